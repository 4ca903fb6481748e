//! Heat: what it costs to cut next to a cut that has not cooled yet, and how far apart successive cuts are.

use kurbo::Point;

/// Cuts before a cut whose heat is still felt. The k-th before it weighs 1/k: a line of heat in a sheet fades with the
/// inverse of time.
pub const LOOKBACK: usize = 3;

/// The price of cutting near a cut made just before, in millimetres of travel.
///
/// A cut pays `price_mm / k · max(0, 1 − gap / reach_mm)` for the k-th cut before it, k = 1 … [`LOOKBACK`], where the gap
/// is the smallest distance between the two, each taken as the straight line between its ends. The order of cuts makes
/// the sum of travel and heat small. A price of zero asks for short travel alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heat {
    /// What touching the cut before costs, millimetres of travel.
    pub price_mm: f64,
    /// The gap from which on nothing is paid, millimetres.
    pub reach_mm: f64,
}

impl Heat {
    /// Short travel alone.
    pub const NONE: Self = Self {
        price_mm: 0.0,
        reach_mm: 0.0,
    };

    /// Whether anything is ever paid. Prices and reaches that are no positive numbers ask for nothing.
    pub(super) fn counts(&self) -> bool {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        positive(self.price_mm) && positive(self.reach_mm)
    }

    /// What two cuts pay for each other, with `k` − 1 others between them.
    pub(super) fn between(&self, a: &[Point; 2], b: &[Point; 2], k: usize) -> f64 {
        let gap = gap_mm(a, b);
        self.price_mm / k as f64 * (1.0 - gap / self.reach_mm).max(0.0)
    }
}

/// The smallest distance between two straight cuts, each given by its ends, millimetres.
pub(super) fn gap_mm(a: &[Point; 2], b: &[Point; 2]) -> f64 {
    if cross(a, b) {
        return 0.0;
    }
    let to = |p: Point, [from, to]: &[Point; 2]| {
        let d = *to - *from;
        let along = (p - *from).dot(d) / d.hypot2();
        // A cut of no length has no direction: its point is all there is.
        let along = if along.is_finite() {
            along.clamp(0.0, 1.0)
        } else {
            0.0
        };
        p.distance_squared(*from + along * d)
    };
    to(a[0], b)
        .min(to(a[1], b))
        .min(to(b[0], a))
        .min(to(b[1], a))
        .sqrt()
}

fn cross(a: &[Point; 2], b: &[Point; 2]) -> bool {
    let side = |p: Point, l: &[Point; 2]| (l[1] - l[0]).cross(p - l[0]);
    side(a[0], b) * side(a[1], b) < 0.0 && side(b[0], a) * side(b[1], a) < 0.0
}

/// How far apart cuts are that follow each other.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spacing {
    /// Mean of the gap between a cut and the nearest of the [`LOOKBACK`] before it, millimetres.
    pub mean_mm: f64,
    /// The gap that one cut in twenty falls below, millimetres.
    pub low_mm: f64,
}

/// The spacing of cuts in the order given, each by its two ends; none for fewer than two cuts.
pub fn spacing(cuts: &[[Point; 2]]) -> Option<Spacing> {
    let mut gaps: Vec<f64> = (1..cuts.len())
        .map(|i| {
            cuts[i.saturating_sub(LOOKBACK)..i]
                .iter()
                .map(|before| gap_mm(before, &cuts[i]))
                .fold(f64::INFINITY, f64::min)
        })
        .collect();
    gaps.sort_by(f64::total_cmp);
    let low_mm = *gaps.get(gaps.len() / 20)?;
    Some(Spacing {
        mean_mm: gaps.iter().sum::<f64>() / gaps.len() as f64,
        low_mm,
    })
}
