//! Cuts in their order, and what they amount to.

use kurbo::Point;

use super::order::{Heat, Way, order_strokes};
use super::scrap::{Scrap, Side};
use super::{kerf, star};
use crate::base::curve::{Curve, Piece};
use crate::machine::Machine;
use crate::material::{CutSetting, MarkSetting, PassOrder};
use crate::pattern::{Contour, Sheet, Star, Tab};

/// What a cut is for; also the order in which cuts are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Engraved: text and arrows, before anything can move.
    Mark,
    /// One stroke of a star of slits.
    Slit,
    /// A hole.
    Inner,
    /// The rim of a part: last, because afterwards the part is loose.
    Outer,
}

impl Role {
    /// What is cut, in words.
    pub fn word(self) -> &'static str {
        match self {
            Self::Mark => "marks",
            Self::Slit => "slits",
            Self::Inner => "holes",
            Self::Outer => "rim",
        }
    }
}

/// One stroke of the beam.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// From the pierce to where the line begins, through scrap.
    pub lead_in: Option<Curve>,
    /// Where the middle of the beam runs, sheet frame, millimetres: an open curve. Around a whole contour it ends where
    /// it begins.
    pub line: Curve,
    /// From where the line ends: overcut along its beginning, and the way out.
    pub lead_out: Option<Curve>,
    /// What it is for.
    pub role: Role,
    /// Per cent of the machine's full power.
    pub power_percent: f64,
    /// Speed, millimetres per minute.
    pub feed_mm_per_min: f64,
    /// How often the line is gone over: an open one to and fro, a closed one round and round.
    pub passes: u32,
    /// Stretches of the line that are cut more slowly, as distances from its start, millimetres: in order, apart.
    pub slow_mm: Vec<(f64, f64)>,
    /// Speed along them, per cent of the cut's own.
    pub slow_percent: f64,
    /// Speed along everything else, leads included, per cent of the cut's own.
    pub percent: f64,
    /// The torch is held off along the way out, and the head goes on: nothing is burnt there.
    pub off_on_way_out: bool,
}

/// A piece of a cut with the speed along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Where the middle of the beam runs.
    pub piece: Piece,
    /// Per cent of the cut's speed.
    pub speed_percent: f64,
    /// The torch is held off: nothing is burnt.
    pub off: bool,
}

impl Cut {
    /// Whether its line ends where it begins.
    pub fn is_closed(&self) -> bool {
        match (self.line.start(), self.line.end()) {
            (Some(a), Some(b)) => self.line.len() > 1 && a.distance(b) < CLOSED_MM,
            _ => false,
        }
    }

    /// Length of one pass of the line, millimetres.
    pub fn length_mm(&self) -> f64 {
        self.line.length()
    }

    /// Where the beam goes on.
    pub fn start(&self) -> Option<Point> {
        let first = self.lead_in.as_ref().unwrap_or(&self.line);
        first.start()
    }

    /// Where the beam is when all is done.
    pub fn end(&self) -> Option<Point> {
        if let Some(out) = &self.lead_out {
            return out.end();
        }
        if self.passes.is_multiple_of(2) && !self.is_closed() {
            self.line.start()
        } else {
            self.line.end()
        }
    }

    /// The whole way of the head, in order: the way in, every pass, the way out.
    pub fn steps(&self) -> Vec<Step> {
        let step = |piece, off| Step {
            piece,
            speed_percent: self.percent,
            off,
        };
        let there = self.slowed();
        let back: Vec<Step> = if self.passes > 1 && !self.is_closed() {
            there
                .iter()
                .rev()
                .map(|s| Step {
                    piece: s.piece.reversed(),
                    ..*s
                })
                .collect()
        } else {
            Vec::new()
        };
        let mut steps = Vec::with_capacity(there.len() * self.passes as usize + 2);
        let ways_in = self.lead_in.iter().flat_map(Curve::pieces);
        steps.extend(ways_in.map(|piece| step(piece, false)));
        for pass in 0..self.passes {
            let turned = pass % 2 == 1 && !self.is_closed();
            steps.extend_from_slice(if turned { &back } else { &there });
        }
        let ways_out = self.lead_out.iter().flat_map(Curve::pieces);
        steps.extend(ways_out.map(|piece| step(piece, self.off_on_way_out)));
        steps
    }

    /// The line's pieces, divided where the speed changes.
    fn slowed(&self) -> Vec<Step> {
        let mut steps = Vec::with_capacity(self.line.len() + 2 * self.slow_mm.len());
        let mut before = 0.0;
        for piece in self.line.pieces() {
            let length = piece.length();
            let mut at = 0.0;
            let mut push = |to: f64, speed_percent: f64| {
                if to - at > SHORTEST_STEP_MM || (to >= length && to > at) {
                    let piece = piece.between(at / length, to / length);
                    steps.push(Step {
                        piece,
                        speed_percent,
                        off: false,
                    });
                    at = to;
                }
            };
            for &(from, to) in &self.slow_mm {
                let (from, to) = (
                    (from - before).clamp(0.0, length),
                    (to - before).clamp(0.0, length),
                );
                if to > from {
                    push(from, self.percent);
                    push(to, self.slow_percent);
                }
            }
            push(length, self.percent);
            before += length;
        }
        steps
    }

    /// Length of everything that is burnt, millimetres.
    pub fn burnt_mm(&self) -> f64 {
        let out = self.lead_out.as_ref().filter(|_| !self.off_on_way_out);
        let ways = [self.lead_in.as_ref(), out];
        let leads: f64 = ways.into_iter().flatten().map(Curve::length).sum();
        self.length_mm() * f64::from(self.passes) + leads
    }
}

/// Ends of a closed line may differ by rounding, millimetres.
const CLOSED_MM: f64 = 1e-6;

/// A change of speed closer than this to the end of a piece is moved there, millimetres.
const SHORTEST_STEP_MM: f64 = 0.05;

/// All cuts of a sheet, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Toolpath {
    /// The cuts.
    pub cuts: Vec<Cut>,
    /// Where the head is before the first, millimetres.
    pub start: Point,
    /// How often each cut is gone over, all passes of all rounds together.
    pub passes: u32,
    /// Diameter of the pierce hole where it is wider than the kerf, millimetres.
    pub pierce_mm: Option<f64>,
    /// How far contours are cut beyond their start, millimetres.
    pub overcut_mm: f64,
}

/// What a toolpath amounts to.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Strokes of the beam; each begins with a pierce.
    pub strokes: usize,
    /// Length burnt, all passes and leads, millimetres.
    pub cut_length_mm: f64,
    /// Length engraved, millimetres.
    pub mark_length_mm: f64,
    /// Length travelled with the beam off, from the start to the last cut, millimetres.
    pub travel_mm: f64,
}

/// Why a sheet has no toolpath.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ToolpathError {
    /// The beam does not fit into a hole or a slot.
    #[error(
        "near ({x:.3}, {y:.3}) mm the contour leaves a gap narrower than the kerf of {kerf_mm} mm: the beam does not fit. Use larger triangles, or a finer kerf (--kerf)"
    )]
    NarrowSlot {
        /// Where, millimetres on the sheet.
        x: f64,
        /// Where, millimetres on the sheet.
        y: f64,
        /// The kerf.
        kerf_mm: f64,
    },
    /// The pierce hole touches a ligament or what stays.
    #[error(
        "near ({x:.3}, {y:.3}) mm the pierce hole of {pierce_mm} mm has no room: {room_mm:.3} mm are free of ligaments. Use larger triangles (--edge, or fewer --triangles), or a finer process"
    )]
    NoRoomToPierce {
        /// Where, millimetres on the sheet.
        x: f64,
        /// Where, millimetres on the sheet.
        y: f64,
        /// Diameter of the hole.
        pierce_mm: f64,
        /// What there is.
        room_mm: f64,
    },
}

impl Toolpath {
    /// Lengths and counts.
    pub fn figures(&self) -> Figures {
        let mut at = self.start;
        let mut travel_mm = 0.0;
        let (mut cut_length_mm, mut mark_length_mm) = (0.0, 0.0);
        for cut in &self.cuts {
            if let (Some(first), Some(end)) = (cut.start(), cut.end()) {
                travel_mm += at.distance(first);
                at = end;
            }
            match cut.role {
                Role::Mark => mark_length_mm += cut.burnt_mm(),
                _ => cut_length_mm += cut.burnt_mm(),
            }
        }
        Figures {
            strokes: self.cuts.len(),
            cut_length_mm,
            mark_length_mm,
            travel_mm,
        }
    }
}

/// Where a torch must slow down, because it leans in corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerSlowdown {
    /// Turns by more than this, radians.
    pub angle: f64,
    /// From this far before the corner to this far behind it, millimetres.
    pub distance_mm: f64,
    /// Per cent of the cut's speed.
    pub percent: f64,
}

/// How a torch cuts small holes: slowly, with the part on its right, and held off before the head stops. An arc leans
/// back and swirls: fast or the other way round a small hole comes out conical, and where it stops, with a notch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmallHoles {
    /// Holes that nowhere measure more than this across, millimetres.
    pub below_mm: f64,
    /// Per cent of the cut's speed.
    pub percent: f64,
    /// How far the head goes on past the hole's beginning, the torch held off, millimetres.
    pub overcut_mm: f64,
}

/// How cuts are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutOptions {
    /// Speed along a cut, millimetres per minute.
    pub feed_mm_per_min: f64,
    /// Power, per cent of the machine's.
    pub power_percent: f64,
    /// How often each cut is gone over.
    pub passes: u32,
    /// And in which order.
    pub pass_order: PassOrder,
    /// Diameter of the hole that a pierce leaves, millimetres; no wider than the kerf for most lasers.
    pub pierce_mm: f64,
    /// Length of the way into a contour, millimetres.
    pub lead_in_mm: f64,
    /// Length of the way out of it.
    pub lead_out_mm: f64,
    /// How far a contour is cut beyond its start.
    pub overcut_mm: f64,
    /// Slower corners.
    pub corner: Option<CornerSlowdown>,
    /// Small holes; like large ones if there is nothing here. Only for a torch that the job can hold off in motion.
    pub small_holes: Option<SmallHoles>,
    /// What it costs to cut close to the cuts just made.
    pub heat: Heat,
    /// Speed (mm/min) and power (per cent) for marks; without them none are engraved.
    pub engrave: Option<(f64, f64)>,
}

impl CutOptions {
    /// As the profiles say; marks are engraved if there are settings for them.
    pub fn of(setting: &CutSetting, machine: &Machine, marks: Option<&MarkSetting>) -> Self {
        let corner = machine.plasma().and_then(|torch| torch.corner);
        let small_hole = machine.plasma().and_then(|torch| torch.small_hole);
        Self {
            feed_mm_per_min: setting.speed_mm_per_min,
            power_percent: setting.power_percent,
            passes: setting.passes.max(1),
            pass_order: setting.pass_order,
            pierce_mm: setting.pierce_diameter_mm,
            lead_in_mm: setting.lead_in_mm,
            lead_out_mm: setting.lead_out_mm,
            overcut_mm: setting.overcut_mm,
            corner: corner.map(|c| CornerSlowdown {
                angle: c.angle_deg.to_radians(),
                distance_mm: c.distance_mm,
                percent: c.percent,
            }),
            small_holes: small_hole.map(|h| SmallHoles {
                below_mm: h.below_mm,
                percent: h.percent,
                overcut_mm: h.overcut_mm,
            }),
            heat: Heat::NONE,
            engrave: marks.map(|m| (m.speed_mm_per_min, m.power_percent)),
        }
    }
}

/// The cuts of a sheet with these options, for a head that starts at `start` (millimetres, frame of the sheet).
///
/// The kerf is the sheet's own: its slits were drawn for it.
///
/// # Errors
/// [`ToolpathError`].
pub fn plan(
    sheet: &Sheet,
    options: &CutOptions,
    start: [f64; 2],
) -> Result<Toolpath, ToolpathError> {
    let start = Point::new(start[0], start[1]);
    let kerf_mm = sheet.metadata.kerf_mm;
    let pierce_mm = (options.pierce_mm > kerf_mm).then_some(options.pierce_mm);
    let scrap = Scrap::new(sheet);
    let mut planner = Planner {
        options,
        cuts: Vec::with_capacity(sheet.slits.len() + sheet.contours.len()),
        at: start,
    };
    planner.marks(sheet);
    planner.slits(sheet, &scrap, pierce_mm)?;
    let outlines = sheet.contours.iter().map(|c| kerf::outline(c, kerf_mm));
    let outlines = outlines.collect::<Result<Vec<Curve>, _>>()?;
    let tabs = kerf::tabs_by_outline(&outlines, &sheet.tabs);
    let mut closed = Vec::with_capacity(outlines.len());
    for ((contour, outline), tabs) in sheet.contours.iter().zip(outlines).zip(tabs) {
        closed.push(Closed {
            contour,
            outline,
            tabs,
        });
    }
    let (rims, holes) = closed.into_iter().partition(|c| c.contour.outer);
    planner.contours(holes, &scrap, kerf_mm, Role::Inner)?;
    planner.contours(rims, &scrap, kerf_mm, Role::Outer)?;
    Ok(Toolpath {
        cuts: planner.cuts,
        start,
        passes: options.passes,
        pierce_mm,
        overcut_mm: options.overcut_mm,
    })
}

/// A contour, where the beam runs around it, and the tabs on that.
struct Closed<'a> {
    contour: &'a Contour,
    outline: Curve,
    tabs: Vec<Tab>,
}

struct Planner<'a> {
    options: &'a CutOptions,
    cuts: Vec<Cut>,
    at: Point,
}

impl Planner<'_> {
    fn push(&mut self, role: Role, line: Curve, passes: u32) {
        let cut = Cut {
            lead_in: None,
            slow_mm: self.slow(&line),
            line,
            lead_out: None,
            role,
            power_percent: self.options.power_percent,
            feed_mm_per_min: self.options.feed_mm_per_min,
            passes,
            slow_percent: self.options.corner.map_or(100.0, |c| c.percent),
            percent: 100.0,
            off_on_way_out: false,
        };
        self.at = cut.end().unwrap_or(self.at);
        self.cuts.push(cut);
    }

    /// Gives the last cut its ways in and out.
    fn lead(&mut self, lead_in: Option<Curve>, lead_out: Option<Curve>) {
        if let Some(cut) = self.cuts.last_mut() {
            cut.lead_in = lead_in;
            cut.lead_out = lead_out;
            self.at = cut.end().unwrap_or(self.at);
        }
    }

    /// Around the corners of a line.
    fn slow(&self, line: &Curve) -> Vec<(f64, f64)> {
        let Some(corner) = self.options.corner else {
            return Vec::new();
        };
        let whole = line.length();
        let mut found: Vec<(f64, f64)> = Vec::new();
        let mut add = |from: f64, to: f64| {
            let (from, to) = (
                (from - corner.distance_mm).max(0.0),
                (to + corner.distance_mm).min(whole),
            );
            match found.last_mut() {
                Some(last) if last.1 >= from => last.1 = last.1.max(to),
                _ => found.push((from, to)),
            }
        };
        let mut at = 0.0;
        let mut before: Option<Piece> = None;
        for piece in line.pieces() {
            if let Some(before) = before {
                let (u, v) = (before.direction(1.0), piece.direction(0.0));
                if u.cross(v).atan2(u.dot(v)).abs() > corner.angle {
                    add(at, at);
                }
            }
            let length = piece.length();
            // The rounding of a corner is a corner.
            if let Some(arc) = piece.arc()
                && arc.radius < corner.distance_mm
                && arc.sweep.abs() > corner.angle
            {
                add(at, at + length);
            }
            at += length;
            before = Some(piece);
        }
        found
    }

    fn marks(&mut self, sheet: &Sheet) {
        let Some((feed_mm_per_min, power_percent)) = self.options.engrave else {
            return;
        };
        let lines: Vec<Curve> = sheet.marks.iter().flat_map(|m| m.strokes()).collect();
        for (line, reversed) in ordered(&lines, self.at, false, None, Heat::NONE) {
            let line = if reversed {
                lines[line].reversed()
            } else {
                lines[line].clone()
            };
            self.push(Role::Mark, line, 1);
            if let Some(cut) = self.cuts.last_mut() {
                cut.feed_mm_per_min = feed_mm_per_min;
                cut.power_percent = power_percent;
                cut.slow_mm.clear();
            }
        }
    }

    fn slits(
        &mut self,
        sheet: &Sheet,
        scrap: &Scrap,
        pierce_mm: Option<f64>,
    ) -> Result<(), ToolpathError> {
        let mut lines = Vec::with_capacity(sheet.slits.len());
        // Parts of a line that are its way in, where it has one.
        let mut ways: Vec<Option<Curve>> = Vec::new();
        for slits in sheet.slits.chunk_by(|a, b| a.star == b.star) {
            let star = Star::new(slits, &sheet.metadata);
            if pierce_mm.is_some()
                && let Some(way) = self.way_from_rim(&star, scrap, sheet.metadata.kerf_mm)
            {
                ways.push(Some(way.0));
                lines.push(way.1);
                for arm in star.arms.iter().skip(1) {
                    let one = Star {
                        arms: vec![arm.clone()],
                        ..star.clone()
                    };
                    let more = star::strokes(&one, pierce_mm)?;
                    ways.resize(ways.len() + more.len(), None);
                    lines.extend(more);
                }
                continue;
            }
            let strokes = star::strokes(&star, pierce_mm)?;
            ways.resize(ways.len() + strokes.len(), None);
            lines.extend(strokes);
        }
        let (rounds, passes) = match self.options.pass_order {
            PassOrder::Cut => (1, self.options.passes),
            PassOrder::Sheet => (self.options.passes, 1),
        };
        let returns = passes.is_multiple_of(2);
        for _ in 0..rounds {
            for (n, reversed) in ordered(&lines, self.at, returns, pierce_mm, self.options.heat) {
                let line = if reversed {
                    lines[n].reversed()
                } else {
                    lines[n].clone()
                };
                self.push(Role::Slit, line, passes);
                if let Some(cut) = self.cuts.last_mut() {
                    cut.lead_in = ways[n].clone();
                }
            }
        }
        Ok(())
    }

    /// For a star on the rim whose first arm can be entered from scrap: the way in, and the arm.
    fn way_from_rim(&self, star: &Star, scrap: &Scrap, kerf_mm: f64) -> Option<(Curve, Curve)> {
        if !star.fillets.is_empty() {
            return None;
        }
        let arm = star.arms.first()?;
        let way = scrap.way_to_rim(star.centre, -arm.direction, self.options, kerf_mm)?;
        Some((way, arm.outwards()))
    }

    fn contours(
        &mut self,
        mut left: Vec<Closed<'_>>,
        scrap: &Scrap,
        kerf_mm: f64,
        role: Role,
    ) -> Result<(), ToolpathError> {
        while let Some(next) = nearest(left.iter().map(|c| &c.outline), self.at) {
            let Closed {
                contour,
                outline,
                tabs,
            } = left.swap_remove(next);
            if role == Role::Inner
                && let Some(small) = self.options.small_holes
                && across_is_below(&contour.line, small.below_mm)
                && kerf::without_tabs(&outline.opened_at(0, 0.0), &tabs, kerf_mm).is_empty()
            {
                self.small_hole(contour, &outline, small, scrap, kerf_mm)?;
                continue;
            }
            let ways = scrap.enter(
                contour,
                &outline,
                self.options,
                kerf_mm,
                self.at,
                Side::Right,
            )?;
            let stretches = kerf::without_tabs(&ways.line, &tabs, kerf_mm);
            if stretches.is_empty() {
                self.push(role, ways.line, self.options.passes);
                self.lead(ways.lead_in, ways.lead_out);
            }
            for stretch in stretches {
                let (way_in, stretch) = scrap.way_in(stretch, self.options, kerf_mm)?;
                self.push(role, stretch, self.options.passes);
                self.lead(way_in, None);
            }
        }
        Ok(())
    }

    /// A small hole: the other way round than `outline`, so that the part is on the right, and past its beginning with
    /// the torch held off.
    fn small_hole(
        &mut self,
        contour: &Contour,
        outline: &Curve,
        small: SmallHoles,
        scrap: &Scrap,
        kerf_mm: f64,
    ) -> Result<(), ToolpathError> {
        let options = CutOptions {
            overcut_mm: small.overcut_mm,
            lead_out_mm: 0.0,
            ..*self.options
        };
        let ways = scrap.enter(
            contour,
            &outline.reversed(),
            &options,
            kerf_mm,
            self.at,
            Side::Left,
        )?;
        self.push(Role::Inner, ways.line, self.options.passes);
        self.lead(ways.lead_in, ways.lead_out);
        if let Some(cut) = self.cuts.last_mut() {
            cut.percent = small.percent;
            cut.off_on_way_out = true;
            if cut.slow_percent >= small.percent {
                cut.slow_mm.clear();
            }
        }
        Ok(())
    }
}

/// Whether no two points of a closed line are farther apart than `limit_mm`.
fn across_is_below(line: &Curve, limit_mm: f64) -> bool {
    let points = line.flattened(kerf::CHORD_ERROR_MM);
    // Almost all that is larger is so along an axis.
    let [mut low, mut high] = [points.first().copied().unwrap_or_default(); 2];
    for p in &points {
        low = Point::new(low.x.min(p.x), low.y.min(p.y));
        high = Point::new(high.x.max(p.x), high.y.max(p.y));
    }
    if (high.x - low.x).max(high.y - low.y) > limit_mm {
        return false;
    }
    let all = points.iter().enumerate();
    all.flat_map(|(i, a)| points[..i].iter().map(|b| a.distance(*b)))
        .all(|d| d <= limit_mm)
}

/// The line with the point nearest to the head; none of none.
fn nearest<'a>(lines: impl Iterator<Item = &'a Curve>, head: Point) -> Option<usize> {
    let far = |line: &Curve| {
        let all = line.vertices.iter().map(|v| v.at.distance_squared(head));
        all.fold(f64::INFINITY, f64::min)
    };
    let found = lines
        .map(far)
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1));
    found.map(|(n, _)| n)
}

/// Lines in an order of short travel, each with whether it is reversed. A line with a wide pierce is not: it begins there.
fn ordered(
    lines: &[Curve],
    head: Point,
    returns: bool,
    pierce_mm: Option<f64>,
    heat: Heat,
) -> Vec<(usize, bool)> {
    let pierced = pierce_mm.is_some();
    let ends: Vec<[Point; 2]> = lines
        .iter()
        .map(|line| {
            let (a, b) = (line.start().unwrap_or(head), line.end().unwrap_or(head));
            if pierced && returns { [a, a] } else { [a, b] }
        })
        .collect();
    let way = match (pierced, returns) {
        (true, _) => Way::Forwards,
        (false, true) => Way::Back,
        (false, false) => Way::Either,
    };
    order_strokes(&ends, head, way, heat)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage};
    use crate::pattern::SheetOptions;

    fn options(passes: u32) -> CutOptions {
        let machine = crate::machine::load(crate::machine::DEFAULT).unwrap();
        let material = crate::material::load("leather-1.6").unwrap();
        let setting = material.cut_for(&machine).unwrap();
        CutOptions {
            passes,
            ..CutOptions::of(&setting, &machine, None)
        }
    }

    fn ring() -> Sheet {
        let mut cells = Linkage::hexagon_cells(5);
        cells.retain(|c| !Linkage::hexagon_cells(1).contains(c));
        let linkage = Linkage::patch(10.0, Handedness::Right, &cells);
        Sheet::new(&linkage, &SheetOptions::plain(1.0, 0.2)).unwrap()
    }

    #[test]
    fn slits_come_before_holes_and_holes_before_rims_and_nothing_is_lost() {
        let sheet = ring();
        for passes in [1, 2, 3] {
            let path = plan(&sheet, &options(passes), [0.0, 0.0]).unwrap();
            assert!(path.cuts.is_sorted_by_key(|c| c.role));
            let length = |role| {
                path.cuts
                    .iter()
                    .filter(|c| c.role == role)
                    .map(Cut::length_mm)
                    .sum::<f64>()
            };
            assert!((length(Role::Slit) - sheet.figures().slit_length_mm).abs() < 1e-9);
            assert_eq!(
                path.cuts.iter().filter(|c| c.role == Role::Inner).count(),
                1
            );
            let rim = path.cuts.last().unwrap();
            assert!(rim.role == Role::Outer && rim.is_closed());
            let burnt: f64 = path
                .cuts
                .iter()
                .map(|c| {
                    let steps = c.steps();
                    assert_eq!(steps.last().map(|s| s.piece.to), c.end());
                    assert!(
                        steps
                            .windows(2)
                            .all(|w| w[0].piece.to.distance(w[1].piece.from) < 1e-6)
                    );
                    steps.iter().map(|s| s.piece.length()).sum::<f64>()
                })
                .sum();
            assert!((burnt - path.figures().cut_length_mm).abs() < 1e-6);
        }
    }

    #[test]
    fn a_star_of_three_is_two_strokes() {
        let sheet = ring();
        let mut sizes = vec![0usize; sheet.figures().stars];
        for slit in &sheet.slits {
            sizes[slit.star as usize] += 1;
        }
        let path = plan(&sheet, &options(1), [0.0, 0.0]).unwrap();
        let strokes = path.cuts.iter().filter(|c| c.role == Role::Slit).count();
        assert_eq!(strokes, sizes.iter().map(|n| n.div_ceil(2)).sum::<usize>());
    }
}
