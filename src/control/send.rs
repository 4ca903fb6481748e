//! Streaming a job by character counting, and stopping it with proof.

use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::time::Duration;

use serde::Serialize;

use super::reply::{MachineState, Reply, Status};
use super::{Job, Transport};
use crate::base::progress::Progress;

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

/// A job that ran to its end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SendReport {
    /// Lines sent.
    pub lines: usize,
    /// Lines acknowledged: all of them.
    pub acknowledged: usize,
    /// Bytes sent for them.
    pub bytes: u64,
    /// From the first byte of the job to the report that the machine stands, s on the link's clock.
    pub time_s: f64,
    /// The most bytes that were unanswered at any moment.
    pub max_in_flight: usize,
    /// The controller's receive buffer, bytes.
    pub buffer: usize,
    /// What the controller calls itself.
    pub firmware: String,
    /// Where the machine stood at the end, as it tells, mm.
    pub position_mm: Option<[f64; 3]>,
}

/// What is known about the beam after a stop.
#[derive(Clone, Debug, PartialEq)]
pub enum Proof {
    /// The controller reported: standing, power 0.
    BeamOff {
        /// It came to rest before the reset, so its position is still true.
        position_kept: bool,
    },
    /// No report says so.
    Unknown {
        /// Why not.
        why: String,
    },
    /// The link is gone.
    LinkLost {
        /// The job uses M3.
        constant_power: bool,
    },
}

impl fmt::Display for Proof {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BeamOff { position_kept: true } => f.write_str(
                "the machine reports that it stands, the beam is off and its position is kept",
            ),
            Self::BeamOff { position_kept: false } => f.write_str(
                "the machine reports that it stands and the beam is off; it was stopped in motion, so home it before the next job",
            ),
            Self::Unknown { why } => write!(
                f,
                "IT COULD NOT BE CONFIRMED THAT THE BEAM IS OFF ({why}): switch the machine off by hand"
            ),
            Self::LinkLost { constant_power: false } => f.write_str(
                "nothing more can be confirmed: lines already in the controller may still run; the job uses M4 only, so the beam goes off when they end. Stay beside the machine until it stands",
            ),
            Self::LinkLost { constant_power: true } => f.write_str(
                "THE BEAM MAY STAY ON: the job uses M3, and no computer can switch it off now. Switch the machine off by hand",
            ),
        }
    }
}

/// How far a job came.
#[derive(Clone, Debug, PartialEq)]
pub struct Confirmed {
    /// Lines in the job.
    pub lines: usize,
    /// Lines sent.
    pub sent: usize,
    /// Lines acknowledged: planned by the controller, not necessarily cut.
    pub acknowledged: usize,
    /// The number in the file of the last line acknowledged.
    pub last_line: Option<usize>,
    /// The last position that the machine told, mm.
    pub position_mm: Option<[f64; 3]>,
    /// What is known about the beam.
    pub proof: Proof,
}

impl fmt::Display for Confirmed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} lines sent, {} acknowledged (planned, not all of them cut)",
            self.sent, self.lines, self.acknowledged
        )?;
        if let Some(line) = self.last_line {
            write!(f, ", the last one line {line} of the file")?;
        }
        if let Some([x, y, _]) = self.position_mm {
            write!(f, "; last position told: X{x:.3} Y{y:.3}")?;
        }
        write!(f, "; {}", self.proof)
    }
}

/// Why a running job was stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum StopReason {
    /// The person asked for it.
    Interrupted,
    /// The controller refused a line.
    Refused {
        /// GRBL's error number.
        error: u32,
        /// Number of the line in the file.
        line: usize,
        /// The line.
        text: String,
    },
    /// The controller locked itself.
    Alarm(u32),
    /// The controller started anew in the middle of the job.
    Reset(String),
    /// The controller does not answer.
    Silent {
        /// For how long, s.
        seconds: f64,
    },
    /// The machine is paused and nobody resumes it.
    Paused {
        /// For how long, s.
        seconds: f64,
    },
    /// An answer that no line was waiting for, or a line that got none: bytes were lost or damaged.
    Ledger(String),
    /// The job was acknowledged to its end and the machine stands, but its beam is on.
    BeamOn {
        /// The power told, S.
        s: f64,
    },
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interrupted => f.write_str("interrupted"),
            Self::Refused { error, line, text } => write!(
                f,
                "the controller refused line {line} ({text}) with error {error}: {}",
                error_words(*error)
            ),
            Self::Alarm(n) => write!(f, "the controller raised alarm {n}: {}", alarm_words(*n)),
            Self::Reset(banner) => write!(
                f,
                "the controller started anew in the middle of the job ({banner}): check its power supply and the emergency stop"
            ),
            Self::Silent { seconds } => {
                write!(f, "the controller has not answered for {seconds:.1} s")
            }
            Self::Paused { seconds } => write!(
                f,
                "the machine has been paused for {seconds:.0} s (M0 in the job, or a hold) and nobody resumes it"
            ),
            Self::Ledger(what) => write!(
                f,
                "{what}: bytes were lost or damaged on the way; use a shorter, better shielded cable"
            ),
            Self::BeamOn { s } => write!(
                f,
                "the job has ended but the machine reports power S{s}: its beam was on while standing"
            ),
        }
    }
}

/// GRBL's errors, in words for a person.
fn error_words(number: u32) -> &'static str {
    match number {
        1 | 2 => "a word of it is damaged",
        8 => "it must be idle for this",
        9 => "it is locked; unlock or home it",
        11 => "the line is too long for it",
        20 => "it does not know a word of it",
        21 => "two words of it contradict each other",
        22 => "no feed rate (F) has been set",
        24 | 25 => "a word is repeated or two commands want the same axes",
        33..=35 => "the arc is not valid",
        _ => "see GRBL's list of errors",
    }
}

/// GRBL's alarms, in words for a person.
fn alarm_words(number: u32) -> &'static str {
    match number {
        1 => "a limit switch was hit; position may be lost",
        2 => "the job leaves the machine's travel",
        3 => "it was reset while moving; position is lost",
        6..=9 => "homing failed",
        _ => "see GRBL's list of alarms",
    }
}

/// Why a job did not run to its end.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// The link failed before the job began.
    #[error("no connection to {port}: {source}. Nothing was sent")]
    Connect {
        /// The transport's name.
        port: String,
        /// The system's reason.
        source: io::Error,
    },
    /// What answers is no GRBL controller.
    #[error(
        "no GRBL controller answers at {port} ({heard}): check the port, its baud rate and that the machine is on. Nothing was sent"
    )]
    NoController {
        /// The transport's name.
        port: String,
        /// What was heard instead.
        heard: String,
    },
    /// The controller is not in a state to run this job.
    #[error("{why}. Nothing was sent")]
    NotReady {
        /// What is wrong and what to do.
        why: String,
    },
    /// The job was stopped.
    #[error("{reason}; {confirmed}")]
    Stopped {
        /// Why.
        reason: StopReason,
        /// How far it came, and what is known.
        confirmed: Box<Confirmed>,
    },
    /// The link was lost in the middle of the job.
    #[error("lost the link to {port} ({source}); {confirmed}")]
    LinkLost {
        /// The transport's name.
        port: String,
        /// The system's reason.
        source: io::Error,
        /// How far it came, and what is known.
        confirmed: Box<Confirmed>,
    },
}

impl SendError {
    /// How far the job came, if it had begun.
    pub fn confirmed(&self) -> Option<&Confirmed> {
        match self {
            Self::Stopped { confirmed, .. } | Self::LinkLost { confirmed, .. } => Some(confirmed),
            _ => None,
        }
    }
}

const RESET: &[u8] = &[0x18];
/// The largest receive buffer believed, bytes: what grblHAL and FluidNC boards tell at the most.
const LARGEST_BUFFER: usize = 1024;
/// How often the reset is repeated, and how long each waits for the banner: the stop is often wanted because bytes
/// are being lost, and the one that counts may be among them.
const RESETS: u32 = 3;
const BANNER_WAIT: Duration = Duration::from_secs(1);
/// How long an answer to a question outside the job may take.
const ANSWER: Duration = Duration::from_secs(3);
/// How long a hold may brake, if reports say that it still does: 10 m/min at 10 mm/s² is 17 s.
const BRAKING: Duration = Duration::from_secs(20);
/// How long between status requests while stopping.
const STOP_POLL: Duration = Duration::from_millis(50);

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

/// Lines in, bytes out.
struct Link<'a> {
    transport: &'a mut dyn Transport,
    partial: Vec<u8>,
    lines: VecDeque<Reply>,
}

impl Link<'_> {
    /// The next reply, waiting for it until `deadline`. It looks at the line once even if that has passed, and it
    /// comes back in time however much noise the line carries.
    fn reply(&mut self, deadline: Duration) -> io::Result<Option<Reply>> {
        loop {
            if let Some(reply) = self.lines.pop_front() {
                return Ok(Some(reply));
            }
            let now = self.transport.now();
            let mut buffer = [0; 512];
            let count = self
                .transport
                .receive(&mut buffer, deadline.saturating_sub(now))?;
            for &byte in &buffer[..count] {
                if byte == b'\n' || byte == b'\r' {
                    let line = String::from_utf8_lossy(&self.partial);
                    self.lines.extend(Reply::parse(&line));
                    self.partial.clear();
                } else if self.partial.len() < 1024 {
                    // Longer lines come from no controller; what is dropped makes the line unknown.
                    self.partial.push(byte);
                }
            }
            if self.lines.is_empty() && self.transport.now() >= deadline {
                return Ok(None);
            }
        }
    }

    /// As [`Link::reply`], and nothing once `deadline` has passed: for loops that must end whatever the far side says.
    fn reply_before(&mut self, deadline: Duration) -> io::Result<Option<Reply>> {
        if self.transport.now() >= deadline {
            Ok(None)
        } else {
            self.reply(deadline)
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.transport.send(bytes)
    }
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

    fn connect_error(&self, source: io::Error) -> SendError {
        SendError::Connect {
            port: self.port(),
            source,
        }
    }

    /// Waits for the banner, resets the controller if there is none, and gives the banner.
    fn connect(&mut self) -> Result<String, SendError> {
        let mut heard = "nothing was heard".to_owned();
        for reset in [false, true] {
            if reset {
                self.link
                    .send(RESET)
                    .map_err(|source| self.connect_error(source))?;
            }
            let wait = if reset {
                ANSWER
            } else {
                self.options.banner_wait
            };
            let deadline = self.now() + wait;
            while let Some(reply) = self
                .link
                .reply_before(deadline)
                .map_err(|source| self.connect_error(source))?
            {
                self.check_interrupted()?;
                match reply {
                    Reply::Banner(text) => {
                        // What follows at once (the lock's message) belongs to the banner.
                        let settle = self.now() + Duration::from_millis(100);
                        while self
                            .link
                            .reply_before(settle)
                            .map_err(|source| self.connect_error(source))?
                            .is_some()
                        {}
                        return Ok(text);
                    }
                    Reply::Unknown(text) => heard = format!("it says {text:?}"),
                    _ => {}
                }
            }
        }
        Err(SendError::NoController {
            port: self.port(),
            heard,
        })
    }

    /// The person may change their mind before anything is sent.
    fn check_interrupted(&self) -> Result<(), SendError> {
        if self.progress.interrupted() {
            return Err(SendError::NotReady {
                why: "interrupted before the job began".into(),
            });
        }
        Ok(())
    }

    /// Sends a question and collects what is said until `ok`.
    fn ask(&mut self, question: &str) -> Result<Vec<Reply>, SendError> {
        let lost = |port: String, source| SendError::Connect { port, source };
        let text = format!("{question}\n");
        self.link
            .send(text.as_bytes())
            .map_err(|source| lost(self.port(), source))?;
        let deadline = self.now() + ANSWER;
        let mut answer = Vec::new();
        loop {
            self.check_interrupted()?;
            match self
                .link
                .reply_before(deadline)
                .map_err(|source| lost(self.port(), source))?
            {
                Some(Reply::Ok) => return Ok(answer),
                Some(Reply::Error(number)) => {
                    return Err(SendError::NotReady {
                        why: format!(
                            "the controller answers {question} with error {number}: {}",
                            error_words(number)
                        ),
                    });
                }
                Some(reply) => answer.push(reply),
                None => {
                    return Err(SendError::NoController {
                        port: self.port(),
                        heard: format!("{question} was not answered"),
                    });
                }
            }
        }
    }

    /// Is this the controller, set as the job needs it? Gives the size of its receive buffer.
    fn preflight(&mut self) -> Result<usize, SendError> {
        let not_ready = |why: String| Err(SendError::NotReady { why });
        let state = self.ask_status()?;
        match state {
            MachineState::Idle => {}
            MachineState::Alarm => {
                return not_ready(
                    "the machine is locked: home it ($H), or unlock it ($X) if you know where it stands"
                        .into(),
                );
            }
            other => {
                return not_ready(format!(
                    "the machine is not idle ({other:?}): bring it to rest first"
                ));
            }
        }
        let mut buffer = None;
        for reply in self.ask("$I")? {
            if let Reply::Message(text) = reply
                && let Some(options) = text.strip_prefix("[OPT:")
            {
                let mut fields = options.trim_end_matches(']').split(',');
                buffer = fields.nth(2).and_then(|f| f.parse::<usize>().ok());
            }
        }
        let Some(told) = buffer.filter(|&b| b >= 82) else {
            return not_ready(
                "the controller does not tell the size of its receive buffer ($I): it is not a GRBL 1.1 controller that can be streamed to"
                    .into(),
            );
        };
        // One byte less than told: grblHAL tells the size of a ring that holds one less. And never more than the
        // profile says, nor more than any of these boards has: a damaged number must not overrun the real buffer.
        let buffer = told
            .min(self.options.buffer.unwrap_or(LARGEST_BUFFER))
            .min(LARGEST_BUFFER)
            - 1;
        let (mut laser, mut s_max) = (None, None);
        for reply in self.ask("$$")? {
            match reply {
                Reply::Setting(32, value) => laser = Some(value),
                Reply::Setting(30, value) => s_max = Some(value),
                _ => {}
            }
        }
        if laser != Some(1.0) {
            return not_ready(
                "the controller is not in laser mode ($32=1): its beam would stay on between cuts and in a pause. Set $32=1, then send again"
                    .into(),
            );
        }
        let Some(s_max) = s_max else {
            return not_ready("the controller does not tell its full power ($30)".into());
        };
        if let Some(wanted) = self.options.s_max
            && wanted != s_max
        {
            return not_ready(format!(
                "the job is written for full power at S{wanted}, the controller is set to S{s_max} ($30): every power would be wrong by {:.2} times. Set $30={wanted}, or make the job for this machine",
                wanted / s_max
            ));
        }
        if self.job.largest_s() > s_max {
            return not_ready(format!(
                "the job asks for S{}, the controller's full power is S{s_max} ($30): make the job for this machine, or set $30",
                self.job.largest_s()
            ));
        }
        self.check_modal_state()?;
        Ok(buffer)
    }

    /// The beam must be off before the job, and no startup block may light it after a reset: blocks run after every
    /// one of them, also after the one that ends a stop.
    fn check_modal_state(&mut self) -> Result<(), SendError> {
        for reply in self.ask("$G")? {
            if let Reply::Message(text) = reply
                && text.starts_with("[GC:")
                && text
                    .trim_end_matches(']')
                    .split([' ', ':'])
                    .any(|word| word == "M3" || word == "M4")
            {
                return Err(SendError::NotReady {
                    why: format!(
                        "the controller's beam is armed already ({text}): send M5 to it, then try again"
                    ),
                });
            }
        }
        for reply in self.ask("$N")? {
            if let Reply::Unknown(text) = reply
                && let Some((name, block)) = text.split_once('=')
                && name.starts_with("$N")
                && !block.trim().is_empty()
            {
                return Err(SendError::NotReady {
                    why: format!(
                        "the controller runs a startup block after every reset ({text}), also after an emergency stop: clear it with {name}= and send again"
                    ),
                });
            }
        }
        Ok(())
    }

    /// Asks for a status and waits for it.
    fn ask_status(&mut self) -> Result<MachineState, SendError> {
        let deadline = self.now() + ANSWER;
        self.link
            .send(b"?")
            .map_err(|source| self.connect_error(source))?;
        loop {
            self.check_interrupted()?;
            match self
                .link
                .reply_before(deadline)
                .map_err(|source| self.connect_error(source))?
            {
                Some(Reply::Status(status)) => return Ok(status.state),
                Some(_) => {}
                None => {
                    return Err(SendError::NoController {
                        port: self.port(),
                        heard: "a status request was not answered".into(),
                    });
                }
            }
        }
    }

    /// Fills the controller's buffer as far as it is known to be free.
    fn fill(&mut self, buffer: usize) -> io::Result<()> {
        let mut batch = Vec::new();
        while let Some((text, _)) = self.job.line(self.sent) {
            let cost = text.len() + 1;
            if self.in_flight + cost > buffer {
                break;
            }
            batch.extend_from_slice(text.as_bytes());
            batch.push(b'\n');
            self.ledger.push_back(cost);
            self.in_flight += cost;
            self.sent += 1;
        }
        self.max_in_flight = self.max_in_flight.max(self.in_flight);
        if batch.is_empty() {
            return Ok(());
        }
        self.bytes += batch.len() as u64;
        self.link.send(&batch)
    }

    /// A line has been answered; gives its index in the job.
    fn settle(&mut self) -> Result<usize, Trouble> {
        let Some(cost) = self.ledger.pop_front() else {
            return Err(Trouble::Stop(StopReason::Ledger(
                "the controller answered a line that was not sent".into(),
            )));
        };
        self.in_flight -= cost;
        Ok(self.sent - self.ledger.len() - 1)
    }

    fn stream(&mut self, buffer: usize) -> Result<(), Trouble> {
        let mut next_poll = self.now() + self.options.poll;
        let mut asked_at: Option<Duration> = None;
        // Idle reports in a row with nothing else said: at the end, or with lines that will never be answered.
        let mut idle_since: Option<Duration> = None;
        let mut idle_reports = 0;
        let mut held_since: Option<Duration> = None;
        let patience = Duration::try_from_secs_f64(self.job.longest_dwell_s())
            .unwrap_or(Duration::from_secs(3600))
            + Duration::from_secs(3);
        loop {
            if self.progress.interrupted() {
                return Err(Trouble::Stop(StopReason::Interrupted));
            }
            self.fill(buffer)?;
            let now = self.now();
            if let Some(asked) = asked_at
                && now.saturating_sub(asked) > self.options.silence
            {
                let seconds = (now - asked).as_secs_f64();
                return Err(Trouble::Stop(StopReason::Silent { seconds }));
            }
            if now >= next_poll {
                next_poll = now + self.options.poll;
                if asked_at.is_none() {
                    self.link.send(b"?")?;
                    asked_at = Some(now);
                }
            }
            let Some(reply) = self.link.reply(next_poll)? else {
                continue;
            };
            match reply {
                Reply::Ok => {
                    self.settle()?;
                    self.acknowledged += 1;
                    self.progress.advance(1);
                    (idle_since, idle_reports) = (None, 0);
                    if self.ledger.is_empty() && self.job.line(self.sent).is_none() {
                        // The end is near: ask at once.
                        next_poll = self.now();
                    }
                }
                Reply::Error(error) => {
                    let index = self.settle()?;
                    let (text, line) = self.job.line(index).unwrap_or(("", 0));
                    return Err(Trouble::Stop(StopReason::Refused {
                        error,
                        line,
                        text: text.to_owned(),
                    }));
                }
                Reply::Alarm(number) => return Err(Trouble::Stop(StopReason::Alarm(number))),
                Reply::Banner(text) => return Err(Trouble::Stop(StopReason::Reset(text))),
                Reply::Status(status) => {
                    let asked = asked_at.take();
                    let state = status.state;
                    let s = status.s;
                    self.status = Some(status);
                    let holding = matches!(state, MachineState::Hold(_) | MachineState::Door(_));
                    match held_since {
                        None if holding => {
                            held_since = Some(now);
                            self.progress.note(
                                "the machine is paused; it goes on when resumed there, Ctrl-C ends the job",
                            );
                        }
                        Some(_) if !holding => {
                            held_since = None;
                            self.progress.note("the machine goes on");
                        }
                        Some(since)
                            if self
                                .options
                                .longest_pause
                                .is_some_and(|longest| now.saturating_sub(since) > longest) =>
                        {
                            let seconds = (now - since).as_secs_f64();
                            return Err(Trouble::Stop(StopReason::Paused { seconds }));
                        }
                        _ => {}
                    }
                    if state == MachineState::Alarm {
                        return Err(Trouble::Stop(StopReason::Alarm(0)));
                    }
                    if matches!(state, MachineState::Check | MachineState::Sleep) {
                        return Err(Trouble::Stop(StopReason::Ledger(format!(
                            "the machine has gone to {state:?} in the middle of the job"
                        ))));
                    }
                    if state != MachineState::Idle {
                        (idle_since, idle_reports) = (None, 0);
                        continue;
                    }
                    idle_reports += 1;
                    let since = *idle_since.get_or_insert(asked.unwrap_or(now));
                    let all_answered = self.ledger.is_empty() && self.job.line(self.sent).is_none();
                    // One report may have been on its way before the last answer; the second was not.
                    if all_answered && idle_reports >= 2 {
                        return match s {
                            Some(0.0) => Ok(()),
                            Some(s) => Err(Trouble::Stop(StopReason::BeamOn { s })),
                            None => Err(Trouble::Stop(StopReason::Ledger(
                                "the last report does not tell the power".into(),
                            ))),
                        };
                    }
                    if all_answered {
                        next_poll = self.now();
                    } else if self.now().saturating_sub(since) > patience {
                        return Err(Trouble::Stop(StopReason::Ledger(format!(
                            "the machine is idle but {} lines were never answered",
                            self.ledger.len()
                        ))));
                    }
                }
                Reply::Message(text) => {
                    if !text.starts_with("[MSG:Pgm End") {
                        self.progress.note(&text);
                    }
                }
                Reply::Setting(..) => {}
                Reply::Unknown(text) => {
                    return Err(Trouble::Stop(StopReason::Ledger(format!(
                        "the controller said {text:?}, which is no answer"
                    ))));
                }
            }
        }
    }

    fn confirmed(&self, proof: Proof) -> Box<Confirmed> {
        let last_line = self
            .acknowledged
            .checked_sub(1)
            .and_then(|k| self.job.line(k))
            .map(|(_, number)| number);
        Box::new(Confirmed {
            lines: self.job.len(),
            sent: self.sent,
            acknowledged: self.acknowledged,
            last_line,
            position_mm: self.status.as_ref().and_then(|s| s.position_mm),
            proof,
        })
    }

    fn link_lost(&self, source: io::Error) -> SendError {
        let constant_power = self.job.constant_power();
        SendError::LinkLost {
            port: self.port(),
            source,
            confirmed: self.confirmed(Proof::LinkLost { constant_power }),
        }
    }

    /// The link gave an error. Often it is only hurt: the machine is stopped all the same, as far as it listens.
    fn link_failed(&mut self, source: io::Error) -> SendError {
        match self.stop_sequence(false) {
            Ok(proof @ Proof::BeamOff { .. }) => SendError::LinkLost {
                port: self.port(),
                source,
                confirmed: self.confirmed(proof),
            },
            _ => self.link_lost(source),
        }
    }

    /// Hold, wait until it stands, reset, and see that it is dark.
    fn stop(&mut self, reason: StopReason) -> SendError {
        // After a restart, an alarm or lost bytes the position told may be anything.
        let trusted = matches!(
            reason,
            StopReason::Interrupted
                | StopReason::Refused { .. }
                | StopReason::Paused { .. }
                | StopReason::BeamOn { .. }
        );
        match self.stop_sequence(trusted) {
            Ok(proof) => SendError::Stopped {
                reason,
                confirmed: self.confirmed(proof),
            },
            Err(source) => self.link_lost(source),
        }
    }

    /// Brings the machine to rest and shows that it is dark. `trusted`: nothing so far speaks against its position.
    ///
    /// An error in the first half (the hold) does not end it: the reset is what puts the beam out.
    fn stop_sequence(&mut self, trusted: bool) -> io::Result<Proof> {
        let (stood, undisturbed) = self
            .link
            .send(b"!")
            .and_then(|()| self.wait_until_still())
            .unwrap_or_default();
        // Also when it does not stand: in motion a reset puts the beam out at once.
        let mut banner = false;
        let mut failure = None;
        for _ in 0..RESETS {
            match self.reset_and_hear() {
                Ok(heard) => banner = heard,
                Err(error) => failure = Some(error),
            }
            if banner {
                break;
            }
        }
        if let (false, Some(error)) = (banner, failure) {
            return Err(error);
        }
        let deadline = self.now() + ANSWER;
        let mut last = None;
        while self.now() < deadline {
            self.link.send(b"?")?;
            let until = self.now() + STOP_POLL;
            while let Some(reply) = self.link.reply_before(until)? {
                if let Reply::Status(status) = reply {
                    let locked = status.state == MachineState::Alarm;
                    let dark = status.dark_and_still();
                    last = Some(format!("{:?}, power {:?}", status.state, status.s));
                    self.status = Some(status);
                    if dark && banner {
                        return Ok(Proof::BeamOff {
                            position_kept: stood && undisturbed && trusted && !locked,
                        });
                    }
                }
            }
        }
        Ok(Proof::Unknown {
            why: match (banner, last) {
                (false, _) => "the controller did not answer the reset".into(),
                (true, None) => "it answered the reset but gives no report".into(),
                (true, Some(report)) => format!("its last report was {report}"),
            },
        })
    }

    /// One reset; true if the banner answers it.
    fn reset_and_hear(&mut self) -> io::Result<bool> {
        self.link.send(RESET)?;
        let deadline = self.now() + BANNER_WAIT;
        while let Some(reply) = self.link.reply_before(deadline)? {
            if matches!(reply, Reply::Banner(_)) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Polls until a report says that the machine stands. First: whether one did in time. Second: whether nothing was
    /// heard that a controller says only when it starts anew, or never.
    fn wait_until_still(&mut self) -> io::Result<(bool, bool)> {
        let start = self.now();
        let mut deadline = start + ANSWER;
        let mut undisturbed = true;
        let mut running = false;
        while self.now() < deadline {
            // The hold is repeated as long as the machine says that it runs: a single byte may be lost.
            self.link.send(if running { b"!?" } else { b"?" })?;
            let until = self.now() + STOP_POLL;
            while let Some(reply) = self.link.reply_before(until)? {
                match reply {
                    Reply::Status(status) => {
                        let state = status.state;
                        self.status = Some(status);
                        running = state == MachineState::Run;
                        match state {
                            MachineState::Hold(true) | MachineState::Door(true) => {
                                return Ok((true, undisturbed));
                            }
                            // Locked: it stands, or will not say more before the reset.
                            MachineState::Alarm | MachineState::Sleep => {
                                return Ok((false, undisturbed));
                            }
                            MachineState::Hold(false) | MachineState::Door(false) => {
                                deadline = start + BRAKING;
                            }
                            _ => {}
                        }
                    }
                    Reply::Alarm(_) => return Ok((false, undisturbed)),
                    Reply::Banner(_) | Reply::Unknown(_) => undisturbed = false,
                    // Answers to lines sent before the hold still count.
                    Reply::Ok if self.settle().is_ok() => self.acknowledged += 1,
                    Reply::Error(_) => {
                        let _ = self.settle();
                    }
                    _ => {}
                }
            }
        }
        Ok((false, undisturbed))
    }
}
