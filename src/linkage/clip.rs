//! Lays the lattice on a layout and keeps what makes a linkage: triangles whose three corners lie on the surface, each
//! held by at least two others (the 2-core of the adjacency), in one piece. At a smooth rim also triangles that it trims.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Point2;

use super::lattice::{Key, Lattice, across};
use super::net::Net;
use super::trim::{Fate, SmoothRim, Trim, fate, hinge_of_side};
use super::types::Handedness;
use super::walk::Walker;
use super::{Colour, LinkageError};
use crate::base::progress::Progress;
use crate::base::union::Union;
use crate::conformal::Layout;
use crate::mesh::{FaceId, HalfedgeId, Surface};

/// A lattice triangle on the layout.
#[derive(Clone, Debug)]
pub(crate) struct Laid {
    /// The face that holds the centroid.
    pub face: FaceId,
    /// Barycentric coordinates of the centroid in that face.
    pub barycentric: [f64; 3],
    /// Corners in the chart of that face, counter-clockwise.
    pub corners: [Point2<f64>; 3],
    pub colour: Colour,
    /// Per side: the triangle across it and that triangle's side.
    pub neighbours: [Option<(usize, usize)>; 3],
    /// Per side: whether the hinge to that triangle has its ligaments, which a smooth rim may cut off.
    pub held: [bool; 3],
    /// What a smooth rim leaves of it.
    pub trim: Option<Arc<Trim>>,
    /// Its number among all that were laid.
    pub number: u32,
}

impl Laid {
    /// The triangles that it is hinged to.
    fn hinged(&self) -> impl Iterator<Item = usize> + '_ {
        let sides = self.neighbours.iter().zip(&self.held);
        sides.filter_map(|(n, held)| n.filter(|_| *held).map(|n| n.0))
    }
}

/// Closer than this (in L) counts as the same place, or than a few times the seam's gap if that is more: a symmetric
/// mesh has its cut on a line of lattice centroids, and each must be met on one side of it exactly. The walk's own
/// rounding errors are 10⁻¹² of the layout's size.
const TOLERANCE: f64 = 1e-9;

/// Walks on a layout, as exact as its lattice of this edge needs.
pub(super) fn walker<'a>(surface: &'a Surface, layout: &'a Layout, edge_mm: f64) -> Walker<'a> {
    Walker {
        surface,
        layout,
        tolerance_mm: (TOLERANCE * edge_mm).max(4.0 * layout.seam_gap_mm),
    }
}

/// All lattice triangles with their three corners on the surface, with their neighbours, by face and key. With a smooth
/// rim only those of which it leaves enough.
pub(crate) fn lay(
    surface: &Surface,
    layout: &Layout,
    lattice: &Lattice,
    (edge_mm, handedness): (f64, Handedness),
    rim: Option<&SmoothRim>,
    progress: &dyn Progress,
) -> Result<Vec<Laid>, LinkageError> {
    let walker = walker(surface, layout, edge_mm);
    let entries = centroids(&walker, lattice);
    let index: HashMap<(FaceId, Key), usize> =
        entries.iter().enumerate().map(|(n, e)| (*e, n)).collect();
    let same = merge(&walker, lattice, &entries, &index);
    progress.check()?;

    let mut number = vec![usize::MAX; entries.len()];
    let mut laid: Vec<Laid> = Vec::new();
    let mut keys: Vec<Key> = Vec::new();
    for (n, &(face, key)) in entries.iter().enumerate() {
        if same[n] != n {
            continue;
        }
        let (centroid, corners) = (lattice.centroid(key), lattice.corners(key));
        if corners
            .iter()
            .all(|&c| walker.walk(face, centroid, c).is_some())
        {
            let trim = match rim.map(|rim| fate(&walker, rim, face, centroid, &corners)) {
                Some(Fate::Gone) => continue,
                Some(Fate::Trimmed(trim)) => Some(Arc::new(trim)),
                Some(Fate::Whole) | None => None,
            };
            number[n] = laid.len();
            keys.push(key);
            laid.push(Laid {
                face,
                barycentric: walker.barycentric(face, centroid),
                corners,
                colour: key.colour,
                neighbours: [None; 3],
                held: [true; 3],
                trim,
                number: laid.len() as u32,
            });
        }
    }
    progress.check()?;
    for n in 0..laid.len() {
        for side in 0..3 {
            let Some((entry, shared)) = step(&walker, lattice, &index, laid[n].face, keys[n], side)
            else {
                continue;
            };
            let other = number[same[entry]];
            if other == usize::MAX {
                continue;
            }
            // The shared side runs the other way in the neighbour, whatever its chart's rotation.
            let (face, motion) = shared;
            let end = motion.apply(laid[n].corners[(side + 1) % 3]);
            let Some(end) = to_chart(&walker, face, end, entries[same[entry]].0) else {
                continue;
            };
            let their_side = (0..3).min_by(|&a, &b| {
                (laid[other].corners[a] - end)
                    .norm()
                    .total_cmp(&(laid[other].corners[b] - end).norm())
            });
            laid[n].neighbours[side] = their_side.map(|s| (other, s));
        }
    }
    // A neighbour that does not know us back (a slot narrower than a triangle between the two) is none.
    for n in 0..laid.len() {
        for side in 0..3 {
            if let Some((other, s)) = laid[n].neighbours[side]
                && laid[other].neighbours[s] != Some((n, side))
            {
                laid[n].neighbours[side] = None;
            }
        }
    }
    let has_room = |n: usize, side: usize| {
        let trim = &laid[n].trim;
        let hinge = hinge_of_side(handedness, laid[n].colour, side);
        trim.as_ref().is_none_or(|t| t.beyond != hinge)
    };
    let held: Vec<[bool; 3]> = (0..laid.len())
        .map(|n| {
            std::array::from_fn(|side| {
                let beyond = laid[n].neighbours[side];
                has_room(n, side) && beyond.is_none_or(|(other, theirs)| has_room(other, theirs))
            })
        })
        .collect();
    for (triangle, held) in laid.iter_mut().zip(held) {
        triangle.held = held;
    }
    Ok(laid)
}

/// Every (face, triangle) with the centroid in the face, faces in order; a centroid on an edge comes once per face.
fn centroids(walker: &Walker<'_>, lattice: &Lattice) -> Vec<(FaceId, Key)> {
    let mut found = Vec::new();
    for (face, corners) in walker.layout.corners.iter_ids() {
        let at = corners.map(|c| lattice.coordinates(c));
        let range = |of: fn(&(f64, f64)) -> f64| {
            let low = at.iter().map(of).fold(f64::INFINITY, f64::min);
            let high = at.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            // The centroids of a cell lie at 1/3 and 2/3 of it.
            ((low - 0.7).floor() as i32, (high - 0.3).ceil() as i32)
        };
        let ((i0, i1), (j0, j1)) = (range(|c| c.0), range(|c| c.1));
        for i in i0..=i1 {
            for j in j0..=j1 {
                for colour in [Colour::Up, Colour::Down] {
                    let key = Key { i, j, colour };
                    if walker.contains(face, lattice.centroid(key)) {
                        found.push((face, key));
                    }
                }
            }
        }
    }
    found
}

/// For every entry the first entry that is the same point of the surface: centroids on mesh edges are met from
/// several faces.
fn merge(
    walker: &Walker<'_>,
    lattice: &Lattice,
    entries: &[(FaceId, Key)],
    index: &HashMap<(FaceId, Key), usize>,
) -> Vec<usize> {
    let mut same = Union::new(entries.len());
    for (n, &(face, key)) in entries.iter().enumerate() {
        let point = lattice.centroid(key);
        for (side, depth) in walker.depths(face, point).into_iter().enumerate() {
            if depth > walker.tolerance_mm {
                continue;
            }
            if let Some((twin, motion)) = walker.cross(HalfedgeId::side(face, side)) {
                let theirs = (twin.face(), lattice.key_at_centroid(motion.apply(point)));
                if let Some(&other) = index.get(&theirs) {
                    same.join(n, other);
                }
            }
        }
    }
    (0..entries.len()).map(|n| same.root(n)).collect()
}

/// The entry of the triangle across a side, reached on foot: straight from centroid to centroid, or around by one of
/// the two common corners where a notch in the rim bars the straight way.
fn step(
    walker: &Walker<'_>,
    lattice: &Lattice,
    index: &HashMap<(FaceId, Key), usize>,
    face: FaceId,
    key: Key,
    side: usize,
) -> Option<(usize, (FaceId, crate::conformal::Transition))> {
    let (from, corners) = (lattice.centroid(key), lattice.corners(key));
    let goal = lattice.centroid(across(key, side));
    let straight = || walker.walk(face, from, goal);
    let around = |corner: Point2<f64>| {
        let half = walker.walk(face, from, corner)?;
        let rest = walker.walk(
            half.face,
            half.motion.apply(corner),
            half.motion.apply(goal),
        )?;
        Some(super::walk::Arrival {
            face: rest.face,
            motion: half.motion.then(&rest.motion),
        })
    };
    let arrival = straight()
        .or_else(|| around(corners[side]))
        .or_else(|| around(corners[(side + 1) % 3]))?;
    let there = arrival.motion.apply(goal);
    if let Some(&entry) = index.get(&(arrival.face, lattice.key_at_centroid(there))) {
        return Some((entry, (arrival.face, arrival.motion)));
    }
    // On an edge, within rounding: the neighbouring face has it.
    (0..3).find_map(|k| {
        let (twin, motion) = walker.cross(HalfedgeId::side(arrival.face, k))?;
        let entry = *index.get(&(twin.face(), lattice.key_at_centroid(motion.apply(there))))?;
        Some((entry, (twin.face(), arrival.motion.then(&motion))))
    })
}

/// Takes a point from the chart of `from` to that of `to`, which is `from` itself or shares an edge or a vertex with it.
fn to_chart(
    walker: &Walker<'_>,
    from: FaceId,
    point: Point2<f64>,
    to: FaceId,
) -> Option<Point2<f64>> {
    let mut front = vec![(from, point)];
    for _ in 0..3 {
        if let Some((_, p)) = front.iter().find(|(f, _)| *f == to) {
            return Some(*p);
        }
        let next: Vec<(FaceId, Point2<f64>)> = front
            .iter()
            .flat_map(|&(f, p)| {
                (0..3).filter_map(move |k| {
                    let (twin, motion) = walker.cross(HalfedgeId::side(f, k))?;
                    Some((twin.face(), motion.apply(p)))
                })
            })
            .collect();
        front.extend(next);
    }
    front.iter().find(|(f, _)| *f == to).map(|(_, p)| *p)
}

/// Drops the triangles for which `keep` is false, then those held by fewer than two others, again and again, then all
/// but the largest piece. Returns what is left, renumbered, and how many the last two rules cost.
pub(crate) fn core(laid: &[Laid], keep: impl Fn(usize) -> bool) -> (Vec<Laid>, usize) {
    let mut alive: Vec<bool> = (0..laid.len()).map(keep).collect();
    let asked = alive.iter().filter(|a| **a).count();
    let degree_of =
        |alive: &[bool], n: usize| laid[n].hinged().filter(|other| alive[*other]).count();
    let mut queue: Vec<usize> = (0..laid.len())
        .filter(|&n| alive[n] && degree_of(&alive, n) < 2)
        .collect();
    while let Some(n) = queue.pop() {
        if !alive[n] {
            continue;
        }
        alive[n] = false;
        for other in laid[n].hinged() {
            if alive[other] && degree_of(&alive, other) < 2 {
                queue.push(other);
            }
        }
    }
    let mut piece = vec![usize::MAX; laid.len()];
    let mut best = (0, usize::MAX);
    let mut stack = Vec::new();
    for seed in 0..laid.len() {
        if !alive[seed] || piece[seed] != usize::MAX {
            continue;
        }
        let mut count = 0;
        piece[seed] = seed;
        stack.push(seed);
        while let Some(n) = stack.pop() {
            count += 1;
            for other in laid[n].hinged() {
                if alive[other] && piece[other] == usize::MAX {
                    piece[other] = seed;
                    stack.push(other);
                }
            }
        }
        if count > best.0 {
            best = (count, seed);
        }
    }
    let mut number = vec![usize::MAX; laid.len()];
    let mut left = 0;
    for n in 0..laid.len() {
        if alive[n] && piece[n] == best.1 {
            number[n] = left;
            left += 1;
        }
    }
    let kept: Vec<Laid> = laid
        .iter()
        .enumerate()
        .filter(|(n, _)| number[*n] != usize::MAX)
        .map(|(_, old)| {
            let mut new = old.clone();
            for neighbour in &mut new.neighbours {
                *neighbour = neighbour
                    .filter(|(n, _)| number[*n] != usize::MAX)
                    .map(|(n, side)| (number[n], side));
            }
            new
        })
        .collect();
    let lost = asked - kept.len();
    (kept, lost)
}

/// The triangles to remove at cones: `count` around each vertex of four triangles, nearest first, ring by ring, and in
/// proportion around one of two, whose own two go in any case: they share two sides and cannot both be hinged.
pub(crate) fn around_cones(laid: &[Laid], count: usize) -> Vec<bool> {
    let net = Net::new(laid);
    let around = |node: usize| net.leaving[node].iter().map(|side| side / 3);
    let inner = |node: &usize| !net.rim[*node];
    let mut removed = vec![false; laid.len()];
    for node in (0..net.rim.len()).filter(inner) {
        let size = net.leaving[node].len();
        if size >= 6 {
            continue;
        }
        let wanted = (count * size)
            .div_ceil(4)
            .max(if size < 3 { size } else { 0 });
        let mut taken = Vec::new();
        let mut ring: Vec<usize> = around(node).collect();
        while taken.len() < wanted && !ring.is_empty() {
            ring.sort_unstable();
            ring.dedup();
            ring.retain(|t| !taken.contains(t));
            ring.truncate(wanted - taken.len());
            taken.extend(&ring);
            ring = ring
                .iter()
                .flat_map(|&t| 3 * t..3 * t + 3)
                .map(|side| net.node[side])
                .filter(inner)
                .flat_map(around)
                .collect();
        }
        taken.iter().for_each(|&t| removed[t] = true);
    }
    removed
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of up and down triangles, closed to a ring if asked.
    fn row(count: usize, ring: bool) -> Vec<Laid> {
        let link = |n: usize| Some((n, 0));
        (0..count)
            .map(|n| Laid {
                face: FaceId(0),
                barycentric: [1.0, 0.0, 0.0],
                corners: [Point2::origin(); 3],
                colour: Colour::Up,
                number: n as u32,
                held: [true; 3],
                trim: None,
                neighbours: [
                    if n + 1 < count {
                        link(n + 1)
                    } else if ring {
                        link(0)
                    } else {
                        None
                    },
                    if n > 0 {
                        link(n - 1)
                    } else if ring {
                        link(count - 1)
                    } else {
                        None
                    },
                    None,
                ],
            })
            .collect()
    }

    #[test]
    fn the_core_of_a_chain_is_empty_and_that_of_a_ring_is_the_ring() {
        assert_eq!(core(&row(9, false), |_| true).0.len(), 0);
        assert_eq!(core(&row(9, true), |_| true).0.len(), 9);
        assert_eq!(
            core(&row(9, true), |n| n != 4).0.len(),
            0,
            "a broken ring falls to pieces"
        );
    }
}
