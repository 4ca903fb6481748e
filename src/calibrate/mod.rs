//! How far a material may be stretched, from strips that were pulled, with a stated confidence.
//!
//! A *strip* is a piece of a coupon with hinges of one [`Geometry`], stretched from mark to mark of a gauge until a hinge
//! fails. Its [`Reading`](crate::material::Reading) says the last stretch that held and the first that did not: an
//! interval, open above if it never failed. [`fit`] turns readings into a [`Calibration`], which states for a *sheet*
//! (another geometry, many more hinges) the σ at which none of them fails.
//!
//! # The model
//!
//! - *Load.* An opening λ bends a ligament by α(λ, c/L), about its own middle and not about the vertex, and strains it by
//!   ε = α/(2 h² J₃) ([`Ligament`](crate::pattern::Ligament)). All is measured in ln ε: thickness and fold aside, this is
//!   where hinges of different widths, tips and edges compare.
//! - *Hinge.* It fails at ln ε = level + exponent · ln(h/h₀) + spread · Z, each with a Z of its own. The exponent is what
//!   the beam gets wrong about the width; its prior is normal, 0 ± 0.3. The level's prior is flat, and so is that of
//!   ln spread, between 1 % and 25 % of σ: for a level and a spread this is the prior whose predictions cover as often as
//!   they claim at every spread, not on average over spreads.
//! - *Strip and sheet* fail at their weakest hinge: P(all N bear a load) = S^N. The reading noise is one factor on all
//!   stretches of a strip.
//! - *Law of Z.* Normal or Weibull: strips of some tens of hinges cannot tell which, and the weakest of a thousand depends
//!   on it. A question is asked of both posteriors and the worse answer counts.
//!
//! What differs between whole strips is not modelled apart: it looks like a larger spread of hinges, from which the way to
//! a larger sheet is longer, so that the bound errs low. The same holds for noise beyond what is stated.
//!
//! # The bound
//!
//! [`Calibration::bound`] is predictive: the probability that this very sheet survives, averaged over all that the
//! readings leave open, is at least the confidence; not a bound on a mean. Three tenths of the allowed risk are kept back
//! for what the model cannot know. `tests/calibrate.rs` holds it to its word over simulated materials
//! ([`SimulatedMaterial`]), in every cell of spread, number of strips, noise and law; with six strips the median distance
//! below the bound of someone who knows the material is 1 to 10 % of σ at a confidence of 0.9. It is never more than a strip bore,
//! and never more than fully open. Outside of the strips' ranges it is lowered and says so, and far outside refused; a
//! sheet of another thickness is another material.
//!
//! The posterior is a sum over nodes that lie where least squares put them, a few thousand: milliseconds, no randomness,
//! the same bytes everywhere. [`Calibration::next_strip`] says which strip would raise the bound most.
//!
//! # Kerf
//!
//! [`kerf`](kerf()) takes caliper readings of pieces and holes.
//!
//! # Readings
//!
//! What a maker wrote down beside a [`Coupon`], as CSV or TOML, becomes [`Readings`], `readings.toml`: checked, with what
//! looks wrong as [`Doubt`]s, and with the hinges as wide as they really are under the kerf that was measured. A
//! [`SimulatedBench`] writes down what it reads from a coupon, so that the whole evening can be rehearsed.

mod bench;
mod bound;
mod coupon;
mod fit;
mod geometry;
mod kerf;
mod next;
mod readings;
mod refusal;
mod scatter;
mod simulated;

#[cfg(test)]
mod tests;

pub use bench::SimulatedBench;
pub use bound::{Bound, CONFIDENCES, Caution, Demand, StoppedBy};
pub use coupon::{
    Coupon, CouponError, CouponJob, CouponPlan, CouponWish, GAUGE_STEP, KerfPiece, MOST_STRIPS,
    SettingSquare, Strip, coupon,
};
pub use fit::{Calibration, FitOptions, Limit, fit};
pub use geometry::Geometry;
pub use kerf::{Kerf, KerfError, KerfReading, Side, kerf};
pub use next::{Candidate, NextStrip};
pub(crate) use readings::{
    Answer, Item, KERF_DECIMALS, check_calipers, check_stretch, failure, items, number, pulled, yes,
};
pub use readings::{Doubt, MeasuredPiece, Readings, TriedSetting, not_counted_yet, template};
pub use refusal::{Measure, Refusal};
pub use scatter::{LAWS, Law};
pub use simulated::{Gauge, SimulatedMaterial};
