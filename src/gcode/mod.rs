//! Stage 8: a toolpath becomes text for a controller, and the text is read back and judged.
//!
//! [`write()`] makes the dialect that the machine's profile asks for. [`read_as`] is an interpreter that knows nothing of
//! the writer: it gives the [`Move`]s that a controller would make, beam and all, and complains by line. [`verify`] compares those moves with the machine
//! and, where a sheet is given, with what it wants cut: every cut as often as asked, nothing else, nothing outside.

mod compare;
mod coverage;
mod finding;
mod interpret;
mod ligament;
mod outside;
mod pierce;
mod rim_last;
#[cfg(test)]
mod round_trip;
mod verify;
mod write;

pub use compare::Slack;
pub use finding::{Finding, Rule, TOLERANCE_MM};
pub use interpret::{Beam, Dialect, Move, Program, read, read_as, read_with};
pub use ligament::Ligaments;
pub use verify::{Verdict, compare_burnt, verify};
pub use write::{Declared, GcodeError, machine_of, passes_of, write};
