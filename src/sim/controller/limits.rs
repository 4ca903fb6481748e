//! The ends of the travel: soft limits before a motion, switches in one.

use super::{Controller, State};
use crate::planner::Profile;
use crate::sim::settings::Settings;

impl Controller {
    /// A machine that was switched on, homed, and stands where that has put it, at machine zero. (Where nothing homes, one
    /// that was switched on.)
    pub fn homed_at_zero(settings: Settings) -> Self {
        let mut new = Self::new(settings);
        if new.state == State::Alarm {
            new.state = State::Idle;
        }
        new
    }

    /// Whether a place lies between the ends of every axis.
    pub(super) fn within_travel(&self, target: [f64; 3]) -> bool {
        target.iter().enumerate().all(|(k, &t)| {
            let [low, high] = self.settings.range_mm(k);
            t >= low && t <= high
        })
    }

    /// A motion would leave the travel (ALARM:2): what moves is brought to rest first.
    pub(super) fn beyond_travel(&mut self) {
        self.actions.clear();
        self.answer = None;
        self.soft_limit_hit = true;
        if self.running.is_some() {
            self.hold(false);
        } else {
            self.soft_limit_alarm();
        }
    }

    pub(super) fn soft_limit_alarm(&mut self) {
        self.soft_limit_hit = false;
        self.stop_motion();
        self.forget_program();
        self.critical(2);
    }

    /// When the head reaches a switch at the end of its travel, on the way that it goes now, s. There are switches
    /// where there is homing, and `$21` listens to them. A head that has passed one does not press it again.
    pub(super) fn switch_s(&self) -> Option<f64> {
        if !(self.settings.hard_limits && self.settings.homing) {
            return None;
        }
        let running = self.running.as_ref()?;
        let (_, cut) = self.queue.front()?;
        let (from, to) = (self.on_bed(cut.start), self.on_bed(cut.end));
        let place_mm = (0..3)
            .filter_map(|k| {
                let [low, high] = self.settings.range_mm(k);
                let end = if to[k] > high {
                    high
                } else if to[k] < low {
                    low
                } else {
                    return None;
                };
                let part = (end - from[k]) / (to[k] - from[k]);
                let place_mm = part * cut.length_mm;
                (part.is_finite() && place_mm > running.behind_mm).then_some(place_mm)
            })
            .fold(f64::INFINITY, f64::min);
        self.passes_s(place_mm - running.behind_mm)
    }

    /// When the head has gone this far along what runs now, mm, s; none if it does not come so far.
    pub(super) fn passes_s(&self, along_mm: f64) -> Option<f64> {
        let running = self.running.as_ref()?;
        if along_mm > running.profile.length_mm() {
            return None;
        }
        Some(running.start_s + time_of(&running.profile, along_mm))
    }
}

/// When a profile has come so far, s from its start.
pub(super) fn time_of(profile: &Profile, along_mm: f64) -> f64 {
    // Place grows with time: halve the interval.
    let (mut low, mut high) = (0.0, profile.duration_s());
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if profile.at(middle).0 < along_mm {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}
