//! Stage 2: a surface becomes a flat [`Layout`] by a conformal map whose scale is to stay inside [1, σ].
//!
//! The slit sheet stretches the same in every direction, so a shape that it can take is a conformal image of the flat
//! sheet with a scale factor λ between 1 (closed) and σ (open); see the paper, §3.1. Room by room: [`MetricSolver`]
//! finds the scaled edge lengths (CETM) for given [`Singularities`], [`cut_graph`] opens the surface to a disk,
//! [`Layout`] unfolds the faces and carries λ, [`search()`] proposes singularities where they are left open, a [`Dart`]
//! opens the surface where no cone can help, and [`flatten()`] does all of it but the darts, and scales.

mod cone;
mod cut;
mod dart;
mod distance;
mod field;
mod geodesic;
mod intrinsic;
mod layout;
mod linear;
mod metric;
mod paths;
mod propose;
mod search;
mod system;

pub use cone::{CURVATURE_UNIT, Cone, Singularities};
pub use cut::{Segment, cut_graph};
pub use dart::{Dart, Patch, around_handles, patches, slit_along, to_goals};
pub(crate) use distance::from_vertices;
pub(crate) use geodesic::{Stretch, straight_way};
pub use layout::{Layout, ScaleSummary, Spread, Transition};
pub use metric::{Metric, MetricSolver};
pub use propose::{
    ConeRequest, FlattenOptions, Flattened, Sizing, Wish, choose_turnings,
    choose_turnings_with_hems, flatten, proposals, vertex_from_number, with_cones,
};
pub use search::{SearchOptions, search};

use crate::base::progress::Interrupted;
use crate::base::sparse::FactorError;
use crate::mesh::{EditError, VertexId};

/// Why a surface could not be flattened.
#[derive(Debug, thiserror::Error)]
pub enum ConformalError {
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
    /// Curvature that a triangle lattice cannot carry.
    #[error("a cone of {units} units (of 120°) cannot be made: use +1, +2, −1 or −2")]
    ConeUnits {
        /// Asked for.
        units: i32,
    },
    /// Two cones at one vertex.
    #[error("two cones were asked for at vertex {vertex}: give one, with the sum of their units")]
    ConeTwice {
        /// The vertex.
        vertex: VertexId,
    },
    /// Not one turning for each rim but the first.
    #[error(
        "{given} rim turnings were given, the surface needs {wanted}: one for each rim but the first"
    )]
    Turnings {
        /// Given.
        given: usize,
        /// Needed.
        wanted: usize,
    },
    /// No such rim.
    #[error("there is no rim {rim}: the surface has {count}; `inspect` lists them")]
    NoSuchRim {
        /// Asked for, counted from 1.
        rim: u64,
        /// Rims there are.
        count: usize,
    },
    /// A rim that cannot be straight.
    #[error(
        "rim {rim} cannot become a straight hem: with these cones and turnings it turns by {turning_deg}°, and only a rim that turns by 0°, as the end of a tube, can lie straight: choose another rim, or other cones and turnings"
    )]
    HemTurns {
        /// The rim, counted from 1.
        rim: usize,
        /// How far it turns, degrees.
        turning_deg: i64,
    },
    /// A closed surface whose cones do not carry its curvature.
    #[error(
        "the cones have {given} units of curvature (of 120°) in all; this surface is closed and has exactly {wanted}: add or remove cones, or leave them to --cone auto"
    )]
    TotalCurvature {
        /// Asked for.
        given: i64,
        /// What a closed surface of this genus has.
        wanted: i64,
    },
    /// The metric does not return to itself around a handle.
    #[error(
        "around a handle the flat metric turns by {turn_deg:.6}°, which is no multiple of 120°, so the pattern cannot close there: move the cones, or cut the handle open"
    )]
    Holonomy {
        /// The angle, degrees.
        turn_deg: f64,
    },
    /// A dart without length.
    #[error("a dart needs at least two different points: give it as X,Y,Z;X,Y,Z")]
    DartTooShort,
    /// A dart that cannot be cut.
    #[error(transparent)]
    Dart(EditError),
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
