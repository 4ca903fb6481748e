//! The verbs at the machine: `status`, `home`, `unlock`, `jog`, `zero`, `frame`, `settings`.

pub mod frame;
pub mod home;
pub mod jog;
pub mod settings;
pub mod status;
pub mod unlock;
pub mod zero;

use super::port_args::PortArgs;
use super::{Failure, Global, Terminal, print, print_json};
use crate::control::{Console, ConsoleError, Status, Transport, work_mm};
use crate::machine::Machine;

/// Opens the port and does something at the machine, which is of this profile.
fn at_machine<T>(
    args: &PortArgs,
    terminal: &Terminal,
    act: impl FnOnce(&mut Console<'_>, &Machine) -> Result<T, ConsoleError>,
) -> Result<T, Failure> {
    with_line(args, terminal, |line, machine| {
        let mut console = Console::open(line, terminal)?;
        act(&mut console, machine)
    })
}

/// The same with the bare line.
fn with_line<T>(
    args: &PortArgs,
    terminal: &Terminal,
    act: impl FnOnce(&mut dyn Transport, &Machine) -> Result<T, ConsoleError>,
) -> Result<T, Failure> {
    let machine = args.profile()?;
    let port = args.port(&machine)?;
    let result = port.open(Some(&machine), terminal, |line| act(line, &machine))?;
    let done = result.map_err(failure)?;
    port.remember(Some(&machine), terminal);
    Ok(done)
}

/// A machine that cannot be reached is bad input; one that refuses is an answer.
fn failure(error: ConsoleError) -> Failure {
    match error {
        ConsoleError::Link { .. } | ConsoleError::NoController { .. } => Failure::bad(error),
        _ => Failure::No(error.to_string()),
    }
}

/// Tells where the machine stands, at the end of a verb.
fn tell(status: &Status, done: &str, global: &Global) -> Result<(), Failure> {
    if global.json {
        return print_json(&serde_json::json!({
            "done": done,
            "state": format!("{:?}", status.state),
            "machine_mm": if status.is_work { None } else { status.position_mm },
            "work_mm": work_mm(status),
            "s": status.s,
        }));
    }
    if global.quiet {
        return Ok(());
    }
    print(&format!("{done}; {}", place(status)))
}

/// Where it stands, in words.
fn place(status: &Status) -> String {
    let xyz = |p: [f64; 3]| format!("X{:.3} Y{:.3} Z{:.3}", p[0], p[1], p[2]);
    let mut words = match work_mm(status) {
        Some(work) => format!("the head stands at {} of the work", xyz(work)),
        None => "where the head stands is not told".into(),
    };
    if let Some(position) = status.position_mm.filter(|_| !status.is_work) {
        words.push_str(&format!(", {} of the machine", xyz(position)));
    }
    words
}
