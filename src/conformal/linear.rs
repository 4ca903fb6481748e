//! The linear model of the conformal map: its first Newton step, for all singularities at once.

use super::metric::spread;
use super::system::{Energy as _, System, Unknowns};
use super::{CURVATURE_UNIT, ConformalError};
use crate::base::ids::{Id as _, Per};
use crate::mesh::{Surface, VertexId};

/// Right-hand sides solved together: wide enough for the dense kernels, small enough to stay near the processor (6 MB on
/// 25 000 vertices).
const BATCH: usize = 32;

/// The first Newton step from the surface's own metric, for all singularities at once: u is linear in them.
pub(super) struct LinearModel<'s> {
    surface: &'s Surface,
    unknowns: &'s Unknowns,
    system: &'s mut System,
    start: Per<VertexId, f64>,
    /// One right-hand side, with the held entry.
    rhs: Vec<f64>,
}

impl<'s> LinearModel<'s> {
    /// The model in which `target` are the angle sums without singularities.
    pub fn new(
        surface: &'s Surface,
        unknowns: &'s Unknowns,
        system: &'s mut System,
        target: &[f64],
    ) -> Result<Self, ConformalError> {
        let mut rhs = vec![0.0; unknowns.count + 1];
        system.evaluate(&vec![0.0; unknowns.count + 1], target, &mut rhs)?;
        system.factor_start()?;
        rhs.iter_mut().for_each(|g| *g = -*g);
        system.solve_columns(&mut rhs[..unknowns.count], 1);
        Ok(Self {
            surface,
            start: spread(unknowns, &rhs),
            unknowns,
            system,
            rhs,
        })
    }

    /// The model around `u`, the unknowns of a metric, with the held entry.
    pub fn around(
        surface: &'s Surface,
        unknowns: &'s Unknowns,
        system: &'s mut System,
        u: &[f64],
    ) -> Result<Self, ConformalError> {
        let mut rhs = vec![0.0; unknowns.count + 1];
        system.evaluate(u, &vec![0.0; unknowns.count + 1], &mut rhs)?;
        system.factor_here()?;
        Ok(Self {
            surface,
            start: spread(unknowns, u),
            unknowns,
            system,
            rhs,
        })
    }

    /// u without cones, all inner rims turning by 0; around a metric, its own.
    pub fn start(&self) -> &Per<VertexId, f64> {
        &self.start
    }

    /// What a cone of +1 at a vertex adds.
    pub fn cone(&mut self, vertex: VertexId) -> Per<VertexId, f64> {
        let row = self.unknowns.of[vertex.index()];
        self.column(|rhs| rhs[row as usize] = CURVATURE_UNIT)
    }

    /// What a cone of +1 at each of `vertices` adds, at `samples` only: one column a vertex, in their order. Many at
    /// once cost a fraction of as many calls of [`LinearModel::cone`].
    pub fn cones(&mut self, vertices: &[VertexId], samples: &[VertexId]) -> Vec<Vec<f64>> {
        let rows = self.unknowns.count;
        let row = |v: VertexId| self.unknowns.of[v.index()] as usize;
        let mut block = vec![0.0; rows * BATCH.min(vertices.len())];
        let mut columns = Vec::with_capacity(vertices.len());
        for batch in vertices.chunks(BATCH) {
            let block = &mut block[..rows * batch.len()];
            block.fill(0.0);
            for (column, &vertex) in batch.iter().enumerate() {
                if row(vertex) < rows {
                    block[column * rows + row(vertex)] = CURVATURE_UNIT;
                }
            }
            self.system.solve_columns(block, batch.len());
            columns.extend((0..batch.len()).map(|column| {
                let values = &block[column * rows..][..rows];
                let value = |&v: &VertexId| values.get(row(v)).copied().unwrap_or(0.0);
                samples.iter().map(value).collect()
            }));
        }
        columns
    }

    /// What one more unit of turning at inner rim `rim` (1, 2, …) adds.
    pub fn rim(&mut self, rim: usize) -> Per<VertexId, f64> {
        self.cone(self.surface.rims()[rim][0])
    }

    /// What one unit of curvature adds that is spread in proportion to `weight`.
    pub fn spread(&mut self, weight: &Per<VertexId, f64>) -> Per<VertexId, f64> {
        let total: f64 = weight.iter().sum();
        let unknowns = self.unknowns;
        self.column(|rhs| {
            for (w, &row) in weight.iter().zip(&unknowns.of) {
                rhs[row as usize] += CURVATURE_UNIT * w / total;
            }
        })
    }

    fn column(&mut self, fill: impl FnOnce(&mut [f64])) -> Per<VertexId, f64> {
        self.rhs.fill(0.0);
        fill(&mut self.rhs);
        let held = self.unknowns.count;
        self.rhs[held] = 0.0;
        self.system.solve_columns(&mut self.rhs[..held], 1);
        spread(self.unknowns, &self.rhs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformal::MetricSolver;
    use crate::mesh::Sample;

    /// Also at a rim, where the unknown is shared, and on the first rim, where there is none; more than one batch.
    #[test]
    fn columns_solved_together_are_those_solved_alone() {
        let sample = Sample::parse("vase:faces=800").and_then(|s| s.generate());
        let surface = sample.unwrap();
        let mut solver = MetricSolver::new(&surface).unwrap();
        let mut model = solver.linear_model().unwrap();
        let all: Vec<VertexId> = surface.positions().ids().collect();
        let places: Vec<VertexId> = all.iter().copied().step_by(5).collect();
        assert!(places.len() > 2 * BATCH && places.iter().any(|v| surface.on_rim(*v)));
        let together = model.cones(&places, &all);
        for (&place, column) in places.iter().zip(&together) {
            let alone = model.cone(place);
            assert_eq!(column.len(), alone.len());
            for (a, b) in column.iter().zip(alone.iter()) {
                assert!((a - b).abs() < 1e-12, "{a} and {b}");
            }
        }
    }
}
