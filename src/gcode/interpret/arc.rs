//! Arcs as chords, by the controllers' own rules for what is one.

use kurbo::Point;

use super::block::Block;
use crate::base::units::short;

/// Largest distance between an arc and the chords that stand for it, millimetres.
const ARC_CHORD_MM: f64 = 0.002;
/// Chords of one full turn at the most, however large the radius.
const ARC_CHORDS: f64 = 20_000.0;
/// Ends of an arc that are closer than this without being equal: in the controller's single precision rounding decides
/// whether it goes all the way round or hardly moves.
const ARC_CLOSED_MM: f64 = 0.01;
/// Beyond the slack the two radii may still differ by this part: GRBL's `error:33`, LinuxCNC's spiral.
const ARC_RADIUS_PART: f64 = 0.001;

/// An arc that is to become chords.
pub(super) struct Arc {
    to: Point,
    centre: Point,
    /// Radius at the start and at the end, mm.
    radii: (f64, f64),
    start_angle: f64,
    sweep: f64,
    pub chords: usize,
}

impl Arc {
    /// The arc of a block. `slack_mm`: how far its two radii may differ, whatever its size.
    pub fn new(
        from: Point,
        to: Point,
        block: &Block,
        unit: f64,
        clockwise: bool,
        slack_mm: f64,
    ) -> Result<Self, String> {
        let centre = match (block.r, block.i, block.j) {
            (Some(r), None, None) => {
                let (r, chord) = (r * unit, to - from);
                let half = 0.5 * chord.hypot();
                if half == 0.0 || r == 0.0 || r.abs() < half - slack_mm {
                    return Err("an arc whose radius R does not reach its end".into());
                }
                let height = (r * r - half * half).max(0.0).sqrt();
                let left = chord.turn_90() / (2.0 * half);
                // A positive radius is the shorter way round.
                let side = if (r > 0.0) == clockwise { -1.0 } else { 1.0 };
                from.midpoint(to) + left * (height * side)
            }
            (None, None, None) => return Err("an arc needs I and J, or R".into()),
            (None, i, j) => from + kurbo::Vec2::new(i.unwrap_or(0.0), j.unwrap_or(0.0)) * unit,
            _ => return Err("an arc with both R and a centre".into()),
        };
        if block.r.is_none() && from != to && from.distance(to) < ARC_CLOSED_MM {
            return Err(format!(
                "an arc whose ends are {} mm apart and not equal: rounding decides whether the controller goes all the way round",
                from.distance(to)
            ));
        }
        let (r, s) = (from.distance(centre), to.distance(centre));
        if (r - s).abs() > slack_mm && (r - s).abs() > ARC_RADIUS_PART * r {
            return Err(format!(
                "an arc whose ends are {} and {} mm from its centre",
                short(r, 4),
                short(s, 4)
            ));
        }
        let (a, b) = ((from - centre).atan2(), (to - centre).atan2());
        let mut sweep = (b - a).rem_euclid(std::f64::consts::TAU);
        if clockwise {
            sweep -= std::f64::consts::TAU;
        }
        // The same start and end mean a full turn.
        if sweep.abs() < 1e-9 {
            sweep = std::f64::consts::TAU.copysign(if clockwise { -1.0 } else { 1.0 });
        }
        let step = 2.0 * (1.0 - ARC_CHORD_MM / r.max(ARC_CHORD_MM)).acos();
        Ok(Self {
            to,
            centre,
            radii: (r, s),
            start_angle: a,
            sweep,
            chords: (sweep.abs() / step).ceil().clamp(1.0, ARC_CHORDS) as usize,
        })
    }

    /// The ends of the chords, without the arc's first point.
    pub fn points(&self) -> impl Iterator<Item = Point> + '_ {
        let (r, s) = self.radii;
        (1..=self.chords).map(move |k| {
            if k == self.chords {
                return self.to;
            }
            let t = k as f64 / self.chords as f64;
            let direction = kurbo::Vec2::from_angle(self.start_angle + self.sweep * t);
            self.centre + direction * (r + (s - r) * t)
        })
    }
}
