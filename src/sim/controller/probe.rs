//! Probing: down until the tip touches the sheet, or up until it no longer does.
//!
//! The contact is looked at with every step. Where it changes, the position is noted and the head brakes as in a hold,
//! so that it runs on by its braking distance: a tip that touches presses into the sheet by so much. What is left of
//! the move is forgotten. The output is nobody's business here: it stays on, also where probing ends in an alarm.

use super::{Controller, State};
use crate::sim::flavour::Flavour;
use crate::sim::modal::{Action, Probe};

/// Probing under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probing {
    away: bool,
    /// Where the contact changed, as the controller counts.
    touched: Option<[f64; 3]>,
}

/// A hair, in steps, so that a surface that lies on a step is reached there.
const HAIR_STEPS: f64 = 1e-6;

impl Controller {
    /// The highest step of Z at which the tip touches the sheet, as the controller counts; none without a sheet.
    fn surface_step(&self) -> Option<f64> {
        let height_mm = self.settings.surface_mm? - self.zero[2];
        Some((height_mm * self.settings.steps_per_mm[2] + HAIR_STEPS).floor())
    }

    /// Whether the probe's pin reads as if something had been found: the tip touches, or no longer does where that is
    /// what is looked for.
    pub(super) fn probe_pin(&self) -> bool {
        let step = (self.position_mm()[2] * self.settings.steps_per_mm[2]).round();
        let touches = self.surface_step().is_some_and(|surface| step <= surface);
        touches != self.probing.is_some_and(|p| p.away)
    }

    /// True while the head brakes because something was found.
    pub(super) fn found_something(&self) -> bool {
        self.probing.is_some_and(|p| p.touched.is_some())
    }

    /// One step of a probing line: begins, waits, or ends it. False if it must wait.
    pub(super) fn probe(&mut self, probe: Probe) -> bool {
        let Some(probing) = self.probing else {
            self.begin_probing(probe);
            return true;
        };
        if self.running.is_some() || !self.queue.is_empty() || self.state != State::Idle {
            self.actions.push_front(Action::Probe(probe));
            return false;
        }
        self.probing = None;
        self.probed.1 = probing.touched.is_some();
        match probing.touched {
            Some(place) => {
                self.probed.0 = place;
                self.modal.position = self.position;
            }
            None => {
                if !probe.strict || self.settings.flavour == Flavour::GrblHal {
                    self.probed.0 = self.position;
                }
                if probe.strict {
                    self.lock(5);
                }
            }
        }
        self.idle_delay();
        self.probe_report();
        true
    }

    fn begin_probing(&mut self, probe: Probe) {
        self.probed.1 = false;
        let probing = Probing {
            away: probe.away,
            touched: None,
        };
        self.probing = Some(probing);
        if self.probe_pin() {
            self.probing = None;
            self.modal.position = probe.from;
            return self.lock(4);
        }
        self.actions.push_front(Action::Probe(probe));
        self.plan_line(probe.target, probe.drive, true);
        self.start_cycle();
    }

    /// When the contact changes on the way that the head goes now, s.
    pub(super) fn touch_s(&self) -> Option<f64> {
        let probing = self.probing.filter(|p| p.touched.is_none())?;
        let running = self.running.as_ref()?;
        let (_, cut) = self.queue.front()?;
        let z_mm = self.touch_z_mm(probing)?;
        let fall_mm = cut.end[2] - cut.start[2];
        // Away from the sheet is up, towards it is down.
        if fall_mm == 0.0 || (fall_mm > 0.0) != probing.away {
            return None;
        }
        let along = (z_mm - cut.start[2]) / fall_mm * cut.length_mm - running.behind_mm;
        self.passes_s(along.max(0.0))
    }

    /// The first step of Z at which the contact is another.
    fn touch_z_mm(&self, probing: Probing) -> Option<f64> {
        let step = self.surface_step()? + if probing.away { 1.0 } else { 0.0 };
        Some(step / self.settings.steps_per_mm[2])
    }

    /// The contact changes: the place is noted, and the head comes to rest.
    pub(super) fn touch(&mut self) {
        let (place, _) = self.whereabouts();
        let steps_per_mm = self.settings.steps_per_mm;
        let mut place: [f64; 3] =
            std::array::from_fn(|k| (place[k] * steps_per_mm[k]).round() / steps_per_mm[k]);
        if let Some(z_mm) = self.probing.and_then(|p| self.touch_z_mm(p)) {
            place[2] = z_mm;
        }
        let braking = self.braking();
        if let Some(probing) = &mut self.probing {
            probing.touched = Some(place);
        }
        if !braking {
            self.brake();
        }
    }

    /// An alarm that locks, and no more: what runs of the program's line goes on, and every output stays as it is.
    fn lock(&mut self, number: u8) {
        self.state = State::Alarm;
        self.raise(number);
    }
}
