//! Lays the triangles flat on the sheet, cut open along lattice lines where cones forbid one piece.
//!
//! The cut that unfolded the mesh is of no use on the sheet: it runs along mesh edges. Here the seam is chosen anew
//! as the shortest path over lattice edges, straight where possible, from every cone (or the hole left where its
//! triangles were removed) to the outer rim. Flat positions are whole lattice positions, found by unfolding triangle
//! by triangle.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, VecDeque};

use nalgebra::Point2;

use super::Colour;
use super::clip::Laid;
use super::lattice::{Key, Lattice, corner_indices};

/// Price of a turn by 60° at a vertex of the seam, in edges. A seam with fewer corners is easier to close by hand;
/// half an edge still prefers a way that is one edge shorter to one with two corners fewer.
const TURN_PRICE: u64 = 5;
/// Price of an edge, in the same units.
const EDGE_PRICE: u64 = 10;

/// Flat triangles.
#[derive(Clone, Debug)]
pub(crate) struct Flat {
    /// Closed corners on the sheet, millimetres, per triangle.
    pub corners: Vec<[Point2<f64>; 3]>,
    /// Pairs of triangles that came to lie on one another.
    pub overlaps: Vec<(usize, usize)>,
    /// Lattice edges of the seam.
    pub seam_edges: usize,
}

/// A fan of triangles around one lattice vertex; a vertex where two fans touch is two of them.
struct Fans {
    /// Fan of every corner.
    of: Vec<[usize; 3]>,
    /// Triangles in each fan.
    size: Vec<usize>,
    /// True if the fan does not close: its vertex lies on a rim.
    open: Vec<bool>,
}

impl Fans {
    fn new(laid: &[Laid]) -> Self {
        let mut parent: Vec<usize> = (0..3 * laid.len()).collect();
        fn root(parent: &mut [usize], mut n: usize) -> usize {
            while parent[n] != n {
                parent[n] = parent[parent[n]];
                n = parent[n];
            }
            n
        }
        for (t, triangle) in laid.iter().enumerate() {
            for (side, neighbour) in triangle.neighbours.iter().enumerate() {
                let Some((other, s)) = *neighbour else {
                    continue;
                };
                for (mine, theirs) in [(side, (s + 1) % 3), ((side + 1) % 3, s)] {
                    let (a, b) = (
                        root(&mut parent, 3 * t + mine),
                        root(&mut parent, 3 * other + theirs),
                    );
                    parent[a.max(b)] = a.min(b);
                }
            }
        }
        let mut number = vec![usize::MAX; parent.len()];
        let (mut size, mut open) = (Vec::new(), Vec::new());
        let mut of = vec![[0; 3]; laid.len()];
        for (t, triangle) in laid.iter().enumerate() {
            for k in 0..3 {
                let r = root(&mut parent, 3 * t + k);
                if number[r] == usize::MAX {
                    number[r] = size.len();
                    size.push(0);
                    open.push(false);
                }
                let fan = number[r];
                of[t][k] = fan;
                size[fan] += 1;
                open[fan] |=
                    triangle.neighbours[k].is_none() || triangle.neighbours[(k + 2) % 3].is_none();
            }
        }
        Self { of, size, open }
    }
}

/// Rims of the linkage as loops of fans, with their turning in units of 60° (a disk's rim turns by +6).
fn rims(laid: &[Laid], fans: &Fans) -> Vec<(Vec<usize>, i64)> {
    let mut seen = vec![[false; 3]; laid.len()];
    let mut loops = Vec::new();
    for t in 0..laid.len() {
        for s in 0..3 {
            if seen[t][s] || laid[t].neighbours[s].is_some() {
                continue;
            }
            let (mut members, mut turning) = (Vec::new(), 0i64);
            let (mut triangle, mut side) = (t, s);
            while !seen[triangle][side] {
                seen[triangle][side] = true;
                let fan = fans.of[triangle][(side + 1) % 3];
                members.push(fan);
                turning += 3 - fans.size[fan] as i64;
                side = (side + 1) % 3;
                while let Some((other, back)) = laid[triangle].neighbours[side] {
                    (triangle, side) = (other, (back + 1) % 3);
                }
            }
            loops.push((members, turning));
        }
    }
    loops.sort_by_key(|(members, _)| Reverse(members.len()));
    loops
}

/// Chooses the seam and lays every triangle flat. `root` keeps the place that it has in its chart.
pub(crate) fn flatten(laid: &[Laid], lattice: &Lattice, root: usize) -> Flat {
    let fans = Fans::new(laid);
    let mut cut = vec![[false; 3]; laid.len()];
    let rims = rims(laid, &fans);
    // Where a seam may end: the outer rim, and whatever an earlier seam has reached.
    let mut goal = vec![false; fans.size.len()];
    if let Some((outer, _)) = rims.first() {
        outer.iter().for_each(|&fan| goal[fan] = true);
    }
    let mut sources: Vec<Vec<usize>> = (0..fans.size.len())
        .filter(|&fan| !fans.open[fan] && fans.size[fan] != 6)
        .map(|fan| vec![fan])
        .collect();
    sources.extend(
        rims.into_iter()
            .skip(1)
            .filter(|(_, turning)| turning.rem_euclid(6) != 0)
            .map(|(m, _)| m),
    );
    let mut seam_edges = 0;
    for source in sources {
        if source.iter().any(|&fan| goal[fan]) {
            continue;
        }
        for (t, side) in seam_path(laid, &fans, &source, &goal) {
            cut[t][side] = true;
            if let Some((other, back)) = laid[t].neighbours[side] {
                cut[other][back] = true;
            }
            goal[fans.of[t][side]] = true;
            seam_edges += 1;
        }
        source.iter().for_each(|&fan| goal[fan] = true);
    }
    let keys = unfold(laid, lattice, &cut, root);
    let mut first: HashMap<Key, usize> = HashMap::with_capacity(keys.len());
    let mut overlaps = Vec::new();
    for (t, (key, _)) in keys.iter().enumerate() {
        if let Some(&other) = first.get(key) {
            overlaps.push((other, t));
        } else {
            first.insert(*key, t);
        }
    }
    let corners = keys
        .iter()
        .map(|&(key, turn)| {
            let c = lattice.corners(key);
            std::array::from_fn(|k| c[(k + turn) % 3])
        })
        .collect();
    Flat {
        corners,
        overlaps,
        seam_edges,
    }
}

/// The cheapest path from any source fan to any goal fan over sides that have triangles on both sides, as directed
/// sides (triangle on the left).
fn seam_path(laid: &[Laid], fans: &Fans, source: &[usize], goal: &[bool]) -> Vec<(usize, usize)> {
    let id = |t: usize, s: usize| 3 * t + s;
    let mut price = vec![u64::MAX; 3 * laid.len()];
    let mut before = vec![usize::MAX; 3 * laid.len()];
    let mut queue = BinaryHeap::new();
    let start: std::collections::HashSet<usize> = source.iter().copied().collect();
    for t in 0..laid.len() {
        for s in 0..3 {
            if start.contains(&fans.of[t][s]) && laid[t].neighbours[s].is_some() {
                price[id(t, s)] = EDGE_PRICE;
                queue.push(Reverse((EDGE_PRICE, id(t, s))));
            }
        }
    }
    while let Some(Reverse((so_far, here))) = queue.pop() {
        if so_far > price[here] {
            continue;
        }
        let (t, s) = (here / 3, here % 3);
        let head = fans.of[t][(s + 1) % 3];
        if goal[head] {
            let mut path = Vec::new();
            let mut at = here;
            while at != usize::MAX {
                path.push((at / 3, at % 3));
                at = before[at];
            }
            path.reverse();
            return path;
        }
        if fans.open[head] {
            continue;
        }
        // Turn clockwise around the head from the sharpest left to the sharpest right; three corners on the left is
        // straight on.
        let (mut triangle, mut side) = (t, (s + 1) % 3);
        for corners in 1..fans.size[head] {
            let turn = (corners as i64 - 3).unsigned_abs();
            let total = so_far + EDGE_PRICE + TURN_PRICE * turn * turn;
            if laid[triangle].neighbours[side].is_some() && total < price[id(triangle, side)] {
                price[id(triangle, side)] = total;
                before[id(triangle, side)] = here;
                queue.push(Reverse((total, id(triangle, side))));
            }
            let Some((other, back)) = laid[triangle].neighbours[side] else {
                break;
            };
            (triangle, side) = (other, (back + 1) % 3);
        }
    }
    Vec::new()
}

/// Lattice triangle of every triangle, and which of its corners is the triangle's corner 0, by unfolding across sides
/// that are not cut.
fn unfold(laid: &[Laid], lattice: &Lattice, cut: &[[bool; 3]], root: usize) -> Vec<(Key, usize)> {
    let centre =
        |c: &[Point2<f64>; 3]| Point2::from((c[0].coords + c[1].coords + c[2].coords) / 3.0);
    // The lattice triangle with these corners; the first that matches tells the rotation.
    let place = |indices: [(i32, i32); 3], colour: Colour| -> (Key, usize) {
        let (mut i, mut j) = (i32::MAX, i32::MAX);
        for (a, b) in indices {
            (i, j) = (i.min(a), j.min(b));
        }
        let key = Key { i, j, colour };
        let turn = corner_indices(key)
            .iter()
            .position(|c| *c == indices[0])
            .unwrap_or(0);
        (key, turn)
    };
    let corner = |&(key, turn): &(Key, usize), k: usize| corner_indices(key)[(k + turn) % 3];
    let mut placed: Vec<Option<(Key, usize)>> = vec![None; laid.len()];
    let mut queue = VecDeque::new();
    // Every piece gets a root; the linkage is one piece unless the seam cuts it in two.
    for seed in std::iter::once(root).chain(0..laid.len()) {
        if placed[seed].is_some() {
            continue;
        }
        let key = lattice.key_at_centroid(centre(&laid[seed].corners));
        let corners = lattice.corners(key);
        let nearest = |k: &usize| (corners[*k] - laid[seed].corners[0]).norm();
        let turn = (0..3)
            .min_by(|a, b| nearest(a).total_cmp(&nearest(b)))
            .unwrap_or(0);
        placed[seed] = Some((key, turn));
        queue.push_back(seed);
        while let Some(t) = queue.pop_front() {
            let Some(here) = placed[t] else { continue };
            for side in 0..3 {
                let Some((other, back)) = laid[t].neighbours[side] else {
                    continue;
                };
                if cut[t][side] || placed[other].is_some() {
                    continue;
                }
                let (a, b) = (corner(&here, side), corner(&here, (side + 1) % 3));
                let c = corner(&here, (side + 2) % 3);
                let mut indices = [(0, 0); 3];
                indices[back] = b;
                indices[(back + 1) % 3] = a;
                indices[(back + 2) % 3] = (a.0 + b.0 - c.0, a.1 + b.1 - c.1);
                placed[other] = Some(place(indices, here.0.colour.other()));
                queue.push_back(other);
            }
        }
    }
    let origin = (
        Key {
            i: 0,
            j: 0,
            colour: Colour::Up,
        },
        0,
    );
    placed.into_iter().map(|p| p.unwrap_or(origin)).collect()
}
