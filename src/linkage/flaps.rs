//! Doubled rows along the seam: triangles that are cut twice, so that the two sides of a seam can be glued on one
//! another instead of edge to edge (the paper's Fig. 1).
//!
//! A *segment* is a run of the seam over which the lattice goes on from one side to the other by one and the same
//! motion: it ends at cones, rims and branches. Its *row* are the triangles across it and those that touch two of them
//! in a vertex of the seam; 2n − 1 along a straight segment of n edges. Moved by the segment's motion they lie against
//! the side that is chosen to carry them, where the lattice simply goes on: the seam becomes an ordinary line of slits
//! there, and a mere rim on the other side, whose triangles are the doubles that the row is glued on.
//!
//! Where two sides come close (a narrow wedge at a cone, another part of the sheet) there is no room for a row. A flap
//! triangle may touch nothing but what it is hinged to, not even in a point, and must hang by two hinges as every
//! triangle does; what does not is left out. Every segment gets the side on which more triangles fit.

use std::collections::{HashMap, HashSet};

use super::lattice::Lattice;
use super::net::{Net, Spot, beyond, next};
use super::pieces::{Bounds, Motion, middle, middle_beyond};
use super::types::{Cell, Linkage, TriangleId};
use crate::base::ids::Id as _;

/// Rounds in which every segment may change the side that carries its row. Every change is an improvement, and two rounds
/// found them all on 2000 sheets with random holes; the bound keeps the time in hand.
const ROUNDS: usize = 8;

/// A triangle of a doubled row.
#[derive(Clone, Debug)]
pub struct Flap {
    /// Colour, closed place on the sheet, and what it is hinged to there: triangles of the linkage by their number,
    /// flap triangles by theirs plus the number of triangles.
    pub cell: Cell,
    /// The triangle of the linkage that it is glued on, corner on corner.
    pub double: TriangleId,
    /// Index of its segment in [`Flaps::segments`].
    pub segment: usize,
}

/// A run of the seam between cones, rims and branches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct SeamSegment {
    /// Its length in triangle edges.
    pub edges: usize,
    /// Edges with a flap triangle across them.
    pub doubled: usize,
    /// Triangles of a full row on the side that carries it.
    pub row: usize,
    /// Flap triangles for which there is room.
    pub flaps: usize,
}

/// The doubled rows of a sheet. They belong to the sheet alone: in space each of them lies on its double.
#[derive(Clone, Debug, Default)]
pub struct Flaps {
    /// The flap triangles, row by row.
    pub flaps: Vec<Flap>,
    /// The segments of the seam.
    pub segments: Vec<SeamSegment>,
}

impl Flaps {
    /// The same seam without any doubled row.
    #[must_use]
    pub fn none(&self) -> Self {
        let bare = |s: &SeamSegment| SeamSegment {
            doubled: 0,
            flaps: 0,
            ..*s
        };
        Self {
            flaps: Vec::new(),
            segments: self.segments.iter().map(bare).collect(),
        }
    }

    /// Edges of the seam that no flap triangle crosses: they are joined edge to edge.
    pub fn bare_edges(&self) -> usize {
        self.segments.iter().map(|s| s.edges - s.doubled).sum()
    }

    /// What is cut: a planar linkage of the triangles of `linkage` in their order, then the flap triangles, hinged as
    /// on the sheet; seams are rims.
    pub fn on_sheet(&self, linkage: &Linkage) -> Linkage {
        let mut cells: Vec<Cell> = linkage
            .flat_neighbours()
            .iter()
            .zip(linkage.triangles.iter())
            .map(|(beside, triangle)| Cell {
                colour: triangle.colour,
                flat: triangle.flat,
                neighbours: beside.map(|n| n.map(|(t, side)| (t.index(), side))),
                trim: triangle.trim.clone(),
            })
            .collect();
        let count = cells.len();
        for (n, flap) in self.flaps.iter().enumerate() {
            for (side, beside) in flap.cell.neighbours.iter().enumerate() {
                if let Some((t, theirs)) = beside.filter(|(t, _)| *t < count) {
                    cells[t].neighbours[theirs] = Some((count + n, side));
                }
            }
        }
        cells.extend(self.flaps.iter().map(|f| f.cell.clone()));
        Linkage::assemble(linkage.edge_mm, linkage.handedness, &cells)
    }
}

/// A flap triangle on the lattice.
#[derive(Clone, Debug)]
struct Tile {
    /// The triangle that it is a copy of; for a triangle of the sheet, itself.
    original: usize,
    corners: [Spot; 3],
    /// Its segment; none for a triangle of the sheet.
    segment: Option<usize>,
}

/// A side of a segment that may carry a row.
#[derive(Clone)]
struct Row {
    /// The seam's sides on the carrying triangles, in order, each ending where the next one starts.
    hosts: Vec<usize>,
    /// True if the last one ends where the first one starts, and no cone, rim or branch is there.
    closed: bool,
}

/// Lays doubled rows along the seam of a sheet of which the lattice corners are `spots`. `laid` gives the colours.
pub(super) fn rows(
    net: &Net,
    spots: &[[Spot; 3]],
    laid: &[super::clip::Laid],
    lattice: &Lattice,
) -> Flaps {
    let seams = Seams { net, spots };
    let segments = seams.segments();
    let mut planner = Planner::new(&seams, &segments);
    planner.choose();
    let tiles = planner.tiles;
    let at: HashMap<Spot, usize> = (0..tiles.len())
        .map(|n| (middle(&tiles[n].corners), n))
        .collect();
    let mut found: Vec<SeamSegment> = segments
        .iter()
        .zip(planner.full)
        .map(|(segment, row)| SeamSegment {
            edges: segment.hosts.len(),
            doubled: 0,
            row,
            flaps: 0,
        })
        .collect();
    let mut flaps = Vec::with_capacity(tiles.len());
    for tile in &tiles {
        let segment = tile.segment.unwrap_or(0);
        found[segment].flaps += 1;
        let neighbours = std::array::from_fn(|k| {
            let twin = net.twin[3 * tile.original + k]?;
            let there = beyond(&tile.corners, k, twin);
            let other = twin / 3;
            match at.get(&middle(&there)) {
                Some(&n) => (tiles[n].segment == tile.segment
                    && tiles[n].corners == there
                    && tiles[n].original == other)
                    .then_some((spots.len() + n, twin % 3)),
                None => (spots[other] == there).then_some((other, twin % 3)),
            }
        });
        found[segment].doubled += neighbours
            .iter()
            .flatten()
            .filter(|(t, _)| *t < spots.len())
            .count();
        flaps.push(Flap {
            cell: Cell {
                colour: laid[tile.original].colour,
                flat: tile
                    .corners
                    .map(|(i, j)| lattice.point(f64::from(i), f64::from(j))),
                neighbours,
                trim: laid[tile.original].trim.clone(),
            },
            double: TriangleId::from_index(tile.original),
            segment,
        });
    }
    Flaps {
        flaps,
        segments: found,
    }
}

/// The seam of a sheet that is laid flat.
struct Seams<'a> {
    net: &'a Net,
    spots: &'a [[Spot; 3]],
}

impl Seams<'_> {
    /// The same side on the other side of the seam; none if the two lie side by side, or on a rim.
    fn twin(&self, side: usize) -> Option<usize> {
        let twin = self.net.twin[side]?;
        (beyond(&self.spots[side / 3], side, twin) != self.spots[twin / 3]).then_some(twin)
    }

    /// The seam's sides that leave a node.
    fn leaving(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        self.net.leaving[node]
            .iter()
            .copied()
            .filter(|&side| self.twin(side).is_some())
    }

    /// Whether the seam goes on through a node by the same motion.
    fn passes(&self, node: usize) -> bool {
        self.net.flat[node] && !self.net.rim[node] && self.leaving(node).count() == 2
    }

    /// All segments, each as the row of one of its sides.
    fn segments(&self) -> Vec<Row> {
        let mut seen = vec![false; self.net.twin.len()];
        let mut segments = Vec::new();
        let ends = |&side: &usize| !self.passes(self.net.node[side]);
        // From their ends first; what is left after that are loops.
        let starts = (0..seen.len())
            .filter(ends)
            .chain(0..seen.len())
            .collect::<Vec<_>>();
        for start in starts {
            let Some(_) = self.twin(start).filter(|_| !seen[start]) else {
                continue;
            };
            let mut hosts = Vec::new();
            let mut closed = false;
            let mut side = start;
            while let Some(twin) = self.twin(side) {
                hosts.push(side);
                (seen[side], seen[twin]) = (true, true);
                let node = self.net.head(side);
                if !self.passes(node) {
                    break;
                }
                let Some(onward) = self.leaving(node).find(|&other| other != twin) else {
                    break;
                };
                if onward == start {
                    closed = true;
                    break;
                }
                side = onward;
            }
            segments.push(Row { hosts, closed });
        }
        segments
    }

    /// The row on the other side of a segment.
    fn opposite(&self, row: &Row) -> Row {
        Row {
            hosts: row
                .hosts
                .iter()
                .rev()
                .filter_map(|&s| self.twin(s))
                .collect(),
            closed: row.closed,
        }
    }

    /// The triangles across the hosts of a row and those around the vertices between, once each, in order.
    fn across(&self, row: &Row) -> Vec<usize> {
        let twins: Vec<usize> = row.hosts.iter().filter_map(|&s| self.twin(s)).collect();
        let mut found = Vec::with_capacity(2 * twins.len());
        let mut seen = HashSet::new();
        for (k, &twin) in twins.iter().enumerate() {
            if seen.insert(twin / 3) {
                found.push(twin / 3);
            }
            let after = match twins.get(k + 1) {
                Some(&after) => after,
                None if row.closed => twins[0],
                None => break,
            };
            // Around the vertex between the two, from the far triangle back to the near one.
            let mut fan = Vec::new();
            let mut side = next(after);
            while side != twin {
                let Some(other) = self.net.twin[side].filter(|_| fan.len() < 6) else {
                    break;
                };
                if seen.insert(other / 3) {
                    fan.push(other / 3);
                }
                side = next(other);
            }
            found.extend(fan.into_iter().rev());
        }
        found
    }
}

/// Rows being laid.
struct Planner<'a> {
    seams: &'a Seams<'a>,
    segments: &'a [Row],
    /// Triangles of the sheet by place.
    sheet: HashMap<Spot, usize>,
    /// Box around the sheet.
    bounds: Bounds,
    /// Segments in the order in which their rows are laid, the longest first.
    order: Vec<usize>,
    /// For each segment: whether the other side carries its row.
    other: Vec<bool>,
    /// Flap triangles laid, and their places.
    tiles: Vec<Tile>,
    places: HashMap<Spot, usize>,
    /// The segment of which a side carries the row.
    carries: HashMap<usize, usize>,
    /// Triangles of each segment's full row.
    full: Vec<usize>,
}

impl<'a> Planner<'a> {
    fn new(seams: &'a Seams<'a>, segments: &'a [Row]) -> Self {
        let mut order: Vec<usize> = (0..segments.len()).collect();
        order.sort_by_key(|&n| std::cmp::Reverse(segments[n].hosts.len()));
        let mut bounds = Bounds::EMPTY;
        seams.spots.iter().flatten().for_each(|&s| bounds.add(s));
        Self {
            sheet: (0..seams.spots.len())
                .map(|t| (middle(&seams.spots[t]), t))
                .collect(),
            bounds,
            order,
            other: vec![false; segments.len()],
            tiles: Vec::new(),
            places: HashMap::new(),
            carries: HashMap::new(),
            full: vec![0; segments.len()],
            seams,
            segments,
        }
    }

    /// Chooses the sides: one segment after the other changes over where that gives more flap triangles, or as many
    /// and a smaller sheet, until none does.
    fn choose(&mut self) {
        self.lay();
        let mut best = self.worth();
        for _ in 0..ROUNDS {
            let mut changed = false;
            for segment in 0..self.segments.len() {
                self.other[segment] ^= true;
                self.lay();
                let worth = self.worth();
                if worth > best {
                    (best, changed) = (worth, true);
                } else {
                    self.other[segment] ^= true;
                }
            }
            if !changed {
                break;
            }
        }
        self.lay();
    }

    /// Number of flap triangles, then how small the sheet is.
    fn worth(&self) -> (usize, std::cmp::Reverse<(i64, i64)>) {
        let mut bounds = self.bounds;
        self.tiles
            .iter()
            .flat_map(|t| t.corners)
            .for_each(|s| bounds.add(s));
        (
            self.tiles.len(),
            std::cmp::Reverse(bounds.cost_with(&bounds, [0, 0])),
        )
    }

    /// Lays all rows anew, each on the side chosen for it.
    fn lay(&mut self) {
        self.tiles.clear();
        self.places.clear();
        self.carries.clear();
        for segment in self.order.clone() {
            let here = &self.segments[segment];
            let row = if self.other[segment] {
                self.seams.opposite(here)
            } else {
                here.clone()
            };
            self.full[segment] = self.lay_row(segment, &row);
        }
    }

    /// Lays as much of a row as there is room for, and returns how many triangles a full one has.
    fn lay_row(&mut self, segment: usize, row: &Row) -> usize {
        let Some((&first, twin)) = row
            .hosts
            .first()
            .and_then(|side| Some((side, self.seams.twin(*side)?)))
        else {
            return 0;
        };
        let spots = self.seams.spots;
        let motion = Motion::between(&spots[twin / 3], &beyond(&spots[first / 3], first, twin));
        let across = self.seams.across(row);
        let full = across.len();
        for &side in &row.hosts {
            self.carries.insert(side, segment);
        }
        let start = self.tiles.len();
        for original in across {
            let corners = spots[original].map(|s| motion.apply(s));
            let place = middle(&corners);
            if !self.sheet.contains_key(&place) && !self.places.contains_key(&place) {
                self.places.insert(place, self.tiles.len());
                self.tiles.push(Tile {
                    original,
                    corners,
                    segment: Some(segment),
                });
            }
        }
        // What has no room goes, then what hung on it.
        loop {
            let bad: Vec<bool> = self.tiles[start..].iter().map(|t| !self.holds(t)).collect();
            if !bad.contains(&true) {
                return full;
            }
            let kept = self.tiles.split_off(start);
            for tile in &kept {
                self.places.remove(&middle(&tile.corners));
            }
            for tile in kept.into_iter().zip(bad).filter(|(_, bad)| !bad) {
                self.places
                    .insert(middle(&tile.0.corners), self.tiles.len());
                self.tiles.push(tile.0);
            }
        }
    }

    /// What lies at a place.
    fn at(&self, place: Spot) -> Option<Tile> {
        if let Some(&n) = self.places.get(&place) {
            return Some(self.tiles[n].clone());
        }
        self.sheet.get(&place).map(|&t| Tile {
            original: t,
            corners: self.seams.spots[t],
            segment: None,
        })
    }

    /// Whether two triangles that lie side by side are neighbours on the sheet, and not merely close.
    fn joined(&self, a: &Tile, b: &Tile) -> bool {
        let Some(k) = (0..3).find(|&k| middle_beyond(&a.corners, k) == middle(&b.corners)) else {
            return false;
        };
        let Some(twin) = self.seams.net.twin[3 * a.original + k] else {
            return false;
        };
        if twin / 3 != b.original || beyond(&a.corners, k, twin) != b.corners {
            return false;
        }
        match (a.segment, b.segment) {
            (Some(own), None) => self.carries.get(&twin) == Some(&own),
            (None, Some(own)) => self.carries.get(&(3 * a.original + k)) == Some(&own),
            (mine, theirs) => mine == theirs,
        }
    }

    /// Whether a flap triangle touches only what it hangs on, and hangs on two triangles or more.
    fn holds(&self, tile: &Tile) -> bool {
        let mut hinges = 0;
        for k in 0..3 {
            if let Some(other) = self.at(middle_beyond(&tile.corners, k)) {
                if !self.joined(tile, &other) {
                    return false;
                }
                hinges += usize::from(self.seams.net.held[3 * tile.original + k]);
            }
        }
        hinges >= 2 && tile.corners.iter().all(|&corner| self.fan(tile, corner))
    }

    /// Whether all triangles around a corner of `tile` hang together around it.
    fn fan(&self, tile: &Tile, corner: Spot) -> bool {
        let around: [Option<Tile>; 6] = std::array::from_fn(|k| {
            let (i, j) = Motion::turned((1, 1), k);
            self.at((3 * corner.0 + i, 3 * corner.1 + j))
        });
        let present = around.iter().flatten().count();
        let own = around
            .iter()
            .position(|t| t.as_ref().is_some_and(|t| t.corners == tile.corners));
        let Some(own) = own else { return false };
        let run = |step: usize| {
            (1..6)
                .take_while(|n| {
                    let (a, b) = (
                        &around[(own + (n - 1) * step) % 6],
                        &around[(own + n * step) % 6],
                    );
                    matches!((a, b), (Some(a), Some(b)) if self.joined(a, b))
                })
                .count()
        };
        let (left, right) = (run(1), run(5));
        left == 5 || right == 5 || 1 + left + right == present
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::clip::Laid;
    use super::super::pieces::lay;
    use super::super::pieces::tests::{
        cone, double_torus, octahedron, parallelogram, saddle_between_cones, with_holes,
    };
    use super::super::{Colour, Handedness};
    use super::*;
    use proptest::prelude::*;

    /// Doubled rows of a linkage laid flat, with everything checked that holds for any.
    fn checked(laid: &[Laid]) -> Flaps {
        let net = Net::new(laid);
        let lattice = Lattice::new(1.0, 0.0);
        let (spots, _) = lay(&net, 0, [(0, 0), (1, 0), (0, 1)], &|_, _| 1.0);
        let flaps = rows(&net, &spots, laid, &lattice);
        let count = spots.len();
        let mut there: HashMap<Spot, usize> = (0..count).map(|t| (middle(&spots[t]), t)).collect();
        let corners: Vec<[Spot; 3]> = flaps
            .flaps
            .iter()
            .map(|flap| {
                flap.cell.flat.map(|p| {
                    let (i, j) = lattice.coordinates(p);
                    assert!((i - i.round()).abs().max((j - j.round()).abs()) < 1e-9);
                    (i.round() as i32, j.round() as i32)
                })
            })
            .collect();
        for (n, (flap, own)) in flaps.flaps.iter().zip(&corners).enumerate() {
            let double = flap.double.index();
            assert_eq!(flap.cell.colour, laid[double].colour);
            let up = middle(own).0.rem_euclid(3) == 1;
            assert_eq!(up, flap.cell.colour == laid[0].colour, "colours are kept");
            let motion = Motion::between(&spots[double], own);
            assert_eq!(spots[double].map(|s| motion.apply(s)), *own, "a rigid copy");
            assert_eq!(
                there.insert(middle(own), count + n),
                None,
                "flap triangle {n} lies on something"
            );
        }
        // Hinges are those of the doubles, along the seam or within the row, and nothing else lies side by side.
        let mut doubled = vec![HashSet::new(); flaps.segments.len()];
        for (n, (flap, own)) in flaps.flaps.iter().zip(&corners).enumerate() {
            let beside = flap.cell.neighbours;
            assert!(beside.iter().flatten().count() >= 2);
            for (k, neighbour) in beside.iter().enumerate() {
                let across = there.get(&middle_beyond(own, k)).copied();
                assert_eq!(across, neighbour.map(|(t, _)| t), "side {k} of flap {n}");
                let Some((t, side)) = *neighbour else {
                    continue;
                };
                let twin = net.twin[3 * flap.double.index() + k].unwrap();
                let (original, place) = if t < count {
                    let far = beyond(&spots[t], 3 * t + side, 3 * flap.double.index() + k);
                    assert_ne!(far, spots[flap.double.index()], "no seam there");
                    assert!(doubled[flap.segment].insert(twin));
                    (t, spots[t])
                } else {
                    let other = &flaps.flaps[t - count];
                    assert_eq!(other.segment, flap.segment);
                    assert_eq!(other.cell.neighbours[side], Some((count + n, k)));
                    (other.double.index(), corners[t - count])
                };
                assert_eq!(twin, 3 * original + side);
                assert_eq!(beyond(own, k, twin), place, "the lattice goes on");
            }
        }
        for (segment, doubled) in flaps.segments.iter().zip(&doubled) {
            assert_eq!(segment.doubled, doubled.len());
            assert!(segment.doubled <= segment.edges);
        }
        let seam = |side: usize| {
            net.twin[side]
                .is_some_and(|twin| beyond(&spots[side / 3], side, twin) != spots[twin / 3])
        };
        let sides = (0..net.twin.len()).filter(|&side| seam(side)).count();
        let edges: usize = flaps.segments.iter().map(|s| s.edges).sum();
        assert_eq!(2 * edges, sides, "every edge of the seam, once");
        let placed: usize = flaps.segments.iter().map(|s| s.flaps).sum();
        assert_eq!(placed, flaps.flaps.len());

        // As one planar linkage: no seam, every flap hangs on the sheet, and touches nothing else in a point.
        let linkage = Linkage::assemble(1.0, Handedness::Right, &cells(laid, &spots, &lattice));
        let whole = flaps.on_sheet(&linkage);
        assert!(whole.hinges.iter().all(|h| !h.seam));
        let inner = flaps
            .flaps
            .iter()
            .flat_map(|f| f.cell.neighbours)
            .flatten()
            .filter(|(t, _)| *t >= count)
            .count();
        let flat = linkage.hinges.iter().filter(|h| !h.seam).count();
        let bridging: usize = doubled.iter().map(HashSet::len).sum();
        assert_eq!(whole.hinges.len(), flat + inner / 2 + bridging);
        let table = whole.flat_neighbours();
        let mut reached = vec![false; whole.triangles.len()];
        let mut stack: Vec<usize> = (0..count).collect();
        while let Some(t) = stack.pop() {
            if !std::mem::replace(&mut reached[t], true) {
                stack.extend(
                    table[TriangleId::from_index(t)]
                        .iter()
                        .flatten()
                        .map(|n| n.0.index()),
                );
            }
        }
        assert!(reached.iter().all(|r| *r), "a flap that hangs on nothing");
        let of = |t: usize| {
            if t < count {
                spots[t]
            } else {
                corners[t - count]
            }
        };
        let mut at: HashMap<Spot, Vec<usize>> = HashMap::new();
        for t in 0..whole.triangles.len() {
            of(t).iter().for_each(|&v| at.entry(v).or_default().push(t));
        }
        for (vertex, around) in at {
            if around.iter().all(|&t| t < count) {
                continue;
            }
            let (mut fan, mut done) = (vec![around[0]], 0);
            while done < fan.len() {
                for (t, _) in table[TriangleId::from_index(fan[done])].iter().flatten() {
                    if of(t.index()).contains(&vertex) && !fan.contains(&t.index()) {
                        fan.push(t.index());
                    }
                }
                done += 1;
            }
            assert_eq!(
                fan.len(),
                around.len(),
                "a flap touches something at {vertex:?}"
            );
        }
        flaps
    }

    /// A cylinder of `around` × `across` cells, cut open along a row of flaps, for tests of later stages.
    pub(crate) fn cylinder(edge_mm: f64, around: i32, across: i32) -> (Linkage, Flaps) {
        let laid = parallelogram(around, across, 0, [true, false]);
        let (net, lattice) = (Net::new(&laid), Lattice::new(edge_mm, 0.3));
        let (spots, _) = lay(&net, 0, [(0, 0), (1, 0), (0, 1)], &|_, _| 1.0);
        let cells = cells(&laid, &spots, &lattice);
        let linkage = Linkage::assemble(edge_mm, Handedness::Left, &cells);
        (linkage, rows(&net, &spots, &laid, &lattice))
    }

    /// A cone of `size` triangles of `n` cells a side each, with `hole` rings left out at its tip, cut open.
    pub(crate) fn cone_sheet(edge_mm: f64, size: usize, n: i32, hole: usize) -> (Linkage, Flaps) {
        let laid = cone(size, n, hole);
        let (net, lattice) = (Net::new(&laid), Lattice::new(edge_mm, 0.2));
        let (spots, _) = lay(&net, 0, [(0, 0), (1, 0), (0, 1)], &|_, _| 1.0);
        let cells = cells(&laid, &spots, &lattice);
        let linkage = Linkage::assemble(edge_mm, Handedness::Right, &cells);
        (linkage, rows(&net, &spots, &laid, &lattice))
    }

    fn cells(laid: &[Laid], spots: &[[Spot; 3]], lattice: &Lattice) -> Vec<Cell> {
        laid.iter()
            .zip(spots)
            .map(|(l, s)| Cell {
                colour: l.colour,
                flat: s.map(|(i, j)| lattice.point(f64::from(i), f64::from(j))),
                neighbours: l.neighbours,
                trim: None,
            })
            .collect()
    }

    fn counts(flaps: &Flaps) -> Vec<(usize, usize, usize)> {
        let mut list: Vec<_> = flaps
            .segments
            .iter()
            .map(|s| (s.edges, s.row, s.flaps))
            .collect();
        list.sort_unstable();
        list
    }

    #[test]
    fn the_straight_seam_of_a_cylinder_gets_a_full_row() {
        for n in [1, 2, 4, 7] {
            let flaps = checked(&parallelogram(12, n, 0, [true, false]));
            let n = n as usize;
            // A lone triangle would dangle from one hinge.
            let got = if n == 1 { 0 } else { 2 * n - 1 };
            assert_eq!(counts(&flaps), [(n, 2 * n - 1, got)]);
            assert_eq!(flaps.bare_edges(), if n == 1 { 1 } else { 0 });
            // The triangles on either side of the row's line take turns.
            let ups = flaps.flaps.iter().filter(|f| f.cell.colour == Colour::Up);
            assert!(ups.count().abs_diff(got / 2) <= 1);
        }
    }

    #[test]
    fn a_torus_gets_a_row_along_both_of_its_seams() {
        for (a, b, skew, length) in [(4, 4, 0, 8), (6, 3, 0, 9), (5, 7, 2, 12), (7, 3, 3, 10)] {
            let flaps = checked(&parallelogram(a, b, skew, [true, true]));
            let edges: usize = flaps.segments.iter().map(|s| s.edges).sum();
            assert_eq!(
                (edges, flaps.bare_edges()),
                (length, 0),
                "{a} × {b}, {skew}"
            );
            for s in &flaps.segments {
                assert_eq!(s.flaps, s.row, "a full row, whatever its bends");
            }
        }
    }

    #[test]
    fn every_edge_of_an_octahedron_that_is_cut_open_gets_a_full_row() {
        for n in [2, 3, 5] {
            let flaps = checked(&octahedron(n));
            let n = n as usize;
            assert_eq!(counts(&flaps), [(n, 2 * n - 1, 2 * n - 1); 5]);
        }
    }

    #[test]
    fn wide_wedges_at_a_cone_hold_the_whole_row() {
        for (size, n, hole) in [(2, 5, 1), (4, 5, 0), (4, 6, 1), (4, 8, 3)] {
            let flaps = checked(&cone(size, n, hole));
            let n = n as usize - hole;
            assert_eq!(counts(&flaps), [(n, 2 * n - 1, 2 * n - 1)], "{size} {n}");
        }
    }

    #[test]
    fn a_wedge_of_sixty_degrees_has_no_room_for_the_first_edge() {
        // Ten triangles around a vertex, cut into twice five. The triangle at the tip would lie against the other side
        // of the wedge, and the next one touch it in a point.
        for n in [3, 5] {
            let flaps = checked(&cone(10, n, 0));
            let n = n as usize;
            assert_eq!(counts(&flaps), [(n, 2 * n - 1, 2 * n - 3); 2]);
            assert_eq!(flaps.bare_edges(), 2);
        }
    }

    #[test]
    fn a_sheet_without_seam_has_no_flaps() {
        for laid in [parallelogram(9, 4, 0, [false, false]), cone(6, 6, 2)] {
            let flaps = checked(&laid);
            assert!(flaps.flaps.is_empty() && flaps.segments.is_empty());
        }
    }

    #[test]
    fn rows_of_saddles_and_double_tori_leave_little_bare() {
        for laid in [
            cone(8, 6, 0),
            saddle_between_cones(4),
            double_torus(6),
            double_torus(9),
        ] {
            let flaps = checked(&laid);
            let edges: usize = flaps.segments.iter().map(|s| s.edges).sum();
            assert!(4 * flaps.bare_edges() <= edges);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..crate::base::cases::cases(40) })]

        /// Whatever is missing from whatever surface: flaps touch nothing but what they hang on.
        #[test]
        fn rows_of_anything_with_holes_are_in_nobodys_way(
            which in 0usize..6, holes in prop::collection::vec(any::<u32>(), 0..60),
        ) {
            let left = with_holes(which, &holes);
            if !left.is_empty() {
                checked(&left);
            }
        }
    }
}
