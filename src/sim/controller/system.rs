//! Lines that begin with a dollar.

use super::{Action, Controller, State};
use crate::sim::words::number;

impl Controller {
    /// A `$` line.
    ///
    /// # Errors
    /// GRBL's number: 3 unknown, 5 homing is disabled, 8 not idle, and those of the settings.
    pub(super) fn system_line(&mut self, text: &[u8]) -> Result<(), u8> {
        let standing = matches!(self.state, State::Idle | State::Alarm | State::Check);
        match text {
            b"$" => {
                self.say("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]")
            }
            b"$$" if !standing => return Err(8),
            b"$$" => {
                for (number, value, decimals) in self.settings.rows() {
                    self.say(&format!("${number}={value:.decimals$}"));
                }
            }
            b"$I" => {
                self.say("[VER:1.1h.20190830:]");
                let options = format!(
                    "[OPT:V,{},{}]",
                    self.settings.planner_blocks, self.settings.receive_buffer
                );
                self.say(&options);
            }
            b"$G" => self.modal_report(),
            b"$#" => self.offsets_report(),
            b"$N" => {
                self.say("$N0=");
                self.say("$N1=");
            }
            b"$X" => {
                if self.state == State::Alarm {
                    self.state = State::Idle;
                    self.say("[MSG:Caution: Unlocked]");
                }
            }
            b"$C" => match self.state {
                State::Check => {
                    self.say("[MSG:Disabled]");
                    self.reset_pending = true;
                }
                State::Idle if self.queue.is_empty() => {
                    self.state = State::Check;
                    self.say("[MSG:Enabled]");
                }
                _ => return Err(8),
            },
            b"$H" => {
                if !self.settings.homing {
                    return Err(5);
                }
                if !matches!(self.state, State::Idle | State::Alarm) {
                    return Err(8);
                }
                self.actions.push_back(Action::Sync);
                self.actions.push_back(Action::Home);
            }
            _ => return self.set_setting(text),
        }
        Ok(())
    }

    fn set_setting(&mut self, text: &[u8]) -> Result<(), u8> {
        let mut at = 1;
        if !text.get(at).is_some_and(u8::is_ascii_digit) {
            return Err(3);
        }
        let which = number(text, &mut at)?;
        if text.get(at) != Some(&b'=') {
            return Err(3);
        }
        at += 1;
        let value = number(text, &mut at)?;
        if at != text.len() || which.fract() != 0.0 || which > 255.0 {
            return Err(3);
        }
        if !matches!(self.state, State::Idle | State::Alarm) || !self.queue.is_empty() {
            return Err(8);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0 to 255"
        )]
        self.settings.set(which as u16, value)?;
        self.queue.set_limits(self.settings.limits());
        self.actions.push_back(Action::Memory);
        Ok(())
    }

    /// Homing is over: the head stands at the corner that `$23` names, a little off the switches.
    pub(super) fn homed(&mut self) {
        let pull = self.settings.homing_pull_off_mm;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a mask of 3 bits"
        )]
        let mask = self.settings.homing_direction_mask as u8;
        self.position = std::array::from_fn(|k| {
            if mask & (1 << k) != 0 {
                pull - self.settings.travel_mm[k]
            } else {
                -pull
            }
        });
        self.zero = [0.0; 3];
        self.modal.position = self.position;
        self.state = State::Idle;
        self.idle_delay();
    }
}
