//! What acts at once, in the middle of anything: hold, door, resume, stop of the output, reset.

use super::overrides::Overrides;
use super::{Controller, Line, Running, State};
use crate::planner::Profile;
use crate::sim::burnt::Light;
use crate::sim::flavour::Flavour;
use crate::sim::modal::{Action, Spindle};

/// How long a spindle gets to run up when the door is closed again, s.
const RESTORE_S: f64 = 4.0;

impl Controller {
    pub(super) fn hold(&mut self, door: bool) {
        let moving = self.running.is_some();
        match self.state {
            State::Idle | State::Run => self.held_since_s = self.now_s,
            State::Hold { .. } if door => {}
            State::Jog if door => self.jog_cancelled = true,
            State::Jog => return self.cancel_jog(),
            State::Restoring if door => {
                self.state = State::Door { standing: true };
                let head = self.on_bed(self.position);
                self.shine(head, Light::DARK);
                return;
            }
            _ => return,
        }
        if let State::Hold { standing } = self.state {
            self.state = State::Door { standing };
            if standing {
                let head = self.on_bed(self.position);
                self.shine(head, Light::DARK);
            }
            return;
        }
        self.state = if door {
            State::Door { standing: false }
        } else {
            State::Hold { standing: false }
        };
        if !moving {
            self.held();
            return;
        }
        self.brake();
    }

    /// 0x85, or a hold in a jog: it comes to rest, and what was planned is forgotten.
    pub(super) fn cancel_jog(&mut self) {
        if self.state == State::Jog && !self.jog_cancelled {
            self.jog_cancelled = true;
            self.brake();
        }
    }

    /// From now on the running block slows down.
    fn brake(&mut self) {
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
        let door = matches!(self.state, State::Door { .. });
        self.state = if door {
            State::Door { standing: true }
        } else {
            State::Hold { standing: true }
        };
        self.before_hold = self.at_rest;
        // Without laser mode a hold leaves the output as it is, as for a mill; the door always switches it off.
        let stop = std::mem::take(&mut self.stop_output);
        let light = if self.settings.laser_mode || door || stop {
            Light::DARK
        } else {
            self.at_rest
        };
        let head = self.on_bed(self.position);
        self.shine(head, light);
        self.idle_delay();
    }

    pub(super) fn resume(&mut self) {
        match self.state {
            State::Hold { standing: true } => self.move_on(),
            State::Door { standing: true } => {
                let output = self.output_wanted();
                if self.settings.laser_mode || output == Light::DARK {
                    return self.move_on();
                }
                // A spindle, or a torch, comes back before the motion, and gets time to run up.
                self.state = State::Restoring;
                let head = self.on_bed(self.position);
                self.shine(head, output);
                self.restored_s = self.now_s + RESTORE_S;
            }
            _ => {}
        }
    }

    /// What the program wants of the output where the head stands now.
    fn output_wanted(&self) -> Light {
        match self.queue.front() {
            Some((_, cut)) if cut.drive.s > 0.0 && cut.drive.spindle != Spindle::Off => Light {
                s: self.output_word(cut.drive.s),
                spindle: cut.drive.spindle,
                rapid: false,
            },
            Some(_) => Light::DARK,
            None => self.before_hold,
        }
    }

    /// Out of a hold.
    pub(super) fn move_on(&mut self) {
        self.at_rest = self.before_hold;
        self.overrides_in = 0;
        if let Some(Action::Dwell {
            until_s: Some(until),
            ..
        }) = self.actions.front_mut()
        {
            *until += self.now_s - self.held_since_s;
        }
        if self.queue.is_empty() {
            self.state = State::Idle;
            self.rest(self.at_rest);
        } else {
            self.state = State::Run;
            self.begin_first();
        }
    }

    /// The beam goes out, and the motors stop at once.
    pub(super) fn stop_motion(&mut self) {
        // First the beam: the head runs on dark.
        let head = self.head_mm();
        self.shine(head, Light::DARK);
        self.halt();
        self.rest(Light::DARK);
    }

    /// The motors get no more steps. From a motion the head runs on by itself, as far as it would have taken to brake,
    /// and the controller does not know: its position is lost. A real head stops somewhere between; this is the worst.
    pub(super) fn halt(&mut self) {
        let (place, speed) = self.whereabouts();
        if let (true, Some((block, _))) = (self.running.is_some(), self.queue.front()) {
            let slide_mm = speed * speed / (2.0 * block.acceleration_mm_s2);
            for (zero, along) in self.zero.iter_mut().zip(block.direction) {
                *zero += along * slide_mm;
            }
        }
        self.position = place;
        self.running = None;
        self.queue.clear();
    }

    pub(super) fn forget_program(&mut self) {
        self.actions.clear();
        self.answer = None;
        self.reset_pending = false;
        self.starting.clear();
        self.ready = None;
        self.line = Line::default();
        self.report_wanted = false;
        self.busy_until_s = self.now_s;
    }

    /// Everything but the state and the wires back to how it starts.
    pub(super) fn restart(&mut self) {
        self.stop_motion();
        self.forget_program();
        self.receive.clear();
        self.soft_limit_hit = false;
        self.before_hold = Light::DARK;
        (self.jog_cancelled, self.stop_output) = (false, false);
        (self.offset_in, self.overrides_in) = (0, 0);
        self.overrides = Overrides::default();
        (self.latched, self.line_end) = (None, None);
        self.modal.reset(self.position);
        self.queue.set_limits(self.settings.limits());
    }

    pub(super) fn soft_reset(&mut self) {
        let lost = self.braking() || matches!(self.state, State::Run | State::Home | State::Jog);
        let locked = matches!(self.state, State::Alarm | State::Critical | State::Sleep);
        self.restart();
        if lost {
            self.raise(3);
        }
        self.state = if lost || locked {
            State::Alarm
        } else {
            State::Idle
        };
        self.boot();
    }

    /// Tells an alarm.
    pub(super) fn raise(&mut self, number: u8) {
        self.alarm = number;
        if self.settings.flavour == Flavour::FluidNc {
            let name = match number {
                1 => "Hard Limit",
                2 => "Soft Limit",
                _ => "Abort Cycle",
            };
            self.message(&format!("ALARM: {name}"));
        }
        self.say(&format!("ALARM:{number}"));
    }

    /// An alarm after which nothing is done until a reset.
    pub(super) fn critical(&mut self, number: u8) {
        self.state = State::Critical;
        self.raise(number);
        self.message("Reset to continue");
    }

    /// The banner, and what follows it: the lock, or the startup lines.
    pub(super) fn boot(&mut self) {
        self.say("");
        self.say(self.settings.flavour.banner());
        if self.state == State::Alarm {
            self.message("'$H'|'$X' to unlock");
        } else {
            self.starting = self
                .startup
                .iter()
                .filter(|l| !l.is_empty())
                .cloned()
                .collect();
        }
    }
}
