//! `kagome pose`: a linkage moved by handles, edges exact in the end.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::base::document::Document;
use crate::base::progress::Progress as _;
use crate::base::units::short;
use crate::job::EDGE_TOLERANCE;
use crate::linkage::{read_obj, write_obj};
use crate::mesh::{ClosestPoint, ImportOptions, import_file};
use crate::rationalize::pose::Pose;
use crate::rationalize::{SIGMA_TOLERANCE, Soundness};

/// Weight with which a surface draws the points: the paper's final w₁.
const CLOSENESS: f64 = 0.1;

/// A bound on hinges where the file gives none: they are open at 2.
const FULLY_OPEN: f64 = 2.0;

/// Arguments of `kagome pose`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example:
  kagome pose lamp/linkage.obj --handles lamp.toml -o posed.obj

A handle file, in millimetres; points are numbered as in the linkage:
  format = 1
  sigma = 1.9
  [[pin]]
  group = \"rim\"              # the corners that hang on no hinge
  [[keyframe]]
  [[keyframe.handle]]
  near_mm = [0, 0, 100]       # the point nearest to it, or point = 118
  by_mm = [0, 0, 25]          # or to_mm = [x, y, z]
  weight = 5                  # softly; without it exactly")]
pub struct PoseArgs {
    /// The linkage, as `make` writes it
    linkage: PathBuf,
    /// What to hold and where to move it (TOML)
    #[arg(long, value_name = "FILE")]
    handles: PathBuf,
    /// A surface that also draws the points, in millimetres (layout.obj of the same folder, for example)
    #[arg(long, value_name = "SURFACE")]
    target: Option<PathBuf>,
    /// Where the posed linkage goes
    #[arg(short, long, value_name = "FILE", default_value = "posed.obj")]
    output: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure::No`] if the pose cannot be reached with exact edges and no overlap (it is written all the same),
/// [`Failure::Bad`] for files that cannot be used: nothing is written.
pub fn run(args: &PoseArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let read = |path: &PathBuf| {
        std::fs::read(path)
            .map_err(|e| Failure::Bad(format!("{} cannot be read: {e}", path.display())))
    };
    let name = args.linkage.display().to_string();
    let (linkage, start) = read_obj(&read(&args.linkage)?, &name).map_err(Failure::bad)?;
    let handles = args.handles.display().to_string();
    let text = String::from_utf8(read(&args.handles)?)
        .map_err(|_| Failure::Bad(format!("{handles} is not UTF-8 text")))?;
    let document = Document::new(handles, text);
    let pose = Pose::read(&document, &linkage, &start).map_err(Failure::bad)?;
    let sigma = pose.sigma().unwrap_or(FULLY_OPEN);
    let before = Soundness::measure(&linkage, &start, sigma);
    if before.opening[2] > sigma + SIGMA_TOLERANCE {
        return Err(Failure::Bad(format!(
            "{}: sigma = {}, but a hinge of the linkage is open to {} already (point {}): give that at least, or close the linkage first (kagome states)",
            args.handles.display(),
            short(sigma, 3),
            short(before.opening[2], 3),
            before.opening_max.point,
        )));
    }
    let target = match &args.target {
        None => None,
        Some(path) => {
            let import = import_file(path, &ImportOptions::default()).map_err(Failure::bad)?;
            Some((Arc::new(ClosestPoint::new(&import.surface)), CLOSENESS))
        }
    };
    terminal.start("posing", None);
    let (positions, effort) = pose
        .exact(&linkage, &start, target, terminal)
        .map_err(Failure::bad)?;
    let sound = Soundness::measure(&linkage, &positions, sigma);
    write_file(&args.output, write_obj(&linkage, &positions).as_bytes()).map_err(Failure::bad)?;
    terminal.clear();
    let moved: Vec<f64> = positions
        .iter()
        .zip(&start)
        .map(|(a, b)| (a - b).norm())
        .collect();
    let farthest = moved.iter().fold(0.0f64, |m, d| m.max(*d));
    if global.json {
        let result = serde_json::json!({
            "linkage": name,
            "written": args.output,
            "moved_mm": farthest,
            "figures": sound,
            "steps": effort.steps,
        });
        print(&format!("{result:#}"))?;
    } else {
        print(&format!(
            "{}: posed; the farthest point moved by {} mm, hinges open from {} to {}, edges are exact to {:.0e}",
            args.output.display(),
            short(farthest, 2),
            short(sound.opening[0], 3),
            short(sound.opening[2], 3),
            sound.edge_error_max,
        ))?;
    }
    let mut reasons = Vec::new();
    if sound.edge_error_max > EDGE_TOLERANCE {
        reasons.push(format!(
            "the handles pull triangles out of shape, edges by up to {:.1e} of their length: hold fewer points exactly (give them a weight), or move them less",
            sound.edge_error_max
        ));
    }
    if sound.over_sigma > 0 {
        reasons.push(format!(
            "{} hinges open beyond σ = {} (point {} to {}): move the handles less",
            sound.over_sigma,
            short(sigma, 3),
            sound.opening_max.point,
            short(sound.opening[2], 3),
        ));
    }
    if sound.penetrations + sound.intersections > 0 {
        let at = sound.intersection_at.unwrap_or(sound.penetration_depth);
        reasons.push(format!(
            "{} pairs of triangles run into each other, one at point {}: move the handles less, or raise smoothness",
            sound.penetrations + sound.intersections,
            at.point,
        ));
    }
    if reasons.is_empty() {
        Ok(())
    } else {
        Err(Failure::No(reasons.join("\n    ")))
    }
}
