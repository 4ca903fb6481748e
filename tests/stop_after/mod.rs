//! A person who changes their mind, for tests that send.

use std::sync::atomic::{AtomicUsize, Ordering};

use kagome::base::progress::Progress;
use kagome::control::Operator;

/// Asks to stop after this many answers.
pub struct StopAfter(AtomicUsize);

impl StopAfter {
    pub fn new(answers: usize) -> Self {
        Self(AtomicUsize::new(answers))
    }
}

impl Progress for StopAfter {
    fn advance(&self, _: u64) {
        let _ = self
            .0
            .fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| n.checked_sub(1));
    }
    fn interrupted(&self) -> bool {
        self.0.load(Ordering::SeqCst) == 0
    }
}

impl Operator for StopAfter {}
