//! A job read by the controller itself, without motion (`$C`).

use super::{ANSWER, Console, ConsoleError};
use crate::control::Job;
use crate::control::reply::{MachineState, Reply};

impl Console<'_> {
    /// Has the controller check every line of a job: nothing moves, no beam is lit. It is in its normal state again at the end,
    /// also after a line that it refuses; GRBL resets itself for that.
    ///
    /// # Errors
    /// [`ConsoleError::Refused`] with the line of the file.
    pub fn dry_run(&mut self, job: &Job) -> Result<(), ConsoleError> {
        self.dark()?;
        self.ask("$C")?;
        let checking = self.status()?.state;
        if checking != MachineState::Check {
            return Err(ConsoleError::NotReady(format!(
                "the controller does not go into its check mode ($C): it is {checking:?}"
            )));
        }
        self.progress.start(
            "the controller reads the job",
            u64::try_from(job.len()).ok(),
        );
        let patience = ANSWER
            + std::time::Duration::try_from_secs_f64(job.longest_dwell_s()).unwrap_or_default();
        let mut outcome = Ok(());
        for (text, line) in job.lines() {
            if self.progress.interrupted() {
                outcome = Err(ConsoleError::Interrupted("nothing was moved".into()));
                break;
            }
            match self.command(text, patience, |_| Ok(())) {
                Ok(_) => self.progress.advance(1),
                Err(ConsoleError::Refused { error, words, .. }) => {
                    outcome = Err(ConsoleError::Refused {
                        command: format!("line {line} ({text})"),
                        error,
                        words,
                    });
                    break;
                }
                Err(other) => return Err(other),
            }
        }
        self.leave_check()?;
        outcome
    }

    /// Back to the normal state, by whichever way the firmware takes.
    fn leave_check(&mut self) -> Result<(), ConsoleError> {
        self.send(b"$C\n")?;
        let end = self.now() + ANSWER;
        let mut answered = false;
        while self.now() < end {
            match self.next(end)? {
                Some(Reply::Banner(_)) => return Ok(()),
                Some(Reply::Ok) => answered = true,
                // After a refused line grblHAL hears nothing but a reset.
                Some(Reply::Error(_)) => self.send(&[0x18])?,
                _ => {}
            }
            if answered && self.status()?.state == MachineState::Idle {
                return Ok(());
            }
        }
        Err(ConsoleError::NotReady(
            "the controller does not come back from its check mode: reset it (kagome unlock --reset)"
                .into(),
        ))
    }
}
