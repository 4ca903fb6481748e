//! The journal of a job: what is proven to be cut, on disk before it counts.
//!
//! A text file beside the job, `job.nc.journal`, that is only ever added to. Every line carries a checksum over itself
//! and the line before it, and is on the disk (fsync) before the sender goes on. So whatever ends the program, its
//! computer or the machine, the file says which cuts are certainly made; the sender is never more than
//! `max_unconfirmed_cuts` ahead of it.
//!
//! ```text
//! 31e5… kagome-journal 1
//! 90c1… job 7c0d… lines=86 cuts=40 ahead=3 name=job.nc
//! 02fa… machine name=diode-400
//! b71c… begin cut=0 system=G54 offset=0.0000,0.0000,0.0000 homes=false firmware=Grbl 1.1h ['$' for help]
//! 5d02… cuts 1
//! 88e0… cuts 3
//! c410… stopped position=31.2500,5.0000,0.0000
//! ```

mod read;
mod record;
mod store;
#[cfg(test)]
mod tests;

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use self::record::Chain;
use super::{Cuts, Job};

pub use read::{History, JournalError};
pub use record::{Begin, Header, Record};
pub use store::{FileStore, MemoryStore, Store};

/// A journal that is being written.
pub struct Journal {
    header: Header,
    store: Box<dyn Store>,
    chain: Chain,
    history: Option<History>,
}

/// The journal of a job file: beside it, with `.journal` behind its name.
pub fn path_for(job: &Path) -> PathBuf {
    let mut name = job.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".journal");
    job.with_file_name(name)
}

impl Header {
    /// Of a job of this file name for a machine (its profile's name, or empty), with a sender that runs at most
    /// `max_unconfirmed` cuts ahead.
    pub fn of(job: &Job, cuts: &Cuts, name: &str, machine: &str, max_unconfirmed: usize) -> Self {
        Self {
            job: record::digest(job.lines().map(|(text, _)| text)),
            lines: job.len(),
            cuts: cuts.len(),
            max_unconfirmed,
            name: name.to_owned(),
            machine: machine.to_owned(),
        }
    }
}

impl Journal {
    /// A new journal. Nothing is written before the job begins.
    pub fn new(header: Header, store: impl Store + 'static) -> Self {
        Self {
            header,
            store: Box::new(store),
            chain: Chain::default(),
            history: None,
        }
    }

    /// The journal of a job that is to go on: `bytes` is what `store` holds.
    ///
    /// # Errors
    /// [`JournalError`]: damaged, of another job or machine, or finished.
    pub fn continued(
        header: Header,
        bytes: &[u8],
        store: impl Store + 'static,
    ) -> Result<Self, JournalError> {
        let history = History::read(bytes)?;
        history.check(&header)?;
        Ok(Self {
            header,
            store: Box::new(store),
            chain: history.chain.clone(),
            history: Some(history),
        })
    }

    /// What was known when it was opened; none for a new one.
    pub fn history(&self) -> Option<&History> {
        self.history.as_ref()
    }

    /// The most cuts that may be sent without being proven.
    pub fn max_unconfirmed(&self) -> usize {
        self.header.max_unconfirmed.max(1)
    }

    /// Sending begins.
    ///
    /// # Errors
    /// The system's; nothing may be sent then.
    pub fn begin(&mut self, begin: Begin) -> io::Result<()> {
        match &self.history {
            Some(history) => self.store.keep(history.length)?,
            None => {
                self.store.create()?;
                let mut text = String::new();
                for line in self.header.lines() {
                    text.push_str(&self.chain.seal(&line));
                }
                self.store.append(text.as_bytes())?;
            }
        }
        self.write(&Record::Begin(begin))
    }

    /// Writes a line and waits until it is on the disk.
    ///
    /// # Errors
    /// The system's: what the line says must not be counted on.
    pub fn write(&mut self, record: &Record) -> io::Result<()> {
        let line = self.chain.seal(&record.text());
        self.store.append(line.as_bytes())
    }
}
