//! The main program: reads one line after the other, and waits where the firmware waits.

use super::{Controller, LINE_LIMIT, Line, MEMORY_S, State};
use crate::planner::READING_AT_REST;
use crate::sim::burnt::Light;
use crate::sim::modal::{Action, Arc, Spindle, interpret};

impl Controller {
    pub(super) fn suspended(&self) -> bool {
        matches!(
            self.state,
            State::Hold { .. } | State::Door { .. } | State::Critical
        )
    }

    /// One thing that the main program does now; false if it must wait.
    pub(super) fn main_step(&mut self) -> bool {
        if self.report_wanted && self.state != State::Critical && self.state != State::Home {
            self.report_wanted = false;
            self.status_report();
            return true;
        }
        if self.suspended() {
            return false;
        }
        if self.state == State::Home {
            // Its time was spent in `busy_until_s`.
            self.homed();
            return true;
        }
        if let Some(action) = self.actions.pop_front() {
            return self.act(action);
        }
        if let Some(answer) = self.answer.take() {
            self.say(answer);
            if std::mem::take(&mut self.reset_pending) {
                self.restart();
                self.state = State::Idle;
                self.banner();
            }
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
            b'/' | 0..=b' ' => {}
            _ if line.text.len() >= LINE_LIMIT => line.overflow = true,
            _ => line.text.push(byte.to_ascii_uppercase()),
        }
        false
    }

    pub(super) fn execute(&mut self, line: &Line) {
        let result = if line.overflow {
            Err(11)
        } else if line.text.is_empty() {
            Ok(())
        } else if line.text[0] == b'$' {
            self.system_line(&line.text)
        } else if matches!(self.state, State::Alarm) {
            Err(9)
        } else {
            let mut actions = std::mem::take(&mut self.actions);
            let result = interpret(&line.text, &mut self.modal, &self.settings, &mut actions);
            if self.state == State::Check {
                actions.clear();
            }
            self.actions = actions;
            result
        };
        match result {
            Ok(()) => self.answer = Some("ok"),
            Err(number) => self.say(&format!("error:{number}")),
        }
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
            Action::Spindle { spindle, s } => {
                let dark = spindle == Spindle::Off
                    || (self.settings.laser_mode && spindle == Spindle::Dynamic);
                self.rest(Light {
                    s: if dark { 0.0 } else { s },
                    spindle,
                    rapid: false,
                });
            }
            Action::Line { target, drive } => {
                if self.queue.is_full() {
                    self.actions.push_front(action);
                    return self.start_cycle();
                }
                self.plan_line(target, drive);
            }
            Action::Arc(mut arc) => {
                if let Some(target) = arc.point() {
                    if self.queue.is_full() {
                        self.actions.push_front(Action::Arc(arc));
                        return self.start_cycle();
                    }
                    let drive = arc.drive;
                    arc.next += 1;
                    self.more_arc(arc);
                    self.plan_line(target, drive);
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
                self.rest(Light::DARK);
                self.say("[MSG:Pgm End]");
            }
            Action::Memory => self.write_memory(),
            Action::Home => {
                self.state = State::Home;
                let far = self
                    .settings
                    .travel_mm
                    .iter()
                    .fold(0.0f64, |a, &t| a.max(t));
                self.busy_until_s = self.now_s + far / (self.settings.homing_seek_mm_min / 60.0);
            }
        }
        true
    }

    pub(super) fn more_arc(&mut self, arc: Arc) {
        self.actions.push_front(Action::Arc(arc));
    }

    pub(super) fn write_memory(&mut self) {
        self.deaf_until_s = self.now_s + MEMORY_S;
        self.busy_until_s = self.deaf_until_s;
    }
}
