//! What a controller makes of a text: moves with a beam or an arc.
//!
//! Written from the controllers' rules and not from our writer, so that it also serves G-code of other programs.

mod arc;
mod block;
#[cfg(test)]
mod tests;
mod torch;
#[cfg(test)]
mod torch_tests;
mod words;

use kurbo::Point;

use self::arc::Arc;
use self::block::{Block, Motion};
use self::torch::Torch;
use self::words::{Line, Value, line as parse};
use super::finding::{Finding, Rule};
use crate::base::units::short;
use crate::machine::{Controller, HeightControl, Machine, Tool};

/// Whose rules a text is read by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// GRBL, grblHAL and FluidNC in laser mode.
    Laser,
    /// LinuxCNC with QtPlasmaC: the torch moves up and down by itself.
    QtPlasmaC,
    /// LinuxCNC with a torch that the job moves.
    LinuxCnc,
    /// Any other table with a torch that the job moves, GRBL without laser mode included.
    Table,
}

impl Dialect {
    /// As a machine's profile says.
    pub fn of(machine: &Machine) -> Self {
        match (machine.tool(), machine.controller) {
            (Some(Tool::Plasma(torch)), _) if torch.height_control == HeightControl::QtPlasmaC => {
                Self::QtPlasmaC
            }
            (Some(Tool::Plasma(_)), Controller::LinuxCnc) => Self::LinuxCnc,
            (Some(Tool::Plasma(_)), _) => Self::Table,
            _ => Self::Laser,
        }
    }

    /// Whether it drives a torch, which burns at rest too.
    fn is_torch(self) -> bool {
        self != Self::Laser
    }

    fn is_linuxcnc(self) -> bool {
        matches!(self, Self::QtPlasmaC | Self::LinuxCnc)
    }

    /// How far the two radii of an arc may differ, millimetres, whatever its size: GRBL's own bound (`error:33`), and
    /// LinuxCNC 2.9's of a thousandth of an inch.
    fn arc_slack_mm(self) -> f64 {
        if self.is_linuxcnc() { 0.0254 } else { 0.005 }
    }
}

/// What the beam is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beam {
    /// M5, or nothing yet.
    Off,
    /// A laser's M3: on wherever S is above 0, also at rest.
    Constant,
    /// A laser's M4: on in motion only.
    Dynamic,
    /// A plasma arc: on, whatever the head does.
    Torch,
    /// The scribe of a plasma table, down on the sheet.
    Scribe,
}

/// One straight piece of motion, millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Line of the text, counted from 1.
    pub line: usize,
    /// Where it begins; `None` if nobody said where the head was.
    pub from: Option<Point>,
    /// Where it ends.
    pub to: Point,
    /// G0.
    pub rapid: bool,
    /// Millimetres per minute; 0 if never given, and not a number where it is that of a material which only the table
    /// knows.
    pub feed_mm_per_min: f64,
    /// The S word in force; of a torch that is on 1, and of a scribe 0.
    pub power: f64,
    /// The beam's mode.
    pub beam: Beam,
}

impl Move {
    /// Whether material is burnt or scratched along it: of a laser in laser mode never on a rapid.
    pub fn burns(&self) -> bool {
        match self.beam {
            Beam::Off => false,
            Beam::Constant | Beam::Dynamic => !self.rapid && self.power > 0.0,
            Beam::Torch | Beam::Scribe => true,
        }
    }
}

/// A text as a controller understands it.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// All motion, arcs as chords.
    pub moves: Vec<Move>,
    /// What a controller refuses or what is not safe to run, by line.
    pub findings: Vec<Finding>,
    /// Lines with a laser's M3, whether or not anything is burnt after it.
    pub constant_power: Vec<usize>,
    /// Places where a torch pierces, with the lines.
    pub pierces: Vec<(usize, Point)>,
    /// Numbers in QtPlasmaC's own list of materials that are selected (M190), with the lines.
    pub materials: Vec<(usize, u32)>,
    /// Lines of the text.
    pub lines: usize,
}

/// Chords of all arcs of a text together: ten times those of a big job, 200 MB of moves. Larger counts are a mistake or
/// an attack, and would fill the memory.
const ALL_CHORDS: usize = 2_000_000;

struct State {
    dialect: Dialect,
    motion: Option<Motion>,
    unit_mm: Option<f64>,
    absolute: Option<bool>,
    at: [Option<f64>; 2],
    feed: f64,
    power: f64,
    beam: Beam,
    torch: Torch,
    ended: bool,
    /// Chords that may still be made; none once a text has asked for too many.
    chords: Option<usize>,
}

/// Reads G-code for a GRBL-class laser: [`read_as`] with [`Dialect::Laser`].
pub fn read(text: &str) -> Program {
    read_as(text, Dialect::Laser)
}

/// Reads G-code. Never fails: what is wrong becomes a [`Finding`] with its line, and reading goes on, as a controller
/// would.
pub fn read_as(text: &str, dialect: Dialect) -> Program {
    read_with(text, dialect, None)
}

/// [`read_as`] by someone who knows the feed (mm/min) of the material that a job selects from QtPlasmaC's own list: it
/// stands in the moves in place of NaN.
pub fn read_with(text: &str, dialect: Dialect, table_feed: Option<f64>) -> Program {
    let mut state = State {
        dialect,
        motion: None,
        unit_mm: None,
        absolute: None,
        at: [None; 2],
        feed: 0.0,
        power: 0.0,
        beam: Beam::Off,
        torch: Torch::new(table_feed),
        ended: false,
        chords: Some(ALL_CHORDS),
    };
    let mut program = Program {
        moves: Vec::new(),
        findings: Vec::new(),
        constant_power: Vec::new(),
        pierces: Vec::new(),
        materials: Vec::new(),
        lines: 0,
    };
    // A second `%` ends LinuxCNC's programs.
    let mut percents = 0;
    for (i, raw) in text.lines().enumerate() {
        program.lines = i + 1;
        let line = i + 1;
        if raw.contains('\r') {
            program.findings.push(Finding::at(
                line,
                Rule::Syntax,
                "a carriage return without a newline stands in the line: the controller ends a line there, other \
                 programs do not"
                    .into(),
            ));
        }
        // Read as the controller does.
        for part in raw.split('\r') {
            match parse(part, dialect) {
                Ok(found) => {
                    percents += usize::from(found.percent);
                    state.torch.starts_a_move(part);
                    if let Some(inside) = found.material.filter(|_| dialect == Dialect::QtPlasmaC) {
                        state.material(line, inside, &mut program);
                    }
                    if !found.words.is_empty() {
                        state.block(line, &found, &mut program);
                    }
                }
                Err(problem) => program
                    .findings
                    .push(Finding::at(line, Rule::Syntax, problem)),
            }
        }
    }
    if state.beam != Beam::Off && !state.ended {
        program.findings.push(Finding::at(
            program.lines,
            Rule::BeamAtEnd,
            if dialect.is_torch() {
                "the program ends without M5: the torch stays on".into()
            } else {
                "the program ends without M5: the laser stays armed".into()
            },
        ));
    }
    if dialect.is_linuxcnc() && !state.ended && percents >= 2 {
        state.left_behind(program.lines, &mut program);
    }
    if dialect.is_linuxcnc() && !state.ended && percents < 2 {
        program.findings.push(Finding::at(
            program.lines,
            Rule::Syntax,
            "the program does not end: LinuxCNC wants M2, M30, or a line % before and after it"
                .into(),
        ));
    }
    program
}

impl State {
    /// One line, in the controller's order of execution: feed, power, beam, dwell, units and modes, motion, end.
    fn block(&mut self, line: usize, found: &Line<'_>, program: &mut Program) {
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        let block = match Block::gather(&found.words, self.dialect) {
            Ok(block) => block,
            Err(problem) => return say(Rule::Syntax, problem),
        };
        if self.ended {
            say(
                Rule::Syntax,
                "there are commands after the end of the program (M2, M30)".into(),
            );
        }
        if let Some(unit) = block.unit_mm {
            self.unit_mm = Some(unit);
        }
        if let Some(absolute) = block.absolute {
            self.absolute = Some(absolute);
        }
        let unit = self.unit_mm.unwrap_or(1.0);
        match block.f {
            Some(Value::Number(f)) => self.feed = f * unit,
            Some(Value::MaterialFeed) => {
                if self.torch.changing {
                    say(
                        Rule::Feed,
                        "the feed is taken before the table has changed to the material (M190): a line M66 P3 L3 Q1 belongs between"
                            .into(),
                    );
                }
                if self.torch.material_feed == Some(0.0) {
                    say(
                        Rule::Feed,
                        "the feed is that of a material, and no material was chosen (M190)".into(),
                    );
                }
                self.feed = self.torch.material_feed.unwrap_or(f64::NAN);
            }
            None => {}
        }
        if let Some(s) = block.s {
            self.power = s;
        }
        if self.dialect.is_torch() {
            self.torch_block(line, &block, unit, program);
        } else {
            self.laser_block(line, &block, unit, program);
        }
        if block.end {
            if self.beam != Beam::Off {
                program.findings.push(Finding::at(
                    line,
                    Rule::BeamAtEnd,
                    if self.dialect.is_torch() {
                        "the program ends with the torch on; M5 belongs before the way home".into()
                    } else {
                        "the program ends with the laser still armed; M5 belongs before the way home"
                            .into()
                    },
                ));
            }
            if self.dialect.is_linuxcnc() {
                self.left_behind(line, program);
            }
            self.ended = true;
        }
    }

    fn laser_block(&mut self, line: usize, block: &Block, unit: f64, program: &mut Program) {
        if let Some(beam) = block.beam {
            self.beam = beam;
            if beam == Beam::Constant {
                program.constant_power.push(line);
            }
        }
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        let mut stands = false;
        if block.dwell && self.beam == Beam::Constant && self.power > 0.0 {
            stands = true;
            say(
                Rule::StandingBeam,
                "the machine waits (G4) with the beam on (M3)".into(),
            );
        }
        self.dwell(line, block, program);
        // A controller that takes a wait and a move in one line waits first, and then moves: so it is read.
        if let Some(motion) = block.motion {
            self.motion = Some(motion);
        }
        if block.x.is_some() || block.y.is_some() {
            self.travel(line, block, unit, program);
        } else if !stands
            && self.beam == Beam::Constant
            && self.power > 0.0
            && self.motion.is_some_and(|motion| motion != Motion::Rapid)
        {
            program.findings.push(Finding::at(
                line,
                Rule::StandingBeam,
                "with M3, a cutting mode (G1, G2, G3) in force and S above 0, a line without a target turns the beam on at rest"
                    .into(),
            ));
        }
    }

    /// What holds for every wait.
    fn dwell(&self, line: usize, block: &Block, program: &mut Program) {
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        if !block.dwell {
            return;
        }
        if block.p.is_none() {
            say(Rule::Syntax, "G4 without P: how long?".into());
        }
        if block.moves() {
            say(
                Rule::Syntax,
                "a line both waits (G4) and moves: controllers do not agree on what that means; write two lines"
                    .into(),
            );
        }
    }

    fn travel(&mut self, line: usize, block: &Block, unit: f64, program: &mut Program) {
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        if block.machine_coordinates {
            return say(
                Rule::Syntax,
                "G53 moves in another coordinate system: where that is cannot be checked".into(),
            );
        }
        let Some(motion) = self.motion else {
            return say(
                Rule::Modes,
                "there are coordinates before any G0 or G1".into(),
            );
        };
        if self.unit_mm.is_none() {
            say(
                Rule::Modes,
                "the first motion comes before the unit (G21)".into(),
            );
            self.unit_mm = Some(1.0);
        }
        if self.absolute.is_none() {
            say(
                Rule::Modes,
                "the first motion comes before absolute or relative (G90)".into(),
            );
            self.absolute = Some(true);
        }
        let absolute = self.absolute.unwrap_or(true);
        let mut target = self.at;
        for (axis, word) in [block.x, block.y].into_iter().enumerate() {
            let Some(word) = word else { continue };
            target[axis] = if absolute {
                Some(word * unit)
            } else {
                self.at[axis].map(|v| v + word * unit)
            };
        }
        let from = match self.at {
            [Some(x), Some(y)] => Some(Point::new(x, y)),
            _ => None,
        };
        self.at = target;
        let [Some(x), Some(y)] = target else {
            return say(
                Rule::Modes,
                "nothing before this says where the head is: begin with G0 X Y".into(),
            );
        };
        let to = Point::new(x, y);
        let rapid = motion == Motion::Rapid;
        if rapid
            && block.s.is_some_and(|s| s > 0.0)
            && matches!(self.beam, Beam::Constant | Beam::Dynamic)
        {
            say(
                Rule::BurnOnRapid,
                format!(
                    "a rapid sets power S{}: a controller that is not in laser mode burns here",
                    short(self.power, 3)
                ),
            );
        }
        let (beam, power) = self.in_motion();
        let step = |from: Option<Point>, to: Point| Move {
            line,
            from,
            to,
            rapid,
            feed_mm_per_min: self.torch.slowed(self.feed),
            power,
            beam,
        };
        if matches!(motion, Motion::Rapid | Motion::Line | Motion::Probe) {
            if motion == Motion::Line
                && from == Some(to)
                && self.beam == Beam::Constant
                && self.power > 0.0
            {
                say(
                    Rule::StandingBeam,
                    "a cut to where the head is anyway turns an M3 beam on at rest".into(),
                );
            }
            program.moves.push(step(from, to));
            return;
        }
        let Some(from) = from else {
            return say(
                Rule::Modes,
                "an arc begins where nobody said the head is".into(),
            );
        };
        let clockwise = motion == Motion::Clockwise;
        match Arc::new(
            from,
            to,
            block,
            unit,
            clockwise,
            self.dialect.arc_slack_mm(),
        ) {
            Ok(arc) => {
                let Some(left) = self.chords else { return };
                self.chords = left.checked_sub(arc.chords);
                if self.chords.is_none() {
                    return say(
                        Rule::Syntax,
                        format!(
                            "the arcs up to here need more than {ALL_CHORDS} straight pieces: from here on no arc is checked"
                        ),
                    );
                }
                let mut last = from;
                for p in arc.points() {
                    program.moves.push(step(Some(last), p));
                    last = p;
                }
            }
            Err(problem) => say(Rule::Syntax, problem),
        }
    }

    /// What burns while the head moves, and how strongly.
    fn in_motion(&self) -> (Beam, f64) {
        match self.beam {
            Beam::Torch if !self.torch.enabled => (Beam::Off, 0.0),
            Beam::Torch => (Beam::Torch, 1.0),
            Beam::Scribe => (Beam::Scribe, 0.0),
            other => (other, self.power),
        }
    }
}
