//! What `machines` and `materials` have in common, and where a person's own profiles are: the library never looks for
//! that by itself.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::base::catalog::CatalogError;
use crate::base::progress::Progress as _;
use crate::machine::{self, Machine};
use crate::material::{self, Fit, Material};

/// A profile that is checked: one that is wrong is an answer, not bad input.
pub(super) fn checked<T>(loaded: Result<T, CatalogError>) -> Result<T, Failure> {
    loaded.map_err(|error| match error {
        CatalogError::Profile(wrong) => Failure::No(wrong.to_string()),
        other => Failure::bad(other),
    })
}

/// The variable that names the folder of one's own profiles; empty for none.
const VARIABLE: &str = "KAGOME_PROFILES";

/// Whose habits decide where a configuration belongs.
#[derive(Clone, Copy)]
enum Platform {
    Unix,
    MacOs,
    Windows,
}

/// The folder of a person's own profiles, with `machines` and `profiles` in it; it need not be there.
pub(super) fn own_folder() -> Option<PathBuf> {
    let platform = if cfg!(windows) {
        Platform::Windows
    } else if cfg!(target_os = "macos") {
        Platform::MacOs
    } else {
        Platform::Unix
    };
    own_folder_of(platform, |name| std::env::var_os(name))
}

fn own_folder_of(
    platform: Platform,
    variable: impl Fn(&str) -> Option<OsString>,
) -> Option<PathBuf> {
    if let Some(folder) = variable(VARIABLE) {
        return (!folder.is_empty()).then(|| folder.into());
    }
    // A relative path would mean another folder in every folder.
    let absolute = |name: &str| {
        variable(name)
            .map(PathBuf::from)
            .filter(|p| p.is_absolute())
    };
    let configuration = match platform {
        Platform::Unix => {
            absolute("XDG_CONFIG_HOME").or_else(|| Some(absolute("HOME")?.join(".config")))
        }
        Platform::MacOs => absolute("HOME").map(|h| h.join("Library/Application Support")),
        Platform::Windows => absolute("APPDATA"),
    };
    Some(configuration?.join("kagome"))
}

/// What `machine::load` takes for `--machine`.
pub(super) fn machine_named(name: &str) -> Result<String, CatalogError> {
    machine::resolve(name, own_folder().as_deref())
}

/// What `material::load` takes for `--material`.
pub(super) fn material_named(name: &str) -> Result<String, CatalogError> {
    material::resolve(name, own_folder().as_deref())
}

/// A profile in a list.
pub(super) struct Listed<T> {
    /// The name that finds it.
    pub name: String,
    /// Its file, if it is a person's own.
    pub file: Option<String>,
    /// The profile, or what is wrong with it in one line.
    pub profile: Result<T, String>,
}

/// All profiles of a kind: one's own, then those shipped ones that none of them hides. `own` are names with files.
pub(super) fn listed<T>(
    shipped: impl Iterator<Item = &'static str>,
    own: Vec<(String, PathBuf)>,
    find: impl Fn(&str) -> Result<T, CatalogError>,
    load: impl Fn(&str) -> Result<T, CatalogError>,
) -> Result<Vec<Listed<T>>, Failure> {
    let mut all = Vec::with_capacity(own.len() + shipped.size_hint().0);
    for (name, file) in own {
        let file = file.display().to_string();
        let profile = find(&name).map_err(|error| match error {
            CatalogError::Profile(wrong) => match wrong.line {
                Some(line) => format!("{} ({file}, line {line})", wrong.problem),
                None => format!("{} ({file})", wrong.problem),
            },
            other => other.to_string(),
        });
        all.push(Listed {
            name,
            file: Some(file),
            profile,
        });
    }
    let yours = all.len();
    for name in shipped {
        if all[..yours].iter().all(|own| own.name != name) {
            all.push(Listed {
                name: name.to_owned(),
                file: None,
                profile: Ok(load(name).map_err(Failure::bad)?),
            });
        }
    }
    Ok(all)
}

impl<T: serde::Serialize> Listed<T> {
    /// Where it comes from, in one word.
    pub fn from(&self) -> &'static str {
        match self.file {
            Some(_) => "yours",
            None => "shipped",
        }
    }

    /// The profile with `from` and `file` beside its own keys; one that is wrong is its name and an `error`.
    pub fn value(&self) -> Result<Value, Failure> {
        match &self.profile {
            Ok(profile) => with_origin(profile, self.from(), self.file.as_deref()),
            Err(error) => Ok(serde_json::json!({
                "name": self.name, "from": self.from(), "file": self.file, "error": error,
            })),
        }
    }
}

/// A profile as JSON, with where it comes from beside its own keys.
pub(super) fn with_origin(
    profile: &impl serde::Serialize,
    from: &str,
    file: Option<&str>,
) -> Result<Value, Failure> {
    let mut value = serde_json::to_value(profile).map_err(Failure::bad)?;
    if let Some(keys) = value.as_object_mut() {
        keys.insert("from".into(), from.into());
        if let Some(file) = file {
            keys.insert("file".into(), file.into());
        }
    }
    Ok(value)
}

/// Shows the profile that `asked` led to `found`: the text of one that has a name, with the path of one's own over it,
/// and a summary of a file.
pub(super) fn show<T: serde::Serialize>(
    profile: &T,
    asked: &str,
    found: &str,
    shipped: Option<&str>,
    summary: impl Fn(&T) -> String,
    global: &Global,
) -> Result<(), Failure> {
    let own = asked != found;
    if global.json {
        let (from, file) = match (own, shipped) {
            (true, _) => ("yours", Some(found)),
            (false, Some(_)) => ("shipped", None),
            (false, None) => ("file", Some(found)),
        };
        return print(&format!("{:#}", with_origin(profile, from, file)?));
    }
    if own {
        let text = std::fs::read_to_string(found)
            .map_err(|e| Failure::Bad(format!("{found} cannot be read: {e}")))?;
        return print(&format!("# {found}\n{}", text.trim_end()));
    }
    match shipped {
        Some(text) => print(text.trim_end()),
        None => print(&summary(profile)),
    }
}

/// Where `new` writes.
pub(super) enum Place<'a> {
    /// To this file, else to `NAME.toml` here.
    File(Option<&'a Path>),
    /// Into the person's own folder; the function knows which file of it is meant.
    Own(fn(&Path, &str) -> Option<PathBuf>),
}

/// Writes a starting profile; `option` is the one that takes its name.
pub(super) fn write_new(
    text: &str,
    name: &str,
    option: &str,
    place: &Place<'_>,
    force: bool,
    global: &Global,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let (path, more) = match place {
        Place::File(Some(path)) => (path.to_path_buf(), String::new()),
        Place::File(None) => (
            PathBuf::from(format!("{name}.toml")),
            format!("; with --own it goes where {option} {name} finds it"),
        ),
        Place::Own(file) => {
            let own = own_folder().ok_or_else(|| {
                Failure::Bad(format!(
                    "there is no folder for profiles of your own: set {VARIABLE} to one"
                ))
            })?;
            let path = file(&own, name).ok_or_else(|| {
                Failure::Bad(format!(
                    "{name} would be taken for a file: choose a name without .toml"
                ))
            })?;
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).map_err(|e| {
                    Failure::Bad(format!("{} cannot be made: {e}", folder.display()))
                })?;
            }
            (path, format!("; {option} {name} finds it there"))
        }
    };
    if path.exists() && !force {
        return Err(Failure::Bad(format!(
            "{} exists already; add --force to replace it, or choose another place with -o",
            path.display()
        )));
    }
    write_file(&path, text.as_bytes()).map_err(Failure::bad)?;
    if global.json {
        return print(&format!(
            "{:#}",
            serde_json::json!({ "name": name, "file": path })
        ));
    }
    terminal.note(&format!(
        "{}: change what differs, then check it{more}",
        path.display()
    ));
    Ok(())
}

/// How one pair fits: in words, and for machines.
pub(super) fn fit(machine: &Machine, material: &Material) -> (String, serde_json::Value) {
    match material.cut_for(machine) {
        Ok(setting) => (
            "cuts it".into(),
            serde_json::json!({ "fit": Fit::Compatible, "cut": setting, "mark": material.mark_for(machine) }),
        ),
        Err(error) => (
            format!("no: {error}"),
            serde_json::json!({ "fit": Fit::from(&error), "why": error.to_string() }),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ones_own_folder_is_where_the_platform_keeps_configurations() {
        // What is absolute differs between platforms: so that the test runs on all.
        let root = if cfg!(windows) { "C:/" } else { "/" };
        let folder = |platform, variables: &[(&str, &str)]| {
            own_folder_of(platform, |name| {
                let found = variables.iter().find(|(n, _)| *n == name);
                found.map(|(_, value)| OsString::from(value.replace('~', root)))
            })
        };
        let path = |text: &str| Some(PathBuf::from(text.replace('~', root)));
        use Platform::{MacOs, Unix, Windows};
        for (platform, variables, found) in [
            (Unix, vec![("HOME", "~h")], path("~h/.config/kagome")),
            (
                Unix,
                vec![("HOME", "~h"), ("XDG_CONFIG_HOME", "~c")],
                path("~c/kagome"),
            ),
            (
                Unix,
                vec![("HOME", "~h"), ("XDG_CONFIG_HOME", "c")],
                path("~h/.config/kagome"),
            ),
            (
                MacOs,
                vec![("HOME", "~h")],
                path("~h/Library/Application Support/kagome"),
            ),
            (Windows, vec![("APPDATA", "~a")], path("~a/kagome")),
            (Unix, vec![], None),
            (Windows, vec![("HOME", "~h")], None),
            (
                Unix,
                vec![("HOME", "~h"), ("KAGOME_PROFILES", "here")],
                path("here"),
            ),
            (Unix, vec![("HOME", "~h"), ("KAGOME_PROFILES", "")], None),
        ] {
            assert_eq!(folder(platform, &variables), found, "{variables:?}");
        }
    }
}
