//! The controller: bytes in, bytes out, motion and a beam, on a clock that moves only when told.
//!
//! Written after GRBL 1.1h; where grblHAL and FluidNC differ stands in [`Flavour`](super::Flavour). Nothing runs by
//! ticks: [`Controller::advance`] goes from event to event (a byte arrives, a line has been read, a block ends), so a job
//! of minutes takes milliseconds and always gives the same result. Three things run side by side, as in the firmware:
//! the wires, which take time per byte and lose what finds the receive buffer full; the main program, which reads one
//! line after the other and waits where the firmware waits; and the motion, which goes on by itself.
//!
//! Not simulated: spindle synchronisation, parking, switches that bounce, steps that are lost where homing ends dead at
//! a switch, and the steps already made ready when a hold or a touch of the probe comes (some 50 ms on GRBL): braking
//! begins at once.

mod hold;
mod homing;
mod limits;
mod motion;
mod overrides;
mod power;
mod probe;
mod program;
mod report;
mod reset;
mod system;
#[cfg(test)]
mod tests;
mod wires;

use std::collections::VecDeque;

use super::burnt::{BeamChange, BeamTime, Bed, Burn, Light};
use super::faults::Mishap;
use super::modal::{Action, Drive, Modal, Spindle};
use super::settings::Settings;
use crate::planner::{Profile, Queue};

use hold::{Restore, Stop};
use homing::Homing;
use overrides::Overrides;
use probe::Probing;

pub use power::Life;

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
    /// The door is closed again and the output comes back; the head still stands.
    Restoring,
    /// Jogging.
    Jog,
    /// Asleep: deaf to everything but a reset.
    Sleep,
    /// Homing.
    Home,
    /// Checks G-code without moving.
    Check,
}

/// How long the controller hears nothing while it writes its memory, s: some ten bytes at 3.4 ms.
const MEMORY_S: f64 = 0.034;

/// A block on its way.
#[derive(Clone, Copy, Debug)]
struct Cut {
    start: [f64; 3],
    end: [f64; 3],
    length_mm: f64,
    drive: Drive,
    /// A jog, or probing: the feed override does not touch it.
    fixed_feed: bool,
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
    life: Life,
    now_s: f64,
    /// What will happen to it, and when.
    due: Vec<(f64, Mishap)>,
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
    answer: Option<String>,
    /// Startup lines still to be run.
    starting: VecDeque<String>,
    /// The error that is repeated for every block.
    latched: Option<u8>,
    /// The last end of a line, to see a pair of them.
    line_end: Option<u8>,
    /// Leaving check mode resets the controller, once the line has been answered.
    reset_pending: bool,
    report_wanted: bool,
    /// Reports until the next that tells the work offset, and the overrides.
    offset_in: u32,
    overrides_in: u32,
    overrides: Overrides,
    /// The number of the last alarm.
    alarm: u8,
    // Memory that outlives the power.
    factory: Settings,
    startup: [String; 2],
    owner: String,
    // Motion.
    queue: Queue<Cut>,
    running: Option<Running>,
    /// Where the head is as the controller believes.
    position: [f64; 3],
    /// Where its zero lies on the bed: a controller that starts anew calls the place where the head stands zero.
    zero: [f64; 3],
    soft_limit_hit: bool,
    /// A jog is being cancelled.
    jog_cancelled: bool,
    homing: Option<Homing>,
    probing: Option<Probing>,
    /// What probing found last, and whether it did.
    probed: ([f64; 3], bool),
    /// What became of 0x9E.
    stop: Stop,
    /// What a hold puts back at its end.
    restore: Restore,
    held_since_s: f64,
    /// When the output has had its time to come back, and the head moves on.
    resume_s: Option<f64>,
    /// Air has still to come back.
    air_waits: bool,
    /// When something moved first and last.
    motion_s: Option<[f64; 2]>,
    // The beam.
    bed: Bed,
    light: Light,
    at_rest: Light,
    /// The last M3, M4 or M5 that was done, not only read, and the S with it.
    spindle: Spindle,
    spindle_s: f64,
    /// Mist and flood, as they are switched.
    air: [bool; 2],
    /// What is switched on has changed since it was told.
    accessory_news: bool,
}

impl Controller {
    /// A machine that has just been switched on: it sends its banner.
    pub fn new(settings: Settings) -> Self {
        let queue = Queue::new(settings.limits(), settings.planner_blocks)
            .timed(settings.flavour.step_timer(), settings.steps_per_mm);
        let mut new = Self {
            queue,
            modal: Modal::new(),
            state: if settings.homing {
                State::Alarm
            } else {
                State::Idle
            },
            factory: settings.clone(),
            startup: Default::default(),
            owner: String::new(),
            settings,
            life: Life::Running,
            now_s: 0.0,
            due: Vec::new(),
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
            starting: VecDeque::new(),
            latched: None,
            line_end: None,
            reset_pending: false,
            report_wanted: false,
            offset_in: 0,
            overrides_in: 0,
            overrides: Overrides::default(),
            alarm: 0,
            running: None,
            position: [0.0; 3],
            zero: [0.0; 3],
            soft_limit_hit: false,
            jog_cancelled: false,
            homing: None,
            probing: None,
            probed: ([0.0; 3], false),
            stop: Stop::None,
            restore: Restore::NOTHING,
            held_since_s: 0.0,
            resume_s: None,
            air_waits: false,
            motion_s: None,
            bed: Bed::default(),
            light: Light::DARK,
            at_rest: Light::DARK,
            spindle: Spindle::Off,
            spindle_s: 0.0,
            air: [false; 2],
            accessory_news: false,
        };
        new.boot();
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

    /// Where the head really is on the bed, mm: differs from [`Self::position_mm`] after a [`Self::reboot`] away from
    /// zero, until the machine is homed.
    pub fn head_mm(&self) -> [f64; 3] {
        match &self.homing {
            Some(homing) => homing.head(self.now_s),
            None => self.on_bed(self.position_mm()),
        }
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

    /// Every switching of the beam so far, in order.
    pub fn beam_changes(&self) -> &[BeamChange] {
        self.bed.changes()
    }

    /// When something moved first, s.
    pub fn first_motion_s(&self) -> Option<f64> {
        self.motion_s.map(|[first_s, _]| first_s)
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
            || !self.starting.is_empty()
            || self.report_wanted
            || self.resume_s.is_some()
            || self.homing.is_some()
            || !self.receive.is_empty()
            || self.busy_until_s > self.now_s
    }

    /// When the next thing happens by itself, if anything will: motion, a reply's arrival, a line read.
    pub fn next_event_s(&self) -> Option<f64> {
        let reply = self.outgoing.front().map_or(f64::INFINITY, |(at, _)| *at);
        let next = self.next_inside_s().min(reply);
        next.is_finite().then_some(next.max(self.now_s))
    }

    /// The next event of the machine itself; replies on the wire are events for the host alone.
    fn next_inside_s(&self) -> f64 {
        let mut next = self
            .due
            .iter()
            .map(|(at, _)| *at)
            .fold(f64::INFINITY, f64::min);
        if self.life != Life::Running {
            return next;
        }
        if let Some(&(at, _)) = self.incoming.front() {
            next = next.min(at);
        }
        if let Some(running) = &self.running {
            next = next.min(running.start_s + running.profile.duration_s());
        }
        for at in self.switch_s().into_iter().chain(self.touch_s()) {
            next = next.min(at);
        }
        if self.busy_until_s > self.now_s {
            next = next.min(self.busy_until_s);
        }
        if let Some(homing) = &self.homing {
            next = next.min(homing.due_s());
        }
        if let Some(at) = self.resume_s {
            next = next.min(at.max(self.busy_until_s));
        }
        if !self.suspended()
            && self.resume_s.is_none()
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

    fn settle(&mut self) {
        while let Some(k) = self.due.iter().position(|(at, _)| *at <= self.now_s) {
            let (_, mishap) = self.due.remove(k);
            self.suffer(mishap);
        }
        if self.life != Life::Running {
            return;
        }
        loop {
            let mut progress = false;
            while let Some(&(at, byte)) = self.incoming.front()
                && at <= self.now_s
            {
                self.incoming.pop_front();
                self.arrive(byte);
                progress = true;
            }
            if self.switch_s().is_some_and(|at| at <= self.now_s) {
                self.limit_switch();
                progress = true;
            }
            if self.touch_s().is_some_and(|at| at <= self.now_s) {
                self.touch();
                progress = true;
            }
            if let Some(running) = self.running
                && running.start_s + running.profile.duration_s() <= self.now_s
            {
                self.block_ends(running);
                progress = true;
            }
            if self
                .homing
                .as_ref()
                .is_some_and(|h| h.due_s() <= self.now_s)
            {
                self.homing_step();
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
}
