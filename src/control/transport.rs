//! A line to a machine, and its clock.

use std::io;
use std::time::Duration;

/// Bytes both ways, and the time that passes between them.
///
/// The sender takes its time from here, never from the system: on a real port it is the wall's, in the simulated
/// machine it is virtual and moves only while [`Transport::receive`] waits, so the same sender code runs a job of
/// twenty minutes in milliseconds.
pub trait Transport {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// Whatever makes the link unusable; nothing is known about how many bytes arrived.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits at most `wait` for bytes and gives how many were put into `buffer`: 0 if none came in time.
    ///
    /// # Errors
    /// Any error means that the link is lost; silence is not an error.
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize>;

    /// The time on this link's clock, from some fixed moment.
    fn now(&self) -> Duration;

    /// What to call it in messages: a path, or "the simulated machine".
    fn name(&self) -> &str;
}

/// What reading gave, where a system tells by an error that nothing came in time.
///
/// # Errors
/// All other errors, and `lost` where the far side has gone.
pub(crate) fn received(read: io::Result<usize>, lost: io::ErrorKind) -> io::Result<usize> {
    match read {
        // Nothing to read and no timeout: the far side has gone.
        Ok(0) => Err(lost.into()),
        Ok(count) => Ok(count),
        Err(error)
            if matches!(
                error.kind(),
                io::ErrorKind::TimedOut | io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock
            ) =>
        {
            Ok(0)
        }
        Err(error) => Err(error),
    }
}
