//! The triangle lattice in the plane: vertices at L·e^{iφ}·(i + j·e^{iπ/3}) around the chart's origin.

use nalgebra::{Complex, Point2};

use super::Colour;

/// sin 60° = √3/2: height of a triangle of edge 1.
pub(crate) const HEIGHT: f64 = 0.866_025_403_784_438_6;

/// Edge length and direction of a lattice with a vertex at the origin.
#[derive(Clone, Copy, Debug)]
pub struct Lattice {
    edge_mm: f64,
    direction: Complex<f64>,
}

/// A lattice triangle: the rhombus (i, j) it lies in and which half of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Key {
    pub i: i32,
    pub j: i32,
    pub colour: Colour,
}

impl Lattice {
    /// A lattice of edge `edge_mm` whose first axis makes the angle `orientation` (radians) with X.
    pub fn new(edge_mm: f64, orientation: f64) -> Self {
        Self {
            edge_mm,
            direction: Complex::from_polar(1.0, orientation),
        }
    }

    /// Lattice coordinates (i, j), not rounded, of a chart point.
    #[inline]
    pub(crate) fn coordinates(&self, point: Point2<f64>) -> (f64, f64) {
        let z = Complex::new(point.x, point.y) * self.direction.conj() / self.edge_mm;
        let j = z.im / HEIGHT;
        (z.re - 0.5 * j, j)
    }

    /// The chart point at lattice coordinates (i, j).
    #[inline]
    pub(crate) fn point(&self, i: f64, j: f64) -> Point2<f64> {
        let z = Complex::new(i + 0.5 * j, HEIGHT * j) * self.direction * self.edge_mm;
        Point2::new(z.re, z.im)
    }

    /// The lattice vertex nearest to a chart point.
    pub(crate) fn nearest(&self, at: Complex<f64>) -> Complex<f64> {
        let (i, j) = self.coordinates(Point2::new(at.re, at.im));
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
        corners
            .map(|(a, b)| {
                let p = self.point(i.floor() + a, j.floor() + b);
                Complex::new(p.x, p.y)
            })
            .into_iter()
            .min_by(|a, b| (a - at).norm_sqr().total_cmp(&(b - at).norm_sqr()))
            .unwrap_or(at)
    }

    /// The centroid of a triangle.
    #[inline]
    pub(crate) fn centroid(&self, key: Key) -> Point2<f64> {
        let third = if key.colour == Colour::Up {
            1.0 / 3.0
        } else {
            2.0 / 3.0
        };
        self.point(f64::from(key.i) + third, f64::from(key.j) + third)
    }

    /// The corners of a triangle, counter-clockwise, in the order of [`Colour`].
    pub(crate) fn corners(&self, key: Key) -> [Point2<f64>; 3] {
        corner_indices(key).map(|(i, j)| self.point(f64::from(i), f64::from(j)))
    }

    /// The triangle whose centroid lies at `point`, which must be a centroid up to a small error.
    #[inline]
    pub(crate) fn key_at_centroid(&self, point: Point2<f64>) -> Key {
        let (x, y) = self.coordinates(point);
        let (i, j) = (x.floor(), y.floor());
        let colour = if (x - i) + (y - j) < 1.0 {
            Colour::Up
        } else {
            Colour::Down
        };
        Key {
            i: i as i32,
            j: j as i32,
            colour,
        }
    }
}

/// Lattice vertices of a triangle, counter-clockwise.
pub(crate) fn corner_indices(key: Key) -> [(i32, i32); 3] {
    let Key { i, j, colour } = key;
    match colour {
        Colour::Up => [(i, j), (i + 1, j), (i, j + 1)],
        Colour::Down => [(i + 1, j), (i + 1, j + 1), (i, j + 1)],
    }
}

/// The triangle across side `side` of `key`.
pub(crate) fn across(key: Key, side: usize) -> Key {
    let Key { i, j, colour } = key;
    let (i, j) = match (colour, side) {
        (Colour::Up, 0) => (i, j - 1),
        (Colour::Up, 2) => (i - 1, j),
        (Colour::Down, 0) => (i + 1, j),
        (Colour::Down, 1) => (i, j + 1),
        _ => (i, j),
    };
    Key {
        i,
        j,
        colour: colour.other(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_triangle_is_found_again_by_its_centroid_and_shares_two_corners_with_each_neighbour(
            i in -500i32..500, j in -500i32..500, up: bool, angle in 0.0..7.0f64, edge in 0.1..50.0f64,
        ) {
            let lattice = Lattice::new(edge, angle);
            let key = Key { i, j, colour: if up { Colour::Up } else { Colour::Down } };
            prop_assert_eq!(lattice.key_at_centroid(lattice.centroid(key)), key);
            let corners = lattice.corners(key);
            for side in 0..3 {
                let other = across(key, side);
                prop_assert_eq!(across(other, (0..3).find(|&s| across(other, s) == key).unwrap()), key);
                let theirs = lattice.corners(other);
                for corner in [corners[side], corners[(side + 1) % 3]] {
                    prop_assert!(theirs.iter().any(|c| (c - corner).norm() < 1e-9 * edge * 500.0));
                }
            }
        }
    }
}
