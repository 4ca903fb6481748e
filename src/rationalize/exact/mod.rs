//! The exact solve: Newton steps on all conditions at once, in units of L.
//!
//! Energy: half the squares of |e| − 1 for every edge, of every violated condition (3)–(6) and λ ≤ σ, of w times the
//! distance from the target (a surface, point to plane, growing steeper where it is large; a place of its own for each
//! point; or a scale factor for each hinge), and of w/30 times the way from where the stage began. Three unknowns a
//! point, less two edges, less one surface condition leave only freedom at the rim, so exact solutions on the surface
//! are the rule: w fades out over a few stages without the edges having to give way. Where σ forbids the surface the
//! edges stay exact and the distance shows it. Three things keep the number of factorisations at about a third of plain
//! Gauss–Newton's:
//!
//! - violated conditions enter through a smooth max(0, r) whose rounding τ fades with w, so that a step sees the ones
//!   that it is about to violate instead of finding out afterwards;
//! - an edge that is too long resists turning as well; this part of its curvature is never negative and tames the steps
//!   where conditions contradict each other;
//! - the pull towards the beginning of the stage (not of the solve) stops drift along the surface without biasing the
//!   result.
//!
//! The last stage ends when edges and conditions hold to rounding. Then triangles that cross though no hinge joins them
//! get conditions of their own ([`contact`]), and the last stages run again.

mod contact;
mod opening;
mod system;

use nalgebra::{Matrix3, Point3, Vector3};

use self::contact::{Contact, contacts};
pub(crate) use self::opening::{Bends, Openings, bends};
use self::system::System;
use super::RationalizeError;
use super::problem::{CONDITIONS, Problem, hinge_violations};
use crate::base::progress::Progress;
use crate::base::sparse::FactorError;
use crate::mesh::{ClosestPoint, ClosestTracker};

/// What a solver did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Steps taken (exact) or iterations (projection).
    pub steps: usize,
    /// Numeric factorisations.
    pub factorizations: usize,
    /// Symbolic analyses: one, and one more each time hinges come near to a bound of theirs.
    pub analyses: usize,
}

impl Effort {
    /// Adds that of another solve.
    pub(crate) fn add(&mut self, other: Self) {
        self.steps += other.steps;
        self.factorizations += other.factorizations;
        self.analyses += other.analyses;
    }
}

/// What draws the points.
#[derive(Clone, Copy)]
pub(crate) enum Target<'a> {
    /// The nearest point of a surface (millimetres).
    Surface(&'a ClosestPoint),
    /// A place of its own for each point (millimetres), with a weight from 0 to 1.
    Places(&'a [(Point3<f64>, f64)]),
    /// A scale factor and bends for each hinge.
    Openings(Openings<'a>),
}

/// One stage of the continuation.
#[derive(Clone, Copy, Debug)]
struct Stage {
    /// Weight w of the target.
    weight: f64,
    /// Rounding τ of the conditions, in L.
    rounding: f64,
}

/// Target and rounding fade together; each stage starts so near its solution that one or two steps suffice.
const STAGES: [Stage; 4] = [
    Stage {
        weight: 0.1,
        rounding: 1e-2,
    },
    Stage {
        weight: 0.03,
        rounding: 3e-3,
    },
    Stage {
        weight: 1e-2,
        rounding: 1e-3,
    },
    Stage {
        weight: 1e-3,
        rounding: 1e-4,
    },
];

/// The last stage: conditions alone, met by the shortest way.
const LAST: Stage = Stage {
    weight: 0.0,
    rounding: 0.0,
};
/// Damping at its beginning.
const LAST_DAMPING: f64 = 1e-9;

/// Stages of the exact solve, each one unit of [`Progress::advance`].
pub const STAGE_COUNT: u64 = STAGES.len() as u64 + 1;

/// Weight of the way from the beginning of a stage, as a part of the target's.
const PROXIMAL: f64 = 1.0 / 30.0;
/// Damping at the beginning of a stage, as a part of the target's squared weight.
const DAMPING: f64 = 1e-2;
/// Steps in one stage at the most. Feasible cases take one or two; infeasible ones would creep on without end.
const STEPS: usize = 15;
/// Steps in the last stage at the most: from a surface it takes three or four, from a pose that stretches the linkage far more.
const LAST_STEPS: usize = 60;
/// A stage ends when a step gains, or promises, less than this part of the energy.
const GAIN: f64 = 0.02;
/// Rounds of parting triangles that cross.
const PARTINGS: usize = 6;
/// Tried only where there is not more than one crossing for so many triangles: if there are, they are no accident.
const FEW: usize = 50;
/// How much farther from the target the worst point may come by it, in L.
const WORTH: f64 = 0.05;
/// The stage that the solve goes back to in each of them.
const RESUME: usize = 2;
/// In the last stage a factor serves again after a step that left less than this part of the energy.
const CHORD: f64 = 1e-3;
/// Edges are exact when none is off by more than this, in L; conditions when none is violated by more. A few times what
/// rounding leaves of positions a thousand L from the origin.
const EXACT: f64 = 5e-13;
/// A hinge gets its blocks when one of its bounds is nearer than this at the start, in L.
const NEAR: f64 = 0.05;
/// When some hinge without blocks comes to a bound, all nearer than this get theirs.
const NEARER: f64 = 0.1;
/// From about this distance from a surface, in L, the pull grows with its cube: what cannot lie on it is spread over
/// many points instead of left to a few. On a mask that σ does not suffice for, the worst point came from 0.129 L to
/// 0.061 L, on a bump from 2.1 L to 0.6 L, and the mean rose by a fifth and to twice.
const FAR: f64 = 0.05;
/// Beyond this it grows in proportion again: there is no hope, and steps would have to be short.
const VERY_FAR: f64 = 0.5;
/// Second derivatives below this are left away.
const NEGLIGIBLE: f64 = 1e-6;

/// Solves from `start` (millimetres, one position a point) towards `target`; `edge_mm` is L. Points in `pinned` stay
/// where they start.
///
/// # Errors
/// [`RationalizeError`]: interruption, memory.
pub(crate) fn solve(
    problem: &Problem,
    start: &[Point3<f64>],
    target: Target<'_>,
    pinned: &[u32],
    edge_mm: f64,
    progress: &dyn Progress,
) -> Result<(Vec<Point3<f64>>, Effort), RationalizeError> {
    let mut solver = Solver::new(problem, start, target, pinned, edge_mm)?;
    for stage in &STAGES {
        solver.run(stage, STEPS, progress)?;
        progress.advance(1);
    }
    solver.run(&LAST, LAST_STEPS, progress)?;
    solver.part(progress)?;
    progress.advance(1);
    Ok((solver.positions_mm(), solver.effort))
}

/// Where one point is drawn to: along unit `normal`, `distance` away; every way if there is no normal.
#[derive(Clone, Copy, Debug)]
struct Draw {
    /// Unit normal of the tangent plane, or the offset itself where every direction counts.
    along: Vector3<f64>,
    distance: f64,
}

struct Solver<'a> {
    problem: &'a Problem,
    target: Target<'a>,
    pinned: &'a [u32],
    edge_mm: f64,
    x: Vec<Vector3<f64>>,
    trial: Vec<Vector3<f64>>,
    /// Where the stage began.
    begin: Vec<Vector3<f64>>,
    /// Closest points, where the target is a surface.
    tracker: Option<ClosestTracker<&'a ClosestPoint>>,
    /// What draws `x`, and `trial`.
    draws: Vec<Draw>,
    trial_draws: Vec<Draw>,
    near: Vec<bool>,
    contacts: Vec<Contact>,
    system: System,
    step: Vec<f64>,
    effort: Effort,
}

impl<'a> Solver<'a> {
    fn new(
        problem: &'a Problem,
        start: &[Point3<f64>],
        target: Target<'a>,
        pinned: &'a [u32],
        edge_mm: f64,
    ) -> Result<Self, RationalizeError> {
        let x: Vec<_> = start.iter().map(|p| p.coords / edge_mm).collect();
        let near: Vec<bool> = problem
            .hinges
            .iter()
            .map(|h| {
                matches!(target, Target::Openings(_))
                    || slack(problem, &h.map(|i| x[i as usize])) < NEAR
            })
            .collect();
        let system = System::new(problem, &near, &[])?;
        let tracker = match target {
            Target::Surface(closest) => Some(ClosestTracker::new(closest, x.len())),
            Target::Places(_) | Target::Openings(_) => None,
        };
        let none = Draw {
            along: Vector3::zeros(),
            distance: 0.0,
        };
        Ok(Self {
            problem,
            target,
            pinned,
            edge_mm,
            trial: x.clone(),
            begin: x.clone(),
            tracker,
            draws: vec![none; x.len()],
            trial_draws: vec![none; x.len()],
            near,
            contacts: Vec::new(),
            system,
            step: vec![0.0; 3 * x.len()],
            effort: Effort {
                analyses: 1,
                ..Effort::default()
            },
            x,
        })
    }

    fn positions_mm(&self) -> Vec<Point3<f64>> {
        let mm = |p: &Vector3<f64>| Point3::from(p * self.edge_mm);
        self.x.iter().map(mm).collect()
    }

    /// Parts triangles that cross though no hinge joins them. Where that fails, or would cost more than it is worth,
    /// everything stays as it is.
    fn part(&mut self, progress: &dyn Progress) -> Result<(), RationalizeError> {
        let before = self.x.clone();
        let allowed = self.farthest() + WORTH;
        let mut most = self.problem.triangles.len() / FEW;
        for _ in 0..PARTINGS {
            let found = contacts(self.problem, &self.x);
            let pairs = found.len() / 3;
            if pairs == 0 {
                if self.violation() > EXACT.sqrt() || self.farthest() > allowed {
                    break;
                }
                return Ok(());
            }
            if pairs > most {
                break;
            }
            most = pairs;
            self.contacts.extend(found);
            self.system = System::new(self.problem, &self.near, &self.contacts)?;
            self.effort.analyses += 1;
            for stage in &STAGES[RESUME..] {
                self.run(stage, STEPS, progress)?;
            }
            self.run(&LAST, LAST_STEPS, progress)?;
        }
        self.x = before;
        Ok(())
    }

    /// The longest way from a point to its target, in L.
    fn farthest(&self) -> f64 {
        let distances = self.draws.iter().map(|d| d.distance.abs());
        distances.fold(0.0, f64::max)
    }

    /// What draws the points of `trial`, into `trial_draws`.
    fn aim(&mut self) {
        let edge_mm = self.edge_mm;
        match self.target {
            Target::Surface(closest) => {
                let Some(tracker) = &mut self.tracker else {
                    return;
                };
                let draws = self.trial_draws.iter_mut().enumerate();
                for (x, (point, draw)) in self.trial.iter().zip(draws) {
                    let found = tracker.query(point, Point3::from(x * edge_mm));
                    let offset = x - found.point.coords / edge_mm;
                    let distance = offset.norm();
                    // On the surface the direction to it is lost in rounding; its normal is the limit.
                    *draw = if distance > 1e-9 {
                        Draw {
                            along: offset / distance,
                            distance,
                        }
                    } else {
                        let along = closest.normal(found.face);
                        Draw {
                            along,
                            distance: along.dot(&offset),
                        }
                    };
                }
            }
            Target::Places(places) => {
                for ((x, (place, weight)), draw) in
                    self.trial.iter().zip(places).zip(&mut self.trial_draws)
                {
                    let along = (x - place.coords / edge_mm) * *weight;
                    *draw = Draw {
                        along,
                        distance: along.norm(),
                    };
                }
            }
            // Hinges are drawn, not points.
            Target::Openings(_) => {}
        }
    }

    /// Half the sum of squares at `trial`, whose draws must be up to date.
    fn energy(&self, stage: &Stage) -> f64 {
        let x = &self.trial;
        let mut sum = 0.0;
        for t in &self.problem.triangles {
            for k in 0..3 {
                let r = (x[t[(k + 1) % 3] as usize] - x[t[k] as usize]).norm() - 1.0;
                sum += r * r;
            }
        }
        for h in &self.problem.hinges {
            let p = h.map(|i| x[i as usize]);
            for violation in hinge_violations(&p, self.problem.sigma) {
                let r = rounded(violation, stage.rounding).value;
                sum += r * r;
            }
        }
        for contact in &self.contacts {
            if let Some((clear, _)) = contact.evaluate(x) {
                let r = rounded(-clear, stage.rounding).value;
                sum += r * r;
            }
        }
        let target = stage.weight * stage.weight;
        let proximal = target * PROXIMAL * PROXIMAL;
        for ((x, begin), draw) in x.iter().zip(&self.begin).zip(&self.trial_draws) {
            let off = match self.target {
                Target::Surface(_) => 2.0 * stiffened(draw.distance).value,
                Target::Places(_) | Target::Openings(_) => draw.distance * draw.distance,
            };
            sum += target * off + proximal * (x - begin).norm_squared();
        }
        if let Target::Openings(wanted) = &self.target {
            sum += target * opening::misfit(self.problem, wanted, x);
        }
        0.5 * sum
    }

    /// Gives hinges that come near to a bound their blocks.
    fn widen(&mut self, stage: &Stage) -> Result<(), FactorError> {
        let least = |h: &[u32; 5]| slack(self.problem, &h.map(|i| self.x[i as usize]));
        let mut hinges = self.problem.hinges.iter().zip(&self.near);
        if !hinges.any(|(h, near)| !near && least(h) < 3.0 * stage.rounding) {
            return Ok(());
        }
        let wider = self.problem.hinges.iter().zip(&self.near);
        self.near = wider.map(|(h, near)| *near || least(h) < NEARER).collect();
        self.system = System::new(self.problem, &self.near, &self.contacts)?;
        self.effort.analyses += 1;
        Ok(())
    }

    /// Hessian and negative gradient at `x`.
    fn assemble(&mut self, stage: &Stage) -> Result<(), FactorError> {
        self.widen(stage)?;
        let (problem, x, system) = (self.problem, &self.x, &mut self.system);
        system.clear();
        for (n, t) in problem.triangles.iter().enumerate() {
            for k in 0..3 {
                let ends = [t[k], t[(k + 1) % 3]];
                let edge = x[ends[1] as usize] - x[ends[0] as usize];
                let length = edge.norm().max(1e-12);
                let g = edge / length;
                let residual = length - 1.0;
                // What is too long resists turning; what is too short would ask for it, and is left to do without.
                let turning = residual.max(0.0) / length;
                let m = g * g.transpose() * (1.0 - turning) + Matrix3::identity() * turning;
                system.add_side(n, k, ends, &m);
                system.pull(ends[0], &-g, residual);
                system.pull(ends[1], &g, residual);
            }
        }
        for (n, h) in problem.hinges.iter().enumerate() {
            let Some(clique) = system.hinge(n) else {
                continue;
            };
            let p = h.map(|i| x[i as usize]);
            let violations = hinge_violations(&p, problem.sigma);
            for (condition, violation) in CONDITIONS.into_iter().zip(violations) {
                let bend = rounded(violation, stage.rounding);
                let curvature = bend.slope * bend.slope + bend.value * bend.curvature;
                if curvature > NEGLIGIBLE
                    && let Some(gradient) = condition.violation_gradient(&p)
                {
                    system.add_clique(clique, &gradient, curvature, bend.value * bend.slope);
                }
            }
        }
        for (n, contact) in self.contacts.iter().enumerate() {
            if let Some((clear, gradient)) = contact.evaluate(x) {
                let bend = rounded(-clear, stage.rounding);
                let curvature = bend.slope * bend.slope + bend.value * bend.curvature;
                if curvature > NEGLIGIBLE {
                    let clique = system.contact(n);
                    system.add_clique(clique, &gradient, curvature, -bend.value * bend.slope);
                }
            }
        }
        let target = stage.weight * stage.weight;
        let proximal = target * PROXIMAL * PROXIMAL;
        for i in 0..problem.points {
            let draw = &self.draws[i];
            match self.target {
                Target::Surface(_) => {
                    let pull = stiffened(draw.distance);
                    system.add_outer(i as u32, &draw.along, target * pull.curvature);
                    system.pull(i as u32, &draw.along, target * pull.slope);
                }
                Target::Places(places) => {
                    let weight = places[i].1;
                    system.add_identity(i as u32, target * weight * weight);
                    system.pull(i as u32, &draw.along, target * weight);
                }
                Target::Openings(_) => {}
            }
            system.add_identity(i as u32, proximal);
            system.pull(i as u32, &(x[i] - self.begin[i]), proximal);
        }
        if let Target::Openings(wanted) = &self.target {
            opening::draw(problem, wanted, x, target, system);
        }
        for &i in self.pinned {
            system.pin(i);
        }
        Ok(())
    }

    /// How far the worst edge is off and the worst condition violated, in L.
    fn violation(&self) -> f64 {
        let x = &self.x;
        let mut worst = 0.0f64;
        for t in &self.problem.triangles {
            for k in 0..3 {
                let length = (x[t[(k + 1) % 3] as usize] - x[t[k] as usize]).norm();
                worst = worst.max((length - 1.0).abs());
            }
        }
        for h in &self.problem.hinges {
            worst = worst.max(-slack(self.problem, &h.map(|i| x[i as usize])));
        }
        for (clear, _) in self.contacts.iter().filter_map(|c| c.evaluate(x)) {
            worst = worst.max(-clear);
        }
        worst
    }

    fn run(
        &mut self,
        stage: &Stage,
        steps: usize,
        progress: &dyn Progress,
    ) -> Result<(), RationalizeError> {
        let last = stage.rounding == 0.0;
        self.begin.copy_from_slice(&self.x);
        self.trial.copy_from_slice(&self.x);
        self.aim();
        std::mem::swap(&mut self.draws, &mut self.trial_draws);
        self.trial_draws.copy_from_slice(&self.draws);
        let mut energy = self.energy(stage);
        let mut damping = (DAMPING * stage.weight * stage.weight).max(LAST_DAMPING);
        let mut factored = false;
        for _ in 0..steps {
            if last && self.violation() < EXACT {
                break;
            }
            let analyses = self.effort.analyses;
            self.assemble(stage)?;
            factored &= analyses == self.effort.analyses;
            let Some(there) = self.descend(stage, energy, factored, &mut damping, progress)? else {
                break;
            };
            self.effort.steps += 1;
            // Near the end the last factor is as good as a new one.
            factored = last && there < CHORD * energy;
            let gained = energy - there;
            energy = there;
            if !last && gained < GAIN * (gained + there) {
                break;
            }
        }
        Ok(())
    }

    /// One step from `x` that lowers the energy, and the energy there; none if there is little left to gain. `factored`
    /// if the factor of the step before is to be tried first.
    fn descend(
        &mut self,
        stage: &Stage,
        energy: f64,
        mut factored: bool,
        damping: &mut f64,
        progress: &dyn Progress,
    ) -> Result<Option<f64>, RationalizeError> {
        // Each further rejection raises the damping more steeply: it starts tiny, and every try is a factorisation.
        let mut growth = 6.0;
        while *damping < 1e6 {
            progress.check()?;
            if !factored {
                self.effort.factorizations += 1;
                match self.system.factor(*damping) {
                    Ok(()) => {}
                    Err(FactorError::NotPositiveDefinite) => {
                        *damping = (*damping * growth).max(1e-12);
                        growth *= 4.0;
                        continue;
                    }
                    Err(other) => return Err(other.into()),
                }
            }
            let promised = self.system.solve(&mut self.step);
            let moved = self.trial.iter_mut().zip(&self.x);
            for ((t, x), s) in moved.zip(self.step.chunks_exact(3)) {
                *t = x + Vector3::new(s[0], s[1], s[2]);
            }
            for &i in self.pinned {
                self.trial[i as usize] = self.x[i as usize];
            }
            self.aim();
            let there = self.energy(stage);
            if there < energy {
                std::mem::swap(&mut self.x, &mut self.trial);
                std::mem::swap(&mut self.draws, &mut self.trial_draws);
                if !factored {
                    *damping /= 5.0;
                }
                return Ok(Some(there));
            }
            if factored {
                factored = false;
                continue;
            }
            let longest = self.step.iter().fold(0.0f64, |m, s| m.max(s.abs()));
            let little = if stage.rounding > 0.0 {
                promised < GAIN * energy
            } else {
                longest < 1e-14
            };
            if little {
                break;
            }
            *damping *= growth;
            growth *= 4.0;
        }
        Ok(None)
    }
}

/// A smooth max(0, r) and its derivatives.
struct Rounded {
    value: f64,
    slope: f64,
    curvature: f64,
}

/// ½ (r + √(r² + 4τ²)), which is max(0, r) for τ = 0.
#[inline]
fn rounded(r: f64, tau: f64) -> Rounded {
    if tau == 0.0 {
        return Rounded {
            value: r.max(0.0),
            slope: f64::from(r > 0.0),
            curvature: 0.0,
        };
    }
    let root = (r * r + 4.0 * tau * tau).sqrt();
    // The second form is the first without cancellation.
    let value = if r > 0.0 {
        0.5 * (r + root)
    } else {
        2.0 * tau * tau / (root - r)
    };
    Rounded {
        value,
        slope: value / root,
        curvature: 2.0 * tau * tau / (root * root * root),
    }
}

/// ½ d² up to about [`FAR`], then growing with d⁴, up to [`VERY_FAR`].
#[inline]
fn stiffened(d: f64) -> Rounded {
    let near = d.abs().min(VERY_FAR);
    let steep = near * near / (FAR * FAR);
    Rounded {
        value: 0.5 * (near * near * (1.0 + 0.5 * steep) + (d * d - near * near) * (1.0 + steep)),
        slope: d * (1.0 + steep),
        curvature: if d.abs() < VERY_FAR {
            1.0 + 3.0 * steep
        } else {
            1.0 + steep
        },
    }
}

/// How far a hinge is from the nearest of its bounds, in L; negative past one.
fn slack(problem: &Problem, p: &[Vector3<f64>; 5]) -> f64 {
    let violations = hinge_violations(p, problem.sigma);
    -violations.into_iter().fold(f64::NEG_INFINITY, f64::max)
}
