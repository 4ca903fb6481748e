//! `kagome verify`: the last look before the beam.

use std::path::{Path, PathBuf};

use clap::Args;

use super::cut::drawing_of;
use super::job_args::machine_for;
use super::profiles::machine_named;
use super::{Failure, Global, Terminal, print, print_json};
use crate::base::units::short;
use crate::{gcode, machine, pattern};

/// Options of `kagome verify`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Example:\n  kagome verify mask/job.nc --machine diode-400\n\nWithout a sheet (--sheet, or a pattern.svg beside the job) only the bed, the beam and the modes\nare checked: that serves G-code of any program."
)]
pub struct VerifyArgs {
    /// The G-code
    job: PathBuf,
    /// The sheet that it must cut [default: the SVG of the same name beside it, or pattern.svg]
    #[arg(long, value_name = "SVG")]
    sheet: Option<PathBuf>,
    /// The machine's profile [default: the one that the job's header names, or the standard one]
    #[arg(long, value_name = "NAME|FILE")]
    machine: Option<String>,
    /// How often each cut must be gone over [default: as the job's header says, or once]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    passes: Option<u32>,
}

/// Findings that are printed one by one; a wrong sheet would give thousands of the same kind.
const SHOWN: usize = 20;

fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .map_err(|e| Failure::Bad(format!("{} cannot be read: {e}", path.display())))
}

/// Runs the verb.
///
/// # Errors
/// [`Failure::No`] with the findings, [`Failure::Bad`] for files that cannot be used.
pub fn run(args: &VerifyArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let text = read(&args.job)?;
    let machine = match machine_for(args.machine.as_deref(), text.as_bytes())? {
        Some(machine) => machine,
        None => {
            let found = machine_named(machine::DEFAULT).map_err(Failure::bad)?;
            machine::load(&found).map_err(Failure::bad)?
        }
    };
    let sheet_path = args.sheet.clone().or_else(|| drawing_of(&args.job));
    let sheet = match &sheet_path {
        None => None,
        Some(path) => Some(
            pattern::read_svg(&read(path)?)
                .map_err(|e| Failure::Bad(format!("{}: {e}", path.display())))?,
        ),
    };
    let verdict =
        gcode::verify(&text, &machine, sheet.as_ref(), args.passes).map_err(Failure::bad)?;
    terminal.clear();
    if global.json {
        print_json(&verdict)?;
    }
    let scope = match (&sheet_path, verdict.passes) {
        (Some(path), Some(1)) => format!("compared with {}", path.display()),
        (Some(path), Some(n)) => format!("compared with {}, {n} passes", path.display()),
        _ => "bed, beam and modes only: there is no sheet to compare with".into(),
    };
    if verdict.passed() && verdict.burnt_mm == 0.0 {
        return Err(Failure::No(format!(
            "{}: it burns nothing",
            args.job.display()
        )));
    }
    if verdict.passed() {
        if global.json {
            return Ok(());
        }
        return print(&format!(
            "{}: good for {} ({scope}); {} mm burnt, {} mm travelled",
            args.job.display(),
            machine.name,
            short(verdict.burnt_mm, 1),
            short(verdict.travel_mm, 1)
        ));
    }
    let count = verdict.findings.len();
    let mut text = format!(
        "{}: not good for {} ({scope}), {count} finding{}",
        args.job.display(),
        machine.name,
        if count == 1 { "" } else { "s" }
    );
    for finding in verdict.findings.iter().take(SHOWN) {
        text.push_str(&format!("\n  {finding}"));
    }
    if count > SHOWN {
        text.push_str(&format!(
            "\n  and {} more (--json lists all)",
            count - SHOWN
        ));
    }
    Err(Failure::No(text))
}
