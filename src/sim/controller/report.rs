//! What the controller says of itself.

use std::fmt::Write as _;

use super::{Controller, State};
use crate::sim::modal::Spindle;

/// Every how many reports the work offset is told anew: less often while moving, as in the firmware.
const OFFSET_EVERY: (u32, u32) = (30, 10);

fn triple(values: [f64; 3]) -> String {
    // No negative zero: a machine at 0 says 0.000.
    let [x, y, z] = values.map(|v| if v.abs() < 0.0005 { 0.0 } else { v });
    format!("{x:.3},{y:.3},{z:.3}")
}

impl Controller {
    /// The reply to `?`.
    pub(super) fn status_report(&mut self) {
        let state = match self.state {
            State::Idle => "Idle",
            State::Run => "Run",
            State::Hold { standing: true } => "Hold:0",
            State::Hold { standing: false } => "Hold:1",
            State::Door { standing: true } => "Door:0",
            State::Door { standing: false } => "Door:2",
            State::Alarm | State::Critical => "Alarm",
            State::Home => "Home",
            State::Check => "Check",
        };
        let (place, speed) = self.whereabouts();
        let mut text = format!("<{state}|");
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a mask of 8 bits"
        )]
        let mask = self.settings.status_mask as u8;
        let offset = self.modal.offset();
        // Writing to a String cannot fail.
        let _ = if mask & 1 != 0 {
            write!(text, "MPos:{}", triple(place))
        } else {
            let work = std::array::from_fn(|k| place[k] - offset[k]);
            write!(text, "WPos:{}", triple(work))
        };
        if mask & 2 != 0 {
            let free = self.settings.receive_buffer - self.receive.len();
            let _ = write!(text, "|Bf:{},{free}", self.queue.free());
        }
        let s = self.output_s(speed);
        let _ = write!(text, "|FS:{:.0},{s:.0}", speed * 60.0);
        let every = if self.running.is_some() {
            OFFSET_EVERY.0
        } else {
            OFFSET_EVERY.1
        };
        match self.reports % every {
            0 => {
                let _ = write!(text, "|WCO:{}", triple(offset));
            }
            1 => {
                text.push_str("|Ov:100,100,100");
                let mut accessories = String::new();
                if self.bed.lit() {
                    accessories.push(if self.modal.spindle == Spindle::Dynamic {
                        'C'
                    } else {
                        'S'
                    });
                }
                if self.modal.flood {
                    accessories.push('F');
                }
                if self.modal.mist {
                    accessories.push('M');
                }
                if !accessories.is_empty() {
                    let _ = write!(text, "|A:{accessories}");
                }
            }
            _ => {}
        }
        text.push('>');
        self.reports = self.reports.wrapping_add(1);
        self.say(&text);
    }

    /// The power that the output has now, in S: with dynamic power the programmed one times speed over rate.
    fn output_s(&self, speed_mm_s: f64) -> f64 {
        let Some((_, cut)) = self.queue.front().filter(|_| self.running.is_some()) else {
            return self.bed.s();
        };
        match (
            self.settings.laser_mode,
            cut.drive.spindle,
            cut.drive.rate_mm_min,
        ) {
            (true, Spindle::Dynamic, Some(rate)) => {
                (self.bed.s() * speed_mm_s * 60.0 / rate).min(self.bed.s())
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
        let text = format!(
            "[GC:G{} G{} G{} G{} G{} G94 M{spindle} {coolant} T{:.0} F{:.0} S{:.0}]",
            m.motion,
            54 + m.system,
            m.plane,
            if m.inches { 20 } else { 21 },
            if m.incremental { 91 } else { 90 },
            m.tool,
            m.feed_mm_min,
            m.s,
        );
        self.say(&text);
    }

    /// `$#`.
    pub(super) fn offsets_report(&mut self) {
        for (k, system) in self.modal.systems.into_iter().enumerate() {
            self.say(&format!("[G{}:{}]", 54 + k, triple(system)));
        }
        for name in ["G28", "G30"] {
            self.say(&format!("[{name}:{}]", triple([0.0; 3])));
        }
        let g92 = self.modal.g92;
        self.say(&format!("[G92:{}]", triple(g92)));
        self.say("[TLO:0.000]");
        self.say(&format!("[PRB:{}:0]", triple([0.0; 3])));
    }
}
