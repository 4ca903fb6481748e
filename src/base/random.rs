//! Numbers that look random and are the same on every machine, from a seed.

/// SplitMix64 (Steele, Lea, Flood 2014): small, seeded, good enough to shake a protocol and to draw a simulated material.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A sequence of its own for each seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Normal with mean 0 and standard deviation 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moments_of_a_hundred_thousand_are_those_of_their_laws() {
        let mut random = Random::new(7);
        let count = 100_000;
        let (mut unit, mut first, mut second, mut fourth) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..count {
            let u = random.unit();
            assert!((0.0..1.0).contains(&u));
            let z = random.normal();
            unit += u;
            first += z;
            second += z * z;
            fourth += z.powi(4);
        }
        let mean = |sum: f64| sum / f64::from(count);
        // Five standard errors of each.
        assert!((mean(unit) - 0.5).abs() < 5.0 * 0.289 / 316.0);
        assert!(mean(first).abs() < 5.0 / 316.0);
        assert!((mean(second) - 1.0).abs() < 5.0 * 1.42 / 316.0);
        assert!((mean(fourth) - 3.0).abs() < 5.0 * 9.8 / 316.0);
    }
}
