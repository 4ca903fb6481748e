//! `kagome cut`: G-code from a drawing, as `make` wrote it or edited since.

use std::path::{Path, PathBuf};

use clap::Args;

use super::profiles::{machine_named, material_named};
use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::base::units::short;
use crate::job::{MakeError, cut_drawing};

/// Arguments of `kagome cut`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome cut mask/pattern.svg --force
  kagome cut edited.svg --machine diode-400 --material plywood-3 -o edited.nc

Slits and contours may be moved, deleted and added in a drawing program: a slit is one straight line from the point where
its star begins to its hinge. Hinge width, kerf and the shapes of tips and corners are those of the drawing. The job is
verified against the drawing as it is now and rehearsed, as `kagome make` does. Where the drawing was moved (--place), or another
one lies beside the job, the drawing that was cut is written beside it as an SVG of the job's name.")]
pub struct CutArgs {
    /// The drawing (SVG)
    drawing: PathBuf,
    /// Machine profile, by name (see `kagome machines list`) or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::machine::DEFAULT)]
    machine: String,
    /// Material profile, by name (see `kagome materials list`) or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::material::DEFAULT)]
    material: String,
    /// Move the drawing into the corner of the bed
    #[arg(long)]
    place: bool,
    /// The job [default: beside the drawing, job.nc for pattern.svg, else of the drawing's name]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Replace a job that is there already
    #[arg(long)]
    force: bool,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure::No`] if the job that was made is not good, [`Failure::Bad`] for a drawing or profiles that cannot be used;
/// nothing is written then.
pub fn run(args: &CutArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let output = args.output.clone().unwrap_or_else(|| job_of(&args.drawing));
    let beside = output.with_extension("svg");
    // `verify` and `send` must find the drawing that was cut.
    let found = drawing_of(&output).is_some_and(|d| same(&d, &args.drawing));
    let copy = args.place || !found;
    if args.place && same(&beside, &args.drawing) {
        return Err(Failure::Bad(format!(
            "the moved drawing would be written over {}; give the job another name (-o)",
            args.drawing.display()
        )));
    }
    let mut written = vec![&output];
    written.extend(copy.then_some(&beside));
    if let Some(there) = written.iter().find(|p| p.exists()).filter(|_| !args.force) {
        return Err(Failure::Bad(format!(
            "{} exists already; add --force to replace it, or choose another place with -o",
            there.display()
        )));
    }
    let text = std::fs::read_to_string(&args.drawing)
        .map_err(|e| Failure::Bad(format!("{} cannot be read: {e}", args.drawing.display())))?;
    let machine = machine_named(&args.machine).map_err(Failure::bad)?;
    let material = material_named(&args.material).map_err(Failure::bad)?;
    let result = cut_drawing(&text, &machine, &material, args.place, terminal);
    let made = result.map_err(|error| match error {
        MakeError::Drawing(e) => Failure::Bad(format!("{}: {e}", args.drawing.display())),
        other => Failure::bad(other),
    })?;
    terminal.clear();
    if !global.quiet {
        for warning in &made.warnings {
            eprintln!("warning: {warning}");
        }
    }
    if !made.objections.is_empty() {
        return Err(Failure::No(format!(
            "{} cannot be cut as it is drawn; there is no job\n  - {}",
            args.drawing.display(),
            made.objections.join("\n  - ")
        )));
    }
    if copy {
        write_file(&beside, made.drawing.as_bytes()).map_err(Failure::bad)?;
    }
    write_file(&output, made.gcode.as_bytes()).map_err(Failure::bad)?;
    if global.json {
        let result = serde_json::json!({
            "drawing": args.drawing,
            "written": output,
            "warnings": made.warnings,
            "figures": made.figures,
        });
        return print(&format!("{result:#}"));
    }
    if global.quiet {
        return Ok(());
    }
    let number = |key: &str| made.figures[key].as_f64().unwrap_or(0.0);
    print(&format!(
        "{}: {} strokes, {} mm cut, {} mm travelled, {} s; verified and rehearsed\n  kagome send {} --port PORT",
        output.display(),
        short(number("strokes"), 0),
        short(number("cut_length_mm"), 1),
        short(number("travel_mm"), 1),
        short(number("machine_s"), 0),
        output.display()
    ))
}

/// Where the job of a drawing goes.
fn job_of(drawing: &Path) -> PathBuf {
    let name = drawing
        .file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    match name.strip_prefix("pattern") {
        Some(number) if number.is_empty() || number.starts_with('-') => {
            drawing.with_file_name(format!("job{number}.nc"))
        }
        _ => drawing.with_extension("nc"),
    }
}

fn same(a: &Path, b: &Path) -> bool {
    a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// The drawing that belongs to a job, if it is there: one of the same name beside it, else what `make` writes: job.nc goes
/// with pattern.svg, job-2.nc with pattern-2.svg.
pub(super) fn drawing_of(job: &Path) -> Option<PathBuf> {
    let name = job.file_stem()?.to_string_lossy().into_owned();
    let number = name.strip_prefix("job").unwrap_or("");
    [
        job.with_extension("svg"),
        job.with_file_name(format!("pattern{number}.svg")),
        job.with_file_name("pattern.svg"),
    ]
    .into_iter()
    .find(|path| path.is_file())
}
