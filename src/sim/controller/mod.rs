//! The controller: bytes in, bytes out, motion and a beam, on a clock that moves only when told.
//!
//! Written after GRBL 1.1h. Nothing runs by ticks: [`Controller::advance`] goes from event to event (a byte arrives, a
//! line has been read, a block ends), so a job of minutes takes milliseconds and always gives the same result. Three
//! things run side by side, as in the firmware: the wires, which take time per byte and lose what finds the receive
//! buffer full; the main program, which reads one line after the other and waits where the firmware waits; and the
//! motion, which goes on by itself.
//!
//! Not simulated: jogging, overrides (their bytes are ignored), probing, limit switches, startup blocks, sleep.

mod report;
mod system;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use super::burnt::{BeamTime, Bed, Burn, Light};
use super::modal::{Action, Arc, Drive, Modal, Spindle, interpret};
use super::settings::Settings;
use crate::planner::{Move, Profile, Queue, READING_AT_REST, dark_before_stop_s};

/// What the controller says it is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Ready.
    Idle,
    /// Moving.
    Run,
    /// Feed hold; `standing` once it has come to rest.
    Hold {
        /// At rest.
        standing: bool,
    },
    /// The safety door; `standing` once it has come to rest.
    Door {
        /// At rest.
        standing: bool,
    },
    /// Locked until `$X` or `$H`.
    Alarm,
    /// Locked, and deaf to everything but a reset (ALARM:1 and 2).
    Critical,
    /// Homing.
    Home,
    /// Checks G-code without moving.
    Check,
}

/// The longest line that is accepted, characters without spaces and comments.
pub const LINE_LIMIT: usize = 79;
/// How long the controller hears nothing while it writes its memory, s: some ten bytes at 3.4 ms.
const MEMORY_S: f64 = 0.034;

/// A block on its way.
#[derive(Clone, Copy, Debug)]
struct Cut {
    start: [f64; 3],
    end: [f64; 3],
    length_mm: f64,
    drive: Drive,
}

/// The block that moves now.
#[derive(Clone, Copy, Debug)]
struct Running {
    profile: Profile,
    start_s: f64,
    /// When the block began, s: earlier than `start_s` once its profile has been planned anew.
    block_start_s: f64,
    /// Length of the block already behind when `profile` began, mm.
    behind_mm: f64,
}

/// A line being received.
#[derive(Clone, Debug, Default)]
struct Line {
    text: Vec<u8>,
    /// Bytes read for it, blanks and comments included.
    bytes: u32,
    overflow: bool,
    paren: bool,
    semicolon: bool,
}

/// A simulated GRBL 1.1h laser controller.
#[derive(Clone, Debug)]
pub struct Controller {
    settings: Settings,
    modal: Modal,
    state: State,
    now_s: f64,
    // The wires.
    incoming: VecDeque<(f64, u8)>,
    incoming_free_s: f64,
    receive: VecDeque<u8>,
    outgoing: VecDeque<(f64, Vec<u8>)>,
    outgoing_free_s: f64,
    deaf_until_s: f64,
    lost_bytes: u64,
    // The main program.
    busy_until_s: f64,
    line: Line,
    ready: Option<Line>,
    actions: VecDeque<Action>,
    answer: Option<&'static str>,
    /// Leaving check mode resets the controller, once the line has been answered.
    reset_pending: bool,
    report_wanted: bool,
    reports: u32,
    // Motion.
    queue: Queue<Cut>,
    running: Option<Running>,
    /// Where the head is as the controller believes.
    position: [f64; 3],
    /// Where its zero lies on the bed: a controller that starts anew calls the place where the head stands zero.
    zero: [f64; 3],
    soft_limit_hit: bool,
    held_since_s: f64,
    /// When something moved first and last.
    motion_s: Option<[f64; 2]>,
    // The beam.
    bed: Bed,
    at_rest: Light,
    before_hold: Light,
}

impl Controller {
    /// A machine that has just been switched on: it sends its banner.
    pub fn new(settings: Settings) -> Self {
        let queue = Queue::new(settings.limits(), settings.planner_blocks);
        let mut new = Self {
            queue,
            modal: Modal::new(),
            state: if settings.homing {
                State::Alarm
            } else {
                State::Idle
            },
            settings,
            now_s: 0.0,
            incoming: VecDeque::new(),
            incoming_free_s: 0.0,
            receive: VecDeque::new(),
            outgoing: VecDeque::new(),
            outgoing_free_s: 0.0,
            deaf_until_s: 0.0,
            lost_bytes: 0,
            busy_until_s: 0.0,
            line: Line::default(),
            ready: None,
            actions: VecDeque::new(),
            answer: None,
            reset_pending: false,
            report_wanted: false,
            reports: 0,
            running: None,
            position: [0.0; 3],
            zero: [0.0; 3],
            soft_limit_hit: false,
            held_since_s: 0.0,
            motion_s: None,
            bed: Bed::default(),
            at_rest: Light::DARK,
            before_hold: Light::DARK,
        };
        new.banner();
        new
    }

    /// The machine's clock, s.
    pub fn now_s(&self) -> f64 {
        self.now_s
    }

    /// What it is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Its settings now.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Where the head is as the controller reports it, machine coordinates, mm.
    pub fn position_mm(&self) -> [f64; 3] {
        self.whereabouts().0
    }

    /// Where the head really is on the bed, mm: differs from [`Self::position_mm`] after a [`Self::power_up`] away from
    /// zero, until the machine is homed.
    pub fn head_mm(&self) -> [f64; 3] {
        self.on_bed(self.position_mm())
    }

    fn on_bed(&self, place: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| self.zero[k] + place[k])
    }

    /// True if the beam is on.
    pub fn beam_on(&self) -> bool {
        self.bed.lit()
    }

    /// Everything that was burnt until now, in order.
    pub fn burns(&self) -> Vec<Burn> {
        self.bed.burns(self.now_s, self.head_mm())
    }

    /// From the beginning of the first motion to the end of the last block so far, s.
    pub fn motion_s(&self) -> f64 {
        self.motion_s
            .map_or(0.0, |[first_s, last_s]| last_s - first_s)
    }

    /// How long and how often the beam was on until now.
    pub fn beam_time(&self) -> BeamTime {
        self.bed.beam_time(self.now_s)
    }

    /// Bytes that found the receive buffer full, or the controller deaf. Real firmware does not know this number.
    pub fn lost_bytes(&self) -> u64 {
        self.lost_bytes
    }

    /// True if nothing moves and nothing is left to do but wait for bytes.
    pub fn at_rest(&self) -> bool {
        self.running.is_none() && !self.working() && self.incoming.is_empty()
    }

    /// True if the main program waits for bytes: more time brings nothing but motion.
    pub fn hungry(&self) -> bool {
        !self.working() && self.incoming.is_empty()
    }

    fn working(&self) -> bool {
        self.ready.is_some()
            || !self.actions.is_empty()
            || self.answer.is_some()
            || self.report_wanted
            || !self.receive.is_empty()
            || self.busy_until_s > self.now_s
    }

    /// Puts bytes on the wire, behind those already there.
    pub fn write(&mut self, bytes: &[u8]) {
        let byte_s = self.byte_s();
        for &byte in bytes {
            self.incoming_free_s = self.incoming_free_s.max(self.now_s) + byte_s;
            self.incoming.push_back((self.incoming_free_s, byte));
        }
    }

    /// Takes what has arrived at the host by now; `into` is appended to.
    pub fn read(&mut self, into: &mut Vec<u8>) {
        while let Some((arrival_s, _)) = self.outgoing.front()
            && *arrival_s <= self.now_s
        {
            if let Some((_, bytes)) = self.outgoing.pop_front() {
                into.extend_from_slice(&bytes);
            }
        }
    }

    /// True if something has arrived at the host by now and was not read.
    pub fn has_output(&self) -> bool {
        self.outgoing
            .front()
            .is_some_and(|(at, _)| *at <= self.now_s)
    }

    /// When the next thing happens by itself, if anything will: motion, a reply's arrival, a line read.
    pub fn next_event_s(&self) -> Option<f64> {
        let reply = self.outgoing.front().map_or(f64::INFINITY, |(at, _)| *at);
        let next = self.next_inside_s().min(reply);
        next.is_finite().then_some(next.max(self.now_s))
    }

    /// The next event of the machine itself; replies on the wire are events for the host alone.
    fn next_inside_s(&self) -> f64 {
        let mut next = f64::INFINITY;
        if let Some(&(at, _)) = self.incoming.front() {
            next = at;
        }
        if let Some(running) = &self.running {
            next = next.min(running.start_s + running.profile.duration_s());
        }
        if self.busy_until_s > self.now_s {
            next = next.min(self.busy_until_s);
        }
        if !self.suspended()
            && let Some(Action::Dwell {
                until_s: Some(until),
                ..
            }) = self.actions.front()
        {
            // A dwell that is over is only noticed once the main program is free again.
            next = next.min(until.max(self.busy_until_s));
        }
        next
    }

    /// Lets the clock run to `until_s`.
    pub fn advance(&mut self, until_s: f64) {
        loop {
            self.settle();
            let next = self.next_inside_s();
            if next > until_s {
                break;
            }
            self.now_s = self.now_s.max(next);
        }
        self.now_s = self.now_s.max(until_s);
    }

    /// Lets the clock run until nothing moves and nothing is left to do, as after the cable was pulled: the lines in
    /// the buffers still run. At most `limit_s` from now; true if it came to rest.
    pub fn run_out(&mut self, limit_s: f64) -> bool {
        let end = self.now_s + limit_s;
        while !self.at_rest() && self.now_s < end {
            let next = self.next_inside_s().clamp(self.now_s, end);
            self.advance(next);
            if next == end || !self.next_inside_s().is_finite() {
                break;
            }
        }
        self.at_rest()
    }

    /// The power is cut: everything stops where it is, nothing is heard any more and the beam is off.
    pub fn power_off(&mut self) {
        self.position = self.position_mm();
        self.stop_motion();
        self.incoming.clear();
        self.receive.clear();
        self.outgoing.clear();
        self.forget_program();
        self.state = State::Critical;
    }

    /// As when the port is opened and DTR toggles: the controller starts anew, without an alarm. The head stays where it
    /// is, but the controller has forgotten where that is, and calls it zero.
    pub fn power_up(&mut self) {
        self.incoming.clear();
        self.outgoing.clear();
        self.outgoing_free_s = self.now_s;
        self.incoming_free_s = self.now_s;
        self.stop_motion();
        self.zero = self.head_mm();
        self.position = [0.0; 3];
        self.restart();
        self.state = if self.settings.homing {
            State::Alarm
        } else {
            State::Idle
        };
        self.banner();
    }

    // ---- wires -------------------------------------------------------------------------------------------------

    fn byte_s(&self) -> f64 {
        self.settings.baud.map_or(0.0, |baud| 10.0 / baud.max(1.0))
    }

    fn say(&mut self, text: &str) {
        let mut bytes = Vec::with_capacity(text.len() + 2);
        bytes.extend_from_slice(text.as_bytes());
        bytes.extend_from_slice(b"\r\n");
        #[expect(clippy::cast_precision_loss, reason = "a line of text")]
        let wire_s = bytes.len() as f64 * self.byte_s();
        self.outgoing_free_s = self.outgoing_free_s.max(self.now_s) + wire_s;
        self.outgoing.push_back((self.outgoing_free_s, bytes));
    }

    fn banner(&mut self) {
        self.say("");
        self.say("Grbl 1.1h ['$' for help]");
        if self.state == State::Alarm {
            self.say("[MSG:'$H'|'$X' to unlock]");
        }
    }

    fn settle(&mut self) {
        loop {
            let mut progress = false;
            while let Some(&(at, byte)) = self.incoming.front()
                && at <= self.now_s
            {
                self.incoming.pop_front();
                self.arrive(byte);
                progress = true;
            }
            if let Some(running) = self.running
                && running.start_s + running.profile.duration_s() <= self.now_s
            {
                self.block_ends(running);
                progress = true;
            }
            if self.busy_until_s <= self.now_s && self.main_step() {
                progress = true;
            }
            if !progress {
                return;
            }
        }
    }

    /// The receive interrupt: realtime bytes act at once, the others wait in the buffer, or are lost.
    fn arrive(&mut self, byte: u8) {
        if self.now_s < self.deaf_until_s {
            self.lost_bytes += 1;
            return;
        }
        match byte {
            0x18 => self.soft_reset(),
            b'?' => self.report_wanted = true,
            b'!' => self.hold(false),
            b'~' => self.resume(),
            0x84 => self.hold(true),
            0x9e => self.spindle_stop(),
            // Overrides and whatever else is not text: taken out of the stream, as the firmware does.
            0x80..=0xff => {}
            _ if self.receive.len() >= self.settings.receive_buffer => self.lost_bytes += 1,
            _ => self.receive.push_back(byte),
        }
    }

    // ---- the main program --------------------------------------------------------------------------------------

    fn suspended(&self) -> bool {
        matches!(
            self.state,
            State::Hold { .. } | State::Door { .. } | State::Critical
        )
    }

    /// One thing that the main program does now; false if it must wait.
    fn main_step(&mut self) -> bool {
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
    fn take_byte(&mut self, byte: u8) -> bool {
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

    fn execute(&mut self, line: &Line) {
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
    fn act(&mut self, action: Action) -> bool {
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

    fn more_arc(&mut self, arc: Arc) {
        self.actions.push_front(Action::Arc(arc));
    }

    fn write_memory(&mut self) {
        self.deaf_until_s = self.now_s + MEMORY_S;
        self.busy_until_s = self.deaf_until_s;
    }

    // ---- motion ------------------------------------------------------------------------------------------------

    /// Where the head is and how fast, mm and mm/s.
    fn whereabouts(&self) -> ([f64; 3], f64) {
        let (Some(running), Some((_, cut))) = (&self.running, self.queue.front()) else {
            return (self.position, 0.0);
        };
        let (along, speed) = running.profile.at(self.now_s - running.start_s);
        let part = ((running.behind_mm + along) / cut.length_mm).clamp(0.0, 1.0);
        let place = std::array::from_fn(|k| cut.start[k] + (cut.end[k] - cut.start[k]) * part);
        (place, speed)
    }

    /// Plans a straight move: soft limits, whole steps, and the look-ahead of what already moves.
    fn plan_line(&mut self, target: [f64; 3], drive: Drive) {
        if self.settings.soft_limits && !self.within_travel(target) {
            self.actions.clear();
            self.answer = None;
            self.soft_limit_hit = true;
            if self.running.is_some() {
                self.hold(false);
            } else {
                self.soft_limit_alarm();
            }
            return;
        }
        let end: [f64; 3] = std::array::from_fn(|k| {
            let steps = self.settings.steps_per_mm[k];
            (target[k] * steps).round() / steps
        });
        let start = self.planned_end();
        let delta_mm: [f64; 3] = std::array::from_fn(|k| end[k] - start[k]);
        let length_mm = delta_mm.iter().map(|d| d * d).sum::<f64>().sqrt();
        let cut = Cut {
            start,
            end,
            length_mm,
            drive,
        };
        let exit_before = self.queue.exit_sqr();
        let mut now = (0.0, 0.0);
        if let Some(running) = &self.running {
            let (along, speed) = running.profile.at(self.now_s - running.start_s);
            let done = running.behind_mm + along;
            let whole = self.queue.front().map_or(0.0, |(_, c)| c.length_mm);
            now = (done, speed);
            self.queue.set_front(whole - done, speed);
        }
        let wanted = Move {
            delta_mm,
            rate_mm_min: drive.rate_mm_min,
        };
        match self.queue.push(&wanted, cut) {
            Ok(true) => {
                if self.running.is_some() && self.queue.exit_sqr() != exit_before {
                    self.begin_block(now.0);
                }
            }
            // A move to the present place is dropped. With M3 in laser mode the output is set to what the line says,
            // once the head stands there.
            Ok(false) if self.settings.laser_mode && drive.spindle == Spindle::Constant => {
                self.actions.push_front(Action::Spindle {
                    spindle: drive.spindle,
                    s: drive.s,
                });
                self.actions.push_front(Action::Sync);
            }
            Ok(false) => {}
            // Callers have looked for room.
            Err(_) => self.actions.push_front(Action::Line { target, drive }),
        }
    }

    fn planned_end(&self) -> [f64; 3] {
        self.queue.back().map_or(self.position, |cut| cut.end)
    }

    fn within_travel(&self, target: [f64; 3]) -> bool {
        // GRBL's machine space is negative: from −travel to 0.
        target
            .iter()
            .zip(self.settings.travel_mm)
            .all(|(&t, travel)| t <= 0.0 && t >= -travel)
    }

    /// Starts to move if there is something planned and nothing moves; true if it did.
    fn start_cycle(&mut self) -> bool {
        if self.running.is_some() || self.queue.is_empty() || self.state != State::Idle {
            return false;
        }
        self.state = State::Run;
        self.begin_first();
        true
    }

    fn begin_first(&mut self) {
        let behind = self.queue.front().map_or(0.0, |(block, cut)| {
            (cut.length_mm - block.length_mm).max(0.0)
        });
        self.begin_block(behind);
        self.light_block();
    }

    /// The first block's profile from now, `behind_mm` of it already done.
    fn begin_block(&mut self, behind_mm: f64) {
        self.motion_s.get_or_insert([self.now_s; 2]);
        let block_start_s = match &self.running {
            Some(running) => running.block_start_s,
            None => self.now_s,
        };
        self.running = self.queue.front_profile().map(|profile| Running {
            profile,
            start_s: self.now_s,
            block_start_s,
            behind_mm,
        });
    }

    /// The beam as the first block wants it.
    fn light_block(&mut self) {
        let Some((_, cut)) = self.queue.front() else {
            return;
        };
        let light = Light {
            s: cut.drive.s,
            spindle: cut.drive.spindle,
            rapid: cut.drive.rate_mm_min.is_none(),
        };
        self.bed.light(self.now_s, self.head_mm(), light);
        // What the output is left at when the machine comes to rest after this block.
        let dark = self.settings.laser_mode && light.spindle == Spindle::Dynamic;
        self.at_rest = if dark {
            Light::DARK
        } else {
            Light {
                rapid: false,
                ..light
            }
        };
    }

    /// The output while standing, from now.
    fn rest(&mut self, light: Light) {
        self.at_rest = light;
        let head = self.on_bed(self.position);
        self.bed.light(self.now_s, head, light);
    }

    /// The running profile has ended: on to the next block, or to rest.
    fn block_ends(&mut self, running: Running) {
        if let Some([_, last_s]) = &mut self.motion_s {
            *last_s = self.now_s;
        }
        let exit = running.profile.exit_mm_s();
        let Some((_, cut)) = self.queue.front() else {
            self.running = None;
            return;
        };
        let left = cut.length_mm - running.behind_mm - running.profile.length_mm();
        let holding = matches!(
            self.state,
            State::Hold { standing: false } | State::Door { standing: false }
        );
        if holding && left > 1e-9 {
            // Stopped within the block: the rest of it waits.
            self.position = self.whereabouts().0;
            self.running = None;
            self.queue.set_front(left, 0.0);
            self.queue.replan_all();
            self.held();
            return;
        }
        if exit == 0.0 && cut.drive.spindle == Spindle::Dynamic && self.settings.laser_mode {
            let steps = (0..3).map(|k| {
                (cut.end[k] - cut.start[k]).abs() / cut.length_mm * self.settings.steps_per_mm[k]
            });
            self.bed.faded(dark_before_stop_s(
                &running.profile,
                running.start_s - running.block_start_s,
                steps.fold(0.0, f64::max),
            ));
        }
        self.position = cut.end;
        self.queue.pop();
        self.running = None;
        if let Some((block, _)) = self.queue.front().map(|(b, c)| (*b, *c)) {
            self.queue.set_front(block.length_mm, exit);
            if holding && exit == 0.0 {
                self.queue.replan_all();
                self.held();
            } else if holding {
                self.running = Some(Running {
                    profile: Profile::braking(block.length_mm, exit, block.acceleration_mm_s2),
                    start_s: self.now_s,
                    block_start_s: self.now_s,
                    behind_mm: 0.0,
                });
                self.light_block();
            } else {
                self.begin_block(0.0);
                self.light_block();
            }
        } else if holding {
            self.held();
        } else {
            self.state = State::Idle;
            self.rest(self.at_rest);
            self.idle_delay();
        }
    }

    /// The firmware blocks while it holds the motors for a moment.
    fn idle_delay(&mut self) {
        if self.settings.step_idle_delay_ms < 255.0 {
            self.busy_until_s = self
                .busy_until_s
                .max(self.now_s + self.settings.step_idle_delay_ms * 1e-3);
        }
    }

    // ---- realtime commands -------------------------------------------------------------------------------------

    fn hold(&mut self, door: bool) {
        let moving = self.running.is_some();
        match self.state {
            State::Idle | State::Run => self.held_since_s = self.now_s,
            State::Hold { .. } if door => {}
            _ => return,
        }
        if let State::Hold { standing } = self.state {
            self.state = State::Door { standing };
            if standing {
                self.rest(Light::DARK);
            }
            return;
        }
        self.state = if door {
            State::Door { standing: false }
        } else {
            State::Hold { standing: false }
        };
        if !moving {
            self.held();
            return;
        }
        if let (Some(running), Some((block, cut))) = (self.running, self.queue.front()) {
            let (along, speed) = running.profile.at(self.now_s - running.start_s);
            let behind_mm = running.behind_mm + along;
            self.running = Some(Running {
                profile: Profile::braking(
                    (cut.length_mm - behind_mm).max(0.0),
                    speed,
                    block.acceleration_mm_s2,
                ),
                start_s: self.now_s,
                block_start_s: running.block_start_s,
                behind_mm,
            });
        }
    }

    /// A hold has come to rest.
    fn held(&mut self) {
        if self.soft_limit_hit {
            self.soft_limit_alarm();
            return;
        }
        let door = matches!(self.state, State::Door { .. });
        self.state = if door {
            State::Door { standing: true }
        } else {
            State::Hold { standing: true }
        };
        self.before_hold = self.at_rest;
        // Without laser mode a hold leaves the output as it is, as for a mill; the door always switches it off.
        let light = if self.settings.laser_mode || door {
            Light::DARK
        } else {
            self.at_rest
        };
        let head = self.on_bed(self.position);
        self.bed.light(self.now_s, head, light);
        self.idle_delay();
    }

    fn resume(&mut self) {
        if !matches!(
            self.state,
            State::Hold { standing: true } | State::Door { standing: true }
        ) {
            return;
        }
        self.at_rest = self.before_hold;
        if let Some(Action::Dwell {
            until_s: Some(until),
            ..
        }) = self.actions.front_mut()
        {
            *until += self.now_s - self.held_since_s;
        }
        if self.queue.is_empty() {
            self.state = State::Idle;
            self.rest(self.at_rest);
        } else {
            self.state = State::Run;
            self.begin_first();
        }
    }

    /// 0x9E: in a hold at rest, the output off, or on again.
    fn spindle_stop(&mut self) {
        if self.state == (State::Hold { standing: true }) {
            let light = if self.bed.lit() {
                Light::DARK
            } else {
                self.before_hold
            };
            let head = self.on_bed(self.position);
            self.bed.light(self.now_s, head, light);
        }
    }

    fn soft_limit_alarm(&mut self) {
        self.soft_limit_hit = false;
        self.stop_motion();
        self.forget_program();
        self.state = State::Critical;
        self.say("ALARM:2");
        self.say("[MSG:Reset to continue]");
    }

    fn stop_motion(&mut self) {
        self.position = self.whereabouts().0;
        self.running = None;
        self.queue.clear();
        self.rest(Light::DARK);
    }

    fn forget_program(&mut self) {
        self.actions.clear();
        self.answer = None;
        self.reset_pending = false;
        self.ready = None;
        self.line = Line::default();
        self.report_wanted = false;
        self.busy_until_s = self.now_s;
    }

    /// Everything but the state and the wires back to how it starts.
    fn restart(&mut self) {
        self.stop_motion();
        self.forget_program();
        self.receive.clear();
        self.soft_limit_hit = false;
        self.before_hold = Light::DARK;
        self.reports = 0;
        self.modal.reset(self.position);
        self.queue.set_limits(self.settings.limits());
    }

    fn soft_reset(&mut self) {
        let lost = matches!(
            self.state,
            State::Run
                | State::Home
                | State::Hold { standing: false }
                | State::Door { standing: false }
        );
        let locked = matches!(self.state, State::Alarm | State::Critical);
        self.restart();
        if lost {
            self.say("ALARM:3");
        }
        self.state = if lost || locked {
            State::Alarm
        } else {
            State::Idle
        };
        self.banner();
    }
}
