//! The equations of the conformal map on one mesh: the unknowns, gradient and Hessian of the energy, and Newton steps.
//!
//! A step costs a factorisation only where it must. In the smooth theory the Dirichlet energy does not change under a
//! conformal map, so the cotangent Laplacian of the scaled metric (the Hessian) stays close to that of the surface's own:
//! the factor of the first one preconditions the others so well that a few rounds of conjugate gradients solve a step
//! to the accuracy that it deserves (Eisenstat, Walker: Choosing the forcing terms in an inexact Newton method, 1996).
//! Where that goes slowly, as around coarse triangles at a cone, the Hessian at hand is factored.

use std::f64::consts::PI;

use super::metric::angles;
use crate::base::sparse::{Cholesky, FactorError, Pattern};

/// Rounds of conjugate gradients at the most in one step; one costs about an eighth of a factorisation.
const MOST_ROUNDS: usize = 8;

/// A convex function of the unknowns, for Newton's method.
pub(super) trait Energy {
    /// Number of unknowns; vectors have one entry more.
    fn count(&self) -> usize;

    /// Gradient Θ − Σα at `u` into `gradient`; the Hessian there is kept for [`Energy::step`]. Returns the number of
    /// broken faces.
    fn evaluate(
        &mut self,
        u: &[f64],
        target: &[f64],
        gradient: &mut [f64],
    ) -> Result<usize, FactorError>;

    /// A Newton step at the point last evaluated, into `step`, accurate to `forcing` times the gradient, downhill in any
    /// case; without `forcing` the first one, at u = 0.
    ///
    /// # Errors
    /// [`FactorError`] if no multiple of the diagonal makes the Hessian positive definite.
    fn step(
        &mut self,
        gradient: &[f64],
        forcing: Option<f64>,
        step: &mut [f64],
    ) -> Result<(), FactorError>;
}

/// Which unknown the logarithmic factor of each vertex is.
#[derive(Clone, Debug)]
pub(super) struct Unknowns {
    /// Number of each vertex' unknown; [`Unknowns::count`] where u is held at 0. Vertices may share one.
    pub of: Vec<u32>,
    /// How many there are.
    pub count: usize,
}

/// The energy's gradient and Hessian as functions of the unknowns. Vectors of unknowns have one more entry than there
/// are unknowns, for the vertices that are held, so that inner loops need not ask.
pub(super) struct System {
    count: usize,
    /// Unknowns at the corners of every face.
    corners: Vec<[u32; 3]>,
    /// Unscaled lengths of every face's sides (side k from corner k to k + 1).
    lengths: Vec<[f64; 3]>,
    /// Slots of the Hessian's entries for the sides; one behind the last where there is none.
    sides: Vec<[u32; 3]>,
    cholesky: Cholesky,
    /// Hessian values by slot, at the point last evaluated, with one entry more.
    hessian: Vec<f64>,
    /// What the factor is that of.
    factored: Factored,
    /// e^{u/2} of every unknown.
    half: Vec<f64>,
    /// Angle sum and Hessian diagonal of every unknown.
    sums: Vec<[f64; 2]>,
    /// Vectors of the conjugate gradients.
    work: [Vec<f64>; 4],
}

#[derive(Clone, Copy, PartialEq)]
enum Factored {
    Nothing,
    /// The Hessian at u = 0: every solve starts from it.
    Start,
    Other,
}

/// Largest absolute value; infinite or not a number if one entry is.
pub(super) fn norm(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, x| {
        if x.abs() <= most {
            most
        } else {
            x.abs() + 0.0 * most
        }
    })
}

/// The dot product.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl System {
    /// The system of a mesh: `faces` as vertices, the `lengths` of their sides, and `on_rim` for each vertex.
    ///
    /// # Errors
    /// [`FactorError::OutOfMemory`].
    pub fn new(
        unknowns: &Unknowns,
        faces: impl Iterator<Item = [u32; 3]>,
        lengths: Vec<[f64; 3]>,
        on_rim: impl Fn(u32) -> bool,
    ) -> Result<Self, FactorError> {
        let count = unknowns.count;
        let held = count as u32;
        let mut corners = Vec::with_capacity(lengths.len());
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(lengths.len() * 3 / 2);
        for v in faces {
            let c = v.map(|v| unknowns.of[v as usize]);
            corners.push(c);
            for k in 0..3 {
                let (i, j) = (c[k], c[(k + 1) % 3]);
                // An inner edge is met once in each direction.
                let once = i < j || (on_rim(v[k]) && on_rim(v[(k + 1) % 3]));
                if once && i != j && i != held && j != held {
                    pairs.push((i, j));
                }
            }
        }
        let cholesky = Cholesky::new(Pattern::new(count, pairs))?;
        let pattern = cholesky.pattern();
        let none = pattern.entries() as u32;
        let sides = corners
            .iter()
            .map(|c: &[u32; 3]| {
                std::array::from_fn(|k| {
                    let (i, j) = (c[k], c[(k + 1) % 3]);
                    let slot = (i != j && i != held && j != held)
                        .then(|| pattern.slot(i as usize, j as usize));
                    slot.flatten().map_or(none, |slot| slot as u32)
                })
            })
            .collect();
        Ok(Self {
            count,
            corners,
            lengths,
            sides,
            hessian: vec![0.0; pattern.entries() + 1],
            cholesky,
            factored: Factored::Nothing,
            half: vec![1.0; count + 1],
            sums: vec![[0.0; 2]; count + 1],
            work: std::array::from_fn(|_| vec![0.0; count]),
        })
    }

    /// Factors the Hessian at u = 0, where [`Energy::evaluate`] was called last, unless that is the factor at hand.
    ///
    /// # Errors
    /// As [`Energy::step`].
    pub fn factor_start(&mut self) -> Result<(), FactorError> {
        if self.factored != Factored::Start {
            self.factor()?;
            self.factored = Factored::Start;
        }
        Ok(())
    }

    /// Factors the Hessian where [`Energy::evaluate`] was called last.
    ///
    /// # Errors
    /// As [`Energy::step`].
    pub fn factor_here(&mut self) -> Result<(), FactorError> {
        self.factor()?;
        self.factored = Factored::Other;
        Ok(())
    }

    /// The factored system's solutions in place of `count` right-hand sides, each without the held entry.
    pub fn solve_columns(&mut self, rhs: &mut [f64], count: usize) {
        self.cholesky.solve_columns(rhs, count);
    }

    fn solve_downhill(&mut self, gradient: &[f64], step: &mut [f64]) {
        for (s, g) in step.iter_mut().zip(gradient) {
            *s = -g;
        }
        self.cholesky.solve(&mut step[..self.count]);
    }

    /// The step by conjugate gradients with the factor at hand; false if that goes too slowly.
    fn conjugate_gradients(&mut self, gradient: &[f64], forcing: f64, step: &mut [f64]) -> bool {
        let step = &mut step[..self.count];
        let [rest, preconditioned, along, product] = &mut self.work;
        step.fill(0.0);
        for (r, g) in rest.iter_mut().zip(gradient) {
            *r = -g;
        }
        let start = norm(rest);
        let mut energy = 0.0;
        for round in 1..=MOST_ROUNDS {
            preconditioned.copy_from_slice(rest);
            self.cholesky.solve(preconditioned);
            let before = energy;
            energy = dot(rest, preconditioned);
            let keep = if round == 1 { 0.0 } else { energy / before };
            for (a, p) in along.iter_mut().zip(preconditioned.iter()) {
                *a = p + keep * *a;
            }
            self.cholesky
                .pattern()
                .multiply(&self.hessian, along, product);
            let curvature = dot(along, product);
            if !(curvature > 0.0 && energy > 0.0 && curvature.is_finite()) {
                return false;
            }
            let length = energy / curvature;
            for i in 0..step.len() {
                step[i] += length * along[i];
                rest[i] -= length * product[i];
            }
            let gained = norm(rest) / start;
            if gained <= forcing {
                return true;
            }
            // As many rounds as that, at this pace.
            let wanted = round as f64 * forcing.ln() / gained.ln();
            if round >= 3 && !(gained < 1.0 && wanted < MOST_ROUNDS as f64 + 0.5) {
                return false;
            }
        }
        false
    }

    /// Factors the Hessian; where broken triangles leave it singular, a growing multiple of its diagonal is added,
    /// which shortens the step but keeps it downhill.
    fn factor(&mut self) -> Result<(), FactorError> {
        let entries = self.cholesky.pattern().entries();
        let diagonal = |i: usize| self.cholesky.pattern().diagonal(i);
        let total: f64 = (0..self.count)
            .map(|i| self.hessian[diagonal(i)].abs())
            .sum();
        let mean = (total / self.count.max(1) as f64).max(1e-30);
        let mut shift = 0.0;
        self.factored = Factored::Nothing;
        loop {
            match self.cholesky.factor(&self.hessian[..entries]) {
                Err(FactorError::NotPositiveDefinite) if shift < 1e6 => {
                    let next = if shift == 0.0 { 1e-10 } else { shift * 100.0 };
                    for i in 0..self.count {
                        let slot = self.cholesky.pattern().diagonal(i);
                        self.hessian[slot] += (next - shift) * mean;
                    }
                    shift = next;
                }
                other => return other,
            }
        }
    }
}

impl Energy for System {
    fn count(&self) -> usize {
        self.count
    }

    fn evaluate(
        &mut self,
        u: &[f64],
        target: &[f64],
        gradient: &mut [f64],
    ) -> Result<usize, FactorError> {
        for (half, u) in self.half.iter_mut().zip(u) {
            *half = (0.5 * u).exp();
        }
        self.sums.fill([0.0; 2]);
        self.hessian.fill(0.0);
        let mut broken = 0;
        for ((corners, lengths), sides) in self.corners.iter().zip(&self.lengths).zip(&self.sides) {
            let at = corners.map(|c| c as usize);
            let e = at.map(|c| self.half[c]);
            let (angle, cot, bad) = corner_angles([
                lengths[0] * e[0] * e[1],
                lengths[1] * e[1] * e[2],
                lengths[2] * e[2] * e[0],
            ]);
            broken += usize::from(bad);
            // Along a rim both ends are one unknown, and their difference is nothing.
            let half: [f64; 3] = std::array::from_fn(|k| {
                if corners[k] == corners[(k + 1) % 3] {
                    0.0
                } else {
                    0.5 * cot[k]
                }
            });
            for k in 0..3 {
                // `angle[k]` lies opposite side k, that is at corner k + 2; sides k and k − 1 meet at corner k.
                let sums = &mut self.sums[at[k]];
                sums[0] += angle[(k + 1) % 3];
                sums[1] += half[k] + half[(k + 2) % 3];
                self.hessian[sides[k] as usize] -= half[k];
            }
        }
        let pattern = self.cholesky.pattern();
        for i in 0..self.count {
            gradient[i] = target[i] - self.sums[i][0];
            self.hessian[pattern.diagonal(i)] = self.sums[i][1];
        }
        gradient[self.count] = 0.0;
        Ok(broken)
    }

    fn step(
        &mut self,
        gradient: &[f64],
        forcing: Option<f64>,
        step: &mut [f64],
    ) -> Result<(), FactorError> {
        match forcing {
            None => {
                self.factor_start()?;
                self.solve_downhill(gradient, step);
            }
            Some(forcing) => {
                let fresh = self.factored == Factored::Nothing;
                if fresh || !self.conjugate_gradients(gradient, forcing, step) {
                    self.factor()?;
                    self.factored = Factored::Other;
                    self.solve_downhill(gradient, step);
                }
            }
        }
        step[self.count] = 0.0;
        Ok(())
    }
}

/// As [`angles`], with two arc tangents: the third angle is what the others leave of π, so that it has their absolute
/// error, which is all that a sum around a vertex shows.
#[inline]
fn corner_angles(lengths: [f64; 3]) -> ([f64; 3], [f64; 3], bool) {
    let [a, b, c] = lengths;
    let slack = |x: f64, y: f64, z: f64| (y.max(z) - x) + y.min(z);
    let (sa, sb, sc) = (slack(a, b, c), slack(b, c, a), slack(c, a, b));
    // Not a number is sorted out by the other function, too.
    if !(sa > 0.0 && sb > 0.0 && sc > 0.0) {
        return angles(lengths);
    }
    let perimeter = a + b + c;
    let area4 = (perimeter * sa * sb * sc).sqrt();
    if !(area4 > 0.0 && area4.is_finite()) {
        return angles(lengths);
    }
    let per_area = 1.0 / area4;
    let tangent = area4 / perimeter;
    let (alpha, beta) = (2.0 * (tangent / sa).atan(), 2.0 * (tangent / sb).atan());
    let (aa, bb, cc) = (a * a, b * b, c * c);
    (
        [alpha, beta, PI - alpha - beta],
        [
            (bb + cc - aa) * per_area,
            (cc + aa - bb) * per_area,
            (aa + bb - cc) * per_area,
        ],
        false,
    )
}
