//! Stage 1: a file or a sample becomes a [`Surface`]: an oriented manifold triangle mesh in millimetres.

pub mod samples;
mod surface;
pub mod write;

pub use samples::{Sample, SampleError};
pub use surface::{FaceId, HalfedgeId, Surface, TopologyError, VertexId};
