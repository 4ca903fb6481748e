//! G-code for a GRBL laser.

use kurbo::Point;

use crate::base::units::short;
use crate::machine::{Machine, PowerMode};
use crate::material::Material;
use crate::toolpath::{CHORD_ERROR_MM, Cut, Role, Toolpath};

/// Micrometres: GRBL prints and keeps no more, and the verifier tolerates ten.
const DECIMALS: usize = 3;

/// Why a toolpath cannot be written for a machine.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GcodeError {
    /// A line would be longer than the controller takes. Only coordinates of astronomical size can do that.
    #[error("the line {line:?} has {length} characters, and the controller takes {limit}")]
    LineTooLong {
        /// The line.
        line: String,
        /// Its length.
        length: usize,
        /// The limit.
        limit: usize,
    },
    /// No G-code is written for such a machine yet.
    #[error("no G-code is written for machine `{machine}` yet: it has no laser")]
    NoDialect {
        /// The machine.
        machine: String,
    },
    /// A coordinate is not a number.
    #[error("a cut has a coordinate that is not a number, near ({x}, {y})")]
    NotFinite {
        /// The x coordinate.
        x: f64,
        /// The y coordinate.
        y: f64,
    },
}

/// Lines under construction, and what the controller already knows.
struct Writer {
    lines: Vec<String>,
    at: Option<[String; 2]>,
    motion: &'static str,
    feed: String,
    power: String,
}

impl Writer {
    fn line(&mut self, text: impl Into<String>) {
        self.lines.push(text.into());
    }

    /// Says only what changes. A move to where the head is anyway is left out: controllers drop it too, some with the
    /// beam on.
    fn go(&mut self, motion: &'static str, to: Point, settings: Option<(&str, &str)>) {
        let target = [short(to.x, DECIMALS), short(to.y, DECIMALS)];
        let mut words: Vec<String> = Vec::with_capacity(5);
        for (axis, letter) in ["X", "Y"].iter().enumerate() {
            if self.at.as_ref().is_none_or(|at| at[axis] != target[axis]) {
                words.push(format!("{letter}{}", target[axis]));
            }
        }
        if words.is_empty() {
            return;
        }
        if self.motion != motion {
            words.insert(0, motion.into());
            self.motion = motion;
        }
        if let Some((feed, power)) = settings {
            if self.feed != feed {
                words.push(format!("F{feed}"));
                self.feed = feed.into();
            }
            if self.power != power {
                words.push(format!("S{power}"));
                self.power = power.into();
            }
        }
        self.at = Some(target);
        self.line(words.join(" "));
    }
}

/// How the header names the machine profile that a job was written for.
const MACHINE_LINE: &str = "; machine ";

/// How the header says how often each cut is gone over; left out for once.
const PASSES_LINE: &str = "; passes ";

/// What else the header says for the verifier; left out where it does not apply.
const LEADS_LINE: &str = "; leads";
const MARKS_LINE: &str = "; marks";
const OVERCUT_LINE: &str = "; overcut ";
const PIERCE_LINE: &str = "; pierce ";

/// Lines of a text that may be its header.
const HEADER_LINES: usize = 16;

/// What a job says of itself in its header, for those who judge it: without the words, none of these is accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Declared {
    /// It burns leads in scrap.
    pub leads: bool,
    /// It engraves the sheet's marks.
    pub marks: bool,
    /// It cuts contours this far beyond their start, millimetres.
    pub overcut_mm: f64,
    /// Its pierce holes have this diameter, millimetres; 0 if they are no wider than the kerf.
    pub pierce_mm: f64,
}

impl Declared {
    /// As the header of a text says.
    pub fn of(text: &str) -> Self {
        let header = || text.lines().take(HEADER_LINES);
        let has = |line: &str| header().any(|l| l.trim_end() == line);
        let number = |start: &str| {
            let found = header().find_map(|l| l.strip_prefix(start)?.trim().parse::<f64>().ok());
            found.filter(|v| (0.0..1000.0).contains(v)).unwrap_or(0.0)
        };
        Self {
            leads: has(LEADS_LINE),
            marks: has(MARKS_LINE),
            overcut_mm: number(OVERCUT_LINE),
            pierce_mm: number(PIERCE_LINE),
        }
    }
}

/// How often a job goes over each cut, from its header: `None` where it does not say so, which in our own jobs means
/// once.
pub fn passes_of(text: &str) -> Option<u32> {
    text.lines()
        .take(HEADER_LINES)
        .find_map(|line| line.strip_prefix(PASSES_LINE))?
        .trim()
        .parse()
        .ok()
        .filter(|n| (1..=1000).contains(n))
}

/// The name of the machine profile that a job was written for, from its header; `None` for G-code of other programs.
pub fn machine_of(text: &str) -> Option<&str> {
    text.lines()
        .take(HEADER_LINES)
        .find_map(|line| line.strip_prefix(MACHINE_LINE))
        .map(str::trim)
}

/// The G-code of a toolpath, in machine coordinates, ending with a line end.
///
/// The beam: `M4` follows speed and is off on every `G0` and at rest, as long as the controller is in laser mode
/// (`$32=1`). Power stays set between cuts: an S word on a rapid would stop GRBL's planner each time.
///
/// # Errors
/// [`GcodeError`].
pub fn write(
    toolpath: &Toolpath,
    machine: &Machine,
    material: &Material,
) -> Result<String, GcodeError> {
    let Some(laser) = machine.laser() else {
        return Err(GcodeError::NoDialect {
            machine: machine.name.clone(),
        });
    };
    let figures = toolpath.figures();
    let mut w = Writer {
        lines: Vec::new(),
        at: None,
        motion: "",
        feed: String::new(),
        power: String::new(),
    };
    w.line(format!("; kagome {}", env!("CARGO_PKG_VERSION")));
    w.line(format!("{MACHINE_LINE}{}", machine.name));
    w.line(format!("; material {}", material.name));
    // The verifier must not guess this from what is burnt: a job that is doubled by mistake would pass.
    if let Some(passes) = toolpath.cuts.iter().map(|c| c.passes).max()
        && passes > 1
    {
        w.line(format!("{PASSES_LINE}{passes}"));
    }
    let any = |of: &dyn Fn(&Cut) -> bool| toolpath.cuts.iter().any(of);
    if any(&|c| c.lead_in.is_some() || c.lead_out.is_some()) {
        w.line(LEADS_LINE);
    }
    if any(&|c| c.role == Role::Mark) {
        w.line(MARKS_LINE);
    }
    if toolpath.overcut_mm > 0.0 {
        w.line(format!(
            "{OVERCUT_LINE}{}",
            short(toolpath.overcut_mm, DECIMALS)
        ));
    }
    if let Some(pierce_mm) = toolpath.pierce_mm {
        w.line(format!("{PIERCE_LINE}{}", short(pierce_mm, DECIMALS)));
    }
    w.line(format!(
        "; {} strokes, cut {} mm, travel {} mm",
        figures.strokes,
        short(figures.cut_length_mm, 0),
        short(figures.travel_mm, 0)
    ));
    w.line("; needs laser mode: $32=1");
    w.line("G21");
    w.line("G90");
    w.line("G17");
    w.line("G94");
    w.lines.extend(machine.job.preamble.iter().cloned());
    let air = laser.air_on.is_some();
    w.lines.extend(laser.air_on.iter().cloned());
    w.line(match laser.power_mode {
        PowerMode::Dynamic => "M4 S0",
        PowerMode::Constant => "M3 S0",
    });
    w.power = "0".into();
    let mut role = None;
    for cut in &toolpath.cuts {
        let curves = [cut.lead_in.as_ref(), Some(&cut.line), cut.lead_out.as_ref()];
        if let Some(curve) = curves.into_iter().flatten().find(|c| !c.is_finite()) {
            let bad = curve.vertices.iter().find(|v| !v.at.is_finite());
            let at = bad
                .or(curve.vertices.first())
                .map_or(Point::ORIGIN, |v| v.at);
            return Err(GcodeError::NotFinite { x: at.x, y: at.y });
        }
        if role != Some(cut.role) {
            role = Some(cut.role);
            w.line(format!("; {}", cut.role.word()));
        }
        let feed = short(cut.feed_mm_per_min, 0);
        // Hundredths of a per cent and better, whatever the scale of S.
        let power = short(laser.s_max * cut.power_percent / 100.0, 1);
        for (i, step) in cut.steps().into_iter().enumerate() {
            if i == 0 {
                w.go("G0", step.piece.from, None);
            }
            let feed = if step.speed_percent == 100.0 {
                feed.clone()
            } else {
                short(cut.feed_mm_per_min * step.speed_percent / 100.0, 0)
            };
            for point in step.piece.chords(CHORD_ERROR_MM) {
                w.go("G1", point, Some((&feed, &power)));
            }
        }
    }
    w.line("M5");
    if air {
        w.lines.extend(laser.air_off.iter().cloned());
    }
    let park = machine.job.park;
    w.go("G0", Point::new(park.x_mm, park.y_mm), None);
    w.lines.extend(machine.job.postamble.iter().cloned());
    let limit = machine.line_limit();
    if let Some(line) = w.lines.iter().find(|l| l.len() > limit) {
        return Err(GcodeError::LineTooLong {
            line: line.clone(),
            length: line.len(),
            limit,
        });
    }
    let mut text = w.lines.join("\n");
    text.push('\n');
    Ok(text)
}
