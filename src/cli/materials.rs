//! `kagome materials`: what can be cut.

use clap::{Args, Subcommand};

use super::{Failure, Global, Terminal, print, print_json};
use crate::base::catalog::CatalogError;
use crate::base::units::short;
use crate::material::{self, Material};

/// Options of `kagome materials`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome materials list\n  kagome materials show leather-1.6 > mine.toml\n  kagome materials check mine.toml"
)]
pub struct MaterialsArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Clone, Debug)]
enum What {
    /// The materials that kagome knows
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
pub fn run(args: &MaterialsArgs, global: &Global, _: &Terminal) -> Result<(), Failure> {
    match &args.what {
        What::List => {
            let mut all = Vec::new();
            for (name, _) in material::shipped() {
                all.push(material::load(name).map_err(Failure::bad)?);
            }
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
            Ok(())
        }
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
            let material = match material::load(file) {
                Ok(material) => material,
                Err(CatalogError::Profile(wrong)) => {
                    return Err(Failure::No(wrong.to_string()));
                }
                Err(other) => return Err(Failure::bad(other)),
            };
            if global.json {
                return print_json(&material);
            }
            print(&summary(&material))
        }
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
        text.push_str(&format!(
            "\n  {} laser {} W: {} mm/min at {} %, passes {}, kerf {} mm",
            c.laser,
            short(c.watts, 3),
            short(c.speed_mm_per_min, 3),
            short(c.power_percent, 3),
            c.passes,
            short(c.kerf_mm, 3)
        ));
    }
    text
}
