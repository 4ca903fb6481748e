//! A single-line font for engraving: every stroke is gone over once, and nothing is filled.
//!
//! Letters stand on a grid four wide and six high; each glyph is a row of strokes, each stroke a row of grid points
//! written as two digits, x and y. Straight strokes only, so that a letter of 3 mm is cut as it is drawn.

use kurbo::{Point, Vec2};

use super::mark::Label;
use crate::base::curve::Curve;

/// Grid units of a capital letter's height.
const HEIGHT: f64 = 6.0;
/// Grid units of a letter's width.
const WIDTH: f64 = 4.0;
/// Grid units between two letters.
const GAP: f64 = 2.0;

/// Strokes of a character; none for a space and for what the font does not have.
fn glyph(c: char) -> Option<&'static str> {
    Some(match c.to_ascii_uppercase() {
        ' ' => "",
        'A' => "00 26 40;12 32",
        'B' => "00 06 36 45 44 33 03;33 42 41 30 00",
        'C' => "45 36 16 05 01 10 30 41",
        'D' => "00 06 26 44 42 20 00",
        'E' => "40 00 06 46;03 33",
        'F' => "00 06 46;03 33",
        'G' => "45 36 16 05 01 10 30 41 43 23",
        'H' => "00 06;40 46;03 43",
        'I' => "20 26;10 30;16 36",
        'J' => "46 41 30 10 01",
        'K' => "00 06;46 03 40",
        'L' => "06 00 40",
        'M' => "00 06 23 46 40",
        'N' => "00 06 40 46",
        'O' => "01 05 16 36 45 41 30 10 01",
        'P' => "00 06 36 45 44 33 03",
        'Q' => "01 05 16 36 45 41 30 10 01;22 40",
        'R' => "00 06 36 45 44 33 03;23 40",
        'S' => "45 36 16 05 04 13 33 42 41 30 10 01",
        'T' => "20 26;06 46",
        'U' => "06 01 10 30 41 46",
        'V' => "06 20 46",
        'W' => "06 10 23 30 46",
        'X' => "00 46;06 40",
        'Y' => "06 23 46;23 20",
        'Z' => "06 46 00 40",
        '0' => "01 05 16 36 45 41 30 10 01;11 35",
        '1' => "05 26 20;10 30",
        '2' => "05 16 36 45 44 00 40",
        '3' => "06 46 23 33 42 41 30 10 01",
        '4' => "30 36 02 42",
        '5' => "46 06 04 34 43 41 30 10 01",
        '6' => "45 36 16 05 01 10 30 41 42 33 13 02",
        '7' => "06 46 10",
        '8' => "13 04 05 16 36 45 44 33 13 02 01 10 30 41 42 33",
        '9' => "01 10 30 41 45 36 16 05 04 13 33 44",
        '-' => "13 33",
        '+' => "13 33;22 24",
        '.' => "20 21",
        ',' => "21 10",
        ':' => "21 22;24 25",
        '/' => "00 46",
        '(' => "36 25 21 30",
        ')' => "16 25 21 10",
        '=' => "12 32;14 34",
        '\'' => "26 25",
        '_' => "00 40",
        _ => return None,
    })
}

/// Whether every character of a text can be engraved.
pub fn can_write(text: &str) -> bool {
    text.chars().all(|c| glyph(c).is_some())
}

/// Width of a text, millimetres.
pub fn width_mm(text: &str, height_mm: f64) -> f64 {
    let n = text.chars().count() as f64;
    (n * (WIDTH + GAP) - GAP).max(0.0) * height_mm / HEIGHT
}

/// The strokes of a label. A character that the font does not have leaves its place empty.
pub(super) fn lines(label: &Label) -> Vec<Curve> {
    let unit = label.height_mm / HEIGHT;
    let right = Vec2::new(label.up.y, -label.up.x);
    let width = width_mm(&label.text, label.height_mm);
    let corner = label.at - right * (0.5 * width) - label.up * (0.5 * label.height_mm);
    let mut all = Vec::new();
    for (n, c) in label.text.chars().enumerate() {
        let left = n as f64 * (WIDTH + GAP);
        for stroke in glyph(c).unwrap_or("").split(';').filter(|s| !s.is_empty()) {
            let points = stroke.split(' ').filter_map(|xy| {
                let mut digits = xy.chars().filter_map(|d| d.to_digit(10)).map(f64::from);
                let (x, y) = (digits.next()?, digits.next()?);
                Some(corner + right * ((left + x) * unit) + label.up * (y * unit))
            });
            all.push(Curve::polyline(points.collect::<Vec<Point>>(), false));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_glyph_stays_on_its_grid_and_no_two_are_alike() {
        let all = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-+.,:/()='_";
        let mut seen = std::collections::BTreeSet::new();
        for c in all.chars() {
            assert!(seen.insert(glyph(c).unwrap()), "{c}");
            let label = Label {
                text: c.to_string(),
                at: Point::new(2.0, 3.0),
                up: Vec2::new(0.0, 1.0),
                height_mm: 6.0,
            };
            let strokes = lines(&label);
            assert!(!strokes.is_empty());
            for s in &strokes {
                assert!(s.length() > 0.0, "{c}");
                let b = s.bounds().unwrap();
                assert!(
                    b.x0 >= 0.0 && b.x1 <= 4.0 && b.y0 >= 0.0 && b.y1 <= 6.0,
                    "{c}"
                );
            }
        }
        assert!(can_write("a1/A1 Cone+") && !can_write("ß"));
    }

    #[test]
    fn a_text_is_centred_and_as_high_as_asked_whichever_way_is_up() {
        for angle in [0.0, 1.0, 2.5] {
            let up = Vec2::from_angle(angle);
            let label = Label {
                text: "HH".into(),
                at: Point::new(5.0, 7.0),
                up,
                height_mm: 3.0,
            };
            let points: Vec<Point> = lines(&label)
                .iter()
                .flat_map(|c| c.flattened(0.1))
                .collect();
            let along = |d: Vec2| {
                let all = points.iter().map(|p| (*p - label.at).dot(d));
                (
                    all.clone().fold(f64::MAX, f64::min),
                    all.fold(f64::MIN, f64::max),
                )
            };
            let (low, high) = along(up);
            assert!((low + 1.5).abs() < 1e-9 && (high - 1.5).abs() < 1e-9);
            let (left, right) = along(Vec2::new(up.y, -up.x));
            let half = 0.5 * width_mm("HH", 3.0);
            assert!((left + half).abs() < 1e-9 && (right - half).abs() < 1e-9);
        }
    }
}
