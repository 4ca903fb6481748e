//! The global step, solved for the triangles instead of the points.
//!
//! Local steps ask for moves of edge vectors; the global step finds the points that meet them best. With one weight w
//! for all edge vectors, three for a triangle, its matrix is A = D − BᵀwB: B sums the corners of every triangle, D is
//! diagonal (3w for every triangle at a point, and the pulls on the point itself). The points follow from the sums
//! s = wB x by x = D⁻¹(f + Bᵀs), and the sums from
//!
//! > (1/w − B D⁻¹ Bᵀ) s = B D⁻¹ f,
//!
//! positive definite as A is. It has an unknown a triangle, where A has one a point (3 : 2), and three neighbours a row,
//! where A has four: the dual of the hexagons instead of the kagome net. Its factor is less than half as large, and so
//! is the time for each solve. A point that is held has D⁻¹ = 0: the pattern never changes.
//!
//! f is what the local steps ask for beyond the present positions, so the solution is a step, and terms that are met
//! weigh in A alone.

use crate::base::sparse::{Cholesky, FactorError, Pattern, Triangle};

/// The matrix over triangles and its factor. Triangles are numbered by the caller; once built, [`Global::order`] is
/// the numbering in which everything else must be given.
pub(super) struct Global {
    cholesky: Cholesky,
    factor: Triangle,
    values: Vec<f64>,
    /// Slots of the diagonal, in the order of elimination.
    diagonal: Vec<u32>,
    /// Slots of the pairs that a hinge joins, in the order of the pairs given.
    joints: Vec<u32>,
    /// Numeric factorisations so far.
    pub factorizations: usize,
}

impl Global {
    /// The system of `triangles` triangles of which `pairs` are joined.
    pub fn new(triangles: usize, pairs: &[[u32; 2]]) -> Result<Self, FactorError> {
        let pattern = Pattern::new(triangles, pairs.iter().map(|p| (p[0], p[1])));
        let cholesky = Cholesky::new(pattern)?;
        let factor = Triangle::new(&cholesky);
        let pattern = cholesky.pattern();
        let diagonal = factor
            .order()
            .iter()
            .map(|&t| pattern.diagonal(t as usize) as u32)
            .collect();
        let joints = pairs
            .iter()
            .map(|p| {
                pattern
                    .slot(p[0] as usize, p[1] as usize)
                    .unwrap_or_default() as u32
            })
            .collect();
        Ok(Self {
            values: vec![0.0; pattern.entries()],
            diagonal,
            joints,
            factor,
            cholesky,
            factorizations: 0,
        })
    }

    /// The triangles in the order of elimination.
    pub fn order(&self) -> &[u32] {
        self.factor.order()
    }

    /// Entries of the factor below its diagonal.
    pub fn entries(&self) -> usize {
        self.factor.entries()
    }

    /// Factors for the edge weight `weight` and the `reciprocals` 1/D by point. `corners` are the points of the
    /// triangles in the order of elimination, `hinges` the points of the pairs.
    pub fn refactor(
        &mut self,
        weight: f64,
        reciprocals: &[f64],
        corners: &[[u32; 3]],
        hinges: impl Iterator<Item = u32>,
    ) -> Result<(), FactorError> {
        self.values.fill(0.0);
        for (&slot, corners) in self.diagonal.iter().zip(corners) {
            let sum: f64 = corners.iter().map(|&p| reciprocals[p as usize]).sum();
            self.values[slot as usize] = 1.0 / weight - sum;
        }
        for (&slot, point) in self.joints.iter().zip(hinges) {
            self.values[slot as usize] -= reciprocals[point as usize];
        }
        self.cholesky.factor(&self.values)?;
        self.factor.refresh(&self.cholesky);
        self.factorizations += 1;
        Ok(())
    }

    /// Replaces the right-hand side, by triangle in the order of elimination, by the sums.
    pub fn solve(&self, sums: &mut [[f64; 4]]) {
        self.factor.solve(sums);
    }
}
