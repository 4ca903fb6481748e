//! Polygons into triangles: a fan where convex, ear clipping in the best-fit plane where not.

use nalgebra::{Point2, Point3, Vector3};

/// Corners beyond which a polygon is refused: clipping takes their cube at worst.
const MOST_CORNERS: usize = 1_000;

/// Quality (doubled area over the sum of squared sides; 0.58 is equilateral) below which an ear is taken for a
/// straight line: far above rounding, far below any triangle that is meant.
const FLAT: f64 = 1e-9;

/// Appends the triangles of a polygon with the same sense of rotation. `None` if it crosses itself, has no area or
/// more than 1 000 corners. Triangles pass through unseen, whatever their shape.
pub(super) fn triangulate(
    positions: &[Point3<f64>],
    corners: &[u32],
    out: &mut Vec<[u32; 3]>,
) -> Option<()> {
    if let [a, b, c] = *corners {
        out.push([a, b, c]);
        return Some(());
    }
    if corners.len() < 3 || corners.len() > MOST_CORNERS {
        return None;
    }
    let flat = project(positions, corners)?;
    let n = corners.len();
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp(&(flat[c] - flat[b]));
    let convex = (0..n).all(|i| turn(i, (i + 1) % n, (i + 2) % n) > 0.0);
    // All turns to the left and once round: a star polygon also turns left, but several times.
    let fan_is_whole = (1..n - 1).all(|i| turn(0, i, i + 1) > 0.0);
    if convex && fan_is_whole {
        // The shorter diagonal of a quadrilateral gives the better triangles.
        let length = |i: usize, j: usize| {
            (positions[corners[i] as usize] - positions[corners[j] as usize]).norm()
        };
        let start = usize::from(n == 4 && length(1, 3) < length(0, 2));
        let corner = |i: usize| corners[(start + i) % n];
        out.extend((1..n - 1).map(|i| [corner(0), corner(i), corner(i + 1)]));
        return Some(());
    }
    clip(&flat, corners, out)
}

/// Into the plane across the area vector (Newell), counter-clockwise.
fn project(positions: &[Point3<f64>], corners: &[u32]) -> Option<Vec<Point2<f64>>> {
    let origin = positions[corners[0] as usize];
    let at = |i: usize| positions[corners[i % corners.len()] as usize] - origin;
    let area: Vector3<f64> = (0..corners.len()).map(|i| at(i).cross(&at(i + 1))).sum();
    let normal = area.try_normalize(0.0)?;
    let across = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    let along = normal.cross(&across);
    Some(
        (0..corners.len())
            .map(|i| Point2::new(at(i).dot(&across), at(i).dot(&along)))
            .collect(),
    )
}

/// Always the best-shaped ear: corners on a straight side would else be left over as triangles without area.
fn clip(flat: &[Point2<f64>], corners: &[u32], out: &mut Vec<[u32; 3]>) -> Option<()> {
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp(&(flat[c] - flat[b]));
    let quality = |[a, b, c]: [usize; 3]| {
        let squares = (flat[b] - flat[a]).norm_squared()
            + (flat[c] - flat[b]).norm_squared()
            + (flat[a] - flat[c]).norm_squared();
        turn(a, b, c) / squares
    };
    let mut left: Vec<usize> = (0..corners.len()).collect();
    while left.len() >= 3 {
        let n = left.len();
        let ear_at = |i: usize| [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
        let mut best = (FLAT, None);
        for i in 0..n {
            let ear = ear_at(i);
            let [a, b, c] = ear;
            let shape = quality(ear);
            let empty = || {
                left.iter().all(|&p| {
                    // A corner that is met twice (a bridge to a hole) does not block its own copies.
                    ear.iter().any(|&q| flat[q] == flat[p])
                        || turn(a, b, p) < 0.0
                        || turn(b, c, p) < 0.0
                        || turn(c, a, p) < 0.0
                })
            };
            if shape > best.0 && empty() {
                best = (shape, Some(i));
            }
        }
        let ear = best.1?;
        out.push(ear_at(ear).map(|i| corners[i]));
        left.remove(ear);
        if n == 3 {
            break;
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &[[f64; 2]]) -> (usize, f64, bool) {
        let points: Vec<_> = polygon
            .iter()
            .map(|[x, y]| Point3::new(*x, *y, 0.3 * x - 0.2 * y))
            .collect();
        let corners: Vec<u32> = (0..points.len() as u32).collect();
        let mut out = Vec::new();
        let done = triangulate(&points, &corners, &mut out).is_some();
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| points[i as usize].xy());
            (b - a).perp(&(c - a))
        };
        let positive = out.iter().all(|t| doubled(t) > 0.0);
        (
            out.len(),
            out.iter().map(doubled).sum::<f64>() / 2.0,
            done && positive,
        )
    }

    #[test]
    fn convex_concave_and_crossing() {
        let pentagon = [[0., 0.], [2., 0.], [3., 1.], [1., 3.], [-1., 1.]];
        assert_eq!(area(&pentagon), (3, 7.0, true));
        let arrow = [[0., 0.], [4., 0.], [4., 4.], [3., 1.]];
        let (count, total, ok) = area(&arrow);
        assert!(count == 2 && ok && (total - 4.0).abs() < 1e-12);
        let comb = [
            [0., 0.],
            [7., 0.],
            [7., 3.],
            [6., 3.],
            [6., 1.],
            [4., 1.],
            [4., 3.],
            [3., 3.],
            [3., 1.],
            [1., 1.],
            [1., 3.],
            [0., 3.],
        ];
        let (count, total, ok) = area(&comb);
        assert!(
            count == 10 && ok && (total - 13.0).abs() < 1e-12,
            "{count} {total}"
        );
        let with_a_straight_corner = [[0., 0.], [1., 0.], [2., 0.], [2., 2.], [0., 2.]];
        let (count, total, ok) = area(&with_a_straight_corner);
        assert!(count == 3 && ok && total == 4.0);
        let bow_tie = [[0., 0.], [2., 2.], [2., 0.], [0., 1.]];
        assert!(!area(&bow_tie).2);
        let line = [[0., 0.], [1., 0.], [2., 0.], [3., 0.]];
        assert!(!area(&line).2);
    }
}
