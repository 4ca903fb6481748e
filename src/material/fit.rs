//! Which settings of a material a machine cuts and marks it with, and why not.

use serde::Serialize;

use super::cut::{CutEntry, Laser, PassOrder, Process};
use super::profile::{Material, Source};
use crate::machine::{LaserTool, Machine, PlasmaTool, Tool};

/// Settings with which one machine cuts one material: every value resolved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CutSetting {
    /// How material is removed.
    pub process: Process,
    /// Speed along the cut, millimetres per minute.
    pub speed_mm_per_min: f64,
    /// Power, per cent of the machine's laser; 100 for a torch.
    pub power_percent: f64,
    /// How often each cut is gone over; once for a torch.
    pub passes: u32,
    /// In which order.
    pub pass_order: PassOrder,
    /// Whether air must blow at the cut; a torch brings its own.
    pub air_assist: bool,
    /// Width of what is burnt away, millimetres.
    pub kerf_mm: f64,
    /// Diameter of the hole where a cut begins, millimetres.
    pub pierce_diameter_mm: f64,
    /// Length of the way from the pierce into the cut, millimetres.
    pub lead_in_mm: f64,
    /// Length of the way out of it, millimetres.
    pub lead_out_mm: f64,
    /// How far a closed cut goes on past its beginning, millimetres.
    pub overcut_mm: f64,
    /// What only a torch has.
    pub torch: Option<TorchSetting>,
    /// Where the figures come from.
    pub source: Source,
    /// From whom or how, in words.
    pub note: String,
}

/// What a plasma torch needs to know of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TorchSetting {
    /// Current, amperes.
    pub amps: f64,
    /// How long the torch stands until it is through, seconds.
    pub pierce_delay_s: f64,
    /// Its height meanwhile, millimetres over the sheet.
    pub pierce_height_mm: f64,
    /// Its height while cutting, millimetres over the sheet.
    pub cut_height_mm: f64,
}

/// Settings with which one machine marks one material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MarkSetting {
    /// A laser, or a plasma table's scribe.
    pub process: Process,
    /// Speed, millimetres per minute.
    pub speed_mm_per_min: f64,
    /// Power, per cent of the machine's laser; 100 for a scribe.
    pub power_percent: f64,
}

/// Why a machine does not cut a material.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CutError {
    /// The profile has neither a laser nor a torch: only one made in memory, never one from a file.
    #[error("machine `{machine}` has no tool: neither [laser] nor [plasma]")]
    NoTool {
        /// The machine.
        machine: String,
    },
    /// The material is cut by another process.
    #[error(
        "machine `{machine}` cuts with {process}, and material `{material}` has settings for: {has}. Choose another machine or material, or add a [[cut]] with process = \"{process}\" to a copy of the material's profile"
    )]
    OtherProcess {
        /// The machine.
        machine: String,
        /// How it cuts.
        process: Process,
        /// The material.
        material: String,
        /// What the material has settings for.
        has: String,
    },
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
    /// All settings for a torch need a stronger power source.
    #[error(
        "material `{material}` is cut with {needs_amps} A, and the torch of machine `{machine}` has {amps} A at the most"
    )]
    TooFewAmps {
        /// The machine.
        machine: String,
        /// Its largest current, amperes.
        amps: f64,
        /// The material.
        material: String,
        /// The least current in the profile, amperes.
        needs_amps: f64,
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

/// Whether a machine cuts a material, in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// It does.
    Compatible,
    /// It has no tool.
    NoTool,
    /// A laser for what a torch cuts, or the reverse.
    OtherProcess,
    /// A laser of another kind.
    OtherLaser,
    /// Too little power or current.
    TooWeak,
    /// It moves too slowly.
    TooFast,
    /// It has no air.
    NoAir,
}

impl From<&CutError> for Fit {
    fn from(error: &CutError) -> Self {
        match error {
            CutError::NoTool { .. } => Self::NoTool,
            CutError::OtherProcess { .. } => Self::OtherProcess,
            CutError::NoLaser { .. } => Self::OtherLaser,
            CutError::TooWeak { .. } | CutError::TooFewAmps { .. } => Self::TooWeak,
            CutError::TooFast { .. } => Self::TooFast,
            CutError::NoAir { .. } => Self::NoAir,
        }
    }
}

/// Whether a machine cuts a material; [`Material::cut_for`] says with what, or why not in words.
pub fn classify(machine: &Machine, material: &Material) -> Fit {
    match material.cut_for(machine) {
        Ok(_) => Fit::Compatible,
        Err(error) => Fit::from(&error),
    }
}

impl Material {
    /// The settings with which a machine cuts this material.
    ///
    /// For a laser: among the settings for its kind, those for the strongest one that is no stronger than the
    /// machine's; on a stronger machine the percentage is lowered so that the same watts arrive. For a torch: among
    /// the settings that its power source can give, those with the narrowest kerf.
    ///
    /// # Errors
    /// [`CutError`] says what is missing and what to change.
    pub fn cut_for(&self, machine: &Machine) -> Result<CutSetting, CutError> {
        let (tool, best) = self.chosen(machine)?;
        Ok(CutSetting {
            process: tool.process(),
            speed_mm_per_min: best.speed_mm_per_min,
            power_percent: match tool {
                Tool::Laser(laser) => best.strength() / laser.watts * 100.0,
                Tool::Plasma(_) => 100.0,
            },
            passes: best.passes.unwrap_or(1),
            pass_order: best.pass_order.unwrap_or_default(),
            air_assist: best.air_assist.unwrap_or(false),
            kerf_mm: best.kerf_mm,
            pierce_diameter_mm: best.pierce_diameter_mm.unwrap_or(best.kerf_mm),
            lead_in_mm: best.lead_in_mm.unwrap_or(0.0),
            lead_out_mm: best.lead_out_mm.unwrap_or(0.0),
            overcut_mm: best.overcut_mm.unwrap_or(0.0),
            torch: torch_setting(best),
            source: best.source,
            note: best.note.clone(),
        })
    }

    /// The number, from 0, of the `[[cut]]` that [`Material::cut_for`] takes for a machine.
    ///
    /// # Errors
    /// As [`Material::cut_for`].
    pub fn cut_entry_for(&self, machine: &Machine) -> Result<usize, CutError> {
        let (_, best) = self.chosen(machine)?;
        // It is one of them.
        let place = self.cut.iter().position(|c| std::ptr::eq(c, best));
        Ok(place.unwrap_or(0))
    }

    /// The machine's tool, and the entry for it that the machine can follow.
    fn chosen<'a>(&'a self, machine: &'a Machine) -> Result<(Tool<'a>, &'a CutEntry), CutError> {
        let Some(tool) = machine.tool() else {
            return Err(CutError::NoTool {
                machine: machine.name.clone(),
            });
        };
        let process = tool.process();
        let entries: Vec<&CutEntry> = self.cut.iter().filter(|c| c.process == process).collect();
        if entries.is_empty() {
            return Err(CutError::OtherProcess {
                machine: machine.name.clone(),
                process,
                material: self.name.clone(),
                has: listed(self.cut.iter()),
            });
        }
        let best = match tool {
            Tool::Laser(laser) => self.for_laser(machine, laser, &entries)?,
            Tool::Plasma(torch) => self.for_torch(machine, torch, &entries)?,
        };
        let limit = slower_axis(machine);
        if best.speed_mm_per_min > limit {
            return Err(CutError::TooFast {
                machine: machine.name.clone(),
                limit_mm_per_min: limit,
                material: self.name.clone(),
                speed_mm_per_min: best.speed_mm_per_min,
            });
        }
        if let Tool::Laser(laser) = tool
            && best.air_assist.unwrap_or(false)
            && laser.air_on.is_none()
        {
            return Err(CutError::NoAir {
                machine: machine.name.clone(),
                material: self.name.clone(),
            });
        }
        Ok((tool, best))
    }

    fn for_laser<'a>(
        &self,
        machine: &Machine,
        laser: &LaserTool,
        entries: &[&'a CutEntry],
    ) -> Result<&'a CutEntry, CutError> {
        let of_kind = || {
            entries
                .iter()
                .copied()
                .filter(|c| c.laser == Some(laser.kind))
        };
        let by_strength = |a: &&CutEntry, b: &&CutEntry| a.strength().total_cmp(&b.strength());
        let Some(least) = of_kind().min_by(by_strength) else {
            return Err(CutError::NoLaser {
                machine: machine.name.clone(),
                laser: laser.kind,
                key: laser.kind.key(),
                material: self.name.clone(),
                has: listed(entries.iter().copied()),
            });
        };
        // What a setting really needs is its watts times its percentage.
        of_kind()
            .filter(|c| c.strength() <= laser.watts)
            .max_by(by_strength)
            .ok_or_else(|| CutError::TooWeak {
                machine: machine.name.clone(),
                watts: laser.watts,
                laser: laser.kind,
                material: self.name.clone(),
                needs_watts: least.watts.unwrap_or(0.0),
                needs_percent: least.power_percent.unwrap_or(0.0),
            })
    }

    fn for_torch<'a>(
        &self,
        machine: &Machine,
        torch: &PlasmaTool,
        entries: &[&'a CutEntry],
    ) -> Result<&'a CutEntry, CutError> {
        entries
            .iter()
            .copied()
            .filter(|c| c.strength() <= torch.max_amps)
            .min_by(|a, b| a.kerf_mm.total_cmp(&b.kerf_mm))
            .ok_or_else(|| CutError::TooFewAmps {
                machine: machine.name.clone(),
                amps: torch.max_amps,
                material: self.name.clone(),
                needs_amps: entries
                    .iter()
                    .map(|c| c.strength())
                    .fold(f64::INFINITY, f64::min),
            })
    }

    /// The settings with which a machine marks this material: the strongest of its kind of laser that it can give, or
    /// the scribe of a plasma table. `None` where the profiles know of no way: then nothing is marked.
    pub fn mark_for(&self, machine: &Machine) -> Option<MarkSetting> {
        let tool = machine.tool()?;
        let limit = slower_axis(machine);
        let entries = || {
            self.engrave
                .iter()
                .filter(|e| e.process == tool.process() && e.speed_mm_per_min <= limit)
        };
        match tool {
            Tool::Laser(laser) => {
                let best = entries()
                    .filter(|e| e.laser == Some(laser.kind) && e.strength() <= laser.watts)
                    .max_by(|a, b| a.strength().total_cmp(&b.strength()))?;
                Some(MarkSetting {
                    process: Process::Laser,
                    speed_mm_per_min: best.speed_mm_per_min,
                    power_percent: best.strength() / laser.watts * 100.0,
                })
            }
            Tool::Plasma(torch) => {
                let best = entries().next().filter(|_| torch.scribe)?;
                Some(MarkSetting {
                    process: Process::Plasma,
                    speed_mm_per_min: best.speed_mm_per_min,
                    power_percent: 100.0,
                })
            }
        }
    }
}

fn slower_axis(machine: &Machine) -> f64 {
    let rate = machine.motion.rate_mm_per_min;
    rate.x.min(rate.y)
}

fn torch_setting(entry: &CutEntry) -> Option<TorchSetting> {
    Some(TorchSetting {
        amps: entry.amps?,
        pierce_delay_s: entry.pierce_delay_s?,
        pierce_height_mm: entry.pierce_height_mm?,
        cut_height_mm: entry.cut_height_mm?,
    })
}

fn listed<'a>(entries: impl Iterator<Item = &'a CutEntry>) -> String {
    entries.map(CutEntry::tool).collect::<Vec<_>>().join(", ")
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

    fn laser(machine: &mut Machine) -> &mut LaserTool {
        machine.laser.as_mut().unwrap()
    }

    #[test]
    fn a_stronger_laser_gives_the_same_watts() {
        let (material, mut machine) = pair();
        let here = material.cut_for(&machine).unwrap();
        let mark = material.mark_for(&machine).unwrap();
        laser(&mut machine).watts *= 2.0;
        let strong = material.cut_for(&machine).unwrap();
        assert!((strong.power_percent * 2.0 - here.power_percent).abs() < 1e-9);
        let strong = material.mark_for(&machine).unwrap();
        assert!((strong.power_percent * 2.0 - mark.power_percent).abs() < 1e-9);
    }

    #[test]
    fn each_refusal_says_what_is_missing() {
        let (material, machine) = pair();
        let refused = |change: &dyn Fn(&mut Machine)| {
            let mut m = machine.clone();
            change(&mut m);
            (
                classify(&m, &material),
                material.cut_for(&m).unwrap_err().to_string(),
            )
        };
        let (fit, text) = refused(&|m| laser(m).kind = Laser::Fibre);
        assert_eq!(fit, Fit::OtherLaser);
        assert!(
            text.contains("fibre laser") && text.contains("CO2 40 W"),
            "{text}"
        );
        assert_eq!(refused(&|m| laser(m).watts = 1.0).0, Fit::TooWeak);
        assert_eq!(
            refused(&|m| m.motion.rate_mm_per_min.y = 10.0).0,
            Fit::TooFast
        );
        assert_eq!(refused(&|m| laser(m).air_on = None).0, Fit::NoAir);
        assert_eq!(refused(&|m| m.laser = None).0, Fit::NoTool);
        let torch = crate::machine::load("plasma-qtplasmac").unwrap();
        let (fit, text) = refused(&|m| *m = torch.clone());
        assert_eq!(fit, Fit::OtherProcess);
        for word in ["plasma-qtplasmac", "leather-1.6", "with plasma", "CO2 40 W"] {
            assert!(text.contains(word), "{text}");
        }
        let steel = crate::material::load("steel-1.5").unwrap();
        let mut weak = torch.clone();
        weak.plasma.as_mut().unwrap().max_amps = 10.0;
        assert_eq!(classify(&weak, &steel), Fit::TooWeak);
    }

    #[test]
    fn a_torch_takes_the_narrowest_kerf_that_its_source_can_give() {
        let torch = crate::machine::load("plasma-qtplasmac").unwrap();
        let mut steel = crate::material::load("steel-1.5").unwrap();
        let mut second = steel.cut[0].clone();
        second.amps = steel.cut[0].amps.map(|a| a + 1.0);
        second.kerf_mm *= 0.9;
        second.lead_in_mm = None;
        steel.cut.push(second.clone());
        steel.validate().unwrap();
        let setting = steel.cut_for(&torch).unwrap();
        assert_eq!(setting.kerf_mm, second.kerf_mm);
        assert_eq!(
            (setting.power_percent, setting.passes, setting.lead_in_mm),
            (100.0, 1, 0.0)
        );
        assert_eq!(Some(setting.pierce_diameter_mm), second.pierce_diameter_mm);
        assert!(setting.torch.unwrap().pierce_height_mm > setting.torch.unwrap().cut_height_mm);
    }

    /// One letter a machine, in the order of their names: `+` compatible, `P` other process, `L` other laser.
    #[test]
    fn every_pair_of_shipped_profiles_is_classified() {
        let machines: Vec<Machine> = crate::machine::shipped()
            .map(|(name, _)| crate::machine::load(name).unwrap())
            .collect();
        let names: Vec<&str> = machines.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "co2-600x400",
                "co2-900x600-grblhal",
                "diode-400",
                "diode-400-fluidnc",
                "fibre-300",
                "plasma-generic",
                "plasma-grbl",
                "plasma-linuxcnc",
                "plasma-qtplasmac",
            ]
        );
        let rows: Vec<(String, String)> = crate::material::shipped()
            .map(|(name, _)| {
                let material = crate::material::load(name).unwrap();
                let row = machines
                    .iter()
                    .map(|m| match classify(m, &material) {
                        Fit::Compatible => '+',
                        Fit::OtherProcess => 'P',
                        Fit::OtherLaser => 'L',
                        other => panic!("{} on {}: {other:?}", material.name, m.name),
                    })
                    .collect();
                (name.to_owned(), row)
            })
            .collect();
        let expected = [
            ("acrylic-3", "++LLLPPPP"),
            ("brass-0.2", "LLLL+PPPP"),
            ("brass-1.5", "PPPPP++++"),
            ("cardboard-1.5", "++++LPPPP"),
            ("copper-0.2", "LLLL+PPPP"),
            ("copper-1.5", "PPPPP++++"),
            ("felt-3", "++++LPPPP"),
            ("leather-1.6", "++++LPPPP"),
            ("plywood-3", "++++LPPPP"),
            ("steel-0.2", "LLLL+PPPP"),
            ("steel-1.5", "PPPPP++++"),
        ]
        .map(|(a, b)| (a.to_owned(), b.to_owned()));
        assert_eq!(rows, expected);
    }
}
