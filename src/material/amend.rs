//! A profile with what was measured put in; all else, comments too, stays as it was written.

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, value};

use super::profile::Source;
use super::reading::Reading;
use super::{Material, parse};
use crate::base::document::DocumentError;
use crate::base::units::short;

/// What was measured, and goes into a profile.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Name and title of the new profile; none to keep them.
    pub name: Option<[String; 2]>,
    /// The largest stretch and how it was found, in words; none to keep them.
    pub sigma: Option<(f64, String)>,
    /// Strips that are added to those in the profile.
    pub samples: Vec<Reading>,
    /// What was found about ways to cut it.
    pub cuts: Vec<MeasuredCut>,
}

/// What was found about one way to cut a material.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredCut {
    /// Its number in the profile, from 0.
    pub entry: usize,
    /// Width of what is burnt away, millimetres; none to keep it.
    pub kerf_mm: Option<f64>,
    /// Laser watts, per cent of them, and speed in mm/min; none to keep them.
    pub setting: Option<[f64; 3]>,
    /// How this was found, in words.
    pub note: String,
}

/// Why a profile cannot be amended.
#[derive(Debug, thiserror::Error)]
pub enum AmendError {
    /// What would come out is no profile.
    #[error("the amended profile would be wrong: {0}")]
    Wrong(DocumentError),
    /// The text is no profile.
    #[error("the profile is wrong: {0}")]
    Profile(DocumentError),
    /// Its text cannot be changed in place.
    #[error("{file} cannot be changed: {problem}")]
    Text {
        /// As messages call it.
        file: String,
        /// What is in the way.
        problem: String,
    },
}

fn source_words(source: Source) -> &'static str {
    match source {
        Source::Measured => "measured",
        Source::Literature => "from literature",
        Source::Estimate => "an estimate",
    }
}

/// Sets a value, and keeps what stands around the old one.
fn set(table: &mut Table, key: &str, new: impl Into<toml_edit::Value>) {
    let mut new = new.into();
    if let Some(old) = table.get(key).and_then(Item::as_value) {
        *new.decor_mut() = old.decor().clone();
    }
    // Through the item, so that a comment over the key stays as well.
    match table.get_mut(key) {
        Some(item) => *item = Item::Value(new),
        None => {
            table.insert(key, value(new));
        }
    }
}

/// The text of a profile with what was measured; `file` is what messages call it. Figures that are replaced live on in
/// words in the note.
///
/// # Errors
/// [`AmendError`].
pub fn amend(file: &str, text: &str, measured: &Measured) -> Result<String, AmendError> {
    let before = parse(file, text).map_err(AmendError::Profile)?;
    let wrong = |problem: &str| AmendError::Text {
        file: file.into(),
        problem: problem.into(),
    };
    let mut document: DocumentMut = text
        .parse()
        .map_err(|e: toml_edit::TomlError| wrong(e.message()))?;
    if let Some([name, title]) = &measured.name {
        set(document.as_table_mut(), "name", name.as_str());
        set(document.as_table_mut(), "title", title.as_str());
    }
    if measured.sigma.is_some() || !measured.samples.is_empty() {
        let sigma = document
            .get_mut("sigma")
            .and_then(Item::as_table_mut)
            .ok_or_else(|| wrong("write sigma as a table of its own, [sigma]"))?;
        amend_sigma(sigma, &before, measured).map_err(|problem| wrong(&problem))?;
    }
    for cut in &measured.cuts {
        let entry = document
            .get_mut("cut")
            .and_then(Item::as_array_of_tables_mut)
            .and_then(|cuts| cuts.get_mut(cut.entry))
            .ok_or_else(|| wrong("write each way to cut as a table of its own, [[cut]]"))?;
        amend_cut(entry, &before, cut);
    }
    let text = document.to_string();
    parse(file, &text).map_err(AmendError::Wrong)?;
    Ok(text)
}

fn amend_sigma(table: &mut Table, before: &Material, measured: &Measured) -> Result<(), String> {
    let old = &before.sigma;
    if let Some((max, note)) = &measured.sigma {
        let note = format!(
            "{note}; before: {}, {}: {}",
            short(old.max, 3),
            source_words(old.source),
            old.note
        );
        set(table, "max", *max);
        set(table, "source", "measured");
        set(table, "note", note);
    }
    if measured.samples.is_empty() {
        return Ok(());
    }
    let samples = table
        .entry("sample")
        .or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()))
        .as_array_of_tables_mut()
        .ok_or("write each strip as a table of its own, [[sigma.sample]]")?;
    for sample in &measured.samples {
        let text = toml::to_string(sample).map_err(|e| e.to_string())?;
        let own: DocumentMut = text
            .parse()
            .map_err(|e: toml_edit::TomlError| e.message().to_owned())?;
        let mut table = own.as_table().clone();
        table.decor_mut().set_prefix("\n");
        samples.push(table);
    }
    Ok(())
}

fn amend_cut(table: &mut Table, before: &Material, cut: &MeasuredCut) {
    let Some(old) = before.cut.get(cut.entry) else {
        return;
    };
    let mut were = Vec::new();
    if let Some([watts, percent, speed]) = cut.setting {
        were.push(format!(
            "{} % at {} mm/min",
            short(old.power_percent.unwrap_or(100.0), 2),
            short(old.speed_mm_per_min, 1)
        ));
        if old.watts.is_some() {
            set(table, "watts", watts);
            set(table, "power_percent", percent);
        }
        set(table, "speed_mm_per_min", speed);
    }
    if let Some(kerf_mm) = cut.kerf_mm {
        were.push(format!("kerf {}", short(old.kerf_mm, 4)));
        set(table, "kerf_mm", kerf_mm);
        // A pierce burns at least what the cut burns.
        if old.pierce_diameter_mm.is_some_and(|d| d < kerf_mm) {
            set(table, "pierce_diameter_mm", kerf_mm);
        }
    }
    let note = format!(
        "{}; before: {}, {}: {}",
        cut.note,
        were.join(", "),
        source_words(old.source),
        old.note
    );
    set(table, "source", "measured");
    set(table, "note", note);
}

#[cfg(test)]
mod tests {
    use super::super::shipped;
    use super::*;
    use crate::material::Failure;

    fn sample(held: f64) -> Reading {
        Reading {
            strip: Some("A1".into()),
            date: "2026-05-31".into(),
            hinge_width_mm: 1.0,
            kerf_mm: 0.2,
            tip_radius_mm: None,
            thickness_mm: 1.6,
            edge_mm: 12.0,
            hinges: 36,
            held,
            tore: Some(held + 0.05),
            failure: Some(Failure::Torn),
        }
    }

    fn measured() -> Measured {
        Measured {
            name: Some(["mine".into(), "My leather".into()]),
            sigma: Some((1.41, "of two strips".into())),
            samples: vec![sample(1.4), sample(1.5)],
            cuts: vec![MeasuredCut {
                entry: 0,
                kerf_mm: Some(0.23),
                setting: Some([40.0, 50.0, 800.0]),
                note: "calipers".into(),
            }],
        }
    }

    #[test]
    fn only_what_was_measured_changes_and_old_figures_stay_in_words() {
        for (name, text) in shipped() {
            let before = parse(name, text).unwrap();
            let amended = amend(name, text, &measured()).unwrap();
            let after = parse(name, &amended).unwrap();
            assert_eq!(after.name, "mine");
            assert_eq!(after.sigma.max, 1.41);
            assert_eq!(after.sigma.source, Source::Measured);
            assert!(after.sigma.note.contains(&before.sigma.note));
            assert!(after.sigma.note.contains(&short(before.sigma.max, 3)));
            assert_eq!(after.sigma.sample, measured().samples);
            assert_eq!(after.cut[0].kerf_mm, 0.23);
            assert_eq!(after.cut[0].speed_mm_per_min, 800.0);
            assert!(after.cut[0].note.contains(&before.cut[0].note));
            assert_eq!(after.cut[1..], before.cut[1..]);
            assert_eq!(after.engrave, before.engrave);
            // Again: the samples are all there, the history grows.
            let again = Measured {
                name: None,
                samples: vec![sample(1.6)],
                ..measured()
            };
            let last = parse(name, &amend(name, &amended, &again).unwrap()).unwrap();
            assert_eq!(last.sigma.sample.len(), 3);
            assert_eq!(last.sigma.sample[2], sample(1.6));
            assert!(last.sigma.note.contains(&after.sigma.note));
        }
    }

    #[test]
    fn comments_and_order_stay() {
        let (name, text) = shipped().next().unwrap();
        let commented: String = text
            .lines()
            .map(|l| {
                if l.contains(" = ") {
                    format!("# about {l}\n{l} # so\n")
                } else {
                    format!("{l}\n")
                }
            })
            .collect();
        let amended = amend(name, &commented, &measured()).unwrap();
        for line in commented.lines() {
            if line.starts_with('#') {
                assert!(amended.contains(line), "{line}\n{amended}");
            }
        }
        let so = |t: &str| t.matches("# so").count();
        assert_eq!(so(&amended), so(&commented));
        // What was not measured is byte for byte what it was.
        let unmeasured = amend(name, &commented, &Measured::default()).unwrap();
        assert_eq!(unmeasured, commented);
        // The samples stand behind [sigma] and before the first [[cut]].
        let at = |what: &str| amended.find(what).unwrap();
        assert!(at("[sigma]") < at("[[sigma.sample]]"), "{amended}");
        assert!(at("[[sigma.sample]]") < at("[[cut]]"), "{amended}");
    }

    #[test]
    fn what_would_be_no_profile_is_refused() {
        let (name, text) = shipped().next().unwrap();
        let bad = Measured {
            sigma: Some((3.0, "x".into())),
            ..Measured::default()
        };
        assert!(matches!(amend(name, text, &bad), Err(AmendError::Wrong(_))));
        assert!(matches!(
            amend(name, "format = 2", &bad),
            Err(AmendError::Profile(_))
        ));
    }
}
