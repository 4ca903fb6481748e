//! Distances in the flat metric, how far every vertex is from the nearest cone, and on the surface itself.
//!
//! Dijkstra's order with the update of triangles instead of edges (Kimmel and Sethian: Computing geodesic paths on
//! manifolds, 1998): the distances of two corners place a source in the plane of their triangle, and the third corner's
//! distance is measured from it. Away from the cones the metric is flat, so that this is exact wherever a straight
//! line from the nearest cone arrives through the triangles in the order of their distances.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::{Cone, Metric};
use crate::base::ids::Per;
use crate::mesh::{FaceId, HalfedgeId, Surface, VertexId};

/// Distance of every vertex from the nearest cone in the metric's own unit; infinite without cones.
pub(super) fn from_cones(surface: &Surface, metric: &Metric, cones: &[Cone]) -> Per<VertexId, f64> {
    let starts = cones.iter().map(|cone| (cone.vertex, 0.0));
    march(surface, |face| metric.lengths(surface, face), starts)
}

/// Distance of every vertex on the surface, millimetres, from vertices that are some way off themselves.
pub(crate) fn from_vertices(
    surface: &Surface,
    starts: impl Iterator<Item = (VertexId, f64)>,
) -> Per<VertexId, f64> {
    let lengths = |face| [0, 1, 2].map(|k| surface.length(HalfedgeId::side(face, k)));
    march(surface, lengths, starts)
}

fn march(
    surface: &Surface,
    lengths: impl Fn(FaceId) -> [f64; 3],
    starts: impl Iterator<Item = (VertexId, f64)>,
) -> Per<VertexId, f64> {
    let mut distance = Per::filled(surface.positions().len(), f64::INFINITY);
    let mut queue = BinaryHeap::new();
    for (vertex, off) in starts {
        if off < distance[vertex] {
            distance[vertex] = off;
            queue.push(Reverse((off.to_bits(), vertex)));
        }
    }
    while let Some(Reverse((bits, here))) = queue.pop() {
        if f64::from_bits(bits) > distance[here] {
            continue;
        }
        for h in surface.around(here) {
            let (face, k) = (h.face(), h.corner());
            let lengths = lengths(face);
            let v = surface.faces()[face];
            let (left, right) = (v[(k + 2) % 3], v[(k + 1) % 3]);
            // Sides: k from here to right, k + 1 from right to left, k + 2 from left to here.
            for (near, far, to_near, across, to_far) in [
                (
                    right,
                    left,
                    lengths[k],
                    lengths[(k + 1) % 3],
                    lengths[(k + 2) % 3],
                ),
                (
                    left,
                    right,
                    lengths[(k + 2) % 3],
                    lengths[(k + 1) % 3],
                    lengths[k],
                ),
            ] {
                let known = (distance[here], distance[near]);
                let straight = through(known, to_near, (to_far, across));
                // Never nearer than where it came from: rounding in a needle could go on improving for ever.
                let found = straight
                    .unwrap_or(distance[here] + to_far)
                    .max(distance[here]);
                if found < distance[far] {
                    distance[far] = found;
                    queue.push(Reverse((found.to_bits(), far)));
                }
            }
        }
    }
    distance
}

/// Distance of the apex of a triangle from the source that lies `known` from the two ends of its base, on the other
/// side of it; `None` if the straight way does not cross the base.
fn through(known: (f64, f64), base: f64, sides: (f64, f64)) -> Option<f64> {
    // Feet on the base, measured from its first end.
    let foot = |a: f64, b: f64| (base * base + a * a - b * b) / (2.0 * base);
    let (source, apex) = (foot(known.0, known.1), foot(sides.0, sides.1));
    let depth = known.0 * known.0 - source * source;
    let height = sides.0 * sides.0 - apex * apex;
    if !(depth >= 0.0 && height > 0.0) {
        return None;
    }
    let (depth, height) = (depth.sqrt(), height.sqrt());
    let crossing = (source * height + apex * depth) / (height + depth);
    (0.0..=base)
        .contains(&crossing)
        .then(|| (apex - source).hypot(height + depth))
}
