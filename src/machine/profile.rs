//! A machine's profile and its checks.

use serde::{Deserialize, Serialize};

use crate::base::document::{Complaint, ranged};
use crate::material::Laser;
use crate::material::{check_format, check_name};

/// The firmware that reads the G-code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Controller {
    /// GRBL 1.1 in laser mode (`$32=1`).
    Grbl,
}

impl Controller {
    /// Longest line that the controller takes, characters without the line end. GRBL 1.1 answers `error:11` to more.
    pub fn line_limit(self) -> usize {
        match self {
            Self::Grbl => 79,
        }
    }
}

/// How the beam follows the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PowerMode {
    /// M4: power follows speed, and the beam is off whenever the machine stands still, also when the link is lost.
    Dynamic,
    /// M3: the beam stays on where the machine stops. If the cable is pulled, no program can switch it off.
    Constant,
}

/// The laser: `[laser]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LaserTool {
    /// Its kind.
    pub kind: Laser,
    /// Optical power at 100 %, watts.
    pub watts: f64,
    /// The S word of 100 % (`$30`).
    pub s_max: f64,
    /// M4 or M3.
    pub power_mode: PowerMode,
    /// `power_mode = "constant"` needs this to be true: with M3 the beam stays on if the link is lost in mid-job.
    #[serde(default)]
    pub accept_beam_on_after_lost_link: bool,
    /// The line that starts the air, if there is any.
    #[serde(default)]
    pub air_on: Option<String>,
    /// The line that stops the air.
    #[serde(default)]
    pub air_off: Option<String>,
}

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

/// How it is reached: `[connection]`.
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
    /// Its laser.
    pub laser: LaserTool,
    /// Its bed.
    pub bed: Bed,
    /// How it moves.
    pub motion: Motion,
    /// How it is reached.
    pub connection: Connection,
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
        check_format(self.format)?;
        check_name(&self.name)?;
        self.check_laser()?;
        self.check_bed()?;
        self.check_motion()?;
        self.check_connection()?;
        self.check_park()?;
        self.check_lines()
    }

    fn check_laser(&self) -> Result<(), Complaint> {
        ranged("laser.watts", self.laser.watts, 0.1, 50_000.0)?;
        ranged("laser.s_max", self.laser.s_max, 1.0, 100_000.0)?;
        if self.laser.power_mode == PowerMode::Constant
            && !self.laser.accept_beam_on_after_lost_link
        {
            return Err(Complaint::new(
                "laser.power_mode",
                "is \"constant\" (M3): if the cable is pulled in mid-job the beam stays on, and no program can switch it off. Use \"dynamic\" (M4), or write accept_beam_on_after_lost_link = true below it",
            ));
        }
        Ok(())
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
        let c = &self.connection;
        ranged("connection.baud", f64::from(c.baud), 300.0, 10_000_000.0)?;
        // A buffer that does not hold one full line could never be streamed to.
        let least = self.controller.line_limit() as f64 + 1.0;
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
        )
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
        let job = [
            ("job.preamble", &self.job.preamble),
            ("job.postamble", &self.job.postamble),
        ];
        for (key, lines) in job {
            for (i, line) in lines.iter().enumerate() {
                self.check_line(&format!("{key}[{i}]"), line)?;
            }
        }
        for (key, line) in [
            ("laser.air_on", &self.laser.air_on),
            ("laser.air_off", &self.laser.air_off),
        ] {
            if let Some(line) = line {
                self.check_line(key, line)?;
            }
        }
        Ok(())
    }

    fn check_line(&self, key: &str, line: &str) -> Result<(), Complaint> {
        let limit = self.controller.line_limit();
        if line.len() > limit {
            let problem = format!(
                "has {} characters; the controller takes {limit} in a line",
                line.len()
            );
            return Err(Complaint::new(key, problem));
        }
        if line.trim().is_empty() {
            return Err(Complaint::new(key, "is an empty line"));
        }
        // `?`, `!` and `~` act at once wherever they stand, also in a comment.
        if let Some(c) = line
            .chars()
            .find(|c| !(' '..='}').contains(c) || "?!".contains(*c))
        {
            return Err(Complaint::new(
                key,
                format!("has the character {c:?}, which a line of G-code must not hold"),
            ));
        }
        Ok(())
    }
}
