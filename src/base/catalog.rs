//! Profiles that ship in the binary, those in a person's own folder, and those from files: one way to name all.
//!
//! A library must not look for folders behind its caller's back: who wants a person's own profiles found hands over
//! their folder. [`Catalog::resolve`] turns a name into what [`Catalog::load`] takes; a profile of one's own becomes the
//! path of its file, so that whatever notes down what was used notes down that.

use std::path::{Path, PathBuf};

use super::document::{Complaint, Document, DocumentError};

/// The shipped profiles of one kind.
#[derive(Clone, Copy, Debug)]
pub struct Catalog {
    /// What they are, in words: `material`, `machine`.
    pub kind: &'static str,
    /// The folder of such profiles within a person's own: `profiles`, `machines`.
    pub folder: &'static str,
    /// Names with texts, in the order of the names.
    pub shipped: &'static [(&'static str, &'static str)],
}

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// Neither a name that is known nor a file.
    #[error("there is no {kind} `{name}`. {known}; or give the path of a TOML file")]
    Unknown {
        /// What kind of profile.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// The names that are known, in words.
        known: String,
    },
    /// A person's own folder is there and cannot be read.
    #[error("the folder {path} with your own {kind} profiles cannot be read: {source}")]
    Folder {
        /// What kind of profile.
        kind: &'static str,
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A person's own folder has a name that cannot be written down.
    #[error(
        "the path {path} of your own {kind} is not Unicode text: set KAGOME_PROFILES to a folder whose path is"
    )]
    Path {
        /// What kind of profile.
        kind: &'static str,
        /// The file.
        path: PathBuf,
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
                known: format!("Shipped: {}", self.names()),
            });
        }
        let text = std::fs::read_to_string(path).map_err(|source| CatalogError::Read {
            kind: self.kind,
            path: path.into(),
            source,
        })?;
        Ok(parse(name_or_path, &text)?)
    }

    /// Where a person's own profile of this name is or would be, in their folder `own`; none for what is no name.
    pub fn own_file(&self, own: &Path, name: &str) -> Option<PathBuf> {
        let is_path = Path::new(name).components().count() != 1 || name.contains(['/', '\\']);
        if is_path || name.starts_with('.') || name.ends_with(".toml") {
            return None;
        }
        Some(own.join(self.folder).join(format!("{name}.toml")))
    }

    /// The profiles in a person's own folder, by name: `NAME.toml` is NAME. None if there is no such folder.
    ///
    /// # Errors
    /// [`CatalogError::Folder`].
    pub fn own_files(&self, own: &Path) -> Result<Vec<(String, PathBuf)>, CatalogError> {
        let path = own.join(self.folder);
        let wrong = |source| CatalogError::Folder {
            kind: self.kind,
            path: path.clone(),
            source,
        };
        let entries = match std::fs::read_dir(&path) {
            Ok(entries) => entries,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(e) => return Err(wrong(e)),
        };
        let mut found = Vec::new();
        for entry in entries {
            let file = entry.map_err(wrong)?.path();
            let name = file.file_name().and_then(|n| n.to_str());
            let name = name.and_then(|n| n.strip_suffix(".toml"));
            if let Some(name) = name
                && self.own_file(own, name).is_some()
                && file.is_file()
            {
                found.push((name.to_owned(), file));
            }
        }
        found.sort();
        Ok(found)
    }

    /// What [`Catalog::load`] takes for a name or a path. A profile in a person's own folder comes before a shipped one
    /// of the same name, and becomes its path; everything else stays as it is. `check` (name of the file for messages,
    /// text) judges the file and gives the name that the profile bears.
    ///
    /// # Errors
    /// [`CatalogError`] for a name that nobody knows, and for a profile of one's own that is wrong or bears another name
    /// than its file.
    pub fn resolve(
        &self,
        name_or_path: &str,
        own: Option<&Path>,
        check: impl Fn(&str, &str) -> Result<String, DocumentError>,
    ) -> Result<String, CatalogError> {
        let Some(own) = own else {
            return Ok(name_or_path.into());
        };
        let Some(file) = self.own_file(own, name_or_path) else {
            return Ok(name_or_path.into());
        };
        if !file.is_file() {
            let shipped = self.shipped.iter().any(|(name, _)| *name == name_or_path);
            let yours = self.own_files(own)?;
            if shipped || yours.is_empty() || Path::new(name_or_path).is_file() {
                return Ok(name_or_path.into());
            }
            let yours: Vec<String> = yours.into_iter().map(|(name, _)| name).collect();
            return Err(CatalogError::Unknown {
                kind: self.kind,
                name: name_or_path.into(),
                known: format!("Yours: {}. Shipped: {}", yours.join(", "), self.names()),
            });
        }
        let Some(path) = file.to_str() else {
            return Err(CatalogError::Path {
                kind: self.kind,
                path: file,
            });
        };
        let text = std::fs::read_to_string(&file).map_err(|source| CatalogError::Read {
            kind: self.kind,
            path: file.clone(),
            source,
        })?;
        let bears = check(path, &text)?;
        if bears != name_or_path {
            let problem = format!(
                "is {bears:?}, and the file is {name_or_path}.toml: in your own folder both must agree, because the job's header bears the name; change one of them"
            );
            let wrong = Document::new(path, text).complain(Complaint::new("name", problem));
            return Err(CatalogError::Profile(wrong));
        }
        Ok(path.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CATALOG: Catalog = Catalog {
        kind: "toy",
        folder: "toys",
        shipped: &[("ball", "ball"), ("kite", "kite")],
    };

    /// A toy's text is its name.
    fn check(file: &str, text: &str) -> Result<String, DocumentError> {
        match text {
            "broken" => Err(Document::new(file, text).complain(Complaint::new("toy", "is broken"))),
            name => Ok(name.to_owned()),
        }
    }

    #[test]
    fn ones_own_comes_first_and_only_what_is_asked_for_by_name_is_judged() {
        let own = tempfile::tempdir().unwrap();
        let toys = own.path().join("toys");
        let resolve = |name: &str| CATALOG.resolve(name, Some(own.path()), check);
        assert_eq!(resolve("ball").unwrap(), "ball");
        // A folder that is not there holds nothing; what is unknown is left to `load`.
        assert_eq!(CATALOG.own_files(own.path()).unwrap(), []);
        assert_eq!(resolve("drum").unwrap(), "drum");
        std::fs::create_dir(&toys).unwrap();
        for (name, text) in [
            ("ball.toml", "ball"),
            ("drum.toml", "drum"),
            ("old.toml", "broken"),
            ("horn.toml", "trumpet"),
            ("notes.txt", "drum"),
            (".hidden.toml", "drum"),
        ] {
            std::fs::write(toys.join(name), text).unwrap();
        }
        std::fs::create_dir(toys.join("box.toml")).unwrap();
        let path = |name: &str| toys.join(name).to_str().unwrap().to_owned();
        for (name, found) in [
            ("ball", path("ball.toml")),
            ("drum", path("drum.toml")),
            ("kite", "kite".into()),
            ("drum.toml", "drum.toml".into()),
            ("./drum", "./drum".into()),
            ("../toys/drum", "../toys/drum".into()),
        ] {
            assert_eq!(resolve(name).unwrap(), found);
            assert_eq!(CATALOG.resolve(name, None, check).unwrap(), name);
        }
        let names: Vec<String> = CATALOG
            .own_files(own.path())
            .unwrap()
            .into_iter()
            .map(|(name, _)| name)
            .collect();
        assert_eq!(names, ["ball", "drum", "horn", "old"]);
        let wrong = |name: &str| resolve(name).unwrap_err().to_string();
        assert!(wrong("old").contains("is broken"), "{}", wrong("old"));
        assert!(wrong("horn").contains("trumpet") && wrong("horn").contains("horn.toml"));
        assert!(wrong("flute").contains("Yours: ball, drum, horn, old. Shipped: ball, kite"));
    }
}
