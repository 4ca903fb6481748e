//! One iteration of local and global steps on the energy (2), and what it works on.
//!
//! Triangles stand in the order in which the global step eliminates them, points in the order in which those triangles
//! first use them, so that every loop runs through memory as the factor does. Lengths are in L.

use nalgebra::Vector3;

use super::anderson::Anderson;
use super::global::Global;
use super::separate::{Separation, close, separate};
use crate::base::sparse::FactorError;
use crate::rationalize::problem::{Condition, OPEN_MARGIN, Problem};

/// What hinges must keep to, beyond (3) and (4).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    /// The projection of (3) and (4).
    pub separation: Separation,
    /// Conditions (5) and (6), and λ ≤ σ for this σ.
    pub bounds: Option<f64>,
    /// Weight of the smoothness; 0 leaves it out.
    pub smoothness: f64,
    /// What is smooth.
    pub rest: Rest,
}

/// What the smoothness draws a linkage to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rest {
    /// Evenly spaced triangles on a flat sheet.
    Flat,
    /// The bends of the start, as they stand in space: they do not turn along when a part of the linkage turns.
    #[default]
    Start,
}

/// Weight of every edge vector in the matrix of the global step for its length.
const EDGE_WEIGHT: f64 = 1.0;

/// What both tuples of (3) and (4) at the hinges of its two ends add, each holding two of the inner arms and one of the
/// outer. So it has to be where no guard watches the energy. Where one does, the hinges weigh nothing in the matrix:
/// few are broken at a time, those that are not would only hold back the step, and what is too far for those that are
/// is refused. It takes 100 iterations to where the full weight takes 250.
const HINGE_WEIGHT: f64 = 3.0;

/// What the smoothness adds for each of its own weight.
const SMOOTH_WEIGHT: f64 = 1.0;

/// A pull on every point towards where it is, as a part of the weight: without a single other pull the matrix must
/// still be definite. It takes nothing from the solution and next to nothing from a step.
const REST: f64 = 1e-7;

/// Halvings of a plain step that does not lower the energy, before the iteration counts as settled.
const HALVINGS: usize = 4;

#[derive(Clone, Copy)]
struct Hinge {
    /// `[h, b1, a1, a2, b2]`.
    points: [u32; 5],
    /// Of (b1, a1) and of (a2, b2).
    triangles: [u32; 2],
}

/// How an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The accelerated step was taken.
    Accelerated,
    /// The plain step was taken: the accelerated one raised the energy, or there is no history yet.
    Plain,
    /// Nothing along the plain step lowers the energy; the points stay.
    Settled,
}

/// The state of an iteration.
pub(crate) struct Kernel {
    /// Where a point of the linkage stands here.
    place: Vec<u32>,
    corners: Vec<[u32; 3]>,
    hinges: Vec<Hinge>,
    /// The triangles at a point; of a free corner the second is the row of zeros after the last triangle.
    owners: Vec<[u32; 2]>,
    /// Hinge points in the order in which the matrix knows the pairs.
    joints: Vec<u32>,
    rings: Vec<Ring>,
    rules: Rules,
    global: Global,
    /// 1/D; zero where a point is held.
    reciprocals: Vec<f64>,
    /// Closeness: weight and place.
    pulls: Vec<f64>,
    targets: Vec<[f64; 3]>,
    /// Points drawn to a place: point, weight, place.
    handles: Vec<(u32, f64, Vector3<f64>)>,
    held: Vec<bool>,
    x: Vec<[f64; 3]>,
    next: Vec<[f64; 3]>,
    last: Vec<[f64; 3]>,
    forces: Vec<[f64; 3]>,
    normals: Vec<Vector3<f64>>,
    sums: Vec<[f64; 4]>,
    anderson: Anderson,
    /// Steps that raise the energy are refused.
    safeguard: bool,
    energy: f64,
}

/// A triangle that hangs on three hinges: its corners, and of each neighbour the two corners that are not the hinge.
#[derive(Clone, Copy)]
struct Ring {
    corners: [u32; 3],
    outer: [[u32; 2]; 3],
    /// The Laplacian at the start.
    start: Vector3<f64>,
}

impl Ring {
    /// Σ (c − c₀) over the neighbours' centroids c; each c − c₀ is a third of the sum of the arms at the hinge.
    #[inline]
    fn laplacian(&self, x: &[[f64; 3]]) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for k in 0..3 {
            let [a, b] = self.outer[k].map(|p| at(x, p));
            sum += a + b - at(x, self.corners[k]) * 2.0;
        }
        sum / 3.0
    }
}

#[inline(always)]
fn at(x: &[[f64; 3]], i: u32) -> Vector3<f64> {
    Vector3::from(x[i as usize])
}

#[inline(always)]
fn add(f: &mut [[f64; 3]], i: u32, v: &Vector3<f64>) {
    let f = &mut f[i as usize];
    for k in 0..3 {
        f[k] += v[k];
    }
}

impl Kernel {
    /// At `start` (in L, by point of the linkage), nothing drawn anywhere. Acceleration looks back `window` steps.
    pub fn new(
        problem: &Problem,
        start: &[Vector3<f64>],
        rules: Rules,
        window: usize,
    ) -> Result<Self, FactorError> {
        let triangles = problem.triangles.len();
        let mut owners = vec![[u32::MAX; 2]; problem.points];
        for (t, corners) in problem.triangles.iter().enumerate() {
            for &p in corners {
                let owners = &mut owners[p as usize];
                owners[usize::from(owners[0] != u32::MAX)] = t as u32;
            }
        }
        let owner = |h: &[u32; 5], inner: usize| {
            // The triangle at h that also has the arm.
            let [a, b] = owners[h[0] as usize];
            let has = |t: u32| {
                problem
                    .triangles
                    .get(t as usize)
                    .is_some_and(|c| c.contains(&h[inner]))
            };
            if has(a) { a } else { b }
        };
        let pairs: Vec<[u32; 2]> = problem
            .hinges
            .iter()
            .map(|h| [owner(h, 2), owner(h, 3)])
            .collect();
        let global = Global::new(triangles, &pairs)?;
        let mut rank = vec![0u32; triangles];
        let mut place = vec![u32::MAX; problem.points];
        let mut point_of = Vec::with_capacity(problem.points);
        let mut corners = Vec::with_capacity(triangles);
        for (k, &t) in global.order().iter().enumerate() {
            rank[t as usize] = k as u32;
            let points = problem.triangles[t as usize];
            for p in points {
                if place[p as usize] == u32::MAX {
                    place[p as usize] = point_of.len() as u32;
                    point_of.push(p);
                }
            }
            corners.push(points.map(|p| place[p as usize]));
        }
        // Points of no triangle, if there are any.
        for p in 0..problem.points {
            if place[p] == u32::MAX {
                place[p] = point_of.len() as u32;
                point_of.push(p as u32);
            }
        }
        let owners = point_of
            .iter()
            .map(|&p| {
                owners[p as usize].map(|t| rank.get(t as usize).map_or(triangles as u32, |r| *r))
            })
            .collect();
        let mut hinges: Vec<Hinge> = problem
            .hinges
            .iter()
            .zip(&pairs)
            .map(|(h, pair)| Hinge {
                points: h.map(|p| place[p as usize]),
                triangles: pair.map(|t| rank[t as usize]),
            })
            .collect();
        let joints = hinges.iter().map(|h| h.points[0]).collect();
        // In the order of their triangles; the matrix goes by the joints, which stay in the order of the pairs.
        hinges.sort_by_key(|h| h.triangles[0].min(h.triangles[1]));
        let x: Vec<[f64; 3]> = point_of.iter().map(|&p| start[p as usize].into()).collect();
        let points = x.len();
        let mut kernel = Self {
            rings: Vec::new(),
            place,
            corners,
            hinges,
            joints,
            owners,
            rules,
            global,
            reciprocals: vec![0.0; points],
            pulls: vec![0.0; points],
            targets: x.clone(),
            handles: Vec::new(),
            held: vec![false; points],
            next: x.clone(),
            last: x.clone(),
            forces: vec![[0.0; 3]; points],
            x,
            normals: vec![Vector3::zeros(); triangles],
            sums: vec![[0.0; 4]; triangles + 1],
            anderson: Anderson::new(3 * points, window),
            safeguard: window > 0,
            energy: f64::INFINITY,
        };
        kernel.rings = kernel.rings();
        Ok(kernel)
    }

    /// Every triangle that hangs on three hinges, with its neighbours' other corners.
    fn rings(&self) -> Vec<Ring> {
        let mut outer = vec![[[u32::MAX; 2]; 3]; self.corners.len()];
        for h in &self.hinges {
            let [_, b1, a1, a2, b2] = h.points;
            for (t, arms) in [(h.triangles[0], [a2, b2]), (h.triangles[1], [b1, a1])] {
                for k in 0..3 {
                    if self.corners[t as usize][k] == h.points[0] {
                        outer[t as usize][k] = arms;
                    }
                }
            }
        }
        outer
            .into_iter()
            .zip(&self.corners)
            .filter(|(outer, _)| outer.iter().all(|o| o[0] != u32::MAX))
            .map(|(outer, &corners)| {
                let mut ring = Ring {
                    corners,
                    outer,
                    start: Vector3::zeros(),
                };
                ring.start = ring.laplacian(&self.x);
                ring
            })
            .collect()
    }

    /// Weight of all edge vectors in the matrix.
    fn weight(&self) -> f64 {
        let hinges = if self.safeguard { 0.0 } else { HINGE_WEIGHT };
        EDGE_WEIGHT + hinges + SMOOTH_WEIGHT * self.rules.smoothness
    }

    /// Factors for the present pulls, handles and held points.
    pub fn refactor(&mut self) -> Result<(), FactorError> {
        let weight = self.weight();
        let rest = REST * weight;
        for (p, reciprocal) in self.reciprocals.iter_mut().enumerate() {
            let owners = self.owners[p]
                .iter()
                .filter(|&&t| (t as usize) < self.corners.len())
                .count();
            *reciprocal = self.pulls[p] + rest + 3.0 * weight * owners as f64;
        }
        for &(p, pull, _) in &self.handles {
            self.reciprocals[p as usize] += pull;
        }
        for (reciprocal, held) in self.reciprocals.iter_mut().zip(&self.held) {
            *reciprocal = if *held { 0.0 } else { 1.0 / *reciprocal };
        }
        self.global.refactor(
            weight,
            &self.reciprocals,
            &self.corners,
            self.joints.iter().copied(),
        )
    }

    /// The local steps: how far every term wants each point moved, and the energy (2) at `x`.
    fn local(&mut self) -> f64 {
        let mut energy = 0.0;
        let (x, forces) = (&self.x, &mut self.forces);
        for (((force, x), target), pull) in
            forces.iter_mut().zip(x).zip(&self.targets).zip(&self.pulls)
        {
            for k in 0..3 {
                let gap = target[k] - x[k];
                force[k] = pull * gap;
                energy += pull * gap * gap;
            }
        }
        for (point, pull, place) in &self.handles {
            let gap = place - at(x, *point);
            energy += pull * gap.norm_squared();
            add(forces, *point, &(gap * *pull));
        }
        for (corners, normal) in self.corners.iter().zip(&mut self.normals) {
            let [a, b, c] = corners.map(|p| at(x, p));
            let edges = [b - a, c - b, a - c];
            let moves = edges.map(|e| {
                let length = e.norm_squared().sqrt();
                energy += (length - 1.0) * (length - 1.0);
                // An edge of no length could turn anywhere: it waits for its neighbours.
                if length > 0.0 {
                    e * (1.0 / length - 1.0)
                } else {
                    e
                }
            });
            add(forces, corners[0], &(moves[2] - moves[0]));
            add(forces, corners[1], &(moves[0] - moves[1]));
            add(forces, corners[2], &(moves[1] - moves[2]));
            *normal = edges[0].cross(&-edges[2]);
        }
        let separation = self.rules.separation;
        for hinge in &self.hinges {
            let [h, _, a1, a2, _] = hinge.points;
            let [n1, n2] = hinge.triangles.map(|t| &self.normals[t as usize]);
            let centre = at(x, h);
            let (v2, v3) = (at(x, a1) - centre, at(x, a2) - centre);
            let across = v2.cross(&v3);
            // (3) n₁·(v₂ × v₃) ≥ 0, and (4) n₂·(v₃ × v₂) ≥ 0 with n₂ against the second triangle's own normal.
            if n1.dot(&across) < 0.0 {
                energy += part(forces, separation, n1, (h, a1, a2), &v2, &v3);
            }
            if n2.dot(&across) < 0.0 {
                energy += part(forces, separation, n2, (h, a2, a1), &v3, &v2);
            }
        }
        if let Some(sigma) = self.rules.bounds {
            energy += self.bounds(3f64.sqrt() * sigma);
        }
        energy + self.smooth()
    }

    /// Conditions (5) and (6), and the bound `apart` on |v₁ + v₂ − v₃ − v₄|.
    fn bounds(&mut self, apart: f64) -> f64 {
        let (x, forces) = (&self.x, &mut self.forces);
        let mut energy = 0.0;
        for hinge in &self.hinges {
            let p = hinge.points.map(|i| at(x, i));
            let d = p[1] + p[2] - p[3] - p[4];
            if d.norm_squared() > apart * apart {
                let step = close(&d, apart);
                energy += 4.0 * step.norm_squared();
                for (k, sign) in [(1, 1.0), (2, 1.0), (3, -1.0), (4, -1.0)] {
                    add(forces, hinge.points[k], &(step * sign));
                }
            }
            let [n1, n2] = hinge.triangles.map(|t| &self.normals[t as usize]);
            let arms = [1, 2, 3, 4].map(|k| p[k] - p[0]);
            // Twice the area stands for its own value √3/2: a margin, not a measure.
            let margin = OPEN_MARGIN;
            for (condition, value) in [
                (Condition::FirstOpen, n1.dot(&arms[0].cross(&arms[2]))),
                (Condition::SecondOpen, n2.dot(&arms[1].cross(&arms[3]))),
            ] {
                if value < margin
                    && let Some(signed) = condition.evaluate(&p)
                    && signed.value < margin
                {
                    let length: f64 = signed.gradient[1..].iter().map(Vector3::norm_squared).sum();
                    let factor = (margin - signed.value) / length.max(1e-12);
                    energy += factor * factor * length;
                    for (&point, gradient) in hinge.points.iter().zip(&signed.gradient) {
                        add(forces, point, &(gradient * factor));
                    }
                }
            }
        }
        energy
    }

    /// Smoothness: the vectors from a triangle's centroid to those of its three neighbours sum to nothing, or to what
    /// they did at the start.
    fn smooth(&mut self) -> f64 {
        let (x, forces) = (&self.x, &mut self.forces);
        let (weight, mut energy) = (self.rules.smoothness, 0.0);
        if weight == 0.0 {
            return 0.0;
        }
        for ring in &self.rings {
            let rest = match self.rules.rest {
                Rest::Flat => Vector3::zeros(),
                Rest::Start => ring.start,
            };
            let miss = rest - ring.laplacian(x);
            energy += 0.75 * weight * miss.norm_squared();
            // The nearest move of the twelve arms changes each by a quarter of what is missing.
            let quarter = miss * (0.25 * weight);
            for k in 0..3 {
                add(forces, ring.corners[k], &(quarter * -2.0));
                add(forces, ring.outer[k][0], &quarter);
                add(forces, ring.outer[k][1], &quarter);
            }
        }
        energy
    }

    /// The global step from the forces at `x`: the plain next iterate, into `next`.
    fn global(&mut self) {
        let (forces, reciprocals) = (&self.forces, &self.reciprocals);
        for (sum, corners) in self.sums.iter_mut().zip(&self.corners) {
            let mut total = [0.0; 4];
            for &p in corners {
                let (f, r) = (&forces[p as usize], reciprocals[p as usize]);
                for k in 0..3 {
                    total[k] += f[k] * r;
                }
            }
            *sum = total;
        }
        let triangles = self.corners.len();
        self.global.solve(&mut self.sums[..triangles]);
        let points = self
            .next
            .iter_mut()
            .zip(&self.x)
            .zip(forces)
            .zip(reciprocals)
            .zip(&self.owners);
        for ((((next, x), force), reciprocal), owners) in points {
            let [a, b] = owners.map(|t| &self.sums[t as usize]);
            for k in 0..3 {
                next[k] = x[k] + reciprocal * (force[k] + a[k] + b[k]);
            }
        }
    }

    /// To be called after anything but an iteration has changed: points, places, weights, rules.
    /// `track` brings the places on the surface up to date for the points given.
    pub fn restart(&mut self, track: &mut impl FnMut(&[[f64; 3]], &mut [[f64; 3]])) {
        self.anderson.reset();
        track(&self.x, &mut self.targets);
        self.energy = self.local();
    }

    /// One iteration from an evaluated state to an evaluated state.
    pub fn iterate(&mut self, track: &mut impl FnMut(&[[f64; 3]], &mut [[f64; 3]])) -> Outcome {
        self.global();
        if !self.safeguard {
            self.last.copy_from_slice(&self.x);
            self.x.copy_from_slice(&self.next);
            track(&self.x, &mut self.targets);
            self.energy = self.local();
            return Outcome::Plain;
        }
        let before = self.energy;
        self.last.copy_from_slice(&self.x);
        self.x.copy_from_slice(&self.next);
        let accelerated = self
            .anderson
            .accelerate(self.last.as_flattened(), self.x.as_flattened_mut());
        let mut evaluate = |kernel: &mut Self| {
            track(&kernel.x, &mut kernel.targets);
            kernel.energy = kernel.local();
            kernel.energy <= before
        };
        if accelerated {
            if evaluate(self) {
                return Outcome::Accelerated;
            }
            self.x.copy_from_slice(&self.next);
        }
        for _ in 0..=HALVINGS {
            if evaluate(self) {
                return Outcome::Plain;
            }
            for (x, last) in self
                .x
                .as_flattened_mut()
                .iter_mut()
                .zip(self.last.as_flattened())
            {
                *x = 0.5 * (*x + last);
            }
        }
        self.x.copy_from_slice(&self.last);
        self.anderson.reset();
        evaluate(self);
        Outcome::Settled
    }

    /// The weight of closeness, for all points; true if it is another.
    pub fn pull_all(&mut self, weight: f64) -> bool {
        let changed = self.pulls.iter().any(|w| *w != weight);
        self.pulls.fill(weight);
        changed
    }

    /// What hinges must keep to.
    pub fn rules(&mut self) -> &mut Rules {
        &mut self.rules
    }

    /// Holds exactly these points of the linkage, each at its place, and draws those others to theirs by a weight.
    pub fn hold(
        &mut self,
        hard: impl Iterator<Item = (u32, Vector3<f64>)>,
        soft: impl Iterator<Item = (u32, f64, Vector3<f64>)>,
    ) {
        self.held.fill(false);
        for (point, place) in hard {
            let point = self.place[point as usize] as usize;
            self.held[point] = true;
            self.x[point] = place.into();
        }
        self.handles.clear();
        self.handles
            .extend(soft.map(|(point, weight, place)| (self.place[point as usize], weight, place)));
    }

    /// Farthest that the last iteration moved a point.
    pub fn moved(&self) -> f64 {
        let far =
            |(a, b): (&[f64; 3], &[f64; 3])| (Vector3::from(*a) - Vector3::from(*b)).norm_squared();
        self.x
            .iter()
            .zip(&self.last)
            .map(far)
            .fold(0.0, f64::max)
            .sqrt()
    }

    /// The energy (2) where the points are.
    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// Numeric factorisations so far.
    pub fn factorizations(&self) -> usize {
        self.global.factorizations
    }

    /// Rows of the system of the global step, and entries of its factor below the diagonal.
    pub fn factor_size(&self) -> (usize, usize) {
        (self.corners.len(), self.global.entries())
    }

    /// For every point of the linkage its number here.
    pub fn places(&self) -> &[u32] {
        &self.place
    }

    /// Where a point of the linkage is; `None` if there is no such point.
    pub fn position(&self, point: u32) -> Option<Vector3<f64>> {
        Some(at(&self.x, *self.place.get(point as usize)?))
    }

    /// Positions by point of the linkage.
    pub fn positions(&self) -> impl ExactSizeIterator<Item = Vector3<f64>> {
        self.place.iter().map(|&p| at(&self.x, p))
    }
}

/// One tuple of (3) or (4): v₂ and v₃ move apart. Returns its part of the energy.
#[cold]
fn part(
    forces: &mut [[f64; 3]],
    kind: Separation,
    normal: &Vector3<f64>,
    (h, second, third): (u32, u32, u32),
    v2: &Vector3<f64>,
    v3: &Vector3<f64>,
) -> f64 {
    let Some(normal) = normal.try_normalize(0.0) else {
        return 0.0;
    };
    let [d2, d3] = separate(kind, &normal, v2, v3);
    add(forces, second, &d2);
    add(forces, third, &d3);
    add(forces, h, &-(d2 + d3));
    d2.norm_squared() + d3.norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::sparse::{Cholesky, Pattern};
    use crate::linkage::{Handedness, Linkage};
    use proptest::prelude::*;

    /// A hexagon of triangles, its points moved at random.
    fn patch(seed: u64) -> (Problem, Vec<Vector3<f64>>) {
        let linkage = Linkage::patch(1.0, Handedness::Right, &Linkage::hexagon_cells(3));
        let problem = Problem::new(&linkage, 1.5);
        let mut start = vec![Vector3::zeros(); problem.points];
        for t in linkage.triangles.iter() {
            for k in 0..3 {
                start[t.points[k].0 as usize] = Vector3::new(t.flat[k].x, t.flat[k].y, 0.0);
            }
        }
        let mut state = seed | 1;
        for v in start.iter_mut().flat_map(|p| p.iter_mut()) {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            *v += 0.3 * ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
        }
        (problem, start)
    }

    fn kernel(
        seed: u64,
        bounds: bool,
        smoothness: f64,
        window: usize,
    ) -> (Problem, Vec<Vector3<f64>>, Kernel) {
        let (problem, start) = patch(seed);
        let rules = Rules {
            separation: Separation::InPlane,
            bounds: bounds.then_some(1.5),
            smoothness,
            rest: Rest::Flat,
        };
        let kernel = Kernel::new(&problem, &start, rules, window).unwrap();
        (problem, start, kernel)
    }

    proptest! {
        #![proptest_config(crate::base::cases::cases(24))]

        /// The step over triangles is the step of the matrix over points.
        #[test]
        fn the_system_of_triangles_solves_that_of_the_points(
            seed: u64, pull in 0.001..0.5f64, held in prop::collection::btree_set(0usize..80, 0..5),
        ) {
            let (problem, start, mut kernel) = kernel(seed, true, 0.3, 0);
            kernel.pull_all(pull);
            for &p in &held {
                kernel.held[kernel.place[p] as usize] = true;
            }
            kernel.refactor().unwrap();
            kernel.restart(&mut |_, _| {});
            let w = kernel.weight();
            let sides = || problem.triangles.iter().flat_map(|t| (0..3).map(|k| (t[k], t[(k + 1) % 3])));
            let mut solver = Cholesky::new(Pattern::new(problem.points, sides())).unwrap();
            let mut values = vec![0.0; solver.pattern().entries()];
            for (i, j) in sides() {
                let (i, j) = (i as usize, j as usize);
                for (a, b, v) in [(i, i, w), (j, j, w), (i, j, -w)] {
                    let free = !held.contains(&a) && !held.contains(&b);
                    if a == b || free {
                        values[solver.pattern().slot(a, b).unwrap()] += v;
                    }
                }
            }
            for i in 0..problem.points {
                values[solver.pattern().diagonal(i)] += pull + REST * w;
            }
            solver.factor(&values).unwrap();
            for axis in 0..3 {
                let mut rhs: Vec<f64> = (0..problem.points)
                    .map(|p| if held.contains(&p) { 0.0 } else { kernel.forces[kernel.place[p] as usize][axis] })
                    .collect();
                solver.solve(&mut rhs);
                kernel.global();
                for (p, step) in rhs.iter().enumerate() {
                    let found = kernel.next[kernel.place[p] as usize][axis] - start[p][axis];
                    prop_assert!((found - step).abs() < 1e-9, "{found} {step}");
                }
            }
        }

        /// Under the safeguard the energy never rises, and it falls.
        #[test]
        fn the_energy_never_rises(seed: u64, bounds: bool, smooth: bool, pull in 0.001..0.1f64) {
            let (_, _, mut kernel) = kernel(seed, bounds, if smooth { 0.5 } else { 0.0 }, 5);
            kernel.pull_all(pull);
            kernel.refactor().unwrap();
            kernel.restart(&mut |_, _| {});
            let first = kernel.energy();
            for _ in 0..60 {
                let before = kernel.energy();
                kernel.iterate(&mut |_, _| {});
                prop_assert!(kernel.energy() <= before);
            }
            prop_assert!(kernel.energy() < 0.5 * first, "{} of {first}", kernel.energy());
        }

        /// What the terms ask for sums to nothing: they move the linkage as a whole neither along nor around.
        #[test]
        fn local_steps_keep_the_middle(seed: u64) {
            let (_, _, mut kernel) = kernel(seed, true, 0.7, 0);
            kernel.restart(&mut |_, _| {});
            let sum: Vector3<f64> = kernel.forces.iter().map(|f| Vector3::from(*f)).sum();
            prop_assert!(sum.norm() < 1e-10);
        }
    }
}
