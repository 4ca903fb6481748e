//! Walking straight ahead on the flattened surface, face by face and across seams.
//!
//! Neighbours of a lattice triangle are found by going there, not by their coordinates, so a chart that overlaps
//! itself, or a seam in between, does no harm: the path knows on which sheet it is.

use nalgebra::Point2;

use crate::conformal::{Layout, Transition};
use crate::mesh::{FaceId, HalfedgeId, Surface};

/// Where a walk ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival {
    /// The face that holds the goal.
    pub face: FaceId,
    /// From the chart coordinates at the start to those of `face`.
    pub motion: Transition,
}

/// Walks on one layout.
pub(crate) struct Walker<'a> {
    pub surface: &'a Surface,
    pub layout: &'a Layout,
    /// A point this close to a face is on it, millimetres. Far above rounding, far below anything that shows.
    pub tolerance_mm: f64,
}

/// Twice the signed area of a, b, c.
#[inline]
fn orient(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

impl Walker<'_> {
    /// Signed distances of a point from the three sides of a face, positive inside.
    #[inline]
    pub fn depths(&self, face: FaceId, point: Point2<f64>) -> [f64; 3] {
        let c = &self.layout.corners[face];
        std::array::from_fn(|k| {
            let (a, b) = (c[k], c[(k + 1) % 3]);
            let length = (b - a).norm();
            if length > 0.0 {
                orient(a, b, point) / length
            } else {
                0.0
            }
        })
    }

    /// True if the point lies in the face or within the tolerance of it.
    #[inline]
    pub fn contains(&self, face: FaceId, point: Point2<f64>) -> bool {
        self.depths(face, point)
            .iter()
            .all(|d| *d >= -self.tolerance_mm)
    }

    /// Barycentric coordinates of a chart point in a face, clamped to the face.
    pub fn barycentric(&self, face: FaceId, point: Point2<f64>) -> [f64; 3] {
        let c = &self.layout.corners[face];
        let mut weights: [f64; 3] =
            std::array::from_fn(|k| orient(c[(k + 1) % 3], c[(k + 2) % 3], point).max(0.0));
        let sum: f64 = weights.iter().sum();
        if sum > 0.0 {
            weights.iter_mut().for_each(|w| *w /= sum);
            weights
        } else {
            [1.0 / 3.0; 3]
        }
    }

    /// The face across a side and the motion into its chart.
    #[inline]
    pub fn cross(&self, side: HalfedgeId) -> Option<(HalfedgeId, Transition)> {
        let twin = self.surface.twin(side)?;
        Some((
            twin,
            self.layout
                .seam
                .get(&side)
                .copied()
                .unwrap_or(Transition::IDENTITY),
        ))
    }

    /// Goes straight from a point of `face` to `goal` (both in the chart of `face`); `None` if the way leaves the
    /// surface.
    pub fn walk(&self, face: FaceId, from: Point2<f64>, goal: Point2<f64>) -> Option<Arrival> {
        let (mut face, mut from, mut goal) = (face, from, goal);
        let mut motion = Transition::IDENTITY;
        let mut entry: Option<usize> = None;
        // A straight path meets every face a bounded number of times; the bound only guards against broken charts.
        for _ in 0..=3 * self.surface.faces().len() {
            let depths = self.depths(face, goal);
            if depths.iter().all(|d| *d >= -self.tolerance_mm) {
                return Some(Arrival { face, motion });
            }
            let c = &self.layout.corners[face];
            let exit = match entry {
                // The apex decides between the two sides that are left.
                Some(e) => {
                    if orient(from, goal, c[(e + 2) % 3]) > 0.0 {
                        (e + 1) % 3
                    } else {
                        (e + 2) % 3
                    }
                }
                None => {
                    let side = |k: usize| orient(from, goal, c[k % 3]);
                    let straddled = (0..3)
                        .filter(|&k| {
                            depths[k] < -self.tolerance_mm && side(k) <= 0.0 && side(k + 1) >= 0.0
                        })
                        .min_by(|&a, &b| depths[a].total_cmp(&depths[b]));
                    straddled.or_else(|| (0..3).min_by(|&a, &b| depths[a].total_cmp(&depths[b])))?
                }
            };
            let (twin, step) = self.cross(HalfedgeId::side(face, exit))?;
            (from, goal) = (step.apply(from), step.apply(goal));
            motion = motion.then(&step);
            face = twin.face();
            entry = Some(twin.corner());
        }
        None
    }
}
