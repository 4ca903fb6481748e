//! Stage 12: the whole job, and what it tells its maker.
//!
//! - [`picture`]: a small software renderer: surfaces, layouts and linkages as PNG, colour maps and their legends;
//! - [`report`]: the page `report.html`: the verdict in words, the pictures, every figure.

pub mod picture;
pub mod report;
