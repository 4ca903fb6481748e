//! `kagome inspect linkage.obj`: what a linkage is like, and how it can move.

use std::path::Path;

use super::inspect::InspectArgs;
use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::base::units::short;
use crate::job::LinkageFigures;
use crate::linkage::read_obj;
use crate::rationalize::{MOST_MOTIONS, Motion, motions_obj, softest};

/// A hinge cannot open farther.
const FULLY_OPEN: f64 = 2.0;

/// Reads a linkage from the bytes of its file and prints its figures.
///
/// # Errors
/// [`Failure::Bad`] if it is broken, with what is wrong and what to do, or if an option is for surfaces.
pub(super) fn run(
    bytes: &[u8],
    args: &InspectArgs,
    global: &Global,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let name = &args.surface.surface;
    let foreign = args.for_surfaces();
    if !foreign.is_empty() {
        return Err(Failure::Bad(format!(
            "{name} is a linkage, in millimetres: {} is for surfaces",
            foreign.join(", ")
        )));
    }
    let sigma = args.size.sigma.unwrap_or(FULLY_OPEN);
    if !(1.0..=FULLY_OPEN).contains(&sigma) {
        return Err(Failure::Bad(format!(
            "--sigma {sigma} cannot be used: hinges open from 1 (closed) to 2 (fully open)"
        )));
    }
    let wanted = args.motions.unwrap_or(0);
    if args.motions == Some(0) || wanted > MOST_MOTIONS {
        return Err(Failure::Bad(format!(
            "--motions {wanted} cannot be used: 1 to {MOST_MOTIONS} can"
        )));
    }
    if let Some(path) = &args.output {
        check_output(path, wanted)?;
    }
    let (linkage, positions) = read_obj(bytes, name).map_err(Failure::bad)?;
    let figures =
        LinkageFigures::of(&linkage, &positions, sigma, terminal).map_err(Failure::bad)?;
    let motions = softest(&linkage, &positions, wanted, terminal).map_err(Failure::bad)?;
    if let Some(path) = &args.output {
        let text = motions_obj(&linkage, &positions, &motions);
        write_file(path, text.as_bytes()).map_err(Failure::bad)?;
    }
    terminal.clear();
    if global.json {
        let mut result = serde_json::json!({ "linkage": name, "figures": figures });
        if args.motions.is_some() {
            result["motions"] = serde_json::json!(motions);
        }
        return print(&format!("{result:#}"));
    }
    let mut lines = vec![format!("{name}: a linkage of rigid triangles")];
    let say = |(what, value): (&str, String)| format!("  {what:<16}{value}");
    lines.extend(figures.summary().into_iter().map(say));
    lines.push(figures.answer());
    if args.motions.is_some() {
        lines.push("The softest motions, if all hinges resist turning alike:".into());
        lines.extend(motions.iter().enumerate().map(one_line));
    }
    print(&lines.join("\n"))
}

/// The motions go into an OBJ, and only if some are asked for.
fn check_output(path: &Path, wanted: usize) -> Result<(), Failure> {
    if wanted == 0 {
        return Err(Failure::Bad(
            "-o matters for a linkage only with --motions N".into(),
        ));
    }
    match path.extension() {
        Some(ending) if ending.eq_ignore_ascii_case("obj") => Ok(()),
        _ => Err(Failure::Bad(format!(
            "-o {}: the name must end in .obj",
            path.display()
        ))),
    }
}

fn one_line((n, motion): (usize, &Motion)) -> String {
    let [x, y, z] = motion.at_mm.map(|x| short(x, 1));
    format!(
        "  {:<3} farthest at vertex {} ({x}, {y}, {z}) mm, {:.0} % of the points at least half as far; 1 mm there turns hinges by {:.3}° rms, {:.3}° at most",
        n + 1,
        motion.point,
        100.0 * motion.moving,
        motion.turn_rms_deg_per_mm,
        motion.turn_max_deg_per_mm
    )
}
