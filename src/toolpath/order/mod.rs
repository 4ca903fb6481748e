//! The order of strokes: short travel between them, and on demand cool.
//!
//! A stroke is entered at one end and left at the other, either way round or, if it must, one way only. The tour starts at the head's position and
//! ends anywhere: the cheapest links first, then improved by exchanges of two and three links towards near neighbours
//! (S. Lin 1965; D. S. Johnson, L. A. McGeoch 1997); at last small random kicks, each kept only if the repaired tour
//! is no longer. Seeded, so the same strokes give the same order.
//!
//! Strokes are numbered along a curve that fills the plane, and kicks go along it: what one kick looks at, the next
//! finds in the processor's cache.

mod curve;
mod first;
mod heat;
mod near;
mod tour;

use kurbo::Point;

pub use heat::{Heat, LOOKBACK, Spacing, spacing};
use tour::Tour;

/// Which way a stroke may be gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// From either end to the other.
    Either,
    /// From its first end to its second: it begins with its pierce.
    Forwards,
    /// From either end and back to it, as an even number of passes does.
    Back,
}

/// How often the tour is kicked: more for each stroke of a small set, and in proportion to the strokes of a large one, so
/// that the time grows with their number. A kick where heat counts takes ten times as long.
fn kicks(strokes: usize, heat: Heat) -> usize {
    let (each, few) = if heat.counts() {
        (2, 6000)
    } else {
        (15, 60_000)
    };
    few.min(60 * strokes).max(each * strokes)
}

/// The order of strokes by their two ends (millimetres), each with whether it is reversed, for a head at `start` and with
/// a price of heat. Every stroke comes once, and the same strokes always come in the same order: as given, where a
/// coordinate is no number. Near O(n log n).
pub fn order_strokes(
    ends: &[[Point; 2]],
    start: Point,
    way: Way,
    heat: Heat,
) -> Vec<(usize, bool)> {
    let finite = start.is_finite() && ends.iter().flatten().all(|p| p.is_finite());
    if ends.is_empty() || !finite {
        return (0..ends.len()).map(|s| (s, false)).collect();
    }
    let along = curve::along(ends);
    let sorted: Vec<[Point; 2]> = along.iter().map(|&s| ends[s]).collect();
    let mut tour = Tour::new(&sorted, start, way, heat);
    tour.improve();
    tour.kick(kicks(ends.len(), heat));
    let order = tour.order();
    order.into_iter().map(|(s, r)| (along[s], r)).collect()
}

#[cfg(test)]
mod tests;
