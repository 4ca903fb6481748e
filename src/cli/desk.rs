//! What a person sees and presses while a job runs: one line that is redrawn on a terminal, plain lines elsewhere, or events
//! as JSON, a line each, for other programs.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use serde_json::json;

use super::Terminal;
use super::timetable::Timetable;
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::control::{Change, Glance, Operator, Wish};

/// Between two pictures of the line, on the machine's clock.
const REDRAW: Duration = Duration::from_millis(200);

/// Between two events of the same kind.
const EVENTS: Duration = Duration::from_millis(500);

/// Plain lines tell of every so many per cent.
const PLAIN_STEP: usize = 10;

/// Characters of the bar.
const BAR: usize = 20;

/// The keys, in words.
const KEYS: &str = "p pause  +/- feed  ]/[ power  0 as made  a end";

/// How it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Show {
    /// A line that is redrawn, and keys.
    Line,
    /// Plain lines.
    Plain,
    /// JSON, a line an event.
    Events,
    /// Nothing but remarks.
    Nothing,
}

/// Feed, rapids and power, per cent of what the job says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Overrides {
    feed: u16,
    rapids: u16,
    power: u16,
}

impl Overrides {
    const AS_MADE: Self = Self {
        feed: 100,
        rapids: 100,
        power: 100,
    };

    /// What is not as the job was made; empty if all of it is.
    fn words(self) -> String {
        [
            ("feed", self.feed),
            ("rapids", self.rapids),
            ("power", self.power),
        ]
        .into_iter()
        .filter(|(_, percent)| *percent != 100)
        .map(|(what, percent)| format!("  {what} {percent} %"))
        .collect()
    }
}

#[derive(Default)]
struct State {
    shown_at: Option<Duration>,
    cuts: usize,
    /// Time in pauses so far, and when this one began.
    paused_for: Duration,
    paused_at: Option<Duration>,
    /// Keys are read.
    raw: bool,
    /// The key that ends the job was pressed once.
    end_asked: bool,
    step: usize,
    /// As the controller told them last, or as keys have asked since; none before either.
    overrides: Option<Overrides>,
    /// Wishes of one key, still to be passed on.
    wishes: VecDeque<Wish>,
}

/// The person's side of a running job.
pub(super) struct Desk<'a> {
    terminal: &'a Terminal,
    show: Show,
    times: Timetable,
    state: Mutex<State>,
}

impl<'a> Desk<'a> {
    pub fn new(terminal: &'a Terminal, show: Show, times: Timetable) -> Self {
        Self {
            terminal,
            show,
            times,
            state: Mutex::new(State::default()),
        }
    }

    /// The time of the whole job by the planner, s; none where it is not known or not shown.
    pub fn whole_s(&self) -> Option<f64> {
        Some(self.times.whole_s()).filter(|time| *time > 0.0)
    }

    /// Gives the keyboard back, so that a line can be read; the next glance takes it again.
    pub fn release_keys(&self) {
        if let Ok(mut state) = self.state.lock()
            && state.raw
        {
            state.raw = false;
            let _ = disable_raw_mode();
        }
    }

    fn event(&self, value: &serde_json::Value) {
        use std::io::Write as _;
        // Nobody listening is no reason to stop a machine.
        let mut out = std::io::stdout().lock();
        let _ = writeln!(out, "{value}").and_then(|()| out.flush());
    }

    fn key(&self, code: KeyCode, control: bool, state: &mut State) -> Option<Wish> {
        if control && matches!(code, KeyCode::Char('c' | 'C')) {
            self.terminal.stop_flag().store(true, Ordering::SeqCst);
            return None;
        }
        let KeyCode::Char(key) = code else {
            return None;
        };
        let was_asked = std::mem::take(&mut state.end_asked);
        match key {
            'a' | 'A' if was_asked => {
                self.terminal.stop_flag().store(true, Ordering::SeqCst);
                None
            }
            'a' | 'A' => {
                state.end_asked = true;
                self.terminal
                    .note("the machine pauses: press a once more to end the job, p to go on");
                Some(Wish::Pause)
            }
            'p' | 'P' | ' ' => Some(if state.paused_at.is_some() {
                Wish::Resume
            } else {
                Wish::Pause
            }),
            '+' | '=' => Some(changed(state, |o| &mut o.feed, 10, Wish::Feed)),
            '-' => Some(changed(state, |o| &mut o.feed, -10, Wish::Feed)),
            ']' => Some(changed(state, |o| &mut o.power, 10, Wish::Power)),
            '[' => Some(changed(state, |o| &mut o.power, -10, Wish::Power)),
            '0' => {
                state.overrides = Some(Overrides::AS_MADE);
                let rest = [Wish::Rapid(Change::Reset), Wish::Power(Change::Reset)];
                state.wishes.extend(rest);
                Some(Wish::Feed(Change::Reset))
            }
            _ => None,
        }
    }

    fn line(&self, glance: &Glance<'_>, state: &State) -> String {
        let elapsed = self.worked_s(glance, state);
        let done = self.times.done_s(glance.done_lines);
        let whole = self.times.whole_s();
        let share = if whole > 0.0 { done / whole } else { 0.0 };
        let full = ((share * BAR as f64) as usize).min(BAR);
        let mut text = format!(
            "[{}{}] {:3} %",
            "#".repeat(full),
            ".".repeat(BAR - full),
            (100.0 * share).floor()
        );
        if glance.of_cuts > 0 {
            text.push_str(&format!("  cut {} of {}", glance.cuts, glance.of_cuts));
        }
        if let Some([x, y]) = glance.work_mm {
            text.push_str(&format!("  X{x:.1} Y{y:.1}"));
        }
        if glance.paused() {
            text.push_str("  PAUSED, p goes on");
        } else if whole > 0.0 {
            text.push_str(&format!(
                "  {} left",
                clock(self.times.left_s(glance.done_lines, elapsed))
            ));
        }
        text.push_str(&state.overrides.map_or_else(String::new, Overrides::words));
        format!("{text}   {KEYS}")
    }

    fn status_event(&self, glance: &Glance<'_>, state: &State) -> serde_json::Value {
        let worked = self.worked_s(glance, state);
        let overrides = state
            .overrides
            .map(|o| json!({ "feed": o.feed, "rapids": o.rapids, "power": o.power }));
        json!({
            "event": "status",
            "state": format!("{:?}", glance.status.state),
            "paused": glance.paused(),
            "work_mm": glance.work_mm,
            "s": glance.status.s,
            "rate_mm_per_min": glance.status.rate_mm_min,
            "overrides_percent": overrides,
            "cuts": glance.cuts,
            "of_cuts": glance.of_cuts,
            "acknowledged": glance.acknowledged,
            "lines": glance.lines,
            "elapsed_s": rounded(glance.elapsed.as_secs_f64()),
            "left_s": rounded(self.times.left_s(glance.done_lines, worked)),
        })
    }

    fn worked_s(&self, glance: &Glance<'_>, state: &State) -> f64 {
        let now = state
            .paused_at
            .map_or(Duration::ZERO, |at| glance.elapsed.saturating_sub(at));
        glance
            .elapsed
            .saturating_sub(state.paused_for + now)
            .as_secs_f64()
    }
}

/// A key changes an override; gives the wish that changes it at the machine.
fn changed(
    state: &mut State,
    which: impl Fn(&mut Overrides) -> &mut u16,
    by: i16,
    wish: impl Fn(Change) -> Wish,
) -> Wish {
    let percent = which(state.overrides.get_or_insert(Overrides::AS_MADE));
    *percent = percent.saturating_add_signed(by).clamp(10, 200);
    wish(if by > 0 { Change::More } else { Change::Less })
}

/// Minutes and seconds.
fn clock(seconds: f64) -> String {
    let whole = seconds.round().max(0.0) as u64;
    format!("{}:{:02}", whole / 60, whole % 60)
}

impl Drop for Desk<'_> {
    fn drop(&mut self) {
        self.release_keys();
    }
}

impl Progress for Desk<'_> {
    fn start(&self, step: &str, total: Option<u64>) {
        // The job itself is shown by glances.
        if step == "sending" {
            self.terminal.clear();
        } else {
            self.terminal.start(step, total);
        }
    }

    fn note(&self, text: &str) {
        if self.show == Show::Events {
            self.event(&json!({ "event": "note", "text": text }));
        }
        self.terminal.note(text);
    }

    fn interrupted(&self) -> bool {
        self.terminal.interrupted()
    }
}

impl Operator for Desk<'_> {
    fn wish(&self) -> Option<Wish> {
        let mut state = self.state.lock().ok()?;
        if !state.raw {
            return None;
        }
        let rest = state.wishes.pop_front();
        if rest.is_some() {
            return rest;
        }
        while event::poll(Duration::ZERO).unwrap_or(false) {
            let Ok(Event::Key(key)) = event::read() else {
                continue;
            };
            if key.kind == KeyEventKind::Release {
                continue;
            }
            let control = key.modifiers.contains(KeyModifiers::CONTROL);
            if let Some(wish) = self.key(key.code, control, &mut state) {
                return Some(wish);
            }
        }
        None
    }

    fn glance(&self, glance: &Glance<'_>) {
        let Ok(mut state) = self.state.lock() else {
            return;
        };
        let paused = glance.paused();
        let mut turned = state.paused_at.is_some() != paused;
        if let Some([feed, rapids, power]) = glance.status.overrides {
            let told = Some(Overrides {
                feed,
                rapids,
                power,
            });
            turned |= std::mem::replace(&mut state.overrides, told) != told;
        }
        match (state.paused_at, paused) {
            (None, true) => state.paused_at = Some(glance.elapsed),
            (Some(at), false) => {
                state.paused_for += glance.elapsed.saturating_sub(at);
                state.paused_at = None;
            }
            _ => {}
        }
        let since = |every: Duration, state: &State| {
            state
                .shown_at
                .is_none_or(|at| glance.elapsed.saturating_sub(at) >= every || glance.elapsed < at)
        };
        match self.show {
            Show::Line => {
                if !state.raw {
                    state.raw = enable_raw_mode().is_ok();
                }
                if turned || since(REDRAW, &state) {
                    state.shown_at = Some(glance.elapsed);
                    self.terminal.show(&self.line(glance, &state));
                }
            }
            Show::Plain => {
                let share = (100 * glance.cuts)
                    .checked_div(glance.of_cuts)
                    .unwrap_or(100 * glance.acknowledged / glance.lines.max(1));
                if share / PLAIN_STEP > state.step {
                    state.step = share / PLAIN_STEP;
                    let left = self
                        .times
                        .left_s(glance.done_lines, self.worked_s(glance, &state));
                    self.terminal.note(&format!(
                        "{share} %: cut {} of {}, about {} left{}",
                        glance.cuts,
                        glance.of_cuts,
                        clock(left),
                        state.overrides.map_or_else(String::new, Overrides::words)
                    ));
                }
            }
            Show::Events => {
                let new = glance.cuts != state.cuts;
                if turned || new || since(EVENTS, &state) {
                    state.shown_at = Some(glance.elapsed);
                    state.cuts = glance.cuts;
                    self.event(&self.status_event(glance, &state));
                }
            }
            Show::Nothing => {}
        }
    }
}

fn rounded(seconds: f64) -> f64 {
    short(seconds, 3).parse().unwrap_or(seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::timetable::tests::job;
    use crate::control::{MachineState, Status};
    use crate::sim::Settings;

    #[test]
    fn keys_are_wishes_and_the_job_ends_at_the_second_asking() {
        let terminal = Terminal::new(true);
        let desk = Desk::new(&terminal, Show::Line, Timetable::default());
        let mut state = State::default();
        let press = |key: char, state: &mut State| desk.key(KeyCode::Char(key), false, state);
        assert_eq!(press('p', &mut state), Some(Wish::Pause));
        state.paused_at = Some(Duration::ZERO);
        assert_eq!(press('p', &mut state), Some(Wish::Resume));
        assert_eq!(press('+', &mut state), Some(Wish::Feed(Change::More)));
        assert_eq!(press('[', &mut state), Some(Wish::Power(Change::Less)));
        let keyed = state.overrides.unwrap();
        assert_eq!((keyed.feed, keyed.rapids, keyed.power), (110, 100, 90));
        assert_eq!(press('0', &mut state), Some(Wish::Feed(Change::Reset)));
        assert_eq!(
            state.wishes.drain(..).collect::<Vec<_>>(),
            [Wish::Rapid(Change::Reset), Wish::Power(Change::Reset)]
        );
        assert_eq!(state.overrides, Some(Overrides::AS_MADE));
        assert_eq!(press('a', &mut state), Some(Wish::Pause));
        assert_eq!(press('x', &mut state), None);
        // Another key in between takes it back.
        assert_eq!(press('a', &mut state), Some(Wish::Pause));
        assert!(!terminal.interrupted());
        assert_eq!(press('a', &mut state), None);
        assert!(terminal.interrupted());
    }

    fn report() -> Status {
        Status {
            state: MachineState::Run,
            position_mm: Some([10.0, 5.0, 0.0]),
            rounding_mm: 0.0005,
            is_work: false,
            offset_mm: None,
            rate_mm_min: None,
            s: Some(500.0),
            overrides: None,
            output_on: None,
        }
    }

    fn seen(status: &Status) -> Glance<'_> {
        Glance {
            status,
            work_mm: Some([10.0, 5.0]),
            cuts: 50,
            of_cuts: 100,
            acknowledged: 120,
            lines: 204,
            done_lines: 103,
            elapsed: Duration::from_secs(60),
        }
    }

    #[test]
    fn overrides_are_the_controllers_and_a_key_counts_until_it_tells_them() {
        let terminal = Terminal::new(true);
        let desk = Desk::new(&terminal, Show::Nothing, Timetable::default());
        let told = |overrides: Option<[u16; 3]>| Status {
            overrides,
            ..report()
        };
        let event = || desk.status_event(&seen(&report()), &desk.state.lock().unwrap());
        let line = || desk.line(&seen(&report()), &desk.state.lock().unwrap());
        let press = |key| desk.key(KeyCode::Char(key), false, &mut desk.state.lock().unwrap());
        let percent = |feed: u16, rapids: u16, power: u16| json!({ "feed": feed, "rapids": rapids, "power": power });
        desk.glance(&seen(&told(None)));
        assert!(event()["overrides_percent"].is_null());
        desk.glance(&seen(&told(Some([100; 3]))));
        assert_eq!(event()["overrides_percent"], percent(100, 100, 100));
        assert!(!line().contains("100 %"), "{}", line());
        press('+');
        desk.glance(&seen(&told(None)));
        assert!(line().contains("feed 110 %"), "{}", line());
        // It was lost on the way, and somebody turned the rapids down.
        desk.glance(&seen(&told(Some([100, 25, 100]))));
        assert_eq!(event()["overrides_percent"], percent(100, 25, 100));
        assert!(
            line().contains("rapids 25 %") && !line().contains("feed 1"),
            "{}",
            line()
        );
        // The next key counts from what is told.
        desk.glance(&seen(&told(Some([150, 25, 80]))));
        press('-');
        press('[');
        assert_eq!(event()["overrides_percent"], percent(140, 25, 70));
    }

    #[test]
    fn the_line_tells_what_the_machine_has_done() {
        let terminal = Terminal::new(true);
        let (job, settings) = (job(), Settings::default());
        let desk = Desk::new(&terminal, Show::Line, Timetable::of(&job, &settings));
        let status = report();
        let mut glance = seen(&status);
        let state = State {
            overrides: Some(Overrides {
                feed: 110,
                ..Overrides::AS_MADE
            }),
            ..State::default()
        };
        let line = desk.line(&glance, &state);
        assert!(!line.contains("power 1"), "{line}");
        for part in [
            "cut 50 of 100",
            "X10.0 Y5.0",
            " left",
            "feed 110 %",
            "[#########",
        ] {
            assert!(line.contains(part), "{part}: {line}");
        }
        let held = Status {
            state: MachineState::Hold(true),
            ..status.clone()
        };
        glance.status = &held;
        assert!(desk.line(&glance, &state).contains("PAUSED"));
        assert_eq!(clock(599.6), "10:00");
    }
}
