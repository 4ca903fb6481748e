//! Kerf on a contour: where the middle of the beam runs.

use cavalier_contours::polyline::{PlineSource as _, PlineSourceMut as _, Polyline};
use kurbo::Point;

use super::path::ToolpathError;
use crate::pattern::Contour;

/// Largest distance between a rounded corner and the straight pieces that stand for it. A fifth of what the verifier
/// tolerates; a corner of radius 0.1 mm then has pieces of 0.04 mm.
pub const CHORD_ERROR_MM: f64 = 0.002;

/// Slack in the test of what the offset left out, relative: rounding of the offset library (1e-5 mm) on a kerf of 0.1 mm.
const SLACK: f64 = 1e-3;

/// The closed line half a kerf outside the material of a contour, in the contour's direction, first point not repeated.
///
/// # Errors
/// [`ToolpathError::NarrowSlot`] where the beam does not fit: a hole or a slot narrower than the kerf.
pub fn outline(contour: &Contour, kerf_mm: f64) -> Result<Vec<Point>, ToolpathError> {
    let narrow = |at: Point| ToolpathError::NarrowSlot {
        x: at.x,
        y: at.y,
        kerf_mm,
    };
    let Some(first) = contour.points.first().copied() else {
        return Err(narrow(Point::ZERO));
    };
    let mut line = Polyline::new_closed();
    for p in &contour.points {
        line.add(p.x, p.y, 0.0);
    }
    // The material is on the left, and positive offsets go left.
    let offsets = line.parallel_offset(-0.5 * kerf_mm);
    let [offset] = offsets.as_slice() else {
        return Err(narrow(first));
    };
    let flat = offset
        .arcs_to_approx_lines(CHORD_ERROR_MM)
        .ok_or_else(|| narrow(first))?;
    let mut points: Vec<Point> = flat.iter_vertexes().map(|v| Point::new(v.x, v.y)).collect();
    // Arcs and lines meet with rounding between them.
    points.dedup_by(|a, b| a.distance(*b) < 1e-6);
    if points.len() < 3 {
        return Err(narrow(first));
    }
    match left_out(&contour.points, &points, kerf_mm) {
        Some(at) => Err(narrow(at)),
        None => Ok(points),
    }
}

/// A place of the contour that the offset line does not pass at its proper distance: it was in a slot too narrow, which
/// the offset skips without a word.
fn left_out(contour: &[Point], outline: &[Point], kerf_mm: f64) -> Option<Point> {
    let n = contour.len();
    let near = |p: Point, limit: f64| {
        (0..outline.len()).any(|i| {
            let (a, b) = (outline[i], outline[(i + 1) % outline.len()]);
            let d = b - a;
            let t = ((p - a).dot(d) / d.hypot2()).clamp(0.0, 1.0);
            p.distance(a.lerp(b, t)) <= limit
        })
    };
    (0..n).find_map(|i| {
        let (before, here, after) = (contour[(i + n - 1) % n], contour[i], contour[(i + 1) % n]);
        let (u, v) = ((here - before).normalize(), (after - here).normalize());
        // In a concave corner the line stays away from the corner itself: r / sin(φ/2) for a gap of angle φ, and
        // sin(φ/2) = cos(turn/2).
        let half = ((1.0 + u.dot(v)) / 2.0).max(0.0).sqrt();
        let reach = if u.cross(v) < 0.0 {
            0.5 * kerf_mm / half
        } else {
            0.5 * kerf_mm
        };
        let limit = reach * (1.0 + SLACK) + CHORD_ERROR_MM;
        let middle = here.midpoint(after);
        if !near(here, limit) {
            Some(here)
        } else if !near(middle, 0.5 * kerf_mm * (1.0 + SLACK) + CHORD_ERROR_MM) {
            Some(middle)
        } else {
            None
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::Contour;

    fn polygon(points: &[(f64, f64)]) -> Contour {
        Contour {
            points: points.iter().map(|p| Point::new(p.0, p.1)).collect(),
            outer: true,
        }
    }

    fn area(points: &[Point]) -> f64 {
        (0..points.len())
            .map(|i| {
                0.5 * points[i]
                    .to_vec2()
                    .cross(points[(i + 1) % points.len()].to_vec2())
            })
            .sum()
    }

    #[test]
    fn a_square_grows_by_its_rim_and_rounded_corners_and_a_hole_shrinks() {
        let corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)];
        let r = 0.1;
        let grown = area(&outline(&polygon(&corners), 2.0 * r).unwrap());
        let exact = 100.0 + 40.0 * r + std::f64::consts::PI * r * r;
        assert!(
            grown <= exact + 1e-9 && grown > exact - 4.0 * CHORD_ERROR_MM * r * 2.0,
            "{grown}"
        );
        let mut hole = corners;
        hole.reverse();
        let shrunk = area(&outline(&polygon(&hole), 2.0 * r).unwrap());
        assert!(
            (shrunk + (10.0 - 2.0 * r) * (10.0 - 2.0 * r)).abs() < 1e-9,
            "{shrunk}"
        );
    }

    #[test]
    fn a_hole_or_a_slot_narrower_than_the_kerf_is_an_error_with_its_place() {
        let hole = polygon(&[(0.0, 0.0), (0.0, 0.1), (9.0, 0.1), (9.0, 0.0)]);
        assert!(matches!(
            outline(&hole, 0.2),
            Err(ToolpathError::NarrowSlot { .. })
        ));
        assert!(outline(&hole, 0.05).is_ok());
        // A plate with a slot 0.1 mm wide from the top edge to the middle.
        let slotted = polygon(&[
            (0.0, 0.0),
            (10.0, 0.0),
            (10.0, 10.0),
            (5.1, 10.0),
            (5.1, 5.0),
            (5.0, 5.0),
            (5.0, 10.0),
            (0.0, 10.0),
        ]);
        let Err(ToolpathError::NarrowSlot { x, y, .. }) = outline(&slotted, 0.2) else {
            panic!("the slot was lost without a word");
        };
        assert!((x - 5.05).abs() < 0.1 && y >= 5.0);
        assert!(outline(&slotted, 0.05).is_ok());
    }
}
