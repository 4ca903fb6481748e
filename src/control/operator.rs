//! The person at the machine while a job runs: what they wish, and what they are shown.

use std::time::Duration;

use super::reply::{MachineState, Status};
use crate::base::progress::{Progress, Silent, StopFlag};

/// By how much an override changes, in per cent of what the job says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Back to 100 %.
    Reset,
    /// 10 % more.
    More,
    /// 10 % less.
    Less,
    /// 1 % more.
    SlightlyMore,
    /// 1 % less.
    SlightlyLess,
}

/// What a person wishes of a running job. To end it is [`Progress::interrupted`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Feed hold: the head brakes, the beam is off once it stands.
    Pause,
    /// Go on after a hold.
    Resume,
    /// The feed of cuts, 10 to 200 %.
    Feed(Change),
    /// The power, 10 to 200 %, never above the controller's full power.
    Power(Change),
    /// Rapids at 100, 50 or 25 %: `Reset`, `Less` and `SlightlyLess`.
    Rapid(Change),
}

impl Wish {
    /// GRBL's real-time command for it.
    pub fn byte(self) -> u8 {
        let of = |first: u8, change: Change| {
            first
                + match change {
                    Change::Reset => 0,
                    Change::More => 1,
                    Change::Less => 2,
                    Change::SlightlyMore => 3,
                    Change::SlightlyLess => 4,
                }
        };
        match self {
            Self::Pause => b'!',
            Self::Resume => b'~',
            Self::Feed(change) => of(0x90, change),
            Self::Rapid(Change::Reset | Change::More | Change::SlightlyMore) => 0x95,
            Self::Rapid(Change::Less) => 0x96,
            Self::Rapid(Change::SlightlyLess) => 0x97,
            Self::Power(change) => of(0x99, change),
        }
    }
}

/// Where a running job is, by what the machine has done.
#[derive(Clone, Copy, Debug)]
pub struct Glance<'a> {
    /// The machine's last report.
    pub status: &'a Status,
    /// Where the head is, work coordinates, mm.
    pub work_mm: Option<[f64; 2]>,
    /// Cuts proven to be made, those of earlier runs included.
    pub cuts: usize,
    /// Cuts of the whole job; 0 if it cannot be followed.
    pub of_cuts: usize,
    /// Lines acknowledged.
    pub acknowledged: usize,
    /// Lines of this run.
    pub lines: usize,
    /// How many of them are done for sure: those up to the last proven cut.
    pub done_lines: usize,
    /// Since the first line was sent, on the link's clock.
    pub elapsed: Duration,
}

impl Glance<'_> {
    /// Whether the machine is held.
    pub fn paused(&self) -> bool {
        matches!(
            self.status.state,
            MachineState::Hold(_) | MachineState::Door(_)
        )
    }
}

/// Shows a running job to a person and passes on their wishes. The methods are called from the loop that streams: they must
/// come back at once.
pub trait Operator: Progress {
    /// The next wish, if there is one.
    fn wish(&self) -> Option<Wish> {
        None
    }

    /// After every report of the machine.
    fn glance(&self, glance: &Glance<'_>) {
        let _ = glance;
    }
}

impl Operator for Silent {}
impl Operator for StopFlag {}

/// Nobody: progress alone.
pub struct Unattended<'a>(pub &'a dyn Progress);

impl Progress for Unattended<'_> {
    fn start(&self, step: &str, total: Option<u64>) {
        self.0.start(step, total);
    }

    fn advance(&self, done: u64) {
        self.0.advance(done);
    }

    fn note(&self, text: &str) {
        self.0.note(text);
    }

    fn interrupted(&self) -> bool {
        self.0.interrupted()
    }
}

impl Operator for Unattended<'_> {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wishes_are_the_bytes_of_the_protocol() {
        for (wish, byte) in [
            (Wish::Pause, 0x21),
            (Wish::Resume, 0x7e),
            (Wish::Feed(Change::Reset), 0x90),
            (Wish::Feed(Change::More), 0x91),
            (Wish::Feed(Change::Less), 0x92),
            (Wish::Feed(Change::SlightlyMore), 0x93),
            (Wish::Feed(Change::SlightlyLess), 0x94),
            (Wish::Rapid(Change::Reset), 0x95),
            (Wish::Rapid(Change::Less), 0x96),
            (Wish::Rapid(Change::SlightlyLess), 0x97),
            (Wish::Power(Change::Reset), 0x99),
            (Wish::Power(Change::More), 0x9a),
            (Wish::Power(Change::Less), 0x9b),
            (Wish::Power(Change::SlightlyMore), 0x9c),
            (Wish::Power(Change::SlightlyLess), 0x9d),
        ] {
            assert_eq!(wish.byte(), byte, "{wish:?}");
        }
    }
}
