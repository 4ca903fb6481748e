//! What is told of a result: a summary for a person, warnings, and every figure for a machine.

use serde_json::{Value, json};

use super::cut::CutResult;
use super::design::Design;
use super::load::Loaded;
use super::maps::Ground;
use super::shape::{Fit, Shape};
use super::targets::Targets;
use super::verdict::place;
use crate::base::units::short;
use crate::conformal::Dart;
use crate::machine::Machine;
use crate::material::{Material, Source as SigmaSource};
use crate::mesh::VertexId;
use crate::pattern::{Figures, HingeRisk, Sheet};

/// What does not forbid the cut but should be known before it.
pub(crate) fn warnings(
    loaded: &Loaded,
    material: &Material,
    measured: bool,
    shape: &Shape,
    sigma: f64,
) -> Vec<String> {
    let (flat, built) = (&shape.flat, &shape.built);
    let mut warnings: Vec<String> = loaded
        .import
        .report
        .repairs()
        .into_iter()
        .map(|r| format!("the mesh was mended: {r}"))
        .collect();
    for also in &loaded.also {
        let repairs = also.import.report.repairs().into_iter();
        warnings.extend(repairs.map(|r| format!("the mesh {} was mended: {r}", also.name)));
    }
    if measured {
        // The strips themselves are asked.
    } else if sigma > material.sigma.max {
        warnings.push(format!(
            "σ = {} was asked for, but the profile {} says {} ({}): hinges are likely to tear. Cut a small trial first",
            short(sigma, 3),
            material.name,
            short(material.sigma.max, 3),
            source_in_words(material.sigma.source),
        ));
    } else if material.sigma.source != SigmaSource::Measured {
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
            "{} faces of the mesh are too thin for the conformal map and lie on the sheet as lines or turned over: remesh evenly for a better map",
            flat.metric.broken.len()
        ));
    }
    if !shape.left_out.is_empty() {
        warnings.push(format!(
            "{} were left out where the sheet cannot follow: openings of their size stay in it",
            match shape.left_out.len() {
                1 => "1 triangle".to_owned(),
                n => format!("{n} triangles"),
            }
        ));
    }
    if let Some(skirt) = &loaded.skirt {
        warnings.extend(skirt.bare_rims.iter().map(|rim| {
            format!(
                "rim {} is too small to be cut smoothly at this triangle size: the sheet follows the triangles there",
                rim + 1
            )
        }));
    }
    if built.lost > 0 {
        warnings.push(format!(
            "at the rim {} hanging by fewer than two others left out",
            if built.lost == 1 {
                "1 triangle was".into()
            } else {
                format!("{} triangles were", built.lost)
            }
        ));
    }
    if let Some(darts) = darts_in_words(&shape.ground) {
        warnings.push(darts);
    }
    if shape.divided {
        warnings.push(format!(
            "the sheet is larger than the stock and was divided along lattice lines into {} pieces on {}: join them along their seams",
            built.pieces,
            match shape.sheets.len() {
                1 => "one sheet".into(),
                n => format!("{n} sheets"),
            }
        ));
    } else if built.pieces > 1 {
        warnings.push(format!(
            "the sheet is cut in {} pieces, because around a cone of negative curvature there is more than lies flat: join them along their seams",
            built.pieces
        ));
    }
    if built.seam_edges > 0 {
        warnings.push(seams(shape));
    }
    warnings
}

/// Says so where fewer tabs hold a part than were asked for each.
pub(crate) fn tabs(shape: &Shape, wanted: usize) -> Option<String> {
    let count = |f: fn(&Sheet) -> usize| shape.sheets.iter().map(f).sum::<usize>();
    let parts = count(|s| s.contours.iter().filter(|c| c.outer).count());
    let found = count(|s| s.tabs.len());
    (found < wanted * parts).then(|| {
        format!(
            "{found} tabs of {} fit: each needs a straight stretch of the rim for itself, twice as long as the tab",
            wanted * parts
        )
    })
}

/// Says so where folds strain hinges beyond what stretching a flat one to σ would.
pub(crate) fn risk(fit: &Fit, risks: &[HingeRisk]) -> Option<String> {
    let beyond = risks.iter().filter(|r| r.share > 1.0).count();
    let worst = risks.iter().max_by(|a, b| a.share.total_cmp(&b.share))?;
    let at = fit.positions.get(worst.point as usize)?;
    (beyond > 0).then(|| {
        format!(
            "at {} the fold between the triangles adds to the stretch, up to {} times the strain of a flat hinge at σ, most near {}: open the sheet there with care, or make the triangles larger or the hinges narrower",
            if beyond == 1 { "1 hinge".to_owned() } else { format!("{beyond} hinges") },
            short(worst.share, 2),
            place(*at)
        )
    })
}

/// What there is to join, and how.
fn seams(shape: &Shape) -> String {
    let (all, count) = (shape.built.seam_edges, shape.flaps.flaps.len());
    let bare = shape.flaps.bare_edges();
    let edges = |n: usize| match n {
        1 => "1 triangle edge".to_owned(),
        n => format!("{n} triangle edges"),
    };
    let head = format!("the sheet has seams of {} in all", edges(all));
    let larger = if shape.flaps_too_large {
        " (rows of flaps to glue them on would make the sheet larger than the bed)"
    } else {
        ""
    };
    match (count, bare) {
        (0, _) => format!("{head}: their two sides must be joined by hand, edge to edge{larger}"),
        (_, 0) => format!(
            "{head}: a row of {count} flap triangles along them doubles the triangles of the other side; glue each on its double"
        ),
        _ => format!(
            "{head}: {count} flap triangles along {} of them double the triangles of the other side; glue each on its double. Along {} there is no room for flaps: join these edge to edge",
            all - bare,
            edges(bare),
        ),
    }
}

/// The open cuts, if there are any: where they are and what they mean.
fn darts_in_words(ground: &Ground) -> Option<String> {
    let at = |v: &VertexId| place(ground.shown().position(*v));
    let each = |dart: &Dart| match (dart.stops.first(), dart.stops.last()) {
        (Some(a), Some(b)) if a != b => format!("from {} to {}", at(a), at(b)),
        (Some(a), _) => format!("around the handle at {}", at(a)),
        _ => String::new(),
    };
    let list: Vec<String> = ground.darts.iter().map(each).collect();
    let (count, verb) = match list.len() {
        0 => return None,
        1 => ("1 cut (a dart)".to_owned(), "is"),
        n => (format!("{n} cuts (darts)"), "are"),
    };
    Some(format!(
        "{count} {verb} left open, where no cone takes up the curvature: {}. The pattern does not go on across them; their sides are only laid together",
        list.join("; ")
    ))
}

fn source_in_words(source: SigmaSource) -> &'static str {
    match source {
        SigmaSource::Measured => "measured",
        SigmaSource::Literature => "from literature",
        SigmaSource::Estimate => "an estimate",
    }
}

/// The result in a few lines: name and value, what a maker asks first.
pub(crate) fn summary(
    material: &Material,
    machine: &Machine,
    shape: &Shape,
    targets: &Targets,
    cuts: &[CutResult],
    sigma: f64,
) -> Vec<(String, String)> {
    let flat = &shape.flat;
    let mut lines = vec![
        ("Material".to_owned(), material.title.clone()),
        ("Machine".to_owned(), machine.title.clone()),
    ];
    for (n, sheet) in shape.sheets.iter().enumerate() {
        let figures = sheet.figures();
        let name = match shape.sheets.len() {
            1 => "Sheet".to_owned(),
            _ => format!("Sheet {}", n + 1),
        };
        lines.push((
            name,
            format!(
                "{} × {} mm, {} cm² of material used{}",
                short(figures.width_mm, 0),
                short(figures.height_mm, 0),
                short(figures.area_mm2 / 100.0, 0),
                cost(material, figures.width_mm * figures.height_mm),
            ),
        ));
    }
    if let Some(sheet) = shape.sheets.first() {
        let figures = total(&shape.sheets);
        lines.push((
            "Pattern".to_owned(),
            format!(
                "{} triangles{}{} of {} mm, {} slits, hinges {} mm wide, cut {} mm wide",
                figures.triangles,
                match figures.flaps {
                    0 => String::new(),
                    n => format!(" and {n} flap triangles"),
                },
                match trimmed(shape) {
                    0 => String::new(),
                    n => format!(", {n} trimmed at the rim,"),
                },
                short(flat.edge_mm, 2),
                figures.slits,
                short(sheet.metadata.hinge_width_mm, 2),
                short(sheet.metadata.kerf_mm, 2),
            ),
        ));
    }
    for (fit, target) in shape.fits.iter().zip(&targets.0) {
        let quality = &fit.quality;
        if targets.several() {
            lines.push(("Surface".to_owned(), target.name.clone()));
        }
        lines.extend([
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
                match quality.distance_max.value * quality.edge_mm {
                    mm if mm < 0.001 => "under 0.001 mm".to_owned(),
                    mm => format!(
                        "at most {} mm ({} of a triangle edge)",
                        short(mm, 3),
                        short(quality.distance_max.value, 4),
                    ),
                },
            ),
        ]);
    }
    for (n, cut) in cuts.iter().enumerate() {
        let name = match cuts.len() {
            1 => "Job".to_owned(),
            _ => format!("Job {}", n + 1),
        };
        lines.push((
            name,
            format!(
                "{} strokes, {} m cut, {} m travel, {} {}",
                cut.toolpath.cuts.len(),
                short(cut.cut_length_mm / 1000.0, 2),
                short(cut.travel_mm / 1000.0, 2),
                duration(cut.machine_s),
                match cut.rehearsal {
                    Some(_) => "on the simulated machine",
                    None => "by the planner",
                },
            ),
        ));
    }
    lines
}

/// Triangles of which a smooth rim cuts off a part.
fn trimmed(shape: &Shape) -> usize {
    let all = shape.linkage.triangles.iter();
    all.filter(|t| t.trim.is_some()).count()
}

/// What the box around a sheet costs, if the material's profile has a price.
fn cost(material: &Material, box_mm2: f64) -> String {
    let (Some(price), Some(currency)) = (material.price_per_m2, &material.currency) else {
        return String::new();
    };
    format!(
        ", {} {currency} with its offcut",
        short(price * box_mm2 * 1e-6, 2)
    )
}

/// Counts and lengths of several sheets together; width and height are the largest.
fn total(sheets: &[Sheet]) -> Figures {
    let mut sum = Figures::default();
    for figures in sheets.iter().map(Sheet::figures) {
        sum.triangles += figures.triangles;
        sum.flaps += figures.flaps;
        sum.slits += figures.slits;
        sum.flap_slits += figures.flap_slits;
        sum.stars += figures.stars;
        sum.contours += figures.contours;
        sum.slit_length_mm += figures.slit_length_mm;
        sum.contour_length_mm += figures.contour_length_mm;
        sum.area_mm2 += figures.area_mm2;
        sum.width_mm = sum.width_mm.max(figures.width_mm);
        sum.height_mm = sum.height_mm.max(figures.height_mm);
    }
    sum
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

/// Every figure, for `report.json` and the end of the page.
pub(crate) fn figures(
    design: &Design,
    loaded: &Loaded,
    shape: &Shape,
    cuts: &[CutResult],
    warnings: &[String],
) -> Value {
    let (flat, built) = (&shape.flat, &shape.built);
    let surface = shape.ground.shown();
    let mut distortion = flat
        .layout
        .quasi_conformal_error(&shape.ground.surface)
        .into_vec();
    distortion.sort_by(f64::total_cmp);
    let at = |part: f64| {
        distortion
            .get((part * (distortion.len() - 1) as f64) as usize)
            .copied()
            .unwrap_or(1.0)
    };
    let sheets: Vec<_> = shape.sheets.iter().map(Sheet::figures).collect();
    let sheet = (!sheets.is_empty()).then(|| total(&shape.sheets));
    let first = shape.first();
    let mut figures = json!({
        "verdict": shape.verdict,
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
            "cones": flat.singularities.cones.iter().map(|c| json!({
                "vertex": u64::from(c.vertex.0) + 1,
                "at_mm": surface.position(c.vertex).coords.as_slice(),
                "units": c.units,
            })).collect::<Vec<_>>(),
            "darts": shape.ground.darts.iter().map(|d| json!({
                "vertices": d.stops.iter().map(|v| u64::from(v.0) + 1).collect::<Vec<_>>(),
                "from_mm": d.stops.first().map(|v| surface.position(*v).coords.as_slice().to_vec()),
                "to_mm": d.stops.last().map(|v| surface.position(*v).coords.as_slice().to_vec()),
            })).collect::<Vec<_>>(),
            "misfit_mm": flat.scale.misfit_mm,
            "rim_turnings_deg": flat.singularities.rim_turnings_deg(),
            "straight_rims": flat.singularities.straight_rims(),
            "distortion_of_fit": shape.distortion,
            "broken_faces": flat.metric.broken.len(),
            "flipped_edges": flat.metric.flips,
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
            "left_out_where_it_fails": shape.left_out.len(),
            "left_out_at_rim": built.lost,
            "trimmed_at_rim": trimmed(shape),
            "seam_edges": built.seam_edges,
            "seam_edges_without_flaps": shape.flaps.bare_edges(),
            "seam_segments": shape.flaps.segments,
            "pieces": built.pieces,
            "overlaps_on_sheet": built.overlaps.len(),
        },
        "solve": { "steps": first.effort.steps, "factorizations": first.effort.factorizations },
        "quality": first.quality,
        "sheet": sheet.map(|s| json!({
            "flap_triangles": s.flaps,
            "slits": s.slits,
            "flap_slits": s.flap_slits,
            "stars": s.stars,
            "contours": s.contours,
            "slit_length_mm": s.slit_length_mm,
            "contour_length_mm": s.contour_length_mm,
            "area_mm2": s.area_mm2,
            "width_mm": s.width_mm,
            "height_mm": s.height_mm,
        })),
        "job": cuts.first().map(CutResult::figures),
    });
    if cuts.len() > 1 {
        figures["sheets"] = json!(sheets);
        figures["jobs"] = Value::Array(cuts.iter().map(CutResult::figures).collect());
    }
    if !loaded.also.is_empty() {
        let further = shape.fits.iter().skip(1).zip(&loaded.also);
        let further = further.map(|(fit, also)| {
            json!({
                "surface": also.name,
                "area_mm2": also.import.surface.area(),
                "solve": { "steps": fit.effort.steps, "factorizations": fit.effort.factorizations },
                "quality": fit.quality,
            })
        });
        figures["also"] = Value::Array(further.collect());
    }
    figures
}
