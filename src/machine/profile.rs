//! A machine's profile and its checks.

use serde::{Deserialize, Serialize};

use super::controller::{Controller, ControllerLimits};
use super::lines::{self, Where};
use super::tool::{LaserTool, PlasmaTool, Tool};
use crate::base::document::{Complaint, ranged};
use crate::material::{FORMAT, check_format, check_name};

/// The corner of the bed where X and Y are zero, seen by a person in front of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// Coordinates grow from 0.
    FrontLeft,
    /// X runs from −width to 0.
    FrontRight,
    /// Y runs from −height to 0.
    RearLeft,
    /// Both are negative.
    RearRight,
}

/// The bed: `[bed]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bed {
    /// Along X, millimetres.
    pub width_mm: f64,
    /// Along Y, millimetres.
    pub height_mm: f64,
    /// Where zero lies.
    pub origin: Origin,
    /// Kept free on every side, millimetres.
    pub margin_mm: f64,
}

/// One number for each axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axes {
    /// Of the X axis.
    pub x: f64,
    /// Of the Y axis.
    pub y: f64,
}

/// How it moves: `[motion]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Largest rate of each axis, millimetres per minute (`$110`, `$111`).
    pub rate_mm_per_min: Axes,
    /// Acceleration of each axis, millimetres per second squared (`$120`, `$121`).
    pub acceleration_mm_per_s2: Axes,
    /// Junction deviation, millimetres (`$11`).
    pub junction_deviation_mm: f64,
}

/// How a streamed controller is reached: `[connection]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Connection {
    /// Bits per second.
    pub baud: u32,
    /// Bytes that the controller holds of what it has not yet read.
    pub receive_buffer_bytes: u32,
    /// Moves that the controller plans ahead.
    pub planner_blocks: u32,
    /// Whether opening the port resets the controller.
    pub reset_on_open: bool,
    /// Cuts that may be sent without being proven by the head's position: so many at most are cut twice after whatever
    /// happened. 3 unless given. Measured: from 2 on it costs no time; 1 costs 3 % on a sheet of 1500 slits of 3 mm to
    /// 6 mm at 25 mm/s, and up to 11 % at 100 mm/s, because the head stands at each slit until the last one is proven.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_unconfirmed_cuts: Option<u32>,
    /// How lines are handed over; `counted` unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub streaming: Option<HandOver>,
}

/// How lines are handed to a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HandOver {
    /// As many as its buffer holds.
    Counted,
    /// Each after the answer to the one before: for firmware that loses count, at half the rate or less.
    Answered,
}

impl Connection {
    /// [`Connection::max_unconfirmed_cuts`] where the profile does not say.
    pub const UNCONFIRMED_CUTS: u32 = 3;
}

/// Homing: `[homing]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Homing {
    /// Whether the machine has switches and `$H` works.
    pub enabled: bool,
}

/// A point on the bed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Millimetres.
    pub x_mm: f64,
    /// Millimetres.
    pub y_mm: f64,
}

/// What stands around every job: `[job]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Job {
    /// Where the head goes at the end, with the beam off.
    pub park: Place,
    /// Lines after units and modes are set and before the first motion.
    #[serde(default)]
    pub preamble: Vec<String>,
    /// Lines after the head is parked.
    #[serde(default)]
    pub postamble: Vec<String>,
}

/// A machine: the whole of `machines/NAME.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Version of the format; 1.
    pub format: u32,
    /// Its name, as `--machine` takes it.
    pub name: String,
    /// What it is, for people.
    pub title: String,
    /// Its firmware.
    pub controller: Controller,
    /// What its controller takes that others of its kind do not, or the reverse.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller_limits: Option<ControllerLimits>,
    /// Its laser; a machine has this or [`Machine::plasma`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub laser: Option<LaserTool>,
    /// Its plasma torch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plasma: Option<PlasmaTool>,
    /// Its bed.
    pub bed: Bed,
    /// How it moves.
    pub motion: Motion,
    /// How it is reached; none for a controller that opens jobs as files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub connection: Option<Connection>,
    /// Homing.
    pub homing: Homing,
    /// What stands around every job.
    pub job: Job,
}

/// The rectangle that the beam can reach, in machine coordinates, millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Smallest x and y.
    pub min: [f64; 2],
    /// Largest x and y.
    pub max: [f64; 2],
}

impl Reach {
    /// Whether the point lies inside, or outside by no more than `slack_mm`.
    pub fn contains(&self, p: [f64; 2], slack_mm: f64) -> bool {
        (0..2).all(|i| p[i] >= self.min[i] - slack_mm && p[i] <= self.max[i] + slack_mm)
    }
}

impl Machine {
    /// What cuts; `None` only for a machine that would not pass [`Machine::validate`].
    pub fn tool(&self) -> Option<Tool<'_>> {
        match (&self.laser, &self.plasma) {
            (Some(laser), _) => Some(Tool::Laser(laser)),
            (None, Some(plasma)) => Some(Tool::Plasma(plasma)),
            (None, None) => None,
        }
    }

    /// Its laser, if it has one.
    pub fn laser(&self) -> Option<&LaserTool> {
        self.laser.as_ref()
    }

    /// Its plasma torch, if it has one.
    pub fn plasma(&self) -> Option<&PlasmaTool> {
        self.plasma.as_ref()
    }

    /// Longest line that its controller takes, characters without the line end.
    pub fn line_limit(&self) -> usize {
        self.controller_limits
            .as_ref()
            .and_then(|l| l.line_limit)
            .map_or(self.controller.line_limit(), |l| l as usize)
    }

    /// Whether its controller takes arcs.
    pub fn arcs(&self) -> bool {
        self.controller_limits
            .as_ref()
            .and_then(|l| l.arcs)
            .unwrap_or(self.controller.arcs())
    }

    /// Short lines that its controller takes in a second.
    pub fn lines_per_s(&self) -> f64 {
        self.controller_limits
            .as_ref()
            .and_then(|l| l.lines_per_s)
            .unwrap_or(self.controller.lines_per_s())
    }

    /// The shortest segment that its planner can be fed at this speed, millimetres: shorter ones make it starve.
    pub fn shortest_segment_mm(&self, feed_mm_per_min: f64) -> f64 {
        feed_mm_per_min / 60.0 / self.lines_per_s()
    }

    /// Where the beam may go.
    pub fn reach(&self) -> Reach {
        let (w, h) = (self.bed.width_mm, self.bed.height_mm);
        let (x, y) = match self.bed.origin {
            Origin::FrontLeft => (0.0, 0.0),
            Origin::FrontRight => (-w, 0.0),
            Origin::RearLeft => (0.0, -h),
            Origin::RearRight => (-w, -h),
        };
        Reach {
            min: [x, y],
            max: [x + w, y + h],
        }
    }

    /// Where the head waits before and after a job, millimetres.
    pub fn park_mm(&self) -> [f64; 2] {
        [self.job.park.x_mm, self.job.park.y_mm]
    }

    /// All checks, in the order of the file.
    ///
    /// # Errors
    /// The first [`Complaint`], with the key.
    pub fn validate(&self) -> Result<(), Complaint> {
        check_format(self.format, FORMAT)?;
        check_name(&self.name)?;
        if let Some(limits) = &self.controller_limits {
            limits.check(self.controller)?;
        }
        self.check_tool()?;
        self.check_bed()?;
        self.check_motion()?;
        self.check_connection()?;
        self.check_park()?;
        self.check_lines()
    }

    fn check_tool(&self) -> Result<(), Complaint> {
        let limit = self.line_limit();
        match (&self.laser, &self.plasma) {
            (Some(laser), None) => laser.check(self.controller, limit),
            (None, Some(plasma)) => plasma.check(self.controller, limit),
            (Some(_), Some(_)) => Err(Complaint::new(
                "plasma",
                "stands beside [laser]: one machine has one tool. Write a profile for each",
            )),
            (None, None) => Err(Complaint::new(
                "controller",
                "stands in a profile without a tool: add a [laser] or a [plasma] table",
            )),
        }
    }

    fn check_bed(&self) -> Result<(), Complaint> {
        ranged("bed.width_mm", self.bed.width_mm, 10.0, 10_000.0)?;
        ranged("bed.height_mm", self.bed.height_mm, 10.0, 10_000.0)?;
        let half = 0.5 * self.bed.width_mm.min(self.bed.height_mm);
        ranged("bed.margin_mm", self.bed.margin_mm, 0.0, half)
    }

    fn check_motion(&self) -> Result<(), Complaint> {
        let m = &self.motion;
        ranged(
            "motion.rate_mm_per_min.x",
            m.rate_mm_per_min.x,
            1.0,
            500_000.0,
        )?;
        ranged(
            "motion.rate_mm_per_min.y",
            m.rate_mm_per_min.y,
            1.0,
            500_000.0,
        )?;
        ranged(
            "motion.acceleration_mm_per_s2.x",
            m.acceleration_mm_per_s2.x,
            1.0,
            100_000.0,
        )?;
        ranged(
            "motion.acceleration_mm_per_s2.y",
            m.acceleration_mm_per_s2.y,
            1.0,
            100_000.0,
        )?;
        ranged(
            "motion.junction_deviation_mm",
            m.junction_deviation_mm,
            0.0,
            1.0,
        )
    }

    fn check_connection(&self) -> Result<(), Complaint> {
        let Some(c) = &self.connection else {
            if self.controller.is_streamed() {
                return Err(Complaint::new(
                    "controller",
                    format!(
                        "is {}, to which jobs are streamed: add a [connection] table",
                        self.controller
                    ),
                ));
            }
            return Ok(());
        };
        if !self.controller.is_streamed() {
            return Err(Complaint::new(
                "connection",
                format!("is of no use: {} opens jobs as files", self.controller),
            ));
        }
        ranged("connection.baud", f64::from(c.baud), 300.0, 10_000_000.0)?;
        // A buffer that does not hold one full line could never be streamed to.
        let least = self.line_limit() as f64 + 1.0;
        ranged(
            "connection.receive_buffer_bytes",
            f64::from(c.receive_buffer_bytes),
            least,
            1_000_000.0,
        )?;
        ranged(
            "connection.planner_blocks",
            f64::from(c.planner_blocks),
            1.0,
            100_000.0,
        )?;
        match c.max_unconfirmed_cuts {
            Some(cuts) => ranged(
                "connection.max_unconfirmed_cuts",
                f64::from(cuts),
                1.0,
                1000.0,
            ),
            None => Ok(()),
        }
    }

    fn check_park(&self) -> Result<(), Complaint> {
        let reach = self.reach();
        ranged(
            "job.park.x_mm",
            self.job.park.x_mm,
            reach.min[0],
            reach.max[0],
        )?;
        ranged(
            "job.park.y_mm",
            self.job.park.y_mm,
            reach.min[1],
            reach.max[1],
        )
    }

    fn check_lines(&self) -> Result<(), Complaint> {
        let limit = self.line_limit();
        for (i, line) in self.job.preamble.iter().enumerate() {
            let key = format!("job.preamble[{i}]");
            lines::check(&key, line, self.controller, limit, Where::Preamble)?;
        }
        let count = self.job.postamble.len();
        for (i, line) in self.job.postamble.iter().enumerate() {
            let place = Where::Postamble {
                last: i + 1 == count,
            };
            let key = format!("job.postamble[{i}]");
            lines::check(&key, line, self.controller, limit, place)?;
        }
        Ok(())
    }
}
