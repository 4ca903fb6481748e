//! kagome: from a surface mesh to an auxetic sheet, cut and verified.

pub mod base;
pub mod cli;
pub mod conformal;
pub mod control;
pub mod gcode;
pub mod job;
pub mod linkage;
pub mod machine;
pub mod material;
pub mod mesh;
pub mod pattern;
pub mod planner;
pub mod rationalize;
pub mod sim;
pub mod toolpath;
