//! `kagome inspect`: what a surface is like, and what had to be mended.

use clap::Args;

use super::surface_args::SurfaceArgs;
use super::{Failure, Global, Terminal, print};
use crate::mesh::Import;
use crate::mesh::check::Inspection;

/// Arguments of `kagome inspect`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome inspect scan.obj
  kagome inspect scan.stl --unit in
  kagome inspect statue.ply --size 300 --part largest --json
  kagome inspect sample:torus:t=3")]
pub struct InspectArgs {
    #[command(flatten)]
    surface: SurfaceArgs,
}

/// Reads a surface and prints its figures.
///
/// # Errors
/// [`Failure::Bad`] if it is no surface, with what is wrong and what to do.
pub fn run(args: &InspectArgs, global: &Global, _terminal: &Terminal) -> Result<(), Failure> {
    let import = args.surface.load()?;
    let found = Inspection::of(&import.surface);
    if global.json {
        let result = serde_json::json!({
            "surface": args.surface.surface,
            "import": import.report,
            "repairs": import.report.repairs(),
            "kind": found.kind(),
            "figures": found,
        });
        print(&format!("{result:#}"))
    } else {
        print(&text(&args.surface.surface, &import, &found))
    }
}

fn text(name: &str, import: &Import, found: &Inspection) -> String {
    let report = &import.report;
    let mut lines = vec![format!("{name} ({}): {}", report.format, found.kind())];
    let mut say = |what: &str, value: String| lines.push(format!("  {what:<16}{value}"));
    say(
        "size",
        format!(
            "{:.1} × {:.1} × {:.1} mm ({} mm for each unit of the file)",
            found.box_mm[0], found.box_mm[1], found.box_mm[2], report.mm_per_unit
        ),
    );
    say("area", format!("{:.1} cm²", found.area_mm2 / 100.0));
    say(
        "mesh",
        format!(
            "{} vertices, {} edges, {} faces; Euler characteristic {}",
            found.vertices, found.edges, found.faces, found.euler_characteristic
        ),
    );
    if let Some(genus) = found.genus {
        say("handles", genus.to_string());
    }
    for (i, rim) in found.rims.iter().enumerate() {
        say(
            &format!("rim {}", i + 1),
            format!(
                "{} vertices, {:.1} mm long, turning {:.1}°",
                rim.vertices, rim.length_mm, rim.turning_deg
            ),
        );
    }
    say(
        "edges",
        format!(
            "{:.3} to {:.3} mm, {:.3} mm in the mean",
            found.edge_mm[0], found.edge_mm[2], found.edge_mm[1]
        ),
    );
    say(
        "curvature",
        format!("{:.1}° in all", found.total_curvature_deg),
    );
    let worst = &found.worst_face;
    say(
        "worst triangle",
        format!(
            "quality {:.3} (1 is equilateral) near {:.1}, {:.1}, {:.1}; smallest angle {:.2}°",
            worst.quality, worst.at_mm[0], worst.at_mm[1], worst.at_mm[2], found.least_angle_deg
        ),
    );
    let repairs = report.repairs();
    if repairs.is_empty() {
        say("repairs", "none needed".into());
    }
    for line in repairs {
        say("repaired", line);
    }
    lines.push(String::new());
    lines.join("\n")
}
