//! What is known after a job: all of it done, or how far it came, and what the beam does.

use std::fmt;

use serde::Serialize;

/// A job that ran to its end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SendReport {
    /// Lines sent.
    pub lines: usize,
    /// Lines acknowledged: all of them.
    pub acknowledged: usize,
    /// Bytes sent for them.
    pub bytes: u64,
    /// Cuts of the job that are proven to be made; of a job that cannot be followed 0.
    pub cuts: usize,
    /// From the first byte of the job to the report that the machine stands, s on the link's clock.
    pub time_s: f64,
    /// The most bytes that were unanswered at any moment.
    pub max_in_flight: usize,
    /// The controller's receive buffer, bytes.
    pub buffer: usize,
    /// What the controller calls itself.
    pub firmware: String,
    /// Where the machine stood at the end, as it tells, mm.
    pub position_mm: Option<[f64; 3]>,
}

/// What is known about the beam after a stop.
#[derive(Clone, Debug, PartialEq)]
pub enum Proof {
    /// The controller reported: standing, power 0.
    BeamOff {
        /// It came to rest before the reset, so its position is still true.
        position_kept: bool,
    },
    /// No report says so.
    Unknown {
        /// Why not.
        why: String,
    },
    /// The link is gone.
    LinkLost {
        /// The job uses M3.
        constant_power: bool,
    },
}

impl fmt::Display for Proof {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BeamOff { position_kept: true } => f.write_str(
                "the machine reports that it stands, the beam is off and its position is kept",
            ),
            Self::BeamOff { position_kept: false } => f.write_str(
                "the machine reports that it stands and the beam is off; it was stopped in motion, so home it before the next job",
            ),
            Self::Unknown { why } => write!(
                f,
                "IT COULD NOT BE CONFIRMED THAT THE BEAM IS OFF ({why}): switch the machine off by hand"
            ),
            Self::LinkLost { constant_power: false } => f.write_str(
                "nothing more can be confirmed: lines already in the controller may still run; the job uses M4 only, so the beam goes off when they end. Stay beside the machine until it stands",
            ),
            Self::LinkLost { constant_power: true } => f.write_str(
                "THE BEAM MAY STAY ON: the job uses M3, and no computer can switch it off now. Switch the machine off by hand",
            ),
        }
    }
}

/// How far a job came.
#[derive(Clone, Debug, PartialEq)]
pub struct Confirmed {
    /// Lines in the job.
    pub lines: usize,
    /// Lines sent.
    pub sent: usize,
    /// Lines acknowledged: planned by the controller, not necessarily cut.
    pub acknowledged: usize,
    /// The number in the file of the last line acknowledged.
    pub last_line: Option<usize>,
    /// Cuts of the job; 0 for one that cannot be followed.
    pub cuts: usize,
    /// Cuts that are proven to be made, of the first so many.
    pub proven: usize,
    /// The last position that the machine told, mm.
    pub position_mm: Option<[f64; 3]>,
    /// What is known about the beam.
    pub proof: Proof,
}

impl fmt::Display for Confirmed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} lines sent, {} acknowledged (planned, not all of them cut)",
            self.sent, self.lines, self.acknowledged
        )?;
        if let Some(line) = self.last_line {
            write!(f, ", the last one line {line} of the file")?;
        }
        if self.cuts > 0 {
            write!(f, "; {} of {} cuts proven made", self.proven, self.cuts)?;
        }
        if let Some([x, y, _]) = self.position_mm {
            write!(f, "; last position told: X{x:.3} Y{y:.3}")?;
        }
        write!(f, "; {}", self.proof)
    }
}
