//! One answer of a maker, as it was written or typed: from words to a value, or what is wrong with it.

use crate::calibrate::coupon::Strip;
use crate::material::Failure;

/// What is wrong with a row, and in which column.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wrong {
    /// The column.
    pub column: &'static str,
    /// What is wrong, beginning with a verb.
    pub problem: String,
}

impl Wrong {
    pub(super) fn new(column: &'static str, problem: impl Into<String>) -> Self {
        Self {
            column,
            problem: problem.into(),
        }
    }
}

/// A strip's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pulled {
    pub held: f64,
    pub tore: Option<f64>,
    pub failure: Option<Failure>,
}

/// A number as people write it: with a decimal point, or one decimal comma.
pub(crate) fn number(text: &str) -> Result<f64, String> {
    let text = text.trim();
    if text.ends_with('%') {
        return Err(format!(
            "is {text:?}: per cent are not understood here; a stretch that grew by 30 % is 1.3"
        ));
    }
    let points = if text.matches(',').count() == 1 && !text.contains('.') {
        text.replace(',', ".")
    } else {
        text.to_owned()
    };
    match points.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("is {text:?}, which is no number")),
    }
}

/// How a strip failed, by its first letters or as neighbours of these words.
pub(crate) fn failure(text: &str) -> Result<Failure, String> {
    match text.trim().to_lowercase().as_str() {
        "torn" | "tore" | "t" | "broken" => Ok(Failure::Torn),
        "plastic" | "p" | "bent" => Ok(Failure::Plastic),
        _ => Err(format!(
            "is {:?}: \"torn\" if a hinge tore or broke, \"plastic\" if one stayed bent",
            text.trim()
        )),
    }
}

/// Yes or no.
pub(crate) fn yes(text: &str) -> Result<bool, String> {
    match text.trim().to_lowercase().as_str() {
        "yes" | "y" | "true" | "1" => Ok(true),
        "no" | "n" | "false" | "0" => Ok(false),
        _ => Err(format!("is {:?}: \"yes\" or \"no\"", text.trim())),
    }
}

/// A stretch from 1 to 2; with words for the ways in which another unit was meant.
pub(crate) fn check_stretch(value: f64, strip: &Strip) -> Result<(), String> {
    if (1.0..=2.0).contains(&value) {
        return Ok(());
    }
    let closed = strip.gauge_mm;
    let guess = if value < 0.0 {
        "it cannot be negative".into()
    } else if value < 1.0 {
        format!(
            "if it grew by {:.0} %, write {:.3}",
            100.0 * value,
            1.0 + value
        )
    } else if (closed..=2.0 * closed).contains(&value) && !(100.0..=200.0).contains(&value) {
        format!(
            "if these are millimetres between the marks, they were {closed} closed: write {:.3}",
            value / closed
        )
    } else if value <= 100.0 {
        format!(
            "if it grew by {value} per cent, write {:.3}",
            1.0 + 0.01 * value
        )
    } else {
        format!("if these are per cent, write {:.3}", 0.01 * value)
    };
    Err(format!(
        "is {value}, and a stretch is the opened length over the closed one, 1 to 2. Units mixed up? {guess}"
    ))
}

/// A strip's row; `None` if nothing is filled in.
pub(crate) fn pulled(
    strip: &Strip,
    held: Option<f64>,
    tore: Option<f64>,
    failure: Option<Failure>,
) -> Result<Option<Pulled>, Wrong> {
    for (column, value) in [("held", held), ("tore", tore)] {
        if let Some(value) = value {
            check_stretch(value, strip).map_err(|problem| Wrong::new(column, problem))?;
        }
    }
    match (held, tore, failure) {
        (None, None, None) => Ok(None),
        (None, Some(_), _) => Err(Wrong::new(
            "held",
            "is empty: the last mark at which nothing had failed, or 1 if it failed at the first one",
        )),
        (_, None, Some(_)) => Err(Wrong::new(
            "failure",
            "is filled in and tore is not: at which mark did it fail?",
        )),
        (Some(_), Some(_), None) => Err(Wrong::new(
            "failure",
            "is empty: \"torn\" if a hinge tore or broke, \"plastic\" if one stayed bent",
        )),
        (Some(held), Some(tore), Some(_)) if tore <= held => Err(Wrong::new(
            "tore",
            format!(
                "is {tore}, and the strip is said to have held at {held}: were the two mixed up?"
            ),
        )),
        (Some(held), None, None) if held <= 1.0 => Err(Wrong::new(
            "held",
            "is 1 and nothing failed: a strip that was not pulled is no reading; leave its line empty",
        )),
        (Some(held), tore, failure) => Ok(Some(Pulled {
            held,
            tore,
            failure,
        })),
    }
}

/// What calipers say of a piece whose cuts are drawn so far apart.
pub(crate) fn check_calipers(measured_mm: f64, nominal_mm: f64) -> Result<(), String> {
    if measured_mm > 0.0 && (measured_mm - nominal_mm).abs() < 0.5 * nominal_mm {
        return Ok(());
    }
    let near = |factor: f64| (measured_mm * factor / nominal_mm - 1.0).abs() < 0.2;
    let guess = if near(10.0) {
        " These look like centimetres."
    } else if near(25.4) {
        " These look like inches."
    } else {
        ""
    };
    Err(format!(
        "is {measured_mm}, and {nominal_mm:.2} mm are drawn: calipers say about that, in millimetres. Units mixed up, or another piece?{guess}"
    ))
}
