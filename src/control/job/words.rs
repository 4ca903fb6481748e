//! The words of a line, as far as they must be known before it is sent.

use super::JobError;
use crate::material::Process;

/// Digits that GRBL reads of a number; it takes the others for zeros, leading zeros included: `M000000005` is M0.
const DIGITS: usize = 8;

/// Appends a line without blanks and comments, upper case.
pub(super) fn strip(raw: &[u8], line: usize, into: &mut String) -> Result<(), JobError> {
    let (mut paren, mut semicolon) = (false, false);
    for &byte in raw {
        match byte {
            0x80.. => return Err(JobError::NotAscii { line, byte }),
            // Realtime bytes act even inside a comment, if one were sent; comments are not, but a job that holds
            // them should not be sent by other programs either. In a comment they are only text.
            b' '..=b'~' | b'\t' if semicolon => {}
            b')' if paren => paren = false,
            b' '..=b'~' | b'\t' if paren => {}
            b'(' => paren = true,
            b';' => semicolon = true,
            b' ' | b'\t' => {}
            b'!' | b'~' | b'?' => {
                return Err(JobError::Realtime {
                    line,
                    character: char::from(byte),
                });
            }
            0x21..=0x7e => into.push(char::from(byte.to_ascii_uppercase())),
            _ => return Err(JobError::Binary { line, byte }),
        }
    }
    Ok(())
}

/// What a line says that matters before it is sent.
#[derive(Default)]
pub(super) struct Found {
    pub m3: bool,
    pub on: bool,
    pub off: bool,
    pub s: Option<f64>,
    pub dwell_s: f64,
}

pub(super) fn read_words(text: &str, line: usize, process: Process) -> Result<Found, JobError> {
    let mut found = Found::default();
    let mut dwell = false;
    let mut p = 0.0;
    let mut rest = text;
    while let Some(letter) = rest.chars().next() {
        let wrong = |word: &str, why| JobError::Word {
            line,
            word: word.to_owned(),
            why,
        };
        if !letter.is_ascii_uppercase() {
            return Err(wrong(rest, "a G-code word begins with a letter"));
        }
        let end = rest[1..]
            .find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '+' | '-')))
            .map_or(rest.len(), |n| n + 1);
        let (word, after) = rest.split_at(end);
        if !"FGIJKLMNPRSTXYZ".contains(letter) {
            return Err(wrong(word, "no GRBL controller knows this letter"));
        }
        let value: f64 = word[1..]
            .parse()
            .map_err(|_| wrong(word, "a letter must be followed by a number"))?;
        match letter {
            'G' | 'M' if word.bytes().filter(u8::is_ascii_digit).count() > DIGITS => {
                return Err(wrong(
                    word,
                    "a command has a number of so many digits that the controller reads another one",
                ));
            }
            // The firmware keeps the whole part in a byte: M259 is M3.
            'G' | 'M' if !(0.0..256.0).contains(&value) => {
                return Err(wrong(word, "commands are numbered from 0 to 255"));
            }
            // And rounds the fraction to hundredths: M3.004 is M3.
            'M' if value.fract() != 0.0 => {
                return Err(wrong(word, "M commands are whole numbers"));
            }
            'G' if value == 10.0 || value == 28.1 || value == 30.1 => {
                return Err(wrong(
                    word,
                    "this writes the controller's memory, and while it writes it loses what is sent: set the origin before the job, not in it",
                ));
            }
            // With its height control, a torch feels for the sheet before each cut.
            'G' if process == Process::Plasma && [38.2, 38.3, 38.4, 38.5].contains(&value) => {}
            'G' if value.trunc() == 38.0 => {
                return Err(wrong(
                    word,
                    "a laser has no probe, and a job must not move until something is touched",
                ));
            }
            'G' if value.fract() != 0.0 && ![43.1, 61.1, 91.1, 92.1].contains(&value) => {
                return Err(wrong(word, "no GRBL controller knows this command"));
            }
            'M' => {
                found.m3 |= value == 3.0;
                found.on |= value == 3.0 || value == 4.0;
                found.off |= value == 5.0 || value == 2.0 || value == 30.0;
            }
            'G' => dwell |= value == 4.0,
            'S' => found.s = Some(value),
            'P' => p = value.max(p),
            _ => {}
        }
        rest = after;
    }
    if dwell {
        found.dwell_s = p;
    }
    Ok(found)
}
