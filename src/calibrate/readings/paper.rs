//! The maker's own file, CSV or TOML: cells with their places, not yet compared with a coupon.

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use super::words;
use crate::base::document::{Document, DocumentError};
use crate::material::Failure;

/// The columns, in the order of the template.
pub(super) const COLUMNS: [&str; 7] = [
    "name",
    "held",
    "tore",
    "failure",
    "measured_mm",
    "cut_through",
    "date",
];

/// The comment of the template that says for which coupon it is.
pub(super) const COUPON: &str = "# coupon: ";

/// One row.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    pub name: Spanned<String>,
    pub held: Option<Spanned<f64>>,
    pub tore: Option<Spanned<f64>>,
    pub failure: Option<Spanned<Failure>>,
    pub measured_mm: Option<Spanned<f64>>,
    pub cut_through: Option<Spanned<bool>>,
    pub date: Option<Spanned<String>>,
}

impl Row {
    /// Where a column of it stands; its name if the column is empty.
    pub fn span(&self, column: &str) -> Range<usize> {
        let span = match column {
            "held" => self.held.as_ref().map(Spanned::span),
            "tore" => self.tore.as_ref().map(Spanned::span),
            "failure" => self.failure.as_ref().map(Spanned::span),
            "measured_mm" => self.measured_mm.as_ref().map(Spanned::span),
            "cut_through" => self.cut_through.as_ref().map(Spanned::span),
            "date" => self.date.as_ref().map(Spanned::span),
            _ => None,
        };
        span.unwrap_or_else(|| self.name.span())
    }

    /// The columns that are filled in beside name and date.
    pub fn filled(&self) -> impl Iterator<Item = &'static str> {
        [
            ("held", self.held.is_some()),
            ("tore", self.tore.is_some()),
            ("failure", self.failure.is_some()),
            ("measured_mm", self.measured_mm.is_some()),
            ("cut_through", self.cut_through.is_some()),
        ]
        .into_iter()
        .filter_map(|(column, filled)| filled.then_some(column))
    }
}

/// What a maker wrote down.
#[derive(Debug)]
pub(super) struct Paper {
    pub document: Document,
    /// Material and machine of the coupon, where the file names them.
    pub coupon: Option<Spanned<(String, String)>>,
    pub date: Option<Spanned<String>>,
    pub rows: Vec<Row>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    material: Option<Spanned<String>>,
    machine: Option<Spanned<String>>,
    date: Option<Spanned<String>>,
    #[serde(default)]
    strip: Vec<Row>,
    #[serde(default)]
    kerf: Vec<Row>,
    #[serde(default)]
    setting: Vec<Row>,
}

impl Paper {
    /// Reads a file; TOML if its name ends so, else CSV.
    pub fn read(file: &str, text: &str) -> Result<Self, DocumentError> {
        // Spreadsheets begin their files with a mark of byte order.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if file.to_lowercase().ends_with(".toml") {
            Self::toml(file, text)
        } else {
            Self::csv(file, text)
        }
    }

    fn toml(file: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::new(file, text);
        let read: File = document.read(|_| Ok(()))?;
        let coupon = read.material.map(|material| {
            let span = material.span();
            let machine = read.machine.map(Spanned::into_inner).unwrap_or_default();
            Spanned::new(span, (material.into_inner(), machine))
        });
        let rows = read.strip.into_iter().chain(read.kerf).chain(read.setting);
        Ok(Self {
            document,
            coupon,
            date: read.date,
            rows: rows.collect(),
        })
    }

    fn csv(file: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::new(file, text);
        let mut paper = Self {
            document,
            coupon: None,
            date: None,
            rows: Vec::new(),
        };
        let mut table: Option<Table> = None;
        let mut start = 0;
        for line in text.split_inclusive('\n') {
            let span = start..start + line.trim_end().len();
            start += line.len();
            let bare = line.trim().trim_start_matches('"');
            if bare.starts_with('#') {
                if let Some((material, machine)) = bare
                    .strip_prefix(COUPON)
                    .and_then(|rest| rest.split_once(" on "))
                {
                    let machine = machine.trim_end_matches([' ', '"', ',', ';', '\t']);
                    paper.coupon = Some(Spanned::new(
                        span,
                        (material.trim().to_owned(), machine.to_owned()),
                    ));
                }
                continue;
            }
            // Spreadsheets write empty lines with all their separators.
            if line
                .trim_matches([' ', ',', ';', '\t', '\r', '\n'])
                .is_empty()
            {
                continue;
            }
            match &table {
                None => table = Some(Table::head(&paper.document, text, span)?),
                Some(table) => paper.rows.extend(table.row(&paper.document, text, span)?),
            }
        }
        if table.is_none() {
            return Err(paper.document.blame(
                None,
                format!(
                    "has no header: its first line names the columns, {}",
                    COLUMNS[..6].join(",")
                ),
                None,
            ));
        }
        Ok(paper)
    }
}

/// How a CSV file is laid out.
struct Table {
    separator: char,
    columns: Vec<&'static str>,
}

type Cell = Spanned<String>;

impl Table {
    fn head(document: &Document, text: &str, line: Range<usize>) -> Result<Self, DocumentError> {
        let own = &text[line.clone()];
        // A decimal comma is never in a header.
        let separator = ['\t', ';', ',']
            .into_iter()
            .find(|c| own.contains(*c))
            .unwrap_or(',');
        let mut columns: Vec<&'static str> = Vec::new();
        for cell in cells(document, text, line.clone(), separator)? {
            let name = cell.get_ref().to_lowercase();
            // Behind the last separator.
            if name.is_empty() {
                columns.push("");
                continue;
            }
            let Some(known) = COLUMNS.into_iter().find(|c| *c == name) else {
                return Err(document.blame(
                    Some(name.clone()),
                    format!(
                        "column {name:?} is not known: the columns are {}",
                        COLUMNS.join(", ")
                    ),
                    Some(cell.span()),
                ));
            };
            if columns.contains(&known) {
                return Err(document.blame(
                    Some(name),
                    format!("column {known} stands twice"),
                    Some(cell.span()),
                ));
            }
            columns.push(known);
        }
        let has = |column: &str| columns.contains(&column);
        let strips = ["held", "tore", "failure"];
        let some = strips.into_iter().any(has);
        let missing = if !has("name") {
            Some("name")
        } else if some {
            strips.into_iter().find(|c| !has(c))
        } else if !has("measured_mm") && !has("cut_through") {
            Some("held")
        } else {
            None
        };
        match missing {
            Some(column) => Err(document.blame(
                Some(column.into()),
                format!(
                    "column {column} is missing: the first line names the columns, {}",
                    COLUMNS[..6].join(",")
                ),
                Some(line),
            )),
            None => Ok(Self { separator, columns }),
        }
    }

    /// A line; none if all of its cells are empty quotes.
    fn row(
        &self,
        document: &Document,
        text: &str,
        line: Range<usize>,
    ) -> Result<Option<Row>, DocumentError> {
        let all = cells(document, text, line.clone(), self.separator)?;
        if all.iter().all(|c| c.get_ref().is_empty()) {
            return Ok(None);
        }
        if let Some(more) = all.get(self.columns.len()) {
            let why = if self.separator == ',' {
                ": with decimal commas, separate the columns by semicolons"
            } else {
                ""
            };
            return Err(document.blame(
                None,
                format!(
                    "the line has more columns than the header, {}{why}",
                    self.columns.len()
                ),
                Some(more.span()),
            ));
        }
        let cell = |column: &str| -> Option<&Cell> {
            let place = self.columns.iter().position(|c| *c == column)?;
            all.get(place).filter(|c| !c.get_ref().is_empty())
        };
        let Some(name) = cell("name") else {
            return Err(document.blame(
                Some("name".into()),
                "the line has no name: what was measured?".into(),
                Some(line),
            ));
        };
        let blame = |column: &str, cell: &Cell, problem: String| {
            document.blame(
                Some(column.into()),
                format!("{}: {column} {problem}", name.get_ref()),
                Some(cell.span()),
            )
        };
        let number = |column: &str| read(cell(column), words::number, &blame, column);
        Ok(Some(Row {
            held: number("held")?,
            tore: number("tore")?,
            failure: read(cell("failure"), words::failure, &blame, "failure")?,
            measured_mm: number("measured_mm")?,
            cut_through: read(cell("cut_through"), words::yes, &blame, "cut_through")?,
            date: cell("date").cloned(),
            name: name.clone(),
        }))
    }
}

fn read<T>(
    cell: Option<&Cell>,
    value: impl Fn(&str) -> Result<T, String>,
    blame: &impl Fn(&str, &Cell, String) -> DocumentError,
    column: &str,
) -> Result<Option<Spanned<T>>, DocumentError> {
    let Some(cell) = cell else { return Ok(None) };
    match value(cell.get_ref()) {
        Ok(value) => Ok(Some(Spanned::new(cell.span(), value))),
        Err(problem) => Err(blame(column, cell, problem)),
    }
}

/// The cells of a line, trimmed, without their quotes.
fn cells(
    document: &Document,
    text: &str,
    line: Range<usize>,
    separator: char,
) -> Result<Vec<Cell>, DocumentError> {
    let own = &text[line.clone()];
    let mut found = Vec::new();
    let (mut value, mut from) = (String::new(), 0);
    let (mut quoted, mut closed) = (false, false);
    let mut push = |value: &mut String, from: usize, to: usize| {
        let cell = std::mem::take(value);
        let spaces = own[from..to].len() - own[from..to].trim_start().len();
        let start = line.start + from + spaces;
        let end = (line.start + from + own[from..to].trim_end().len()).max(start);
        found.push(Spanned::new(start..end, cell.trim().to_owned()));
    };
    let mut letters = own.char_indices().peekable();
    while let Some((at, c)) = letters.next() {
        if quoted {
            if c != '"' {
                value.push(c);
            } else if letters.next_if(|(_, next)| *next == '"').is_some() {
                value.push('"');
            } else {
                (quoted, closed) = (false, true);
            }
        } else if c == separator {
            push(&mut value, from, at);
            (from, closed) = (at + c.len_utf8(), false);
        } else if c == '"' && value.trim().is_empty() && !closed {
            value.clear();
            quoted = true;
        } else {
            value.push(c);
        }
    }
    if quoted {
        return Err(document.blame(
            None,
            "a quotation mark is opened and not closed on this line".into(),
            Some(line.start + from..line.end),
        ));
    }
    push(&mut value, from, own.len());
    Ok(found)
}
