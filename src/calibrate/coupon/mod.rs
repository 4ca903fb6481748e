//! A coupon: what is cut to find σ, kerf and setting of a sheet, and what it is called.
//!
//! [`Coupon`] is the list of everything on it, `coupon.toml`: strips of hinges, pieces and holes for calipers, and squares
//! that are each cut at a power and a speed of their own. Each has a name, which is engraved beside it and stands in the
//! readings.

mod check;
mod comb;
mod plan;
mod strip;

use serde::{Deserialize, Serialize};

use super::kerf::Side;

pub(super) use check::check_setting;

pub use plan::{CouponError, CouponJob, CouponPlan, CouponWish, GAUGE_STEP, MOST_STRIPS, coupon};

/// The version of `coupon.toml`.
const FORMAT: u32 = 1;

/// What was cut: `coupon.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coupon {
    /// Version of the format; 1.
    pub format: u32,
    /// Name of the material's profile.
    pub material: String,
    /// Name of the machine's profile.
    pub machine: String,
    /// Thickness of the sheet, millimetres.
    pub thickness_mm: f64,
    /// The kerf for which the strips' ligaments were drawn, millimetres. With another one they are wider or narrower by the
    /// difference.
    pub kerf_mm: f64,
    /// Finished radius of the slits' ends, millimetres; half the kerf if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_radius_mm: Option<f64>,
    /// From mark to mark of the gauge card, as a stretch: 0.05.
    pub gauge_step: f64,
    /// The strips.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub strip: Vec<Strip>,
    /// What is measured with calipers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kerf: Vec<KerfPiece>,
    /// The squares of the power and speed grid.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub setting: Vec<SettingSquare>,
}

/// A strip of hinges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Strip {
    /// Its name, as it is engraved: `A1`.
    pub name: String,
    /// Width of its ligaments as drawn, millimetres.
    pub hinge_width_mm: f64,
    /// Edge L of its triangles, millimetres.
    pub edge_mm: f64,
    /// How many hinges open.
    pub hinges: u32,
    /// From one of its two marks to the other while it is closed, millimetres.
    pub gauge_mm: f64,
}

/// A piece or a hole for calipers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KerfPiece {
    /// Its name: `K1`.
    pub name: String,
    /// A piece, or the hole that it leaves.
    pub side: Side,
    /// From centre line to centre line as drawn, millimetres.
    pub nominal_mm: f64,
}

/// A square that is cut at a power and a speed of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettingSquare {
    /// Its name: `P1`.
    pub name: String,
    /// Power, per cent of the machine's.
    pub power_percent: f64,
    /// Speed, mm/min.
    pub speed_mm_per_min: f64,
}
