//! G-code of a toolpath, in the dialect of a machine.
//!
//! What all dialects share is here and in [`motion`]: the header that a verifier reads, numbers, modal words, motion.
//! What differs (how the tool is switched, heights, speeds at corners) has one file a dialect, chosen by the machine's
//! profile.

mod grbl;
mod linuxcnc;
mod motion;
mod template;

use kurbo::Point;

use self::motion::{Rules, Spot, Stroke, spot, strokes};
use crate::base::units::short;
use crate::machine::{Controller, HeightControl, Machine, Tool};
use crate::material::{CutError, Material};
use crate::toolpath::{Cut, Role, Toolpath};

/// Micrometres.
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
    /// A coordinate is not a number, or too large for any machine.
    #[error("a cut has a coordinate that is not a number for a machine, near ({x}, {y})")]
    NotFinite {
        /// The x coordinate.
        x: f64,
        /// The y coordinate.
        y: f64,
    },
    /// The machine does not cut the material.
    #[error(transparent)]
    Cut(#[from] CutError),
    /// A torch cannot go over a cut again.
    #[error("a cut is to be gone over {passes} times, and a plasma torch cuts through at once")]
    Passes {
        /// How often.
        passes: u32,
    },
    /// The machine's profile was not checked: its template is not there, or wants a figure that is not.
    #[error("the machine's template cannot be filled in: {missing} is missing")]
    Template {
        /// What is missing.
        missing: String,
    },
    /// There are marks, and no tool that makes them.
    #[error(
        "the sheet has marks, and machine `{machine}` has nothing to make them with (`plasma.scribe`): leave them out"
    )]
    Marks {
        /// The machine.
        machine: String,
    },
}

/// Lines under construction, and what the controller already knows.
struct Writer<'a> {
    machine: &'a Machine,
    lines: Vec<String>,
    at: Option<Spot>,
    /// The motion word in force; empty if it must be said again.
    motion: &'static str,
    feed: String,
    power: String,
    /// What the cuts before the next one were for.
    role: Option<Role>,
}

impl Writer<'_> {
    fn line(&mut self, text: impl Into<String>) {
        self.lines.push(text.into());
    }

    /// A remark, in the form that the controller takes.
    fn remark(&mut self, text: &str) {
        self.line(match self.machine.controller {
            Controller::Generic => format!("({text})"),
            _ => format!("; {text}"),
        });
    }

    /// What the next cuts are for, once.
    fn role(&mut self, role: Role) {
        if self.role != Some(role) {
            self.role = Some(role);
            self.remark(role.word());
        }
    }

    /// X and Y words, but those that say what the controller knows.
    fn coordinates(&self, to: Spot) -> Vec<String> {
        let mut words = Vec::with_capacity(5);
        for (axis, letter) in ['X', 'Y'].into_iter().enumerate() {
            if self.at.is_none_or(|at| at[axis] != to[axis]) {
                words.push(word(letter, to[axis]));
            }
        }
        words
    }

    fn say(&mut self, motion: &'static str, mut words: Vec<String>) {
        if self.motion != motion {
            words.insert(0, motion.into());
            self.motion = motion;
        }
        self.line(words.join(" "));
    }

    /// A move with the tool off. One to where the head is anyway is left out: controllers drop it too, some with the
    /// beam on.
    fn rapid(&mut self, to: Spot) {
        let words = self.coordinates(to);
        if !words.is_empty() {
            self.say("G0", words);
            self.at = Some(to);
        }
    }

    /// A move with the tool on: only what changes is said, and of an arc all of it.
    fn stroke(&mut self, stroke: &Stroke, feed: &str, power: Option<&str>) {
        let (motion, mut words) = match stroke.arc {
            None => ("G1", self.coordinates(stroke.to)),
            Some((centre, clockwise)) => (
                if clockwise { "G2" } else { "G3" },
                vec![
                    word('X', stroke.to[0]),
                    word('Y', stroke.to[1]),
                    word('I', centre[0]),
                    word('J', centre[1]),
                ],
            ),
        };
        if words.is_empty() {
            return;
        }
        if self.feed != feed {
            words.push(format!("F{feed}"));
            self.feed = feed.into();
        }
        if let Some(power) = power
            && self.power != power
        {
            words.push(format!("S{power}"));
            self.power = power.into();
        }
        self.say(motion, words);
        self.at = Some(stroke.to);
    }

    /// The place where a cut begins, and its strokes.
    fn path(&self, cut: &Cut) -> Result<Option<(Spot, Vec<Stroke>)>, GcodeError> {
        let curves = [cut.lead_in.as_ref(), Some(&cut.line), cut.lead_out.as_ref()];
        for curve in curves.into_iter().flatten() {
            let plain = |at: Point, bulge: f64| spot(at).is_some() && bulge.is_finite();
            if let Some(v) = curve.vertices.iter().find(|v| !plain(v.at, v.bulge)) {
                return Err(GcodeError::NotFinite {
                    x: v.at.x,
                    y: v.at.y,
                });
            }
        }
        let rules = Rules {
            arcs: self.machine.arcs(),
            lines_per_s: self.machine.lines_per_s(),
        };
        Ok(cut.start().and_then(spot).map(|start| {
            (
                start,
                strokes(start, &cut.steps(), rules, cut.feed_mm_per_min),
            )
        }))
    }

    /// Whether the postamble ends the program by itself.
    fn ends_itself(&self) -> bool {
        let last = self.machine.job.postamble.last();
        last.is_some_and(|l| {
            let l = l.trim().to_ascii_uppercase();
            l.starts_with("M2") || l.starts_with("M02") || l.starts_with("M30")
        })
    }

    /// The way home, the profile's last lines, and the end of the program where the controller must be told.
    fn finish(mut self) -> Result<String, GcodeError> {
        let [x, y] = self.machine.park_mm();
        let park = spot(Point::new(x, y)).ok_or(GcodeError::NotFinite { x, y })?;
        self.rapid(park);
        let ends = self.ends_itself() || self.machine.controller.is_streamed();
        self.lines
            .extend(self.machine.job.postamble.iter().cloned());
        if !ends {
            self.line("M2");
        }
        let limit = self.machine.line_limit();
        if let Some(line) = self.lines.iter().find(|l| l.len() > limit) {
            return Err(GcodeError::LineTooLong {
                line: line.clone(),
                length: line.len(),
                limit,
            });
        }
        let mut text = self.lines.join("\n");
        text.push('\n');
        Ok(text)
    }
}

fn word(letter: char, micrometres: i64) -> String {
    format!("{letter}{}", short(micrometres as f64 / 1000.0, DECIMALS))
}

/// A feed as it is written, millimetres per minute.
fn feed_word(cut: &Cut, speed_percent: f64) -> String {
    short(cut.feed_mm_per_min * speed_percent / 100.0, 0)
}

/// How the header names the machine profile that a job was written for.
const MACHINE_LINE: &str = "machine ";

/// How it names the material profile.
const MATERIAL_LINE: &str = "material ";

/// How the header says how often each cut is gone over; left out for once.
const PASSES_LINE: &str = "passes ";

/// What else the header says for the verifier; left out where it does not apply.
const LEADS_LINE: &str = "leads";
const MARKS_LINE: &str = "marks";
const OVERCUT_LINE: &str = "overcut ";
const PIERCE_LINE: &str = "pierce ";

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

/// The remarks of a text's header, in either form.
fn header(text: &str) -> impl Iterator<Item = &str> {
    text.lines().take(HEADER_LINES).filter_map(|line| {
        let line = line.trim();
        match line.strip_prefix(';') {
            Some(rest) => Some(rest.trim()),
            None => Some(line.strip_prefix('(')?.strip_suffix(')')?.trim()),
        }
    })
}

impl Declared {
    /// As the header of a text says.
    pub fn of(text: &str) -> Self {
        let has = |line: &str| header(text).any(|l| l == line);
        let number = |start: &str| {
            let found =
                header(text).find_map(|l| l.strip_prefix(start)?.trim().parse::<f64>().ok());
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
    header(text)
        .find_map(|line| line.strip_prefix(PASSES_LINE))?
        .trim()
        .parse()
        .ok()
        .filter(|n| (1..=1000).contains(n))
}

/// The name of the machine profile that a job was written for, from its header; `None` for G-code of other programs.
pub fn machine_of(text: &str) -> Option<&str> {
    header(text)
        .find_map(|line| line.strip_prefix(MACHINE_LINE))
        .map(str::trim)
}

/// The name of the material profile that a job was written for, likewise.
pub(super) fn material_of(text: &str) -> Option<&str> {
    header(text)
        .find_map(|line| line.strip_prefix(MATERIAL_LINE))
        .map(str::trim)
}

/// The G-code of a toolpath, in machine coordinates, ending with a line end, in the dialect that the machine's profile
/// asks for: GRBL and its successors for lasers, QtPlasmaC, or the profile's template for other plasma tables.
///
/// # Errors
/// [`GcodeError`].
pub fn write(
    toolpath: &Toolpath,
    machine: &Machine,
    material: &Material,
) -> Result<String, GcodeError> {
    let mut w = Writer {
        machine,
        lines: Vec::new(),
        at: None,
        motion: "",
        feed: String::new(),
        power: String::new(),
        role: None,
    };
    w.header(toolpath, material);
    match machine.tool() {
        Some(Tool::Laser(laser)) => grbl::write(w, toolpath, laser),
        Some(Tool::Plasma(torch)) => {
            if let Some(cut) = toolpath.cuts.iter().find(|c| c.passes > 1) {
                return Err(GcodeError::Passes { passes: cut.passes });
            }
            let marks = toolpath.cuts.iter().any(|c| c.role == Role::Mark);
            if marks && !torch.scribe {
                return Err(GcodeError::Marks {
                    machine: machine.name.clone(),
                });
            }
            let setting = material.cut_for(machine)?;
            match torch.height_control {
                HeightControl::QtPlasmaC => linuxcnc::write(w, toolpath, torch, material, &setting),
                HeightControl::Plain => template::write(w, toolpath, torch, &setting),
            }
        }
        None => Err(CutError::NoTool {
            machine: machine.name.clone(),
        }
        .into()),
    }
}

impl Writer<'_> {
    /// Who made it, for what, and what a verifier must not guess.
    fn header(&mut self, toolpath: &Toolpath, material: &Material) {
        let figures = toolpath.figures();
        self.remark(&format!("kagome {}", env!("CARGO_PKG_VERSION")));
        self.remark(&format!("{MACHINE_LINE}{}", self.machine.name));
        self.remark(&format!("{MATERIAL_LINE}{}", material.name));
        // The verifier must not guess this from what is burnt: a job that is doubled by mistake would pass.
        let passes = toolpath.passes;
        if passes > 1 {
            self.remark(&format!("{PASSES_LINE}{passes}"));
        }
        let any = |of: &dyn Fn(&Cut) -> bool| toolpath.cuts.iter().any(of);
        if any(&|c| c.lead_in.is_some() || c.lead_out.is_some()) {
            self.remark(LEADS_LINE);
        }
        if any(&|c| c.role == Role::Mark) {
            self.remark(MARKS_LINE);
        }
        if toolpath.overcut_mm > 0.0 {
            let overcut = short(toolpath.overcut_mm, DECIMALS);
            self.remark(&format!("{OVERCUT_LINE}{overcut}"));
        }
        if let Some(pierce_mm) = toolpath.pierce_mm {
            self.remark(&format!("{PIERCE_LINE}{}", short(pierce_mm, DECIMALS)));
        }
        self.remark(&format!(
            "{} strokes, cut {} mm, travel {} mm",
            figures.strokes,
            short(figures.cut_length_mm, 0),
            short(figures.travel_mm, 0)
        ));
    }

    /// Units and modes, then the profile's first lines.
    fn modes(&mut self, modes: &[&str]) {
        for mode in modes {
            self.line(*mode);
        }
        self.lines.extend(self.machine.job.preamble.iter().cloned());
    }
}
