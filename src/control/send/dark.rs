//! A torch that is held must not burn where it stands.
//!
//! In laser mode a hold puts the beam out by itself. Without it (`$32=0`, as for a torch) the output stays as it is: a hold
//! pressed at the machine, here, or an M0 would leave the arc on one spot. So whenever a report shows the machine held
//! with its output on, it is switched off: by the spindle stop (0x9E), after which the machine goes on where it was; if
//! that is not seen to work, by the safety door (0x84), which always switches it off but makes the controller stand for
//! 4 s with the torch on when it is resumed; if that is not seen to work either, the job is stopped.
//!
//! 0x9E is a toggle: it is sent once, and only after a report that shows the output on. What a report does not tell is not
//! believed: the power in it must be 0 and the accessories (`A:`) without the spindle.

use std::io;
use std::time::Duration;

use super::reason::StopReason;
use super::{Sender, Trouble};
use crate::control::reply::{MachineState, Status};

/// In a hold: the output off, or on again.
pub(super) const SPINDLE_STOP: u8 = 0x9e;
/// The safety door: brakes, and then switches the output off, whatever it was before.
pub(super) const DOOR: u8 = 0x84;

/// How long a report may still show the output on after a byte that switches it off, and how long may pass without any
/// report that tells. GRBL tells a change in the next report or the one after it, and everything in every twentieth.
const STILL_ON: Duration = Duration::from_millis(300);
const UNTOLD: Duration = Duration::from_secs(1);
/// How long a resumed controller may tell Hold with the torch on: the way of a byte and a report, and where the firmware gives
/// a spindle time to run up after every hold, as grblHAL does, that time.
const ON_ITS_WAY: Duration = Duration::from_millis(300);
const RUN_UP: Duration = Duration::from_millis(5500);
/// How often the status is asked for until it is dark.
pub(super) const DARK_POLL: Duration = Duration::from_millis(25);

/// What has been done about the output in this hold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Step {
    /// It moves, or has just come to rest.
    #[default]
    Moving,
    /// It stands, and no report has told yet whether the output is on; since when.
    Standing(Duration),
    /// The spindle stop was sent.
    Stopped(Duration),
    /// The door was sent.
    Door(Duration),
    /// It was seen to be off.
    Dark,
    /// The person has resumed it, and the controller may give the torch time before it moves.
    Resumed(Duration),
}

/// The watch over a held output.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watch {
    step: Step,
    /// It brakes, or was just told to.
    braking: bool,
    /// How long it may stand lit once it was resumed.
    run_up: Duration,
}

impl Watch {
    /// Of this controller, that tells how long a spindle gets to run up, or does not.
    pub fn of(firmware: &str, run_up_s: Option<f64>) -> Self {
        let run_up = match run_up_s {
            Some(s) => Duration::from_secs_f64(s.clamp(0.0, 60.0)) + ON_ITS_WAY,
            None if firmware.to_ascii_lowercase().contains("grblhal") => RUN_UP,
            None => ON_ITS_WAY,
        };
        Self {
            run_up,
            ..Self::default()
        }
    }

    /// The person pauses it.
    pub fn paused(&mut self) {
        // In one that is dark already a pause changes nothing.
        if matches!(self.step, Step::Moving | Step::Resumed(_)) {
            (self.step, self.braking) = (Step::Moving, true);
        }
    }

    /// The person resumes it.
    pub fn resumed(&mut self, now: Duration) {
        if self.step == Step::Dark {
            self.step = Step::Resumed(now);
        }
    }

    /// The machine is held, and it is not known yet that its output is off.
    pub fn is_waiting(self) -> bool {
        self.braking
            || matches!(
                self.step,
                Step::Standing(_) | Step::Stopped(_) | Step::Door(_)
            )
    }
}

impl Status {
    /// Whether this report proves that the output is on, or off: none if it does not tell.
    pub(super) fn lit(&self) -> Option<bool> {
        if self.output_on == Some(true) || self.s.is_some_and(|s| s != 0.0) {
            return Some(true);
        }
        self.output_on
    }
}

impl Sender<'_> {
    /// Looks at a report of a torch's machine, and switches the output off if it is held with it.
    pub(super) fn keep_dark(&mut self, status: &Status) -> Result<(), Trouble> {
        if !self.job.is_torch() {
            return Ok(());
        }
        let door = match status.state {
            MachineState::Hold(true) => false,
            MachineState::Door(true) => true,
            state => {
                self.watch.step = Step::Moving;
                self.watch.braking =
                    matches!(state, MachineState::Hold(false) | MachineState::Door(false));
                return Ok(());
            }
        };
        self.watch.braking = false;
        let now = self.now();
        let late = |since: Duration, than: Duration| now.saturating_sub(since) > than;
        let lit = status.lit();
        let next = match (self.watch.step, lit) {
            (Step::Dark, Some(false) | None) => return Ok(()),
            // grblHAL lights the torch and tells Hold for as long as a spindle gets to run up.
            (Step::Resumed(since), _) if !late(since, self.watch.run_up) => return Ok(()),
            (_, Some(false)) => {
                self.progress
                    .note("the machine tells that the torch is off while it is paused");
                Step::Dark
            }
            (Step::Moving, None) => Step::Standing(now),
            (Step::Moving | Step::Standing(_) | Step::Dark, Some(true)) if !door => {
                self.link.send(&[SPINDLE_STOP])?;
                Step::Stopped(now)
            }
            (Step::Moving | Step::Standing(_) | Step::Dark | Step::Resumed(_), Some(true)) => {
                self.by_door(now)?
            }
            (Step::Standing(since), None) if late(since, UNTOLD) => self.by_door(now)?,
            (Step::Stopped(since), Some(true)) if late(since, STILL_ON) => self.by_door(now)?,
            (Step::Stopped(since), None) if late(since, UNTOLD) => self.by_door(now)?,
            (Step::Door(since), _) if late(since, UNTOLD) => {
                return Err(Trouble::Stop(StopReason::HeldOn));
            }
            (step, _) => step,
        };
        self.watch.step = next;
        Ok(())
    }

    fn by_door(&mut self, now: Duration) -> io::Result<Step> {
        self.progress.note(
            "the torch was not seen to go off in the pause, so the safety door is used: when the machine is resumed it \
             lights the torch and stands for 4 s before it moves. Better end the job (Ctrl-C) and go on with `kagome resume`",
        );
        self.link.send(&[DOOR])?;
        Ok(Step::Door(now))
    }
}
