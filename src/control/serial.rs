//! Real ports. The only file that knows the serial library.

use std::io;
use std::time::{Duration, Instant};

use serialport::{ErrorKind, SerialPort, SerialPortType};

use super::Transport;
use super::transport::received;

/// A port that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// There is no such port.
    #[error("there is no port {port}; {}", known(.present))]
    Missing {
        /// The port asked for.
        port: String,
        /// The ports that are there.
        present: Vec<String>,
    },
    /// The system refuses.
    #[error("no permission to use {port}{}", hint(.port))]
    Permission {
        /// The port.
        port: String,
    },
    /// Another program has it.
    #[error(
        "{port} is used by another program: close it first (a second sender, a slicer, a serial monitor)"
    )]
    Busy {
        /// The port.
        port: String,
    },
    /// Another of our senders has it.
    #[error("{port} is used by another sender ({by}): wait until it has ended, or end it first")]
    InUse {
        /// The port.
        port: String,
        /// Which program.
        by: String,
    },
    /// No board with these numbers.
    #[error(
        "no board {id} is connected: is it plugged in and switched on? `kagome ports` lists those that are"
    )]
    NoBoard {
        /// `usb:VID:PID`.
        id: String,
    },
    /// Two boards of a kind.
    #[error("{id} is on {}: name the port itself", .ports.join(" and on "))]
    Several {
        /// `usb:VID:PID`.
        id: String,
        /// Where they are.
        ports: Vec<String>,
    },
    /// Nobody answers on the network.
    #[error(
        "cannot reach {address}: {reason}; is the machine on, in the same network, and its telnet port switched on ($Telnet/Enable on FluidNC)?"
    )]
    Network {
        /// Host and port.
        address: String,
        /// The system's reason.
        reason: String,
    },
    /// Anything else.
    #[error("cannot open {port} at {baud} baud: {reason}")]
    Other {
        /// The port.
        port: String,
        /// The rate.
        baud: u32,
        /// The system's reason.
        reason: String,
    },
}

fn known(present: &[String]) -> String {
    let mut text = if present.is_empty() {
        "no serial port was found: is the machine plugged in and switched on? --port sim is always there".to_owned()
    } else {
        format!(
            "there are {} (and sim, the built-in machine)",
            present.join(", ")
        )
    };
    if cfg!(target_os = "linux") {
        text += ". To be allowed to use a serial port, ";
        text += DIALOUT;
    }
    text
}

/// What Linux asks of a person before a serial port may be opened.
const DIALOUT: &str = "add yourself to the group that owns serial ports with `sudo usermod -a -G dialout $USER`, then log out and in (on Arch the group is uucp)";

fn hint(port: &str) -> String {
    if cfg!(target_os = "linux") && port.starts_with("/dev/tty") {
        format!(": {DIALOUT}")
    } else {
        ": check who owns it".into()
    }
}

/// The serial ports of this computer and what is known of each, sorted by name.
pub fn ports() -> Vec<(String, String)> {
    // The library panics where Linux has no /sys/class/tty (containers).
    if cfg!(target_os = "linux") && !std::path::Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let mut list: Vec<(String, String)> = serialport::available_ports()
        .unwrap_or_default()
        .into_iter()
        .map(|port| {
            let kind = match port.port_type {
                SerialPortType::UsbPort(usb) => {
                    let mut text = format!("USB {:04x}:{:04x}", usb.vid, usb.pid);
                    for part in [usb.manufacturer, usb.product].into_iter().flatten() {
                        text.push(' ');
                        text.push_str(&part);
                    }
                    text
                }
                SerialPortType::PciPort => "built in".into(),
                SerialPortType::BluetoothPort => "Bluetooth".into(),
                SerialPortType::Unknown => "unknown".into(),
            };
            (port.port_name, kind)
        })
        .collect();
    list.sort();
    list
}

/// A [`Transport`] over a serial port or a pseudo-terminal.
pub struct SerialTransport {
    port: Box<dyn SerialPort>,
    name: String,
    opened: Instant,
}

impl SerialTransport {
    /// Opens a port with 8 data bits, no parity, one stop bit. This resets most boards.
    ///
    /// # Errors
    /// [`PortError`], with the ports that are there if this one is not.
    pub fn open(name: &str, baud: u32) -> Result<Self, PortError> {
        let port = serialport::new(name, baud)
            .timeout(Duration::from_millis(100))
            .open()
            .map_err(|error| Self::explain(name, baud, &error))?;
        Ok(Self {
            port,
            name: name.to_owned(),
            opened: Instant::now(),
        })
    }

    fn explain(name: &str, baud: u32, error: &serialport::Error) -> PortError {
        let port = name.to_owned();
        // `NoDevice` also stands for a port in use.
        let there = cfg!(unix) && std::path::Path::new(name).exists();
        match error.kind {
            ErrorKind::Io(io::ErrorKind::PermissionDenied) => PortError::Permission { port },
            ErrorKind::NoDevice if there => PortError::Busy { port },
            ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound) => PortError::Missing {
                port,
                present: ports().into_iter().map(|(name, _)| name).collect(),
            },
            _ => PortError::Other {
                port,
                baud,
                reason: error.to_string(),
            },
        }
    }
}

impl Transport for SerialTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        // A write may time out with a part done, so every byte is counted here and none is sent twice.
        let mut left = bytes;
        let give_up = Instant::now() + Duration::from_secs(5);
        while !left.is_empty() {
            match self.port.write(left) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => left = &left[count..],
                Err(error)
                    if matches!(
                        error.kind(),
                        io::ErrorKind::TimedOut
                            | io::ErrorKind::Interrupted
                            | io::ErrorKind::WouldBlock
                    ) && Instant::now() < give_up => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        // Zero would mean "for ever" to some drivers; a millisecond is nothing to a machine.
        let wait = wait.max(Duration::from_millis(1));
        self.port
            .set_timeout(wait)
            .map_err(|error| io::Error::other(error.to_string()))?;
        received(self.port.read(buffer), io::ErrorKind::BrokenPipe)
    }

    fn now(&self) -> Duration {
        self.opened.elapsed()
    }

    fn name(&self) -> &str {
        &self.name
    }
}
