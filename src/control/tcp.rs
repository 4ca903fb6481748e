//! Controllers on a network: FluidNC and grblHAL listen on a TCP port, as a rule 23.

use std::io::{self, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};

use super::Transport;
use super::serial::PortError;
use super::transport::received;

/// How long a controller may take to accept.
const CONNECT: Duration = Duration::from_secs(5);

/// How long it may take to accept bytes before the link counts as lost.
const SEND: Duration = Duration::from_secs(5);

/// The byte that begins a telnet command, which is no speech of the controller's.
const TELNET: u8 = 0xff;

/// A [`Transport`] over TCP.
pub struct TcpTransport {
    stream: TcpStream,
    name: String,
    opened: Instant,
    /// Bytes of a telnet command still to be passed over.
    skip: u8,
}

impl TcpTransport {
    /// Connects to `HOST:PORT`; without a port to that of telnet, 23. This resets no controller.
    ///
    /// # Errors
    /// [`PortError::Network`].
    pub fn open(address: &str) -> Result<Self, PortError> {
        let with_port = if address.rsplit_once(':').is_some_and(|(host, port)| {
            port.parse::<u16>().is_ok() && (!host.contains(':') || host.ends_with(']'))
        }) {
            address.to_owned()
        } else {
            format!("{address}:23")
        };
        let failed = |reason: String| PortError::Network {
            address: with_port.clone(),
            reason,
        };
        let places = with_port
            .to_socket_addrs()
            .map_err(|error| failed(error.to_string()))?;
        let mut why = "the name stands for no address".to_owned();
        for place in places {
            match TcpStream::connect_timeout(&place, CONNECT) {
                Ok(stream) => {
                    let set = stream
                        .set_nodelay(true)
                        .and_then(|()| stream.set_write_timeout(Some(SEND)));
                    set.map_err(|error| failed(error.to_string()))?;
                    return Ok(Self {
                        stream,
                        name: format!("tcp://{with_port}"),
                        opened: Instant::now(),
                        skip: 0,
                    });
                }
                Err(error) => why = error.to_string(),
            }
        }
        Err(failed(why))
    }

    /// Takes telnet commands out of what was received; how many bytes are left.
    fn speech(&mut self, bytes: &mut [u8]) -> usize {
        let mut kept = 0;
        for at in 0..bytes.len() {
            let byte = bytes[at];
            if self.skip > 0 {
                self.skip -= 1;
            } else if byte == TELNET {
                // Command and option.
                self.skip = 2;
            } else {
                bytes[kept] = byte;
                kept += 1;
            }
        }
        kept
    }
}

impl Transport for TcpTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.stream
            .set_read_timeout(Some(wait.max(Duration::from_millis(1))))?;
        let count = received(self.stream.read(buffer), io::ErrorKind::ConnectionAborted)?;
        Ok(self.speech(&mut buffer[..count]))
    }

    fn now(&self) -> Duration {
        self.opened.elapsed()
    }

    fn name(&self) -> &str {
        &self.name
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn bytes_go_both_ways_telnet_is_left_out_and_a_closed_line_is_lost() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let server = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let mut heard = [0; 3];
            stream.read_exact(&mut heard).unwrap();
            // A command that is cut in two by the network.
            stream.write_all(&[b'o', TELNET]).unwrap();
            stream.flush().unwrap();
            std::thread::sleep(Duration::from_millis(30));
            stream.write_all(&[251, 1, b'k', b'\n']).unwrap();
            heard
        });
        let mut link = TcpTransport::open(&address).unwrap();
        assert_eq!(link.name(), format!("tcp://{address}"));
        link.send(b"$G\n").unwrap();
        let mut said = Vec::new();
        let lost = loop {
            let mut buffer = [0; 16];
            match link.receive(&mut buffer, Duration::from_millis(200)) {
                Ok(count) => said.extend_from_slice(&buffer[..count]),
                Err(error) => break error,
            }
        };
        assert_eq!(said, b"ok\n");
        assert_eq!(lost.kind(), io::ErrorKind::ConnectionAborted);
        assert_eq!(&server.join().unwrap(), b"$G\n");
    }

    #[test]
    fn nobody_there_is_said_with_the_address() {
        // A port that was free a moment ago.
        let free = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let Err(error) = TcpTransport::open(&free.to_string()) else {
            panic!("somebody answers");
        };
        assert!(error.to_string().contains(&free.to_string()), "{error}");
        let Err(error) = TcpTransport::open("no host") else {
            panic!("somebody answers");
        };
        assert!(error.to_string().contains("no host:23"), "{error}");
    }
}
