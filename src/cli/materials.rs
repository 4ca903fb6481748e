//! `kagome materials`: what can be cut.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::profiles::{
    Listed, Place, checked, fit, listed, machine_named, material_named, own_folder, show, write_new,
};
use super::{Failure, Global, Terminal, print, print_json};
use crate::base::units::short;
use crate::machine::{self, Machine};
use crate::material::{self, CutEntry, Material, Process};

/// Options of `kagome materials`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome materials list --machine diode-400\n  kagome materials new mine --from leather-1.6 --own\n  kagome materials check mine\n  kagome make scan.obj --material mine"
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
        /// The shipped material that it is made from
        #[arg(long, value_name = "SHIPPED", default_value = material::DEFAULT)]
        from: String,
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
pub fn run(args: &MaterialsArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    match &args.what {
        What::List { machine } => list(machine.as_deref(), global),
        What::Show { name } => {
            let found = material_named(name).map_err(Failure::bad)?;
            let material = material::load(&found).map_err(Failure::bad)?;
            let shipped = material::shipped().find(|(n, _)| n == name);
            show(
                &material,
                name,
                &found,
                shipped.map(|(_, text)| text),
                summary,
                global,
            )
        }
        What::Check { file } => {
            let material = checked(material_named(file).and_then(|found| material::load(&found)))?;
            if global.json {
                return print_json(&material);
            }
            print(&summary(&material))
        }
        What::New {
            name,
            from,
            output,
            own,
            force,
        } => {
            let text = material::start(name, from).map_err(Failure::bad)?;
            let place = if *own {
                Place::Own(material::own_file)
            } else {
                Place::File(output.as_deref())
            };
            write_new(&text, name, "--material", &place, *force, global, terminal)
        }
    }
}

fn list(machine: Option<&str>, global: &Global) -> Result<(), Failure> {
    let own = own_folder();
    let all = listed(
        material::shipped().map(|(name, _)| name),
        match &own {
            Some(own) => material::own_files(own).map_err(Failure::bad)?,
            None => Vec::new(),
        },
        |name| material::load(&material::resolve(name, own.as_deref())?),
        material::load,
    )?;
    let machine = match machine {
        None => None,
        Some(machine) => {
            let found = machine_named(machine).map_err(Failure::bad)?;
            Some(machine::load(&found).map_err(Failure::bad)?)
        }
    };
    if global.json {
        let rows: Result<Vec<_>, Failure> =
            all.iter().map(|row| value(row, machine.as_ref())).collect();
        return print_json(&rows?);
    }
    for row in &all {
        let words = match (&row.profile, &machine) {
            (Err(wrong), _) => format!("is not usable: {wrong}"),
            (Ok(material), Some(machine)) => fit(machine, material).0,
            (Ok(material), None) => format!("{}{}", material.title, default_mark(material)),
        };
        print(&format!("{:<16} {:<7} {words}", row.name, row.from()))?;
    }
    Ok(())
}

/// A row of the list for machines.
fn value(row: &Listed<Material>, machine: Option<&Machine>) -> Result<serde_json::Value, Failure> {
    let Some(machine) = machine else {
        return row.value();
    };
    let answer = match &row.profile {
        Ok(material) => fit(machine, material).1,
        Err(wrong) => serde_json::json!({ "fit": "unknown", "why": wrong }),
    };
    Ok(serde_json::json!({ "material": row.value()?, "machine": machine.name, "answer": answer }))
}

fn default_mark(material: &Material) -> &'static str {
    if material.name == material::DEFAULT {
        " (default)"
    } else {
        ""
    }
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
