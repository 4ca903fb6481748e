//! Stage 1: a file or a sample becomes a [`Surface`]: an oriented manifold triangle mesh in millimetres.

pub mod closest;
pub mod edit;
pub mod samples;
mod surface;
pub mod write;

pub use closest::{Closest, ClosestPoint, Feature, distance_to_triangle};
pub use edit::insert_point;
pub use samples::{Sample, SampleError};
pub use surface::{FaceId, HalfedgeId, Surface, TopologyError, VertexId};
