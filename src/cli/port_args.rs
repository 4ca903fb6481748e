//! Which machine, on which port: options of every verb that speaks to one, and the port that was used last.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use serde::{Deserialize, Serialize};

use super::profiles::{machine_named, own_folder};
use super::{Failure, Terminal};
use crate::base::atomic::write_file;
use crate::base::progress::Progress as _;
use crate::control::{OpenPort, Transport, ports, usb_name};
use crate::machine::{self, Machine};
use crate::sim::{Controller, Settings, SimTransport};

/// The name of the machine that is built in.
pub(super) const SIM: &str = "sim";

/// What GRBL boards use unless they were built otherwise.
pub(super) const STANDARD_BAUD: u32 = 115_200;

/// Where the machine is.
#[derive(Args, Clone, Debug)]
pub struct PortArgs {
    /// The machine's port (see `kagome ports`): a path, usb:VID:PID, tcp://HOST:PORT, or sim for the machine that is built
    /// in [default: the one that this machine was on last]
    #[arg(long)]
    pub(super) port: Option<String>,
    /// The machine's profile
    #[arg(long, value_name = "NAME|FILE", default_value = crate::machine::DEFAULT)]
    pub(super) machine: String,
    /// Rate of the serial line [default: the profile's]
    #[arg(long)]
    pub(super) baud: Option<u32>,
}

impl PortArgs {
    /// The profile; one whose controller is streamed to.
    pub(super) fn profile(&self) -> Result<Machine, Failure> {
        let found = machine_named(&self.machine).map_err(Failure::bad)?;
        let machine = machine::load(&found).map_err(Failure::bad)?;
        if machine.controller.is_streamed() {
            return Ok(machine);
        }
        Err(Failure::Bad(format!(
            "machine {} has {}, which is worked from its own screen: there is nothing to speak to",
            machine.name, machine.controller
        )))
    }

    /// Opens the line.
    pub(super) fn open(&self) -> Result<Box<dyn Transport>, Failure> {
        let machine = self.profile()?;
        open(
            &port_of(self.port.as_deref(), Some(&machine.name))?,
            self.baud,
            Some(&machine),
        )
    }

    /// Keeps the port for the next time.
    pub(super) fn remember(&self, terminal: &Terminal) {
        if let (Some(port), Ok(machine)) = (&self.port, self.profile()) {
            remember(port, &machine.name, terminal);
        }
    }
}

/// The port that is asked for, else the one that this machine was on last.
pub(super) fn port_of(asked: Option<&str>, machine: Option<&str>) -> Result<String, Failure> {
    if let Some(port) = asked {
        return Ok(port.to_owned());
    }
    let last = machine.and_then(|name| Book::read().0.remove(name));
    match last {
        Some(last) => Ok(last.name(&ports())),
        None => Err(Failure::Bad(
            "where is the machine? Name its port with --port (`kagome ports` lists them); it is remembered then".into(),
        )),
    }
}

/// Opens a port by its name.
pub(super) fn open(
    port: &str,
    baud: Option<u32>,
    machine: Option<&Machine>,
) -> Result<Box<dyn Transport>, Failure> {
    if port == SIM {
        let settings = machine.map_or_else(Settings::default, Settings::of_machine);
        let controller = Controller::homed_at_zero(settings);
        return Ok(Box::new(SimTransport::new(controller)));
    }
    let connection = machine.and_then(|m| m.connection.as_ref());
    let baud = baud.or(connection.map(|c| c.baud)).unwrap_or(STANDARD_BAUD);
    let line = OpenPort::open(port, baud).map_err(Failure::bad)?;
    Ok(Box::new(line))
}

/// Keeps a port that worked for the next time. What cannot be kept is no reason to fail.
pub(super) fn remember(port: &str, machine: &str, terminal: &Terminal) {
    if port == SIM {
        return;
    }
    let known = ports();
    let kind = known.iter().find(|(name, _)| name == port);
    let last = Last {
        port: port.to_owned(),
        usb: kind.and_then(|(_, kind)| usb_name(kind)),
    };
    let mut book = Book::read();
    if book.0.get(machine) == Some(&last) {
        return;
    }
    book.0.insert(machine.to_owned(), last);
    if let Err(problem) = book.write() {
        terminal.note(&format!("the port is not remembered: {problem}"));
    }
}

/// Where a machine was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Last {
    port: String,
    /// Its board's numbers, if it is on USB: it may be on another port today.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    usb: Option<String>,
}

impl Last {
    /// What to open: the same path if the same board is on it, else wherever that board is.
    fn name(self, present: &[(String, String)]) -> String {
        let Some(usb) = self.usb else {
            return self.port;
        };
        let here = present
            .iter()
            .any(|(name, kind)| *name == self.port && usb_name(kind).as_ref() == Some(&usb));
        if here { self.port } else { usb }
    }
}

/// `ports.toml` in the folder of one's own profiles: machines by name.
#[derive(Default, Serialize, Deserialize)]
struct Book(BTreeMap<String, Last>);

impl Book {
    fn file() -> Option<PathBuf> {
        Some(own_folder()?.join("ports.toml"))
    }

    /// A book that cannot be read is empty: it only saves typing.
    fn read() -> Self {
        let text = Self::file().and_then(|file| std::fs::read_to_string(file).ok());
        text.and_then(|text| toml::from_str(&text).ok())
            .unwrap_or_default()
    }

    fn write(&self) -> Result<(), String> {
        let Some(file) = Self::file() else {
            return Ok(());
        };
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        }
        let text = toml::to_string(self).map_err(|e| e.to_string())?;
        write_file(&file, text.as_bytes()).map_err(|e| e.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_that_moved_to_another_port_is_looked_for() {
        let last = Last {
            port: "/dev/ttyUSB0".into(),
            usb: Some("usb:1a86:7523".into()),
        };
        let port = |name: &str, kind: &str| (name.to_owned(), kind.to_owned());
        let same = [port("/dev/ttyUSB0", "USB 1a86:7523 QinHeng")];
        assert_eq!(last.clone().name(&same), "/dev/ttyUSB0");
        let other = [
            port("/dev/ttyUSB0", "USB 2341:0043 Arduino"),
            port("/dev/ttyUSB1", "USB 1a86:7523"),
        ];
        assert_eq!(last.clone().name(&other), "usb:1a86:7523");
        let network = Last {
            port: "tcp://laser.local:23".into(),
            usb: None,
        };
        assert_eq!(network.name(&other), "tcp://laser.local:23");
        let mut book = Book::default();
        book.0.insert("co2-600x400".into(), last);
        let text = toml::to_string(&book).unwrap();
        let again: Book = toml::from_str(&text).unwrap();
        assert_eq!(again.0, book.0);
    }
}
