//! How the hinges of one sheet differ: laws of scatter with mean 0 and standard deviation 1, and the weakest of many.

use std::sync::OnceLock;

/// The law of a hinge's ln ε at failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Law {
    /// Normal: many small causes (log-normal limits).
    Normal,
    /// Smallest of many flaws (Weibull limits).
    Weibull,
}

/// Both laws, in the order in which results keep them.
pub const LAWS: [Law; 2] = [Law::Normal, Law::Weibull];

/// Euler's constant.
const EULER: f64 = 0.577_215_664_901_532_9;
/// Standard deviation of the logarithm of a standard exponential variable, π/√6.
const SEV_SD: f64 = 1.282_549_830_161_864;

/// ln(1 − Φ(z)), to nearly full precision.
fn ln_normal_survival(z: f64) -> f64 {
    let density = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
    if z.abs() <= 3.0 {
        // Φ(z) = 1/2 + φ(z) (z + z³/3 + z⁵/15 + …).
        let (mut term, mut sum, mut odd) = (z, z, 1.0);
        while term.abs() > 1e-18 * sum.abs() && odd < 200.0 {
            odd += 2.0;
            term *= z * z / odd;
            sum += term;
        }
        return (0.5 - density * sum).ln();
    }
    // Laplace's continued fraction for Mills' ratio.
    let x = z.abs();
    let fraction = (1..=60).rev().fold(x, |f, n| x + f64::from(n) / f);
    if z > 0.0 {
        -0.5 * z * z - (std::f64::consts::TAU.sqrt() * fraction).ln()
    } else {
        (-density / fraction).ln_1p()
    }
}

/// ln S is tabulated for z in ±`RANGE`, so many steps to one.
const RANGE: f64 = 9.0;
const STEPS: f64 = 256.0;

/// ln S(z) of one law, by a table: linear between its lines, exact to 2·10⁻⁴ of itself.
#[derive(Debug)]
pub(super) struct Table {
    values: Vec<f64>,
}

impl Table {
    fn new(law: Law) -> Self {
        let count = (2.0 * RANGE * STEPS) as i32;
        Self {
            values: (0..=count)
                .map(|i| law.ln_survival(f64::from(i) / STEPS - RANGE))
                .collect(),
        }
    }

    /// ln S(z). Below the table nothing fails, above it all fails.
    #[inline]
    pub(super) fn at(&self, z: f64) -> f64 {
        let x = (z + RANGE) * STEPS;
        // Also for −∞; a NaN does not get here.
        if x <= 0.0 {
            return 0.0;
        }
        // The end of the range saturates, also for +∞.
        let i = x as usize;
        match self.values.get(i..).and_then(|v| v.first_chunk()) {
            Some([low, high]) => low + (x - i as f64) * (high - low),
            None => f64::NEG_INFINITY,
        }
    }
}

impl Law {
    /// ln of the share of hinges whose limit is more than z standard deviations over the mean.
    pub fn ln_survival(self, z: f64) -> f64 {
        match self {
            Self::Normal => ln_normal_survival(z),
            Self::Weibull => -(z * SEV_SD - EULER).exp(),
        }
    }

    pub(super) fn table(self) -> &'static Table {
        static TABLES: OnceLock<[Table; 2]> = OnceLock::new();
        let tables = TABLES.get_or_init(|| LAWS.map(Table::new));
        match self {
            Self::Normal => &tables[0],
            Self::Weibull => &tables[1],
        }
    }

    /// The z that the weakest of `count` hinges exceeds with probability `survival`.
    pub fn weakest(self, count: f64, survival: f64) -> f64 {
        let wanted = survival.ln() / count;
        match self {
            Self::Weibull => ((-wanted).ln() + EULER) / SEV_SD,
            Self::Normal => {
                let (mut low, mut high) = (-38.0, 38.0);
                for _ in 0..80 {
                    let middle = 0.5 * (low + high);
                    if ln_normal_survival(middle) > wanted {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                0.5 * (low + high)
            }
        }
    }

    /// Median and standard deviation (half the distance of the 16 % and 84 % points) of the weakest of `count`.
    pub(super) fn weakest_spread(self, count: f64) -> (f64, f64) {
        let at = |p: f64| self.weakest(count, p);
        (at(0.5), 0.5 * (at(0.1587) - at(0.8413)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::Random;

    #[test]
    fn the_normal_tail_agrees_with_its_integral_and_its_symmetry() {
        // Simpson's rule from z to 12.
        for z in [-6.0, -3.01, -2.99, -1.0, 0.0, 0.5, 2.99, 3.01, 5.0] {
            let n = 4000;
            let step = (12.0 - z) / f64::from(n);
            let f = |x: f64| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
            let sum: f64 = (0..=n)
                .map(|k| {
                    let weight = if k == 0 || k == n {
                        1.0
                    } else if k % 2 == 1 {
                        4.0
                    } else {
                        2.0
                    };
                    weight * f(z + f64::from(k) * step)
                })
                .sum();
            let integral = sum * step / 3.0;
            assert!(
                (ln_normal_survival(z).exp() / integral - 1.0).abs() < 1e-9,
                "{z}"
            );
            let both = ln_normal_survival(z).exp() + ln_normal_survival(-z).exp();
            assert!((both - 1.0).abs() < 1e-14, "{z}");
        }
    }

    #[test]
    fn both_laws_have_mean_0_and_deviation_1_and_their_tables_agree() {
        for law in LAWS {
            let (mut mean, mut square) = (0.0, 0.0);
            let n = 60_000;
            for i in 0..n {
                let p = (f64::from(i) + 0.5) / f64::from(n);
                let z = law.weakest(1.0, p);
                assert!((law.ln_survival(z).exp() - p).abs() < 1e-9);
                mean += z / f64::from(n);
                square += z * z / f64::from(n);
            }
            assert!(mean.abs() < 1e-3, "{mean}");
            assert!((square - 1.0).abs() < 3e-3, "{square}");
            let mut random = Random::new(1);
            for _ in 0..1000 {
                let z = random.between(-8.9, 4.0);
                let (exact, table) = (law.ln_survival(z), law.table().at(z));
                assert!((table / exact - 1.0).abs() < 2e-4, "{law:?} {z}");
            }
        }
    }

    #[test]
    fn the_weakest_of_many_scales_exactly() {
        for law in LAWS {
            for count in [1.0, 7.0, 400.0] {
                for survival in [0.01, 0.5, 0.95] {
                    let z = law.weakest(count, survival);
                    let all = (count * law.ln_survival(z)).exp();
                    assert!((all / survival - 1.0).abs() < 1e-9);
                }
            }
        }
        // A Weibull sheet of n times as many hinges is weaker by ln n in its own unit: closed form.
        let shift = Law::Weibull.weakest(30.0, 0.5) - Law::Weibull.weakest(3000.0, 0.5);
        assert!((shift - 100f64.ln() / SEV_SD).abs() < 1e-12);
    }
}
