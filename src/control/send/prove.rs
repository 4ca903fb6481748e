//! Cuts proven by position, written to the journal, and what may be sent after them.

use super::reason::StopReason;
use super::report::Proof;
use super::{Sender, Trouble};
use crate::control::follow::Sighting;
use crate::control::journal::Record;
use crate::control::reply::{MachineState, Status};

/// A head farther than this from the way of its job is not there by rounding, mm.
pub(super) const ASTRAY_MM: f64 = 1.0;
/// So many reports in a row must show it: one may be damaged.
const ASTRAY_REPORTS: u32 = 3;
/// Reports that are a little off: each adds 1 to the doubt, each other one takes so much away.
const FORGIVEN: f64 = 0.1;
/// From so much doubt on, the controller's reports are coarser than their decimals, and where they show the head proves
/// nothing. Damaged ones are rarer.
const COARSE: f64 = 3.0;
/// And above this one they prove nothing for the moment.
const DOUBTED: f64 = 0.5;

impl Sender<'_> {
    /// Where a report shows the head, work coordinates, mm.
    pub(super) fn work_mm(&self, status: Option<&Status>) -> Option<[f64; 2]> {
        let status = status?;
        let [x, y, _] = status.position_mm?;
        Some(if status.is_work {
            [x, y]
        } else {
            let offset = status.offset_mm.unwrap_or(self.offset_mm);
            [x - offset[0], y - offset[1]]
        })
    }

    /// Where a report shows the head, machine coordinates, mm.
    pub(super) fn machine_mm(&self, status: &Status) -> Option<[f64; 3]> {
        let place = status.position_mm?;
        Some(if status.is_work {
            let offset = status.offset_mm.unwrap_or(self.offset_mm);
            std::array::from_fn(|k| place[k] + offset[k])
        } else {
            place
        })
    }

    /// Looks a report up on the way of the job. `rested`: this and the report before it were asked for after everything
    /// sent had been acknowledged, and both show the machine idle.
    pub(super) fn follow(&mut self, status: &Status, rested: bool) -> Result<(), Trouble> {
        let sighting = self.sight(status);
        if matches!(sighting, Some(Sighting::Astray { .. })) {
            self.doubt += 1.0;
        } else {
            self.doubt = (self.doubt - FORGIVEN).max(0.0);
        }
        let newly = self.doubt >= COARSE && !std::mem::replace(&mut self.coarse, true);
        if newly && self.journal.is_some() {
            self.progress.note(
                "the controller tells its position more coarsely than it seems, so cuts are proven only when it comes to rest: the machine will stand for a moment every few cuts",
            );
        }
        match sighting {
            Some(Sighting::Astray { by_mm }) if by_mm > ASTRAY_MM => {
                self.astray += 1;
                if self.astray >= ASTRAY_REPORTS {
                    return Err(Trouble::Stop(StopReason::Astray { by_mm }));
                }
            }
            _ => self.astray = 0,
        }
        if let Some(follower) = self.follower.as_mut().filter(|_| rested) {
            follower.rested(self.sent);
        }
        self.write_proven()
            .map_err(|why| Trouble::Stop(StopReason::Journal(why)))
    }

    /// Looks a report up on the way of the job.
    pub(super) fn sight(&mut self, status: &Status) -> Option<Sighting> {
        if let Some(offset) = status.offset_mm {
            self.offset_mm = offset;
        }
        let in_job = matches!(
            status.state,
            MachineState::Idle | MachineState::Run | MachineState::Hold(_) | MachineState::Door(_)
        );
        let at = self.work_mm(Some(status)).filter(|_| in_job)?;
        let follower = self.follower.as_mut()?;
        // While a report a little off the way is fresh, the others may be rounded as well.
        if self.coarse || self.doubt > DOUBTED {
            return Some(follower.looked_up(at, self.sent));
        }
        Some(follower.sighted(at, self.sent))
    }

    /// What is newly proven goes to the journal, and only then counts.
    fn write_proven(&mut self) -> Result<(), String> {
        let proven = self.follower.as_ref().map_or(0, |f| f.proven());
        if proven > self.proven {
            if let Some(journal) = self.journal.as_deref_mut() {
                journal
                    .write(&Record::Cuts(self.earlier + proven))
                    .map_err(|error| error.to_string())?;
            }
            self.proven = proven;
            self.allow();
        }
        Ok(())
    }

    /// How many lines may be sent: those before the first cut that would be one too many.
    pub(super) fn allow(&mut self) {
        self.allowed = match (&self.journal, self.cuts) {
            (Some(journal), Some(cuts)) => {
                cuts.lines_before(self.proven + journal.max_unconfirmed())
            }
            _ => usize::MAX,
        };
    }

    /// Proofs hold the next line back, and nothing else.
    pub(super) fn held_back(&self) -> bool {
        self.sent >= self.allowed
    }

    /// After a stop: what the last reports proved, and where the machine stands.
    pub(super) fn note_stopped(&mut self, proof: &Proof) {
        let kept = matches!(
            proof,
            Proof::BeamOff {
                position_kept: true
            }
        );
        let at = self.status.as_ref().and_then(|s| self.machine_mm(s));
        // The job is being stopped already: a journal that cannot be written leaves the last proofs out, and a resume
        // begins a little earlier.
        let written = self.write_proven().is_ok();
        if let Some(journal) = self.journal.as_deref_mut().filter(|_| written) {
            let _ = journal.write(&Record::Stopped {
                kept_mm: at.filter(|_| kept),
            });
        }
    }
}
