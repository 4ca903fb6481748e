//! The controller's `$` settings as a file: saved, compared, and put back.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::{Console, ConsoleError};
use crate::control::reply::{MachineState, Reply};

/// All `$n=value` of a controller, by number; values as the controller writes them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings(BTreeMap<u32, String>);

/// A line of a settings file that is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{line}: {problem}")]
pub struct SettingsError {
    /// The file.
    pub file: String,
    /// Its line, from 1.
    pub line: usize,
    /// What is wrong, and what to do.
    pub problem: String,
}

/// A setting that differs.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct SettingDifference {
    /// Its number.
    pub number: u32,
    /// The controller's value; none if it has no such setting.
    pub controller: Option<String>,
    /// The file's; none if the file does not name it.
    pub file: Option<String>,
}

/// What came of putting settings back.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Restored {
    /// Those that the controller took and tells now.
    pub written: Vec<u32>,
    /// Those that it refused, with the reason.
    pub refused: Vec<(u32, String)>,
    /// Those that it took and tells differently.
    pub different: Vec<SettingDifference>,
}

/// Equal as numbers, or as texts.
fn same(a: &str, b: &str) -> bool {
    match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => a == b || (a - b).abs() <= 1e-6 * a.abs().max(b.abs()),
        _ => a == b,
    }
}

/// What some firmwares show in place of a password.
fn is_hidden(value: &str) -> bool {
    !value.is_empty() && value.bytes().all(|b| b == b'*')
}

impl Settings {
    /// The number and value of a line `$n=value`, without an explanation in brackets behind it.
    fn of_line(line: &str) -> Option<(u32, String)> {
        let (number, value) = line.trim().strip_prefix('$')?.split_once('=')?;
        let number = number.trim().parse().ok()?;
        // GRBL 0.9 and some of its heirs write "$0=10 (step pulse, usec)".
        let value = value.split(" (").next().unwrap_or(value).trim();
        Some((number, value.to_owned()))
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A setting as a number.
    pub fn number(&self, number: u32) -> Option<f64> {
        self.0.get(&number)?.parse().ok()
    }

    /// The text of a file: a line a setting, `;` for remarks.
    pub fn to_text(&self, heading: &str) -> String {
        let mut text = String::new();
        for line in heading.lines() {
            let _ = writeln!(text, "; {line}");
        }
        for (number, value) in &self.0 {
            let _ = writeln!(text, "${number}={value}");
        }
        text
    }

    /// Reads a file that [`Settings::to_text`] or a person wrote: also what a terminal shows after `$$`.
    ///
    /// # Errors
    /// [`SettingsError`] with the line: no setting, a number twice, no setting at all.
    pub fn parse(file: &str, text: &str) -> Result<Self, SettingsError> {
        let wrong = |line: usize, problem: String| SettingsError {
            file: file.to_owned(),
            line: line + 1,
            problem,
        };
        let mut found = BTreeMap::new();
        for (n, raw) in text.lines().enumerate() {
            let line = raw.split(';').next().unwrap_or("").trim();
            if line.is_empty() || line == "ok" {
                continue;
            }
            let Some((number, value)) = Self::of_line(line) else {
                return Err(wrong(
                    n,
                    format!("{raw:?} is no setting; they look like $110=5000"),
                ));
            };
            if value.is_empty() && number < 70 {
                return Err(wrong(n, format!("${number} has no value")));
            }
            // One line of it must not become two at the controller.
            if value.chars().any(|c| c.is_control() || !c.is_ascii()) || value.len() > 60 {
                return Err(wrong(
                    n,
                    format!("${number} has a value that no controller takes"),
                ));
            }
            if found.insert(number, value).is_some() {
                return Err(wrong(n, format!("${number} stands here twice")));
            }
        }
        if found.is_empty() {
            return Err(wrong(0, "there is no setting in it".into()));
        }
        Ok(Self(found))
    }

    /// What differs between a controller (`self`) and a file; passwords that are hidden are not compared.
    pub fn differences(&self, file: &Self) -> Vec<SettingDifference> {
        let mut numbers: Vec<u32> = self.0.keys().chain(file.0.keys()).copied().collect();
        numbers.sort_unstable();
        numbers.dedup();
        let differs = |number: u32| {
            let (a, b) = (self.0.get(&number), file.0.get(&number));
            let equal = match (a, b) {
                (Some(a), Some(b)) => same(a, b) || is_hidden(a) || is_hidden(b),
                _ => false,
            };
            (!equal).then(|| SettingDifference {
                number,
                controller: a.cloned(),
                file: b.cloned(),
            })
        };
        numbers.into_iter().filter_map(differs).collect()
    }
}

impl Console<'_> {
    /// The controller's settings.
    ///
    /// # Errors
    /// [`ConsoleError`].
    pub fn settings(&mut self) -> Result<Settings, ConsoleError> {
        let mut found = BTreeMap::new();
        for reply in self.ask("$$")? {
            match reply {
                Reply::Setting(number, value) => {
                    found.insert(number, format!("{value}"));
                }
                // Texts, such as the name of a network.
                Reply::Unknown(line) => {
                    if let Some((number, value)) = Settings::of_line(&line) {
                        found.insert(number, value);
                    }
                }
                _ => {}
            }
        }
        if found.is_empty() {
            return Err(ConsoleError::NotReady(
                "the controller tells no settings ($$)".into(),
            ));
        }
        Ok(Settings(found))
    }

    /// Writes those of these differences that a file has and the controller has too, one at a time, and reads all back. Each
    /// goes to the EEPROM, during which GRBL loses bytes: nothing else is on the line until it is answered.
    ///
    /// # Errors
    /// [`ConsoleError`] for a machine that is not at rest, or a link that fails.
    pub fn restore(&mut self, differences: &[SettingDifference]) -> Result<Restored, ConsoleError> {
        let status = self.status()?;
        if !matches!(status.state, MachineState::Idle | MachineState::Alarm) {
            return Err(ConsoleError::NotReady(format!(
                "the machine is not idle ({:?}): settings are written at rest only",
                status.state
            )));
        }
        let mut restored = Restored::default();
        let mut wanted = Settings::default();
        // Soft limits ($20) are refused while homing ($22) is off.
        let (homing, rest): (Vec<_>, Vec<_>) = differences.iter().partition(|d| d.number == 22);
        for difference in homing.into_iter().chain(rest) {
            let (Some(value), Some(_)) = (&difference.file, &difference.controller) else {
                continue;
            };
            let number = difference.number;
            if is_hidden(value) {
                continue;
            }
            if self.progress.interrupted() {
                restored
                    .refused
                    .push((number, "interrupted before it".into()));
                continue;
            }
            match self.ask(&format!("${number}={value}")) {
                Ok(_) => {
                    wanted.0.insert(number, value.clone());
                }
                Err(ConsoleError::Refused { words, .. }) => restored.refused.push((number, words)),
                Err(other) => return Err(other),
            }
        }
        let now = self.settings()?;
        let kept = Settings(
            now.0
                .into_iter()
                .filter(|(number, _)| wanted.0.contains_key(number))
                .collect(),
        );
        restored.different = kept.differences(&wanted);
        let differs = |n: &u32| restored.different.iter().any(|d| d.number == *n);
        restored.written = wanted.0.keys().copied().filter(|n| !differs(n)).collect();
        Ok(restored)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_back_and_only_what_differs_is_told() {
        let text = "; my laser\n$0=10\n$30=1000.000 (rpm max)\n$32=1\n$74=home\n$75=********\n";
        let file = Settings::parse("a.txt", text).unwrap();
        assert_eq!(file.len(), 5);
        let again = file.to_text("head\nmore");
        assert!(again.starts_with("; head\n; more\n$0=10\n$30=1000.000\n"));
        assert_eq!(Settings::parse("b.txt", &again).unwrap(), file);
        let mut other = file.clone();
        other.0.insert(30, "1000".into());
        other.0.insert(75, "secret".into());
        assert_eq!(other.differences(&file), []);
        other.0.insert(32, "0".into());
        other.0.remove(&0);
        other.0.insert(110, "500".into());
        let numbers: Vec<u32> = other.differences(&file).iter().map(|d| d.number).collect();
        assert_eq!(numbers, [0, 32, 110]);
        for (text, line) in [
            ("$0=10\nhello", 2),
            ("$0=10\n\n$0=11", 3),
            ("", 1),
            ("$x=1", 1),
            ("$0=", 1),
            ("$0=1\u{7}", 1),
            ("$74=ä", 1),
        ] {
            assert_eq!(
                Settings::parse("f", text).unwrap_err().line,
                line,
                "{text:?}"
            );
        }
    }
}
