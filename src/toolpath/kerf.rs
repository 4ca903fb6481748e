//! Kerf on a contour: where the middle of the beam runs.

use cavalier_contours::polyline::{PlineSource as _, PlineSourceMut as _, Polyline};
use kurbo::Point;

use super::path::ToolpathError;
use crate::base::curve::{Curve, Piece, Vertex};
use crate::base::plane;
use crate::pattern::{Contour, Tab};

/// Largest distance between an arc and the straight pieces that stand for it where only straight ones will do. A fifth
/// of what the verifier tolerates.
pub const CHORD_ERROR_MM: f64 = 0.002;

/// Slack in the test of what the offset left out, relative: rounding of the offset library (1e-5 mm) on a kerf of 0.1 mm.
const SLACK: f64 = 1e-3;

/// Arcs and lines meet with rounding between them, millimetres.
const JOINT_MM: f64 = 1e-6;

/// The closed line half a kerf outside the material of a contour, in the contour's direction, its rounded corners as
/// true arcs.
///
/// # Errors
/// [`ToolpathError::NarrowSlot`] where the beam does not fit: a hole or a slot narrower than the kerf.
pub fn outline(contour: &Contour, kerf_mm: f64) -> Result<Curve, ToolpathError> {
    let narrow = |at: Point| ToolpathError::NarrowSlot {
        x: at.x,
        y: at.y,
        kerf_mm,
    };
    let Some(first) = contour.line.start() else {
        return Err(narrow(Point::ZERO));
    };
    let mut line = Polyline::new_closed();
    for v in &contour.line.vertices {
        line.add(v.at.x, v.at.y, v.bulge);
    }
    // The material is on the left, and positive offsets go left.
    let offsets = line.parallel_offset(-0.5 * kerf_mm);
    let [offset] = offsets.as_slice() else {
        return Err(narrow(first));
    };
    let mut vertices: Vec<Vertex> = Vec::with_capacity(offset.vertex_count());
    for v in offset.iter_vertexes() {
        let new = Vertex {
            at: Point::new(v.x, v.y),
            bulge: v.bulge,
        };
        match vertices.last_mut() {
            Some(last) if last.at.distance(new.at) < JOINT_MM => last.bulge = new.bulge,
            _ => vertices.push(new),
        }
    }
    if let (Some(first), Some(last)) = (vertices.first(), vertices.last())
        && vertices.len() > 1
        && first.at.distance(last.at) < JOINT_MM
    {
        vertices.pop();
    }
    let outline = Curve {
        vertices,
        closed: true,
    };
    if outline.vertices.len() < 2 {
        return Err(narrow(first));
    }
    match left_out(&contour.line, &outline, kerf_mm) {
        Some(at) => Err(narrow(at)),
        None => Ok(outline),
    }
}

/// A place of the contour that the offset line does not pass at its proper distance: it was in a slot too narrow, which
/// the offset skips without a word. O(n): the two lines run side by side, so that the search goes on where it stopped.
fn left_out(contour: &Curve, outline: &Curve, kerf_mm: f64) -> Option<Point> {
    let beam = outline.flattened(CHORD_ERROR_MM);
    let pieces: Vec<Piece> = contour.pieces().collect();
    let mut last = 0;
    let mut near = |p: Point, limit: f64| {
        let m = beam.len();
        let hit = (0..m).map(|k| (last + k) % m).find(|&i| {
            let (a, b) = (beam[i], beam[(i + 1) % m]);
            plane::from_segment(p, a, b) <= limit
        });
        last = hit.unwrap_or(last);
        hit.is_some()
    };
    let n = pieces.len();
    (0..n).find_map(|i| {
        let (before, piece) = (pieces[(i + n - 1) % n], pieces[i]);
        let (u, v) = (before.direction(1.0), piece.direction(0.0));
        // In a concave corner the line stays away from the corner itself: r / sin(φ/2) for a gap of angle φ, and
        // sin(φ/2) = cos(turn/2).
        let half = ((1.0 + u.dot(v)) / 2.0).max(0.0).sqrt();
        let reach = if u.cross(v) < 0.0 {
            0.5 * kerf_mm / half
        } else {
            0.5 * kerf_mm
        };
        let limit = reach * (1.0 + SLACK) + CHORD_ERROR_MM;
        let middle = piece.at(0.5);
        if !near(piece.from, limit) {
            Some(piece.from)
        } else if !near(middle, 0.5 * kerf_mm * (1.0 + SLACK) + CHORD_ERROR_MM) {
            Some(middle)
        } else {
            None
        }
    })
}

/// The stretches of a closed outline, given as an open line, between the tabs that lie on it; none if no tab does, or
/// if they leave nothing.
///
/// A gap is a kerf wider than its tab: the beam burns half a kerf beyond the end of each stretch.
pub fn without_tabs(line: &Curve, tabs: &[Tab], kerf_mm: f64) -> Vec<Curve> {
    let whole = line.length();
    let mut gaps: Vec<(f64, f64)> = Vec::new();
    for tab in tabs {
        let (away, at) = nearest(line, tab.at);
        if away <= kerf_mm {
            let half = 0.5 * (tab.width_mm + kerf_mm);
            gaps.push((at - half, at + half));
        }
    }
    if gaps.is_empty() {
        return Vec::new();
    }
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut stretches = Vec::with_capacity(gaps.len());
    for (n, gap) in gaps.iter().enumerate() {
        let from = gap.1;
        let to = gaps.get(n + 1).map_or(gaps[0].0 + whole, |g| g.0);
        if to - from < SHORTEST_STRETCH_MM {
            continue;
        }
        // Beyond the end the line begins again.
        let mut stretch = line.between(from.min(whole), to.min(whole));
        if to > whole {
            stretch.join(&line.between((from - whole).max(0.0), to - whole));
        }
        if from < 0.0 {
            let mut start = line.between(from + whole, whole);
            start.join(&stretch);
            stretch = start;
        }
        stretches.push(stretch);
    }
    stretches
}

/// The tabs of every outline: each is one of that which it is nearest to. A hole may touch the rim in a corner, and a tab
/// there holds the part, not the hole's scrap.
pub fn tabs_by_outline(outlines: &[Curve], tabs: &[Tab]) -> Vec<Vec<Tab>> {
    let mut all = vec![Vec::new(); outlines.len()];
    for tab in tabs {
        let away = outlines.iter().map(|line| nearest(line, tab.at).0);
        if let Some((n, _)) = away.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)) {
            all[n].push(*tab);
        }
    }
    all
}

/// How far a point is from a line, and how far along the line that is.
fn nearest(line: &Curve, p: Point) -> (f64, f64) {
    let mut best = (f64::INFINITY, 0.0);
    let mut before = 0.0;
    for piece in line
        .pieces()
        .filter(|p| p.bulge == 0.0 || p.arc().is_some())
    {
        let length = piece.length();
        let part = nearest_part(&piece, p);
        let away = piece.at(part).distance(p);
        if away <= best.0 {
            best = (away, before + part * length);
        }
        before += length;
    }
    best
}

/// Shorter stretches between two tabs are left to hold, millimetres.
const SHORTEST_STRETCH_MM: f64 = 0.1;

/// Where along a piece, 0 to 1, a point is nearest.
fn nearest_part(piece: &Piece, p: Point) -> f64 {
    match piece.arc() {
        None => plane::nearest_part(piece.from, piece.to, p),
        Some(arc) => {
            let turn = ((p - arc.centre).atan2() - arc.start) * arc.sweep.signum();
            let part = turn.rem_euclid(std::f64::consts::TAU) / arc.sweep.abs();
            // Beyond the arc the nearer end is nearest.
            if part <= 1.0 {
                part
            } else if p.distance(piece.from) < p.distance(piece.to) {
                0.0
            } else {
                1.0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[(f64, f64)]) -> Contour {
        Contour {
            line: Curve::polyline(points.iter().map(|p| Point::new(p.0, p.1)), true),
            outer: true,
        }
    }

    #[test]
    fn a_square_grows_by_its_rim_and_rounded_corners_and_a_hole_shrinks() {
        let corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)];
        let r = 0.1;
        let grown = outline(&polygon(&corners), 2.0 * r).unwrap().signed_area();
        let exact = 100.0 + 40.0 * r + std::f64::consts::PI * r * r;
        assert!((grown - exact).abs() < 1e-9, "{grown}");
        let mut hole = corners;
        hole.reverse();
        let shrunk = outline(&polygon(&hole), 2.0 * r).unwrap().signed_area();
        assert!(
            (shrunk + (10.0 - 2.0 * r) * (10.0 - 2.0 * r)).abs() < 1e-9,
            "{shrunk}"
        );
    }

    #[test]
    fn tabs_leave_gaps_of_their_width_and_a_kerf_wherever_the_line_begins() {
        let square = polygon(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]);
        let kerf = 0.4;
        let closed = outline(&square, kerf).unwrap();
        let tabs: Vec<Tab> = [(5.0, 0.0), (10.0, 3.0), (0.0, 9.0)]
            .map(|at| Tab {
                at: at.into(),
                width_mm: 0.5,
            })
            .to_vec();
        for start in 0..closed.len() {
            for part in [0.0, 0.3, 0.5] {
                let line = closed.opened_at(start, part);
                let stretches = without_tabs(&line, &tabs, kerf);
                assert_eq!(stretches.len(), 3);
                let cut: f64 = stretches.iter().map(Curve::length).sum();
                assert!((line.length() - cut - 3.0 * 0.9).abs() < 1e-6, "{cut}");
                for (stretch, tab) in stretches
                    .iter()
                    .flat_map(|s| tabs.iter().map(move |t| (s, t)))
                {
                    for p in stretch.flattened(0.01) {
                        assert!(p.distance(tab.at) >= 0.45 - 1e-6);
                    }
                }
            }
        }
        assert_eq!(without_tabs(&closed.opened_at(0, 0.0), &[], kerf), vec![]);
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
