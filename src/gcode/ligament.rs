//! What remains of a sheet once a job has burnt it: the width of every ligament, and whether the part stays in one piece
//! until its rim is cut.
//!
//! Nothing here trusts the drawing's slits for what was burnt: widths are distances between burnt lines, less the kerf.
//! Connection follows from them. Two triangles beside a slit hang together at the slit's tip, by the two ligaments
//! there; as burning only ever removes material, it is enough to look once, when everything but the rims has been cut:
//! what is in one piece then was so all the time before.

use std::collections::HashMap;

use kurbo::Point;

use super::coverage::{Index, Segment, distance};
use super::finding::{Finding, Rule, TOLERANCE_MM, place};
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
