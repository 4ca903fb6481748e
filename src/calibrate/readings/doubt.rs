//! What in readings looks wrong, and may be right all the same.

use super::Readings;
use crate::base::units::short;
use crate::calibrate::fit::{FitOptions, fit};
use crate::calibrate::geometry::Geometry;

/// Something that looks wrong.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Doubt {
    /// About which item; none if about several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// What, and what could be done.
    pub text: String,
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.name {
            Some(name) => write!(f, "{name}: {}", self.text),
            None => f.write_str(&self.text),
        }
    }
}

/// An interval of more gauge steps than this was not read at every mark.
const MOST_STEPS: f64 = 3.0;

/// What one strip of a hundred does, given the others, is looked at again.
const RARE: f64 = 0.01;

/// So many strips say what another one should do.
const LEAST_OTHERS: usize = 3;

/// A stretch so near to fully open is fully open on a gauge.
const OPEN: f64 = 0.03;

impl Readings {
    /// What looks wrong, in the order of the file.
    pub fn doubts(&self) -> Vec<Doubt> {
        let mut all = Vec::new();
        self.doubt_kerf(&mut all);
        for i in 0..self.strips.len() {
            self.doubt_strip(i, &mut all);
        }
        self.doubt_settings(&mut all);
        all
    }

    fn doubt_strip(&self, i: usize, all: &mut Vec<Doubt>) {
        let strip = &self.strips[i];
        let mut say = |text: String| {
            all.push(Doubt {
                name: strip.strip.clone(),
                text,
            });
        };
        let geometry = Geometry::of(strip);
        let most = geometry.most_opening();
        let open = format!("its hinges are fully open at {}", short(most, 3));
        match strip.tore {
            Some(tore) => {
                let wide = tore - strip.held;
                if wide > MOST_STEPS * self.gauge_step + 1e-9 {
                    say(format!(
                        "held at {} and failed at {}, {} steps of the gauge apart: what lies between is not known; were the marks in between not looked at?",
                        strip.held,
                        tore,
                        short(wide / self.gauge_step, 1)
                    ));
                }
                if strip.held >= most {
                    say(format!(
                        "is said to have held at {}, and {open}: check the reading",
                        strip.held
                    ));
                }
            }
            None if strip.held >= most - OPEN => say(format!(
                "never failed, and {open}: it only says that the limit is higher; wider hinges or a shorter edge strain the material more"
            )),
            None => say(format!(
                "did not fail at {}, and {open}: pull it on until it fails",
                strip.held
            )),
        }
        if let Some(text) = self.against_the_others(i) {
            say(text);
        }
    }

    /// Whether a strip failed at a stretch that the others do not lead to expect.
    fn against_the_others(&self, i: usize) -> Option<String> {
        if self.strips.len() <= LEAST_OTHERS {
            return None;
        }
        let mut others = self.strips.clone();
        let own = others.remove(i);
        let fitted = fit(&others, &FitOptions::default()).ok()?;
        let expected = |survival| {
            fitted
                .expected(&Geometry::of(&own), own.hinges as usize, survival)
                .ok()
        };
        let (low, high) = (expected(1.0 - RARE)?, expected(RARE)?);
        let when = match own.tore {
            Some(tore) if tore < low => "earlier",
            _ if own.held > high => "later",
            _ => return None,
        };
        let (low, high) = (short(low, 2), short(high, 2));
        let where_ = if low == high {
            format!("at {low}")
        } else {
            format!("between {low} and {high}")
        };
        Some(format!(
            "failed {when} than the other strips lead to expect ({where_}): are reading and name right? If they are, it stays in"
        ))
    }

    fn doubt_kerf(&self, all: &mut Vec<Doubt>) {
        let mut say = |text: String| all.push(Doubt { name: None, text });
        let drawn = self.drawn_kerf_mm;
        match self.measured_kerf(0.9) {
            Some(Err(error)) => say(format!(
                "the kerf stays at {drawn} mm, as it was drawn: {error}"
            )),
            Some(Ok(found)) => {
                let off = found.kerf_mm - drawn;
                if off.abs() > (0.3 * drawn).max(0.05) {
                    say(format!(
                        "the kerf is {} mm and the coupon was drawn for {drawn} mm: its hinges are {} mm {} than drawn; cut the next coupon with the measured kerf",
                        short(found.kerf_mm, 3),
                        short(off.abs(), 3),
                        if off > 0.0 { "narrower" } else { "wider" }
                    ));
                }
            }
            None => {}
        }
    }

    fn doubt_settings(&self, all: &mut Vec<Doubt>) {
        for square in self.setting.iter().filter(|s| !s.cut_through) {
            let weaker = self.setting.iter().find(|other| {
                other.cut_through
                    && other.power_percent <= square.power_percent
                    && other.speed_mm_per_min >= square.speed_mm_per_min
            });
            if let Some(weaker) = weaker {
                all.push(Doubt {
                    name: Some(square.name.clone()),
                    text: format!(
                        "was not cut through at {} % and {} mm/min, and {} was at {} % and {} mm/min: is the sheet flat and in focus everywhere?",
                        square.power_percent,
                        square.speed_mm_per_min,
                        weaker.name,
                        weaker.power_percent,
                        weaker.speed_mm_per_min
                    ),
                });
            }
        }
        if !self.setting.is_empty() && self.setting.iter().all(|s| !s.cut_through) {
            all.push(Doubt {
                name: None,
                text: "no square was cut through: more power, less speed or another pass is needed"
                    .into(),
            });
        }
    }
}
