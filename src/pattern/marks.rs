//! What helps to put a sheet together, engraved into its triangles.
//!
//! *Seams*: along every run of the seam over which the lattice goes on by one motion, edges are numbered, and the two
//! triangles that meet there carry the same letter and number and an arrow to the edge: A1 meets A1. *Cones*: a ring in
//! each triangle around a cone with less than a full turn, a cross around one with more (the paper's Fig. 15). *Name* and
//! *side*: spelled along rows of triangles, a letter or a few in each.
//!
//! A mark lies in the middle part of one triangle: away from its sides, and farther from its corners than the ligaments
//! reach, so that it weakens nothing and touches no slit and no contour. Text is as large as that part allows; what would
//! be too small to read is left out.

use std::collections::{BTreeMap, BTreeSet};

use kurbo::{Point, Vec2};

use super::font;
use super::mark::{Label, Mark, MarkKind};
use super::sheet::{Sheet, flat_vertices};
use crate::base::curve::Curve;
use crate::base::ids::{Id as _, Per};
use crate::base::plane;
use crate::base::union::Union;
use crate::linkage::{Colour, Linkage, TriangleId};

/// Smaller text is not read any more, millimetres.
const SMALLEST_TEXT_MM: f64 = 0.7;

/// Larger text only takes time, millimetres.
const LARGEST_TEXT_MM: f64 = 6.0;

/// Labels along one segment of the seam: where it has more edges, every second one or fewer carry one.
const MOST_LABELS: usize = 12;

/// Letters of a sheet's name; the rest is left away.
const MOST_LETTERS: usize = 16;

/// Holes around cones have this many rings of triangles at the most; what is larger is a rim.
const MOST_RINGS: usize = 3;

/// Largest radius of a cone's ring, millimetres.
const LARGEST_RING_MM: f64 = 2.0;

/// Part of a hinge's width that stays free beside slits and contours.
const BESIDE: f64 = 0.3;

/// What stays free beside a narrow hinge's slits, millimetres: steps of a motor and the tolerance of a verdict are not
/// taken for a mark that runs into a slit.
const LEAST_BESIDE_MM: f64 = 0.1;

/// Positions that are tried for a mark on either side of a triangle's centre.
const STEPS: i32 = 24;

/// What the marks of a sheet say of it.
#[derive(Clone, Copy, Debug)]
pub struct MarkOptions<'a> {
    /// Its name; what the font does not have is left away, and nothing is written for an empty one.
    pub name: &'a str,
    /// Whether the beam strikes the back.
    pub back: bool,
}

/// A direction, and for every triangle the next one that way.
type Rows = Option<(Vec2, Vec<Option<TriangleId>>)>;

type Sides = Per<TriangleId, [Option<(TriangleId, usize)>; 3]>;

/// The marks of a sheet that was made of this linkage, in the same frame.
pub fn marks(linkage: &Linkage, sheet: &Sheet, options: &MarkOptions<'_>) -> Vec<Mark> {
    let mut marker = Marker::new(linkage, sheet);
    if marker.room_mm <= 0.0 || marker.corner_room_mm <= 0.0 {
        return Vec::new();
    }
    let all = linkage.neighbours();
    marker.seams();
    marker.cones(&all);
    let name: String = options
        .name
        .chars()
        .map(|c| c.to_ascii_uppercase())
        .filter(|c| font::can_write(&c.to_string()))
        .take(MOST_LETTERS)
        .collect();
    let parts = marker.parts();
    let rows = marker.rows();
    for (n, part) in parts.iter().enumerate() {
        // Of several parts each has a number.
        let number = if parts.len() > 1 {
            format!(" {}", n + 1)
        } else {
            String::new()
        };
        let name = format!("{}{number}", name.trim());
        marker.text(name.trim(), MarkKind::Name, part, &rows);
        let side = if options.back { "BACK" } else { "FRONT" };
        marker.text(side, MarkKind::Side, part, &rows);
    }
    marker.marks
}

/// A mark's shape around the middle of its text, for a text of height 1: points that its convex hull needs.
struct Form {
    hull: Vec<Vec2>,
}

impl Form {
    fn text(text: &str) -> Self {
        let half = 0.5 * font::width_mm(text, 1.0);
        let corners = [(-half, -0.5), (half, -0.5), (half, 0.5), (-half, 0.5)];
        Self {
            hull: corners.map(Vec2::from).to_vec(),
        }
    }

    /// With an arrow below it.
    fn with_arrow(mut self) -> Self {
        self.hull.extend(ARROW.concat().into_iter().map(Vec2::from));
        self
    }

    fn height(&self) -> (f64, f64) {
        let y = || self.hull.iter().map(|p| p.y);
        (y().fold(f64::MAX, f64::min), y().fold(f64::MIN, f64::max))
    }
}

/// Strokes of an arrow below a text of height 1.
const ARROW: [&[(f64, f64)]; 2] = [
    &[(0.0, -0.8), (0.0, -1.5)],
    &[(-0.25, -1.2), (0.0, -1.5), (0.25, -1.2)],
];

struct Marker<'a> {
    linkage: &'a Linkage,
    flat: Sides,
    /// Triangles that carry a mark.
    used: Vec<bool>,
    /// Radius of the hole in a triangle's middle.
    holes: Vec<f64>,
    /// From a triangle's middle to where a mark may reach towards its sides and its corners.
    room_mm: f64,
    corner_room_mm: f64,
    /// From the edge of a cut to where a mark may begin.
    beside_mm: f64,
    marks: Vec<Mark>,
}

impl<'a> Marker<'a> {
    fn new(linkage: &'a Linkage, sheet: &Sheet) -> Self {
        let meta = &sheet.metadata;
        // What engraves is about as wide as what cuts.
        let beside = (BESIDE * meta.hinge_width_mm).max(LEAST_BESIDE_MM) + 0.5 * meta.kerf_mm;
        // Ligaments lie within the neck; wide tips reach beyond it.
        let tip = meta.tip.radius_mm(0.0);
        let around = if tip > 0.0 { tip + beside } else { 0.0 };
        let corner = meta.neck_mm() + around.max(0.5 * meta.kerf_mm);
        let mut marker = Self {
            linkage,
            flat: linkage.flat_neighbours(),
            // Nothing is written on what a smooth rim trims.
            used: linkage.triangles.iter().map(|t| t.trim.is_some()).collect(),
            holes: vec![0.0; linkage.triangles.len()],
            room_mm: linkage.edge_mm / 12f64.sqrt() - beside - 0.5 * meta.kerf_mm,
            corner_room_mm: linkage.edge_mm / 3f64.sqrt() - corner,
            beside_mm: beside,
            marks: Vec::new(),
        };
        let round = sheet.contours.iter().filter_map(|c| {
            let circle = !c.outer && c.line.len() == 2;
            let arc = c.line.pieces().next().filter(|_| circle)?.arc()?;
            Some((arc.centre, arc.radius))
        });
        // Few, or one in each triangle beside a seam: sorted by X they are found quickly.
        let mut circles: Vec<(Point, f64)> = round.collect();
        circles.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
        if !circles.is_empty() {
            let near = 0.01 * linkage.edge_mm;
            for (t, corners) in (0..).zip(linkage.triangles.ids()) {
                let middle = marker.middle(corners);
                let from = circles.partition_point(|c| c.0.x < middle.x - near);
                let hit = circles[from..]
                    .iter()
                    .take_while(|c| c.0.x <= middle.x + near)
                    .find(|c| c.0.distance(middle) < near);
                marker.holes[t] = hit.map_or(0.0, |c| c.1);
            }
        }
        marker
    }

    fn corners(&self, t: TriangleId) -> [Point; 3] {
        self.linkage.triangles[t].flat.map(|p| Point::new(p.x, p.y))
    }

    fn middle(&self, t: TriangleId) -> Point {
        plane::centroid(&self.corners(t))
    }

    /// The largest place for a form in a triangle: the middle of its text and its height.
    fn place(&self, t: TriangleId, up: Vec2, form: &Form) -> Option<(Point, f64)> {
        let right = Vec2::new(up.y, -up.x);
        let corners = self.corners(t);
        let middle = self.middle(t);
        // Towards each side and each corner: how the way there leans, how far the form reaches, and what room there is.
        let limits: [(f64, f64, f64); 6] = std::array::from_fn(|k| {
            let side = corners[(k + 1) % 3] - corners[k % 3];
            let (out, room) = if k < 3 {
                (Vec2::new(side.y, -side.x), self.room_mm)
            } else {
                (corners[k % 3] - middle, self.corner_room_mm)
            };
            let out = out / out.hypot();
            let reach = |p: &Vec2| (right * p.x + up * p.y).dot(out);
            let reach = form.hull.iter().map(reach).fold(f64::MIN, f64::max);
            (out.dot(up), reach.max(1e-9), room)
        });
        let (low, high) = form.height();
        let hole = self.holes[t.index()];
        let keep = hole + self.beside_mm;
        let mut best: Option<(f64, f64)> = None;
        for step in -STEPS..=STEPS {
            let at = 1.5 * self.room_mm * f64::from(step) / f64::from(STEPS);
            let mut height = LARGEST_TEXT_MM;
            for (slope, reach, room) in limits {
                height = height.min((room - at * slope) / reach);
            }
            if hole > 0.0 {
                // Above the hole or below it.
                let above = (at - keep) / (-low).max(1e-9);
                let below = (-at - keep) / high.max(1e-9);
                height = height.min(above.max(below));
            }
            if height >= SMALLEST_TEXT_MM && best.is_none_or(|(_, h)| height > h + 1e-9) {
                best = Some((at, height));
            }
        }
        best.map(|(at, height)| (middle + up * at, height))
    }

    /// Labels along the seams.
    fn seams(&mut self) {
        for (n, edges) in segments(self.linkage, &self.flat).into_iter().enumerate() {
            let step = edges.len().div_ceil(MOST_LABELS);
            let last = edges.len() - 1;
            for (k, sides) in edges.iter().enumerate() {
                if k % step != 0 && k != last {
                    continue;
                }
                let text = format!("{}{}", letters(n), k + 1);
                let form = Form::text(&text).with_arrow();
                let found: Vec<_> = sides
                    .iter()
                    .filter_map(|&(t, side)| self.beside(t, side, &form))
                    .collect();
                // One without the other tells nothing.
                if let [(one, ..), (two, ..)] = found[..]
                    && one != two
                {
                    for (t, at, up, height_mm) in found {
                        self.used[t.index()] = true;
                        self.marks.push(label(&text, at, up, height_mm));
                    }
                }
            }
        }
    }

    /// A free triangle at a side, or close behind it: where a label goes there, which way is up, and how high it is.
    fn beside(
        &self,
        t: TriangleId,
        side: usize,
        form: &Form,
    ) -> Option<(TriangleId, Point, Vec2, f64)> {
        let corners = self.corners(t);
        let along = corners[(side + 1) % 3] - corners[side];
        let up = Vec2::new(-along.y, along.x) / along.hypot();
        let behind = |t: TriangleId| self.flat[t].iter().flatten().map(|n| n.0);
        let next: Vec<TriangleId> = behind(t).collect();
        let far = next.iter().flat_map(|&n| behind(n));
        let mut all = vec![t];
        all.extend(next.iter().copied());
        all.extend(far);
        all.into_iter()
            .filter(|n| !self.used[n.index()])
            .find_map(|n| {
                let (at, height) = self.place(n, up, form)?;
                Some((n, at, up, height))
            })
    }

    /// Rings and crosses around cones.
    fn cones(&mut self, all: &Sides) {
        let room = self.room_mm.min(self.corner_room_mm);
        let size = (0.6 * room).min(LARGEST_RING_MM);
        if 2.0 * size < SMALLEST_TEXT_MM {
            return;
        }
        for (count, triangles) in cones(all) {
            for t in triangles {
                if self.holes[t.index()] > 0.0 || std::mem::replace(&mut self.used[t.index()], true)
                {
                    continue;
                }
                let at = self.middle(t);
                let lines = if count < 6 {
                    vec![Curve::circle(at, size, true).opened_at(0, 0.0)]
                } else {
                    let d = Vec2::new(size, size) * 0.5f64.sqrt();
                    let e = Vec2::new(-d.y, d.x);
                    vec![Curve::line(at - d, at + d), Curve::line(at - e, at + e)]
                };
                self.marks.push(Mark {
                    kind: MarkKind::Cone,
                    lines,
                    label: None,
                });
            }
        }
    }

    /// A text along a row of triangles near the middle of the sheet, with as few letters in each as there is room for.
    fn text(&mut self, text: &str, kind: MarkKind, part: &[TriangleId], rows: &Rows) {
        let letters: Vec<char> = text.chars().collect();
        if letters.is_empty() {
            return;
        }
        let Some((along, next)) = rows else {
            return;
        };
        let up = Vec2::new(-along.y, along.x);
        let ids = || part.iter().copied();
        let sum = ids().fold(Vec2::ZERO, |s, t| s + self.middle(t).to_vec2());
        let centre = (sum / part.len() as f64).to_point();
        for share in [1, 2, 3, letters.len()] {
            let words: Vec<String> = letters.chunks(share).map(|c| c.iter().collect()).collect();
            let form = Form::text(&words[0]);
            let row = |first: TriangleId| -> Option<Vec<TriangleId>> {
                let mut row = vec![first];
                while row.len() < words.len() {
                    row.push(next[row.last()?.index()].filter(|t| self.free(*t))?);
                }
                Some(row)
            };
            let mut best: Option<(f64, Vec<TriangleId>)> = None;
            for first in ids().filter(|t| self.free(*t)) {
                let Some(row) = row(first) else { continue };
                let middle = self.middle(first).midpoint(self.middle(row[row.len() - 1]));
                let away = middle.distance(centre);
                if best.as_ref().is_none_or(|b| away < b.0 - 1e-9) {
                    best = Some((away, row));
                }
            }
            let Some((_, row)) = best else { continue };
            let places: Vec<_> = row.iter().map(|&t| self.place(t, up, &form)).collect();
            if places.iter().any(Option::is_none) {
                continue;
            }
            for ((t, word), place) in row.iter().zip(&words).zip(places) {
                self.used[t.index()] = true;
                if let Some((at, height_mm)) = place.filter(|_| !word.trim().is_empty()) {
                    let label = Label {
                        text: word.clone(),
                        at,
                        up,
                        height_mm,
                    };
                    self.marks.push(Mark {
                        kind,
                        lines: Vec::new(),
                        label: Some(label),
                    });
                }
            }
            return;
        }
    }

    /// May carry a letter: its base runs along the rows, and nothing is in it.
    fn free(&self, t: TriangleId) -> bool {
        self.linkage.triangles[t].colour == Colour::Up
            && !self.used[t.index()]
            && self.holes[t.index()] == 0.0
    }

    /// The triangles of each part of the sheet.
    fn parts(&self) -> Vec<Vec<TriangleId>> {
        let mut sets = Union::new(self.linkage.triangles.len());
        for (t, beside) in self.flat.iter_ids() {
            for (n, _) in beside.iter().flatten() {
                sets.join(t.index(), n.index());
            }
        }
        let mut parts: BTreeMap<usize, Vec<TriangleId>> = BTreeMap::new();
        for t in self.linkage.triangles.ids() {
            parts.entry(sets.root(t.index())).or_default().push(t);
        }
        parts.into_values().collect()
    }

    /// The lattice direction nearest to X, and for every triangle of one colour the next one that way.
    fn rows(&self) -> Rows {
        let up = |t: &TriangleId| self.linkage.triangles[*t].colour == Colour::Up;
        let first = self.linkage.triangles.ids().find(up)?;
        let corners = self.corners(first);
        let along = (0..3)
            .map(|k| corners[(k + 1) % 3] - corners[k])
            .max_by(|a, b| a.x.total_cmp(&b.x))?;
        let near = 1e-3 * along.hypot();
        let next = self.linkage.triangles.ids().map(|t| {
            let there = self.middle(t) + along;
            let beside = self.flat[t].iter().flatten();
            beside
                .flat_map(|n| self.flat[n.0].iter().flatten())
                .map(|n| n.0)
                .find(|&n| up(&n) && self.middle(n).distance(there) < near)
        });
        Some((along / along.hypot(), next.collect()))
    }
}

/// A label of a seam with its arrow.
fn label(text: &str, at: Point, up: Vec2, height_mm: f64) -> Mark {
    let right = Vec2::new(up.y, -up.x);
    let lines = ARROW.map(|stroke| {
        let points = stroke
            .iter()
            .map(|&(x, y)| at + (right * x + up * y) * height_mm);
        Curve::polyline(points, false)
    });
    Mark {
        kind: MarkKind::Seam,
        lines: lines.to_vec(),
        label: Some(Label {
            text: text.to_owned(),
            at,
            up,
            height_mm,
        }),
    }
}

/// A, B, …, Z, AA, AB, …
fn letters(mut n: usize) -> String {
    let mut text = String::new();
    loop {
        text.insert(0, char::from(b'A' + (n % 26) as u8));
        if n < 26 {
            return text;
        }
        n = n / 26 - 1;
    }
}

/// An edge of the seam: the triangle and the side on either hand.
type SeamEdge = [(TriangleId, usize); 2];

/// The seam's edges in runs of one motion, each in order.
fn segments(linkage: &Linkage, flat: &Sides) -> Vec<Vec<SeamEdge>> {
    let vertex = flat_vertices(&linkage.triangles, flat);
    let edges: Vec<SeamEdge> = linkage
        .hinges
        .iter()
        .filter(|h| h.seam)
        .map(|h| [h.ccw, h.cw].map(|c| (c.triangle, linkage.slit_side(c))))
        .collect();
    // A place of the seam: the two points of the sheet that meet there, and by how much the one side is turned against
    // the other. Two edges with the same place are moved alike.
    let places = |&[(a, i), (b, j)]: &SeamEdge| {
        let ends = |t: TriangleId, from: usize, to: usize| {
            let flat = &linkage.triangles[t].flat;
            flat[to % 3] - flat[from % 3]
        };
        let (d, e) = (ends(a, i, i + 1), ends(b, j + 1, j));
        let turn = (d.x * e.y - d.y * e.x).atan2(d.dot(&e)) / std::f64::consts::FRAC_PI_3;
        let turn = (turn.round() as i32).rem_euclid(6);
        [(i, j + 1), (i + 1, j)].map(|(k, l)| {
            let (p, q) = (vertex[3 * a.index() + k % 3], vertex[3 * b.index() + l % 3]);
            if p <= q {
                (p, q, turn)
            } else {
                (q, p, (6 - turn) % 6)
            }
        })
    };
    let ends: Vec<[(u32, u32, i32); 2]> = edges.iter().map(places).collect();
    let mut at: BTreeMap<(u32, u32, i32), Vec<usize>> = BTreeMap::new();
    for (n, two) in ends.iter().enumerate() {
        two.iter()
            .for_each(|place| at.entry(*place).or_default().push(n));
    }
    let mut seen = vec![false; edges.len()];
    let mut runs = Vec::new();
    let is_end = |n: &usize| ends[*n].iter().any(|p| at[p].len() != 2);
    // From their ends first; what is left after that are loops.
    let starts: Vec<usize> = (0..edges.len())
        .filter(is_end)
        .chain(0..edges.len())
        .collect();
    for start in starts {
        if seen[start] {
            continue;
        }
        let mut run = Vec::new();
        let mut here = start;
        let first = usize::from(at[&ends[start][0]].len() == 2 && at[&ends[start][1]].len() != 2);
        let mut ahead = ends[start][1 - first];
        loop {
            seen[here] = true;
            run.push(edges[here]);
            let onward = at[&ahead].iter().copied().find(|&n| n != here && !seen[n]);
            match onward.filter(|_| at[&ahead].len() == 2) {
                Some(next) => {
                    let two = ends[next];
                    ahead = if two[0] == ahead { two[1] } else { two[0] };
                    here = next;
                }
                None => break,
            }
        }
        runs.push(run);
    }
    runs
}

/// Places where the lattice does not go round in six triangles: how many make a full turn there, and the triangles around
/// the vertex, or around the hole where triangles were left out.
fn cones(all: &Sides) -> Vec<(usize, Vec<TriangleId>)> {
    let mut found = Vec::new();
    let mut seen = Per::filled(all.len(), [false; 3]);
    for start in all.ids() {
        for corner in 0..3 {
            let mut around = Vec::new();
            let mut at = (start, corner);
            while !std::mem::replace(&mut seen[at.0][at.1], true) {
                around.push(at.0);
                let Some((beyond, side)) = all[at.0][at.1] else {
                    break;
                };
                at = (beyond, (side + 1) % 3);
                if at == (start, corner) {
                    if around.len() != 6 {
                        found.push((around.len(), around));
                    }
                    break;
                }
            }
        }
    }
    // Rims: the turning of the walk with the sheet on its left, in sixths of a turn, is −6 around a plain hole.
    let mut seen = Per::filled(all.len(), [false; 3]);
    for start in all.ids() {
        for side in 0..3 {
            if all[start][side].is_some() || seen[start][side] {
                continue;
            }
            let (mut turning, mut length) = (0i64, 0usize);
            let mut around = BTreeSet::new();
            let mut at = (start, side);
            while !std::mem::replace(&mut seen[at.0][at.1], true) {
                length += 1;
                around.insert(at.0);
                let mut count = 1;
                let mut next = (at.0, (at.1 + 1) % 3);
                while let Some((beyond, side)) = all[next.0][next.1] {
                    count += 1;
                    next = (beyond, (side + 1) % 3);
                }
                turning += 3 - count;
                at = next;
            }
            let round = usize::try_from(-turning).unwrap_or(0);
            if round > 0 && round != 6 && length <= MOST_RINGS * round {
                found.push((round, around.into_iter().collect()));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Flaps, Handedness, cone_with_flaps, cylinder_with_flaps};
    use crate::machine;
    use crate::pattern::{SheetOptions, Star, Tip, placed};

    const MINE: MarkOptions<'_> = MarkOptions {
        name: "mask 1ß",
        back: false,
    };

    fn sheets() -> Vec<(Linkage, Flaps)> {
        let mut all = vec![
            cylinder_with_flaps(10.0, 7, 5),
            cylinder_with_flaps(8.0, 30, 20),
            (
                Linkage::patch(9.0, Handedness::Right, &Linkage::hexagon_cells(5)),
                Flaps::default(),
            ),
        ];
        for (size, hole) in [(4, 0), (4, 1), (4, 2), (2, 0), (8, 0), (2, 1)] {
            all.push(cone_with_flaps(9.0, size, 6, hole));
        }
        all
    }

    /// The least distance of the strokes from lines.
    fn apart(strokes: &[Curve], lines: &[Curve]) -> f64 {
        let pieces: Vec<[Point; 2]> = lines
            .iter()
            .flat_map(|l| {
                let mut points = l.flattened(1e-3);
                points.extend(l.start().filter(|_| l.closed));
                points.windows(2).map(|w| [w[0], w[1]]).collect::<Vec<_>>()
            })
            .collect();
        let to = |p: Point, [a, b]: &[Point; 2]| {
            let t = ((p - *a).dot(*b - *a) / (*b - *a).hypot2()).clamp(0.0, 1.0);
            p.distance(a.lerp(*b, t))
        };
        let points = strokes.iter().flat_map(|s| s.flattened(1e-2));
        points
            .flat_map(|p| pieces.iter().map(move |s| to(p, s)))
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn nothing_engraved_touches_a_cut_a_contour_or_a_ligament() {
        let machine = machine::load("co2-600x400").unwrap();
        let mut kinds = BTreeSet::new();
        for (linkage, flaps) in sheets() {
            for (tip, hole) in [
                (Tip::Plain, 0.0),
                (Tip::Round { radius_mm: 0.4 }, 1.0),
                (Tip::Teardrop { radius_mm: 0.3 }, 0.0),
            ] {
                let options = SheetOptions {
                    tip,
                    alignment_hole_mm: hole,
                    ..SheetOptions::plain(0.7, 0.2)
                };
                let mut sheet = Sheet::with_flaps(&linkage, &flaps, &options).unwrap();
                sheet.marks = marks(&linkage, &sheet, &MINE);
                let (mirrored, _) = placed(&sheet, &machine, true).unwrap();
                for sheet in [sheet, mirrored] {
                    let strokes: Vec<Curve> = sheet.marks.iter().flat_map(Mark::strokes).collect();
                    kinds.extend(sheet.marks.iter().map(|m| format!("{:?}", m.kind)));
                    let stars = sheet.slits.chunk_by(|a, b| a.star == b.star);
                    let slits: Vec<Curve> = stars
                        .flat_map(|s| Star::new(s, &sheet.metadata).lines().collect::<Vec<_>>())
                        .collect();
                    let contours: Vec<Curve> =
                        sheet.contours.iter().map(|c| c.line.clone()).collect();
                    let (h, k) = (sheet.metadata.hinge_width_mm, sheet.metadata.kerf_mm);
                    // Beams are half a kerf wide on either side.
                    assert!(apart(&strokes, &slits) - k >= BESIDE * h - 1e-9);
                    assert!(apart(&strokes, &contours) - 0.5 * k >= BESIDE * h - 1e-9);
                    // Ligaments lie within the neck of a lattice vertex.
                    let neck = sheet.metadata.neck_mm();
                    for p in strokes.iter().flat_map(|s| s.flattened(1e-2)) {
                        let mut vertices = sheet.triangles.iter().flatten();
                        assert!(vertices.all(|v| v.distance(p) > neck));
                    }
                }
            }
        }
        assert_eq!(kinds.len(), 4, "{kinds:?}");
    }

    #[test]
    fn every_label_stands_at_both_sides_of_its_edge() {
        for (linkage, flaps) in sheets() {
            let sheet =
                Sheet::with_flaps(&linkage, &flaps, &SheetOptions::plain(0.6, 0.1)).unwrap();
            let marks = marks(&linkage, &sheet, &MINE);
            let mut pairs: BTreeMap<String, Vec<TriangleId>> = BTreeMap::new();
            let marker = Marker::new(&linkage, &sheet);
            for mark in marks.iter().filter(|m| m.kind == MarkKind::Seam) {
                let label = mark.label.as_ref().unwrap();
                let near = |t: &TriangleId| marker.middle(*t).distance(label.at);
                let t = linkage
                    .triangles
                    .ids()
                    .min_by(|a, b| near(a).total_cmp(&near(b)));
                pairs
                    .entry(label.text.clone())
                    .or_default()
                    .push(t.unwrap());
            }
            let seam = linkage.hinges.iter().filter(|h| h.seam);
            let joined: BTreeSet<[TriangleId; 2]> = seam
                .map(|h| {
                    let (a, b) = (h.ccw.triangle, h.cw.triangle);
                    [a.min(b), a.max(b)]
                })
                .collect();
            for (text, two) in &pairs {
                assert_eq!(two.len(), 2, "{text}");
                let pair = [two[0].min(two[1]), two[0].max(two[1])];
                assert!(joined.contains(&pair), "{text}: {pair:?}");
            }
            // Each segment is lettered from end to end.
            let longest = flaps.segments.iter().map(|s| s.edges).max();
            assert_eq!(pairs.is_empty(), longest.is_none());
            let all: usize = flaps.segments.iter().map(|s| s.edges).sum();
            let letters: BTreeSet<char> = pairs.keys().filter_map(|k| k.chars().next()).collect();
            assert_eq!(letters.len(), flaps.segments.len(), "{pairs:?}");
            if longest.is_some_and(|n| n <= MOST_LABELS) {
                assert!(pairs.len() + 2 >= all, "{} of {all}", pairs.len());
            }
        }
    }

    #[test]
    fn cones_are_told_by_how_many_triangles_go_round() {
        for (size, hole) in [(4, 0), (4, 1), (4, 2), (2, 1), (8, 0), (6, 0), (6, 1)] {
            let (linkage, _) = cone_with_flaps(9.0, size, 6, hole);
            let found = cones(&linkage.neighbours());
            match size {
                6 => assert!(found.is_empty(), "{found:?}"),
                _ => {
                    assert_eq!(found.len(), 1, "{size} {hole}");
                    assert_eq!(found[0].0, size);
                    let ring = size * hole.max(1);
                    assert!(found[0].1.len() >= ring, "{size} {hole}: {found:?}");
                }
            }
        }
        let (tube, _) = cylinder_with_flaps(9.0, 12, 5);
        assert!(cones(&tube.neighbours()).is_empty());
    }

    #[test]
    fn the_name_and_the_side_are_spelled_where_there_is_room() {
        let linkage = Linkage::patch(12.0, Handedness::Right, &Linkage::hexagon_cells(5));
        let sheet = Sheet::new(&linkage, &SheetOptions::plain(0.7, 0.2)).unwrap();
        let spelled = |options: &MarkOptions<'_>, wanted: MarkKind| -> String {
            let all = marks(&linkage, &sheet, options);
            let of = all.iter().filter(|m| m.kind == wanted);
            of.filter_map(|m| Some(m.label.as_ref()?.text.clone()))
                .collect()
        };
        assert_eq!(spelled(&MINE, MarkKind::Name), "MASK1");
        assert_eq!(spelled(&MINE, MarkKind::Side), "FRONT");
        let back = MarkOptions {
            name: "",
            back: true,
        };
        assert_eq!(spelled(&back, MarkKind::Side), "BACK");
        assert_eq!(spelled(&back, MarkKind::Name), "");
        // Triangles too small for any text carry none.
        let tiny = Linkage::patch(2.2, Handedness::Right, &Linkage::hexagon_cells(5));
        let sheet = Sheet::new(&tiny, &SheetOptions::plain(0.7, 0.1)).unwrap();
        assert!(marks(&tiny, &sheet, &MINE).is_empty());
    }

    #[test]
    fn letters_go_on_after_z() {
        let names: Vec<String> = [0, 1, 25, 26, 27, 701, 702].map(letters).to_vec();
        assert_eq!(names, ["A", "B", "Z", "AA", "AB", "ZZ", "AAA"]);
    }
}
