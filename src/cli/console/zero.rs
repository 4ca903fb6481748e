//! `kagome zero`.

use clap::Args;

use super::{at_machine, tell};
use crate::cli::port_args::PortArgs;
use crate::cli::{Failure, Global, Terminal};

/// Say where the head stands: the work zero (G54), kept in the controller's memory
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome zero                 # the head stands over the sheet's corner: X0 Y0\n  kagome zero --x 10 --y 10   # 10 mm in from it\n  kagome zero --z 0"
)]
pub struct ZeroArgs {
    #[command(flatten)]
    port: PortArgs,
    /// X of the work here, millimetres [default: 0, if no axis is named]
    #[arg(long, allow_negative_numbers = true, value_name = "MM")]
    x: Option<f64>,
    /// Y of the work here
    #[arg(long, allow_negative_numbers = true, value_name = "MM")]
    y: Option<f64>,
    /// Z of the work here; without it Z stays
    #[arg(long, allow_negative_numbers = true, value_name = "MM")]
    z: Option<f64>,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: locked, or the controller tells another place afterwards.
pub fn run(args: &ZeroArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let here = match [args.x, args.y, args.z] {
        [None, None, None] => [Some(0.0), Some(0.0), None],
        named => named,
    };
    if here.iter().flatten().any(|v| !v.is_finite()) {
        return Err(Failure::Bad(
            "a place is a plain number of millimetres".into(),
        ));
    }
    let status = at_machine(&args.port, terminal, |console, _| console.set_zero(here))?;
    tell(&status, "zero is set", global)
}
