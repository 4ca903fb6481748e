//! At the machine without a job: ask, home, unlock, jog, set zero, keep settings.
//!
//! One command at a time, each waited for: nothing is streamed here, and nothing that lights the beam is ever sent. Whatever
//! moves first switches the output off and sees it off ([`Console::dark`]); the person's wish to stop cancels a jog (0x85),
//! and resets a homing cycle, which knows no other end.

mod act;
mod dry_run;
mod settings;

use std::io;
use std::time::Duration;

use super::offsets::Offsets;
use super::reply::{MachineState, Reply, Status};
use super::send::{Link, error_words};
use super::{Transport, stranger};
use crate::base::progress::Progress;

pub use act::{JogTo, Move, work_mm};
pub use settings::{Restored, SettingDifference, Settings, SettingsError};

/// How long an answer to a question may take.
const ANSWER: Duration = Duration::from_secs(3);
/// How long a board that the opening of its port has reset may take to start.
const BANNER: Duration = Duration::from_millis(2500);
/// Between two status requests.
const POLL: Duration = Duration::from_millis(100);

/// What goes wrong at the machine.
#[derive(Debug, thiserror::Error)]
pub enum ConsoleError {
    /// The link failed.
    #[error("lost the link to {port}: {source}")]
    Link {
        /// The transport's name.
        port: String,
        /// The system's reason.
        source: io::Error,
    },
    /// Nobody, or somebody else.
    #[error(
        "no GRBL controller answers at {port} ({heard}): check port and rate, and that the machine is on. After a limit switch was hit GRBL is silent until a reset: `kagome unlock --reset`"
    )]
    NoController {
        /// The transport's name.
        port: String,
        /// What was heard.
        heard: String,
    },
    /// A command was not answered.
    #[error("{command} was not answered")]
    NoAnswer {
        /// The command.
        command: String,
    },
    /// A command was refused.
    #[error("the controller refuses {command} with error {error}: {words}")]
    Refused {
        /// The command.
        command: String,
        /// GRBL's number.
        error: u32,
        /// What it means, and what to do.
        words: String,
    },
    /// The controller locked itself.
    #[error("the controller raised alarm {alarm} during {command}: {words}")]
    Alarm {
        /// The command.
        command: String,
        /// GRBL's number.
        alarm: u32,
        /// What it means.
        words: String,
    },
    /// The machine is not in a state for it.
    #[error("{0}")]
    NotReady(String),
    /// The person asked to stop; the machine was stopped.
    #[error("stopped: {0}")]
    Interrupted(String),
    /// The controller started anew.
    #[error("the controller started anew during {command} ({banner}): its position is lost")]
    Reset {
        /// The command.
        command: String,
        /// What it said.
        banner: String,
    },
}

/// A controller that answers, between jobs.
pub struct Console<'a> {
    link: Link<'a>,
    progress: &'a dyn Progress,
    /// What it called itself when the port was opened, if that has reset it.
    pub banner: Option<String>,
    /// The state it was in at first.
    pub first: Status,
    /// The work offset, the last that was told, mm.
    offset_mm: [f64; 3],
}

/// What it takes to find out all that a controller tells of itself.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Told {
    /// `$I`, line by line.
    pub build: Vec<String>,
    /// Modes in force (`$G`).
    pub modes: String,
    /// Offsets by name (`$#`), in its own unit.
    pub offsets: Offsets,
}

impl<'a> Console<'a> {
    /// Listens on an open line until the controller has shown itself. It is not reset: that would lose its position.
    ///
    /// # Errors
    /// [`ConsoleError::NoController`] with what was heard.
    pub fn open(
        transport: &'a mut dyn Transport,
        progress: &'a dyn Progress,
    ) -> Result<Self, ConsoleError> {
        let mut link = Link::new(transport);
        let port = link.transport.name().to_owned();
        let lost = |source| ConsoleError::Link {
            port: port.clone(),
            source,
        };
        let mut heard = "nothing was heard".to_owned();
        let mut banner = None;
        let start = link.transport.now();
        // A board that starts says so; one that does not is asked. Its boot loader must not be: it takes bytes for programs.
        let mut ask_from = start + BANNER;
        let end = ask_from + ANSWER;
        loop {
            let now = link.transport.now();
            if now >= end {
                return Err(ConsoleError::NoController { port, heard });
            }
            if progress.interrupted() {
                return Err(ConsoleError::Interrupted("nothing was sent".into()));
            }
            if now >= ask_from {
                link.send(b"?").map_err(lost)?;
                ask_from = now + POLL;
            }
            while let Some(reply) = link.reply_before(ask_from.min(now + POLL)).map_err(lost)? {
                match reply {
                    Reply::Banner(text) => {
                        banner = Some(text);
                        ask_from = link.transport.now() + POLL;
                    }
                    Reply::Status(first) => {
                        let console = Self {
                            offset_mm: [0.0; 3],
                            link,
                            progress,
                            banner,
                            first,
                        };
                        return console.with_unit();
                    }
                    Reply::Unknown(text) => heard = stranger::words(&text),
                    _ => {}
                }
            }
        }
    }

    /// Finds out what it reports lengths in, and where it stands.
    fn with_unit(mut self) -> Result<Self, ConsoleError> {
        // In motion it answers no such question, and is taken for one that reports millimetres.
        if matches!(self.first.state, MachineState::Idle | MachineState::Alarm) {
            let inches = self.settings().ok().and_then(|s| s.number(13));
            if inches.is_some_and(|v| v != 0.0) {
                self.link.unit_mm = 25.4;
            }
        }
        self.first = self.status()?;
        Ok(self)
    }

    /// Resets the controller and listens as [`Console::open`] does. In motion this loses the position.
    ///
    /// # Errors
    /// As [`Console::open`].
    pub fn open_with_reset(
        transport: &'a mut dyn Transport,
        progress: &'a dyn Progress,
    ) -> Result<Self, ConsoleError> {
        // Boards that were reset by the opening do not hear a byte yet.
        let mut early = Link::new(transport);
        let port = early.transport.name().to_owned();
        let lost = |source| ConsoleError::Link {
            port: port.clone(),
            source,
        };
        let until = early.transport.now() + BANNER;
        while let Some(reply) = early.reply_before(until).map_err(lost)? {
            if matches!(reply, Reply::Banner(_)) {
                break;
            }
        }
        early.send(&[0x18]).map_err(lost)?;
        Self::open(early.transport, progress)
    }

    fn now(&self) -> Duration {
        self.link.transport.now()
    }

    fn lost(&self, source: io::Error) -> ConsoleError {
        ConsoleError::Link {
            port: self.link.transport.name().to_owned(),
            source,
        }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), ConsoleError> {
        self.link.send(bytes).map_err(|source| self.lost(source))
    }

    fn next(&mut self, until: Duration) -> Result<Option<Reply>, ConsoleError> {
        self.link
            .reply_before(until)
            .map_err(|source| self.lost(source))
    }

    /// Asks where the machine stands and what it does; the work offset is that of the last report that told one.
    ///
    /// # Errors
    /// [`ConsoleError::NoAnswer`].
    pub fn status(&mut self) -> Result<Status, ConsoleError> {
        let end = self.now() + ANSWER;
        while self.now() < end {
            self.send(b"?")?;
            let until = self.now() + 5 * POLL;
            while let Some(reply) = self.next(until)? {
                if let Reply::Status(mut status) = reply {
                    if let Some(offset) = status.offset_mm {
                        self.offset_mm = offset;
                    }
                    status.offset_mm = Some(self.offset_mm);
                    return Ok(status);
                }
            }
        }
        Err(ConsoleError::NoAnswer {
            command: "?".into(),
        })
    }

    /// Sends a line that moves nothing, and gives what is said until it is taken.
    ///
    /// # Errors
    /// [`ConsoleError`]: refused, not answered.
    pub fn ask(&mut self, command: &str) -> Result<Vec<Reply>, ConsoleError> {
        self.command(command, ANSWER, |_| Ok(()))
    }

    /// Sends a line and collects replies until `ok`, at most this long after the last of them. `interrupted` is called when
    /// the person wants to stop.
    fn command(
        &mut self,
        command: &str,
        patience: Duration,
        mut interrupted: impl FnMut(&mut Self) -> Result<(), ConsoleError>,
    ) -> Result<Vec<Reply>, ConsoleError> {
        self.send(format!("{command}\n").as_bytes())?;
        let mut answer = Vec::new();
        let mut end = self.now() + patience;
        loop {
            if self.progress.interrupted() {
                interrupted(self)?;
            }
            let now = self.now();
            if now >= end {
                return Err(ConsoleError::NoAnswer {
                    command: command.to_owned(),
                });
            }
            let Some(reply) = self.next(end.min(now + POLL))? else {
                continue;
            };
            end = self.now() + patience;
            match reply {
                Reply::Ok => return Ok(answer),
                Reply::Error(error) => {
                    return Err(ConsoleError::Refused {
                        command: command.to_owned(),
                        error,
                        words: refusal(command, error),
                    });
                }
                Reply::Alarm(alarm) => {
                    return Err(ConsoleError::Alarm {
                        command: command.to_owned(),
                        alarm,
                        words: super::send::alarm_words(alarm).into(),
                    });
                }
                Reply::Banner(banner) => {
                    return Err(ConsoleError::Reset {
                        command: command.to_owned(),
                        banner,
                    });
                }
                other => answer.push(other),
            }
        }
    }

    /// All that the controller tells of itself.
    ///
    /// # Errors
    /// [`ConsoleError`].
    pub fn told(&mut self) -> Result<Told, ConsoleError> {
        let text = |replies: Vec<Reply>| -> Vec<String> {
            let of = |reply| match reply {
                Reply::Message(text) | Reply::Unknown(text) => Some(text),
                _ => None,
            };
            replies.into_iter().filter_map(of).collect()
        };
        let build = text(self.ask("$I")?);
        let modes = text(self.ask("$G")?)
            .into_iter()
            .find_map(|line| Some(line.strip_prefix("[GC:")?.strip_suffix(']')?.to_owned()))
            .unwrap_or_default();
        let offsets = Offsets::of(&self.ask("$#")?);
        Ok(Told {
            build,
            modes,
            offsets,
        })
    }

    /// Switches the output off and sees that it is off, on a machine that stands.
    ///
    /// # Errors
    /// [`ConsoleError::NotReady`] if the machine does not stand, or still reports power.
    pub fn dark(&mut self) -> Result<(), ConsoleError> {
        let status = self.status()?;
        match status.state {
            MachineState::Idle => {}
            MachineState::Alarm => {
                return Err(ConsoleError::NotReady(
                    "the machine is locked: home it (kagome home), or unlock it (kagome unlock) if you know where it stands".into(),
                ));
            }
            other => {
                return Err(ConsoleError::NotReady(format!(
                    "the machine is not idle ({other:?}): bring it to rest first"
                )));
            }
        }
        self.ask("M5")?;
        let status = self.status()?;
        if status.dark_and_still() {
            return Ok(());
        }
        Err(ConsoleError::NotReady(format!(
            "the beam could not be seen off (power {:?}): switch the machine off by hand",
            status.s
        )))
    }
}

/// Why a command was refused, for who gave it.
fn refusal(command: &str, error: u32) -> String {
    match (command, error) {
        ("$H", 5) => "homing is switched off ($22=0): the machine has no switches, or its settings do not say so".into(),
        (_, 15) => "it would leave the machine's travel ($130, $131)".into(),
        (_, 16) => "the controller does not take it for a jog".into(),
        (_, 3) => "the controller does not know it".into(),
        (_, 8) => "the machine must be idle for it".into(),
        _ => error_words(error).into(),
    }
}
