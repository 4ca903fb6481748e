//! The exact solve: Levenberg–Marquardt on all conditions at once, in units of L.
//!
//! Residuals: |e| − 1 for every edge; the active ones among (3)–(6) and λ ≤ σ; a pull towards the surface
//! w_c n·(x − P(x)), point to plane with n along x − P(x); and an anchor w_a (x − x₀) at the lift that stops drift along
//! the surface. Three unknowns a point, less two edges, less one surface condition leave only freedom at the rim, so
//! exact solutions on the surface are the rule, and the two soft terms fade out over a few stages without the edges
//! having to give way. Where σ forbids the surface the edges stay exact and the distance shows it.
//!
//! The normal equations have one pattern for all states, so ordering and symbolic factor are computed once.

use nalgebra::{Point3, Vector3};

use super::RationalizeError;
use super::problem::{Condition, Problem, hinge_scale};
use crate::base::progress::Progress;
use crate::base::sparse::{Cholesky, FactorError, Pattern};
use crate::mesh::{ClosestPoint, FaceId};

/// One stage of the continuation: weights of closeness and anchor, starting damping.
#[derive(Clone, Copy, Debug)]
struct Stage {
    closeness: f64,
    anchor: f64,
    damping: f64,
    /// The stage ends when a step gains less than this part of the energy.
    gain: f64,
}

/// Closeness and anchor fade by powers of ten; each stage starts so near its solution that a few steps suffice. The
/// last leaves a pull of 10⁻⁴, which bends the edges by no more than its square. Only the last is worth finishing: the
/// others end at the first step that gains little.
const STAGES: [Stage; 5] = [
    Stage {
        closeness: 0.3,
        anchor: 1e-2,
        damping: 1e-3,
        gain: 2e-2,
    },
    Stage {
        closeness: 0.1,
        anchor: 3e-3,
        damping: 1e-4,
        gain: 2e-2,
    },
    Stage {
        closeness: 0.01,
        anchor: 3e-4,
        damping: 1e-6,
        gain: 2e-2,
    },
    Stage {
        closeness: 1e-3,
        anchor: 3e-5,
        damping: 1e-8,
        gain: 2e-2,
    },
    Stage {
        closeness: 1e-4,
        anchor: 1e-6,
        damping: 1e-10,
        gain: 1e-4,
    },
];

/// Steps in one stage at the most. Feasible cases take 2–5; infeasible ones would creep on without end.
const STEPS_PER_STAGE: usize = 12;

/// What a solver did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Steps taken (exact) or iterations (projection).
    pub steps: usize,
    /// Numeric factorisations.
    pub factorizations: usize,
}

/// Solves from `start` (millimetres, one position a point) towards the surface of `closest`; `edge_mm` is L.
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
    let mut system = System::new(problem, start, closest, edge_mm)?;
    let mut effort = Effort::default();
    let mut x = system.anchor.clone();
    for (number, stage) in STAGES.iter().enumerate() {
        progress.check()?;
        system.run_stage(&mut x, stage, &mut effort, progress)?;
        progress.advance(1);
        if number == STAGES.len() - 1 {
            break;
        }
    }
    Ok((
        x.iter().map(|p| Point3::from(p * edge_mm)).collect(),
        effort,
    ))
}

/// Where one 3 × 3 block of the matrix is stored: the slots of its three columns' first entries.
#[derive(Clone, Copy, Debug)]
struct Block {
    columns: [u32; 3],
}

struct System<'a> {
    problem: &'a Problem,
    closest: &'a ClosestPoint,
    edge_mm: f64,
    anchor: Vec<Vector3<f64>>,
    faces: Vec<FaceId>,
    cholesky: Cholesky,
    diagonal: Vec<Block>,
    /// For every triangle the blocks of its sides (k, k + 1).
    sides: Vec<[Block; 3]>,
    /// For every hinge the blocks of the pairs (i, j), i < j, of its five points, in the order of [`PAIRS`].
    pairs: Vec<[Block; 10]>,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
    planes: Vec<(Vector3<f64>, f64)>,
}

/// Pairs of a hinge's five points.
const PAIRS: [(usize, usize); 10] = [
    (0, 1),
    (0, 2),
    (0, 3),
    (0, 4),
    (1, 2),
    (1, 3),
    (1, 4),
    (2, 3),
    (2, 4),
    (3, 4),
];

impl<'a> System<'a> {
    fn new(
        problem: &'a Problem,
        start: &[Point3<f64>],
        closest: &'a ClosestPoint,
        edge_mm: f64,
    ) -> Result<Self, RationalizeError> {
        let sides = problem
            .triangles
            .iter()
            .flat_map(|t| (0..3).map(move |k| (t[k], t[(k + 1) % 3])));
        let pairs = problem
            .hinges
            .iter()
            .flat_map(|h| PAIRS.iter().map(move |&(i, j)| (h[i], h[j])));
        let pattern = Pattern::new(problem.points, sides.chain(pairs)).expanded(3);
        let cholesky = Cholesky::new(pattern)?;
        let block = |i: u32, j: u32| -> Block {
            let (low, high) = (3 * i.min(j) as usize, 3 * i.max(j) as usize);
            let columns = std::array::from_fn(|c| {
                let row = if low == high { low + c } else { high };
                cholesky.pattern().slot(low + c, row).unwrap_or_default() as u32
            });
            Block { columns }
        };
        let diagonal = (0..problem.points as u32).map(|i| block(i, i)).collect();
        let sides = problem
            .triangles
            .iter()
            .map(|t| std::array::from_fn(|k| block(t[k], t[(k + 1) % 3])))
            .collect();
        let pairs = problem
            .hinges
            .iter()
            .map(|h| PAIRS.map(|(i, j)| block(h[i], h[j])))
            .collect();
        let matrix = vec![0.0; cholesky.pattern().entries()];
        let faces = start.iter().map(|p| closest.query(*p).face).collect();
        Ok(Self {
            problem,
            closest,
            edge_mm,
            anchor: start.iter().map(|p| p.coords / edge_mm).collect(),
            faces,
            cholesky,
            diagonal,
            sides,
            pairs,
            matrix,
            rhs: vec![0.0; 3 * problem.points],
            planes: vec![(Vector3::zeros(), 0.0); problem.points],
        })
    }

    /// Tangent planes at the closest points of `x`: unit normal n along x − P and n·(x − P).
    fn project(&mut self, x: &[Vector3<f64>]) {
        for ((x, plane), face) in x.iter().zip(&mut self.planes).zip(&mut self.faces) {
            let found = self
                .closest
                .query_from(Point3::from(x * self.edge_mm), *face);
            *face = found.face;
            let offset = x - found.point.coords / self.edge_mm;
            let distance = offset.norm();
            // On the surface the direction to it is lost in rounding; its normal is the limit.
            *plane = if distance > 1e-9 {
                (offset / distance, distance)
            } else {
                let normal = self.closest.normal(found.face);
                (normal, normal.dot(&offset))
            };
        }
    }

    /// Half the sum of squares at `x`, whose planes must be up to date.
    fn energy(&self, x: &[Vector3<f64>], stage: &Stage) -> f64 {
        let mut sum = 0.0;
        for t in &self.problem.triangles {
            for k in 0..3 {
                let r = (x[t[(k + 1) % 3] as usize] - x[t[k] as usize]).norm() - 1.0;
                sum += r * r;
            }
        }
        for h in &self.problem.hinges {
            let p = h.map(|i| x[i as usize]);
            for condition in Condition::ALL {
                if let Some(signed) = condition.evaluate(&p) {
                    let r = (condition.margin() - signed.value).max(0.0);
                    sum += r * r;
                }
            }
            let r = (hinge_scale(&p).value - self.problem.sigma).max(0.0);
            sum += r * r;
        }
        let (wc, wa) = (
            stage.closeness * stage.closeness,
            stage.anchor * stage.anchor,
        );
        for ((x, anchor), (_, distance)) in x.iter().zip(&self.anchor).zip(&self.planes) {
            sum += wc * distance * distance + wa * (x - anchor).norm_squared();
        }
        0.5 * sum
    }

    #[inline]
    fn add_diagonal(&mut self, i: u32, g: &Vector3<f64>) {
        let columns = self.diagonal[i as usize].columns;
        for c in 0..3 {
            for r in c..3 {
                self.matrix[columns[c] as usize + r - c] += g[r] * g[c];
            }
        }
    }

    /// Adds g_i g_jᵀ for two different points.
    #[inline]
    fn add_block(&mut self, block: Block, i: u32, gi: &Vector3<f64>, j: u32, gj: &Vector3<f64>) {
        let (column, row) = if i < j { (gi, gj) } else { (gj, gi) };
        for c in 0..3 {
            let first = block.columns[c] as usize;
            for r in 0..3 {
                self.matrix[first + r] += row[r] * column[c];
            }
        }
    }

    #[inline]
    fn add_rhs(&mut self, i: u32, g: &Vector3<f64>, residual: f64) {
        for k in 0..3 {
            self.rhs[3 * i as usize + k] -= g[k] * residual;
        }
    }

    /// JᵀJ and −Jᵀr at `x`.
    fn assemble(&mut self, x: &[Vector3<f64>], stage: &Stage) {
        self.matrix.fill(0.0);
        self.rhs.fill(0.0);
        let problem = self.problem;
        for (n, t) in problem.triangles.iter().enumerate() {
            for k in 0..3 {
                let (i, j) = (t[k], t[(k + 1) % 3]);
                let edge = x[j as usize] - x[i as usize];
                let length = edge.norm().max(1e-12);
                let g = edge / length;
                let residual = length - 1.0;
                self.add_diagonal(i, &g);
                self.add_diagonal(j, &g);
                self.add_block(self.sides[n][k], i, &-g, j, &g);
                self.add_rhs(i, &-g, residual);
                self.add_rhs(j, &g, residual);
            }
        }
        for (n, h) in problem.hinges.iter().enumerate() {
            let p = h.map(|i| x[i as usize]);
            for condition in Condition::ALL {
                if let Some(signed) = condition.evaluate(&p)
                    && signed.value < condition.margin()
                {
                    self.add_hinge(n, h, &signed.gradient, signed.value - condition.margin());
                }
            }
            let scale = hinge_scale(&p);
            if scale.value > problem.sigma {
                self.add_hinge(n, h, &scale.gradient, scale.value - problem.sigma);
            }
        }
        let anchor_squared = stage.anchor * stage.anchor;
        for i in 0..problem.points {
            let (normal, distance) = self.planes[i];
            let g = normal * stage.closeness;
            self.add_diagonal(i as u32, &g);
            self.add_rhs(i as u32, &g, distance * stage.closeness);
            let pull = x[i] - self.anchor[i];
            for k in 0..3 {
                self.matrix[self.diagonal[i].columns[k] as usize] += anchor_squared;
                self.rhs[3 * i + k] -= anchor_squared * pull[k];
            }
        }
    }

    fn add_hinge(&mut self, n: usize, h: &[u32; 5], gradient: &[Vector3<f64>; 5], residual: f64) {
        for (i, g) in h.iter().zip(gradient) {
            self.add_diagonal(*i, g);
            self.add_rhs(*i, g, residual);
        }
        for (pair, &(i, j)) in PAIRS.iter().enumerate() {
            self.add_block(self.pairs[n][pair], h[i], &gradient[i], h[j], &gradient[j]);
        }
    }

    fn run_stage(
        &mut self,
        x: &mut Vec<Vector3<f64>>,
        stage: &Stage,
        effort: &mut Effort,
        progress: &dyn Progress,
    ) -> Result<(), RationalizeError> {
        let mut damping = stage.damping;
        self.project(x);
        let mut energy = self.energy(x, stage);
        let mut damped = vec![0.0; self.matrix.len()];
        let mut step = vec![0.0; self.rhs.len()];
        let mut trial = x.clone();
        for _ in 0..STEPS_PER_STAGE {
            self.assemble(x, stage);
            let before = energy;
            let mut accepted = false;
            // Each further rejection raises the damping more steeply: it starts tiny, and every try is a factorisation.
            let mut growth = 6.0;
            while damping < 1e6 {
                progress.check()?;
                damped.copy_from_slice(&self.matrix);
                for block in &self.diagonal {
                    for slot in block.columns {
                        damped[slot as usize] += damping;
                    }
                }
                effort.factorizations += 1;
                match self.cholesky.factor(&damped) {
                    Ok(()) => {}
                    Err(FactorError::NotPositiveDefinite) => {
                        damping = (damping * growth).max(1e-12);
                        growth *= 4.0;
                        continue;
                    }
                    Err(other) => return Err(other.into()),
                }
                step.copy_from_slice(&self.rhs);
                self.cholesky.solve(&mut step);
                for (i, t) in trial.iter_mut().enumerate() {
                    *t = x[i] + Vector3::new(step[3 * i], step[3 * i + 1], step[3 * i + 2]);
                }
                self.project(&trial);
                let there = self.energy(&trial, stage);
                if there < energy {
                    std::mem::swap(x, &mut trial);
                    energy = there;
                    damping /= 5.0;
                    accepted = true;
                    break;
                }
                damping *= growth;
                growth *= 4.0;
                // Nothing left to gain at this accuracy.
                if step.iter().fold(0.0f64, |m, s| m.max(s.abs())) < 1e-14 {
                    break;
                }
            }
            effort.steps += 1;
            if !accepted {
                self.project(x);
                break;
            }
            if before - energy < stage.gain * before || energy < 1e-26 {
                break;
            }
        }
        Ok(())
    }
}
