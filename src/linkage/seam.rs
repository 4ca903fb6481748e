//! Chooses where the linkage is cut open, so that its triangles can lie flat.
//!
//! The cut that unfolded the mesh is of no use on the sheet: it runs along mesh edges. Here the seam is chosen anew
//! along lattice edges: a tree that joins all nodes with a holonomy (a cone, the hole left where its triangles were
//! removed, a rim around which the pattern turns or shifts), nearest first, straight where possible; then the loops
//! that open every handle, by the greedy homotopy generators of Erickson and Whittlesey (2005): a tree of shortest
//! ways, a maximum spanning tree of the triangles that crosses none of them, and one loop for each side left over.
//!
//! A vertex with eight triangles must not be the tree's leaf: 480° do not lie flat. It gets a second way out, and the
//! dearest part of the seam that this makes superfluous is closed again. Where none does, the sheet falls in two.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::net::{Net, next};
use crate::base::union::Union;

/// Price of a turn by 60° at a vertex of the seam, in edges. A seam with fewer corners is easier to close by hand;
/// half an edge still prefers a way that is one edge shorter to one with two corners fewer.
const TURN_PRICE: u64 = 5;
/// Price of an edge, in the same units.
const EDGE_PRICE: f64 = 10.0;
/// Most triangles of one vertex in one piece where it is cut: with six, both sides of the cut would lie on one line.
const MOST_IN_SECTOR: usize = 5;

/// What the price of an edge is multiplied by, given a triangle and its side; 1 or more, and the dearer of the two
/// sides counts.
pub(crate) type Price<'a> = &'a dyn Fn(usize, usize) -> f64;

/// How a search goes on from a node that it has reached.
enum Onward {
    /// Through it.
    Pass,
    /// Not through it.
    Stay,
    /// No farther at all.
    Done,
}

/// The seam being chosen.
pub(super) struct Seam<'a> {
    net: &'a Net,
    /// Price of each side.
    price: Vec<u64>,
    /// Sides along which the sheet is cut open, from both sides.
    pub cut: Vec<bool>,
}

impl<'a> Seam<'a> {
    /// The seam of a net.
    pub fn choose(net: &'a Net, price: Price<'_>) -> Self {
        let one = |side: usize| (EDGE_PRICE * price(side / 3, side % 3).max(1.0)).round() as u64;
        let price = (0..net.twin.len())
            .map(|side| one(side).max(net.twin[side].map_or(0, one)))
            .collect();
        let mut seam = Self {
            net,
            price,
            cut: vec![false; net.twin.len()],
        };
        let joined = seam.join();
        seam.open_handles(&joined);
        seam.relieve();
        seam
    }

    fn set(&mut self, side: usize, cut: bool) {
        self.cut[side] = cut;
        if let Some(twin) = self.net.twin[side] {
            self.cut[twin] = cut;
        }
    }

    /// Joins all nodes with a holonomy by a tree: again and again the nearest. Returns the nodes on it.
    fn join(&mut self) -> Vec<bool> {
        let net = self.net;
        let mut joined = vec![false; net.flat.len()];
        // From the longest rim, which is the outer one as a rule.
        let first = (0..net.flat.len())
            .filter(|&n| !net.flat[n])
            .max_by_key(|&n| {
                (
                    net.rim[n],
                    if net.rim[n] { net.leaving[n].len() } else { 0 },
                    Reverse(n),
                )
            })
            .or((net.handles() > 0).then_some(0));
        let Some(first) = first else { return joined };
        joined[first] = true;
        loop {
            let starts = (0..joined.len())
                .filter(|&n| joined[n])
                .flat_map(|n| self.exits(n));
            let mut reached = None;
            let before = self.explore(starts, |_, side| {
                let head = net.head(side);
                match (joined[head], net.flat[head]) {
                    (true, _) => Onward::Stay,
                    (_, true) => Onward::Pass,
                    _ => {
                        reached = Some(side);
                        Onward::Done
                    }
                }
            });
            let Some(last) = reached else { return joined };
            for side in path(&before, last) {
                self.set(side, true);
                joined[net.node[side]] = true;
                joined[net.head(side)] = true;
            }
        }
    }

    /// Adds loops until what is not cut has no handle.
    fn open_handles(&mut self, joined: &[bool]) {
        let net = self.net;
        if net.handles() == 0 {
            return;
        }
        // The tree of ways: by which side each node was reached first, and for what price.
        let mut arrival: Vec<Option<(u64, usize)>> = vec![None; joined.len()];
        let starts = (0..joined.len())
            .filter(|&n| joined[n])
            .flat_map(|n| self.exits(n));
        self.explore(starts, |price, side| {
            let head = net.head(side);
            if joined[head] || arrival[head].is_some() {
                return Onward::Stay;
            }
            arrival[head] = Some((price, side));
            Onward::Pass
        });
        let mut taken = self.cut.clone();
        for side in arrival.iter().flatten().map(|a| a.1) {
            taken[side] = true;
            net.twin[side]
                .into_iter()
                .for_each(|twin| taken[twin] = true);
        }
        let price = |node: usize| arrival[node].map_or(0, |a| a.0);
        let mut free: Vec<(Reverse<u64>, usize, usize)> = (0..taken.len())
            .filter(|&side| !taken[side])
            .filter_map(|side| net.twin[side].map(|twin| (side, twin)))
            .filter(|(side, twin)| side < twin)
            .map(|(side, twin)| {
                let around = price(net.node[side]) + self.price[side] + price(net.head(side));
                (Reverse(around), side, twin)
            })
            .collect();
        free.sort_unstable();
        let mut trees = Union::new(net.twin.len() / 3);
        for (_, side, twin) in free {
            if trees.join(side / 3, twin / 3) {
                continue;
            }
            self.set(side, true);
            for mut node in [net.node[side], net.head(side)] {
                while let Some((_, side)) = arrival[node] {
                    self.set(side, true);
                    node = net.node[side];
                }
            }
        }
    }

    /// Gives every crowded vertex as many ways out as it takes to lie flat.
    fn relieve(&mut self) {
        for node in 0..self.net.flat.len() {
            // Each way halves a sector or takes five triangles from it.
            for _ in 0..self.net.leaving[node].len() {
                let sectors = self.sectors(node);
                let Some(sector) = sectors.into_iter().find(|s| s.len() > MOST_IN_SECTOR) else {
                    break;
                };
                if !self.net.crowded(node) || !self.cut[sector[0]] || !self.second_way(&sector) {
                    break;
                }
            }
        }
    }

    /// The sides that leave a vertex, from each one that is cut to the one before the next; all in one if none is.
    fn sectors(&self, node: usize) -> Vec<Vec<usize>> {
        let mut leaving = self.net.leaving[node].clone();
        let first = leaving.iter().position(|&side| self.cut[side]);
        leaving.rotate_left(first.unwrap_or(0));
        leaving
            .chunk_by(|_, &side| !self.cut[side])
            .map(<[usize]>::to_vec)
            .collect()
    }

    /// Whether a node would lie flat if these sides were closed again.
    fn holds(&self, node: usize, closed: &[usize]) -> bool {
        if !self.net.crowded(node) {
            return true;
        }
        let mut without = Self {
            net: self.net,
            price: Vec::new(),
            cut: self.cut.clone(),
        };
        closed.iter().for_each(|&side| without.set(side, false));
        without
            .sectors(node)
            .iter()
            .all(|s| s.len() <= MOST_IN_SECTOR)
    }

    /// Sides on which the seam may leave a node: at a crowded vertex those that leave no sector too large.
    fn exits(&self, node: usize) -> Vec<usize> {
        if !self.net.crowded(node) {
            let leaving = self.net.leaving[node].iter();
            return leaving.copied().filter(|&side| !self.cut[side]).collect();
        }
        self.sectors(node)
            .iter()
            .flat_map(|s| self.halving(s))
            .collect()
    }

    /// The sides of a sector that divide it well.
    fn halving<'s>(&self, sector: &'s [usize]) -> impl Iterator<Item = usize> + use<'s> {
        let count = sector.len();
        let bordered = self.cut[sector[0]];
        let fair = move |k: usize| {
            let larger = k.max(count - k);
            count <= MOST_IN_SECTOR || larger <= MOST_IN_SECTOR.max(count - MOST_IN_SECTOR)
        };
        (0..count)
            .filter(move |&k| !bordered || (k > 0 && fair(k)))
            .map(|k| sector[k])
    }

    /// Cheapest ways over sides that are not cut, starting with the sides given. `reach` hears of every side in the
    /// order of its price, and says how to go on from its head. Returns the side before each; see [`path`].
    fn explore(
        &self,
        starts: impl Iterator<Item = usize>,
        mut reach: impl FnMut(u64, usize) -> Onward,
    ) -> Vec<usize> {
        let net = self.net;
        let mut best = vec![u64::MAX; net.twin.len()];
        let mut before = vec![usize::MAX; net.twin.len()];
        let mut left_rim = vec![false; net.rim.len()];
        let mut queue = BinaryHeap::new();
        for side in starts {
            best[side] = self.price[side];
            queue.push(Reverse((best[side], side)));
        }
        while let Some(Reverse((so_far, here))) = queue.pop() {
            if so_far > best[here] {
                continue;
            }
            match reach(so_far, here) {
                Onward::Pass => {}
                Onward::Stay => continue,
                Onward::Done => break,
            }
            let mut go = |side: usize, turn: u64| {
                let total = so_far + self.price[side] + turn;
                if !self.cut[side] && total < best[side] {
                    best[side] = total;
                    before[side] = here;
                    queue.push(Reverse((total, side)));
                }
            };
            let head = net.head(here);
            if net.rim[head] {
                // Once is enough: nobody leaves a rim for less than the first who came.
                if !std::mem::replace(&mut left_rim[head], true) {
                    net.leaving[head].iter().for_each(|&side| go(side, 0));
                }
                continue;
            }
            // Clockwise around the head, from the sharpest left; half of its triangles on the left is straight on.
            let count = net.leaving[head].len();
            let mut side = next(here);
            for corners in 1..count {
                let turn = (2 * corners).abs_diff(count) as u64;
                go(side, TURN_PRICE * turn * turn / 4);
                let Some(twin) = net.twin[side] else { break };
                side = next(twin);
            }
        }
        before
    }

    /// Leads the seam out of a vertex through a sector that is too large, to where it costs least, what can be closed
    /// again deducted, and preferably so that the sheet stays in one piece. False if there is no way.
    fn second_way(&mut self, sector: &[usize]) -> bool {
        let net = self.net;
        let rim = self.rim_from(sector[0]);
        // Where on the sheet's rim a corner lies, and each side.
        let mut place = vec![usize::MAX; net.twin.len()];
        let mut at = vec![usize::MAX; net.twin.len()];
        for (k, &side) in rim.iter().enumerate() {
            at[side] = k;
            let mut corner = next(side);
            place[corner] = k;
            while let (false, Some(twin)) = (self.cut[corner], net.twin[corner]) {
                corner = next(twin);
                place[corner] = k;
            }
        }
        let joined: Vec<bool> = (0..net.flat.len())
            .map(|n| net.rim[n] || net.leaving[n].iter().any(|&side| self.cut[side]))
            .collect();
        let mut best: Option<((bool, i64, usize), Vec<usize>)> = None;
        let before = self.explore(self.halving(sector), |price, side| {
            if !joined[net.head(side)] {
                return Onward::Pass;
            }
            // A rim of its own is not on the sheet's outer one: to reach it splits nothing.
            let end = place[next(side)];
            let spare = if end == usize::MAX {
                Vec::new()
            } else {
                self.spare(&rim, &at, end)
            };
            let gain: u64 = spare.iter().map(|&s| self.price[s]).sum();
            let rank = (
                end != usize::MAX && spare.is_empty(),
                price as i64 - gain as i64,
                side,
            );
            if best.as_ref().is_none_or(|(least, _)| rank < *least) {
                best = Some((rank, spare));
            }
            Onward::Stay
        });
        let Some(((_, _, last), spare)) = best else {
            return false;
        };
        spare.into_iter().for_each(|side| self.set(side, false));
        path(&before, last)
            .into_iter()
            .for_each(|side| self.set(side, true));
        true
    }

    /// The rim of the cut-open sheet from a side on it, around to itself.
    fn rim_from(&self, first: usize) -> Vec<usize> {
        let mut rim = vec![first];
        loop {
            let mut side = next(rim[rim.len() - 1]);
            while let (false, Some(twin)) = (self.cut[side], self.net.twin[side]) {
                side = next(twin);
            }
            if side == first {
                return rim;
            }
            rim.push(side);
        }
    }

    /// The dearest part of the seam that may be closed once a way leads from the start of the sheet's `rim` to the end
    /// of its side `end`: its two sides then belong to two pieces, which it joins again.
    fn spare(&self, rim: &[usize], at: &[usize], end: usize) -> Vec<usize> {
        let net = self.net;
        let parting = |side: usize| {
            net.twin[side].is_some_and(|twin| at[twin] != usize::MAX && at[twin] > end)
        };
        let through = |node: usize| {
            net.flat[node]
                && !net.rim[node]
                && net.leaving[node]
                    .iter()
                    .filter(|&&side| self.cut[side])
                    .count()
                    == 2
        };
        let own = net.node[rim[0]];
        rim[..=end]
            .chunk_by(|&a, &b| parting(a) == parting(b) && through(net.head(a)))
            .filter(|run| parting(run[0]))
            .filter(|run| {
                let ends = [net.node[run[0]], net.head(run[run.len() - 1])];
                ends.iter()
                    .all(|&node| node != own && self.holds(node, run))
            })
            .max_by_key(|run| run.iter().map(|&side| self.price[side]).sum::<u64>())
            .map(<[usize]>::to_vec)
            .unwrap_or_default()
    }
}

/// The sides that lead to `last`, in order.
fn path(before: &[usize], last: usize) -> Vec<usize> {
    let mut sides: Vec<usize> = std::iter::successors(Some(last), |&side| {
        before.get(before[side]).map(|_| before[side])
    })
    .collect();
    sides.reverse();
    sides
}
