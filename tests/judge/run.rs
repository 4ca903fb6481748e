//! The program as a person runs it.

use std::path::Path;
use std::process::{Command, Output};

/// Runs it in a folder and waits for its end.
pub fn kagome(args: &[&str], folder: &Path) -> Output {
    // The slow checks run the release build.
    let program =
        std::env::var("KAGOME_BIN").unwrap_or_else(|_| env!("CARGO_BIN_EXE_kagome").into());
    Command::new(program)
        .env("KAGOME_PROFILES", "")
        .args(args)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// What it said of errors.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
