//! The drawing of a sheet; [`super::read_svg()`] takes it back.
//!
//! True to size in millimetres, one group and one colour an operation, each a layer of its own in Inkscape, Y flipped so that a viewer shows what the beam
//! strikes. The slits of doubled rows have a group of their own, `flaps`; the contour goes around sheet and flaps, for a
//! part is cut out along one closed line. Numbers that are not geometry ride along as `data-kagome-*` attributes of the root.

use kurbo::{Point, Rect};
use svg::node::element::{Circle, Group, Path};

use super::mark::MarkKind;
use super::sheet::{Sheet, Tip};
use crate::base::curve::Curve;
use crate::base::units::{fixed, rounded, short};

/// A tenth of a micrometre: a hundredth of what the verifier tolerates.
const DECIMALS: usize = 4;

/// The version of the attributes and groups.
pub(super) const FORMAT: &str = "1";

/// Colours as laser programs sort operations by them.
pub(super) const CONTOUR: &str = "#ff0000";
pub(super) const SLITS: &str = "#0000ff";
pub(super) const FLAPS: &str = "#00a000";
pub(super) const GUIDE: &str = "#c0c0c0";
pub(super) const MARKS: &str = "#000000";

pub(super) const TIP_RADIUS: &str = "data-kagome-tip-radius-mm";
pub(super) const CORNER_RADIUS: &str = "data-kagome-corner-radius-mm";

fn tip_words(tip: Tip) -> Option<(&'static str, f64)> {
    match tip {
        Tip::Plain => None,
        Tip::Round { radius_mm } => Some(("round", radius_mm)),
        Tip::Teardrop { radius_mm } => Some(("teardrop", radius_mm)),
    }
}

/// The class of a flap triangle's outline.
pub(super) const FLAP: &str = "flap";

/// The sheet as SVG text.
pub fn svg(sheet: &Sheet) -> String {
    // Rounded first, so that the page fits what is written and not what was meant.
    let round = |v: f64| rounded(v, DECIMALS as i32);
    let b = sheet.bounds();
    let bounds = Rect::new(round(b.x0), round(b.y0), round(b.x1), round(b.y1));
    // Room for half the cut and a stroke.
    let room = 1.0f64.max(2.0 * sheet.metadata.kerf_mm);
    let view = bounds.inflate(room, room);
    let (width, height) = (
        short(view.width(), DECIMALS),
        short(view.height(), DECIMALS),
    );
    let group = |id: &str, colour: &str, stroke: &str| {
        Group::new()
            .set("id", id)
            .set("inkscape:groupmode", "layer")
            .set("inkscape:label", id)
            .set("fill", "none")
            .set("stroke", colour)
            .set("stroke-width", stroke)
    };
    let mut guide = group("guide", GUIDE, "0.05");
    for triangle in &sheet.triangles {
        guide = guide.add(Path::new().set("d", closed(triangle)));
    }
    for triangle in &sheet.flaps {
        guide = guide.add(Path::new().set("class", FLAP).set("d", closed(triangle)));
    }
    let lines = |id: &str, colour: &str, flap: bool| {
        let chosen = sheet.slits.iter().filter(|slit| slit.flap == flap);
        chosen.fold(group(id, colour, "0.1"), |lines, slit| {
            lines.add(
                Path::new()
                    .set("d", data(&Curve::line(slit.tail, slit.tip)))
                    .set("data-star", slit.star.to_string()),
            )
        })
    };
    let mut contour = group("contour", CONTOUR, "0.1");
    for c in &sheet.contours {
        let class = if c.outer { "outer" } else { "inner" };
        contour = contour.add(Path::new().set("class", class).set("d", data(&c.line)));
    }
    let m = &sheet.metadata;
    let mut document = svg::Document::new()
        .set(
            "xmlns:inkscape",
            "http://www.inkscape.org/namespaces/inkscape",
        )
        .set("width", format!("{width}mm"))
        .set("height", format!("{height}mm"))
        .set(
            "viewBox",
            format!(
                "{} {} {width} {height}",
                fixed(view.x0, DECIMALS),
                fixed(-view.y1, DECIMALS)
            ),
        )
        .set("data-kagome-format", FORMAT)
        .set("data-kagome-edge-mm", exact(m.edge_mm))
        .set("data-kagome-hinge-width-mm", exact(m.hinge_width_mm))
        .set("data-kagome-kerf-mm", exact(m.kerf_mm));
    if let Some((shape, radius_mm)) = tip_words(m.tip) {
        document = document
            .set("data-kagome-tip", shape)
            .set(TIP_RADIUS, exact(radius_mm));
    }
    if m.corner_radius_mm > 0.0 {
        document = document.set(CORNER_RADIUS, exact(m.corner_radius_mm));
    }
    document = document.add(guide).add(lines("slits", SLITS, false));
    if !sheet.flaps.is_empty() {
        document = document.add(lines("flaps", FLAPS, true));
    }
    if !sheet.marks.is_empty() {
        let mut marks = group("marks", MARKS, "0.1");
        for mark in &sheet.marks {
            let name = MarkKind::ALL.iter().find(|(k, _)| *k == mark.kind);
            let strokes: Vec<String> = mark.strokes().iter().map(data).collect();
            marks = marks.add(
                Path::new()
                    .set("class", name.map_or("", |n| n.1))
                    .set("d", strokes.join(" ")),
            );
        }
        document = document.add(marks);
    }
    document = document.add(contour);
    if !sheet.tabs.is_empty() {
        let mut tabs = group("tabs", GUIDE, "0.1");
        for tab in &sheet.tabs {
            tabs = tabs.add(
                Circle::new()
                    .set("cx", fixed(tab.at.x, DECIMALS))
                    .set("cy", fixed(-tab.at.y, DECIMALS))
                    .set("r", exact(0.5 * tab.width_mm)),
            );
        }
        document = document.add(tabs);
    }
    format!("{document}\n")
}

/// The shortest decimals that give the same number back.
fn exact(value: f64) -> String {
    format!("{value}")
}

fn closed(points: &[Point]) -> String {
    data(&Curve::polyline(points.iter().copied(), true))
}

/// Arcs are written in parts of no more than this, radians: at a half turn the radius, rounded, would say nothing of
/// where the centre is.
const LARGEST_ARC: f64 = 1.8;

/// Path data with fixed decimals: the svg crate's own builder rounds to f32. Arcs stay arcs.
fn data(curve: &Curve) -> String {
    let at = |p: Point| format!("{},{}", fixed(p.x, DECIMALS), fixed(-p.y, DECIMALS));
    let mut parts: Vec<String> = curve
        .start()
        .map(|p| format!("M{}", at(p)))
        .into_iter()
        .collect();
    let n = curve.len();
    for (i, piece) in curve.pieces().enumerate() {
        match piece.arc() {
            Some(arc) => {
                let count = (arc.sweep.abs() / LARGEST_ARC).ceil().max(1.0);
                let radius = fixed(arc.radius, DECIMALS);
                // Y points down in the file, so that a turn to the left is one against the clock for the viewer.
                let sweep = u8::from(arc.sweep < 0.0);
                for k in 1..=count as usize {
                    let to = piece.at(k as f64 / count);
                    parts.push(format!("A{radius},{radius} 0 0 {sweep} {}", at(to)));
                }
            }
            None if curve.closed && i + 1 == n => {}
            None => parts.push(format!("L{}", at(piece.to))),
        }
    }
    if curve.closed {
        parts.push("Z".into());
    }
    parts.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage};
    use crate::pattern::{SheetOptions, read_svg};

    fn sheet() -> Sheet {
        let mut cells = Linkage::hexagon_cells(3);
        cells.retain(|c| !Linkage::hexagon_cells(1).contains(c));
        Sheet::new(
            &Linkage::patch(10.0 / 3.0, Handedness::Left, &cells),
            &SheetOptions::plain(0.7, 0.15),
        )
        .unwrap()
    }

    #[test]
    fn what_is_written_is_read_back_to_the_last_decimal_and_written_the_same_again() {
        let (one, text) = (sheet(), svg(&sheet()));
        let two = read_svg(&text).unwrap();
        assert_eq!(two.metadata, one.metadata);
        let close = |a: Point, b: Point| a.distance(b) < 1e-4;
        assert_eq!(one.slits.len(), two.slits.len());
        for (a, b) in one.slits.iter().zip(&two.slits) {
            assert!(close(a.tail, b.tail) && close(a.tip, b.tip) && a.star == b.star);
        }
        assert_eq!(one.contours.len(), 2);
        for (a, b) in one.contours.iter().zip(&two.contours) {
            assert_eq!(a.outer, b.outer);
            assert!(
                a.line
                    .vertices
                    .iter()
                    .zip(&b.line.vertices)
                    .all(|(p, q)| close(p.at, q.at))
            );
        }
        assert_eq!(svg(&two), text);
        assert!(!text.contains("-0.0000"));
    }

    #[test]
    fn flaps_have_a_group_of_their_own_and_are_read_back() {
        let (linkage, flaps) = crate::linkage::cylinder_with_flaps(8.0, 7, 4);
        let one = Sheet::with_flaps(&linkage, &flaps, &SheetOptions::plain(0.7, 0.15)).unwrap();
        let text = svg(&one);
        let document = roxmltree::Document::parse(&text).unwrap();
        let root = document.root_element();
        let groups: Vec<_> = root.children().filter_map(|n| n.attribute("id")).collect();
        assert_eq!(groups, ["guide", "slits", "flaps", "contour"]);
        let two = read_svg(&text).unwrap();
        assert_eq!(two.flaps.len(), 7);
        assert_eq!(two.triangles.len(), one.triangles.len());
        // In the same order too: strokes go through pairs of a star.
        let names = |s: &Sheet| -> Vec<_> { s.slits.iter().map(|s| (s.star, s.flap)).collect() };
        assert_eq!(names(&one), names(&two));
        for (a, b) in one.slits.iter().zip(&two.slits) {
            assert!(a.tail.distance(b.tail) < 1e-4 && a.tip.distance(b.tip) < 1e-4);
        }
        assert_eq!(svg(&two), text);
    }

    #[test]
    fn the_page_is_true_to_size() {
        let text = svg(&sheet());
        let document = roxmltree::Document::parse(&text).unwrap();
        let root = document.root_element();
        let view: Vec<f64> = root
            .attribute("viewBox")
            .unwrap()
            .split(' ')
            .map(|v| v.parse().unwrap())
            .collect();
        assert_eq!(
            root.attribute("width").unwrap(),
            format!("{}mm", short(view[2], 4))
        );
        assert!((view[2] - (sheet().bounds().width() + 2.0)).abs() < 1e-3);
        let groups: Vec<_> = root.children().filter_map(|n| n.attribute("id")).collect();
        assert_eq!(groups, ["guide", "slits", "contour"]);
    }
}
