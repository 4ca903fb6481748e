//! What remains of a sheet once a job has burnt it: the width of every ligament, and whether the part stays in one piece
//! until its rim is cut.
//!
//! Nothing here trusts the drawing's slits for what was burnt: widths are distances between burnt lines, less the kerf.
//! Connection follows from them. Two triangles beside a slit hang together at the slit's tip, by the two ligaments
//! there; as burning only ever removes material, it is enough to look once, when everything but the rims has been cut:
//! what is in one piece then was so all the time before.

use std::collections::HashMap;

use kurbo::{Point, Vec2};

use super::compare::{Kind, Wanted};
use super::coverage::{Index, Segment};
use super::verify::{Finding, Rule, TOLERANCE_MM, place};
use crate::base::plane;
use crate::base::union::Union;
use crate::base::units::short;
use crate::pattern::{Sheet, Star};

/// How much narrower than asked a ligament may be, millimetres: rounding of four ends to a micrometre.
const ROUNDING_MM: f64 = 0.003;

/// The ligaments of a sheet as burnt.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Ligaments {
    /// Slit tips that were measured; each has a ligament on either side.
    pub tips: usize,
    /// Width of the narrowest, millimetres.
    pub narrowest_mm: f64,
    /// Pieces in which the parts would fall before their rims are cut; as many as there are parts in a good job. `None`
    /// where the drawing has no triangles to tell by.
    pub pieces: Option<usize>,
}

/// Measures every ligament; narrower than the hinge width is a finding, and so is a part that falls in two.
pub(super) fn measure(
    sheet: &Sheet,
    burnt: &[(Option<usize>, Segment)],
    findings: &mut Vec<Finding>,
) -> Ligaments {
    let meta = &sheet.metadata;
    let index = Index::new(burnt.iter().map(|(_, s)| *s).collect());
    let neck = meta.neck_mm();
    let mut narrowest = f64::INFINITY;
    let mut tips = 0;
    let mut intact = Vec::with_capacity(sheet.slits.len());
    let mut near = Vec::new();
    for slits in sheet.slits.chunk_by(|a, b| a.star == b.star) {
        let star = Star::new(slits, meta);
        for (slit, arm) in slits.iter().zip(&star.arms) {
            if slit.through {
                intact.push(false);
                continue;
            }
            tips += 1;
            let points = arm.outwards().flattened(0.0005);
            let own: Vec<Segment> = points
                .windows(2)
                .map(|w| Segment { a: w[0], b: w[1] })
                .collect();
            let spot = Segment {
                a: slit.tip,
                b: slit.tip,
            };
            index.near(&spot, neck + meta.kerf_mm, &mut near);
            // Only what is near the tip: farther in, the other arms of its own star are no neighbours, nor is a rim that it
            // begins at, under 60° or more.
            let whole = slit.tip.distance(slit.tail);
            let around = meta.tip.radius_mm(meta.kerf_mm) - 0.5 * meta.kerf_mm;
            let root = (meta.hinge_width_mm + meta.kerf_mm) / 0.75f64.sqrt();
            let near_tip = neck.min((whole - root).max(around));
            let is_own = |s: &Segment| {
                [s.a, s.a.midpoint(s.b), s.b].iter().all(|p| {
                    own.iter()
                        .any(|o| distance(&Segment { a: *p, b: *p }, o) <= 2.0 * TOLERANCE_MM)
                })
            };
            let mut mine: Vec<Segment> = Vec::new();
            let mut others: Vec<Segment> = Vec::new();
            for &n in &near {
                let s = index.segment(n);
                if is_own(&s) {
                    mine.extend(clipped(&s, slit.tip, near_tip));
                } else {
                    others.push(s);
                }
            }
            let mut width = f64::INFINITY;
            for a in &mine {
                for b in &others {
                    width = width.min(distance(a, b) - meta.kerf_mm);
                }
            }
            narrowest = narrowest.min(width);
            intact.push(width > 0.0);
            if width < meta.hinge_width_mm - ROUNDING_MM {
                findings.push(Finding {
                    line: None,
                    rule: Rule::Ligament,
                    text: format!(
                        "the ligament at the slit's tip near {} is {} mm wide, {} are asked for",
                        place(slit.tip),
                        short(width.max(0.0), 3),
                        short(meta.hinge_width_mm, 3)
                    ),
                });
            }
        }
    }
    let pieces = pieces(sheet, &intact);
    let parts = sheet.contours.iter().filter(|c| c.outer).count();
    if let Some(pieces) = pieces.filter(|n| *n > parts) {
        findings.push(Finding {
            line: None,
            rule: Rule::Loose,
            text: format!(
                "{} would fall out before the rim is cut: the triangles hang together in {pieces} pieces, and the sheet has {parts}",
                if pieces - parts == 1 { "a piece".into() } else { format!("{} pieces", pieces - parts) }
            ),
        });
    }
    Ligaments {
        tips,
        narrowest_mm: if narrowest.is_finite() {
            narrowest
        } else {
            0.0
        },
        pieces,
    }
}

/// The part of a segment within a radius of a point.
fn clipped(s: &Segment, centre: Point, radius: f64) -> Option<Segment> {
    let d = s.b - s.a;
    let length = d.hypot();
    if length == 0.0 {
        return (s.a.distance(centre) <= radius).then_some(*s);
    }
    let u = d / length;
    let along = (centre - s.a).dot(u);
    let away = (centre - s.a).cross(u);
    let reach = (radius * radius - away * away).max(0.0).sqrt();
    let (from, to) = ((along - reach).max(0.0), (along + reach).min(length));
    (from <= to && away.abs() <= radius).then(|| Segment {
        a: s.at(from),
        b: s.at(to),
    })
}

/// Least distance between two segments.
pub(super) fn distance(a: &Segment, b: &Segment) -> f64 {
    let (u, v, w) = (a.b - a.a, b.b - b.a, b.a - a.a);
    let across = u.cross(v);
    if across != 0.0 {
        let (s, t) = (w.cross(v) / across, w.cross(u) / across);
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            return 0.0;
        }
    }
    let to = |p: Point, s: &Segment| plane::from_segment(p, s.a, s.b);
    to(a.a, b).min(to(a.b, b)).min(to(b.a, a)).min(to(b.b, a))
}

/// In how many pieces the triangles hang together: across an edge that no slit cuts, and at the tips that are intact.
fn pieces(sheet: &Sheet, intact: &[bool]) -> Option<usize> {
    let triangles: Vec<&[Point; 3]> = sheet.triangles.iter().chain(&sheet.flaps).collect();
    if triangles.is_empty() {
        return None;
    }
    let edge = sheet.metadata.edge_mm;
    // Middles of lattice edges are half an edge apart or more.
    let key = |p: Point| {
        let cell = 0.1 * edge;
        ((p.x / cell).round() as i64, (p.y / cell).round() as i64)
    };
    let around = |p: Point| {
        let (x, y) = key(p);
        (x - 1..=x + 1).flat_map(move |x| (y - 1..=y + 1).map(move |y| (x, y)))
    };
    let mut slits: HashMap<(i64, i64), Vec<(Point, usize)>> = HashMap::new();
    for (n, slit) in sheet.slits.iter().enumerate() {
        let d = slit.tip - slit.tail;
        // From the end that is where the lattice has it: the tail may begin at a smooth rim.
        let d = d / d.hypot();
        let middle = if slit.through {
            slit.tail + d * (0.5 * edge)
        } else {
            slit.tip + d * (sheet.metadata.neck_mm() - 0.5 * edge)
        };
        slits.entry(key(middle)).or_default().push((middle, n));
    }
    let mut sides: HashMap<(i64, i64), Vec<(Point, usize)>> = HashMap::new();
    let mut union = Union::new(triangles.len());
    let near = 0.01 * edge;
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let middle = corners[k].midpoint(corners[(k + 1) % 3]);
            let find = |map: &HashMap<(i64, i64), Vec<(Point, usize)>>| {
                around(middle)
                    .filter_map(|c| map.get(&c))
                    .flatten()
                    .find(|(p, n)| p.distance(middle) < near && *n != t)
                    .map(|(_, n)| *n)
            };
            if let Some(other) = find(&sides) {
                let slit = around(middle)
                    .filter_map(|c| slits.get(&c))
                    .flatten()
                    .find(|(p, _)| p.distance(middle) < near)
                    .map(|(_, n)| *n);
                if slit.is_none_or(|n| intact[n]) {
                    union.join(t, other);
                }
            }
            sides.entry(key(middle)).or_default().push((middle, t));
        }
    }
    let mut roots: Vec<usize> = (0..triangles.len()).map(|t| union.root(t)).collect();
    roots.sort_unstable();
    roots.dedup();
    Some(roots.len())
}

/// Every pierce hole keeps away from ligaments and, in scrap, from what stays. In the middle of an arm it widens the slit,
/// which is where it may be.
pub(super) fn check_pierces(
    sheet: &Sheet,
    outside: &Outside<'_>,
    starts: &[(Option<usize>, Point)],
    pierce_mm: f64,
    findings: &mut Vec<Finding>,
) {
    let meta = &sheet.metadata;
    let neck = meta.neck_mm();
    let turned = |d: Vec2, angle: f64| {
        let (sin, cos) = angle.sin_cos();
        Vec2::new(cos * d.x - sin * d.y, sin * d.x + cos * d.y)
    };
    // From every tip to where the ligament meets the arms beside it: half a neck from the vertex.
    let mut spans = Vec::with_capacity(2 * sheet.slits.len());
    let mut slits = Vec::with_capacity(sheet.slits.len());
    for slit in &sheet.slits {
        slits.push(Segment {
            a: slit.tail,
            b: slit.tip,
        });
        if slit.through {
            continue;
        }
        let d = slit.tip - slit.tail;
        let Some(d) = (d.hypot() > 0.0).then(|| d / d.hypot()) else {
            continue;
        };
        let vertex = slit.tip + d * neck;
        for side in [-1.0, 1.0] {
            let arm = turned(-d, side * std::f64::consts::FRAC_PI_3);
            spans.push(Segment {
                a: slit.tip,
                b: vertex + arm * (0.5 * neck),
            });
        }
    }
    let (spans, slits) = (Index::new(spans), Index::new(slits));
    let half = 0.5 * pierce_mm;
    let mut near = Vec::new();
    for &(line, at) in starts {
        let spot = Segment { a: at, b: at };
        slits.near(&spot, TOLERANCE_MM, &mut near);
        let on_slit = near
            .iter()
            .any(|n| distance(&spot, &slits.segment(*n)) <= 2.0 * TOLERANCE_MM);
        let room = if on_slit {
            spans.near(&spot, half, &mut near);
            near.iter()
                .map(|n| distance(&spot, &spans.segment(*n)))
                .fold(f64::INFINITY, f64::min)
        } else {
            outside.clearance(at, half)
        };
        if room < half - TOLERANCE_MM {
            let what = if on_slit { "a ligament" } else { "what stays" };
            findings.push(Finding {
                line,
                rule: Rule::Pierce,
                text: format!(
                    "the pierce at {} makes a hole of {} mm, and {what} is {} mm from its middle",
                    place(at),
                    short(pierce_mm, 3),
                    short(room, 3)
                ),
            });
        }
    }
}

/// No rim is begun before everything inside it is done.
pub(super) fn check_order(
    sheet: &Sheet,
    wanted: &Wanted,
    burnt: &[(Option<usize>, Segment)],
    findings: &mut Vec<Finding>,
) {
    // For each cut when it is first and last burnt, as numbers of burnt pieces.
    let mut when: Vec<Option<(usize, usize)>> = vec![None; wanted.cuts.len()];
    let mut near = Vec::new();
    for (n, (_, segment)) in burnt.iter().enumerate() {
        let middle = segment.a.midpoint(segment.b);
        for cut in wanted.at(middle, &mut near) {
            when[cut] = Some(when[cut].map_or((n, n), |(first, _)| (first, n)));
        }
    }
    let rims: Vec<usize> = (0..wanted.cuts.len())
        .filter(|c| wanted.cuts[*c].kind == Kind::Rim)
        .collect();
    let only_one = sheet.contours.iter().filter(|c| c.outer).count() == 1;
    for (c, cut) in wanted
        .cuts
        .iter()
        .enumerate()
        .filter(|(_, c)| c.kind != Kind::Rim)
    {
        let Some((_, last)) = when[c] else { continue };
        let at = wanted.segments[cut.range.start].a;
        let early = rims.iter().find(|r| {
            let inside = || {
                let of = wanted.cuts[**r].contour.and_then(|n| sheet.contours.get(n));
                of.is_some_and(|contour| {
                    only_one || plane::encloses(&contour.line.flattened(0.01), at)
                })
            };
            when[**r].is_some_and(|(first, _)| first < last) && inside()
        });
        if let Some(rim) = early {
            let first = when[*rim].map_or(0, |w| w.0);
            findings.push(Finding {
                line: burnt.get(first).and_then(|b| b.0),
                rule: Rule::Order,
                text: format!(
                    "the rim is begun before the cut near {} is done: the part may be loose by then",
                    place(at)
                ),
            });
            // One is enough: a rim that comes first is before everything.
            return;
        }
    }
}

/// Everything outside what stays: where leads may burn.
pub(super) struct Outside<'a> {
    edges: Index,
    /// The same edges by height, for counting crossings.
    rows: HashMap<i64, Vec<u32>>,
    row_mm: f64,
    wanted: &'a Index,
    half_mm: f64,
}

impl<'a> Outside<'a> {
    pub fn new(sheet: &Sheet, wanted: &'a Wanted) -> Self {
        let mut edges = Vec::new();
        for contour in &sheet.contours {
            let points = contour.line.flattened(0.0005);
            let n = points.len();
            edges.extend((0..n).map(|i| Segment {
                a: points[i],
                b: points[(i + 1) % n],
            }));
        }
        let row_mm = sheet.metadata.edge_mm;
        let mut rows: HashMap<i64, Vec<u32>> = HashMap::new();
        for (n, e) in edges.iter().enumerate() {
            let (low, high) = (e.a.y.min(e.b.y), e.a.y.max(e.b.y));
            for row in (low / row_mm).floor() as i64..=(high / row_mm).floor() as i64 {
                rows.entry(row).or_default().push(n as u32);
            }
        }
        Self {
            edges: Index::new(edges),
            rows,
            row_mm,
            wanted: &wanted.index,
            half_mm: 0.5 * sheet.metadata.kerf_mm,
        }
    }

    /// Whether a burnt piece touches nothing that stays but what is burnt anyway: the last half kerf before the line
    /// that it leads to.
    pub fn is_scrap(&self, piece: &Segment) -> bool {
        let mut near = Vec::new();
        let reach = self.half_mm - TOLERANCE_MM;
        // Steps of a tenth of a kerf: no edge comes nearer than the tolerance between two of them.
        let steps = (piece.length() / (0.2 * self.half_mm))
            .ceil()
            .clamp(1.0, 100_000.0) as usize;
        (0..=steps).all(|k| {
            let p = piece.a.lerp(piece.b, k as f64 / steps as f64);
            let spot = Segment { a: p, b: p };
            self.wanted.near(&spot, self.half_mm, &mut near);
            let burnt_anyway = near
                .iter()
                .any(|n| distance(&spot, &self.wanted.segment(*n)) <= self.half_mm);
            if burnt_anyway {
                return true;
            }
            self.edges.near(&spot, self.half_mm, &mut near);
            let clear = near
                .iter()
                .all(|n| distance(&spot, &self.edges.segment(*n)) >= reach);
            clear && !self.inside(p)
        })
    }

    /// Distance from a point to what stays, up to `limit`; 0 inside it.
    fn clearance(&self, p: Point, limit: f64) -> f64 {
        if self.inside(p) {
            return 0.0;
        }
        let mut near = Vec::new();
        let spot = Segment { a: p, b: p };
        self.edges.near(&spot, limit, &mut near);
        near.iter()
            .map(|n| distance(&spot, &self.edges.segment(*n)))
            .fold(f64::INFINITY, f64::min)
    }

    fn inside(&self, p: Point) -> bool {
        let row = (p.y / self.row_mm).floor() as i64;
        let crossed = self.rows.get(&row).into_iter().flatten().filter(|n| {
            let e = self.edges.segment(**n);
            plane::crosses(e.a, e.b, p)
        });
        crossed.count() % 2 == 1
    }
}
