//! Sample surfaces, made here and not read from anywhere: what the tool is tried on, tested with and shown by.
//!
//! A sample is named as `sample:NAME` or `sample:NAME:key=value,key=value`; [`Sample::parse`] reads that,
//! [`Sample::generate`] makes the surface. All are in millimetres, about 200 mm across and of about 12 000 faces
//! unless told otherwise, the outside up (+Z) or away from the Z axis, with near-isotropic triangles.
//!
//! | sample | topology | what it shows |
//! |---|---|---|
//! | `cap`, `hemisphere` | disk | closed form: see [`Cap`] |
//! | `bump` | disk | impossible without a cone, easy with one at the tip |
//! | `saddle` | disk | negative curvature |
//! | `catenoid`, `vase`, `funnel` | annulus | seams, and how the turning of a rim matters |
//! | `torus` | closed, one handle | closed form |
//! | `double_torus` | closed, two handles | the pattern must close along four loops at once |
//! | `octasphere` | closed | six cones in the right places make it developable by triangles |
//! | `mask` | disk | a face |

mod double_torus;
mod mask;
mod parameter;
mod revolve;
mod shapes;

use std::fmt;

pub use double_torus::DoubleTorus;
pub use mask::Mask;
pub use parameter::Parameter;
pub use shapes::{Bump, Cap, Catenoid, Funnel, Hemisphere, Octasphere, Saddle, Torus, Vase};

use super::repair::{Import, ImportOptions, ImportReport};
use super::surface::{Surface, TopologyError};

/// Why a sample cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SampleError {
    /// There is no such sample.
    #[error("there is no sample {name:?}; there are: {known}")]
    UnknownName {
        /// As given.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// The sample has no such parameter.
    #[error("sample {sample} has no parameter {key:?}; it has: {known}")]
    UnknownKey {
        /// The sample.
        sample: &'static str,
        /// As given.
        key: String,
        /// Those that it has.
        known: String,
    },
    /// A part is not of the form `key=number`.
    #[error("in {text:?}, {part:?} is not of the form key=number (for example {example})")]
    NotAValue {
        /// All that was given.
        text: String,
        /// The part that is wrong.
        part: String,
        /// How it might look.
        example: String,
    },
    /// A parameter is given twice.
    #[error("in {text:?}, {key} is given twice")]
    Twice {
        /// All that was given.
        text: String,
        /// The key.
        key: &'static str,
    },
    /// A parameter is outside its range.
    #[error("sample {sample}: {key}={value} is outside {least} to {most}")]
    OutOfRange {
        /// The sample.
        sample: &'static str,
        /// The parameter.
        key: &'static str,
        /// As given.
        value: f64,
        /// The smallest value accepted.
        least: f64,
        /// The largest value accepted.
        most: f64,
    },
    /// Parameters that are possible each for itself contradict each other.
    #[error("sample {sample}: {why}")]
    Contradiction {
        /// The sample.
        sample: &'static str,
        /// Which ones, with their values.
        why: String,
    },
    /// The units asked for do not give a surface of a size that can be made.
    #[error("sample:{sample}: {problem}")]
    Size {
        /// The sample with its parameters.
        sample: String,
        /// What is wrong and what to do.
        problem: String,
    },
    /// The triangles do not form a surface.
    #[error("sample {sample} cannot be meshed with these parameters ({source}); try more faces")]
    Topology {
        /// The sample.
        sample: &'static str,
        /// What is wrong.
        source: TopologyError,
    },
}

macro_rules! samples {
    ($( $(#[doc = $doc:literal])+ $name:literal => $shape:ident ),+ $(,)?) => {
        /// A sample surface with its parameters.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Sample {
            $( $(#[doc = $doc])+ $shape($shape), )+
        }

        impl Sample {
            /// Every sample, with default parameters.
            pub fn all() -> Vec<Self> {
                vec![ $( Self::$shape($shape::default()), )+ ]
            }
            /// Its name in `sample:NAME`.
            pub fn name(&self) -> &'static str {
                match self { $( Self::$shape(_) => $name, )+ }
            }
            /// What it is, in one line.
            pub fn summary(&self) -> &'static str {
                match self { $( Self::$shape(_) => concat!($($doc),+).trim_ascii(), )+ }
            }
            /// Its parameters.
            pub fn parameters(&self) -> &'static [Parameter] {
                match self { $( Self::$shape(_) => $shape::PARAMETERS, )+ }
            }
            /// The values of its parameters, in the order of [`Sample::parameters`].
            pub fn values(&self) -> Vec<f64> {
                match self { $( Self::$shape(shape) => shape.values(), )+ }
            }
            fn set(&mut self, key: &str, value: f64) {
                match self { $( Self::$shape(shape) => shape.set(key, value), )+ }
            }
            fn arrays(&self) -> Result<revolve::Arrays, SampleError> {
                match self { $( Self::$shape(shape) => shape.arrays(), )+ }
            }
        }
    };
}

samples! {
    /// a spherical cap, with a closed form to test against
    "cap" => Cap,
    /// half a sphere
    "hemisphere" => Hemisphere,
    /// a steep bell on a disk: it needs one cone, at its tip
    "bump" => Bump,
    /// a saddle over a disk: negative curvature
    "saddle" => Saddle,
    /// the minimal surface between two equal rings
    "catenoid" => Catenoid,
    /// a vase without a bottom: two rims, belly and neck
    "vase" => Vase,
    /// a trumpet: two rims of very different size
    "funnel" => Funnel,
    /// a ring: closed, with a handle
    "torus" => Torus,
    /// two rings grown together: closed, with two handles
    "double_torus" => DoubleTorus,
    /// a closed sphere, meshed as a divided octahedron
    "octasphere" => Octasphere,
    /// a face in relief, in the manner of a theatre mask
    "mask" => Mask,
}

impl Sample {
    /// Reads `NAME` or `NAME:key=value,…`, with or without `sample:` before it.
    ///
    /// # Errors
    /// [`SampleError`], which lists the names or keys that there are.
    pub fn parse(text: &str) -> Result<Self, SampleError> {
        let body = text.strip_prefix("sample:").unwrap_or(text);
        let (name, rest) = body.split_once(':').unwrap_or((body, ""));
        let all = Self::all();
        let Some(mut sample) = all.iter().find(|s| s.name() == name).copied() else {
            let known: Vec<_> = all.iter().map(Self::name).collect();
            return Err(SampleError::UnknownName {
                name: name.into(),
                known: known.join(", "),
            });
        };
        let parameters = sample.parameters();
        let mut given: Vec<&str> = Vec::new();
        for part in rest.split(',').filter(|p| !p.trim().is_empty()) {
            let not_a_value = || SampleError::NotAValue {
                text: text.into(),
                part: part.trim().into(),
                example: format!("{}={}", parameters[0].key, parameters[0].default),
            };
            let (key, value) = part.split_once('=').ok_or_else(not_a_value)?;
            let (key, value) = (key.trim(), value.trim());
            let Some(parameter) = parameters.iter().find(|p| p.key == key) else {
                let known: Vec<_> = parameters.iter().map(|p| p.key).collect();
                return Err(SampleError::UnknownKey {
                    sample: sample.name(),
                    key: key.into(),
                    known: known.join(", "),
                });
            };
            if given.contains(&parameter.key) {
                return Err(SampleError::Twice {
                    text: text.into(),
                    key: parameter.key,
                });
            }
            given.push(parameter.key);
            let value: f64 = value.parse().map_err(|_| not_a_value())?;
            sample.set(key, parameter.check(sample.name(), value)?);
        }
        Ok(sample)
    }

    /// Makes the surface.
    ///
    /// # Errors
    /// [`SampleError`] if a parameter set by hand is outside its range or contradicts another.
    pub fn generate(&self) -> Result<Surface, SampleError> {
        for (parameter, value) in self.parameters().iter().zip(self.values()) {
            parameter.check(self.name(), value)?;
        }
        let (positions, faces) = self.arrays()?;
        Surface::new(positions, faces).map_err(|source| SampleError::Topology {
            sample: self.name(),
            source,
        })
    }

    /// Makes the surface in the size that `options` ask for, as [`super::import_file`] does for a file.
    ///
    /// # Errors
    /// [`SampleError`] for parameters or units that cannot be used.
    pub fn import(&self, options: &ImportOptions) -> Result<Import, SampleError> {
        let surface = self.generate()?;
        let (low, high) = surface.bounds();
        let mm_per_unit = options
            .units
            .factor((high - low).max())
            .map_err(|problem| SampleError::Size {
                sample: self.to_string(),
                problem: problem.to_string(),
            })?;
        let report = ImportReport {
            format: "sample",
            file_vertices: surface.positions().len(),
            file_faces: surface.faces().len(),
            parts: 1,
            mm_per_unit,
            ..Default::default()
        };
        let surface = if mm_per_unit == 1.0 {
            surface
        } else {
            surface.scaled(mm_per_unit)
        };
        Ok(Import { surface, report })
    }
}

/// The shortest text from which [`Sample::parse`] gives the same sample: `cap`, `cap:half_angle_deg=75`.
impl fmt::Display for Sample {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        let mut before = ':';
        for (parameter, value) in self.parameters().iter().zip(self.values()) {
            if value != parameter.default {
                write!(f, "{before}{}={value}", parameter.key)?;
                before = ',';
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
