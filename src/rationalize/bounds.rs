//! Which bounds hold a linkage back: where it cannot follow the surface, some hinges stand at theirs.

use nalgebra::{Point3, Vector3};

use super::problem::{Problem, hinge_violations};
use crate::linkage::Linkage;

/// A condition nearer to its bound than this, in L, counts as active.
const ACTIVE: f64 = 5e-3;

/// The hinges near a place, and how many of them stand at a bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Bounds {
    /// Hinges near the place.
    pub hinges: usize,
    /// Of them, open to σ or to 180°: the sheet cannot stretch farther.
    pub open: usize,
    /// Of them, closed, their triangles touching along the slit: the sheet cannot shrink farther.
    pub closed: usize,
}

impl Bounds {
    /// Counts the hinges within `reach` (in L) of `place` (millimetres), at `positions` (millimetres, by point).
    pub fn near(
        linkage: &Linkage,
        positions: &[Point3<f64>],
        sigma: f64,
        place: Point3<f64>,
        reach: f64,
    ) -> Self {
        let problem = Problem::new(linkage, sigma);
        let at = |i: u32| -> Vector3<f64> { (positions[i as usize] - place) / linkage.edge_mm };
        let mut bounds = Self::default();
        for h in &problem.hinges {
            let p = h.map(at);
            if p[0].norm() > reach {
                continue;
            }
            let [second, first, open_first, open_second, scale] = hinge_violations(&p, sigma);
            bounds.hinges += 1;
            bounds.open += usize::from(scale.max(open_first).max(open_second) > -ACTIVE);
            bounds.closed += usize::from(second.max(first) > -ACTIVE);
        }
        bounds
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::Handedness;

    #[test]
    fn a_closed_patch_is_closed_everywhere_and_a_bound_below_its_opening_is_met_everywhere() {
        let linkage = Linkage::patch(5.0, Handedness::Right, &Linkage::hexagon_cells(3));
        let mut positions = vec![Point3::origin(); linkage.point_count()];
        for t in linkage.triangles.iter() {
            for (point, flat) in t.points.iter().zip(t.flat) {
                positions[point.0 as usize] = Point3::new(flat.x, flat.y, 0.0);
            }
        }
        let all = |sigma, reach| Bounds::near(&linkage, &positions, sigma, Point3::origin(), reach);
        let count = linkage.hinges.len();
        assert_eq!(
            all(2.0, 10.0),
            Bounds {
                hinges: count,
                open: 0,
                closed: count
            }
        );
        assert_eq!(
            all(1.0, 10.0),
            Bounds {
                hinges: count,
                open: count,
                closed: count
            }
        );
        // The three hinges of the vertex in the middle.
        assert_eq!(all(2.0, 0.5).hinges, 3);
    }
}
