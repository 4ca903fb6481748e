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
const SIM: &str = "sim";

/// What GRBL boards use unless they were built otherwise.
const STANDARD_BAUD: u32 = 115_200;

/// Which machine, and where it is.
#[derive(Args, Clone, Debug)]
pub struct PortArgs {
    /// The machine's port (see `kagome ports`): a path, usb:VID:PID, tcp://HOST:PORT, or sim for the machine that is built
    /// in [default: the one that this machine was on last]
    #[arg(long)]
    port: Option<String>,
    /// The machine's profile
    #[arg(long, value_name = "NAME|FILE", default_value = crate::machine::DEFAULT)]
    machine: String,
    /// Rate of the serial line [default: the profile's]
    #[arg(long)]
    baud: Option<u32>,
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

    /// Where it is.
    pub(super) fn port(&self, machine: &Machine) -> Result<Port, Failure> {
        Port::of(self.port.as_deref(), self.baud, Some(machine))
    }
}

/// The port that is asked for, else the one that the machine was on last.
#[derive(Debug)]
pub(super) struct Port {
    name: String,
    baud: Option<u32>,
    /// It was asked for, and is to be remembered.
    asked: bool,
}

impl Port {
    pub fn of(
        asked: Option<&str>,
        baud: Option<u32>,
        machine: Option<&Machine>,
    ) -> Result<Self, Failure> {
        let last = || Some(Book::read().0.remove(&machine?.name)?.name(&ports()));
        let name = asked.map(str::to_owned).or_else(last).ok_or_else(|| {
            Failure::Bad("where is the machine? Name its port with --port (`kagome ports` lists them); it is remembered then".into())
        })?;
        Ok(Self {
            name,
            baud,
            asked: asked.is_some(),
        })
    }

    /// Whether it is the machine that is built in.
    pub fn is_sim(&self) -> bool {
        self.name == SIM
    }

    /// Opens it and does something over it that must be brought to its end. While that lasts no number of Ctrl-C ends the
    /// program, each asks for the stop that belongs to what is being done; from the opening on, which resets most boards: an
    /// exit in between would leave them to themselves.
    pub fn open<T>(
        &self,
        machine: Option<&Machine>,
        terminal: &Terminal,
        work: impl FnOnce(&mut dyn Transport) -> T,
    ) -> Result<T, Failure> {
        let Some(guard) = terminal.forbid_exit() else {
            return Err(Failure::Bad(
                "Ctrl-C cannot be caught here, so what runs could not be stopped with proof; nothing was sent".into(),
            ));
        };
        let mut line = self.line(machine)?;
        let done = work(line.as_mut());
        drop(guard);
        terminal.clear();
        Ok(done)
    }

    fn line(&self, machine: Option<&Machine>) -> Result<Box<dyn Transport>, Failure> {
        if self.is_sim() {
            let settings = machine.map_or_else(Settings::default, Settings::of_machine);
            let controller = Controller::homed_at_zero(settings);
            return Ok(Box::new(SimTransport::new(controller)));
        }
        let connection = machine.and_then(|m| m.connection.as_ref());
        let baud = self.baud.or(connection.map(|c| c.baud));
        let line = OpenPort::open(&self.name, baud.unwrap_or(STANDARD_BAUD));
        Ok(Box::new(line.map_err(Failure::bad)?))
    }

    /// Keeps one that was asked for and has worked for the next time. What cannot be kept is no reason to fail.
    pub fn remember(&self, machine: Option<&Machine>, terminal: &Terminal) {
        let Some(machine) = machine.filter(|_| self.asked && !self.is_sim()) else {
            return;
        };
        let known = ports();
        let kind = known.iter().find(|(name, _)| *name == self.name);
        let last = Last {
            port: self.name.clone(),
            usb: kind.and_then(|(_, kind)| usb_name(kind)),
        };
        let mut book = Book::read();
        if book.0.get(&machine.name) == Some(&last) {
            return;
        }
        book.0.insert(machine.name.clone(), last);
        if let Err(problem) = book.write() {
            terminal.note(&format!("the port is not remembered: {problem}"));
        }
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
