//! `kagome jog`.

use clap::{Args, ValueEnum};

use super::{at_machine, tell};
use crate::cli::port_args::PortArgs;
use crate::cli::{Failure, Global, Terminal};
use crate::control::{JogTo, Move};

/// How the lengths of a jog are meant.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ToArg {
    /// By so much from here
    By,
    /// To a place of the work
    Work,
    /// To a place of the machine
    Machine,
}

/// Move the head by hand, dark
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome jog --x 10\n  kagome jog --x 0 --y 0 --to work --feed 6000\n\nCtrl-C stops the move; the position is kept."
)]
pub struct JogArgs {
    #[command(flatten)]
    port: PortArgs,
    /// Millimetres along X
    #[arg(long, allow_negative_numbers = true, value_name = "MM")]
    x: Option<f64>,
    /// Millimetres along Y
    #[arg(long, allow_negative_numbers = true, value_name = "MM")]
    y: Option<f64>,
    /// Millimetres along Z
    #[arg(long, allow_negative_numbers = true, value_name = "MM")]
    z: Option<f64>,
    /// What the numbers are
    #[arg(long, value_enum, default_value_t = ToArg::By)]
    to: ToArg,
    /// mm/min
    #[arg(long, default_value_t = 3000.0, value_name = "MM/MIN")]
    feed: f64,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: locked, beyond the travel, or stopped.
pub fn run(args: &JogArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let by = Move {
        to: match args.to {
            ToArg::By => JogTo::By,
            ToArg::Work => JogTo::Work,
            ToArg::Machine => JogTo::Machine,
        },
        axes_mm: [args.x, args.y, args.z],
        feed_mm_per_min: args.feed,
    };
    // Before the port is opened, which resets most boards.
    if by.line().is_none() {
        return Err(Failure::Bad(
            "name an axis, --x, --y or --z, with a plain number of millimetres, and a --feed above zero".into(),
        ));
    }
    let status = at_machine(&args.port, terminal, |console, _| console.jog(&by))?;
    tell(&status, "moved", global)
}
