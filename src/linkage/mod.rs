//! Stage 3: the flat layout and a triangle lattice become a [`Linkage`].

mod types;

pub use types::{Cell, Colour, Corner, Handedness, Hinge, Linkage, PointId, Triangle, TriangleId};
