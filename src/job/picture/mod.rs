//! Pictures without a graphics card: triangles and lines in space become a PNG.
//!
//! A [`Canvas`] is a z-buffer with 2 × 2 samples a pixel; a [`Camera`] looks at it in parallel projection along a
//! [`View`]; a [`Paint`] says what colour a triangle has: plain, or by a value through a [`ColourScale`]. The scenes
//! that a report needs are ready made: [`Scene`] with a surface, a layout or a linkage, and the [`postcard()`].
//!
//! The same input gives the same bytes: no clocks, and one order of drawing within a picture.

mod camera;
mod canvas;
mod colour;
mod image;
mod legend;
mod palette;
mod postcard;
mod scene;

pub use camera::{Camera, Frame, View};
pub use canvas::{Canvas, Material, Paint};
pub use colour::{ColourScale, Rgb, mix};
pub use image::Image;
pub use legend::legend;
pub use postcard::postcard;
pub use scene::Scene;
