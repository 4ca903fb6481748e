//! `kagome unlock`.

use clap::Args;

use super::{tell, with_line};
use crate::cli::port_args::PortArgs;
use crate::cli::{Failure, Global, Terminal};
use crate::control::Console;

/// Take the lock off after an alarm, without homing
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome unlock\n  kagome unlock --reset\n\nThe machine does not know where it stands after an alarm in motion: home it if it can."
)]
pub struct UnlockArgs {
    #[command(flatten)]
    port: PortArgs,
    /// Reset the controller first: after a limit switch was hit it hears nothing else. A moving machine loses its position
    #[arg(long)]
    reset: bool,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: no controller answers, or a limit switch is still pressed.
pub fn run(args: &UnlockArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let status = with_line(&args.port, terminal, |line, _| {
        let mut console = if args.reset {
            Console::open_with_reset(line, terminal)?
        } else {
            Console::open(line, terminal)?
        };
        console.unlock()
    })?;
    tell(&status, "unlocked", global)
}
