//! `kagome make`: the main job.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use super::surface_args::SurfaceArgs;
use super::{Failure, Global, Terminal, print, print_json};
use crate::base::atomic::check_directory;
use crate::conformal::Sizing;
use crate::job::{
    ACCEPT_DISTANCE, ConePlace, ConeWish, DEFAULT_TRIANGLES, DartWish, Design, FILES, FlapWish,
    Made, MakeError, Request, Source, make,
};
use crate::linkage::Handedness;
use crate::rationalize::Solver;

/// Arguments of `kagome make`.
#[derive(Args, Clone, Debug)]
#[command(
    group = ArgGroup::new("sizing").args(["edge", "triangles"]),
    after_help = "Examples:
  kagome make sample:mask
  kagome make scan.obj --size 220 --material plywood-3 --triangles 2000 -o scan-sheet
  kagome make scan.stl --cone v1200 --remove 16 --sigma 1.6
  kagome make scan-sheet/design.toml -o again

SURFACE may be a mesh (OBJ, STL, PLY), sample:NAME (see `kagome samples list`), or a design.toml that an
earlier run wrote; a design brings every decision with it, and only -o, --force and --accept-distance apply."
)]
pub struct MakeArgs {
    #[command(flatten)]
    surface: SurfaceArgs,
    /// Directory for the results; it appears complete or not at all [default: the surface's name]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Replace the results of an earlier run
    #[arg(long)]
    force: bool,
    /// Triangle edge in millimetres
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    edge: Option<f64>,
    /// Number of triangles wanted, about [default: 1500]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    triangles: Option<f64>,
    /// Material profile, by name (see `kagome materials list`) or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::material::DEFAULT)]
    material: String,
    /// Machine profile, by name (see `kagome machines list`) or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::machine::DEFAULT)]
    machine: String,
    /// Largest stretch, in place of the material's: above 1, at most 2
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    sigma: Option<f64>,
    /// Width of the ligaments at the hinges, in place of the material's
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    hinge: Option<f64>,
    /// Width of the cut, in place of the material's
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    kerf: Option<f64>,
    /// auto, none, a point X,Y,Z or a vertex vN; :K after it is its curvature in units of 120° (1 if absent)
    #[arg(long = "cone", value_name = "CONE", allow_hyphen_values = true)]
    cones: Vec<ConeArg>,
    /// auto, none, or an open cut past two or more places, X,Y,Z;X,Y,Z or vN;vN; repeatable
    #[arg(long = "dart", value_name = "DART", allow_hyphen_values = true)]
    darts: Vec<DartArg>,
    /// A path that the seam follows where it can, past two or more places, X,Y,Z;X,Y,Z or vN;vN; repeatable. A dart opens
    /// the surface; a cut only says where the seam runs that the sheet needs anyway [default: where it shows least]
    #[arg(long = "cut", value_name = "CUT", allow_hyphen_values = true)]
    cuts: Vec<CutArg>,
    /// Triangles to drop at the cone: 4, 16, … [default: 4 at a positive cone, 16 where that fits better]
    #[arg(long, value_name = "N")]
    remove: Option<usize>,
    /// auto leaves out the few triangles, if any, by which a sheet fails; none keeps all
    #[arg(long, value_enum, default_value_t = LeaveOutArg::Auto)]
    leave_out: LeaveOutArg,
    /// How far a rim turns in degrees, a multiple of 120 (-360: a hole in a plane, 0: a tube's end); once for each rim
    /// but the first, as `inspect` lists them [default: what needs least stretch]
    #[arg(long = "turning", value_name = "DEG", allow_hyphen_values = true)]
    turnings: Vec<i32>,
    /// Make this rim a straight hem, by its number in `inspect`: the end of a tube then lies on one line of the sheet,
    /// and the lattice follows it; repeatable
    #[arg(long = "hem", value_name = "N")]
    hems: Vec<u32>,
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
    /// exact, or projection (the paper's method: a preview that rarely passes)
    #[arg(long, value_enum, default_value_t = SolverArg::Exact)]
    solver: SolverArg,
    /// Distance from the surface that is accepted, in triangle edges [default: 0.1]
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    accept_distance: Option<f64>,
}

/// A value of `--cone`.
#[derive(Clone, Debug, PartialEq)]
enum ConeArg {
    Auto,
    None,
    At(ConePlace, i32),
}

impl std::str::FromStr for ConeArg {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let form = || {
            format!(
                "{text:?} is not auto, none, X,Y,Z[:K] or vN[:K], for example 0,12.5,80 or v120:-1"
            )
        };
        match text {
            "auto" => return Ok(Self::Auto),
            "none" => return Ok(Self::None),
            _ => {}
        }
        let (place, units) = match text.split_once(':') {
            Some((place, units)) => (
                place,
                units
                    .trim_start_matches('+')
                    .trim_start_matches('±')
                    .parse()
                    .map_err(|_| form())?,
            ),
            None => (text, 1),
        };
        if let Some(number) = place.strip_prefix('v') {
            return Ok(Self::At(
                ConePlace::Vertex(number.parse().map_err(|_| form())?),
                units,
            ));
        }
        let numbers: Vec<f64> = place
            .split(',')
            .map(|n| n.trim().parse::<f64>().map_err(|_| form()))
            .collect::<Result<_, _>>()?;
        match numbers[..] {
            [x, y, z] if numbers.iter().all(|n| n.is_finite()) => {
                Ok(Self::At(ConePlace::Point([x, y, z]), units))
            }
            _ => Err(form()),
        }
    }
}

/// A value of `--dart`.
#[derive(Clone, Debug, PartialEq)]
enum DartArg {
    Auto,
    None,
    Past(Vec<ConePlace>),
}

impl std::str::FromStr for DartArg {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => return Ok(Self::Auto),
            "none" => return Ok(Self::None),
            _ => {}
        }
        places(text).map(Self::Past).ok_or_else(|| {
            format!(
                "{text:?} is not auto, none, or two or more places, for example \"0,12.5,80;0,60,20\" or \"v12;v905\""
            )
        })
    }
}

/// Two or more places; none if the text is something else.
fn places(text: &str) -> Option<Vec<ConePlace>> {
    let places: Option<Vec<ConePlace>> = text
        .split(';')
        .map(|part| match part.trim().parse() {
            Ok(ConeArg::At(place, _)) if !part.contains(':') => Some(place),
            _ => None,
        })
        .collect();
    places.filter(|places| places.len() > 1)
}

/// A value of `--cut`.
#[derive(Clone, Debug, PartialEq)]
struct CutArg(Vec<ConePlace>);

impl std::str::FromStr for CutArg {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        places(text).map(Self).ok_or_else(|| {
            format!(
                "{text:?} is not two or more places, for example \"0,12.5,80;0,60,20\" or \"v12;v905\""
            )
        })
    }
}

/// The darts that these arguments ask for.
fn dart_wish(args: &[DartArg]) -> Result<DartWish, Failure> {
    match args {
        [] | [DartArg::Auto] => Ok(DartWish::Auto),
        [DartArg::None] => Ok(DartWish::Given(Vec::new())),
        many => many
            .iter()
            .map(|dart| match dart {
                DartArg::Past(places) => Ok(places.clone()),
                _ => Err(Failure::Bad(
                    "--dart auto and --dart none stand alone".to_owned(),
                )),
            })
            .collect::<Result<_, _>>()
            .map(DartWish::Given),
    }
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

/// Options that a design file decides for itself.
fn decided_by_design(args: &MakeArgs) -> Vec<&'static str> {
    [
        (args.edge.is_some(), "--edge"),
        (args.triangles.is_some(), "--triangles"),
        (args.material != crate::material::DEFAULT, "--material"),
        (args.machine != crate::machine::DEFAULT, "--machine"),
        (args.sigma.is_some(), "--sigma"),
        (args.hinge.is_some(), "--hinge"),
        (args.kerf.is_some(), "--kerf"),
        (!args.cones.is_empty(), "--cone"),
        (!args.darts.is_empty(), "--dart"),
        (!args.cuts.is_empty(), "--cut"),
        (args.remove.is_some(), "--remove"),
        (matches!(args.leave_out, LeaveOutArg::None), "--leave-out"),
        (!args.turnings.is_empty(), "--turning"),
        (!args.hems.is_empty(), "--hem"),
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
    .filter_map(|(given, name)| given.then_some(name))
    .collect()
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
    if let Some(distance) = args.accept_distance {
        request.accept_distance = distance;
    }
    Ok(request)
}

/// Turnings in units of 120°; `None` if the program is to choose.
fn turning_wish(degrees: &[i32]) -> Result<Option<Vec<i32>>, Failure> {
    if let Some(wrong) = degrees.iter().find(|deg| *deg % 120 != 0) {
        return Err(Failure::Bad(format!(
            "--turning {wrong}: a rim turns by a multiple of 120°, so that the pattern closes around it"
        )));
    }
    let units = degrees.iter().map(|deg| deg / 120).collect();
    Ok(Some(units).filter(|_| !degrees.is_empty()))
}

/// Straight rims, counted from 0.
fn hem_wish(numbers: &[u32]) -> Result<Vec<usize>, Failure> {
    if numbers.contains(&0) {
        return Err(Failure::Bad(
            "--hem 0: rims are counted from 1, see `kagome inspect`".into(),
        ));
    }
    let mut hems: Vec<usize> = numbers.iter().map(|n| *n as usize - 1).collect();
    hems.sort_unstable();
    hems.dedup();
    Ok(hems)
}

fn from_arguments(args: &MakeArgs) -> Result<Request, Failure> {
    let name = &args.surface.surface;
    let source = match name.strip_prefix("sample:") {
        Some(sample) => Source::Sample(sample.to_owned()),
        None => Source::File {
            path: name.into(),
            sha256: None,
        },
    };
    Ok(Request {
        source,
        import: args.surface.options(),
        material: args.material.clone(),
        machine: args.machine.clone(),
        sigma: args.sigma,
        hinge_width_mm: args.hinge,
        kerf_mm: args.kerf,
        mirror: args.mirror,
        sizing: match (args.edge, args.triangles) {
            (Some(edge), _) => Sizing::EdgeMm(edge),
            (None, count) => Sizing::Triangles(count.unwrap_or(DEFAULT_TRIANGLES)),
        },
        cones: cone_wish(&args.cones)?,
        darts: dart_wish(&args.darts)?,
        cuts: args.cuts.iter().map(|c| c.0.clone()).collect(),
        left_out: match args.leave_out {
            LeaveOutArg::Auto => None,
            LeaveOutArg::None => Some(Vec::new()),
        },
        turnings: turning_wish(&args.turnings)?,
        straight: hem_wish(&args.hems)?,
        orientation_deg: args.orientation.0,
        handedness: match args.pattern {
            PatternArg::Right => Handedness::Right,
            PatternArg::Left => Handedness::Left,
        },
        remove_at_cone: args.remove,
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

fn cone_wish(cones: &[ConeArg]) -> Result<ConeWish, Failure> {
    match cones {
        [] | [ConeArg::Auto] => Ok(ConeWish::Auto),
        [ConeArg::None] => Ok(ConeWish::Given(Vec::new())),
        given => given
            .iter()
            .map(|cone| match cone {
                ConeArg::At(place, units) => Ok((*place, *units)),
                _ => Err(Failure::Bad(
                    "--cone auto and --cone none stand alone; leave out the other --cone".into(),
                )),
            })
            .collect::<Result<_, _>>()
            .map(ConeWish::Given),
    }
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
        lines.push(format!(
            "Written to {}; open report.html first, then:",
            folder.display()
        ));
        lines.push(format!(
            "  kagome send {} --port PORT",
            folder.join("job.nc").display()
        ));
    }
    lines.join("\n") + "\n"
}
