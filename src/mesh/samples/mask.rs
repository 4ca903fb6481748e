//! A face in relief, in the manner of a calm theatre mask.
//!
//! An oval dome carries smooth bumps and dents: no folds, no walls, one rim. It looks along +Z, with +Y up. Lengths
//! below are in units of half the height, so the whole face scales with its height.

use super::SampleError;
use super::parameter::{Parameter, parameters};
use super::revolve::{Arrays, Ends, revolve};

parameters! {
    /// A face: forehead, brows, eyes, nose, cheeks, lips and chin on an oval dome.
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
    let width = 0.74 * (1.0 + 0.10 * v - 0.05 * v * v);
    (u * width, v)
}

/// The height above the rim's plane at the point (x, y) of the face, which is (u, v) in the disk.
fn height(u: f64, v: f64, x: f64, y: f64, relief: f64) -> f64 {
    let inside = 1.0 - u * u - v * v;
    // Not quite a paraboloid: flatter in front, rounder at the temples.
    let dome = 0.62 * inside - 0.10 * inside * inside;
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
    let mut z = 0.0;
    // Both sides of a feature that lies off the middle: the sum is smooth across x = 0.
    let pair = |centre: (f64, f64), size: (f64, f64)| {
        bump(x, y, centre, size) + bump(x, y, (-centre.0, centre.1), size)
    };
    z += 0.020 * bump(x, y, (0.0, 0.55), (0.30, 0.22));
    z += 0.035 * pair((0.24, 0.20), (0.15, 0.06));
    z -= 0.060 * pair((0.25, 0.05), (0.13, 0.08));
    z += 0.035 * pair((0.25, 0.03), (0.09, 0.045));
    z += 0.17 * bump(x, y, (0.0, -0.13), (0.085, 0.16));
    z += 0.030 * pair((0.34, -0.20), (0.14, 0.15));
    z += 0.045 * bump(x, y, (0.0, -0.43), (0.13, 0.05));
    z += 0.050 * bump(x, y, (0.0, -0.56), (0.10, 0.05));
    z += 0.060 * bump(x, y, (0.0, -0.78), (0.15, 0.11));
    z
}
