//! The verdict on a job: what it burns is what the sheet wants, and nothing else.

use kurbo::Point;

use super::compare::{Kind, NO_GAP_MM, Slack, Wanted, compare};
use super::coverage::Segment;
use super::finding::{Finding, Rule, TOLERANCE_MM, place};
use super::interpret::{Beam, Dialect, Program, read_as};
use super::ligament::{Ligaments, measure};
use super::outside::Outside;
use super::pierce::check_pierces;
use super::rim_last::check_order;
use super::write::{Declared, material_of, passes_of};
use crate::base::units::short;
use crate::machine::{Machine, PowerMode};
use crate::pattern::Sheet;
use crate::toolpath::ToolpathError;

/// Rounding of coordinates may go over the bed's edge by this much, millimetres.
const EDGE_MM: f64 = 0.001;

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
    /// The ligaments as burnt; `None` without a sheet.
    pub ligaments: Option<Ligaments>,
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
    let program = read_as(text, Dialect::of(machine));
    let mut findings = program.findings.clone();
    check_lines(text, machine, &mut findings);
    check_moves(&program, machine, &mut findings);
    check_materials(&program, text, machine, &mut findings);
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
    let mut ligaments = None;
    if let Some(sheet) = sheet {
        let declared = Declared::of(text);
        let wanted = Wanted::new(sheet, &declared)?;
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
        let wide = declared.pierce_mm > sheet.metadata.kerf_mm;
        let outside = (declared.leads || wide).then(|| Outside::new(sheet, &wanted));
        let scrap =
            |piece: &Segment| declared.leads && outside.as_ref().is_some_and(|o| o.is_scrap(piece));
        let exact = Slack {
            sideways_mm: TOLERANCE_MM,
            gap_mm: NO_GAP_MM,
        };
        compare(&burnt, &wanted, n, exact, &scrap, &mut findings);
        check_order(sheet, &wanted, &burnt, &mut findings);
        let scribed = program.moves.iter().any(|m| m.beam == Beam::Scribe);
        let engraved = if declared.marks || scribed {
            engraved(&program, &wanted, &mut findings)
        } else {
            vec![false; burnt.len()]
        };
        if let Some(outside) = outside.as_ref().filter(|_| wide) {
            let starts = pierces(&program, &engraved);
            check_pierces(sheet, outside, &starts, declared.pierce_mm, &mut findings);
        }
        let cuts = if declared.marks || scribed {
            burnt
                .into_iter()
                .zip(engraved)
                .filter(|(_, mark)| !mark)
                .map(|(b, _)| b)
                .collect()
        } else {
            burnt
        };
        ligaments = Some(measure(sheet, &cuts, &mut findings));
    }
    findings.sort_by_key(|f| f.line.unwrap_or(usize::MAX));
    Ok(Verdict {
        findings,
        burnt_mm,
        travel_mm: length(true),
        passes: found_passes,
        compared: sheet.is_some(),
        ligaments,
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
        // A file may hold any remark.
        if !machine.controller.is_streamed() {
            continue;
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

/// A number in the table's list is only a number: heights, current and feed are whatever stands there. The profile knows
/// which material it is, and the job's header which one is meant.
fn check_materials(program: &Program, text: &str, machine: &Machine, findings: &mut Vec<Finding>) {
    let Some(torch) = machine.plasma() else {
        return;
    };
    let numbers = &torch.material_numbers;
    let meant = material_of(text);
    for &(line, number) in &program.materials {
        let right = meant.and_then(|name| numbers.get(name));
        if right == Some(&number) || (right.is_none() && numbers.is_empty()) {
            continue;
        }
        let is = numbers.iter().find(|(_, n)| **n == number);
        let is = is.map_or(
            "none that the machine's profile names".into(),
            |(name, _)| format!("`{name}`"),
        );
        let text = match (meant, right) {
            (Some(name), Some(right)) => format!(
                "material {number} of the table is {is}; `{name}`, for which the job was made, is {right} there"
            ),
            (Some(name), None) => format!(
                "material {number} of the table is {is}, and the job was made for `{name}` (plasma.material_numbers)"
            ),
            (None, _) if numbers.values().any(|n| *n == number) => continue,
            (None, _) => {
                format!("material {number} of the table is {is} (plasma.material_numbers)")
            }
        };
        findings.push(Finding::at(line, Rule::Material, text));
    }
}

/// Where the beam goes on to cut; `engraved` says of each burning move whether it marks.
fn pierces(program: &Program, engraved: &[bool]) -> Vec<(Option<usize>, Point)> {
    // A torch pierces wherever it is switched on, also where the cut before it ended.
    if !program.pierces.is_empty() {
        let all = program.pierces.iter();
        return all.map(|&(line, at)| (Some(line), at)).collect();
    }
    let mut starts = Vec::new();
    let mut burning = false;
    let mut marks = engraved.iter();
    for m in &program.moves {
        let mark = m.burns() && marks.next().copied().unwrap_or(false);
        if m.burns() && !burning && !mark {
            starts.extend(m.from.map(|from| (Some(m.line), from)));
        }
        burning = m.burns();
    }
    starts
}

/// For each burning move whether it engraves a mark. A mark that gets as much energy a millimetre as the gentlest cut is a
/// finding: it would go through.
fn engraved(program: &Program, wanted: &Wanted, findings: &mut Vec<Finding>) -> Vec<bool> {
    let mut near = Vec::new();
    let mut of_mark = |m: &super::Move| {
        let from = m.from.unwrap_or(m.to);
        let middle = from.midpoint(m.to);
        let cuts = wanted.at(middle, &mut near);
        let mut kinds = cuts.map(|c| wanted.cuts[c].kind).peekable();
        kinds.peek().is_some() && kinds.all(|k| k == Kind::Mark)
    };
    let burns: Vec<_> = program.moves.iter().filter(|m| m.burns()).collect();
    let marks: Vec<bool> = burns.iter().map(|m| of_mark(m)).collect();
    let energy = |m: &super::Move| m.power / m.feed_mm_per_min.max(f64::MIN_POSITIVE);
    let cuts = burns
        .iter()
        .zip(&marks)
        .filter(|(m, mark)| !**mark && m.beam != Beam::Scribe);
    let gentlest = cuts.map(|(m, _)| energy(m)).fold(f64::INFINITY, f64::min);
    if let Some((m, _)) = burns
        .iter()
        .zip(&marks)
        .find(|(m, mark)| **mark && energy(m) >= gentlest)
    {
        findings.push(Finding::at(
            m.line,
            Rule::Engraving,
            format!(
                "the mark near {} gets as much power a millimetre as a cut: it would go through",
                place(m.to)
            ),
        ));
    }
    if let Some((m, _)) = burns
        .iter()
        .zip(&marks)
        .find(|(m, mark)| !**mark && m.beam == Beam::Scribe)
    {
        findings.push(Finding::at(
            m.line,
            Rule::Engraving,
            format!(
                "the scribe goes to {}, where the sheet has no mark",
                place(m.to)
            ),
        ));
    }
    marks
}

/// Judges what a machine has really burnt, as straight pieces in the sheet's frame, against the sheet: every cut as
/// often as wanted but for gaps up to `gap_mm`, and nothing else. Findings carry no line.
///
/// # Tolerance
/// What `slack` says: gaps are measured along the cut and round its corners.
///
/// # Errors
/// [`ToolpathError`] if the sheet itself cannot be cut with its kerf.
pub fn compare_burnt(
    sheet: &Sheet,
    burnt: &[[Point; 2]],
    passes: u32,
    declared: &Declared,
    slack: Slack,
) -> Result<Vec<Finding>, ToolpathError> {
    let burnt: Vec<(Option<usize>, Segment)> = burnt
        .iter()
        .map(|&[a, b]| (None, Segment { a, b }))
        .collect();
    let mut findings = Vec::new();
    let wanted = Wanted::new(sheet, declared)?;
    let outside = declared.leads.then(|| Outside::new(sheet, &wanted));
    let scrap = |piece: &Segment| outside.as_ref().is_some_and(|o| o.is_scrap(piece));
    compare(&burnt, &wanted, passes, slack, &scrap, &mut findings);
    Ok(findings)
}
