//! Stage 1: a file or a sample becomes a [`Surface`]: an oriented manifold triangle mesh in millimetres.

pub mod check;
pub mod closest;
pub mod edit;
pub mod error;
pub mod read;
pub mod repair;
pub mod samples;
mod surface;
pub mod units;
pub mod write;

pub use closest::{Closest, ClosestPoint, Feature, distance_to_triangle};
pub use edit::insert_point;
pub use error::{ImportError, Problem};
pub use repair::{Import, ImportOptions, ImportReport, PartChoice, import_bytes, import_file};
pub use samples::{Sample, SampleError};
pub use surface::{FaceId, HalfedgeId, Surface, TopologyError, VertexId};
pub use units::{Unit, Units};
