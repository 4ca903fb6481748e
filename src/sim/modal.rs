//! What GRBL's interpreter remembers between lines, and what one line makes it do.
//!
//! Written from GRBL 1.1h's documented behaviour; shares nothing with our own G-code writer and reader, so that it can
//! judge them. Not simulated, and answered with `error:20`: G28, G30, G38, G43.1, G93.

use std::collections::VecDeque;

use super::settings::Settings;
use super::words::next_word;

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

/// The rest of an arc: straight segments within the arc tolerance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Arc {
    pub drive: Drive,
    pub axes: [usize; 3],
    pub centre: [f64; 2],
    pub radius: f64,
    pub start_angle: f64,
    pub sweep: f64,
    pub from_linear: f64,
    pub target: [f64; 3],
    pub next: u32,
    pub segments: u32,
}

impl Arc {
    /// The end of the next segment, or none when the arc is done.
    pub fn point(&self) -> Option<[f64; 3]> {
        if self.next > self.segments {
            return None;
        }
        if self.next == self.segments {
            return Some(self.target);
        }
        let part = f64::from(self.next) / f64::from(self.segments);
        let angle = self.start_angle + self.sweep * part;
        let mut point = self.target;
        point[self.axes[0]] = self.centre[0] + self.radius * angle.cos();
        point[self.axes[1]] = self.centre[1] + self.radius * angle.sin();
        point[self.axes[2]] =
            self.from_linear + (self.target[self.axes[2]] - self.from_linear) * part;
        Some(point)
    }
}

/// What a line makes the controller do, in order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Action {
    /// Wait until everything planned has been done.
    Sync,
    /// Set the output while standing.
    Spindle { spindle: Spindle, s: f64 },
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
            g92: [0.0; 3],
            position: [0.0; 3],
        }
    }

    /// Where the work origin is, machine coordinates.
    pub fn offset(&self) -> [f64; 3] {
        std::array::from_fn(|k| self.systems[self.system][k] + self.g92[k])
    }

    /// After a reset: modal words as at power-up, offsets kept in memory, G92 forgotten.
    pub fn reset(&mut self, position: [f64; 3]) {
        *self = Self {
            systems: self.systems,
            position,
            ..Self::new()
        };
    }
}

/// The words of a line, by what they are for.
#[derive(Default)]
struct Words {
    value: [Option<f64>; 26],
    motion: Option<u8>,
    /// G4, G10, G53, G92, G92.1 as the integer times ten.
    other: Option<u16>,
    plane: Option<u8>,
    inches: Option<bool>,
    incremental: Option<bool>,
    system: Option<usize>,
    flow: Option<u8>,
    spindle: Option<Spindle>,
    coolant: Option<u8>,
    /// Modal groups seen, by a number of our own.
    groups: u16,
}

impl Words {
    fn take(&mut self, letter: u8) -> Option<f64> {
        self.value[usize::from(letter - b'A')].take()
    }

    fn get(&self, letter: u8) -> Option<f64> {
        self.value[usize::from(letter - b'A')]
    }

    fn group(&mut self, group: u16) -> Result<(), u8> {
        if self.groups & (1 << group) != 0 {
            return Err(21);
        }
        self.groups |= 1 << group;
        Ok(())
    }

    fn read(line: &[u8]) -> Result<Self, u8> {
        let mut words = Self::default();
        let mut at = 0;
        while at < line.len() {
            let (letter, value) = next_word(line, &mut at)?;
            match letter {
                b'G' => words.g(value)?,
                b'M' => words.m(value)?,
                b'F' | b'I' | b'J' | b'K' | b'L' | b'N' | b'P' | b'R' | b'S' | b'T' | b'X'
                | b'Y' | b'Z' => {
                    let slot = &mut words.value[usize::from(letter - b'A')];
                    if slot.is_some() {
                        return Err(25);
                    }
                    if value < 0.0 && matches!(letter, b'F' | b'N' | b'P' | b'S' | b'T') {
                        return Err(4);
                    }
                    *slot = Some(value);
                }
                _ => return Err(20),
            }
        }
        Ok(words)
    }

    fn g(&mut self, value: f64) -> Result<(), u8> {
        let (number, hundredths) = command(value);
        let code = match (number, hundredths) {
            (_, 0) => u16::from(number) * 10,
            (91 | 92, 10) => u16::from(number) * 10 + 1,
            (0..=4 | 10 | 17..=21 | 40 | 53..=59 | 80 | 93 | 94, _) => return Err(23),
            _ => return Err(20),
        };
        match code {
            0 | 10 | 20 | 30 | 800 => {
                self.group(1)?;
                self.motion = u8::try_from(code / 10).ok();
            }
            40 | 100 | 530 | 920 | 921 => {
                self.group(0)?;
                self.other = Some(code);
            }
            170 | 180 | 190 => {
                self.group(2)?;
                self.plane = u8::try_from(code / 10).ok();
            }
            900 | 910 => {
                self.group(3)?;
                self.incremental = Some(code == 910);
            }
            911 => self.group(4)?,
            940 => self.group(5)?,
            200 | 210 => {
                self.group(6)?;
                self.inches = Some(code == 200);
            }
            400 => self.group(7)?,
            490 => self.group(8)?,
            540 | 550 | 560 | 570 | 580 | 590 => {
                self.group(12)?;
                self.system = Some(usize::from(code / 10 - 54));
            }
            610 => self.group(13)?,
            _ => return Err(20),
        }
        Ok(())
    }

    fn m(&mut self, value: f64) -> Result<(), u8> {
        let (code, hundredths) = command(value);
        if hundredths != 0 {
            return Err(23);
        }
        match code {
            0 | 2 | 30 => {
                self.group(9)?;
                self.flow = Some(code);
            }
            3..=5 => {
                self.group(10)?;
                self.spindle = Some(match code {
                    3 => Spindle::Constant,
                    4 => Spindle::Dynamic,
                    _ => Spindle::Off,
                });
            }
            7..=9 => {
                // M7 and M8 may stand together.
                if code == 9 {
                    self.group(11)?;
                }
                self.coolant = Some(code);
            }
            _ => return Err(20),
        }
        Ok(())
    }
}

/// The number of a G or M word as the firmware takes it apart: the whole part in one byte, which wraps (`M259` is
/// `M3`), and the fraction in rounded hundredths (`M3.004` is `M3`). Single precision, as on the controller.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "brought into range first; single precision is the point"
)]
fn command(value: f64) -> (u8, u8) {
    let value = value as f32;
    let hundredths = (100.0 * value.fract()).round();
    (
        value.trunc().rem_euclid(256.0) as u8,
        hundredths.rem_euclid(256.0) as u8,
    )
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
    let takes_axes = matches!(words.other, Some(100 | 920));
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
        });
        next.spindle = spindle;
    }
    if let Some(coolant) = words.coolant {
        let wanted = (
            coolant == 7 || (coolant != 9 && next.mist),
            coolant == 8 || (coolant != 9 && next.flood),
        );
        if wanted != (next.mist, next.flood) {
            todo.push(Action::Sync);
        }
        (next.mist, next.flood) = wanted;
    }

    match words.other {
        Some(40) => {
            let seconds = words.take(b'P').ok_or(28u8)?;
            todo.push(Action::Sync);
            // Steps of 50 ms, rounded up, as measured; the epsilon keeps 0.05 at one step.
            let steps = (seconds / 0.05 - 1e-6).ceil().max(0.0);
            if steps > 0.0 {
                todo.push(Action::Dwell {
                    left_s: steps * 0.05,
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
        let offset = next.offset();
        let target: [f64; 3] = std::array::from_fn(|k| match axis_words[k] {
            Some(value) if absolute_machine => value * unit,
            Some(value) if next.incremental => next.position[k] + value * unit,
            Some(value) => value * unit + offset[k],
            None => next.position[k],
        });
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

/// G10 L2 and L20: where a work coordinate system has its origin.
fn set_system(
    words: &mut Words,
    axis_words: [Option<f64>; 3],
    unit: f64,
    next: &mut Modal,
    todo: &mut Vec<Action>,
) -> Result<(), u8> {
    if axis_words.iter().all(Option::is_none) {
        return Err(26);
    }
    let (Some(l), Some(p)) = (words.take(b'L'), words.take(b'P')) else {
        return Err(28);
    };
    if l != 2.0 && l != 20.0 {
        return Err(20);
    }
    let index = match p {
        0.0 => next.system,
        1.0..=6.0 => {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "1 to 6"
            )]
            let index = p as usize - 1;
            index
        }
        _ => return Err(29),
    };
    for (k, word) in axis_words.iter().enumerate() {
        if let Some(value) = word {
            next.systems[index][k] = if l == 2.0 {
                value * unit
            } else {
                next.position[k] - next.g92[k] - value * unit
            };
        }
    }
    todo.push(Action::Sync);
    todo.push(Action::Memory);
    Ok(())
}

/// A G2 or G3 from the present position, by centre or by radius.
fn arc(
    words: &mut Words,
    modal: &Modal,
    target: [f64; 3],
    drive: Drive,
    unit: f64,
    settings: &Settings,
) -> Result<Arc, u8> {
    let axes: [usize; 3] = match modal.plane {
        18 => [2, 0, 1],
        19 => [1, 2, 0],
        _ => [0, 1, 2],
    };
    let letters = [b'X', b'Y', b'Z'];
    if words.get(letters[axes[0]]).is_none() && words.get(letters[axes[1]]).is_none() {
        return Err(32);
    }
    let clockwise = modal.motion == 2;
    let from = [modal.position[axes[0]], modal.position[axes[1]]];
    let to = [target[axes[0]], target[axes[1]]];
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let (offset, radius) = if let Some(r) = words.take(b'R') {
        let mut r = r * unit;
        if x == 0.0 && y == 0.0 {
            return Err(33);
        }
        let h = 4.0 * r * r - x * x - y * y;
        if h < 0.0 {
            return Err(34);
        }
        let mut h = -h.sqrt() / x.hypot(y);
        if !clockwise {
            h = -h;
        }
        if r < 0.0 {
            h = -h;
            r = -r;
        }
        ([0.5 * (x - y * h), 0.5 * (y + x * h)], r)
    } else {
        let words_of = [b'I', b'J', b'K'];
        let given = [words.take(words_of[axes[0]]), words.take(words_of[axes[1]])];
        if given.iter().all(Option::is_none) {
            return Err(35);
        }
        let offset = given.map(|g| g.unwrap_or(0.0) * unit);
        let end = (x - offset[0]).hypot(y - offset[1]);
        let radius = offset[0].hypot(offset[1]);
        let off = (end - radius).abs();
        if off > 0.005 && (off > 0.5 || off > 0.001 * radius) {
            return Err(33);
        }
        (offset, radius)
    };
    let centre = [from[0] + offset[0], from[1] + offset[1]];
    let start = [-offset[0], -offset[1]];
    let end = [to[0] - centre[0], to[1] - centre[1]];
    let mut sweep =
        (start[0] * end[1] - start[1] * end[0]).atan2(start[0] * end[0] + start[1] * end[1]);
    // GRBL's threshold: below it the arc is a full circle.
    const FULL: f64 = 5e-7;
    if clockwise && sweep >= -FULL {
        sweep -= std::f64::consts::TAU;
    } else if !clockwise && sweep <= FULL {
        sweep += std::f64::consts::TAU;
    }
    let tolerance = settings.arc_tolerance_mm.min(radius);
    let chord = (tolerance * (2.0 * radius - tolerance)).sqrt();
    let count = (0.5 * sweep * radius).abs() / chord;
    // A hundred thousand segments are metres of radius; more would only stall the simulation.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped; NaN gives 0"
    )]
    let segments = count.floor().clamp(1.0, 1e5) as u32;
    Ok(Arc {
        drive,
        axes,
        centre,
        radius,
        start_angle: start[1].atan2(start[0]),
        sweep,
        from_linear: modal.position[axes[2]],
        target,
        next: 1,
        segments,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(lines: &[&str]) -> Result<(Modal, Vec<Action>), (usize, u8)> {
        let (mut modal, mut actions) = (Modal::new(), VecDeque::new());
        for (k, line) in lines.iter().enumerate() {
            interpret(
                line.as_bytes(),
                &mut modal,
                &Settings::default(),
                &mut actions,
            )
            .map_err(|e| (k, e))?;
        }
        Ok((modal, actions.into()))
    }

    #[test]
    fn errors_have_grbls_numbers() {
        for (line, error) in [
            ("1X2", 1),
            ("G1X", 2),
            ("G1X1F-5", 4),
            ("G5", 20),
            ("G38.2X1F5", 20),
            ("B3", 20),
            ("M6", 20),
            ("G0G1X1", 21),
            ("G20G21", 21),
            ("G1X1", 22),
            ("G1", 22),
            ("M3.5", 23),
            ("G92G0X1", 24),
            ("G0X1X2", 25),
            ("G92", 26),
            ("N20000000", 27),
            ("G4", 28),
            ("G10L2P9X0", 29),
            ("G53G2X1I1F100", 30),
            ("G80X1", 31),
            ("G2Z1I1F100", 32),
            ("G2X10I1F100", 33),
            ("G2X10R1F100", 34),
            ("G2X10F100", 35),
            ("G0X1P2", 36),
            ("T300", 38),
        ] {
            assert_eq!(run(&[line]).map(|_| ()), Err((0, error)), "{line}");
        }
    }

    #[test]
    fn a_line_in_error_changes_nothing() {
        let (mut modal, mut actions) = (Modal::new(), VecDeque::new());
        let before = modal.clone();
        let result = interpret(
            b"G91G20S7X1G1",
            &mut modal,
            &Settings::default(),
            &mut actions,
        );
        assert_eq!(result, Err(22));
        assert_eq!((modal, actions.len()), (before, 0));
    }

    #[test]
    fn offsets_units_and_increments_add_up() {
        let (modal, actions) = run(&["G92X10", "G0X11", "G20", "G91", "G0X1"]).unwrap();
        assert!(
            (modal.position[0] - 26.4).abs() < 1e-12,
            "{:?}",
            modal.position
        );
        assert_eq!(actions.len(), 2);
    }

    #[test]
    fn an_arc_stays_within_its_tolerance_and_ends_exactly() {
        let (_, actions) = run(&["G0X10Y0", "G3X10Y0I-10J0F600"]).unwrap();
        let Action::Arc(mut arc) = actions[1].clone() else {
            panic!("{actions:?}");
        };
        let mut last = [10.0, 0.0, 0.0];
        let mut length = 0.0;
        while let Some(p) = arc.point() {
            let middle = [(p[0] + last[0]) / 2.0, (p[1] + last[1]) / 2.0];
            assert!(10.0 - middle[0].hypot(middle[1]) < 0.0021);
            length += (p[0] - last[0]).hypot(p[1] - last[1]);
            last = p;
            arc.next += 1;
        }
        assert_eq!(last, [10.0, 0.0, 0.0]);
        assert!((length - std::f64::consts::TAU * 10.0).abs() < 0.01);
    }
}
