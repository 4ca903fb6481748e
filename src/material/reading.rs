//! One strip of a coupon that was pulled: `[[sigma.sample]]`.

use serde::{Deserialize, Serialize};

use crate::base::document::{Complaint, ranged};

/// How a strip failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Failure {
    /// A hinge tore or broke.
    Torn,
    /// A hinge stayed bent, and nothing tore.
    Plastic,
}

/// What a strip of hinges bore when it was pulled from one mark of the gauge to the next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reading {
    /// The strip's name, as it is engraved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strip: Option<String>,
    /// The day it was pulled, `YYYY-MM-DD`.
    pub date: String,
    /// Width h of its ligaments, millimetres.
    pub hinge_width_mm: f64,
    /// Width of what the beam burnt away, millimetres.
    pub kerf_mm: f64,
    /// Finished radius of the slits' ends, millimetres; half the kerf if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_radius_mm: Option<f64>,
    /// Thickness of the sheet, millimetres.
    pub thickness_mm: f64,
    /// Length L of the triangles' edges, millimetres.
    pub edge_mm: f64,
    /// How many hinges were opened.
    pub hinges: u32,
    /// The last stretch λ at which nothing had failed; 1 if it failed at the first mark.
    pub held: f64,
    /// The stretch λ at which it failed; left out if it never did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tore: Option<f64>,
    /// How it failed; given exactly if `tore` is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<Failure>,
}

/// The neck c = (2/√3)(h + k/2 + r): how far before its hinge a slit's tip has its centre, for a hinge of width h, a kerf
/// k and a tip of finished radius r, so that h remains beside the tip.
pub fn neck_mm(hinge_width_mm: f64, kerf_mm: f64, tip_radius_mm: f64) -> f64 {
    (hinge_width_mm + 0.5 * kerf_mm + tip_radius_mm) / 0.75f64.sqrt()
}

/// More hinges than this are no strip to be pulled by hand.
pub(crate) const MOST_HINGES: u32 = 100_000;

impl Reading {
    /// What messages call it: its name, or its number in the list from 1.
    pub fn label(&self, index: usize) -> String {
        match &self.strip {
            Some(name) => format!("strip {name}"),
            None => format!("strip no. {}", index + 1),
        }
    }

    /// All checks; `key` is where the reading stands, for example `sigma.sample[2]`.
    ///
    /// # Errors
    /// The first [`Complaint`], with the key.
    pub fn check(&self, key: &str) -> Result<(), Complaint> {
        let at = |name: &str| format!("{key}.{name}");
        if let Some(name) = &self.strip
            && (name.trim().is_empty() || name.len() > 40 || name.chars().any(char::is_control))
        {
            return Err(Complaint::new(
                at("strip"),
                format!("is {name:?}; a name has 1 to 40 characters on one line"),
            ));
        }
        check_date(&at("date"), &self.date)?;
        ranged(&at("hinge_width_mm"), self.hinge_width_mm, 0.02, 50.0)?;
        ranged(&at("kerf_mm"), self.kerf_mm, 0.001, 10.0)?;
        if let Some(radius) = self.tip_radius_mm {
            ranged(&at("tip_radius_mm"), radius, 0.001, 10.0)?;
        }
        ranged(&at("thickness_mm"), self.thickness_mm, 0.01, 50.0)?;
        ranged(&at("edge_mm"), self.edge_mm, 0.5, 1000.0)?;
        let ends = 2.0
            * neck_mm(
                self.hinge_width_mm,
                self.kerf_mm,
                self.tip_radius_mm.unwrap_or(0.5 * self.kerf_mm),
            );
        if ends >= self.edge_mm {
            return Err(Complaint::new(
                at("edge_mm"),
                format!(
                    "is {}, and its hinges alone take {ends:.2} mm of that: are the units mixed up?",
                    self.edge_mm
                ),
            ));
        }
        if self.hinges == 0 || self.hinges > MOST_HINGES {
            return Err(Complaint::new(
                at("hinges"),
                format!(
                    "is {}; count the hinges that opened, 1 to {MOST_HINGES}",
                    self.hinges
                ),
            ));
        }
        self.check_stretches(&at)
    }

    fn check_stretches(&self, at: &dyn Fn(&str) -> String) -> Result<(), Complaint> {
        let stretch = |name: &str, value: f64| {
            ranged(&at(name), value, 1.0, 2.0).map_err(|c| {
                Complaint::new(
                    c.key,
                    format!(
                        "{}: a stretch is the opened length over the closed one, 1 to 2",
                        c.problem
                    ),
                )
            })
        };
        stretch("held", self.held)?;
        match (self.tore, self.failure) {
            (Some(tore), Some(_)) => {
                stretch("tore", tore)?;
                if tore <= self.held {
                    return Err(Complaint::new(
                        at("tore"),
                        format!(
                            "is {tore}, and the strip is said to have held at {}: were the two mixed up?",
                            self.held
                        ),
                    ));
                }
                Ok(())
            }
            (Some(_), None) => Err(Complaint::new(
                at("failure"),
                "is missing: \"torn\" or \"plastic\"",
            )),
            (None, Some(_)) => Err(Complaint::new(
                at("failure"),
                "has no meaning without `tore`, the stretch at which it failed",
            )),
            (None, None) if self.held <= 1.0 => Err(Complaint::new(
                at("held"),
                "is 1 and nothing failed: a strip that was not pulled is no reading; remove it",
            )),
            (None, None) => Ok(()),
        }
    }
}

/// A day of the calendar, as ISO 8601 writes it.
pub(crate) fn check_date(key: &str, date: &str) -> Result<(), Complaint> {
    let wrong = || {
        Complaint::new(
            key,
            format!("is {date:?}; a day is written YYYY-MM-DD, for example \"2026-05-31\""),
        )
    };
    let bytes = date.as_bytes();
    let form = bytes.len() == 10
        && bytes.iter().enumerate().all(|(i, b)| match i {
            4 | 7 => *b == b'-',
            _ => b.is_ascii_digit(),
        });
    if !form {
        return Err(wrong());
    }
    let number = |range: std::ops::Range<usize>| date[range].parse::<u32>().unwrap_or(0);
    let (year, month, day) = (number(0..4), number(5..7), number(8..10));
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let days = match month {
        2 if leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1 | 3 | 5 | 7 | 8 | 10 | 12 => 31,
        _ => 0,
    };
    if year >= 1900 && (1..=days).contains(&day) {
        return Ok(());
    }
    Err(wrong())
}

#[cfg(test)]
mod tests {
    const GOOD: &str = "[[sigma.sample]]\nstrip = \"A3\"\ndate = \"2024-02-29\"\nhinge_width_mm = 1.0\nkerf_mm = 0.2\nthickness_mm = 1.6\nedge_mm = 15\nhinges = 24\nheld = 1.3\ntore = 1.35\nfailure = \"torn\"\n";

    fn profile(sample: &str) -> String {
        let (_, text) = crate::material::shipped()
            .find(|(n, _)| *n == "leather-1.6")
            .unwrap();
        text.replacen("[[cut]]", &format!("{sample}\n[[cut]]"), 1)
    }

    #[test]
    fn a_profile_keeps_its_samples_and_writes_them_as_it_read_them() {
        let material = crate::material::parse("x.toml", &profile(GOOD)).unwrap();
        let sample = &material.sigma.sample[0];
        assert_eq!(sample.label(0), "strip A3");
        assert_eq!((sample.held, sample.tore), (1.3, Some(1.35)));
        let again = toml::to_string(&material).unwrap();
        assert_eq!(crate::material::parse("y.toml", &again).unwrap(), material);
        // A profile without any is written without any.
        let plain = crate::material::load("leather-1.6").unwrap();
        assert!(!toml::to_string(&plain).unwrap().contains("sample"));
    }

    #[test]
    fn each_check_has_a_sample_that_fails_it() {
        for (from, to, key) in [
            ("strip = \"A3\"", "strip = \" \"", "strip"),
            ("2024-02-29", "2023-02-29", "date"),
            ("2024-02-29", "29.2.2024", "date"),
            ("2024-02-29", "2024-13-01", "date"),
            (
                "hinge_width_mm = 1.0",
                "hinge_width_mm = 0",
                "hinge_width_mm",
            ),
            ("kerf_mm = 0.2", "kerf_mm = nan", "kerf_mm"),
            (
                "kerf_mm = 0.2",
                "kerf_mm = 0.2\ntip_radius_mm = -1",
                "tip_radius_mm",
            ),
            ("thickness_mm = 1.6", "thickness_mm = 160", "thickness_mm"),
            ("edge_mm = 15", "edge_mm = 1.5", "edge_mm"),
            ("hinges = 24", "hinges = 0", "hinges"),
            ("held = 1.3", "held = 0.9", "held"),
            ("held = 1.3", "held = 130", "held"),
            ("tore = 1.35", "tore = 1.3", "tore"),
            ("tore = 1.35", "tore = 2.1", "tore"),
            ("tore = 1.35\n", "", "failure"),
            ("failure = \"torn\"\n", "", "failure"),
            (
                "held = 1.3\ntore = 1.35\nfailure = \"torn\"",
                "held = 1",
                "held",
            ),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let text = profile(&GOOD.replacen(from, to, 1));
            let error = crate::material::parse("x.toml", &text).unwrap_err();
            assert!(error.line.is_some(), "{error}");
            let expected = format!("sigma.sample[0].{key}");
            assert_eq!(error.key.as_deref(), Some(expected.as_str()), "{error}");
        }
    }

    #[test]
    fn a_strip_that_never_tore_or_tore_at_once_is_a_reading() {
        for (from, to) in [
            ("tore = 1.35\nfailure = \"torn\"\n", ""),
            ("held = 1.3\n", "held = 1\n"),
            ("failure = \"torn\"", "failure = \"plastic\""),
        ] {
            let text = profile(&GOOD.replacen(from, to, 1));
            crate::material::parse("x.toml", &text).unwrap();
        }
    }
}
