//! `report.html`: what was decided, what came out, and where to look.
//!
//! One page that stands alone: style within, pictures as data URIs, drawings as SVG, no script, nothing fetched. It
//! says first whether the job may be cut and why, then shows λ on the layout and on the surface, the linkage, its
//! distance from the surface, the hinges, the sheet and the toolpath, and ends with every figure. [`html`] takes plain
//! data: it measures nothing and decides nothing.

mod histogram;
mod map;
mod margins;
mod strokes;
mod table;
mod text;
mod views;

use std::fmt::Write as _;

use nalgebra::Point3;

pub use histogram::histogram;
pub use map::{MapPage, map_html};
pub use margins::Margins;
pub use strokes::{Role, Stroke};
pub use text::{escape, svg_element};

use super::Verdict;
use super::picture::{ColourScale, Scene, View, legend};
use crate::base::ids::Per;
use crate::base::units::short;
use crate::conformal::Layout;
use crate::linkage::Linkage;
use crate::mesh::{Surface, VertexId};
use crate::pattern::HingeRisk;
use views::{Named, Style};

/// All that the page shows.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// Name of the job.
    pub title: &'a str,
    /// May it be cut?
    pub verdict: &'a Verdict,
    /// Name and value, in the order of reading: what a maker asks first.
    pub summary: &'a [(String, String)],
    /// What is not wrong but should be known, in words.
    pub warnings: &'a [String],
    /// Radius around each cone, on the sheet, in which triangles are removed, millimetres; 0 for none.
    pub cone_opening_mm: f64,
    /// The linkage.
    pub linkage: &'a Linkage,
    /// The linkage on each surface, in the order of the verdict's.
    pub poses: &'a [Pose<'a>],
    /// The distance that the verdict allows, in L.
    pub distance_limit_in_l: f64,
    /// The largest λ that the material allows.
    pub sigma: f64,
    /// What is cut, sheet by sheet; none if nothing may be.
    pub sheets: &'a [DrawnSheet],
    /// `report.json`.
    pub figures: &'a serde_json::Value,
}

/// A sheet and its toolpath.
#[derive(Clone, Debug)]
pub struct DrawnSheet {
    /// Its `pattern.svg`.
    pub svg: String,
    /// The toolpath in the order of the machine.
    pub toolpath: Vec<Stroke>,
}

/// The linkage on one surface.
#[derive(Clone, Copy, Debug)]
pub struct Pose<'a> {
    /// Name of the surface; told where there are several.
    pub name: &'a str,
    /// The surface, millimetres.
    pub surface: &'a Surface,
    /// Its layout; λ is taken from here.
    pub layout: &'a Layout,
    /// Where the linkage's points are in space, millimetres, by point.
    pub positions: &'a [Point3<f64>],
    /// How far they are from the surface, in L, by point.
    pub distances_in_l: &'a [f64],
    /// How much of what the material bears every hinge uses.
    pub risks: &'a [HingeRisk],
    /// How much of what the strips allow every hinge keeps; none where none were pulled.
    pub margins: Option<Margins<'a>>,
    /// λ at every hinge.
    pub openings: &'a [f64],
}

/// Sizes of the pictures, pixels. All together a page stays within 2 MB for a surface of 20 000 faces.
const VIEW_SIZE: [usize; 2] = [520, 520];
const LARGE_SIZE: [usize; 2] = [760, 720];
const LAYOUT_SIZE: [usize; 2] = [900, 640];

/// Reach of the shade between triangles, in L.
const SHADE_REACH: f64 = 0.45;

/// The page as text. Lists that are shorter than the linkage asks for leave out or grey what they do not tell.
pub fn html(page: &Page<'_>) -> String {
    let mut out = String::with_capacity(2 << 20);
    head(&mut out, page.title);
    verdict(&mut out, page);
    summary(&mut out, page.summary);
    warnings(&mut out, page);
    for (n, pose) in page.poses.iter().enumerate() {
        let reasons = page.verdict.reasons.iter().enumerate();
        let places: Vec<(usize, Point3<f64>)> = reasons
            .filter(|(_, r)| r.surface == n)
            .filter_map(|(i, r)| r.at_mm.map(|p| (i + 1, Point3::from(p))))
            .collect();
        if page.poses.len() > 1 {
            let _ = writeln!(out, "<h2 class=\"pose\">On {}</h2>", escape(pose.name));
        }
        let map = Stretch {
            surface: pose.surface,
            layout: pose.layout,
            cone_opening_mm: page.cone_opening_mm,
            sigma: page.sigma,
        };
        stretch(&mut out, &map, &places);
        linkage(&mut out, page, pose, &places);
        hinges(&mut out, page, pose);
        let around = views::around(View::front(pose.surface));
        risks(&mut out, page, pose, &around);
        margins::margins(&mut out, page, pose, &around);
    }
    sheet(&mut out, page);
    toolpath(&mut out, page);
    foot(&mut out, page.figures);
    out
}

fn head(out: &mut String, title: &str) {
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{0} · kagome</title><style>{1}</style></head>\n<body><main><h1>{0}</h1>\n",
        escape(title),
        include_str!("style.css")
    );
}

fn foot(out: &mut String, figures: &serde_json::Value) {
    let _ = write!(
        out,
        "<section><h2>All figures</h2>{}</section>\n</main></body></html>\n",
        table::table(figures)
    );
}

fn verdict(out: &mut String, page: &Page<'_>) {
    let (class, headline) = if page.verdict.pass {
        ("pass", "✓ Pass: this can be cut")
    } else {
        ("fail", "✗ Fail: do not cut this")
    };
    let _ = write!(
        out,
        "<section class=\"verdict {class}\"><strong>{headline}</strong>"
    );
    if !page.verdict.reasons.is_empty() {
        // Numbers lead to the rings on the pictures; where there are none, neither are numbers.
        let numbered = page.verdict.reasons.iter().any(|r| r.at_mm.is_some());
        let list = if numbered { "ol" } else { "ul" };
        let _ = write!(out, "<{list}>");
        for reason in &page.verdict.reasons {
            let _ = write!(out, "<li>{}</li>", escape(&reason.text));
        }
        let _ = write!(out, "</{list}>");
        if numbered {
            out.push_str(
                "<div>The numbers are ringed on the pictures (dashed: behind the object).</div>",
            );
        }
    }
    out.push_str("</section>");
}

fn summary(out: &mut String, lines: &[(String, String)]) {
    if lines.is_empty() {
        return;
    }
    out.push_str("<dl class=\"summary\">");
    for (name, value) in lines {
        let _ = write!(
            out,
            "<div><dt>{}</dt><dd>{}</dd></div>",
            escape(name),
            escape(value)
        );
    }
    out.push_str("</dl>\n");
}

fn warnings(out: &mut String, page: &Page<'_>) {
    if page.warnings.is_empty() {
        return;
    }
    out.push_str("<section class=\"warnings\"><h2>Before you cut</h2><ul>");
    for warning in page.warnings {
        let _ = write!(out, "<li>{}</li>", escape(warning));
    }
    out.push_str("</ul></section>");
}

/// What the pictures of λ are drawn from.
#[derive(Clone, Copy)]
struct Stretch<'a> {
    surface: &'a Surface,
    layout: &'a Layout,
    cone_opening_mm: f64,
    sigma: f64,
}

fn stretch(out: &mut String, map: &Stretch<'_>, places: &[(usize, Point3<f64>)]) {
    let (surface, layout) = (map.surface, map.layout);
    let scale = ColourScale::scale_factor(map.sigma);
    // No number, and so no colour, where nothing is left of the sheet.
    let value = |(x, distance): (&f64, &f64)| {
        if *distance < map.cone_opening_mm {
            f64::NAN
        } else {
            x.exp()
        }
    };
    let around = layout.cone_distance_mm.iter();
    let values: Per<VertexId, f64> = layout.log_scale.iter().zip(around).map(value).collect();
    let _ = write!(
        out,
        "<section><h2>Stretch</h2><p class=\"lead\">How much the sheet must open at each place: λ = 1 is closed, σ = {} is as far as the hinges of this material go. Around a cone whose triangles are removed it is grey.</p><div class=\"key\">{}</div>",
        short(map.sigma, 3),
        legend(
            &scale,
            "",
            "below 1: the sheet cannot shrink, it would overlap",
            "above σ: the hinges would tear"
        )
    );
    let flat = [Named {
        name: "on the flat layout",
        view: View::flat(),
    }];
    let scene = Scene::layout(surface, layout, &values, &scale);
    out.push_str(&views::figures(
        &scene,
        "stretch on the layout",
        &flat,
        Style {
            size: LAYOUT_SIZE,
            shade_mm: 0.0,
        },
        &[],
    ));
    let scene = Scene::surface(surface, &values, &scale);
    let _ = write!(
        out,
        "<div class=\"grid\" style=\"margin-top:12px\">{}</div></section>",
        views::figures(
            &scene,
            "stretch on the surface",
            &views::around(View::front(surface)),
            Style {
                size: VIEW_SIZE,
                shade_mm: 0.0,
            },
            places
        )
    );
}

fn linkage(out: &mut String, page: &Page<'_>, pose: &Pose<'_>, places: &[(usize, Point3<f64>)]) {
    let around = views::around(View::front(pose.surface));
    let scene = Scene::linkage(pose.surface, page.linkage, pose.positions);
    let _ = write!(
        out,
        "<section><h2>The opened sheet</h2><p class=\"lead\">{} rigid triangles of {} mm, joined at {} hinges, as they will stand in space. The pale body is the surface.</p><div class=\"grid two\">{}</div></section>",
        page.linkage.triangles.len(),
        short(page.linkage.edge_mm, 2),
        page.linkage.hinges.len(),
        views::figures(
            &scene,
            "the linkage",
            &around[..2],
            Style {
                size: LARGE_SIZE,
                shade_mm: SHADE_REACH * page.linkage.edge_mm,
            },
            places
        )
    );
    let scale = ColourScale::distance(page.distance_limit_in_l);
    let scene = Scene::linkage_by_value(page.linkage, pose.positions, pose.distances_in_l, &scale);
    let _ = write!(
        out,
        "<section><h2>Distance from the surface</h2><p class=\"lead\">How far the corners of the triangles are from the surface, in triangle edges (L = {} mm).</p><div class=\"key\">{}</div><div class=\"grid\">{}</div></section>",
        short(page.linkage.edge_mm, 2),
        legend(
            &scale,
            " L",
            "",
            &format!(
                "farther than the {} L allowed",
                short(page.distance_limit_in_l, 3)
            )
        ),
        views::figures(
            &scene,
            "distance from the surface",
            &around,
            Style {
                size: VIEW_SIZE,
                shade_mm: 0.0,
            },
            places
        )
    );
}

fn hinges(out: &mut String, page: &Page<'_>, pose: &Pose<'_>) {
    let scale = ColourScale::scale_factor(page.sigma);
    let _ = write!(
        out,
        "<section><h2>Hinges</h2><p class=\"lead\">How far each of the {} hinges is open, from closed (1) to the limit of the material (σ).</p><figure>{}</figure></section>",
        pose.openings.len(),
        histogram(pose.openings, &scale)
    );
}

/// Hinges in the table of those at most risk.
const RISKS_SHOWN: usize = 5;

fn risks(out: &mut String, page: &Page<'_>, pose: &Pose<'_>, around: &[Named]) {
    let mut worst: Vec<&HingeRisk> = pose.risks.iter().filter(|r| r.share.is_finite()).collect();
    if worst.is_empty() || !page.sigma.is_finite() {
        return;
    }
    let mut values = vec![0.0; pose.positions.len()];
    for risk in &worst {
        if let Some(value) = values.get_mut(risk.point as usize) {
            *value = risk.share;
        }
    }
    worst.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.hinge.cmp(&b.hinge)));
    let scale = ColourScale::distance(1.0);
    let scene = Scene::linkage_by_value(page.linkage, pose.positions, &values, &scale);
    let numbered: Vec<(usize, Point3<f64>)> = worst
        .iter()
        .take(RISKS_SHOWN)
        .enumerate()
        .filter_map(|(n, r)| Some((n + 1, *pose.positions.get(r.point as usize)?)))
        .collect();
    let rows: String = worst
        .iter()
        .take(RISKS_SHOWN)
        .enumerate()
        .map(|(n, r)| {
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}°</td><td>{}</td></tr>",
                n + 1,
                short(r.opening, 3),
                short(r.fold_deg, 1),
                short(r.share, 2)
            )
        })
        .collect();
    let _ = write!(
        out,
        "<section><h2>Hinges at risk</h2><p class=\"lead\">Nominal strain of the ligaments, from their opening and from the fold between their triangles, as a share of a flat hinge's at σ. Watch the numbered ones when you open the sheet.</p><div class=\"key\">{}</div><div class=\"grid\">{}</div><table><tr><th>place</th><th>open λ</th><th>fold</th><th>share</th></tr>{rows}</table></section>",
        legend(&scale, "", "", "more than a flat hinge bears at σ"),
        views::figures(
            &scene,
            "strain of the hinges",
            around,
            Style {
                size: VIEW_SIZE,
                shade_mm: 0.0,
            },
            &numbered
        )
    );
}

fn sheet(out: &mut String, page: &Page<'_>) {
    let drawings: Vec<&str> = page
        .sheets
        .iter()
        .filter_map(|s| svg_element(&s.svg))
        .collect();
    if drawings.is_empty() {
        return;
    }
    let (words, key) = if drawings.iter().any(|svg| svg.contains("id=\"flaps\"")) {
        (
            " Shaded rows are flaps: each of their triangles doubles one on the other side of the seam, and is glued on it.",
            "<span style=\"--c:#00a000\">slits of flaps</span>",
        )
    } else {
        ("", "")
    };
    let several = drawings.len() > 1;
    let _ = write!(
        out,
        "<section><h2>The sheet{}</h2><p class=\"lead\">What is cut: slits, then the outline. Every slit ends a hinge's width before its star.{words}</p>",
        if several { "s" } else { "" }
    );
    for (n, svg) in drawings.iter().enumerate() {
        let caption = if several {
            format!("<figcaption>sheet {}</figcaption>", n + 1)
        } else {
            String::new()
        };
        let _ = write!(
            out,
            "<figure class=\"sheet\">{svg}<div class=\"note\"><span style=\"--c:#0000ff\">slits</span>{key}<span style=\"--c:#ff0000\">outline</span></div>{caption}</figure>"
        );
    }
    out.push_str("</section>");
}

fn toolpath(out: &mut String, page: &Page<'_>) {
    for (n, sheet) in page.sheets.iter().enumerate() {
        let name = if page.sheets.len() > 1 {
            format!(", sheet {}", n + 1)
        } else {
            String::new()
        };
        order_of_cutting(out, &name, &sheet.toolpath);
    }
}

fn order_of_cutting(out: &mut String, name: &str, toolpath: &[Stroke]) {
    let Some(svg) = strokes::drawing(toolpath) else {
        return;
    };
    let count = |role: Role| toolpath.iter().filter(|s| s.role == role).count();
    let _ = write!(
        out,
        "<section><h2>Order of cutting{name}</h2><p class=\"lead\">{} strokes for slits and {} for outlines, from the first (dot) to the last.</p><figure class=\"path\">{svg}<div class=\"note\"><span style=\"--c:{}\">first</span><span style=\"--c:{}\">last</span><span style=\"--c:{}\">travel, beam off</span>{}</div></figure></section>",
        count(Role::Cut),
        count(Role::Contour),
        strokes::FIRST.css(),
        strokes::LAST.css(),
        strokes::TRAVEL.css(),
        if count(Role::Mark) > 0 {
            format!(
                "<span style=\"--c:{}\">engraved marks</span>",
                strokes::MARK.css()
            )
        } else {
            String::new()
        }
    );
}

#[cfg(test)]
mod tests;
