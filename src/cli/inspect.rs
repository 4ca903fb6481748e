//! `kagome inspect`: what a surface is like, and what had to be mended. A linkage is told from a surface by its content.

use std::path::PathBuf;

use clap::Args;

use super::flatten::{form_of, one_line, write};
use super::layout_args::SizeArgs;
use super::profiles::material_named;
use super::surface_args::SurfaceArgs;
use super::{Failure, Global, Terminal, inspect_linkage, print};
use crate::job::{MapFigures, Request, explore};
use crate::linkage::is_linkage;
use crate::mesh::Import;
use crate::mesh::check::Inspection;
use crate::mesh::units::Unit;

/// Arguments of `kagome inspect`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome inspect scan.obj
  kagome inspect scan.stl --unit in
  kagome inspect statue.ply --size 300 --part largest --json
  kagome inspect sample:torus:t=3
  kagome inspect scan.obj --size 250 --propose
  kagome inspect scan-sheet/linkage.obj --sigma 1.6
  kagome inspect scan-sheet/linkage.obj --motions 4 -o motions.obj")]
pub struct InspectArgs {
    #[command(flatten)]
    pub(super) surface: SurfaceArgs,
    /// Also say what stretch it needs without cones, and which cones and turnings would need less
    #[arg(long)]
    propose: bool,
    /// Write the best proposal: a page with pictures (.html), the surface with its layout (.obj), or a design for
    /// `kagome make` (.toml); with --motions, the linkage at rest and in each motion, as objects of one file (.obj)
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Option<PathBuf>,
    /// Of a linkage: also the N softest ways in which it gives way, if its hinges resist turning alike
    #[arg(long, value_name = "N")]
    pub(super) motions: Option<usize>,
    #[command(flatten)]
    pub(super) size: SizeArgs,
}

impl InspectArgs {
    /// Those that were given and say nothing of a linkage, by name.
    pub(super) fn for_surfaces(&self) -> Vec<&'static str> {
        let surface = &self.surface;
        let mut given: Vec<&'static str> = [
            (surface.unit != Unit::default(), "--unit"),
            (surface.scale != 1.0, "--scale"),
            (surface.size.is_some(), "--size"),
            (surface.part.is_some(), "--part"),
            (self.propose, "--propose"),
        ]
        .into_iter()
        .filter_map(|(given, name)| given.then_some(name))
        .collect();
        given.extend(self.size.given().into_iter().filter(|n| *n != "--sigma"));
        given
    }
}

/// Reads a surface and prints its figures.
///
/// # Errors
/// [`Failure::Bad`] if it is no surface, or cannot be mapped, with what is wrong and what to do.
pub fn run(args: &InspectArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    if !args.surface.surface.starts_with("sample:")
        && let Ok(bytes) = std::fs::read(&args.surface.surface)
        && is_linkage(&bytes)
    {
        return inspect_linkage::run(&bytes, args, global, terminal);
    }
    if args.motions.is_some() {
        return Err(Failure::Bad(format!(
            "--motions is for a linkage (linkage.obj), and {} is a surface",
            args.surface.surface
        )));
    }
    if args.output.is_some() && !args.propose {
        return Err(Failure::Bad("-o matters only with --propose".into()));
    }
    if !args.propose && !args.size.given().is_empty() {
        return Err(Failure::Bad(format!(
            "{} matters only with --propose",
            args.size.given().join(", ")
        )));
    }
    let form = args.output.as_deref().map(form_of).transpose()?;
    let import = args.surface.load()?;
    let found = Inspection::of(&import.surface);
    let mut proposed = None;
    if args.propose {
        let request = Request {
            import: args.surface.options(),
            material: material_named(&args.size.material).map_err(Failure::bad)?,
            sigma: args.size.sigma,
            confidence: args.size.confidence,
            sizing: args.size.sizing(),
            ..Request::new(args.surface.source())
        };
        let explored = explore(&request, true, terminal).map_err(Failure::bad)?;
        if let (Some(path), Some(form)) = (&args.output, form) {
            write(&explored, path, form, terminal)?;
        }
        proposed = Some(explored.figures());
        terminal.clear();
    }
    if global.json {
        let mut result = serde_json::json!({
            "surface": args.surface.surface,
            "import": import.report,
            "repairs": import.report.repairs(),
            "kind": found.kind(),
            "figures": found,
        });
        if let Some(maps) = proposed {
            result["maps"] = serde_json::json!(maps);
        }
        print(&format!("{result:#}"))
    } else {
        let mut all = text(&args.surface.surface, &import, &found);
        if let Some(maps) = proposed {
            all += &proposals(&maps);
        }
        print(&all)
    }
}

/// The stretch without cones, then the sets that were proposed, the most promising first, with the arguments that ask
/// for them.
fn proposals(maps: &[MapFigures]) -> String {
    let mut lines = Vec::new();
    let plain = maps.iter().find(|m| m.cones.is_empty());
    lines.push(match plain {
        Some(plain) => format!("Without cones: {}.", plain.answer()),
        None => "There is no map without cones.".into(),
    });
    if maps.len() == 1 && plain.is_some_and(|p| p.suffices) {
        lines.push("No cones are needed:".into());
    } else {
        lines.push("Maps, the most promising first, with the arguments for `kagome flatten` and `kagome make`:".into());
    }
    lines.extend(maps.iter().map(one_line));
    lines.join("\n")
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
