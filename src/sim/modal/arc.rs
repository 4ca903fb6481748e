//! Arcs as the firmware runs them: straight segments within a tolerance.

use super::block::Words;
use super::{Drive, Modal};
use crate::sim::settings::Settings;

/// The rest of an arc: straight segments within the arc tolerance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Arc {
    pub drive: Drive,
    pub axes: [usize; 3],
    pub centre: [f64; 2],
    pub radius: f64,
    pub start_angle: f64,
    pub sweep: f64,
    pub from_linear: f64,
    pub target: [f64; 3],
    pub next: u32,
    pub segments: u32,
}

impl Arc {
    /// The length of its segments together, mm.
    pub fn segments_mm(&self) -> f64 {
        let count = f64::from(self.segments);
        let chord = 2.0 * self.radius * (0.5 * self.sweep / count).sin();
        count * chord.hypot((self.target[self.axes[2]] - self.from_linear) / count)
    }

    /// The end of the next segment, or none when the arc is done.
    pub fn point(&self) -> Option<[f64; 3]> {
        if self.next > self.segments {
            return None;
        }
        if self.next == self.segments {
            return Some(self.target);
        }
        let part = f64::from(self.next) / f64::from(self.segments);
        let angle = self.start_angle + self.sweep * part;
        let mut point = self.target;
        point[self.axes[0]] = self.centre[0] + self.radius * angle.cos();
        point[self.axes[1]] = self.centre[1] + self.radius * angle.sin();
        point[self.axes[2]] =
            self.from_linear + (self.target[self.axes[2]] - self.from_linear) * part;
        Some(point)
    }
}

/// A G2 or G3 from the present position, by centre or by radius.
pub(super) fn arc(
    words: &mut Words,
    modal: &Modal,
    target: [f64; 3],
    drive: Drive,
    unit: f64,
    settings: &Settings,
) -> Result<Arc, u8> {
    let axes: [usize; 3] = match modal.plane {
        18 => [2, 0, 1],
        19 => [1, 2, 0],
        _ => [0, 1, 2],
    };
    let letters = [b'X', b'Y', b'Z'];
    if words.get(letters[axes[0]]).is_none() && words.get(letters[axes[1]]).is_none() {
        return Err(32);
    }
    let clockwise = modal.motion == 2;
    let from = [modal.position[axes[0]], modal.position[axes[1]]];
    let to = [target[axes[0]], target[axes[1]]];
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let (offset, radius) = if let Some(r) = words.take(b'R') {
        let mut r = r * unit;
        if x == 0.0 && y == 0.0 {
            return Err(33);
        }
        let h = 4.0 * r * r - x * x - y * y;
        if h < 0.0 {
            return Err(34);
        }
        let mut h = -h.sqrt() / x.hypot(y);
        if !clockwise {
            h = -h;
        }
        if r < 0.0 {
            h = -h;
            r = -r;
        }
        ([0.5 * (x - y * h), 0.5 * (y + x * h)], r)
    } else {
        let words_of = [b'I', b'J', b'K'];
        let given = [words.take(words_of[axes[0]]), words.take(words_of[axes[1]])];
        if given.iter().all(Option::is_none) {
            return Err(35);
        }
        let offset = given.map(|g| g.unwrap_or(0.0) * unit);
        let end = (x - offset[0]).hypot(y - offset[1]);
        let radius = offset[0].hypot(offset[1]);
        let off = (end - radius).abs();
        if off > 0.005 && (off > 0.5 || off > 0.001 * radius) {
            return Err(33);
        }
        (offset, radius)
    };
    let centre = [from[0] + offset[0], from[1] + offset[1]];
    let start = [-offset[0], -offset[1]];
    let end = [to[0] - centre[0], to[1] - centre[1]];
    let mut sweep =
        (start[0] * end[1] - start[1] * end[0]).atan2(start[0] * end[0] + start[1] * end[1]);
    // GRBL's threshold: below it the arc is a full circle.
    const FULL: f64 = 5e-7;
    if clockwise && sweep >= -FULL {
        sweep -= std::f64::consts::TAU;
    } else if !clockwise && sweep <= FULL {
        sweep += std::f64::consts::TAU;
    }
    let tolerance = settings.arc_tolerance_mm.min(radius);
    let chord = (tolerance * (2.0 * radius - tolerance)).sqrt();
    let count = (0.5 * sweep * radius).abs() / chord;
    // A hundred thousand segments are metres of radius; more would only stall the simulation.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped; NaN gives 0"
    )]
    let segments = count.floor().clamp(1.0, 1e5) as u32;
    Ok(Arc {
        drive,
        axes,
        centre,
        radius,
        start_angle: start[1].atan2(start[0]),
        sweep,
        from_linear: modal.position[axes[2]],
        target,
        next: 1,
        segments,
    })
}
