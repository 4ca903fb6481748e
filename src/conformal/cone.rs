//! Cones: the vertices where curvature is allowed to stay, in the quanta that a triangle lattice can carry.

use std::f64::consts::PI;

use crate::mesh::VertexId;

/// The curvature quantum 2π/3: a vertex of a lattice whose triangles are slit as directed cycles has even degree, so
/// its angle defect 2π − k·π/3 moves in steps of 2π/3 (paper, §3.2).
pub const CURVATURE_UNIT: f64 = 2.0 * PI / 3.0;

/// A cone singularity of curvature `units` · 2π/3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cone {
    /// Where it is.
    pub vertex: VertexId,
    /// Curvature in units of 2π/3: +1 leaves a lattice vertex of four triangles, −1 one of eight.
    pub units: i32,
}

impl Cone {
    /// The cone angle: the sum of flat angles around the vertex, 2π minus the curvature.
    pub fn angle(&self) -> f64 {
        2.0 * PI - f64::from(self.units) * CURVATURE_UNIT
    }

    /// Triangles around the cone in the closed lattice: 6 − 2·units.
    pub fn degree(&self) -> usize {
        (6 - 2 * self.units).max(0) as usize
    }
}
