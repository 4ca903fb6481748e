//! The places on a surface that points are drawn to.

use std::ops::Deref;

use nalgebra::Point3;

use super::kernel::Kernel;
use crate::mesh::{ClosestPoint, ClosestTracker};

/// Keeps the closest points of a kernel's points.
pub(crate) struct Follower<C> {
    tracker: ClosestTracker<C>,
    /// The kernel's points in the order of the linkage's, which runs along the surface: faces that are asked for one
    /// after the other lie near each other in memory.
    order: Vec<u32>,
    edge_mm: f64,
}

impl<C: Deref<Target = ClosestPoint>> Follower<C> {
    /// On the surface of `closest`; `edge_mm` is L.
    pub fn new(closest: C, kernel: &Kernel, edge_mm: f64) -> Self {
        let order = kernel.places().to_vec();
        Self {
            tracker: ClosestTracker::new(closest, order.len()),
            order,
            edge_mm,
        }
    }

    /// Brings the places up to date with the points, both in the kernel's order and in L.
    pub fn follow(&mut self, x: &[[f64; 3]], places: &mut [[f64; 3]]) {
        for (i, &point) in self.order.iter().enumerate() {
            let at = Point3::from(x[point as usize]) * self.edge_mm;
            let found = self.tracker.query(i, at);
            places[point as usize] = (found.point / self.edge_mm).into();
        }
    }
}
