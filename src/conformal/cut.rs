//! The cut that lets a surface with a cone lie flat: a path of edges from the cone to the rim.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::base::ids::{Id as _, Per};
use crate::mesh::{HalfedgeId, Surface, VertexId};

/// The shortest edge path from `from` to the rim, as halfedges from the vertex outwards; empty if `from` lies on the
/// rim or there is none. The pattern does not depend on this path: the seam is cut along lattice lines later.
pub fn cut_to_rim(surface: &Surface, from: VertexId) -> Vec<HalfedgeId> {
    let mut distance = Per::<VertexId, f64>::filled(surface.positions().len(), f64::INFINITY);
    let mut arrived = Per::<VertexId, Option<HalfedgeId>>::filled(surface.positions().len(), None);
    // Distances are not negative, so their bit patterns sort as they do.
    let mut queue = BinaryHeap::from([Reverse((0u64, from))]);
    distance[from] = 0.0;
    while let Some(Reverse((bits, here))) = queue.pop() {
        let so_far = f64::from_bits(bits);
        if so_far > distance[here] {
            continue;
        }
        if surface.on_rim(here) {
            let mut path = Vec::new();
            let mut at = here;
            while let Some(h) = arrived[at] {
                path.push(h);
                at = surface.tail(h);
            }
            path.reverse();
            return path;
        }
        for h in surface.around(here) {
            let (next, length) = (surface.head(h), so_far + surface.length(h));
            if length < distance[next] {
                distance[next] = length;
                arrived[next] = Some(h);
                queue.push(Reverse((length.to_bits(), next)));
            }
        }
    }
    debug_assert!(surface.rims().is_empty() || from.index() >= surface.positions().len());
    Vec::new()
}
