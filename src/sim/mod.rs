//! The simulated machine: a GRBL 1.1h (or grblHAL, FluidNC) controller with its buffers, planner and clock, and a sheet that remembers
//! what was burnt.
//!
//! It is the independent judge of our G-code and of our sender: it has its own interpreter and shares with the rest of
//! the crate only the [`planner`](crate::planner) and the [`Transport`](crate::control::Transport) trait. In process it
//! runs on a virtual clock ([`SimTransport`], [`rehearse`]); other programs reach it through a pseudo-terminal
//! ([`pty`]) or on TCP ([`tcp`]).

pub mod burnt;
pub mod controller;
mod estimate;
mod faults;
mod flavour;
mod link;
mod modal;
pub mod pty;
mod rehearse;
mod serve;
mod settings;
pub mod tcp;
mod words;

pub use burnt::{BeamChange, BeamTime, Burn, Stroke, strokes};
pub use controller::{Controller, Life, State};
pub use estimate::{EstimateError, estimate};
pub use faults::{At, Faults, Mishap};
pub use flavour::Flavour;
pub use link::SimTransport;
pub use modal::Spindle;
pub use rehearse::{Rehearsal, RehearsalError, RehearsalSummary, rehearse};
pub use settings::{Settings, Switch};
