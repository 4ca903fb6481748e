//! Singularities: where curvature is allowed to stay, in the quanta that a triangle lattice can carry.

use std::f64::consts::PI;

use super::ConformalError;
use crate::mesh::{Surface, VertexId};

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
}

/// Largest and smallest curvature of one cone: +2 leaves a vertex of two triangles, −2 one of ten.
const CONE_UNITS: std::ops::RangeInclusive<i32> = -2..=2;

/// Everything about a flat metric that is a choice: its cones, and how far each rim turns.
///
/// By Gauss–Bonnet the units of all cones and the turnings of all rims sum to 3χ. The first rim takes what is left;
/// a surface without a rim has nothing that could.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Singularities {
    /// The cones.
    pub cones: Vec<Cone>,
    /// Turning (total geodesic curvature, the surface on the left) of each rim but the first, in units of 2π/3: −3
    /// for a hole in a plane, 0 for the end of a cylinder. So the pattern closes around every rim.
    pub turnings: Vec<i32>,
    /// Rims (0-based, ascending) that become straight lines: every vertex has the angle π. Only a rim that turns by 0
    /// can, as the end of a tube; u then varies along it.
    pub straight: Vec<usize>,
}

impl Singularities {
    /// No cone, and every rim but the first turning like a hole in a plane.
    pub fn none(surface: &Surface) -> Self {
        Self::cones(surface, Vec::new())
    }

    /// These cones, and every rim but the first turning like a hole in a plane.
    pub fn cones(surface: &Surface, cones: Vec<Cone>) -> Self {
        Self {
            cones,
            turnings: vec![-3; surface.rims().len().saturating_sub(1)],
            straight: Vec::new(),
        }
    }

    /// How far every rim but the first turns on the surface itself, to the nearest unit.
    pub(super) fn natural_turnings(surface: &Surface) -> Vec<i32> {
        let units = |rim: &Vec<VertexId>| (surface.rim_turning(rim) / CURVATURE_UNIT).round();
        surface
            .rims()
            .iter()
            .skip(1)
            .map(|rim| units(rim) as i32)
            .collect()
    }

    /// The turnings in degrees, as a person reads them.
    pub fn rim_turnings_deg(&self) -> Vec<i32> {
        self.turnings.iter().map(|units| 120 * units).collect()
    }

    /// The numbers of the straight rims as a person counts them, from 1.
    pub fn straight_rims(&self) -> Vec<usize> {
        self.straight.iter().map(|rim| rim + 1).collect()
    }

    /// What Gauss–Bonnet leaves for the first rim, in units of 2π/3; on a closed surface it must be 0.
    pub fn rest(&self, surface: &Surface) -> i64 {
        let given = self
            .cones
            .iter()
            .map(|c| c.units)
            .chain(self.turnings.iter().copied());
        3 * surface.euler_characteristic() - given.map(i64::from).sum::<i64>()
    }

    /// Whether `surface` has a metric with these singularities.
    ///
    /// # Errors
    /// [`ConformalError`]: a cone that is no inner vertex, is named twice or is too strong, a wrong number of
    /// turnings, a straight rim that turns, or curvatures that do not sum to what the surface has.
    pub fn check(&self, surface: &Surface) -> Result<(), ConformalError> {
        let inner_rims = surface.rims().len().saturating_sub(1);
        if self.turnings.len() != inner_rims {
            return Err(ConformalError::Turnings {
                given: self.turnings.len(),
                wanted: inner_rims,
            });
        }
        for (i, &Cone { vertex, units }) in self.cones.iter().enumerate() {
            if vertex.0 as usize >= surface.positions().len() {
                return Err(ConformalError::NoSuchVertex {
                    vertex: u64::from(vertex.0) + 1,
                    count: surface.positions().len(),
                });
            }
            if surface.on_rim(vertex) {
                return Err(ConformalError::ConeOnRim { vertex });
            }
            if units == 0 || !CONE_UNITS.contains(&units) {
                return Err(ConformalError::ConeUnits { units });
            }
            if self.cones[..i].iter().any(|c| c.vertex == vertex) {
                return Err(ConformalError::ConeTwice { vertex });
            }
        }
        let rest = self.rest(surface);
        for &rim in &self.straight {
            if rim >= surface.rims().len() {
                return Err(ConformalError::NoSuchRim {
                    rim: rim as u64 + 1,
                    count: surface.rims().len(),
                });
            }
            let units = match rim {
                0 => rest,
                inner => i64::from(self.turnings[inner - 1]),
            };
            if units != 0 {
                return Err(ConformalError::HemTurns {
                    rim: rim + 1,
                    turning_deg: 120 * units,
                });
            }
        }
        if surface.rims().is_empty() && rest != 0 {
            let wanted = 3 * surface.euler_characteristic();
            return Err(ConformalError::TotalCurvature {
                given: wanted - rest,
                wanted,
            });
        }
        Ok(())
    }
}
