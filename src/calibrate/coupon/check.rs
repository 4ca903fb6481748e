//! `coupon.toml` read back, with its checks.

use super::{Coupon, FORMAT};
use crate::base::document::{Complaint, Document, DocumentError, ranged};
use crate::material::{MOST_HINGES, check_format};

impl Coupon {
    /// From the text of a `coupon.toml`; `file` is what messages call it.
    ///
    /// # Errors
    /// [`DocumentError`] with file, line and key.
    pub fn parse(file: &str, text: &str) -> Result<Self, DocumentError> {
        Document::new(file, text).read(Self::validate)
    }

    /// All checks, in the order of the file.
    ///
    /// # Errors
    /// The first [`Complaint`], with the key.
    pub fn validate(&self) -> Result<(), Complaint> {
        check_format(self.format, FORMAT)?;
        for (key, name) in [("material", &self.material), ("machine", &self.machine)] {
            check_word(key, name)?;
        }
        ranged("thickness_mm", self.thickness_mm, 0.01, 50.0)?;
        ranged("kerf_mm", self.kerf_mm, 0.001, 10.0)?;
        if let Some(radius) = self.tip_radius_mm {
            ranged("tip_radius_mm", radius, 0.001, 10.0)?;
        }
        ranged("gauge_step", self.gauge_step, 0.001, 0.5)?;
        let mut names = Vec::new();
        for (i, strip) in self.strip.iter().enumerate() {
            let key = |k: &str| format!("strip[{i}].{k}");
            check_name(&key("name"), &strip.name, &mut names)?;
            ranged(&key("hinge_width_mm"), strip.hinge_width_mm, 0.02, 50.0)?;
            ranged(&key("edge_mm"), strip.edge_mm, 0.5, 1000.0)?;
            ranged(
                &key("hinges"),
                f64::from(strip.hinges),
                1.0,
                f64::from(MOST_HINGES),
            )?;
            ranged(&key("gauge_mm"), strip.gauge_mm, 0.5, 10_000.0)?;
        }
        for (i, piece) in self.kerf.iter().enumerate() {
            let key = |k: &str| format!("kerf[{i}].{k}");
            check_name(&key("name"), &piece.name, &mut names)?;
            ranged(&key("nominal_mm"), piece.nominal_mm, 0.1, 1000.0)?;
        }
        for (i, square) in self.setting.iter().enumerate() {
            let key = |k: &str| format!("setting[{i}].{k}");
            check_name(&key("name"), &square.name, &mut names)?;
            check_setting(&key, square.power_percent, square.speed_mm_per_min)?;
        }
        Ok(())
    }
}

/// One line of text, of which a CSV can hold one cell.
fn check_word(key: &str, name: &str) -> Result<(), Complaint> {
    let fine = !name.trim().is_empty()
        && name.chars().count() <= 200
        && !name.chars().any(|c| c.is_control() || ",;\"#".contains(c));
    if fine {
        return Ok(());
    }
    Err(Complaint::new(
        key,
        format!("is {name:?}; a name on one line, without , ; # and quotation marks, is needed"),
    ))
}

fn check_name<'a>(key: &str, name: &'a str, names: &mut Vec<&'a str>) -> Result<(), Complaint> {
    check_word(key, name)?;
    if name.chars().count() > 40 {
        return Err(Complaint::new(key, "has more than 40 characters"));
    }
    if names.iter().any(|other| other.eq_ignore_ascii_case(name)) {
        return Err(Complaint::new(
            key,
            format!("is {name:?}, which is the name of something else on this coupon"),
        ));
    }
    names.push(name);
    Ok(())
}

/// Power and speed of a square of the grid; `key` makes a key of a name.
pub(crate) fn check_setting(
    key: &dyn Fn(&str) -> String,
    power_percent: f64,
    speed_mm_per_min: f64,
) -> Result<(), Complaint> {
    ranged(&key("power_percent"), power_percent, 0.01, 100.0)?;
    ranged(&key("speed_mm_per_min"), speed_mm_per_min, 0.1, 200_000.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "format = 1\nmaterial = \"felt-3\"\nmachine = \"co2-600x400\"\nthickness_mm = 3\nkerf_mm = 0.2\ngauge_step = 0.05\n\
        [[strip]]\nname = \"A1\"\nhinge_width_mm = 1\nedge_mm = 12\nhinges = 36\ngauge_mm = 48\n\
        [[kerf]]\nname = \"K1\"\nside = \"hole\"\nnominal_mm = 19.8\n\
        [[setting]]\nname = \"P1\"\npower_percent = 30\nspeed_mm_per_min = 900\n";

    #[test]
    fn each_check_has_a_text_that_fails_it() {
        let coupon = Coupon::parse("c.toml", GOOD).unwrap();
        let again = toml::to_string(&coupon).unwrap();
        assert_eq!(Coupon::parse("c.toml", &again).unwrap(), coupon);
        for (from, to, key) in [
            ("format = 1", "format = 9", "format"),
            ("felt-3", " ", "material"),
            ("co2-600x400", "a, b", "machine"),
            ("thickness_mm = 3", "thickness_mm = nan", "thickness_mm"),
            ("kerf_mm = 0.2", "kerf_mm = 0", "kerf_mm"),
            (
                "kerf_mm = 0.2",
                "kerf_mm = 0.2\ntip_radius_mm = -1",
                "tip_radius_mm",
            ),
            ("gauge_step = 0.05", "gauge_step = 5", "gauge_step"),
            (
                "hinge_width_mm = 1",
                "hinge_width_mm = -1",
                "strip[0].hinge_width_mm",
            ),
            ("edge_mm = 12", "edge_mm = 0", "strip[0].edge_mm"),
            ("hinges = 36", "hinges = 0", "strip[0].hinges"),
            ("gauge_mm = 48", "gauge_mm = inf", "strip[0].gauge_mm"),
            ("\"K1\"", "\"a1\"", "kerf[0].name"),
            ("nominal_mm = 19.8", "nominal_mm = 0", "kerf[0].nominal_mm"),
            (
                "power_percent = 30",
                "power_percent = 130",
                "setting[0].power_percent",
            ),
            (
                "speed_mm_per_min = 900",
                "speed_mm_per_min = 0",
                "setting[0].speed_mm_per_min",
            ),
            ("\"P1\"", "\"\"", "setting[0].name"),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let error = Coupon::parse("c.toml", &GOOD.replacen(from, to, 1)).unwrap_err();
            assert_eq!(error.key.as_deref(), Some(key), "{error}");
            assert!(error.line.is_some());
        }
    }
}
