//! From the numbers of a file to millimetres.

use super::error::Problem;

/// What one unit in a file is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// Millimetre.
    #[default]
    Millimetre,
    /// Centimetre.
    Centimetre,
    /// Metre.
    Metre,
    /// Inch.
    Inch,
}

impl Unit {
    /// Its length in millimetres.
    pub fn in_mm(self) -> f64 {
        match self {
            Self::Millimetre => 1.0,
            Self::Centimetre => 10.0,
            Self::Metre => 1000.0,
            Self::Inch => 25.4,
        }
    }
}

impl std::str::FromStr for Unit {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "mm" => Ok(Self::Millimetre),
            "cm" => Ok(Self::Centimetre),
            "m" => Ok(Self::Metre),
            "in" => Ok(Self::Inch),
            _ => Err("there are mm, cm, m and in".into()),
        }
    }
}

/// How large the surface shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// What one unit in the file is.
    pub unit: Unit,
    /// A factor on top.
    pub scale: f64,
    /// The longest side of the box wanted, in millimetres, instead of both.
    pub size_mm: Option<f64>,
}

impl Default for Units {
    fn default() -> Self {
        Self {
            unit: Unit::Millimetre,
            scale: 1.0,
            size_mm: None,
        }
    }
}

impl Units {
    /// The smallest longest side in millimetres that is taken to be meant.
    pub const LEAST_MM: f64 = 1.0;
    /// The largest.
    pub const MOST_MM: f64 = 20_000.0;

    /// Millimetres for each unit of a file whose box has this longest side, in its own units.
    ///
    /// # Errors
    /// [`Problem::BadScale`], or [`Problem::OddSize`] if the result is outside [`Units::LEAST_MM`] to
    /// [`Units::MOST_MM`].
    pub fn factor(&self, longest: f64) -> Result<f64, Problem> {
        let positive = |what, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(value)
            } else {
                Err(Problem::BadScale { what, value })
            }
        };
        let factor = match self.size_mm {
            Some(size_mm) => positive("--size", size_mm)? / longest,
            None => self.unit.in_mm() * positive("--scale", self.scale)?,
        };
        let longest_mm = longest * factor;
        if (Self::LEAST_MM..=Self::MOST_MM).contains(&longest_mm) && factor.is_finite() {
            Ok(factor)
        } else {
            Err(Problem::OddSize { longest_mm })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_scale_and_size() {
        let metre = Units {
            unit: "m".parse().unwrap(),
            scale: 2.0,
            size_mm: None,
        };
        assert_eq!(metre.factor(0.3).unwrap(), 2000.0);
        let size = Units {
            size_mm: Some(150.0),
            ..metre
        };
        assert_eq!(size.factor(0.3).unwrap(), 500.0);
        let small = Units::default().factor(0.3).unwrap_err().to_string();
        assert!(
            small.contains("0.3 mm") && small.contains("--unit") && small.contains("less than")
        );
        let large = metre.factor(11.0).unwrap_err().to_string();
        assert!(large.contains("more than 20 m"), "{large}");
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let bad = Units {
                scale,
                ..Units::default()
            };
            assert!(matches!(bad.factor(100.0), Err(Problem::BadScale { .. })));
        }
        assert!(Units::default().factor(0.0).is_err());
        assert!("yard".parse::<Unit>().is_err());
    }
}
