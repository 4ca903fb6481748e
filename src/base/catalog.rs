//! Profiles that ship in the binary, and profiles from files: one way to name both.

use std::path::{Path, PathBuf};

use super::document::DocumentError;

/// The shipped profiles of one kind.
#[derive(Clone, Copy, Debug)]
pub struct Catalog {
    /// What they are, in words: `material`, `machine`.
    pub kind: &'static str,
    /// Names with texts, in the order of the names.
    pub shipped: &'static [(&'static str, &'static str)],
}

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// Neither a shipped name nor a file.
    #[error("there is no {kind} `{name}`. Shipped: {known}; or give the path of a TOML file")]
    Unknown {
        /// What kind of profile.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// The names of the shipped ones.
        known: String,
    },
    /// The file cannot be read.
    #[error("{kind} file {path} cannot be read: {source}")]
    Read {
        /// What kind of profile.
        kind: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The profile is wrong.
    #[error(transparent)]
    Profile(#[from] DocumentError),
}

impl Catalog {
    /// The names of the shipped profiles, with commas between them.
    pub fn names(&self) -> String {
        self.shipped
            .iter()
            .map(|(name, _)| *name)
            .collect::<Vec<_>>()
            .join(", ")
    }

    /// A shipped profile by its name, or one from a file by its path, as `parse` (name for messages, text) reads it.
    /// A shipped name wins; `./NAME` means the file.
    ///
    /// # Errors
    /// [`CatalogError`]: unknown name (with the known ones), unreadable file, or what `parse` says.
    pub fn load<T>(
        &self,
        name_or_path: &str,
        parse: impl Fn(&str, &str) -> Result<T, DocumentError>,
    ) -> Result<T, CatalogError> {
        if let Some((name, text)) = self.shipped.iter().find(|(name, _)| *name == name_or_path) {
            return Ok(parse(&format!("{name} (shipped)"), text)?);
        }
        let path = Path::new(name_or_path);
        let looks_like_a_file =
            path.extension().is_some_and(|e| e == "toml") || path.components().count() > 1;
        if !looks_like_a_file && !path.is_file() {
            return Err(CatalogError::Unknown {
                kind: self.kind,
                name: name_or_path.into(),
                known: self.names(),
            });
        }
        let text = std::fs::read_to_string(path).map_err(|source| CatalogError::Read {
            kind: self.kind,
            path: path.into(),
            source,
        })?;
        Ok(parse(name_or_path, &text)?)
    }
}
