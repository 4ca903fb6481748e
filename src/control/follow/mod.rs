//! Where the machine is in its job: the cuts of a job, and the proof that they are made.
//!
//! An `ok` says that a line was planned; what was cut only the machine's position tells. So the job is read by the crate's
//! own interpreter into the way that the head will take and the [`Cuts`] along it, and each status report is looked up
//! on that way. Ways cross and repeat themselves, so a position may be many places on it: the [`Follower`] takes the
//! earliest that all reports so far allow, and claims only what lies before. A proof is never ahead of the truth.

mod cuts;
mod follower;
mod path;

pub use cuts::{Cut, Cuts};
pub use follower::{Follower, Sighting};

/// A job that cannot be followed: it is sent without proof by position, and cannot be resumed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {why}")]
pub struct NotFollowed {
    /// Line of the file, from 1.
    pub line: usize,
    /// What cannot be followed there.
    pub why: String,
}
