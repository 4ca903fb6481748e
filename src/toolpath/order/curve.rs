//! Strokes along a curve that fills the plane (D. Hilbert 1891): what is near in the plane is mostly near along it.

use kurbo::Point;

/// The curve visits the cells of a square of so many cells, a power of two, each way.
const CELLS: u32 = 1 << 16;

/// The numbers of the strokes in the order of their middles along the curve; of one cell, in their own.
pub(super) fn along(ends: &[[Point; 2]]) -> Vec<usize> {
    let middles = || ends.iter().map(|[a, b]| a.midpoint(*b));
    let least = |f: fn(Point) -> f64| middles().map(f).fold(f64::INFINITY, f64::min);
    let (left, low) = (least(|p| p.x), least(|p| p.y));
    let (right, high) = (-least(|p| -p.x), -least(|p| -p.y));
    let side = (right - left).max(high - low);
    // A cast from what is no number is zero: strokes in one place need no curve.
    let cell = |v: f64| ((v / side * f64::from(CELLS)) as u32).min(CELLS - 1);
    let keys: Vec<u32> = middles()
        .map(|p| hilbert(cell(p.x - left), cell(p.y - low)))
        .collect();
    let mut along: Vec<usize> = (0..ends.len()).collect();
    along.sort_by_key(|&s| keys[s]);
    along
}

/// How many cells the curve visits before this one.
fn hilbert(mut x: u32, mut y: u32) -> u32 {
    let mut before = 0;
    let mut half = CELLS / 2;
    while half > 0 {
        let (right, above) = (x & half != 0, y & half != 0);
        // The quarters are visited from the lower left over the upper left and right to the lower right.
        before = 4 * before
            + match (right, above) {
                (false, false) => 0,
                (false, true) => 1,
                (true, true) => 2,
                (true, false) => 3,
            };
        // The first and the last are turned over a diagonal.
        if !above {
            if right {
                (x, y) = (CELLS - 1 - x, CELLS - 1 - y);
            }
            (x, y) = (y, x);
        }
        half /= 2;
    }
    before
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_from_cell_to_neighbouring_cell() {
        // The corner of 64 by 64 cells that the curve visits first.
        let mut cells: Vec<(u32, u32)> =
            (0..64).flat_map(|x| (0..64).map(move |y| (x, y))).collect();
        cells.sort_by_key(|&(x, y)| hilbert(x, y));
        assert_eq!(cells[0], (0, 0));
        for (n, pair) in cells.windows(2).enumerate() {
            let ((a, b), (c, d)) = (pair[0], pair[1]);
            assert_eq!(a.abs_diff(c) + b.abs_diff(d), 1, "{pair:?}");
            assert_eq!(hilbert(c, d), n as u32 + 1);
        }
    }
}
