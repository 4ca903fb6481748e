//! `kagome machines`: what can cut.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::profiles::{checked, fit, write_new};
use super::{Failure, Global, Terminal, print, print_json};
use crate::base::progress::Progress as _;
use crate::base::units::short;
use crate::machine::{self, ControllerSettings, HeightControl, Machine, Tool};
use crate::material;

/// Options of `kagome machines`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome machines list --material leather-1.6\n  kagome machines new mine --from diode-400 --settings dollar.txt\n  kagome machines check mine.toml\n  kagome make scan.obj --machine mine.toml"
)]
pub struct MachinesArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Clone, Debug)]
enum What {
    /// The machines that kagome knows
    List {
        /// With this material: whether each cuts it, and why not
        #[arg(long, value_name = "NAME|FILE")]
        material: Option<String>,
    },
    /// The profile of one
    Show {
        /// A shipped name or a TOML file
        name: String,
    },
    /// Whether a profile of your own is right
    Check {
        /// A TOML file
        file: String,
    },
    /// A profile of your own to start from, with an explanation of every key
    New {
        /// Its name
        name: String,
        /// The shipped machine that it is made from
        #[arg(long, value_name = "SHIPPED", default_value = machine::DEFAULT)]
        from: String,
        /// What a GRBL controller answered to $$: bed, rates, accelerations and full power are taken from it
        #[arg(long, value_name = "FILE")]
        settings: Option<PathBuf>,
        /// The file to write [default: NAME.toml]
        #[arg(short, long, value_name = "FILE.toml")]
        output: Option<PathBuf>,
        /// Replace the file if it exists
        #[arg(long)]
        force: bool,
    },
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: an unknown name or a wrong profile is bad input; a profile under `check` that is wrong is a no.
pub fn run(args: &MachinesArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    match &args.what {
        What::List { material } => list(material.as_deref(), global),
        What::Show { name } => {
            let machine = machine::load(name).map_err(Failure::bad)?;
            if global.json {
                return print_json(&machine);
            }
            match machine::shipped().find(|(n, _)| n == name) {
                Some((_, text)) => print(text.trim_end()),
                None => print(&summary(&machine)),
            }
        }
        What::Check { file } => {
            let machine = checked(machine::load(file))?;
            if global.json {
                return print_json(&machine);
            }
            print(&summary(&machine))
        }
        What::New {
            name,
            from,
            settings,
            output,
            force,
        } => {
            let settings = match settings {
                None => None,
                Some(path) => {
                    let text = std::fs::read_to_string(path).map_err(|e| {
                        Failure::Bad(format!("{} cannot be read: {e}", path.display()))
                    })?;
                    let settings = ControllerSettings::parse(&text)
                        .map_err(|e| Failure::Bad(format!("{}: {e}", path.display())))?;
                    Some(settings)
                }
            };
            let text = machine::start(name, from, settings.as_ref()).map_err(Failure::bad)?;
            write_new(&text, name, output.as_deref(), *force, global, terminal)?;
            for warning in settings.iter().flat_map(ControllerSettings::warnings) {
                terminal.note(&format!("warning: {warning}"));
            }
            Ok(())
        }
    }
}

fn list(material: Option<&str>, global: &Global) -> Result<(), Failure> {
    let mut all = Vec::new();
    for (name, _) in machine::shipped() {
        all.push(machine::load(name).map_err(Failure::bad)?);
    }
    let Some(material) = material else {
        if global.json {
            return print_json(&all);
        }
        for m in &all {
            print(&format!("{:<20} {}{}", m.name, m.title, default_mark(m)))?;
        }
        return Ok(());
    };
    let material = material::load(material).map_err(Failure::bad)?;
    if global.json {
        let rows: Vec<_> = all
            .iter()
            .map(|m| serde_json::json!({ "machine": m, "material": material.name, "answer": fit(m, &material).1 }))
            .collect();
        return print_json(&rows);
    }
    for m in &all {
        print(&format!("{:<20} {}", m.name, fit(m, &material).0))?;
    }
    Ok(())
}

fn default_mark(machine: &Machine) -> &'static str {
    if machine.name == machine::DEFAULT {
        " (default)"
    } else {
        ""
    }
}

fn summary(m: &Machine) -> String {
    let tool = match m.tool() {
        Some(Tool::Laser(laser)) => format!("{} laser, {} W", laser.kind, short(laser.watts, 3)),
        Some(Tool::Plasma(torch)) => format!(
            "plasma torch, {} A, height by {}",
            short(torch.max_amps, 3),
            match torch.height_control {
                HeightControl::QtPlasmaC => "QtPlasmaC",
                HeightControl::Plain => "the job",
            }
        ),
        None => "no tool".into(),
    };
    format!(
        "{}: {}\n  {tool}; {}, {} arcs; bed {} x {} mm, margin {} mm",
        m.name,
        m.title,
        m.controller,
        if m.arcs() { "takes" } else { "takes no" },
        short(m.bed.width_mm, 3),
        short(m.bed.height_mm, 3),
        short(m.bed.margin_mm, 3),
    )
}
