//! A machine's port by the name that a person gives it: a path, `usb:VID:PID`, or `tcp://HOST:PORT`; one sender each.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::Transport;
use super::serial::{PortError, SerialTransport, ports};
use super::tcp::TcpTransport;

/// Prefixes of ports that are no paths.
const TCP: &str = "tcp://";
const USB: &str = "usb:";

/// A port in use: nobody else may open it until it is dropped.
pub struct OpenPort {
    line: Box<dyn Transport>,
    /// Released with it.
    _lock: PortLock,
}

impl OpenPort {
    /// Opens a port, a serial one at this rate. A serial port resets most boards.
    ///
    /// # Errors
    /// [`PortError`]: it is not there, may not be used, or another sender has it.
    pub fn open(name: &str, baud: u32) -> Result<Self, PortError> {
        if let Some(address) = name.strip_prefix(TCP) {
            let lock = PortLock::take(name)?;
            let line = Box::new(TcpTransport::open(address)?);
            return Ok(Self { line, _lock: lock });
        }
        let path = match name.strip_prefix(USB) {
            Some(id) => by_id(id, ports())?,
            None => name.to_owned(),
        };
        let lock = PortLock::take(&path)?;
        let line = Box::new(SerialTransport::open(&path, baud)?);
        Ok(Self { line, _lock: lock })
    }
}

impl Transport for OpenPort {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.line.receive(buffer, wait)
    }

    fn now(&self) -> Duration {
        self.line.now()
    }

    fn name(&self) -> &str {
        self.line.name()
    }
}

/// The name by which a board is found on whichever port it is: `usb:1a86:7523`, from what [`ports`] knows of it.
pub fn usb_name(kind: &str) -> Option<String> {
    let id = kind.strip_prefix("USB ")?.split(' ').next()?;
    let (vendor, product) = id.split_once(':')?;
    let hex = |text: &str| text.len() == 4 && text.bytes().all(|b| b.is_ascii_hexdigit());
    (hex(vendor) && hex(product)).then(|| format!("{USB}{}", id.to_lowercase()))
}

/// The one port whose board has this vendor and product.
fn by_id(id: &str, present: Vec<(String, String)>) -> Result<String, PortError> {
    let wanted = format!("{USB}{}", id.to_lowercase());
    let mut found: Vec<String> = present
        .into_iter()
        .filter(|(_, kind)| usb_name(kind).as_deref() == Some(&wanted))
        .map(|(name, _)| name)
        .collect();
    match (found.pop(), found.is_empty()) {
        (Some(only), true) => Ok(only),
        (Some(last), false) => {
            found.push(last);
            Err(PortError::Several {
                id: wanted,
                ports: found,
            })
        }
        (None, _) => Err(PortError::NoBoard { id: wanted }),
    }
}

/// A file that only one program holds. The system frees it when that program ends, however it ends.
struct PortLock {
    file: File,
}

impl PortLock {
    fn take(port: &str) -> Result<Self, PortError> {
        Self::take_in(&std::env::temp_dir(), port)
    }

    fn take_in(folder: &Path, port: &str) -> Result<Self, PortError> {
        // A link and what it points to are one port.
        let real = std::fs::canonicalize(port).unwrap_or_else(|_| PathBuf::from(port));
        let name: String = real
            .display()
            .to_string()
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
            .collect();
        let path = folder.join(format!("kagome-{name}.lock"));
        let failed = |error: io::Error| PortError::Other {
            port: port.to_owned(),
            baud: 0,
            reason: format!("{} cannot be locked: {error}", path.display()),
        };
        let opened = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(&path);
        // Another person's file may be locked too, though not written to.
        let opened = opened.or_else(|error| match error.kind() {
            io::ErrorKind::PermissionDenied => File::open(&path),
            _ => Err(error),
        });
        let mut file = opened.map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut who = String::new();
                let _ = file.read_to_string(&mut who);
                return Err(PortError::InUse {
                    port: port.to_owned(),
                    by: who.trim().to_owned(),
                });
            }
            // A file system without locks: the port's own is left.
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        let _ = file
            .set_len(0)
            .and_then(|()| file.rewind())
            .and_then(|()| write!(file, "kagome, process {}", std::process::id()));
        Ok(Self { file })
    }
}

impl Drop for PortLock {
    fn drop(&mut self) {
        let _ = self.file.set_len(0);
        let _ = self.file.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_has_one_sender_under_all_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let port = folder.path().join("tty");
        std::fs::write(&port, "").unwrap();
        let name = port.display().to_string();
        let first = PortLock::take_in(folder.path(), &name).unwrap();
        let Err(error) = PortLock::take_in(folder.path(), &name) else {
            panic!("two have it");
        };
        let text = error.to_string();
        assert!(text.contains(&std::process::id().to_string()), "{text}");
        #[cfg(unix)]
        {
            let link = folder.path().join("laser");
            std::os::unix::fs::symlink(&port, &link).unwrap();
            assert!(PortLock::take_in(folder.path(), &link.display().to_string()).is_err());
        }
        assert!(PortLock::take_in(folder.path(), "tcp://laser.local:23").is_ok());
        drop(first);
        assert!(PortLock::take_in(folder.path(), &name).is_ok());
    }

    #[test]
    fn a_board_is_found_by_its_numbers_if_there_is_one_of_it() {
        let list = |ports: &[(&str, &str)]| -> Vec<(String, String)> {
            let own = |(a, b): &(&str, &str)| ((*a).to_owned(), (*b).to_owned());
            ports.iter().map(own).collect()
        };
        let one = [
            ("/dev/ttyACM0", "USB 2341:0043 Arduino Uno"),
            ("/dev/ttyS0", "built in"),
            ("/dev/ttyUSB3", "USB 1A86:7523 QinHeng"),
        ];
        assert_eq!(by_id("1a86:7523", list(&one)).unwrap(), "/dev/ttyUSB3");
        let error = by_id("1a86:7524", list(&one)).unwrap_err().to_string();
        assert!(error.contains("usb:1a86:7524"), "{error}");
        let two = [one[2], ("/dev/ttyUSB4", "USB 1a86:7523")];
        let error = by_id("1a86:7523", list(&two)).unwrap_err().to_string();
        assert!(
            error.contains("ttyUSB3") && error.contains("ttyUSB4"),
            "{error}"
        );
        assert_eq!(
            usb_name("USB 1A86:7523 QinHeng").as_deref(),
            Some("usb:1a86:7523")
        );
        assert_eq!(usb_name("built in"), None);
        assert_eq!(usb_name("USB 12:7523"), None);
    }
}
