//! `kagome send`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::cut::drawing_of;
use super::profiles::{machine_named, own_folder};
use super::{Failure, Global, Terminal};
use crate::base::progress::Progress as _;
use crate::control::{Job, JobRules, SendError, SendOptions, SendReport, SerialTransport, send};
use crate::machine::{self, Machine};
use crate::sim::{RehearsalError, RehearsalSummary, Settings, rehearse};
use crate::{gcode, pattern};

/// Send a job to a machine, and stop it with proof if anything goes wrong
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    kagome send mask/job.nc --port sim\n  \
    kagome send mask/job.nc --port /dev/ttyUSB0\n\n\
    Ctrl-C holds the machine, resets it, and waits until it reports that the beam is off.")]
pub struct SendArgs {
    /// The job: a G-code file
    job: PathBuf,
    /// The machine's port (see `kagome ports`), or `sim` for the machine that is built in
    #[arg(long)]
    port: String,
    /// The machine's profile [default: the one that the job's header names]
    #[arg(long, value_name = "NAME|FILE")]
    machine: Option<String>,
    /// Rate of the serial line [default: the profile's, or 115200]
    #[arg(long)]
    baud: Option<u32>,
    /// Send a job that uses M3: its beam stays on if the cable is pulled. Stay beside the machine
    #[arg(long)]
    allow_constant_power: bool,
    /// The S word of full power that the job was made for; the controller's $30 must be the same [default: the
    /// profile's]
    #[arg(long, value_name = "S")]
    s_max: Option<f64>,
}

/// What GRBL boards use unless they were built otherwise.
const STANDARD_BAUD: u32 = 115_200;

/// The profile asked for, else the one that the job's header names, else none: G-code of other programs may come
/// without a profile to compare with.
pub(super) fn machine_for(asked: Option<&str>, job: &[u8]) -> Result<Option<Machine>, Failure> {
    if let Some(name) = asked {
        let found = machine_named(name).map_err(Failure::bad)?;
        return machine::load(&found).map(Some).map_err(Failure::bad);
    }
    let text = String::from_utf8_lossy(job);
    let Some(named) = gcode::machine_of(&text) else {
        return Ok(None);
    };
    // What a header says is no path.
    let own = own_folder().and_then(|own| machine::own_file(&own, named));
    if !own.is_some_and(|file| file.is_file())
        && !machine::shipped().any(|(shipped, _)| shipped == named)
    {
        return Err(Failure::Bad(format!(
            "the job was made for the machine {named}, which is neither a shipped profile nor one of your own: name its file with --machine"
        )));
    }
    let found = machine_named(named).map_err(Failure::bad)?;
    machine::load(&found).map(Some).map_err(Failure::bad)
}

/// The job must be good for the machine, and cut its sheet if the drawing lies beside it: what `verify` would say.
fn check_job(path: &Path, text: &[u8], machine: &Machine, args: &SendArgs) -> Result<(), Failure> {
    let text = String::from_utf8_lossy(text);
    // Only our own jobs belong to the drawing beside them.
    let ours = gcode::machine_of(&text).is_some();
    let beside = drawing_of(path).filter(|_| ours);
    let sheet = match &beside {
        Some(beside) => {
            let wrong = |e: String| Failure::Bad(format!("{}: {e}", beside.display()));
            let drawing = std::fs::read_to_string(beside)
                .map_err(|e| wrong(format!("cannot be read: {e}")))?;
            Some(pattern::read_svg(&drawing).map_err(|e| wrong(e.to_string()))?)
        }
        None => None,
    };
    let verdict = gcode::verify(&text, machine, sheet.as_ref(), None).map_err(Failure::bad)?;
    let findings: Vec<String> = verdict
        .findings
        .iter()
        .filter(|f| !(args.allow_constant_power && f.rule == gcode::Rule::ConstantPower))
        .take(SHOWN)
        .map(|f| format!("\n  {f}"))
        .collect();
    if findings.is_empty() {
        return Ok(());
    }
    Err(Failure::No(format!(
        "{} is not good for {}; nothing was sent. `kagome verify` lists everything{}",
        path.display(),
        machine.name,
        findings.concat()
    )))
}

/// Findings shown; `verify` shows the rest.
const SHOWN: usize = 5;

/// Sends a job.
pub fn run(args: &SendArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let text = std::fs::read(&args.job).map_err(|error| {
        Failure::Bad(format!(
            "cannot read {}: {error}; nothing was sent",
            args.job.display()
        ))
    })?;
    let machine = machine_for(args.machine.as_deref(), &text)?;
    if let Some(m) = machine.as_ref().filter(|m| !m.controller.is_streamed()) {
        return Err(Failure::Bad(format!(
            "machine {} has {}, to which nothing is streamed: open {} there as a file. Nothing was sent",
            m.name,
            m.controller,
            args.job.display()
        )));
    }
    let rules = JobRules {
        allow_constant_power: args.allow_constant_power,
        line_limit: machine
            .as_ref()
            .map_or(JobRules::default().line_limit, Machine::line_limit),
    };
    if args.s_max.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
        return Err(Failure::Bad("--s-max must be a number above zero".into()));
    }
    let s_max = args
        .s_max
        .or(machine.as_ref().and_then(|m| Some(m.laser()?.s_max)));
    let here = |error| Failure::Bad(format!("{}: {error}", args.job.display()));
    if let Some(machine) = &machine {
        // First the plain faults, in the sender's words.
        Job::check(&text, &rules)
            .map_err(|error| Failure::Bad(format!("{}: {error}", args.job.display())))?;
        check_job(&args.job, &text, machine, args)?;
        if let Some(made_for) = gcode::machine_of(&String::from_utf8_lossy(&text))
            && made_for != machine.name
        {
            terminal.note(&format!(
                "warning: the job was made for {made_for}, it goes to {}: powers and speeds may not suit it",
                machine.name
            ));
        }
    } else {
        terminal.note(
            "the job names no machine profile: bed and sheet are not checked (see --machine)",
        );
    }
    if args.port == "sim" {
        let mut settings = machine
            .as_ref()
            .map_or_else(Settings::default, Settings::of_machine);
        if let Some(s_max) = s_max {
            settings.s_max = s_max;
        }
        let rehearsal =
            rehearse(&text, &settings, &rules, terminal).map_err(|error| match error {
                RehearsalError::Job(error) => here(error),
                RehearsalError::Send(error) => failure(*error),
            })?;
        terminal.clear();
        print(global, &rehearsal.report, Some(&rehearsal.summary));
        return Ok(());
    }
    let job = Job::check(&text, &rules).map_err(here)?;
    let options = SendOptions {
        s_max,
        buffer: machine
            .as_ref()
            .and_then(|m| Some(m.connection.as_ref()?.receive_buffer_bytes as usize)),
        ..SendOptions::default()
    };
    // From the opening on: it resets the board, and an exit in between would leave it to itself.
    let Some(guard) = terminal.forbid_exit() else {
        return Err(Failure::Bad(
            "Ctrl-C cannot be caught here, so a running job could not be stopped with proof; nothing was sent".into(),
        ));
    };
    let baud = args
        .baud
        .or(machine.and_then(|m| Some(m.connection?.baud)))
        .unwrap_or(STANDARD_BAUD);
    let mut port = SerialTransport::open(&args.port, baud).map_err(Failure::bad)?;
    let result = send(&mut port, &job, &options, terminal);
    drop(guard);
    terminal.clear();
    let report = result.map_err(failure)?;
    print(global, &report, None);
    Ok(())
}

/// A machine that cannot be reached is bad input; one that stopped, or refuses, is an answer.
pub(super) fn failure(error: SendError) -> Failure {
    match error {
        SendError::Connect { .. } | SendError::NoController { .. } => Failure::bad(error),
        _ => Failure::No(error.to_string()),
    }
}

fn print(global: &Global, report: &SendReport, summary: Option<&RehearsalSummary>) {
    if global.json {
        println!(
            "{}",
            serde_json::json!({ "report": report, "rehearsal": summary })
        );
        return;
    }
    println!(
        "{} lines sent and acknowledged; the machine stands and its beam is off ({})",
        report.acknowledged, report.firmware
    );
    let minutes = (report.time_s / 60.0).floor();
    println!(
        "time: {minutes:.0} min {:.1} s",
        report.time_s - 60.0 * minutes
    );
    if let Some(s) = summary {
        println!(
            "burnt: {} cuts, {:.1} mm, beam on for {:.1} s",
            s.strokes, s.burnt_mm, s.beam_on_s
        );
        println!(
            "burnt while standing: {:.2} s; on rapids: {:.2} mm",
            s.standing_burn_s, s.rapid_burn_mm
        );
    }
}
