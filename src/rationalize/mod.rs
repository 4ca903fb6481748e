//! Stage 4: the lifted linkage becomes exact: rigid triangles, no overlap, hinges within σ, on the surface.
//!
//! [`rationalize`] runs one of two solvers from the opened lift: [`Solver::Exact`] (all conditions to rounding) or
//! [`Solver::Projection`] (the paper's, for preview and comparison; [`AlternatingProjection`] step by step).
//! [`Quality`] measures the result independently of either, [`Soundness`] the part of it that needs no surface,
//! [`Bounds`] what holds a linkage back at a place. [`freedom()`] counts and finds the degrees of freedom that a linkage
//! has left, [`softest`] the motions that cost least. A [`Session`] poses a linkage by handles, frame by frame;
//! [`pose`] reads poses from a file, [`settle`] makes them exact.

mod bounds;
mod exact;
mod freedom;
mod grid;
mod motion;
mod overlap;
pub mod pose;
mod problem;
mod projection;
mod quality;
pub mod session;

use nalgebra::{Point3, Vector3};

pub use bounds::Bounds;
pub use exact::{Effort, STAGE_COUNT};
pub use freedom::{Freedom, FreedomError, Mobility, freedom};
pub use motion::{MOST_MOTIONS, Motion, motions_obj, softest};
pub use overlap::OVERLAP_TOLERANCE;
pub use problem::Problem;
pub use projection::{AlternatingProjection, Closeness, ProjectionOptions, Rest, Separation};
pub use quality::{Quality, SIGMA_TOLERANCE, Soundness, Worst, failing};
pub use session::{Edit, EditError, Hold, Session, Step};

use crate::base::progress::{Interrupted, Progress};
use crate::base::sparse::FactorError;
use crate::linkage::{Linkage, PointId};
use crate::mesh::ClosestPoint;

/// Which solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// Newton steps on all conditions at once.
    #[default]
    Exact,
    /// The paper's alternating projection.
    Projection,
}

/// Why there is no result. (A result that is not good enough is a result: see [`Quality`].)
#[derive(Debug, thiserror::Error)]
pub enum RationalizeError {
    /// The linear system failed.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// The person asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// Moves the points of a linkage from `start` (millimetres, by point) to where its triangles are rigid, do not
/// overlap, open no farther than `sigma`, and lie on the surface of `closest`.
///
/// # Errors
/// [`RationalizeError`]: interruption, memory.
pub fn rationalize(
    linkage: &Linkage,
    start: &[Point3<f64>],
    closest: &ClosestPoint,
    sigma: f64,
    solver: Solver,
    progress: &dyn Progress,
) -> Result<(Vec<Point3<f64>>, Effort), RationalizeError> {
    let problem = Problem::new(linkage, sigma);
    match solver {
        Solver::Exact => {
            let target = exact::Target::Surface(closest);
            exact::solve(&problem, start, target, &[], linkage.edge_mm, progress)
        }
        Solver::Projection => {
            projection::solve(&problem, start, closest, linkage.edge_mm, progress)
        }
    }
}

/// The exact linkage next to `places`: each point is drawn to a place of its own (millimetres) with a weight from 0 to 1,
/// from `start`, where all points in `pinned` stay. For shapes that are posed by hand rather than given by a surface.
///
/// # Errors
/// [`RationalizeError`]: interruption, memory.
pub fn settle(
    linkage: &Linkage,
    start: &[Point3<f64>],
    places: &[(Point3<f64>, f64)],
    pinned: &[PointId],
    sigma: f64,
    progress: &dyn Progress,
) -> Result<(Vec<Point3<f64>>, Effort), RationalizeError> {
    let problem = Problem::new(linkage, sigma);
    let pinned: Vec<u32> = pinned.iter().map(|p| p.0).collect();
    let target = exact::Target::Places(places);
    exact::solve(&problem, start, target, &pinned, linkage.edge_mm, progress)
}

/// The scale factor λ of every hinge at `positions` (millimetres, by point), in the order of the linkage's hinges.
pub fn hinge_scales(linkage: &Linkage, positions: &[Point3<f64>]) -> Vec<f64> {
    let problem = Problem::new(linkage, 2.0);
    let at = |i: u32| -> Vector3<f64> { positions[i as usize].coords / linkage.edge_mm };
    problem
        .hinges
        .iter()
        .map(|h| problem::hinge_scale(&h.map(at)).value)
        .collect()
}
