//! `kagome status`.

use clap::Args;

use super::{at_machine, place};
use crate::cli::port_args::PortArgs;
use crate::cli::{Failure, Global, Terminal, print, print_json};
use crate::control::{Survey, work_mm};

/// Show what the machine is, where it stands, and how its settings differ from its profile
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Example:\n  kagome status --port /dev/ttyUSB0\n\nNothing is moved or changed. On most boards the opening of the port alone is a reset."
)]
pub struct StatusArgs {
    #[command(flatten)]
    port: PortArgs,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: no controller answers.
pub fn run(args: &StatusArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let (status, told, survey, machine, banner) =
        at_machine(&args.port, terminal, |console, machine| {
            let settings = console.settings()?;
            let survey = Survey::settings(&|number| settings.number(number), machine);
            let told = console.told()?;
            let status = console.status()?;
            let name = machine.name.clone();
            Ok((status, told, survey, name, console.banner.clone()))
        })?;
    if global.json {
        return print_json(&serde_json::json!({
            "state": format!("{:?}", status.state),
            "machine_mm": if status.is_work { None } else { status.position_mm },
            "work_mm": work_mm(&status),
            "s": status.s,
            "banner": banner,
            "told": told,
            "profile": machine,
            "differs": survey.warned,
        }));
    }
    let mut lines = vec![format!("{:?}; {}", status.state, place(&status))];
    if let Some(s) = status.s {
        lines.push(if s > 0.0 {
            format!("THE BEAM IS ON: S{s}")
        } else {
            "the beam is off".into()
        });
    }
    lines.push(format!("modes {}", told.modes));
    for (name, values) in told.offsets.iter() {
        if values.iter().any(|v| *v != 0.0) {
            let values: Vec<String> = values.iter().map(ToString::to_string).collect();
            lines.push(format!("{name} {}", values.join(" ")));
        }
    }
    lines.extend(told.build);
    if survey.warned.is_empty() {
        lines.push(format!("set as the profile {machine} says"));
    }
    lines.extend(survey.warned.iter().map(|w| format!("differs: {w}")));
    print(&(lines.join("\n") + "\n"))
}
