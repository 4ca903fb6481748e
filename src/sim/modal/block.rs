//! The words of one line, sorted by what they are for.

use super::Spindle;
use crate::sim::words::next_word;

/// The words of a line, by what they are for.
#[derive(Default)]
pub(super) struct Words {
    pub value: [Option<f64>; 26],
    /// 0 to 3 and 80; 382 to 385 for the ways of probing.
    pub motion: Option<u16>,
    /// G4, G10, G28, G28.1, G30, G30.1, G53, G92, G92.1 as the integer times ten, plus the fraction's first digit.
    pub other: Option<u16>,
    pub plane: Option<u8>,
    pub inches: Option<bool>,
    pub incremental: Option<bool>,
    /// G93, not G94.
    pub inverse_time: Option<bool>,
    /// G43.1, not G49.
    pub tool_length: Option<bool>,
    pub system: Option<usize>,
    pub flow: Option<u8>,
    pub spindle: Option<Spindle>,
    pub coolant: Option<u8>,
    /// Modal groups seen, by a number of our own.
    groups: u16,
}

impl Words {
    pub fn take(&mut self, letter: u8) -> Option<f64> {
        self.value[usize::from(letter - b'A')].take()
    }

    pub fn get(&self, letter: u8) -> Option<f64> {
        self.value[usize::from(letter - b'A')]
    }

    fn group(&mut self, group: u16) -> Result<(), u8> {
        if self.groups & (1 << group) != 0 {
            return Err(21);
        }
        self.groups |= 1 << group;
        Ok(())
    }

    pub fn read(line: &[u8]) -> Result<Self, u8> {
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
            (28 | 30 | 43 | 91 | 92, 10) => u16::from(number) * 10 + 1,
            (38, 20 | 30 | 40 | 50) => 380 + u16::from(hundredths) / 10,
            // Whatever its fraction.
            (49, _) => 490,
            (0..=4 | 10 | 17..=21 | 40 | 53..=59 | 80 | 93 | 94, _) => return Err(23),
            _ => return Err(20),
        };
        match code {
            0 | 10 | 20 | 30 | 800 => {
                self.group(1)?;
                self.motion = Some(code / 10);
            }
            382..=385 => {
                self.group(1)?;
                self.motion = Some(code);
            }
            40 | 100 | 280 | 281 | 300 | 301 | 530 | 920 | 921 => {
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
            930 | 940 => {
                self.group(5)?;
                self.inverse_time = Some(code == 930);
            }
            200 | 210 => {
                self.group(6)?;
                self.inches = Some(code == 200);
            }
            400 => self.group(7)?,
            431 | 490 => {
                self.group(8)?;
                self.tool_length = Some(code == 431);
            }
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
            0..=2 | 30 => {
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
