//! `kagome frame`: the head goes around the job before it is cut.

use clap::Args;

use crate::base::units::{fixed, short};
use crate::cli::job_args::JobAt;
use crate::cli::send::failure;
use crate::cli::{Failure, Global, Terminal, print, print_json};
use crate::control::{Job, JobReach, JobRules, SendOptions, Unattended, send};
use crate::gcode::Dialect;

/// What lights a mark and burns none, per cent of full power, at the most.
const MOST_PERCENT: f64 = 5.0;

/// Go around the rectangle that a job burns, dark or with a faint beam, to see where it will lie
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Examples:\n  kagome frame mask/job.nc\n  kagome frame mask/job.nc --power 1 --times 3\n\nIt is sent as any job is: Ctrl-C holds the machine and sees its beam off."
)]
pub struct FrameArgs {
    #[command(flatten)]
    at: JobAt,
    /// Power of the beam on the way, per cent, at most 5; 0 is dark. It is dynamic (M4): off whenever the head stands
    #[arg(long, default_value_t = 0.0, value_name = "PERCENT")]
    power: f64,
    /// How fast, mm/min
    #[arg(long, default_value_t = 3000.0, value_name = "MM/MIN")]
    feed: f64,
    /// How often
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    times: u32,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: a job that burns nothing, a power that would mark, a machine that refuses.
pub fn run(args: &FrameArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let (text, machine) = args.at.read()?;
    if let Some(m) = machine.as_ref().filter(|m| !m.controller.is_streamed()) {
        return Err(Failure::Bad(format!(
            "machine {} has {}, which frames jobs on its own screen",
            m.name, m.controller
        )));
    }
    if !(0.0..=MOST_PERCENT).contains(&args.power) {
        return Err(Failure::Bad(format!(
            "--power {} would mark the sheet: 0 (dark) to {MOST_PERCENT} per cent",
            args.power
        )));
    }
    if !(1.0..=100_000.0).contains(&args.feed) {
        return Err(Failure::Bad(format!(
            "--feed {} is no speed of a machine, mm/min",
            args.feed
        )));
    }
    let s_max = machine.as_ref().and_then(|m| Some(m.laser()?.s_max));
    let s = match (args.power > 0.0, s_max) {
        (false, _) => None,
        (true, Some(s_max)) => Some(0.01 * args.power * s_max),
        (true, None) if machine.as_ref().is_some_and(|m| m.plasma().is_some()) => {
            return Err(Failure::Bad(
                "a torch has no faint beam: frame the job dark, without --power".into(),
            ));
        }
        (true, None) => {
            return Err(Failure::Bad(
                "how much power that is depends on the machine: name its profile with --machine"
                    .into(),
            ));
        }
    };
    let reach = JobReach::of(
        &String::from_utf8_lossy(&text),
        machine.as_ref().map_or(Dialect::Laser, Dialect::of),
    );
    let Some([low, high]) = reach.and_then(|r| r.burnt_mm) else {
        return Err(Failure::Bad(format!(
            "{} burns nothing: there is nothing to frame",
            args.at.job.display()
        )));
    };
    let way = around(low, high, s, args.feed, args.times);
    let reach = JobReach::of(&way, Dialect::Laser);
    let job = Job::check(
        way.as_bytes(),
        &machine
            .as_ref()
            .map_or_else(JobRules::default, JobRules::of),
    )
    .map_err(Failure::bad)?;
    let port = args.at.port(machine.as_ref())?;
    let options = SendOptions {
        s_max,
        made_for: machine.clone().map(|m| Box::new((m, reach))),
        buffer: machine
            .as_ref()
            .and_then(|m| Some(m.connection.as_ref()?.receive_buffer_bytes as usize)),
        ..SendOptions::default()
    };
    port.open(machine.as_ref(), terminal, |line| {
        send(line, &job, &options, &Unattended(terminal))
    })?
    .map_err(failure)?;
    port.remember(machine.as_ref(), terminal);
    if global.json {
        return print_json(
            &serde_json::json!({ "low_mm": low, "high_mm": high, "power_percent": args.power }),
        );
    }
    if global.quiet {
        return Ok(());
    }
    print(&format!(
        "went around X{} Y{} to X{} Y{}, {}",
        short(low[0], 2),
        short(low[1], 2),
        short(high[0], 2),
        short(high[1], 2),
        if s.is_some() {
            "with a faint beam"
        } else {
            "dark"
        }
    ))
}

/// A job around a rectangle, from its lower left corner and back to it.
fn around(low: [f64; 2], high: [f64; 2], s: Option<f64>, feed: f64, times: u32) -> String {
    let at = |x: f64, y: f64| format!("X{} Y{}", fixed(x, 3), fixed(y, 3));
    let mut job = format!("G21 G90 G94 G54\nM5\nG0 {}\n", at(low[0], low[1]));
    if let Some(s) = s {
        job.push_str(&format!("M4 S{}\n", short(s, 3)));
    }
    for n in 0..times {
        for (k, corner) in [
            (high[0], low[1]),
            (high[0], high[1]),
            (low[0], high[1]),
            (low[0], low[1]),
        ]
        .into_iter()
        .enumerate()
        {
            job.push_str(&format!("G1 {}", at(corner.0, corner.1)));
            if n == 0 && k == 0 {
                job.push_str(&format!(" F{}", short(feed, 1)));
            }
            job.push('\n');
        }
    }
    job.push_str("M5\nM2\n");
    job
}
