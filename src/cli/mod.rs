//! The command line: one file a verb, each a thin caller of the library.
//!
//! Exit codes: 0 done, 1 the answer is no, 2 bad usage or bad input. Results go to standard output (`--json` for
//! machines), everything else to standard error.

pub mod calibrate;
pub mod console;
pub mod cut;
mod desk;
pub mod flatten;
pub mod form;
pub mod inspect;
mod inspect_linkage;
mod job_args;
pub mod layout_args;
pub mod machines;
pub mod make;
pub mod materials;
mod port_args;
pub mod ports;
pub mod pose;
mod profiles;
mod question;
pub mod resume;
mod samples;
pub mod send;
pub mod sheet_args;
pub mod sim;
pub mod states;
pub mod surface_args;
pub mod template;
mod terminal;
mod timetable;
pub mod verify;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

pub use terminal::{ExitGuard, Terminal};

/// From a surface to a verified, rehearsed cut.
#[derive(Parser)]
#[command(
    name = "kagome",
    version,
    propagate_version = true,
    max_term_width = 100
)]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    verb: Verb,
}

/// Options that every verb takes.
#[derive(Args, Clone, Debug)]
pub struct Global {
    /// Print the result as JSON on standard output
    #[arg(long, global = true)]
    pub json: bool,
    /// No progress and no remarks, only the result and errors
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

#[derive(Subcommand)]
enum Verb {
    /// From a surface to a verified, rehearsed job: the main thing
    Make(Box<make::MakeArgs>),
    /// From a drawing, as `make` wrote it or edited since, to a verified, rehearsed job
    Cut(cut::CutArgs),
    /// Print a drawing at true size: a PDF tiled over pages of paper
    Template(template::TemplateArgs),
    /// A body to form the sheet over: the surface on a flat base, as a watertight STL
    Form(form::FormArgs),
    /// The conformal map alone: try cones, darts and rims before a sheet is made
    Flatten(Box<flatten::FlattenArgs>),
    /// Show what a surface is like (topology, size, curvature, defects), or a linkage.obj (hinges, how it can move)
    Inspect(Box<inspect::InspectArgs>),
    /// Move a linkage by handles and make it exact again
    Pose(pose::PoseArgs),
    /// Open and close a linkage.obj, or go from one state of it to another: a sequence of OBJ, and a glTF that plays it
    States(states::StatesArgs),
    /// List the sample surfaces, or write one as a file
    Samples(samples::SamplesArgs),
    /// List, show, check and start machines
    Machines(machines::MachinesArgs),
    /// List, show, check and start materials
    Materials(materials::MaterialsArgs),
    /// Measure σ, kerf and setting of a sheet on a coupon, into a profile of your own
    Calibrate(calibrate::CalibrateArgs),
    /// Read G-code back and judge it: bed, beam, modes, and every cut of its sheet
    Verify(verify::VerifyArgs),
    Send(send::SendArgs),
    Resume(resume::ResumeArgs),
    Status(console::status::StatusArgs),
    Home(console::home::HomeArgs),
    Unlock(console::unlock::UnlockArgs),
    Jog(console::jog::JogArgs),
    Zero(console::zero::ZeroArgs),
    Frame(console::frame::FrameArgs),
    Settings(console::settings::SettingsArgs),
    Sim(sim::SimArgs),
    Ports(ports::PortsArgs),
}

/// Why a verb did not end with "done".
#[derive(Debug)]
pub enum Failure {
    /// The work was done and the answer is no: exit code 1. The text says what, where and what to do.
    No(String),
    /// The request or its input cannot be used: exit code 2.
    Bad(String),
}

impl Failure {
    /// Bad input, in the words of the error.
    pub fn bad(error: impl std::fmt::Display) -> Self {
        Self::Bad(error.to_string())
    }
}

/// Runs the program with these arguments (the first is its name) and gives its exit code.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // Clap prints help and version through the same path, on standard output and with code 0.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let terminal = Terminal::new(cli.global.quiet);
    let global = &cli.global;
    let result = match &cli.verb {
        Verb::Make(args) => make::run(args, global, &terminal),
        Verb::Cut(args) => cut::run(args, global, &terminal),
        Verb::Template(args) => template::run(args, global, &terminal),
        Verb::Form(args) => form::run(args, global, &terminal),
        Verb::Flatten(args) => flatten::run(args, global, &terminal),
        Verb::Verify(args) => verify::run(args, global, &terminal),
        Verb::Inspect(args) => inspect::run(args, global, &terminal),
        Verb::Pose(args) => pose::run(args, global, &terminal),
        Verb::States(args) => states::run(args, global, &terminal),
        Verb::Samples(args) => samples::run(args, global, &terminal),
        Verb::Materials(args) => materials::run(args, global, &terminal),
        Verb::Calibrate(args) => calibrate::run(args, global, &terminal),
        Verb::Machines(args) => machines::run(args, global, &terminal),
        Verb::Send(args) => send::run(args, global, &terminal),
        Verb::Resume(args) => resume::run(args, global, &terminal),
        Verb::Status(args) => console::status::run(args, global, &terminal),
        Verb::Home(args) => console::home::run(args, global, &terminal),
        Verb::Unlock(args) => console::unlock::run(args, global, &terminal),
        Verb::Jog(args) => console::jog::run(args, global, &terminal),
        Verb::Zero(args) => console::zero::run(args, global, &terminal),
        Verb::Frame(args) => console::frame::run(args, global, &terminal),
        Verb::Settings(args) => console::settings::run(args, global, &terminal),
        Verb::Sim(args) => sim::run(args, global, &terminal),
        Verb::Ports(args) => ports::run(args, global, &terminal),
    };
    terminal.clear();
    report(result)
}

fn report(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::No(text)) => {
            eprintln!("no: {text}");
            ExitCode::from(1)
        }
        Err(Failure::Bad(text)) => {
            eprintln!("error: {text}");
            ExitCode::from(2)
        }
    }
}

/// Text on standard output, ended by a line end. A reader that has gone away (`| head`) is no error worth words.
fn print(text: &str) -> Result<(), Failure> {
    use std::io::Write as _;
    match writeln!(std::io::stdout(), "{}", text.trim_end()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::Bad(format!(
            "standard output cannot be written: {e}"
        ))),
        _ => Ok(()),
    }
}

/// A value as JSON on standard output.
fn print_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value).map_err(Failure::bad)?;
    print(&text)
}
