//! What the maker wrote down beside a coupon: read, checked against it, and kept as `readings.toml`.
//!
//! [`template()`] is the CSV to fill in. [`Readings::read`] takes that, or TOML, and puts each row to the strip, piece or
//! square of its name: what cannot be is an error at its line, what only looks wrong is a [`Doubt`]. The kerf that the
//! calipers found makes the hinges wider or narrower than they were drawn; the readings have them as they are.

mod doubt;
mod merge;
mod paper;
mod words;

#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

pub use doubt::Doubt;
pub(crate) use merge::{Answer, Item, KERF_DECIMALS, items};
pub(crate) use words::{check_calipers, check_stretch, failure, number, pulled, yes};

use super::coupon::{Coupon, check_setting};
use super::kerf::{Kerf, KerfError, KerfReading, Side, kerf};
use crate::base::document::{Complaint, Document, DocumentError, ranged};
use crate::material::{Reading, check_date, check_format};

/// The version of `readings.toml`.
const FORMAT: u32 = 1;

/// Everything that was read from one coupon: `readings.toml`. It needs no other file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Readings {
    /// Version of the format; 1.
    pub format: u32,
    /// Name of the material's profile.
    pub material: String,
    /// Name of the machine's profile.
    pub machine: String,
    /// The day of the readings, `YYYY-MM-DD`; a strip may have another.
    pub date: String,
    /// Thickness of the sheet, millimetres.
    pub thickness_mm: f64,
    /// The kerf for which the coupon was drawn, millimetres.
    pub drawn_kerf_mm: f64,
    /// From mark to mark of the gauge card, as a stretch.
    pub gauge_step: f64,
    /// The strips that were pulled, with hinges as wide as they are under the measured kerf.
    #[serde(default, rename = "strip", skip_serializing_if = "Vec::is_empty")]
    pub strips: Vec<Reading>,
    /// What the calipers said.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kerf: Vec<MeasuredPiece>,
    /// The squares of the setting grid that were looked at.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub setting: Vec<TriedSetting>,
}

/// A piece or a hole with what the calipers said.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredPiece {
    /// Its name: `K1-HOLE`.
    pub name: String,
    /// A piece, or the hole that it left.
    pub side: Side,
    /// From centre line to centre line as drawn, millimetres.
    pub nominal_mm: f64,
    /// What the calipers say, millimetres.
    pub measured_mm: f64,
}

impl MeasuredPiece {
    /// Without its name.
    pub fn reading(&self) -> KerfReading {
        KerfReading {
            side: self.side,
            nominal_mm: self.nominal_mm,
            measured_mm: self.measured_mm,
        }
    }
}

/// A square of the setting grid, and whether it fell out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriedSetting {
    /// Its name: `P1`.
    pub name: String,
    /// Power, per cent of the machine's.
    pub power_percent: f64,
    /// Speed, mm/min.
    pub speed_mm_per_min: f64,
    /// Whether the square was cut through all around.
    pub cut_through: bool,
}

impl TriedSetting {
    /// Heat for each millimetre of cut, up to a factor.
    fn heat(&self) -> f64 {
        self.power_percent / self.speed_mm_per_min
    }
}

impl Readings {
    /// Reads the maker's file (TOML if its name ends so, else CSV) and puts it to the coupon. `date` is for what names
    /// none.
    ///
    /// # Errors
    /// [`DocumentError`] with file, line and column.
    pub fn read(
        file: &str,
        text: &str,
        coupon: &Coupon,
        date: &str,
    ) -> Result<Self, DocumentError> {
        merge::merge(&paper::Paper::read(file, text)?, coupon, date)
    }

    /// From the text of a `readings.toml`; `file` is what messages call it.
    ///
    /// # Errors
    /// [`DocumentError`] with file, line and key.
    pub fn parse(file: &str, text: &str) -> Result<Self, DocumentError> {
        Document::new(file, text).read(Self::validate)
    }

    /// As `readings.toml`.
    pub fn to_text(&self) -> String {
        // Numbers, words and lists of flat tables, scalars first: there is nothing that TOML could not hold.
        let body = toml::to_string(self).unwrap_or_default();
        format!("# What was read from a coupon; kagome calibrate fit takes it.\n{body}")
    }

    /// All checks, in the order of the file.
    ///
    /// # Errors
    /// The first [`Complaint`], with the key.
    pub fn validate(&self) -> Result<(), Complaint> {
        check_format(self.format, FORMAT)?;
        for (key, name) in [("material", &self.material), ("machine", &self.machine)] {
            if name.trim().is_empty() {
                return Err(Complaint::new(key, "is empty"));
            }
        }
        check_date("date", &self.date)?;
        ranged("thickness_mm", self.thickness_mm, 0.01, 50.0)?;
        ranged("drawn_kerf_mm", self.drawn_kerf_mm, 0.001, 10.0)?;
        ranged("gauge_step", self.gauge_step, 0.001, 0.5)?;
        for (i, strip) in self.strips.iter().enumerate() {
            strip.check(&format!("strip[{i}]"))?;
        }
        for (i, piece) in self.kerf.iter().enumerate() {
            ranged(
                &format!("kerf[{i}].nominal_mm"),
                piece.nominal_mm,
                0.1,
                1000.0,
            )?;
            check_calipers(piece.measured_mm, piece.nominal_mm)
                .map_err(|p| Complaint::new(format!("kerf[{i}].measured_mm"), p))?;
        }
        for (i, square) in self.setting.iter().enumerate() {
            let key = |k: &str| format!("setting[{i}].{k}");
            check_setting(&key, square.power_percent, square.speed_mm_per_min)?;
        }
        Ok(())
    }

    /// The kerf with an interval of this confidence; `None` if nothing was measured.
    ///
    /// # Errors
    /// [`KerfError`].
    pub fn measured_kerf(&self, confidence: f64) -> Option<Result<Kerf, KerfError>> {
        let readings: Vec<KerfReading> = self.kerf.iter().map(MeasuredPiece::reading).collect();
        (!readings.is_empty()).then(|| kerf(&readings, confidence))
    }

    /// The square that was cut through with the least heat for its length, of two the faster one; only if every square
    /// with as much power and as little speed was cut through as well.
    pub fn cleanest(&self) -> Option<&TriedSetting> {
        let sure = |square: &&TriedSetting| {
            square.cut_through
                && !self.setting.iter().any(|other| {
                    !other.cut_through
                        && other.power_percent >= square.power_percent
                        && other.speed_mm_per_min <= square.speed_mm_per_min
                })
        };
        self.setting.iter().filter(sure).min_by(|a, b| {
            a.heat()
                .total_cmp(&b.heat())
                .then(b.speed_mm_per_min.total_cmp(&a.speed_mm_per_min))
        })
    }
}

/// Those of `new` that are not among `have` nor come twice: a strip is the same if its name, its day and all of its values
/// are. The names of the others as well.
pub fn not_counted_yet(have: &[Reading], new: &[Reading]) -> (Vec<Reading>, Vec<String>) {
    let (mut fresh, mut known) = (Vec::<Reading>::new(), Vec::new());
    for reading in new {
        let same = |other: &Reading| reading.strip.is_some() && other == reading;
        if have.iter().any(same) || fresh.iter().any(same) {
            known.push(reading.strip.clone().unwrap_or_default());
        } else {
            fresh.push(reading.clone());
        }
    }
    (fresh, known)
}

/// The CSV to fill in for a coupon.
pub fn template(coupon: &Coupon) -> String {
    let mut text = format!(
        "# held: the last stretch on the gauge at which nothing had failed (1 if it failed at the first mark). tore: the one at\n\
         # which it failed, empty if it never did; failure: torn or plastic (it stayed bent). measured_mm: what calipers say.\n\
         # cut_through: yes or no. What was not measured stays empty. Then: kagome calibrate record\n\
         {}{} on {}\n{}\n",
        paper::COUPON,
        coupon.material,
        coupon.machine,
        paper::COLUMNS[..6].join(",")
    );
    for item in items(coupon) {
        text.push_str(item.name());
        text.push_str(",,,,,\n");
    }
    text
}
