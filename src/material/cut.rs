//! Settings that cut and mark a material, as its profile holds them.

use serde::{Deserialize, Serialize};

use super::profile::{Source, check_note};
use crate::base::document::{Complaint, ranged};

/// How material is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Process {
    /// A laser beam.
    Laser,
    /// A plasma arc.
    Plasma,
}

impl std::fmt::Display for Process {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Laser => "laser",
            Self::Plasma => "plasma",
        })
    }
}

/// The kind of laser: its wavelength decides what it cuts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Laser {
    /// Carbon dioxide, 10.6 µm: leather, wood, acrylic, paper; not bare metal.
    Co2,
    /// Blue diode, about 450 nm: leather, thin wood, card; not clear acrylic, not metal.
    Diode,
    /// Fibre, about 1.06 µm: metal.
    Fibre,
}

impl Laser {
    /// As profiles spell it.
    pub fn key(self) -> &'static str {
        match self {
            Self::Co2 => "co2",
            Self::Diode => "diode",
            Self::Fibre => "fibre",
        }
    }
}

impl std::fmt::Display for Laser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Co2 => "CO2",
            Self::Diode => "diode",
            Self::Fibre => "fibre",
        })
    }
}

/// In which order the passes of a job with several are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PassOrder {
    /// All passes of a cut, then the next cut: less travel.
    #[default]
    Cut,
    /// One pass of the whole sheet, then the next: cooler.
    Sheet,
}

/// One way to cut a material: one `[[cut]]` of its profile. Keys of the other process are refused by
/// [`super::Material::validate`]; what a key left out means, [`super::CutSetting`] says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CutEntry {
    /// How material is removed.
    pub process: Process,
    /// Laser: its kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub laser: Option<Laser>,
    /// Laser: optical power of the laser that these settings are for, watts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub watts: Option<f64>,
    /// Laser: power, per cent of `watts`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_percent: Option<f64>,
    /// Laser: how often each cut is gone over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub passes: Option<u32>,
    /// Laser: in which order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pass_order: Option<PassOrder>,
    /// Laser: whether air must blow at the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub air_assist: Option<bool>,
    /// Plasma: current, amperes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amps: Option<f64>,
    /// Plasma: how long the torch stands until it is through, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pierce_delay_s: Option<f64>,
    /// Plasma: its height meanwhile, millimetres over the sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pierce_height_mm: Option<f64>,
    /// Plasma: its height while cutting, millimetres over the sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut_height_mm: Option<f64>,
    /// Speed along the cut, millimetres per minute.
    pub speed_mm_per_min: f64,
    /// Width of what is burnt away, millimetres.
    pub kerf_mm: f64,
    /// Diameter of the hole where a cut begins, millimetres. Laser: the kerf if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pierce_diameter_mm: Option<f64>,
    /// Length of the way from the pierce into the cut, millimetres; 0 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lead_in_mm: Option<f64>,
    /// Length of the way out of it, millimetres; 0 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lead_out_mm: Option<f64>,
    /// How far a closed cut goes on past its beginning, millimetres; 0 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overcut_mm: Option<f64>,
    /// Where the figures come from.
    pub source: Source,
    /// From whom or how, in words.
    pub note: String,
}

/// One way to mark a material: one `[[engrave]]` of its profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EngraveEntry {
    /// With a laser, or with the scribe of a plasma table.
    pub process: Process,
    /// Laser: its kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub laser: Option<Laser>,
    /// Laser: optical power of the laser that these settings are for, watts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub watts: Option<f64>,
    /// Laser: power, per cent of `watts`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_percent: Option<f64>,
    /// Speed, millimetres per minute.
    pub speed_mm_per_min: f64,
    /// Where the figures come from.
    pub source: Source,
    /// From whom or how, in words.
    pub note: String,
}

/// A key with whether it is there, and whether the process must have it, may have it, or must not.
type Rule = (&'static str, bool, Need);

#[derive(Clone, Copy, PartialEq)]
enum Need {
    Must,
    May,
    Never,
}

fn check_keys(at: &str, process: Process, rules: &[Rule]) -> Result<(), Complaint> {
    for &(key, present, need) in rules {
        let full = format!("{at}.{key}");
        if present && need == Need::Never {
            return Err(Complaint::new(
                full,
                format!("has no meaning with process = \"{process}\"; remove it"),
            ));
        }
        if !present && need == Need::Must {
            return Err(Complaint::new(
                full,
                format!("is missing; process = \"{process}\" needs it"),
            ));
        }
    }
    Ok(())
}

fn ranged_if(key: &str, value: Option<f64>, low: f64, high: f64) -> Result<(), Complaint> {
    value.map_or(Ok(()), |v| ranged(key, v, low, high))
}

impl CutEntry {
    /// What it is for, in words: `CO2 40 W`, `plasma 20 A`.
    pub fn tool(&self) -> String {
        tool(self.laser, self.watts, self.amps)
    }

    /// What decides between settings of one kind: watts that arrive, or amperes.
    pub(super) fn strength(&self) -> f64 {
        match self.process {
            Process::Laser => {
                self.watts.unwrap_or(0.0) * self.power_percent.unwrap_or(100.0) / 100.0
            }
            Process::Plasma => self.amps.unwrap_or(0.0),
        }
    }

    pub(super) fn check(&self, i: usize) -> Result<(), Complaint> {
        let at = format!("cut[{i}]");
        let key = |k: &str| format!("{at}.{k}");
        let (laser, plasma) = match self.process {
            Process::Laser => (Need::Must, Need::Never),
            Process::Plasma => (Need::Never, Need::Must),
        };
        let laser_may = if laser == Need::Must {
            Need::May
        } else {
            Need::Never
        };
        let pierce = if plasma == Need::Must {
            Need::Must
        } else {
            Need::May
        };
        check_keys(
            &at,
            self.process,
            &[
                ("laser", self.laser.is_some(), laser),
                ("watts", self.watts.is_some(), laser),
                ("power_percent", self.power_percent.is_some(), laser),
                ("passes", self.passes.is_some(), laser),
                ("pass_order", self.pass_order.is_some(), laser_may),
                ("air_assist", self.air_assist.is_some(), laser),
                ("amps", self.amps.is_some(), plasma),
                ("pierce_delay_s", self.pierce_delay_s.is_some(), plasma),
                ("pierce_height_mm", self.pierce_height_mm.is_some(), plasma),
                ("cut_height_mm", self.cut_height_mm.is_some(), plasma),
                (
                    "pierce_diameter_mm",
                    self.pierce_diameter_mm.is_some(),
                    pierce,
                ),
            ],
        )?;
        ranged_if(&key("watts"), self.watts, 0.1, 50_000.0)?;
        ranged_if(&key("power_percent"), self.power_percent, 0.1, 100.0)?;
        ranged_if(&key("passes"), self.passes.map(f64::from), 1.0, 50.0)?;
        ranged_if(&key("amps"), self.amps, 5.0, 1000.0)?;
        ranged_if(&key("pierce_delay_s"), self.pierce_delay_s, 0.0, 60.0)?;
        ranged_if(&key("pierce_height_mm"), self.pierce_height_mm, 0.1, 50.0)?;
        ranged_if(&key("cut_height_mm"), self.cut_height_mm, 0.1, 50.0)?;
        ranged(
            &key("speed_mm_per_min"),
            self.speed_mm_per_min,
            1.0,
            200_000.0,
        )?;
        ranged(&key("kerf_mm"), self.kerf_mm, 0.005, 5.0)?;
        // A pierce burns at least what the cut burns.
        ranged_if(
            &key("pierce_diameter_mm"),
            self.pierce_diameter_mm,
            self.kerf_mm,
            20.0,
        )?;
        ranged_if(&key("lead_in_mm"), self.lead_in_mm, 0.0, 50.0)?;
        ranged_if(&key("lead_out_mm"), self.lead_out_mm, 0.0, 50.0)?;
        ranged_if(&key("overcut_mm"), self.overcut_mm, 0.0, 50.0)?;
        check_note(&key("note"), self.source, &self.note)
    }
}

impl EngraveEntry {
    /// What it is for, in words.
    pub fn tool(&self) -> String {
        match self.process {
            Process::Laser => tool(self.laser, self.watts, None),
            Process::Plasma => "scribe".into(),
        }
    }

    pub(super) fn strength(&self) -> f64 {
        self.watts.unwrap_or(0.0) * self.power_percent.unwrap_or(100.0) / 100.0
    }

    pub(super) fn check(&self, i: usize) -> Result<(), Complaint> {
        let at = format!("engrave[{i}]");
        let key = |k: &str| format!("{at}.{k}");
        let laser = match self.process {
            Process::Laser => Need::Must,
            Process::Plasma => Need::Never,
        };
        check_keys(
            &at,
            self.process,
            &[
                ("laser", self.laser.is_some(), laser),
                ("watts", self.watts.is_some(), laser),
                ("power_percent", self.power_percent.is_some(), laser),
            ],
        )?;
        ranged_if(&key("watts"), self.watts, 0.1, 50_000.0)?;
        ranged_if(&key("power_percent"), self.power_percent, 0.1, 100.0)?;
        ranged(
            &key("speed_mm_per_min"),
            self.speed_mm_per_min,
            1.0,
            200_000.0,
        )?;
        check_note(&key("note"), self.source, &self.note)
    }
}

fn tool(laser: Option<Laser>, watts: Option<f64>, amps: Option<f64>) -> String {
    use crate::base::units::short;
    match (laser, watts, amps) {
        (Some(laser), Some(watts), _) => format!("{laser} {} W", short(watts, 3)),
        (_, _, Some(amps)) => format!("plasma {} A", short(amps, 3)),
        _ => "nothing".into(),
    }
}
