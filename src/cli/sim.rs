//! `kagome sim`.

use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::profiles::machine_named;
use super::{Failure, Global, Terminal};
use crate::base::progress::Progress as _;
use crate::sim::pty::{Link, PtyServer, Serve};
use crate::sim::tcp::TcpServer;
use crate::sim::{Controller, Mishap, RehearsalSummary, Settings};

/// Serve the simulated machine on a pseudo-terminal or on TCP, for this and other senders
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  \
    kagome sim --link /tmp/laser --speed max &\n  \
    kagome send mask/job.nc --port /tmp/laser\n\n\
    kagome sim --tcp 127.0.0.1:2300 --machine diode-400-fluidnc\n\n\
    The path of the pseudo-terminal, or the address, is the first line printed. Ctrl-C ends the machine; what was burnt is printed then.")]
pub struct SimArgs {
    /// A symbolic link to the pseudo-terminal, under a name that does not change
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Listen on TCP instead: an address and a port, 0 for any that is free. One client at a time
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "link")]
    tcp: Option<String>,
    /// Start as after power-up where the profile has homing: locked until homed
    #[arg(long)]
    locked: bool,
    /// Something that happens to the machine at a time on its clock, s: power-loss, power-returns, reboot, hang or
    /// limit-switch. May be given several times
    #[arg(long, value_name = "WHAT@SECONDS", value_parser = mishap)]
    mishap: Vec<(f64, Mishap)>,
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

fn mishap(text: &str) -> Result<(f64, Mishap), String> {
    const SHAPE: &str =
        "as reboot@12.5: power-loss, power-returns, reboot, hang or limit-switch, and a time in s";
    let (what, at) = text.split_once('@').ok_or(SHAPE)?;
    let at_s = at
        .parse::<f64>()
        .ok()
        .filter(|at_s| at_s.is_finite() && *at_s >= 0.0)
        .ok_or(SHAPE)?;
    let mishap = match what {
        "power-loss" => Mishap::PowerLoss,
        "power-returns" => Mishap::PowerReturns([0.0; 3]),
        "reboot" => Mishap::Reboot,
        "hang" => Mishap::Hang,
        "limit-switch" => Mishap::LimitSwitch,
        _ => return Err(SHAPE.into()),
    };
    Ok((at_s, mishap))
}

/// Says where the machine is to be found.
fn announce(global: &Global, kind: &str, place: &str) {
    if global.json {
        println!("{}", serde_json::json!({ kind: place }));
    } else {
        println!("{place}");
    }
    // Programs that wait for it read from a pipe.
    let _ = std::io::stdout().flush();
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
    let mut settings = Settings::of_machine(&machine);
    if !args.locked {
        // Else it would be locked after every reset, also by the opening of the port.
        settings.homing = false;
        settings.soft_limits = false;
    }
    let mut how = Serve {
        speed: args.speed.0,
        once: args.once,
        reset_on_open: machine.connection.is_some_and(|c| c.reset_on_open)
            && !args.no_reset_on_open,
    };
    let stop = |_: &Controller| terminal.interrupted();
    let switched_on = |settings: Settings| {
        let mut controller = Controller::new(settings);
        for &(at_s, mishap) in &args.mishap {
            controller.schedule(at_s, mishap);
        }
        controller
    };
    let mut controller;
    if let Some(address) = &args.tcp {
        let mut server = TcpServer::open(address).map_err(Failure::bad)?;
        announce(global, "tcp", &server.address().to_string());
        // No line of 10 bits a byte, and none that pulls a reset.
        settings.baud = None;
        how.reset_on_open = false;
        controller = switched_on(settings);
        server.run(&mut controller, how, stop);
    } else {
        let mut server = PtyServer::open().map_err(Failure::bad)?;
        let _link = match &args.link {
            Some(path) => Some(Link::new(path, server.path()).map_err(Failure::bad)?),
            None => None,
        };
        announce(global, "port", server.path());
        controller = switched_on(settings);
        server.run(&mut controller, how, stop);
    }
    // The line is gone, the machine is not: what it had in its buffers still runs, as on a real one.
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
