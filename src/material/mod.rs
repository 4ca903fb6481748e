//! Stage 0: what the sheet is made of, and what cuts it.
//!
//! A [`Material`] is plain data from `profiles/NAME.toml`: how far it stretches at a hinge (σ), how wide a hinge must
//! be, and for each kind of laser and torch the settings that cut and mark it and the kerf they leave. Figures say
//! where they come from: only a [`Source::Measured`] was measured. [`Material::cut_for`] gives the settings for one
//! machine, every default filled in.

mod amend;
mod cut;
mod fit;
mod profile;
mod reading;
mod shipped;
mod start;

pub use amend::{AmendError, Measured, MeasuredCut, amend};
pub use cut::{CutEntry, EngraveEntry, Laser, PassOrder, Process};
pub use fit::{CutError, CutSetting, Fit, MarkSetting, TorchSetting, classify};
pub(crate) use profile::{FORMAT, check_format, check_name};
pub use profile::{Kind, Material, Sigma, Source, StockSize, Tip, TipShape};
pub use reading::{Failure, Reading, neck_mm};
pub(crate) use reading::{MOST_HINGES, check_date};
pub use shipped::{DEFAULT, load, own_file, own_files, parse, resolve, shipped};
pub use start::start;
