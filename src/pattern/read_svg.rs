//! Reading the drawing of a sheet back, also after somebody edited it.
//!
//! Drawing programs keep the lines and little else: they move groups by transforms, rename ids, write styles instead of
//! attributes, paths with other commands, other units. All that is understood. What a line is for is told by the layer
//! that it is in, else by its colour. Slits that begin at one point are one star, whatever the numbers in the file say, so
//! that slits may be moved, deleted and added. What cannot be cut as it is drawn, text, images, clones, fills, is refused
//! with its line: nothing is read by half.

use std::collections::BTreeMap;

use kurbo::{Affine, Point};

use super::mark::{Mark, MarkKind};
use super::path_data::{self, LARGEST_MM, close, curves, similarity};
use super::sheet::{Contour, Sheet, SheetMetadata, Slit, Tab, Tip};
use super::svg::{CONTOUR, CORNER_RADIUS, FLAP, FLAPS, FORMAT, GUIDE, MARKS, SLITS, TIP_RADIUS};
use crate::base::curve::Curve;
use crate::base::plane;
use crate::base::units::short;

/// Millimetres to one pixel of SVG.
const PIXEL_MM: f64 = 25.4 / 96.0;

/// A drawing whose size is off by more than this part is another size: hinges would have another width.
const SAME_SIZE: f64 = 1e-4;

/// Slits that begin within this distance begin at one point, millimetres: programs round.
const ONE_POINT_MM: f64 = 0.01;

/// Groups in groups, at the most.
const DEEPEST: usize = 60;

const SVG: &str = "http://www.w3.org/2000/svg";
const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";

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

/// A sheet as it was drawn, and what was noticed and does no harm.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// The sheet.
    pub sheet: Sheet,
    /// What was left out or understood with reservations, in words.
    pub warnings: Vec<String>,
}

/// Reads an SVG that [`super::svg()`] wrote, as it is or edited.
///
/// # Errors
/// As [`read_drawing`].
pub fn read_svg(text: &str) -> Result<Sheet, SvgError> {
    read_drawing(text).map(|drawing| drawing.sheet)
}

/// As [`read_svg`], with what was noticed. Places are those of the file: X as in the user's coordinates, Y negated, in
/// millimetres, wherever the page lies.
///
/// # Errors
/// [`SvgError`] with the line: not ours, another size, something that is no line of a sheet, a slit that is not straight.
pub fn read_drawing(text: &str) -> Result<Drawing, SvgError> {
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
    let mut reader = Reader {
        document: &document,
        sheet: Sheet {
            slits: Vec::new(),
            contours: Vec::new(),
            triangles: Vec::new(),
            flaps: Vec::new(),
            marks: Vec::new(),
            tabs: Vec::new(),
            metadata: metadata(root)?,
        },
        slits: Vec::new(),
        outer: Vec::new(),
        guide_left_out: 0,
        mirrored_marks: false,
        warnings: Vec::new(),
    };
    let scale = scale_of_page(root)?;
    let start = State {
        map: Affine::new([scale, 0.0, 0.0, -scale, 0.0, 0.0]),
        layer: None,
        stroke: None,
        fill: None,
        depth: 0,
    };
    reader.children(
        root,
        &start.within(root).map_err(|p| reader.wrong(root, p))?,
    )?;
    reader.finish()
}

fn metadata(root: Node<'_>) -> Result<SheetMetadata, SvgError> {
    Ok(SheetMetadata {
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
    })
}

fn positive(root: Node<'_>, attribute: &'static str) -> Result<f64, SvgError> {
    let wrong = |problem: String| SvgError::Attribute { attribute, problem };
    let text = root
        .attribute(attribute)
        .ok_or_else(|| wrong("is missing".into()))?;
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() && v > 0.0 => Ok(v),
        _ => Err(wrong(format!("is {text:?}, not a length above 0"))),
    }
}

/// A length with its unit, millimetres.
fn length_mm(text: &str) -> Option<f64> {
    let text = text.trim();
    let end = text
        .find(|c: char| c.is_ascii_alphabetic() && !matches!(c, 'e' | 'E') || c == '%')
        .unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let unit_mm = match unit {
        "mm" => 1.0,
        "cm" => 10.0,
        "in" => 25.4,
        "pt" => 25.4 / 72.0,
        "pc" => 25.4 / 6.0,
        "px" | "" => PIXEL_MM,
        _ => return None,
    };
    let value = number.trim().parse::<f64>().ok()? * unit_mm;
    (value.is_finite() && value > 0.0).then_some(value)
}

/// Millimetres to one unit of the file.
fn scale_of_page(root: Node<'_>) -> Result<f64, SvgError> {
    let Some(text) = root.attribute("viewBox") else {
        return Ok(PIXEL_MM);
    };
    let wrong =
        |attribute: &'static str, problem: String| SvgError::Attribute { attribute, problem };
    let view = path_data::numbers(text).filter(|v| v.len() == 4 && v[2] > 0.0 && v[3] > 0.0);
    let Some(view) = view else {
        return Err(wrong("viewBox", format!("is {text:?}, not four numbers")));
    };
    let side = |name: &'static str| -> Result<f64, SvgError> {
        let text = root.attribute(name).unwrap_or("");
        length_mm(text).ok_or_else(|| {
            wrong(
                name,
                format!("is {text:?}, so that the size of the drawing is unknown; set the page's size in mm"),
            )
        })
    };
    let (x, y) = (side("width")? / view[2], side("height")? / view[3]);
    if (x / y - 1.0).abs() > 1e-3 {
        return Err(wrong(
            "viewBox",
            format!(
                "has other proportions than width and height: one unit is {} mm across and {} mm down",
                short(x, 6),
                short(y, 6)
            ),
        ));
    }
    Ok(x)
}

type Node<'a> = roxmltree::Node<'a, 'a>;

/// What a line of the drawing is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layer {
    Guide,
    Slits,
    Flaps,
    Marks,
    Contour,
    Tabs,
}

const LAYERS: [(Layer, &str, &str); 6] = [
    (Layer::Guide, "guide", GUIDE),
    (Layer::Slits, "slits", SLITS),
    (Layer::Flaps, "flaps", FLAPS),
    (Layer::Marks, "marks", MARKS),
    (Layer::Contour, "contour", CONTOUR),
    // Drawn in the colour of the guide: never found by it.
    (Layer::Tabs, "tabs", ""),
];

impl Layer {
    fn name(self) -> &'static str {
        LAYERS.iter().find(|l| l.0 == self).map_or("", |l| l.1)
    }

    /// By a layer's name or id, to which programs append numbers.
    fn named(text: &str) -> Option<Self> {
        let text = text.trim().to_ascii_lowercase();
        let begins = |name: &str| {
            text.strip_prefix(name)
                .is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_alphabetic()))
        };
        LAYERS.iter().find(|l| begins(l.1)).map(|l| l.0)
    }

    /// By the colour of a line.
    fn coloured(text: &str) -> Option<Self> {
        let text = text.trim().to_ascii_lowercase();
        let colour = match text.as_str() {
            "red" => "#ff0000".to_owned(),
            "blue" => "#0000ff".to_owned(),
            "black" => "#000000".to_owned(),
            other => match other.strip_prefix('#') {
                Some(digits) if digits.chars().count() == 3 => {
                    let double = digits.chars().flat_map(|c| [c, c]);
                    std::iter::once('#').chain(double).collect()
                }
                Some(_) => other.to_owned(),
                None => {
                    let inside = other.strip_prefix("rgb(")?.strip_suffix(')')?;
                    let rgb = path_data::numbers(inside).filter(|v| v.len() == 3)?;
                    let byte = |v: f64| v.round().clamp(0.0, 255.0) as u8;
                    format!(
                        "#{:02x}{:02x}{:02x}",
                        byte(rgb[0]),
                        byte(rgb[1]),
                        byte(rgb[2])
                    )
                }
            },
        };
        LAYERS.iter().find(|l| l.2 == colour).map(|l| l.0)
    }
}

/// What a group hands down to what is in it.
#[derive(Clone)]
struct State {
    /// To the sheet's frame.
    map: Affine,
    layer: Option<Layer>,
    stroke: Option<String>,
    fill: Option<String>,
    depth: usize,
}

/// A property, as a style or as an attribute.
fn property<'a>(node: Node<'a>, name: &str) -> Option<&'a str> {
    let in_style = node.attribute("style").and_then(|style| {
        let all = style.split(';').filter_map(|p| p.split_once(':'));
        // The last one of a name holds.
        all.rev()
            .find(|(key, _)| key.trim() == name)
            .map(|(_, value)| value.trim())
    });
    in_style.or_else(|| node.attribute(name))
}

impl State {
    fn within(&self, node: Node<'_>) -> Result<Self, String> {
        let mut state = self.clone();
        if let Some(text) = property(node, "transform") {
            state.map *= path_data::transform(text)?;
        }
        if matches!(node.tag_name().name(), "g" | "svg" | "a") {
            let label = node.attribute((INKSCAPE, "label"));
            let names = [label, node.attribute("id")];
            state.layer = names
                .into_iter()
                .flatten()
                .find_map(Layer::named)
                .or(self.layer);
        }
        for (name, place) in [("stroke", &mut state.stroke), ("fill", &mut state.fill)] {
            if let Some(value) = property(node, name).filter(|v| *v != "inherit") {
                *place = Some(value.to_owned());
            }
        }
        state.depth += 1;
        Ok(state)
    }
}

struct Reader<'a> {
    document: &'a roxmltree::Document<'a>,
    sheet: Sheet,
    /// Slits with the star that the file says they belong to.
    slits: Vec<(Slit, Option<u32>)>,
    /// For every contour whether the file says that it is an outer one.
    outer: Vec<Option<bool>>,
    guide_left_out: usize,
    mirrored_marks: bool,
    warnings: Vec<String>,
}

impl<'a> Reader<'a> {
    /// The line is counted from the start of the file, so only for a message.
    fn line(&self, node: Node<'_>) -> u32 {
        self.document.text_pos_at(node.range().start).row
    }

    fn wrong(&self, node: Node<'_>, problem: impl Into<String>) -> SvgError {
        SvgError::Element {
            line: self.line(node),
            problem: problem.into(),
        }
    }

    fn children(&mut self, node: Node<'a>, state: &State) -> Result<(), SvgError> {
        if state.depth > DEEPEST {
            return Err(self.wrong(node, "too many groups in one another; ungroup them"));
        }
        for child in node.children().filter(Node::is_element) {
            self.element(child, state)?;
        }
        Ok(())
    }

    fn element(&mut self, node: Node<'a>, state: &State) -> Result<(), SvgError> {
        // Programs keep their own notes in other namespaces.
        if node.tag_name().namespace().is_some_and(|ns| ns != SVG) {
            return Ok(());
        }
        let name = node.tag_name().name();
        let state = state.within(node).map_err(|p| self.wrong(node, p))?;
        let hidden = property(node, "display") == Some("none")
            || property(node, "visibility") == Some("hidden");
        match name {
            // What is defined is not drawn, and a clone that would draw it is refused.
            "defs" | "metadata" | "title" | "desc" | "namedview" => Ok(()),
            "style" | "script" => {
                self.warnings.push(format!(
                    "line {} of the SVG: <{name}> is not understood; colours and visibility that it sets are ignored",
                    self.line(node)
                ));
                Ok(())
            }
            // The guide is for the eye and tells what hangs together, seen or not.
            _ if hidden && state.layer != Some(Layer::Guide) => {
                self.warnings.push(format!(
                    "line {} of the SVG: what is hidden there is left out{}",
                    self.line(node),
                    state.layer.map_or(String::new(), |l| format!(" (in the layer {})", l.name()))
                ));
                Ok(())
            }
            "g" | "a" => self.children(node, &state),
            "path" | "line" | "polyline" | "polygon" | "circle" | "ellipse" | "rect" => {
                self.shape(node, &state)
            }
            _ if state.layer == Some(Layer::Guide) => {
                self.guide_left_out += 1;
                Ok(())
            }
            "text" | "flowRoot" => Err(self.wrong(
                node,
                "text cannot be engraved as it is: turn it into a path of single lines in the layer marks, or delete it",
            )),
            "image" => Err(self.wrong(node, "an image cannot be cut: delete it, or trace it into lines")),
            "use" => Err(self.wrong(node, "a clone is not read: unlink it (in Inkscape Alt+Shift+D), so that it is lines of its own")),
            "svg" => Err(self.wrong(node, "a drawing within the drawing; ungroup it")),
            _ => Err(self.wrong(node, format!("<{name}> is nothing that a sheet has; delete it"))),
        }
    }

    /// The lines of a shape in the sheet's frame.
    fn lines(&self, node: Node<'a>, map: &Affine) -> Result<Vec<Curve>, SvgError> {
        let number = |name: &str| -> Result<f64, SvgError> {
            let value = node.attribute(name).unwrap_or("0").trim();
            let value = value.trim_end_matches("px").parse::<f64>().ok();
            value
                .filter(|v| v.abs() <= LARGEST_MM)
                .ok_or_else(|| self.wrong(node, format!("{name} is not a plain number")))
        };
        let text = match node.tag_name().name() {
            "path" => node.attribute("d").unwrap_or("").to_owned(),
            "line" => {
                format!(
                    "M{} {}L{} {}",
                    number("x1")?,
                    number("y1")?,
                    number("x2")?,
                    number("y2")?
                )
            }
            name @ ("polyline" | "polygon") => {
                let end = if name == "polygon" { "Z" } else { "" };
                format!("M{}{end}", node.attribute("points").unwrap_or(""))
            }
            name @ ("circle" | "ellipse") => {
                let (x, y) = (number("cx")?, number("cy")?);
                let [rx, ry] = if name == "circle" {
                    ["r"; 2]
                } else {
                    ["rx", "ry"]
                };
                let (rx, ry) = (number(rx)?, number(ry)?);
                format!(
                    "M{} {y}A{rx} {ry} 0 0 1 {} {y}A{rx} {ry} 0 0 1 {} {y}Z",
                    x + rx,
                    x - rx,
                    x + rx
                )
            }
            _ => {
                if number("rx")? != 0.0 || number("ry")? != 0.0 {
                    return Err(self.wrong(node, "a rounded rectangle; turn it into a path"));
                }
                let (x, y) = (number("x")?, number("y")?);
                let (w, h) = (number("width")?, number("height")?);
                format!("M{x} {y}h{w}v{h}h{}z", -w)
            }
        };
        curves(&text, map).map_err(|p| self.wrong(node, p))
    }

    fn shape(&mut self, node: Node<'a>, state: &State) -> Result<(), SvgError> {
        let by_colour = || state.stroke.as_deref().and_then(Layer::coloured);
        let Some(layer) = state.layer.or_else(by_colour) else {
            return Err(self.wrong(
                node,
                "it is in no layer of the sheet, and its colour is that of none: move it into the layer slits, flaps, contour, marks or guide, or delete it",
            ));
        };
        let Some(scale) = similarity(&state.map) else {
            return Err(self.wrong(
                node,
                "a transform skews it, or stretches it more in one direction than in another; undo that",
            ));
        };
        if (scale - 1.0).abs() > SAME_SIZE && layer != Layer::Marks {
            return Err(self.wrong(
                node,
                format!(
                    "it was scaled to {} %: hinges and slits would no longer have their widths. Undo that, and make the sheet anew in the size that is wanted (kagome make --scale)",
                    short(100.0 * scale, 2)
                ),
            ));
        }
        let filled = state
            .fill
            .as_deref()
            .is_some_and(|f| f != "none" && f != "transparent");
        if filled && layer != Layer::Guide {
            return Err(self.wrong(
                node,
                format!(
                    "a filled shape in the layer {}: only lines are cut; set its fill to none",
                    layer.name()
                ),
            ));
        }
        let all = match self.lines(node, &state.map) {
            Ok(all) => all,
            Err(_) if layer == Layer::Guide => {
                self.guide_left_out += 1;
                return Ok(());
            }
            Err(error) => return Err(error),
        };
        let plain = |line: &Curve| line.pieces().all(|p| p.bulge == 0.0);
        match layer {
            Layer::Guide => {
                for line in all {
                    let points: Vec<Point> = line.vertices.iter().map(|v| v.at).collect();
                    match points[..] {
                        [a, b, c] if line.closed && plain(&line) => {
                            let flap = node.attribute("class") == Some(FLAP);
                            let list = if flap {
                                &mut self.sheet.flaps
                            } else {
                                &mut self.sheet.triangles
                            };
                            list.push([a, b, c]);
                        }
                        _ => self.guide_left_out += 1,
                    }
                }
            }
            Layer::Slits | Layer::Flaps => {
                for line in all {
                    let points: Vec<Point> = line.vertices.iter().map(|v| v.at).collect();
                    let [tail, tip] = points[..] else {
                        return Err(self.wrong(
                            node,
                            format!(
                                "a slit is one straight line, and this has {} points; divide it at them",
                                points.len()
                            ),
                        ));
                    };
                    if line.closed || !plain(&line) {
                        return Err(self.wrong(
                            node,
                            format!(
                                "a curve in the layer {}, which has straight lines only",
                                layer.name()
                            ),
                        ));
                    }
                    let slit = Slit {
                        tail,
                        tip,
                        star: 0,
                        flap: layer == Layer::Flaps,
                        through: false,
                    };
                    let star = node.attribute("data-star").and_then(|s| s.parse().ok());
                    self.slits.push((slit, star));
                }
            }
            Layer::Contour => {
                for mut line in all {
                    let ends = line.start().zip(line.end());
                    if !line.closed && ends.is_some_and(|(a, b)| a.distance(b) < 2e-4) {
                        close(&mut line);
                    }
                    if !line.closed || line.len() < 2 {
                        return Err(self.wrong(
                            node,
                            "a contour that is open: join its ends, or move the line into another layer",
                        ));
                    }
                    self.sheet.contours.push(Contour { outer: true, line });
                    self.outer.push(match node.attribute("class") {
                        Some("outer") => Some(true),
                        Some("inner") => Some(false),
                        _ => None,
                    });
                }
            }
            Layer::Marks => {
                let name = node.attribute("class").unwrap_or("");
                let kind = MarkKind::ALL.iter().find(|(_, n)| *n == name);
                self.mirrored_marks |= state.map.determinant() > 0.0;
                self.sheet.marks.push(Mark {
                    kind: kind.map_or(MarkKind::Name, |k| k.0),
                    lines: all,
                    label: None,
                });
            }
            Layer::Tabs => {
                for line in all {
                    let arc = line.pieces().next().and_then(|p| p.arc());
                    let Some(arc) = arc.filter(|_| line.closed && line.len() >= 2) else {
                        return Err(self.wrong(node, "a tab is a circle around its place"));
                    };
                    self.sheet.tabs.push(Tab {
                        at: arc.centre,
                        width_mm: 2.0 * arc.radius,
                    });
                }
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Drawing, SvgError> {
        if self.sheet.contours.is_empty() {
            return Err(SvgError::NotOurs("the drawing has no contour".into()));
        }
        if self.guide_left_out > 0 {
            self.warnings.push(format!(
                "the layer guide holds {} thing{} that no triangle outlines are; they are ignored",
                self.guide_left_out,
                if self.guide_left_out == 1 { "" } else { "s" }
            ));
        }
        if self.mirrored_marks && !self.sheet.marks.is_empty() {
            self.warnings.push(
                "the drawing was mirrored, and its text with it: marks will be engraved reversed. `kagome make --mirror` writes them readable".into(),
            );
        }
        orient(&mut self.sheet.contours, &self.outer);
        self.sheet.slits = starred(self.slits);
        self.sheet.find_through();
        Ok(Drawing {
            sheet: self.sheet,
            warnings: self.warnings,
        })
    }
}

/// Turns contours so that the material is on their left. Which are outer ones the file says, or how they lie in each other.
fn orient(contours: &mut [Contour], told: &[Option<bool>]) {
    let loops: Vec<Vec<Point>> = contours.iter().map(|c| c.line.flattened(0.01)).collect();
    let boxes: Vec<_> = contours.iter().map(|c| c.line.bounds()).collect();
    for n in 0..contours.len() {
        let outer = told[n].unwrap_or_else(|| {
            let Some(p) = contours[n].line.start() else {
                return true;
            };
            let around = (0..loops.len())
                .filter(|&m| m != n && boxes[m].is_some_and(|b| b.contains(p)))
                .filter(|&m| plane::encloses(&loops[m], p));
            around.count() % 2 == 0
        });
        let contour = &mut contours[n];
        contour.outer = outer;
        if (contour.line.signed_area() > 0.0) != outer {
            contour.line = contour.line.reversed();
        }
    }
}

/// Slits star by star. A star are the slits that begin at one point; those that the file numbers keep the order of their
/// numbers, and of an added line the end at a star, if one is there, is its beginning.
fn starred(mut slits: Vec<(Slit, Option<u32>)>) -> Vec<Slit> {
    // Points where slits begin or end, as numbers: one for all that are close to each other.
    let mut points = Points::default();
    let mut ends: Vec<[usize; 2]> = slits
        .iter()
        .map(|(s, _)| [points.number(s.tail), points.number(s.tip)])
        .collect();
    let mut begun = vec![0usize; points.all.len()];
    ends.iter().for_each(|e| begun[e[0]] += 1);
    // Drawing programs may turn a line round: its beginning is where others begin.
    for ((slit, _), ends) in slits.iter_mut().zip(&mut ends) {
        if begun[ends[0]] == 1 && begun[ends[1]] > 0 {
            begun[ends[0]] -= 1;
            begun[ends[1]] += 1;
            std::mem::swap(&mut slit.tail, &mut slit.tip);
            ends.swap(0, 1);
        }
    }
    // Where most slits of a number begin is its home. Two stars that touch in a point have different numbers; a slit that
    // was moved away from its star joins the one that it is at now.
    let mut counts: BTreeMap<(u32, usize), usize> = BTreeMap::new();
    for ((_, star), ends) in slits.iter().zip(&ends) {
        if let Some(star) = star {
            *counts.entry((*star, ends[0])).or_insert(0) += 1;
        }
    }
    let mut home: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    for (&(star, point), &count) in &counts {
        let best = home.entry(star).or_insert((count, point));
        if count > best.0 {
            *best = (count, point);
        }
    }
    let mut at: BTreeMap<usize, u32> = BTreeMap::new();
    for (&star, &(_, point)) in &home {
        at.entry(point).or_insert(star);
    }
    let mut order: Vec<(u32, usize, usize)> = (0..slits.len())
        .map(|n| {
            let point = ends[n][0];
            let own = slits[n]
                .1
                .filter(|s| home.get(s).is_some_and(|h| h.1 == point));
            let told = own.or_else(|| at.get(&point).copied());
            (told.unwrap_or(u32::MAX), point, n)
        })
        .collect();
    order.sort_unstable();
    let mut stars = Vec::with_capacity(slits.len());
    let mut star = 0;
    for (k, &(told, point, n)) in order.iter().enumerate() {
        let before = k.checked_sub(1).map(|b| order[b]);
        if before.is_some_and(|(t, p, _)| (t, p) != (told, point)) {
            star += 1;
        }
        stars.push(Slit { star, ..slits[n].0 });
    }
    stars
}

/// Numbers for points, one for all within [`ONE_POINT_MM`] of the first.
#[derive(Default)]
struct Points {
    all: Vec<Point>,
    cells: BTreeMap<(i64, i64), Vec<usize>>,
}

impl Points {
    fn number(&mut self, p: Point) -> usize {
        let cell = |v: f64| (v / ONE_POINT_MM).floor() as i64;
        let (x, y) = (cell(p.x), cell(p.y));
        let around = (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| (x, y)));
        let known = around
            .filter_map(|c| self.cells.get(&c))
            .flatten()
            .copied()
            .find(|&n| self.all[n].distance(p) <= ONE_POINT_MM);
        known.unwrap_or_else(|| {
            self.all.push(p);
            let n = self.all.len() - 1;
            self.cells.entry((x, y)).or_default().push(n);
            n
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage, cylinder_with_flaps};
    use crate::pattern::{MarkOptions, SheetOptions, marks, svg};

    fn hexagon() -> Sheet {
        let cells = Linkage::hexagon_cells(3);
        let linkage = Linkage::patch(10.0, Handedness::Left, &cells);
        let options = SheetOptions {
            corner_radius_mm: 0.3,
            tip: Tip::Round { radius_mm: 0.3 },
            ..SheetOptions::plain(0.7, 0.15)
        };
        let mut sheet = Sheet::new(&linkage, &options).unwrap();
        let told = MarkOptions {
            name: "hex",
            back: false,
        };
        sheet.marks = marks(&linkage, &sheet, &told);
        sheet.tabs = sheet.even_tabs(2, 0.5);
        sheet
    }

    fn same(a: &Sheet, b: &Sheet, shift: kurbo::Vec2) {
        let near = |p: Point, q: Point| p.distance(q + shift) < 2e-3;
        assert_eq!(a.slits.len(), b.slits.len());
        for (s, t) in a.slits.iter().zip(&b.slits) {
            assert!(near(s.tail, t.tail) && near(s.tip, t.tip), "{s:?} {t:?}");
            assert_eq!((s.star, s.flap), (t.star, t.flap));
        }
        assert_eq!(a.contours.len(), b.contours.len());
        for (s, t) in a.contours.iter().zip(&b.contours) {
            assert_eq!(s.outer, t.outer);
            assert!((s.line.signed_area() - t.line.signed_area()).abs() < 1e-2);
            assert!((s.line.length() - t.line.length()).abs() < 1e-2);
        }
        assert_eq!(a.tabs.len(), b.tabs.len());
        for (s, t) in a.tabs.iter().zip(&b.tabs) {
            assert!(near(s.at, t.at) && (s.width_mm - t.width_mm).abs() < 1e-3);
        }
        let ink = |s: &Sheet| -> f64 {
            s.marks
                .iter()
                .flat_map(Mark::strokes)
                .map(|l| l.length())
                .sum()
        };
        assert!((ink(a) - ink(b)).abs() < 0.05, "{} {}", ink(a), ink(b));
        assert_eq!(a.metadata, b.metadata);
    }

    #[test]
    fn what_drawing_programs_make_of_it_is_the_same_sheet() {
        let sheet = hexagon();
        let text = svg(&sheet);
        same(&read_svg(&text).unwrap(), &sheet, kurbo::Vec2::ZERO);

        // A page in pixels: everything within the groups enlarged to match.
        let size = |name: &str| -> f64 {
            let at = text.find(&format!("{name}=\"")).unwrap() + name.len() + 2;
            text[at..].split("mm").next().unwrap().parse().unwrap()
        };
        let pixels = 96.0 / 25.4;
        let page = |t: &str| {
            let (w, h) = (size("width"), size("height"));
            t.replace(
                &format!("width=\"{w}mm\""),
                &format!("width=\"{}\"", w * pixels),
            )
            .replace(
                &format!("height=\"{h}mm\""),
                &format!("height=\"{}px\"", h * pixels),
            )
        };
        let drawing = read_drawing(&page(&text)).unwrap();
        same(&drawing.sheet, &sheet, kurbo::Vec2::ZERO);
        assert!(drawing.warnings.is_empty());

        // Ids renamed, layers told by label; styles in place of attributes; transforms; clutter; no star numbers.
        let changed = text
            .replace("id=\"slits\"", "id=\"g123\" transform=\"translate(3,4)\"")
            .replace("id=\"contour\"", "id=\"contour-7\" transform=\"matrix(1 0 0 1 3 4)\"")
            .replace("id=\"tabs\"", "id=\"layer9\" transform=\"translate(13,4) translate(-10)\"")
            .replace("id=\"marks\"", "id=\"marks\" style=\"fill:none;display:inline\"")
            .replace("stroke=\"#0000ff\"", "style=\"stroke:#00f;fill:none\"")
            .replace(" data-star=\"", " data-other=\"")
            .replacen(
                "<g ",
                "<!-- edited --><defs id='d'><path d='x'/></defs><metadata><a xmlns='urn:x'/></metadata>\
                 <sodipodi:namedview xmlns:sodipodi='http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd' units='px'/><g ",
                1,
            );
        let moved = read_drawing(&changed).unwrap();
        same(&moved.sheet, &sheet, kurbo::Vec2::new(3.0, -4.0));
        assert!(moved.warnings.is_empty(), "{:?}", moved.warnings);

        // No groups at all: by colour.
        let flat = text
            .replace("inkscape:label=\"", "data-l=\"")
            .replace("id=\"slits\"", "id=\"a\"")
            .replace("id=\"contour\"", "id=\"b\"")
            .replace("id=\"guide\"", "id=\"c\"")
            .replace("id=\"marks\"", "id=\"d\"");
        same(&read_svg(&flat).unwrap(), &sheet, kurbo::Vec2::ZERO);
    }

    #[test]
    fn a_mirrored_drawing_keeps_the_material_on_the_left_and_says_so() {
        let sheet = hexagon();
        let text = svg(&sheet).replace("<g ", "<g transform=\"scale(-1,1)\" ");
        let drawing = read_drawing(&text).unwrap();
        assert!(drawing.sheet.contours[0].outer);
        let area = |s: &Sheet| s.contours[0].line.signed_area();
        assert!((area(&drawing.sheet) - area(&sheet)).abs() < 1e-2);
        assert_eq!(drawing.sheet.slits.len(), sheet.slits.len());
        assert!(
            drawing.warnings[0].contains("mirrored"),
            "{:?}",
            drawing.warnings
        );
    }

    #[test]
    fn slits_may_be_deleted_turned_round_and_added() {
        let sheet = hexagon();
        let text = svg(&sheet);
        let whole = read_svg(&text).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        // The first of a star of three.
        let first = whole
            .slits
            .windows(3)
            .find(|w| w[0].star == w[2].star)
            .unwrap()[0];
        let number = format!("data-star=\"{}\"", first.star);
        let at = lines.iter().position(|l| l.contains(&number)).unwrap();
        // Deleted: one less, and the numbers have no gaps.
        let without: Vec<&str> = (0..lines.len())
            .filter(|n| *n != at)
            .map(|n| lines[n])
            .collect();
        let fewer = read_svg(&without.join("\n")).unwrap();
        assert_eq!(fewer.slits.len() + 1, whole.slits.len());
        let stars: Vec<u32> = fewer.slits.iter().map(|s| s.star).collect();
        assert!(stars[0] == 0 && stars.windows(2).all(|w| w[1] == w[0] || w[1] == w[0] + 1));
        // Added without a number, from the wrong end, as a <line>: in its star again.
        let mut added = without.clone();
        let line = format!(
            "<line x1='{}' y1='{}' x2='{}' y2='{}'/>",
            first.tip.x, -first.tip.y, first.tail.x, -first.tail.y
        );
        added.insert(at, &line);
        let again = read_svg(&added.join("\n")).unwrap();
        same(&again, &whole, kurbo::Vec2::ZERO);
        // Alone somewhere: a star of its own.
        let mut alone = lines.clone();
        alone.insert(at, "<path d='m 1000 1000 h 3'/>");
        let more = read_svg(&alone.join("\n")).unwrap();
        let last = more.slits.last().unwrap();
        assert_eq!(last.star, whole.slits.last().unwrap().star + 1);
        assert_eq!(last.tail, Point::new(1000.0, -1000.0));
    }

    #[test]
    fn flaps_and_touching_stars_keep_their_numbers() {
        let (linkage, flaps) = cylinder_with_flaps(8.0, 7, 4);
        let sheet = Sheet::with_flaps(&linkage, &flaps, &SheetOptions::plain(0.7, 0.15)).unwrap();
        let read = read_svg(&svg(&sheet)).unwrap();
        same(&read, &sheet, kurbo::Vec2::ZERO);
        assert_eq!(svg(&read), svg(&sheet));
    }

    #[test]
    fn a_drawing_that_is_no_sheet_is_refused_with_the_line() {
        let good = svg(&hexagon());
        let contour = "inkscape:label=\"contour\"";
        for (from, to, word) in [
            ("<svg", "<html", "not an SVG"),
            ("data-kagome-format=\"1\"", "", "data-kagome-format"),
            (
                "data-kagome-kerf-mm=\"0.15\"",
                "data-kagome-kerf-mm=\"nan\"",
                "kerf",
            ),
            ("mm\" viewBox", "furlong\" viewBox", "height"),
            ("viewBox=\"", "viewBox=\"9 9 9 1 ", "viewBox"),
            (
                contour,
                "inkscape:label=\"contour\" transform=\"scale(1.2)\"",
                "120 %",
            ),
            (
                contour,
                "inkscape:label=\"contour\" transform=\"skewX(9)\"",
                "skews",
            ),
            (
                contour,
                "inkscape:label=\"contour\" transform=\"turn(9)\"",
                "cannot be read",
            ),
            (
                "fill=\"none\" id=\"contour\"",
                "fill=\"#123\" id=\"contour\"",
                "filled",
            ),
            ("</svg>", "<text>A</text></svg>", "text cannot"),
            ("</svg>", "<image/></svg>", "image"),
            ("</svg>", "<use href='#slits'/></svg>", "clone"),
            ("</svg>", "<symbol/></svg>", "<symbol>"),
            ("</svg>", "<path d='M0 0h9'/></svg>", "in no layer"),
            (
                "</svg>",
                "<path stroke='#123456' d='M0 0h9'/></svg>",
                "in no layer",
            ),
            (
                "</svg>",
                "<path stroke='#00f' d='M0 0h9v9'/></svg>",
                "3 points",
            ),
            (
                "</svg>",
                "<path stroke='#00f' d='M0 0c0 5 5 9 9 9'/></svg>",
                "one straight line",
            ),
            (
                "</svg>",
                "<path stroke='#00f' d='M0 0a5 5 0 0 1 5 5'/></svg>",
                "straight lines only",
            ),
            ("</svg>", "<path stroke='red' d='M0 0h9v9'/></svg>", "open"),
            (
                "</svg>",
                "<rect stroke='red' rx='2' width='9' height='9'/></svg>",
                "rounded",
            ),
            (
                "</svg>",
                "<ellipse stroke='red' rx='2' ry='1'/></svg>",
                "ellipse",
            ),
        ] {
            let bad = good.replacen(from, to, 1);
            assert_ne!(bad, good, "the fixture changed: {from}");
            let text = read_svg(&bad).unwrap_err().to_string();
            assert!(text.contains(word), "{to}: {text}");
            if from == "</svg>" {
                assert!(
                    text.starts_with(&format!("line {}", good.lines().count())),
                    "{text}"
                );
            }
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
        let deep = format!("{root}>{}{}</svg>", "<g>".repeat(200), "</g>".repeat(200));
        assert!(read_svg(&deep).unwrap_err().to_string().contains("groups"));
    }

    #[test]
    fn what_is_left_out_is_told() {
        let good = svg(&hexagon());
        for (from, to, word) in [
            (
                "id=\"marks\"",
                "id=\"marks\" style=\"display:none\"",
                "hidden",
            ),
            ("</svg>", "<style>a{}</style></svg>", "<style>"),
            (
                "</g>",
                "<text>look</text><path d='M0 0h4'/></g>",
                "2 things",
            ),
        ] {
            let drawing = read_drawing(&good.replacen(from, to, 1)).unwrap();
            assert!(drawing.warnings[0].contains(word), "{:?}", drawing.warnings);
            assert_eq!(drawing.sheet.slits.len(), hexagon().slits.len());
        }
    }
}
