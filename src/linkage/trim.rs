//! A smooth rim: triangles of which one corner lies beyond the rim of the surface, cut off where it runs.
//!
//! The surface that the lattice is laid on goes on beyond its rims ([`crate::mesh::skirt()`]), so that such triangles lie on
//! it whole, in the linkage and in space. On the sheet the rim cuts them. The hinge of the corner beyond is gone, and its
//! slit runs out; the other two hinges need material around their ligaments, so the rim must keep a margin from them. A
//! triangle that is held by both stays. Triangles that lie wholly on the surface are none of the rim's business.

use std::collections::HashSet;
use std::sync::Arc;

use nalgebra::Point2;

use super::Colour;
use super::types::Handedness;
use super::walk::Walker;
use crate::base::ids::Id as _;
use crate::conformal::Transition;
use crate::mesh::{FaceId, HalfedgeId};

/// Where the rim of the sheet runs, on a surface that goes on beyond it.
#[derive(Clone, Debug)]
pub struct SmoothRim {
    /// By face: whether it lies beyond the rim. Faces that it does not name lie inside.
    pub beyond: Arc<[bool]>,
    /// What a hinge needs between its lattice vertex and the rim, on the sheet, millimetres.
    pub margin_mm: f64,
}

impl SmoothRim {
    fn is_beyond(&self, face: FaceId) -> bool {
        self.beyond.get(face.index()).copied().unwrap_or(false)
    }
}

/// What a smooth rim leaves of a triangle. Corners and weights are in the triangle's order.
#[derive(Clone, Debug, PartialEq)]
pub struct Trim {
    /// The corner beyond the rim: there is no hinge there.
    pub beyond: usize,
    /// The rim where it crosses the triangle, from side to side with the material on its left, as weights of the corners.
    pub rim: Vec<[f64; 3]>,
}

impl Trim {
    /// The part of side `k`, from corner `k` (0) to `k + 1` (1), that is left.
    pub fn side(&self, k: usize) -> [f64; 2] {
        let (from, to) = (k, (k + 1) % 3);
        let crossing = |otherwise: f64| {
            let ends = [self.rim.first(), self.rim.last()].into_iter().flatten();
            let third = |w: &&[f64; 3]| w[(k + 2) % 3].abs();
            let at = ends.min_by(|a, b| third(a).total_cmp(&third(b)));
            at.map_or(otherwise, |w| w[to] / (w[from] + w[to]))
        };
        if self.beyond == from {
            [crossing(0.0), 1.0]
        } else if self.beyond == to {
            [0.0, crossing(1.0)]
        } else {
            [0.0, 1.0]
        }
    }
}

/// The corner in which the slit along a side ends: its hinge.
pub(super) fn hinge_of_side(handedness: Handedness, colour: Colour, side: usize) -> usize {
    if handedness.counter_clockwise(colour) {
        (side + 1) % 3
    } else {
        side
    }
}

/// What becomes of a triangle at the rim.
pub(super) enum Fate {
    /// It lies inside with all its corners.
    Whole,
    /// One corner is cut off.
    Trimmed(Trim),
    /// Too much of it lies beyond, or the rim cuts it up.
    Gone,
}

/// Follows the rim through a triangle: `corners` in the chart of `face`, which holds the centroid.
pub(super) fn fate(
    walker: &Walker<'_>,
    rim: &SmoothRim,
    face: FaceId,
    centroid: Point2<f64>,
    corners: &[Point2<f64>; 3],
) -> Fate {
    let inside = corners.map(|p| {
        walker
            .walk(face, centroid, p)
            .is_some_and(|there| !rim.is_beyond(there.face))
    });
    let beyond = match inside {
        [true, true, true] => return Fate::Whole,
        [false, true, true] => 0,
        [true, false, true] => 1,
        [true, true, false] => 2,
        _ => return Fate::Gone,
    };
    let reach = (corners[0] - centroid).norm();
    let near = nearby(walker, face, centroid, reach);
    let segments = rim_segments(walker, rim, &near);
    let mut pieces: Vec<[[f64; 3]; 2]> = segments
        .iter()
        .filter_map(|s| clipped(corners, s))
        .collect();
    let Some(line) = chained(&mut pieces).filter(|line| cuts_off(line, beyond)) else {
        return Fate::Gone;
    };
    // Both hinges keep their margin, and so does half of it along the side between them.
    let at = |w: &[f64; 3]| {
        Point2::from((0..3).fold(nalgebra::Vector2::zeros(), |sum, k| {
            sum + corners[k].coords * w[k]
        }))
    };
    let [a, b] = [1, 2].map(|k| corners[(beyond + k) % 3]);
    let clear = line.windows(2).all(|w| {
        let (from, to) = (at(&w[0]), at(&w[1]));
        let room = |p: Point2<f64>| distance(p, from, to) >= rim.margin_mm;
        room(a) && room(b) && distance(from, a, b) >= 0.5 * rim.margin_mm
    });
    if clear {
        Fate::Trimmed(Trim { beyond, rim: line })
    } else {
        Fate::Gone
    }
}

/// Whether a line through the triangle comes and goes over the two sides at a corner, as one that cuts it off does.
fn cuts_off(line: &[[f64; 3]], corner: usize) -> bool {
    // An end lies on the side opposite the corner of which it has no weight.
    let opposite = |w: &[f64; 3]| (0..3).find(|&k| w[k].abs() < ON_SIDE);
    let ends = [line.first(), line.last()].map(|w| w.and_then(opposite));
    let [Some(a), Some(b)] = ends else {
        return false;
    };
    a != b && a != corner && b != corner
}

/// Faces within `reach` of a point of the chart of `face`, with the motion from there to their own charts.
fn nearby(
    walker: &Walker<'_>,
    face: FaceId,
    at: Point2<f64>,
    reach: f64,
) -> Vec<(FaceId, Transition)> {
    let mut found = vec![(face, Transition::IDENTITY)];
    let mut seen = HashSet::from([face]);
    let mut next = 0;
    while next < found.len() {
        let (face, motion) = found[next];
        next += 1;
        let here = motion.apply(at);
        for k in 0..3 {
            let c = &walker.layout.corners[face];
            if distance(here, c[k], c[(k + 1) % 3]) > reach {
                continue;
            }
            if let Some((twin, step)) = walker.cross(HalfedgeId::side(face, k))
                && seen.insert(twin.face())
            {
                found.push((twin.face(), motion.then(&step)));
            }
        }
    }
    found
}

/// The rim along these faces, in the chart where the motions begin, the inside on the left.
fn rim_segments(
    walker: &Walker<'_>,
    rim: &SmoothRim,
    near: &[(FaceId, Transition)],
) -> Vec<[Point2<f64>; 2]> {
    let mut found = Vec::new();
    for &(face, motion) in near.iter().filter(|(f, _)| !rim.is_beyond(*f)) {
        for k in 0..3 {
            let over = walker.surface.twin(HalfedgeId::side(face, k));
            if over.is_some_and(|twin| rim.is_beyond(twin.face())) {
                let c = &walker.layout.corners[face];
                let back = motion.inverse();
                found.push([back.apply(c[k]), back.apply(c[(k + 1) % 3])]);
            }
        }
    }
    found
}

fn distance(p: Point2<f64>, a: Point2<f64>, b: Point2<f64>) -> f64 {
    let d = b - a;
    let length = d.norm_squared();
    let t = if length > 0.0 {
        ((p - a).dot(&d) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (p - (a + d * t)).norm()
}

/// The part of a segment inside a triangle, as weights of its corners; `None` if there is none of any length.
fn clipped(corners: &[Point2<f64>; 3], segment: &[Point2<f64>; 2]) -> Option<[[f64; 3]; 2]> {
    let area = |a: Point2<f64>, b: Point2<f64>, c: Point2<f64>| (b - a).perp(&(c - a));
    let whole = area(corners[0], corners[1], corners[2]);
    let weights = |p: Point2<f64>| -> [f64; 3] {
        std::array::from_fn(|k| area(corners[(k + 1) % 3], corners[(k + 2) % 3], p) / whole)
    };
    let [a, b] = segment.map(weights);
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for k in 0..3 {
        let (low, high) = (a[k], b[k]);
        if low < 0.0 && high < 0.0 {
            return None;
        }
        if low < 0.0 {
            from = from.max(low / (low - high));
        } else if high < 0.0 {
            to = to.min(low / (low - high));
        }
    }
    let at = |t: f64| std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t);
    (to - from > 0.0).then(|| [at(from), at(to)])
}

/// Ends of rim pieces this near to each other, as weights, are one: rounding only.
const SAME: f64 = 1e-9;
/// An end with so little weight of a corner lies on the side opposite it.
const ON_SIDE: f64 = 1e-9;
/// Rim points that lie this near to the line between their neighbours are left away, in L: nobody cuts that.
const STRAIGHT: f64 = 0.005;

/// All pieces as one line, if they are one.
fn chained(pieces: &mut Vec<[[f64; 3]; 2]>) -> Option<Vec<[f64; 3]>> {
    let same = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < SAME);
    pieces.retain(|[a, b]| !same(a, b));
    let first =
        (0..pieces.len()).find(|&n| pieces.iter().all(|[_, end]| !same(end, &pieces[n][0])))?;
    let [start, mut at] = pieces.swap_remove(first);
    let mut line = vec![start, at];
    while let Some(n) = pieces.iter().position(|[from, _]| same(from, &at)) {
        at = pieces.swap_remove(n)[1];
        line.push(at);
    }
    pieces.is_empty().then(|| simplified(&line))
}

/// A line without the points that it hardly bends at (Douglas and Peucker).
fn simplified(line: &[[f64; 3]]) -> Vec<[f64; 3]> {
    // In a frame where the triangle's edge is 1.
    let plane = |w: &[f64; 3]| Point2::new(w[1] + 0.5 * w[2], 0.75f64.sqrt() * w[2]);
    let mut kept = vec![false; line.len()];
    let mut stack = vec![(0, line.len() - 1)];
    kept[0] = true;
    kept[line.len() - 1] = true;
    while let Some((from, to)) = stack.pop() {
        let (a, b) = (plane(&line[from]), plane(&line[to]));
        let far = (from + 1..to)
            .map(|n| (distance(plane(&line[n]), a, b), n))
            .max_by(|x, y| x.0.total_cmp(&y.0));
        if let Some((away, n)) = far
            && away > STRAIGHT
        {
            kept[n] = true;
            stack.extend([(from, n), (n, to)]);
        }
    }
    (0..line.len())
        .filter(|n| kept[*n])
        .map(|n| line[n])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_rim_leaves_the_sides_that_lie_on_its_left() {
        let corners = [
            Point2::new(0.0, 0.0),
            Point2::new(1.0, 0.0),
            Point2::new(0.5, 0.75f64.sqrt()),
        ];
        // From right to left at a height that cuts off the top.
        let y = 0.4;
        let piece = clipped(&corners, &[Point2::new(2.0, y), Point2::new(-1.0, y)]).unwrap();
        let rim = chained(&mut vec![piece]).unwrap();
        assert!(cuts_off(&rim, 2));
        assert!(!cuts_off(&rim, 0) && !cuts_off(&rim, 1));
        let trim = Trim { beyond: 2, rim };
        let part = y / 0.75f64.sqrt();
        for (k, expected) in [[0.0, 1.0], [0.0, part], [1.0 - part, 1.0]]
            .into_iter()
            .enumerate()
        {
            let side = trim.side(k);
            assert!((side[0] - expected[0]).abs() < 1e-12);
            assert!((side[1] - expected[1]).abs() < 1e-12);
        }
    }

    #[test]
    fn pieces_in_any_order_are_one_line_and_two_lines_are_none() {
        let at = |x: f64| [x, 0.5 - 0.5 * x, 0.5 - 0.5 * x];
        let mut bent: Vec<[[f64; 3]; 2]> = [(0.3, 0.5), (0.0, 0.3), (0.5, 0.9)]
            .map(|(a, b)| [at(a), at(b)])
            .to_vec();
        // Straight: only its ends are left.
        assert_eq!(chained(&mut bent).unwrap(), [at(0.0), at(0.9)]);
        let mut two = vec![[at(0.0), at(0.3)], [at(0.5), at(0.9)]];
        assert!(chained(&mut two).is_none());
        let bump = [
            [0.5, 0.5, 0.0],
            [0.4, 0.3, 0.3],
            [0.2, 0.3, 0.5],
            [0.5, 0.0, 0.5],
        ];
        assert_eq!(simplified(&bump).len(), 4);
    }
}
