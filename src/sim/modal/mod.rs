//! What GRBL's interpreter remembers between lines, and what one line makes it do.
//!
//! Written from GRBL 1.1h's documented behaviour; shares nothing with our own G-code writer and reader, so that it can
//! judge them. Not simulated, and answered with `error:20`: G38, G43.1, G93; and M7, which stock GRBL is built without.

mod arc;
mod block;
mod jog;
mod offsets;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use super::flavour::Flavour;
use super::settings::Settings;
use arc::arc;
use block::Words;
use offsets::{remembered, set_system};

pub(crate) use arc::Arc;
pub(crate) use jog::interpret_jog;

/// The state of the spindle output: off, constant power, or power that follows speed in laser mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spindle {
    /// M5.
    #[default]
    Off,
    /// M3.
    Constant,
    /// M4: in laser mode the power follows the speed.
    Dynamic,
}

/// How one block is to be driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drive {
    pub rate_mm_min: Option<f64>,
    pub spindle: Spindle,
    pub s: f64,
}

/// What a line makes the controller do, in order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Action {
    /// Wait until everything planned has been done.
    Sync,
    /// Set the output while standing; `word` is the S that holds from then on.
    Spindle { spindle: Spindle, s: f64, word: f64 },
    /// Mist and flood.
    Air([bool; 2]),
    /// Plan a straight move to a place in machine coordinates.
    Line { target: [f64; 3], drive: Drive },
    /// Plan an arc.
    Arc(Arc),
    /// Stand for this long, s.
    Dwell { left_s: f64, until_s: Option<f64> },
    /// M0: hold until `~`.
    Pause,
    /// M2, M30: everything off, then the message.
    End,
    /// The controller writes its memory, and hears nothing meanwhile.
    Memory,
    /// Home the machine.
    Home,
    /// A jog to a place in machine coordinates.
    Jog { target: [f64; 3], rate_mm_min: f64 },
    /// The motors go without current, until a reset.
    Sleep,
}

/// Modal state. Lengths in mm, places in machine coordinates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Modal {
    /// 0, 1, 2, 3, or 80.
    pub motion: u8,
    pub plane: u8,
    pub inches: bool,
    pub incremental: bool,
    pub feed_mm_min: f64,
    pub spindle: Spindle,
    pub s: f64,
    pub mist: bool,
    pub flood: bool,
    pub tool: f64,
    pub system: usize,
    pub systems: [[f64; 3]; 6],
    /// Where G28 and G30 go, machine coordinates.
    pub places: [[f64; 3]; 2],
    pub g92: [f64; 3],
    pub position: [f64; 3],
}

impl Modal {
    pub fn new() -> Self {
        Self {
            motion: 0,
            plane: 17,
            inches: false,
            incremental: false,
            feed_mm_min: 0.0,
            spindle: Spindle::Off,
            s: 0.0,
            mist: false,
            flood: false,
            tool: 0.0,
            system: 0,
            systems: [[0.0; 3]; 6],
            places: [[0.0; 3]; 2],
            g92: [0.0; 3],
            position: [0.0; 3],
        }
    }

    /// Where the work origin is, machine coordinates.
    pub fn offset(&self) -> [f64; 3] {
        std::array::from_fn(|k| self.systems[self.system][k] + self.g92[k])
    }

    /// Where a line's axis words lead, machine coordinates.
    fn target(&self, words: [Option<f64>; 3], unit: f64, machine: bool) -> [f64; 3] {
        let offset = self.offset();
        std::array::from_fn(|k| match words[k] {
            Some(value) if machine => value * unit,
            Some(value) if self.incremental => self.position[k] + value * unit,
            Some(value) => value * unit + offset[k],
            None => self.position[k],
        })
    }

    /// After a reset: modal words as at power-up, offsets kept in memory, G92 forgotten.
    pub fn reset(&mut self, position: [f64; 3]) {
        *self = Self {
            systems: self.systems,
            places: self.places,
            position,
            ..Self::new()
        };
    }
}

/// Interprets one line (no spaces, no comments, upper case): changes `modal` and appends what is to be done, or leaves
/// both as they were.
///
/// # Errors
/// GRBL's error number.
pub(crate) fn interpret(
    line: &[u8],
    modal: &mut Modal,
    settings: &Settings,
    actions: &mut VecDeque<Action>,
) -> Result<(), u8> {
    let mut words = Words::read(line)?;
    let mut next = modal.clone();
    let mut todo: Vec<Action> = Vec::new();

    let axis_words = [b'X', b'Y', b'Z'].map(|l| words.get(l));
    let any_axis = axis_words.iter().any(Option::is_some);
    let takes_axes = matches!(words.other, Some(100 | 280 | 300 | 920));
    if takes_axes && matches!(words.motion, Some(0..=3)) {
        return Err(24);
    }
    let moving = !takes_axes && (any_axis || matches!(words.motion, Some(0..=3)));

    if words.take(b'N').is_some_and(|n| n > 10_000_000.0) {
        return Err(27);
    }
    next.inches = words.inches.unwrap_or(next.inches);
    let unit = if next.inches { 25.4 } else { 1.0 };
    if let Some(f) = words.take(b'F') {
        next.feed_mm_min = f * unit;
    }
    if let Some(t) = words.take(b'T') {
        if t > 255.0 {
            return Err(38);
        }
        next.tool = t.trunc();
    }
    next.plane = words.plane.unwrap_or(next.plane);
    next.incremental = words.incremental.unwrap_or(next.incremental);
    next.system = words.system.unwrap_or(next.system);
    next.motion = words.motion.unwrap_or(next.motion);

    // Laser mode: any line outside G1–G3 is dark, whatever S says.
    let burning_motion = matches!(next.motion, 1..=3);
    let dark = settings.laser_mode && !burning_motion;
    let is_motion = settings.laser_mode && any_axis && moving;
    let mut force_sync = false;
    if settings.laser_mode && !is_motion && modal.spindle == Spindle::Constant {
        force_sync = matches!(modal.motion, 1..=3) == dark;
    }
    let s = words.take(b'S').unwrap_or(modal.s);
    if s != modal.s || force_sync {
        if modal.spindle != Spindle::Off && !is_motion {
            todo.push(Action::Sync);
            todo.push(Action::Spindle {
                spindle: modal.spindle,
                s: if dark { 0.0 } else { s },
                word: s,
            });
        }
        next.s = s;
    }
    let block_s = if dark { 0.0 } else { next.s };
    if let Some(spindle) = words.spindle
        && spindle != modal.spindle
    {
        todo.push(Action::Sync);
        todo.push(Action::Spindle {
            spindle,
            s: block_s,
            word: next.s,
        });
        next.spindle = spindle;
    }
    if let Some(coolant) = words.coolant {
        if coolant == 7 && settings.flavour == Flavour::Grbl {
            return Err(20);
        }
        let wanted = (
            coolant == 7 || (coolant != 9 && next.mist),
            coolant == 8 || (coolant != 9 && next.flood),
        );
        if wanted != (next.mist, next.flood) {
            todo.push(Action::Sync);
            todo.push(Action::Air([wanted.0, wanted.1]));
        }
        (next.mist, next.flood) = wanted;
    }

    match words.other {
        Some(40) => {
            let seconds = words.take(b'P').ok_or(28u8)?;
            todo.push(Action::Sync);
            // GRBL waits in steps of 50 ms, rounded up, as measured; the epsilon keeps 0.05 at one step.
            let piece_s = settings.flavour.dwell_piece_s();
            let left_s = if piece_s > 0.0 {
                (seconds / piece_s - 1e-6).ceil() * piece_s
            } else {
                seconds
            };
            if left_s > 0.0 {
                todo.push(Action::Dwell {
                    left_s,
                    until_s: None,
                });
            }
        }
        Some(100) => set_system(&mut words, axis_words, unit, &mut next, &mut todo)?,
        Some(920) => {
            if !any_axis {
                return Err(26);
            }
            for (k, word) in axis_words.iter().enumerate() {
                if let Some(value) = word {
                    next.g92[k] = next.position[k] - next.systems[next.system][k] - value * unit;
                }
            }
        }
        Some(921) => next.g92 = [0.0; 3],
        Some(code @ (280 | 300)) => {
            let drive = Drive {
                rate_mm_min: None,
                spindle: next.spindle,
                s: block_s,
            };
            let place = next.places[usize::from(code == 300)];
            let home = if any_axis {
                let between = next.target(axis_words, unit, false);
                todo.push(Action::Line {
                    target: between,
                    drive,
                });
                std::array::from_fn(|k| match axis_words[k] {
                    Some(_) => place[k],
                    None => between[k],
                })
            } else {
                place
            };
            todo.push(Action::Line {
                target: home,
                drive,
            });
            next.position = home;
        }
        Some(code @ (281 | 301)) => remembered(code == 301, &mut next, &mut todo),
        _ => {}
    }

    if moving {
        let absolute_machine = words.other == Some(530);
        if absolute_machine && !matches!(next.motion, 0 | 1) {
            return Err(30);
        }
        if next.motion == 80 {
            return Err(31);
        }
        if next.motion != 0 && next.feed_mm_min == 0.0 {
            return Err(22);
        }
        let target = next.target(axis_words, unit, absolute_machine);
        if target.iter().any(|t| !t.is_finite() || t.abs() > 1e6) {
            return Err(33);
        }
        let drive = Drive {
            rate_mm_min: (next.motion != 0).then_some(next.feed_mm_min),
            spindle: next.spindle,
            s: block_s,
        };
        if next.motion >= 2 {
            if !any_axis {
                return Err(26);
            }
            todo.push(Action::Arc(arc(
                &mut words, &next, target, drive, unit, settings,
            )?));
        } else if any_axis {
            todo.push(Action::Line { target, drive });
        }
        if any_axis {
            next.position = target;
        }
    }
    for letter in [b'X', b'Y', b'Z'] {
        if moving || takes_axes {
            words.take(letter);
        }
    }
    if words.value.iter().any(Option::is_some) {
        return Err(36);
    }

    match words.flow {
        Some(0) => {
            todo.push(Action::Sync);
            todo.push(Action::Pause);
        }
        // An optional stop is none.
        Some(1) => {}
        Some(_) => {
            todo.push(Action::Sync);
            todo.push(Action::End);
            next.motion = 1;
            next.plane = 17;
            next.incremental = false;
            next.system = 0;
            next.spindle = Spindle::Off;
            (next.mist, next.flood) = (false, false);
        }
        None => {}
    }
    *modal = next;
    actions.extend(todo);
    Ok(())
}
