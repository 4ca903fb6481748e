//! The simulated machine on a pseudo-terminal, for senders in other processes: ours and everyone else's.

use std::path::{Path, PathBuf};

use super::controller::Controller;

pub use super::serve::Serve;

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
    use std::time::{Duration, Instant};

    use serialport::{SerialPort as _, TTYPort};

    use super::{Controller, PtyError, Serve};
    use crate::sim::serve::{Heard, Port, WAIT, run};

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
            stop: impl FnMut(&Controller) -> bool,
        ) {
            run(&mut self.master, controller, how, stop);
        }
    }

    impl Port for TTYPort {
        fn hear(&mut self, buffer: &mut [u8]) -> Heard {
            match self.read(buffer) {
                Ok(count) => Heard::Bytes(count),
                // Open, and silent.
                Err(error) if error.kind() == io::ErrorKind::TimedOut => Heard::Bytes(0),
                Err(_) => Heard::Nobody,
            }
        }

        fn say(&mut self, bytes: &[u8]) -> bool {
            let mut left = bytes;
            let give_up = Instant::now() + Duration::from_millis(500);
            while !left.is_empty() {
                match self.write(left) {
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
