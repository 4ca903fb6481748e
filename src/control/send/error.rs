//! Why a job did not run to its end.

use std::io;

use super::reason::StopReason;
use super::report::Confirmed;

/// Why a job did not run to its end.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// The link failed before the job began.
    #[error("no connection to {port}: {source}. Nothing was sent")]
    Connect {
        /// The transport's name.
        port: String,
        /// The system's reason.
        source: io::Error,
    },
    /// What answers is no GRBL controller.
    #[error(
        "no GRBL controller answers at {port} ({heard}): check the port, its baud rate and that the machine is on. Nothing was sent"
    )]
    NoController {
        /// The transport's name.
        port: String,
        /// What was heard instead.
        heard: String,
    },
    /// The controller is not in a state to run this job.
    #[error("{why}. Nothing was sent")]
    NotReady {
        /// What is wrong and what to do.
        why: String,
    },
    /// The job was stopped.
    #[error("{reason}; {confirmed}")]
    Stopped {
        /// Why.
        reason: StopReason,
        /// How far it came, and what is known.
        confirmed: Box<Confirmed>,
    },
    /// The link was lost in the middle of the job.
    #[error("lost the link to {port} ({source}); {confirmed}")]
    LinkLost {
        /// The transport's name.
        port: String,
        /// The system's reason.
        source: io::Error,
        /// How far it came, and what is known.
        confirmed: Box<Confirmed>,
    },
}

impl SendError {
    /// How far the job came, if it had begun.
    pub fn confirmed(&self) -> Option<&Confirmed> {
        match self {
            Self::Stopped { confirmed, .. } | Self::LinkLost { confirmed, .. } => Some(confirmed),
            _ => None,
        }
    }
}
