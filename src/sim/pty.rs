//! The simulated machine on a pseudo-terminal, for senders in other processes: ours and everyone else's.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::controller::Controller;

/// Why the machine cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum PtyError {
    /// This platform has none.
    #[error(
        "there are no pseudo-terminals on this platform: use --port sim, the machine in the same process"
    )]
    Unsupported,
    /// The system refused to make one.
    #[error("cannot open a pseudo-terminal: {reason}")]
    Open {
        /// The system's reason.
        reason: String,
    },
    /// The link to it could not be made.
    #[error(
        "cannot make the link {path}: {source}; choose a name that is free, in a folder that you may write to"
    )]
    Link {
        /// The link.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// How to serve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Serve {
    /// The machine's seconds per second of the wall; none for as fast as the other side feeds it.
    pub speed: Option<f64>,
    /// End when the other side has closed the port and the machine has come to rest.
    pub once: bool,
    /// Start anew whenever the port is opened, as boards do whose reset hangs on DTR.
    pub reset_on_open: bool,
}

impl Default for Serve {
    fn default() -> Self {
        Self {
            speed: Some(1.0),
            once: false,
            reset_on_open: true,
        }
    }
}

/// How long the wall waits for bytes at a time.
const WAIT: Duration = Duration::from_millis(2);
/// How far the machine may run ahead between two looks at the line, s, when it goes as fast as it can.
const STRIDE_S: f64 = 0.05;

/// A symbolic link that is removed with its owner.
#[derive(Debug)]
pub struct Link(PathBuf);

impl Link {
    /// Makes a symbolic link to a pseudo-terminal; a link to one that is there already is replaced, anything else is not.
    ///
    /// # Errors
    /// [`PtyError::Link`].
    pub fn new(path: &Path, target: &str) -> Result<Self, PtyError> {
        let failed = |source| PtyError::Link {
            path: path.to_path_buf(),
            source,
        };
        // A link that an earlier run left; a person's own link to something else stays.
        if path
            .read_link()
            .is_ok_and(|old| old.starts_with("/dev/pts"))
        {
            std::fs::remove_file(path).map_err(failed)?;
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(target, path).map_err(failed)?;
        #[cfg(not(unix))]
        {
            let _ = target;
            return Err(PtyError::Unsupported);
        }
        #[cfg(unix)]
        Ok(Self(path.to_path_buf()))
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

#[cfg(unix)]
mod unix {
    use std::io::{self, Read as _, Write as _};
    use std::time::Instant;

    use serialport::{SerialPort as _, TTYPort};

    use super::{Controller, Duration, PtyError, STRIDE_S, Serve, WAIT};

    /// One side of a pseudo-terminal, with the machine behind it.
    #[derive(Debug)]
    pub struct PtyServer {
        master: TTYPort,
        path: String,
    }

    impl PtyServer {
        /// Opens a pair; the other side has [`PtyServer::path`].
        ///
        /// # Errors
        /// [`PtyError::Open`].
        pub fn open() -> Result<Self, PtyError> {
            let failed = |error: serialport::Error| PtyError::Open {
                reason: error.to_string(),
            };
            let (mut master, slave) = TTYPort::pair().map_err(failed)?;
            let path = slave.name().unwrap_or_default();
            // Ours of the two far sides is closed, so that the near one tells when the last user leaves. The raw
            // mode that the library has set stays as long as the near side is open.
            drop(slave);
            master.set_timeout(WAIT).map_err(failed)?;
            Ok(Self { master, path })
        }

        /// The device to give to a sender.
        pub fn path(&self) -> &str {
            &self.path
        }

        /// Runs the machine until `stop` says so (or as [`Serve::once`] says). When the server is dropped its users
        /// see a broken line.
        pub fn run(
            &mut self,
            controller: &mut Controller,
            how: Serve,
            mut stop: impl FnMut(&Controller) -> bool,
        ) {
            let mut clock = Instant::now();
            let mut connected = false;
            let mut ever = false;
            let mut buffer = [0; 4096];
            let mut out = Vec::new();
            while !stop(controller) {
                let heard = match self.master.read(&mut buffer) {
                    Ok(count) => {
                        if !connected {
                            (connected, ever) = (true, true);
                            controller.port_opened(how.reset_on_open);
                        }
                        controller.write(&buffer[..count]);
                        count > 0
                    }
                    Err(error) if error.kind() == io::ErrorKind::TimedOut => {
                        // Open, and silent.
                        if !connected {
                            (connected, ever) = (true, true);
                            controller.port_opened(how.reset_on_open);
                        }
                        false
                    }
                    Err(_) => {
                        connected = false;
                        std::thread::sleep(WAIT);
                        false
                    }
                };
                if !connected && ever && how.once && controller.at_rest() {
                    return;
                }
                match how.speed {
                    Some(speed) => {
                        let passed = clock.elapsed();
                        clock += passed;
                        let until = controller.now_s() + passed.as_secs_f64() * speed;
                        controller.advance(until);
                    }
                    // Time goes by only while the machine has work, or the line has been silent for a while.
                    None => self.hurry(controller, heard, connected),
                }
                out.clear();
                controller.read(&mut out);
                if connected && !out.is_empty() && !self.say(&out) {
                    connected = false;
                }
            }
        }

        fn hurry(&self, controller: &mut Controller, heard: bool, connected: bool) {
            let stride = controller.now_s() + STRIDE_S;
            if controller.hungry() && connected && heard {
                return;
            }
            // Up to the first moment at which the other side has something to read.
            while controller.now_s() < stride {
                let next = controller.next_event_s().unwrap_or(stride).min(stride);
                controller.advance(next);
                if controller.has_output() {
                    return;
                }
            }
        }

        /// False if nobody is there to read.
        fn say(&mut self, bytes: &[u8]) -> bool {
            let mut left = bytes;
            let give_up = Instant::now() + Duration::from_millis(500);
            while !left.is_empty() {
                match self.master.write(left) {
                    Ok(count) => left = &left[count..],
                    Err(error)
                        if error.kind() == io::ErrorKind::TimedOut && Instant::now() < give_up => {}
                    Err(_) => return false,
                }
            }
            true
        }
    }
}

#[cfg(unix)]
pub use unix::PtyServer;

/// There are no pseudo-terminals here.
#[cfg(not(unix))]
#[derive(Debug)]
pub struct PtyServer;

#[cfg(not(unix))]
impl PtyServer {
    /// Never succeeds.
    ///
    /// # Errors
    /// [`PtyError::Unsupported`].
    pub fn open() -> Result<Self, PtyError> {
        Err(PtyError::Unsupported)
    }

    /// No path.
    pub fn path(&self) -> &str {
        ""
    }

    /// Does nothing.
    pub fn run(&mut self, _: &mut Controller, _: Serve, _: impl FnMut(&Controller) -> bool) {}
}
