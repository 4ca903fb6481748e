//! `kagome machines`: what can cut.

use clap::{Args, Subcommand};

use super::{Failure, Global, Terminal, print, print_json};
use crate::base::catalog::CatalogError;
use crate::base::units::short;
use crate::machine::{self, Machine};

/// Options of `kagome machines`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome machines list\n  kagome machines show co2-600x400 > mine.toml\n  kagome machines check mine.toml"
)]
pub struct MachinesArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Clone, Debug)]
enum What {
    /// The machines that kagome knows
    List,
    /// The profile of one, as a start for your own
    Show {
        /// A shipped name or a TOML file
        name: String,
    },
    /// Whether a profile of your own is right
    Check {
        /// A TOML file
        file: String,
    },
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: an unknown name or a wrong profile is bad input; a profile under `check` that is wrong is a no.
pub fn run(args: &MachinesArgs, global: &Global, _: &Terminal) -> Result<(), Failure> {
    match &args.what {
        What::List => {
            let mut all = Vec::new();
            for (name, _) in machine::shipped() {
                all.push(machine::load(name).map_err(Failure::bad)?);
            }
            if global.json {
                return print_json(&all);
            }
            for m in &all {
                print(&format!("{:<16} {}{}", m.name, m.title, default_mark(m)))?;
            }
            Ok(())
        }
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
            let machine = match machine::load(file) {
                Ok(machine) => machine,
                Err(CatalogError::Profile(wrong)) => {
                    return Err(Failure::No(wrong.to_string()));
                }
                Err(other) => return Err(Failure::bad(other)),
            };
            if global.json {
                return print_json(&machine);
            }
            print(&summary(&machine))
        }
    }
}

fn default_mark(machine: &Machine) -> &'static str {
    if machine.name == machine::DEFAULT {
        " (default)"
    } else {
        ""
    }
}

fn summary(m: &Machine) -> String {
    format!(
        "{}: {}\n  {} laser, {} W; bed {} x {} mm, margin {} mm",
        m.name,
        m.title,
        m.laser.kind,
        short(m.laser.watts, 3),
        short(m.bed.width_mm, 3),
        short(m.bed.height_mm, 3),
        short(m.bed.margin_mm, 3),
    )
}
