//! `kagome sim`.

use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::profiles::machine_named;
use super::{Failure, Global, Terminal};
use crate::base::progress::Progress as _;
use crate::sim::pty::{Link, PtyServer, Serve};
use crate::sim::{Controller, RehearsalSummary, Settings};

/// Serve the simulated machine on a pseudo-terminal, for this and other senders
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  \
    kagome sim --link /tmp/laser --speed max &\n  \
    kagome send mask/job.nc --port /tmp/laser\n\n\
    The path of the pseudo-terminal is the first line printed. Ctrl-C ends the machine; what was burnt is printed then.")]
pub struct SimArgs {
    /// A symbolic link to the pseudo-terminal, under a name that does not change
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// The machine's profile
    #[arg(long, value_name = "NAME|FILE", default_value = crate::machine::DEFAULT)]
    machine: String,
    /// The machine's seconds per second, or `max` for as fast as it is fed
    #[arg(long, default_value = "1", value_parser = speed)]
    speed: Speed,
    /// End when the sender has closed the port and the machine has come to rest
    #[arg(long)]
    once: bool,
    /// Do not start anew when the port is opened (as boards without a reset on DTR)
    #[arg(long)]
    no_reset_on_open: bool,
}

/// The machine's seconds per second of the wall; none for as fast as possible.
#[derive(Clone, Copy, Debug)]
struct Speed(Option<f64>);

fn speed(text: &str) -> Result<Speed, String> {
    if text == "max" {
        return Ok(Speed(None));
    }
    match text.parse::<f64>() {
        Ok(value) if (0.01..=1000.0).contains(&value) => Ok(Speed(Some(value))),
        _ => Err("a number from 0.01 to 1000, or max".into()),
    }
}

/// Serves until Ctrl-C, or until the sender leaves.
pub fn run(args: &SimArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let machine = {
        let found = machine_named(&args.machine).map_err(Failure::bad)?;
        crate::machine::load(&found).map_err(Failure::bad)?
    };
    if !machine.controller.is_streamed() {
        return Err(Failure::Bad(format!(
            "machine {} has {}, which opens jobs as files: there is no port to serve",
            machine.name, machine.controller
        )));
    }
    let mut server = PtyServer::open().map_err(Failure::bad)?;
    let _link = match &args.link {
        Some(path) => Some(Link::new(path, server.path()).map_err(Failure::bad)?),
        None => None,
    };
    let path = server.path().to_owned();
    if global.json {
        println!("{}", serde_json::json!({ "port": path }));
    } else {
        println!("{path}");
    }
    // Programs that wait for the path read from a pipe.
    let _ = std::io::stdout().flush();
    let mut controller = Controller::new(Settings::of_machine(&machine));
    let how = Serve {
        speed: args.speed.0,
        once: args.once,
        reset_on_open: machine.connection.is_some_and(|c| c.reset_on_open)
            && !args.no_reset_on_open,
    };
    server.run(&mut controller, how, |_| terminal.interrupted());
    // The line is gone, the machine is not: what it had in its buffers still runs, as on a real one.
    drop(server);
    controller.run_out(3600.0);
    let summary = RehearsalSummary::of(&controller);
    if global.json {
        println!(
            "{}",
            serde_json::json!({ "time_s": controller.now_s(), "burnt": summary })
        );
    } else if !global.quiet {
        println!(
            "burnt: {} cuts, {:.1} mm; while standing: {:.2} s; beam {} at the end",
            summary.strokes,
            summary.burnt_mm,
            summary.standing_burn_s,
            if summary.beam_on_at_end { "ON" } else { "off" },
        );
    }
    Ok(())
}
