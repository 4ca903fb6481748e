//! The edges of the finished part: boundary loops of the union of the flat triangles.

use std::collections::BTreeMap;

use kurbo::{Point, Vec2};

use super::sheet::{Contour, PatternError};
use crate::base::curve::{Curve, Piece};
use crate::base::ids::Per;
use crate::linkage::{Linkage, Triangle, TriangleId};

/// Two flat corners closer than this (in L) are one point: lattice positions are exact to rounding.
const SAME_POINT: f64 = 1e-6;

/// Traces every gap of the sheet once, material on the left.
///
/// At a pinch, where fans of triangles touch only in a point, the loop continues along the *same gap*, into the next
/// fan: that keeps every loop simple, whereas a loop that stayed with its fan would run through the point twice.
pub(super) fn trace(
    linkage: &Linkage,
    neighbours: &Per<TriangleId, [Option<(TriangleId, usize)>; 3]>,
) -> Result<Vec<Contour>, PatternError> {
    let edge_mm = linkage.edge_mm;
    let mut sides: Vec<(Point, Point)> = Vec::new();
    for (t, across) in neighbours.iter_ids() {
        let triangle = &linkage.triangles[t];
        for (k, beyond) in across.iter().enumerate() {
            let left = left_of(triangle, k);
            // A neighbour has the same side the other way round; what both have is no edge.
            let theirs = beyond.map(|(other, side)| {
                let [from, to] = left_of(&linkage.triangles[other], side);
                [1.0 - to, 1.0 - from]
            });
            let corners = [k, (k + 1) % 3].map(|c| corner(triangle, c));
            for [from, to] in less(left, theirs) {
                let at = |t: f64| match t {
                    0.0 => corners[0],
                    1.0 => corners[1],
                    t => corners[0].lerp(corners[1], t),
                };
                sides.push((at(from), at(to)));
            }
        }
        if let Some(trim) = &triangle.trim {
            let at = |w: &[f64; 3]| {
                let all = (0..3).map(|c| corner(triangle, c).to_vec2() * w[c]);
                all.fold(Vec2::ZERO, |sum, p| sum + p).to_point()
            };
            sides.extend(trim.rim.windows(2).map(|w| (at(&w[0]), at(&w[1]))));
        }
    }
    let leaving = Leaving::new(&sides, edge_mm);
    let mut done = vec![false; sides.len()];
    let mut contours = Vec::new();
    for first in 0..sides.len() {
        if done[first] {
            continue;
        }
        let mut points = Vec::new();
        let mut side = first;
        while !done[side] {
            done[side] = true;
            points.push(sides[side].0);
            let (tail, head) = sides[side];
            let next = leaving.next_in_gap(&sides, tail, head, &done, first);
            side = next.ok_or(PatternError::OpenRim {
                x: head.x,
                y: head.y,
            })?;
        }
        if side != first {
            let at = sides[side].0;
            return Err(PatternError::OpenRim { x: at.x, y: at.y });
        }
        let line = Curve::polyline(merge_collinear(&points), true);
        let outer = line.signed_area() > 0.0;
        contours.push(Contour { line, outer });
    }
    Ok(contours)
}

fn corner(triangle: &Triangle, k: usize) -> Point {
    Point::new(triangle.flat[k].x, triangle.flat[k].y)
}

/// What is left of a side.
fn left_of(triangle: &Triangle, side: usize) -> [f64; 2] {
    match &triangle.trim {
        Some(trim) => trim.side(side),
        None => [0.0, 1.0],
    }
}

/// The parts of one interval that another one does not cover.
fn less([from, to]: [f64; 2], other: Option<[f64; 2]>) -> impl Iterator<Item = [f64; 2]> {
    let [low, high] = other.unwrap_or([to, to]);
    [[from, to.min(low)], [from.max(high), to]]
        .into_iter()
        .filter(|[a, b]| b - a > SAME_POINT)
}

/// Boundary sides by the point where they start.
struct Leaving {
    cells: BTreeMap<(i64, i64), Vec<u32>>,
    cell_mm: f64,
    same_mm: f64,
}

impl Leaving {
    fn new(sides: &[(Point, Point)], edge_mm: f64) -> Self {
        let mut this = Self {
            cells: BTreeMap::new(),
            // Any size between the rounding of one point and the distance of two.
            cell_mm: 0.25 * edge_mm,
            same_mm: SAME_POINT * edge_mm,
        };
        for (i, (tail, _)) in sides.iter().enumerate() {
            let key = this.key(*tail, 0.0, 0.0);
            this.cells.entry(key).or_default().push(i as u32);
        }
        this
    }

    fn key(&self, p: Point, dx: f64, dy: f64) -> (i64, i64) {
        (
            ((p.x + dx) / self.cell_mm).floor() as i64,
            ((p.y + dy) / self.cell_mm).floor() as i64,
        )
    }

    /// Of the sides that leave `head`, the first one counter-clockwise from the side that arrives from `tail`: between
    /// the two lies the gap on the right of both. The first side of the loop may be met again; others only once.
    fn next_in_gap(
        &self,
        sides: &[(Point, Point)],
        tail: Point,
        head: Point,
        done: &[bool],
        first: usize,
    ) -> Option<usize> {
        let mut keys = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
            .map(|(x, y)| self.key(head, x * self.same_mm, y * self.same_mm));
        keys.sort_unstable();
        let back = (tail - head).atan2();
        let mut best: Option<(f64, usize)> = None;
        for (i, key) in keys.iter().enumerate() {
            if i > 0 && keys[i - 1] == *key {
                continue;
            }
            for &s in self.cells.get(key).into_iter().flatten() {
                let s = s as usize;
                if (done[s] && s != first) || sides[s].0.distance(head) > self.same_mm {
                    continue;
                }
                let turn =
                    ((sides[s].1 - sides[s].0).atan2() - back).rem_euclid(std::f64::consts::TAU);
                // Straight back is a slot of no width: a whole turn, rounding aside.
                let turn = if turn < 1e-6 {
                    std::f64::consts::TAU
                } else {
                    turn
                };
                if best.is_none_or(|(least, _)| turn < least) {
                    best = Some((turn, s));
                }
            }
        }
        best.map(|(_, s)| s)
    }
}

/// Drops points where the line goes straight on.
fn merge_collinear(points: &[Point]) -> Vec<Point> {
    let n = points.len();
    let kept: Vec<Point> = (0..n)
        .filter(|&i| {
            let (a, b, c) = (points[(i + n - 1) % n], points[i], points[(i + 1) % n]);
            let (u, v) = ((b - a).normalize(), (c - b).normalize());
            u.cross(v).abs() > 1e-6 || u.dot(v) < 0.0
        })
        .map(|i| points[i])
        .collect();
    if kept.len() < 3 {
        points.to_vec()
    } else {
        kept
    }
}

/// A closed line of straight pieces with its convex corners rounded to a radius; less where a side is too short for two
/// fillets. In concave corners the beam itself leaves a fillet.
pub(super) fn rounded(line: &Curve, radius_mm: f64) -> Curve {
    if radius_mm <= 0.0 {
        return line.clone();
    }
    let points: Vec<Point> = line.vertices.iter().map(|v| v.at).collect();
    let n = points.len();
    let mut pieces: Vec<Piece> = Vec::with_capacity(2 * n);
    // For each corner where its fillet begins and ends, and the fillet's bulge.
    let corner = |i: usize| {
        let (before, here, after) = (points[(i + n - 1) % n], points[i], points[(i + 1) % n]);
        let (u, v) = ((here - before).normalize(), (after - here).normalize());
        let turn = u.cross(v).atan2(u.dot(v));
        if turn < 1e-6 {
            return (here, here, 0.0);
        }
        let half = (0.5 * turn).tan();
        let room = 0.5 * (here - before).hypot().min((after - here).hypot());
        let back = (radius_mm * half).min(room);
        (here - u * back, here + v * back, (0.25 * turn).tan())
    };
    for i in 0..n {
        let (from, to, bulge) = corner(i);
        if from != to {
            pieces.push(Piece::new(from, to, bulge));
        }
        let (next, ..) = corner((i + 1) % n);
        if to.distance(next) > SAME_POINT {
            pieces.push(Piece::new(to, next, 0.0));
        }
    }
    let mut round = Curve::of_pieces(pieces);
    round.vertices.pop();
    round.closed = true;
    round
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn rounding_takes_the_known_area_from_each_convex_corner_and_none_from_the_others() {
        // An L: five convex corners and a concave one.
        let l = [(0., 0.), (4., 0.), (4., 2.), (2., 2.), (2., 4.), (0., 4.)];
        let sharp = Curve::polyline(l.map(Point::from), true);
        for r in [0.1, 0.5, 0.99] {
            let round = rounded(&sharp, r);
            let lost = 5.0 * (1.0 - PI / 4.0) * r * r;
            assert!((sharp.signed_area() - round.signed_area() - lost).abs() < 1e-9);
            assert_eq!(round.pieces().filter(|p| p.arc().is_some()).count(), 5);
        }
        // Too round for the short sides: as round as they allow.
        let most = rounded(&sharp, 50.0);
        assert!(
            most.pieces()
                .filter_map(|p| p.arc())
                .all(|a| a.radius <= 1.0 + 1e-9 || a.radius > 1.9)
        );
        assert!(most.is_finite() && most.signed_area() > 0.0);
    }
}
