//! What the controller says of itself.

use std::fmt::Write as _;

use super::{Controller, State};
use crate::sim::modal::Spindle;
use crate::sim::settings::Switch;

/// Every how many reports the work offset and the overrides are told: less often while moving, as in the firmware.
const OFFSET_EVERY: [u32; 2] = [10, 30];
const OVERRIDES_EVERY: [u32; 2] = [10, 20];

impl Controller {
    /// Three lengths, mm or inches as `$13` wants.
    fn triple(&self, values: [f64; 3]) -> String {
        let (unit, digits) = if self.settings.report_inches {
            (25.4, 4)
        } else {
            (1.0, 3)
        };
        // No negative zero: a machine at 0 says 0.000.
        let [x, y, z] = values.map(|v| {
            if v.abs() < 0.00005 * unit {
                0.0
            } else {
                v / unit
            }
        });
        format!("{x:.digits$},{y:.digits$},{z:.digits$}")
    }

    /// A rate, in mm/min or inches/min.
    fn rate(&self, mm_min: f64) -> String {
        if self.settings.report_inches {
            format!("{:.1}", mm_min / 25.4)
        } else {
            format!("{mm_min:.0}")
        }
    }

    fn state_name(&self) -> String {
        match self.state {
            State::Idle => "Idle",
            State::Run => "Run",
            State::Hold { standing: true } => "Hold:0",
            State::Hold { standing: false } => "Hold:1",
            State::Door { standing: true } => "Door:0",
            State::Door { standing: false } => "Door:2",
            State::Restoring => "Door:3",
            State::Alarm | State::Critical
                if self.settings.flavour.numbers_alarms() && self.alarm != 0 =>
            {
                return format!("Alarm:{}", self.alarm);
            }
            State::Alarm | State::Critical => "Alarm",
            State::Home => "Home",
            State::Check => "Check",
            State::Jog => "Jog",
            State::Sleep => "Sleep",
        }
        .to_owned()
    }

    /// The reply to `?`.
    pub(super) fn status_report(&mut self) {
        let (place, speed) = self.whereabouts();
        let mut text = format!("<{}|", self.state_name());
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a mask of 9 bits"
        )]
        let mask = self.settings.status_mask as u16;
        let offset = self.modal.offset();
        // Writing to a String cannot fail.
        let _ = if mask & 1 != 0 {
            write!(text, "MPos:{}", self.triple(place))
        } else {
            let work = std::array::from_fn(|k| place[k] - offset[k]);
            write!(text, "WPos:{}", self.triple(work))
        };
        if mask & 2 != 0 {
            let _ = write!(text, "|Bf:{},{}", self.queue.free(), self.receive_free());
        }
        let s = self.output_s(speed);
        let _ = write!(text, "|FS:{},{s:.0}", self.rate(speed * 60.0));
        let pins = self.pins();
        if !pins.is_empty() {
            let _ = write!(text, "|Pn:{pins}");
        }
        let resting = matches!(
            self.state,
            State::Idle | State::Alarm | State::Critical | State::Check | State::Sleep
        );
        let busy = usize::from(!resting);
        let mut overrides = self.overrides_in == 0;
        if self.offset_in > 0 {
            self.offset_in -= 1;
        } else {
            self.offset_in = OFFSET_EVERY[busy] - 1;
            // The overrides come with the next report, not with this one.
            (overrides, self.overrides_in) = (false, self.overrides_in.max(1));
            let _ = write!(text, "|WCO:{}", self.triple(offset));
        }
        if overrides {
            self.overrides_in = OVERRIDES_EVERY[busy] - 1;
            let o = self.overrides;
            let _ = write!(text, "|Ov:{},{},{}", o.feed, o.rapid, o.spindle);
        } else {
            self.overrides_in -= 1;
        }
        let on = self.accessories();
        if overrides && !on.is_empty() || std::mem::take(&mut self.accessory_news) {
            self.accessory_news = false;
            let _ = write!(text, "|A:{on}");
        }
        text.push('>');
        self.say(&text);
    }

    /// Inputs that are closed now, as one letter each: the probe, and switches that the head presses or that are stuck.
    fn pins(&self) -> String {
        let head = self.head_mm();
        let axes = ['X', 'Y', 'Z'].into_iter().enumerate();
        let pressed = axes.filter(|&(k, _)| {
            self.settings.homing
                && (self.settings.switches[k] == Switch::Stuck || self.beyond(k, head[k]))
        });
        let probe = self.probe_pin().then_some('P');
        probe
            .into_iter()
            .chain(pressed.map(|(_, letter)| letter))
            .collect()
    }

    /// What is switched on now, as one letter each.
    fn accessories(&self) -> String {
        let clockwise = self.light.spindle != Spindle::Dynamic;
        let [mist, flood] = self.air;
        [
            (self.bed.lit() && clockwise, 'S'),
            (self.bed.lit() && !clockwise, 'C'),
            (flood, 'F'),
            (mist, 'M'),
        ]
        .into_iter()
        .filter_map(|(on, letter)| on.then_some(letter))
        .collect()
    }

    /// The power that the output has now, in S: with dynamic power the programmed one times speed over rate.
    fn output_s(&self, speed_mm_s: f64) -> f64 {
        let Some((_, cut)) = self.queue.front().filter(|_| self.running.is_some()) else {
            return self.bed.s();
        };
        match (self.light.dynamic, cut.drive.rate_mm_min) {
            (true, Some(rate)) => {
                (self.bed.s() * speed_mm_s * 60.0 / rate).min(self.settings.s_max)
            }
            _ => self.bed.s(),
        }
    }

    /// `$G`.
    pub(super) fn modal_report(&mut self) {
        let m = &self.modal;
        let spindle = match m.spindle {
            Spindle::Off => 5,
            Spindle::Constant => 3,
            Spindle::Dynamic => 4,
        };
        let coolant = match (m.mist, m.flood) {
            (false, false) => "M9",
            (true, false) => "M7",
            (false, true) => "M8",
            (true, true) => "M7 M8",
        };
        let feed = self.rate(m.feed_mm_min);
        let motion = match m.motion {
            probing @ 380.. => format!("38.{}", probing - 380),
            plain => plain.to_string(),
        };
        let text = format!(
            "[GC:G{motion} G{} G{} G{} G{} G{} M{spindle} {coolant} T{:.0} F{feed} S{:.0}]",
            54 + m.system,
            m.plane,
            if m.inches { 20 } else { 21 },
            if m.incremental { 91 } else { 90 },
            if m.inverse_time { 93 } else { 94 },
            m.tool,
            m.s,
        );
        self.say(&text);
    }

    /// `$#`.
    pub(super) fn offsets_report(&mut self) {
        for (k, system) in self.modal.systems.into_iter().enumerate() {
            let text = format!("[G{}:{}]", 54 + k, self.triple(system));
            self.say(&text);
        }
        for (name, place) in ["G28", "G30"].into_iter().zip(self.modal.places) {
            let text = format!("[{name}:{}]", self.triple(place));
            self.say(&text);
        }
        let g92 = format!("[G92:{}]", self.triple(self.modal.g92));
        let length = self.triple([self.modal.tool_length, 0.0, 0.0]);
        let length = length.split(',').next().unwrap_or_default();
        let length = format!("[TLO:{length}]");
        for text in [g92, length] {
            self.say(&text);
        }
        self.probe_report();
    }

    /// What probing found last, machine coordinates.
    pub(super) fn probe_report(&mut self) {
        let (place, found) = self.probed;
        let text = format!("[PRB:{}:{}]", self.triple(place), u8::from(found));
        self.say(&text);
    }
}
