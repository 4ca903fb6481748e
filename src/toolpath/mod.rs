//! Stage 7: a sheet becomes cuts in an order.
//!
//! Marks first, then slits, then holes, then the rims, so that nothing moves before it is finished. A star of three slits
//! is two strokes where a stroke may begin anywhere, and more where the pierce hole must keep away from ligaments. The
//! order of strokes, and the direction of each, keeps the head's empty travel short. Contours are followed half a kerf
//! outside the material, so that what remains has the drawn size; they are entered and left through scrap.

mod kerf;
mod order;
mod path;
mod scrap;
mod star;

pub use kerf::{CHORD_ERROR_MM, outline, tabs_by_outline, without_tabs};
pub use order::{Heat, LOOKBACK, Spacing, Way, order_strokes, spacing};
pub use path::{
    CornerSlowdown, Cut, CutOptions, Figures, Role, SmallHoles, Step, Toolpath, ToolpathError, plan,
};
