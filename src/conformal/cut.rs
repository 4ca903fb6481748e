//! The cut graph: edges along which a surface is opened so that a disk is left, which can lie flat.
//!
//! It is a tree that joins all cones and rims, each by the cheapest way to what is joined already, and, for every
//! handle, two loops from the tree around it: the edges outside both a shortest-path tree and a heaviest spanning
//! tree of the dual graph each close one loop, and these are the shortest that generate all others (Erickson and
//! Whittlesey: Greedy optimal homotopy and homology generators, 2005). Where exactly it runs does not show: the
//! pattern runs on across it, and the sheet's own seam is cut along lattice lines later.

use std::cmp::Reverse;

use super::paths::ShortestPaths;
use super::{Cone, Transition};
use crate::base::ids::{Id as _, Per};
use crate::base::union::Union;
use crate::mesh::{HalfedgeId, Surface, VertexId};

/// A stretch of the cut without a branch: from a cone, a rim or a branch to the next.
#[derive(Clone, Debug)]
pub struct Segment {
    /// Its halfedges, head to tail.
    pub halfedges: Vec<HalfedgeId>,
    /// From the chart on their left to the chart on their right.
    pub transition: Transition,
}

/// The edges of the cut graph, one halfedge each, in ascending order.
pub fn cut_graph(surface: &Surface, cones: &[Cone]) -> Vec<HalfedgeId> {
    let terminals: Vec<Vec<VertexId>> = surface
        .rims()
        .iter()
        .cloned()
        .chain(cones.iter().map(|c| vec![c.vertex]))
        .collect();
    let mut cut: Vec<HalfedgeId> = Vec::new();
    let mut joined = terminals
        .first()
        .cloned()
        .unwrap_or_else(|| vec![VertexId::from_index(0)]);
    let mut waiting: Vec<&Vec<VertexId>> = terminals.iter().skip(1).collect();
    while !waiting.is_empty() {
        let mut goal = Per::<VertexId, bool>::filled(surface.positions().len(), false);
        waiting
            .iter()
            .copied()
            .flatten()
            .for_each(|&v| goal[v] = true);
        let mut paths = ShortestPaths::new(surface);
        let Some(met) = paths.extend(&joined, |v| goal[v]) else {
            break;
        };
        joined.push(met);
        for h in paths.back(met) {
            cut.push(h);
            joined.push(surface.tail(h));
        }
        waiting.retain(|terminal| {
            let arrived = terminal.contains(&met);
            if arrived {
                joined.extend_from_slice(terminal);
            }
            !arrived
        });
    }
    if surface.genus() > 0 {
        let mut paths = ShortestPaths::new(surface);
        paths.extend(&joined, |_| false);
        for h in loops(surface, &paths, &on_both_sides(surface, &cut)) {
            cut.push(h);
            cut.extend(paths.back(surface.tail(h)));
            cut.extend(paths.back(surface.head(h)));
        }
    }
    let is_cut = on_both_sides(surface, &cut);
    surface.edges().filter(|&h| is_cut[h]).collect()
}

/// Marks edges at both their halfedges.
pub(super) fn on_both_sides(surface: &Surface, edges: &[HalfedgeId]) -> Per<HalfedgeId, bool> {
    let mut marked = Per::filled(surface.faces().len() * 3, false);
    for &h in edges {
        marked[h] = true;
        if let Some(twin) = surface.twin(h) {
            marked[twin] = true;
        }
    }
    marked
}

/// One edge for each generating loop: those that are left over by the shortest paths and by the dual spanning tree
/// that crosses the edges with the longest loops first.
pub(super) fn loops(
    surface: &Surface,
    paths: &ShortestPaths<'_>,
    is_cut: &Per<HalfedgeId, bool>,
) -> Vec<HalfedgeId> {
    let in_tree = |h: HalfedgeId| paths.arrived[surface.head(h)] == Some(h) || is_cut[h];
    let mut rest: Vec<(u64, HalfedgeId)> = surface
        .edges()
        .filter_map(|h| Some((h, surface.twin(h)?)))
        .filter(|&(h, twin)| !in_tree(h) && !in_tree(twin))
        .map(|(h, _)| {
            let around = paths.distance[surface.tail(h)]
                + surface.length(h)
                + paths.distance[surface.head(h)];
            (around.to_bits(), h)
        })
        .collect();
    rest.sort_unstable_by_key(|&(bits, h)| (Reverse(bits), h));
    let mut pieces = Union::new(surface.faces().len());
    rest.into_iter()
        .filter(|&(_, h)| {
            let across = surface.twin(h).map_or(h.face(), HalfedgeId::face);
            !pieces.join(h.face().index(), across.index())
        })
        .map(|(_, h)| h)
        .collect()
}

/// The cut graph's segments, in the order of their first edges, with no transition yet. Nodes are cones, rim vertices
/// and branches.
pub(super) fn segments(surface: &Surface, cones: &[Cone], edges: &[HalfedgeId]) -> Vec<Segment> {
    let is_cut = on_both_sides(surface, edges);
    let mut degree = Per::<VertexId, u32>::filled(surface.positions().len(), 0);
    for &h in edges {
        degree[surface.tail(h)] += 1;
        degree[surface.head(h)] += 1;
    }
    let mut node = Per::<VertexId, bool>::filled(surface.positions().len(), false);
    cones.iter().for_each(|c| node[c.vertex] = true);
    for (v, &d) in degree.iter_ids() {
        node[v] |= d > 0 && (d != 2 || surface.on_rim(v));
    }
    let mut found = Vec::new();
    let mut used = Per::<HalfedgeId, bool>::filled(surface.faces().len() * 3, false);
    let mut starts: Vec<HalfedgeId> = edges
        .iter()
        .flat_map(|&h| [Some(h), surface.twin(h)])
        .flatten()
        .filter(|&h| node[surface.tail(h)])
        .collect();
    // A cut without any node is a ring; it is opened anywhere.
    starts.extend_from_slice(edges);
    for start in starts {
        let mut halfedges = Vec::new();
        let mut here = start;
        while !used[here] {
            halfedges.push(here);
            used[here] = true;
            if let Some(twin) = surface.twin(here) {
                used[twin] = true;
            }
            let head = surface.head(here);
            if node[head] {
                break;
            }
            let on = surface
                .around(head)
                .find(|h| is_cut[*h] && Some(*h) != surface.twin(here));
            let Some(next) = on else { break };
            here = next;
        }
        if !halfedges.is_empty() {
            found.push(Segment {
                halfedges,
                transition: Transition::IDENTITY,
            });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Sample;

    fn sample(text: &str) -> Surface {
        Sample::parse(text).unwrap().generate().unwrap()
    }

    /// Faces reachable from each other without crossing the cut, and the Euler characteristic of what is left.
    fn opened(surface: &Surface, cut: &[HalfedgeId]) -> (usize, i64) {
        let mut pieces = Union::new(surface.faces().len());
        let mut joins = 0;
        for h in surface.edges() {
            if let Some(twin) = surface.twin(h)
                && cut.binary_search(&h).is_err()
            {
                pieces.join(h.face().index(), twin.face().index());
                joins += 1;
            }
        }
        let roots = (0..surface.faces().len())
            .filter(|&f| pieces.root(f) == f)
            .count();
        // A disk of F faces with V inner vertices off the cut: χ = F − inner edges + inner vertices.
        let mut on_cut = Per::<VertexId, bool>::filled(surface.positions().len(), false);
        for &h in cut {
            on_cut[surface.tail(h)] = true;
            on_cut[surface.head(h)] = true;
        }
        let inner = surface
            .positions()
            .ids()
            .filter(|&v| !on_cut[v] && !surface.on_rim(v))
            .count();
        (roots, surface.faces().len() as i64 - joins + inner as i64)
    }

    #[test]
    fn any_surface_is_opened_to_one_disk() {
        for (name, cones) in [
            ("cap:faces=900", 0),
            ("cap:faces=900", 3),
            ("vase:faces=900", 0),
            ("vase:faces=900", 2),
            ("octasphere:faces=900", 6),
            ("torus:faces=900", 0),
            ("torus:faces=900", 2),
        ] {
            let surface = sample(name);
            let inner: Vec<VertexId> = surface
                .positions()
                .ids()
                .filter(|&v| !surface.on_rim(v))
                .collect();
            let cones: Vec<Cone> = (0..cones)
                .map(|i| Cone {
                    vertex: inner[(i * inner.len()) / 7 + 5],
                    units: 1,
                })
                .collect();
            let cut = cut_graph(&surface, &cones);
            assert_eq!(
                opened(&surface, &cut),
                (1, 1),
                "{name} with {} cones",
                cones.len()
            );
            let parts = segments(&surface, &cones, &cut);
            let length: usize = parts.iter().map(|s| s.halfedges.len()).sum();
            assert_eq!(length, cut.len(), "{name}: segments cover the cut once");
            for cone in &cones {
                let ends = |s: &Segment| {
                    surface.tail(s.halfedges[0]) == cone.vertex
                        || s.halfedges
                            .last()
                            .is_some_and(|h| surface.head(*h) == cone.vertex)
                };
                assert!(parts.iter().any(ends), "every cone ends a segment");
            }
        }
    }
}
