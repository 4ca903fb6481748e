//! The lines of G-code in a profile: what they may do, checked before any job is written with them.
//!
//! Only words whose effect is known here may stand there, and none that would move the head over the sheet, change
//! what coordinates mean, or switch the tool on anywhere but where a cut begins. The interpreter judges the whole job
//! again; this check comes earlier, and names the key.

use super::controller::Controller;
use crate::base::document::Complaint;

/// Where in a job a line stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Where {
    /// Before the first motion.
    Preamble,
    /// After the head is parked; `last` for the very last line.
    Postamble {
        /// The last line.
        last: bool,
    },
    /// Anywhere with the tool off: air.
    Frame,
    /// At the pierce.
    BeginCut,
    /// At the end of a cut.
    EndCut,
}

/// What a line does to the tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effect {
    /// M3.
    pub tool_on: bool,
    /// M5.
    pub tool_off: bool,
    /// The S word, if its number is written out.
    pub s: Option<f64>,
}

/// Whether coordinates are places or steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distance {
    /// G90.
    Absolute,
    /// G91.
    Relative,
}

/// The last distance mode that a line sets.
pub fn distance_mode(line: &str) -> Option<Distance> {
    words(line)
        .ok()?
        .iter()
        .rev()
        .find_map(|w| match (w.letter, tenths(w.value?)) {
            ('G', 900) => Some(Distance::Absolute),
            ('G', 910) => Some(Distance::Relative),
            _ => None,
        })
}

/// A letter with its number; none if the number is an expression, or a spindle as in `M3 $0`.
struct Word<'a> {
    letter: char,
    value: Option<f64>,
    text: &'a str,
}

fn tenths(value: f64) -> i64 {
    (value * 10.0).round() as i64
}

/// The words of a line without its comments.
fn words(line: &str) -> Result<Vec<Word<'_>>, String> {
    let mut words = Vec::new();
    let mut rest = line.trim_start();
    while let Some(letter) = rest.chars().next() {
        match letter {
            ';' => break,
            '(' => {
                let inside = &rest[1..];
                let end = inside
                    .find(')')
                    .ok_or("opens a comment with ( and never closes it")?;
                if inside[..end].contains('(') {
                    return Err(
                        "has a ( inside a comment: controllers do not agree on where that ends"
                            .into(),
                    );
                }
                rest = inside[end + 1..].trim_start();
            }
            'A'..='Z' | 'a'..='z' | '$' => {
                let body = rest[1..].trim_start();
                let number = body
                    .find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)))
                    .unwrap_or(body.len());
                let length = if number > 0 {
                    number
                } else {
                    expression(body)?
                };
                if length == 0 {
                    return Err(format!("has {letter} without a number"));
                }
                let text = &body[..length];
                let value = if number > 0 {
                    let v = text
                        .parse::<f64>()
                        .map_err(|_| format!("has {letter}{text}, which is no number"))?;
                    Some(v)
                } else {
                    None
                };
                words.push(Word {
                    letter: letter.to_ascii_uppercase(),
                    value,
                    text,
                });
                rest = body[length..].trim_start();
            }
            ')' => return Err("closes a comment with ) that was never opened".into()),
            other => {
                return Err(format!(
                    "has {other:?}, which has no meaning in G-code here"
                ));
            }
        }
    }
    Ok(words)
}

/// Length of a LinuxCNC parameter or expression at the beginning of `text`: `#5`, `#<name>`, `#<_hal[pin]>`, `[1+2]`.
fn expression(text: &str) -> Result<usize, String> {
    let (skip, open, close) = match text.as_bytes() {
        [b'#', b'<', ..] => (1, '<', '>'),
        [b'[', ..] => (0, '[', ']'),
        [b'#', ..] => {
            let digits = text[1..].bytes().take_while(u8::is_ascii_digit).count();
            return Ok(if digits > 0 { digits + 1 } else { 0 });
        }
        _ => return Ok(0),
    };
    let mut depth = 0usize;
    for (at, c) in text.char_indices().skip(skip) {
        if c == open {
            depth += 1;
        } else if c == close {
            depth -= 1;
            if depth == 0 {
                return Ok(at + 1);
            }
        }
    }
    Err(format!("has {text:?}, which is never closed"))
}

/// Checks one line for its place.
///
/// # Errors
/// [`Complaint`] with `key`.
pub fn check(
    key: &str,
    line: &str,
    controller: Controller,
    limit: usize,
    place: Where,
) -> Result<Effect, Complaint> {
    let no = |problem: String| Complaint::new(key, problem);
    if line.len() > limit {
        return Err(no(format!(
            "has {} characters; the controller takes {limit} in a line",
            line.len()
        )));
    }
    if line.trim().is_empty() {
        return Err(no("is an empty line".into()));
    }
    // `?`, `!` and `~` act at once wherever they stand, also in a comment.
    if let Some(c) = line
        .chars()
        .find(|c| !(' '..='}').contains(c) || "?!".contains(*c))
    {
        return Err(no(format!(
            "has the character {c:?}, which a line of G-code must not hold"
        )));
    }
    if line.trim_start().starts_with('$') {
        return Err(no(
            "is a command to the controller, not G-code: a job must not change settings".into(),
        ));
    }
    let words = words(line).map_err(no)?;
    let mut effect = Effect::default();
    for word in &words {
        judge(word, controller, place, &mut effect).map_err(no)?;
    }
    Ok(effect)
}

fn judge(
    word: &Word<'_>,
    controller: Controller,
    place: Where,
    effect: &mut Effect,
) -> Result<(), String> {
    let name = format!("{}{}", word.letter, word.text);
    let in_cut = matches!(place, Where::BeginCut | Where::EndCut);
    let unknown = || {
        Err(format!(
            "has {name}, which is not known here: what it does to the cuts cannot be checked"
        ))
    };
    match word.letter {
        'X' | 'Y' | 'I' | 'J' | 'A' | 'B' | 'C' | 'U' | 'V' | 'W' => {
            return Err(format!(
                "has {name}: a line of the profile must not move the head over the sheet"
            ));
        }
        'Z' if !in_cut => {
            return Err(format!(
                "has {name}: only a cut's template moves the torch up and down"
            ));
        }
        'S' => {
            effect.s = word.value;
            return Ok(());
        }
        'Z' | 'F' | 'P' | 'Q' | 'K' | 'N' | 'E' | 'L' | 'H' | 'R' | 'T' => return Ok(()),
        '$' => {
            return if controller == Controller::LinuxCnc {
                Ok(())
            } else {
                unknown()
            };
        }
        'G' | 'M' => {}
        _ => return unknown(),
    }
    let Some(value) = word.value else {
        return Err(format!(
            "has {name}: the number of a G or M word must be written out"
        ));
    };
    let code = tenths(value);
    let files = !controller.is_streamed();
    let fine = if word.letter == 'G' {
        match code {
            // Wait, plane, millimetres, no compensation, first coordinate system, path modes, feed per minute.
            40 | 170 | 210 | 400 | 490 | 540 | 610 | 800 | 900 | 911 | 940 => true,
            // Motion of Z alone, relative steps, probing, setting Z, in the template of a cut.
            0 | 10 if !in_cut => {
                return Err(format!(
                    "has {name}: a line of the profile must not move the head"
                ));
            }
            // GRBL and its successors know no G31.
            310 => in_cut && files,
            0 | 10 | 382 | 383 | 910 | 920 => in_cut,
            640 => files,
            // Forgets what a template's G92 Z has set.
            921 => in_cut || matches!(place, Where::Postamble { .. }),
            200 => return Err("has G20: the job is written in millimetres".into()),
            _ => false,
        }
    } else {
        match code {
            30 | 40 if place == Where::BeginCut => {
                if code == 40 {
                    return Err("has M4: a torch is switched on with M3".into());
                }
                effect.tool_on = true;
                true
            }
            30 | 40 => {
                return Err(format!(
                    "has {name}, which switches the tool on; that belongs to the cuts"
                ));
            }
            50 => {
                if place == Where::BeginCut {
                    return Err("has M5: the torch must be on when begin_cut is done".into());
                }
                effect.tool_off = true;
                true
            }
            20 | 300 => match place {
                Where::Postamble { last: true } => true,
                _ => {
                    return Err(format!(
                        "has {name}, which ends the program; only the last line of the postamble may"
                    ));
                }
            },
            70 | 80 | 90 => true,
            0 | 10 => {
                return Err(format!(
                    "has {name}, which stops for a person: a job runs by itself once started"
                ));
            }
            520 | 530 | 620 | 630 | 640 | 650 | 660 | 670 | 680 | 1900 => {
                controller == Controller::LinuxCnc
            }
            _ => false,
        }
    };
    if fine { Ok(()) } else { unknown() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(line: &str, controller: Controller, place: Where) -> Option<String> {
        check("k", line, controller, 79, place)
            .err()
            .map(|c| c.problem)
    }

    #[test]
    fn harmless_lines_pass_and_every_kind_of_harm_is_named() {
        let last = Where::Postamble { last: true };
        for (line, controller, place) in [
            ("G54", Controller::Grbl, Where::Preamble),
            (
                "g17 g21 g90 (modes) G94 ; all",
                Controller::Grbl,
                Where::Preamble,
            ),
            ("M2", Controller::Grbl, last),
            ("M8", Controller::Grbl, Where::Frame),
            ("G64 P0.01 Q0.01", Controller::LinuxCnc, Where::Preamble),
            ("M68 E3 Q0", Controller::LinuxCnc, Where::Preamble),
            ("M66 P3 L3 Q1", Controller::LinuxCnc, Where::Preamble),
            (
                "F#<_hal[plasmac.cut-feed-rate]>",
                Controller::LinuxCnc,
                Where::Preamble,
            ),
            ("G31 Z-100 F500", Controller::Generic, Where::BeginCut),
            ("G38.2 Z-50 F300", Controller::LinuxCnc, Where::BeginCut),
            ("G91 G0 Z-1 G90", Controller::Generic, Where::BeginCut),
            ("M5", Controller::Generic, Where::EndCut),
        ] {
            assert_eq!(problem(line, controller, place), None, "{line}");
        }
        for (line, controller, place, word) in [
            ("G0 X1", Controller::Grbl, Where::Preamble, "move"),
            ("G1 Y1", Controller::Generic, Where::BeginCut, "move"),
            ("Z5", Controller::LinuxCnc, Where::Preamble, "up and down"),
            ("G92 X0", Controller::Grbl, Where::Preamble, "G92"),
            ("G28", Controller::Grbl, Where::Preamble, "G28"),
            ("G20", Controller::Grbl, Where::Preamble, "millimetres"),
            ("G91", Controller::Grbl, Where::Preamble, "G91"),
            ("M3 S5", Controller::Grbl, Where::Preamble, "on"),
            ("M4", Controller::Grbl, Where::Frame, "on"),
            ("M3", Controller::Generic, Where::EndCut, "on"),
            ("M4", Controller::Generic, Where::BeginCut, "M3"),
            ("M5", Controller::Generic, Where::BeginCut, "M5"),
            ("M2", Controller::Grbl, Where::Preamble, "ends"),
            (
                "M30",
                Controller::Grbl,
                Where::Postamble { last: false },
                "ends",
            ),
            ("M0", Controller::Grbl, Where::Preamble, "person"),
            ("M68 E3 Q0", Controller::Grbl, Where::Preamble, "M68"),
            ("$H", Controller::Grbl, Where::Preamble, "command"),
            (
                "G54 (half",
                Controller::Grbl,
                Where::Preamble,
                "never closes",
            ),
            ("G54 (a (b))", Controller::Grbl, Where::Preamble, "inside"),
            ("G54 )", Controller::Grbl, Where::Preamble, "never opened"),
            ("G", Controller::Grbl, Where::Preamble, "without"),
            ("G#5", Controller::LinuxCnc, Where::Preamble, "written out"),
            (
                "F#<half",
                Controller::LinuxCnc,
                Where::Preamble,
                "never closed",
            ),
            ("G1.2.3", Controller::Grbl, Where::Preamble, "no number"),
            ("O100", Controller::LinuxCnc, Where::Preamble, "O100"),
        ] {
            let text = problem(line, controller, place).unwrap_or_default();
            assert!(text.contains(word), "{line}: {text:?}");
        }
    }
}
