//! `kagome materials`: what can be cut.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::profiles::{checked, fit, write_new};
use super::{Failure, Global, Terminal, print, print_json};
use crate::base::units::short;
use crate::machine;
use crate::material::{self, CutEntry, Material, Process};

/// Options of `kagome materials`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome materials list --machine diode-400\n  kagome materials new mine --from leather-1.6\n  kagome materials check mine.toml\n  kagome make scan.obj --material mine.toml"
)]
pub struct MaterialsArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Clone, Debug)]
enum What {
    /// The materials that kagome knows
    List {
        /// With this machine: whether it cuts each, and why not
        #[arg(long, value_name = "NAME|FILE")]
        machine: Option<String>,
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
        /// The shipped material that it is made from
        #[arg(long, value_name = "SHIPPED", default_value = material::DEFAULT)]
        from: String,
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
pub fn run(args: &MaterialsArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    match &args.what {
        What::List { machine } => list(machine.as_deref(), global),
        What::Show { name } => {
            let material = material::load(name).map_err(Failure::bad)?;
            if global.json {
                return print_json(&material);
            }
            match material::shipped().find(|(n, _)| n == name) {
                Some((_, text)) => print(text.trim_end()),
                None => print(&summary(&material)),
            }
        }
        What::Check { file } => {
            let material = checked(material::load(file))?;
            if global.json {
                return print_json(&material);
            }
            print(&summary(&material))
        }
        What::New {
            name,
            from,
            output,
            force,
        } => {
            let text = material::start(name, from).map_err(Failure::bad)?;
            write_new(&text, name, output.as_deref(), *force, global, terminal)
        }
    }
}

fn list(machine: Option<&str>, global: &Global) -> Result<(), Failure> {
    let mut all = Vec::new();
    for (name, _) in material::shipped() {
        all.push(material::load(name).map_err(Failure::bad)?);
    }
    let Some(machine) = machine else {
        if global.json {
            return print_json(&all);
        }
        for m in &all {
            let mark = if m.name == material::DEFAULT {
                " (default)"
            } else {
                ""
            };
            print(&format!("{:<16} {}{mark}", m.name, m.title))?;
        }
        return Ok(());
    };
    let machine = machine::load(machine).map_err(Failure::bad)?;
    if global.json {
        let rows: Vec<_> = all
            .iter()
            .map(|m| serde_json::json!({ "material": m, "machine": machine.name, "answer": fit(&machine, m).1 }))
            .collect();
        return print_json(&rows);
    }
    for m in &all {
        print(&format!("{:<16} {}", m.name, fit(&machine, m).0))?;
    }
    Ok(())
}

fn summary(m: &Material) -> String {
    let mut text = format!(
        "{}: {}\n  stretches up to {} ({}); hinges {} mm wide",
        m.name,
        m.title,
        short(m.sigma.max, 3),
        m.sigma.note,
        short(m.hinge_width_mm, 3)
    );
    for c in &m.cut {
        text.push_str(&format!("\n  cut, {}", cut(c)));
    }
    for e in &m.engrave {
        text.push_str(&format!(
            "\n  mark, {}: {} mm/min",
            e.tool(),
            short(e.speed_mm_per_min, 3)
        ));
        if let Some(percent) = e.power_percent {
            text.push_str(&format!(" at {} %", short(percent, 3)));
        }
    }
    text
}

fn cut(c: &CutEntry) -> String {
    let how = match c.process {
        Process::Laser => format!(
            " at {} %, passes {}",
            short(c.power_percent.unwrap_or(0.0), 3),
            c.passes.unwrap_or(1)
        ),
        Process::Plasma => format!(
            ", pierce {} s at {} mm, cut at {} mm",
            short(c.pierce_delay_s.unwrap_or(0.0), 3),
            short(c.pierce_height_mm.unwrap_or(0.0), 3),
            short(c.cut_height_mm.unwrap_or(0.0), 3)
        ),
    };
    format!(
        "{}: {} mm/min{how}, kerf {} mm",
        c.tool(),
        short(c.speed_mm_per_min, 3),
        short(c.kerf_mm, 3)
    )
}
