//! Scrap: everywhere outside the finished part, where a pierce may splash and a lead may run.
//!
//! A contour is entered from the side that falls away. The *lead-in* starts at the pierce, far enough out that its hole
//! touches nothing that stays, and meets the outline at a slant in the direction of the cut; the *lead-out* leaves it
//! the same way. Both start from the middle of a straight piece, so that no corner is marked.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_6};

use kurbo::{Point, Vec2};
use rstar::primitives::{GeomWithData, Line};
use rstar::{AABB, RTree};

use super::kerf::CHORD_ERROR_MM;
use super::path::{CutOptions, ToolpathError};
use crate::base::curve::{Curve, Piece, Vertex};
use crate::base::plane;
use crate::pattern::{Contour, Sheet};

/// Angles between a lead and the cut that are tried, radians: a slant leaves the least mark, straight on needs the least
/// room along the rim.
const SLANTS: [f64; 4] = [1.05, FRAC_PI_2, 0.7, 2.1];

/// Kept between a pierce hole and the finished part, millimetres.
const CLEAR_MM: f64 = 0.05;

/// A point no farther from an edge lies on it, millimetres: drawings have four decimals.
const ON_RIM_MM: f64 = 1e-3;

/// Angles from the outward direction that are tried for a way in from the rim to a slit, radians.
/// Multiples of 15°: so one of them runs in the middle of any corner of the lattice.
const WAYS: [f64; 7] = [
    0.0,
    FRAC_PI_12,
    -FRAC_PI_12,
    FRAC_PI_6,
    -FRAC_PI_6,
    FRAC_PI_4,
    -FRAC_PI_4,
];

const FRAC_PI_12: f64 = 0.5 * FRAC_PI_6;

/// How far from the tail of a slit a way in from the rim may burn the rim, half kerfs. The slit itself burns as far as
/// one. In the middle of a corner of angle φ a beam takes from its sides up to 1 / sin(φ/2): 1.155 in one of 120°,
/// which is too little to see, but 2 in a notch of 60°, from both.
const AROUND_TAIL: f64 = 1.16;

/// The finished edges of a sheet by place.
pub(super) struct Scrap {
    edges: RTree<GeomWithData<Line<[f64; 2]>, u32>>,
}

/// The parts of a segment that lie farther from a place than a distance.
fn beyond([a, b]: [Point; 2], place: Point, distance: f64) -> [Option<[Point; 2]>; 2] {
    let (d, w) = (b - a, place - a);
    let length = d.hypot();
    let along = w.dot(d) / length;
    let away = w.cross(d) / length;
    let reach = distance * distance - away * away;
    if length == 0.0 || reach <= 0.0 {
        let far = length > 0.0 || w.hypot() > distance;
        return [far.then_some([a, b]), None];
    }
    let (from, to) = (along - reach.sqrt(), along + reach.sqrt());
    if from >= length || to <= 0.0 {
        return [Some([a, b]), None];
    }
    [
        (from > 0.0).then(|| [a, a.lerp(b, from / length)]),
        (to < length).then(|| [a.lerp(b, to / length), b]),
    ]
}

fn ends(line: &Line<[f64; 2]>) -> (Point, Point) {
    let point = |[x, y]: [f64; 2]| Point::new(x, y);
    (point(line.from), point(line.to))
}

impl Scrap {
    pub fn new(sheet: &Sheet) -> Self {
        let mut edges = Vec::new();
        for (n, contour) in sheet.contours.iter().enumerate() {
            let points = contour.line.flattened(CHORD_ERROR_MM);
            for (i, a) in points.iter().enumerate() {
                let b = points[(i + 1) % points.len()];
                edges.push(GeomWithData::new(
                    Line::new([a.x, a.y], [b.x, b.y]),
                    n as u32,
                ));
            }
        }
        Self {
            edges: RTree::bulk_load(edges),
        }
    }

    /// Distance from a point to the nearest finished edge, up to `limit`.
    fn clearance(&self, p: Point, limit: f64) -> f64 {
        let near = AABB::from_corners([p.x - limit, p.y - limit], [p.x + limit, p.y + limit]);
        let mut least = limit;
        for edge in self.edges.locate_in_envelope_intersecting(near) {
            let (a, b) = ends(edge.geom());
            least = least.min(plane::from_segment(p, a, b));
        }
        least
    }

    /// Whether a point lies in the part: a ray from it to the right crosses an odd number of edges.
    fn is_part(&self, p: Point) -> bool {
        let ray = AABB::from_corners([p.x, p.y], [f64::MAX, p.y]);
        let crossed = self.edges.locate_in_envelope_intersecting(ray).filter(|e| {
            let (a, b) = ends(e.geom());
            plane::crosses(a, b, p)
        });
        crossed.count() % 2 == 1
    }

    /// Whether the straight way from a pierce stays in scrap, hole and beam and all; `but` as [`Self::keeps_clear`] has it.
    fn is_free(
        &self,
        way: [Point; 2],
        hole_mm: f64,
        kerf_mm: f64,
        but: Option<(Point, f64)>,
    ) -> bool {
        let hole = 0.5 * hole_mm + CLEAR_MM;
        self.clearance(way[0], hole) >= hole && self.keeps_clear(way, kerf_mm, but)
    }

    /// Whether a beam along a segment touches no finished edge, or none farther from a place than a distance: there
    /// another one burns.
    fn keeps_clear(&self, way: [Point; 2], kerf_mm: f64, but: Option<(Point, f64)>) -> bool {
        let half = 0.5 * kerf_mm;
        let least = half - 2.0 * CHORD_ERROR_MM;
        let [a, b] = way;
        let near = AABB::from_corners(
            [a.x.min(b.x) - half, a.y.min(b.y) - half],
            [a.x.max(b.x) + half, a.y.max(b.y) + half],
        );
        let mut edges = self.edges.locate_in_envelope_intersecting(near);
        edges.all(|edge| {
            let (c, d) = ends(edge.geom());
            let parts = match but {
                Some((place, reach)) => beyond([c, d], place, reach),
                None => [Some([c, d]), None],
            };
            let mut parts = parts.into_iter().flatten();
            parts.all(|part| plane::between_segments(way, part) >= least)
        })
    }

    /// The ways into and out of a closed outline, and the outline as an open line from where they meet it.
    ///
    /// `side` is where the scrap lies, seen along the outline.
    ///
    /// With a pierce no wider than the kerf and no leads asked for, the line begins at the vertex nearest to `head`.
    ///
    /// # Errors
    /// [`ToolpathError::NoRoomToPierce`] where the hole fits nowhere beside a wide pierce's outline.
    pub fn enter(
        &self,
        contour: &Contour,
        outline: &Curve,
        options: &CutOptions,
        kerf_mm: f64,
        head: Point,
        side: Side,
    ) -> Result<Ways, ToolpathError> {
        let nearest_vertex = || {
            let vertices = outline.vertices.iter().enumerate();
            let near = vertices.min_by(|a, b| {
                let d = |v: &(usize, &Vertex)| v.1.at.distance_squared(head);
                d(a).total_cmp(&d(b))
            });
            near.map_or(0, |(i, _)| i)
        };
        let wide = options.pierce_mm > kerf_mm;
        if !wide && options.lead_in_mm <= 0.0 {
            let line = outline.opened_at(nearest_vertex(), 0.0);
            let along = line
                .pieces()
                .next_back()
                .map_or(Vec2::ZERO, |p| p.direction(1.0));
            let lead_out = self.leave(&line, along, options, kerf_mm, side);
            return Ok(Ways {
                lead_in: None,
                line,
                lead_out,
            });
        }
        // Straight pieces, nearest middle first.
        let mut pieces: Vec<(usize, Piece)> = outline.pieces().enumerate().collect();
        pieces.sort_by(|a, b| {
            let small = |p: &Piece| p.arc().is_some_and(|a| a.radius <= 2.0 * kerf_mm);
            let d = |p: &Piece| p.at(0.5).distance_squared(head);
            small(&a.1)
                .cmp(&small(&b.1))
                .then(d(&a.1).total_cmp(&d(&b.1)))
        });
        for (slant, length) in ways(options, kerf_mm) {
            for (index, piece) in &pieces {
                let (at, along) = (piece.at(0.5), piece.direction(0.5));
                let pierce = at + lead(along, slant, side) * length;
                if self.is_free([pierce, at], options.pierce_mm, kerf_mm, None) {
                    let line = outline.opened_at(*index, 0.5);
                    let lead_out = self.leave(&line, along, options, kerf_mm, side);
                    let lead_in = Some(Curve::line(pierce, at));
                    return Ok(Ways {
                        lead_in,
                        line,
                        lead_out,
                    });
                }
            }
        }
        if wide {
            return Err(no_room(contour.line.start().unwrap_or(head), options));
        }
        Ok(Ways {
            lead_in: None,
            line: outline.opened_at(nearest_vertex(), 0.0),
            lead_out: None,
        })
    }

    /// The way into a stretch between two tabs, and the stretch itself: the other way round where only its end can be
    /// reached.
    ///
    /// # Errors
    /// [`ToolpathError::NoRoomToPierce`] if the hole is wide and fits at neither end.
    pub fn way_in(
        &self,
        line: Curve,
        options: &CutOptions,
        kerf_mm: f64,
    ) -> Result<(Option<Curve>, Curve), ToolpathError> {
        let wide = options.pierce_mm > kerf_mm;
        if !wide && options.lead_in_mm <= 0.0 {
            return Ok((None, line));
        }
        let back = line.reversed();
        for (slant, length) in ways(options, kerf_mm) {
            // Scrap is on the right of the outline, and on the left of the way back.
            for (line, side) in [(&line, Side::Right), (&back, Side::Left)] {
                let Some(first) = line.pieces().next() else {
                    continue;
                };
                let pierce = first.from + lead(first.direction(0.0), slant, side) * length;
                if self.is_free([pierce, first.from], options.pierce_mm, kerf_mm, None) {
                    return Ok((Some(Curve::line(pierce, first.from)), line.clone()));
                }
            }
        }
        if wide {
            return Err(no_room(line.start().unwrap_or(Point::ORIGIN), options));
        }
        Ok((None, line))
    }

    /// Overcut along the line's beginning, then away from the part.
    fn leave(
        &self,
        line: &Curve,
        along: Vec2,
        options: &CutOptions,
        kerf_mm: f64,
        side: Side,
    ) -> Option<Curve> {
        let over = options.overcut_mm.min(0.5 * line.length());
        let mut way = if over > 0.0 {
            line.between(0.0, over)
        } else {
            Curve::default()
        };
        let (end, along) = match way.pieces().next_back() {
            Some(last) => (last.to, last.direction(1.0)),
            None => (line.end()?, along),
        };
        if options.lead_out_mm > 0.0 {
            // The way in, mirrored.
            let found = SLANTS.iter().find_map(|slant| {
                let out = end - lead(along, *slant, side.other()) * options.lead_out_mm;
                self.is_free([out, end], kerf_mm, kerf_mm, None)
                    .then_some(out)
            });
            if let Some(out) = found {
                way.join(&Curve::line(end, out));
            }
        }
        (!way.is_empty()).then_some(way)
    }

    /// A way from scrap to the tail of a slit on the rim, if the pierce hole has room there.
    pub fn way_to_rim(
        &self,
        tail: Point,
        outwards: Vec2,
        options: &CutOptions,
        kerf_mm: f64,
    ) -> Option<Curve> {
        let least = 0.5 * options.pierce_mm + 2.0 * CLEAR_MM;
        if self.clearance(tail, kerf_mm) > ON_RIM_MM {
            return None;
        }
        for length in [options.lead_in_mm.max(least), 1.5 * least, least] {
            for turn in WAYS {
                let pierce = tail + Vec2::from_angle(turn + outwards.atan2()) * length;
                let around_tail = Some((tail, AROUND_TAIL * 0.5 * kerf_mm));
                if self.is_free([pierce, tail], options.pierce_mm, kerf_mm, around_tail)
                    && !self.is_part(pierce)
                {
                    return Some(Curve::line(pierce, tail));
                }
            }
        }
        None
    }
}

/// A side of a line, seen along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Side {
    Left,
    Right,
}

impl Side {
    fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// A closed outline with its ways in and out.
pub(super) struct Ways {
    /// From the pierce to the line.
    pub lead_in: Option<Curve>,
    /// The outline as an open line.
    pub line: Curve,
    /// Overcut and way out.
    pub lead_out: Option<Curve>,
}

fn no_room(at: Point, options: &CutOptions) -> ToolpathError {
    ToolpathError::NoRoomToPierce {
        x: at.x,
        y: at.y,
        pierce_mm: options.pierce_mm,
        room_mm: 0.0,
    }
}

/// Slants and lengths of a lead-in that are tried: as long as asked first, and shorter down to what the hole needs.
fn ways(options: &CutOptions, kerf_mm: f64) -> Vec<(f64, f64)> {
    let mut all = Vec::with_capacity(12);
    for share in [1.0, 0.5, 0.0] {
        for slant in SLANTS {
            let least = (0.5 * (options.pierce_mm - kerf_mm) + 2.0 * CLEAR_MM) / slant.sin();
            let most = options.lead_in_mm.max(least);
            all.push((slant, least + share * (most - least)));
        }
    }
    all
}

/// From the outline back into the scrap where a lead-in comes from, on this side of the direction `along`.
fn lead(along: Vec2, slant: f64, side: Side) -> Vec2 {
    let right = Vec2::new(along.y, -along.x);
    let aside = match side {
        Side::Right => right,
        Side::Left => -right,
    };
    aside * slant.sin() - along * slant.cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage};
    use crate::pattern::SheetOptions;

    /// A plate with a corner of this angle cut into it from below, its vertex at the origin, its sides 50 mm long.
    fn notched(angle_deg: f64) -> Scrap {
        let linkage = Linkage::patch(20.0, Handedness::Right, &Linkage::hexagon_cells(1));
        let mut sheet = Sheet::new(&linkage, &SheetOptions::plain(1.0, 0.2)).unwrap();
        let tip = 50.0 * Vec2::from_angle(f64::to_radians(0.5 * angle_deg - 90.0));
        let corners = [
            (-tip.x, tip.y),
            (0., 0.),
            (tip.x, tip.y),
            (tip.x, 30.),
            (-tip.x, 30.),
        ];
        sheet.contours = vec![Contour {
            line: Curve::polyline(corners.map(Point::from), true),
            outer: true,
        }];
        Scrap::new(&sheet)
    }

    fn options(pierce_mm: f64) -> CutOptions {
        let machine = crate::machine::load(crate::machine::DEFAULT).unwrap();
        let material = crate::material::load(crate::material::DEFAULT).unwrap();
        CutOptions {
            pierce_mm,
            lead_in_mm: 3.0,
            ..CutOptions::of(&material.cut_for(&machine).unwrap(), &machine, None)
        }
    }

    #[test]
    fn a_way_to_the_rim_burns_no_more_of_it_than_its_slit_or_is_none() {
        let kerf_mm = 0.2;
        for (angle_deg, entered) in [(60.0, false), (90.0, false), (120.0, true), (180.0, true)] {
            for slit_deg in [-30.0, 0.0, 30.0] {
                let outwards = Vec2::from_angle(f64::to_radians(slit_deg - 90.0));
                let scrap = notched(angle_deg);
                let way = scrap.way_to_rim(Point::ORIGIN, outwards, &options(0.9), kerf_mm);
                assert_eq!(way.is_some(), entered, "{angle_deg} {slit_deg}");
                let Some(way) = way else { continue };
                // Every place of the rim that the beam reaches is one that the slit reaches, to a hundredth of a
                // millimetre and a half.
                let side = Vec2::from_angle(f64::to_radians(0.5 * angle_deg - 90.0));
                let line = way.flattened(CHORD_ERROR_MM);
                for k in 0..200 {
                    let along = 0.01 * f64::from(k);
                    let rim = (side * along).to_point();
                    if plane::from_segment(rim, line[0], line[1]) < 0.5 * kerf_mm - 0.004 {
                        assert!(along < 0.5 * kerf_mm + 0.016, "{angle_deg}: {along}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_beam_that_passes_a_corner_between_two_points_touches_it() {
        // The tip of a corner is 0.09 mm beside the middle of a way: half a kerf is 0.1, and its ends are far off.
        let scrap = notched(60.0);
        for (beside, clear) in [(0.09, false), (0.101, true)] {
            for middle in [0.0, 0.013, 0.05] {
                let tip = 50.0 * Vec2::from_angle(f64::to_radians(-60.0));
                let (x, y) = (tip.x + middle, tip.y - beside);
                let way = [Point::new(x - 0.2, y), Point::new(x + 0.2, y)];
                let found = scrap.keeps_clear(way, 0.2, None);
                assert_eq!(found, clear, "{beside} {middle}");
            }
        }
    }

    #[test]
    fn what_lies_beyond_a_circle_is_both_ends_or_all_or_nothing() {
        let line = [Point::new(0.0, 0.0), Point::new(10.0, 0.0)];
        let length = |place: (f64, f64), r: f64| -> Vec<f64> {
            let parts = beyond(line, place.into(), r).into_iter().flatten();
            parts.map(|[a, b]| a.distance(b)).collect()
        };
        assert_eq!(length((5.0, 3.0), 5.0), [1.0, 1.0]);
        assert_eq!(length((0.0, 0.0), 4.0), [6.0]);
        assert_eq!(length((12.0, 0.0), 4.0), [8.0]);
        assert_eq!(length((5.0, 6.0), 5.0), [10.0]);
        assert_eq!(length((30.0, 0.0), 5.0), [10.0]);
        assert!(length((5.0, 0.0), 6.0).is_empty());
        let spot = [line[0]; 2];
        assert_eq!(beyond(spot, Point::new(1.0, 0.0), 2.0), [None, None]);
        assert_eq!(beyond(spot, Point::new(3.0, 0.0), 2.0), [Some(spot), None]);
    }
}
