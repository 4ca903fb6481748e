//! What a GRBL-class controller in laser mode makes of a text: moves with a beam.
//!
//! Written from the controller's rules and not from our writer, so that it also serves G-code of other programs.

use kurbo::Point;

use super::verify::{Finding, Rule};
use crate::base::units::short;

/// What the beam is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beam {
    /// M5, or nothing yet.
    Off,
    /// M3: on wherever S is above 0, also at rest.
    Constant,
    /// M4: on in motion only.
    Dynamic,
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
    /// Millimetres per minute; 0 if never given.
    pub feed_mm_per_min: f64,
    /// The S word in force.
    pub power: f64,
    /// The beam's mode.
    pub beam: Beam,
}

impl Move {
    /// Whether material is burnt along it: never on a rapid, in laser mode.
    pub fn burns(&self) -> bool {
        !self.rapid && self.beam != Beam::Off && self.power > 0.0
    }
}

/// A text as a controller understands it.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// All motion, arcs as chords.
    pub moves: Vec<Move>,
    /// What a controller refuses or what is not safe to run, by line.
    pub findings: Vec<Finding>,
    /// Lines with M3, whether or not anything is burnt after it.
    pub constant_power: Vec<usize>,
    /// Lines of the text.
    pub lines: usize,
}

/// Largest distance between an arc and the chords that stand for it, millimetres.
const ARC_CHORD_MM: f64 = 0.002;
/// GRBL's own bound on the two radii of an arc: `error:33` beyond 0.005 mm and 0.1 %.
const ARC_RADIUS_SLACK_MM: f64 = 0.005;
/// Chords of one full turn at the most, however large the radius.
const ARC_CHORDS: f64 = 20_000.0;
/// Chords of all arcs of a text together: ten times those of a big job, 200 MB of moves. Larger counts are a mistake or
/// an attack, and would fill the memory.
const ALL_CHORDS: usize = 2_000_000;
/// Ends of an arc that are closer than this without being equal: in the controller's single precision rounding decides
/// whether it goes all the way round or hardly moves.
const ARC_CLOSED_MM: f64 = 0.01;
const MM_PER_INCH: f64 = 25.4;
/// Larger numbers than any machine's, and far from where arithmetic fails: ten kilometres.
const LARGEST_NUMBER: f64 = 1e7;

#[derive(Clone, Copy, PartialEq)]
enum Motion {
    Rapid,
    Line,
    Clockwise,
    CounterClockwise,
}

struct State {
    motion: Option<Motion>,
    unit_mm: Option<f64>,
    absolute: Option<bool>,
    at: [Option<f64>; 2],
    feed: f64,
    power: f64,
    beam: Beam,
    ended: bool,
    /// Chords that may still be made; none once a text has asked for too many.
    chords: Option<usize>,
}

/// Reads G-code. Never fails: what is wrong becomes a [`Finding`] with its line, and reading goes on, as a controller
/// would.
pub fn read(text: &str) -> Program {
    let mut state = State {
        motion: None,
        unit_mm: None,
        absolute: None,
        at: [None; 2],
        feed: 0.0,
        power: 0.0,
        beam: Beam::Off,
        ended: false,
        chords: Some(ALL_CHORDS),
    };
    let mut program = Program {
        moves: Vec::new(),
        findings: Vec::new(),
        constant_power: Vec::new(),
        lines: 0,
    };
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
            match words(part) {
                Ok(words) if words.is_empty() => {}
                Ok(words) => state.block(line, &words, &mut program),
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
            "the program ends without M5: the laser stays armed".into(),
        ));
    }
    program
}

/// Letters with their numbers; comments and blanks dropped.
fn words(raw: &str) -> Result<Vec<(char, f64)>, String> {
    let mut words = Vec::new();
    let mut rest = raw.trim();
    if rest == "%" {
        return Ok(words);
    }
    if rest.starts_with('$') {
        return Err(format!(
            "`{rest}` is a command to the controller, not G-code: a job must not change settings"
        ));
    }
    loop {
        rest = rest.trim_start();
        let Some(letter) = rest.chars().next() else {
            return Ok(words);
        };
        match letter {
            ';' => return Ok(words),
            '(' => match rest.find(')') {
                Some(end) => rest = &rest[end + 1..],
                None => return Err("a comment is opened with ( and never closed".into()),
            },
            'A'..='Z' | 'a'..='z' => {
                let body = rest[1..].trim_start();
                let end = body
                    .find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)))
                    .unwrap_or(body.len());
                let number = &body[..end];
                let value = number.parse::<f64>().map_err(|_| {
                    format!("`{letter}{number}` is no word: a letter needs a number")
                })?;
                if value.is_nan() || value.abs() > LARGEST_NUMBER {
                    return Err(format!("`{letter}{number}` is no number for a machine"));
                }
                words.push((letter.to_ascii_uppercase(), value));
                rest = &body[end..];
            }
            other => return Err(format!("the character {other:?} has no meaning in G-code")),
        }
    }
}

/// The words of one line, sorted by meaning.
#[derive(Default)]
struct Block {
    x: Option<f64>,
    y: Option<f64>,
    i: Option<f64>,
    j: Option<f64>,
    r: Option<f64>,
    p: Option<f64>,
    f: Option<f64>,
    s: Option<f64>,
    motion: Option<Motion>,
    dwell: bool,
    machine_coordinates: bool,
    beam: Option<Beam>,
    unit_mm: Option<f64>,
    absolute: Option<bool>,
    end: bool,
}

impl Block {
    /// Whether a motion is asked for, or words that only a motion takes.
    fn moves(&self) -> bool {
        self.motion.is_some()
            || [self.x, self.y, self.i, self.j, self.r]
                .iter()
                .any(Option::is_some)
    }

    fn gather(words: &[(char, f64)]) -> Result<Self, String> {
        let mut block = Self::default();
        fn once<T>(slot: &mut Option<T>, value: T, what: &str) -> Result<(), String> {
            match slot.replace(value) {
                None => Ok(()),
                Some(_) => Err(format!(
                    "two words of one line say {what}: the controller refuses it"
                )),
            }
        }
        for &(letter, value) in words {
            // G and M numbers are compared in tenths: G38.2 is not G38.
            let code = (value * 10.0).round() as i64;
            let name = format!("{letter}{}", short(value, 3));
            match letter {
                'X' => once(&mut block.x, value, "X")?,
                'Y' => once(&mut block.y, value, "Y")?,
                'I' => once(&mut block.i, value, "I")?,
                'J' => once(&mut block.j, value, "J")?,
                'R' => once(&mut block.r, value, "R")?,
                'P' => once(&mut block.p, value, "P")?,
                'F' => once(&mut block.f, value, "F")?,
                'S' => once(&mut block.s, value, "S")?,
                'N' | 'T' => {}
                'G' => match code {
                    0 => once(&mut block.motion, Motion::Rapid, "how to move")?,
                    10 => once(&mut block.motion, Motion::Line, "how to move")?,
                    20 => once(&mut block.motion, Motion::Clockwise, "how to move")?,
                    30 => once(&mut block.motion, Motion::CounterClockwise, "how to move")?,
                    40 => block.dwell = true,
                    200 => once(&mut block.unit_mm, MM_PER_INCH, "the unit")?,
                    210 => once(&mut block.unit_mm, 1.0, "the unit")?,
                    530 => block.machine_coordinates = true,
                    900 => once(&mut block.absolute, true, "absolute or relative")?,
                    910 => once(&mut block.absolute, false, "absolute or relative")?,
                    // XY plane, no cutter compensation, first coordinate system, exact path, feed per minute,
                    // relative arc centres, no length offset.
                    170 | 400 | 490 | 540 | 610 | 940 | 911 => {}
                    _ => {
                        return Err(format!(
                            "{name} is not known here: what it does cannot be checked"
                        ));
                    }
                },
                'M' => match code {
                    30 => once(&mut block.beam, Beam::Constant, "the beam")?,
                    40 => once(&mut block.beam, Beam::Dynamic, "the beam")?,
                    50 => once(&mut block.beam, Beam::Off, "the beam")?,
                    20 | 300 => block.end = true,
                    0 | 10 | 70 | 80 | 90 => {}
                    _ => {
                        return Err(format!(
                            "{name} is not known here: what it does cannot be checked"
                        ));
                    }
                },
                _ => {
                    return Err(format!(
                        "{name} is not known here: what it does cannot be checked"
                    ));
                }
            }
        }
        if block.f.is_some_and(|f| f < 0.0) || block.s.is_some_and(|s| s < 0.0) {
            return Err("F and S must not be negative".into());
        }
        Ok(block)
    }
}

impl State {
    /// One line, in the controller's order of execution: feed, power, beam, dwell, units and modes, motion, end.
    fn block(&mut self, line: usize, words: &[(char, f64)], program: &mut Program) {
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        let block = match Block::gather(words) {
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
        if let Some(f) = block.f {
            self.feed = f * unit;
        }
        if let Some(s) = block.s {
            self.power = s;
        }
        if let Some(beam) = block.beam {
            self.beam = beam;
            if beam == Beam::Constant {
                program.constant_power.push(line);
            }
        }
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        let mut stands = false;
        if block.dwell {
            if self.beam == Beam::Constant && self.power > 0.0 {
                stands = true;
                say(
                    Rule::StandingBeam,
                    "the machine waits (G4) with the beam on (M3)".into(),
                );
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
        // A controller that takes a wait and a move in one line waits first, and then moves: so it is read.
        if let Some(motion) = block.motion {
            self.motion = Some(motion);
        }
        if block.x.is_some() || block.y.is_some() {
            self.travel(line, &block, unit, program);
        } else if !stands
            && self.beam == Beam::Constant
            && self.power > 0.0
            && self.motion.is_some_and(|motion| motion != Motion::Rapid)
        {
            say(
                Rule::StandingBeam,
                "with M3, a cutting mode (G1, G2, G3) in force and S above 0, a line without a target turns the beam on at rest"
                    .into(),
            );
        }
        if block.end {
            if self.beam != Beam::Off {
                program.findings.push(Finding::at(
                    line,
                    Rule::BeamAtEnd,
                    "the program ends with the laser still armed; M5 belongs before the way home"
                        .into(),
                ));
            }
            self.ended = true;
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
        if rapid && block.s.is_some_and(|s| s > 0.0) && self.beam != Beam::Off {
            say(
                Rule::BurnOnRapid,
                format!(
                    "a rapid sets power S{}: a controller that is not in laser mode burns here",
                    short(self.power, 3)
                ),
            );
        }
        let step = |from: Option<Point>, to: Point| Move {
            line,
            from,
            to,
            rapid,
            feed_mm_per_min: self.feed,
            power: self.power,
            beam: self.beam,
        };
        if matches!(motion, Motion::Rapid | Motion::Line) {
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
        match Arc::new(from, to, block, unit, clockwise) {
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
}

/// An arc that is to become chords.
struct Arc {
    to: Point,
    centre: Point,
    /// Radius at the start and at the end, mm.
    radii: (f64, f64),
    start_angle: f64,
    sweep: f64,
    chords: usize,
}

impl Arc {
    fn new(
        from: Point,
        to: Point,
        block: &Block,
        unit: f64,
        clockwise: bool,
    ) -> Result<Self, String> {
        let centre = match (block.r, block.i, block.j) {
            (Some(r), None, None) => {
                let (r, chord) = (r * unit, to - from);
                let half = 0.5 * chord.hypot();
                if half == 0.0 || r == 0.0 || r.abs() < half - ARC_RADIUS_SLACK_MM {
                    return Err("an arc whose radius R does not reach its end".into());
                }
                let height = (r * r - half * half).max(0.0).sqrt();
                let left = chord.turn_90() / (2.0 * half);
                // A positive radius is the shorter way round.
                let side = if (r > 0.0) == clockwise { -1.0 } else { 1.0 };
                from.midpoint(to) + left * (height * side)
            }
            (None, None, None) => return Err("an arc needs I and J, or R".into()),
            (None, i, j) => from + kurbo::Vec2::new(i.unwrap_or(0.0), j.unwrap_or(0.0)) * unit,
            _ => return Err("an arc with both R and a centre".into()),
        };
        if block.r.is_none() && from != to && from.distance(to) < ARC_CLOSED_MM {
            return Err(format!(
                "an arc whose ends are {} mm apart and not equal: rounding decides whether the controller goes all the way round",
                from.distance(to)
            ));
        }
        let (r, s) = (from.distance(centre), to.distance(centre));
        if (r - s).abs() > ARC_RADIUS_SLACK_MM && (r - s).abs() > 0.001 * r {
            return Err(format!(
                "an arc whose ends are {} and {} mm from its centre",
                short(r, 4),
                short(s, 4)
            ));
        }
        let (a, b) = ((from - centre).atan2(), (to - centre).atan2());
        let mut sweep = (b - a).rem_euclid(std::f64::consts::TAU);
        if clockwise {
            sweep -= std::f64::consts::TAU;
        }
        // The same start and end mean a full turn.
        if sweep.abs() < 1e-9 {
            sweep = std::f64::consts::TAU.copysign(if clockwise { -1.0 } else { 1.0 });
        }
        let step = 2.0 * (1.0 - ARC_CHORD_MM / r.max(ARC_CHORD_MM)).acos();
        Ok(Self {
            to,
            centre,
            radii: (r, s),
            start_angle: a,
            sweep,
            chords: (sweep.abs() / step).ceil().clamp(1.0, ARC_CHORDS) as usize,
        })
    }

    /// The ends of the chords, without the arc's first point.
    fn points(&self) -> impl Iterator<Item = Point> + '_ {
        let (r, s) = self.radii;
        (1..=self.chords).map(move |k| {
            if k == self.chords {
                return self.to;
            }
            let t = k as f64 / self.chords as f64;
            let direction = kurbo::Vec2::from_angle(self.start_angle + self.sweep * t);
            self.centre + direction * (r + (s - r) * t)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "G21 G90\nG0 X0 Y0\nM4 S100\n";

    fn rules(text: &str) -> Vec<(usize, Rule)> {
        read(text)
            .findings
            .iter()
            .map(|f| (f.line.unwrap_or(0), f.rule))
            .collect()
    }

    #[test]
    fn modal_words_hold_until_they_change() {
        let program = read(
            "G21G90\nG0X1Y2\nM4S50\ng1 x3 f600\nY4\nG91 X-1\nG20\nX1 (one inch) S0\nM5\nG0X0\nM2\n",
        );
        assert_eq!(program.findings, []);
        let ends: Vec<_> = program
            .moves
            .iter()
            .map(|m| (m.to.x, m.to.y, m.burns()))
            .collect();
        assert_eq!(
            ends,
            [
                (1.0, 2.0, false),
                (3.0, 2.0, true),
                (3.0, 4.0, true),
                (2.0, 4.0, true),
                (27.4, 4.0, false),
                (27.4, 4.0, false),
            ]
        );
        assert_eq!(program.moves[3].feed_mm_per_min, 600.0);
    }

    #[test]
    fn arcs_stay_on_their_circle_and_go_the_right_way() {
        for (word, turn) in [
            ("G3 X0 Y10 I-10 J0", 0.25),
            ("G2 X0 Y10 I-10", 0.75),
            ("G3 X0 Y10 R10", 0.25),
            ("G2 X0 Y10 R-10", 0.75),
            ("G3 X10 Y0 I-10", 1.0),
        ] {
            let text = format!("G21G90\nG0 X10 Y0\nM4 S1\nG1 X10 F100\n{word}\nM5\n");
            let program = read(&text);
            assert_eq!(program.findings, [], "{word}");
            let arc: Vec<_> = program.moves.iter().filter(|m| m.line == 5).collect();
            let length: f64 = arc.iter().map(|m| m.from.unwrap().distance(m.to)).sum();
            let exact = std::f64::consts::TAU * 10.0 * turn;
            assert!(
                (length - exact).abs() < 1e-2,
                "{word}: {length} for {exact}"
            );
            for m in arc {
                let middle = m.from.unwrap().midpoint(m.to).to_vec2().hypot();
                assert!((10.0 - middle) < 0.0021 && (m.to.to_vec2().hypot() - 10.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn what_a_controller_refuses_is_found_with_its_line() {
        for (line, rule) in [
            ("G1 G0 X1", Rule::Syntax),
            ("G1 X1 X2", Rule::Syntax),
            ("G1 X", Rule::Syntax),
            ("G5 X1", Rule::Syntax),
            ("M99", Rule::Syntax),
            ("G1 X1 (open", Rule::Syntax),
            ("$32=0", Rule::Syntax),
            ("G1 X1 F-1", Rule::Syntax),
            ("G28 X0", Rule::Syntax),
            ("G53 G0 X0 Y0", Rule::Syntax),
            ("G2 X5 Y5", Rule::Syntax),
            ("G2 X5 Y5 I9 J9", Rule::Syntax),
            ("G4", Rule::Syntax),
            ("G1 X99999999999999999999", Rule::Syntax),
            ("G1 Xé", Rule::Syntax),
            ("G0 X1 S5", Rule::BurnOnRapid),
            ("G1 X9 F600\rX20", Rule::Syntax),
            ("G4 P0.1 X60", Rule::Syntax),
            ("G4 P0 G1", Rule::Syntax),
            ("G3 X0 Y0.000001 I-10 F600", Rule::Syntax),
        ] {
            assert_eq!(rules(&format!("{HEAD}{line}\nM5\n")), [(4, rule)], "{line}");
        }
        assert_eq!(rules("G90\nG0 X1 Y1\n"), [(2, Rule::Modes)]);
        assert_eq!(rules("G21\nG0 X1 Y1\n"), [(2, Rule::Modes)]);
        assert_eq!(rules("G21 G90\nG0 X1\n"), [(2, Rule::Modes)]);
        assert_eq!(rules("G21 G90\nX1 Y1\n"), [(2, Rule::Modes)]);
        assert_eq!(rules(HEAD), [(3, Rule::BeamAtEnd)]);
        assert_eq!(rules(&format!("{HEAD}M2\n")), [(4, Rule::BeamAtEnd)]);
        assert_eq!(
            rules(&format!("{HEAD}M3\nG4 P1\nM5\n")),
            [(5, Rule::StandingBeam)]
        );
        assert_eq!(
            rules(&format!("{HEAD}M3\nG1\nM5\n")),
            [(5, Rule::StandingBeam)]
        );
    }

    #[test]
    fn a_wait_and_a_move_in_one_line_are_both_read() {
        let program = read(&format!("{HEAD}G1 X5 F600\nG4 P0.1 X60\nM5\n"));
        assert_eq!(program.moves[2].to, Point::new(60.0, 0.0));
        assert!(program.moves[2].burns());
        // The mode of such a line holds for the lines after it.
        let program = read(&format!("{HEAD}F600\nG4 P0 G1\nX60\nM5\n"));
        assert!(program.moves[1].burns());
    }

    #[test]
    fn a_return_ends_a_line_as_for_the_controller() {
        let program = read(&format!("{HEAD}G1 X9 F600 ; right\rY20\nM5\r\n"));
        assert_eq!(program.findings.len(), 1, "{:?}", program.findings);
        assert_eq!(program.moves[2].to, Point::new(9.0, 20.0));
    }

    #[test]
    fn with_m3_any_line_without_a_target_burns_at_rest_while_a_cutting_mode_is_in_force() {
        let standing = |line: &str| rules(&format!("G21 G90\nG0 X1 Y1\nG1 X2 F600\n{line}\nM5\n"));
        for (lines, at) in [
            ("M3 S500", 4),
            ("M3 S0\nS500", 5),
            ("M3 S0\nX3 S9\nM8", 6),
            ("M3 S0\nX3 S9\nX3", 6),
            ("M3 S0\nX3 S9\nF100", 6),
        ] {
            assert_eq!(standing(lines), [(at, Rule::StandingBeam)], "{lines}");
        }
        for lines in ["M3 S0", "M4 S500\nM8", "G0\nM3 S500\nM8", "M3 S0\nX3 S9"] {
            assert_eq!(standing(lines), [], "{lines}");
        }
    }

    #[test]
    fn arcs_without_end_do_not_fill_the_memory() {
        let mut text = String::from(HEAD);
        text.push_str("F600\n");
        for _ in 0..150 {
            text.push_str("G2 X0 Y0 I1000000\n");
        }
        text.push_str("M5\n");
        let program = read(&text);
        assert_eq!(program.moves.len(), 1 + ALL_CHORDS);
        assert_eq!(
            program
                .findings
                .iter()
                .map(|f| (f.line, f.rule))
                .collect::<Vec<_>>(),
            [(Some(105), Rule::Syntax)]
        );
    }
}
