//! Stage 2: a surface becomes a flat [`Layout`] by a conformal map whose scale is to stay inside [1, σ].
//!
//! The slit sheet stretches the same in every direction, so a shape that it can take is a conformal image of the flat
//! sheet with a scale factor λ between 1 (closed) and σ (open); see the paper, §3.1. Room by room: [`MetricSolver`]
//! finds the scaled edge lengths (CETM), [`cut_to_rim`] opens a surface with a [`Cone`], [`Layout`] unfolds the faces
//! and carries λ, [`flatten()`] does all of it, decides whether a cone is needed, and scales.
//!
//! Scope today: surfaces of disk type with no cone or one.

mod cone;
mod cut;
mod layout;
mod metric;
mod propose;

pub use cone::{CURVATURE_UNIT, Cone};
pub use cut::cut_to_rim;
pub use layout::{Layout, ScaleSummary, Transition};
pub use metric::{Metric, MetricSolver};
pub use propose::{ConeRequest, FlattenOptions, Flattened, Sizing, flatten, vertex_from_number};

use crate::base::progress::Interrupted;
use crate::base::sparse::FactorError;
use crate::mesh::VertexId;

/// Why a surface could not be flattened.
#[derive(Debug, thiserror::Error)]
pub enum ConformalError {
    /// Not of disk type.
    #[error(
        "the surface is not a disk: it has {rims} rims and {handles} handles. kagome flattens surfaces with exactly one rim and no handle so far; {advice}"
    )]
    NotADisk {
        /// Number of rims.
        rims: usize,
        /// Number of handles.
        handles: i64,
        /// What can be done.
        advice: &'static str,
    },
    /// An edge without length.
    #[error("vertices {tail} and {head} lie at the same place: merge them in the mesh")]
    ZeroLength {
        /// One end.
        tail: VertexId,
        /// The other end.
        head: VertexId,
    },
    /// A cone on the rim, where curvature needs none.
    #[error(
        "vertex {vertex} lies on the rim, a cone must lie inside the surface: choose another place with --cone"
    )]
    ConeOnRim {
        /// The vertex.
        vertex: VertexId,
    },
    /// No such vertex.
    #[error("there is no vertex {vertex}: the surface has {count}")]
    NoSuchVertex {
        /// Asked for, counted from 1.
        vertex: u64,
        /// Vertices there are.
        count: usize,
    },
    /// More than the present scope.
    #[error("{count} cones were asked for; kagome places one at the most so far")]
    TooManyCones {
        /// Number asked for.
        count: usize,
    },
    /// Curvature that a triangle lattice cannot carry.
    #[error("a cone of {units} units (of 120°) is not supported yet: use +1 or −1")]
    ConeUnits {
        /// Asked for.
        units: i32,
    },
    /// Newton's method stopped short.
    #[error(
        "the conformal map did not converge: after {steps} steps the angles around vertex {vertex} at ({:.1}, {:.1}, {:.1}) are still {residual_deg:.2e}° off; the mesh has slivers there: remesh it evenly and try again",
        position[0], position[1], position[2]
    )]
    NotConverged {
        /// Newton steps taken.
        steps: usize,
        /// Largest remaining angle error, degrees.
        residual_deg: f64,
        /// Where it is.
        vertex: VertexId,
        /// Where that is, millimetres.
        position: [f64; 3],
    },
    /// The linear system failed.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// The person asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}
