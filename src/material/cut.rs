//! Settings that cut a material, and the choice of the right ones for a machine.

use serde::{Deserialize, Serialize};

use super::profile::{Material, Source};
use crate::base::document::{Complaint, ranged};
use crate::base::units::short;
use crate::machine::Machine;

/// How material is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Process {
    /// A laser beam.
    Laser,
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

impl std::fmt::Display for Laser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Co2 => "CO2",
            Self::Diode => "diode",
            Self::Fibre => "fibre",
        })
    }
}

/// One way to cut a material: one `[[cut]]` of its profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CutSetting {
    /// How material is removed.
    pub process: Process,
    /// With which kind of laser.
    pub laser: Laser,
    /// Optical power of the laser that these settings are for, watts.
    pub watts: f64,
    /// Speed along the cut, millimetres per minute.
    pub speed_mm_per_min: f64,
    /// Power, per cent of `watts`.
    pub power_percent: f64,
    /// How often each cut is gone over.
    pub passes: u32,
    /// Whether air must blow at the cut.
    pub air_assist: bool,
    /// Width of what is burnt away, millimetres.
    pub kerf_mm: f64,
    /// Where the figures come from.
    pub source: Source,
    /// From whom or how, in words.
    pub note: String,
}

impl CutSetting {
    pub(super) fn check(&self, at: usize) -> Result<(), Complaint> {
        let key = |k: &str| format!("cut[{at}].{k}");
        ranged(&key("watts"), self.watts, 0.1, 50_000.0)?;
        ranged(
            &key("speed_mm_per_min"),
            self.speed_mm_per_min,
            1.0,
            200_000.0,
        )?;
        ranged(&key("power_percent"), self.power_percent, 0.1, 100.0)?;
        ranged(&key("passes"), f64::from(self.passes), 1.0, 50.0)?;
        ranged(&key("kerf_mm"), self.kerf_mm, 0.005, 5.0)?;
        super::profile::check_note(&key("note"), self.source, &self.note)
    }
}

/// Why a machine does not cut a material.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CutError {
    /// The profile has no settings for this kind of laser.
    #[error(
        "machine `{machine}` has a {laser} laser, and material `{material}` has settings for: {has}. Choose another machine or material, or add a [[cut]] with laser = \"{key}\" to a copy of the material's profile"
    )]
    NoLaser {
        /// The machine.
        machine: String,
        /// Its laser.
        laser: Laser,
        /// Its laser as profiles spell it.
        key: &'static str,
        /// The material.
        material: String,
        /// The lasers that the material has settings for, with their watts.
        has: String,
    },
    /// All settings for this kind of laser need more power.
    #[error(
        "material `{material}` needs a {laser} laser of {needs_watts} W (at {needs_percent} %), and machine `{machine}` has {watts} W"
    )]
    TooWeak {
        /// The machine.
        machine: String,
        /// Its power, watts.
        watts: f64,
        /// Its laser.
        laser: Laser,
        /// The material.
        material: String,
        /// Power of the weakest laser in the profile, watts.
        needs_watts: f64,
        /// Per cent of it that is used.
        needs_percent: f64,
    },
    /// The cut is faster than the machine moves.
    #[error(
        "material `{material}` is cut at {speed_mm_per_min} mm/min, and machine `{machine}` moves at {limit_mm_per_min} mm/min at the most: lower the speed and the power in a copy of the material's profile"
    )]
    TooFast {
        /// The machine.
        machine: String,
        /// The slower axis's largest rate.
        limit_mm_per_min: f64,
        /// The material.
        material: String,
        /// The speed of the cut.
        speed_mm_per_min: f64,
    },
    /// The cut wants air and the machine has none.
    #[error(
        "material `{material}` is cut with air assist, and machine `{machine}` has none (`laser.air_on`, for example \"M8\")"
    )]
    NoAir {
        /// The machine.
        machine: String,
        /// The material.
        material: String,
    },
}

impl Material {
    /// The settings with which a machine cuts this material.
    ///
    /// Among the settings for its kind of laser, those for the strongest one that is no stronger than the machine's;
    /// on a stronger machine the percentage is lowered so that the same watts arrive.
    ///
    /// # Errors
    /// [`CutError`] says what is missing and what to change.
    pub fn cut_for(&self, machine: &Machine) -> Result<CutSetting, CutError> {
        let laser = &machine.laser;
        let of_kind = || self.cut.iter().filter(|c| c.laser == laser.kind);
        if of_kind().next().is_none() {
            return Err(CutError::NoLaser {
                machine: machine.name.clone(),
                laser: laser.kind,
                key: match laser.kind {
                    Laser::Co2 => "co2",
                    Laser::Diode => "diode",
                    Laser::Fibre => "fibre",
                },
                material: self.name.clone(),
                has: self
                    .cut
                    .iter()
                    .map(|c| format!("{} {} W", c.laser, short(c.watts, 3)))
                    .collect::<Vec<_>>()
                    .join(", "),
            });
        }
        // What a setting really needs is its watts times its percentage.
        let needed = |c: &CutSetting| c.watts * c.power_percent / 100.0;
        let best = of_kind()
            .filter(|c| needed(c) <= laser.watts)
            .max_by(|a, b| needed(a).total_cmp(&needed(b)));
        let Some(best) = best else {
            let least = of_kind().min_by(|a, b| needed(a).total_cmp(&needed(b)));
            return Err(CutError::TooWeak {
                machine: machine.name.clone(),
                watts: laser.watts,
                laser: laser.kind,
                material: self.name.clone(),
                needs_watts: least.map_or(0.0, |c| c.watts),
                needs_percent: least.map_or(0.0, |c| c.power_percent),
            });
        };
        let limit = machine
            .motion
            .rate_mm_per_min
            .x
            .min(machine.motion.rate_mm_per_min.y);
        if best.speed_mm_per_min > limit {
            return Err(CutError::TooFast {
                machine: machine.name.clone(),
                limit_mm_per_min: limit,
                material: self.name.clone(),
                speed_mm_per_min: best.speed_mm_per_min,
            });
        }
        if best.air_assist && laser.air_on.is_none() {
            return Err(CutError::NoAir {
                machine: machine.name.clone(),
                material: self.name.clone(),
            });
        }
        Ok(CutSetting {
            power_percent: needed(best) / laser.watts * 100.0,
            watts: laser.watts,
            ..best.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair() -> (Material, Machine) {
        (
            crate::material::load("leather-1.6").unwrap(),
            crate::machine::load("co2-600x400").unwrap(),
        )
    }

    #[test]
    fn a_stronger_laser_gives_the_same_watts() {
        let (material, mut machine) = pair();
        let watts = |c: &CutSetting| c.watts * c.power_percent / 100.0;
        let here = material.cut_for(&machine).unwrap();
        machine.laser.watts *= 2.0;
        let strong = material.cut_for(&machine).unwrap();
        assert!((watts(&here) - watts(&strong)).abs() < 1e-9);
        assert!((strong.power_percent * 2.0 - here.power_percent).abs() < 1e-9);
    }

    #[test]
    fn each_refusal_says_what_is_missing() {
        let (material, machine) = pair();
        let mut m = machine.clone();
        m.laser.kind = Laser::Fibre;
        let text = material.cut_for(&m).unwrap_err().to_string();
        assert!(
            text.contains("fibre laser") && text.contains("CO2 40 W"),
            "{text}"
        );
        let mut m = machine.clone();
        m.laser.watts = 1.0;
        assert!(matches!(
            material.cut_for(&m),
            Err(CutError::TooWeak { .. })
        ));
        let mut m = machine.clone();
        m.motion.rate_mm_per_min.y = 10.0;
        assert!(matches!(
            material.cut_for(&m),
            Err(CutError::TooFast { .. })
        ));
        let mut m = machine;
        m.laser.air_on = None;
        assert!(matches!(material.cut_for(&m), Err(CutError::NoAir { .. })));
    }
}
