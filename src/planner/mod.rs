//! Moves and a machine's limits become motion in time.
//!
//! The model is GRBL's, and most controllers' of its class: each axis has a largest rate and acceleration, projected
//! on the direction of a move; a corner may be passed at the speed that an arc within the junction deviation would
//! allow; every move is a trapezoid of speed. A controller looks ahead only over the moves that it holds ([`Queue`],
//! 15 for GRBL on an AVR); an estimate looks ahead over all of them ([`plan`]). The estimate, the simulated machine
//! and the sender use the same blocks, so that they cannot disagree about time.
//!
//! Lengths are millimetres and times seconds; rates are millimetres per minute at the surface, as in G-code, and
//! millimetres per second inside.

mod block;
mod estimate;
mod job;
mod output;
mod profile;
mod queue;

pub use block::{Block, Limits, LimitsError, Move};
pub use estimate::{Motion, plan, total_s};
pub use job::{Estimate, Firmware, READING_AT_REST, Step, estimate};
pub use output::dark_before_stop_s;
pub use profile::{Profile, StepTimer};
pub use queue::{Queue, QueueFull};
