//! The banner, and what the controller must be and how it must be set before a job.

use std::io;
use std::time::Duration;

use super::reason::error_words;
use super::{ANSWER, RESET, SendError, Sender};
use crate::control::reply::{MachineState, Reply};

/// The largest receive buffer believed, bytes: what grblHAL and FluidNC boards tell at the most.
const LARGEST_BUFFER: usize = 1024;

impl Sender<'_> {
    fn connect_error(&self, source: io::Error) -> SendError {
        SendError::Connect {
            port: self.port(),
            source,
        }
    }

    /// Waits for the banner, resets the controller if there is none, and gives the banner.
    pub(super) fn connect(&mut self) -> Result<String, SendError> {
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
    pub(super) fn check_interrupted(&self) -> Result<(), SendError> {
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
    pub(super) fn preflight(&mut self) -> Result<usize, SendError> {
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
        // FluidNC does not tell: then the profile must.
        let told = buffer.filter(|&b| b >= 82).or(self.options.buffer);
        let Some(told) = told.filter(|&b| b >= 82) else {
            return not_ready(
                "the controller does not tell the size of its receive buffer ($I), and neither does the machine's profile (receive_buffer_bytes): it is not known how much can be sent at once"
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
}
