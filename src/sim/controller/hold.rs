//! Standing still in the middle of a job: hold, door, resume, and the stop of the output by hand.
//!
//! A hold brakes; only when the head stands does anything happen to the output. Without laser mode (`$32=0`) a hold
//! leaves it on, as for a mill: 0x9E switches it off and on again while held, the door always switches it off, and both
//! light it again before the head moves on. In laser mode the firmware sends itself that 0x9E at every hold.

use super::{Controller, Running, State};
use crate::planner::Profile;
use crate::sim::flavour::Flavour;
use crate::sim::modal::{Action, Spindle};

/// What 0x9E has come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// The output is as the program wants it.
    None,
    /// It came before the head stood.
    Wanted,
    /// The output is off.
    Done,
}

/// What a hold has found, and what is put back after it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Restore {
    pub spindle: Spindle,
    pub s: f64,
    /// Mist and flood.
    pub air: [bool; 2],
}

impl Restore {
    pub const NOTHING: Self = Self {
        spindle: Spindle::Off,
        s: 0.0,
        air: [false; 2],
    };
}

impl Controller {
    pub(super) fn hold(&mut self, door: bool) {
        if door {
            self.door_message();
        }
        match self.state {
            State::Idle | State::Run => self.held_since_s = self.now_s,
            State::Hold { standing } if door => {
                self.state = State::Door { standing };
                if standing {
                    self.de_energise();
                }
                return;
            }
            State::Home if door => return self.homing_fails(7),
            State::Jog if door => self.jog_cancelled = true,
            State::Jog => return self.cancel_jog(),
            // Opened again while the output comes back.
            State::Restoring if door => {
                self.state = State::Door { standing: true };
                return self.de_energise();
            }
            _ => return,
        }
        self.state = if door {
            State::Door { standing: false }
        } else {
            State::Hold { standing: false }
        };
        if self.running.is_some() {
            self.brake();
        } else {
            self.held();
        }
    }

    fn door_message(&mut self) {
        let silent = match self.state {
            State::Alarm | State::Critical | State::Check | State::Home => true,
            // It tells only what is new.
            State::Door { .. } | State::Sleep => self.settings.flavour == Flavour::GrblHal,
            _ => false,
        };
        if !silent {
            self.message("Check Door");
        }
    }

    /// 0x85, or a hold in a jog: it comes to rest, and what was planned is forgotten.
    pub(super) fn cancel_jog(&mut self) {
        if self.state == State::Jog && !self.jog_cancelled {
            self.jog_cancelled = true;
            self.brake();
        }
    }

    /// From now on the running block slows down.
    pub(super) fn brake(&mut self) {
        if let (Some(running), Some((block, cut))) = (self.running, self.queue.front()) {
            let (along, speed) = running.profile.at(self.now_s - running.start_s);
            let behind_mm = running.behind_mm + along;
            self.running = Some(Running {
                profile: Profile::braking(
                    (cut.length_mm - behind_mm).max(0.0),
                    speed,
                    block.acceleration_mm_s2,
                ),
                start_s: self.now_s,
                block_start_s: running.block_start_s,
                behind_mm,
            });
        }
    }

    /// A hold has come to rest.
    pub(super) fn held(&mut self) {
        if self.soft_limit_hit {
            self.soft_limit_alarm();
            return;
        }
        if std::mem::take(&mut self.jog_cancelled) {
            self.queue.clear();
            self.actions
                .retain(|action| !matches!(action, Action::Jog { .. }));
            self.modal.position = self.position;
            if self.state == State::Jog {
                self.state = State::Idle;
                self.rest(self.at_rest);
                return self.idle_delay();
            }
        }
        if self.state == State::Run {
            // Probing has found something.
            self.queue.clear();
            self.state = State::Idle;
            self.rest(self.at_rest);
            return self.idle_delay();
        }
        self.restore = self.found();
        self.rest(self.at_rest);
        if matches!(self.state, State::Door { .. }) {
            self.state = State::Door { standing: true };
            self.de_energise();
        } else {
            self.state = State::Hold { standing: true };
            let asked = std::mem::replace(&mut self.stop, Stop::None) == Stop::Wanted;
            let laser = self.settings.laser_mode;
            // Of two at once the 32-bit firmware takes one.
            let once = asked && self.settings.flavour == Flavour::GrblHal;
            for _ in 0..usize::from(asked) + usize::from(laser && !once) {
                self.toggle_stop();
            }
        }
        self.idle_delay();
    }

    /// What the next block wants, or where there is none what was last said.
    fn found(&self) -> Restore {
        match self.queue.front() {
            Some((_, cut)) => Restore {
                spindle: cut.drive.spindle,
                s: cut.drive.s,
                air: self.air,
            },
            None => Restore {
                spindle: self.spindle,
                s: self.spindle_s,
                air: [self.modal.mist, self.modal.flood],
            },
        }
    }

    /// 0x9E: heeded in a hold only, and by a program that has an output on.
    pub(super) fn spindle_stop(&mut self) {
        match self.state {
            State::Hold { standing: true } if self.resume_s.is_none() => self.toggle_stop(),
            // Another one before it stands changes nothing.
            State::Hold { standing: false } => self.stop = Stop::Wanted,
            _ => {}
        }
    }

    /// The output off, or on again, while the head stands.
    fn toggle_stop(&mut self) {
        if self.spindle == Spindle::Off {
            self.stop = Stop::None;
        } else if self.stop == Stop::Done {
            self.message("Restoring spindle");
            self.stop = Stop::None;
            // GRBL lights a laser here too, with M3, although it stands: its "set when the cycle starts" is looked at
            // by the hold itself. grblHAL leaves it dark.
            if !self.settings.laser_mode || self.settings.flavour != Flavour::GrblHal {
                self.set_output(self.restore.spindle, self.restore.s);
            }
        } else {
            self.set_output(Spindle::Off, 0.0);
            self.stop = Stop::Done;
        }
    }

    /// The spindle override has changed.
    pub(super) fn override_output(&mut self) {
        match self.state {
            State::Idle => self.set_output(self.spindle, self.spindle_s),
            State::Hold { standing: true } if self.stop == Stop::None => {
                self.set_output(self.restore.spindle, self.restore.s);
            }
            _ if self.running.is_some() => self.light_block(),
            _ => {}
        }
    }

    /// What an open door does: everything off.
    fn de_energise(&mut self) {
        (self.stop, self.resume_s) = (Stop::None, None);
        self.set_output(Spindle::Off, 0.0);
        self.set_air([false; 2]);
    }

    pub(super) fn resume(&mut self) {
        match self.state {
            State::Hold { standing: true } if self.resume_s.is_none() => self.resume_hold(),
            State::Door { standing: true } => {
                self.state = State::Restoring;
                self.air_waits = self.modal.mist || self.modal.flood;
                self.resume_s = Some(self.now_s);
                // A spindle, or a torch, comes back before the motion, and gets time to run up.
                if self.spindle != Spindle::Off && !self.settings.laser_mode {
                    self.set_output(self.restore.spindle, self.restore.s);
                    let [spindle_s, _] = self.settings.flavour.door_delays_s();
                    self.resume_s = Some(self.now_s + spindle_s);
                }
            }
            _ => {}
        }
    }

    fn resume_hold(&mut self) {
        let stopped = std::mem::replace(&mut self.stop, Stop::None) == Stop::Done;
        if !stopped {
            return self.move_on();
        }
        self.message("Restoring spindle");
        // A laser is lit by the motion that follows, and stays dark where none does.
        if self.settings.laser_mode {
            return self.move_on();
        }
        self.set_output(self.restore.spindle, self.restore.s);
        let [spindle_s, _] = self.settings.flavour.door_delays_s();
        if self.settings.flavour == Flavour::GrblHal && self.restore.spindle != Spindle::Off {
            self.resume_s = Some(self.now_s + spindle_s);
        } else {
            self.move_on();
        }
    }

    /// The time that the output gets has passed; false if it has not.
    pub(super) fn resumed(&mut self) -> bool {
        if self.resume_s.is_none_or(|at| at > self.now_s) {
            return false;
        }
        if std::mem::take(&mut self.air_waits) {
            self.set_air(self.restore.air);
            let [_, air_s] = self.settings.flavour.door_delays_s();
            self.resume_s = Some(self.now_s + air_s);
        } else {
            self.move_on();
        }
        true
    }

    /// Out of a hold.
    fn move_on(&mut self) {
        self.resume_s = None;
        if let Some(Action::Dwell {
            until_s: Some(until),
            ..
        }) = self.actions.front_mut()
        {
            *until += self.now_s - self.held_since_s;
        }
        if self.found_something() {
            self.queue.clear();
        }
        if self.queue.is_empty() {
            self.state = State::Idle;
        } else {
            self.state = State::Run;
            self.begin_first();
        }
    }
}
