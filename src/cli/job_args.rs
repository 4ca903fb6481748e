//! Which job, on which machine, at which port: options of every verb that sends one.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use super::port_args::Port;
use super::profiles::{machine_named, own_folder};
use crate::gcode;
use crate::machine::{self, Machine};

/// A job and where it goes.
#[derive(Args, Clone, Debug)]
pub(super) struct JobAt {
    /// The job: a G-code file
    pub job: PathBuf,
    /// The machine's port (see `kagome ports`): a path, usb:VID:PID, tcp://HOST:PORT, or sim for the machine that is built
    /// in [default: the one that this machine was on last]
    #[arg(long)]
    port: Option<String>,
    /// The machine's profile [default: the one that the job's header names]
    #[arg(long, value_name = "NAME|FILE")]
    machine: Option<String>,
    /// Rate of the serial line [default: the profile's, or 115200]
    #[arg(long)]
    baud: Option<u32>,
}

impl JobAt {
    /// The job as it is in its file, and its machine: see [`machine_for`].
    pub fn read(&self) -> Result<(Vec<u8>, Option<Machine>), Failure> {
        let text = std::fs::read(&self.job).map_err(|error| {
            Failure::Bad(format!(
                "cannot read {}: {error}; nothing was sent",
                self.job.display()
            ))
        })?;
        let machine = machine_for(self.machine.as_deref(), &text)?;
        Ok((text, machine))
    }

    /// Where the machine is.
    pub fn port(&self, machine: Option<&Machine>) -> Result<Port, Failure> {
        Port::of(self.port.as_deref(), self.baud, machine)
    }
}

/// The profile asked for, else the one that the job's header names, else none: G-code of other programs may come
/// without a profile to compare with.
pub(super) fn machine_for(asked: Option<&str>, job: &[u8]) -> Result<Option<Machine>, Failure> {
    let text = String::from_utf8_lossy(job);
    let Some(name) = asked.or(gcode::machine_of(&text)) else {
        return Ok(None);
    };
    // What a header says is no path.
    let own = own_folder().and_then(|own| machine::own_file(&own, name));
    if asked.is_none()
        && !own.is_some_and(|file| file.is_file())
        && !machine::shipped().any(|(shipped, _)| shipped == name)
    {
        return Err(Failure::Bad(format!(
            "the job was made for the machine {name}, which is neither a shipped profile nor one of your own: name its file with --machine"
        )));
    }
    let found = machine_named(name).map_err(Failure::bad)?;
    machine::load(&found).map(Some).map_err(Failure::bad)
}
