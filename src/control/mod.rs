//! From a job to a machine: checked, streamed, and stopped with proof.
//!
//! The rule of the house: *the beam is off unless the program means it on*, on every pause, error, disconnect, exit and
//! crash path that software can reach. So a job is checked whole before a byte is sent ([`Job`]); the controller is
//! asked what it is and how it is set; every byte sent has an owner until it is acknowledged; and every way out of a
//! running job goes through a feed hold, a reset and a status report that shows the beam off, or says in plain words
//! that this could not be confirmed ([`Proof`]).
//!
//! What is cut is known from where the head is, not from what was acknowledged ([`Cuts`], [`Follower`]). It is written to
//! a [`journal`] on the disk before it counts, and the sender never runs further ahead of it than a few cuts
//! ([`send_recorded`]); so after whatever happened a job goes on at the first cut that is not proven ([`resume`]).
//!
//! The person at the machine wishes pauses and overrides and sees where the job is through an [`Operator`]; between jobs they
//! work with a [`Console`].
//!
//! What software cannot do: an M3 (constant power) beam stays on after the cable is pulled, until the firmware ends
//! it. M4 goes dark by itself when motion ends; so M3 is refused unless asked for.

mod awake;
mod console;
mod follow;
mod job;
pub mod journal;
mod offsets;
mod operator;
mod port;
mod reply;
pub mod script;
mod send;
mod serial;
mod stranger;
mod survey;
mod tcp;
mod transport;

pub use awake::Awake;
pub use console::{
    Console, ConsoleError, JogTo, Move, Restored, SettingDifference,
    Settings as ControllerSettings, SettingsError, Told, work_mm,
};
pub use follow::{Cut, Cuts, Follower, NotFollowed, Sighting};
pub use job::{Job, JobError, JobRules};
pub use offsets::Offsets;
pub use operator::{Change, Glance, Operator, Unattended, Wish};
pub use port::{OpenPort, usb_name};
pub use reply::{MachineState, Reply, Status};
pub use send::{
    Confirmed, Proof, Question, SendError, SendOptions, SendReport, StopReason, Streaming, resume,
    send, send_recorded,
};
pub use serial::{PortError, SerialTransport, ports};
pub use survey::{JobReach, Survey};
pub use tcp::TcpTransport;
pub use transport::Transport;
pub(crate) use transport::received;
