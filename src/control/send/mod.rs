//! Streaming a job by character counting, and stopping it with proof.
//!
//! | room | what is there |
//! |---|---|
//! | `options`, `report`, `reason`, `error` | what goes in, what comes out |
//! | `link` | lines in, bytes out |
//! | `connect` | banner and pre-flight |
//! | `stream` | the ledger, the running job |
//! | `stop` | hold, reset, proof |

mod connect;
mod error;
mod link;
mod options;
mod reason;
mod report;
mod stop;
mod stream;

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use self::link::Link;
use super::reply::Status;
use super::{Job, Transport};
use crate::base::progress::Progress;

pub use error::SendError;
pub use options::SendOptions;
pub use reason::StopReason;
pub use report::{Confirmed, Proof, SendReport};

const RESET: &[u8] = &[0x18];
/// How long an answer to a question outside the job may take.
const ANSWER: Duration = Duration::from_secs(3);

/// Sends a job over an open link, and comes back when the machine stands: with a report if all of it was acknowledged
/// and the machine is idle with its beam off, else with an error that says what is known.
///
/// The order is: wait for the banner, or reset the controller; ask what it is and how it is set; stream; wait until it
/// is idle. The person's wish to stop is [`Progress::interrupted`].
///
/// # Errors
/// [`SendError`]; for the first three kinds the job was not begun.
pub fn send(
    transport: &mut dyn Transport,
    job: &Job,
    options: &SendOptions,
    progress: &dyn Progress,
) -> Result<SendReport, SendError> {
    let mut sender = Sender {
        link: Link {
            transport,
            partial: Vec::new(),
            lines: VecDeque::new(),
        },
        job,
        options,
        progress,
        armed: false,
        sent: 0,
        bytes: 0,
        max_in_flight: 0,
        ledger: VecDeque::new(),
        in_flight: 0,
        acknowledged: 0,
        status: None,
    };
    let firmware = sender.connect()?;
    let buffer = sender.preflight()?;
    sender
        .progress
        .start("sending", u64::try_from(job.len()).ok());
    let start = sender.link.transport.now();
    sender.armed = true;
    let result = sender.stream(buffer);
    let outcome = match result {
        Ok(()) => Ok(SendReport {
            lines: job.len(),
            acknowledged: sender.acknowledged,
            bytes: sender.bytes,
            time_s: (sender.link.transport.now() - start).as_secs_f64(),
            max_in_flight: sender.max_in_flight,
            buffer,
            firmware,
            position_mm: sender.status.as_ref().and_then(|s| s.position_mm),
        }),
        Err(Trouble::Link(source)) => Err(sender.link_failed(source)),
        Err(Trouble::Stop(reason)) => Err(sender.stop(reason)),
    };
    sender.armed = false;
    outcome
}

/// What ends the stream.
enum Trouble {
    Link(io::Error),
    Stop(StopReason),
}

impl From<io::Error> for Trouble {
    fn from(error: io::Error) -> Self {
        Self::Link(error)
    }
}

struct Sender<'a> {
    link: Link<'a>,
    job: &'a Job,
    options: &'a SendOptions,
    progress: &'a dyn Progress,
    /// The job has begun and has not been brought to an end.
    armed: bool,
    sent: usize,
    bytes: u64,
    max_in_flight: usize,
    /// Bytes of each line sent and not yet answered, oldest first.
    ledger: VecDeque<usize>,
    in_flight: usize,
    acknowledged: usize,
    status: Option<Status>,
}

impl Drop for Sender<'_> {
    /// The way out of a panic: a reset puts the beam out at once, whatever the machine does. Position is lost, the
    /// sheet perhaps too.
    fn drop(&mut self) {
        if self.armed {
            let _ = self.link.send(RESET);
        }
    }
}

impl Sender<'_> {
    fn now(&self) -> Duration {
        self.link.transport.now()
    }

    fn port(&self) -> String {
        self.link.transport.name().to_owned()
    }
}
