//! Kerf from calipers: pieces are smaller than drawn by one kerf, holes larger by one.
//!
//! Measured = nominal · (1 + g) ∓ k. A piece and a hole together give the kerf k whatever the machine's scale error g is;
//! with only one kind, g counts as 0. Least squares over all readings; the interval is Student's.

use serde::{Deserialize, Serialize};

/// On which side of the cut was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// What is left between two cuts: a square, a rib.
    Piece,
    /// What is gone between two cuts: the hole of a square, a slot.
    Hole,
}

/// One measure of the kerf comb.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KerfReading {
    /// A piece or a hole.
    pub side: Side,
    /// Distance of the two cuts' centre lines as drawn, millimetres.
    pub nominal_mm: f64,
    /// What the calipers say, millimetres.
    pub measured_mm: f64,
}

/// The kerf and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Kerf {
    /// Its estimate, millimetres.
    pub kerf_mm: f64,
    /// Standard deviation of a single reading, millimetres: of the cut's width and of the calipers.
    pub spread_mm: f64,
    /// Ends of its interval, millimetres.
    pub interval_mm: [f64; 2],
    /// The confidence of the interval.
    pub confidence: f64,
    /// By how much the machine draws too large, relative; none if there were only pieces or only holes.
    pub scale_error: Option<f64>,
}

/// Why there is no kerf.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KerfError {
    /// Too few readings.
    #[error(
        "{count} kerf reading(s), and at least {needed} are needed: measure the squares and their holes"
    )]
    TooFew {
        /// How many there are.
        count: usize,
        /// How many are needed.
        needed: usize,
    },
    /// A reading that cannot be.
    #[error(
        "kerf reading {number}: {measured_mm} mm was measured where {nominal_mm} mm was drawn: both must be positive and differ by less than half; are the units mixed up?"
    )]
    Reading {
        /// Its number, from 1.
        number: usize,
        /// As drawn, millimetres.
        nominal_mm: f64,
        /// As measured, millimetres.
        measured_mm: f64,
    },
    /// No kerf comes out.
    #[error(
        "the kerf comes out as {kerf_mm:.3} mm: pieces must be smaller than their holes; were the two mixed up?"
    )]
    NotPositive {
        /// What came out, millimetres.
        kerf_mm: f64,
    },
    /// The machine is not to scale.
    #[error(
        "the machine draws {percent:+.1} % off: set its steps per millimetre first ($100 and $101 of GRBL), then cut the comb anew"
    )]
    Scale {
        /// By how much, per cent.
        percent: f64,
    },
    /// One reading is off.
    #[error("kerf reading {number} is {off_mm:+.2} mm off what the others say: measure it again")]
    Outlier {
        /// Its number, from 1.
        number: usize,
        /// By how much, millimetres.
        off_mm: f64,
    },
    /// A confidence that is none.
    #[error("a confidence of {confidence} is not between 0.5 and 0.999")]
    Confidence {
        /// What was given.
        confidence: f64,
    },
}

/// Calipers do not show less than this, millimetres.
const RESOLUTION_MM: f64 = 0.01;
/// A machine that is farther off than this is not ready.
const MOST_SCALE_ERROR: f64 = 0.02;
/// A reading outside of this interval of what the others predict is an outlier, if it is off by this much at the least.
const OUTLIER_CONFIDENCE: f64 = 0.9999;
const OUTLIER_MM: f64 = 0.1;

/// The half-width of Student's interval with `freedom` degrees of freedom, in standard errors.
///
/// With t = √ν tan θ the probability of |T| < t is ∫₀^θ cos^{ν−1} over the same integral to π/2.
fn student(freedom: usize, confidence: f64) -> f64 {
    // Beyond this the law is normal, and the integrand too narrow for the rule.
    let freedom = freedom.min(1000);
    let power = freedom as f64 - 1.0;
    let integral = |to: f64| {
        let n = 400;
        let step = to / f64::from(n);
        let sum: f64 = (0..=n)
            .map(|k| {
                let weight = if k == 0 || k == n {
                    1.0
                } else if k % 2 == 1 {
                    4.0
                } else {
                    2.0
                };
                weight * (f64::from(k) * step).cos().max(0.0).powf(power)
            })
            .sum();
        sum * step / 3.0
    };
    let wanted = confidence * integral(std::f64::consts::FRAC_PI_2);
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if integral(middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    (freedom as f64).sqrt() * low.tan()
}

/// Kerf, scale error and the standard deviations of the kerf in units of a reading's.
struct Line {
    kerf_mm: f64,
    scale: f64,
    kerf_sd: f64,
}

fn sign(reading: &KerfReading) -> f64 {
    match reading.side {
        Side::Piece => -1.0,
        Side::Hole => 1.0,
    }
}

/// Least squares of measured − nominal = ±k + g · nominal, without g if it is not `free`.
fn least_squares<'a>(readings: impl Iterator<Item = &'a KerfReading>, free: bool) -> Line {
    let (mut n, mut sx, mut xx, mut sy, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for r in readings {
        let (s, x, y) = (sign(r), r.nominal_mm, r.measured_mm - r.nominal_mm);
        n += 1.0;
        sx += s * x;
        xx += x * x;
        sy += s * y;
        xy += x * y;
    }
    if !free {
        return Line {
            kerf_mm: sy / n,
            scale: 0.0,
            kerf_sd: 1.0 / f64::sqrt(n),
        };
    }
    let det = n * xx - sx * sx;
    Line {
        kerf_mm: (xx * sy - sx * xy) / det,
        scale: (n * xy - sx * sy) / det,
        kerf_sd: f64::sqrt(xx / det),
    }
}

fn residual(reading: &KerfReading, line: &Line) -> f64 {
    reading.measured_mm - reading.nominal_mm * (1.0 + line.scale) - sign(reading) * line.kerf_mm
}

/// The kerf from readings, with an interval of this confidence.
///
/// # Errors
/// [`KerfError`] says what is wrong and what to measure.
pub fn kerf(readings: &[KerfReading], confidence: f64) -> Result<Kerf, KerfError> {
    if !(0.5..=0.999).contains(&confidence) {
        return Err(KerfError::Confidence { confidence });
    }
    for (i, r) in readings.iter().enumerate() {
        let sound = r.nominal_mm > 0.0
            && r.nominal_mm.is_finite()
            && r.measured_mm > 0.0
            && (r.measured_mm - r.nominal_mm).abs() < 0.5 * r.nominal_mm;
        if !sound {
            return Err(KerfError::Reading {
                number: i + 1,
                nominal_mm: r.nominal_mm,
                measured_mm: r.measured_mm,
            });
        }
    }
    let of = |side: Side| readings.iter().filter(|r| r.side == side).count();
    let both = of(Side::Piece) > 0 && of(Side::Hole) > 0;
    let unknowns = if both { 2 } else { 1 };
    if readings.len() <= unknowns {
        return Err(KerfError::TooFew {
            count: readings.len(),
            needed: unknowns + 1,
        });
    }
    let line = least_squares(readings.iter(), both);
    find_outlier(readings, &line, both)?;
    if both && line.scale.abs() > MOST_SCALE_ERROR {
        return Err(KerfError::Scale {
            percent: 100.0 * line.scale,
        });
    }
    if line.kerf_mm <= 0.0 {
        return Err(KerfError::NotPositive {
            kerf_mm: line.kerf_mm,
        });
    }
    let freedom = readings.len() - unknowns;
    let squares: f64 = readings.iter().map(|r| residual(r, &line).powi(2)).sum();
    let least = RESOLUTION_MM / 12f64.sqrt();
    let spread = (squares / freedom as f64).sqrt().max(least);
    let half = student(freedom, confidence) * spread * line.kerf_sd;
    Ok(Kerf {
        kerf_mm: line.kerf_mm,
        spread_mm: spread,
        interval_mm: [(line.kerf_mm - half).max(0.0), line.kerf_mm + half],
        confidence,
        scale_error: both.then_some(line.scale),
    })
}

/// Each reading against the fit to the others, if there are enough of them.
fn find_outlier(readings: &[KerfReading], line: &Line, both: bool) -> Result<(), KerfError> {
    let unknowns = if both { 2 } else { 1 };
    if readings.len() < unknowns + 3 {
        return Ok(());
    }
    let farthest = (0..readings.len()).max_by(|a, b| {
        let of = |i: usize| residual(&readings[i], line).abs();
        of(*a).total_cmp(&of(*b))
    });
    let Some(i) = farthest else { return Ok(()) };
    let others = || readings.iter().enumerate().filter(|(j, _)| *j != i);
    let first = others().next().map(|(_, r)| r.side);
    let free = both && others().any(|(_, r)| Some(r.side) != first);
    let rest = least_squares(others().map(|(_, r)| r), free);
    let freedom = readings.len() - 1 - if free { 2 } else { 1 };
    let squares: f64 = others().map(|(_, r)| residual(r, &rest).powi(2)).sum();
    let spread = (squares / freedom as f64).sqrt();
    let off_mm = residual(&readings[i], &rest);
    let most = student(freedom, OUTLIER_CONFIDENCE) * spread * (1.0 + rest.kerf_sd.powi(2)).sqrt();
    if off_mm.abs() > most.max(OUTLIER_MM) {
        return Err(KerfError::Outlier {
            number: i + 1,
            off_mm,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::Random;

    fn comb(kerf: f64, scale: f64, off: &mut dyn FnMut() -> f64) -> Vec<KerfReading> {
        let mut all = Vec::new();
        for nominal_mm in [5.0, 10.0, 20.0, 30.0] {
            for side in [Side::Piece, Side::Hole] {
                let mut reading = KerfReading {
                    side,
                    nominal_mm,
                    measured_mm: 0.0,
                };
                reading.measured_mm = nominal_mm * (1.0 + scale) + sign(&reading) * kerf + off();
                all.push(reading);
            }
        }
        all
    }

    #[test]
    fn exact_squares_give_the_kerf_and_the_scale_exactly() {
        for (k, g) in [(0.2, 0.0), (0.06, 0.004), (1.2, -0.01)] {
            let found = kerf(&comb(k, g, &mut || 0.0), 0.95).unwrap();
            assert!((found.kerf_mm - k).abs() < 1e-12);
            assert!((found.scale_error.unwrap() - g).abs() < 1e-12);
            let [low, high] = found.interval_mm;
            assert!(low < k && k < high && high - low < 0.01);
        }
        // Pieces alone: the scale counts as right.
        let pieces: Vec<KerfReading> = comb(0.2, 0.0, &mut || 0.0)
            .into_iter()
            .filter(|r| r.side == Side::Piece)
            .collect();
        let found = kerf(&pieces, 0.95).unwrap();
        assert!((found.kerf_mm - 0.2).abs() < 1e-12 && found.scale_error.is_none());
    }

    #[test]
    fn the_interval_covers_as_often_as_it_says() {
        let mut random = Random::new(3);
        let mut covered = 0;
        let runs = 2000;
        for _ in 0..runs {
            let readings = comb(0.25, 0.002, &mut || 0.03 * random.normal());
            // A false outlier counts as a miss.
            if let Ok(found) = kerf(&readings, 0.9) {
                let [low, high] = found.interval_mm;
                covered += i32::from(low <= 0.25 && 0.25 <= high);
            }
        }
        // Four standard errors of the simulation.
        let share = f64::from(covered) / f64::from(runs);
        assert!(
            (share - 0.9).abs() < 4.0 * (0.09f64 / 2000.0).sqrt(),
            "{share}"
        );
    }

    #[test]
    fn student_is_cauchy_for_one_degree_and_closed_for_two() {
        for p in [0.5, 0.9, 0.99] {
            let cauchy = (p * std::f64::consts::FRAC_PI_2).tan();
            assert!((student(1, p) / cauchy - 1.0).abs() < 1e-9);
            // P(|T| < t) = t/√(2 + t²).
            let two = (2.0 * p * p / (1.0 - p * p)).sqrt();
            assert!((student(2, p) / two - 1.0).abs() < 1e-9);
        }
        // For many, the normal law's 95 %.
        let normal = super::super::Law::Normal.weakest(1.0, 0.025);
        assert!((student(100_000, 0.95) - normal).abs() < 3e-3);
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_number() {
        let good = comb(0.2, 0.0, &mut || 0.0);
        assert!(matches!(
            kerf(&good[..2], 0.95),
            Err(KerfError::TooFew {
                count: 2,
                needed: 3
            })
        ));
        let mut bad = good.clone();
        bad[2].measured_mm = 0.98;
        assert!(matches!(
            kerf(&bad, 0.95),
            Err(KerfError::Reading { number: 3, .. })
        ));
        bad[2].measured_mm = f64::NAN;
        assert!(matches!(
            kerf(&bad, 0.95),
            Err(KerfError::Reading { number: 3, .. })
        ));
        let mut bad = good.clone();
        bad[5].measured_mm += 0.3;
        assert!(matches!(
            kerf(&bad, 0.95),
            Err(KerfError::Outlier { number: 6, .. })
        ));
        let swapped: Vec<KerfReading> = good
            .iter()
            .map(|r| KerfReading {
                side: match r.side {
                    Side::Piece => Side::Hole,
                    Side::Hole => Side::Piece,
                },
                ..*r
            })
            .collect();
        assert!(matches!(
            kerf(&swapped, 0.95),
            Err(KerfError::NotPositive { .. })
        ));
        assert!(matches!(
            kerf(&comb(0.2, 0.05, &mut || 0.0), 0.95),
            Err(KerfError::Scale { .. })
        ));
        assert!(matches!(
            kerf(&good, 1.0),
            Err(KerfError::Confidence { .. })
        ));
    }
}
