//! The computer stays awake while a job runs, where the system can be asked for that.

use std::process::{Child, Command, Stdio};

/// Keeps the computer awake until it is dropped, or the program has ended in whatever way.
#[derive(Debug)]
pub struct Awake(Option<Child>);

impl Awake {
    /// Asks for it: on Linux with systemd. Elsewhere nothing happens.
    pub fn ask(why: &str) -> Self {
        if !cfg!(target_os = "linux") {
            return Self(None);
        }
        // `cat` ends with our side of the pipe, and the inhibitor with it: also after kill -9.
        let started = Command::new("systemd-inhibit")
            .args([
                "--what=sleep:idle:handle-lid-switch",
                "--who=kagome",
                "--mode=block",
            ])
            .arg(format!("--why={why}"))
            .arg("cat")
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        Self(started.ok())
    }
}

impl Drop for Awake {
    fn drop(&mut self) {
        if let Some(mut child) = self.0.take() {
            drop(child.stdin.take());
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
