//! What the three firmwares that speak GRBL's protocol do differently.
//!
//! GRBL 1.1h as measured; grblHAL and FluidNC after their sources and the figures of one board each.

use serde::{Deserialize, Serialize};

use super::settings::Settings;
use crate::machine::Controller as Kind;
use crate::planner::StepTimer;

/// A firmware that speaks GRBL's protocol.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Flavour {
    /// GRBL 1.1h on an 8-bit board.
    #[default]
    Grbl,
    /// grblHAL 1.1f.
    GrblHal,
    /// FluidNC 3.7.
    FluidNc,
}

impl Flavour {
    /// That of a machine profile's controller; GRBL for those that are not streamed to.
    pub fn of(kind: Kind) -> Self {
        match kind {
            Kind::GrblHal => Self::GrblHal,
            Kind::FluidNc => Self::FluidNc,
            Kind::Grbl | Kind::LinuxCnc | Kind::Generic => Self::Grbl,
        }
    }

    /// The longest line that it takes, characters without its end.
    pub fn line_limit(self) -> usize {
        match self {
            Self::Grbl => Kind::Grbl.line_limit(),
            Self::GrblHal => Kind::GrblHal.line_limit(),
            Self::FluidNc => Kind::FluidNc.line_limit(),
        }
    }

    /// How long it takes to read and plan a line, s per byte of it. GRBL on an AVR: 5.3 kB/s, whether as 330 lines of
    /// 16 bytes or 295 of 18. 32-bit boards take 1000 to 1200 lines/s of that length.
    pub fn byte_time_s(self) -> f64 {
        match self {
            Self::Grbl => 1.0 / 5300.0,
            Self::GrblHal | Self::FluidNc => 1.0 / 17_600.0,
        }
    }

    /// Dwells are made of pieces of this length, s; zero if they last as long as asked.
    pub fn dwell_piece_s(self) -> f64 {
        match self {
            Self::Grbl => 0.05,
            Self::GrblHal | Self::FluidNc => 0.0,
        }
    }

    /// How long the spindle and the air get to come back behind a closed door, s; grblHAL gives the spindle that time
    /// also where 0x9E has stopped it. FluidNC leaves it to the spindle.
    pub(crate) fn door_delays_s(self) -> [f64; 2] {
        match self {
            Self::Grbl | Self::GrblHal => [4.0, 1.0],
            Self::FluidNc => [0.0; 2],
        }
    }

    /// Whether a report tells what is switched on whenever that has changed, and also that it is nothing, instead of
    /// together with the overrides.
    pub(crate) fn tells_accessories_apart(self) -> bool {
        self == Self::GrblHal
    }

    /// What makes its steps, where that is known: 16 MHz for GRBL's 8-bit boards.
    pub(crate) fn step_timer(self) -> Option<StepTimer> {
        match self {
            Self::Grbl => Some(StepTimer { clock_hz: 16e6 }),
            Self::GrblHal | Self::FluidNc => None,
        }
    }

    /// Whether it waits at each stop until the motors are let go (`$1`). The others let them go by a timer.
    pub(crate) fn waits_at_stops(self) -> bool {
        self == Self::Grbl
    }

    /// Whether it hears nothing while it writes its memory.
    pub(crate) fn deaf_while_writing(self) -> bool {
        self == Self::Grbl
    }

    /// Whether it repeats an error for every block until it is cleared.
    pub(crate) fn latches_errors(self) -> bool {
        self == Self::GrblHal
    }

    /// Whether `\r\n` is one end of a line and not two.
    pub(crate) fn pairs_line_ends(self) -> bool {
        self != Self::Grbl
    }

    /// Whether a report tells the number of an alarm.
    pub(crate) fn numbers_alarms(self) -> bool {
        self == Self::GrblHal
    }

    /// Bytes that its receive buffer holds, of those that it has: a ring of grblHAL keeps one free.
    pub(crate) fn usable(self, buffer: usize) -> usize {
        match self {
            Self::GrblHal => buffer.saturating_sub(1),
            Self::Grbl | Self::FluidNc => buffer,
        }
    }

    /// `$10` as shipped: bit 0 machine position, bit 1 free buffers.
    pub fn status_mask(self) -> f64 {
        match self {
            Self::Grbl | Self::FluidNc => 1.0,
            Self::GrblHal => 511.0,
        }
    }

    /// What it says when it starts.
    pub(crate) fn banner(self) -> &'static str {
        match self {
            Self::Grbl => "Grbl 1.1h ['$' for help]",
            Self::GrblHal => "GrblHAL 1.1f ['$' or '$HELP' for help]",
            Self::FluidNc => "Grbl 3.7 [FluidNC v3.7.8 (wifi) '$' for help]",
        }
    }

    /// A message for a person.
    pub(crate) fn message(self, text: &str) -> String {
        match self {
            Self::Grbl | Self::GrblHal => format!("[MSG:{text}]"),
            Self::FluidNc => format!("[MSG:INFO: {text}]"),
        }
    }

    /// The message at the end of a program.
    pub(crate) fn program_end(self) -> &'static str {
        match self {
            Self::Grbl | Self::GrblHal => "Pgm End",
            Self::FluidNc => "Program End",
        }
    }

    /// The answer to `$I`, for a controller with these settings and this text of its owner.
    pub(crate) fn build_info(self, settings: &Settings, owner: &str) -> Vec<String> {
        let (blocks, buffer) = (settings.planner_blocks, settings.receive_buffer);
        let zero = if settings.homing_sets_zero { "Z" } else { "" };
        match self {
            Self::Grbl => vec![
                format!("[VER:1.1h.20190830:{owner}]"),
                format!("[OPT:V{zero},{blocks},{buffer}]"),
            ],
            Self::GrblHal => vec![
                format!("[VER:1.1f.20240101:{owner}]"),
                format!("[OPT:VNMSL,{blocks},{buffer},3,0]"),
                "[AXS:3:XYZ]".into(),
                "[NEWOPT:ENUMS,RT+]".into(),
                "[FIRMWARE:grblHAL]".into(),
            ],
            // It does not tell its buffers.
            Self::FluidNc => vec![
                format!("[VER:3.7 FluidNC v3.7.8 (wifi):{owner}]"),
                "[OPT:PHSW]".into(),
                self.message("Machine: laser"),
            ],
        }
    }

    /// Whether `$$` lists this setting. FluidNC keeps its settings in a file and shows a few by their old numbers.
    pub(crate) fn lists(self, number: u16) -> bool {
        self != Self::FluidNc || matches!(number, 3 | 10 | 20..=23 | 30 | 32 | 100..=132)
    }

    /// Whether this setting can be changed by its number.
    pub(crate) fn takes(self, number: u16) -> bool {
        self != Self::FluidNc || number == 10
    }
}
