//! Progress on a terminal, quiet lines elsewhere, and Ctrl-C as a polite request.

use std::io::IsTerminal as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::base::progress::Progress;

/// The person's side of a long computation.
pub struct Terminal {
    quiet: bool,
    bar: Option<Mutex<ProgressBar>>,
    stop: Arc<AtomicBool>,
}

impl Terminal {
    /// Takes over Ctrl-C: the first asks the work to stop, the second ends the program at once.
    pub fn new(quiet: bool) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = stop.clone();
        // A handler that cannot be set (one is there already) leaves the system's own: the program just ends.
        let _ = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
        let bar =
            (!quiet && std::io::stderr().is_terminal()).then(|| Mutex::new(ProgressBar::hidden()));
        Self { quiet, bar, stop }
    }

    /// The flag that Ctrl-C raises, for code that must react faster than by polling [`Progress`].
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        self.stop.clone()
    }

    /// Removes the progress bar, before results are printed.
    pub fn clear(&self) {
        if let Some(Ok(bar)) = self.bar.as_ref().map(Mutex::lock) {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Terminal {
    fn start(&self, step: &str, total: Option<u64>) {
        let Some(Ok(mut bar)) = self.bar.as_ref().map(Mutex::lock) else {
            return;
        };
        bar.finish_and_clear();
        *bar = match total {
            Some(n) => ProgressBar::new(n).with_style(
                ProgressStyle::with_template("{msg:32} {wide_bar} {pos}/{len}")
                    .unwrap_or_else(|_| ProgressStyle::default_bar()),
            ),
            None => ProgressBar::new_spinner(),
        };
        bar.set_message(step.to_owned());
        bar.enable_steady_tick(Duration::from_millis(100));
    }

    fn advance(&self, done: u64) {
        if let Some(Ok(bar)) = self.bar.as_ref().map(Mutex::lock) {
            bar.inc(done);
        }
    }

    fn note(&self, text: &str) {
        match self.bar.as_ref().map(Mutex::lock) {
            Some(Ok(bar)) => bar.suspend(|| eprintln!("{text}")),
            _ if !self.quiet => eprintln!("{text}"),
            _ => {}
        }
    }

    fn interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
