//! A job, checked whole before anything is sent.

/// What a job may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobRules {
    /// The longest line the controller takes, characters (79 for GRBL).
    pub line_limit: usize,
    /// M3 is allowed: the beam then stays on if the link fails.
    pub allow_constant_power: bool,
}

impl Default for JobRules {
    fn default() -> Self {
        Self {
            line_limit: 79,
            allow_constant_power: false,
        }
    }
}

/// Why a job is not sent. Nothing has reached the machine.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JobError {
    /// No line does anything.
    #[error("the job has no G-code in it: nothing was sent")]
    Empty,
    /// Not text.
    #[error(
        "line {line} holds the byte 0x{byte:02x}, which is not G-code: is this file a job? Nothing was sent"
    )]
    Binary {
        /// Line number in the file, from 1.
        line: usize,
        /// The byte.
        byte: u8,
    },
    /// A character that a controller takes out of the stream and obeys at once.
    #[error(
        "line {line} holds {character:?}, which the controller obeys the moment it arrives, and which no job may hold: remove it. Nothing was sent"
    )]
    Realtime {
        /// Line number, from 1.
        line: usize,
        /// The character.
        character: char,
    },
    /// A line longer than the controller's memory for one.
    #[error(
        "line {line} has {length} characters, but the controller takes {limit}: write the job with fewer decimals. Nothing was sent"
    )]
    TooLong {
        /// Line number, from 1.
        line: usize,
        /// Its length without spaces and comments.
        length: usize,
        /// The limit.
        limit: usize,
    },
    /// A word that is no G-code word.
    #[error("line {line}, {word:?}: {why}. Nothing was sent")]
    Word {
        /// Line number, from 1.
        line: usize,
        /// The word.
        word: String,
        /// What is wrong with it.
        why: &'static str,
    },
    /// A `$` line: a command for the controller.
    #[error(
        "line {line} is a command for the controller ({text}), not a part of a job: send it by itself. Nothing was sent"
    )]
    Command {
        /// Line number, from 1.
        line: usize,
        /// The line.
        text: String,
    },
    /// M3 without permission.
    #[error(
        "line {line} switches the beam to constant power (M3): if the cable is pulled it stays on while the head stands still, and no computer can switch it off. Use M4, or add --allow-constant-power and stay beside the machine. Nothing was sent"
    )]
    ConstantPower {
        /// Line number, from 1.
        line: usize,
    },
    /// The last word on the beam is "on".
    #[error(
        "line {line} switches the beam on and nothing after it switches it off: end the job with M5. Nothing was sent"
    )]
    BeamLeftOn {
        /// Line of the last M3 or M4, from 1.
        line: usize,
    },
}

/// Lines that are ready to be sent: no comments, no blanks, upper case.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    text: String,
    /// End of each line in `text`, and its number in the file.
    lines: Vec<(usize, usize)>,
    constant_power: bool,
    largest_s: f64,
    longest_dwell_s: f64,
}

impl Job {
    /// Reads and checks a job.
    ///
    /// # Errors
    /// The first thing that is wrong with it, with its line.
    pub fn check(text: &[u8], rules: &JobRules) -> Result<Self, JobError> {
        let mut job = Self {
            text: String::with_capacity(text.len()),
            lines: Vec::new(),
            constant_power: false,
            largest_s: 0.0,
            longest_dwell_s: 0.0,
        };
        let mut beam_on = None;
        for (index, raw) in text.split(|&b| b == b'\n').enumerate() {
            let line = index + 1;
            let start = job.text.len();
            strip(raw, line, &mut job.text)?;
            let kept = &job.text[start..];
            if kept.is_empty() || kept == "%" {
                job.text.truncate(start);
                continue;
            }
            if kept.starts_with('$') {
                return Err(JobError::Command {
                    line,
                    text: kept.to_owned(),
                });
            }
            if kept.len() > rules.line_limit {
                return Err(JobError::TooLong {
                    line,
                    length: kept.len(),
                    limit: rules.line_limit,
                });
            }
            let found = read_words(kept, line)?;
            if found.m3 {
                if !rules.allow_constant_power {
                    return Err(JobError::ConstantPower { line });
                }
                job.constant_power = true;
            }
            if found.off {
                beam_on = None;
            } else if found.on {
                beam_on = Some(line);
            }
            job.largest_s = job.largest_s.max(found.s);
            job.longest_dwell_s = job.longest_dwell_s.max(found.dwell_s);
            job.lines.push((job.text.len(), line));
        }
        if let Some(line) = beam_on {
            return Err(JobError::BeamLeftOn { line });
        }
        if job.lines.is_empty() {
            return Err(JobError::Empty);
        }
        Ok(job)
    }

    /// How many lines will be sent.
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// True if there is nothing to send; a checked job never is.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// The text of line `k` as sent, without its newline, and its number in the file; none past the end.
    pub fn line(&self, k: usize) -> Option<(&str, usize)> {
        let &(end, number) = self.lines.get(k)?;
        let start = k.checked_sub(1).map_or(0, |before| self.lines[before].0);
        Some((&self.text[start..end], number))
    }

    /// True if the job uses M3.
    pub fn constant_power(&self) -> bool {
        self.constant_power
    }

    /// The largest S word.
    pub fn largest_s(&self) -> f64 {
        self.largest_s
    }

    /// The longest dwell, s: so long may the controller stand idle with lines unanswered.
    pub fn longest_dwell_s(&self) -> f64 {
        self.longest_dwell_s
    }
}

/// Appends a line without blanks and comments, upper case.
fn strip(raw: &[u8], line: usize, into: &mut String) -> Result<(), JobError> {
    let mut paren = false;
    for &byte in raw {
        match byte {
            // Realtime bytes act even inside a comment, if one were sent; comments are not, but a job that holds
            // them should not be sent by other programs either. In a comment they are only text.
            b')' if paren => paren = false,
            _ if paren && (byte >= 0x20 || byte == b'\t' || byte == b'\r') => {}
            b'(' => paren = true,
            b';' => break,
            b' ' | b'\t' | b'\r' => {}
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

#[derive(Default)]
struct Found {
    m3: bool,
    on: bool,
    off: bool,
    s: f64,
    dwell_s: f64,
}

fn read_words(text: &str, line: usize) -> Result<Found, JobError> {
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
            'M' => {
                found.m3 |= value == 3.0;
                found.on |= value == 3.0 || value == 4.0;
                found.off |= value == 5.0 || value == 2.0 || value == 30.0;
            }
            'G' => dwell |= value == 4.0,
            'S' => found.s = value,
            'P' => p = value,
            _ => {}
        }
        rest = after;
    }
    if dwell {
        found.dwell_s = p;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str) -> Result<Job, JobError> {
        Job::check(text.as_bytes(), &JobRules::default())
    }

    #[test]
    fn comments_and_blanks_are_not_sent_and_lines_keep_their_numbers() {
        let job =
            check("%\n(head!)\ng21 g90 ; mm\r\n\nM4 s500\nG1 X1 F100\nG4 P2.5\nM5\n").unwrap();
        let lines: Vec<_> = (0..job.len()).filter_map(|k| job.line(k)).collect();
        assert_eq!(
            lines,
            [
                ("G21G90", 3),
                ("M4S500", 5),
                ("G1X1F100", 6),
                ("G4P2.5", 7),
                ("M5", 8)
            ]
        );
        assert_eq!((job.largest_s(), job.longest_dwell_s()), (500.0, 2.5));
        assert!(!job.constant_power() && job.line(5).is_none());
    }

    #[test]
    fn what_no_machine_should_get_is_refused_with_its_line() {
        assert_eq!(check(""), Err(JobError::Empty));
        assert_eq!(check("\n(nothing)\n"), Err(JobError::Empty));
        assert_eq!(
            check("G21\nG1\u{0}X"),
            Err(JobError::Binary { line: 2, byte: 0 })
        );
        assert!(matches!(
            check("G1 X1 ! F3"),
            Err(JobError::Realtime { character: '!', .. })
        ));
        assert!(matches!(
            check("$H"),
            Err(JobError::Command { line: 1, .. })
        ));
        assert!(matches!(check("G1X1E3"), Err(JobError::Word { .. })));
        assert!(matches!(check("G1X1-2"), Err(JobError::Word { .. })));
        assert!(matches!(check("5"), Err(JobError::Word { .. })));
        assert_eq!(
            check("G21\nM3 S1\nM5"),
            Err(JobError::ConstantPower { line: 2 })
        );
        assert_eq!(
            check("M4 S1\nM5\nM4\nG1X1F1"),
            Err(JobError::BeamLeftOn { line: 3 })
        );
        let long = format!("G1X{}", "1".repeat(90));
        assert_eq!(
            check(&long),
            Err(JobError::TooLong {
                line: 1,
                length: 93,
                limit: 79
            })
        );
    }

    #[test]
    fn constant_power_passes_when_asked_for() {
        let rules = JobRules {
            allow_constant_power: true,
            ..JobRules::default()
        };
        assert!(Job::check(b"M03 S1\nM5", &rules).unwrap().constant_power());
    }
}
