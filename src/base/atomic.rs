//! Outputs that appear complete or not at all.
//!
//! A file is written beside its place and renamed over it; a directory is filled under another name in the same
//! parent and renamed once everything is in it. A crash, a full disk or Ctrl-C leaves what was there before.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// What went wrong with an output.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The operating system refused.
    #[error("cannot write {path}: {source}; choose a place that you may write to with -o")]
    Io {
        /// The output asked for.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Something is there already and may not be replaced.
    #[error("{path} exists already; add --force to replace it, or choose another place with -o")]
    Exists {
        /// The output asked for.
        path: PathBuf,
    },
    /// The name belongs to something that is no directory.
    #[error("{path} is there already and is not a directory; choose another place with -o")]
    NotADirectory {
        /// The directory asked for.
        path: PathBuf,
    },
    /// Replacing would delete something that this program did not make.
    #[error(
        "{path} holds {stranger}, which kagome did not write; it is not replaced, even with --force: choose another place with -o"
    )]
    NotOurs {
        /// The directory asked for.
        path: PathBuf,
        /// The first entry that is not one of ours.
        stranger: String,
    },
}

fn parent_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// Writes one file, replacing what is there.
///
/// # Errors
/// [`WriteError::Io`] with the path; the old file is then untouched.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let io = |source| WriteError::Io {
        path: path.to_path_buf(),
        source,
    };
    let mut file = tempfile::Builder::new()
        .prefix(".kagome-")
        .tempfile_in(parent_of(path))
        .map_err(io)?;
    file.write_all(bytes).map_err(io)?;
    file.as_file().sync_all().map_err(io)?;
    share(file.path()).map_err(io)?;
    file.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}

/// Temporary files are private to their maker; an output is an ordinary file.
fn share(path: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = if path.is_dir() { 0o755 } else { 0o644 };
        fs::set_permissions(path, fs::Permissions::from_mode(mode))?;
    }
    let _ = path;
    Ok(())
}

/// Checks, before any work is done, that [`write_directory`] could succeed: the parent is there and takes files,
/// and `path` is free, empty, or may be replaced.
///
/// # Errors
/// As [`write_directory`].
pub fn check_directory(path: &Path, names: &[&str], force: bool) -> Result<(), WriteError> {
    let io = |source| WriteError::Io {
        path: path.to_path_buf(),
        source,
    };
    match fs::symlink_metadata(path) {
        Ok(meta) if meta.is_dir() => {
            let mut entries = Vec::new();
            for entry in fs::read_dir(path).map_err(io)? {
                entries.push(
                    entry
                        .map_err(io)?
                        .file_name()
                        .to_string_lossy()
                        .into_owned(),
                );
            }
            entries.sort();
            if let Some(stranger) = entries.iter().find(|e| !names.contains(&e.as_str())) {
                return Err(if force {
                    WriteError::NotOurs {
                        path: path.into(),
                        stranger: stranger.clone(),
                    }
                } else {
                    WriteError::Exists { path: path.into() }
                });
            }
            if !entries.is_empty() && !force {
                return Err(WriteError::Exists { path: path.into() });
            }
        }
        Ok(_) => return Err(WriteError::NotADirectory { path: path.into() }),
        Err(_) => {}
    }
    tempfile::Builder::new()
        .prefix(".kagome-")
        .tempdir_in(parent_of(path))
        .map(drop)
        .map_err(io)
}

/// Writes a whole directory of files. It appears complete or not at all; an earlier one is replaced only with
/// `force`, and only if every entry in it has one of `names` (so that no stranger's file is ever deleted).
///
/// # Errors
/// [`WriteError`]; what was at `path` before is then still there.
pub fn write_directory(
    path: &Path,
    files: &[(&str, Vec<u8>)],
    names: &[&str],
    force: bool,
) -> Result<(), WriteError> {
    let io = |source| WriteError::Io {
        path: path.to_path_buf(),
        source,
    };
    check_directory(path, names, force)?;
    let parent = parent_of(path);
    let staged = tempfile::Builder::new()
        .prefix(".kagome-")
        .tempdir_in(&parent)
        .map_err(io)?;
    for (name, bytes) in files {
        let mut file = fs::File::create(staged.path().join(name)).map_err(io)?;
        file.write_all(bytes).map_err(io)?;
        file.sync_all().map_err(io)?;
    }
    share(staged.path()).map_err(io)?;
    // A directory cannot be renamed over a full one: the old one steps aside first, and comes back if that fails.
    let aside = if path.exists() {
        let aside = tempfile::Builder::new()
            .prefix(".kagome-old-")
            .tempdir_in(&parent)
            .map_err(io)?;
        fs::rename(path, aside.path().join("old")).map_err(io)?;
        Some(aside)
    } else {
        None
    };
    let staged = staged.keep();
    if let Err(source) = fs::rename(&staged, path) {
        let _ = fs::remove_dir_all(&staged);
        if let Some(aside) = &aside {
            let _ = fs::rename(aside.path().join("old"), path);
        }
        return Err(io(source));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_is_replaced_only_when_asked_and_only_if_it_is_ours() {
        let base = tempfile::tempdir().unwrap();
        let dir = base.path().join("out");
        let names = ["a", "b"];
        write_directory(&dir, &[("a", b"1".to_vec())], &names, false).unwrap();
        assert!(matches!(
            write_directory(&dir, &[("b", vec![])], &names, false),
            Err(WriteError::Exists { .. })
        ));
        write_directory(&dir, &[("b", b"2".to_vec())], &names, true).unwrap();
        assert!(!dir.join("a").exists());
        assert_eq!(fs::read(dir.join("b")).unwrap(), b"2");
        fs::write(dir.join("thesis.txt"), "years").unwrap();
        assert!(matches!(
            write_directory(&dir, &[], &names, true),
            Err(WriteError::NotOurs { .. })
        ));
        assert!(dir.join("thesis.txt").exists());
        assert_eq!(
            fs::read_dir(base.path()).unwrap().count(),
            1,
            "nothing temporary is left behind"
        );
    }

    #[test]
    fn a_missing_parent_is_said_before_any_work() {
        let base = tempfile::tempdir().unwrap();
        let dir = base.path().join("no/such/place");
        assert!(matches!(
            check_directory(&dir, &[], false),
            Err(WriteError::Io { .. })
        ));
    }
}
