//! Stage 5: a linkage becomes the sheet that is cut: slits, contours, marks, and the drawing of all.
//!
//! A [`Sheet`] is what the finished part looks like: slits as centre lines, contours as the exact edge that remains.
//! Width of the beam matters twice: it sets where a slit must stop so that its ligament is exactly the hinge width,
//! and the toolpath keeps half of it away from a contour. Frame: millimetres, X right, Y up, seen from the side that
//! the beam strikes; material on the left of every contour.
//!
//! It leaves as [`svg()`], which [`read_drawing`] takes back after edits, as [`dxf()`], and on paper as a [`template()`].

mod check;
mod contour;
mod dxf;
mod font;
mod ligament;
mod mark;
mod marks;
mod nest;
mod path_data;
mod place;
mod read_svg;
mod sheet;
mod star;
mod svg;
mod tabs;
mod template;

pub use dxf::dxf;
pub use font::{can_write, width_mm};
pub use ligament::{HingeRisk, Ligament, PIVOT_IN_NECKS, hinge_risks};
pub use mark::{Label, Mark, MarkKind};
pub use marks::{MarkOptions, marks};
pub use nest::{Nested, StockArea, fits_stock, nest};
pub use place::{Motion, on_bed, placed, placed_on};
pub use read_svg::{Drawing, SvgError, read_drawing, read_svg};
pub use sheet::{
    Contour, Figures, MAX_NECK, PatternError, Sheet, SheetMetadata, SheetOptions, Slit, Tab, Tip,
};
pub use star::{Arm, Star};
pub use svg::svg;
pub use template::{Paper, Template, TemplateError, template};
