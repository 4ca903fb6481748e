//! The drawing of a sheet, and reading it back.
//!
//! True to size in millimetres, one group and one colour an operation, Y flipped so that a viewer shows what the beam
//! strikes. The slits of doubled rows have a group of their own, `flaps`; the contour goes around sheet and flaps, for a
//! part is cut out along one closed line. Numbers that are not geometry ride along as `data-kagome-*` attributes of the root.

use kurbo::{Point, Rect};
use svg::node::element::{Circle, Group, Path};

use super::mark::{Mark, MarkKind};
use super::sheet::{Contour, Sheet, SheetMetadata, Slit, Tab, Tip};
use crate::base::curve::{Curve, Piece, Vertex};
use crate::base::units::{fixed, short};

/// A tenth of a micrometre: a hundredth of what the verifier tolerates.
const DECIMALS: usize = 4;

/// The version of the attributes and groups.
const FORMAT: &str = "1";

/// Coordinates beyond a kilometre belong to no sheet, millimetres.
const LARGEST_MM: f64 = 1e6;

/// Shorter pieces have no direction at the precision of the file, millimetres.
const SHORTEST_MM: f64 = 1e-3;

/// Colours as laser programs sort operations by them.
const CONTOUR: &str = "#ff0000";
const SLITS: &str = "#0000ff";
const FLAPS: &str = "#00a000";
const GUIDE: &str = "#c0c0c0";
const MARKS: &str = "#000000";

const TIP_RADIUS: &str = "data-kagome-tip-radius-mm";
const CORNER_RADIUS: &str = "data-kagome-corner-radius-mm";

fn tip_words(tip: Tip) -> Option<(&'static str, f64)> {
    match tip {
        Tip::Plain => None,
        Tip::Round { radius_mm } => Some(("round", radius_mm)),
        Tip::Teardrop { radius_mm } => Some(("teardrop", radius_mm)),
    }
}

/// The class of a flap triangle's outline.
const FLAP: &str = "flap";

/// The sheet as SVG text.
pub fn svg(sheet: &Sheet) -> String {
    // Rounded first, so that the page fits what is written and not what was meant.
    let round = |v: f64| (v * 1e4).round() / 1e4;
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

/// Why an SVG is not read as a sheet.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SvgError {
    /// Not XML.
    #[error("this is not an SVG: {0}")]
    NotXml(String),
    /// XML of another kind, or without our attributes.
    #[error("{0}. Only an SVG that kagome wrote (its `pattern.svg`) can be read as a sheet")]
    NotOurs(String),
    /// A number is missing or wrong.
    #[error("the SVG's attribute {attribute} {problem}")]
    Attribute {
        /// Its name.
        attribute: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// An element that cannot be cut as it is.
    #[error("line {line} of the SVG: {problem}")]
    Element {
        /// Line, counted from 1.
        line: u32,
        /// What is wrong, and what to do.
        problem: String,
    },
}

/// Reads an SVG that [`svg()`] wrote.
///
/// # Errors
/// [`SvgError`] with the line: not ours, a transform, a path that is not straight, a slit that is not one line.
pub fn read_svg(text: &str) -> Result<Sheet, SvgError> {
    let document = roxmltree::Document::parse(text).map_err(|e| SvgError::NotXml(e.to_string()))?;
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        let name = root.tag_name().name();
        return Err(SvgError::NotOurs(format!(
            "the file's root is <{name}>, not <svg>"
        )));
    }
    match root.attribute("data-kagome-format") {
        Some(FORMAT) => {}
        Some(other) => {
            return Err(SvgError::Attribute {
                attribute: "data-kagome-format",
                problem: format!("is {other:?}, and this build reads {FORMAT:?}"),
            });
        }
        None => {
            return Err(SvgError::NotOurs(
                "the root has no data-kagome-format".into(),
            ));
        }
    }
    let metadata = SheetMetadata {
        edge_mm: positive(root, "data-kagome-edge-mm")?,
        hinge_width_mm: positive(root, "data-kagome-hinge-width-mm")?,
        kerf_mm: positive(root, "data-kagome-kerf-mm")?,
        tip: match root.attribute("data-kagome-tip") {
            None => Tip::Plain,
            Some("round") => Tip::Round {
                radius_mm: positive(root, TIP_RADIUS)?,
            },
            Some("teardrop") => Tip::Teardrop {
                radius_mm: positive(root, TIP_RADIUS)?,
            },
            Some(other) => {
                return Err(SvgError::Attribute {
                    attribute: "data-kagome-tip",
                    problem: format!(
                        "is {other:?}; it may be \"round\" or \"teardrop\", or be left out"
                    ),
                });
            }
        },
        corner_radius_mm: match root.attribute(CORNER_RADIUS) {
            None => 0.0,
            Some(_) => positive(root, CORNER_RADIUS)?,
        },
    };
    let mut sheet = Sheet {
        slits: Vec::new(),
        contours: Vec::new(),
        triangles: Vec::new(),
        flaps: Vec::new(),
        marks: Vec::new(),
        tabs: Vec::new(),
        metadata,
    };
    for node in root.descendants().filter(roxmltree::Node::is_element) {
        // The line is counted from the start of the file, so only for an error.
        let wrong = |problem: String| SvgError::Element {
            line: document.text_pos_at(node.range().start).row,
            problem,
        };
        if node.has_attribute("transform") {
            return Err(wrong(
                "a transform moves this part; apply it in the drawing program first".into(),
            ));
        }
        let group = node.ancestors().skip(1).find_map(|a| a.attribute("id"));
        match (node.tag_name().name(), group) {
            ("svg" | "g", _) => {}
            ("circle", Some("tabs")) => {
                let number = |name: &str| {
                    let value = node.attribute(name).and_then(|v| v.parse::<f64>().ok());
                    value
                        .filter(|v| v.abs() <= LARGEST_MM)
                        .ok_or_else(|| wrong(format!("a tab without a plain {name}")))
                };
                sheet.tabs.push(Tab {
                    at: Point::new(number("cx")?, -number("cy")?),
                    width_mm: 2.0 * number("r")?,
                });
            }
            ("path", Some("marks")) => {
                let name = node.attribute("class").unwrap_or("");
                let kind = MarkKind::ALL.iter().find(|(_, n)| *n == name);
                let d = node.attribute("d").unwrap_or("");
                sheet.marks.push(Mark {
                    kind: kind.map_or(MarkKind::Name, |k| k.0),
                    lines: curves(d).map_err(wrong)?,
                    label: None,
                });
            }
            ("path", Some(group @ ("guide" | "slits" | "flaps" | "contour"))) => {
                let d = node.attribute("d").unwrap_or("");
                let mut all = curves(d).map_err(wrong)?;
                let line = match all.len() {
                    1 => all.remove(0),
                    _ => return Err(wrong("one path holds several lines; split it".into())),
                };
                let is_closed = line.closed;
                let straight = line.pieces().all(|p| p.bulge == 0.0);
                let points: Vec<Point> = line.vertices.iter().map(|v| v.at).collect();
                if !straight && group != "contour" {
                    return Err(wrong(format!(
                        "a curve in the group `{group}`, which has straight lines only"
                    )));
                }
                match (group, is_closed, points.len()) {
                    ("guide", true, 3) => {
                        let flap = node.attribute("class") == Some(FLAP);
                        let list = if flap {
                            &mut sheet.flaps
                        } else {
                            &mut sheet.triangles
                        };
                        list.push([points[0], points[1], points[2]]);
                    }
                    ("slits" | "flaps", false, 2) => sheet.slits.push(Slit {
                        tail: points[0],
                        tip: points[1],
                        star: node
                            .attribute("data-star")
                            .and_then(|s| s.parse().ok())
                            .ok_or_else(|| wrong("a slit without a number in data-star".into()))?,
                        flap: group == "flaps",
                    }),
                    ("contour", true, 2..) => sheet.contours.push(Contour {
                        outer: line.signed_area() > 0.0,
                        line,
                    }),
                    _ => {
                        return Err(wrong(format!(
                            "a path of {} points, {}, does not belong into the group `{group}`",
                            points.len(),
                            if is_closed { "closed" } else { "open" }
                        )));
                    }
                }
            }
            (name, _) => return Err(wrong(format!("<{name}> is nothing that a sheet has"))),
        }
    }
    if sheet.contours.is_empty() {
        return Err(SvgError::NotOurs("the drawing has no contour".into()));
    }
    // Slits along flaps belong to the stars of the sheet; the sort keeps the order in each.
    sheet.slits.sort_by_key(|slit| slit.star);
    Ok(sheet)
}

fn positive(root: roxmltree::Node<'_, '_>, attribute: &'static str) -> Result<f64, SvgError> {
    let wrong = |problem: String| SvgError::Attribute { attribute, problem };
    let text = root
        .attribute(attribute)
        .ok_or_else(|| wrong("is missing".into()))?;
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() && v > 0.0 => Ok(v),
        _ => Err(wrong(format!("is {text:?}, not a length above 0"))),
    }
}

/// The lines of path data in the sheet's frame.
fn curves(d: &str) -> Result<Vec<Curve>, String> {
    let mut all: Vec<Curve> = Vec::new();
    let mut words = d
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|w| !w.is_empty())
        .flat_map(|w| {
            // A letter stands before its first number without a space.
            let split = usize::from(w.starts_with(|c: char| c.is_ascii_alphabetic()));
            let (letter, number) = w.split_at(split);
            [letter, number].into_iter().filter(|part| !part.is_empty())
        })
        .peekable();
    let mut command = "";
    let bad = |what: &str| format!("path data {d:?} {what}");
    while let Some(word) = words.peek().copied() {
        if word.starts_with(|c: char| c.is_ascii_alphabetic()) {
            command = word;
            words.next();
        }
        let mut number = || -> Result<f64, String> {
            let value = words.next().and_then(|w| w.parse::<f64>().ok());
            match value {
                Some(v) if v.abs() <= LARGEST_MM => Ok(v),
                Some(_) => Err(bad("has a coordinate that is on no sheet")),
                None => Err(bad("has no number where one is due")),
            }
        };
        let bulge_to = match command {
            "M" => {
                let at = Point::new(number()?, -number()?);
                all.push(Curve::polyline([at], false));
                // Further pairs after a move are lines.
                command = "L";
                continue;
            }
            "L" => None,
            "A" => {
                let (rx, ry) = (number()?, number()?);
                let (_turn, large, sweep) = (number()?, number()?, number()?);
                if (rx - ry).abs() > 1e-3 * rx {
                    return Err(bad("has an arc of an ellipse"));
                }
                Some((rx, large != 0.0, sweep != 0.0))
            }
            "Z" => {
                match all.last_mut() {
                    Some(line) if !line.closed => close(line),
                    _ => return Err(bad("closes what is not open")),
                }
                command = "";
                continue;
            }
            _ => {
                return Err(bad(
                    "has a curve; a sheet has straight lines and arcs of circles only",
                ));
            }
        };
        let to = Point::new(number()?, -number()?);
        let line = match all.last_mut() {
            Some(line) if !line.closed => line,
            _ => return Err(bad("draws on from nowhere")),
        };
        if let (Some(last), Some((radius, large, clockwise))) = (line.vertices.last_mut(), bulge_to)
        {
            let half = (0.5 * last.at.distance(to) / radius).min(1.0).asin();
            let half = if large {
                std::f64::consts::PI - half
            } else {
                half
            };
            last.bulge = (0.5 * half).tan() * if clockwise { -1.0 } else { 1.0 };
        }
        line.vertices.push(Vertex { at: to, bulge: 0.0 });
    }
    for line in &all {
        if !line.is_finite() || line.is_empty() {
            return Err(bad("has a line without length"));
        }
        if line
            .pieces()
            .any(|p: Piece| p.from.distance(p.to) < SHORTEST_MM)
        {
            return Err(bad("has two neighbouring points on one spot"));
        }
    }
    Ok(all)
}

/// Joins the end of a line to its beginning; an end that is there already is dropped.
fn close(line: &mut Curve) {
    let (first, last) = (
        line.vertices.first().copied(),
        line.vertices.last().copied(),
    );
    if let (Some(first), Some(last)) = (first, last)
        && line.vertices.len() > 2
        && first.at.distance(last.at) < 2e-4
    {
        line.vertices.pop();
    }
    line.closed = true;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage};
    use crate::pattern::SheetOptions;

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

    #[test]
    fn a_drawing_that_is_no_sheet_is_refused_with_the_line() {
        let good = svg(&sheet());
        for (from, to, word) in [
            ("<svg", "<html", "not an SVG"),
            ("data-kagome-format=\"1\"", "", "data-kagome-format"),
            (
                "data-kagome-kerf-mm=\"0.15\"",
                "data-kagome-kerf-mm=\"nan\"",
                "kerf",
            ),
            ("<path", "<path transform=\"scale(2)\"", "transform"),
            ("<path", "<text", "<text>"),
            ("L", "Q1,1 ", "line 3"),
        ] {
            let bad = good.replacen(from, to, 1);
            assert_ne!(bad, good, "the fixture changed: {from}");
            let text = read_svg(&bad).unwrap_err().to_string();
            assert!(text.contains(word), "{text}");
        }
        let root = &good[..good.find('>').unwrap()];
        for (path, word) in [
            ("", "no contour"),
            (
                "<g id='contour'><path d='M0,0 L5,0 L5,0 L0,5 Z'/></g>",
                "one spot",
            ),
            (
                "<g id='contour'><path d='M0,0 L1e300,0 L0,5 Z'/></g>",
                "on no sheet",
            ),
            ("<g id='contour'><path d='M0,0 L5,0 L0,5'/></g>", "open"),
        ] {
            let text = read_svg(&format!("{root}>{path}</svg>"))
                .unwrap_err()
                .to_string();
            assert!(text.contains(word), "{text}");
        }
        assert!(read_svg("<svg/>").is_err() && read_svg("").is_err() && read_svg("<a/>").is_err());
    }
}
