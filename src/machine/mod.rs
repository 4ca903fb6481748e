//! Stage 0: the machine that cuts.
//!
//! A [`Machine`] is plain data from `machines/NAME.toml`: its controller and what that takes, its tool (a laser, or a
//! plasma torch) and what the words for it mean, its bed and where zero lies on it, how fast it moves, how it is
//! reached, and the lines around every job. The axes: X to the right, Y away from the person, millimetres, seen from
//! above; [`Machine::reach`] is where the beam may go.

mod controller;
mod lines;
mod profile;
mod shipped;
mod start;
mod tool;

pub use controller::{Controller, ControllerLimits};
pub use profile::{
    Axes, Bed, Connection, HandOver, Homing, Job, Machine, Motion, Origin, Place, Reach,
};
pub use shipped::{DEFAULT, load, own_file, own_files, parse, resolve, shipped};
pub use start::{ControllerSettings, start};
pub use tool::{
    Corner, HeightControl, LaserTool, PLACEHOLDERS, PlasmaTool, PowerMode, SmallHole, Template,
    Tool, filled,
};
