//! From a request to everything that a maker needs: the whole line, in one call.
//!
//! The order is chosen so that bad input costs nothing: profiles, surface, map, linkage and sheet (with its place on
//! the bed) come first, the long solve only when all of that stands. Nothing is written here; [`Made::write`] puts
//! all files into place at once.

use std::path::Path;

use nalgebra::{Point2, Point3};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use super::design::{
    ConeChoice, Design, FORMAT, LinkageChoice, SheetChoice, SolveChoice, SurfaceChoice,
};
use super::report::{self, Page, Stroke};
use super::request::{ConePlace, ConeWish, Request, Source};
use super::verdict::{Reason, Verdict, place};
use super::{MakeError, cut};
use crate::base::atomic;
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::conformal::{
    Cone, ConeRequest, FlattenOptions, Flattened, Sizing, flatten, vertex_from_number,
};
use crate::linkage::{Built, Linkage, LinkageOptions, build, write_obj};
use crate::machine::Machine;
use crate::material::Material;
use crate::mesh::{
    ClosestPoint, Import, PartChoice, Sample, Surface, import_bytes, insert_point, write,
};
use crate::pattern::{self, Sheet};
use crate::rationalize::{Effort, Quality, rationalize};
use crate::toolpath::{Role, Toolpath};

/// Names of all files that `make` may write, for replacing an earlier result safely.
pub const FILES: [&str; 7] = [
    "design.toml",
    "layout.obj",
    "linkage.obj",
    "pattern.svg",
    "job.nc",
    "report.json",
    "report.html",
];

/// Everything made, in memory.
#[derive(Debug)]
pub struct Made {
    /// Every decision taken.
    pub design: Design,
    /// May it be cut?
    pub verdict: Verdict,
    /// Figures of the linkage in space.
    pub quality: Quality,
    /// What was noticed and does not forbid the cut.
    pub warnings: Vec<String>,
    /// The result in a few lines, for a person.
    pub summary: Vec<(String, String)>,
    /// All figures.
    pub figures: Value,
    /// The files, by name: all of [`FILES`], or without pattern and job if the verdict is no.
    pub files: Vec<(&'static str, Vec<u8>)>,
}

impl Made {
    /// Writes all files into `folder`, which appears complete or not at all.
    ///
    /// # Errors
    /// [`atomic::WriteError`]; what was there before is then still there.
    pub fn write(&self, folder: &Path, force: bool) -> Result<(), atomic::WriteError> {
        atomic::write_directory(folder, &self.files, &FILES, force)
    }
}

/// A surface with the decisions about it.
struct Loaded {
    import: Import,
    sha256: Option<String>,
    cones: ConeRequest,
    /// As they will stand in the design file; `None` while the program decides.
    cone_choices: Option<Vec<ConeChoice>>,
}

/// Makes everything for `request`. `folder` is where the files will lie: the design names the mesh relative to it.
///
/// # Errors
/// [`MakeError`] for input that cannot be used, an interruption, or an output that would be wrong. A surface that
/// cannot be approximated is no error: see [`Made::verdict`].
pub fn make(request: &Request, folder: &Path, progress: &dyn Progress) -> Result<Made, MakeError> {
    let material = crate::material::load(&request.material).map_err(MakeError::Material)?;
    let machine = crate::machine::load(&request.machine).map_err(MakeError::Machine)?;
    let setting = material.cut_for(&machine).map_err(MakeError::Cut)?;
    let sigma = checked_sigma(request.sigma.unwrap_or(material.sigma.max))?;
    let kerf_mm = request.kerf_mm.unwrap_or(setting.kerf_mm);
    let hinge_width_mm = request.hinge_width_mm.unwrap_or(material.hinge_width_mm);
    check_sizing(request.sizing)?;

    progress.start("reading the surface", None);
    let loaded = load(request)?;
    let surface = &loaded.import.surface;

    progress.start("conformal map", None);
    let (flat, built, remove) = lay_out(request, surface, &loaded.cones, sigma, progress)?;
    let cone_choices = loaded.cone_choices.clone().unwrap_or_else(|| {
        let choice = |c: &Cone| ConeChoice {
            vertex: Some(u64::from(c.vertex.0) + 1),
            at_mm: None,
            units: c.units,
        };
        flat.layout.cones.iter().map(choice).collect()
    });
    progress.note(&describe_map(&flat, surface, sigma));

    // The sheet depends on flat positions only: what does not fit the bed is known before the long solve.
    let sheet = Sheet::new(&built.linkage, hinge_width_mm, kerf_mm).map_err(MakeError::Pattern)?;
    let (sheet, motion) =
        pattern::placed(&sheet, &machine, request.mirror).map_err(MakeError::Pattern)?;
    let move_point = |p: Point2<f64>| {
        let (x, y) = motion.apply(p.x, p.y);
        Point2::new(x, y)
    };
    let mut linkage = built.linkage.clone();
    linkage
        .triangles
        .iter_mut()
        .for_each(|t| t.flat = t.flat.map(move_point));
    let mut placed_layout = flat.layout.corners.to_vec();
    placed_layout
        .iter_mut()
        .for_each(|c| *c = c.map(move_point));

    progress.start("rationalising", Some(5));
    let closest = ClosestPoint::new(surface);
    let (positions, effort) = rationalize(
        &linkage,
        &built.start,
        &closest,
        sigma,
        request.solver,
        progress,
    )
    .map_err(MakeError::Rationalize)?;
    let quality = Quality::measure(&linkage, &positions, surface, &closest, sigma);
    let mut verdict = Verdict::judge(
        &quality,
        &flat,
        surface,
        built.overlaps.len(),
        request.accept_distance,
    );
    let warnings = warnings(request, &loaded, &material, &flat, &built, sigma);

    // Only a sheet that passes is turned into anything that a machine could run.
    let cut = if verdict.pass {
        let cut = cut::cut(&sheet, &machine, &material, &setting, progress)?;
        verdict
            .reasons
            .extend(cut.objections.iter().cloned().map(Reason::from));
        verdict.pass = verdict.reasons.is_empty();
        Some(cut)
    } else {
        None
    };
    let cut = cut.filter(|_| verdict.pass);

    progress.start("report", None);
    let design = Design {
        format: FORMAT,
        surface: SurfaceChoice {
            file: match &request.source {
                Source::File { path, .. } => Some(relative(path, folder)),
                Source::Sample(_) => None,
            },
            sample: match &request.source {
                Source::Sample(text) => Some(text.trim_start_matches("sample:").to_owned()),
                Source::File { .. } => None,
            },
            sha256: loaded.sha256.clone(),
            mm_per_unit: loaded.import.report.mm_per_unit,
            largest_part: request.import.parts == PartChoice::Largest,
        },
        sheet: SheetChoice {
            material: profile_name(&request.material, folder),
            machine: profile_name(&request.machine, folder),
            sigma,
            hinge_width_mm,
            kerf_mm,
            mirror: request.mirror,
        },
        linkage: LinkageChoice {
            edge_mm: flat.edge_mm,
            orientation_deg: request.orientation_deg,
            pattern: request.handedness,
            remove_at_cone: remove,
        },
        solve: SolveChoice {
            solver: request.solver,
            accept_distance: request.accept_distance,
        },
        cone: cone_choices,
    };
    let figures = figures(
        &design,
        &loaded,
        &flat,
        &built,
        &quality,
        effort,
        &sheet,
        cut.as_ref(),
        &verdict,
        &warnings,
    );
    let summary = summary(
        &material,
        &machine,
        &sheet,
        &quality,
        &flat,
        cut.as_ref(),
        sigma,
    );
    let layout_obj = write::obj_text(
        "kagome layout: the surface in mm, vt = conformal layout on the sheet in mm",
        surface.positions(),
        surface.faces(),
        Some(&placed_layout),
    );
    let sheet_svg = cut.as_ref().map(|_| pattern::svg(&sheet));
    let strokes = cut.as_ref().map(|c| drawn(&c.toolpath));
    let page = Page {
        title: &title(&request.source),
        verdict: &verdict,
        summary: &summary,
        warnings: &warnings,
        surface,
        layout: &flat.layout,
        linkage: &linkage,
        positions: &positions,
        distances_in_l: &distances(&positions, &closest, flat.edge_mm),
        distance_limit_in_l: request.accept_distance,
        openings: &openings(&linkage, &positions),
        sigma,
        sheet_svg: sheet_svg.as_deref(),
        toolpath: strokes.as_deref(),
        figures: &figures,
    };
    let html = report::html(&page);
    let report = serde_json::to_string_pretty(&figures)
        .map_err(|e| MakeError::Internal(format!("report.json: {e}")))?;
    let mut files: Vec<(&'static str, Vec<u8>)> = vec![
        ("design.toml", design.to_text()?.into_bytes()),
        ("layout.obj", layout_obj.into_bytes()),
        ("linkage.obj", write_obj(&linkage, &positions).into_bytes()),
        ("report.json", (report + "\n").into_bytes()),
        ("report.html", html.into_bytes()),
    ];
    if let (Some(cut), Some(svg)) = (cut, sheet_svg) {
        files.push(("pattern.svg", svg.into_bytes()));
        files.push(("job.nc", cut.gcode.into_bytes()));
    }
    progress.check()?;
    Ok(Made {
        design,
        verdict,
        quality,
        warnings,
        summary,
        figures,
        files,
    })
}

fn checked_sigma(sigma: f64) -> Result<f64, MakeError> {
    if sigma > 1.0 && sigma <= 2.0 {
        Ok(sigma)
    } else {
        Err(MakeError::Sigma { sigma })
    }
}

fn check_sizing(sizing: Sizing) -> Result<(), MakeError> {
    match sizing {
        Sizing::EdgeMm(edge) if !(edge.is_finite() && edge > 0.0) => Err(MakeError::Size {
            what: "the triangle edge (--edge)",
            value: edge,
            example: "--edge 7",
        }),
        Sizing::Triangles(n) if !(n.is_finite() && n >= 1.0) => Err(MakeError::Size {
            what: "the number of triangles (--triangles)",
            value: n,
            example: "--triangles 1500",
        }),
        _ => Ok(()),
    }
}

/// Reads the surface, checks its hash, and turns the cones asked for into vertices.
fn load(request: &Request) -> Result<Loaded, MakeError> {
    let (mut import, sha256) = match &request.source {
        Source::Sample(text) => {
            let sample = Sample::parse(text).map_err(MakeError::Sample)?;
            (
                sample.import(&request.import).map_err(MakeError::Sample)?,
                None,
            )
        }
        Source::File { path, sha256 } => {
            let name = path.display().to_string();
            let bytes = std::fs::read(path).map_err(|source| MakeError::Read {
                path: path.clone(),
                source,
            })?;
            let found: String = Sha256::digest(&bytes)
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect();
            if let Some(expected) = sha256
                && !expected.eq_ignore_ascii_case(&found)
            {
                return Err(MakeError::Changed {
                    path: path.clone(),
                    expected: expected.clone(),
                    found,
                });
            }
            (
                import_bytes(&name, &bytes, &request.import).map_err(MakeError::Import)?,
                Some(found),
            )
        }
    };
    let wished = match &request.cones {
        ConeWish::Auto => {
            return Ok(Loaded {
                import,
                sha256,
                cones: ConeRequest::Auto,
                cone_choices: None,
            });
        }
        ConeWish::Given(wished) => wished,
    };
    let (mut cones, mut choices) = (Vec::new(), Vec::new());
    for &(place, units) in wished {
        match place {
            ConePlace::Vertex(number) => {
                let count = import.surface.positions().len();
                let vertex = vertex_from_number(number)
                    .filter(|v| (v.0 as usize) < count)
                    .ok_or(MakeError::NoSuchVertex {
                        vertex: number,
                        count,
                    })?;
                cones.push(Cone { vertex, units });
                choices.push(ConeChoice {
                    vertex: Some(number),
                    at_mm: None,
                    units,
                });
            }
            ConePlace::Point(at) => {
                let found = ClosestPoint::new(&import.surface).query(Point3::from(at));
                let (low, high) = import.surface.bounds();
                if !(found.distance <= 0.1 * (high - low).norm()) {
                    return Err(MakeError::ConeFarAway {
                        at,
                        distance_mm: found.distance,
                    });
                }
                let (surface, vertex) =
                    insert_point(&import.surface, found.face, found.barycentric)
                        .map_err(MakeError::Edit)?;
                import.surface = surface;
                cones.push(Cone { vertex, units });
                choices.push(ConeChoice {
                    vertex: None,
                    at_mm: Some(at),
                    units,
                });
            }
        }
    }
    Ok(Loaded {
        import,
        sha256,
        cones: ConeRequest::Given(cones),
        cone_choices: Some(choices),
    })
}

/// Triangles around a positive cone that are tried in turn unless a number is given: those at it, then those and the
/// next ring. λ falls to 0 at such a cone, and the finer the triangles, the deeper they reach into the fall.
const REMOVALS: [usize; 2] = [4, 16];

/// Flattens and lays the lattice. With a number of triangles asked for, the edge is corrected once for those that the
/// rim costs. Also returns the number of triangles removed at the cone.
fn lay_out(
    request: &Request,
    surface: &Surface,
    cones: &ConeRequest,
    sigma: f64,
    progress: &dyn Progress,
) -> Result<(Flattened, Built, usize), MakeError> {
    let removals: Vec<usize> = match (request.remove_at_cone, cones) {
        (Some(count), _) => vec![count],
        (None, ConeRequest::Given(cones)) if cones.iter().all(|c| c.units <= 0) => vec![0],
        (None, _) => REMOVALS.to_vec(),
    };
    let mut best: Option<(Flattened, FlattenOptions, usize)> = None;
    for removal in removals {
        let options = FlattenOptions {
            sigma,
            cones: cones.clone(),
            sizing: request.sizing,
            cone_clearance: clearance(removal),
        };
        let flat = flatten(surface, &options, progress).map_err(MakeError::Conformal)?;
        let fits = flat.scale.max <= sigma;
        if best
            .as_ref()
            .is_none_or(|(b, ..)| fits || flat.scale.inside > b.scale.inside)
        {
            best = Some((flat, options, removal));
        }
        if fits {
            break;
        }
    }
    let (mut flat, mut options, removal) =
        best.ok_or_else(|| MakeError::Internal("no layout was tried".into()))?;
    let remove = if flat.layout.cones.is_empty() {
        0
    } else {
        removal
    };
    let lattice = |flat: &Flattened| LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation: request.orientation_deg.to_radians(),
        handedness: request.handedness,
        remove_at_cone: remove,
        sigma,
    };
    let mut built =
        build(surface, &flat.layout, &lattice(&flat), progress).map_err(MakeError::Linkage)?;
    if let Sizing::Triangles(wanted) = request.sizing {
        let got = built.linkage.triangles.len() as f64;
        options.sizing = Sizing::Triangles(wanted * wanted / got);
        flat = flat.resize(surface, &options);
        built =
            build(surface, &flat.layout, &lattice(&flat), progress).map_err(MakeError::Linkage)?;
    }
    Ok((flat, built, remove))
}

/// Radius around a cone, in L, that no triangle's centre comes within: 1/√3 with all triangles in place, 2/√3 without
/// the four at the cone, 2 rings without sixteen; taken a little smaller for the second and third because corners
/// reach further in than centres.
fn clearance(removal: usize) -> f64 {
    if removal == 0 {
        0.7
    } else {
        (removal as f64 / 4.0).sqrt().floor().max(1.0) + 0.1
    }
}

fn describe_map(flat: &Flattened, surface: &Surface, sigma: f64) -> String {
    let cone = match flat.layout.cones.first() {
        Some(cone) => format!(
            "one cone at vertex {} {}",
            cone.vertex,
            place(surface.position(cone.vertex))
        ),
        None => "no cone".into(),
    };
    format!(
        "conformal map: {cone}; λ from {} to {} (σ = {}), triangle edge {} mm",
        short(flat.scale.min, 3),
        short(flat.scale.max, 3),
        short(sigma, 3),
        short(flat.edge_mm, 3),
    )
}

fn warnings(
    request: &Request,
    loaded: &Loaded,
    material: &Material,
    flat: &Flattened,
    built: &Built,
    sigma: f64,
) -> Vec<String> {
    let mut warnings: Vec<String> = loaded
        .import
        .report
        .repairs()
        .into_iter()
        .map(|r| format!("the mesh was mended: {r}"))
        .collect();
    if sigma > material.sigma.max {
        warnings.push(format!(
            "σ = {} was asked for, but {} is known to stretch only to {} ({}): hinges are likely to tear. Cut a small trial first",
            short(sigma, 3),
            material.name,
            short(material.sigma.max, 3),
            source_in_words(material.sigma.source),
        ));
    } else if request.sigma.is_none() && material.sigma.source != crate::material::Source::Measured
    {
        warnings.push(format!(
            "the σ of {} ({}) is {}, not measured on your sheet: cut a small trial first",
            material.name,
            short(material.sigma.max, 3),
            source_in_words(material.sigma.source),
        ));
    }
    if flat.scale.max > sigma + 1e-9 || flat.scale.min < 1.0 - 1e-9 {
        warnings.push(format!(
            "the smooth map asks for λ up to {}, beyond σ = {}, on {} % of the surface; the triangles had to give way there",
            short(flat.scale.max, 2),
            short(sigma, 3),
            short(100.0 * (1.0 - flat.scale.inside), 1),
        ));
    }
    if !flat.metric.broken.is_empty() {
        warnings.push(format!(
            "{} faces of the mesh are too thin for the conformal map and were taken as flat lines: remesh evenly for a better map",
            flat.metric.broken.len()
        ));
    }
    if built.lost > 0 {
        warnings.push(format!(
            "{} triangles at the rim hang by fewer than two others and were left out",
            built.lost
        ));
    }
    if built.seam_edges > 0 {
        warnings.push(format!(
            "the sheet has a seam of {} triangle edges from the cone to the rim: its two sides must be joined by hand, edge to edge",
            built.seam_edges
        ));
    }
    warnings
}

fn source_in_words(source: crate::material::Source) -> &'static str {
    match source {
        crate::material::Source::Measured => "measured",
        crate::material::Source::Literature => "from literature",
        crate::material::Source::Estimate => "an estimate",
    }
}

fn summary(
    material: &Material,
    machine: &Machine,
    sheet: &Sheet,
    quality: &Quality,
    flat: &Flattened,
    cut: Option<&cut::CutResult>,
    sigma: f64,
) -> Vec<(String, String)> {
    let figures = sheet.figures();
    let mut lines = vec![
        ("Material".to_owned(), material.title.clone()),
        ("Machine".to_owned(), machine.title.clone()),
        (
            "Sheet".to_owned(),
            format!(
                "{} × {} mm",
                short(figures.width_mm, 0),
                short(figures.height_mm, 0)
            ),
        ),
        (
            "Pattern".to_owned(),
            format!(
                "{} triangles of {} mm, {} slits, hinges {} mm wide, cut {} mm wide",
                figures.triangles,
                short(flat.edge_mm, 2),
                figures.slits,
                short(sheet.metadata.hinge_width_mm, 2),
                short(sheet.metadata.kerf_mm, 2),
            ),
        ),
        (
            "Hinges open".to_owned(),
            format!(
                "{} to {} times (σ = {})",
                short(quality.opening[0], 2),
                short(quality.opening[2], 2),
                short(sigma, 3)
            ),
        ),
        (
            "Distance from the surface".to_owned(),
            format!(
                "at most {} mm ({} of a triangle edge)",
                short(quality.distance_max.value * quality.edge_mm, 3),
                short(quality.distance_max.value, 4),
            ),
        ),
    ];
    if let Some(cut) = cut {
        lines.push((
            "Job".to_owned(),
            format!(
                "{} strokes, {} m cut, {} m travel, {} on the simulated machine",
                cut.toolpath.cuts.len(),
                short(cut.cut_length_mm / 1000.0, 2),
                short(cut.travel_mm / 1000.0, 2),
                duration(cut.machine_s),
            ),
        ));
    }
    lines
}

/// Seconds as minutes and seconds.
fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    if whole < 60 {
        format!("{whole} s")
    } else {
        format!("{} min {:02} s", whole / 60, whole % 60)
    }
}

#[expect(
    clippy::too_many_arguments,
    reason = "it gathers every stage's figures in one place"
)]
fn figures(
    design: &Design,
    loaded: &Loaded,
    flat: &Flattened,
    built: &Built,
    quality: &Quality,
    effort: Effort,
    sheet: &Sheet,
    cut: Option<&cut::CutResult>,
    verdict: &Verdict,
    warnings: &[String],
) -> Value {
    let surface = &loaded.import.surface;
    let mut distortion = flat.layout.quasi_conformal_error(surface).into_vec();
    distortion.sort_by(f64::total_cmp);
    let at = |part: f64| {
        distortion
            .get((part * (distortion.len() - 1) as f64) as usize)
            .copied()
            .unwrap_or(1.0)
    };
    let s = sheet.figures();
    json!({
        "verdict": verdict,
        "warnings": warnings,
        "design": design,
        "surface": {
            "vertices": surface.positions().len(),
            "faces": surface.faces().len(),
            "area_mm2": surface.area(),
            "import": loaded.import.report,
        },
        "conformal": {
            "newton_steps": flat.metric.steps,
            "angle_residual_rad": flat.metric.residual,
            "closure": flat.layout.closure,
            "broken_faces": flat.metric.broken.len(),
            "lambda_min": flat.scale.min,
            "lambda_max": flat.scale.max,
            "lambda_max_at_mm": surface.position(flat.scale.max_vertex).coords.as_slice(),
            "area_inside_sigma": flat.scale.inside,
            "quasi_conformal_median": at(0.5),
            "quasi_conformal_99_percent": at(0.99),
        },
        "linkage": {
            "triangles": built.linkage.triangles.len(),
            "hinges": built.linkage.hinges.len(),
            "removed_at_cone": built.removed,
            "left_out_at_rim": built.lost,
            "seam_edges": built.seam_edges,
            "overlaps_on_sheet": built.overlaps.len(),
        },
        "solve": { "steps": effort.steps, "factorizations": effort.factorizations },
        "quality": quality,
        "sheet": {
            "slits": s.slits,
            "stars": s.stars,
            "contours": s.contours,
            "slit_length_mm": s.slit_length_mm,
            "contour_length_mm": s.contour_length_mm,
            "area_mm2": s.area_mm2,
            "width_mm": s.width_mm,
            "height_mm": s.height_mm,
        },
        "job": cut.map(cut::CutResult::figures),
    })
}

/// The toolpath as the report draws it: cuts in their order, with the moves between them.
fn drawn(toolpath: &Toolpath) -> Vec<Stroke> {
    let flat = |p: kurbo::Point| Point2::new(p.x, p.y);
    let mut strokes = Vec::with_capacity(2 * toolpath.cuts.len());
    let mut at = toolpath.start;
    for cut in &toolpath.cuts {
        let (Some(&first), Some(end)) = (cut.points.first(), cut.end()) else {
            continue;
        };
        strokes.push(Stroke {
            role: report::Role::Travel,
            points: vec![flat(at), flat(first)],
        });
        let role = match cut.role {
            Role::Slit => report::Role::Cut,
            Role::Inner | Role::Outer => report::Role::Contour,
        };
        strokes.push(Stroke {
            role,
            points: cut.points.iter().copied().map(flat).collect(),
        });
        at = end;
    }
    strokes
}

/// Distance of every point from the surface, in L.
fn distances(positions: &[Point3<f64>], closest: &ClosestPoint, edge_mm: f64) -> Vec<f64> {
    positions
        .iter()
        .map(|p| closest.query(*p).distance / edge_mm)
        .collect()
}

/// Scale factor λ of every hinge.
fn openings(linkage: &Linkage, positions: &[Point3<f64>]) -> Vec<f64> {
    crate::rationalize::hinge_scales(linkage, positions)
}

fn title(source: &Source) -> String {
    match source {
        Source::Sample(text) => text.trim_start_matches("sample:").to_owned(),
        Source::File { path, .. } => path
            .file_stem()
            .map_or_else(|| "surface".into(), |s| s.to_string_lossy().into_owned()),
    }
}

/// A path as seen from `folder`; absolute if the two have nothing in common.
fn relative(path: &Path, folder: &Path) -> String {
    let absolute = |p: &Path| std::path::absolute(p).unwrap_or_else(|_| p.to_path_buf());
    let (path, folder) = (absolute(path), absolute(folder));
    let (a, b): (Vec<_>, Vec<_>) = (path.components().collect(), folder.components().collect());
    let common = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    if common <= 1 {
        return path.to_string_lossy().into_owned();
    }
    let up = std::iter::repeat_n("..".to_owned(), b.len() - common);
    let down = a[common..]
        .iter()
        .map(|c| c.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// A shipped profile by its name, a file relative to the design.
fn profile_name(name: &str, folder: &Path) -> String {
    let path = Path::new(name);
    if path.is_file() {
        relative(path, folder)
    } else {
        name.to_owned()
    }
}
