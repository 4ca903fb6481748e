//! From a request to everything that a maker needs: the whole line, in one call.
//!
//! The order is chosen so that bad input costs nothing: profiles, surface, map, linkage and sheet (with its place on
//! the bed) come first, the long solve only when all of that stands. Nothing is written here; [`Made::write`] puts
//! all files into place at once.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use nalgebra::{Point2, Point3};
use serde_json::Value;

use super::cut::{CutResult, cut};
use super::design::{
    AlsoChoice, ConeChoice, DartChoice, Design, FORMAT, LinkageChoice, SheetChoice, SolveChoice,
    SurfaceChoice,
};
use super::load::{Also, Loaded, MOST_SURFACES, Skirt, load};
use super::maps::cone_opening_mm;
use super::report::{self, DrawnSheet, Page, Pose, Stroke};
use super::request::{Request, Source};
use super::several::choose_for_all;
use super::shape::{Fit, Shape, Stock, on_shape};
use super::strength::{self, Strength};
use super::verdict::{Reason, Verdict};
use super::{MakeError, remedy, tell};
use crate::base::atomic;
use crate::base::ids::Id as _;
use crate::base::progress::Progress;
use crate::calibrate::CONFIDENCES;
use crate::conformal::{Cone, Dart, Flattened, Layout, Sizing};
use crate::linkage::{write_glb, write_obj};
use crate::machine::Machine;
use crate::material::{CutSetting, Material, TipShape};
use crate::mesh::{FaceId, PartChoice, Surface, distance_to_triangle, write};
use crate::pattern::{self, HingeRisk, SheetOptions, Tip, hinge_risks};
use crate::rationalize::{Quality, Solver, hinge_scales};
use crate::toolpath::{Role, Toolpath};

/// Names of all files that `make` may write, for replacing an earlier result safely.
pub const FILES: [&str; 82] = [
    "design.toml",
    "layout.obj",
    "linkage.obj",
    "linkage.glb",
    "report.json",
    "report.html",
    "pattern.svg",
    "pattern.dxf",
    "job.nc",
    "pattern-2.svg",
    "pattern-2.dxf",
    "job-2.nc",
    "pattern-3.svg",
    "pattern-3.dxf",
    "job-3.nc",
    "pattern-4.svg",
    "pattern-4.dxf",
    "job-4.nc",
    "pattern-5.svg",
    "pattern-5.dxf",
    "job-5.nc",
    "pattern-6.svg",
    "pattern-6.dxf",
    "job-6.nc",
    "pattern-7.svg",
    "pattern-7.dxf",
    "job-7.nc",
    "pattern-8.svg",
    "pattern-8.dxf",
    "job-8.nc",
    "pattern-9.svg",
    "pattern-9.dxf",
    "job-9.nc",
    "pattern-10.svg",
    "pattern-10.dxf",
    "job-10.nc",
    "pattern-11.svg",
    "pattern-11.dxf",
    "job-11.nc",
    "pattern-12.svg",
    "pattern-12.dxf",
    "job-12.nc",
    "pattern-13.svg",
    "pattern-13.dxf",
    "job-13.nc",
    "pattern-14.svg",
    "pattern-14.dxf",
    "job-14.nc",
    "pattern-15.svg",
    "pattern-15.dxf",
    "job-15.nc",
    "pattern-16.svg",
    "pattern-16.dxf",
    "job-16.nc",
    "pattern-17.svg",
    "pattern-17.dxf",
    "job-17.nc",
    "pattern-18.svg",
    "pattern-18.dxf",
    "job-18.nc",
    "pattern-19.svg",
    "pattern-19.dxf",
    "job-19.nc",
    "pattern-20.svg",
    "pattern-20.dxf",
    "job-20.nc",
    "linkage-2.obj",
    "layout-2.obj",
    "linkage-3.obj",
    "layout-3.obj",
    "linkage-4.obj",
    "layout-4.obj",
    "linkage-5.obj",
    "layout-5.obj",
    "linkage-6.obj",
    "layout-6.obj",
    "linkage-7.obj",
    "layout-7.obj",
    "linkage-8.obj",
    "layout-8.obj",
    "linkage-9.obj",
    "layout-9.obj",
];
/// Those of every result; drawings and job of each sheet follow, then linkage and layout on each further surface.
const OWN_FILES: usize = 6;
/// SVG, DXF and job of each sheet.
const FILES_A_SHEET: usize = 3;
/// Where those of further surfaces begin.
const SURFACE_FILES: usize = FILES.len() - 2 * (MOST_SURFACES - 1);
/// Sheets of one result at the most.
const MOST_SHEETS: usize = (SURFACE_FILES - OWN_FILES) / FILES_A_SHEET;

/// Everything made, in memory.
#[derive(Debug)]
pub struct Made {
    /// Every decision taken.
    pub design: Design,
    /// May it be cut?
    pub verdict: Verdict,
    /// Figures of the linkage on each surface, in their order.
    pub qualities: Vec<Quality>,
    /// Stretch λ of every hinge that is cut, on each surface.
    pub openings: Vec<Vec<f64>>,
    /// What was noticed and does not forbid the cut.
    pub warnings: Vec<String>,
    /// The result in a few lines, for a person.
    pub summary: Vec<(String, String)>,
    /// Whether the machine is one to which jobs are sent; the others are given the file.
    pub streamed: bool,
    /// All figures.
    pub figures: Value,
    /// The files, by name, of [`FILES`]: without pattern and job if the verdict is no, and linkage and layout on as many
    /// further surfaces as there are.
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

/// Makes everything for `request`. `folder` is where the files will lie: the design names the mesh relative to it.
///
/// # Errors
/// [`MakeError`] for input that cannot be used, an interruption, or an output that would be wrong. A surface that
/// cannot be approximated is no error: see [`Made::verdict`].
pub fn make(request: &Request, folder: &Path, progress: &dyn Progress) -> Result<Made, MakeError> {
    let material = crate::material::load(&request.material).map_err(MakeError::Material)?;
    let machine = crate::machine::load(&request.machine).map_err(MakeError::Machine)?;
    let setting = material.cut_for(&machine).map_err(MakeError::Cut)?;
    let mut stock = stock(request, &material, &machine, &setting)?;
    let strength = Strength::of(request, &material)?;

    progress.start("reading the surface", None);
    let loaded = load(request)?;
    stock.rim = loaded.rim(&stock.options);
    if let Some(strength) = &strength {
        let area_mm2 = loaded.area_mm2();
        if let Some(sigma) = strength.sigma(request, &stock.options, &material, area_mm2)? {
            stock.sigma = checked_sigma(sigma)?;
        }
    }
    let surface = &loaded.import.surface;
    let targets = loaded.targets(&request.source);
    targets.check_sizes(stock.sigma)?;
    let mut shape = choose_for_all(request, &loaded, &stock, &targets, progress)?;
    if !shape.verdict.pass && request.solver == Solver::Exact {
        remedy::explain(request, &mut shape, &stock, &targets, progress)?;
    }
    let mut warnings = tell::warnings(&loaded, &material, strength.is_some(), &shape, stock.sigma);
    warnings.extend(tell::tabs(&shape, stock.tabs));

    let edge_mm = shape.flat.edge_mm;
    let measured: Vec<(Vec<f64>, Vec<f64>)> = shape
        .fits
        .iter()
        .zip(&targets.0)
        .map(|(fit, target)| {
            let distance = |p: &Point3<f64>| target.closest.query(*p).distance / edge_mm;
            (
                fit.positions.iter().map(distance).collect(),
                hinge_scales(&shape.linkage, &fit.positions),
            )
        })
        .collect();
    let ligament = stock.options.ligament(edge_mm, material.thickness_mm);
    let risks: Vec<Vec<HingeRisk>> = shape
        .fits
        .iter()
        .zip(&measured)
        .map(|(fit, (_, openings))| {
            hinge_risks(
                &shape.linkage,
                &fit.positions,
                openings,
                &ligament,
                stock.sigma,
            )
        })
        .collect();
    for (fit, risks) in shape.fits.iter().zip(&risks) {
        warnings.extend(tell::risk(fit, risks));
    }
    let names: Vec<String> = targets.0.iter().map(|t| t.name.clone()).collect();
    let proof = strength.map(|strength| {
        let openings: Vec<&[f64]> = measured.iter().map(|(_, o)| o.as_slice()).collect();
        let (options, thickness_mm) = (&stock.options, material.thickness_mm);
        strength.prove(&shape.linkage, &openings, options, thickness_mm)
    });
    if let Some(proof) = &proof {
        warnings.extend(proof.warnings(stock.sigma, &names));
        let reasons = proof.reasons(&shape.fits, &names);
        shape.verdict.pass &= reasons.is_empty();
        shape.verdict.reasons.extend(reasons);
    }
    if shape.sheets.len() > MOST_SHEETS {
        return Err(MakeError::TooManySheets {
            sheets: shape.sheets.len(),
            most: MOST_SHEETS,
        });
    }

    // Only sheets that pass are turned into anything that a machine could run, and all of them or none.
    let mut jobs = Vec::new();
    if shape.verdict.pass {
        for sheet in &shape.sheets {
            let heat = request.sheet.heat;
            let cut = cut(sheet, &machine, &material, &setting, heat, progress)?;
            let objections = cut.objections.iter().cloned().map(Reason::from);
            shape.verdict.reasons.extend(objections);
            jobs.push(cut);
        }
        shape.verdict.pass = shape.verdict.reasons.is_empty();
        if !shape.verdict.pass {
            jobs.clear();
        }
    }

    progress.start("report", None);
    let taken = Taken {
        flat: &shape.flat,
        darts: &shape.ground.darts,
        removed: shape.removed,
        left_out: &shape.left_out,
        orientation_deg: shape.orientation_deg,
        shares: &shape.shares,
    };
    let design = decided(request, folder, &loaded, &taken, &stock);
    let mut figures = tell::figures(&design, &loaded, &shape, &jobs, &warnings);
    let mut summary = tell::summary(&material, &machine, &shape, &targets, &jobs, stock.sigma);
    if let Some(proof) = &proof {
        figures["strength"] = proof.figures(stock.sigma, &shape.fits);
        summary.extend(proof.line());
    }
    let drawn_sheets: Vec<DrawnSheet> = shape
        .sheets
        .iter()
        .zip(&jobs)
        .map(|(sheet, job)| DrawnSheet {
            svg: pattern::svg(sheet),
            toolpath: drawn(&job.toolpath),
        })
        .collect();
    // Of several surfaces each as it was slit, else the one that was mapped, with its own λ.
    let slit: Vec<&Surface> = match &shape.ground.shapes[..] {
        [] => vec![&shape.ground.surface],
        several => several.iter().map(|s| &s.surface).collect(),
    };
    let layouts: Vec<Cow<'_, Layout>> = match &shape.ground.shapes[..] {
        [] => vec![Cow::Borrowed(&shape.flat.layout)],
        several => several
            .iter()
            .map(|s| Cow::Owned(on_shape(&shape.flat.layout, s)))
            .collect(),
    };
    let poses: Vec<Pose<'_>> = (0..shape.fits.len())
        .map(|n| Pose {
            name: &targets.0[n].name,
            surface: slit[n],
            layout: &layouts[n],
            positions: &shape.fits[n].positions,
            distances_in_l: &measured[n].0,
            openings: &measured[n].1,
            risks: &risks[n],
            margins: proof.as_ref().and_then(|proof| proof.margins(n)),
        })
        .collect();
    let page = Page {
        title: &title(&request.source),
        verdict: &shape.verdict,
        summary: &summary,
        warnings: &warnings,
        cone_opening_mm: cone_opening_mm(shape.removed, edge_mm),
        linkage: &shape.linkage,
        poses: &poses,
        distance_limit_in_l: request.accept_distance,
        sigma: stock.sigma,
        sheets: &drawn_sheets,
        figures: &figures,
    };
    let html = report::html(&page);
    progress.check()?;
    let layout = |surface: &Surface| {
        let (faces, chart): (Vec<_>, Vec<_>) = surface
            .faces()
            .iter_ids()
            .zip(&shape.chart)
            .filter(|((face, _), _)| reached(surface, *face, &loaded, &shape))
            .map(|((_, corners), chart)| (*corners, *chart))
            .unzip();
        let text = write::obj_text(
            "kagome layout: the surface in mm, vt = conformal layout on the sheet in mm",
            surface.positions(),
            &faces,
            Some(&chart),
        );
        text.into_bytes()
    };
    let linkage = |fit: &Fit| write_obj(&shape.linkage, &fit.positions).into_bytes();
    let report = serde_json::to_string_pretty(&figures)
        .map_err(|e| MakeError::Internal(format!("report.json: {e}")))?;
    let mut files: Vec<(&'static str, Vec<u8>)> = vec![
        ("design.toml", design.to_text()?.into_bytes()),
        ("layout.obj", layout(surface)),
        ("linkage.obj", linkage(shape.first())),
        ("report.json", (report + "\n").into_bytes()),
        ("report.html", html.into_bytes()),
    ];
    let names = FILES[OWN_FILES..SURFACE_FILES].chunks_exact(FILES_A_SHEET);
    for (((CutResult { gcode, .. }, drawing), sheet), names) in jobs
        .into_iter()
        .zip(drawn_sheets)
        .zip(&shape.sheets)
        .zip(names)
    {
        files.push((names[0], drawing.svg.into_bytes()));
        files.push((names[1], pattern::dxf(sheet).into_bytes()));
        files.push((names[2], gcode.into_bytes()));
    }
    // Only a linkage too large for the format has none.
    let opened = write_glb(&shape.linkage, &[&shape.first().positions]);
    files.extend(opened.map(|bytes| ("linkage.glb", bytes)));
    let further = shape.fits.iter().zip(&targets.0).skip(1);
    for ((fit, target), names) in further.zip(FILES[SURFACE_FILES..].chunks(2)) {
        files.push((names[0], linkage(fit)));
        files.push((names[1], layout(&target.surface)));
    }
    let qualities = shape.fits.into_iter().map(|fit| fit.quality).collect();
    let kept: Vec<bool> = shape
        .linkage
        .hinges
        .iter()
        .map(|hinge| shape.linkage.keeps(hinge))
        .collect();
    let openings = measured.into_iter().map(|(_, openings)| {
        let cut = openings.into_iter().zip(&kept);
        cut.filter_map(|(opening, kept)| kept.then_some(opening))
            .collect()
    });
    let openings = openings.collect();
    Ok(Made {
        design,
        verdict: shape.verdict,
        qualities,
        openings,
        warnings,
        summary,
        streamed: machine.controller.is_streamed(),
        figures,
        files,
    })
}

/// What the sheet is to be, asked for or as the profiles say.
pub(crate) fn stock<'a>(
    request: &Request,
    material: &Material,
    machine: &'a Machine,
    setting: &CutSetting,
) -> Result<Stock<'a>, MakeError> {
    let stock = Stock {
        sigma: checked_sigma(request.sigma.unwrap_or(material.sigma.max))?,
        confidence: strength::confidence(request, material)?,
        options: SheetOptions {
            hinge_width_mm: request.hinge_width_mm.unwrap_or(material.hinge_width_mm),
            kerf_mm: request.kerf_mm.unwrap_or(setting.kerf_mm),
            tip: request
                .sheet
                .tip
                .or(material.tip.map(Tip::from))
                .unwrap_or_default(),
            corner_radius_mm: request
                .sheet
                .corner_radius_mm
                .or(material.corner_radius_mm)
                .unwrap_or(0.0),
            alignment_hole_mm: request.sheet.alignment_hole_mm,
        },
        machine,
        stock_mm: request.sheet.stock_mm,
        divide: request.sheet.divide,
        rim: None,
        tabs: request.sheet.tabs,
        tab_width_mm: request.sheet.tab_width_mm,
    };
    if let Some(value) = stock.confidence
        && !CONFIDENCES.contains(&value)
    {
        return Err(MakeError::Range {
            what: "--confidence",
            value,
            least: *CONFIDENCES.start(),
            most: *CONFIDENCES.end(),
        });
    }
    check_sizing(request.sizing)?;
    check_ranges(request.accept_distance, &stock)?;
    Ok(stock)
}

/// What was decided about the shape of a sheet.
pub(crate) struct Taken<'a> {
    pub flat: &'a Flattened,
    pub darts: &'a [Dart],
    pub removed: usize,
    pub left_out: &'a [u32],
    pub orientation_deg: f64,
    pub shares: &'a [f64],
}

/// Whether a face is part of the surface, or, beyond its smooth rim, within a triangle's edge of a corner that is cut off.
fn reached(surface: &Surface, face: FaceId, loaded: &Loaded, shape: &Shape) -> bool {
    let beyond = |skirt: &Skirt| skirt.beyond.get(face.index()) == Some(&true);
    if !loaded.skirt.as_ref().is_some_and(beyond) {
        return true;
    }
    let corners = surface.corners(face);
    let positions = &shape.first().positions;
    shape.linkage.triangles.iter().any(|triangle| {
        let Some(trim) = &triangle.trim else {
            return false;
        };
        let at = positions.get(triangle.points[trim.beyond].index());
        at.is_some_and(|p| distance_to_triangle(&corners, p) < shape.linkage.edge_mm)
    })
}

/// Every decision, asked for or taken.
pub(crate) fn decided(
    request: &Request,
    folder: &Path,
    loaded: &Loaded,
    shape: &Taken<'_>,
    stock: &Stock<'_>,
) -> Design {
    let named = |source: &Source| match source {
        Source::File { path, .. } => (Some(relative(path, folder)), None),
        Source::Sample(text) => (None, Some(text.trim_start_matches("sample:").to_owned())),
    };
    let (file, sample) = named(&request.source);
    let further = |(source, also): (&Source, &Also)| {
        let (file, sample) = named(source);
        AlsoChoice {
            file,
            sample,
            sha256: also.sha256.clone(),
        }
    };
    let found = |c: &Cone| ConeChoice {
        vertex: Some(u64::from(c.vertex.0) + 1),
        at_mm: None,
        units: c.units,
    };
    let opened = |d: &Dart| DartChoice {
        vertices: d.stops.iter().map(|v| u64::from(v.0) + 1).collect(),
        points_mm: Vec::new(),
    };
    Design {
        format: FORMAT,
        surface: SurfaceChoice {
            file,
            sample,
            sha256: loaded.sha256.clone(),
            mm_per_unit: loaded.import.report.mm_per_unit,
            largest_part: request.import.parts == PartChoice::Largest,
        },
        also: request.also.iter().zip(&loaded.also).map(further).collect(),
        sheet: SheetChoice {
            material: profile_name(&request.material, folder),
            machine: profile_name(&request.machine, folder),
            sigma: stock.sigma,
            confidence: stock.confidence,
            hinge_width_mm: stock.options.hinge_width_mm,
            kerf_mm: stock.options.kerf_mm,
            mirror: request.mirror,
            stock_mm: stock.stock_mm,
            undivided: !stock.divide,
            smooth_rim_skirt_mm: loaded.skirt.as_ref().map(|s| s.width_mm),
            tip: match stock.options.tip {
                Tip::Plain => None,
                Tip::Round { .. } => Some(TipShape::Round),
                Tip::Teardrop { .. } => Some(TipShape::Teardrop),
            },
            tip_radius_mm: stock.options.tip.radius_mm(0.0),
            corner_radius_mm: stock.options.corner_radius_mm,
            alignment_hole_mm: stock.options.alignment_hole_mm,
            tabs: stock.tabs,
            tab_width_mm: if stock.tabs > 0 {
                stock.tab_width_mm
            } else {
                0.0
            },
            cool_price_mm: request.sheet.heat.price_mm,
            cool_reach_mm: request.sheet.heat.reach_mm,
        },
        linkage: LinkageChoice {
            edge_mm: shape.flat.edge_mm,
            orientation_deg: shape.orientation_deg,
            pattern: request.handedness,
            remove_at_cone: shape.removed,
            left_out: shape.left_out.to_vec(),
            rim_turnings_deg: shape.flat.singularities.rim_turnings_deg(),
            flaps: request.flaps,
            shares: match shape.shares {
                [_] => Vec::new(),
                shares => shares.to_vec(),
            },
            straight_rims: shape.flat.singularities.straight_rims(),
        },
        solve: SolveChoice {
            solver: request.solver,
            accept_distance: request.accept_distance,
        },
        cone: loaded
            .cone_choices
            .clone()
            .unwrap_or_else(|| shape.flat.layout.cones.iter().map(found).collect()),
        dart: loaded
            .dart_choices
            .clone()
            .unwrap_or_else(|| shape.darts.iter().map(opened).collect()),
        cut: loaded.cut_choices.clone(),
    }
}

pub(crate) fn checked_sigma(sigma: f64) -> Result<f64, MakeError> {
    if sigma > 1.0 && sigma <= 2.0 {
        Ok(sigma)
    } else {
        Err(MakeError::Sigma { sigma })
    }
}

fn check_ranges(accept_distance: f64, stock: &Stock<'_>) -> Result<(), MakeError> {
    let area = stock.area();
    let (width_mm, height_mm) = (area.free.width(), area.free.height());
    // Two triangles and their hinge.
    let least_mm = 2.0 * stock.options.hinge_width_mm + 4.0 * stock.options.kerf_mm;
    if width_mm.min(height_mm) < least_mm {
        return Err(MakeError::NoStock {
            width_mm: width_mm.max(0.0),
            height_mm: height_mm.max(0.0),
            margin_mm: stock.machine.bed.margin_mm,
        });
    }
    for (what, value, least, most) in [
        ("--accept-distance", accept_distance, 0.0, 100.0),
        (
            "the hinge width (--hinge)",
            stock.options.hinge_width_mm,
            0.01,
            100.0,
        ),
        (
            "the width of the cut (--kerf)",
            stock.options.kerf_mm,
            0.01,
            20.0,
        ),
    ] {
        if !(least..=most).contains(&value) {
            return Err(MakeError::Range {
                what,
                value,
                least,
                most,
            });
        }
    }
    Ok(())
}

pub(crate) fn check_sizing(sizing: Sizing) -> Result<(), MakeError> {
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

pub(crate) fn title(source: &Source) -> String {
    match source {
        Source::Sample(text) => text.trim_start_matches("sample:").to_owned(),
        Source::File { path, .. } => path
            .file_stem()
            .map_or_else(|| "surface".into(), |s| s.to_string_lossy().into_owned()),
    }
}

/// A path as seen from `folder`; absolute if the two have nothing in common.
fn relative(path: &Path, folder: &Path) -> String {
    // Without `..` and links, so that the way between them does not depend on how they were named.
    let real = |p: &Path| -> PathBuf {
        let beside = |p: &Path| Some(p.parent()?.canonicalize().ok()?.join(p.file_name()?));
        let absolute = std::path::absolute(p).unwrap_or_else(|_| p.to_path_buf());
        absolute
            .canonicalize()
            .ok()
            .or_else(|| beside(&absolute))
            .unwrap_or(absolute)
    };
    let (path, folder) = (real(path), real(folder));
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

/// Arcs in the report, millimetres: far below a pixel.
const DRAWN_CHORD_MM: f64 = 0.02;

/// The toolpath as the report draws it: cuts in their order, with the moves between them.
fn drawn(toolpath: &Toolpath) -> Vec<Stroke> {
    let flat = |p: kurbo::Point| Point2::new(p.x, p.y);
    let mut strokes = Vec::with_capacity(2 * toolpath.cuts.len());
    let mut at = toolpath.start;
    for cut in &toolpath.cuts {
        let (Some(first), Some(end)) = (cut.start(), cut.end()) else {
            continue;
        };
        strokes.push(Stroke {
            role: report::Role::Travel,
            points: vec![flat(at), flat(first)],
        });
        let role = match cut.role {
            Role::Mark => report::Role::Mark,
            Role::Slit => report::Role::Cut,
            Role::Inner | Role::Outer => report::Role::Contour,
        };
        strokes.push(Stroke {
            role,
            points: [&cut.lead_in, &Some(cut.line.clone()), &cut.lead_out]
                .into_iter()
                .flatten()
                .flat_map(|line| line.flattened(DRAWN_CHORD_MM))
                .map(flat)
                .collect(),
        });
        at = end;
    }
    strokes
}
