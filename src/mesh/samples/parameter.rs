//! Parameters of samples: one declaration gives the field, its key, its default, its range and its help.

use super::SampleError;

/// What a key of `sample:NAME:key=value` means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// The key, which is also the name of the field; it ends in the unit.
    pub key: &'static str,
    /// One line of help.
    pub help: &'static str,
    /// The value if the key is not given.
    pub default: f64,
    /// The smallest value accepted.
    pub least: f64,
    /// The largest value accepted.
    pub most: f64,
}

impl Parameter {
    /// Accepts a value inside the range.
    pub(super) fn check(&self, sample: &'static str, value: f64) -> Result<f64, SampleError> {
        if value >= self.least && value <= self.most {
            Ok(value)
        } else {
            Err(SampleError::OutOfRange {
                sample,
                key: self.key,
                value,
                least: self.least,
                most: self.most,
            })
        }
    }
}

/// Declares the parameters of one sample: a struct of public numbers with documented keys.
macro_rules! parameters {
    (
        $(#[$doc:meta])*
        $shape:ident {
            $( $(#[doc = $help:literal])+ $key:ident = $default:literal in $least:literal ..= $most:literal ),+ $(,)?
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $shape {
            $( $(#[doc = $help])+ pub $key: f64, )+
        }

        impl Default for $shape {
            fn default() -> Self {
                Self { $( $key: $default, )+ }
            }
        }

        impl $shape {
            pub(super) const PARAMETERS: &'static [Parameter] = &[
                $( Parameter {
                    key: stringify!($key),
                    help: concat!($($help),+),
                    default: $default,
                    least: $least,
                    most: $most,
                }, )+
            ];

            pub(super) fn values(&self) -> Vec<f64> {
                vec![ $( self.$key, )+ ]
            }

            pub(super) fn set(&mut self, key: &str, value: f64) {
                $( if key == stringify!($key) { self.$key = value; } )+
            }
        }
    };
}
pub(super) use parameters;
