//! What `machines` and `materials` have in common.

use std::path::{Path, PathBuf};

use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::base::catalog::CatalogError;
use crate::base::progress::Progress as _;
use crate::machine::Machine;
use crate::material::{Fit, Material};

/// A profile that is checked: one that is wrong is an answer, not bad input.
pub(super) fn checked<T>(loaded: Result<T, CatalogError>) -> Result<T, Failure> {
    loaded.map_err(|error| match error {
        CatalogError::Profile(wrong) => Failure::No(wrong.to_string()),
        other => Failure::bad(other),
    })
}

/// Writes a starting profile to `output`, else to `NAME.toml`.
pub(super) fn write_new(
    text: &str,
    name: &str,
    output: Option<&Path>,
    force: bool,
    global: &Global,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let path = output.map_or_else(|| PathBuf::from(format!("{name}.toml")), Path::to_path_buf);
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
        "{}: change what differs, then check it",
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
