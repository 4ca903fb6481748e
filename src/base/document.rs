//! TOML that a person wrote: read strictly, and blamed exactly.
//!
//! A [`Document`] keeps the text beside the name that the person knows it by. A value is deserialised from it (unknown
//! keys are errors), then checked; a failed check names the *key* it is about, and the document finds the line.

use std::fmt;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

/// A check that a value did not pass: which key, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key}: {problem}")]
pub struct Complaint {
    /// The key, as a path: `bed.width_mm`, `cut[1].passes`. Lists count from 0.
    pub key: String,
    /// What is wrong, with the value, and what would be right.
    pub problem: String,
}

impl Complaint {
    /// A complaint about `key`.
    pub fn new(key: impl Into<String>, problem: impl Into<String>) -> Self {
        Self {
            key: key.into(),
            problem: problem.into(),
        }
    }
}

/// A number with its allowed range, both ends included. NaN and infinities are outside every range.
///
/// # Errors
/// [`Complaint`] with the value and the range.
pub fn ranged(key: &str, value: f64, low: f64, high: f64) -> Result<(), Complaint> {
    if value >= low && value <= high {
        return Ok(());
    }
    let what = if value.is_finite() {
        format!("is {value}, which is not between {low} and {high}")
    } else {
        format!("is {value}; a plain number between {low} and {high} is needed")
    };
    Err(Complaint::new(key, what))
}

/// A TOML text with the name that messages use for it.
#[derive(Clone, Debug)]
pub struct Document {
    name: String,
    text: String,
}

/// What is wrong with a document, and where. `Display` draws the line with the place underlined, without colour.
#[derive(Clone, Debug, PartialEq)]
pub struct DocumentError {
    /// The file, as messages name it.
    pub file: String,
    /// Line, counted from 1; `None` if the error is about the whole.
    pub line: Option<usize>,
    /// The key, where one is known.
    pub key: Option<String>,
    /// What is wrong.
    pub problem: String,
    drawing: String,
}

impl fmt::Display for DocumentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.drawing)
    }
}

impl std::error::Error for DocumentError {}

impl Document {
    /// A text under the name that messages use: its path, or `NAME (shipped)`.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
        }
    }

    /// Deserialises and checks. `validate` gets the value and gives every complaint it has; the first is reported.
    ///
    /// # Errors
    /// [`DocumentError`] for text that is not TOML, unknown or missing keys, wrong types, and failed checks.
    pub fn read<T: DeserializeOwned>(
        &self,
        validate: impl FnOnce(&T) -> Result<(), Complaint>,
    ) -> Result<T, DocumentError> {
        let value: T = toml::from_str(&self.text)
            .map_err(|e| self.blame(None, e.message().to_owned(), e.span()))?;
        validate(&value).map_err(|c| self.complain(c))?;
        Ok(value)
    }

    /// Finds the place of a complaint in the text.
    pub fn complain(&self, complaint: Complaint) -> DocumentError {
        let span = self.span_of(&complaint.key);
        let problem = format!("{} {}", complaint.key, complaint.problem);
        self.blame(Some(complaint.key), problem, span)
    }

    /// The bytes of the value at a key path; of the nearest table around it if the key itself is absent.
    fn span_of(&self, path: &str) -> Option<Range<usize>> {
        let root = DeTable::parse(&self.text).ok()?;
        let mut found: Option<Range<usize>> = None;
        let mut here: Option<&DeValue<'_>> = None;
        for part in path.split(['.', '[']) {
            let next = match part.strip_suffix(']') {
                Some(number) => here
                    .and_then(DeValue::as_array)
                    .and_then(|a| a.get(number.parse::<usize>().ok()?)),
                None => match here {
                    Some(value) => value.as_table().and_then(|t| t.get(part)),
                    None if found.is_none() => root.get_ref().get(part),
                    None => None,
                },
            };
            let Some(next) = next else { break };
            found = Some(next.span());
            here = Some(next.get_ref());
        }
        found
    }

    /// The error of a problem at some bytes of the text.
    pub(crate) fn blame(
        &self,
        key: Option<String>,
        problem: String,
        span: Option<Range<usize>>,
    ) -> DocumentError {
        let problem = problem.trim_end().replace('\n', "; ");
        let span = span.map(|s| {
            let end = s.end.min(self.text.len());
            s.start.min(end)..end
        });
        let line = span.as_ref().map(|s| {
            self.text.as_bytes()[..s.start]
                .iter()
                .filter(|b| **b == b'\n')
                .count()
                + 1
        });
        let drawing = match span {
            Some(span) => {
                let report = &[Level::ERROR.primary_title(problem.as_str()).element(
                    Snippet::source(self.text.as_str())
                        .path(self.name.as_str())
                        .annotation(AnnotationKind::Primary.span(span)),
                )];
                let drawn = Renderer::plain().render(report).to_string();
                // The program says "error:" itself, as for every other error.
                drawn.strip_prefix("error: ").unwrap_or(&drawn).to_owned()
            }
            None => format!("{}: {problem}", self.name),
        };
        DocumentError {
            file: self.name.clone(),
            line,
            key,
            problem,
            drawing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Toy {
        size_mm: f64,
        #[serde(default)]
        list: Vec<Inner>,
    }

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Inner {
        n: f64,
    }

    fn read(text: &str) -> Result<Toy, DocumentError> {
        Document::new("toy.toml", text).read(|toy: &Toy| {
            ranged("size_mm", toy.size_mm, 0.0, 10.0)?;
            for (i, inner) in toy.list.iter().enumerate() {
                ranged(&format!("list[{i}].n"), inner.n, 0.0, 1.0)?;
            }
            Ok(())
        })
    }

    #[test]
    fn every_error_carries_file_and_line() {
        for (text, line, word) in [
            ("size_mm = 1\nsize_in = 2\n", 2, "size_in"),
            ("size_mm = \"1\"\n", 1, "invalid type"),
            ("# size\nsize_mm = nan\n", 2, "plain number"),
            ("size_mm = inf\n", 1, "plain number"),
            ("size_mm = 11\n", 1, "not between 0 and 10"),
            (
                "size_mm = 1\n[[list]]\nn = 0\n[[list]]\nn = 2\n",
                5,
                "list[1].n",
            ),
            ("size_mm = 1\n[[list]]\nn = 0\nm = 0\n", 4, "unknown field"),
            ("size_mm = = 1\n", 1, ""),
        ] {
            let error = read(text).unwrap_err();
            assert_eq!(error.line, Some(line), "{text}\n{error}");
            let shown = error.to_string();
            assert!(shown.contains(&format!("toy.toml:{line}")), "{shown}");
            assert!(shown.contains(word), "{shown}");
            assert!(!shown.contains('\u{1b}'), "no colour in a plain text");
        }
        assert!(read("size_mm = 1\n").is_ok());
        assert!(read("").unwrap_err().to_string().contains("size_mm"));
    }
}
