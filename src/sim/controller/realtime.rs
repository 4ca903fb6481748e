//! What acts at once, in the middle of anything: hold, door, resume, stop of the output, reset.

use super::{Controller, Line, Running, State};
use crate::planner::Profile;
use crate::sim::burnt::Light;
use crate::sim::modal::Action;

impl Controller {
    pub(super) fn hold(&mut self, door: bool) {
        let moving = self.running.is_some();
        match self.state {
            State::Idle | State::Run => self.held_since_s = self.now_s,
            State::Hold { .. } if door => {}
            _ => return,
        }
        if let State::Hold { standing } = self.state {
            self.state = State::Door { standing };
            if standing {
                self.rest(Light::DARK);
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
        let door = matches!(self.state, State::Door { .. });
        self.state = if door {
            State::Door { standing: true }
        } else {
            State::Hold { standing: true }
        };
        self.before_hold = self.at_rest;
        // Without laser mode a hold leaves the output as it is, as for a mill; the door always switches it off.
        let light = if self.settings.laser_mode || door {
            Light::DARK
        } else {
            self.at_rest
        };
        let head = self.on_bed(self.position);
        self.shine(head, light);
        self.idle_delay();
    }

    pub(super) fn resume(&mut self) {
        if !matches!(
            self.state,
            State::Hold { standing: true } | State::Door { standing: true }
        ) {
            return;
        }
        self.at_rest = self.before_hold;
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

    /// 0x9E: in a hold at rest, the output off, or on again.
    pub(super) fn spindle_stop(&mut self) {
        if self.state == (State::Hold { standing: true }) {
            let light = if self.bed.lit() {
                Light::DARK
            } else {
                self.before_hold
            };
            let head = self.on_bed(self.position);
            self.shine(head, light);
        }
    }

    pub(super) fn soft_limit_alarm(&mut self) {
        self.soft_limit_hit = false;
        self.stop_motion();
        self.forget_program();
        self.state = State::Critical;
        self.say("ALARM:2");
        self.say("[MSG:Reset to continue]");
    }

    /// The motors stop at once, and the beam goes out.
    pub(super) fn stop_motion(&mut self) {
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
        self.reports = 0;
        self.modal.reset(self.position);
        self.queue.set_limits(self.settings.limits());
    }

    pub(super) fn soft_reset(&mut self) {
        let lost = matches!(
            self.state,
            State::Run
                | State::Home
                | State::Hold { standing: false }
                | State::Door { standing: false }
        );
        let locked = matches!(self.state, State::Alarm | State::Critical);
        self.restart();
        if lost {
            self.say("ALARM:3");
        }
        self.state = if lost || locked {
            State::Alarm
        } else {
            State::Idle
        };
        self.banner();
    }
}
