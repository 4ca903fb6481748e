//! A job that was begun before goes on at the first cut that is not proven.
//!
//! Nothing moves and no beam is armed before it is settled where the head stands. If the controller certainly kept its
//! position (it did not start anew, and stands where the journal says, or on the way of the lines that it had), the job goes
//! on. Else it is homed, or its zero point is set again; then the head goes, dark, to the beginning of a cut that is in
//! the sheet already, and the person says whether it stands over it.

use std::time::Duration;

use super::connect::{Facts, NOTHING};
use super::dark::DOOR;
use super::restart::Restart;
use super::{RESET, SendError, SendOptions, SendReport, Sender};
use crate::base::units::short;
use crate::control::follow::Cuts;
use crate::control::journal::{History, Journal};
use crate::control::operator::Operator;
use crate::control::reply::{MachineState, Reply};
use crate::control::{Job, JobRules, Transport};
use crate::material::Process;

/// What only the person can know or allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Question {
    /// The controller has lost its position and can find it by homing: may it, now?
    Home,
    /// It has lost its position and cannot home: does the head stand over the job's zero point, as it did at the
    /// beginning? A torch also has to hang clear of the sheet.
    ZeroHere {
        /// It is a torch.
        torch: bool,
    },
    /// A torch that may hang in the cut can be raised only so far before it travels: does it hang clear of the sheet?
    TorchClear {
        /// How far, mm.
        raised_mm: f64,
    },
    /// The head was moved, dark, to where a cut begins: does it stand over that?
    AtReference {
        /// The cut, from 0.
        cut: usize,
        /// It is proven to be in the sheet already; else it may be.
        is_cut: bool,
        /// Where it begins, work coordinates, mm.
        at_mm: [f64; 2],
    },
}

impl std::fmt::Display for Question {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Home => f.write_str(
                "the controller does not know where the head stands, and can find out by homing. The way to the switches must be free. May it be homed now",
            ),
            Self::ZeroHere { torch } => write!(
                f,
                "the controller does not know where the head stands, and this machine does not home. Move it by hand over the job's zero point (X0 Y0), where it was when the job was begun{}. Does it stand exactly there",
                if *torch {
                    ", and raise the torch clear of the sheet and everything on it"
                } else {
                    ""
                }
            ),
            Self::TorchClear { raised_mm } => write!(
                f,
                "the torch was raised by {} mm, to the upper end of its travel as the controller counts it, and travels over the sheet now. Does it hang clear of the sheet and of everything on it",
                short(*raised_mm, 1)
            ),
            Self::AtReference { cut, is_cut, at_mm } => write!(
                f,
                "the head has gone, with the beam off, to X{} Y{}, where cut {} begins{}. Does it stand exactly over that",
                short(at_mm[0], 3),
                short(at_mm[1], 3),
                cut + 1,
                if *is_cut { ", which is in the sheet" } else { "" }
            ),
        }
    }
}

/// How often a machine that still runs is asked.
const SETTLE_POLL: Duration = Duration::from_millis(200);
/// Idle reports before a machine counts as one that did not start anew when its port was opened.
const SETTLED: u32 = 3;
/// A longer dwell in the job is not waited for, s: the arc may be on.
const LONGEST_WAIT_S: f64 = 10.0;
/// How long homing may take.
const HOMING: Duration = Duration::from_secs(180);
/// How far a machine at rest may be from where it was left, beyond rounding: nothing.
const SAME_MM: f64 = 0.005;

/// How a controller was found.
enum Found {
    /// It has started anew: its banner.
    Anew(String),
    /// It stands, and did not start anew since the port was opened.
    Standing,
    /// It is locked, or says nothing.
    Lost,
}

/// Sends what is left of a job whose `journal` was opened with [`Journal::continued`]: from the first cut that is not
/// proven. `job` and `cuts` are those of the whole job. `answer` is asked what only the person can know; to say no ends
/// it with nothing cut.
///
/// A machine that still runs lines which it had when the link was lost is waited for.
///
/// # Errors
/// [`SendError`], as [`super::send_recorded`].
pub fn resume(
    transport: &mut dyn Transport,
    job: &Job,
    cuts: &Cuts,
    options: &SendOptions,
    progress: &dyn Operator,
    journal: &mut Journal,
    answer: &mut dyn FnMut(&Question) -> bool,
) -> Result<SendReport, SendError> {
    let not_ready = |why: String| SendError::NotReady { why };
    let Some(history) = journal.history().cloned() else {
        return Err(not_ready(
            "the journal is a new one: there is nothing to resume".into(),
        ));
    };
    let rest = Restart::new(job, cuts, history.proven, &history.begin.system)
        .map_err(|error| not_ready(format!("the job cannot be resumed: {error}")))?;
    let mut sender = Sender::new(&mut *transport, &rest.job, options, progress);
    sender.cuts = Some(&rest.cuts);
    let place = Place {
        history: &history,
        cuts,
        ahead: journal
            .max_unconfirmed()
            .max(history.header.max_unconfirmed),
    };
    let (facts, settled) = sender.find(&place, answer)?;
    drop(sender);
    if job.is_torch() && settled != Settled::Anew {
        // It may hang in the kerf, and the way from here goes over the sheet.
        raise(transport, &facts, (options, progress), answer)?;
    }
    if settled != Settled::Sure {
        let (cut, is_cut) = (history.proven.saturating_sub(1), history.proven > 0);
        visit(
            transport,
            job.process(),
            cuts,
            (cut, is_cut),
            &facts,
            (options, progress),
            answer,
        )?;
    }
    let mut sender = Sender::new(transport, &rest.job, options, progress);
    sender.cuts = Some(&rest.cuts);
    let facts = sender.look_again(facts)?;
    sender.record(journal, history.proven, &facts)?;
    progress.note(&format!(
        "going on at cut {} of {} (line {})",
        history.proven + 1,
        cuts.len(),
        cuts.line_of_first_move(history.proven)
            .and_then(|line| job.line(line))
            .map_or(0, |(_, number)| number)
    ));
    sender.run(&facts)
}

/// The head goes dark to where a cut begins, and the person looks.
fn visit(
    transport: &mut dyn Transport,
    process: Process,
    cuts: &Cuts,
    (cut, is_cut): (usize, bool),
    facts: &Facts,
    (options, progress): (&SendOptions, &dyn Operator),
    answer: &mut dyn FnMut(&Question) -> bool,
) -> Result<(), SendError> {
    let not_ready = |why: &str| SendError::NotReady { why: why.into() };
    let at_mm = cuts
        .get(cut)
        .map(|c| c.start_mm)
        .ok_or_else(|| not_ready("the job has no cut to stand over"))?;
    let text = format!(
        "M5\nG21G90G17G94{}\nG0X{}Y{}\n",
        facts.system,
        short(at_mm[0], 4),
        short(at_mm[1], 4)
    );
    progress.note("the head goes to a point of the job with the beam off");
    go_dark(transport, &text, process, facts, (options, progress))?;
    if answer(&Question::AtReference { cut, is_cut, at_mm }) {
        return Ok(());
    }
    Err(not_ready(
        "the head does not stand over the job's cut, so the rest would be cut in the wrong place: set the job's zero point again, and resume once more. The beam was never on",
    ))
}

/// A few lines that only move.
fn go_dark(
    transport: &mut dyn Transport,
    text: &str,
    process: Process,
    facts: &Facts,
    (options, progress): (&SendOptions, &dyn Operator),
) -> Result<(), SendError> {
    let rules = JobRules {
        process,
        ..JobRules::default()
    };
    let way = Job::check(text.as_bytes(), &rules).map_err(|error| SendError::NotReady {
        why: error.to_string(),
    })?;
    Sender::new(transport, &way, options, progress).run(facts)?;
    Ok(())
}

/// A torch is raised before it travels: as far as between two cuts, but not beyond the upper end of its travel, where that is
/// known; if that is less, the person looks.
fn raise(
    transport: &mut dyn Transport,
    facts: &Facts,
    (options, progress): (&SendOptions, &dyn Operator),
    answer: &mut dyn FnMut(&Question) -> bool,
) -> Result<(), SendError> {
    /// Where the profile does not say.
    const LIFT_MM: f64 = 10.0;
    let machine = options.made_for.as_deref().map(|(machine, _)| machine);
    let wanted = machine
        .and_then(|m| m.plasma()?.safe_height_mm)
        .unwrap_or(LIFT_MM);
    // A homed Z axis ends at 0, less the way by which it leaves its switch ($27).
    let room = facts.height_mm().filter(|z| facts.homes && *z <= 0.0);
    let lift = room.map_or(wanted, |z| wanted.min((-facts.pull_off_mm() - z).max(0.0)));
    if lift > 0.0 {
        let text = format!(
            "M5\nG21G90G17G94{}\nG91\nG0Z{}\nG90\n",
            facts.system,
            short(lift, 3)
        );
        progress.note("the torch is raised first");
        let who = (options, progress);
        go_dark(transport, &text, Process::Plasma, facts, who)?;
    }
    if lift < wanted && !answer(&Question::TorchClear { raised_mm: lift }) {
        return Err(SendError::NotReady {
            why: "the torch may hang in the sheet: raise it by hand (kagome jog --z 10), and resume again. The torch was never on"
                .into(),
        });
    }
    Ok(())
}

/// What is settled of where the head stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Settled {
    /// It stands where it was left, and its place and the job's zero are certain.
    Sure,
    /// It stands where it was left, but the zero was put back: it is to be shown.
    ZeroPutBack,
    /// It was homed, or moved by hand: it is to be shown.
    Anew,
}

/// What the journal says of where the head may be.
struct Place<'a> {
    history: &'a History,
    cuts: &'a Cuts,
    ahead: usize,
}

impl Place<'_> {
    /// Whether a controller that stands at these machine coordinates has certainly kept its position since then.
    fn is_kept(&self, machine_mm: [f64; 3], tolerance_mm: f64) -> bool {
        let near = |p: [f64; 3], by: f64| (0..2).all(|k| (machine_mm[k] - p[k]).abs() <= by);
        // Where every controller stands that has started anew.
        if near([0.0; 3], tolerance_mm) {
            return false;
        }
        match self.history.stopped {
            Some(Some(at)) => near(at, SAME_MM),
            Some(None) => false,
            None => {
                let offset = self.history.begin.offset_mm;
                let work = [machine_mm[0] - offset[0], machine_mm[1] - offset[1]];
                let proven = self.history.proven;
                self.cuts
                    .leaves_head_at(work, (proven, proven + self.ahead), tolerance_mm)
            }
        }
    }
}

impl Sender<'_> {
    /// Settles where the head stands.
    fn find(
        &mut self,
        place: &Place<'_>,
        answer: &mut dyn FnMut(&Question) -> bool,
    ) -> Result<(Facts, Settled), SendError> {
        let found = self.settle_down()?;
        let (firmware, stood) = match found {
            Found::Anew(banner) => (banner, false),
            // Half a line may be left in the controller; at rest a reset keeps the position.
            Found::Standing => (self.reset_and_connect(NOTHING.into())?, true),
            Found::Lost => (self.reset_and_connect(NOTHING.into())?, false),
        };
        let locked = self.ask_status()?.state == MachineState::Alarm;
        if !locked {
            self.check_idle()?;
        }
        let mut facts = self.preflight(firmware)?;
        facts.system.clone_from(&place.history.begin.system);
        self.locate(&mut facts)?;
        let then = place.history.begin.offset_mm;
        let axes = if self.minds_height() { 3 } else { 2 };
        let moved = |now: [f64; 3]| (0..axes).any(|k| (now[k] - then[k]).abs() > SAME_MM);
        let same_zero = !moved(facts.offset_mm);
        let machine_mm = facts
            .position_mm
            .as_ref()
            .and_then(|s| self.machine_of(s, &facts));
        let kept =
            stood && !locked && machine_mm.is_some_and(|at| place.is_kept(at, facts.tolerance_mm));
        if kept && same_zero {
            return Ok((facts, Settled::Sure));
        }
        let refused = |why: &str| SendError::NotReady { why: why.into() };
        if kept {
            self.set_zero(&mut facts, Some(then))?;
        } else if facts.homes && place.history.begin.homes {
            if !answer(&Question::Home) {
                return Err(refused(
                    "the controller does not know where the head stands: nothing can be cut before it is homed. Nothing was moved",
                ));
            }
            self.home()?;
            self.locate(&mut facts)?;
            if moved(facts.offset_mm) {
                self.progress.note(
                    "the job's zero point is not where it was when the job was begun: it is set to where it was",
                );
                self.set_zero(&mut facts, Some(then))?;
            }
        } else {
            if locked {
                return Err(refused(
                    "the machine is locked: unlock it ($X), put the head over the job's zero point, and resume again",
                ));
            }
            if self.job.is_torch() && !self.job.probes() {
                return Err(refused(
                    "the controller does not know how high the torch hangs, this machine does not home, and the job does not feel for the sheet (G38): the rest cannot be cut at the right height. Set the zero point anew and cut the rest from a job of its own. Nothing was moved",
                ));
            }
            let torch = self.job.is_torch();
            if !answer(&Question::ZeroHere { torch }) {
                return Err(refused(
                    "the controller does not know where the head stands: put the head over the job's zero point by hand, and resume again. Nothing was moved",
                ));
            }
            self.set_zero(&mut facts, None)?;
        }
        self.survey_travel(&facts)?;
        let settled = if kept {
            Settled::ZeroPutBack
        } else {
            Settled::Anew
        };
        Ok((facts, settled))
    }

    /// Whether the height of the zero point matters: not of a laser, and not where the job feels for the sheet.
    fn minds_height(&self) -> bool {
        self.job.is_torch() && !self.job.probes()
    }

    fn machine_of(&mut self, status: &super::Status, facts: &Facts) -> Option<[f64; 3]> {
        self.offset_mm = facts.offset_mm;
        self.machine_mm(status)
    }

    /// Calls a place the job's zero point: these machine coordinates, or where the head stands. In the controller's
    /// working memory only (G92), not among its settings.
    fn set_zero(&mut self, facts: &mut Facts, zero_mm: Option<[f64; 3]>) -> Result<(), SendError> {
        let status = self.ask_status()?;
        let at = self.machine_of(&status, facts).ok_or(SendError::NotReady {
            why: "the controller does not tell its position".into(),
        })?;
        let zero = zero_mm.unwrap_or(at);
        let word = |k: usize| short(at[k] - zero[k], 4);
        // A height that nobody has lost is kept as well; where the person shows the place, the job feels for it.
        let height = if self.minds_height() && zero_mm.is_some() {
            format!("Z{}", word(2))
        } else {
            String::new()
        };
        self.ask(&format!("G21G90G94{}", facts.system))?;
        self.ask(&format!("G92X{}Y{}{height}", word(0), word(1)))?;
        self.locate(facts)
    }

    /// Homes the machine, and waits until it has.
    fn home(&mut self) -> Result<(), SendError> {
        self.progress.note("homing");
        let failed = |why: String| SendError::NotReady { why };
        self.link
            .send(b"$H\n")
            .map_err(|source| self.connect_error(source))?;
        let deadline = self.now() + HOMING;
        while self.now() < deadline {
            if self.progress.interrupted() {
                let _ = self.link.send(RESET);
                return Err(failed(
                    "interrupted while homing; the machine was reset".into(),
                ));
            }
            let until = self.now() + SETTLE_POLL;
            match self
                .link
                .reply_before(until)
                .map_err(|source| self.connect_error(source))?
            {
                Some(Reply::Ok) => return self.check_idle(),
                Some(Reply::Error(n)) => {
                    return Err(failed(format!("the controller answers $H with error {n}")));
                }
                Some(Reply::Alarm(n)) => return Err(failed(format!("homing failed (alarm {n})"))),
                _ => {}
            }
        }
        let _ = self.link.send(RESET);
        Err(failed("homing did not end; the machine was reset".into()))
    }

    /// The same facts, and where the head stands now.
    fn look_again(&mut self, mut facts: Facts) -> Result<Facts, SendError> {
        self.link.unit_mm = facts.unit_mm;
        self.check_idle()?;
        self.locate(&mut facts)?;
        self.survey_travel(&facts)?;
        Ok(facts)
    }

    /// Waits until the machine stands, and says how it was found. Nothing is sent but status requests: lines that the
    /// controller had when the link was lost run to their end.
    fn settle_down(&mut self) -> Result<Found, SendError> {
        let mut quiet_until = self.now() + self.options.banner_wait;
        let mut standing = 0;
        let mut told = false;
        // GRBL tells Idle while it waits in the middle of a job, as a torch does in its pierce.
        let waits = self.job.longest_dwell_s().min(LONGEST_WAIT_S) / SETTLE_POLL.as_secs_f64();
        let settled = SETTLED.max(waits.ceil() as u32 + 2);
        loop {
            self.check_interrupted()?;
            self.link
                .send(b"?")
                .map_err(|source| self.connect_error(source))?;
            let until = self.now() + SETTLE_POLL;
            while let Some(reply) = self
                .link
                .reply_before(until)
                .map_err(|source| self.connect_error(source))?
            {
                match reply {
                    Reply::Banner(text) => {
                        self.hear_out()?;
                        return Ok(Found::Anew(text));
                    }
                    Reply::Status(status) => {
                        quiet_until = self.now() + self.options.silence;
                        match status.state {
                            MachineState::Idle => standing += 1,
                            MachineState::Alarm => return Ok(Found::Lost),
                            MachineState::Run
                            | MachineState::Jog
                            | MachineState::Home
                            | MachineState::Hold(false)
                            | MachineState::Door(false) => {
                                standing = 0;
                                if !std::mem::replace(&mut told, true) {
                                    self.progress.note(
                                        "the machine still runs the lines that it had: waiting until it stands",
                                    );
                                }
                            }
                            MachineState::Hold(true)
                            | MachineState::Door(true)
                            | MachineState::Check
                            | MachineState::Sleep => {
                                // Whatever it waits for, it need not burn meanwhile.
                                if self.job.is_torch() {
                                    self.link
                                        .send(&[DOOR])
                                        .map_err(|source| self.connect_error(source))?;
                                }
                                let then = if self.job.is_torch() {
                                    "reset it (to let it go on would light the torch where it stands)"
                                } else {
                                    "close its door, or reset it"
                                };
                                return Err(SendError::NotReady {
                                    why: format!(
                                        "the machine is paused ({:?}): {then}, and resume again",
                                        status.state
                                    ),
                                });
                            }
                        }
                    }
                    _ => {}
                }
            }
            if standing >= settled {
                return Ok(Found::Standing);
            }
            if self.now() >= quiet_until && standing == 0 {
                return Ok(Found::Lost);
            }
        }
    }
}
