//! `kagome resume`.

use std::io::IsTerminal as _;

use clap::Args;

use super::question::agrees;
use super::send::{JobArgs, prepare, print};
use super::{Failure, Global, Terminal};
use crate::base::progress::Progress as _;
use crate::control::journal::{self, FileStore, Journal};
use crate::control::{Cuts, Question, resume};

/// Go on with a job that was stopped, at the first cut that is not proven to be made
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  \
    kagome resume mask/job.nc --port /dev/ttyUSB0\n\n\
    Leave the sheet where it is. If the controller has lost its position it is homed, or you put the head over the job's \
    zero point; then the head goes with the beam off to a cut of the sheet, and you say whether it stands over it. Nothing \
    is cut before that. At most max_unconfirmed_cuts of the machine's profile (3) are cut twice.")]
pub struct ResumeArgs {
    #[command(flatten)]
    what: JobArgs,
    /// Home the machine if it has lost its position, without being asked: its way is free
    #[arg(long)]
    home: bool,
    /// If the controller has lost its position and cannot home: the head stands over the job's zero point
    #[arg(long)]
    zero_here: bool,
    /// If a torch cannot be raised by as much as between two cuts: it hangs clear of the sheet
    #[arg(long)]
    torch_clear: bool,
    /// Do not ask whether the head, sent dark to a cut of the sheet, stands over it: it does
    #[arg(long)]
    at_reference: bool,
}

impl ResumeArgs {
    /// What the flags say, else what the person says; without either, no.
    fn answer(&self, question: &Question, terminal: &Terminal) -> bool {
        let (given, flag) = match question {
            Question::Home => (self.home, "--home"),
            Question::ZeroHere { .. } => (self.zero_here, "--zero-here"),
            Question::TorchClear { .. } => (self.torch_clear, "--torch-clear"),
            Question::AtReference { .. } => (self.at_reference, "--at-reference"),
        };
        if given {
            return true;
        }
        terminal.clear();
        if !(std::io::stdin().is_terminal() && std::io::stderr().is_terminal()) {
            terminal.note(&format!(
                "{question}? Nobody is here to answer; {flag} says yes"
            ));
            return false;
        }
        agrees(&question.to_string(), terminal)
    }
}

/// Resumes.
pub fn run(args: &ResumeArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let what = &args.what;
    let ready = prepare(what, terminal)?;
    if ready.port.is_sim() {
        return Err(Failure::Bad(
            "the machine that is built in forgets its sheet when the program ends: there is nothing to resume. `kagome sim` serves one that stays".into(),
        ));
    }
    let cuts = Cuts::of(&ready.job).map_err(|why| {
        Failure::Bad(format!(
            "the head cannot be followed through this job ({why}), so nobody can say where it was stopped"
        ))
    })?;
    let path = journal::path_for(&what.at.job);
    let here = |why: String| Failure::Bad(format!("{}: {why}. Nothing was sent", path.display()));
    let bytes = std::fs::read(&path).map_err(|error| {
        here(format!(
            "{error}; without its journal nobody can say what is cut. `kagome send` begins the job anew"
        ))
    })?;
    let header = ready.header(&what.at.job, &cuts);
    let mut journal = Journal::continued(header, &bytes, FileStore::new(&path))
        .map_err(|error| here(error.to_string()))?;
    let desk = ready.desk(global, terminal);
    let report = ready.at_port(terminal, |port| {
        resume(
            port,
            &ready.job,
            &cuts,
            &ready.options,
            &desk,
            &mut journal,
            &mut |question| {
                desk.release_keys();
                args.answer(question, terminal)
            },
        )
    })?;
    drop(desk);
    print(global, &report, None);
    Ok(())
}
