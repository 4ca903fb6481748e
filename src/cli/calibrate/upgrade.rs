//! Which profile of a person's own takes what was measured, and what is put in.

use std::path::{Path, PathBuf};

use super::outcome::{Machined, SIGMA_DECIMALS, Strips, sheet_words};
use crate::base::atomic::write_file;
use crate::base::units::{floored, rounded, short};
use crate::calibrate::KERF_DECIMALS;
use crate::cli::Failure;
use crate::cli::profiles::{machine_named, material_named};
use crate::machine;
use crate::material::{self, Material, Measured, MeasuredCut, Reading, amend};

/// A profile before it takes anything.
pub(super) struct Base {
    /// Name of the profile to write.
    pub name: String,
    /// Its file; none if there is no folder for profiles of one's own.
    pub file: Option<PathBuf>,
    /// Its text now, or that of the one that it is made from.
    text: String,
    /// The profile itself.
    pub material: Material,
    /// Name and title, if it is a new one.
    renamed: Option<[String; 2]>,
}

/// Finds the profile in the folder `own`: one's own of this name, else one called NAME-measured, made from it.
///
/// # Errors
/// [`Failure::Bad`]: nobody knows the material, or the new name cannot be one.
pub(super) fn base(asked: &str, new: Option<&str>, own: Option<&Path>) -> Result<Base, Failure> {
    let found = material_named(asked).map_err(|e| {
        Failure::Bad(format!(
            "{e}\nName the material that the coupon was cut from with --material"
        ))
    })?;
    let source = material::load(&found).map_err(Failure::bad)?;
    let file_of = |name: &str| own.and_then(|own| material::own_file(own, name));
    let is_own = file_of(&source.name).is_some_and(|file| same_file(&file, Path::new(&found)));
    let name = match new {
        Some(new) => new.to_owned(),
        None if is_own => source.name.clone(),
        None => format!("{}-measured", source.name),
    };
    let file = file_of(&name);
    if own.is_some() && file.is_none() {
        return Err(Failure::Bad(format!(
            "--name {name} would be taken for a file"
        )));
    }
    // What was measured before stays.
    if let Some(own) = file.as_ref().filter(|f| f.is_file()) {
        let text = super::record::text_of(own)?;
        let material = material::parse(&own.display().to_string(), &text).map_err(Failure::bad)?;
        return Ok(Base {
            name,
            file,
            text,
            material,
            renamed: None,
        });
    }
    let shipped = material::shipped().find(|(n, _)| *n == found);
    let text = match shipped {
        Some((shipped, _)) => material::start(&name, shipped).map_err(Failure::bad)?,
        None => {
            if material::shipped().any(|(n, _)| n == name) {
                return Err(Failure::Bad(format!(
                    "{name} is the name of a shipped material: choose another one with --name"
                )));
            }
            super::record::text_of(Path::new(&found))?
        }
    };
    Ok(Base {
        renamed: Some([name.clone(), format!("{}, measured", source.title)]),
        name,
        file,
        text,
        material: source,
    })
}

fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

/// What goes into a profile, and what is to be told about it.
pub(super) fn measured(
    base: &Base,
    strips: Option<&Strips>,
    fresh: &[Reading],
    machines: &[Machined],
    confidence: f64,
    date: &str,
    take_setting: bool,
) -> (Measured, Vec<String>) {
    let mut notes = Vec::new();
    let sigma = strips.and_then(|s| {
        let max = floored(s.bound.as_ref()?.sigma, SIGMA_DECIMALS);
        let same = fresh.is_empty() && (max - base.material.sigma.max).abs() < 5e-4;
        (!same).then(|| {
            let note = format!(
                "{date}: bound at confidence {confidence} from {} strips, for {}",
                s.strips,
                sheet_words(&s.reference)
            );
            (max, note)
        })
    });
    let mut cuts = Vec::new();
    for own in machines {
        match cut(base, own, date, take_setting, &mut notes) {
            Ok(Some(cut)) => cuts.push(cut),
            Ok(None) => {}
            Err(problem) => notes.push(format!(
                "kerf and setting of {} stay out of the profile: {problem}",
                own.machine
            )),
        }
    }
    let measured = Measured {
        name: base.renamed.clone(),
        sigma,
        samples: fresh.to_vec(),
        cuts,
    };
    (measured, notes)
}

fn cut(
    base: &Base,
    own: &Machined,
    date: &str,
    take_setting: bool,
    notes: &mut Vec<String>,
) -> Result<Option<MeasuredCut>, String> {
    if own.kerf.is_none() && own.cleanest.is_none() {
        return Ok(None);
    }
    let found = machine_named(&own.machine).map_err(|e| e.to_string())?;
    let machine = machine::load(&found).map_err(|e| e.to_string())?;
    let entry = base
        .material
        .cut_entry_for(&machine)
        .map_err(|e| e.to_string())?;
    let now = base.material.cut_for(&machine).map_err(|e| e.to_string())?;
    let old = &base.material.cut[entry];
    let mut words = Vec::new();
    let kerf_mm = own
        .kerf
        .map(|k| rounded(k.kerf_mm, KERF_DECIMALS))
        .filter(|&kerf| kerf != old.kerf_mm || old.source != material::Source::Measured);
    if let (Some(kerf_mm), Some(kerf)) = (kerf_mm, &own.kerf) {
        words.push(format!(
            "kerf {} mm by calipers ({} to {} at confidence {})",
            short(kerf_mm, 4),
            short(kerf.interval_mm[0], 3),
            short(kerf.interval_mm[1], 3),
            kerf.confidence
        ));
    }
    let mut setting = None;
    if let Some(best) = &own.cleanest {
        let same = (best.power_percent - now.power_percent).abs() < 0.05
            && (best.speed_mm_per_min - now.speed_mm_per_min).abs() < 0.5;
        let how = format!(
            "{} % of {} at {} mm/min",
            short(best.power_percent, 1),
            machine.name,
            short(best.speed_mm_per_min, 1)
        );
        if !same && (own.grid_alone || take_setting) {
            let has = machine.laser().map_or(1.0, |l| l.watts);
            let watts = old.watts.unwrap_or(has);
            let percent = (10.0 * best.power_percent * has / watts).round() / 10.0;
            setting = Some(if percent <= 100.0 {
                [watts, percent, best.speed_mm_per_min]
            } else {
                [has, best.power_percent, best.speed_mm_per_min]
            });
            words.push(format!("setting {}, {how}", best.name));
            notes.push(format!(
                "the profile takes {how}: cut kerf plate and strips with it, on a new coupon"
            ));
        } else if !same {
            notes.push(format!(
                "kerf and strips were cut with {} % at {} mm/min and hold for that; {} cut through with less heat: {how}. With --take-setting the profile takes it; then cut a new coupon",
                short(now.power_percent, 1),
                short(now.speed_mm_per_min, 1),
                best.name
            ));
        }
    }
    if words.is_empty() {
        return Ok(None);
    }
    Ok(Some(MeasuredCut {
        entry,
        kerf_mm,
        setting,
        note: format!("{date} on {}: {}", machine.name, words.join("; ")),
    }))
}

impl Base {
    /// The text with what was measured; `None` if that changes nothing.
    pub fn amended(&self, measured: &Measured) -> Result<Option<String>, Failure> {
        let nothing =
            measured.sigma.is_none() && measured.samples.is_empty() && measured.cuts.is_empty();
        if nothing {
            return Ok(None);
        }
        let file = match &self.file {
            Some(file) => file.display().to_string(),
            None => self.name.clone(),
        };
        amend(&file, &self.text, measured)
            .map(Some)
            .map_err(Failure::bad)
    }

    /// Writes it to its place.
    pub fn write(&self, text: &str) -> Result<&Path, Failure> {
        let Some(file) = &self.file else {
            return Err(Failure::Bad(
                "there is no folder for profiles of your own: set KAGOME_PROFILES to one".into(),
            ));
        };
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|e| Failure::Bad(format!("{} cannot be made: {e}", folder.display())))?;
        }
        write_file(file, text.as_bytes()).map_err(Failure::bad)?;
        Ok(file)
    }
}
