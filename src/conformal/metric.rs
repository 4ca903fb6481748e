//! The discretely conformal metric with given singularities (CETM), on a surface of any topology.
//!
//! Two metrics on one mesh are discretely conformally equivalent if l̃ᵢⱼ = e^{(uᵢ+uⱼ)/2} lᵢⱼ. The u whose angle sums are
//! Θᵢ is the minimum of a convex function with gradient Θᵢ − Σα and the cotangent Laplacian of the scaled metric as
//! Hessian (Springborn, Schröder, Pinkall: Conformal equivalence of triangle meshes, 2008, §§3–4). Where a triangle
//! inequality fails the angles are extended by 0 and π, which keeps the function convex and once differentiable.
//!
//! On each rim u is constant, which gives the least area distortion (same paper, appendix E). All vertices of a rim share
//! one unknown, and the sum of their equations is the rim's turning. A straight rim instead has an unknown and the angle
//! π at each vertex. The first rim that is not straight, or one vertex where there is none, has u = 0: the function does
//! not see a shift of u, and Gauss–Bonnet makes that last equation true.

use std::f64::consts::PI;

use super::intrinsic::{FlatFace, Intrinsic};
pub(super) use super::linear::LinearModel;
use super::system::{Energy, System, Unknowns, dot, norm};
use super::{CURVATURE_UNIT, ConformalError, Singularities, Spread};
use crate::base::ids::{Id as _, Per};
use crate::base::progress::Progress;
use crate::mesh::{FaceId, Surface, VertexId};

/// Largest angle-sum error accepted, radians. Angle sums of a fan of six carry a rounding error of about 10⁻¹⁵ each;
/// this leaves room for vertices of high degree and for lengths that span orders of magnitude. The error in u is about
/// the same, times the mesh's diameter in edges at the worst. Costs at most one Newton step over 10⁻⁶.
const ANGLE_TOLERANCE: f64 = 1e-12;

/// Above this residual a solve that has stopped improving is a failure, radians. Far below anything that shows: the
/// layout's seams close to this accuracy.
const ANGLE_ACCEPTED: f64 = 1e-8;

/// Newton steps on the mesh's own triangles before edges are flipped. Good meshes take 2–7.
const MAX_STEPS: usize = 30;

/// Newton steps with flips before giving up.
const MAX_FLIPPING_STEPS: usize = 100;

/// The last step is solved this much better than the tolerance asks, so that it is the last.
const SPARE: f64 = 0.03;

/// A step is solved at least as well as this, relative to the gradient.
const LOOSEST: f64 = 0.1;

/// The result of a solve.
#[derive(Clone, Debug)]
pub struct Metric {
    /// Logarithmic factor u per vertex: l̃ᵢⱼ = e^{(uᵢ+uⱼ)/2} lᵢⱼ; constant on each rim that is not kept straight, 0 on the first such.
    pub u: Per<VertexId, f64>,
    /// Newton steps taken.
    pub steps: usize,
    /// Largest remaining error of an angle sum, radians.
    pub residual: f64,
    /// Faces without area or turned over in the flat metric. Where edges were not flipped, their scaled lengths break
    /// the triangle inequality, and they are drawn with angles 0 and π.
    pub broken: Vec<FaceId>,
    /// Edges flipped on the way; 0 where the mesh's own triangles carry the map, so that its lengths are the scaled ones.
    pub flips: usize,
    /// The faces' own lengths, where edges were flipped.
    flat: Option<Per<FaceId, FlatFace>>,
}

impl Metric {
    /// How far the two sides after side `k` of a face each turn from the side before, counter-clockwise, radians.
    pub(super) fn turns(&self, surface: &Surface, face: FaceId, k: usize) -> [f64; 2] {
        if let Some(flat) = &self.flat {
            let side = |k: usize| flat[face].sides[k % 3];
            return [0, 1].map(|i| (side(k + i + 1) * side(k + i).conj()).arg());
        }
        // Opposite side k lies corner k + 2.
        let (angle, ..) = angles(self.lengths(surface, face));
        [PI - angle[(k + 2) % 3], PI - angle[k]]
    }

    /// Flat lengths of a face's sides (side k from corner k to k + 1).
    pub fn lengths(&self, surface: &Surface, face: FaceId) -> [f64; 3] {
        if let Some(flat) = &self.flat {
            return flat[face].sides.map(|side| side.norm());
        }
        let v = surface.faces()[face];
        let p = surface.corners(face);
        std::array::from_fn(|k| {
            let next = (k + 1) % 3;
            (p[next] - p[k]).norm() * (0.5 * (self.u[v[k]] + self.u[v[next]])).exp()
        })
    }
}

/// Angles of the triangle with these side lengths and their cotangents, at the corner opposite each side. A broken
/// triangle has angle π opposite the side that is too long, 0 elsewhere, and no cotangents.
pub(super) fn angles(lengths: [f64; 3]) -> ([f64; 3], [f64; 3], bool) {
    let [a, b, c] = lengths;
    // Kahan: the two near-equal lengths are subtracted first, which is exact, so that needles keep their digits.
    let slack = |x: f64, y: f64, z: f64| (y.max(z) - x) + y.min(z);
    let (sa, sb, sc) = (slack(a, b, c), slack(b, c, a), slack(c, a, b));
    for (k, room) in [sa, sb, sc].into_iter().enumerate() {
        if room <= 0.0 {
            let mut broken = [0.0; 3];
            broken[k] = PI;
            return (broken, [0.0; 3], true);
        }
    }
    // 4·area by Heron; cot α = (b² + c² − a²) / (4·area); tan α/2 = 4·area / ((b + c)² − a²).
    let perimeter = a + b + c;
    let area4 = (perimeter * sa * sb * sc).sqrt();
    let angle = |room: f64| 2.0 * area4.atan2(perimeter * room);
    let cot = |x: f64, y: f64, z: f64| (y * y + z * z - x * x) / area4;
    (
        [angle(sa), angle(sb), angle(sc)],
        [cot(a, b, c), cot(b, c, a), cot(c, a, b)],
        false,
    )
}

/// Solves for the metric of one surface with different singularities. The order of elimination and the factor at the
/// surface's own metric are computed once; results do not depend on what was solved before.
pub struct MetricSolver<'a> {
    surface: &'a Surface,
    /// The rims that the system below keeps straight.
    straight: Vec<usize>,
    unknowns: Unknowns,
    system: System,
    spread: Option<Spread>,
}

/// The unknown of every vertex: its own inside and on straight rims, one for each other rim. One of those, or a vertex,
/// is held at 0.
fn unknowns(surface: &Surface, straight: &[usize]) -> Unknowns {
    let vertices = surface.positions().len();
    let mut of = vec![u32::MAX; vertices];
    let mut count = 0;
    let mut next = || {
        count += 1;
        count - 1
    };
    let mut held: Option<&[VertexId]> = None;
    let mut shared = Vec::new();
    for (i, rim) in surface.rims().iter().enumerate() {
        if straight.contains(&i) {
            continue;
        }
        match held {
            None => held = Some(rim),
            Some(_) => shared.push(rim),
        }
        rim.iter().for_each(|v| of[v.index()] = 0);
    }
    let first = [VertexId::from_index(0)];
    let held = held.unwrap_or(&first);
    held.iter().for_each(|v| of[v.index()] = 0);
    for row in of.iter_mut().filter(|row| **row == u32::MAX) {
        *row = next();
    }
    for rim in shared {
        let one = next();
        rim.iter().for_each(|v| of[v.index()] = one);
    }
    held.iter().for_each(|v| of[v.index()] = count);
    Unknowns {
        of,
        count: count as usize,
    }
}

/// Lengths of all faces' sides.
fn side_lengths(surface: &Surface) -> Result<Vec<[f64; 3]>, ConformalError> {
    let mut all = Vec::with_capacity(surface.faces().len());
    for (face, v) in surface.faces().iter_ids() {
        let p = surface.corners(face);
        let lengths: [f64; 3] = std::array::from_fn(|k| (p[(k + 1) % 3] - p[k]).norm());
        if let Some(k) = (0..3).find(|&k| lengths[k] <= 0.0) {
            return Err(ConformalError::ZeroLength {
                tail: v[k],
                head: v[(k + 1) % 3],
            });
        }
        all.push(lengths);
    }
    Ok(all)
}

fn system(surface: &Surface, unknowns: &Unknowns) -> Result<System, ConformalError> {
    let lengths = side_lengths(surface)?;
    let faces = surface.faces().iter().map(|v| v.map(|v| v.0));
    let on_rim = |v| surface.on_rim(VertexId(v));
    Ok(System::new(unknowns, faces, lengths, on_rim)?)
}

impl<'a> MetricSolver<'a> {
    /// Prepares the solver.
    ///
    /// # Errors
    /// [`ConformalError::ZeroLength`] for an edge without length, or out of memory.
    pub fn new(surface: &'a Surface) -> Result<Self, ConformalError> {
        let unknowns = unknowns(surface, &[]);
        Ok(Self {
            surface,
            straight: Vec::new(),
            system: system(surface, &unknowns)?,
            unknowns,
            spread: None,
        })
    }

    /// The same solver for a sheet that is to take several shapes: λ of its layouts is judged over all of them.
    #[must_use]
    pub fn among(mut self, spread: Option<Spread>) -> Self {
        self.spread = spread;
        self
    }

    /// How the shapes differ that its layouts are judged over.
    pub(super) fn spread(&self) -> Option<&Spread> {
        self.spread.as_ref()
    }

    /// The surface that it solves for.
    pub fn surface(&self) -> &'a Surface {
        self.surface
    }

    /// Has the equations for these straight rims at hand.
    fn straighten(&mut self, straight: &[usize]) -> Result<(), ConformalError> {
        if self.straight != straight {
            let unknowns = unknowns(self.surface, straight);
            self.system = system(self.surface, &unknowns)?;
            (self.unknowns, self.straight) = (unknowns, straight.to_vec());
        }
        Ok(())
    }

    /// The metric with the given singularities, flat everywhere else.
    ///
    /// # Errors
    /// What [`Singularities::check`] finds; [`ConformalError::NotConverged`] with the worst vertex; interruption.
    pub fn solve(
        &mut self,
        singularities: &Singularities,
        progress: &dyn Progress,
    ) -> Result<Metric, ConformalError> {
        singularities.check(self.surface)?;
        self.straighten(&singularities.straight)?;
        let target = self.targets(singularities);
        let plain = newton(&mut self.system, &target, MAX_STEPS, progress);
        let good = |s: &Solved| s.residual <= ANGLE_ACCEPTED && s.broken == 0;
        match plain {
            Ok(solved) if good(&solved) => return Ok(self.metric(&solved, None)),
            Err(error @ ConformalError::Interrupted(_)) => return Err(error),
            _ => {}
        }
        let lengths = side_lengths(self.surface)?;
        let mut intrinsic = Intrinsic::new(self.surface, &lengths, &self.unknowns);
        let doubled: Vec<f64> = target.iter().map(|t| t * intrinsic.copies()).collect();
        let mut solved = newton(&mut intrinsic, &doubled, MAX_FLIPPING_STEPS, progress)?;
        if solved.residual <= ANGLE_ACCEPTED {
            return Ok(self.metric(&solved, Some(intrinsic)));
        }
        // Broken triangles that close are better than whole ones that do not.
        match plain {
            Ok(closed) if closed.residual <= ANGLE_ACCEPTED => {
                return Ok(self.metric(&closed, None));
            }
            _ => {}
        }
        solved.residual /= intrinsic.copies();
        let rows = self.system.count() as u32;
        let off = |row: u32| solved.gradient[row as usize].abs();
        let worst = (0..rows)
            .max_by(|&a, &b| off(a).total_cmp(&off(b)))
            .unwrap_or(0);
        let at = self.unknowns.of.iter().position(|&row| row == worst);
        let vertex = VertexId::from_index(at.unwrap_or(0));
        Err(ConformalError::NotConverged {
            steps: solved.steps,
            residual_deg: solved.residual.to_degrees(),
            vertex,
            position: self.surface.position(vertex).into(),
        })
    }

    /// The metric that Newton's method found, on the triangulation where it did.
    fn metric(&self, solved: &Solved, intrinsic: Option<Intrinsic>) -> Metric {
        let mut metric = Metric {
            u: spread(&self.unknowns, &solved.u),
            steps: solved.steps,
            residual: solved.residual,
            broken: Vec::new(),
            flips: intrinsic.as_ref().map_or(0, Intrinsic::flips),
            flat: intrinsic.map(|found| found.flat_faces(&solved.u).into_iter().collect()),
        };
        let faces = self.surface.faces().ids();
        metric.broken = match &metric.flat {
            Some(flat) => faces.filter(|f| flat[*f].is_broken()).collect(),
            None if solved.broken == 0 => Vec::new(),
            None => faces
                .filter(|f| angles(metric.lengths(self.surface, *f)).2)
                .collect(),
        };
        metric
    }

    /// What the angles of every unknown sum to: around a vertex, or along a rim.
    fn targets(&self, singularities: &Singularities) -> Vec<f64> {
        let row = |v: VertexId| self.unknowns.of[v.index()] as usize;
        let mut target = vec![2.0 * PI; self.system.count() + 1];
        for cone in &singularities.cones {
            target[row(cone.vertex)] = cone.angle();
        }
        let rest = singularities.rest(self.surface) as f64;
        let turnings = singularities.turnings.iter().map(|&t| f64::from(t));
        let turnings = std::iter::once(rest).chain(turnings);
        for ((i, rim), turning) in self.surface.rims().iter().enumerate().zip(turnings) {
            if singularities.straight.contains(&i) {
                rim.iter().for_each(|&v| target[row(v)] = PI);
            } else {
                target[row(rim[0])] = PI * rim.len() as f64 - CURVATURE_UNIT * turning;
            }
        }
        target
    }

    /// The linear model around a metric that has been found: what its cones and rims add, to first order.
    pub(super) fn linear_model_at(
        &mut self,
        metric: &Metric,
    ) -> Result<LinearModel<'_>, ConformalError> {
        let mut u = vec![0.0; self.system.count() + 1];
        for (value, &row) in metric.u.iter().zip(&self.unknowns.of) {
            u[row as usize] = *value;
        }
        LinearModel::around(self.surface, &self.unknowns, &mut self.system, &u)
    }

    /// The linear model: one factorisation of the surface's cotangent Laplacian.
    pub(super) fn linear_model(&mut self) -> Result<LinearModel<'_>, ConformalError> {
        self.linear_model_with_hems(&[])
    }

    /// The same where these rims (0-based, ascending) are straight.
    pub(super) fn linear_model_with_hems(
        &mut self,
        straight: &[usize],
    ) -> Result<LinearModel<'_>, ConformalError> {
        self.straighten(straight)?;
        let none = Singularities {
            cones: Vec::new(),
            turnings: vec![0; self.surface.rims().len().saturating_sub(1)],
            straight: straight.to_vec(),
        };
        let target = self.targets(&none);
        LinearModel::new(self.surface, &self.unknowns, &mut self.system, &target)
    }
}

/// Where Newton's method ended.
struct Solved {
    u: Vec<f64>,
    gradient: Vec<f64>,
    steps: usize,
    residual: f64,
    broken: usize,
}

/// Newton's method with line search.
fn newton(
    system: &mut impl Energy,
    target: &[f64],
    most_steps: usize,
    progress: &dyn Progress,
) -> Result<Solved, ConformalError> {
    let zeros = || vec![0.0; system.count() + 1];
    let (mut u, mut gradient, mut step) = (zeros(), zeros(), zeros());
    let (mut trial, mut trial_gradient) = (zeros(), zeros());
    let mut broken = system.evaluate(&u, target, &mut gradient)?;
    let mut residual = norm(&gradient);
    let mut steps = 0;
    // The gradient that a step leaves is about the square of that before it: no use in solving better than that.
    let mut forcing: f64 = LOOSEST;
    while residual > ANGLE_TOLERANCE && steps < most_steps {
        progress.check()?;
        let enough = SPARE * ANGLE_TOLERANCE / residual;
        let accuracy = (steps > 0).then_some(forcing.max(enough));
        system.step(&gradient, accuracy, &mut step)?;
        let slope = dot(&gradient, &step);
        // The function is convex along the line, so its slope tells everything: a step is good while the slope has not
        // turned clearly positive, and no function value, with its cancellation, is ever needed.
        let mut length = 1.0;
        let improved = loop {
            for ((t, u), s) in trial.iter_mut().zip(&u).zip(&step) {
                *t = u + length * s;
            }
            broken = system.evaluate(&trial, target, &mut trial_gradient)?;
            let trial_slope = dot(&trial_gradient, &step);
            let rest = norm(&trial_gradient);
            if rest.is_finite() && (trial_slope <= -0.1 * slope || rest < 0.5 * residual) {
                break true;
            }
            // Where a straight line between the two slopes crosses zero.
            let crossing = slope / (slope - trial_slope);
            length *= if crossing.is_finite() {
                crossing.clamp(0.1, 0.5)
            } else {
                0.1
            };
            if length < 1e-10 {
                break false;
            }
        };
        steps += 1;
        let rest = norm(&trial_gradient);
        // At the accuracy of rounding a step no longer improves anything: keep the better point and stop.
        if !improved || (residual < 1e-9 && rest >= residual) {
            break;
        }
        std::mem::swap(&mut u, &mut trial);
        std::mem::swap(&mut gradient, &mut trial_gradient);
        forcing = (rest / residual).powi(2).clamp(1e-9, LOOSEST);
        residual = rest;
    }
    Ok(Solved {
        u,
        gradient,
        steps,
        residual,
        broken,
    })
}

/// The value of every vertex' unknown; 0 where it is held.
pub(super) fn spread(unknowns: &Unknowns, values: &[f64]) -> Per<VertexId, f64> {
    unknowns
        .of
        .iter()
        .map(|&row| values[row as usize])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_of_known_triangles_and_of_broken_ones() {
        let (angle, cot, bad) = angles([1.0, 1.0, 2f64.sqrt()]);
        assert!(!bad);
        assert!((angle[0] - PI / 4.0).abs() < 1e-15 && (angle[2] - PI / 2.0).abs() < 1e-15);
        assert!((cot[0] - 1.0).abs() < 1e-15 && cot[2].abs() < 1e-15);
        assert_eq!(angles([1.0, 5.0, 1.0]), ([0.0, PI, 0.0], [0.0; 3], true));
        // A needle keeps an exact angle sum.
        let (angle, ..) = angles([1.0, 1.0, 1e-9]);
        assert!((angle.iter().sum::<f64>() - PI).abs() < 1e-14);
        assert!((angle[2] - 1e-9).abs() < 1e-23);
    }
}
