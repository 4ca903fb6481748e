//! Power, and what takes the controller down without asking it.
//!
//! What survives: the settings and the coordinate systems in its memory, the sheet with its burns, and the head, which
//! stays where it is. What does not: everything else, above all the controller's knowledge of where the head stands.

use super::{Controller, State};
use crate::sim::faults::Mishap;

/// Whether anybody is at home.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Life {
    /// As it should be.
    Running,
    /// The firmware hangs: no answer, no motion, and every output as it was at that moment. Only a [`Controller::reboot`]
    /// or the power switch helps.
    Hung,
    /// Without power: no answer, no motion, no beam.
    Off,
}

impl Controller {
    /// Something will happen to it at this time, s. A cable is none of its own: [`Mishap::Unplug`] does nothing here.
    pub fn schedule(&mut self, at_s: f64, mishap: Mishap) {
        self.due.push((at_s, mishap));
    }

    /// Something happens to it now.
    pub fn suffer(&mut self, mishap: Mishap) {
        match mishap {
            Mishap::Unplug => {}
            Mishap::PowerLoss => self.power_off(),
            Mishap::PowerReturns(shift_mm) => self.power_on(shift_mm),
            Mishap::Reboot => self.reboot(),
            Mishap::Hang => self.hang(),
            Mishap::LimitSwitch => self.limit_switch(),
        }
    }

    /// Whether it runs, hangs or has no power.
    pub fn life(&self) -> Life {
        self.life
    }

    /// The power is cut: everything stops, nothing is heard any more and the beam is off.
    pub fn power_off(&mut self) {
        self.break_off();
        self.outgoing.clear();
        self.receive.clear();
        self.life = Life::Off;
    }

    /// The power is back: the controller starts with its banner and calls the place where the head stands zero.
    /// `shift_mm` is how far the head was moved on the bed meanwhile: by hand, or by its own weight. Without a
    /// [`Self::power_off`] before it, this is the switch flipped off and on.
    pub fn power_on(&mut self, shift_mm: [f64; 3]) {
        if self.life != Life::Off {
            self.power_off();
        }
        self.shift_head(shift_mm);
        self.reboot();
    }

    /// Somebody moves the head by hand, by so much, mm, and the controller does not notice. At rest only.
    pub fn push_head(&mut self, shift_mm: [f64; 3]) {
        if self.running.is_none() && self.homing.is_none() {
            self.shift_head(shift_mm);
        }
    }

    /// Where the machine has switches its frame ends at them, and no hand moves the head further.
    fn shift_head(&mut self, shift_mm: [f64; 3]) {
        for (k, shift) in shift_mm.into_iter().enumerate() {
            let mut head = self.zero[k] + self.position[k] + shift;
            if self.settings.homing {
                let ([low, high], switch) = (self.settings.range_mm(k), self.settings.switch_mm(k));
                head = head.clamp(low.min(switch), high.max(switch));
            }
            self.zero[k] = head - self.position[k];
        }
    }

    /// The controller starts anew, without an alarm: its reset line was pulled (as by DTR when the port is opened), or
    /// its supply dipped. The head stays where it is, but the controller has forgotten where that is, and calls it
    /// zero.
    pub fn reboot(&mut self) {
        self.break_off();
        self.outgoing.clear();
        (self.outgoing_free_s, self.incoming_free_s) = (self.now_s, self.now_s);
        self.deaf_until_s = self.now_s;
        self.life = Life::Running;
        self.zero = self.head_mm();
        self.position = [0.0; 3];
        self.restart();
        self.state = if self.settings.homing {
            State::Alarm
        } else {
            State::Idle
        };
        self.alarm = if self.settings.homing { 11 } else { 0 };
        self.boot();
    }

    /// The firmware hangs from now on, with the beam as it is now.
    pub fn hang(&mut self) {
        if self.life != Life::Running {
            return;
        }
        let light = self.light;
        self.halt();
        let head = self.head_mm();
        self.shine(head, light);
        self.forget_program();
        self.incoming.clear();
        self.receive.clear();
        self.life = Life::Hung;
    }

    /// A limit switch closes: the firmware stops at once, beam off, and wants a reset (ALARM:1). It does not matter
    /// here whether `$21` is set: the wire is what it is.
    pub fn limit_switch(&mut self) {
        if self.life != Life::Running {
            return;
        }
        self.stop_motion();
        self.forget_program();
        self.receive.clear();
        self.critical(1);
    }

    /// A host opens the port: what was said to nobody is gone, and boards whose reset hangs on DTR start anew.
    pub fn port_opened(&mut self, resets: bool) {
        self.outgoing.clear();
        if resets && self.life != Life::Off {
            self.reboot();
        }
    }

    /// Everything ends where it is, in the middle of a motion if need be.
    fn break_off(&mut self) {
        self.incoming.clear();
        self.stop_motion();
        self.forget_program();
    }
}
