//! The words of one line, sorted by meaning.

use super::words::{Value, Word};
use super::{Beam, Dialect};
use crate::base::units::short;

const MM_PER_INCH: f64 = 25.4;

/// How the head moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    Rapid,
    Line,
    Clockwise,
    CounterClockwise,
    /// Down until the sheet is felt: Z alone.
    Probe,
}

/// LinuxCNC's outputs, M62 to M68.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Output {
    /// M62, M63: with the next motion; M64, M65: at once.
    Digital { on: bool, with_motion: bool },
    /// M67: with the next motion; M68: at once.
    Analog { with_motion: bool },
}

/// One line's words.
#[derive(Default)]
pub(super) struct Block {
    pub x: Option<f64>,
    pub y: Option<f64>,
    pub z: Option<f64>,
    pub i: Option<f64>,
    pub j: Option<f64>,
    pub r: Option<f64>,
    pub p: Option<f64>,
    pub q: Option<f64>,
    pub l: Option<f64>,
    pub e: Option<f64>,
    pub f: Option<Value>,
    pub s: Option<f64>,
    /// LinuxCNC's `$`: which of the tools M3 and M5 mean.
    pub tool: Option<f64>,
    pub motion: Option<Motion>,
    pub dwell: bool,
    pub machine_coordinates: bool,
    /// M3, M4, M5.
    pub beam: Option<Beam>,
    pub unit_mm: Option<f64>,
    pub absolute: Option<bool>,
    /// G92: where the head is, is called so.
    pub names_place: bool,
    /// G92.1: it is called as before.
    pub forgets_place: bool,
    pub output: Option<Output>,
    /// M190: a material of the table's own.
    pub material: bool,
    /// M66: until an input changes.
    pub waits: bool,
    pub end: bool,
}

fn once<T>(slot: &mut Option<T>, value: T, what: &str) -> Result<(), String> {
    match slot.replace(value) {
        None => Ok(()),
        Some(_) => Err(format!(
            "two words of one line say {what}: the controller refuses it"
        )),
    }
}

impl Block {
    /// Whether a motion is asked for, or words that only a motion takes.
    pub fn moves(&self) -> bool {
        self.motion.is_some()
            || [self.x, self.y, self.i, self.j, self.r]
                .iter()
                .any(Option::is_some)
    }

    pub fn gather(words: &[Word], dialect: Dialect) -> Result<Self, String> {
        let mut block = Self::default();
        for &(letter, value) in words {
            let Value::Number(number) = value else {
                once(&mut block.f, value, "F")?;
                continue;
            };
            let name = format!("{letter}{}", short(number, 3));
            let unknown = || {
                Err(format!(
                    "{name} is not known here: what it does cannot be checked"
                ))
            };
            let torch = dialect.is_torch();
            match letter {
                'X' => once(&mut block.x, number, "X")?,
                'Y' => once(&mut block.y, number, "Y")?,
                'Z' if torch => once(&mut block.z, number, "Z")?,
                'I' => once(&mut block.i, number, "I")?,
                'J' => once(&mut block.j, number, "J")?,
                'R' => once(&mut block.r, number, "R")?,
                'P' => once(&mut block.p, number, "P")?,
                'Q' if dialect.is_linuxcnc() => once(&mut block.q, number, "Q")?,
                'E' if dialect.is_linuxcnc() => once(&mut block.e, number, "E")?,
                '$' => once(&mut block.tool, number, "$")?,
                'F' => once(&mut block.f, value, "F")?,
                'S' => once(&mut block.s, number, "S")?,
                'L' if dialect.is_linuxcnc() => once(&mut block.l, number, "L")?,
                // A tool's number.
                'H' if dialect.is_linuxcnc() => {}
                'N' | 'T' => {}
                // G and M numbers are compared in tenths: G38.2 is not G38.
                'G' => {
                    if !block.general((number * 10.0).round() as i64, dialect)? {
                        return unknown();
                    }
                }
                'M' => {
                    if !block.miscellaneous((number * 10.0).round() as i64, dialect)? {
                        return unknown();
                    }
                }
                _ => return unknown(),
            }
        }
        let negative = matches!(block.f, Some(Value::Number(f)) if f < 0.0);
        if negative || block.s.is_some_and(|s| s < 0.0) {
            return Err("F and S must not be negative".into());
        }
        Ok(block)
    }

    /// A G word; false if it is not known.
    fn general(&mut self, code: i64, dialect: Dialect) -> Result<bool, String> {
        let torch = dialect.is_torch();
        match code {
            0 => once(&mut self.motion, Motion::Rapid, "how to move")?,
            10 => once(&mut self.motion, Motion::Line, "how to move")?,
            20 => once(&mut self.motion, Motion::Clockwise, "how to move")?,
            30 => once(&mut self.motion, Motion::CounterClockwise, "how to move")?,
            382..=385 if torch => once(&mut self.motion, Motion::Probe, "how to move")?,
            310 if dialect == Dialect::Table => {
                once(&mut self.motion, Motion::Probe, "how to move")?
            }
            40 => self.dwell = true,
            200 => once(&mut self.unit_mm, MM_PER_INCH, "the unit")?,
            210 => once(&mut self.unit_mm, 1.0, "the unit")?,
            530 => self.machine_coordinates = true,
            900 => once(&mut self.absolute, true, "absolute or relative")?,
            910 => once(&mut self.absolute, false, "absolute or relative")?,
            920 if torch => self.names_place = true,
            921 if torch => self.forgets_place = true,
            // XY plane, no cutter compensation, first coordinate system, exact path, feed per minute, relative arc
            // centres, no length offset.
            170 | 400 | 490 | 540 | 610 | 940 | 911 => {}
            // No canned cycle; blended path; a tool's offset from the table.
            800 if torch => {}
            640 if dialect != Dialect::Laser => {}
            430 if dialect.is_linuxcnc() => {}
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// An M word; false if it is not known.
    fn miscellaneous(&mut self, code: i64, dialect: Dialect) -> Result<bool, String> {
        let digital = |on, with_motion| Output::Digital { on, with_motion };
        match code {
            30 => once(&mut self.beam, Beam::Constant, "the beam")?,
            40 => once(&mut self.beam, Beam::Dynamic, "the beam")?,
            50 => once(&mut self.beam, Beam::Off, "the beam")?,
            20 | 300 => self.end = true,
            0 | 10 | 70 | 80 | 90 => {}
            // Tool change, adaptive feed.
            60 | 520 | 530 if dialect.is_linuxcnc() => {}
            660 if dialect.is_linuxcnc() => self.waits = true,
            620 if dialect.is_linuxcnc() => {
                once(&mut self.output, digital(true, true), "an output")?
            }
            630 if dialect.is_linuxcnc() => {
                once(&mut self.output, digital(false, true), "an output")?
            }
            640 if dialect.is_linuxcnc() => {
                once(&mut self.output, digital(true, false), "an output")?
            }
            650 if dialect.is_linuxcnc() => {
                once(&mut self.output, digital(false, false), "an output")?
            }
            670 if dialect.is_linuxcnc() => {
                once(
                    &mut self.output,
                    Output::Analog { with_motion: true },
                    "an output",
                )?;
            }
            680 if dialect.is_linuxcnc() => {
                once(
                    &mut self.output,
                    Output::Analog { with_motion: false },
                    "an output",
                )?;
            }
            1900 if dialect == Dialect::QtPlasmaC => self.material = true,
            _ => return Ok(false),
        }
        Ok(true)
    }
}
