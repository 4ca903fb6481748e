//! Streaming a job by character counting, and stopping it with proof.
//!
//! | room | what is there |
//! |---|---|
//! | `options`, `report`, `reason`, `error` | what goes in, what comes out |
//! | `link` | lines in, bytes out |
//! | `connect` | banner and pre-flight |
//! | `stream` | the ledger, the running job |
//! | `prove` | cuts proven by position, written to the journal |
//! | `dark` | a torch that is held without laser mode |
//! | `stop` | hold, reset, proof |
//! | `restart`, `resume` | a job that was begun before goes on |

mod connect;
mod dark;
mod error;
mod link;
mod options;
mod prove;
mod reason;
mod report;
mod restart;
mod resume;
mod stop;
mod stream;

use std::collections::VecDeque;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::Duration;

use self::connect::Facts;
use self::dark::Watch;
use super::follow::{Cuts, Follower};
use super::journal::{Begin, Journal, Record};
use super::operator::Operator;
use super::reply::Status;
use super::{Job, Transport};

pub use error::SendError;
pub(super) use link::Link;
pub use options::{SendOptions, Streaming};
pub use reason::StopReason;
pub(super) use reason::{alarm_words, error_words};
pub use report::{Confirmed, Proof, SendReport};
pub use resume::{Question, resume};

const RESET: &[u8] = &[0x18];
/// How long an answer to a question outside the job may take.
const ANSWER: Duration = Duration::from_secs(3);

/// Sends a job over an open link, and comes back when the machine stands: with a report if all of it was acknowledged
/// and the machine is idle with its beam off, else with an error that says what is known.
///
/// The order is: wait for the banner, or reset the controller; ask what it is and how it is set; stream; wait until it
/// is idle. The person's wish to stop is
/// [`Progress::interrupted`](crate::base::progress::Progress::interrupted), other wishes come from the [`Operator`].
///
/// # Errors
/// [`SendError`]; for the first three kinds the job was not begun.
pub fn send(
    transport: &mut dyn Transport,
    job: &Job,
    options: &SendOptions,
    progress: &dyn Operator,
) -> Result<SendReport, SendError> {
    let cuts = Cuts::of(job).ok();
    let mut sender = Sender::new(transport, job, options, progress);
    sender.cuts = cuts.as_ref();
    let facts = sender.connect_and_check()?;
    sender.run(&facts)
}

/// [`send`] with a journal: cuts that are proven are written there, and no more than its
/// [`Journal::max_unconfirmed`] are ever sent beyond them, so that the job can be [`resume`]d whatever happens. `cuts`
/// are the job's.
///
/// # Errors
/// [`SendError`]; also where the journal cannot be written.
pub fn send_recorded(
    transport: &mut dyn Transport,
    job: &Job,
    cuts: &Cuts,
    options: &SendOptions,
    progress: &dyn Operator,
    journal: &mut Journal,
) -> Result<SendReport, SendError> {
    let mut sender = Sender::new(transport, job, options, progress);
    sender.cuts = Some(cuts);
    let facts = sender.connect_and_check()?;
    sender.record(journal, 0, &facts)?;
    sender.run(&facts)
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
    progress: &'a dyn Operator,
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
    /// The job's cuts, if it can be followed.
    cuts: Option<&'a Cuts>,
    follower: Option<Follower<'a>>,
    journal: Option<&'a mut Journal>,
    /// Cuts made before this job's first.
    earlier: usize,
    /// Of this job's cuts, those proven and, if there is a journal, written there.
    proven: usize,
    /// Lines that may be sent as far as proofs go.
    allowed: usize,
    /// Reports in a row that showed the head astray.
    astray: u32,
    /// How much speaks for reports that are coarser than they look.
    doubt: f64,
    /// They are taken for that.
    coarse: bool,
    /// Over the output of a torch that is held.
    watch: Watch,
    /// The last work offset told, mm.
    offset_mm: [f64; 3],
    /// When the first line went out.
    started: Duration,
}

impl Drop for Sender<'_> {
    /// The last way out: a reset puts the beam out at once, whatever the machine does. Position is lost, the sheet
    /// perhaps too.
    fn drop(&mut self) {
        if self.armed {
            let _ = self.link.send(RESET);
        }
    }
}

impl<'a> Sender<'a> {
    fn new(
        transport: &'a mut dyn Transport,
        job: &'a Job,
        options: &'a SendOptions,
        progress: &'a dyn Operator,
    ) -> Self {
        Self {
            link: Link::new(transport),
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
            cuts: None,
            follower: None,
            journal: None,
            earlier: 0,
            proven: 0,
            allowed: usize::MAX,
            astray: 0,
            doubt: 0.0,
            coarse: false,
            watch: Watch::default(),
            offset_mm: [0.0; 3],
            started: Duration::ZERO,
        }
    }

    fn now(&self) -> Duration {
        self.link.transport.now()
    }

    fn port(&self) -> String {
        self.link.transport.name().to_owned()
    }

    /// From now on every proof is written; the job's first cut is the `earlier`th of the journal's job.
    fn record(
        &mut self,
        journal: &'a mut Journal,
        earlier: usize,
        facts: &Facts,
    ) -> Result<(), SendError> {
        journal
            .begin(Begin {
                cut: earlier,
                system: facts.system.clone(),
                offset_mm: facts.offset_mm,
                homes: facts.homes,
                firmware: facts.firmware.clone(),
            })
            .map_err(|error| SendError::NotReady {
                why: format!(
                    "the journal cannot be written beside the job ({error}), and without it the job could not be resumed: make room there, or copy the job to a place that can be written to"
                ),
            })?;
        self.journal = Some(journal);
        self.earlier = earlier;
        self.allow();
        Ok(())
    }

    /// Streams the job to its end, or stops it.
    fn run(mut self, facts: &Facts) -> Result<SendReport, SendError> {
        self.link.unit_mm = facts.unit_mm;
        self.offset_mm = facts.offset_mm;
        self.watch = Watch::of(&facts.firmware, facts.run_up_s());
        if let Some(cuts) = self.cuts {
            let start = self.work_mm(facts.position_mm.as_ref());
            self.follower = Some(Follower::new(cuts, start, facts.tolerance_mm));
        }
        self.progress
            .start("sending", u64::try_from(self.job.len()).ok());
        let start = self.now();
        self.started = start;
        self.armed = true;
        // A bug here, or in what shows the progress, must not leave a running machine to itself.
        let result = catch_unwind(AssertUnwindSafe(|| self.stream(facts.buffer)));
        let outcome = match result {
            Ok(Ok(())) => {
                self.note_finished();
                Ok(SendReport {
                    lines: self.job.len(),
                    acknowledged: self.acknowledged,
                    bytes: self.bytes,
                    cuts: self.earlier + self.proven,
                    time_s: (self.now() - start).as_secs_f64(),
                    max_in_flight: self.max_in_flight,
                    buffer: facts.buffer,
                    firmware: facts.firmware.clone(),
                    position_mm: self.status.as_ref().and_then(|s| s.position_mm),
                })
            }
            Ok(Err(Trouble::Link(source))) => Err(self.link_failed(source)),
            Ok(Err(Trouble::Stop(reason))) => Err(self.stop(reason)),
            Err(panic) => {
                let stopped = self.stop_sequence(true);
                self.armed = false;
                if let Ok(proof) = &stopped {
                    self.note_stopped(proof);
                }
                let said = stopped.map_or_else(|e| e.to_string(), |proof| proof.to_string());
                let progress = self.progress;
                let _ = catch_unwind(AssertUnwindSafe(|| {
                    progress.note(&format!("a fault in this program ended the job; {said}"));
                }));
                resume_unwind(panic)
            }
        };
        self.armed = false;
        outcome
    }

    /// The job has come to its end.
    fn note_finished(&mut self) {
        if let Some(journal) = self.journal.as_deref_mut()
            && let Err(error) = journal.write(&Record::Finished)
        {
            self.progress.note(&format!(
                "the journal cannot be finished ({error}); the job is"
            ));
        }
    }
}
