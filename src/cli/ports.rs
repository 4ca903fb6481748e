//! `kagome ports`.

use clap::Args;

use super::{Failure, Global, Terminal};
use crate::control;

/// List the serial ports of this computer
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  kagome ports")]
pub struct PortsArgs {}

/// Prints one port a line, with what is known of it.
pub fn run(_: &PortsArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let ports = control::ports();
    terminal.clear();
    if global.json {
        let list: Vec<_> = ports
            .iter()
            .map(|(name, kind)| serde_json::json!({ "port": name, "kind": kind }))
            .collect();
        println!("{}", serde_json::json!({ "ports": list }));
        return Ok(());
    }
    for (name, kind) in &ports {
        println!("{name}  {kind}");
    }
    println!("sim  the machine that is built in");
    if ports.is_empty() && !global.quiet {
        eprintln!("no serial port was found: is the machine plugged in and switched on?");
    }
    Ok(())
}
