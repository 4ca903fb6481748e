//! The simulated machine on TCP, as FluidNC and grblHAL are reached over a network: bytes as on a serial line, one
//! client at a time.

use std::io::{self, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use super::controller::Controller;
use super::serve::{Heard, Port, Serve, WAIT, run};
use crate::control::received;

/// Why the machine cannot be served on TCP.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot listen on {address}: {source}; choose a port that is free (0 takes any), on an address of this computer"
)]
pub struct TcpError {
    /// The address asked for.
    pub address: String,
    /// The system's reason.
    pub source: io::Error,
}

/// A listening socket with the machine behind it.
#[derive(Debug)]
pub struct TcpServer {
    listener: TcpListener,
    client: Option<TcpStream>,
    address: SocketAddr,
}

impl TcpServer {
    /// Listens on an address as `127.0.0.1:2300`; port 0 takes one that is free.
    ///
    /// # Errors
    /// [`TcpError`].
    pub fn open(address: &str) -> Result<Self, TcpError> {
        let failed = |source| TcpError {
            address: address.to_owned(),
            source,
        };
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        Ok(Self {
            address: listener.local_addr().map_err(failed)?,
            listener,
            client: None,
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Runs the machine until `stop` says so (or as [`Serve::once`] says).
    pub fn run(
        &mut self,
        controller: &mut Controller,
        how: Serve,
        stop: impl FnMut(&Controller) -> bool,
    ) {
        run(self, controller, how, stop);
    }

    /// Lets one client in; others are told why not.
    fn accept(&mut self) {
        while let Ok((mut stream, _)) = self.listener.accept() {
            // The listener's own mode may be inherited.
            let ready = stream
                .set_nonblocking(false)
                .and_then(|()| stream.set_nodelay(true))
                .and_then(|()| stream.set_read_timeout(Some(WAIT)))
                .and_then(|()| stream.set_write_timeout(Some(Duration::from_millis(500))));
            if ready.is_err() {
                continue;
            }
            if self.client.is_none() {
                self.client = Some(stream);
            } else {
                let _ = stream.write_all(
                    b"[MSG:this machine is in use by another program; close that one first]\r\n",
                );
            }
        }
    }
}

impl Port for TcpServer {
    fn hear(&mut self, buffer: &mut [u8]) -> Heard {
        self.accept();
        let Some(client) = &mut self.client else {
            return Heard::Nobody;
        };
        match received(client.read(buffer), io::ErrorKind::ConnectionAborted) {
            Ok(count) => Heard::Bytes(count),
            Err(_) => {
                self.client = None;
                Heard::Nobody
            }
        }
    }

    fn say(&mut self, bytes: &[u8]) -> bool {
        let Some(client) = &mut self.client else {
            return false;
        };
        let mut left = bytes;
        let give_up = Instant::now() + Duration::from_secs(2);
        while !left.is_empty() {
            match client.write(left) {
                Ok(count) if count > 0 => left = &left[count..],
                Err(error)
                    if matches!(
                        error.kind(),
                        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock
                    ) && Instant::now() < give_up => {}
                _ => {
                    self.client = None;
                    return false;
                }
            }
        }
        true
    }
}
