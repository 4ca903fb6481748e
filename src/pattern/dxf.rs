//! The sheet as DXF, for programs that read no SVG or lose its size.
//!
//! AutoCAD R12 text, which everything reads: millimetres, Y up, one layer and one colour an operation, arcs as bulges of
//! polylines and therefore exact. Slits are what the middle of the beam follows, with wide tips and rounded corners of
//! their stars; contours are the edge that remains, as in the SVG: the kerf is for the cutting program to allow for.

use std::fmt::Write as _;

use super::sheet::Sheet;
use super::star::Star;
use crate::base::curve::Curve;
use crate::base::units::fixed;

/// A picometre would be noise; a hundredth of a micrometre keeps arcs tangential.
const DECIMALS: usize = 5;

/// Bulges are ratios.
const BULGE_DECIMALS: usize = 9;

/// Layers with their colours, numbered as every such program does: red 1, green 3, blue 5, black or white 7, grey 8 and 9.
const LAYERS: [(&str, u8); 6] = [
    ("contour", 1),
    ("slits", 5),
    ("flaps", 3),
    ("marks", 7),
    ("guide", 9),
    ("tabs", 8),
];

struct Writer {
    text: String,
}

impl Writer {
    /// A group: its code and its value, each on a line. Writing into a String cannot fail.
    fn put(&mut self, code: u16, value: impl std::fmt::Display) {
        let _ = write!(self.text, "{code:>3}\n{value}\n");
    }

    fn point(&mut self, first: u16, x: f64, y: f64) {
        self.put(first, fixed(x, DECIMALS));
        self.put(first + 10, fixed(y, DECIMALS));
    }

    fn curve(&mut self, layer: &str, curve: &Curve) {
        if curve.is_empty() {
            return;
        }
        self.put(0, "POLYLINE");
        self.put(8, layer);
        self.put(66, 1);
        self.point(10, 0.0, 0.0);
        self.put(30, fixed(0.0, DECIMALS));
        self.put(70, u8::from(curve.closed));
        for vertex in &curve.vertices {
            self.put(0, "VERTEX");
            self.put(8, layer);
            self.point(10, vertex.at.x, vertex.at.y);
            self.put(30, fixed(0.0, DECIMALS));
            if vertex.bulge != 0.0 {
                self.put(42, fixed(vertex.bulge, BULGE_DECIMALS));
            }
        }
        self.put(0, "SEQEND");
        self.put(8, layer);
    }
}

/// The sheet as DXF text.
pub fn dxf(sheet: &Sheet) -> String {
    let mut out = Writer {
        text: String::with_capacity(400 * sheet.slits.len() + 4000),
    };
    let bounds = sheet.bounds();
    out.put(0, "SECTION");
    out.put(2, "HEADER");
    out.put(9, "$ACADVER");
    out.put(1, "AC1009");
    // Millimetres: not yet in R12, and read by those who came later.
    out.put(9, "$INSUNITS");
    out.put(70, 4);
    out.put(9, "$MEASUREMENT");
    out.put(70, 1);
    for (name, x, y) in [
        ("$EXTMIN", bounds.x0, bounds.y0),
        ("$EXTMAX", bounds.x1, bounds.y1),
    ] {
        out.put(9, name);
        out.point(10, x, y);
        out.put(30, fixed(0.0, DECIMALS));
    }
    out.put(0, "ENDSEC");
    out.put(0, "SECTION");
    out.put(2, "TABLES");
    out.put(0, "TABLE");
    out.put(2, "LTYPE");
    out.put(70, 1);
    out.put(0, "LTYPE");
    out.put(2, "CONTINUOUS");
    out.put(70, 0);
    out.put(3, "Solid line");
    out.put(72, 65);
    out.put(73, 0);
    out.put(40, "0.0");
    out.put(0, "ENDTAB");
    out.put(0, "TABLE");
    out.put(2, "LAYER");
    out.put(70, LAYERS.len() + 1);
    for (name, colour) in [("0", 7)].into_iter().chain(LAYERS) {
        out.put(0, "LAYER");
        out.put(2, name);
        out.put(70, 0);
        out.put(62, colour);
        out.put(6, "CONTINUOUS");
    }
    out.put(0, "ENDTAB");
    out.put(0, "ENDSEC");
    out.put(0, "SECTION");
    out.put(2, "ENTITIES");
    for triangle in sheet.triangles.iter().chain(&sheet.flaps) {
        out.curve("guide", &Curve::polyline(*triangle, true));
    }
    for slits in sheet.slits.chunk_by(|a, b| a.star == b.star) {
        let star = Star::new(slits, &sheet.metadata);
        for (n, line) in star.lines().enumerate() {
            // The arms come first, one a slit.
            let flap = slits.get(n).is_some_and(|s| s.flap);
            out.curve(if flap { "flaps" } else { "slits" }, &line);
        }
    }
    for line in sheet.marks.iter().flat_map(|m| m.strokes()) {
        out.curve("marks", &line);
    }
    for contour in &sheet.contours {
        out.curve("contour", &contour.line);
    }
    for tab in &sheet.tabs {
        out.put(0, "CIRCLE");
        out.put(8, "tabs");
        out.point(10, tab.at.x, tab.at.y);
        out.put(30, fixed(0.0, DECIMALS));
        out.put(40, fixed(0.5 * tab.width_mm, DECIMALS));
    }
    out.put(0, "ENDSEC");
    out.put(0, "EOF");
    out.text
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use kurbo::Point;

    use super::*;
    use crate::base::curve::Vertex;
    use crate::linkage::cylinder_with_flaps;
    use crate::pattern::{MarkOptions, SheetOptions, Tip, marks};

    /// Polylines by layer, from the groups of a DXF alone.
    fn polylines(text: &str) -> BTreeMap<String, Vec<Curve>> {
        let lines: Vec<&str> = text.lines().collect();
        let groups: Vec<(u16, &str)> = lines
            .chunks(2)
            .map(|c| (c[0].trim().parse().unwrap(), c[1]))
            .collect();
        let mut all: BTreeMap<String, Vec<Curve>> = BTreeMap::new();
        let mut curve: Option<(String, Curve)> = None;
        let (mut inside, mut at) = ("", 0.0);
        for (code, value) in groups {
            match (code, value) {
                (0, "POLYLINE") => (inside, curve) = ("POLYLINE", Some(Default::default())),
                (0, "SEQEND") => {
                    let (layer, curve) = curve.take().unwrap();
                    all.entry(layer).or_default().push(curve);
                    inside = "";
                }
                (0, other) => inside = other,
                _ => {}
            }
            let Some((layer, curve)) = &mut curve else {
                continue;
            };
            match (inside, code) {
                ("POLYLINE", 8) => *layer = value.into(),
                ("POLYLINE", 70) => curve.closed = value == "1",
                ("VERTEX", 10) => at = value.parse().unwrap(),
                ("VERTEX", 20) => curve.vertices.push(Vertex {
                    at: Point::new(at, value.parse().unwrap()),
                    bulge: 0.0,
                }),
                ("VERTEX", 42) => curve.vertices.last_mut().unwrap().bulge = value.parse().unwrap(),
                _ => {}
            }
        }
        all
    }

    #[test]
    fn every_line_of_the_sheet_is_in_its_layer_with_its_arcs() {
        let (linkage, flaps) = cylinder_with_flaps(12.0, 7, 4);
        let options = SheetOptions {
            tip: Tip::Teardrop { radius_mm: 0.5 },
            corner_radius_mm: 0.4,
            alignment_hole_mm: 1.5,
            ..SheetOptions::plain(0.8, 0.2)
        };
        let mut sheet = Sheet::with_flaps(&linkage, &flaps, &options).unwrap();
        let told = MarkOptions {
            name: "tube",
            back: false,
        };
        sheet.marks = marks(&linkage, &sheet, &told);
        sheet.tabs = sheet.even_tabs(3, 0.5);
        let text = dxf(&sheet);
        let read = polylines(&text);
        let length = |layer: &str| read[layer].iter().map(Curve::length).sum::<f64>();
        let wanted = |lines: Vec<Curve>| lines.iter().map(Curve::length).sum::<f64>();
        let stars = sheet.slits.chunk_by(|a, b| a.star == b.star);
        let slits = stars.flat_map(|s| Star::new(s, &sheet.metadata).lines().collect::<Vec<_>>());
        for (found, wanted) in [
            (length("slits") + length("flaps"), wanted(slits.collect())),
            (
                length("contour"),
                wanted(sheet.contours.iter().map(|c| c.line.clone()).collect()),
            ),
            (
                length("marks"),
                wanted(sheet.marks.iter().flat_map(|m| m.strokes()).collect()),
            ),
        ] {
            assert!((found - wanted).abs() < 1e-2, "{found} {wanted}");
        }
        assert_eq!(
            read["guide"].len(),
            sheet.triangles.len() + sheet.flaps.len()
        );
        let area: f64 = read["contour"].iter().map(Curve::signed_area).sum();
        assert!((area - sheet.figures().area_mm2).abs() < 1e-2);
        assert_eq!(text.matches("\nCIRCLE\n").count(), 3);
        // Groups come in pairs of lines, and the text has nothing that R12 does not know.
        assert!(text.lines().count().is_multiple_of(2) && text.is_ascii());
        assert!(text.ends_with("  0\nEOF\n"));
        assert_eq!(text.matches("SECTION").count(), 3);
    }
}
