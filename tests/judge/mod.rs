//! Judges that know file formats and nothing of the program, so that the tests can hold it to its word; and how they run
//! it.

#![allow(
    dead_code,
    reason = "every test binary uses its own part of the judges"
)]
#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a file that cannot be read fails the test"
)]

pub mod linkage;
pub mod raster;
pub mod run;
pub mod sheet;
