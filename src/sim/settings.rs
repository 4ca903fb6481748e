//! The numbers a GRBL controller keeps in its memory, `$0` to `$132`.

use super::flavour::Flavour;
use crate::machine::Machine;
use crate::planner::Limits;

/// Settings of the simulated controller, with the defaults of GRBL 1.1's generic machine except where a laser needs
/// otherwise: laser mode on, 80 steps/mm, rates and travel of a small frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Which firmware it is. Not a `$` setting.
    pub flavour: Flavour,
    /// `$0`: length of a step's pulse, µs (kept and reported, without effect here).
    pub step_pulse_us: f64,
    /// `$1`: how long the motors are held after each stop, ms; 255 keeps them on. It blocks the firmware.
    pub step_idle_delay_ms: f64,
    /// `$2`–`$6`: which signals are inverted (kept and reported, without effect here).
    pub inversions: [f64; 5],
    /// `$10`: what a status report holds; bit 0 machine position, bit 1 free buffers.
    pub status_mask: f64,
    /// `$11`: junction deviation, mm.
    pub junction_deviation_mm: f64,
    /// `$12`: how far an arc's segments may stray from it, mm.
    pub arc_tolerance_mm: f64,
    /// `$13`: reports in inches.
    pub report_inches: bool,
    /// `$20`: soft limits.
    pub soft_limits: bool,
    /// `$21`: hard limits: with homing, the frame has switches at the ends of its travel.
    pub hard_limits: bool,
    /// `$22`: homing is required after power-up.
    pub homing: bool,
    /// `$23`: bit k set: axis k homes towards its negative end.
    pub homing_direction_mask: f64,
    /// Where homing has put the head is machine zero, and an axis that homes towards its negative end goes from 0 to its
    /// travel. GRBL is built so (`Z` of `$I`), grblHAL has bit 3 of `$22` for it, FluidNC `mpos_mm: 0` in its file. Else
    /// every axis goes from −travel to 0.
    pub homing_sets_zero: bool,
    /// `$24`: slow homing rate, mm/min (kept and reported, without effect here).
    pub homing_feed_mm_min: f64,
    /// `$25`: homing rate, mm/min.
    pub homing_seek_mm_min: f64,
    /// `$26`: how long a switch must be closed, ms (kept and reported, without effect here).
    pub homing_debounce_ms: f64,
    /// `$27`: distance from the switch after homing, mm.
    pub homing_pull_off_mm: f64,
    /// `$30`: the S word of full power.
    pub s_max: f64,
    /// `$31`: the S word of least power.
    pub s_min: f64,
    /// `$32`: laser mode.
    pub laser_mode: bool,
    /// `$100`–`$102`: steps per mm.
    pub steps_per_mm: [f64; 3],
    /// `$110`–`$112`: largest rates, mm/min.
    pub max_rate_mm_min: [f64; 3],
    /// `$120`–`$122`: accelerations, mm/s².
    pub acceleration_mm_s2: [f64; 3],
    /// `$130`–`$132`: travel, mm.
    pub travel_mm: [f64; 3],
    /// Where the sheet's surface lies, machine Z of the bed, mm: there and below the probe's contact is closed. None:
    /// nothing is ever touched. Not a `$` setting.
    pub surface_mm: Option<f64>,
    /// Receive buffer, bytes. Not a `$` setting: compiled in, and told by `$I`.
    pub receive_buffer: usize,
    /// Usable planner blocks. Compiled in, and told by `$I`.
    pub planner_blocks: usize,
    /// How long the firmware takes to read and plan a line, s per byte of it: [`Flavour::byte_time_s`].
    pub byte_time_s: f64,
    /// Speed of the serial line, baud at 10 bits a byte; none for a line that takes no time.
    pub baud: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            flavour: Flavour::Grbl,
            step_pulse_us: 10.0,
            step_idle_delay_ms: 25.0,
            inversions: [0.0; 5],
            status_mask: Flavour::Grbl.status_mask(),
            junction_deviation_mm: 0.01,
            arc_tolerance_mm: 0.002,
            report_inches: false,
            soft_limits: false,
            hard_limits: false,
            homing: false,
            homing_direction_mask: 0.0,
            homing_sets_zero: false,
            homing_feed_mm_min: 25.0,
            homing_seek_mm_min: 500.0,
            homing_debounce_ms: 250.0,
            homing_pull_off_mm: 1.0,
            s_max: 1000.0,
            s_min: 0.0,
            laser_mode: true,
            steps_per_mm: [80.0; 3],
            max_rate_mm_min: [6000.0, 6000.0, 3000.0],
            acceleration_mm_s2: [500.0; 3],
            travel_mm: [500.0, 500.0, 200.0],
            surface_mm: None,
            receive_buffer: 128,
            planner_blocks: 15,
            byte_time_s: Flavour::Grbl.byte_time_s(),
            baud: Some(115_200.0),
        }
    }
}

/// One `$` setting: its number, value and how many decimals GRBL prints.
pub(crate) type Row = (u16, f64, usize);

/// How far below the highest place of a raised torch the sheet of the machine that is built in lies, mm.
const SHEET_BELOW_MM: f64 = 10.0;

impl Settings {
    /// A laser in laser mode with these limits, bed and full-power S word; everything else as shipped.
    pub fn laser(limits: &Limits, travel_mm: [f64; 3], s_max: f64) -> Self {
        Self {
            max_rate_mm_min: limits.max_rate_mm_min,
            acceleration_mm_s2: limits.acceleration_mm_s2,
            junction_deviation_mm: limits.junction_deviation_mm,
            travel_mm,
            s_max,
            ..Self::default()
        }
    }

    /// The controller of a machine profile, as a well-configured one would be.
    pub fn of_machine(machine: &Machine) -> Self {
        let standard = Self::default();
        let (rate, acceleration) = (
            machine.motion.rate_mm_per_min,
            machine.motion.acceleration_mm_per_s2,
        );
        let limits = Limits {
            max_rate_mm_min: [rate.x, rate.y, standard.max_rate_mm_min[2]],
            acceleration_mm_s2: [
                acceleration.x,
                acceleration.y,
                standard.acceleration_mm_s2[2],
            ],
            junction_deviation_mm: machine.motion.junction_deviation_mm,
        };
        let travel_mm = [
            machine.bed.width_mm,
            machine.bed.height_mm,
            standard.travel_mm[2],
        ];
        // A torch is an output that is on or off, also at rest: not laser mode.
        let mut settings = match machine.laser() {
            Some(laser) => Self::laser(&limits, travel_mm, laser.s_max),
            None => Self {
                laser_mode: false,
                ..Self::laser(&limits, travel_mm, standard.s_max)
            },
        };
        settings = settings.with_flavour(Flavour::of(machine.controller));
        // A sheet to be felt for, so far below the torch's highest place that it can rise over it.
        settings.surface_mm = machine
            .plasma()
            .map(|torch| -(torch.safe_height_mm.unwrap_or(0.0) + SHEET_BELOW_MM));
        if let Some(connection) = &machine.connection {
            settings.receive_buffer = connection.receive_buffer_bytes as usize;
            settings.planner_blocks = connection.planner_blocks as usize;
            settings.baud = Some(f64::from(connection.baud));
        }
        if machine.homing.enabled {
            // To the corner that is zero in the profile, so that a homed machine counts as its jobs do.
            let [x, y] = machine.reach().min.map(|low| u8::from(low == 0.0));
            settings.homing = true;
            settings.soft_limits = true;
            settings.homing_sets_zero = true;
            settings.homing_direction_mask = f64::from(x + 2 * y);
        }
        settings
    }

    /// The same for another firmware: its pace, its reports, and the buffers of a usual board.
    pub fn with_flavour(self, flavour: Flavour) -> Self {
        let (receive_buffer, planner_blocks) = match flavour {
            Flavour::Grbl => (128, 15),
            Flavour::GrblHal => (1024, 100),
            Flavour::FluidNc => (256, 16),
        };
        Self {
            flavour,
            receive_buffer,
            planner_blocks,
            byte_time_s: flavour.byte_time_s(),
            status_mask: flavour.status_mask(),
            ..self
        }
    }

    /// What the planner needs.
    pub fn limits(&self) -> Limits {
        Limits {
            max_rate_mm_min: self.max_rate_mm_min,
            acceleration_mm_s2: self.acceleration_mm_s2,
            junction_deviation_mm: self.junction_deviation_mm,
        }
    }

    /// `$22`.
    fn homing_flags(&self) -> f64 {
        let sets_zero = self.homing_sets_zero && self.flavour == Flavour::GrblHal;
        f64::from(u8::from(self.homing) + 8 * u8::from(self.homing && sets_zero))
    }

    /// The ends of an axis in machine coordinates, mm, once it is homed.
    pub(crate) fn range_mm(&self, axis: usize) -> [f64; 2] {
        let travel = self.travel_mm[axis];
        if self.homing_sets_zero && self.homes_downwards(axis) {
            [0.0, travel]
        } else {
            [-travel, 0.0]
        }
    }

    /// An axis homes towards its negative end.
    pub(crate) fn homes_downwards(&self, axis: usize) -> bool {
        // A mask of 3 bits: the cast keeps it.
        self.homing_direction_mask as u8 & (1 << axis) != 0
    }

    /// The settings as `$$` lists them.
    pub(crate) fn rows(&self) -> Vec<Row> {
        let flag = |b: bool| f64::from(u8::from(b));
        let mut rows = vec![(0, self.step_pulse_us, 0), (1, self.step_idle_delay_ms, 0)];
        rows.extend((2..).zip(self.inversions).map(|(n, value)| (n, value, 0)));
        rows.extend([
            (10, self.status_mask, 0),
            (11, self.junction_deviation_mm, 3),
            (12, self.arc_tolerance_mm, 3),
            (13, flag(self.report_inches), 0),
            (20, flag(self.soft_limits), 0),
            (21, flag(self.hard_limits), 0),
            (22, self.homing_flags(), 0),
            (23, self.homing_direction_mask, 0),
            (24, self.homing_feed_mm_min, 3),
            (25, self.homing_seek_mm_min, 3),
            (26, self.homing_debounce_ms, 0),
            (27, self.homing_pull_off_mm, 3),
            (30, self.s_max, 0),
            (31, self.s_min, 0),
            (32, flag(self.laser_mode), 0),
        ]);
        for (base, values) in [
            (100, self.steps_per_mm),
            (110, self.max_rate_mm_min),
            (120, self.acceleration_mm_s2),
            (130, self.travel_mm),
        ] {
            for (k, value) in (0u16..).zip(values) {
                rows.push((base + k, value, 3));
            }
        }
        rows.retain(|row| self.flavour.lists(row.0));
        rows
    }

    /// FluidNC's name for a numbered setting.
    pub(crate) fn name(number: u16) -> Option<String> {
        let axis = |what: &str| {
            Some(format!(
                "Grbl/{what}/{}",
                ["X", "Y", "Z"].get(usize::from(number % 10))?
            ))
        };
        match number {
            3 => Some("Grbl/InvertMask".into()),
            10 => Some("Report/Status".into()),
            20 => Some("Grbl/SoftLimitsEnable".into()),
            21 => Some("Grbl/HardLimitsEnable".into()),
            22 => Some("Grbl/HomingCycleEnable".into()),
            23 => Some("Grbl/HomingDirections".into()),
            30 => Some("Grbl/MaxSpindleSpeed".into()),
            32 => Some("Grbl/LaserMode".into()),
            100..=102 => axis("Resolution"),
            110..=112 => axis("MaxRate"),
            120..=122 => axis("Acceleration"),
            130..=132 => axis("MaxTravel"),
            _ => None,
        }
    }

    /// Sets `$number`.
    ///
    /// # Errors
    /// GRBL's number: 3 unknown setting, 4 negative, 6 pulse too short, 10 soft limits without homing.
    pub(crate) fn set(&mut self, number: u16, value: f64) -> Result<(), u8> {
        if !self.flavour.takes(number) {
            return Err(3);
        }
        if value < 0.0 {
            return Err(4);
        }
        let on = value != 0.0;
        match number {
            0 if value < 3.0 => return Err(6),
            0 => self.step_pulse_us = value.trunc(),
            1 => self.step_idle_delay_ms = value.trunc(),
            2..=6 => self.inversions[usize::from(number) - 2] = value.trunc(),
            10 => self.status_mask = value.trunc(),
            11 => self.junction_deviation_mm = value,
            12 => self.arc_tolerance_mm = value.max(1e-6),
            13 => self.report_inches = on,
            24 => self.homing_feed_mm_min = value,
            26 => self.homing_debounce_ms = value.trunc(),
            20 if on && !self.homing => return Err(10),
            20 => self.soft_limits = on,
            21 => self.hard_limits = on,
            22 => {
                self.homing = on;
                self.soft_limits &= on;
                if self.flavour == Flavour::GrblHal {
                    self.homing_sets_zero = value as u32 & 8 != 0;
                }
            }
            23 => self.homing_direction_mask = value.trunc(),
            25 => self.homing_seek_mm_min = value.max(1.0),
            27 => self.homing_pull_off_mm = value,
            30 => self.s_max = value,
            31 => self.s_min = value,
            32 => self.laser_mode = on,
            100..=132 => {
                let axis = usize::from(number % 10);
                let least = 1e-3;
                let list = match number / 10 {
                    10 => &mut self.steps_per_mm,
                    11 => &mut self.max_rate_mm_min,
                    12 => &mut self.acceleration_mm_s2,
                    _ => &mut self.travel_mm,
                };
                // A zero would stop the planner for good; GRBL accepts it and hangs.
                *list.get_mut(axis).ok_or(3u8)? = value.max(least);
            }
            _ => return Err(3),
        }
        Ok(())
    }
}
