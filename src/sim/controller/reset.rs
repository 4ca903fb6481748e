//! What ends everything: a reset, an alarm; and how the controller starts.

use super::hold::Stop;
use super::overrides::Overrides;
use super::{Controller, Line, State};
use crate::sim::burnt::Light;
use crate::sim::flavour::Flavour;
use crate::sim::modal::Spindle;

impl Controller {
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
        if let Some(homing) = self.homing.take() {
            let head = homing.head(self.now_s);
            (self.position, _) = homing.belief(self.now_s, self.position);
            self.zero = std::array::from_fn(|k| head[k] - self.position[k]);
        }
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
        self.probing = None;
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
        (self.jog_cancelled, self.stop, self.resume_s) = (false, Stop::None, None);
        (self.spindle, self.spindle_s, self.air) = (Spindle::Off, 0.0, [false; 2]);
        (self.offset_in, self.overrides_in, self.accessory_news) = (0, 0, false);
        self.probed = ([0.0; 3], false);
        self.overrides = Overrides::default();
        (self.latched, self.line_end) = (None, None);
        self.modal.reset(self.position);
        self.queue.set_limits(self.settings.limits());
    }

    pub(super) fn soft_reset(&mut self) {
        if self.homing.is_some() {
            return self.homing_fails(6);
        }
        let lost = self.braking() || matches!(self.state, State::Run | State::Jog);
        let locked = matches!(self.state, State::Alarm | State::Critical | State::Sleep);
        // GRBL answers the line that waited, on its way out of it: an ok for what was never done.
        let waited = self.answer.take();
        let g92 = self.modal.g92;
        self.restart();
        if self.settings.flavour == Flavour::GrblHal {
            // Forgotten with the power only.
            self.modal.g92 = g92;
        }
        if lost {
            self.raise(3);
        }
        if let Some(answer) = waited.filter(|_| self.settings.flavour == Flavour::Grbl) {
            self.say(&answer);
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
                4 => "Probe Fail Initial",
                5 => "Probe Fail Contact",
                6 => "Homing Fail Reset",
                7 => "Homing Fail Door",
                8 => "Homing Fail Pulloff",
                9 => "Homing Fail Approach",
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
