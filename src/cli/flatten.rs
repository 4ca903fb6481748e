//! `kagome flatten`: the conformal map alone, to try cones, darts and rims in no time.

use std::path::{Path, PathBuf};

use clap::Args;

use super::layout_args::{LayoutArgs, SizeArgs};
use super::profiles::{machine_named, material_named};
use super::surface_args::SurfaceArgs;
use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::base::units::short;
use crate::job::{ConeWish, Explored, MapFigures, Request, explore};

/// Arguments of `kagome flatten`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome flatten scan.obj --size 250
  kagome flatten scan.obj --size 250 --cone v1200 --cone 0,12.5,80:-1 -o map.html
  kagome flatten sample:vase --hem 1 --turning 0 --sigma 1.4
  kagome flatten sample:mask --propose -o design.toml

Without --cone and --propose it is the map without cones. What is found is asked for again by the same arguments, here and
at `kagome make`.")]
pub struct FlattenArgs {
    #[command(flatten)]
    surface: SurfaceArgs,
    /// Write the best map: a page with pictures (.html), the surface with its layout (.obj), or a design for
    /// `kagome make` (.toml)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Search for cones and turnings, as `kagome make` does
    #[arg(long)]
    propose: bool,
    #[command(flatten)]
    size: SizeArgs,
    /// Machine profile that a design is written for, by name or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::machine::DEFAULT)]
    machine: String,
    #[command(flatten)]
    layout: LayoutArgs,
}

/// Maps a surface and prints the figures.
///
/// # Errors
/// [`Failure::Bad`] for input that cannot be used, or a file that cannot be written.
pub fn run(args: &FlattenArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let form = args.output.as_deref().map(form_of).transpose()?;
    let request = Request {
        import: args.surface.options(),
        material: material_named(&args.size.material).map_err(Failure::bad)?,
        machine: machine_named(&args.machine).map_err(Failure::bad)?,
        sigma: args.size.sigma,
        confidence: args.size.confidence,
        sizing: args.size.sizing(),
        cones: args.layout.cones()?,
        darts: args.layout.darts()?,
        turnings: args.layout.turnings()?,
        straight: args.layout.hems()?,
        remove_at_cone: args.layout.remove,
        ..Request::new(args.surface.source())
    };
    if args.propose && request.cones != ConeWish::Auto {
        return Err(Failure::Bad(
            "--propose searches for cones: leave out --cone, or --propose".into(),
        ));
    }
    let explored = explore(&request, args.propose, terminal).map_err(Failure::bad)?;
    if let (Some(path), Some(form)) = (&args.output, form) {
        write(&explored, path, form, terminal)?;
    }
    let figures = explored.figures();
    terminal.clear();
    if global.json {
        let result = serde_json::json!({ "surface": args.surface.surface, "maps": figures });
        print(&format!("{result:#}"))
    } else {
        print(&text(&args.surface.surface, &figures))
    }
}

/// What a file is to hold.
#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    /// A page with pictures.
    Page,
    /// The surface with its layout.
    Layout,
    /// A design file.
    Design,
}

/// What a file of this name is to hold.
pub(super) fn form_of(path: &Path) -> Result<Form, Failure> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("html") => Ok(Form::Page),
        Some("obj") => Ok(Form::Layout),
        Some("toml") => Ok(Form::Design),
        _ => Err(Failure::Bad(format!(
            "-o {}: the name must end in .html (a page with pictures), .obj (the surface with its layout) or .toml (a design for `kagome make`)",
            path.display()
        ))),
    }
}

/// Writes the best map.
pub(super) fn write(
    explored: &Explored,
    path: &Path,
    form: Form,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let text = match form {
        Form::Page => explored.html(),
        Form::Layout => explored.obj(),
        Form::Design => explored
            .design(folder, terminal)
            .and_then(|design| design.to_text()),
    };
    let text = text.map_err(Failure::bad)?;
    write_file(path, text.as_bytes()).map_err(Failure::bad)
}

/// The best map in full, then the others.
fn text(name: &str, maps: &[MapFigures]) -> String {
    let Some((best, others)) = maps.split_first() else {
        return String::new();
    };
    let mut lines = vec![format!("{name}: {}", best.answer())];
    let say = |(what, value): (String, String)| format!("  {what:<16}{value}");
    lines.extend(best.summary().into_iter().map(say));
    if let Some(cone) = &best.obvious_cone {
        lines.push(format!(
            "  {:<16}{cone}, or --propose to search for cones",
            "try"
        ));
    }
    if !others.is_empty() {
        lines.push("Others:".into());
        lines.extend(others.iter().map(one_line));
    }
    lines.join("\n")
}

/// A map in one line, and its arguments in a second.
pub(super) fn one_line(map: &MapFigures) -> String {
    format!(
        "  λ {} to {}, misfit {} L{}; cones: {}\n    {}",
        short(map.lambda_min, 3),
        short(map.lambda_max, 3),
        short(map.misfit_in_l, 3),
        if map.suffices { ", σ suffices" } else { "" },
        map.cones_in_words(),
        map.command_line()
    )
}
