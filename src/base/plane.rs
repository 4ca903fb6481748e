//! Points, segments and polygons of the plane, for the rooms that measure sheets.

use kurbo::Point;

/// Where between `a` (0) and `b` (1) their segment is nearest to `p`; 0 if they are one point.
pub fn nearest_part(a: Point, b: Point, p: Point) -> f64 {
    let d = b - a;
    ((p - a).dot(d) / d.hypot2().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

/// Distance of `p` from the segment between `a` and `b`.
pub fn from_segment(p: Point, a: Point, b: Point) -> f64 {
    p.distance(a.lerp(b, nearest_part(a, b, p)))
}

/// Least distance between the segments from `a` to `b` and from `c` to `d`.
///
/// Always the distance of two points that lie on them, never 0 for what only seems to cross: of two that lie in one
/// line, apart, rounding leaves the sides on which their ends are to chance.
pub fn between_segments([a, b]: [Point; 2], [c, d]: [Point; 2]) -> f64 {
    let (u, v) = (b - a, d - c);
    let ends = from_segment(a, c, d)
        .min(from_segment(b, c, d))
        .min(from_segment(c, a, b))
        .min(from_segment(d, a, b));
    let across = u.cross(v);
    if across == 0.0 {
        return ends;
    }
    // Where the lines cross, if that is on both; whatever is on the first, it is no nearer than the nearest.
    let part = (c - a).cross(v) / across;
    if (0.0..=1.0).contains(&part) {
        ends.min(from_segment(a.lerp(b, part), c, d))
    } else {
        ends
    }
}

/// Whether the ray from `p` along X crosses the segment between `a` and `b`: an odd number of sides of a polygon
/// around a point inside it.
pub fn crosses(a: Point, b: Point, p: Point) -> bool {
    (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)
}

/// Whether a polygon, its first point not repeated, goes around `p`.
pub fn encloses(polygon: &[Point], p: Point) -> bool {
    let n = polygon.len();
    let crossed = (0..n).filter(|&i| crosses(polygon[i], polygon[(i + 1) % n], p));
    crossed.count() % 2 == 1
}

/// The middle of a triangle.
pub fn centroid([a, b, c]: &[Point; 3]) -> Point {
    ((a.to_vec2() + b.to_vec2() + c.to_vec2()) / 3.0).to_point()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_inside_where_its_ray_leaves_and_near_where_its_foot_is() {
        let l = [(0., 0.), (4., 0.), (4., 2.), (2., 2.), (2., 4.), (0., 4.)].map(Point::from);
        for (p, inside) in [
            ((1.0, 1.0), true),
            ((3.0, 1.0), true),
            ((1.0, 3.0), true),
            ((3.0, 3.0), false),
            ((-1.0, 2.0), false),
        ] {
            assert_eq!(encloses(&l, p.into()), inside, "{p:?}");
        }
        let [a, b] = [(1.0, 1.0), (5.0, 1.0)].map(Point::from);
        assert_eq!(from_segment(Point::new(3.0, 4.0), a, b), 3.0);
        assert_eq!(from_segment(Point::new(8.0, 5.0), a, b), 5.0);
        assert_eq!(from_segment(Point::new(1.0, 3.0), a, a), 2.0);
        assert_eq!(nearest_part(a, b, Point::new(2.0, 9.0)), 0.25);
    }
    #[test]
    fn two_segments_are_as_far_apart_as_their_nearest_points() {
        let line = |a: (f64, f64), b: (f64, f64)| [Point::from(a), Point::from(b)];
        for (one, other, distance) in [
            // Crossing, touching, meeting at ends.
            (line((0., 0.), (4., 4.)), line((0., 4.), (4., 0.)), 0.0),
            (line((0., 0.), (4., 0.)), line((1., 0.), (1., 3.)), 0.0),
            (line((0., 0.), (4., 0.)), line((4., 0.), (7., 1.)), 0.0),
            // Side by side, one behind the other, overlapping.
            (line((0., 0.), (4., 0.)), line((3., 2.), (9., 2.)), 2.0),
            (line((0., 0.), (4., 0.)), line((7., 4.), (9., 4.)), 5.0),
            (line((0., 0.), (4., 0.)), line((6., 0.), (5., 0.)), 1.0),
            (line((0., 0.), (4., 0.)), line((3., 0.), (9., 0.)), 0.0),
            // An end beside the middle; points.
            (line((0., 0.), (4., 0.)), line((2., 3.), (2., 8.)), 3.0),
            (line((0., 0.), (4., 0.)), line((2., 3.), (2., 3.)), 3.0),
            (line((1., 1.), (1., 1.)), line((4., 5.), (4., 5.)), 5.0),
        ] {
            let ([a, b], [c, d]) = (one, other);
            for (p, q) in [([a, b], [c, d]), ([b, a], [c, d]), ([a, b], [d, c])] {
                for found in [between_segments(p, q), between_segments(q, p)] {
                    assert!((found - distance).abs() < 1e-12, "{p:?} {q:?}: {found}");
                }
            }
        }
    }

    #[test]
    fn segments_one_behind_the_other_never_seem_to_cross() {
        // Rounding leaves them not quite in one line, at every angle in another way.
        for n in 0..2000 {
            let u = kurbo::Vec2::from_angle(0.003 * f64::from(n));
            let at = |along: f64| Point::new(30.0, 40.0) + u * along;
            for gap in [1e-3, 0.1, 2.0] {
                let found = between_segments([at(0.0), at(1.0)], [at(1.0 + gap), at(2.0 + gap)]);
                assert!((found - gap).abs() < 1e-9, "{n}: {found} for {gap}");
            }
        }
    }
}
