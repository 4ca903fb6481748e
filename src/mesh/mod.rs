//! Stage 1: a file or a sample becomes a [`Surface`]: an oriented manifold triangle mesh in millimetres.
//!
//! - [`read`]: OBJ, STL and PLY as triangles, with the line of what cannot be read;
//! - [`repair`]: triangles into a surface: mended where that needs no guess, refused with place and remedy elsewhere;
//! - [`samples`]: surfaces made here, by name;
//! - [`closest`]: the closest point on a surface; [`edit`]: a point made a vertex, slits;
//! - [`mod@skirt`]: a strip beyond the rims, for patterns cut along a smooth one;
//! - [`body`]: a solid body below a surface, to form over;
//! - [`check`]: figures for people; [`mod@write`]: OBJ text.
//!
//! ```
//! use kagome::mesh::{ClosestPoint, Sample};
//! let cap = Sample::parse("cap:half_angle_deg=45,faces=1000")?.generate()?;
//! let above = nalgebra::Point3::new(0.0, 0.0, 130.0);
//! let found = ClosestPoint::new(&cap).query(above);
//! assert!((found.distance - 15.0).abs() < 1e-9);
//! # Ok::<(), kagome::mesh::SampleError>(())
//! ```

pub mod body;
pub mod check;
pub mod closest;
pub mod edit;
pub mod error;
pub mod read;
pub mod repair;
pub mod samples;
pub mod skirt;
mod surface;
pub mod units;
pub mod write;

pub use body::{Body, BodyError, BodyOptions};
pub use closest::{Closest, ClosestPoint, ClosestTracker, Feature, distance_to_triangle};
pub use edit::{EditError, insert_point, slit};
pub use error::{ImportError, Problem};
pub use repair::{Import, ImportOptions, ImportReport, PartChoice, import_bytes, import_file};
pub use samples::{Sample, SampleError};
pub use skirt::{Skirted, skirt};
pub use surface::{FaceId, HalfedgeId, Surface, TopologyError, VertexId};
pub use units::{Unit, Units};
