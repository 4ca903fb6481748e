//! The firmware or program that reads the G-code, and what it can take.

use serde::{Deserialize, Serialize};

use crate::base::document::{Complaint, ranged};

/// The firmware that reads the G-code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Controller {
    /// GRBL 1.1 on an 8-bit board.
    Grbl,
    /// grblHAL, GRBL's successor on 32-bit boards.
    GrblHal,
    /// FluidNC, GRBL's successor on ESP32.
    FluidNc,
    /// LinuxCNC 2.9: it reads jobs from files.
    LinuxCnc,
    /// Any other table: it reads jobs from files, in the words that the profile's template gives.
    Generic,
}

impl std::fmt::Display for Controller {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Grbl => "GRBL",
            Self::GrblHal => "grblHAL",
            Self::FluidNc => "FluidNC",
            Self::LinuxCnc => "LinuxCNC",
            Self::Generic => "a generic table",
        })
    }
}

impl Controller {
    /// Longest line that the controller takes, characters without the line end. GRBL 1.1 answers `error:11` to more
    /// than 79; its successors and LinuxCNC keep 255 and a terminator. A generic table may say its own.
    pub fn line_limit(self) -> usize {
        match self {
            Self::Grbl => 79,
            Self::GrblHal | Self::FluidNc | Self::LinuxCnc => 255,
            // What the weakest of the others takes.
            Self::Generic => 79,
        }
    }

    /// Whether arcs (G2, G3) are written for it unless its profile says otherwise.
    pub fn arcs(self) -> bool {
        !matches!(self, Self::Generic)
    }

    /// Short lines that it takes in a second. Measured: 330 on GRBL's 8-bit board, 1000 to 1200 on 32-bit boards.
    /// LinuxCNC plans at most one segment a period of its servo thread, which is 1 ms unless somebody changed it. For
    /// an unknown table the figure is a caution.
    pub fn lines_per_s(self) -> f64 {
        match self {
            Self::Grbl => 330.0,
            Self::GrblHal | Self::FluidNc | Self::LinuxCnc => 1000.0,
            Self::Generic => 100.0,
        }
    }

    /// Whether it speaks GRBL's protocol: a job is streamed to it line by line. Others open the job as a file.
    pub fn is_streamed(self) -> bool {
        matches!(self, Self::Grbl | Self::GrblHal | Self::FluidNc)
    }
}

/// What one controller takes that differs from others of its kind: `[controller_limits]`. Every key may be left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerLimits {
    /// Longest line, characters without the line end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line_limit: Option<u32>,
    /// Whether it takes arcs (G2, G3 with I and J).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arcs: Option<bool>,
    /// Short lines that it takes in a second: it decides how short a segment may be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lines_per_s: Option<f64>,
}

impl ControllerLimits {
    pub(super) fn check(&self, controller: Controller) -> Result<(), Complaint> {
        if let Some(limit) = self.line_limit {
            // One motion with all its words needs about 50.
            ranged(
                "controller_limits.line_limit",
                f64::from(limit),
                60.0,
                4096.0,
            )?;
            let most = controller.line_limit();
            if controller != Controller::Generic && limit as usize > most {
                return Err(Complaint::new(
                    "controller_limits.line_limit",
                    format!("is {limit}, and {controller} takes {most} characters in a line"),
                ));
            }
        }
        if let Some(rate) = self.lines_per_s {
            ranged("controller_limits.lines_per_s", rate, 1.0, 100_000.0)?;
        }
        Ok(())
    }
}
