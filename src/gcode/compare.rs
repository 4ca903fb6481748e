//! Burnt pieces against what a sheet wants cut: every line as often as asked, nothing else, in an order that keeps the
//! part in one piece.

use std::ops::Range;

use kurbo::Point;

use super::coverage::{Index, Pieces, Segment, distance};
use super::finding::{Finding, Rule, TOLERANCE_MM, place};
use super::write::Declared;
use crate::base::curve::Curve;
use crate::base::units::short;
use crate::pattern::{Sheet, Star};
use crate::toolpath::{ToolpathError, outline, tabs_by_outline, without_tabs};

/// Gaps below this are rounding, millimetres.
pub(super) const NO_GAP_MM: f64 = 1e-6;

/// Where two strokes meet at an angle, a short piece lies within the tolerance of both: up to 2τ at 30° and more.
pub(super) const JOINT_MM: f64 = 2.0 * TOLERANCE_MM;

/// Wanted arcs as chords: much finer than the tolerance.
const CHORD_MM: f64 = 0.0005;

/// What burnt lines may differ by from wanted ones, millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slack {
    /// Across the line.
    pub sideways_mm: f64,
    /// Along it, where the beam is off a little before it stands.
    pub gap_mm: f64,
}

/// What a line of a sheet is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Mark,
    Slit,
    Hole,
    Rim,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Mark => "the mark",
            Self::Slit => "the slit",
            Self::Hole => "the hole",
            Self::Rim => "the rim",
        }
    }
}

/// A line that must be burnt.
pub(super) struct WantedCut {
    pub kind: Kind,
    /// Its segments.
    pub range: Range<usize>,
    /// Whether it ends where it begins.
    closed: bool,
    /// How long a stretch may be burnt once more than wanted, millimetres: at tangential joints, and for overcut.
    slack_mm: f64,
    /// Index of the contour, for a rim.
    pub contour: Option<usize>,
}

/// What a sheet wants burnt.
pub(super) struct Wanted {
    pub segments: Vec<Segment>,
    pub cuts: Vec<WantedCut>,
    /// The segments by place.
    pub index: Index,
    /// For each segment the cut that it belongs to.
    owners: Vec<u32>,
}

impl Wanted {
    /// The lines of a sheet, for a job that declares this of itself.
    pub fn new(sheet: &Sheet, declared: &Declared) -> Result<Self, ToolpathError> {
        let mut wanted = Self {
            segments: Vec::with_capacity(sheet.slits.len()),
            cuts: Vec::with_capacity(sheet.slits.len()),
            index: Index::new(Vec::new()),
            owners: Vec::new(),
        };
        let kerf = sheet.metadata.kerf_mm;
        for slits in sheet.slits.chunk_by(|a, b| a.star == b.star) {
            let star = Star::new(slits, &sheet.metadata);
            let tangential = if star.fillets.is_empty() {
                0.0
            } else {
                // Two arcs of radius R that touch stay within τ of each other for √(τR).
                3.0 * (TOLERANCE_MM * (sheet.metadata.corner_radius_mm + 0.5 * kerf)).sqrt()
            };
            // Where a slit widens, its sides leave it at 30° or 90°.
            let widening = if star.arms.iter().any(|a| a.tip.is_some()) {
                2.0 * JOINT_MM
            } else {
                0.0
            };
            for line in star.lines() {
                wanted.add(Kind::Slit, &line, tangential.max(widening), None);
            }
        }
        // Leads meet contours at a slant, and those to slits on the rim cross it.
        let leads = if declared.leads { 4.0 * JOINT_MM } else { 0.0 };
        let outlines = sheet.contours.iter().map(|c| outline(c, kerf));
        let outlines = outlines.collect::<Result<Vec<Curve>, _>>()?;
        let tabs = tabs_by_outline(&outlines, &sheet.tabs);
        for (n, contour) in sheet.contours.iter().enumerate() {
            let kind = if contour.outer { Kind::Rim } else { Kind::Hole };
            let closed = &outlines[n];
            let stretches = without_tabs(&closed.opened_at(0, 0.0), &tabs[n], kerf);
            if stretches.is_empty() {
                wanted.add(kind, closed, declared.overcut_mm + leads, Some(n));
            }
            for stretch in stretches {
                wanted.add(kind, &stretch, leads, Some(n));
            }
        }
        if declared.marks {
            wanted.add_marks(sheet);
        }
        wanted.index = Index::new(wanted.segments.clone());
        Ok(wanted)
    }

    /// Adds what is engraved.
    fn add_marks(&mut self, sheet: &Sheet) {
        for line in sheet.marks.iter().flat_map(|m| m.strokes()) {
            // Strokes of a letter meet at sharp angles.
            self.add(Kind::Mark, &line, 4.0 * JOINT_MM, None);
        }
    }

    fn add(&mut self, kind: Kind, line: &Curve, slack_mm: f64, contour: Option<usize>) {
        let points = line.flattened(CHORD_MM);
        let n = points.len();
        let first = self.segments.len();
        let count = if line.closed { n } else { n.saturating_sub(1) };
        for i in 0..count {
            self.segments.push(Segment {
                a: points[i],
                b: points[(i + 1) % n],
            });
        }
        if self.segments.len() > first {
            let number = self.cuts.len() as u32;
            self.owners.resize(self.segments.len(), number);
            self.cuts.push(WantedCut {
                kind,
                range: first..self.segments.len(),
                closed: line.closed || (n > 2 && points[0].distance(points[n - 1]) < NO_GAP_MM),
                slack_mm,
                contour,
            });
        }
    }

    /// The cuts that pass a point within the tolerance, one of several segments as often. `near` is scratch.
    pub fn at<'a>(&'a self, p: Point, near: &'a mut Vec<u32>) -> impl Iterator<Item = usize> + 'a {
        self.around(p, near).map(|(cut, _)| cut)
    }

    /// The cut that passes a point most closely, if one passes within the tolerance. `near` is scratch.
    pub fn closest(&self, p: Point, near: &mut Vec<u32>) -> Option<usize> {
        let all = self.around(p, near);
        all.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(cut, _)| cut)
    }

    /// The cuts that pass a point within the tolerance, and how far off.
    fn around<'a>(
        &'a self,
        p: Point,
        near: &'a mut Vec<u32>,
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let spot = Segment { a: p, b: p };
        self.index.near(&spot, TOLERANCE_MM, near);
        near.iter()
            .map(move |n| {
                let cut = self.owners[*n as usize] as usize;
                (cut, distance(&spot, &self.index.segment(*n)))
            })
            .filter(|(_, off)| *off <= TOLERANCE_MM)
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

/// Compares burnt pieces, with their lines where there are lines, with what is wanted.
///
/// `scrap` says whether a burnt piece that no line wants touches nothing that stays.
pub(super) fn compare(
    burnt: &[(Option<usize>, Segment)],
    wanted: &Wanted,
    passes: u32,
    slack: Slack,
    scrap: &dyn Fn(&Segment) -> bool,
    findings: &mut Vec<Finding>,
) {
    let asked = passes as i32;
    let burnt_index = Index::new(burnt.iter().map(|(_, s)| *s).collect());
    let mut pieces = Pieces::default();
    let mut missing = Stretches::new(i32::min);
    let mut repeated = Stretches::new(i32::max);
    for cut in &wanted.cuts {
        let passes = if cut.kind == Kind::Mark { 1 } else { asked };
        let range = &cut.range;
        let mut whole = 0.0;
        for segment in &wanted.segments[range.clone()] {
            burnt_index.along(segment, slack.sideways_mm, &mut pieces);
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
        if cut.closed {
            missing.close(whole);
            repeated.close(whole);
        }
        let missing = missing.take(|_| slack.gap_mm);
        // At a corner each of its two sides may lie within the tolerance of the other. Where a machine's steps add to the
        // tolerance, the ends of such a stretch are as uncertain.
        let steps_mm = (slack.sideways_mm - TOLERANCE_MM).max(0.0);
        let wider = 1.0 + steps_mm / TOLERANCE_MM;
        let repeated = repeated.take(|s| {
            let joint = if s.corner { 2.0 * JOINT_MM } else { JOINT_MM };
            wider * joint + steps_mm + cut.slack_mm
        });
        let ends = (
            wanted.segments[range.start].a,
            wanted.segments[range.end - 1].b,
        );
        let describe = |found: (f64, i32, Point)| {
            format!(
                "{} from {} to {} is cut {} over {} of its {} mm, near {}",
                cut.kind.name(),
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
    for (line, segment) in burnt {
        wanted.index.along(segment, slack.sideways_mm, &mut pieces);
        let length = segment.length();
        let mut stray: Option<(f64, Point)> = None;
        if length <= NO_GAP_MM {
            if pieces.capped.is_empty() && !scrap(segment) {
                stray = Some((0.0, segment.a));
            }
        } else {
            pieces.runs(
                true,
                length,
                NO_GAP_MM,
                |n| n < 1,
                |run, _| {
                    let piece = Segment {
                        a: segment.at(run.0),
                        b: segment.at(run.1),
                    };
                    if scrap(&piece) {
                        return;
                    }
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
