//! The sheet on the bed, and what the beam has done to it.

use super::modal::Spindle;

/// One thing that the beam did: along a straight line, or on one spot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burn {
    /// Where it began, machine coordinates, mm.
    pub from_mm: [f64; 2],
    /// Where it ended.
    pub to_mm: [f64; 2],
    /// When it began, s on the machine's clock.
    pub start_s: f64,
    /// When it ended.
    pub end_s: f64,
    /// The S word in force.
    pub s: f64,
    /// True if the power followed the speed (M4 in laser mode), false if it was constant.
    pub dynamic: bool,
    /// True if the move was a rapid: a beam there is always a fault.
    pub rapid: bool,
}

impl Burn {
    /// Its length, mm.
    pub fn length_mm(&self) -> f64 {
        (self.to_mm[0] - self.from_mm[0]).hypot(self.to_mm[1] - self.from_mm[1])
    }

    /// True if the beam stood on one spot: a hole, or a fire.
    pub fn standing(&self) -> bool {
        self.from_mm == self.to_mm
    }
}

/// A cut without interruption: the places where its direction changed, ends included.
pub type Stroke = Vec<[f64; 2]>;

/// Joins burns that follow each other without a gap into strokes, and straight pieces into one: what a person would
/// call the cuts. Spots are left out.
///
/// `tolerance_mm` is how far the ends may be apart, and a dropped point from the straight line through its
/// neighbours: one step of the motors is a good value (0.0125 at 80 steps/mm). O(n).
pub fn strokes(burns: &[Burn], tolerance_mm: f64) -> Vec<Stroke> {
    let mut strokes: Vec<Stroke> = Vec::new();
    let mut open = false;
    let mut last_end_s = f64::NEG_INFINITY;
    // Where the present straight piece may still point: an interval of directions seen from its first point.
    let mut straight = Corridor::default();
    for burn in burns {
        if burn.standing() {
            // With M3 the beam rests on corners: the stroke goes on.
            last_end_s = burn.end_s;
            continue;
        }
        let near =
            |p: [f64; 2]| (p[0] - burn.from_mm[0]).hypot(p[1] - burn.from_mm[1]) <= tolerance_mm;
        // A rest of a few milliseconds in between is a corner; longer is a new stroke.
        let joins = open
            && burn.start_s - last_end_s < 1e-3
            && strokes
                .last()
                .and_then(|s| s.last())
                .is_some_and(|&p| near(p));
        last_end_s = burn.end_s;
        match strokes.last_mut() {
            Some(stroke) if joins => {
                let n = stroke.len();
                let anchor = stroke[n - 2];
                if straight.accepts(anchor, burn.to_mm, tolerance_mm) {
                    stroke[n - 1] = burn.to_mm;
                } else {
                    straight = Corridor::default();
                    straight.accepts(burn.from_mm, burn.to_mm, tolerance_mm);
                    stroke.push(burn.to_mm);
                }
            }
            _ => {
                straight = Corridor::default();
                straight.accepts(burn.from_mm, burn.to_mm, tolerance_mm);
                strokes.push(vec![burn.from_mm, burn.to_mm]);
            }
        }
        open = true;
    }
    strokes
}

/// Directions in which a straight line from an anchor passes all points so far within a tolerance.
#[derive(Default)]
struct Corridor {
    /// Unit vector of the first point, and the half-open angles around it.
    axis: Option<[f64; 2]>,
    low: f64,
    high: f64,
    reached_mm: f64,
}

impl Corridor {
    /// Adds a point if it still fits and lies ahead; false leaves the corridor as it was.
    fn accepts(&mut self, anchor: [f64; 2], point: [f64; 2], tolerance_mm: f64) -> bool {
        let d = [point[0] - anchor[0], point[1] - anchor[1]];
        let length = d[0].hypot(d[1]);
        let slack = if length > tolerance_mm {
            (tolerance_mm / length).asin()
        } else {
            std::f64::consts::FRAC_PI_2
        };
        let Some(axis) = self.axis else {
            self.axis = Some([d[0] / length, d[1] / length]);
            (self.low, self.high) = (-slack, slack);
            self.reached_mm = length;
            return true;
        };
        let along = axis[0] * d[0] + axis[1] * d[1];
        let angle = (axis[0] * d[1] - axis[1] * d[0]).atan2(along);
        if along < self.reached_mm || angle < self.low || angle > self.high {
            return false;
        }
        self.low = self.low.max(angle - slack);
        self.high = self.high.min(angle + slack);
        self.reached_mm = along;
        true
    }
}

/// The beam now, and the record of it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bed {
    burns: Vec<Burn>,
    open: Option<Burn>,
    /// The output is above zero.
    glows: bool,
    changes: Vec<BeamChange>,
    /// Time within burns at which the output was zero already, s.
    dark_s: f64,
}

/// The output goes above zero, or to zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamChange {
    /// When, s on the machine's clock.
    pub at_s: f64,
    /// Whether it is above zero from then on.
    pub on: bool,
}

/// How long and how often the output was above zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeamTime {
    /// Time, s. With M4 the output is zero a little before each stop, where a burn still goes on.
    pub on_s: f64,
    /// How often it was switched on.
    pub periods: usize,
}

/// What the beam is told to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Light {
    pub s: f64,
    pub spindle: Spindle,
    /// The power follows the speed.
    pub dynamic: bool,
    pub rapid: bool,
}

impl Light {
    pub const DARK: Self = Self {
        s: 0.0,
        spindle: Spindle::Off,
        dynamic: false,
        rapid: false,
    };

    fn on(&self) -> bool {
        self.s > 0.0 && self.spindle != Spindle::Off
    }
}

/// No output switches so fast, s.
const INSTANT_S: f64 = 1e-6;

impl Bed {
    /// From now on, at this place, the beam does this. What was open is closed.
    pub fn light(&mut self, now_s: f64, at: [f64; 3], light: Light) {
        let at = [at[0], at[1]];
        if let Some(mut burn) = self.open.take() {
            burn.to_mm = at;
            burn.end_s = now_s;
            // A change in the very moment of another leaves a trace of nothing.
            let least_s = if burn.standing() { INSTANT_S } else { 0.0 };
            if burn.end_s - burn.start_s > least_s {
                self.burns.push(burn);
            }
        }
        self.glow(now_s, light.on());
        if light.on() {
            self.open = Some(Burn {
                from_mm: at,
                to_mm: at,
                start_s: now_s,
                end_s: now_s,
                s: light.s,
                dynamic: light.dynamic,
                rapid: light.rapid,
            });
        }
    }

    /// True if the beam is on.
    pub fn lit(&self) -> bool {
        self.open.is_some()
    }

    fn glow(&mut self, at_s: f64, on: bool) {
        if self.glows != on {
            self.changes.push(BeamChange { at_s, on });
        }
        self.glows = on;
    }

    /// The output was zero already during the last moments of what ends now.
    pub fn faded(&mut self, now_s: f64, dark_s: f64) {
        if self.glows {
            self.dark_s += dark_s;
            self.glow(now_s - dark_s, false);
        }
    }

    /// Every switching of the output.
    pub fn changes(&self) -> &[BeamChange] {
        &self.changes
    }

    /// How long and how often the output was above zero until now.
    pub fn beam_time(&self, now_s: f64) -> BeamTime {
        let open = self.open.map_or(0.0, |b| now_s - b.start_s);
        let closed: f64 = self.burns.iter().map(|b| b.end_s - b.start_s).sum();
        BeamTime {
            on_s: (closed + open - self.dark_s).max(0.0),
            periods: self.changes.iter().filter(|c| c.on).count(),
        }
    }

    /// The S word of the beam, 0 if it is off.
    pub fn s(&self) -> f64 {
        self.open.map_or(0.0, |b| b.s)
    }

    /// Everything burnt so far, with what still burns closed at this time and place.
    pub fn burns(&self, now_s: f64, at: [f64; 3]) -> Vec<Burn> {
        let mut copy = self.clone();
        copy.light(now_s, at, Light::DARK);
        copy.burns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn burn(from: [f64; 2], to: [f64; 2], start_s: f64) -> Burn {
        Burn {
            from_mm: from,
            to_mm: to,
            start_s,
            end_s: start_s + 1.0,
            s: 500.0,
            dynamic: true,
            rapid: false,
        }
    }

    #[test]
    fn straight_pieces_become_one_and_corners_stay() {
        let burns = [
            burn([0.0, 0.0], [1.0, 0.0], 0.0),
            burn([1.0, 0.0], [2.0, 0.001], 1.0),
            burn([2.0, 0.001], [2.0, 3.0], 2.0),
            burn([5.0, 5.0], [6.0, 5.0], 9.0),
        ];
        let strokes = strokes(&burns, 0.0125);
        assert_eq!(strokes.len(), 2);
        assert_eq!(strokes[0], [[0.0, 0.0], [2.0, 0.001], [2.0, 3.0]]);
        assert_eq!(strokes[1], [[5.0, 5.0], [6.0, 5.0]]);
    }

    #[test]
    fn back_over_the_same_line_is_another_piece() {
        let burns = [
            burn([0.0, 0.0], [5.0, 0.0], 0.0),
            burn([5.0, 0.0], [0.0, 0.0], 1.0),
        ];
        assert_eq!(strokes(&burns, 0.0125)[0].len(), 3);
    }

    #[test]
    fn a_circle_of_small_steps_is_not_flattened() {
        let point = |k: i32| {
            let a = f64::from(k) * 0.01;
            [20.0 * a.cos(), 20.0 * a.sin()]
        };
        let burns: Vec<Burn> = (0..628)
            .map(|k| burn(point(k), point(k + 1), f64::from(k)))
            .collect();
        let strokes = strokes(&burns, 0.0125);
        assert_eq!(strokes.len(), 1);
        for pair in strokes[0].windows(2) {
            let middle = [
                (pair[0][0] + pair[1][0]) / 2.0,
                (pair[0][1] + pair[1][1]) / 2.0,
            ];
            assert!(20.0 - middle[0].hypot(middle[1]) < 0.03);
        }
    }

    #[test]
    fn what_still_burns_is_counted() {
        let mut bed = Bed::default();
        let light = Light {
            s: 300.0,
            spindle: Spindle::Constant,
            dynamic: false,
            rapid: false,
        };
        bed.light(1.0, [2.0, 3.0, 0.0], light);
        assert!(bed.lit() && bed.s() == 300.0);
        let burns = bed.burns(4.0, [2.0, 3.0, 0.0]);
        assert!(burns.len() == 1 && burns[0].standing() && burns[0].end_s == 4.0);
    }
}
