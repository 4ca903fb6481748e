//! What a linkage is: rigid equilateral triangles, joined in pairs at their corners.
//!
//! Every lattice edge between two triangles is slit from one end almost to the other, and the hinge is the end that
//! stays. Around each lattice vertex outgoing and incoming slits alternate, so each triangle is a directed cycle of
//! slits: triangles of one colour counter-clockwise, of the other clockwise (paper, §3 and Fig. 7). A lattice vertex
//! therefore becomes several [`PointId`]s in space, each shared by exactly two triangles.

use std::sync::Arc;

use nalgebra::Point2;

use super::trim::Trim;
use crate::base::ids::{Id, Per, typed_id};

typed_id!(
    /// A rigid triangle of a [`Linkage`].
    TriangleId
);
typed_id!(
    /// A point of a [`Linkage`]: a hinge (shared by two triangles) or a free corner (of one).
    PointId
);

/// Which way a triangle points in the lattice frame. Neighbours have opposite colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Colour {
    /// Corners at a, a + 1, a + e^{iπ/3}.
    Up,
    /// Corners at a + 1, a + 1 + e^{iπ/3}, a + e^{iπ/3}.
    Down,
}

impl Colour {
    /// The other colour.
    pub fn other(self) -> Self {
        match self {
            Self::Up => Self::Down,
            Self::Down => Self::Up,
        }
    }
}

/// Which of the two mirror patterns of slits is cut.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Handedness {
    /// Up triangles are counter-clockwise slit cycles.
    #[default]
    Right,
    /// Up triangles are clockwise slit cycles.
    Left,
}

impl Handedness {
    /// True if the slits around a triangle of this colour run counter-clockwise.
    #[inline]
    pub fn counter_clockwise(self, colour: Colour) -> bool {
        (self == Self::Right) == (colour == Colour::Up)
    }
}

/// One rigid triangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangle {
    /// Its points, counter-clockwise seen from outside.
    pub points: [PointId; 3],
    /// Its colour, preserved by every seam transition.
    pub colour: Colour,
    /// Its closed position on the sheet, millimetres, corner by corner.
    pub flat: [Point2<f64>; 3],
    /// What a smooth rim leaves of it on the sheet; `None` for all of it. In space it stays whole.
    pub trim: Option<Arc<Trim>>,
}

/// A corner (0, 1, 2) of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Corner {
    /// The triangle.
    pub triangle: TriangleId,
    /// 0, 1 or 2.
    pub corner: usize,
}

/// A pair of triangles that turn about a common point. Closed, they touch along the slit edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hinge {
    /// The common point.
    pub point: PointId,
    /// The corner whose triangle is a counter-clockwise slit cycle: its slit edge comes from its previous corner.
    pub ccw: Corner,
    /// The corner of the clockwise triangle: its slit edge comes from its next corner.
    pub cw: Corner,
    /// True if the two are not neighbours on the flat sheet: the sheet is cut open between them.
    pub seam: bool,
}

impl Hinge {
    /// The four edge vectors of the paper's Fig. 10 as points: `[b1, a1, a2, b2]`, so that v1 = b1 − h, v2 = a1 − h,
    /// v3 = a2 − h, v4 = b2 − h, where a1 and a2 coincide when the hinge is closed. `ccw` is the first triangle.
    #[inline]
    pub fn arms(&self, triangles: &Per<TriangleId, Triangle>) -> [PointId; 4] {
        let (p, q) = (
            &triangles[self.ccw.triangle].points,
            &triangles[self.cw.triangle].points,
        );
        let (i, j) = (self.ccw.corner, self.cw.corner);
        [
            p[(i + 1) % 3],
            p[(i + 2) % 3],
            q[(j + 1) % 3],
            q[(j + 2) % 3],
        ]
    }
}

/// A triangle before it is joined to others.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Its colour.
    pub colour: Colour,
    /// Its closed corners on the sheet, counter-clockwise, millimetres.
    pub flat: [Point2<f64>; 3],
    /// For each side `k` (corner `k` to `k + 1`): the neighbouring cell across it and that cell's side.
    pub neighbours: [Option<(usize, usize)>; 3],
    /// What a smooth rim leaves of it; `None` for all.
    pub trim: Option<Arc<Trim>>,
}

/// Rigid triangles and their hinges. Positions in space are kept apart, one per [`PointId`].
#[derive(Clone, Debug)]
pub struct Linkage {
    /// Length L of every triangle edge, millimetres.
    pub edge_mm: f64,
    /// Which of the two slit patterns.
    pub handedness: Handedness,
    /// The triangles.
    pub triangles: Per<TriangleId, Triangle>,
    /// The hinges, in the order of their points.
    pub hinges: Vec<Hinge>,
    points: usize,
}

/// Two flat corners closer than this (in L) are one point of the sheet. Lattice positions are exact to rounding, and
/// the nearest other lattice vertex is 1 away, so any small number does.
const SAME_FLAT_POINT: f64 = 1e-6;

impl Linkage {
    /// Joins cells at the hinges that the slit pattern gives. Neighbours must be mutual and of opposite colours;
    /// a pair that is not, is left unjoined.
    pub fn assemble(edge_mm: f64, handedness: Handedness, cells: &[Cell]) -> Self {
        const UNSET: PointId = PointId(u32::MAX);
        let mut triangles: Per<TriangleId, Triangle> = cells
            .iter()
            .map(|c| Triangle {
                points: [UNSET; 3],
                colour: c.colour,
                flat: c.flat,
                trim: c.trim.clone(),
            })
            .collect();
        let mut hinges = Vec::new();
        let mut points = 0;
        for (i, cell) in cells.iter().enumerate() {
            let triangle = TriangleId::from_index(i);
            for corner in 0..3 {
                if triangles[triangle].points[corner] != UNSET {
                    continue;
                }
                let point = PointId::from_index(points);
                points += 1;
                triangles[triangle].points[corner] = point;
                let here = Corner { triangle, corner };
                let ccw = handedness.counter_clockwise(cell.colour);
                let side = if ccw { (corner + 2) % 3 } else { corner };
                let Some((other, other_side)) = cell.neighbours[side] else {
                    continue;
                };
                if other == i
                    || cells[other].colour == cell.colour
                    || cells[other].neighbours[other_side] != Some((i, side))
                {
                    continue;
                }
                let there = Corner {
                    triangle: TriangleId::from_index(other),
                    corner: if ccw {
                        other_side
                    } else {
                        (other_side + 1) % 3
                    },
                };
                triangles[there.triangle].points[there.corner] = point;
                let apart = |a: usize, b: usize| {
                    (cell.flat[a % 3] - cells[other].flat[b % 3]).norm() > SAME_FLAT_POINT * edge_mm
                };
                let seam = apart(side, other_side + 1) || apart(side + 1, other_side);
                let (ccw, cw) = if ccw { (here, there) } else { (there, here) };
                hinges.push(Hinge {
                    point,
                    ccw,
                    cw,
                    seam,
                });
            }
        }
        Self {
            edge_mm,
            handedness,
            triangles,
            hinges,
            points,
        }
    }

    /// A linkage from what it consists of: hinges in the order of their points, `points` of which there are in all.
    pub(super) fn from_parts(
        edge_mm: f64,
        handedness: Handedness,
        triangles: Per<TriangleId, Triangle>,
        hinges: Vec<Hinge>,
        points: usize,
    ) -> Self {
        Self {
            edge_mm,
            handedness,
            triangles,
            hinges,
            points,
        }
    }

    /// A planar linkage from lattice cells: (i, j, colour) with corners at (i, j), (i + 1, j), (i, j + 1) for up and
    /// (i + 1, j), (i + 1, j + 1), (i, j + 1) for down, where (i, j) lies at L (i + j/2, j √3/2). For coupons and tests.
    pub fn patch(edge_mm: f64, handedness: Handedness, cells: &[(i32, i32, Colour)]) -> Self {
        let index: std::collections::HashMap<_, _> =
            cells.iter().enumerate().map(|(k, c)| (*c, k)).collect();
        let at = |i: i32, j: i32| {
            Point2::new(i as f64 + 0.5 * j as f64, j as f64 * 0.75f64.sqrt()) * edge_mm
        };
        let list: Vec<Cell> = cells
            .iter()
            .map(|&(i, j, colour)| {
                let find = |i, j, colour, side| index.get(&(i, j, colour)).map(|&k| (k, side));
                match colour {
                    Colour::Up => Cell {
                        colour,
                        flat: [at(i, j), at(i + 1, j), at(i, j + 1)],
                        neighbours: [
                            find(i, j - 1, Colour::Down, 1),
                            find(i, j, Colour::Down, 2),
                            find(i - 1, j, Colour::Down, 0),
                        ],
                        trim: None,
                    },
                    Colour::Down => Cell {
                        colour,
                        flat: [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                        neighbours: [
                            find(i + 1, j, Colour::Up, 2),
                            find(i, j + 1, Colour::Up, 0),
                            find(i, j, Colour::Up, 1),
                        ],
                        trim: None,
                    },
                }
            })
            .collect();
        Self::assemble(edge_mm, handedness, &list)
    }

    /// The hexagon of lattice radius `radius` around a lattice vertex: 6 · radius² cells for [`Linkage::patch`].
    pub fn hexagon_cells(radius: i32) -> Vec<(i32, i32, Colour)> {
        let inside = |i: i32, j: i32| i.abs().max(j.abs()).max((i + j).abs()) <= radius;
        let mut cells = Vec::new();
        for j in -radius..radius {
            for i in -radius - radius..radius + radius {
                if inside(i, j) && inside(i + 1, j) && inside(i, j + 1) {
                    cells.push((i, j, Colour::Up));
                }
                if inside(i + 1, j) && inside(i + 1, j + 1) && inside(i, j + 1) {
                    cells.push((i, j, Colour::Down));
                }
            }
        }
        cells
    }

    /// Number of points: hinges and free corners.
    pub fn point_count(&self) -> usize {
        self.points
    }

    /// The side of its triangle along which the slit of a corner runs: `side` goes from corner `side` to `side + 1`.
    #[inline]
    pub fn slit_side(&self, corner: Corner) -> usize {
        if self
            .handedness
            .counter_clockwise(self.triangles[corner.triangle].colour)
        {
            (corner.corner + 2) % 3
        } else {
            corner.corner
        }
    }

    /// Whether a smooth rim leaves a hinge its ligaments. Without them it is no hinge of the sheet, and its slit runs out.
    pub fn keeps(&self, hinge: &Hinge) -> bool {
        [hinge.ccw, hinge.cw].iter().all(|c| {
            let trim = &self.triangles[c.triangle].trim;
            trim.as_ref().is_none_or(|t| t.beyond != c.corner)
        })
    }

    /// For every triangle and side: the triangle across it (and its side), whether on the sheet or across a seam.
    pub fn neighbours(&self) -> Per<TriangleId, [Option<(TriangleId, usize)>; 3]> {
        self.neighbours_where(|_| true)
    }

    /// As [`Linkage::neighbours`], only those that are joined on the flat sheet.
    pub fn flat_neighbours(&self) -> Per<TriangleId, [Option<(TriangleId, usize)>; 3]> {
        self.neighbours_where(|hinge| !hinge.seam)
    }

    /// Lattice vertices with triangles all around, across seams too, by the number of triangles: 6, or fewer or more at a
    /// cone.
    pub fn rounds(&self) -> std::collections::BTreeMap<usize, usize> {
        let neighbours = self.neighbours();
        let mut seen = Per::filled(self.triangles.len(), [false; 3]);
        let mut rounds = std::collections::BTreeMap::new();
        for start in self.triangles.ids() {
            for corner in 0..3 {
                let (mut at, mut count) = ((start, corner), 0);
                while !std::mem::replace(&mut seen[at.0][at.1], true) {
                    count += 1;
                    // Over the side that leaves the vertex; beyond, it ends there.
                    let Some((beyond, side)) = neighbours[at.0][at.1] else {
                        break;
                    };
                    at = (beyond, (side + 1) % 3);
                    if at == (start, corner) {
                        *rounds.entry(count).or_insert(0) += 1;
                    }
                }
            }
        }
        rounds
    }

    fn neighbours_where(
        &self,
        keep: impl Fn(&Hinge) -> bool,
    ) -> Per<TriangleId, [Option<(TriangleId, usize)>; 3]> {
        let mut table = Per::filled(self.triangles.len(), [None; 3]);
        for hinge in self.hinges.iter().filter(|h| keep(h)) {
            let (a, b) = (self.slit_side(hinge.ccw), self.slit_side(hinge.cw));
            table[hinge.ccw.triangle][a] = Some((hinge.cw.triangle, b));
            table[hinge.cw.triangle][b] = Some((hinge.ccw.triangle, a));
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hexagon_has_the_counted_triangles_hinges_and_points() {
        for radius in 1..5i32 {
            for handedness in [Handedness::Right, Handedness::Left] {
                let linkage = Linkage::patch(7.0, handedness, &Linkage::hexagon_cells(radius));
                let triangles = 6 * radius * radius;
                let hinges = (3 * triangles - 6 * radius) / 2; // every side but those of the rim
                assert_eq!(linkage.triangles.len() as i32, triangles);
                assert_eq!(linkage.hinges.len() as i32, hinges);
                assert_eq!(linkage.point_count() as i32, 3 * triangles - hinges);
                assert!(linkage.hinges.iter().all(|h| !h.seam));
                let inner = 1 + 3 * radius * (radius - 1);
                let rounds: Vec<_> = linkage.rounds().into_iter().collect();
                assert_eq!(rounds, [(6, inner as usize)]);
            }
        }
    }

    #[test]
    fn around_an_inner_vertex_outgoing_and_incoming_slits_alternate() {
        let linkage = Linkage::patch(1.0, Handedness::Right, &Linkage::hexagon_cells(1));
        let centre = Point2::origin();
        let (mut outgoing, mut incoming) = (Vec::new(), Vec::new());
        for h in &linkage.hinges {
            let t = &linkage.triangles[h.ccw.triangle];
            let (from, to) = (t.flat[(h.ccw.corner + 2) % 3], t.flat[h.ccw.corner]);
            let angle =
                |p: Point2<f64>| (p.y.atan2(p.x).to_degrees().round() as i32).rem_euclid(360);
            if (from - centre).norm() < 1e-9 {
                outgoing.push(angle(to));
            } else {
                incoming.push(angle(from));
            }
        }
        outgoing.sort();
        incoming.sort();
        assert_eq!(
            (outgoing, incoming),
            (vec![0, 120, 240], vec![60, 180, 300])
        );
    }
}
