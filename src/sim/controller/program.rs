//! The main program: reads one line after the other, and waits where the firmware waits.

use super::overrides::Overrides;
use super::{Controller, Line, MEMORY_S, State};
use crate::planner::READING_AT_REST;
use crate::sim::flavour::Flavour;
use crate::sim::modal::{Action, Arc, Spindle, interpret};

impl Controller {
    /// Whether the main program waits for a person. GRBL and FluidNC go on reading lines while they brake; grblHAL
    /// does not.
    pub(super) fn suspended(&self) -> bool {
        match self.state {
            State::Hold { standing } | State::Door { standing } => {
                standing || self.settings.flavour == Flavour::GrblHal
            }
            State::Critical | State::Sleep => true,
            _ => false,
        }
    }

    /// One thing that the main program does now; false if it must wait.
    pub(super) fn main_step(&mut self) -> bool {
        // GRBL's locked loop does not look at the wish for a report; its successors' does. While homing FluidNC does.
        let flavour = self.settings.flavour;
        let mute = self.state == State::Home && flavour != Flavour::FluidNc
            || self.state == State::Critical && flavour == Flavour::Grbl;
        if self.report_wanted && !mute {
            self.report_wanted = false;
            self.status_report();
            return true;
        }
        if self.resume_s.is_some() {
            return self.resumed();
        }
        if self.suspended() {
            return false;
        }
        if self.homing.is_some() {
            return false;
        }
        if let Some(action) = self.actions.pop_front() {
            return self.act(action);
        }
        if let Some(answer) = self.answer.take() {
            self.say(&answer);
            if std::mem::take(&mut self.reset_pending) {
                self.soft_reset();
            }
            return true;
        }
        if let Some(line) = self.starting.pop_front() {
            let result = self.block(line.as_bytes());
            self.answer = Some(match result {
                Ok(()) => format!(">{line}:ok"),
                Err(number) => format!(">{line}:error:{number}"),
            });
            return true;
        }
        if let Some(line) = self.ready.take() {
            self.execute(&line);
            return true;
        }
        let mut progress = false;
        while let Some(byte) = self.receive.pop_front() {
            progress = true;
            if self.take_byte(byte) {
                let bytes = self.ready.as_ref().map_or(0, |line| line.bytes);
                let share = if self.running.is_none() {
                    READING_AT_REST
                } else {
                    1.0
                };
                self.busy_until_s =
                    self.now_s + f64::from(bytes) * self.settings.byte_time_s * share;
                return true;
            }
        }
        // Nothing more to read: what is planned begins to move.
        self.start_cycle() || progress
    }

    /// One character of a line; true when the line is complete.
    pub(super) fn take_byte(&mut self, byte: u8) -> bool {
        let limit = self.settings.flavour.line_limit();
        let named = self.settings.flavour == Flavour::FluidNc;
        let end = matches!(byte, b'\n' | b'\r').then_some(byte);
        if self.settings.flavour.pairs_line_ends()
            && self.line.bytes == 0
            && end.is_some()
            && self.line_end.is_some_and(|last| end != Some(last))
        {
            self.line_end = None;
            return false;
        }
        self.line_end = end;
        let line = &mut self.line;
        line.bytes += 1;
        match byte {
            b'\n' | b'\r' => {
                self.ready = Some(std::mem::take(&mut self.line));
                return true;
            }
            b')' if line.paren => line.paren = false,
            _ if line.paren || line.semicolon => {}
            b'(' => line.paren = true,
            b';' => line.semicolon = true,
            b'/' if !(named && line.text.first() == Some(&b'$')) => {}
            0..=b' ' => {}
            _ if line.text.len() >= limit => line.overflow = true,
            _ => line.text.push(byte.to_ascii_uppercase()),
        }
        false
    }

    pub(super) fn execute(&mut self, line: &Line) {
        let latches = self.settings.flavour.latches_errors();
        let result = if line.overflow {
            Err(11)
        } else if line.text.is_empty() {
            Ok(())
        } else if line.text[0] == b'$' {
            self.system_line(&line.text)
        } else if matches!(self.state, State::Alarm | State::Jog) {
            Err(9)
        } else if let Some(number) = self.latched {
            Err(number)
        } else {
            self.block(&line.text)
        };
        if latches {
            self.latched = result.err();
        }
        match result {
            Ok(()) => self.answer = Some("ok".into()),
            Err(number) => self.say(&format!("error:{number}")),
        }
    }

    /// A block of G-code.
    fn block(&mut self, text: &[u8]) -> Result<(), u8> {
        let mut actions = std::mem::take(&mut self.actions);
        let offset = self.modal.offset();
        let result = interpret(text, &mut self.modal, &self.settings, &mut actions);
        if self.modal.offset() != offset {
            self.offset_in = 0;
        }
        // In a motion of laser mode an S word waits for nothing.
        if !actions.iter().any(|a| matches!(a, Action::Spindle { .. })) {
            self.spindle_s = self.modal.s;
        }
        if self.state == State::Check {
            // Nothing moves, but the limits hold.
            let mut ends = actions.iter().filter_map(|action| match action {
                Action::Line { target, .. } => Some(*target),
                Action::Arc(arc) => Some(arc.target),
                // Where probing leads is not looked at.
                _ => None,
            });
            let fits = !self.settings.soft_limits || ends.all(|t| self.within_travel(t));
            let ends_program = actions.contains(&Action::End);
            actions.clear();
            if ends_program {
                self.overrides = Overrides::default();
                self.message(self.settings.flavour.program_end());
            }
            if !fits {
                self.soft_limit_alarm();
                return Ok(());
            }
        }
        self.actions = actions;
        result
    }

    /// Does an action, or puts it back and waits.
    pub(super) fn act(&mut self, action: Action) -> bool {
        match action {
            Action::Sync => {
                if self.running.is_some() || !self.queue.is_empty() {
                    self.actions.push_front(action);
                    return self.start_cycle();
                }
            }
            Action::Spindle { spindle, s, word } => {
                (self.spindle, self.spindle_s) = (spindle, word);
                self.set_output(spindle, s);
            }
            Action::Air(air) => self.set_air(air),
            Action::Line { target, drive } => {
                if self.queue.is_full() {
                    self.actions.push_front(action);
                    return self.start_cycle();
                }
                self.plan_line(target, drive, false);
            }
            Action::Jog {
                target,
                rate_mm_min,
            } => {
                if self.queue.is_full() {
                    self.actions.push_front(action);
                    return false;
                }
                self.plan_jog(target, rate_mm_min);
            }
            Action::Probe(probe) => return self.probe(probe),
            Action::Arc(mut arc) => {
                if let Some(target) = arc.point() {
                    if self.queue.is_full() {
                        self.actions.push_front(Action::Arc(arc));
                        return self.start_cycle();
                    }
                    let drive = arc.drive;
                    arc.next += 1;
                    self.more_arc(arc);
                    self.plan_line(target, drive, false);
                }
            }
            Action::Dwell { left_s, until_s } => {
                let until = until_s.unwrap_or(self.now_s + left_s);
                if self.now_s < until {
                    self.actions.push_front(Action::Dwell {
                        left_s,
                        until_s: Some(until),
                    });
                    return until_s.is_none();
                }
            }
            Action::Pause => self.hold(false),
            Action::End => {
                self.overrides = Overrides::default();
                self.spindle = Spindle::Off;
                self.set_output(Spindle::Off, 0.0);
                self.set_air([false; 2]);
                (self.overrides_in, self.offset_in) = (0, 0);
                self.message(self.settings.flavour.program_end());
            }
            Action::Memory => self.write_memory(),
            Action::Sleep => {
                self.set_output(Spindle::Off, 0.0);
                self.set_air([false; 2]);
                self.state = State::Sleep;
                self.message("Sleeping");
            }
            Action::Home => self.home(),
        }
        true
    }

    pub(super) fn more_arc(&mut self, arc: Arc) {
        self.actions.push_front(Action::Arc(arc));
    }

    pub(super) fn write_memory(&mut self) {
        if !self.settings.flavour.deaf_while_writing() {
            return;
        }
        self.deaf_until_s = self.now_s + MEMORY_S;
        self.busy_until_s = self.deaf_until_s;
    }
}
