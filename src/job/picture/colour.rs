//! Colours, and the maps from values to them.
//!
//! Both maps were laid out in OKLab with lightness in even steps, so that equal differences of the value look equally
//! large, in grey as well. Values outside the range get flags that neither map contains: a maker sees at once where a
//! design fails.

/// An sRGB colour, 8 bits a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rgb(pub [u8; 3]);

impl Rgb {
    /// A colour from its hexadecimal number: `Rgb::hex(0xff8000)`.
    pub const fn hex(number: u32) -> Self {
        Self([(number >> 16) as u8, (number >> 8) as u8, number as u8])
    }

    /// As CSS and SVG write it: `#ff8000`.
    pub fn css(self) -> String {
        let [r, g, b] = self.0;
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// The colour a part `t` (0 to 1) of the way from `a` to `b`.
pub fn mix(a: Rgb, b: Rgb, t: f64) -> Rgb {
    let t = t.clamp(0.0, 1.0);
    let channel =
        |k: usize| (f64::from(a.0[k]) + (f64::from(b.0[k]) - f64::from(a.0[k])) * t).round() as u8;
    Rgb([channel(0), channel(1), channel(2)])
}

/// Indigo to yellow: lightness 0.36 to 0.92, hue 285° to 105°.
const SCALE_FACTOR: [Rgb; 9] = [
    Rgb::hex(0x392d7d),
    Rgb::hex(0x264b96),
    Rgb::hex(0x026a9d),
    Rgb::hex(0x01859f),
    Rgb::hex(0x09a0a0),
    Rgb::hex(0x24bb99),
    Rgb::hex(0x76cf8a),
    Rgb::hex(0xb6de7f),
    Rgb::hex(0xf1ea7e),
];

/// Ivory to brown: lightness 0.96 to 0.40. Nothing to see where the linkage lies on the surface.
const DISTANCE: [Rgb; 6] = [
    Rgb::hex(0xf7f2e3),
    Rgb::hex(0xe2caa2),
    Rgb::hex(0xd29e62),
    Rgb::hex(0xbf7226),
    Rgb::hex(0x9f4b0c),
    Rgb::hex(0x7c2802),
];

/// Below the range: the sheet would have to shrink.
const BELOW: Rgb = Rgb::hex(0xff4fc3);
/// Above the range: the hinges would tear, or the shape is missed.
const ABOVE: Rgb = Rgb::hex(0xe01b24);
/// The same for distances: red would be too near to brown.
const TOO_FAR: Rgb = Rgb::hex(0xc4179b);
/// No number.
const UNKNOWN: Rgb = Rgb::hex(0x9a9a9a);

/// Values this far (relative to the range's ends) outside are rounding: the verdict's own slack on λ.
const SLACK: f64 = 1e-4;

/// Steps of the table that pixels are looked up in; finer than 8 bits can show.
const STEPS: usize = 512;

/// A map from values to colours: even inside [low, high], flagged outside.
#[derive(Clone, Debug)]
pub struct ColourScale {
    low: f64,
    high: f64,
    below: Rgb,
    above: Rgb,
    table: Vec<Rgb>,
}

impl ColourScale {
    /// For the scale factor λ: [1, `sigma`].
    pub fn scale_factor(sigma: f64) -> Self {
        Self::new(1.0, sigma, &SCALE_FACTOR, ABOVE)
    }

    /// For distances from the surface: [0, `limit`], in whatever unit the limit has.
    pub fn distance(limit: f64) -> Self {
        Self::new(0.0, limit, &DISTANCE, TOO_FAR)
    }

    fn new(low: f64, high: f64, points: &[Rgb], above: Rgb) -> Self {
        let table = (0..STEPS)
            .map(|i| {
                let at = i as f64 / (STEPS - 1) as f64 * (points.len() - 1) as f64;
                let k = (at as usize).min(points.len() - 2);
                mix(points[k], points[k + 1], at - k as f64)
            })
            .collect();
        Self {
            low,
            high,
            below: BELOW,
            above,
            table,
        }
    }

    /// The ends of the range.
    pub fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// The flags: below the range, above it.
    pub fn flags(&self) -> (Rgb, Rgb) {
        (self.below, self.above)
    }

    /// The colour of a value; grey for no number.
    #[inline]
    pub fn colour(&self, value: f64) -> Rgb {
        let slack = SLACK * self.low.abs().max(self.high.abs());
        if value > self.high + slack {
            self.above
        } else if value < self.low - slack {
            self.below
        } else if value.is_nan() {
            UNKNOWN
        } else {
            let part = (value - self.low) / (self.high - self.low);
            // A range without width makes `part` NaN or infinite; the conversion saturates.
            let step = (part.clamp(0.0, 1.0) * (STEPS - 1) as f64 + 0.5) as usize;
            self.table[step.min(STEPS - 1)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// OKLab lightness (Ottosson 2020).
    fn lightness(c: Rgb) -> f64 {
        let [r, g, b] = c.0.map(|x| {
            let x = f64::from(x) / 255.0;
            if x <= 0.04045 {
                x / 12.92
            } else {
                ((x + 0.055) / 1.055).powf(2.4)
            }
        });
        let l = 0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b;
        let m = 0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b;
        let s = 0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b;
        0.2104542553 * l.cbrt() + 0.7936177850 * m.cbrt() - 0.0040720468 * s.cbrt()
    }

    #[test]
    fn the_ends_of_a_map_are_its_ends_and_beyond_them_are_flags() {
        let scale = ColourScale::scale_factor(1.8);
        assert_eq!(scale.colour(1.0), SCALE_FACTOR[0]);
        assert_eq!(scale.colour(1.8), SCALE_FACTOR[8]);
        assert_eq!(scale.colour(1.8 + 1e-5), SCALE_FACTOR[8]);
        assert_eq!(scale.colour(1.0 - 1e-5), SCALE_FACTOR[0]);
        assert_eq!(scale.colour(1.81), ABOVE);
        assert_eq!(scale.colour(f64::INFINITY), ABOVE);
        assert_eq!(scale.colour(0.99), BELOW);
        assert_eq!(scale.colour(f64::NAN), UNKNOWN);
        assert_eq!(ColourScale::distance(0.1).colour(0.0), DISTANCE[0]);
        assert_eq!(ColourScale::distance(0.1).colour(0.11), TOO_FAR);
    }

    #[test]
    fn lightness_changes_by_equal_steps_and_flags_are_in_no_map() {
        for (points, above) in [(&SCALE_FACTOR[..], ABOVE), (&DISTANCE[..], TOO_FAR)] {
            let scale = ColourScale::new(0.0, 1.0, points, above);
            let at = |i: usize| lightness(scale.colour(i as f64 / 16.0));
            let mean = (at(16) - at(0)) / 16.0;
            for i in 0..16 {
                assert!(((at(i + 1) - at(i)) / mean - 1.0).abs() < 0.35, "{i}");
            }
            for flag in [BELOW, above] {
                for c in &scale.table {
                    let apart: i32 = (0..3)
                        .map(|k| (i32::from(c.0[k]) - i32::from(flag.0[k])).abs())
                        .sum();
                    assert!(apart > 120, "{c:?} {flag:?}");
                }
            }
        }
    }

    #[test]
    fn a_range_without_width_still_has_colours() {
        let scale = ColourScale::scale_factor(1.0);
        assert!(scale.table.contains(&scale.colour(1.0)));
        assert_eq!(scale.colour(1.1), ABOVE);
    }
}
