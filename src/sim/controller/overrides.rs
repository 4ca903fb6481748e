//! Overrides: a person's hand on the rates and on the power while a job runs.

use super::{Controller, Cut, State};
use crate::planner::Block;
use crate::sim::burnt::Light;
use crate::sim::modal::Spindle;

/// Percent of what the program says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Overrides {
    pub feed: u16,
    pub rapid: u16,
    pub spindle: u16,
}

impl Default for Overrides {
    fn default() -> Self {
        Self {
            feed: 100,
            rapid: 100,
            spindle: 100,
        }
    }
}

impl Overrides {
    /// After one of the bytes 0x90 to 0x9D.
    fn after(self, byte: u8) -> Self {
        let step = |now: u16, code: u8| match code {
            0 => 100,
            1 => (now + 10).min(200),
            2 => now.saturating_sub(10).max(10),
            3 => (now + 1).min(200),
            _ => now.saturating_sub(1).max(10),
        };
        let mut next = self;
        match byte {
            0x90..=0x94 => next.feed = step(self.feed, byte - 0x90),
            0x95 => next.rapid = 100,
            0x96 => next.rapid = 50,
            0x97 => next.rapid = 25,
            0x99..=0x9d => next.spindle = step(self.spindle, byte - 0x99),
            _ => {}
        }
        next
    }

    /// The speed wanted along a block, mm/s.
    pub fn speed_mm_s(self, block: &Block, cut: &Cut) -> f64 {
        let share = |percent: u16| f64::from(percent) / 100.0;
        match cut.drive.rate_mm_min {
            Some(rate) => {
                let feed = if cut.fixed_feed {
                    1.0
                } else {
                    share(self.feed)
                };
                (rate * feed).max(1.0).min(block.fastest_mm_s * 60.0) / 60.0
            }
            None => block.fastest_mm_s * share(self.rapid),
        }
    }
}

impl Controller {
    /// One of the bytes 0x90 to 0x9D.
    pub(super) fn override_byte(&mut self, byte: u8) {
        let before = self.overrides;
        self.overrides = before.after(byte);
        if self.overrides == before {
            return;
        }
        self.overrides_in = 0;
        if (self.overrides.feed, self.overrides.rapid) != (before.feed, before.rapid) {
            self.new_speeds();
        }
        if self.overrides.spindle != before.spindle {
            self.override_output();
        }
    }

    /// Every block gets the speed that holds now, from the place where the head is.
    pub(super) fn new_speeds(&mut self) {
        let done_mm = self.running.map(|running| {
            let (along, speed) = running.profile.at(self.now_s - running.start_s);
            let done_mm = running.behind_mm + along;
            let whole = self.queue.front().map_or(0.0, |(_, cut)| cut.length_mm);
            self.queue.set_front(whole - done_mm, speed);
            done_mm
        });
        let overrides = self.overrides;
        self.queue
            .set_nominal(|block, cut| overrides.speed_mm_s(block, cut));
        if let Some(done_mm) = done_mm
            && !self.braking()
        {
            self.begin_block(done_mm);
        }
    }

    /// The S word that reaches the output: with its override, between `$31` and `$30`.
    pub(super) fn output_word(&self, s: f64) -> f64 {
        if s <= 0.0 {
            return 0.0;
        }
        let wanted = s * f64::from(self.overrides.spindle) / 100.0;
        wanted.max(self.settings.s_min).min(self.settings.s_max)
    }

    /// The output of a standing machine from now on. With dynamic power in laser mode that is none.
    pub(super) fn set_output(&mut self, spindle: Spindle, s: f64) {
        let light = self.light(spindle, s, false);
        let dark = spindle == Spindle::Off || light.dynamic;
        self.rest(if dark { Light::DARK } else { light });
        self.accessory_changed();
    }

    /// Mist and flood from now on.
    pub(super) fn set_air(&mut self, air: [bool; 2]) {
        self.air = air;
        self.accessory_changed();
    }

    /// The next report tells what is switched on.
    fn accessory_changed(&mut self) {
        if self.settings.flavour.tells_accessories_apart() {
            self.accessory_news = true;
        } else {
            self.overrides_in = 0;
        }
    }

    /// 0xA0: air on or off by hand.
    pub(super) fn toggle_flood(&mut self) {
        if matches!(
            self.state,
            State::Idle | State::Run | State::Hold { .. } | State::Jog
        ) {
            self.modal.flood ^= true;
            self.set_air([self.modal.mist, self.modal.flood]);
        }
    }
}
