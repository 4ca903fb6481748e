//! How to send.

use std::time::Duration;

use crate::control::survey::JobReach;
use crate::machine::Machine;

/// How lines are handed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Streaming {
    /// As many as the controller's receive buffer holds: the planner never waits for the line.
    Counted,
    /// One at a time, each after the answer to the one before: for firmware that loses count.
    Answered,
}

/// How to send.
#[derive(Clone, Debug, PartialEq)]
pub struct SendOptions {
    /// What `$30` must be: the S word of full power that the job was written for. None asks only that no S word is
    /// larger than the controller's.
    pub s_max: Option<f64>,
    /// The controller's receive buffer as its profile has it, bytes; the smaller of this and what it tells is used.
    pub buffer: Option<usize>,
    /// The machine that the job was made for, and where the job goes: the controller is compared with them.
    pub made_for: Option<Box<(Machine, Option<JobReach>)>>,
    /// How long to wait for the controller's banner after the port was opened, before it is reset. Boards that reset
    /// by themselves need up to 2 s for their boot loader.
    pub banner_wait: Duration,
    /// How often the status is asked for. Ten times a second is what GRBL's authors call its most; it decides how soon a
    /// cut is proven.
    pub poll: Duration,
    /// How the lines are handed over.
    pub streaming: Streaming,
    /// How long a controller may be silent before it counts as lost.
    pub silence: Duration,
    /// How long the machine may be paused (M0, a feed hold pressed at the machine, its door) before the job is
    /// stopped. None waits for the person; a rehearsal has none to wait for.
    pub longest_pause: Option<Duration>,
}

impl Default for SendOptions {
    fn default() -> Self {
        Self {
            s_max: None,
            buffer: None,
            made_for: None,
            banner_wait: Duration::from_secs(2),
            poll: Duration::from_millis(100),
            streaming: Streaming::Counted,
            silence: Duration::from_secs(5),
            longest_pause: None,
        }
    }
}
