//! The job itself: lines go out as far as the controller has room, and every one is owned until it is answered.

use std::io;
use std::time::Duration;

use super::dark::DARK_POLL;
use super::reason::StopReason;
use super::{Sender, Streaming, Trouble};
use crate::control::follow::Cuts;
use crate::control::operator::{Change, Glance, Wish};
use crate::control::reply::{MachineState, Reply, Status};

/// How often the status is asked for while only a proof is waited for: it decides how long the machine stands, and it has
/// nothing else to do.
const WAITING_POLL: Duration = Duration::from_millis(25);

/// Idle reports at the end of a job before one must have told whether the output is on.
const TELLING_REPORTS: u32 = 40;

impl Sender<'_> {
    /// Fills the controller's buffer as far as it is known to be free, and as far as proofs allow.
    fn fill(&mut self, buffer: usize) -> io::Result<()> {
        let mut batch = Vec::new();
        while let Some((text, _)) = self.job.line(self.sent) {
            let cost = text.len() + 1;
            let full = match self.options.streaming {
                Streaming::Counted => self.in_flight + cost > buffer,
                Streaming::Answered => !self.ledger.is_empty(),
            };
            if full || self.held_back() {
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
    pub(super) fn settle(&mut self) -> Result<usize, Trouble> {
        let Some(cost) = self.ledger.pop_front() else {
            return Err(Trouble::Stop(StopReason::Ledger(
                "the controller answered a line that was not sent".into(),
            )));
        };
        self.in_flight -= cost;
        Ok(self.sent - self.ledger.len() - 1)
    }

    /// Shows the person where the job is.
    fn show(&self, status: &Status) {
        let done = self.proven.checked_sub(1).and_then(|k| self.cuts?.get(k));
        self.progress.glance(&Glance {
            status,
            work_mm: self.work_mm(Some(status)),
            cuts: self.earlier + self.proven,
            of_cuts: self.earlier + self.cuts.map_or(0, Cuts::len),
            acknowledged: self.acknowledged,
            lines: self.job.len(),
            done_lines: done.map_or(0, |cut| cut.last_line + 1),
            elapsed: self.now().saturating_sub(self.started),
        });
    }

    /// Whether the last report of a job proves that the output is on, or off. In laser mode its power does; without, a board
    /// may know no power, and what is switched on is told in every tenth report only.
    fn lit_at_end(&self, status: &Status) -> Option<bool> {
        if self.job.is_torch() {
            return status.lit();
        }
        status.s.map(|s| s != 0.0)
    }

    pub(super) fn stream(&mut self, buffer: usize) -> Result<(), Trouble> {
        let mut next_poll = self.now() + self.options.poll;
        let mut asked_at: Option<Duration> = None;
        // Idle reports in a row with nothing else said: at the end, or with lines that will never be answered.
        let mut idle_since: Option<Duration> = None;
        let mut idle_reports = 0;
        let mut held_since: Option<Duration> = None;
        // Reports in a row that were asked for with everything sent answered, and show the machine idle.
        let mut asked_rested = false;
        let mut rests = 0;
        let patience = Duration::try_from_secs_f64(self.job.longest_dwell_s())
            .unwrap_or(Duration::from_secs(3600))
            + Duration::from_secs(3);
        loop {
            if self.progress.interrupted() {
                return Err(Trouble::Stop(StopReason::Interrupted));
            }
            while let Some(wish) = self.progress.wish() {
                // A part of full power is a start contact that chatters.
                if self.job.is_torch()
                    && matches!(wish, Wish::Power(change) if change != Change::Reset)
                {
                    self.progress
                        .note("a torch is on or off: its power is set at its source");
                    continue;
                }
                self.link.send(&[wish.byte()])?;
                if self.job.is_torch() {
                    match wish {
                        Wish::Resume => self.watch.resumed(self.now()),
                        Wish::Pause => self.watch.paused(),
                        _ => {}
                    }
                }
            }
            let before = self.sent;
            self.fill(buffer)?;
            if self.sent != before {
                (asked_rested, rests) = (false, 0);
            }
            let now = self.now();
            if self.held_back() {
                next_poll = next_poll.min(now + WAITING_POLL);
            }
            if self.watch.is_waiting() {
                next_poll = next_poll.min(now + DARK_POLL);
            }
            if let Some(asked) = asked_at
                && now.saturating_sub(asked) > self.options.silence
            {
                let seconds = (now - asked).as_secs_f64();
                return Err(Trouble::Stop(StopReason::Silent { seconds }));
            }
            if now >= next_poll {
                next_poll = now + self.options.poll;
                if asked_at.is_none() {
                    asked_rested = self.ledger.is_empty();
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
                    let lit = self.lit_at_end(&status);
                    // An arc that stands with nothing to follow is not waited for so long.
                    let hurry = match lit {
                        Some(true) if self.job.is_torch() => Duration::from_secs(2),
                        _ => Duration::ZERO,
                    };
                    rests = match asked_rested && asked.is_some() && state == MachineState::Idle {
                        true => rests + 1,
                        false => 0,
                    };
                    self.keep_dark(&status)?;
                    self.follow(&status, rests >= 2)?;
                    self.show(&status);
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
                        match lit {
                            Some(false) => return Ok(()),
                            Some(true) => {
                                let s = self.status.as_ref().and_then(|s| s.s);
                                return Err(Trouble::Stop(StopReason::BeamOn { s }));
                            }
                            None if idle_reports < TELLING_REPORTS => {}
                            None => {
                                return Err(Trouble::Stop(StopReason::Ledger(
                                    "the last reports do not tell whether the beam is on".into(),
                                )));
                            }
                        }
                    }
                    if all_answered {
                        next_poll = self.now();
                    } else if self.now().saturating_sub(since) > patience.saturating_sub(hurry) {
                        return Err(Trouble::Stop(StopReason::Ledger(format!(
                            "the machine is idle but {} lines were never answered",
                            self.ledger.len()
                        ))));
                    }
                }
                Reply::Message(text) => {
                    // Of the end, and of every sheet that was felt, the person has seen enough.
                    if !["[MSG:Pgm End", "[PRB:"]
                        .iter()
                        .any(|s| text.starts_with(s))
                    {
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
}
