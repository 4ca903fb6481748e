//! How long a job takes, without rehearsing it: the simulated machine's interpreter and the planner, but no wires, no
//! sender and no sheet.

use std::collections::VecDeque;

use super::modal::{Action, Drive, Modal, Spindle, interpret};
use super::settings::Settings;
use crate::planner::{Estimate, Firmware, Motion, Move, Step, estimate as estimate_steps};

/// A line that the controller would refuse: its time is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: the controller would answer error:{number}, so the job's time is not known")]
pub struct EstimateError {
    /// The line, counted from 1.
    pub line: usize,
    /// GRBL's number.
    pub number: u8,
}

impl Settings {
    /// What the estimate needs besides the limits.
    pub fn firmware(&self) -> Firmware {
        Firmware {
            planner_blocks: self.planner_blocks,
            byte_time_s: self.byte_time_s,
            stop_delay_s: if self.flavour.waits_at_stops() && self.step_idle_delay_ms < 255.0 {
                self.step_idle_delay_ms * 1e-3
            } else {
                0.0
            },
            dwell_piece_s: self.flavour.dwell_piece_s(),
            steps_per_mm: self.steps_per_mm,
            step_timer: self.flavour.step_timer(),
        }
    }
}

/// What a job takes on a controller with these settings that stands at its origin: dwells in their pieces, the delay
/// of each stop, and the pace of its reading included. Pauses (M0) take no time here.
///
/// # Errors
/// [`EstimateError`] for the first line that is refused.
pub fn estimate(job: &str, settings: &Settings) -> Result<Estimate, EstimateError> {
    let mut modal = Modal::new();
    let mut actions = VecDeque::new();
    let mut steps = Vec::new();
    let mut at = [0.0; 3];
    let mut bytes = 0;
    let step = |target: [f64; 3], drive: &Drive, at: &mut [f64; 3], bytes: &mut u32| {
        let end: [f64; 3] = std::array::from_fn(|k| {
            let steps = settings.steps_per_mm[k];
            (target[k] * steps).round() / steps
        });
        let delta_mm = std::array::from_fn(|k| end[k] - at[k]);
        *at = end;
        Step {
            motion: Motion::Move(Move {
                delta_mm,
                rate_mm_min: drive.rate_mm_min,
            }),
            bytes: std::mem::take(bytes),
            lit: drive.s > 0.0 && drive.spindle != Spindle::Off,
        }
    };
    for (number, raw) in job.lines().enumerate() {
        bytes += u32::try_from(raw.len() + 1).unwrap_or(u32::MAX / 2);
        let line = bare(raw);
        if line.is_empty() {
            continue;
        }
        interpret(&line, &mut modal, settings, &mut actions).map_err(|error| EstimateError {
            line: number + 1,
            number: error,
        })?;
        while let Some(action) = actions.pop_front() {
            let wait_s = match action {
                Action::Line { target, drive } => {
                    steps.push(step(target, &drive, &mut at, &mut bytes));
                    continue;
                }
                Action::Arc(mut arc) => {
                    while let Some(target) = arc.point() {
                        arc.next += 1;
                        steps.push(step(target, &arc.drive, &mut at, &mut bytes));
                    }
                    continue;
                }
                Action::Probe(probe) => {
                    // It ends on the sheet, and the job goes on from there.
                    let end = probe.end(settings.surface_mm);
                    modal.position = end;
                    steps.push(step(end, &probe.drive, &mut at, &mut bytes));
                    0.0
                }
                Action::Sync | Action::Pause | Action::End => 0.0,
                Action::Dwell { left_s, .. } => left_s,
                Action::Spindle { .. }
                | Action::Air(_)
                | Action::Memory
                | Action::Home
                | Action::Jog { .. }
                | Action::Sleep => continue,
            };
            steps.push(Step {
                motion: Motion::Stop { wait_s },
                bytes: std::mem::take(&mut bytes),
                lit: false,
            });
        }
    }
    Ok(estimate_steps(
        &steps,
        &settings.limits(),
        &settings.firmware(),
    ))
}

/// A line as the interpreter wants it: no comments, no blanks, capitals.
fn bare(raw: &str) -> Vec<u8> {
    let mut line = Vec::with_capacity(raw.len());
    let mut inside = false;
    for byte in raw.bytes() {
        match byte {
            b';' if !inside => break,
            b'(' => inside = true,
            b')' if inside => inside = false,
            _ if inside => {}
            b'/' | 0..=b' ' => {}
            _ => line.push(byte.to_ascii_uppercase()),
        }
    }
    line
}
