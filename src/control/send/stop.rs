//! The way out of a running job: hold, wait until it stands, reset, and see that it is dark.

use std::io;
use std::time::Duration;

use super::dark::DOOR;
use super::reason::StopReason;
use super::report::{Confirmed, Proof};
use super::{ANSWER, RESET, SendError, Sender};
use crate::control::reply::{MachineState, Reply};

/// How often the reset is repeated, and how long each waits for the banner: the stop is often wanted because bytes
/// are being lost, and the one that counts may be among them.
const RESETS: u32 = 3;
const BANNER_WAIT: Duration = Duration::from_secs(1);
/// How long a hold may brake, if reports say that it still does: 10 m/min at 10 mm/s² is 17 s.
const BRAKING: Duration = Duration::from_secs(20);
/// How long between status requests while stopping.
const STOP_POLL: Duration = Duration::from_millis(50);

impl Sender<'_> {
    fn confirmed(&self, proof: Proof) -> Box<Confirmed> {
        let last_line = self
            .acknowledged
            .checked_sub(1)
            .and_then(|k| self.job.line(k))
            .map(|(_, number)| number);
        Box::new(Confirmed {
            lines: self.job.len(),
            sent: self.sent,
            acknowledged: self.acknowledged,
            last_line,
            cuts: self.cuts.map_or(0, |c| c.len() + self.earlier),
            proven: self.earlier + self.proven,
            position_mm: self.status.as_ref().and_then(|s| s.position_mm),
            proof,
        })
    }

    fn link_lost(&self, source: io::Error) -> SendError {
        let constant_power = self.job.constant_power();
        SendError::LinkLost {
            port: self.port(),
            source,
            confirmed: self.confirmed(Proof::LinkLost { constant_power }),
        }
    }

    /// The link gave an error. Often it is only hurt: the machine is stopped all the same, as far as it listens.
    pub(super) fn link_failed(&mut self, source: io::Error) -> SendError {
        match self.stop_sequence(false) {
            Ok(proof @ Proof::BeamOff { .. }) => {
                self.note_stopped(&proof);
                SendError::LinkLost {
                    port: self.port(),
                    source,
                    confirmed: self.confirmed(proof),
                }
            }
            _ => self.link_lost(source),
        }
    }

    /// Hold, wait until it stands, reset, and see that it is dark.
    pub(super) fn stop(&mut self, reason: StopReason) -> SendError {
        // After a restart, an alarm or lost bytes the position told may be anything.
        let trusted = matches!(
            reason,
            StopReason::Interrupted
                | StopReason::Refused { .. }
                | StopReason::Paused { .. }
                | StopReason::HeldOn
                | StopReason::BeamOn { .. }
                | StopReason::Journal(_)
        );
        match self.stop_sequence(trusted) {
            Ok(proof) => {
                self.note_stopped(&proof);
                SendError::Stopped {
                    reason,
                    confirmed: self.confirmed(proof),
                }
            }
            Err(source) => self.link_lost(source),
        }
    }

    /// Brings the machine to rest and shows that it is dark. `trusted`: nothing so far speaks against its position.
    ///
    /// An error in the first half (the hold) does not end it: the reset is what puts the beam out.
    pub(super) fn stop_sequence(&mut self, trusted: bool) -> io::Result<Proof> {
        let (stood, undisturbed) = self
            .link
            .send(self.hold())
            .and_then(|()| self.wait_until_still(trusted))
            .unwrap_or_default();
        // Also when it does not stand: in motion a reset puts the beam out at once.
        let mut banner = false;
        let mut failure = None;
        for _ in 0..RESETS {
            match self.reset_and_hear() {
                Ok(heard) => banner = heard,
                Err(error) => failure = Some(error),
            }
            if banner {
                break;
            }
        }
        if let (false, Some(error)) = (banner, failure) {
            return Err(error);
        }
        let deadline = self.now() + ANSWER;
        let mut last = None;
        let mut told_off = false;
        while self.now() < deadline {
            self.link.send(b"?")?;
            let until = self.now() + STOP_POLL;
            while let Some(reply) = self.link.reply_before(until)? {
                if let Reply::Status(status) = reply {
                    let locked = status.state == MachineState::Alarm;
                    if let Some(lit) = status.lit() {
                        told_off = !lit;
                    }
                    // A torch's board may know no power, but it must have told what is switched on.
                    let dark = if self.job.is_torch() {
                        told_off && status.is_still()
                    } else {
                        status.dark_and_still()
                    };
                    last = Some(format!(
                        "{:?}, power {:?}, output on {:?}",
                        status.state, status.s, status.output_on
                    ));
                    self.status = Some(status);
                    if dark && banner {
                        return Ok(Proof::BeamOff {
                            position_kept: stood && undisturbed && trusted && !locked,
                        });
                    }
                }
            }
        }
        Ok(Proof::Unknown {
            why: match (banner, last) {
                (false, _) => "the controller did not answer the reset".into(),
                (true, None) => "it answered the reset but gives no report".into(),
                (true, Some(report)) => format!("its last report was {report}"),
            },
        })
    }

    /// What brings it to rest, and where that does not do it by itself, switches the output off: without laser mode a hold
    /// leaves it on, and the door does not.
    fn hold(&self) -> &'static [u8] {
        const BOTH: [u8; 2] = [b'!', DOOR];
        if self.job.is_torch() { &BOTH } else { b"!" }
    }

    /// One reset; true if the banner answers it.
    fn reset_and_hear(&mut self) -> io::Result<bool> {
        self.link.send(RESET)?;
        let deadline = self.now() + BANNER_WAIT;
        while let Some(reply) = self.link.reply_before(deadline)? {
            if matches!(reply, Reply::Banner(_)) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Polls until a report says that the machine stands. First: whether one did in time. Second: whether nothing was
    /// heard that a controller says only when it starts anew, or never.
    fn wait_until_still(&mut self, trusted: bool) -> io::Result<(bool, bool)> {
        let start = self.now();
        let mut deadline = start + ANSWER;
        let mut undisturbed = true;
        let mut running = false;
        while self.now() < deadline {
            // The hold is repeated as long as the machine says that it runs: a single byte may be lost.
            if running {
                self.link.send(self.hold())?;
            }
            self.link.send(b"?")?;
            let until = self.now() + STOP_POLL;
            while let Some(reply) = self.link.reply_before(until)? {
                match reply {
                    Reply::Status(status) => {
                        let state = status.state;
                        if trusted && undisturbed {
                            self.sight(&status);
                        }
                        self.status = Some(status);
                        // GRBL tells Idle while a torch waits in its pierce.
                        running = state == MachineState::Run
                            || state == MachineState::Idle && self.job.is_torch();
                        match state {
                            MachineState::Hold(true) | MachineState::Door(true) => {
                                return Ok((true, undisturbed));
                            }
                            // Locked: it stands, or will not say more before the reset.
                            MachineState::Alarm | MachineState::Sleep => {
                                return Ok((false, undisturbed));
                            }
                            MachineState::Hold(false) | MachineState::Door(false) => {
                                deadline = start + BRAKING;
                            }
                            _ => {}
                        }
                    }
                    Reply::Alarm(_) => return Ok((false, undisturbed)),
                    Reply::Banner(_) | Reply::Unknown(_) => undisturbed = false,
                    // Answers to lines sent before the hold still count.
                    Reply::Ok if self.settle().is_ok() => self.acknowledged += 1,
                    Reply::Error(_) => {
                        let _ = self.settle();
                    }
                    _ => {}
                }
            }
        }
        Ok((false, undisturbed))
    }
}
