//! Stage 7: a sheet becomes cuts in an order.
//!
//! Slits first, then holes, then the rims, so that nothing moves before it is finished. A star of three slits is two
//! strokes, arm–centre–arm and an arm. The order of strokes, and the direction of each, keeps the head's empty travel
//! short. Contours are followed half a kerf outside the material, so that what remains has the drawn size.

mod kerf;
mod order;
mod path;

pub use kerf::{CHORD_ERROR_MM, outline};
pub use order::{Heat, LOOKBACK, Spacing, order_strokes, spacing};
pub use path::{Cut, Figures, Role, Toolpath, ToolpathError, plan};
