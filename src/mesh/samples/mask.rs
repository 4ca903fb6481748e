//! A face in relief, in the manner of a calm theatre mask.
//!
//! An oval dome carries smooth bumps and dents: no folds, no walls, one rim. It looks along +Z, with +Y up. Lengths
//! below are in units of half the height, so the whole face scales with its height.

use super::SampleError;
use super::parameter::{Parameter, parameters};
use super::revolve::{Arrays, Ends, revolve};

parameters! {
    /// A face: forehead, brows, closed eyes, nose, cheeks, lips and chin on an oval dome. With the defaults
    /// max λ / min λ is 2.3 without a cone, and 1.8 with one at the tip of the nose, outside the nearest 5 mm.
    Mask {
        /// height from chin to crown
        height_mm = 200.0 in 1.0..=10000.0,
        /// how far the features stand out: 1 is a calm face, 0 the bare dome
        relief = 1.0 in 0.0..=1.5,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Mask {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        let half_mm = self.height_mm / 2.0;
        let (mut positions, faces) = revolve(|t| (t, 0.0), Ends::Tip, self.faces);
        for p in &mut positions {
            let (x, y) = oval(p.x, p.y);
            p.z = half_mm * height(p.x, p.y, x, y, self.relief);
            (p.x, p.y) = (half_mm * x, half_mm * y);
        }
        Ok((positions, faces))
    }
}

/// From the unit disk to the outline of a face: an oval that narrows towards the chin.
fn oval(u: f64, v: f64) -> (f64, f64) {
    let width = 0.76 * (1.0 + 0.08 * v - 0.07 * v * v);
    (u * width, v)
}

/// The height above the rim's plane at the point (x, y) of the face, which is (u, v) in the disk.
fn height(u: f64, v: f64, x: f64, y: f64, relief: f64) -> f64 {
    let inside = 1.0 - u * u - v * v;
    // Not quite a paraboloid: flatter in front, rounder at the temples.
    let dome = 0.56 * inside - 0.13 * inside * inside;
    // Features fade out before the rim, which stays a smooth curve.
    let fade = (3.0 * inside).clamp(0.0, 1.0);
    let fade = fade * fade * (3.0 - 2.0 * fade);
    dome + relief * fade * features(x, y)
}

/// A round bump of height 1 at (cx, cy), with half widths (sx, sy).
fn bump(x: f64, y: f64, (cx, cy): (f64, f64), (sx, sy): (f64, f64)) -> f64 {
    let (a, b) = ((x - cx) / sx, (y - cy) / sy);
    (-0.5 * (a * a + b * b)).exp()
}

/// The relief on top of the dome; symmetric in x.
fn features(x: f64, y: f64) -> f64 {
    // A feature off the middle comes in two, and their sum is smooth across x = 0.
    let both = |centre: (f64, f64), size: (f64, f64)| {
        bump(x, y, centre, size) + bump(x, y, (-centre.0, centre.1), size)
    };
    let middle = |cy: f64, size: (f64, f64)| bump(x, y, (0.0, cy), size);

    let forehead = 0.022 * middle(0.58, (0.32, 0.20));
    let brows =
        0.030 * both((0.23, 0.265), (0.14, 0.055)) + 0.014 * both((0.36, 0.235), (0.09, 0.05));
    let sockets = -0.078 * both((0.24, 0.115), (0.13, 0.085));
    let lids =
        0.062 * both((0.245, 0.095), (0.095, 0.055)) - 0.022 * both((0.245, 0.045), (0.085, 0.019));
    let nose = 0.052 * middle(0.06, (0.062, 0.15))
        + 0.135 * middle(-0.16, (0.090, 0.095))
        + 0.045 * both((0.095, -0.19), (0.05, 0.05));
    let cheeks =
        0.032 * both((0.33, -0.13), (0.13, 0.14)) - 0.014 * both((0.24, -0.40), (0.07, 0.09));
    let mouth = 0.040 * middle(-0.44, (0.16, 0.10)) + 0.025 * both((0.05, -0.435), (0.075, 0.031))
        - 0.026 * middle(-0.487, (0.14, 0.020))
        + 0.042 * middle(-0.545, (0.085, 0.036))
        - 0.018 * middle(-0.635, (0.12, 0.035));
    let chin = 0.060 * middle(-0.76, (0.14, 0.10));
    forehead + brows + sockets + lids + nose + cheeks + mouth + chin
}
