//! What the planner knows of one move, and of the corner before it.

/// What the axes X, Y, Z of a machine can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest rate of each axis, mm/min (GRBL `$110`–`$112`).
    pub max_rate_mm_min: [f64; 3],
    /// Acceleration of each axis, mm/s² (GRBL `$120`–`$122`).
    pub acceleration_mm_s2: [f64; 3],
    /// How far a path rounded at a corner could stray from it, mm (GRBL `$11`): sets the speed in the corner, the
    /// path itself stays sharp. GRBL ships 0.01; more is faster and shakes the machine more.
    pub junction_deviation_mm: f64,
}

/// A limit that no machine has.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{what} is {value}, but must be a finite number above zero: correct it in the machine's settings"
)]
pub struct LimitsError {
    /// The limit and its axis.
    pub what: String,
    /// Its value.
    pub value: f64,
}

impl Limits {
    /// Checks that every limit is finite and positive (the junction deviation may be zero: stop at every corner).
    ///
    /// # Errors
    /// The first one that is not.
    pub fn validate(&self) -> Result<(), LimitsError> {
        for (axis, name) in ["X", "Y", "Z"].iter().enumerate() {
            for (what, value) in [
                ("maximum rate", self.max_rate_mm_min[axis]),
                ("acceleration", self.acceleration_mm_s2[axis]),
            ] {
                if !(value.is_finite() && value > 0.0) {
                    return Err(LimitsError {
                        what: format!("the {what} of axis {name}"),
                        value,
                    });
                }
            }
        }
        if !(self.junction_deviation_mm.is_finite() && self.junction_deviation_mm >= 0.0) {
            return Err(LimitsError {
                what: "the junction deviation".into(),
                value: self.junction_deviation_mm,
            });
        }
        Ok(())
    }
}

/// A straight move, before the planner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// End minus start, mm.
    pub delta_mm: [f64; 3],
    /// The programmed rate, mm/min; none for a rapid, which runs as fast as its axes allow.
    pub rate_mm_min: Option<f64>,
}

/// A move with the limits that hold along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Unit vector of the move.
    pub direction: [f64; 3],
    /// Length, mm.
    pub length_mm: f64,
    /// Acceleration along the direction, mm/s².
    pub acceleration_mm_s2: f64,
    /// The speed wanted, mm/s: the programmed one within the axes' limits.
    pub nominal_mm_s: f64,
    /// The fastest that the axes can go along the direction, mm/s.
    pub fastest_mm_s: f64,
}

/// The slowest programmed rate, mm/min. GRBL does the same: a rate of zero would never arrive.
const MINIMUM_RATE_MM_MIN: f64 = 1.0;

/// Cosine beyond which a corner counts as none or as a reversal (GRBL's figure; 0.08°).
const STRAIGHT_COSINE: f64 = 0.999_999;

impl Block {
    /// The block of a move, or none if the move goes nowhere (a controller drops such moves: no stop, no corner).
    pub fn new(wanted: &Move, limits: &Limits) -> Option<Self> {
        let length_mm = norm(wanted.delta_mm);
        if !(length_mm > 0.0 && length_mm.is_finite()) {
            return None;
        }
        let direction = wanted.delta_mm.map(|d| d / length_mm);
        let fastest = projected(limits.max_rate_mm_min, direction);
        let rate = match wanted.rate_mm_min {
            Some(rate) => rate.max(MINIMUM_RATE_MM_MIN).min(fastest),
            None => fastest,
        };
        Some(Self {
            direction,
            length_mm,
            acceleration_mm_s2: projected(limits.acceleration_mm_s2, direction),
            nominal_mm_s: rate / 60.0,
            fastest_mm_s: fastest / 60.0,
        })
    }

    /// The square of the largest speed, (mm/s)², at which this block may follow `previous`.
    ///
    /// A circle that touches both moves and comes within the junction deviation of the corner would need this speed's
    /// centripetal acceleration (S. K. Jeon, "Improving Grbl: cornering algorithm", 2011); with per-axis limits taken
    /// along the bisector as in GRBL 1.1. A reversal is a full stop, a straight continuation is no corner.
    pub fn corner_sqr(&self, previous: &Self, limits: &Limits) -> f64 {
        let slower = self.nominal_mm_s.min(previous.nominal_mm_s).powi(2);
        let cosine = -dot(self.direction, previous.direction);
        if cosine > STRAIGHT_COSINE {
            return 0.0;
        }
        if cosine < -STRAIGHT_COSINE {
            return slower;
        }
        let mut bisector: [f64; 3] =
            std::array::from_fn(|k| self.direction[k] - previous.direction[k]);
        let length = norm(bisector);
        bisector = bisector.map(|b| b / length);
        let acceleration = projected(limits.acceleration_mm_s2, bisector);
        let half_sine = (0.5 * (1.0 - cosine)).sqrt();
        let junction = acceleration * limits.junction_deviation_mm * half_sine / (1.0 - half_sine);
        junction.min(slower)
    }
}

/// The largest magnitude along `direction` that keeps every axis within its limit.
fn projected(limits: [f64; 3], direction: [f64; 3]) -> f64 {
    let mut least = f64::INFINITY;
    for (limit, d) in limits.iter().zip(direction) {
        if d != 0.0 {
            least = least.min((limit / d).abs());
        }
    }
    least
}

fn norm(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) const LIMITS: Limits = Limits {
        max_rate_mm_min: [6000.0, 6000.0, 3000.0],
        acceleration_mm_s2: [500.0, 500.0, 500.0],
        junction_deviation_mm: 0.01,
    };

    pub(crate) fn to(x: f64, y: f64, rate_mm_min: f64) -> Move {
        Move {
            delta_mm: [x, y, 0.0],
            rate_mm_min: Some(rate_mm_min),
        }
    }

    #[test]
    fn a_diagonal_may_be_faster_than_each_of_its_axes() {
        let rapid = Move {
            delta_mm: [3.0, 3.0, 0.0],
            rate_mm_min: None,
        };
        let block = Block::new(&rapid, &LIMITS).unwrap();
        assert!((block.nominal_mm_s - 100.0 * 2f64.sqrt()).abs() < 1e-9);
        assert!((block.acceleration_mm_s2 - 500.0 * 2f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_right_angle_is_passed_at_the_speed_of_its_inscribed_arc() {
        let x = Block::new(&to(10.0, 0.0, 6000.0), &LIMITS).unwrap();
        let y = Block::new(&to(0.0, 10.0, 6000.0), &LIMITS).unwrap();
        // sin(θ/2) = 1/√2; along the bisector both axes give √2 · 500 mm/s².
        let half = 0.5f64.sqrt();
        let wanted = 500.0 * 2f64.sqrt() * 0.01 * half / (1.0 - half);
        assert!((y.corner_sqr(&x, &LIMITS) - wanted).abs() < 1e-9);
    }

    #[test]
    fn straight_on_is_no_corner_and_a_reversal_is_a_stop() {
        let there = Block::new(&to(10.0, 0.0, 3000.0), &LIMITS).unwrap();
        let on = Block::new(&to(10.0, 0.0, 1200.0), &LIMITS).unwrap();
        let back = Block::new(&to(-10.0, 0.0, 3000.0), &LIMITS).unwrap();
        assert!((on.corner_sqr(&there, &LIMITS) - 400.0).abs() < 1e-9);
        assert_eq!(back.corner_sqr(&there, &LIMITS), 0.0);
    }

    #[test]
    fn nowhere_is_no_block_and_bad_limits_are_named() {
        assert_eq!(Block::new(&to(0.0, 0.0, 100.0), &LIMITS), None);
        assert_eq!(Block::new(&to(f64::NAN, 0.0, 100.0), &LIMITS), None);
        let mut bad = LIMITS;
        bad.acceleration_mm_s2[1] = 0.0;
        let text = bad.validate().unwrap_err().to_string();
        assert!(text.contains("acceleration of axis Y is 0"), "{text}");
        assert_eq!(LIMITS.validate(), Ok(()));
    }
}
