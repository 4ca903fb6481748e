//! `kagome settings`: the controller's own numbers, saved, compared and put back.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::at_machine;
use crate::base::atomic::write_file;
use crate::base::progress::Progress as _;
use crate::cli::port_args::PortArgs;
use crate::cli::question::agrees;
use crate::cli::{Failure, Global, Terminal, print, print_json};
use crate::control::{ControllerSettings, SettingDifference};

/// Save, compare and put back the controller's settings ($0 to $132 and beyond)
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome settings save laser.txt\n  kagome settings compare laser.txt\n  kagome settings restore laser.txt"
)]
pub struct SettingsArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Clone, Debug)]
enum What {
    /// Write them to a file, a line a setting
    Save {
        /// The file
        file: PathBuf,
        #[command(flatten)]
        port: PortArgs,
        /// Replace a file that is there
        #[arg(long)]
        force: bool,
    },
    /// Show what differs between controller and file; exit code 1 if anything does
    Compare {
        /// The file
        file: PathBuf,
        #[command(flatten)]
        port: PortArgs,
    },
    /// Write those that differ to the controller, and read them back
    Restore {
        /// The file
        file: PathBuf,
        #[command(flatten)]
        port: PortArgs,
        /// Do not ask
        #[arg(long)]
        yes: bool,
    },
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: no controller, a file that is none, a setting that was refused.
pub fn run(args: &SettingsArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    match &args.what {
        What::Save { file, port, force } => save(file, port, *force, global, terminal),
        What::Compare { file, port } => {
            let wanted = read(file)?;
            let now = at_machine(port, terminal, |console, _| console.settings())?;
            let differences = now.differences(&wanted);
            show(&differences, global)?;
            if differences.is_empty() {
                Ok(())
            } else {
                Err(Failure::No(format!(
                    "{} setting(s) differ from {}",
                    differences.len(),
                    file.display()
                )))
            }
        }
        What::Restore { file, port, yes } => restore(file, port, *yes, global, terminal),
    }
}

fn save(
    file: &Path,
    port: &PortArgs,
    force: bool,
    global: &Global,
    terminal: &Terminal,
) -> Result<(), Failure> {
    if file.exists() && !force {
        return Err(Failure::Bad(format!(
            "{} exists already; add --force to replace it",
            file.display()
        )));
    }
    let (settings, heading) = at_machine(port, terminal, |console, machine| {
        let build = console.told()?.build.join("\n");
        let heading = format!("settings of {}\n{build}", machine.name);
        Ok((console.settings()?, heading))
    })?;
    write_file(file, settings.to_text(&heading).as_bytes()).map_err(Failure::bad)?;
    if global.json {
        return print_json(&serde_json::json!({ "file": file, "settings": settings.len() }));
    }
    if global.quiet {
        return Ok(());
    }
    print(&format!(
        "{} settings in {}",
        settings.len(),
        file.display()
    ))
}

fn restore(
    file: &Path,
    port: &PortArgs,
    yes: bool,
    global: &Global,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let wanted = read(file)?;
    if !yes && !std::io::stdin().is_terminal() {
        return Err(Failure::Bad(
            "there is no terminal to ask on: look with `kagome settings compare`, then add --yes"
                .into(),
        ));
    }
    let mut agreed = true;
    let restored = at_machine(port, terminal, |console, _| {
        let differences: Vec<SettingDifference> = console
            .settings()?
            .differences(&wanted)
            .into_iter()
            .filter(|d| d.file.is_some() && d.controller.is_some())
            .collect();
        if !yes && !differences.is_empty() {
            for line in lines(&differences) {
                terminal.note(&line);
            }
            agreed = agrees("write these to the controller", terminal);
        }
        if !agreed {
            return Ok(None);
        }
        console.restore(&differences).map(Some)
    })?;
    let Some(restored) = restored else {
        return Err(Failure::No("nothing was written".into()));
    };
    if global.json {
        print_json(&restored)?;
    } else if !global.quiet {
        print(&format!("{} setting(s) written", restored.written.len()))?;
    }
    let refused = restored
        .refused
        .iter()
        .map(|(n, why)| format!("${n} was refused: {why}"));
    let different = restored.different.iter().map(|d| {
        format!(
            "${} was taken, and reads {} now",
            d.number,
            d.controller.as_deref().unwrap_or("nothing")
        )
    });
    let problems: Vec<String> = refused.chain(different).collect();
    if problems.is_empty() {
        Ok(())
    } else {
        Err(Failure::No(problems.join("\n  ")))
    }
}

fn read(file: &Path) -> Result<ControllerSettings, Failure> {
    let text = std::fs::read_to_string(file)
        .map_err(|e| Failure::Bad(format!("cannot read {}: {e}", file.display())))?;
    ControllerSettings::parse(&file.display().to_string(), &text).map_err(Failure::bad)
}

fn lines(differences: &[SettingDifference]) -> Vec<String> {
    let of = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".into());
    differences
        .iter()
        .map(|d| {
            format!(
                "${}: the controller has {}, the file {}",
                d.number,
                of(&d.controller),
                of(&d.file)
            )
        })
        .collect()
}

fn show(differences: &[SettingDifference], global: &Global) -> Result<(), Failure> {
    if global.json {
        return print_json(&serde_json::json!({ "differences": differences }));
    }
    if global.quiet {
        return Ok(());
    }
    if differences.is_empty() {
        return print("no setting differs");
    }
    print(&(lines(differences).join("\n") + "\n"))
}
