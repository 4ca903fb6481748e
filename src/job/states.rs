//! States of one linkage as a set of files: an OBJ for each, one glTF that plays them, and the figures.

use std::path::Path;

use serde::Serialize;

use crate::base::atomic::{self, WriteError};
use crate::base::units::short;
use crate::linkage::{Linkage, write_glb};
use crate::rationalize::{MOST_STEPS, State, StatePath};

/// All states, to be played.
const PLAYED: &str = "states.glb";

/// All figures.
const FIGURES: &str = "states.json";

/// A mean opening as a person says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Opening {
    /// That of the file.
    Current,
    /// As far closed as it goes.
    Closed,
    /// As far open as it goes.
    Open,
    /// The mean scale factor over the hinges.
    Mean(f64),
    /// Percent of what the file is open: 0 closed, 100 as in the file.
    Percent(f64),
}

impl Opening {
    /// The mean scale factor that is meant, for a file that has `current` and hinges that open to `sigma`.
    pub fn mean(self, current: f64, sigma: f64) -> f64 {
        match self {
            Self::Current => current.min(sigma).max(1.0),
            Self::Closed => 1.0,
            Self::Open => sigma,
            Self::Mean(mean) => mean,
            Self::Percent(percent) => 1.0 + (current - 1.0) * percent / 100.0,
        }
    }

    /// Whether only as far as it goes is asked for, so that to fall short is no failure.
    pub fn as_far_as_it_goes(self) -> bool {
        matches!(self, Self::Closed | Self::Open)
    }
}

impl std::str::FromStr for Opening {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| {
            let number = text.trim().parse::<f64>().ok();
            number.filter(|x| x.is_finite()).ok_or_else(|| {
                format!(
                    "{text:?} is no opening: give the mean scale factor over the hinges (1 closed, 2 fully open), a percentage of what the file is open, or current, closed or open"
                )
            })
        };
        match text.trim() {
            "current" => Ok(Self::Current),
            "closed" => Ok(Self::Closed),
            "open" => Ok(Self::Open),
            other => match other.strip_suffix('%') {
                Some(percent) => number(percent).map(Self::Percent),
                None => number(other).map(Self::Mean),
            },
        }
    }
}

/// Figures of one state.
#[derive(Clone, Debug, Serialize)]
pub struct StateFigures {
    /// Its file.
    pub file: String,
    /// The mean opening that was asked for; none between two given states.
    pub asked: Option<f64>,
    /// Smallest, mean and largest scale factor over the hinges.
    pub opening: [f64; 3],
    /// Part of its extent that is open, where light passes: 1 − 1 / mean(λ²).
    pub open_share: f64,
    /// Sides of the box around it, millimetres.
    pub box_mm: [f64; 3],
    /// Largest relative error of an edge length.
    pub edge_error_max: f64,
    /// Hinges whose triangles run into each other.
    pub penetrations: usize,
    /// Pairs of other triangles that cross.
    pub intersections: usize,
    /// Hinges that open too far.
    pub over_sigma: usize,
    /// Exact edges, no overlaps, no hinge too far open.
    pub sound: bool,
}

impl StateFigures {
    fn new(file: String, state: &State) -> Self {
        let q = &state.soundness;
        let extent = |k: usize| {
            let along = state.positions.iter().map(|p| p[k]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
                (a.min(x), b.max(x))
            });
            (high - low).max(0.0)
        };
        Self {
            file,
            asked: state.asked,
            opening: q.opening,
            open_share: state.open_share,
            box_mm: [0, 1, 2].map(extent),
            edge_error_max: q.edge_error_max,
            penetrations: q.penetrations,
            intersections: q.intersections,
            over_sigma: q.over_sigma,
            sound: state.sound(),
        }
    }

    /// What it has to say on one line.
    pub fn line(&self) -> String {
        let [least, mean, most] = self.opening.map(|s| format!("{s:.4}"));
        let [x, y, z] = self.box_mm.map(|s| short(s, 1));
        let mut text = format!(
            "λ {mean} ({least} to {most}), {:.1} % open, {x} × {y} × {z} mm, edges {:.0e}",
            100.0 * self.open_share,
            self.edge_error_max
        );
        let faults = [
            (self.penetrations, "hinges run into each other"),
            (self.intersections, "pairs of triangles cross"),
            (self.over_sigma, "hinges too far open"),
        ];
        for (count, what) in faults.into_iter().filter(|(count, _)| *count > 0) {
            text += &format!(", {count} {what}");
        }
        text
    }
}

/// The files of a path, and what stands in them.
pub struct StateFiles {
    files: Vec<(String, Vec<u8>)>,
    /// Figures of the states, in their order.
    pub states: Vec<StateFigures>,
    /// All figures, as they stand in `states.json`.
    pub figures: serde_json::Value,
}

impl StateFiles {
    /// The files for a path of a linkage whose hinges may open to `sigma`. `None` if they would be too large for glTF (4 GB).
    pub fn new(linkage: &Linkage, path: &StatePath, sigma: f64) -> Option<Self> {
        let states: Vec<StateFigures> = path
            .states
            .iter()
            .enumerate()
            .map(|(n, state)| StateFigures::new(file_name(n), state))
            .collect();
        let figures = serde_json::json!({
            "triangles": linkage.triangles.len(),
            "hinges": linkage.hinges.len(),
            "edge_mm": linkage.edge_mm,
            "sigma": sigma,
            "reached": { "from": path.reached[0], "to": path.reached[1] },
            "states": states,
        });
        let all: Vec<_> = path.states.iter().map(|s| s.positions.as_slice()).collect();
        let played = write_glb(linkage, &all)?;
        let objects = path.states.iter().zip(&states);
        let mut files: Vec<(String, Vec<u8>)> = objects
            .map(|(state, own)| (own.file.clone(), state.obj(linkage).into_bytes()))
            .collect();
        files.push((PLAYED.into(), played));
        files.push((FIGURES.into(), format!("{figures:#}\n").into_bytes()));
        Some(Self {
            files,
            states,
            figures,
        })
    }

    /// Writes them as one folder, complete or not at all; with `force` over an earlier one.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&self, folder: &Path, force: bool) -> Result<(), WriteError> {
        let files: Vec<(&str, Vec<u8>)> = self
            .files
            .iter()
            .map(|(name, bytes)| (name.as_str(), bytes.clone()))
            .collect();
        with_names(|names| atomic::write_directory(folder, &files, names, force))
    }

    /// Checks, before any work is done, that [`StateFiles::write`] could succeed.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn check(folder: &Path, force: bool) -> Result<(), WriteError> {
        with_names(|names| atomic::check_directory(folder, names, force))
    }
}

fn file_name(n: usize) -> String {
    format!("state-{n:03}.obj")
}

/// All names that a folder of states may hold.
fn with_names<T>(run: impl FnOnce(&[&str]) -> T) -> T {
    let names: Vec<String> = (0..=MOST_STEPS).map(file_name).collect();
    let mut names: Vec<&str> = names.iter().map(String::as_str).collect();
    names.extend([PLAYED, FIGURES]);
    run(&names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn openings_are_read_as_they_are_said() {
        let mean = |text: &str| text.parse::<Opening>().map(|o| o.mean(1.5, 1.8));
        for (text, wanted) in [
            ("current", 1.5),
            ("closed", 1.0),
            ("open", 1.8),
            ("1.25", 1.25),
            ("50%", 1.25),
            ("0 %", 1.0),
            ("100%", 1.5),
        ] {
            assert_eq!(mean(text), Ok(wanted), "{text}");
        }
        for text in ["", "%", "NaN", "inf", "half", "1,5", "nan%"] {
            assert!(
                mean(text).is_err_and(|e| e.contains("mean scale factor")),
                "{text}"
            );
        }
    }
}
