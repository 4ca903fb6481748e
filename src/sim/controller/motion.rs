//! What moves, where the head is, and the beam along the way.

use super::overrides::Overrides;
use super::{Controller, Cut, Running, State};
use crate::planner::{Move, Profile, dark_before_stop_s};
use crate::sim::burnt::Light;
use crate::sim::modal::{Action, Drive, Spindle};

impl Controller {
    /// Where the head is and how fast, mm and mm/s.
    pub(super) fn whereabouts(&self) -> ([f64; 3], f64) {
        if let Some(homing) = &self.homing {
            return homing.belief(self.now_s, self.position);
        }
        let (Some(running), Some((_, cut))) = (&self.running, self.queue.front()) else {
            return (self.position, 0.0);
        };
        let (along, speed) = running.profile.at(self.now_s - running.start_s);
        let part = ((running.behind_mm + along) / cut.length_mm).clamp(0.0, 1.0);
        let place = std::array::from_fn(|k| cut.start[k] + (cut.end[k] - cut.start[k]) * part);
        (place, speed)
    }

    /// Plans a straight move: soft limits, whole steps, and the look-ahead of what already moves.
    pub(super) fn plan_line(&mut self, target: [f64; 3], drive: Drive, fixed_feed: bool) {
        if self.settings.soft_limits && !self.within_travel(target) {
            self.beyond_travel();
            return;
        }
        let end: [f64; 3] = std::array::from_fn(|k| {
            let steps = self.settings.steps_per_mm[k];
            (target[k] * steps).round() / steps
        });
        let start = self.planned_end();
        let delta_mm: [f64; 3] = std::array::from_fn(|k| end[k] - start[k]);
        let length_mm = delta_mm.iter().map(|d| d * d).sum::<f64>().sqrt();
        let cut = Cut {
            start,
            end,
            length_mm,
            drive,
            fixed_feed,
        };
        let exit_before = self.queue.exit_sqr();
        let mut now = (0.0, 0.0);
        if let Some(running) = &self.running {
            let (along, speed) = running.profile.at(self.now_s - running.start_s);
            let done = running.behind_mm + along;
            let whole = self.queue.front().map_or(0.0, |(_, c)| c.length_mm);
            now = (done, speed);
            self.queue.set_front(whole - done, speed);
        }
        let wanted = Move {
            delta_mm,
            rate_mm_min: drive.rate_mm_min,
        };
        match self.queue.push(&wanted, cut) {
            Ok(true) if self.overrides != Overrides::default() => self.new_speeds(),
            Ok(true) => {
                let changed = self.queue.exit_sqr() != exit_before;
                if self.running.is_some() && changed && !self.braking() {
                    self.begin_block(now.0);
                }
            }
            // A move to the present place is dropped. With M3 in laser mode the output is set to what the line says,
            // once the head stands there.
            Ok(false) if self.settings.laser_mode && drive.spindle == Spindle::Constant => {
                self.actions.push_front(Action::Spindle {
                    spindle: drive.spindle,
                    s: drive.s,
                    word: self.modal.s,
                });
                self.actions.push_front(Action::Sync);
            }
            Ok(false) => {}
            // Callers have looked for room.
            Err(_) => self.actions.push_front(Action::Line { target, drive }),
        }
    }

    pub(super) fn planned_end(&self) -> [f64; 3] {
        self.queue.back().map_or(self.position, |cut| cut.end)
    }

    /// Plans a jog, which sets out at once.
    pub(super) fn plan_jog(&mut self, target: [f64; 3], rate_mm_min: f64) {
        if self.jog_cancelled {
            return;
        }
        let drive = Drive {
            rate_mm_min: Some(rate_mm_min),
            spindle: self.modal.spindle,
            s: self.modal.s,
        };
        self.modal.position = target;
        self.plan_line(target, drive, true);
        if self.running.is_none() && !self.queue.is_empty() {
            self.state = State::Jog;
            self.begin_first();
        }
    }

    /// Braking to a rest in the middle of what is planned.
    pub(super) fn braking(&self) -> bool {
        self.jog_cancelled
            || self.found_something()
            || matches!(
                self.state,
                State::Hold { standing: false } | State::Door { standing: false }
            )
    }

    /// Starts to move if there is something planned and nothing moves; true if it did.
    pub(super) fn start_cycle(&mut self) -> bool {
        if self.running.is_some() || self.queue.is_empty() || self.state != State::Idle {
            return false;
        }
        self.state = State::Run;
        self.begin_first();
        true
    }

    pub(super) fn begin_first(&mut self) {
        let behind = self.queue.front().map_or(0.0, |(block, cut)| {
            (cut.length_mm - block.length_mm).max(0.0)
        });
        self.begin_block(behind);
        self.light_block();
    }

    /// The first block's profile from now, `behind_mm` of it already done.
    pub(super) fn begin_block(&mut self, behind_mm: f64) {
        self.motion_s.get_or_insert([self.now_s; 2]);
        let block_start_s = match &self.running {
            Some(running) => running.block_start_s,
            None => self.now_s,
        };
        self.running = self.queue.front_profile().map(|profile| Running {
            profile,
            start_s: self.now_s,
            block_start_s,
            behind_mm,
        });
    }

    /// The output for these words, with its override and within `$31` and `$30`.
    pub(super) fn light(&self, spindle: Spindle, s: f64, rapid: bool) -> Light {
        Light {
            s: self.output_word(s),
            spindle,
            dynamic: self.settings.laser_mode && spindle == Spindle::Dynamic,
            rapid,
        }
    }

    /// The beam as the first block wants it.
    pub(super) fn light_block(&mut self) {
        let Some((_, cut)) = self.queue.front() else {
            return;
        };
        let drive = cut.drive;
        let light = self.light(drive.spindle, drive.s, drive.rate_mm_min.is_none());
        let head = self.head_mm();
        self.shine(head, light);
        // What the output is left at when the machine comes to rest after this block.
        self.at_rest = if light.dynamic {
            Light::DARK
        } else {
            Light {
                rapid: false,
                ..light
            }
        };
    }

    /// The output while standing, from now.
    pub(super) fn rest(&mut self, light: Light) {
        self.at_rest = light;
        let head = self.on_bed(self.position);
        self.shine(head, light);
    }

    /// The output, from now and from this place on the bed.
    pub(super) fn shine(&mut self, head: [f64; 3], light: Light) {
        self.light = light;
        self.bed.light(self.now_s, head, light);
    }

    /// The running profile has ended: on to the next block, or to rest.
    pub(super) fn block_ends(&mut self, running: Running) {
        if let Some([_, last_s]) = &mut self.motion_s {
            *last_s = self.now_s;
        }
        let exit = running.profile.exit_mm_s();
        let Some((_, cut)) = self.queue.front() else {
            self.running = None;
            return;
        };
        let left = cut.length_mm - running.behind_mm - running.profile.length_mm();
        let holding = self.braking();
        if holding && left > 1e-9 {
            // Stopped within the block: the rest of it waits.
            self.position = self.whereabouts().0;
            self.running = None;
            self.queue.set_front(left, 0.0);
            self.queue.replan_all();
            self.held();
            return;
        }
        if exit == 0.0 && self.light.dynamic {
            let steps = (0..3).map(|k| {
                (cut.end[k] - cut.start[k]).abs() / cut.length_mm * self.settings.steps_per_mm[k]
            });
            self.bed.faded(
                self.now_s,
                dark_before_stop_s(
                    &running.profile,
                    running.start_s - running.block_start_s,
                    steps.fold(0.0, f64::max),
                ),
            );
        }
        self.position = cut.end;
        self.queue.pop();
        self.running = None;
        if let Some((block, _)) = self.queue.front().map(|(b, c)| (*b, *c)) {
            self.queue.set_front(block.length_mm, exit);
            if holding && exit == 0.0 {
                self.queue.replan_all();
                self.held();
            } else if holding {
                self.running = Some(Running {
                    profile: Profile::braking(block.length_mm, exit, block.acceleration_mm_s2),
                    start_s: self.now_s,
                    block_start_s: self.now_s,
                    behind_mm: 0.0,
                });
                self.light_block();
            } else {
                self.begin_block(0.0);
                self.light_block();
            }
        } else if holding {
            self.held();
        } else {
            self.state = State::Idle;
            self.rest(self.at_rest);
            self.idle_delay();
        }
    }

    /// The firmware blocks while it holds the motors for a moment.
    pub(super) fn idle_delay(&mut self) {
        if self.settings.flavour.waits_at_stops() && self.settings.step_idle_delay_ms < 255.0 {
            self.busy_until_s = self
                .busy_until_s
                .max(self.now_s + self.settings.step_idle_delay_ms * 1e-3);
        }
    }
}
