//! The discretely conformal metric with given singularities (CETM), on a surface of any topology.
//!
//! Two metrics on one mesh are discretely conformally equivalent if l̃ᵢⱼ = e^{(uᵢ+uⱼ)/2} lᵢⱼ. The u whose angle sums are
//! Θᵢ is the minimum of a convex function with gradient Θᵢ − Σα and the cotangent Laplacian of the scaled metric as
//! Hessian (Springborn, Schröder, Pinkall: Conformal equivalence of triangle meshes, 2008, §§3–4). Where a triangle
//! inequality fails the angles are extended by 0 and π, which keeps the function convex and once differentiable.
//!
//! On each rim u is constant, which gives the least area distortion (same paper, appendix E). All vertices of a rim share
//! one unknown, and the sum of their equations is the rim's turning. The first rim, or one vertex of a closed surface,
//! has u = 0: the function does not see a shift of u, and Gauss–Bonnet makes that last equation true.

use std::f64::consts::PI;

use super::{CURVATURE_UNIT, ConformalError, Singularities};
use crate::base::ids::Per;
use crate::base::progress::Progress;
use crate::base::sparse::{Cholesky, FactorError, Pattern};
use crate::mesh::{FaceId, Surface, VertexId};

/// Largest angle-sum error accepted, radians. Angle sums of a fan of six carry a rounding error of about 10⁻¹⁵ each;
/// this leaves room for vertices of high degree and for lengths that span orders of magnitude. The error in u is about
/// the same, times the mesh's diameter in edges at the worst. Costs at most one Newton step over 10⁻⁶.
const ANGLE_TOLERANCE: f64 = 1e-12;

/// Above this residual a solve that has stopped improving is a failure, radians. Far below anything that shows: the
/// layout's seams close to this accuracy.
const ANGLE_ACCEPTED: f64 = 1e-8;

/// Newton steps before giving up. Good meshes take 2–7, meshes with broken triangles up to some dozens.
const MAX_STEPS: usize = 200;

/// The result of a solve.
#[derive(Clone, Debug)]
pub struct Metric {
    /// Logarithmic factor u per vertex: l̃ᵢⱼ = e^{(uᵢ+uⱼ)/2} lᵢⱼ; constant on each rim, 0 on the first.
    pub u: Per<VertexId, f64>,
    /// Newton steps taken.
    pub steps: usize,
    /// Largest remaining error of an angle sum, radians.
    pub residual: f64,
    /// Faces whose scaled lengths break the triangle inequality: drawn with angles 0 and π.
    pub broken: Vec<FaceId>,
}

impl Metric {
    /// Scaled lengths of a face's sides (side k from corner k to k + 1).
    pub fn lengths(&self, surface: &Surface, face: FaceId) -> [f64; 3] {
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

/// Solves for the metric of one surface with different singularities; the symbolic factor is computed once.
pub struct MetricSolver<'a> {
    surface: &'a Surface,
    /// Unknown of each vertex: its own inside, one for each rim; [`NONE`] where u = 0.
    row: Per<VertexId, u32>,
    rows: usize,
    /// Logarithms of the side lengths.
    log_length: Per<FaceId, [f64; 3]>,
    /// Value slots: per face three diagonal entries (corner k) and three for side k, [`NONE`] where there is none.
    slots: Per<FaceId, [u32; 6]>,
    cholesky: Cholesky,
}

const NONE: u32 = u32::MAX;

/// The unknown of every vertex, and how many there are.
fn unknowns(surface: &Surface) -> (Per<VertexId, u32>, usize) {
    let mut row = Per::filled(surface.positions().len(), NONE);
    let mut rows = 0;
    let mut next = || {
        rows += 1;
        rows as u32 - 1
    };
    // Without a rim the first vertex is held.
    let held = usize::from(surface.rims().is_empty());
    for vertex in surface.positions().ids().skip(held) {
        if !surface.on_rim(vertex) {
            row[vertex] = next();
        }
    }
    for rim in surface.rims().iter().skip(1) {
        let shared = next();
        rim.iter().for_each(|&vertex| row[vertex] = shared);
    }
    (row, rows)
}

impl<'a> MetricSolver<'a> {
    /// Prepares the solver.
    ///
    /// # Errors
    /// [`ConformalError::ZeroLength`] for an edge without length, or out of memory.
    pub fn new(surface: &'a Surface) -> Result<Self, ConformalError> {
        let (row, rows) = unknowns(surface);
        let mut log_length = Vec::with_capacity(surface.faces().len());
        for (face, v) in surface.faces().iter_ids() {
            let p = surface.corners(face);
            let mut logs = [0.0; 3];
            for k in 0..3 {
                let length = (p[(k + 1) % 3] - p[k]).norm();
                if length <= 0.0 {
                    return Err(ConformalError::ZeroLength {
                        tail: v[k],
                        head: v[(k + 1) % 3],
                    });
                }
                logs[k] = length.ln();
            }
            log_length.push(logs);
        }
        let inner_edges = surface.edges().filter_map(|h| {
            let (i, j) = (row[surface.tail(h)], row[surface.head(h)]);
            (i != NONE && j != NONE && i != j).then_some((i, j))
        });
        let cholesky = Cholesky::new(Pattern::new(rows, inner_edges))?;
        let slot = |i: u32, j: u32| -> u32 {
            if i == NONE || j == NONE {
                return NONE;
            }
            cholesky
                .pattern()
                .slot(i as usize, j as usize)
                .map_or(NONE, |s| s as u32)
        };
        let slots = surface
            .faces()
            .iter()
            .map(|v| {
                let r = v.map(|v| row[v]);
                std::array::from_fn(|k| {
                    if k < 3 {
                        slot(r[k], r[k])
                    } else {
                        slot(r[k - 3], r[(k - 2) % 3])
                    }
                })
            })
            .collect();
        Ok(Self {
            surface,
            row,
            rows,
            log_length: Per::new(log_length),
            slots,
            cholesky,
        })
    }

    /// The surface that it solves for.
    pub fn surface(&self) -> &'a Surface {
        self.surface
    }

    /// Gradient Θ − Σα at `u` into `gradient`, Hessian values into `hessian`; returns the number of broken faces.
    fn evaluate(
        &self,
        u: &[f64],
        target: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> usize {
        gradient.copy_from_slice(target);
        hessian.fill(0.0);
        let mut broken = 0;
        for (face, v) in self.surface.faces().iter_ids() {
            let row = v.map(|v| self.row[v]);
            if row == [NONE; 3] {
                continue;
            }
            let at = row.map(|r| if r == NONE { 0.0 } else { u[r as usize] });
            let logs = &self.log_length[face];
            let lengths =
                std::array::from_fn(|k| (logs[k] + 0.5 * (at[k] + at[(k + 1) % 3])).exp());
            let (angle, cot, bad) = angles(lengths);
            broken += usize::from(bad);
            // `angle[k]` lies opposite side k, that is at corner k + 2.
            for k in 0..3 {
                if row[(k + 2) % 3] != NONE {
                    gradient[row[(k + 2) % 3] as usize] -= angle[k];
                }
            }
            let slots = &self.slots[face];
            for k in 0..3 {
                // Along a rim both ends are one unknown, and their difference is nothing.
                if row[k] == row[(k + 1) % 3] {
                    continue;
                }
                let half = 0.5 * cot[k];
                for corner in [k, (k + 1) % 3] {
                    if slots[corner] != NONE {
                        hessian[slots[corner] as usize] += half;
                    }
                }
                if slots[3 + k] != NONE {
                    hessian[slots[3 + k] as usize] -= half;
                }
            }
        }
        broken
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
        let target = self.targets(singularities);
        let norm = |g: &[f64]| g.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let mut u = vec![0.0; self.rows];
        let (mut gradient, mut trial_gradient) = (vec![0.0; self.rows], vec![0.0; self.rows]);
        let (mut step, mut trial) = (vec![0.0; self.rows], vec![0.0; self.rows]);
        let mut hessian = vec![0.0; self.cholesky.pattern().entries()];
        let mut broken = self.evaluate(&u, &target, &mut gradient, &mut hessian);
        let mut residual = norm(&gradient);
        let mut steps = 0;
        while residual > ANGLE_TOLERANCE && steps < MAX_STEPS {
            progress.check()?;
            self.factor(&mut hessian)?;
            for (s, g) in step.iter_mut().zip(&gradient) {
                *s = -g;
            }
            self.cholesky.solve(&mut step);
            let slope: f64 = gradient.iter().zip(&step).map(|(g, s)| g * s).sum();
            // The function is convex along the line, so its slope tells everything: a step is good while the slope has
            // not turned clearly positive, and no function value, with its cancellation, is ever needed.
            let mut length = 1.0;
            let improved = loop {
                for ((t, u), s) in trial.iter_mut().zip(&u).zip(&step) {
                    *t = u + length * s;
                }
                broken = self.evaluate(&trial, &target, &mut trial_gradient, &mut hessian);
                let trial_slope: f64 = trial_gradient.iter().zip(&step).map(|(g, s)| g * s).sum();
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
            residual = rest;
        }
        if residual > ANGLE_ACCEPTED {
            let worst = (0..self.rows)
                .max_by(|&a, &b| gradient[a].abs().total_cmp(&gradient[b].abs()))
                .unwrap_or(0);
            let vertex = self
                .row
                .iter_ids()
                .find(|(_, r)| **r == worst as u32)
                .map_or(VertexId(0), |(v, _)| v);
            return Err(ConformalError::NotConverged {
                steps,
                residual_deg: residual.to_degrees(),
                vertex,
                position: self.surface.position(vertex).into(),
            });
        }
        let u = spread(&self.row, &u);
        let mut metric = Metric {
            u,
            steps,
            residual,
            broken: Vec::new(),
        };
        if broken > 0 {
            metric.broken = self
                .surface
                .faces()
                .ids()
                .filter(|f| angles(metric.lengths(self.surface, *f)).2)
                .collect();
        }
        Ok(metric)
    }

    /// What the angles of every unknown sum to: around a vertex, or along a rim.
    fn targets(&self, singularities: &Singularities) -> Vec<f64> {
        let mut target = vec![2.0 * PI; self.rows];
        for cone in &singularities.cones {
            let row = self.row[cone.vertex];
            if row != NONE {
                target[row as usize] = cone.angle();
            }
        }
        let inner_rims = self.surface.rims().iter().skip(1);
        for (rim, &turning) in inner_rims.zip(&singularities.turnings) {
            target[self.row[rim[0]] as usize] =
                PI * rim.len() as f64 - CURVATURE_UNIT * f64::from(turning);
        }
        target
    }

    /// Factors the Hessian; where broken triangles leave it singular, a growing multiple of its diagonal is added,
    /// which shortens the step but keeps it downhill.
    fn factor(&mut self, hessian: &mut [f64]) -> Result<(), ConformalError> {
        let mut shift = 0.0;
        let diagonal: Vec<usize> = (0..self.rows)
            .filter_map(|i| self.cholesky.pattern().slot(i, i))
            .collect();
        let mean =
            diagonal.iter().map(|&s| hessian[s].abs()).sum::<f64>() / self.rows.max(1) as f64;
        loop {
            match self.cholesky.factor(hessian) {
                Err(FactorError::NotPositiveDefinite) if shift < 1e6 => {
                    let next = if shift == 0.0 { 1e-10 } else { shift * 100.0 };
                    for &slot in &diagonal {
                        hessian[slot] += (next - shift) * mean.max(1e-30);
                    }
                    shift = next;
                }
                other => return Ok(other?),
            }
        }
    }
}

/// The first Newton step from the surface's own metric, for all singularities at once: u is linear in them.
pub(super) struct LinearModel<'s> {
    surface: &'s Surface,
    row: &'s Per<VertexId, u32>,
    cholesky: &'s mut Cholesky,
    start: Per<VertexId, f64>,
    rhs: Vec<f64>,
}

impl MetricSolver<'_> {
    /// The linear model: one factorisation of the surface's cotangent Laplacian.
    pub(super) fn linear_model(&mut self) -> Result<LinearModel<'_>, ConformalError> {
        let none = Singularities {
            cones: Vec::new(),
            turnings: vec![0; self.surface.rims().len().saturating_sub(1)],
        };
        let target = self.targets(&none);
        let mut gradient = vec![0.0; self.rows];
        let mut hessian = vec![0.0; self.cholesky.pattern().entries()];
        self.evaluate(&vec![0.0; self.rows], &target, &mut gradient, &mut hessian);
        self.factor(&mut hessian)?;
        gradient.iter_mut().for_each(|g| *g = -*g);
        self.cholesky.solve(&mut gradient);
        Ok(LinearModel {
            surface: self.surface,
            row: &self.row,
            start: spread(&self.row, &gradient),
            cholesky: &mut self.cholesky,
            rhs: gradient,
        })
    }
}

/// Right-hand sides solved together: wide enough for the dense kernels, small enough to stay near the processor (6 MB on
/// 25 000 vertices).
const BATCH: usize = 32;

/// The value of every vertex' unknown; 0 where it has none.
fn spread(row: &Per<VertexId, u32>, values: &[f64]) -> Per<VertexId, f64> {
    row.iter()
        .map(|&r| if r == NONE { 0.0 } else { values[r as usize] })
        .collect()
}

impl LinearModel<'_> {
    /// u without cones, all inner rims turning by 0.
    pub fn start(&self) -> &Per<VertexId, f64> {
        &self.start
    }

    /// What a cone of +1 at a vertex adds.
    pub fn cone(&mut self, vertex: VertexId) -> Per<VertexId, f64> {
        let row = self.row[vertex];
        self.column(|rhs| {
            if row != NONE {
                rhs[row as usize] = CURVATURE_UNIT;
            }
        })
    }

    /// What a cone of +1 at each of `vertices` adds, at `samples` only: one column a vertex, in their order. Many at
    /// once cost a fraction of as many calls of [`LinearModel::cone`].
    #[allow(dead_code, reason = "the search is being moved over to it")]
    pub fn cones(&mut self, vertices: &[VertexId], samples: &[VertexId]) -> Vec<Vec<f64>> {
        let rows = self.rhs.len();
        let mut block = vec![0.0; rows * BATCH.min(vertices.len())];
        let mut columns = Vec::with_capacity(vertices.len());
        for batch in vertices.chunks(BATCH) {
            let block = &mut block[..rows * batch.len()];
            block.fill(0.0);
            for (column, &vertex) in batch.iter().enumerate() {
                if self.row[vertex] != NONE {
                    block[column * rows + self.row[vertex] as usize] = CURVATURE_UNIT;
                }
            }
            self.cholesky.solve_columns(block, batch.len());
            columns.extend((0..batch.len()).map(|column| {
                let values = &block[column * rows..][..rows];
                let value = |&v: &VertexId| match self.row[v] {
                    NONE => 0.0,
                    row => values[row as usize],
                };
                samples.iter().map(value).collect()
            }));
        }
        columns
    }

    /// What one more unit of turning at inner rim `rim` (1, 2, …) adds.
    pub fn rim(&mut self, rim: usize) -> Per<VertexId, f64> {
        self.cone(self.surface.rims()[rim][0])
    }

    /// What one unit of curvature adds that is spread in proportion to `weight`.
    pub fn spread(&mut self, weight: &Per<VertexId, f64>) -> Per<VertexId, f64> {
        let total: f64 = weight.iter().sum();
        let row = self.row;
        self.column(|rhs| {
            for (w, &r) in weight.iter().zip(row.iter()) {
                if r != NONE {
                    rhs[r as usize] += CURVATURE_UNIT * w / total;
                }
            }
        })
    }

    fn column(&mut self, fill: impl FnOnce(&mut [f64])) -> Per<VertexId, f64> {
        self.rhs.fill(0.0);
        fill(&mut self.rhs);
        self.cholesky.solve(&mut self.rhs);
        spread(self.row, &self.rhs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Sample;

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

    /// Also at a rim, where the unknown is shared, and on the first rim, where there is none; more than one batch.
    #[test]
    fn columns_solved_together_are_those_solved_alone() {
        let sample = Sample::parse("vase:faces=800").and_then(|s| s.generate());
        let surface = sample.unwrap();
        let mut solver = MetricSolver::new(&surface).unwrap();
        let mut model = solver.linear_model().unwrap();
        let all: Vec<VertexId> = surface.positions().ids().collect();
        let places: Vec<VertexId> = all.iter().copied().step_by(5).collect();
        assert!(places.len() > 2 * BATCH && places.iter().any(|v| surface.on_rim(*v)));
        let together = model.cones(&places, &all);
        for (&place, column) in places.iter().zip(&together) {
            let alone = model.cone(place);
            assert_eq!(column.len(), alone.len());
            for (a, b) in column.iter().zip(alone.iter()) {
                assert!((a - b).abs() < 1e-12, "{a} and {b}");
            }
        }
    }
}
