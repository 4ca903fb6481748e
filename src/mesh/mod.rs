//! Stage 1: a file or a sample becomes a [`Surface`]: an oriented manifold triangle mesh in millimetres.

mod surface;

pub use surface::{FaceId, HalfedgeId, Surface, TopologyError, VertexId};
