//! `kagome states`: one linkage opened and closed, state by state.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{Failure, Global, Terminal, print};
use crate::base::units::short;
use crate::job::{Opening, StateFiles};
use crate::linkage::{Linkage, read_obj};
use crate::rationalize::{Soundness, StatePath, check_same, opening_path, path_between};

/// Options of `kagome states`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome states vase-kagome/linkage.obj --to closed
  kagome states linkage.obj --from closed --to 1.6 --steps 24 -o lamp
  kagome states linkage.obj --to 50%
  kagome states open.obj pinched.obj --steps 20

An OPENING is the mean scale factor λ over the hinges (1 closed, 2 fully open), a percentage of what the file is open
(0% closed, 100% as in the file), or current, closed or open: closed and open go as far as the triangles permit.
Written are state-000.obj and so on, each a linkage.obj with exact edges; states.glb, which viewers and Blender play;
and states.json with the openings, how much light passes, edges and overlaps of every state.")]
pub struct StatesArgs {
    /// A linkage.obj
    linkage: PathBuf,
    /// Another state of the same linkage: the path goes from the first to this one
    #[arg(conflicts_with_all = ["from", "to"])]
    other: Option<PathBuf>,
    /// Mean opening at the beginning
    #[arg(long, value_name = "OPENING", default_value = "current")]
    from: Opening,
    /// Mean opening at the end
    #[arg(long, value_name = "OPENING", required_unless_present = "other")]
    to: Option<Opening>,
    /// Steps from the first state to the last
    #[arg(long, value_name = "N", default_value_t = 10)]
    steps: usize,
    /// Largest scale factor of a hinge, 1 to 2
    #[arg(long, value_name = "S", default_value_t = 2.0)]
    sigma: f64,
    /// Folder for the results [default: named after the linkage]
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Replace results of an earlier run
    #[arg(long)]
    force: bool,
}

/// Finds the states and writes them.
///
/// # Errors
/// [`Failure::Bad`] for input that cannot be used, with nothing written; [`Failure::No`], after all is written, if an
/// opening was not reached or a state is not sound.
pub fn run(args: &StatesArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let folder = args
        .output
        .clone()
        .unwrap_or_else(|| default_folder(&args.linkage));
    StateFiles::check(&folder, args.force).map_err(Failure::bad)?;
    let (linkage, start) = read(&args.linkage)?;
    let name = args.linkage.display();
    let (sigma, steps) = (args.sigma, args.steps);
    let bad = |error| Failure::Bad(format!("{name}: {error}"));
    let mut asked = None;
    let path = match (&args.other, args.to) {
        (Some(other), _) => {
            let (second, end) = read(other)?;
            check_same(&linkage, &second)
                .map_err(|e| Failure::Bad(format!("{name}, {}: {e}", other.display())))?;
            path_between(&linkage, [&start, &end], steps, sigma, terminal)
        }
        (None, Some(to)) => {
            let current = Soundness::measure(&linkage, &start, sigma).opening[1];
            let ends = [args.from, to];
            asked = Some(ends);
            let means = ends.map(|o| o.mean(current, sigma));
            opening_path(&linkage, &start, means, steps, sigma, terminal)
        }
        (None, None) => {
            return Err(Failure::Bad(
                "--to OPENING is missing, or a second file".into(),
            ));
        }
    }
    .map_err(bad)?;
    let Some(files) = StateFiles::new(&linkage, &path, sigma) else {
        return Err(Failure::Bad(format!(
            "{name}: so many states do not fit into one glTF file; take fewer --steps"
        )));
    };
    files.write(&folder, args.force).map_err(Failure::bad)?;
    terminal.clear();
    if global.json {
        print(&format!("{:#}", files.figures))?;
    } else if !global.quiet {
        print(&text(&files, &folder))?;
    }
    judge(&files, &path, asked)
}

fn read(path: &Path) -> Result<(Linkage, Vec<nalgebra::Point3<f64>>), Failure> {
    let name = path.display().to_string();
    let bytes =
        std::fs::read(path).map_err(|e| Failure::Bad(format!("cannot read {name}: {e}")))?;
    read_obj(&bytes, &name).map_err(Failure::bad)
}

/// Where the results go unless told: beside the caller, named after the file.
fn default_folder(linkage: &Path) -> PathBuf {
    let stem = linkage
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned());
    PathBuf::from(format!(
        "{}-states",
        stem.unwrap_or_else(|| "linkage".into())
    ))
}

fn text(files: &StateFiles, folder: &Path) -> String {
    let mut lines: Vec<String> = files
        .states
        .iter()
        .map(|s| format!("{}  {}", s.file, s.line()))
        .collect();
    lines.push(format!(
        "Written to {}; states.glb plays them",
        folder.display()
    ));
    lines.join("\n")
}

/// Whether all is as it was asked for.
fn judge(files: &StateFiles, path: &StatePath, asked: Option<[Opening; 2]>) -> Result<(), Failure> {
    let mut reasons = Vec::new();
    let ends = [files.states.first(), files.states.last()];
    for (k, what) in ["--from", "--to"].into_iter().enumerate() {
        if let Some(asked) = asked
            && !path.reached[k]
            && !asked[k].as_far_as_it_goes()
            && let Some(state) = ends[k]
        {
            reasons.push(format!(
                "the opening that {what} asks for is not within reach without overlaps: the nearest mean opening is {}",
                short(state.opening[1], 4)
            ));
        }
    }
    for state in files.states.iter().filter(|s| !s.sound) {
        reasons.push(format!("{} is not sound: {}", state.file, state.line()));
    }
    if reasons.is_empty() {
        return Ok(());
    }
    Err(Failure::No(reasons.join("\n  - ")))
}
