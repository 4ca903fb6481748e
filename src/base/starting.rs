//! A profile of one's own, made from a shipped one: the same text under another name, with a line of explanation over
//! every key.

use super::catalog::Catalog;
use super::document::DocumentError;

/// Why there is no starting profile.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StartError {
    /// A name that no profile may have.
    #[error("the name {0}")]
    Name(String),
    /// The name of a shipped profile.
    #[error(
        "`{name}` is the name of a shipped {kind}, and one of the two would be hidden: choose another name"
    )]
    Taken {
        /// What kind of profile.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// There is no such shipped profile.
    #[error("there is no shipped {kind} `{name}` to start from. Shipped: {known}")]
    Unknown {
        /// What kind of profile.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// The shipped ones.
        known: String,
    },
    /// A file of settings without one that a profile could use.
    #[error(
        "there is none of the settings $11, $30, $110 to $131 in the file: save what the controller answers to $$"
    )]
    NoSettings,
    /// What was put into the shipped profile makes it wrong.
    #[error("the profile would be wrong: {0}")]
    Invalid(#[from] DocumentError),
}

/// The shipped profile `from` under the name `name`, which the caller has checked.
///
/// # Errors
/// [`StartError`]: the name is a shipped one's, or `from` is none.
pub fn renamed(catalog: &Catalog, name: &str, from: &str) -> Result<String, StartError> {
    let find = |wanted: &str| catalog.shipped.iter().find(|(n, _)| *n == wanted);
    if find(name).is_some() {
        return Err(StartError::Taken {
            kind: catalog.kind,
            name: name.into(),
        });
    }
    match find(from) {
        Some((_, text)) => Ok(set(text, "", "name", &format!("\"{name}\""))),
        None => Err(StartError::Unknown {
            kind: catalog.kind,
            name: from.into(),
            known: catalog.names(),
        }),
    }
}

/// The table that a line opens, `[a.b]` or `[[a]]`.
fn header(line: &str) -> Option<&str> {
    let inner = line.trim().strip_prefix('[')?;
    let inner = inner.strip_prefix('[').unwrap_or(inner);
    Some(inner.trim_end_matches(']').trim())
}

/// The key that a line sets, outside of lists over several lines.
fn key(line: &str) -> Option<&str> {
    let (key, _) = line.split_once('=')?;
    let key = key.trim();
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    (!line.starts_with(' ') && !key.is_empty() && key.chars().all(plain)).then_some(key)
}

/// The text with `# explanation` over each key that `explain` knows, by table (empty at the top) and key. A key that
/// stands in several tables of one name is explained once; the key is empty for the table itself.
pub fn annotated<'a>(text: &str, explain: impl Fn(&str, &str) -> Option<&'a str>) -> String {
    let mut out = String::with_capacity(2 * text.len());
    let mut table = String::new();
    let mut done = std::collections::BTreeSet::new();
    for line in text.lines() {
        let opened = header(line);
        if let Some(name) = opened {
            table = name.to_owned();
        }
        let key = if opened.is_some() {
            Some("")
        } else {
            key(line)
        };
        if let Some(key) = key
            && let Some(words) = explain(&table, key)
            && done.insert((table.clone(), key.to_owned()))
        {
            out.push_str("# ");
            out.push_str(words);
            out.push('\n');
        }
        out.push_str(line);
        out.push('\n');
    }
    out
}

/// Sets a key of the first table with this name (empty: the top). Without effect where the key does not stand.
pub fn set(text: &str, table: &str, wanted: &str, value: &str) -> String {
    let mut out = String::with_capacity(text.len() + value.len());
    let (mut here, mut done) = (String::new(), false);
    for line in text.lines() {
        if let Some(name) = header(line) {
            here = name.to_owned();
        }
        if !done && here == table && header(line).is_none() && key(line) == Some(wanted) {
            out.push_str(&format!("{wanted} = {value}\n"));
            done = true;
        } else {
            out.push_str(line);
            out.push('\n');
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "a = 1\n\n[t]\na = 2\nlist = [\n    \"a = 3\",\n]\n[[u]]\nb = 1\n[[u]]\nb = 2\n";

    #[test]
    fn each_key_is_explained_once_and_nothing_else_changes() {
        let text = annotated(TEXT, |table, key| match (table, key) {
            ("", "a") => Some("top"),
            ("t", "a") => Some("inner"),
            ("u", "") => Some("table"),
            ("u", "b") => Some("b"),
            _ => None,
        });
        let comments: Vec<&str> = text.lines().filter(|l| l.starts_with('#')).collect();
        assert_eq!(comments, ["# top", "# inner", "# table", "# b"]);
        let kept: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
        assert_eq!(kept, TEXT.lines().collect::<Vec<_>>());
    }

    #[test]
    fn a_key_is_set_in_its_own_table() {
        assert_eq!(set(TEXT, "t", "a", "9"), TEXT.replace("a = 2", "a = 9"));
        assert_eq!(set(TEXT, "u", "b", "9"), TEXT.replace("b = 1", "b = 9"));
        assert_eq!(set(TEXT, "", "a", "9"), TEXT.replacen("a = 1", "a = 9", 1));
        assert_eq!(set(TEXT, "t", "missing", "9"), TEXT);
    }
}
