//! What every room stands on, and nothing that belongs to one of them.
//!
//! - [`catalog`]: shipped profiles, those of a person's own folder and those from files, by one name;
//! - [`curve`]: lines of straight pieces and arcs;
//! - [`ids`]: typed indices and the per-element containers that only they open;
//! - [`plane`]: points, segments and polygons;
//! - [`progress`]: how long work reports and how it is interrupted, without knowing a terminal;
//! - [`atomic`]: outputs that appear complete or not at all;
//! - [`document`]: TOML that a person wrote, read strictly and blamed exactly;
//! - [`random`]: seeded numbers for what is simulated;
//! - [`sparse`]: symmetric positive definite systems, with the symbolic factor kept between solves;
//! - [`starting`]: a profile of one's own from a shipped one, with an explanation of every key;
//! - [`union`]: disjoint sets;
//! - [`units`]: the few conversions and number formats that several rooms share.

pub mod atomic;
#[cfg(test)]
pub mod cases;
pub mod catalog;
pub mod curve;
pub mod document;
pub mod ids;
pub mod plane;
pub mod progress;
pub mod random;
pub mod sparse;
pub mod starting;
pub mod union;
pub mod units;
