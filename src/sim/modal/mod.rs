//! What GRBL's interpreter remembers between lines, and what one line makes it do.
//!
//! Written from GRBL 1.1h's documented behaviour; shares nothing with our own G-code writer and reader, so that it can
//! judge them. M7 is answered with `error:20` by GRBL alone: it is built without.

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

/// G38.2 to G38.5: a straight move that ends where the probe's contact closes, or opens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Probe {
    pub target: [f64; 3],
    /// Where the interpreter was before.
    pub from: [f64; 3],
    pub drive: Drive,
    /// G38.4, G38.5: until the contact opens.
    pub away: bool,
    /// G38.2, G38.4: it is an alarm if nothing is found.
    pub strict: bool,
}

impl Probe {
    /// Where it ends over a sheet at this height, mm.
    pub fn end(&self, surface_mm: Option<f64>) -> [f64; 3] {
        let (from, to) = (self.from[2], self.target[2]);
        let part = surface_mm.map_or(1.0, |z| (z - from) / (to - from));
        let part = if (0.0..1.0).contains(&part) {
            part
        } else {
            1.0
        };
        std::array::from_fn(|k| self.from[k] + (self.target[k] - self.from[k]) * part)
    }
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
    /// Move until the probe says so.
    Probe(Probe),
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
    /// 0, 1, 2, 3, or 80; 382 to 385 for G38.2 to G38.5.
    pub motion: u16,
    pub plane: u8,
    pub inches: bool,
    pub incremental: bool,
    /// G93: F is how often a minute the move could be made.
    pub inverse_time: bool,
    /// In inverse time, per minute.
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
    /// The length of the tool, mm along Z.
    pub tool_length: f64,
    pub position: [f64; 3],
}

impl Modal {
    pub fn new() -> Self {
        Self {
            motion: 0,
            plane: 17,
            inches: false,
            incremental: false,
            inverse_time: false,
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
            tool_length: 0.0,
            position: [0.0; 3],
        }
    }

    /// Where the work origin is, machine coordinates.
    pub fn offset(&self) -> [f64; 3] {
        let mut offset: [f64; 3] =
            std::array::from_fn(|k| self.systems[self.system][k] + self.g92[k]);
        offset[2] += self.tool_length;
        offset
    }

    /// The tool's length, where it counts.
    fn tool_offset(&self, axis: usize) -> f64 {
        if axis == 2 { self.tool_length } else { 0.0 }
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
    let moves = words.motion.is_some_and(|motion| motion != 80);
    let length = words.tool_length;
    if usize::from(takes_axes) + usize::from(moves) + usize::from(length.is_some()) > 1 {
        return Err(24);
    }
    let moving = !takes_axes && length.is_none() && (any_axis || moves);

    if words.take(b'N').is_some_and(|n| n > 10_000_000.0) {
        return Err(27);
    }
    next.inches = words.inches.unwrap_or(next.inches);
    let unit = if next.inches { 25.4 } else { 1.0 };
    next.inverse_time = words.inverse_time.unwrap_or(next.inverse_time);
    let feed = words.take(b'F');
    if next.inverse_time || modal.inverse_time {
        // Such a rate holds for its own line, and is nobody's unit.
        next.feed_mm_min = feed.unwrap_or(0.0);
    } else if let Some(f) = feed {
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

    match length {
        Some(true) if axis_words.map(|w| w.is_some()) != [false, false, true] => return Err(37),
        Some(true) => next.tool_length = axis_words[2].unwrap_or(0.0) * unit,
        Some(false) => next.tool_length = 0.0,
        None => {}
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
                    let bare = next.position[k] - next.systems[next.system][k] - value * unit;
                    next.g92[k] = bare - next.tool_offset(k);
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

    if next.motion == 80 && any_axis {
        return Err(31);
    }
    if moving {
        let absolute_machine = words.other == Some(530);
        if absolute_machine && !matches!(next.motion, 0 | 1) {
            return Err(30);
        }
        if next.motion != 0 && next.feed_mm_min == 0.0 {
            return Err(22);
        }
        let target = next.target(axis_words, unit, absolute_machine);
        if target.iter().any(|t| !t.is_finite() || t.abs() > 1e6) {
            return Err(33);
        }
        let way: [f64; 3] = std::array::from_fn(|k| target[k] - next.position[k]);
        let rate = if next.inverse_time {
            next.feed_mm_min * way.iter().map(|w| w * w).sum::<f64>().sqrt()
        } else {
            next.feed_mm_min
        };
        let drive = Drive {
            rate_mm_min: (next.motion != 0).then_some(rate),
            spindle: next.spindle,
            s: block_s,
        };
        if next.motion > 1 && !any_axis {
            return Err(26);
        }
        match next.motion {
            0 | 1 if any_axis => todo.push(Action::Line { target, drive }),
            0 | 1 => {}
            2 | 3 => {
                let mut arc = arc(&mut words, &next, target, drive, unit, settings)?;
                if next.inverse_time {
                    arc.drive.rate_mm_min = Some(next.feed_mm_min * arc.segments_mm());
                }
                todo.push(Action::Arc(arc));
            }
            _ => {
                if way.iter().all(|w| w.abs() < 1e-9) {
                    return Err(33);
                }
                todo.push(Action::Sync);
                todo.push(Action::Probe(Probe {
                    target,
                    from: next.position,
                    drive,
                    away: next.motion >= 384,
                    strict: next.motion.is_multiple_of(2),
                }));
            }
        }
        if any_axis {
            next.position = target;
        }
    }
    for letter in [b'X', b'Y', b'Z'] {
        if moving || takes_axes || length.is_some() {
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
            next.inverse_time = false;
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
