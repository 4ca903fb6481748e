//! Stage 0: the machine that cuts.
//!
//! A [`Machine`] is plain data from `machines/NAME.toml`: its controller, its laser and what its power words mean, its
//! bed and where zero lies on it, how fast it moves, how it is reached, and the lines around every job. The axes:
//! X to the right, Y away from the person, millimetres, seen from above; [`Machine::reach`] is where the beam may go.

mod profile;
mod shipped;

pub use profile::{
    Axes, Bed, Connection, Controller, Homing, Job, LaserTool, Machine, Motion, Origin, Place,
    PowerMode, Reach,
};
pub use shipped::{DEFAULT, load, parse, shipped};
