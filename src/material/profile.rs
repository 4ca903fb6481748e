//! A material's profile and its checks.

use serde::{Deserialize, Serialize};

use super::cut::{CutEntry, EngraveEntry, Process};
use super::reading::Reading;
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
    /// The strips that were pulled, the oldest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sample: Vec<Reading>,
}

/// The form of a slit's end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TipShape {
    /// As the beam leaves it: round, with half the kerf for radius.
    #[default]
    Plain,
    /// A round hole.
    Round,
    /// A drop that opens from the slit into a round end.
    Teardrop,
}

/// Stress relief at the ends of slits: `[tip]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tip {
    /// Its form.
    pub shape: TipShape,
    /// Radius of the end, millimetres; none for a plain one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_mm: Option<f64>,
}

/// Size of the sheets as they are bought: `stock_mm`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StockSize {
    /// Along X, millimetres.
    pub x: f64,
    /// Along Y, millimetres.
    pub y: f64,
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
    /// Radius of the rounded corners of triangles, millimetres; sharp if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corner_radius_mm: Option<f64>,
    /// Size of the sheets as they are bought; as large as the machine's bed if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stock_mm: Option<StockSize>,
    /// Price of a square metre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub price_per_m2: Option<f64>,
    /// In which currency, three letters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub currency: Option<String>,
    /// How far it stretches.
    pub sigma: Sigma,
    /// Stress relief at the ends of slits; none if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip: Option<Tip>,
    /// The ways to cut it.
    pub cut: Vec<CutEntry>,
    /// The ways to mark it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub engrave: Vec<EngraveEntry>,
}

/// The version of the profile format that this build reads.
pub(crate) const FORMAT: u32 = 1;

/// Checks the version key of a document against the one that this build reads.
pub(crate) fn check_format(format: u32, reads: u32) -> Result<(), Complaint> {
    if format == reads {
        return Ok(());
    }
    Err(Complaint::new(
        "format",
        format!("is {format}, and this build of kagome reads format {reads}"),
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
        check_format(self.format, FORMAT)?;
        check_name(&self.name)?;
        ranged("thickness_mm", self.thickness_mm, 0.01, 50.0)?;
        ranged("hinge_width_mm", self.hinge_width_mm, 0.02, 50.0)?;
        if let Some(radius) = self.corner_radius_mm {
            ranged("corner_radius_mm", radius, 0.0, 50.0)?;
        }
        self.check_stock()?;
        self.check_sigma()?;
        self.check_tip()?;
        self.check_cuts()?;
        self.check_engravings()
    }

    fn check_stock(&self) -> Result<(), Complaint> {
        if let Some(stock) = self.stock_mm {
            ranged("stock_mm.x", stock.x, 10.0, 10_000.0)?;
            ranged("stock_mm.y", stock.y, 10.0, 10_000.0)?;
        }
        if let Some(price) = self.price_per_m2 {
            ranged("price_per_m2", price, 0.0, 1e6)?;
        }
        match (self.price_per_m2, &self.currency) {
            (Some(_), None) => Err(Complaint::new(
                "price_per_m2",
                "has no currency beside it: add, for example, currency = \"EUR\"",
            )),
            (None, Some(_)) => Err(Complaint::new(
                "currency",
                "has no meaning without price_per_m2",
            )),
            (_, Some(c)) if c.len() != 3 || !c.bytes().all(|b| b.is_ascii_uppercase()) => {
                Err(Complaint::new(
                    "currency",
                    format!("is {c:?}; three capital letters are needed, for example \"EUR\""),
                ))
            }
            _ => Ok(()),
        }
    }

    fn check_tip(&self) -> Result<(), Complaint> {
        let Some(tip) = self.tip else { return Ok(()) };
        match (tip.shape, tip.radius_mm) {
            (TipShape::Plain, None) => Ok(()),
            (TipShape::Plain, Some(_)) => Err(Complaint::new(
                "tip.radius_mm",
                "has no meaning with shape = \"plain\"; remove it, or choose \"round\" or \"teardrop\"",
            )),
            (_, None) => Err(Complaint::new(
                "tip.radius_mm",
                "is missing; a round or teardrop tip needs it",
            )),
            (_, Some(radius)) => ranged("tip.radius_mm", radius, 0.01, 10.0),
        }
    }

    fn check_engravings(&self) -> Result<(), Complaint> {
        for (i, entry) in self.engrave.iter().enumerate() {
            entry.check(i)?;
            let same = |e: &EngraveEntry| {
                (e.process, e.laser, e.watts) == (entry.process, entry.laser, entry.watts)
            };
            if let Some(j) = self.engrave[..i].iter().position(same) {
                return Err(Complaint::new(
                    format!("engrave[{i}].process"),
                    format!(
                        "stands for {}, the same as engrave[{j}]: which of the two is meant?",
                        entry.tool()
                    ),
                ));
            }
        }
        Ok(())
    }

    fn check_sigma(&self) -> Result<(), Complaint> {
        ranged("sigma.max", self.sigma.max, 1.0, 2.0)?;
        if self.sigma.max <= 1.0 {
            return Err(Complaint::new(
                "sigma.max",
                "is 1: a material that does not open at all makes no surface",
            ));
        }
        check_note("sigma.note", self.sigma.source, &self.sigma.note)?;
        for (i, sample) in self.sigma.sample.iter().enumerate() {
            sample.check(&format!("sigma.sample[{i}]"))?;
        }
        Ok(())
    }

    fn check_cuts(&self) -> Result<(), Complaint> {
        if self.cut.is_empty() {
            return Err(Complaint::new("cut", "is empty; add at least one [[cut]]"));
        }
        for (i, cut) in self.cut.iter().enumerate() {
            cut.check(i)?;
            let same = |c: &CutEntry| {
                (c.process, c.laser, c.watts, c.amps)
                    == (cut.process, cut.laser, cut.watts, cut.amps)
            };
            if let Some(j) = self.cut[..i].iter().position(same) {
                let key = match cut.process {
                    Process::Laser => "watts",
                    Process::Plasma => "amps",
                };
                return Err(Complaint::new(
                    format!("cut[{i}].{key}"),
                    format!(
                        "makes it settings for {}, the same as cut[{j}]: which of the two is meant?",
                        cut.tool()
                    ),
                ));
            }
        }
        Ok(())
    }
}
