//! A material's profile and its checks.

use serde::{Deserialize, Serialize};

use super::cut::CutSetting;
use crate::base::document::{Complaint, ranged};

/// What family a material belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Leather.
    Leather,
    /// Solid wood, plywood, MDF.
    Wood,
    /// Sheet metal.
    Metal,
    /// Acrylic and other plastics.
    Plastic,
    /// Paper, card, cardboard.
    Paper,
    /// Felt and woven cloth.
    Textile,
}

/// Where a figure comes from, so that nobody mistakes a guess for a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Measured on a coupon of this material with this machine.
    Measured,
    /// From a publication or a maker's table; the note says which.
    Literature,
    /// A cautious guess; the note says from what.
    Estimate,
}

/// How far the material stretches when its hinges open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sigma {
    /// Largest stretch λ of the linkage, 1 (closed) to 2 (open).
    pub max: f64,
    /// How it was found.
    pub source: Source,
    /// From whom or how, in words.
    pub note: String,
}

/// A material: the whole of `profiles/NAME.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Version of the format; 1.
    pub format: u32,
    /// Its name, as `--material` takes it.
    pub name: String,
    /// What it is, for people.
    pub title: String,
    /// Its family.
    pub kind: Kind,
    /// Thickness of the sheet, millimetres.
    pub thickness_mm: f64,
    /// Width h of the narrowest ligament at a hinge, millimetres.
    pub hinge_width_mm: f64,
    /// How far it stretches.
    pub sigma: Sigma,
    /// The ways to cut it.
    pub cut: Vec<CutSetting>,
}

/// The version of the profile format that this build reads.
pub(crate) const FORMAT: u32 = 1;

/// Checks the version key of a profile.
pub(crate) fn check_format(format: u32) -> Result<(), Complaint> {
    if format == FORMAT {
        return Ok(());
    }
    Err(Complaint::new(
        "format",
        format!("is {format}, and this build of kagome reads format {FORMAT}"),
    ))
}

/// Names go into file names, options and G-code comments.
pub(crate) fn check_name(name: &str) -> Result<(), Complaint> {
    let fine = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-._".contains(c);
    if !name.is_empty()
        && name.len() <= 40
        && name.chars().all(fine)
        && name.starts_with(|c: char| c.is_ascii_alphanumeric())
    {
        return Ok(());
    }
    Err(Complaint::new(
        "name",
        format!(
            "is {name:?}; a name has at most 40 characters out of a-z, 0-9, `-`, `.`, `_`, and starts with a letter or digit"
        ),
    ))
}

/// A figure that was not measured must say where it is from.
pub(super) fn check_note(key: &str, source: Source, note: &str) -> Result<(), Complaint> {
    if note.trim().is_empty() {
        return Err(Complaint::new(
            key,
            format!("is empty; say where the figures come from (source is {source:?})"),
        ));
    }
    Ok(())
}

impl Material {
    /// All checks, in the order of the file.
    ///
    /// # Errors
    /// The first [`Complaint`], with the key.
    pub fn validate(&self) -> Result<(), Complaint> {
        check_format(self.format)?;
        check_name(&self.name)?;
        ranged("thickness_mm", self.thickness_mm, 0.01, 50.0)?;
        ranged("hinge_width_mm", self.hinge_width_mm, 0.02, 50.0)?;
        self.check_sigma()?;
        self.check_cuts()
    }

    fn check_sigma(&self) -> Result<(), Complaint> {
        ranged("sigma.max", self.sigma.max, 1.0, 2.0)?;
        if self.sigma.max <= 1.0 {
            return Err(Complaint::new(
                "sigma.max",
                "is 1: a material that does not open at all makes no surface",
            ));
        }
        check_note("sigma.note", self.sigma.source, &self.sigma.note)
    }

    fn check_cuts(&self) -> Result<(), Complaint> {
        if self.cut.is_empty() {
            return Err(Complaint::new("cut", "is empty; add at least one [[cut]]"));
        }
        for (i, cut) in self.cut.iter().enumerate() {
            cut.check(i)?;
            let twin = self.cut[..i]
                .iter()
                .position(|c| c.laser == cut.laser && c.watts == cut.watts);
            if let Some(j) = twin {
                return Err(Complaint::new(
                    format!("cut[{i}].watts"),
                    format!(
                        "is {} for a {} laser, the same as cut[{j}]: which of the two is meant?",
                        cut.watts, cut.laser
                    ),
                ));
            }
        }
        Ok(())
    }
}
