//! A job, checked whole before anything is sent.

mod error;
mod words;

use self::words::{read_words, strip};
use crate::gcode::Dialect;
use crate::machine::{Machine, Tool};
use crate::material::Process;

pub use error::JobError;

/// What a job may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobRules {
    /// The longest line the controller takes, characters (79 for GRBL).
    pub line_limit: usize,
    /// M3 is allowed: the beam then stays on if the link fails.
    pub allow_constant_power: bool,
    /// What M3 and M4 switch. A torch is on or off, also at rest and on rapids: the controller must not be in laser mode.
    pub process: Process,
}

impl Default for JobRules {
    fn default() -> Self {
        Self {
            line_limit: 79,
            allow_constant_power: false,
            process: Process::Laser,
        }
    }
}

impl JobRules {
    /// What a machine's profile says. A torch has nothing but M3, so there the profile's word for it is enough; a laser's M3
    /// is to be allowed for each job.
    pub fn of(machine: &Machine) -> Self {
        Self {
            line_limit: machine.line_limit(),
            allow_constant_power: machine
                .plasma()
                .is_some_and(|torch| torch.accept_arc_on_after_lost_link),
            process: machine.tool().map_or(Process::Laser, Tool::process),
        }
    }
}

/// The longest G4, s. The sender waits so long for an answer before it calls the link dead.
const LONGEST_DWELL_S: f64 = 600.0;

/// Lines that are ready to be sent: no comments, no blanks, upper case.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    text: String,
    /// End of each line in `text`, and its number in the file.
    lines: Vec<(usize, usize)>,
    constant_power: bool,
    process: Process,
    largest_s: f64,
    longest_dwell_s: f64,
    line_limit: usize,
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
            process: rules.process,
            largest_s: 0.0,
            longest_dwell_s: 0.0,
            line_limit: rules.line_limit,
        };
        let mut beam_on = None;
        let mut s = 0.0;
        let mut rows = text.split(|&b| b == b'\n').enumerate().peekable();
        while let Some((index, row)) = rows.next() {
            let line = index + 1;
            // A return belongs to the newline after it, and the last row has none.
            let raw = match row {
                [head @ .., b'\r'] if rows.peek().is_some() => head,
                _ => row,
            };
            if raw.contains(&b'\r') {
                return Err(JobError::LoneReturn { line });
            }
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
            let found = read_words(kept, line, rules.process)?;
            // Without laser mode M4 is as constant as M3: a spindle that turns the other way.
            if found.m3 || (found.on && job.is_torch()) {
                if !rules.allow_constant_power {
                    return Err(match rules.process {
                        Process::Laser => JobError::ConstantPower { line },
                        Process::Plasma => JobError::Arc { line },
                    });
                }
                job.constant_power = true;
            }
            s = found.s.unwrap_or(s);
            if job.is_torch() && s <= 0.0 && (found.on || found.s.is_some() && beam_on.is_some()) {
                return Err(JobError::NoOutput { line });
            }
            if found.dwell_s > LONGEST_DWELL_S {
                return Err(JobError::Dwell {
                    line,
                    seconds: found.dwell_s,
                    limit: LONGEST_DWELL_S,
                });
            }
            if found.off {
                beam_on = None;
            } else if found.on {
                beam_on = Some(line);
            }
            job.largest_s = job.largest_s.max(found.s.unwrap_or(0.0));
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

    /// The lines from `first` on, after others that set the controller up for them; `before` is put at the beginning of
    /// one of the lines kept, which is given by its number in this job.
    ///
    /// # Errors
    /// The index of a line that became too long for the controller.
    pub(super) fn starting_at_line(
        &self,
        first: usize,
        lead: &[String],
        before: Option<(usize, &str)>,
    ) -> Result<Self, usize> {
        let mut job = Self {
            text: String::new(),
            lines: Vec::new(),
            ..self.clone()
        };
        let number = self.line(first).map_or(0, |(_, number)| number);
        for line in lead {
            job.text.push_str(line);
            job.lines.push((job.text.len(), number));
        }
        for (k, (text, number)) in self.lines().enumerate().skip(first) {
            let start = job.text.len();
            if let Some((_, words)) = before.filter(|(line, _)| *line == k) {
                job.text.push_str(words);
            }
            job.text.push_str(text);
            if job.text.len() - start > self.line_limit {
                return Err(k);
            }
            job.lines.push((job.text.len(), number));
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

    /// All lines in order, as [`Job::line`] gives them.
    pub fn lines(&self) -> impl Iterator<Item = (&str, usize)> {
        (0..self.len()).filter_map(|k| self.line(k))
    }

    /// True if the job uses M3.
    pub fn constant_power(&self) -> bool {
        self.constant_power
    }

    /// What M3 and M4 switch.
    pub(super) fn process(&self) -> Process {
        self.process
    }

    /// True if it drives a torch, on a controller without laser mode.
    pub fn is_torch(&self) -> bool {
        self.process == Process::Plasma
    }

    /// Whose rules it is read by.
    pub(super) fn dialect(&self) -> Dialect {
        match self.process {
            Process::Laser => Dialect::Laser,
            Process::Plasma => Dialect::Table,
        }
    }

    /// True if it feels for the sheet (G38), so that it does not matter how high the torch hung before.
    pub(super) fn probes(&self) -> bool {
        self.lines().any(|(text, _)| text.contains("G38."))
    }

    /// The largest S word.
    pub fn largest_s(&self) -> f64 {
        self.largest_s
    }

    /// True if it chooses the first coordinate system (G54); it chooses no other, or could not be followed.
    pub(super) fn names_first_system(&self) -> bool {
        // As a word of its own, not as the beginning of G540 or the end of one.
        self.lines().any(|(text, _)| {
            text.match_indices("G54")
                .any(|(at, _)| !text[at + 3..].starts_with(|c: char| c.is_ascii_digit()))
        })
    }

    /// The longest dwell, s: so long may the controller stand idle with lines unanswered.
    pub fn longest_dwell_s(&self) -> f64 {
        self.longest_dwell_s
    }
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
    fn commands_that_the_controller_reads_otherwise_than_written_are_refused() {
        for job in [
            "M3.004S500\nG1X10F100\nM5\n",
            "M4.004S500\nG1X10F100\n",
            "M2.99999999S5\nG1X1F100\n",
            "M259S5\nG1X1F100\n",
            "M4S5\nG1X1F100\nM000000005",
            "M4S5\nG1X1F100\nM-5",
            "G1.004X1F100",
            "G4.5P1",
            "G257X1F100",
        ] {
            let found = check(job);
            assert!(
                matches!(found, Err(JobError::Word { .. })),
                "{job:?}: {found:?}"
            );
        }
        assert!(check("M04.0 S5\nG01 X1.123456789 F100\nG91.1\nG92.1\nG61.1\nM05").is_ok());
    }

    #[test]
    fn words_that_write_the_controllers_memory_or_probe_are_refused() {
        for word in [
            "G10L2P1X0",
            "G10L20P1X0",
            "G28.1",
            "G30.1",
            "G38.2X1F1",
            "G38.5X1F1",
        ] {
            let found = check(&format!("M4S1\n{word}\nM5\n"));
            assert!(
                matches!(found, Err(JobError::Word { line: 2, .. })),
                "{word}: {found:?}"
            );
        }
    }

    #[test]
    fn a_return_without_a_newline_would_be_a_line_end_for_the_controller_only() {
        for (job, line) in [
            ("G1X10F100S500\rY10\rM4\rM5", 1),
            ("G21\nG1X1 (a\rb)\n", 2),
            ("G21\nG1X1;a\rM3\n", 2),
            ("G21\r\r\n", 1),
            ("G21\nG90\r", 2),
        ] {
            assert_eq!(check(job), Err(JobError::LoneReturn { line }), "{job:?}");
        }
        assert_eq!(check("G21\r\nG90\r\n\r\n").unwrap().len(), 2);
    }

    #[test]
    fn bytes_that_a_controller_may_obey_are_refused_in_comments_too() {
        for (job, byte) in [
            (&b"G21\nG1X1(\x84)"[..], 0x84),
            (b"G21\n;\xc3\xa4\n", 0xc3),
            (b"G21\nX\xe4", 0xe4),
        ] {
            let found = Job::check(job, &JobRules::default());
            assert_eq!(found, Err(JobError::NotAscii { line: 2, byte }));
        }
        assert_eq!(
            check("G21 ; \u{18}"),
            Err(JobError::Binary {
                line: 1,
                byte: 0x18
            })
        );
    }

    #[test]
    fn a_wait_has_a_limit() {
        assert_eq!(check("G4 P600").unwrap().longest_dwell_s(), 600.0);
        assert_eq!(
            check("G21\nG4 P99999"),
            Err(JobError::Dwell {
                line: 2,
                seconds: 99_999.0,
                limit: 600.0
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
