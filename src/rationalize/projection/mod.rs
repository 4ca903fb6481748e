//! The paper's solver: alternating projections (paper, §4.2, eq. 2; Bouaziz et al. 2012), as fast as a preview needs.
//!
//! Local steps: every edge is projected onto length L, every point onto the surface, every pair of neighbouring
//! triangles that penetrates onto an approximate feasible set. Global step: one linear solve whose matrix depends on
//! the closeness weight only. Conditions (5), (6) and the bound σ, which the paper lacks, are projections as well
//! where they are asked for.
//!
//! Three things make it fast: the solve runs over triangles instead of points ([`global`]), the iteration is
//! accelerated and refuses steps that raise the energy ([`anderson`]), and hinges neither cost nor weigh anything where
//! they are not broken ([`kernel`]). So the 250 iterations of the paper end at edges exact to rounding where the surface
//! is within reach. Where it is not, edges and closeness share what is missing by their weights, and
//! [`super::exact`] is the one that keeps the edges.

mod anderson;
mod follow;
mod global;
pub(crate) mod kernel;
mod separate;

use nalgebra::{Point3, Vector3};

pub use separate::Separation;

pub(super) use self::follow::Follower;
pub use self::kernel::Rest;
use self::kernel::{Kernel, Outcome, Rules};
use super::RationalizeError;
use super::exact::Effort;
use super::problem::Problem;
use crate::base::progress::Progress;
use crate::linkage::Linkage;
use crate::mesh::ClosestPoint;

/// The weight of closeness rises geometrically from w₁ = 0.001 to 0.1 in this many levels; each costs one
/// factorisation.
const LEVELS: usize = 10;
const FIRST_WEIGHT: f64 = 0.001;
const LAST_WEIGHT: f64 = 0.1;

/// Where on the surface each point is drawn to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Closeness {
    /// To the point of the surface closest to where the lift put it, fixed: for a first impression.
    Held,
    /// To the point of the surface closest to where it is.
    #[default]
    Tracked,
}

/// How to run it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectionOptions {
    /// The projection onto non-penetration.
    pub separation: Separation,
    /// Conditions (5) and (6), and λ ≤ σ for this σ; the paper has none of them.
    pub sigma: Option<f64>,
    /// What the points are drawn to.
    pub closeness: Closeness,
    /// Iterations while the weight of closeness rises.
    pub rising: usize,
    /// Iterations at the final weight.
    pub finishing: usize,
    /// Differences that Anderson acceleration looks back, at most 8. With 0 there is neither acceleration nor a guard
    /// against steps that raise the energy: the iteration as published.
    pub window: usize,
}

impl Default for ProjectionOptions {
    /// The whole schedule of the paper, accelerated: 50 iterations and an additional 200.
    fn default() -> Self {
        Self {
            separation: Separation::InPlane,
            sigma: None,
            closeness: Closeness::Tracked,
            rising: 50,
            finishing: 200,
            window: 5,
        }
    }
}

impl ProjectionOptions {
    /// For a first impression: 30 iterations with the closest points held ("20–50 iterations for visual feedback").
    pub fn preview() -> Self {
        Self {
            closeness: Closeness::Held,
            rising: 30,
            finishing: 0,
            ..Self::default()
        }
    }

    /// The paper's solver to the letter, but for Appendix B's index.
    pub fn as_printed() -> Self {
        Self {
            separation: Separation::Printed,
            window: 0,
            ..Self::default()
        }
    }
}

/// The solver, iteration by iteration.
pub struct AlternatingProjection<'a> {
    kernel: Kernel,
    follower: Option<Follower<&'a ClosestPoint>>,
    edge_mm: f64,
    options: ProjectionOptions,
    weight: f64,
    iterations: usize,
    refused: usize,
}

impl<'a> AlternatingProjection<'a> {
    /// At `start` (millimetres, one position a point of the linkage), before the first iteration.
    ///
    /// # Errors
    /// [`RationalizeError::Factor`]: memory.
    pub fn new(
        linkage: &Linkage,
        start: &[Point3<f64>],
        closest: &'a ClosestPoint,
        options: &ProjectionOptions,
    ) -> Result<Self, RationalizeError> {
        Self::of(
            &Problem::new(linkage, 2.0),
            linkage.edge_mm,
            start,
            closest,
            options,
        )
    }

    fn of(
        problem: &Problem,
        edge_mm: f64,
        start: &[Point3<f64>],
        closest: &'a ClosestPoint,
        options: &ProjectionOptions,
    ) -> Result<Self, RationalizeError> {
        let rules = Rules {
            separation: options.separation,
            bounds: options.sigma,
            smoothness: 0.0,
            rest: Rest::Flat,
        };
        let x: Vec<Vector3<f64>> = start.iter().map(|p| p.coords / edge_mm).collect();
        let kernel = Kernel::new(problem, &x, rules, options.window)?;
        let mut this = Self {
            follower: Some(Follower::new(closest, &kernel, edge_mm)),
            kernel,
            edge_mm,
            options: *options,
            weight: 0.0,
            iterations: 0,
            refused: 0,
        };
        this.set_weight(FIRST_WEIGHT)?;
        if options.closeness == Closeness::Held {
            this.follower = None;
        }
        Ok(this)
    }

    /// The weight w₁ of closeness from the next iteration on. A new one costs a factorisation.
    ///
    /// # Errors
    /// [`RationalizeError::Factor`]: the weight is not a positive number.
    pub fn set_weight(&mut self, weight: f64) -> Result<(), RationalizeError> {
        if weight != self.weight {
            self.weight = weight;
            self.kernel.pull_all(weight);
            self.kernel.refactor()?;
            let follower = &mut self.follower;
            self.kernel.restart(&mut |x, places| {
                if let Some(follower) = follower {
                    follower.follow(x, places);
                }
            });
        }
        Ok(())
    }

    /// One iteration; false if nothing lowers the energy any more, so that further ones would do nothing.
    pub fn iterate(&mut self) -> bool {
        let follower = &mut self.follower;
        let outcome = self.kernel.iterate(&mut |x, places| {
            if let Some(follower) = follower {
                follower.follow(x, places);
            }
        });
        self.iterations += 1;
        self.refused += usize::from(outcome == Outcome::Plain);
        outcome != Outcome::Settled
    }

    /// Runs the whole schedule, or until nothing lowers the energy at the final weight.
    ///
    /// # Errors
    /// [`RationalizeError`]: interruption, memory.
    pub fn run(&mut self, progress: &dyn Progress) -> Result<(), RationalizeError> {
        let ProjectionOptions {
            rising, finishing, ..
        } = self.options;
        for iteration in 0..rising + finishing {
            progress.check()?;
            let level =
                (iteration * LEVELS / rising.max(1)).min(LEVELS - 1) as f64 / (LEVELS - 1) as f64;
            self.set_weight(FIRST_WEIGHT * (LAST_WEIGHT / FIRST_WEIGHT).powf(level))?;
            let goes_on = self.iterate();
            progress.advance(1);
            if !goes_on && iteration >= rising {
                break;
            }
        }
        Ok(())
    }

    /// The energy (2) where the points are, in L².
    pub fn energy(&self) -> f64 {
        self.kernel.energy()
    }

    /// Positions in millimetres, by point of the linkage.
    pub fn positions(&self) -> Vec<Point3<f64>> {
        self.kernel
            .positions()
            .map(|p| Point3::from(p * self.edge_mm))
            .collect()
    }

    /// What was done so far.
    pub fn effort(&self) -> Effort {
        Effort {
            analyses: 1,
            steps: self.iterations,
            factorizations: self.kernel.factorizations(),
        }
    }

    /// Iterations that took the plain step instead of the accelerated one.
    pub fn plain_steps(&self) -> usize {
        self.refused
    }

    /// Rows of the linear system and entries of its factor below the diagonal.
    pub fn factor_size(&self) -> (usize, usize) {
        self.kernel.factor_size()
    }
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
    let options = ProjectionOptions {
        sigma: Some(problem.sigma),
        ..ProjectionOptions::default()
    };
    let mut solver = AlternatingProjection::of(problem, edge_mm, start, closest, &options)?;
    solver.run(progress)?;
    Ok((solver.positions(), solver.effort()))
}
