//! `kagome machines`: what can cut.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::profiles::{
    Listed, Place, checked, fit, listed, machine_named, material_named, own_folder, show, write_new,
};
use super::{Failure, Global, Terminal, print, print_json};
use crate::base::progress::Progress as _;
use crate::base::units::short;
use crate::machine::{self, ControllerSettings, HeightControl, Machine, Tool};
use crate::material::{self, Material};

/// Options of `kagome machines`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome machines list --material leather-1.6\n  kagome machines new mine --from diode-400 --settings dollar.txt --own\n  kagome machines check mine\n  kagome make scan.obj --machine mine"
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
        /// The name of a shipped one or one of your own, or a TOML file
        name: String,
    },
    /// Whether a profile of your own is right
    Check {
        /// A TOML file, or the name of one in your own folder
        #[arg(value_name = "NAME|FILE")]
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
        /// Write it into your own folder, where it is found by its name
        #[arg(long, conflicts_with = "output")]
        own: bool,
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
            let found = machine_named(name).map_err(Failure::bad)?;
            let machine = machine::load(&found).map_err(Failure::bad)?;
            let shipped = machine::shipped().find(|(n, _)| n == name);
            show(
                &machine,
                name,
                &found,
                shipped.map(|(_, text)| text),
                summary,
                global,
            )
        }
        What::Check { file } => {
            let machine = checked(machine_named(file).and_then(|found| machine::load(&found)))?;
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
            own,
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
            let place = if *own {
                Place::Own(machine::own_file)
            } else {
                Place::File(output.as_deref())
            };
            write_new(&text, name, "--machine", &place, *force, global, terminal)?;
            for warning in settings.iter().flat_map(ControllerSettings::warnings) {
                terminal.note(&format!("warning: {warning}"));
            }
            Ok(())
        }
    }
}

fn list(material: Option<&str>, global: &Global) -> Result<(), Failure> {
    let own = own_folder();
    let all = listed(
        machine::shipped().map(|(name, _)| name),
        match &own {
            Some(own) => machine::own_files(own).map_err(Failure::bad)?,
            None => Vec::new(),
        },
        |name| machine::load(&machine::resolve(name, own.as_deref())?),
        machine::load,
    )?;
    let material = match material {
        None => None,
        Some(material) => {
            let found = material_named(material).map_err(Failure::bad)?;
            Some(material::load(&found).map_err(Failure::bad)?)
        }
    };
    if global.json {
        let rows: Result<Vec<_>, Failure> = all
            .iter()
            .map(|row| value(row, material.as_ref()))
            .collect();
        return print_json(&rows?);
    }
    for row in &all {
        let words = match (&row.profile, &material) {
            (Err(wrong), _) => format!("is not usable: {wrong}"),
            (Ok(machine), Some(material)) => fit(machine, material).0,
            (Ok(machine), None) => format!("{}{}", machine.title, default_mark(machine)),
        };
        print(&format!("{:<20} {:<7} {words}", row.name, row.from()))?;
    }
    Ok(())
}

/// A row of the list for machines.
fn value(row: &Listed<Machine>, material: Option<&Material>) -> Result<serde_json::Value, Failure> {
    let Some(material) = material else {
        return row.value();
    };
    let answer = match &row.profile {
        Ok(machine) => fit(machine, material).1,
        Err(wrong) => serde_json::json!({ "fit": "unknown", "why": wrong }),
    };
    Ok(serde_json::json!({ "machine": row.value()?, "material": material.name, "answer": answer }))
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
