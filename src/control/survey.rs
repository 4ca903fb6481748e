//! Is the controller set as the machine's profile says, and does the job fit where the machine stands?
//!
//! A profile is what the job was made for: its times, its bed. What the controller would do otherwise is told before
//! anything is sent; what would burn in the wrong place is refused.

use super::reply::Reply;
use crate::base::units::short;
use crate::gcode::{Dialect, read_as};
use crate::machine::Machine;

/// Lengths of controllers and profiles are the same within so much, mm.
const SAME_MM: f64 = 0.05;

/// Speeds and accelerations are the same within this share.
const SAME_SHARE: f64 = 0.01;

/// Where a job goes, in work coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobReach {
    /// Least X and Y, mm, of all that moves.
    pub min_mm: [f64; 2],
    /// Largest ones.
    pub max_mm: [f64; 2],
    /// The same of what burns; none if nothing does.
    pub burnt_mm: Option<[[f64; 2]; 2]>,
    /// The fastest burning move, mm/min.
    pub feed_mm_per_min: f64,
}

impl JobReach {
    /// Of a job's text, read by these rules; none if it moves nowhere.
    pub fn of(text: &str, dialect: Dialect) -> Option<Self> {
        let program = read_as(text, dialect);
        let mut all: Option<[[f64; 2]; 2]> = None;
        let mut burnt: Option<[[f64; 2]; 2]> = None;
        let mut feed_mm_per_min: f64 = 0.0;
        let grow = |bounds: &mut Option<[[f64; 2]; 2]>, p: [f64; 2]| {
            let [low, high] = bounds.get_or_insert([p, p]);
            for k in 0..2 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        };
        for step in &program.moves {
            let to = [step.to.x, step.to.y];
            grow(&mut all, to);
            if step.burns() {
                feed_mm_per_min = feed_mm_per_min.max(step.feed_mm_per_min);
                grow(&mut burnt, to);
                if let Some(from) = step.from {
                    grow(&mut burnt, [from.x, from.y]);
                }
            }
        }
        let [min_mm, max_mm] = all?;
        Some(Self {
            min_mm,
            max_mm,
            burnt_mm: burnt,
            feed_mm_per_min,
        })
    }
}

/// What a comparison found.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Survey {
    /// The job must not run so.
    pub refused: Vec<String>,
    /// It may, but not as it was planned.
    pub warned: Vec<String>,
}

impl Survey {
    /// Compares a controller's settings, by their numbers, with a machine's profile.
    pub fn settings(found: &dyn Fn(u32) -> Option<f64>, machine: &Machine) -> Self {
        let mut survey = Self::default();
        let mut warn = |text: String| survey.warned.push(text);
        let far = |a: f64, b: f64| (a - b).abs() > SAME_SHARE * a.abs().max(b.abs());
        let motion = &machine.motion;
        let rates = [
            (110, motion.rate_mm_per_min.x, "rate of X", "mm/min"),
            (111, motion.rate_mm_per_min.y, "rate of Y", "mm/min"),
            (
                120,
                motion.acceleration_mm_per_s2.x,
                "acceleration of X",
                "mm/s²",
            ),
            (
                121,
                motion.acceleration_mm_per_s2.y,
                "acceleration of Y",
                "mm/s²",
            ),
            (11, motion.junction_deviation_mm, "junction deviation", "mm"),
        ];
        for (number, profile, what, unit) in rates {
            if let Some(value) = found(number).filter(|v| far(*v, profile)) {
                warn(format!(
                    "{what}: the controller has {} {unit} (${number}), the profile {}: times will be other than estimated",
                    short(value, 4),
                    short(profile, 4)
                ));
            }
        }
        let sizes = [
            (130, machine.bed.width_mm, "X"),
            (131, machine.bed.height_mm, "Y"),
        ];
        for (number, bed, axis) in sizes {
            if let Some(travel) = found(number).filter(|t| *t < bed - SAME_MM) {
                warn(format!(
                    "travel of {axis}: the controller has {} mm (${number}), the bed of the profile {} mm",
                    short(travel, 3),
                    short(bed, 3)
                ));
            }
        }
        match (found(22), machine.homing.enabled) {
            (Some(0.0), true) => warn(
                "homing is switched off ($22=0), and the profile says that the machine homes: after a lost position it must be found by hand".into(),
            ),
            (Some(on), false) if on != 0.0 => warn(
                "the controller homes ($22), and the profile says that the machine does not".into(),
            ),
            _ => {}
        }
        if found(22).is_some_and(|v| v != 0.0) && found(20) == Some(0.0) {
            warn(
                "soft limits are off ($20=0): a job that leaves the travel runs into the frame"
                    .into(),
            );
        }
        survey
    }

    /// Sees whether a job stays within a homed machine's travel, with the work offset (mm) in force. `options` are the
    /// letters of `[OPT:…]`: `Z` means that homed axes may begin at 0.
    ///
    /// GRBL 1.1 puts a homed axis at the upper end of −travel to 0; with `Z`, or with bit 3 of grblHAL's `$22`, one that homes
    /// towards its negative end (`$23`) at the lower end of 0 to travel.
    pub fn travel(
        &mut self,
        found: &dyn Fn(u32) -> Option<f64>,
        options: &str,
        reach: &JobReach,
        offset_mm: [f64; 3],
    ) {
        if found(22).is_none_or(|v| v == 0.0) {
            return;
        }
        let mask = found(23).unwrap_or(0.0) as u32;
        let from_zero = options.contains('Z') || found(22).unwrap_or(0.0) as u32 & 8 != 0;
        let range = |axis: usize, number: u32| {
            let travel = found(number).filter(|t| *t > 0.0)?;
            Some(if from_zero && mask & (1 << axis) != 0 {
                [0.0, travel]
            } else {
                [-travel, 0.0]
            })
        };
        self.within(
            [range(0, 130), range(1, 131)],
            "$130, $131",
            reach,
            offset_mm,
        );
    }

    /// What FluidNC is asked, line by line, before [`Survey::travel_of_file`]: where its axes home to and how far they go stands
    /// in its configuration file. A key that it refuses is one that this version does not know.
    pub const TRAVEL_OF_FILE: [&'static str; 8] = [
        "$/axes/x/homing/cycle",
        "$/axes/x/homing/positive_direction",
        "$/axes/x/homing/mpos_mm",
        "$/axes/x/max_travel_mm",
        "$/axes/y/homing/cycle",
        "$/axes/y/homing/positive_direction",
        "$/axes/y/homing/mpos_mm",
        "$/axes/y/max_travel_mm",
    ];

    /// [`Survey::travel`] of FluidNC, from its replies to [`Survey::TRAVEL_OF_FILE`]: an axis is at `mpos_mm` at its switch, and
    /// its travel lies below that where it homes in the positive direction, else above (`limitsMinPosition` and
    /// `limitsMaxPosition` of FluidNC's `Limit.cpp`). An axis that does not home (cycle 0 or less), or does not tell all of
    /// this, is not judged.
    pub fn travel_of_file(&mut self, replies: &[Reply], reach: &JobReach, offset_mm: [f64; 3]) {
        let told = |axis: &str, key: &str| {
            replies.iter().find_map(|reply| {
                let Reply::Unknown(text) = reply else {
                    return None;
                };
                let rest = text.strip_prefix("$/axes/")?.strip_prefix(axis)?;
                let (name, value) = rest.strip_prefix('/')?.split_once('=')?;
                (name == key).then(|| value.trim())
            })
        };
        let range = |axis: &str| {
            let number = |key: &str| {
                let value: f64 = told(axis, key)?.parse().ok()?;
                value.is_finite().then_some(value)
            };
            let homes = number("homing/cycle")? >= 1.0;
            let travel = number("max_travel_mm").filter(|t| homes && *t > 0.0)?;
            let at_switch = number("homing/mpos_mm")?;
            match told(axis, "homing/positive_direction")? {
                "true" => Some([at_switch - travel, at_switch]),
                "false" => Some([at_switch, at_switch + travel]),
                _ => None,
            }
        };
        let place = "max_travel_mm and mpos_mm in its configuration";
        self.within([range("x"), range("y")], place, reach, offset_mm);
    }

    /// Refuses a job that leaves the range of an axis (machine coordinates, mm; none where it is not known). `place`: where the
    /// controller has these ranges.
    fn within(
        &mut self,
        ranges: [Option<[f64; 2]>; 2],
        place: &str,
        reach: &JobReach,
        offset_mm: [f64; 3],
    ) {
        for (axis, range) in ranges.into_iter().enumerate() {
            let Some([low, high]) = range else {
                continue;
            };
            let ends = [reach.min_mm[axis], reach.max_mm[axis]].map(|v| v + offset_mm[axis]);
            let name = ["X", "Y"][axis];
            if ends[0] < low - SAME_MM || ends[1] > high + SAME_MM {
                self.refused.push(format!(
                    "the job would go from {name}{} to {name}{} in machine coordinates, and the machine has {} to {}: set the work zero where the sheet lies (kagome zero), or check the travel ({place})",
                    short(ends[0], 2),
                    short(ends[1], 2),
                    short(low, 2),
                    short(high, 2)
                ));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controller(text: &str) -> impl Fn(u32) -> Option<f64> + use<> {
        let found = crate::control::ControllerSettings::parse("$$", text).unwrap();
        move |number| found.number(number)
    }

    #[test]
    fn only_what_differs_is_told() {
        let machine = crate::machine::load("co2-600x400").unwrap();
        let same = "$11=0.010\n$20=1\n$22=1\n$110=30000.000\n$111=20000\n$120=2000\n$121=1000\n$130=600\n$131=400\n";
        assert_eq!(
            Survey::settings(&controller(same), &machine),
            Survey::default()
        );
        for (from, to, part) in [
            ("$110=30000.000", "$110=10000", "$110"),
            ("$121=1000", "$121=500", "acceleration of Y"),
            ("$130=600", "$130=400", "travel of X"),
            ("$22=1", "$22=0", "$22=0"),
            ("$20=1", "$20=0", "soft limits"),
            ("$11=0.010", "$11=0.02", "junction"),
        ] {
            assert!(same.contains(from));
            let survey = Survey::settings(&controller(&same.replace(from, to)), &machine);
            assert_eq!(survey.warned.len(), 1, "{to}: {survey:?}");
            assert!(survey.warned[0].contains(part), "{survey:?}");
        }
    }

    #[test]
    fn a_job_outside_of_the_travel_is_refused() {
        let job = "G21 G90\nG0 X10 Y20\nM4 S500\nG1 X110 Y20 F1200\nG1 X110 Y60\nM5\nG0 X0 Y0\n";
        let reach = JobReach::of(job, Dialect::Laser).unwrap();
        assert_eq!((reach.min_mm, reach.max_mm), ([0.0; 2], [110.0, 60.0]));
        assert_eq!(reach.burnt_mm, Some([[10.0, 20.0], [110.0, 60.0]]));
        assert_eq!(reach.feed_mm_per_min, 1200.0);
        assert_eq!(JobReach::of("G21\nM5\n", Dialect::Laser), None);
        let refused = |options: &str, offset: [f64; 3]| {
            let homes = if options == "hal" { 9 } else { 1 };
            let found = controller(&format!("$22={homes}\n$23=3\n$130=600\n$131=400\n"));
            let mut survey = Survey::default();
            survey.travel(&found, options, &reach, offset);
            survey.refused.len()
        };
        // GRBL as it comes: −600 to 0.
        assert_eq!(refused("V", [-600.0, -400.0, 0.0]), 0);
        assert_eq!(refused("V", [-110.0, -60.0, 0.0]), 0);
        assert_eq!(refused("V", [0.0; 3]), 2);
        assert_eq!(refused("V", [-109.0, -60.0, 0.0]), 1);
        // Built to begin at 0.
        assert_eq!(refused("VZ", [0.0; 3]), 0);
        assert_eq!(refused("VZ", [491.0, 0.0, 0.0]), 1);
        assert_eq!(refused("hal", [0.0; 3]), 0);
        // Without homing nobody knows.
        let mut survey = Survey::default();
        survey.travel(&controller("$22=0\n$130=1\n"), "V", &reach, [0.0; 3]);
        assert_eq!(survey, Survey::default());
    }

    #[test]
    fn fluidnc_has_each_axis_where_its_file_says() {
        let job = "G21 G90\nG0 X10 Y20\nM4 S500\nG1 X110 Y60 F1200\nM5\n";
        let reach = JobReach::of(job, Dialect::Laser).unwrap();
        let file = |axis: &str, cycle: &str, positive: &str, mpos: &str, travel: &str| {
            let key = |key: &str, value: &str| format!("$/axes/{axis}/{key}={value}");
            [
                key("homing/cycle", cycle),
                key("homing/positive_direction", positive),
                key("homing/mpos_mm", mpos),
                key("max_travel_mm", travel),
            ]
        };
        let refused = |lines: &[String], offset: [f64; 3]| {
            let replies: Vec<Reply> = lines.iter().filter_map(|l| Reply::parse(l)).collect();
            let mut survey = Survey::default();
            survey.travel_of_file(&replies, &reach, offset);
            assert!(survey.warned.is_empty());
            survey.refused
        };
        // X homes towards its lower end and calls it 0, Y towards its upper one and calls that 300.
        let both = |x: [String; 4], y: [String; 4]| [x, y].concat();
        let lines = both(
            file("x", "2", "false", "0.000", "400.000"),
            file("y", "2", "true", "300.000", "300.000"),
        );
        assert_eq!(refused(&lines, [0.0; 3]), Vec::<String>::new());
        assert_eq!(refused(&lines, [290.0, 240.0, 0.0]), Vec::<String>::new());
        let told = refused(&lines, [291.0, 241.0, 0.0]);
        assert_eq!(told.len(), 2);
        assert!(told[0].contains("from X301 to X401") && told[0].contains("0 to 400"));
        assert!(told[1].contains("max_travel_mm"), "{told:?}");
        assert_eq!(refused(&lines, [-11.0, -21.0, 0.0]).len(), 2);
        // As GRBL has it: −travel to 0.
        let lines = both(
            file("x", "1", "true", "0.000", "400.000"),
            file("y", "1", "true", "0.000", "300.000"),
        );
        assert_eq!(refused(&lines, [-400.0, -300.0, 0.0]), Vec::<String>::new());
        assert_eq!(refused(&lines, [0.0; 3]).len(), 2);
        // What is not told, or not homed, is not judged.
        let x = file("x", "1", "true", "0.000", "400.000");
        for k in 0..4 {
            let mut some = x.to_vec();
            some.remove(k);
            assert_eq!(refused(&some, [0.0; 3]), Vec::<String>::new(), "{k}");
        }
        assert_eq!(refused(&x, [0.0; 3]).len(), 1);
        for unhomed in ["0", "-1"] {
            let x = file("x", unhomed, "true", "0.000", "400.000");
            assert_eq!(refused(&x, [0.0; 3]), Vec::<String>::new());
        }
        // The questions are for what is read.
        for line in file("x", "1", "true", "0", "1") {
            let key = line.split_once('=').unwrap().0;
            assert!(Survey::TRAVEL_OF_FILE.contains(&key), "{key}");
            assert!(Survey::TRAVEL_OF_FILE.contains(&&*key.replace("/x/", "/y/")));
        }
    }
}
