//! Lines that begin with a dollar.

use super::{Controller, State};
use crate::sim::flavour::Flavour;
use crate::sim::modal::{Action, interpret, interpret_jog};
use crate::sim::settings::Settings;
use crate::sim::words::number;

impl Controller {
    /// A `$` line.
    ///
    /// # Errors
    /// GRBL's number: 2 no number where a setting's should stand, 3 unknown, 5 homing is disabled, 8 not idle, 15 and 16
    /// of a jog, and those of the settings.
    pub(super) fn system_line(&mut self, text: &[u8]) -> Result<(), u8> {
        match text {
            b"$" => {
                self.say("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]")
            }
            b"$$" => {
                // Printing takes too long while moving.
                if matches!(self.state, State::Run | State::Hold { .. }) {
                    return Err(8);
                }
                for (number, value, decimals) in self.settings.rows() {
                    self.say(&format!("${number}={value:.decimals$}"));
                }
            }
            b"$G" => self.modal_report(),
            b"$X" => {
                if self.state == State::Alarm {
                    self.message("Caution: Unlocked");
                    self.state = State::Idle;
                }
            }
            b"$C" => match self.state {
                State::Check => {
                    self.message("Disabled");
                    self.reset_pending = true;
                }
                State::Idle if self.queue.is_empty() => {
                    self.state = State::Check;
                    self.message("Enabled");
                }
                _ => return Err(8),
            },
            [b'$', b'J', rest @ ..] => return self.jog_line(rest),
            _ if !matches!(self.state, State::Idle | State::Alarm) || !self.queue.is_empty() => {
                return Err(8);
            }
            b"$#" => self.offsets_report(),
            b"$I" => {
                let settings = &self.settings;
                let info = settings.flavour.build_info(settings, &self.owner);
                for line in info {
                    self.say(&line);
                }
            }
            [b'$', b'I', b'=', owner @ ..] => {
                self.owner = String::from_utf8_lossy(owner).into_owned();
                self.actions.push_back(Action::Memory);
            }
            b"$H" if !self.settings.homing => return Err(5),
            b"$H" => {
                self.actions.push_back(Action::Sync);
                self.actions.push_back(Action::Home);
            }
            b"$SLP" => {
                // Answered first, then asleep.
                self.say("ok");
                self.actions.push_back(Action::Sleep);
                self.answer = None;
            }
            [b'$', b'R', b'S', b'T', b'=', what @ ..] => return self.restore(what),
            b"$N" => {
                for k in 0..self.startup.len() {
                    let text = format!("$N{k}={}", self.startup[k]);
                    self.say(&text);
                }
            }
            [b'$', b'N', rest @ ..] => return self.startup_line(rest),
            _ if self.settings.flavour == Flavour::FluidNc => return self.named_setting(text),
            _ => return self.set_setting(text),
        }
        Ok(())
    }

    /// What follows `$J`.
    fn jog_line(&mut self, rest: &[u8]) -> Result<(), u8> {
        if !matches!(self.state, State::Idle | State::Jog) {
            return Err(8);
        }
        let line = rest.strip_prefix(b"=").ok_or(3u8)?;
        let action = interpret_jog(line, &self.modal)?;
        if let Action::Jog { target, .. } = action
            && self.settings.soft_limits
            && !self.within_travel(target)
        {
            return Err(15);
        }
        self.actions.push_back(action);
        Ok(())
    }

    /// `$RST=`: settings, offsets, or everything as shipped, then a reset.
    fn restore(&mut self, what: &[u8]) -> Result<(), u8> {
        let (settings, offsets) = match what {
            b"$" => (true, false),
            b"#" => (false, true),
            b"*" => (true, true),
            _ => return Err(3),
        };
        if settings {
            self.settings = self.factory.clone();
        }
        if offsets {
            self.modal.systems = Default::default();
            self.modal.places = Default::default();
        }
        if settings && offsets {
            self.startup = Default::default();
            self.owner.clear();
        }
        self.message("Restoring defaults");
        self.actions.push_back(Action::Memory);
        self.reset_pending = true;
        Ok(())
    }

    /// What follows `$N` where a line is to be kept: it is run once, to see that it can be.
    fn startup_line(&mut self, rest: &[u8]) -> Result<(), u8> {
        if self.state != State::Idle {
            return Err(8);
        }
        let mut at = 0;
        let which = number(rest, &mut at)?;
        let line = rest
            .get(at..)
            .and_then(|r| r.strip_prefix(b"="))
            .ok_or(3u8)?;
        if !line.is_empty() {
            interpret(line, &mut self.modal, &self.settings, &mut self.actions)?;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "compared with two"
        )]
        let slot = self.startup.get_mut(which.max(0.0) as usize).ok_or(3u8)?;
        *slot = String::from_utf8_lossy(line).into_owned();
        self.actions.push_back(Action::Memory);
        Ok(())
    }

    /// `$number=value`.
    fn set_setting(&mut self, text: &[u8]) -> Result<(), u8> {
        let mut at = 1;
        let which = number(text, &mut at)?;
        if text.get(at) != Some(&b'=') {
            return Err(3);
        }
        at += 1;
        let value = number(text, &mut at)?;
        if at != text.len() || which.fract() != 0.0 || !(0.0..=255.0).contains(&which) {
            return Err(3);
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

    /// FluidNC knows its settings by name: `$S` lists those that a numbered setting stands for, and `$Report/Status=`
    /// is the one of them that can be set.
    fn named_setting(&mut self, text: &[u8]) -> Result<(), u8> {
        if text == b"$S" {
            for (number, value, decimals) in self.settings.rows() {
                if let Some(name) = Settings::name(number) {
                    self.say(&format!("${name}={value:.decimals$}"));
                }
            }
            return Ok(());
        }
        if let Some(answer) = self.axis_of_file(text) {
            self.say(&answer);
            return Ok(());
        }
        match text.strip_prefix(b"$REPORT/STATUS=") {
            Some(value) => self.set_setting(&[b"$10=", value].concat()),
            None => self.set_setting(text),
        }
    }

    /// What FluidNC answers for what its configuration file says of an axis, as far as it is simulated.
    fn axis_of_file(&self, text: &[u8]) -> Option<String> {
        let key = std::str::from_utf8(text).ok()?.to_ascii_lowercase();
        let (axis, what) = key.strip_prefix("$/axes/")?.split_once('/')?;
        let axis = ["x", "y", "z"].iter().position(|name| *name == axis)?;
        let settings = &self.settings;
        let [low, high] = settings.range_mm(axis);
        let upwards = !settings.homes_downwards(axis);
        let value = match what {
            "max_travel_mm" => format!("{:.3}", settings.travel_mm[axis]),
            "soft_limits" => settings.soft_limits.to_string(),
            // An axis without homing in the file has cycle 0.
            "homing/cycle" => u8::from(settings.homing).to_string(),
            "homing/positive_direction" => upwards.to_string(),
            "homing/mpos_mm" => format!("{:.3}", if upwards { high } else { low }),
            _ => return None,
        };
        Some(format!("{key}={value}"))
    }
}
