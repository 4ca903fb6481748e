//! Why a job is not sent.

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
    /// Not ASCII.
    #[error(
        "line {line} holds the byte 0x{byte:02x}, which is not ASCII, and which a controller may obey the moment it arrives, also in a comment: write the line without umlauts, accents and symbols. Nothing was sent"
    )]
    NotAscii {
        /// Line number, from 1.
        line: usize,
        /// The byte.
        byte: u8,
    },
    /// A carriage return that no newline follows.
    #[error(
        "line {line} holds a carriage return that no newline follows: the controller would read two lines, other programs one. Save the file with line ends \\n or \\r\\n. Nothing was sent"
    )]
    LoneReturn {
        /// Line number, from 1.
        line: usize,
    },
    /// A wait longer than any job needs.
    #[error(
        "line {line} waits for {seconds} s (G4 P is in seconds), and a job may wait {limit} s at a time: while the machine waits nobody can tell it from one that has died. Write a shorter wait. Nothing was sent"
    )]
    Dwell {
        /// Line number, from 1.
        line: usize,
        /// How long, s.
        seconds: f64,
        /// The limit, s.
        limit: f64,
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
    /// A torch without permission.
    #[error(
        "line {line} switches the torch on (M3): if the cable is pulled in mid-cut it stays on, and no computer can switch it off. If you will stay beside the table, write accept_arc_on_after_lost_link = true in its profile. Nothing was sent"
    )]
    Arc {
        /// Line number, from 1.
        line: usize,
    },
    /// A torch that is switched on with no S above 0.
    #[error(
        "line {line} switches the torch on without power (S): the controller switches its output only for an S above 0, so the head would go its way dark. Write M3 S1000, or what $30 is on the table. Nothing was sent"
    )]
    NoOutput {
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
