//! The verdict on a job: what it burns is what the sheet wants, and nothing else.

use std::fmt;

use kurbo::Point;

use super::coverage::{Index, Pieces, Segment};
use super::interpret::{Program, read};
use super::write::passes_of;
use crate::base::units::short;
use crate::machine::{Machine, PowerMode};
use crate::pattern::Sheet;
use crate::toolpath::{ToolpathError, outline};

/// How far a burnt line may be from a wanted one and still be it, millimetres. Rounding to three decimals takes 0.0007.
pub const TOLERANCE_MM: f64 = 0.01;

/// Gaps below this are rounding, millimetres.
const NO_GAP_MM: f64 = 1e-6;

/// Where two strokes meet at an angle, a short piece lies within the tolerance of both: up to 2τ at 30° and more.
const JOINT_MM: f64 = 2.0 * TOLERANCE_MM;

/// Rounding of coordinates may go over the bed's edge by this much, millimetres.
const EDGE_MM: f64 = 0.001;

/// What a job must do or not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// The controller would refuse the line, or nobody can say what it does.
    Syntax,
    /// No line longer than the controller's limit.
    LineTooLong,
    /// Unit, distance mode and position are known before the first motion.
    Modes,
    /// The head stays on the bed.
    OffBed,
    /// No rapid arms the beam.
    BurnOnRapid,
    /// The beam is never on at rest.
    StandingBeam,
    /// M3 only where the machine's profile accepts it.
    ConstantPower,
    /// Every burning move has a feed above 0 and within the machine's rates.
    Feed,
    /// Power within the machine's scale.
    Power,
    /// The beam is switched off before the end.
    BeamAtEnd,
    /// Every wanted cut is made, as often as wanted.
    Missing,
    /// No wanted cut is made more often.
    Repeated,
    /// Nothing else is burnt.
    Stray,
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Finding {
    /// Line of the G-code, counted from 1, where one can be named.
    pub line: Option<usize>,
    /// The rule that is broken.
    pub rule: Rule,
    /// What, where, in words.
    pub text: String,
}

impl Finding {
    pub(super) fn at(line: usize, rule: Rule, text: String) -> Self {
        Self {
            line: Some(line),
            rule,
            text,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "line {line}: {}", self.text),
            None => f.write_str(&self.text),
        }
    }
}

/// The outcome of [`verify`].
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// Everything that is wrong, by line; empty means the job is good.
    pub findings: Vec<Finding>,
    /// Length burnt, millimetres.
    pub burnt_mm: f64,
    /// Length of rapids, millimetres.
    pub travel_mm: f64,
    /// How often each cut must be gone over, as given or as the header says; `None` without a sheet.
    pub passes: Option<u32>,
    /// Whether the burnt lines were compared with a sheet.
    pub compared: bool,
}

impl Verdict {
    /// Whether nothing is wrong.
    pub fn passed(&self) -> bool {
        self.findings.is_empty()
    }
}

/// Judges a job for a machine and, if there is one, against the sheet that it must cut.
///
/// `passes`: how often each cut must be gone over; `None` takes the number from the job's header ([`passes_of`]), and
/// without one demands a single pass.
///
/// # Tolerance
/// A burnt line is a wanted one within [`TOLERANCE_MM`]. Coverage is exact, by intervals and not by samples; the time
/// grows with the number of segments times its logarithm.
///
/// # Errors
/// [`ToolpathError`] if the sheet itself cannot be cut with its kerf.
pub fn verify(
    text: &str,
    machine: &Machine,
    sheet: Option<&Sheet>,
    passes: Option<u32>,
) -> Result<Verdict, ToolpathError> {
    let program = read(text);
    let mut findings = program.findings.clone();
    check_lines(text, machine, &mut findings);
    check_moves(&program, machine, &mut findings);
    let length = |rapid: bool| -> f64 {
        program
            .moves
            .iter()
            .filter(|m| if rapid { m.rapid } else { m.burns() })
            .filter_map(|m| m.from.map(|f| f.distance(m.to)))
            .sum()
    };
    let burnt_mm = length(false);
    let mut found_passes = None;
    if let Some(sheet) = sheet {
        let wanted = Wanted::new(sheet)?;
        let n = passes.or_else(|| passes_of(text)).unwrap_or(1);
        found_passes = Some(n);
        let burnt: Vec<(Option<usize>, Segment)> = program
            .moves
            .iter()
            .filter(|m| m.burns())
            .map(|m| {
                (
                    Some(m.line),
                    Segment {
                        a: m.from.unwrap_or(m.to),
                        b: m.to,
                    },
                )
            })
            .collect();
        compare(&burnt, &wanted, n, NO_GAP_MM, &mut findings);
    }
    findings.sort_by_key(|f| f.line.unwrap_or(usize::MAX));
    Ok(Verdict {
        findings,
        burnt_mm,
        travel_mm: length(true),
        passes: found_passes,
        compared: sheet.is_some(),
    })
}

fn check_lines(text: &str, machine: &Machine, findings: &mut Vec<Finding>) {
    let limit = machine.line_limit();
    for (i, line) in text.lines().enumerate() {
        if line.len() > limit {
            findings.push(Finding::at(
                i + 1,
                Rule::LineTooLong,
                format!(
                    "the line has {} characters, and the controller takes {limit}",
                    line.len()
                ),
            ));
        }
        // These act at once, wherever they stand: feed hold, resume, status, reset.
        if let Some(c) = line.chars().find(|c| "!~?\u{18}".contains(*c)) {
            findings.push(Finding::at(
                i + 1,
                Rule::Syntax,
                format!("the character {c:?} is a real-time command, also in a comment"),
            ));
        }
        // So do most bytes above 0x7F, of which every other character consists. Returns are judged by the reader.
        else if let Some(c) = line.chars().find(|c| !matches!(c, ' '..='~' | '\t' | '\r')) {
            findings.push(Finding::at(
                i + 1,
                Rule::Syntax,
                format!("the character {c:?} is not ASCII text: its bytes may be real-time commands, also in a comment"),
            ));
        }
    }
}

fn check_moves(program: &Program, machine: &Machine, findings: &mut Vec<Finding>) {
    let reach = machine.reach();
    let fastest = machine
        .motion
        .rate_mm_per_min
        .x
        .max(machine.motion.rate_mm_per_min.y);
    if machine
        .laser()
        .is_some_and(|l| l.power_mode == PowerMode::Dynamic)
    {
        for &line in &program.constant_power {
            findings.push(Finding::at(
                line,
                Rule::ConstantPower,
                "M3 keeps the beam on if the link is lost; this machine's profile allows M4 only"
                    .into(),
            ));
        }
    }
    // One finding a line and rule: chords of an arc would repeat it.
    let mut last: Option<(usize, Rule)> = None;
    let mut say = |line: usize, rule: Rule, text: String| {
        if last != Some((line, rule)) {
            findings.push(Finding::at(line, rule, text));
            last = Some((line, rule));
        }
    };
    for m in &program.moves {
        if !reach.contains([m.to.x, m.to.y], EDGE_MM) {
            say(
                m.line,
                Rule::OffBed,
                format!(
                    "the head goes to {}, off the bed (x {} to {}, y {} to {} mm)",
                    place(m.to),
                    short(reach.min[0], 3),
                    short(reach.max[0], 3),
                    short(reach.min[1], 3),
                    short(reach.max[1], 3)
                ),
            );
        }
        if !m.rapid && m.feed_mm_per_min <= 0.0 {
            say(m.line, Rule::Feed, "a cut without a feed (F)".into());
        }
        if !m.burns() {
            continue;
        }
        if m.from.is_none() {
            say(
                m.line,
                Rule::Modes,
                "the beam burns from a place that nobody named".into(),
            );
        }
        if m.feed_mm_per_min > fastest {
            say(
                m.line,
                Rule::Feed,
                format!(
                    "the feed is {} mm/min, and the machine moves at {} at the most",
                    short(m.feed_mm_per_min, 3),
                    short(fastest, 3)
                ),
            );
        }
        if let Some(laser) = machine.laser().filter(|l| m.power > l.s_max) {
            say(
                m.line,
                Rule::Power,
                format!(
                    "S{} is above the machine's full power, S{}",
                    short(m.power, 3),
                    short(laser.s_max, 3)
                ),
            );
        }
    }
}

/// What a sheet wants burnt.
struct Wanted {
    segments: Vec<Segment>,
    /// For each cut its name and its segments.
    cuts: Vec<(&'static str, std::ops::Range<usize>)>,
}

impl Wanted {
    fn new(sheet: &Sheet) -> Result<Self, ToolpathError> {
        let mut wanted = Self {
            segments: Vec::with_capacity(sheet.slits.len()),
            cuts: Vec::with_capacity(sheet.slits.len()),
        };
        for slit in &sheet.slits {
            let at = wanted.segments.len();
            wanted.segments.push(Segment {
                a: slit.tail,
                b: slit.tip,
            });
            wanted.cuts.push(("the slit", at..at + 1));
        }
        for contour in &sheet.contours {
            let at = wanted.segments.len();
            let line = outline(contour, sheet.metadata.kerf_mm)?;
            for i in 0..line.len() {
                wanted.segments.push(Segment {
                    a: line[i],
                    b: line[(i + 1) % line.len()],
                });
            }
            let name = if contour.outer { "the rim" } else { "the hole" };
            wanted.cuts.push((name, at..wanted.segments.len()));
        }
        Ok(wanted)
    }
}

/// A stretch of a cut that is burnt too seldom or too often, as distances along the whole cut.
#[derive(Clone, Copy)]
struct Stretch {
    from: f64,
    to: f64,
    /// How often it is burnt where that is worst.
    count: i32,
    /// A place on it.
    at: Point,
    /// It goes round a corner of the cut.
    corner: bool,
}

impl Stretch {
    /// Both as one; `next` begins where `self` ends.
    fn joined(self, next: Self, worst: fn(i32, i32) -> i32) -> Self {
        Self {
            from: self.from,
            to: next.to,
            count: worst(self.count, next.count),
            at: self.at,
            corner: true,
        }
    }
}

/// The stretches of one cut: those that meet at a corner are one, because what is missing there is missing in one piece,
/// however short the segments of a rounded corner are.
struct Stretches {
    all: Vec<Stretch>,
    worst: fn(i32, i32) -> i32,
}

impl Stretches {
    fn new(worst: fn(i32, i32) -> i32) -> Self {
        Self {
            all: Vec::new(),
            worst,
        }
    }

    /// Notes the next stretch: `run` of a segment that begins `before` mm after the cut's first point.
    fn note(&mut self, segment: &Segment, before: f64, run: (f64, f64), count: i32) {
        let new = Stretch {
            from: before + run.0,
            to: before + run.1,
            count,
            at: segment.at(0.5 * (run.0 + run.1)),
            corner: false,
        };
        match self.all.last_mut() {
            Some(last) if new.from - last.to <= NO_GAP_MM => *last = last.joined(new, self.worst),
            _ => self.all.push(new),
        }
    }

    /// The cut is a closed line of this length: what ends at its end goes on at its beginning.
    fn close(&mut self, whole: f64) {
        if let [first, .., last] = self.all.as_mut_slice()
            && first.from <= NO_GAP_MM
            && whole - last.to <= NO_GAP_MM
        {
            let mut tail = *last;
            tail.from -= whole;
            *first = tail.joined(*first, self.worst);
            self.all.pop();
        }
    }

    /// Total length, worst count and first place of the stretches longer than `least` says, and empties the list.
    fn take(&mut self, least: impl Fn(&Stretch) -> f64) -> Option<(f64, i32, Point)> {
        let mut found: Option<(f64, i32, Point)> = None;
        for stretch in self.all.drain(..) {
            let length = stretch.to - stretch.from;
            if length > least(&stretch) {
                let entry = found.get_or_insert((0.0, stretch.count, stretch.at));
                entry.0 += length;
                entry.1 = (self.worst)(entry.1, stretch.count);
            }
        }
        found
    }
}

/// Judges what a machine has really burnt, as straight pieces in the sheet's frame, against the sheet: every cut as
/// often as wanted but for gaps up to `gap_mm`, and nothing else. Findings carry no line.
///
/// # Tolerance
/// Sideways [`TOLERANCE_MM`]. `gap_mm`, measured along the cut and round its corners, is for what a controller does at the ends of a stroke, where it switches the
/// beam off a little before it stands.
///
/// # Errors
/// [`ToolpathError`] if the sheet itself cannot be cut with its kerf.
pub fn compare_burnt(
    sheet: &Sheet,
    burnt: &[[Point; 2]],
    passes: u32,
    gap_mm: f64,
) -> Result<Vec<Finding>, ToolpathError> {
    let burnt: Vec<(Option<usize>, Segment)> = burnt
        .iter()
        .map(|&[a, b]| (None, Segment { a, b }))
        .collect();
    let mut findings = Vec::new();
    compare(&burnt, &Wanted::new(sheet)?, passes, gap_mm, &mut findings);
    Ok(findings)
}

/// Compares burnt pieces, with their lines where there are lines, with what is wanted.
fn compare(
    burnt: &[(Option<usize>, Segment)],
    wanted: &Wanted,
    passes: u32,
    gap_mm: f64,
    findings: &mut Vec<Finding>,
) {
    let passes = passes as i32;
    let burnt_index = Index::new(burnt.iter().map(|(_, s)| *s).collect());
    let mut pieces = Pieces::default();
    let mut missing = Stretches::new(i32::min);
    let mut repeated = Stretches::new(i32::max);
    for (name, range) in &wanted.cuts {
        let mut whole = 0.0;
        for segment in &wanted.segments[range.clone()] {
            burnt_index.along(segment, TOLERANCE_MM, &mut pieces);
            let length = segment.length();
            pieces.runs(
                true,
                length,
                0.0,
                |n| n < passes,
                |run, n| missing.note(segment, whole, run, n),
            );
            pieces.runs(
                false,
                length,
                0.0,
                |n| n > passes,
                |run, n| repeated.note(segment, whole, run, n),
            );
            whole += length;
        }
        // A slit is one segment; every other cut is closed.
        if range.len() > 1 {
            missing.close(whole);
            repeated.close(whole);
        }
        let missing = missing.take(|_| gap_mm);
        // At a corner each of its two sides may lie within the tolerance of the other.
        let repeated = repeated.take(|s| if s.corner { 2.0 * JOINT_MM } else { JOINT_MM });
        let ends = (
            wanted.segments[range.start].a,
            wanted.segments[range.end - 1].b,
        );
        let describe = |found: (f64, i32, Point)| {
            format!(
                "{name} from {} to {} is cut {} over {} of its {} mm, near {}",
                place(ends.0),
                place(ends.1),
                times(found.1),
                short(found.0, 3),
                short(whole, 3),
                place(found.2)
            )
        };
        if let Some(found) = missing {
            findings.push(Finding {
                line: None,
                rule: Rule::Missing,
                text: format!("{} instead of {}", describe(found), times(passes)),
            });
        }
        if let Some(found) = repeated {
            findings.push(Finding {
                line: None,
                rule: Rule::Repeated,
                text: format!("{} instead of {}", describe(found), times(passes)),
            });
        }
    }
    let wanted_index = Index::new(wanted.segments.clone());
    for (line, segment) in burnt {
        wanted_index.along(segment, TOLERANCE_MM, &mut pieces);
        let length = segment.length();
        let mut stray: Option<(f64, Point)> = None;
        if length <= NO_GAP_MM {
            if pieces.capped.is_empty() {
                stray = Some((0.0, segment.a));
            }
        } else {
            pieces.runs(
                true,
                length,
                NO_GAP_MM,
                |n| n < 1,
                |run, _| {
                    let middle = segment.at(0.5 * (run.0 + run.1));
                    stray.get_or_insert((0.0, middle)).0 += run.1 - run.0;
                },
            );
        }
        if let Some((length, at)) = stray {
            findings.push(Finding {
                line: *line,
                rule: Rule::Stray,
                text: format!(
                    "{} mm are burnt where the sheet has no cut, near {}",
                    short(length, 3),
                    place(at)
                ),
            });
        }
    }
}

fn times(n: i32) -> String {
    match n {
        0 => "not at all".into(),
        1 => "once".into(),
        2 => "twice".into(),
        n => format!("{n} times"),
    }
}

fn place(p: Point) -> String {
    format!("({}, {})", short(p.x, 3), short(p.y, 3))
}
