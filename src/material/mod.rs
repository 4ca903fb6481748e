//! Stage 0: what the sheet is made of, and what cuts it.
//!
//! A [`Material`] is plain data from `profiles/NAME.toml`: how far it stretches at a hinge (σ), how wide a hinge must
//! be, and for each kind of laser the settings that cut it and the kerf they leave. Figures say where they come from:
//! only a [`Source::Measured`] was measured.

mod cut;
mod profile;
mod shipped;

pub use cut::{CutError, CutSetting, Laser, Process};
pub use profile::{Kind, Material, Sigma, Source};
pub(crate) use profile::{check_format, check_name};
pub use shipped::{DEFAULT, load, parse, shipped};
