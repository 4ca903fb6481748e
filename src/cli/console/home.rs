//! `kagome home`.

use clap::Args;

use super::{at_machine, tell};
use crate::cli::port_args::PortArgs;
use crate::cli::{Failure, Global, Terminal};

/// Run the homing cycle, dark
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Example:\n  kagome home --port /dev/ttyUSB0\n\nCtrl-C ends the cycle by a reset; the machine is locked then."
)]
pub struct HomeArgs {
    #[command(flatten)]
    port: PortArgs,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: it does not home, or a switch was not found.
pub fn run(args: &HomeArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let status = at_machine(&args.port, terminal, |console, _| console.home())?;
    tell(&status, "homed", global)
}
