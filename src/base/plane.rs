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
}
