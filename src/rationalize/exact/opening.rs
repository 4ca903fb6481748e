//! Hinges drawn to scale factors of their own, and to bends of their own.
//!
//! Scale factors alone leave a linkage as limp as cloth. A hinge's bend is how far the arms of each of its triangles stand
//! off the other's plane, four signed lengths; drawn to given ones, more weakly than to the scale factors, the hinges
//! choose the shape among those that scale factors permit.

use nalgebra::Vector3;

use super::super::problem::{Problem, hinge_scale};
use super::contact::off_plane;
use super::system::System;

/// Weight of the bends, squared, as a part of that of the scale factors.
const BENDING: f64 = 0.1;

/// Bends of a hinge, in L: the second triangle's arms off the first's plane, and the first's off the second's.
pub(crate) type Bends = [f64; 4];

/// What the hinges are drawn to, one entry a hinge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Openings<'a> {
    pub scales: &'a [f64],
    pub bends: &'a [Bends],
}

/// Of a hinge's points `[h, b1, a1, a2, b2]`: three that span a plane, and one off it.
const PLANES: [[usize; 4]; 4] = [[0, 1, 2, 3], [0, 1, 2, 4], [0, 3, 4, 1], [0, 3, 4, 2]];

/// The bends of a hinge with points `[h, b1, a1, a2, b2]`, in L; zero where a triangle has collapsed.
pub(crate) fn bends(p: &[Vector3<f64>; 5]) -> Bends {
    PLANES.map(|plane| off_plane(&plane.map(|k| p[k])).map_or(0.0, |(value, _)| value))
}

/// The sum of squares by which the hinges at `x` (in L) are off.
pub(super) fn misfit(problem: &Problem, wanted: &Openings<'_>, x: &[Vector3<f64>]) -> f64 {
    let mut sum = 0.0;
    let wanted = wanted.scales.iter().zip(wanted.bends);
    for (h, (scale, bent)) in problem.hinges.iter().zip(wanted) {
        let p = h.map(|i| x[i as usize]);
        sum += (hinge_scale(&p).value - scale).powi(2);
        for (here, there) in bends(&p).iter().zip(bent) {
            sum += BENDING * (here - there).powi(2);
        }
    }
    sum
}

/// Adds `weight` / 2 times [`misfit`] to a system, without the curvature of its residuals.
pub(super) fn draw(
    problem: &Problem,
    wanted: &Openings<'_>,
    x: &[Vector3<f64>],
    weight: f64,
    system: &mut System,
) {
    let bending = weight * BENDING;
    let wanted = wanted.scales.iter().zip(wanted.bends);
    for (n, (h, (wanted, bent))) in problem.hinges.iter().zip(wanted).enumerate() {
        let Some(clique) = system.hinge(n) else {
            continue;
        };
        let p = h.map(|i| x[i as usize]);
        let scale = hinge_scale(&p);
        system.add_clique(
            clique,
            &scale.gradient,
            weight,
            weight * (scale.value - wanted),
        );
        for (plane, bent) in PLANES.iter().zip(bent) {
            if let Some((value, partial)) = off_plane(&plane.map(|k| p[k])) {
                let mut gradient = [Vector3::zeros(); 5];
                for (&k, g) in plane.iter().zip(partial) {
                    gradient[k] = g;
                }
                system.add_clique(clique, &gradient, bending, bending * (value - bent));
            }
        }
    }
}
