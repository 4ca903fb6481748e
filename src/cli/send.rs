//! `kagome send`.

use std::io::IsTerminal as _;
use std::path::Path;

use clap::Args;

use super::cut::drawing_of;
use super::desk::{Desk, Show};
use super::job_args::JobAt;
use super::port_args::Port;
use super::question::agrees;
use super::timetable::Timetable;
use super::{Failure, Global, Terminal};
use crate::base::progress::Progress as _;
use crate::base::units::short;
use crate::control::journal::{self, FileStore, Header, History, Journal};
use crate::control::{
    Awake, Console, Cuts, Job, JobReach, JobRules, SendError, SendOptions, SendReport, Streaming,
    Transport, send, send_recorded,
};
use crate::machine::{Connection, HandOver, Machine};
use crate::sim::{RehearsalError, RehearsalSummary, Settings, rehearse};
use crate::{gcode, pattern};

/// Send a job to a machine, and stop it with proof if anything goes wrong
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    kagome send mask/job.nc --port sim\n  \
    kagome send mask/job.nc --port /dev/ttyUSB0\n\n\
    Ctrl-C holds the machine, resets it, and waits until it reports that the beam is off.\n\
    What is proven to be cut stands in a journal beside the job (job.nc.journal): after Ctrl-C, a pulled cable, a crash or \
    a power cut `kagome resume` goes on from there.")]
pub struct SendArgs {
    #[command(flatten)]
    what: JobArgs,
    /// Keep no journal: a job that is stopped cannot be resumed
    #[arg(long)]
    no_journal: bool,
    /// First have the controller read the whole job without moving ($C)
    #[arg(long)]
    check: bool,
    /// Begin without being asked
    #[arg(long, short)]
    yes: bool,
}

/// A job and where it goes.
#[derive(Args, Debug)]
pub(super) struct JobArgs {
    #[command(flatten)]
    pub at: JobAt,
    /// Send a job that uses M3: its beam stays on if the cable is pulled. Stay beside the machine
    #[arg(long)]
    allow_constant_power: bool,
    /// The S word of full power that the job was made for; the controller's $30 must be the same [default: the
    /// profile's]
    #[arg(long, value_name = "S")]
    s_max: Option<f64>,
}

/// The job must be good for the machine, and cut its sheet if the drawing lies beside it: what `verify` would say.
fn check_job(path: &Path, text: &[u8], machine: &Machine, args: &JobArgs) -> Result<(), Failure> {
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

/// A job that may be sent, and how.
pub(super) struct Ready {
    text: Vec<u8>,
    rules: JobRules,
    pub machine: Option<Machine>,
    pub job: Job,
    pub options: SendOptions,
    /// Where the machine is.
    pub port: Port,
    reach: Option<JobReach>,
}

impl Ready {
    /// The journal's first lines.
    pub fn header(&self, path: &Path, cuts: &Cuts) -> Header {
        let ahead = self
            .machine
            .as_ref()
            .and_then(|m| m.connection.as_ref()?.max_unconfirmed_cuts)
            .unwrap_or(Connection::UNCONFIRMED_CUTS);
        let name = path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let machine = self.machine.as_ref().map_or("", |m| &m.name);
        Header::of(&self.job, cuts, &name, machine, ahead as usize)
    }

    /// What the person sees and presses while it runs.
    pub fn desk<'a>(&self, global: &Global, terminal: &'a Terminal) -> Desk<'a> {
        let show = match (global.json, global.quiet) {
            (true, _) => Show::Events,
            (false, true) => Show::Nothing,
            (false, false) if terminal.is_watched() && std::io::stdin().is_terminal() => Show::Line,
            (false, false) => Show::Plain,
        };
        let times = match show {
            Show::Nothing => Timetable::default(),
            _ => Timetable::of(&self.job, &self.settings()),
        };
        Desk::new(terminal, show, times)
    }

    /// What the controller is taken for where a job is timed or rehearsed.
    fn settings(&self) -> Settings {
        let mut settings = self
            .machine
            .as_ref()
            .map_or_else(Settings::default, Settings::of_machine);
        settings.s_max = self.options.s_max.unwrap_or(settings.s_max);
        settings
    }

    /// What will happen, in words.
    fn words(&self, cuts: Option<&Cuts>, time_s: Option<f64>) -> Vec<String> {
        let mut lines = Vec::new();
        let s = self.job.largest_s();
        let power = match self.options.s_max {
            _ if self.job.is_torch() => "with the torch".into(),
            Some(s_max) => format!("up to {} % of its power", short(100.0 * s / s_max, 1)),
            None => format!("up to S{}", short(s, 1)),
        };
        let mode = if self.job.is_torch() {
            "which stays on if the link is lost: keep a hand on its switch"
        } else if self.job.constant_power() {
            "CONSTANT (M3): it stays on if the link is lost"
        } else {
            "dynamic (M4): off whenever the head stands"
        };
        lines.push(match self.reach.and_then(|r| r.burnt_mm) {
            Some([low, high]) => format!(
                "will burn from X{} Y{} to X{} Y{} of the work, {power}, {mode}",
                short(low[0], 1),
                short(low[1], 1),
                short(high[0], 1),
                short(high[1], 1)
            ),
            None => "will burn nothing".into(),
        });
        let cuts = cuts.map_or_else(String::new, |c| format!("{} cuts, ", c.len()));
        if let Some(time) = time_s {
            lines.push(format!(
                "{cuts}about {} min {} s on {}",
                short((time / 60.0).floor(), 0),
                short(time % 60.0, 0),
                self.machine
                    .as_ref()
                    .map_or("a machine with GRBL's defaults", |m| &m.name)
            ));
        }
        lines
    }

    /// Whether the person at the terminal wants it. Without one there is nobody to ask, and the call itself was the order.
    fn agreed(&self, cuts: Option<&Cuts>, desk: &Desk<'_>, terminal: &Terminal) -> bool {
        if !(std::io::stdin().is_terminal() && std::io::stderr().is_terminal()) {
            return true;
        }
        terminal.clear();
        for line in self.words(cuts, desk.whole_s()) {
            terminal.note(&line);
        }
        agrees(
            "Does the sheet lie in its place, and will you stay beside the machine",
            terminal,
        )
    }

    /// Opens the port and does something over it that must be brought to its end.
    pub fn at_port<T>(
        &self,
        terminal: &Terminal,
        work: impl FnOnce(&mut dyn Transport) -> Result<T, SendError>,
    ) -> Result<T, Failure> {
        let machine = self.machine.as_ref();
        let result = self.port.open(machine, terminal, |line| {
            self.port.remember(machine, terminal);
            let _awake = Awake::ask("a machine is running a job");
            work(line)
        })?;
        result.map_err(failure)
    }
}

/// Reads a job and its machine's profile, and judges the one by the other.
pub(super) fn prepare(args: &JobArgs, terminal: &Terminal) -> Result<Ready, Failure> {
    let (text, machine) = args.at.read()?;
    let path = &args.at.job;
    if let Some(m) = machine.as_ref().filter(|m| !m.controller.is_streamed()) {
        return Err(Failure::Bad(format!(
            "machine {} has {}, to which nothing is streamed: open {} there as a file. Nothing was sent",
            m.name,
            m.controller,
            path.display()
        )));
    }
    let mut rules = machine
        .as_ref()
        .map_or_else(JobRules::default, JobRules::of);
    rules.allow_constant_power |= args.allow_constant_power;
    if args.s_max.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
        return Err(Failure::Bad("--s-max must be a number above zero".into()));
    }
    let s_max = args
        .s_max
        .or(machine.as_ref().and_then(|m| Some(m.laser()?.s_max)));
    // First the plain faults, in the sender's words.
    let job = Job::check(&text, &rules)
        .map_err(|error| Failure::Bad(format!("{}: {error}", path.display())))?;
    if let Some(machine) = &machine {
        check_job(path, &text, machine, args)?;
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
    let connection = machine.as_ref().and_then(|m| m.connection.as_ref());
    let reach = JobReach::of(
        &String::from_utf8_lossy(&text),
        machine
            .as_ref()
            .map_or(gcode::Dialect::Laser, gcode::Dialect::of),
    );
    let options = SendOptions {
        s_max,
        made_for: machine.clone().map(|m| Box::new((m, reach))),
        buffer: connection.map(|c| c.receive_buffer_bytes as usize),
        streaming: match connection.and_then(|c| c.streaming) {
            Some(HandOver::Answered) => Streaming::Answered,
            Some(HandOver::Counted) | None => Streaming::Counted,
        },
        ..SendOptions::default()
    };
    Ok(Ready {
        port: args.at.port(machine.as_ref())?,
        reach,
        text,
        rules,
        machine,
        job,
        options,
    })
}

/// Sends a job.
pub fn run(args: &SendArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let what = &args.what;
    let ready = prepare(what, terminal)?;
    if ready.port.is_sim() {
        return rehearsal(&ready, what, global, terminal);
    }
    let cuts = match Cuts::of(&ready.job) {
        _ if args.no_journal => None,
        Ok(cuts) if cuts.is_empty() => None,
        Ok(cuts) => Some(cuts),
        Err(why) => {
            terminal.note(&format!(
                "the head cannot be followed through this job ({why}): it is sent without a journal, and if it is stopped it cannot be resumed"
            ));
            None
        }
    };
    let desk = ready.desk(global, terminal);
    if !args.yes && !ready.agreed(cuts.as_ref(), &desk, terminal) {
        return Err(Failure::No("nothing was sent".into()));
    }
    let report = ready.at_port(terminal, |port| {
        if args.check {
            Console::open(port, terminal)
                .and_then(|mut console| console.dry_run(&ready.job))
                .map_err(|error| SendError::NotReady {
                    why: error.to_string(),
                })?;
        }
        let Some(cuts) = &cuts else {
            return send(port, &ready.job, &ready.options, &desk);
        };
        let path = journal::path_for(&what.at.job);
        tell_of_old(&path, terminal);
        let header = ready.header(&what.at.job, cuts);
        let mut journal = Journal::new(header, FileStore::new(&path));
        let sent = send_recorded(port, &ready.job, cuts, &ready.options, &desk, &mut journal);
        if let Err(error) = &sent
            && error.confirmed().is_some()
        {
            terminal.note(&format!(
                "what is cut stands in {}: `kagome resume {}` goes on from there",
                path.display(),
                what.at.job.display()
            ));
        }
        sent
    })?;
    drop(desk);
    print(global, &report, None);
    Ok(())
}

/// The journal of an earlier run is put aside; if that run was not finished, the person should know where.
fn tell_of_old(path: &Path, terminal: &Terminal) {
    if let Ok(bytes) = std::fs::read(path)
        && let Ok(history) = History::read(&bytes)
        && !history.finished
    {
        terminal.note(&format!(
            "an earlier run of this job was stopped after {} of {} cuts; the job now begins anew, and the old journal is kept as {}",
            history.proven,
            history.header.cuts,
            FileStore::aside(path).display()
        ));
    }
}

/// The job on the machine that is built in.
fn rehearsal(
    ready: &Ready,
    what: &JobArgs,
    global: &Global,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let rehearsal =
        rehearse(&ready.text, &ready.settings(), &ready.rules, terminal).map_err(|error| {
            match error {
                RehearsalError::Job(error) => {
                    Failure::Bad(format!("{}: {error}", what.at.job.display()))
                }
                RehearsalError::Send(error) => failure(*error),
            }
        })?;
    terminal.clear();
    print(global, &rehearsal.report, Some(&rehearsal.summary));
    Ok(())
}

/// A machine that cannot be reached is bad input; one that stopped, or refuses, is an answer.
pub(super) fn failure(error: SendError) -> Failure {
    match error {
        SendError::Connect { .. } | SendError::NoController { .. } => Failure::bad(error),
        _ => Failure::No(error.to_string()),
    }
}

pub(super) fn print(global: &Global, report: &SendReport, summary: Option<&RehearsalSummary>) {
    if global.json {
        println!(
            "{}",
            serde_json::json!({ "event": "end", "report": report, "rehearsal": summary })
        );
        return;
    }
    println!(
        "{} lines sent and acknowledged; the machine stands and its beam is off ({})",
        report.acknowledged, report.firmware
    );
    if report.cuts > 0 {
        println!("{} cuts, each seen to be made", report.cuts);
    }
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
