//! How long work tells of itself: a trait, so that the library knows no terminal.

use std::sync::atomic::{AtomicBool, Ordering};

/// Receives progress and says whether to go on. All methods have silent defaults.
pub trait Progress: Sync {
    /// A new step begins; `total` is the number of [`Progress::advance`] units if known.
    fn start(&self, step: &str, total: Option<u64>) {
        let _ = (step, total);
    }
    /// `done` units of the present step are finished.
    fn advance(&self, done: u64) {
        let _ = done;
    }
    /// One line worth telling: a decision taken, a figure.
    fn note(&self, text: &str) {
        let _ = text;
    }
    /// True once the person asked to stop. Long loops poll it and return [`Interrupted`].
    fn interrupted(&self) -> bool {
        false
    }
    /// [`Progress::interrupted`] as a result, for use with `?`.
    ///
    /// # Errors
    /// [`Interrupted`] once the person asked to stop.
    fn check(&self) -> Result<(), Interrupted> {
        if self.interrupted() {
            Err(Interrupted)
        } else {
            Ok(())
        }
    }
}

/// The person asked to stop; nothing was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted: nothing was written")]
pub struct Interrupted;

/// Says nothing and never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {}

/// Says nothing, stops when its flag is raised (from another thread or a signal handler).
#[derive(Debug, Default)]
pub struct StopFlag(pub AtomicBool);

impl Progress for StopFlag {
    fn interrupted(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
