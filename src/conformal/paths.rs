//! Shortest ways along the edges of a surface (Dijkstra).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::base::ids::Per;
use crate::mesh::{HalfedgeId, Surface, VertexId};

/// Shortest edge paths from a set of vertices, which may grow.
pub(super) struct ShortestPaths<'a> {
    surface: &'a Surface,
    /// Length of the way to each vertex, millimetres; infinite where none has led yet.
    pub distance: Per<VertexId, f64>,
    /// The halfedge that arrives at each vertex; none at the roots.
    pub arrived: Per<VertexId, Option<HalfedgeId>>,
}

impl<'a> ShortestPaths<'a> {
    /// No root yet.
    pub fn new(surface: &'a Surface) -> Self {
        let count = surface.positions().len();
        Self {
            surface,
            distance: Per::filled(count, f64::INFINITY),
            arrived: Per::filled(count, None),
        }
    }

    /// Adds roots and shortens the ways that they make shorter, until a goal is met, which is returned.
    pub fn extend(
        &mut self,
        roots: &[VertexId],
        goal: impl Fn(VertexId) -> bool,
    ) -> Option<VertexId> {
        // Distances are not negative, so their bit patterns sort as they do.
        let mut queue = BinaryHeap::new();
        for &root in roots {
            self.distance[root] = 0.0;
            self.arrived[root] = None;
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
            // The last edge of a rim vertex has no outgoing halfedge: ways along a rim lead with the surface on the left.
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

    /// The halfedges on the way from `vertex` back to its root.
    pub fn back(&self, vertex: VertexId) -> impl Iterator<Item = HalfedgeId> + '_ {
        std::iter::successors(self.arrived[vertex], |&h| {
            self.arrived[self.surface.tail(h)]
        })
    }
}
