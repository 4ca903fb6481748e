//! Triangles that meet although no hinge joins them: found by a grid over their centroids.
//!
//! Conditions (3)–(6) keep the two triangles of every hinge apart. Triangles on opposite sides of one opening, or of
//! two leaves of a fold, can still cross.

use nalgebra::Vector3;

use super::grid::PointGrid;

/// Depth in L below which an overlap is rounding, not an overlap: a hundredth of a kerf even for large triangles.
pub const OVERLAP_TOLERANCE: f64 = 1e-4;

/// Tells of every pair of triangles without a common point that cross, lower number first. `x` in L, by point.
pub(super) fn crossing(
    triangles: &[[u32; 3]],
    x: &[Vector3<f64>],
    centroids: &[Vector3<f64>],
    mut tell: impl FnMut(usize, usize),
) {
    // Circumradius 1/√3: centroids of triangles that meet are no farther apart than twice that.
    let reach = 2.0 / 3f64.sqrt();
    let grid = PointGrid::new(centroids, reach);
    for (n, centre) in centroids.iter().enumerate() {
        grid.near(centre, reach, |other| {
            if other <= n || triangles[n].iter().any(|i| triangles[other].contains(i)) {
                return;
            }
            let [a, b] = [n, other].map(|t| triangles[t].map(|i| x[i as usize]));
            if edges_cross(&a, &b) || edges_cross(&b, &a) {
                tell(n, other);
            }
        });
    }
}

/// Centroids of triangles, in the unit of `x`.
pub(super) fn centroids(triangles: &[[u32; 3]], x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    triangles
        .iter()
        .map(|t| t.iter().map(|&i| x[i as usize]).sum::<Vector3<f64>>() / 3.0)
        .collect()
}

/// True if an edge of `a` passes through the inside of `b` by more than the tolerance.
fn edges_cross(a: &[Vector3<f64>; 3], b: &[Vector3<f64>; 3]) -> bool {
    let Some(normal) = (b[1] - b[0]).cross(&(b[2] - b[0])).try_normalize(0.0) else {
        return false;
    };
    (0..3).any(|k| {
        let (p, q) = (a[k], a[(k + 1) % 3]);
        let (dp, dq) = ((p - b[0]).dot(&normal), (q - b[0]).dot(&normal));
        if dp.min(dq) > -OVERLAP_TOLERANCE || dp.max(dq) < OVERLAP_TOLERANCE {
            return false;
        }
        let at = p + (q - p) * (dp / (dp - dq));
        (0..3).all(|s| {
            let edge = b[(s + 1) % 3] - b[s];
            edge.cross(&(at - b[s])).dot(&normal) > OVERLAP_TOLERANCE * edge.norm()
        })
    })
}
