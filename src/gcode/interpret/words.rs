//! A line taken apart.

use super::Dialect;

/// Larger numbers than any machine's, and far from where arithmetic fails: ten kilometres.
const LARGEST_NUMBER: f64 = 1e7;

/// What stands behind a letter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value {
    /// A number.
    Number(f64),
    /// LinuxCNC: the feed of the material that QtPlasmaC has loaded.
    MaterialFeed,
}

/// A letter with what stands behind it; `$` is a letter in LinuxCNC.
pub(super) type Word = (char, Value);

/// A line: its words, and a remark that QtPlasmaC reads as a material.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Line<'a> {
    pub words: Vec<Word>,
    /// The inside of `(o=…)`, where the line begins with it.
    pub material: Option<&'a str>,
    /// A line that holds only `%`.
    pub percent: bool,
}

/// How QtPlasmaC's feed is written.
const MATERIAL_FEED: &str = "#<_hal[plasmac.cut-feed-rate]>";

/// Letters with their numbers; comments and blanks dropped.
pub(super) fn line(raw: &str, dialect: Dialect) -> Result<Line<'_>, String> {
    let mut line = Line::default();
    let mut rest = raw.trim();
    if rest == "%" {
        line.percent = true;
        return Ok(line);
    }
    if rest.starts_with('$') {
        return Err(format!(
            "`{rest}` is a command to the controller, not G-code: a job must not change settings"
        ));
    }
    loop {
        rest = rest.trim_start();
        let Some(letter) = rest.chars().next() else {
            return Ok(line);
        };
        match letter {
            ';' => return Ok(line),
            '(' => match rest.find(')') {
                Some(end) => {
                    let inside = &rest[1..end];
                    if line.words.is_empty() && inside.starts_with("o=") {
                        line.material = Some(inside);
                    }
                    rest = &rest[end + 1..];
                }
                None => return Err("a comment is opened with ( and never closed".into()),
            },
            'A'..='Z' | 'a'..='z' | '$' if letter != '$' || dialect.is_linuxcnc() => {
                let body = rest[1..].trim_start();
                let upper = letter.to_ascii_uppercase();
                if dialect == Dialect::QtPlasmaC
                    && upper == 'F'
                    && let Some(after) = body.strip_prefix(MATERIAL_FEED)
                {
                    line.words.push((upper, Value::MaterialFeed));
                    rest = after;
                    continue;
                }
                if dialect.is_linuxcnc() && body.starts_with(['#', '[']) {
                    return Err(format!(
                        "`{letter}{body}`: the value of a parameter or an expression is not known here, so what it does cannot be checked"
                    ));
                }
                let end = body
                    .find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)))
                    .unwrap_or(body.len());
                let number = &body[..end];
                let value = number.parse::<f64>().map_err(|_| {
                    format!("`{letter}{number}` is no word: a letter needs a number")
                })?;
                if value.is_nan() || value.abs() > LARGEST_NUMBER {
                    return Err(format!("`{letter}{number}` is no number for a machine"));
                }
                line.words.push((upper, Value::Number(value)));
                rest = &body[end..];
            }
            other => return Err(format!("the character {other:?} has no meaning in G-code")),
        }
    }
}

/// The cut speed in QtPlasmaC's words for a material, `o=0, …, fr=2600, …`.
///
/// # Errors
/// What QtPlasmaC would refuse.
pub(super) fn material_feed(inside: &str) -> Result<f64, String> {
    let value = |key: &str| {
        inside.split(',').find_map(|item| {
            let (k, v) = item.split_once('=')?;
            (k.trim() == key).then(|| v.trim())
        })
    };
    let number = |key: &str| -> Result<f64, String> {
        let text = value(key).ok_or_else(|| {
            format!("a material without {key}: QtPlasmaC needs ph, pd, ch and fr")
        })?;
        match text.parse::<f64>() {
            Ok(v) if (0.0..LARGEST_NUMBER).contains(&v) => Ok(v),
            _ => Err(format!(
                "a material with {key}={text}, which is no number for a machine"
            )),
        }
    };
    if value("o") != Some("0") {
        return Err("a material that is written into the table's file: a job may only bring a temporary one (o=0)".into());
    }
    for key in ["ph", "pd", "ch"] {
        number(key)?;
    }
    number("fr")
}
