//! Progress on a terminal, quiet lines elsewhere, and Ctrl-C as a polite request.

use std::io::{IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::base::progress::Progress;

/// The person's side of a long computation.
pub struct Terminal {
    quiet: bool,
    bar: Option<Mutex<ProgressBar>>,
    stop: Arc<AtomicBool>,
    guards: Arc<AtomicUsize>,
    /// Ctrl-C reaches us.
    handled: bool,
}

/// While it lives, no number of Ctrl-C ends the program: see [`Terminal::forbid_exit`].
#[derive(Debug)]
pub struct ExitGuard {
    guards: Arc<AtomicUsize>,
    #[cfg(unix)]
    caught: Vec<signal_hook::SigId>,
}

impl Drop for ExitGuard {
    fn drop(&mut self) {
        self.guards.fetch_sub(1, Ordering::SeqCst);
        #[cfg(unix)]
        self.caught.drain(..).for_each(|id| {
            signal_hook::low_level::unregister(id);
        });
    }
}

/// A line on standard error. A terminal that was closed is no reason to panic in the middle of a job.
fn tell(text: &str) {
    // While keys are read a terminal does not go back to the line's beginning by itself.
    let mut text = format!("{text}\n");
    if std::io::stderr().is_terminal() {
        text = text.replace('\n', "\r\n");
    }
    let _ = std::io::stderr().write_all(text.as_bytes());
}

impl Terminal {
    /// Takes over Ctrl-C, SIGTERM and SIGHUP (a closed terminal): the first asks the work to stop, the second ends the
    /// program at once, unless an [`ExitGuard`] lives.
    pub fn new(quiet: bool) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let guards = Arc::new(AtomicUsize::new(0));
        let (flag, held) = (stop.clone(), guards.clone());
        // A handler that cannot be set (one is there already) leaves the system's own: the program just ends.
        let handled = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                if held.load(Ordering::SeqCst) == 0 {
                    std::process::exit(130);
                }
                tell("still stopping the machine: wait until it is known that the beam is off");
            }
        })
        .is_ok();
        let bar =
            (!quiet && std::io::stderr().is_terminal()).then(|| Mutex::new(ProgressBar::hidden()));
        Self {
            quiet,
            bar,
            stop,
            guards,
            handled,
        }
    }

    /// Forbids the exit at the second Ctrl-C until the guard is dropped. Ending the program while a job runs would
    /// leave the controller with a full buffer and nobody to stop it: the stop sequence (hold, reset, proof that the
    /// beam is off) must come to its end, and an impatient person presses twice. It always ends: each of its steps
    /// has a time limit.
    ///
    /// Ctrl-\\ (which would end the program) and Ctrl-Z (which would freeze it over a running machine) ask for the stop
    /// too while the guard lives. `None` if signals cannot be caught: then nothing may be started that needs a stop.
    #[must_use = "the exit is forbidden only while the guard lives"]
    pub fn forbid_exit(&self) -> Option<ExitGuard> {
        if !self.handled {
            return None;
        }
        #[cfg(unix)]
        let caught = [signal_hook::consts::SIGQUIT, signal_hook::consts::SIGTSTP]
            .into_iter()
            .map(|signal| signal_hook::flag::register(signal, self.stop.clone()).ok())
            .collect::<Option<Vec<_>>>()?;
        self.guards.fetch_add(1, Ordering::SeqCst);
        Some(ExitGuard {
            guards: self.guards.clone(),
            #[cfg(unix)]
            caught,
        })
    }

    /// The flag that Ctrl-C raises, for code that must react faster than by polling [`Progress`].
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        self.stop.clone()
    }

    /// Whether there is a person at a terminal who sees what is shown, and is not to be left alone.
    pub(super) fn is_watched(&self) -> bool {
        self.bar.is_some()
    }

    /// Shows a line in place of the one that was shown.
    pub(super) fn show(&self, text: &str) {
        if let Some(Ok(mut bar)) = self.bar.as_ref().map(Mutex::lock) {
            if bar.is_finished() || bar.is_hidden() {
                bar.finish_and_clear();
                *bar = ProgressBar::new_spinner().with_style(
                    ProgressStyle::with_template("{wide_msg}")
                        .unwrap_or_else(|_| ProgressStyle::default_spinner()),
                );
            }
            bar.set_message(text.to_owned());
            bar.tick();
        }
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
            Some(Ok(bar)) => bar.suspend(|| tell(text)),
            _ if !self.quiet => tell(text),
            _ => {}
        }
    }

    fn interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
