//! Why a running job was stopped.

use std::fmt;

/// Why a running job was stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum StopReason {
    /// The person asked for it.
    Interrupted,
    /// The controller refused a line.
    Refused {
        /// GRBL's error number.
        error: u32,
        /// Number of the line in the file.
        line: usize,
        /// The line.
        text: String,
    },
    /// The controller locked itself.
    Alarm(u32),
    /// The controller started anew in the middle of the job.
    Reset(String),
    /// The controller does not answer.
    Silent {
        /// For how long, s.
        seconds: f64,
    },
    /// The machine is paused and nobody resumes it.
    Paused {
        /// For how long, s.
        seconds: f64,
    },
    /// An answer that no line was waiting for, or a line that got none: bytes were lost or damaged.
    Ledger(String),
    /// The head is where no line of the job takes it.
    Astray {
        /// Distance to the nearest place on the job's way, mm.
        by_mm: f64,
    },
    /// The journal cannot be written, so the job could not be resumed.
    Journal(String),
    /// The machine is paused, and its torch could not be switched off by itself.
    HeldOn,
    /// The job was acknowledged to its end and the machine stands, but its beam is on.
    BeamOn {
        /// The power told, S; none if only the output is known to be on.
        s: Option<f64>,
    },
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interrupted => f.write_str("interrupted"),
            Self::Refused { error, line, text } => write!(
                f,
                "the controller refused line {line} ({text}) with error {error}: {}",
                error_words(*error)
            ),
            Self::Alarm(n) => write!(f, "the controller raised alarm {n}: {}", alarm_words(*n)),
            Self::Reset(banner) => write!(
                f,
                "the controller started anew in the middle of the job ({banner}): check its power supply and the emergency stop"
            ),
            Self::Silent { seconds } => {
                write!(f, "the controller has not answered for {seconds:.1} s")
            }
            Self::Paused { seconds } => write!(
                f,
                "the machine has been paused for {seconds:.0} s (M0 in the job, or a hold) and nobody resumes it"
            ),
            Self::Ledger(what) => write!(
                f,
                "{what}: bytes were lost or damaged on the way; use a shorter, better shielded cable"
            ),
            Self::Astray { by_mm } => write!(
                f,
                "the head is {by_mm:.1} mm from where the job can have taken it: a line was damaged on the way, or the controller's zero point was moved"
            ),
            Self::Journal(why) => write!(
                f,
                "the journal cannot be written ({why}), and without it the job could not be resumed: make room on the disk"
            ),
            Self::HeldOn => f.write_str(
                "the machine is paused and was not seen to switch its torch off, neither for the spindle stop nor for the safety door",
            ),
            Self::BeamOn { s: Some(s) } => write!(
                f,
                "the job has ended but the machine reports power S{s}: its beam was on while standing"
            ),
            Self::BeamOn { s: None } => f.write_str(
                "the job has ended but the machine reports that its output is on: the torch burnt while standing",
            ),
        }
    }
}

/// GRBL's errors, in words for a person.
pub(in crate::control) fn error_words(number: u32) -> &'static str {
    match number {
        1 | 2 => "a word of it is damaged",
        8 => "it must be idle for this",
        9 => "it is locked; unlock or home it",
        11 => "the line is too long for it",
        20 => "it does not know a word of it",
        21 => "two words of it contradict each other",
        22 => "no feed rate (F) has been set",
        24 | 25 => "a word is repeated or two commands want the same axes",
        33..=35 => "the arc is not valid",
        _ => "see GRBL's list of errors",
    }
}

/// GRBL's alarms, in words for a person.
pub(in crate::control) fn alarm_words(number: u32) -> &'static str {
    match number {
        1 => "a limit switch was hit; position may be lost",
        2 => "the job leaves the machine's travel",
        3 => "it was reset while moving; position is lost",
        4 => "the probe touched before it set out: is the torch on the sheet, or its switch stuck?",
        5 => "the probe found no sheet: does it lie under the torch, and does its switch work?",
        6..=9 => "homing failed",
        _ => "see GRBL's list of alarms",
    }
}
