//! `kagome make`: the main job.

use std::path::{Path, PathBuf};

use clap::Args;

use super::layout_args::{CutArg, LayoutArgs, SizeArgs};
use super::profiles::{machine_named, material_named};
use super::sheet_args::SheetArgs;
use super::surface_args::{SurfaceArgs, source};
use super::{Failure, Global, Terminal, print, print_json};
use crate::base::atomic::check_directory;
use crate::base::progress::Progress as _;
use crate::job::{ACCEPT_DISTANCE, Design, FILES, FlapWish, Made, MakeError, Request, make};
use crate::linkage::Handedness;
use crate::rationalize::Solver;
use crate::{machine, material};

/// Arguments of `kagome make`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome make sample:mask
  kagome make scan.obj --size 220 --material plywood-3 --triangles 2000 -o scan-sheet
  kagome make scan.stl --cone v1200 --remove 16 --sigma 1.6
  kagome make face.obj --also smile.obj --size 250 --triangles 2500
  kagome make scan-sheet/design.toml -o again

SURFACE may be a mesh (OBJ, STL, PLY), sample:NAME (see `kagome samples list`), or a design.toml that an
earlier run wrote; a design brings every decision with it, and only -o, --force and --accept-distance apply.")]
pub struct MakeArgs {
    #[command(flatten)]
    surface: SurfaceArgs,
    /// A further surface that the same sheet is to fit: the same mesh in another shape, which takes the first one's
    /// millimetres per unit; repeatable
    #[arg(long, value_name = "SURFACE")]
    also: Vec<String>,
    /// Directory for the results; it appears complete or not at all [default: the surface's name]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Replace the results of an earlier run
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    size: SizeArgs,
    /// Machine profile, by name (see `kagome machines list`) or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::machine::DEFAULT)]
    machine: String,
    /// Width of the ligaments at the hinges, in place of the material's
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    hinge: Option<f64>,
    /// Width of the cut, in place of the material's
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    kerf: Option<f64>,
    #[command(flatten)]
    sheet: SheetArgs,
    #[command(flatten)]
    layout: LayoutArgs,
    /// A path that the seam follows where it can, past two or more places, X,Y,Z;X,Y,Z or vN;vN; repeatable. A dart opens
    /// the surface; a cut only says where the seam runs that the sheet needs anyway [default: where it shows least]
    #[arg(long = "cut", value_name = "CUT", allow_hyphen_values = true)]
    cuts: Vec<CutArg>,
    /// auto leaves out the few triangles, if any, by which a sheet fails; none keeps all
    #[arg(long, value_enum, default_value_t = LeaveOutArg::Auto)]
    leave_out: LeaveOutArg,
    /// Direction of the lattice in degrees; auto fits it to the seams, without seams along the sheet's X
    #[arg(
        long,
        value_name = "DEG|auto",
        default_value = "auto",
        allow_hyphen_values = true
    )]
    orientation: Orientation,
    /// Which of the two mirror patterns of slits
    #[arg(long, value_enum, default_value_t = PatternArg::Right)]
    pattern: PatternArg,
    /// Cut from the back: the beam strikes the side that will face inwards
    #[arg(long)]
    mirror: bool,
    /// Rows of triangles that are cut twice along the seams, to be glued on the other side
    #[arg(long, value_enum, default_value_t = FlapsArg::Auto)]
    flaps: FlapsArg,
    /// exact, or projection (the paper's method, accelerated: edges give way where the surface is out of reach)
    #[arg(long, value_enum, default_value_t = SolverArg::Exact)]
    solver: SolverArg,
    /// Distance from the surface that is accepted, in triangle edges [default: 0.1]
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    accept_distance: Option<f64>,
}

/// A value of `--orientation`, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Orientation(Option<f64>);

impl std::str::FromStr for Orientation {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self(None));
        }
        match text.parse::<f64>() {
            Ok(deg) if deg.abs() <= 360.0 => Ok(Self(Some(deg))),
            _ => Err(format!(
                "{text:?} is not auto or an angle in degrees between -360 and 360"
            )),
        }
    }
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum LeaveOutArg {
    Auto,
    None,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum PatternArg {
    /// Triangles that point up are counter-clockwise slit cycles
    Right,
    /// Its mirror image
    Left,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum FlapsArg {
    /// Wherever there is room for them on the sheet
    Auto,
    /// No flaps: seams are joined edge to edge
    None,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum SolverArg {
    Exact,
    Projection,
}

/// Makes everything and writes it.
///
/// # Errors
/// [`Failure::Bad`] for input that cannot be used, with nothing written; [`Failure::No`] if the surface cannot be
/// made, with the reasons, after layout, linkage and report are written.
pub fn run(args: &MakeArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let name = &args.surface.surface;
    let is_design = Path::new(name)
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let folder = args
        .output
        .clone()
        .unwrap_or_else(|| default_folder(name, is_design));
    // Before any work: a place that cannot be written to would waste all of it.
    check_directory(&folder, &FILES, args.force).map_err(Failure::bad)?;
    let request = if is_design {
        from_design(args)?
    } else {
        from_arguments(args)?
    };
    let made = make(&request, &folder, terminal).map_err(|error| match error {
        MakeError::Interrupted(_) => Failure::bad(error),
        _ => Failure::Bad(error.to_string()),
    })?;
    made.write(&folder, args.force).map_err(Failure::bad)?;
    terminal.clear();
    if global.json {
        print_json(&made.figures)?;
    } else if !global.quiet {
        print(&text(&made, &folder))?;
        if made.verdict.pass && lacks_price(&request.material) {
            terminal.note(&format!(
                "with price_per_m2 and currency in {} the report would say what the sheet costs",
                request.material
            ));
        }
    }
    if made.verdict.pass {
        Ok(())
    } else {
        Err(Failure::No(format!(
            "this surface cannot be made as asked; there is no job. See {}\n  - {}",
            folder.join("report.html").display(),
            made.verdict
                .reasons
                .iter()
                .map(|r| r.text.as_str())
                .collect::<Vec<_>>()
                .join("\n  - ")
        )))
    }
}

/// Whether a material is the maker's own, and has no price: a shipped one is the same for all, and can have none.
fn lacks_price(name: &str) -> bool {
    let shipped = material::shipped().any(|(shipped, _)| shipped == name);
    !shipped && material::load(name).is_ok_and(|m| m.price_per_m2.is_none())
}

/// Options that a design file decides for itself.
fn decided_by_design(args: &MakeArgs) -> Vec<&'static str> {
    let own = [
        (args.machine != crate::machine::DEFAULT, "--machine"),
        (args.hinge.is_some(), "--hinge"),
        (args.kerf.is_some(), "--kerf"),
        (!args.also.is_empty(), "--also"),
        (!args.cuts.is_empty(), "--cut"),
        (matches!(args.leave_out, LeaveOutArg::None), "--leave-out"),
        (args.orientation.0.is_some(), "--orientation"),
        (matches!(args.pattern, PatternArg::Left), "--pattern"),
        (args.mirror, "--mirror"),
        (matches!(args.flaps, FlapsArg::None), "--flaps"),
        (matches!(args.solver, SolverArg::Projection), "--solver"),
        (args.surface.size.is_some(), "--size"),
        (args.surface.scale != 1.0, "--scale"),
        (args.surface.part.is_some(), "--part"),
    ]
    .into_iter()
    .filter_map(|(given, name)| given.then_some(name));
    let shared = args
        .size
        .given()
        .into_iter()
        .chain(args.layout.given())
        .chain(args.sheet.given());
    shared.chain(own).collect()
}

fn from_design(args: &MakeArgs) -> Result<Request, Failure> {
    let ignored = decided_by_design(args);
    if !ignored.is_empty() {
        return Err(Failure::Bad(format!(
            "{} cannot be given with a design file, which decides it: edit {} instead",
            ignored.join(", "),
            args.surface.surface
        )));
    }
    let path = Path::new(&args.surface.surface);
    let text = std::fs::read_to_string(path)
        .map_err(|e| Failure::Bad(format!("cannot read {}: {e}", path.display())))?;
    let design = Design::parse(&args.surface.surface, &text).map_err(Failure::bad)?;
    let mut request = design.request(path.parent().unwrap_or(Path::new("")));
    // Own profiles are noted down by their files: a shipped name in a design is the shipped one, whatever hides it here.
    if !material::shipped().any(|(name, _)| name == request.material) {
        request.material = material_named(&request.material).map_err(Failure::bad)?;
    }
    if !machine::shipped().any(|(name, _)| name == request.machine) {
        request.machine = machine_named(&request.machine).map_err(Failure::bad)?;
    }
    if let Some(distance) = args.accept_distance {
        request.accept_distance = distance;
    }
    Ok(request)
}

fn from_arguments(args: &MakeArgs) -> Result<Request, Failure> {
    Ok(Request {
        source: args.surface.source(),
        also: args.also.iter().map(|name| source(name)).collect(),
        shares: None,
        import: args.surface.options(),
        material: material_named(&args.size.material).map_err(Failure::bad)?,
        machine: machine_named(&args.machine).map_err(Failure::bad)?,
        sigma: args.size.sigma,
        confidence: args.size.confidence,
        hinge_width_mm: args.hinge,
        kerf_mm: args.kerf,
        mirror: args.mirror,
        sheet: args.sheet.wish(),
        sizing: args.size.sizing(),
        cones: args.layout.cones()?,
        darts: args.layout.darts()?,
        cuts: args.cuts.iter().map(|c| c.0.clone()).collect(),
        left_out: match args.leave_out {
            LeaveOutArg::Auto => None,
            LeaveOutArg::None => Some(Vec::new()),
        },
        turnings: args.layout.turnings()?,
        straight: args.layout.hems()?,
        orientation_deg: args.orientation.0,
        handedness: match args.pattern {
            PatternArg::Right => Handedness::Right,
            PatternArg::Left => Handedness::Left,
        },
        remove_at_cone: args.layout.remove,
        flaps: match args.flaps {
            FlapsArg::Auto => FlapWish::Auto,
            FlapsArg::None => FlapWish::None,
        },
        solver: match args.solver {
            SolverArg::Exact => Solver::Exact,
            SolverArg::Projection => Solver::Projection,
        },
        accept_distance: args.accept_distance.unwrap_or(ACCEPT_DISTANCE),
    })
}

/// Where the results go unless told: beside the caller, named after the surface.
fn default_folder(name: &str, is_design: bool) -> PathBuf {
    if is_design {
        // Made again where it lies: --force says that this is meant.
        let parent = Path::new(name).parent().unwrap_or(Path::new(""));
        return if parent.as_os_str().is_empty() {
            PathBuf::from("remade")
        } else {
            parent.to_path_buf()
        };
    }
    let stem = match name.strip_prefix("sample:") {
        Some(sample) => sample.split(':').next().unwrap_or(sample).to_owned(),
        None => Path::new(name)
            .file_stem()
            .map_or_else(|| "sheet".into(), |s| s.to_string_lossy().into_owned()),
    };
    PathBuf::from(format!("{stem}-kagome"))
}

fn text(made: &Made, folder: &Path) -> String {
    let mut lines = Vec::new();
    let width = made
        .summary
        .iter()
        .map(|(k, _)| k.chars().count())
        .max()
        .unwrap_or(0);
    for (key, value) in &made.summary {
        lines.push(format!("{key:width$}  {value}"));
    }
    for warning in &made.warnings {
        lines.push(format!("warning: {warning}"));
    }
    if made.verdict.pass {
        let job = folder.join("job.nc");
        lines.push(format!(
            "Written to {}; open report.html first, then:",
            folder.display()
        ));
        lines.push(if made.streamed {
            format!("  kagome send {} --port PORT", job.display())
        } else {
            format!("  load {} at the machine's own controller", job.display())
        });
    }
    lines.join("\n") + "\n"
}
