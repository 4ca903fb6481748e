//! What moves the machine, or tells it where it is.

use std::time::Duration;

use super::{ANSWER, Console, ConsoleError, POLL};
use crate::base::units::{fixed, short};
use crate::control::reply::{MachineState, Reply, Status};

/// How long homing may take between two words of the controller: a slow axis of a metre, there and back.
const HOMING: Duration = Duration::from_secs(300);

/// Where a jog goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JogTo {
    /// By so much, mm.
    By,
    /// To a place in work coordinates, mm.
    Work,
    /// To a place in machine coordinates, mm.
    Machine,
}

/// A dark move by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// How its lengths are meant.
    pub to: JogTo,
    /// X, Y and Z, those that move, mm.
    pub axes_mm: [Option<f64>; 3],
    /// mm/min.
    pub feed_mm_per_min: f64,
}

impl Move {
    /// GRBL's line for it; none if nothing moves or a number is none.
    pub fn line(&self) -> Option<String> {
        let sound = |v: &f64| v.is_finite() && v.abs() < 1e5;
        let moves = self.axes_mm.iter().flatten();
        if moves.clone().count() == 0
            || !moves.clone().all(sound)
            || !(self.feed_mm_per_min > 0.0 && sound(&self.feed_mm_per_min))
        {
            return None;
        }
        let mode = match self.to {
            JogTo::By => "G91",
            JogTo::Work => "G90",
            JogTo::Machine => "G53",
        };
        let mut line = format!("$J={mode} G21");
        for (name, value) in ["X", "Y", "Z"].iter().zip(self.axes_mm) {
            if let Some(value) = value {
                line.push_str(&format!(" {name}{}", fixed(value, 3)));
            }
        }
        line.push_str(&format!(" F{}", short(self.feed_mm_per_min, 1)));
        Some(line)
    }
}

impl Console<'_> {
    /// Waits until the machine stands. The person's wish to stop is passed on by `stop`, once.
    fn until_idle(&mut self, command: &str, stop: &[u8]) -> Result<Status, ConsoleError> {
        let mut stopped = false;
        let mut silent_until = self.now() + ANSWER;
        loop {
            if self.progress.interrupted() && !stopped {
                self.send(stop)?;
                stopped = true;
            }
            self.send(b"?")?;
            let until = self.now() + POLL;
            while let Some(reply) = self.next(until)? {
                silent_until = self.now() + ANSWER;
                match reply {
                    Reply::Status(mut status) => {
                        if let Some(offset) = status.offset_mm {
                            self.offset_mm = offset;
                        }
                        status.offset_mm = Some(self.offset_mm);
                        match status.state {
                            MachineState::Idle if stopped => {
                                return Err(ConsoleError::Interrupted(place(&status)));
                            }
                            MachineState::Idle => return Ok(status),
                            MachineState::Alarm => {
                                return Err(ConsoleError::NotReady(format!(
                                    "the machine has locked itself during {command}"
                                )));
                            }
                            _ => {}
                        }
                    }
                    Reply::Alarm(alarm) => {
                        return Err(ConsoleError::Alarm {
                            command: command.to_owned(),
                            alarm,
                            words: crate::control::send::alarm_words(alarm).into(),
                        });
                    }
                    Reply::Banner(banner) => {
                        return Err(ConsoleError::Reset {
                            command: command.to_owned(),
                            banner,
                        });
                    }
                    _ => {}
                }
            }
            if self.now() >= silent_until {
                return Err(ConsoleError::NoAnswer {
                    command: "?".into(),
                });
            }
        }
    }

    /// Moves the head by hand, dark, and waits until it stands. The person's wish to stop cancels the move; the position is
    /// kept then.
    ///
    /// # Errors
    /// [`ConsoleError`]: locked, beyond the travel, interrupted.
    pub fn jog(&mut self, by: &Move) -> Result<Status, ConsoleError> {
        let Some(line) = by.line() else {
            return Err(ConsoleError::NotReady(
                "a jog needs an axis and a feed above zero, in plain numbers".into(),
            ));
        };
        self.dark()?;
        if self.progress.interrupted() {
            return Err(ConsoleError::Interrupted("nothing was moved".into()));
        }
        self.command(&line, ANSWER, |_| Ok(()))?;
        self.until_idle("the jog", &[0x85])
    }

    /// Runs the homing cycle. The person's wish to stop resets the controller, which ends the cycle at once.
    ///
    /// # Errors
    /// [`ConsoleError`]: no switches, a switch that was not found, interrupted.
    pub fn home(&mut self) -> Result<Status, ConsoleError> {
        let status = self.status()?;
        if !matches!(status.state, MachineState::Idle | MachineState::Alarm) {
            return Err(ConsoleError::NotReady(format!(
                "the machine is not idle ({:?}): bring it to rest first",
                status.state
            )));
        }
        if status.s.is_some_and(|s| s > 0.0) {
            return Err(ConsoleError::NotReady(
                "the machine reports that its beam is on: switch it off by hand".into(),
            ));
        }
        self.command("$H", HOMING, |console| {
            console.send(&[0x18])?;
            Err(ConsoleError::Interrupted(
                "homing was ended by a reset; the machine is locked until it is homed".into(),
            ))
        })?;
        // Homing leaves the modes as they were; an output that is armed is none to leave so.
        self.dark()?;
        self.status()
    }

    /// Takes the lock off without homing: the person says that they know where the head stands.
    ///
    /// # Errors
    /// [`ConsoleError`].
    pub fn unlock(&mut self) -> Result<Status, ConsoleError> {
        self.ask("$X")?;
        self.ask("M5")?;
        self.status()
    }

    /// Says that the head stands at these work coordinates (mm) of G54 now, and keeps that in the controller's memory.
    /// G92 is cleared: a second offset on top of the first one misleads everybody.
    ///
    /// # Errors
    /// [`ConsoleError`]; also if the controller does not report it so afterwards.
    pub fn set_zero(&mut self, here_mm: [Option<f64>; 3]) -> Result<Status, ConsoleError> {
        self.dark()?;
        let mut line = String::from("G21 G10 L20 P1");
        let mut any = false;
        for (name, value) in ["X", "Y", "Z"].iter().zip(here_mm) {
            if let Some(value) = value {
                if !value.is_finite() || value.abs() > 1e5 {
                    return Err(ConsoleError::NotReady(format!(
                        "{name}{value} is no place on a machine"
                    )));
                }
                line.push_str(&format!(" {name}{}", fixed(value, 3)));
                any = true;
            }
        }
        if !any {
            return Err(ConsoleError::NotReady("no axis was named".into()));
        }
        self.ask("G54")?;
        self.ask("G92.1")?;
        // Into the EEPROM: nothing else is on the line until it is answered.
        self.ask(&line)?;
        // The report after a change tells the offset; those before may not.
        let mut status = self.status()?;
        for _ in 0..30 {
            if let Some(at) = work_mm(&status)
                && here_mm
                    .iter()
                    .zip(at)
                    .all(|(wanted, at)| wanted.is_none_or(|w| (w - at).abs() < 0.011))
            {
                return Ok(status);
            }
            status = self.status()?;
        }
        Err(ConsoleError::NotReady(format!(
            "the controller took {line} and tells another place: {}",
            place(&status)
        )))
    }
}

/// Where the head stands in work coordinates, mm.
pub fn work_mm(status: &Status) -> Option<[f64; 3]> {
    let position = status.position_mm?;
    if status.is_work {
        return Some(position);
    }
    let offset = status.offset_mm?;
    Some([0, 1, 2].map(|k| position[k] - offset[k]))
}

fn place(status: &Status) -> String {
    match work_mm(status) {
        Some([x, y, _]) => format!("it stands at X{x:.3} Y{y:.3}"),
        None => "it does not tell where it stands".into(),
    }
}
