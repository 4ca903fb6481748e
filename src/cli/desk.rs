//! What a person sees and presses while a job runs: one line that is redrawn on a terminal, plain lines elsewhere, or events
//! as JSON, a line each, for other programs.

use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use serde_json::json;

use super::Terminal;
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::control::{Change, Glance, Job, Operator, Wish};
use crate::sim::{Settings, estimate};

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

/// When each part of a job is done, by the planner.
#[derive(Default)]
pub(super) struct Timetable {
    /// Lines of the job, and the time at which they are done, s; ascending.
    at: Vec<(usize, f64)>,
}

impl Timetable {
    /// Of a job on a machine; empty if the controller would not take it.
    pub fn of(job: &Job, settings: &Settings) -> Self {
        let lines: Vec<&str> = job.lines().map(|(text, _)| text).collect();
        // A long job has few points: each is an estimate of its own.
        let points = (400_000 / lines.len().max(1)).clamp(4, 32);
        let done = |point: usize| {
            let count = lines.len() * point / points;
            let time = estimate(&lines[..count].join("\n"), settings).ok()?.time_s;
            Some((count, time))
        };
        let at: Option<Vec<_>> = (0..=points).map(done).collect();
        Self {
            at: at.unwrap_or_default(),
        }
    }

    /// The time of the whole job, s.
    pub fn whole_s(&self) -> f64 {
        self.at.last().map_or(0.0, |p| p.1)
    }

    /// When so many lines are done, s.
    pub fn done_s(&self, lines: usize) -> f64 {
        let next = self.at.partition_point(|p| p.0 < lines);
        match (
            next.checked_sub(1).and_then(|k| self.at.get(k)),
            self.at.get(next),
        ) {
            (Some(a), Some(b)) => {
                a.1 + (b.1 - a.1) * (lines - a.0) as f64 / (b.0 - a.0).max(1) as f64
            }
            (None, Some(first)) => first.1,
            (_, None) => self.whole_s(),
        }
    }

    /// How long the rest takes, s, when `lines` are done after `elapsed_s` with the machine at work: at the pace so far once
    /// there is one.
    pub fn left_s(&self, lines: usize, elapsed_s: f64) -> f64 {
        // Feed overrides change the pace; the first seconds say nothing.
        const SETTLED_S: f64 = 20.0;
        let done = self.done_s(lines);
        let pace = if done > SETTLED_S {
            (elapsed_s / done).clamp(0.3, 10.0)
        } else {
            1.0
        };
        pace * (self.whole_s() - done).max(0.0)
    }
}

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
    /// Job without overrides, as far as keys changed them, per cent.
    feed: i32,
    power: i32,
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
            state: Mutex::new(State {
                feed: 100,
                power: 100,
                ..State::default()
            }),
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
            '+' | '=' => Some(changed(&mut state.feed, 10, Wish::Feed)),
            '-' => Some(changed(&mut state.feed, -10, Wish::Feed)),
            ']' => Some(changed(&mut state.power, 10, Wish::Power)),
            '[' => Some(changed(&mut state.power, -10, Wish::Power)),
            '0' => {
                // One byte at a time: the other follows with the next look.
                if state.feed != 100 {
                    state.feed = 100;
                    Some(Wish::Feed(Change::Reset))
                } else {
                    state.power = 100;
                    Some(Wish::Power(Change::Reset))
                }
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
        if state.feed != 100 || state.power != 100 {
            text.push_str(&format!("  feed {} % power {} %", state.feed, state.power));
        }
        format!("{text}   {KEYS}")
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

/// An override that keys changed, and the wish that changes it at the machine.
fn changed(percent: &mut i32, by: i32, wish: impl Fn(Change) -> Wish) -> Wish {
    *percent = (*percent + by).clamp(10, 200);
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
        let turned = state.paused_at.is_some() != paused;
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
                        "{share} %: cut {} of {}, about {} left",
                        glance.cuts,
                        glance.of_cuts,
                        clock(left)
                    ));
                }
            }
            Show::Events => {
                let new = glance.cuts != state.cuts;
                if turned || new || since(EVENTS, &state) {
                    state.shown_at = Some(glance.elapsed);
                    state.cuts = glance.cuts;
                    let worked = self.worked_s(glance, &state);
                    self.event(&json!({
                        "event": "status",
                        "state": format!("{:?}", glance.status.state),
                        "paused": paused,
                        "work_mm": glance.work_mm,
                        "s": glance.status.s,
                        "rate_mm_per_min": glance.status.rate_mm_min,
                        "cuts": glance.cuts,
                        "of_cuts": glance.of_cuts,
                        "acknowledged": glance.acknowledged,
                        "lines": glance.lines,
                        "elapsed_s": rounded(glance.elapsed.as_secs_f64()),
                        "left_s": rounded(self.times.left_s(glance.done_lines, worked)),
                    }));
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
    use crate::control::{JobRules, MachineState, Status};

    fn job() -> Job {
        let mut text = String::from("G21 G90\nM4 S500\nF1200\n");
        for n in 0..100 {
            text.push_str(&format!("G0 X{n} Y0\nG1 Y20\n"));
        }
        text.push_str("M5\n");
        Job::check(text.as_bytes(), &JobRules::default()).unwrap()
    }

    #[test]
    fn the_timetable_is_the_planners() {
        let (job, settings) = (job(), Settings::default());
        let times = Timetable::of(&job, &settings);
        let lines: Vec<&str> = job.lines().map(|l| l.0).collect();
        let whole = estimate(&lines.join("\n"), &settings).unwrap().time_s;
        assert_eq!(times.whole_s(), whole);
        for count in [0, 3, 60, 101, lines.len()] {
            let true_s = estimate(&lines[..count].join("\n"), &settings)
                .unwrap()
                .time_s;
            let found = times.done_s(count);
            assert!(
                (found - true_s).abs() < 0.03 * whole,
                "{count}: {found} {true_s}"
            );
        }
        // Half as fast as planned: twice as long to go.
        let half = lines.len() / 2;
        let left = times.left_s(half, 2.0 * times.done_s(half));
        assert!((left - 2.0 * (whole - times.done_s(half))).abs() < 1e-9);
        assert_eq!(times.left_s(lines.len(), whole), 0.0);
    }

    #[test]
    fn keys_are_wishes_and_the_job_ends_at_the_second_asking() {
        let terminal = Terminal::new(true);
        let desk = Desk::new(&terminal, Show::Line, Timetable { at: Vec::new() });
        let mut state = State {
            feed: 100,
            power: 100,
            ..State::default()
        };
        let press = |key: char, state: &mut State| desk.key(KeyCode::Char(key), false, state);
        assert_eq!(press('p', &mut state), Some(Wish::Pause));
        state.paused_at = Some(Duration::ZERO);
        assert_eq!(press('p', &mut state), Some(Wish::Resume));
        assert_eq!(press('+', &mut state), Some(Wish::Feed(Change::More)));
        assert_eq!(press('[', &mut state), Some(Wish::Power(Change::Less)));
        assert_eq!((state.feed, state.power), (110, 90));
        assert_eq!(press('0', &mut state), Some(Wish::Feed(Change::Reset)));
        assert_eq!(press('0', &mut state), Some(Wish::Power(Change::Reset)));
        assert_eq!((state.feed, state.power), (100, 100));
        assert_eq!(press('a', &mut state), Some(Wish::Pause));
        assert_eq!(press('x', &mut state), None);
        // Another key in between takes it back.
        assert_eq!(press('a', &mut state), Some(Wish::Pause));
        assert!(!terminal.interrupted());
        assert_eq!(press('a', &mut state), None);
        assert!(terminal.interrupted());
    }

    #[test]
    fn the_line_tells_what_the_machine_has_done() {
        let terminal = Terminal::new(true);
        let (job, settings) = (job(), Settings::default());
        let desk = Desk::new(&terminal, Show::Line, Timetable::of(&job, &settings));
        let status = Status {
            state: MachineState::Run,
            position_mm: Some([10.0, 5.0, 0.0]),
            rounding_mm: 0.0005,
            is_work: false,
            offset_mm: None,
            rate_mm_min: None,
            s: Some(500.0),
            overrides: None,
            output_on: None,
        };
        let mut glance = Glance {
            status: &status,
            work_mm: Some([10.0, 5.0]),
            cuts: 50,
            of_cuts: 100,
            acknowledged: 120,
            lines: job.len(),
            done_lines: 103,
            elapsed: Duration::from_secs(60),
        };
        let state = State {
            feed: 110,
            power: 100,
            ..State::default()
        };
        let line = desk.line(&glance, &state);
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
