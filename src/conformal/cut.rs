//! The cut graph: edges along which a surface is opened so that a disk is left, which can lie flat.
//!
//! It is a tree that joins all cones and rims, each by the cheapest way to what is joined already, and, for every
//! handle, two loops from the tree around it: the edges outside both a shortest-path tree and a heaviest spanning
//! tree of the dual graph each close one loop, and these are the shortest that generate all others (Erickson and
//! Whittlesey: Greedy optimal homotopy and homology generators, 2005). Where exactly it runs does not show: the
//! pattern runs on across it, and the sheet's own seam is cut along lattice lines later.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::{Cone, Transition};
use crate::base::ids::{Id as _, Per};
use crate::mesh::{FaceId, HalfedgeId, Surface, VertexId};

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
    let mut forest = Forest::new(surface);
    let terminals: Vec<Vec<VertexId>> = surface
        .rims()
        .iter()
        .cloned()
        .chain(cones.iter().map(|c| vec![c.vertex]))
        .collect();
    let mut is_cut = Per::<HalfedgeId, bool>::filled(surface.faces().len() * 3, false);
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
        let Some(met) = forest.grow(&joined, |v| goal[v]) else {
            break;
        };
        forest.mark(met, &mut is_cut, &mut joined);
        waiting.retain(|terminal| {
            let arrived = terminal.contains(&met);
            if arrived {
                joined.extend_from_slice(terminal);
            }
            !arrived
        });
    }
    forest.grow(&joined, |_| false);
    for h in loops(surface, &forest, &is_cut) {
        is_cut[h] = true;
        forest.mark(surface.tail(h), &mut is_cut, &mut joined);
        forest.mark(surface.head(h), &mut is_cut, &mut joined);
    }
    surface
        .edges()
        .filter(|&h| is_cut[h] || surface.twin(h).is_some_and(|t| is_cut[t]))
        .collect()
}

/// Shortest edge paths from a set of vertices.
struct Forest<'a> {
    surface: &'a Surface,
    distance: Per<VertexId, f64>,
    /// The halfedge that arrives at each vertex; none at the roots.
    arrived: Per<VertexId, Option<HalfedgeId>>,
}

impl<'a> Forest<'a> {
    fn new(surface: &'a Surface) -> Self {
        let count = surface.positions().len();
        Self {
            surface,
            distance: Per::filled(count, f64::INFINITY),
            arrived: Per::filled(count, None),
        }
    }

    /// Grows from `roots` until a goal is met, and returns it.
    fn grow(&mut self, roots: &[VertexId], goal: impl Fn(VertexId) -> bool) -> Option<VertexId> {
        self.distance.iter_mut().for_each(|d| *d = f64::INFINITY);
        self.arrived.iter_mut().for_each(|a| *a = None);
        // Distances are not negative, so their bit patterns sort as they do.
        let mut queue = BinaryHeap::new();
        for &root in roots {
            self.distance[root] = 0.0;
            queue.push(Reverse((0u64, root)));
        }
        while let Some(Reverse((bits, here))) = queue.pop() {
            let so_far = f64::from_bits(bits);
            if so_far > self.distance[here] {
                continue;
            }
            if goal(here) {
                return Some(here);
            }
            // The last edge of a rim vertex has no outgoing halfedge, but rims are joined as a whole.
            for h in self.surface.around(here) {
                let (next, length) = (self.surface.head(h), so_far + self.surface.length(h));
                if length < self.distance[next] {
                    self.distance[next] = length;
                    self.arrived[next] = Some(h);
                    queue.push(Reverse((length.to_bits(), next)));
                }
            }
        }
        None
    }

    /// Marks the way from `vertex` back to its root, and adds its vertices to `joined`.
    fn mark(
        &self,
        vertex: VertexId,
        is_cut: &mut Per<HalfedgeId, bool>,
        joined: &mut Vec<VertexId>,
    ) {
        let mut at = vertex;
        joined.push(at);
        while let Some(h) = self.arrived[at] {
            is_cut[h] = true;
            at = self.surface.tail(h);
            joined.push(at);
        }
    }
}

/// One edge for each generating loop: those that are left over by the shortest paths and by the dual spanning tree
/// that crosses the edges with the longest loops first.
fn loops(
    surface: &Surface,
    forest: &Forest<'_>,
    is_cut: &Per<HalfedgeId, bool>,
) -> Vec<HalfedgeId> {
    if surface.genus() == 0 {
        return Vec::new();
    }
    let in_tree = |h: HalfedgeId| forest.arrived[surface.head(h)] == Some(h) || is_cut[h];
    let mut rest: Vec<(u64, HalfedgeId)> = surface
        .edges()
        .filter_map(|h| Some((h, surface.twin(h)?)))
        .filter(|&(h, twin)| !in_tree(h) && !in_tree(twin))
        .map(|(h, _)| {
            let around = forest.distance[surface.tail(h)]
                + surface.length(h)
                + forest.distance[surface.head(h)];
            (around.to_bits(), h)
        })
        .collect();
    rest.sort_unstable_by_key(|&(bits, h)| (Reverse(bits), h));
    let mut pieces = crate::base::union::Union::new(surface.faces().len());
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
    let mut is_cut = Per::<HalfedgeId, bool>::filled(surface.faces().len() * 3, false);
    let mut degree = Per::<VertexId, u32>::filled(surface.positions().len(), 0);
    for &h in edges {
        is_cut[h] = true;
        if let Some(twin) = surface.twin(h) {
            is_cut[twin] = true;
        }
        degree[surface.tail(h)] += 1;
        degree[surface.head(h)] += 1;
    }
    let mut node = Per::<VertexId, bool>::filled(surface.positions().len(), false);
    cones.iter().for_each(|c| node[c.vertex] = true);
    for (v, &d) in degree.iter_ids() {
        node[v] |= d > 0 && (d != 2 || surface.on_rim(v));
    }
    let mut found = Vec::new();
    let mut used = Per::<FaceId, [bool; 3]>::filled(surface.faces().len(), [false; 3]);
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
        while !used[here.face()][here.corner()] {
            halfedges.push(here);
            used[here.face()][here.corner()] = true;
            if let Some(twin) = surface.twin(here) {
                used[twin.face()][twin.corner()] = true;
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
        let mut pieces = crate::base::union::Union::new(surface.faces().len());
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
