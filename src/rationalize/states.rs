//! States of one linkage: opened and closed, and the way between (paper, Fig. 16: mechanical dimming).
//!
//! A state is wanted with a certain *mean opening*, the mean scale factor over the hinges. Closing takes from every hinge
//! the same part of what it is open, λ − 1; opening gives to every hinge the same part of what it has left, σ − λ. Both
//! ends are flat where the linkage can be flat, and on the way a shape keeps its character: its curvature is that of
//! ln λ. Scale factors alone leave a linkage limp, so hinges are drawn to bends too: those of the start, less the nearer
//! the end is. A path is followed in short steps. Edges and conditions come first; where they do not permit what the
//! hinges are drawn to, the mean is off, and what they are drawn to is corrected until it is met.
//!
//! Between two given states of one linkage the hinges' scale factors and bends go evenly from those of the one to those
//! of the other, wherever the triangles come to lie: a sheet unrolls instead of being squeezed flat.

use nalgebra::{Matrix3, Point3, Vector3};

use super::exact::{self, Bends, Effort};
use super::problem::Problem;
use super::quality::SIGMA_TOLERANCE;
use super::{RationalizeError, Soundness, hinge_scales};
use crate::base::ids::Id as _;
use crate::base::progress::Progress;
use crate::base::union::Union;
use crate::linkage::{Linkage, write_obj};

/// A state whose edges are off by more than this (in L) is not exact.
pub const EXACT_EDGES: f64 = 1e-9;

/// The mean opening is met when it is not off by more than this.
const MET: f64 = 5e-5;

/// … and near enough when corrections do not get it nearer: a solve ends when there is little to gain, each a little
/// elsewhere.
const NEAR: f64 = 1e-4;

/// … and it is reached, at the end of a path, when it is not off by more than this: hinges stop a little short of 180°.
pub const REACHED: f64 = 1.5e-4;

/// Rounding of a mean opening.
const ROUNDING: f64 = 1e-9;

/// Longest step of the mean opening.
const LONGEST: f64 = 0.1;

/// On the way it may be off by this part of the step.
const LOOSE: f64 = 0.25;

/// Shortest step: where not even this succeeds, or gains so much, the path ends.
const SHORTEST: f64 = 0.002;

/// Corrections of what the hinges are drawn to, for one step.
const CORRECTIONS: usize = 8;

/// The mean opening to which a sheet without seams is brought before it is laid down closed.
const NEARLY_CLOSED: f64 = 1.01;

/// … and below which that is done.
const LAID_DOWN: f64 = 1.015;

/// Solves for one step between two given states at the most.
const MOST_STRIDES: f64 = 40.0;

/// Most steps of a path: the states are numbered with three digits.
pub const MOST_STEPS: usize = 999;

/// Why there is no path.
#[derive(Debug, thiserror::Error)]
pub enum StatesError {
    /// A number of steps that is none.
    #[error("{steps} steps are not possible: 1 to {MOST_STEPS} are")]
    Steps {
        /// As given.
        steps: usize,
    },
    /// A mean opening that no state has.
    #[error(
        "a mean opening of {asked} is not possible: hinges open from 1 (closed) to {sigma} (σ; fully open is 2)"
    )]
    Opening {
        /// As given.
        asked: f64,
        /// The bound.
        sigma: f64,
    },
    /// σ is out of range.
    #[error("σ = {sigma} is not possible: hinges open from 1 (closed) to 2 (fully open)")]
    Sigma {
        /// As given.
        sigma: f64,
    },
    /// The state that is given opens farther than it may.
    #[error(
        "it opens to λ = {opening} at vertex {point}, and σ = {sigma} is the most that is allowed; give a larger σ"
    )]
    TooWide {
        /// Its widest hinge.
        opening: f64,
        /// The hinge, counted from 1.
        point: u32,
        /// The bound.
        sigma: f64,
    },
    /// Nothing opens.
    #[error("it has no hinges, so that it neither opens nor closes")]
    NoHinges,
    /// Two files that are no states of one linkage.
    #[error("the two are not the same linkage: {0}; both must come from one linkage.obj")]
    Different(String),
    /// No solution at all.
    #[error(transparent)]
    Rationalize(#[from] RationalizeError),
}

/// One state of a linkage.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Positions of its points, millimetres.
    pub positions: Vec<Point3<f64>>,
    /// The mean opening that was asked for; none between two given states.
    pub asked: Option<f64>,
    /// Edges, openings, overlaps.
    pub soundness: Soundness,
    /// Part of its extent that is open, where light passes: see [`open_share`].
    pub open_share: f64,
}

impl State {
    fn new(linkage: &Linkage, positions: Vec<Point3<f64>>, asked: Option<f64>, sigma: f64) -> Self {
        Self {
            asked,
            soundness: Soundness::measure(linkage, &positions, sigma),
            open_share: open_share(&hinge_scales(linkage, &positions)),
            positions,
        }
    }

    /// Exact edges and no overlaps, and no hinge opens too far.
    pub fn sound(&self) -> bool {
        sound(&self.soundness)
    }

    /// Mean opening.
    pub fn mean(&self) -> f64 {
        self.soundness.opening[1]
    }

    /// As `linkage.obj`.
    pub fn obj(&self, linkage: &Linkage) -> String {
        write_obj(linkage, &self.positions)
    }
}

fn sound(q: &Soundness) -> bool {
    q.edge_error_max <= EXACT_EDGES && q.penetrations + q.intersections + q.over_sigma == 0
}

/// The open part of the area that hinges with these scale factors span. Around a hinge with scale factor λ a triangle
/// has λ² times its own area, so that of all 1 − 1 / mean(λ²) is open: 0 closed, ¾ fully open. Thickness, and how the light
/// falls, are left aside.
pub fn open_share(scales: &[f64]) -> f64 {
    let square = scales.iter().map(|s| s * s).sum::<f64>() / scales.len().max(1) as f64;
    if square > 0.0 {
        (1.0 - 1.0 / square).max(0.0)
    } else {
        0.0
    }
}

/// A path through states of one linkage.
#[derive(Clone, Debug)]
pub struct StatePath {
    /// The states in their order, one more than steps.
    pub states: Vec<State>,
    /// Whether the first and the last have the mean opening that was asked for.
    pub reached: [bool; 2],
    /// What the solver did.
    pub effort: Effort,
}

/// States of a linkage from mean opening `from` to mean opening `to` in `steps` equal steps, found from the state at
/// `start` (millimetres, by point), no hinge opening farther than `sigma`. Each state lies as the one before, as well as
/// it can. Where the conditions forbid an end, the path ends at the nearest state that was found.
///
/// # Errors
/// [`StatesError`]: a number out of range, a start that opens beyond `sigma`, interruption, memory.
pub fn opening_path(
    linkage: &Linkage,
    start: &[Point3<f64>],
    [from, to]: [f64; 2],
    steps: usize,
    sigma: f64,
    progress: &dyn Progress,
) -> Result<StatePath, StatesError> {
    check(linkage, &[start], steps, sigma)?;
    for asked in [from, to] {
        // Measured openings of closed linkages are 1 but for rounding.
        if !(1.0 - ROUNDING..=sigma + ROUNDING).contains(&asked) {
            return Err(StatesError::Opening { asked, sigma });
        }
    }
    let [from, to] = [from, to].map(|asked| asked.clamp(1.0, sigma));
    progress.start("states", Some(steps as u64 + 1));
    let mut walk = Walk::new(linkage, start, sigma);
    let at_start = walk.go(from, progress)?;
    let first = walk.clone();
    let begin = if at_start { from } else { first.mean };
    let (mut states, at_end) = walk.states(begin, to, steps, progress)?;
    if !at_end {
        // Evenly as far as it went.
        let end = walk.x.clone();
        let effort = walk.effort;
        progress.note(&format!(
            "a mean opening of {to} is not within reach: {:.4} is",
            walk.mean
        ));
        progress.start("states", Some(steps as u64 + 1));
        let last = walk.mean;
        walk = first;
        (states, _) = walk.states(begin, last, steps, progress)?;
        walk.effort.add(effort);
        states.truncate(steps);
        let before = states.last().map_or(&end, |s| &s.positions);
        let end = aligned(&end, before);
        states.push(State::new(linkage, end, Some(to), sigma));
    }
    Ok(StatePath {
        states,
        reached: [at_start, at_end],
        effort: walk.effort,
    })
}

/// States of a linkage from that at `a` to that at `b` (millimetres, by point) in `steps` steps, no hinge opening farther
/// than `sigma`. Both ends are as given, `b` moved as a whole to lie as `a` does.
///
/// # Errors
/// [`StatesError`]: a number out of range, an end that opens beyond `sigma`, interruption, memory.
pub fn path_between(
    linkage: &Linkage,
    [a, b]: [&[Point3<f64>]; 2],
    steps: usize,
    sigma: f64,
    progress: &dyn Progress,
) -> Result<StatePath, StatesError> {
    check(linkage, &[a, b], steps, sigma)?;
    progress.start("states", Some(steps as u64 + 1));
    let problem = Problem::new(linkage, sigma);
    let shapes = [a, b].map(|x| Shape::of(linkage, &problem, x));
    let strides = shapes[0].distance(&shapes[1]) / (0.5 * LONGEST * steps as f64);
    let strides = strides.ceil().clamp(1.0, MOST_STRIDES) as usize;
    let mut effort = Effort::default();
    let mut states = vec![State::new(linkage, a.to_vec(), None, sigma)];
    let mut x = a.to_vec();
    for n in 1..steps {
        progress.advance(1);
        for k in 1..=strides {
            let t = ((n - 1) * strides + k) as f64 / (steps * strides) as f64;
            let wanted = shapes[0].towards(&shapes[1], t);
            let (found, spent) = wanted.solve(linkage, &problem, &x, progress)?;
            effort.add(spent);
            x = aligned(&found, &x);
        }
        states.push(State::new(linkage, x.clone(), None, sigma));
    }
    states.push(State::new(linkage, aligned(b, &x), None, sigma));
    progress.advance(2);
    Ok(StatePath {
        states,
        reached: [true, true],
        effort,
    })
}

/// Whether two linkages are the same one, in whatever states.
///
/// # Errors
/// [`StatesError::Different`], with the first difference.
pub fn check_same(a: &Linkage, b: &Linkage) -> Result<(), StatesError> {
    let different = |what: String| Err(StatesError::Different(what));
    if a.triangles.len() != b.triangles.len() || a.point_count() != b.point_count() {
        return different(format!(
            "one has {} triangles and {} vertices, the other {} and {}",
            a.triangles.len(),
            a.point_count(),
            b.triangles.len(),
            b.point_count()
        ));
    }
    // Single precision is what other programs keep texture coordinates in.
    let far = a.triangles.iter().flat_map(|t| t.flat);
    let far = far.map(|p| p.coords.amax()).fold(0.0, f64::max);
    let slack = 1e-6 * (a.edge_mm + far);
    for (n, (s, t)) in a.triangles.iter().zip(b.triangles.iter()).enumerate() {
        let face = n + 1;
        if s.points != t.points {
            let names = |p: &[crate::linkage::PointId; 3]| p.map(|p| p.0 + 1);
            return different(format!(
                "face {face} has the vertices {:?} in one and {:?} in the other",
                names(&s.points),
                names(&t.points)
            ));
        }
        if s.flat
            .iter()
            .zip(&t.flat)
            .any(|(p, q)| (p - q).amax() > slack)
        {
            return different(format!("face {face} has another place on the sheet (vt)"));
        }
    }
    if a.hinges != b.hinges {
        return different("their slits run opposite ways".into());
    }
    Ok(())
}

fn check(
    linkage: &Linkage,
    given: &[&[Point3<f64>]],
    steps: usize,
    sigma: f64,
) -> Result<(), StatesError> {
    if !(1..=MOST_STEPS).contains(&steps) {
        return Err(StatesError::Steps { steps });
    }
    if !(1.0..=2.0).contains(&sigma) {
        return Err(StatesError::Sigma { sigma });
    }
    if linkage.hinges.is_empty() {
        return Err(StatesError::NoHinges);
    }
    for positions in given {
        let scales = hinge_scales(linkage, positions);
        let widest = scales
            .iter()
            .zip(&linkage.hinges)
            .max_by(|(a, _), (b, _)| a.total_cmp(b));
        if let Some((&opening, hinge)) = widest
            && opening > sigma + SIGMA_TOLERANCE
        {
            let point = hinge.point.0 + 1;
            return Err(StatesError::TooWide {
                opening,
                point,
                sigma,
            });
        }
    }
    Ok(())
}

/// A linkage on its way from opening to opening.
#[derive(Clone)]
struct Walk<'a> {
    linkage: &'a Linkage,
    problem: Problem,
    /// What the hinges are like at the start, and how far they are open there in the mean.
    shape: Shape,
    start_mean: f64,
    /// Where it is now.
    x: Vec<Point3<f64>>,
    mean: f64,
    /// By how much more than its mean the hinges are drawn to now.
    lead: f64,
    effort: Effort,
}

impl<'a> Walk<'a> {
    fn new(linkage: &'a Linkage, start: &[Point3<f64>], sigma: f64) -> Self {
        let problem = Problem::new(linkage, sigma);
        let shape = Shape::of(linkage, &problem, start);
        let mean = mean(&shape.scales);
        Self {
            linkage,
            problem,
            shape,
            start_mean: mean,
            x: start.to_vec(),
            mean,
            lead: 0.0,
            effort: Effort::default(),
        }
    }

    /// The states at `steps` equal steps of the mean opening, and whether the last one was reached. Ends early if not.
    fn states(
        &mut self,
        from: f64,
        to: f64,
        steps: usize,
        progress: &dyn Progress,
    ) -> Result<(Vec<State>, bool), RationalizeError> {
        let sigma = self.problem.sigma;
        let mut states = Vec::with_capacity(steps + 1);
        for n in 0..=steps {
            let asked = from + (to - from) * (n as f64 / steps as f64);
            if n > 0 && !self.go(asked, progress)? {
                return Ok((states, false));
            }
            states.push(State::new(self.linkage, self.x.clone(), Some(asked), sigma));
            progress.advance(1);
        }
        Ok((states, true))
    }

    /// Goes to a mean opening, or as near as it can, and tells whether it got there.
    fn go(&mut self, asked: f64, progress: &dyn Progress) -> Result<bool, RationalizeError> {
        let flat = if asked <= 1.0 { self.flat() } else { None };
        let goal = if flat.is_some() { NEARLY_CLOSED } else { asked };
        let mut stride = LONGEST;
        let lies = |mean: f64| flat.is_some() && mean < LAID_DOWN;
        while (goal - self.mean).abs() > MET && !lies(self.mean) {
            let way = goal - self.mean;
            let on_the_way = way.abs() > stride || flat.is_some();
            let next = self.mean + stride.min(way.abs()).copysign(way);
            let next = if way.abs() > stride { next } else { goal };
            match self.step(next, on_the_way, progress)? {
                Step::Arrived if next == goal && flat.is_none() => break,
                Step::Arrived => stride = LONGEST.min(1.5 * stride),
                Step::Bounded(gained) if gained < SHORTEST => break,
                Step::Bounded(_) => {}
                Step::Failed => {
                    stride = 0.5 * stride.min(way.abs());
                    if stride < SHORTEST {
                        break;
                    }
                }
            }
        }
        if let Some(flat) = flat
            && self.mean < LAID_DOWN
        {
            self.x = aligned(&flat, &self.x);
            self.mean = mean(&hinge_scales(self.linkage, &self.x));
            self.lead = 0.0;
        }
        Ok((asked - self.mean).abs() <= REACHED)
    }

    /// One solve, or a few until the mean is met; `on_the_way` about is enough. Goes nowhere if that fails.
    fn step(
        &mut self,
        asked: f64,
        on_the_way: bool,
        progress: &dyn Progress,
    ) -> Result<Step, RationalizeError> {
        let sigma = self.problem.sigma;
        let way = (asked - self.mean).abs();
        let enough = if on_the_way { LOOSE * way } else { MET };
        let mut drawn = (asked + self.lead).clamp(1.0, sigma);
        let mut x = self.x.clone();
        let mut best: Option<Found> = None;
        let mut bounded = false;
        for _ in 0..CORRECTIONS {
            let wanted = self.drawn_to(drawn);
            let (found, effort) = wanted.solve(self.linkage, &self.problem, &x, progress)?;
            self.effort.add(effort);
            let q = Soundness::measure(self.linkage, &found, sigma);
            if !sound(&q) {
                break;
            }
            let mean = q.opening[1];
            let off = mean - asked;
            if best.as_ref().is_none_or(|b| off.abs() < b.off) {
                best = Some(Found {
                    off: off.abs(),
                    x: found.clone(),
                    mean,
                    drawn,
                });
            }
            // No secant: a solve also goes on where the one before left off, and two differences tell little.
            let next = (drawn - off).clamp(1.0, sigma);
            bounded = next == drawn;
            if off.abs() <= enough || bounded {
                break;
            }
            drawn = next;
            x = found;
        }
        let Some(best) = best else {
            return Ok(Step::Failed);
        };
        let step = if best.off <= enough.max(NEAR) {
            Step::Arrived
        } else if bounded && best.off < way {
            Step::Bounded(way - best.off)
        } else {
            return Ok(Step::Failed);
        };
        self.x = aligned(&best.x, &self.x);
        self.mean = best.mean;
        self.lead = best.drawn - best.mean;
        Ok(step)
    }

    /// A shape with this mean opening, between that of the start and a flat one, closed or open to σ.
    fn drawn_to(&self, mean: f64) -> Shape {
        let end = if mean <= self.start_mean {
            1.0
        } else {
            self.problem.sigma
        };
        let span = end - self.start_mean;
        // What is left of the start. Without a way to go all of it.
        let left = if span.abs() < 1e-9 {
            1.0
        } else {
            ((end - mean) / span).clamp(0.0, 1.0)
        };
        // Curvature is that of ln λ, and goes with the square of the bends.
        let bent = left.sqrt();
        let Shape { scales, bends } = &self.shape;
        Shape {
            scales: scales.iter().map(|s| end - (end - s) * left).collect(),
            bends: bends.iter().map(|b| b.map(|b| b * bent)).collect(),
        }
    }

    /// The closed sheet, if all of the linkage can be laid down on it: it is one piece and has no seams.
    fn flat(&self) -> Option<Vec<Point3<f64>>> {
        let mut sets = Union::new(self.linkage.triangles.len());
        let joined = self.linkage.hinges.iter();
        let joined = joined.filter(|h| sets.join(h.ccw.triangle.index(), h.cw.triangle.index()));
        let pieces = self.linkage.triangles.len() - joined.count();
        if pieces > 1 || self.linkage.hinges.iter().any(|h| h.seam) {
            return None;
        }
        let mut flat = vec![Point3::origin(); self.x.len()];
        for t in self.linkage.triangles.iter() {
            for (p, at) in t.points.iter().zip(&t.flat) {
                flat[p.index()] = Point3::new(at.x, at.y, 0.0);
            }
        }
        let q = Soundness::measure(self.linkage, &flat, self.problem.sigma);
        sound(&q).then_some(flat)
    }
}

/// What came of a step.
enum Step {
    /// It is where it was to go.
    Arrived,
    /// Its hinges are drawn as far as they can be, and it is not there; it came so much nearer.
    Bounded(f64),
    /// It is where it was.
    Failed,
}

/// A solution, how far off it is, and what the hinges were drawn to in the mean.
struct Found {
    off: f64,
    x: Vec<Point3<f64>>,
    mean: f64,
    drawn: f64,
}

/// What the hinges of a linkage are like, which is its shape but for where it lies.
#[derive(Clone)]
struct Shape {
    scales: Vec<f64>,
    bends: Vec<Bends>,
}

impl Shape {
    fn of(linkage: &Linkage, problem: &Problem, positions: &[Point3<f64>]) -> Self {
        let at = |i: u32| positions[i as usize].coords / linkage.edge_mm;
        let hinges = problem.hinges.iter();
        Self {
            scales: hinge_scales(linkage, positions),
            bends: hinges.map(|h| exact::bends(&h.map(at))).collect(),
        }
    }

    /// Part `t` of the way to another.
    fn towards(&self, other: &Self, t: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * t;
        let scales = self.scales.iter().zip(&other.scales);
        let bends = self.bends.iter().zip(&other.bends);
        Self {
            scales: scales.map(|(a, b)| mix(*a, *b)).collect(),
            bends: bends
                .map(|(a, b)| std::array::from_fn(|k| mix(a[k], b[k])))
                .collect(),
        }
    }

    /// By how much the hinges of another differ, root mean square.
    fn distance(&self, other: &Self) -> f64 {
        let scales = self.scales.iter().zip(&other.scales);
        let bends = self
            .bends
            .iter()
            .flatten()
            .zip(other.bends.iter().flatten());
        let square = |(a, b): (&f64, &f64)| (a - b) * (a - b);
        let all = scales.map(square).sum::<f64>() + 0.25 * bends.map(square).sum::<f64>();
        (all / self.scales.len().max(1) as f64).sqrt()
    }

    /// The exact linkage next to this shape, from `start`.
    fn solve(
        &self,
        linkage: &Linkage,
        problem: &Problem,
        start: &[Point3<f64>],
        progress: &dyn Progress,
    ) -> Result<(Vec<Point3<f64>>, Effort), RationalizeError> {
        let target = exact::Target::Openings(exact::Openings {
            scales: &self.scales,
            bends: &self.bends,
        });
        exact::solve(
            problem,
            start,
            target,
            &[],
            linkage.edge_mm,
            &Inner(progress),
        )
    }
}

/// Passes on the wish to stop; a path counts its states, not the stages of each solve.
struct Inner<'a>(&'a dyn Progress);

impl Progress for Inner<'_> {
    fn interrupted(&self) -> bool {
        self.0.interrupted()
    }
}

fn mean(scales: &[f64]) -> f64 {
    scales.iter().sum::<f64>() / scales.len().max(1) as f64
}

/// `points` moved as a whole so that they lie as near as possible to `to` (least squares; Kabsch 1976).
fn aligned(points: &[Point3<f64>], to: &[Point3<f64>]) -> Vec<Point3<f64>> {
    let centre = |p: &[Point3<f64>]| {
        p.iter().map(|p| p.coords).sum::<Vector3<f64>>() / p.len().max(1) as f64
    };
    let (here, there) = (centre(points), centre(to));
    let covariance: Matrix3<f64> = points
        .iter()
        .zip(to)
        .map(|(p, q)| (q.coords - there) * (p.coords - here).transpose())
        .sum();
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
        return points.to_vec();
    };
    // No mirroring: the direction that matters least is turned over.
    let mut sign = Matrix3::identity();
    sign[(2, 2)] = (u * v).determinant().signum();
    let turn = u * sign * v;
    points
        .iter()
        .map(|p| Point3::from(turn * (p.coords - here) + there))
        .collect()
}
