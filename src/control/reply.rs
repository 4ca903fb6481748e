//! What a GRBL controller says, line by line.

/// What the machine does, as told by a status report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MachineState {
    /// Ready, at rest.
    Idle,
    /// Moving.
    Run,
    /// Feed hold; true once it stands.
    Hold(bool),
    /// Safety door; true once it stands.
    Door(bool),
    /// Locked.
    Alarm,
    /// Homing.
    Home,
    /// Checks G-code without moving.
    Check,
    /// Jogging.
    Jog,
    /// Asleep.
    Sleep,
}

/// A status report.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// What it does.
    pub state: MachineState,
    /// The position it tells, mm: machine coordinates, or work coordinates where the controller is set so.
    pub position_mm: Option<[f64; 3]>,
    /// Half of the last decimal of that position, mm: what is lost by rounding it, in each axis.
    pub rounding_mm: f64,
    /// The position is in work coordinates.
    pub is_work: bool,
    /// The work offset, if this report tells it, mm: machine coordinates of the job's zero point.
    pub offset_mm: Option<[f64; 3]>,
    /// Rate, mm/min.
    pub rate_mm_min: Option<f64>,
    /// Power of the output now, S.
    pub s: Option<f64>,
    /// What the controller makes of feed, rapids and power, per cent, if this report tells it (`Ov:`): every tenth or
    /// twentieth does, and the one after a change.
    pub overrides: Option<[u16; 3]>,
    /// Whether the spindle output (the laser, the torch) is switched on, if this report tells it: `A:` lists what is on,
    /// and comes with `Ov:`, so where that comes alone nothing is.
    pub output_on: Option<bool>,
}

impl Status {
    /// True if this report proves that the machine stands and its beam is off.
    pub fn dark_and_still(&self) -> bool {
        self.is_still() && self.s == Some(0.0)
    }

    /// True if this report proves that the machine stands.
    pub fn is_still(&self) -> bool {
        matches!(
            self.state,
            MachineState::Idle
                | MachineState::Hold(true)
                | MachineState::Door(true)
                | MachineState::Alarm
                | MachineState::Sleep
                | MachineState::Check
        )
    }

    /// The same from a controller that reports in inches (`$13=1`), or in units of so many mm.
    pub(super) fn scaled(mut self, unit_mm: f64) -> Self {
        let scale = |v: &mut Option<[f64; 3]>| *v = v.map(|v| v.map(|c| c * unit_mm));
        scale(&mut self.position_mm);
        scale(&mut self.offset_mm);
        self.rate_mm_min = self.rate_mm_min.map(|r| r * unit_mm);
        self.rounding_mm *= unit_mm;
        self
    }

    fn parse(text: &str) -> Option<Self> {
        let mut fields = text.strip_prefix('<')?.strip_suffix('>')?.split('|');
        let state = match fields.next()? {
            "Idle" => MachineState::Idle,
            "Run" => MachineState::Run,
            "Hold:0" => MachineState::Hold(true),
            "Hold:1" => MachineState::Hold(false),
            "Door:0" | "Door:1" => MachineState::Door(true),
            "Door:2" | "Door:3" => MachineState::Door(false),
            "Alarm" => MachineState::Alarm,
            "Home" => MachineState::Home,
            "Check" => MachineState::Check,
            "Jog" => MachineState::Jog,
            "Sleep" => MachineState::Sleep,
            // grblHAL tells the number of the alarm.
            other if other.starts_with("Alarm:") => MachineState::Alarm,
            _ => return None,
        };
        let mut status = Self {
            state,
            position_mm: None,
            rounding_mm: 0.0,
            is_work: false,
            offset_mm: None,
            rate_mm_min: None,
            s: None,
            overrides: None,
            output_on: None,
        };
        for field in fields {
            let (name, values) = field.split_once(':')?;
            match name {
                "MPos" | "WPos" => {
                    status.position_mm = Some(triple(values)?);
                    status.rounding_mm = rounding(values);
                    status.is_work = name == "WPos";
                }
                "WCO" => status.offset_mm = Some(triple(values)?),
                "FS" => {
                    let (rate, s) = values.split_once(',')?;
                    status.rate_mm_min = Some(rate.parse().ok()?);
                    // grblHAL adds a third figure.
                    status.s = Some(s.split(',').next()?.parse().ok()?);
                }
                "Ov" => {
                    let mut list = values.split(',').map(str::parse::<u16>);
                    let mut percent = [0; 3];
                    for p in &mut percent {
                        *p = list.next()?.ok()?;
                    }
                    status.overrides = Some(percent);
                    status.output_on = status.output_on.or(Some(false));
                }
                // S: clockwise (M3), C: counterclockwise (M4).
                "A" => status.output_on = Some(values.contains(['S', 'C'])),
                _ => {}
            }
        }
        Some(status)
    }
}

/// The first three of a list of numbers; machines with more axes tell more.
fn triple(text: &str) -> Option<[f64; 3]> {
    let mut list = text.split(',').map(str::parse::<f64>);
    let mut place = [0.0; 3];
    for p in &mut place {
        *p = list.next()?.ok().filter(|v| v.is_finite())?;
    }
    Some(place)
}

/// Half of the last decimal of the coarsest of the first two numbers.
fn rounding(text: &str) -> f64 {
    let decimals = text.split(',').take(2).map(|number| {
        let after = number.split_once('.').map_or("", |(_, after)| after);
        i32::try_from(after.len()).unwrap_or(9).min(9)
    });
    0.5 * 0.1f64.powi(decimals.min().unwrap_or(0))
}

/// One line from the controller.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// A line was taken.
    Ok,
    /// A line was refused.
    Error(u32),
    /// The controller has locked itself.
    Alarm(u32),
    /// The answer to `?`.
    Status(Status),
    /// The controller has started.
    Banner(String),
    /// `$n=value`.
    Setting(u32, f64),
    /// Anything in brackets.
    Message(String),
    /// None of these: noise, or another firmware.
    Unknown(String),
}

impl Reply {
    /// Reads a line without its end; none if it is empty.
    pub fn parse(line: &str) -> Option<Self> {
        let line = line.trim();
        if line.is_empty() {
            return None;
        }
        let number = |prefix: &str| line.strip_prefix(prefix)?.parse().ok();
        let setting = || {
            let (n, value) = line.strip_prefix('$')?.split_once('=')?;
            // Some firmwares explain each setting in brackets behind it.
            let value = value.split([' ', '(']).next()?;
            Some(Self::Setting(n.parse().ok()?, value.parse().ok()?))
        };
        Some(if line == "ok" {
            Self::Ok
        } else if let Some(n) = number("error:") {
            Self::Error(n)
        } else if let Some(n) = number("ALARM:") {
            Self::Alarm(n)
        } else if let Some(status) = Status::parse(line) {
            Self::Status(status)
        } else if line.starts_with("Grbl") {
            Self::Banner(line.to_owned())
        } else if let Some(setting) = setting() {
            setting
        } else if line.starts_with('[') && line.ends_with(']') {
            Self::Message(line.to_owned())
        } else {
            Self::Unknown(line.to_owned())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_line_is_told_apart() {
        let status = Reply::parse("<Hold:0|MPos:1.000,-2.500,0.000|FS:0,0|WCO:0.000,0.000,0.000>");
        let Some(Reply::Status(status)) = status else {
            panic!("{status:?}");
        };
        assert_eq!(status.position_mm, Some([1.0, -2.5, 0.0]));
        assert_eq!((status.offset_mm, status.is_work), (Some([0.0; 3]), false));
        let inches = Reply::parse("<Run|WPos:1.0000,0.0000,0.0000,5.0000|FS:10,0>");
        let Some(Reply::Status(inches)) = inches else {
            panic!("{inches:?}");
        };
        let scaled = inches.scaled(25.4);
        assert_eq!(scaled.position_mm, Some([25.4, 0.0, 0.0]));
        assert!(scaled.is_work && scaled.rate_mm_min == Some(254.0));
        assert!(status.dark_and_still());
        assert_eq!(Reply::parse("ok\r"), Some(Reply::Ok));
        assert_eq!(Reply::parse("error:22"), Some(Reply::Error(22)));
        assert_eq!(Reply::parse("ALARM:3"), Some(Reply::Alarm(3)));
        assert_eq!(
            Reply::parse("$30=1000.000"),
            Some(Reply::Setting(30, 1000.0))
        );
        assert_eq!(Reply::parse(" "), None);
        for (text, banner) in [
            ("Grbl 1.1h ['$' for help]", true),
            ("GrblHAL 1.1f", true),
            ("start", false),
        ] {
            assert_eq!(
                matches!(Reply::parse(text), Some(Reply::Banner(_))),
                banner,
                "{text}"
            );
        }
        assert!(matches!(
            Reply::parse("[MSG:Pgm End]"),
            Some(Reply::Message(_))
        ));
    }

    #[test]
    fn what_rounding_may_hide_is_half_of_the_last_decimal() {
        for (place, unit_mm, rounding_mm) in [
            ("1.000,2.125,0.0", 1.0, 0.0005),
            ("1.0000,2.1250,0", 25.4, 0.00127),
            ("12,3.5,0.000", 1.0, 0.5),
            ("0.5,3.55,0.000", 1.0, 0.05),
        ] {
            let Some(Reply::Status(status)) = Reply::parse(&format!("<Idle|MPos:{place}|FS:0,0>"))
            else {
                panic!("a report");
            };
            let found = status.scaled(unit_mm).rounding_mm;
            assert!((found - rounding_mm).abs() < 1e-9, "{place}: {found}");
        }
    }

    #[test]
    fn what_is_switched_on_is_told_with_the_overrides() {
        let told = |text: &str| match Reply::parse(text) {
            Some(Reply::Status(status)) => (status.overrides, status.output_on),
            other => panic!("{other:?}"),
        };
        for (rest, overrides, output_on) in [
            ("", None, None),
            ("|WCO:0,0,0", None, None),
            ("|Ov:90,25,110|A:S", Some([90, 25, 110]), Some(true)),
            ("|Ov:100,100,100|A:CF", Some([100; 3]), Some(true)),
            ("|Ov:100,100,100|A:FM", Some([100; 3]), Some(false)),
            ("|A:S|Ov:100,100,100", Some([100; 3]), Some(true)),
            ("|Ov:100,100,100", Some([100; 3]), Some(false)),
            // grblHAL tells a change of these alone, also that nothing is on any more.
            ("|A:", None, Some(false)),
            ("|A:S", None, Some(true)),
        ] {
            let text = format!("<Hold:0|MPos:0.000,0.000,0.000|FS:0,0{rest}>");
            assert_eq!(told(&text), (overrides, output_on), "{text}");
        }
    }

    #[test]
    fn a_damaged_line_proves_nothing() {
        for text in [
            "<Idle|FS:0,0",
            "<Idle|FS:0>",
            "<Idle|FS:0,0|Ov:100,1>",
            "<Idle|MPos:1,2|FS:0,0>",
            "oj",
            "<Idlf|FS:0,0>",
            "error:",
        ] {
            assert!(
                matches!(Reply::parse(text), Some(Reply::Unknown(_))),
                "{text}"
            );
        }
        let Some(Reply::Status(status)) = Reply::parse("<Idle|MPos:0,0,0>") else {
            panic!("a report without power is still a report");
        };
        assert!(!status.dark_and_still());
        let Some(Reply::Status(status)) = Reply::parse("<Idle|FS:0,500>") else {
            panic!("a report");
        };
        assert!(!status.dark_and_still(), "M3 standing in Idle burns");
    }
}
