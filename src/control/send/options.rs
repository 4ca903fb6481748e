//! How to send.

use std::time::Duration;

/// How to send.
#[derive(Clone, Debug, PartialEq)]
pub struct SendOptions {
    /// What `$30` must be: the S word of full power that the job was written for. None asks only that no S word is
    /// larger than the controller's.
    pub s_max: Option<f64>,
    /// The controller's receive buffer as its profile has it, bytes; the smaller of this and what it tells is used.
    pub buffer: Option<usize>,
    /// How long to wait for the controller's banner after the port was opened, before it is reset. Boards that reset
    /// by themselves need up to 2 s for their boot loader.
    pub banner_wait: Duration,
    /// How often the status is asked for.
    pub poll: Duration,
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
            banner_wait: Duration::from_secs(2),
            poll: Duration::from_millis(200),
            silence: Duration::from_secs(5),
            longest_pause: None,
        }
    }
}
