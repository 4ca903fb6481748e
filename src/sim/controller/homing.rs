//! Homing (`$H`): the axes look for their switches, Z first, then X and Y together.
//!
//! Each cycle goes four ways: quickly to the switches (`$25`), off them (`$27`), slowly to them again (`$24`), off again;
//! after each the head rests for `$26`. Axes of one cycle set out together, and each stops dead at its switch while the
//! others go on. A search goes half as far again as the travel, a second one five times the distance off. The frame ends
//! behind the switches: where one is missing, the motor stalls there while the controller goes on counting.

use std::collections::VecDeque;

use super::limits::time_of;
use super::{Controller, State};
use crate::planner::{Move, Profile, Queue};
use crate::sim::burnt::Light;
use crate::sim::flavour::Flavour;
use crate::sim::modal::Spindle;
use crate::sim::settings::Switch;

/// How far a search goes at most: times the longest travel, and later times the distance off.
const SEARCH: f64 = 1.5;
const LOCATE: f64 = 5.0;
/// Ways of one cycle.
const WAYS: usize = 4;

/// A cycle under way.
#[derive(Clone, Debug)]
pub(super) struct Homing {
    /// Axes of this cycle, and of those to come.
    axes: [bool; 3],
    to_come: VecDeque<[bool; 3]>,
    way: usize,
    /// Where this way began on the bed, mm, and where each axis goes from there: 1, −1, or 0.
    from: [f64; 3],
    toward: [f64; 3],
    /// How far each axis can go, mm: to its switch, or to the end of the frame.
    most: [f64; 3],
    profile: Profile,
    start_s: f64,
    /// When the head stands, and when the next way begins.
    stands_s: f64,
    rests_s: f64,
    /// The alarm at the end of this way, if there is one.
    alarm: Option<u8>,
    stood: bool,
}

impl Homing {
    /// How far the controller has counted along each axis, mm, and how fast, mm/s.
    fn along(&self, now_s: f64) -> (f64, f64) {
        let count = self
            .axes
            .map(|a| f64::from(u8::from(a)))
            .iter()
            .sum::<f64>();
        let (along, speed) = self.profile.at(now_s.min(self.stands_s) - self.start_s);
        let speed = if self.stood { 0.0 } else { speed };
        (along / count.sqrt(), speed)
    }

    /// Where the head is on the bed.
    pub fn head(&self, now_s: f64) -> [f64; 3] {
        let (along, _) = self.along(now_s);
        std::array::from_fn(|k| {
            let reach = if self.stood {
                self.most[k]
            } else {
                along.min(self.most[k])
            };
            self.from[k]
                + if self.toward[k] == 0.0 {
                    0.0
                } else {
                    self.toward[k] * reach
                }
        })
    }

    /// Where the controller believes it to be, and how fast it goes.
    pub fn belief(&self, now_s: f64, before: [f64; 3]) -> ([f64; 3], f64) {
        let (along, speed) = self.along(now_s);
        let place = std::array::from_fn(|k| match self.axes[k] {
            true => self.toward[k] * along,
            false => before[k],
        });
        (place, speed)
    }

    /// When something happens next, s.
    pub fn due_s(&self) -> f64 {
        if self.stood {
            self.rests_s
        } else {
            self.stands_s
        }
    }
}

impl Controller {
    pub(super) fn home(&mut self) {
        self.state = State::Home;
        // Its motion is one without an output; what the program wants comes back with the next that says so.
        self.rest(Light::DARK);
        if self.settings.flavour == Flavour::GrblHal {
            (self.modal.spindle, self.spindle) = (Spindle::Off, Spindle::Off);
            (self.modal.mist, self.modal.flood) = (false, false);
            self.set_air([false; 2]);
        }
        let cycles = [[false, false, true], [true, true, false]];
        self.homing_way(VecDeque::from(cycles), None);
    }

    /// On which side axis `k` has its switch: 1 or −1.
    fn switch_side(&self, k: usize) -> f64 {
        if self.settings.homes_downwards(k) {
            -1.0
        } else {
            1.0
        }
    }

    /// How far the switch of axis `k` lies ahead of this place on the bed, mm; negative behind it.
    fn switch_ahead_mm(&self, k: usize, head_mm: f64) -> f64 {
        (self.settings.switch_mm(k) - head_mm) * self.switch_side(k)
    }

    /// Sets out on a way: the next one of a cycle, or the first of the next cycle.
    fn homing_way(&mut self, mut to_come: VecDeque<[bool; 3]>, last: Option<(usize, [bool; 3])>) {
        let (way, axes) = match last {
            Some((way, axes)) => (way + 1, axes),
            None => match to_come.pop_front() {
                Some(axes) => (0, axes),
                None => return self.homed(),
            },
        };
        let from = self.on_bed(self.position);
        let s = &self.settings;
        let longest = (0..3)
            .filter(|&k| axes[k])
            .map(|k| s.travel_mm[k])
            .fold(0.0, f64::max);
        let (length, rate) = match way {
            0 => (SEARCH * longest, s.homing_seek_mm_min),
            2 => (LOCATE * s.homing_pull_off_mm, s.homing_feed_mm_min),
            _ => (s.homing_pull_off_mm, s.homing_seek_mm_min),
        };
        let seeks = way.is_multiple_of(2);
        let toward: [f64; 3] = std::array::from_fn(|k| match (axes[k], seeks) {
            (false, _) => 0.0,
            (true, true) => self.switch_side(k),
            (true, false) => -self.switch_side(k),
        });
        let count = axes
            .map(|a| f64::from(u8::from(a)))
            .iter()
            .sum::<f64>()
            .sqrt();
        let mut queue = Queue::new(s.limits(), 1).timed(s.flavour.step_timer(), s.steps_per_mm);
        let wanted = Move {
            delta_mm: toward.map(|side| side * length),
            rate_mm_min: Some(rate * count),
        };
        // One that goes nowhere has ended already.
        let profile = match queue.push(&wanted, ()) {
            Ok(true) => queue.front_profile().unwrap_or_default(),
            _ => Profile::default(),
        };
        let ahead: [f64; 3] = std::array::from_fn(|k| self.switch_ahead_mm(k, from[k]).max(0.0));
        let most = std::array::from_fn(|k| match (seeks, self.settings.switches[k]) {
            (false, _) => length,
            (true, Switch::Stuck) => 0.0,
            (true, Switch::Works | Switch::Missing) => ahead[k],
        });
        let search = |k: usize| match self.settings.switches[k] {
            Switch::Missing => f64::INFINITY,
            _ => most[k],
        };
        let furthest = (0..3).filter(|&k| axes[k]).map(search).fold(0.0, f64::max);
        let mut new = Homing {
            axes,
            to_come,
            way,
            from,
            toward,
            most,
            profile,
            start_s: self.now_s,
            stands_s: self.now_s + profile.duration_s(),
            rests_s: 0.0,
            alarm: None,
            stood: false,
        };
        if seeks && furthest <= length {
            new.stands_s = self.now_s + time_of(&profile, furthest * count);
        } else if seeks {
            new.alarm = Some(9);
            new.most = most.map(|m| m.min(length));
        } else if (0..3).any(|k| axes[k] && self.still_pressed(k, from[k] + toward[k] * length)) {
            new.alarm = Some(8);
        }
        new.rests_s = new.stands_s + self.settings.homing_debounce_ms * 1e-3;
        self.homing = Some(new);
    }

    /// Whether a head at this place of the bed has gone past the switch of axis `k`, and so presses it.
    pub(super) fn beyond(&self, k: usize, head_mm: f64) -> bool {
        self.settings.switches[k] == Switch::Works && self.switch_ahead_mm(k, head_mm) < -1e-9
    }

    fn still_pressed(&self, k: usize, head_mm: f64) -> bool {
        match self.settings.switches[k] {
            Switch::Stuck => true,
            Switch::Missing => false,
            // A hair, so that the switch's own place counts as pressed.
            Switch::Works => self.switch_ahead_mm(k, head_mm) < 1e-9,
        }
    }

    /// The head stands at the end of a way, or has rested there.
    pub(super) fn homing_step(&mut self) {
        let Some(homing) = &mut self.homing else {
            return;
        };
        if !homing.stood {
            if let Some(number) = homing.alarm {
                return self.homing_fails(number);
            }
            homing.stood = true;
            return;
        }
        let (way, axes, to_come) = (homing.way, homing.axes, homing.to_come.clone());
        let head = homing.head(self.now_s);
        let done = way + 1 == WAYS;
        for k in (0..3).filter(|&k| axes[k]) {
            // Each way is counted from zero; at the end the place is known.
            self.position[k] = if done { self.homed_mm(k) } else { 0.0 };
            let zero = head[k] - self.position[k];
            // Without the dust of its sums.
            self.zero[k] = if zero.abs() < 1e-9 { 0.0 } else { zero };
        }
        self.homing = None;
        self.homing_way(to_come, (!done).then_some((way, axes)));
    }

    /// What axis `k` reads a little off its switch, mm, in whole steps.
    fn homed_mm(&self, k: usize) -> f64 {
        let off = self.settings.homing_pull_off_mm;
        let place = self.settings.switch_mm(k) - self.switch_side(k) * off;
        (place * self.settings.steps_per_mm[k]).round() / self.settings.steps_per_mm[k]
    }

    /// The head stands at the corner that `$23` names, a little off the switches.
    fn homed(&mut self) {
        self.modal.position = self.position;
        // Who asked meanwhile is answered now, and still told that it homes.
        if std::mem::take(&mut self.report_wanted) {
            self.status_report();
        }
        self.state = State::Idle;
        self.idle_delay();
        self.starting
            .extend(self.startup.iter().filter(|l| !l.is_empty()).cloned());
    }

    /// Homing ends in an alarm and a reset; the line that asked for it is answered all the same.
    pub(super) fn homing_fails(&mut self, number: u8) {
        self.stop_motion();
        self.raise(number);
        if self.answer.take().is_some() {
            self.say("ok");
        }
        if self.settings.flavour == Flavour::FluidNc && number != 6 {
            self.forget_program();
            self.state = State::Alarm;
            return;
        }
        self.restart();
        self.state = State::Alarm;
        self.boot();
    }
}
