//! The paper's solver: alternating projections (paper, §4.2, eq. 2; Bouaziz et al. 2012).
//!
//! Local step: every edge is projected onto length L, every point onto the surface, every pair of neighbouring
//! triangles that penetrates onto the paper's approximate feasible set. Global step: one linear solve whose matrix
//! depends on the closeness weight only. Conditions (5), (6) and the σ bound are not part of it; the result shows what
//! they are for. Preview and reference; [`super::exact`] is what a sheet is cut from.

use nalgebra::{Matrix3x2, Point3, Vector3};

use super::RationalizeError;
use super::exact::Effort;
use super::problem::Problem;
use crate::base::progress::Progress;
use crate::base::sparse::{Cholesky, Pattern};
use crate::mesh::ClosestPoint;

/// Iterations while the closeness weight rises ("20–50 iterations for visual feedback").
const RISING: usize = 50;
/// Iterations at the final weight ("an additional 200 iterations").
const FINAL: usize = 200;
/// The weight rises geometrically from w₁ = 0.001 to 0.1 in this many levels; each costs one factorisation.
const LEVELS: usize = 10;
const FIRST_WEIGHT: f64 = 0.001;
const LAST_WEIGHT: f64 = 0.1;

/// Appendix B's projection with its index corrected (`i3 = idI_[3]`): if (v₁ × v₂)·(v₂ × v₃) < 0, v₂ and v₃ move to
/// the line that fits them best, v₁ stays.
fn separate(v1: Vector3<f64>, v2: Vector3<f64>, v3: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    if v1.cross(&v2).dot(&v2.cross(&v3)) >= 0.0 {
        return (v2, v3);
    }
    let svd = Matrix3x2::from_columns(&[v2, v3]).svd_unordered(true, false);
    let Some(u) = svd.u else { return (v2, v3) };
    let h = u
        .column(if svd.singular_values[0] >= svd.singular_values[1] {
            0
        } else {
            1
        })
        .into_owned();
    (h * h.dot(&v2), h * h.dot(&v3))
}

/// Runs the schedule from `start` (millimetres) towards the surface of `closest`.
///
/// # Errors
/// [`RationalizeError`]: interruption, memory.
pub(crate) fn solve(
    problem: &Problem,
    start: &[Point3<f64>],
    closest: &ClosestPoint,
    edge_mm: f64,
    progress: &dyn Progress,
) -> Result<(Vec<Point3<f64>>, Effort), RationalizeError> {
    let edges: Vec<[u32; 2]> = problem
        .triangles
        .iter()
        .flat_map(|t| (0..3).map(move |k| [t[k], t[(k + 1) % 3]]))
        .collect();
    // Of a hinge's points [h, b1, a1, a2, b2]: h with (v1, v2, v3) and with (v4, v3, v2).
    let tuples: Vec<[u32; 4]> = problem
        .hinges
        .iter()
        .flat_map(|h| [[h[0], h[1], h[2], h[3]], [h[0], h[4], h[3], h[2]]])
        .collect();
    let pairs = edges
        .iter()
        .map(|e| (e[0], e[1]))
        .chain(tuples.iter().flat_map(|t| (1..4).map(|k| (t[0], t[k]))));
    let mut cholesky = Cholesky::new(Pattern::new(problem.points, pairs))?;

    let mut constant = vec![0.0; cholesky.pattern().entries()];
    let mut add = |i: u32, j: u32| {
        for (a, b, value) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0)] {
            if let Some(slot) = cholesky.pattern().slot(a as usize, b as usize) {
                constant[slot] += value;
            }
        }
    };
    edges.iter().for_each(|e| add(e[0], e[1]));
    tuples
        .iter()
        .for_each(|t| (1..4).for_each(|k| add(t[0], t[k])));
    let diagonal: Vec<usize> = (0..problem.points)
        .filter_map(|i| cholesky.pattern().slot(i, i))
        .collect();

    let mut x: Vec<Vector3<f64>> = start.iter().map(|p| p.coords / edge_mm).collect();
    let mut faces: Vec<_> = start.iter().map(|p| closest.query(*p).face).collect();
    let mut matrix = vec![0.0; constant.len()];
    let mut rhs = [(); 3].map(|()| vec![0.0; problem.points]);
    let mut effort = Effort::default();
    let mut weight = f64::NAN;
    for iteration in 0..RISING + FINAL {
        progress.check()?;
        let level = (iteration * LEVELS / RISING).min(LEVELS - 1) as f64 / (LEVELS - 1) as f64;
        let wanted = FIRST_WEIGHT * (LAST_WEIGHT / FIRST_WEIGHT).powf(level);
        if weight != wanted {
            weight = wanted;
            matrix.copy_from_slice(&constant);
            diagonal.iter().for_each(|&slot| matrix[slot] += weight);
            cholesky.factor(&matrix)?;
            effort.factorizations += 1;
        }
        for ((i, x), face) in x.iter().enumerate().zip(&mut faces) {
            let found = closest.query_from(Point3::from(x * edge_mm), *face);
            *face = found.face;
            for k in 0..3 {
                rhs[k][i] = weight * found.point[k] / edge_mm;
            }
        }
        let mut pull = |from: u32, to: u32, vector: Vector3<f64>| {
            for k in 0..3 {
                rhs[k][to as usize] += vector[k];
                rhs[k][from as usize] -= vector[k];
            }
        };
        for &[i, j] in &edges {
            let edge = x[j as usize] - x[i as usize];
            pull(i, j, edge.try_normalize(0.0).unwrap_or_else(Vector3::x));
        }
        for t in &tuples {
            let [v1, v2, v3] = [1, 2, 3].map(|k| x[t[k] as usize] - x[t[0] as usize]);
            let (p2, p3) = separate(v1, v2, v3);
            pull(t[0], t[1], v1);
            pull(t[0], t[2], p2);
            pull(t[0], t[3], p3);
        }
        for k in 0..3 {
            cholesky.solve(&mut rhs[k]);
            for (x, r) in x.iter_mut().zip(&rhs[k]) {
                x[k] = *r;
            }
        }
        effort.steps += 1;
        progress.advance(1);
    }
    Ok((
        x.iter().map(|p| Point3::from(p * edge_mm)).collect(),
        effort,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_projection_moves_only_what_penetrates_and_ends_on_the_boundary() {
        let at = |deg: f64| Vector3::new(deg.to_radians().cos(), deg.to_radians().sin(), 0.0);
        let apart = separate(at(0.0), at(60.0), at(70.0));
        assert_eq!(apart, (at(60.0), at(70.0)));
        let (p2, p3) = separate(at(0.0), at(60.0), at(50.0));
        assert!(p2.cross(&p3).norm() < 1e-12, "linearly dependent");
        assert!((p2 - at(60.0)).norm() < 0.1 && (p3 - at(50.0)).norm() < 0.1);
    }
}
