//! The surface that a verb works on, and how its file is to be understood: shared by all verbs that take one.

use clap::Args;

use super::Failure;
use crate::job::Source;
use crate::mesh::repair::{Import, ImportOptions, PartChoice, import_file};
use crate::mesh::samples::Sample;
use crate::mesh::units::{Unit, Units};

/// A surface and its units.
#[derive(Args, Clone, Debug)]
pub struct SurfaceArgs {
    /// OBJ, STL or PLY file, or sample:NAME[:key=value,…] (see `kagome samples list`)
    #[arg(value_name = "SURFACE")]
    pub surface: String,
    /// What one unit in the file is: mm, cm, m or in
    #[arg(long, default_value = "mm", value_name = "UNIT")]
    pub unit: Unit,
    /// A factor on top of the unit
    #[arg(
        long,
        default_value_t = 1.0,
        value_name = "S",
        allow_negative_numbers = true
    )]
    pub scale: f64,
    /// Make the longest side of the surface's box this long, instead of --unit and --scale
    #[arg(long, value_name = "MM", conflicts_with_all = ["unit", "scale"], allow_negative_numbers = true)]
    pub size: Option<f64>,
    /// Which part to use if the surface has several
    #[arg(long, value_name = "WHICH")]
    pub part: Option<Part>,
}

/// What a request calls a surface.
pub fn source(name: &str) -> Source {
    match name.strip_prefix("sample:") {
        Some(sample) => Source::Sample(sample.to_owned()),
        None => Source::File {
            path: name.into(),
            sha256: None,
        },
    }
}

/// Values of `--part`.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The one with the most faces
    Largest,
}

impl SurfaceArgs {
    /// How the file is to be understood.
    pub fn options(&self) -> ImportOptions {
        ImportOptions {
            units: Units {
                unit: self.unit,
                scale: self.scale,
                size_mm: self.size,
            },
            parts: match self.part {
                Some(Part::Largest) => PartChoice::Largest,
                None => PartChoice::Refuse,
            },
        }
    }

    /// What a request calls it.
    pub fn source(&self) -> Source {
        source(&self.surface)
    }

    /// Reads the file, or makes the sample; `--unit`, `--scale` and `--size` hold for both.
    ///
    /// # Errors
    /// [`Failure::Bad`] with what is wrong and what to do.
    pub fn load(&self) -> Result<Import, Failure> {
        let options = self.options();
        if !self.surface.starts_with("sample:") {
            return import_file(self.surface.as_ref(), &options).map_err(Failure::bad);
        }
        let sample = Sample::parse(&self.surface).map_err(Failure::bad)?;
        sample.import(&options).map_err(Failure::bad)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Probe {
        #[command(flatten)]
        surface: SurfaceArgs,
    }

    fn load(line: &str) -> Result<Import, Failure> {
        let words = std::iter::once("probe").chain(line.split(' '));
        Probe::try_parse_from(words)
            .map_err(Failure::bad)?
            .surface
            .load()
    }

    #[test]
    fn units_hold_for_samples_too() {
        let width = |line: &str| {
            let (low, high) = load(line).unwrap().surface.bounds();
            (high - low).max()
        };
        assert!((width("sample:hemisphere") - 200.0).abs() < 0.5);
        assert!((width("sample:hemisphere --size 50") - 50.0).abs() < 1e-9);
        assert!((width("sample:hemisphere --unit in --scale 0.5") - 2540.0).abs() < 6.0);
    }

    #[test]
    fn what_cannot_be_meant_is_refused() {
        for (line, says) in [
            ("sample:cone", "octasphere"),
            ("no-such-file.obj", "no-such-file.obj: cannot be read"),
            ("sample:cap --size 0", "--size 0 cannot be used"),
            ("sample:cap --unit m", "more than 20 m"),
            ("sample:cap --size 9 --unit m", "cannot be used with"),
        ] {
            match load(line) {
                Err(Failure::Bad(text)) => assert!(text.contains(says), "{line}: {text}"),
                other => panic!("{line}: {other:?}"),
            }
        }
    }
}
