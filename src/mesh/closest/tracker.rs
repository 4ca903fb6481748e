//! Closest points of points that move a little at a time.
//!
//! For every point the tracker keeps a ball around a place p₀ where it once asked the tree, with radius r, and the
//! faces no farther from p₀ than d₀ + 2r, where d₀ is the distance of the closest. While the point stays in the ball,
//! its distance is at most d₀ + r, and a face that far from it is at most d₀ + 2r from p₀: the closest face is one of
//! the list, and no other can tie with it. So the answer is that of the tree, to the bit.

use std::ops::Deref;

use nalgebra::Point3;

use super::{Candidate, Closest, ClosestPoint, DEPTH, SLACK};

/// Faces in a list at the most. If more are in reach, the ball shrinks until they are not.
const FACES: usize = 12;

/// A ball is made for this many movements like the last ones, between these two by the number of the point: points that
/// move alike should not all need a new ball at the same time.
const STEPS: [f64; 2] = [12.0, 36.0];

/// Bounds on its radius, as parts of the mean edge of the surface. Below the lower a list is as short as it gets;
/// above the upper it is full.
const SMALLEST: f64 = 0.02;
const LARGEST: f64 = 1.0;

/// The radius of the first ball, likewise.
const FIRST: f64 = 0.2;

/// Part of the size of the surface (and of the distance from its middle) by which a ball is smaller than it might be:
/// many times the rounding of a distance.
const ROUNDING: f64 = 1e-12;

/// Likewise, as a part of the distance.
const RELATIVE: f64 = 1e-9;

#[derive(Clone, Copy)]
struct Ball {
    centre: Point3<f64>,
    /// Negative if there is none yet, or if it would hold too many faces: then the tree is asked.
    radius: f64,
    /// Questions since the ball was made.
    age: u32,
    count: u32,
    /// A triangle close by.
    hint: u32,
}

/// One face of a list: its triangle in the tree, and its distance from the centre, rounded down.
#[derive(Clone, Copy, Default)]
struct Near {
    slot: u32,
    distance: f32,
}

/// Answers closest-point queries for a fixed number of moving points, exactly as [`ClosestPoint::query`] does, but
/// many times faster while each moves little between two questions.
///
/// `C` is how it holds the tree: a reference, or an `Arc` where it must live on its own.
pub struct ClosestTracker<C> {
    closest: C,
    balls: Vec<Ball>,
    lists: Vec<[Near; FACES]>,
    edge: f64,
    middle: Point3<f64>,
    size: f64,
    asked: u64,
}

impl<C: Deref<Target = ClosestPoint>> ClosestTracker<C> {
    /// For `points` points that will ask for their closest points on the surface of `closest`.
    pub fn new(closest: C, points: usize) -> Self {
        let (low, high) = closest
            .nodes
            .first()
            .map_or((Point3::origin(), Point3::origin()), |n| (n.low, n.high));
        let perimeter =
            |c: &[Point3<f64>; 3]| (0..3).map(|k| (c[(k + 1) % 3] - c[k]).norm()).sum::<f64>();
        let edges = 3 * closest.triangles.len();
        let edge = closest
            .triangles
            .iter()
            .map(|t| perimeter(&t.corners))
            .sum::<f64>()
            / edges.max(1) as f64;
        Self {
            edge,
            closest,
            balls: vec![
                Ball {
                    centre: Point3::origin(),
                    radius: -1.0,
                    age: 0,
                    count: 0,
                    hint: 0,
                };
                points
            ],
            lists: vec![[Near::default(); FACES]; points],
            middle: nalgebra::center(&low, &high),
            size: (high - low).norm(),
            asked: 0,
        }
    }

    /// The point of the surface closest to `p` (mm), where point number `point` is now.
    ///
    /// # Panics
    /// If there is no such point.
    #[inline]
    pub fn query(&mut self, point: usize, p: Point3<f64>) -> Closest {
        let ball = &mut self.balls[point];
        let moved = (p - ball.centre).norm();
        // A place that is not a number is in no ball.
        if moved > ball.radius || moved.is_nan() {
            return self.renew(point, p, moved);
        }
        ball.age += 1;
        let list = &self.lists[point][..ball.count as usize];
        let mut best: Option<Candidate> = None;
        for near in list {
            if let Some(best) = &best {
                // They stand in ascending distance from the centre, from which the point moved by no more than this.
                let least = f64::from(near.distance) - moved * (1.0 + RELATIVE);
                if least > 0.0
                    && least * least * (1.0 - RELATIVE)
                        > best.hit.squared + ROUNDING * self.size * self.size
                {
                    break;
                }
            }
            let candidate = self.closest.candidate(&p, near.slot);
            best = Some(best.map_or(candidate, |b| b.or(candidate)));
        }
        match best {
            Some(best) => self.closest.finish(best),
            None => self.renew(point, p, moved),
        }
    }

    /// Questions so far that went to the tree.
    pub fn asked(&self) -> u64 {
        self.asked
    }

    /// Asks the tree and makes a new ball.
    #[cold]
    fn renew(&mut self, point: usize, p: Point3<f64>, moved: f64) -> Closest {
        self.asked += 1;
        let ball = &mut self.balls[point];
        let wanted = if ball.age == 0 && ball.radius < 0.0 && ball.count == 0 {
            // Nothing is known of its movement yet.
            FIRST * self.edge
        } else {
            let step = moved / f64::from(ball.age + 1);
            // Multiples of the golden ratio spread evenly, however many there are.
            let part = (point as f64 * 0.618_033_988_749_895).fract();
            let steps = STEPS[0] + (STEPS[1] - STEPS[0]) * part;
            (steps * step).clamp(SMALLEST * self.edge, LARGEST * self.edge)
        };
        let slack = ROUNDING * (self.size + (p - self.middle).norm());
        let hint = self.closest.candidate(&p, ball.hint);
        let mut list = Shortlist::new(hint, 2.0 * wanted + slack);
        self.closest.gather(&p, &mut list);
        let (best, distance) = (list.best, list.best.hit.squared.sqrt());
        // What is not in the list is at least as far as its limit.
        let radius = 0.5 * (list.limit - distance * (1.0 + RELATIVE) - slack);
        let radius = wanted.min(radius);
        let count = list.count;
        *ball = Ball {
            centre: p,
            radius: if radius > 0.0 { radius } else { -1.0 },
            age: 0,
            count: count as u32,
            hint: best.slot,
        };
        for (near, (slot, distance)) in self.lists[point].iter_mut().zip(&list.found[..count]) {
            *near = Near {
                slot: *slot,
                distance: (*distance as f32).next_down(),
            };
        }
        self.closest.finish(best)
    }
}

/// The closest triangle found so far, and those not much farther in ascending distance.
struct Shortlist {
    best: Candidate,
    /// What is farther than the closest by this does not belong to the list.
    reach: f64,
    /// What is as far as this does not, whatever is still to be found.
    limit: f64,
    /// One more than there is room for, to move them.
    found: [(u32, f64); FACES + 1],
    count: usize,
}

impl Shortlist {
    /// Empty, but knowing of a triangle that will be met.
    fn new(hint: Candidate, reach: f64) -> Self {
        let mut list = Self {
            best: hint,
            reach,
            limit: f64::INFINITY,
            found: [(0, 0.0); FACES + 1],
            count: 0,
        };
        list.tighten(hint.hit.squared.sqrt());
        list
    }

    fn tighten(&mut self, distance: f64) {
        self.limit = self.limit.min(distance * (1.0 + RELATIVE) + self.reach);
    }

    /// Whether something at this squared distance matters: to the list, or because it may be the closest.
    #[inline]
    fn wants(&self, squared: f64) -> bool {
        squared < self.limit * self.limit || squared <= self.best.hit.squared * (1.0 + SLACK)
    }

    fn offer(&mut self, candidate: Candidate) {
        let distance = candidate.hit.squared.sqrt();
        self.best = self.best.or(candidate);
        self.tighten(distance);
        if distance >= self.limit {
            return;
        }
        let mut at = self.count;
        while at > 0 && self.found[at - 1].1 > distance {
            self.found[at] = self.found[at - 1];
            at -= 1;
        }
        self.found[at] = (candidate.slot, distance);
        if self.count < FACES {
            self.count += 1;
        } else {
            self.limit = self.limit.min(self.found[FACES].1);
        }
    }
}

impl ClosestPoint {
    /// Offers every triangle that the list may want, nearer boxes first.
    fn gather(&self, p: &Point3<f64>, list: &mut Shortlist) {
        let mut stack = [(0u32, 0.0f64); DEPTH];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (node, bound) = stack[depth];
            if !list.wants(bound) {
                continue;
            }
            let mut here = node as usize;
            loop {
                let node = &self.nodes[here];
                if node.count > 0 {
                    for slot in node.at..node.at + node.count {
                        list.offer(self.candidate(p, slot));
                    }
                    break;
                }
                let (left, right) = (here + 1, node.at as usize);
                let to_left = self.nodes[left].distance_squared(p);
                let to_right = self.nodes[right].distance_squared(p);
                let (near, far) = if to_left <= to_right {
                    ((left, to_left), (right, to_right))
                } else {
                    ((right, to_right), (left, to_left))
                };
                if depth < DEPTH && list.wants(far.1) {
                    stack[depth] = (far.0 as u32, far.1);
                    depth += 1;
                }
                if !list.wants(near.1) {
                    break;
                }
                here = near.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Sample;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::base::cases::cases(40))]
        #[test]
        fn it_answers_as_the_tree_does_wherever_the_points_wander(
            which in 0usize..10,
            starts in prop::collection::vec(prop::array::uniform3(-120.0..120.0f64), 4),
            on_surface: bool,
            scale in prop::sample::select(vec![1e-9, 1e-3, 0.1, 1.0, 10.0]),
            turns in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 60),
        ) {
            let sample = Sample::all()[which];
            let surface = Sample::parse(&format!("{}:faces=900", sample.name())).unwrap().generate().unwrap();
            let tree = ClosestPoint::new(&surface);
            let mut tracker = ClosestTracker::new(&tree, starts.len());
            let mut points: Vec<Point3<f64>> = starts.into_iter().map(Point3::from).collect();
            if on_surface {
                // At corners, where several faces tie, and near them.
                points.iter_mut().for_each(|p| {
                    let found = tree.query(*p);
                    let corners = surface.corners(found.face);
                    *p = corners[found.face.0 as usize % 3];
                });
            }
            for (n, turn) in turns.iter().enumerate() {
                for (i, p) in points.iter_mut().enumerate() {
                    prop_assert_eq!(tracker.query(i, *p), tree.query(*p));
                    // Now and then a leap or a rest; else small steps.
                    let step = match (n + i) % 13 { 0 => 30.0, 5 => 0.0, _ => scale };
                    *p += nalgebra::Vector3::from(*turn) * step;
                }
            }
        }
    }

    #[test]
    fn small_steps_hardly_ever_ask_the_tree() {
        let surface = Sample::parse("hemisphere:faces=5000")
            .unwrap()
            .generate()
            .unwrap();
        let tree = ClosestPoint::new(&surface);
        let mut points: Vec<Point3<f64>> = surface
            .positions()
            .iter()
            .step_by(7)
            .map(|p| p * 1.01)
            .collect();
        let mut tracker = ClosestTracker::new(&tree, points.len());
        let rounds = 100;
        for round in 0..rounds {
            for (i, p) in points.iter_mut().enumerate() {
                tracker.query(i, *p);
                p.x += 0.01 * (round as f64 * 0.3).cos();
            }
        }
        let all = (rounds * points.len()) as u64;
        assert!(tracker.asked() * 10 < all, "{} of {all}", tracker.asked());
    }

    /// More faces at exactly the same distance than a list holds.
    #[test]
    fn around_the_middle_of_a_sphere_the_tree_is_asked() {
        let surface = Sample::parse("octasphere:faces=800")
            .unwrap()
            .generate()
            .unwrap();
        let tree = ClosestPoint::new(&surface);
        let mut tracker = ClosestTracker::new(&tree, 1);
        for n in 0..60 {
            let p = Point3::new(0.0, 0.0, 0.05 * f64::from((n % 7) * (n % 3)));
            assert_eq!(tracker.query(0, p), tree.query(p));
        }
    }

    #[test]
    fn places_that_are_not_numbers_do_no_harm() {
        let surface = Sample::parse("cap:faces=200").unwrap().generate().unwrap();
        let tree = ClosestPoint::new(&surface);
        let mut tracker = ClosestTracker::new(&tree, 1);
        let p = Point3::new(1.0, 2.0, 90.0);
        tracker.query(0, p);
        tracker.query(0, Point3::new(f64::NAN, 0.0, 0.0));
        tracker.query(0, Point3::new(f64::INFINITY, 0.0, 0.0));
        assert_eq!(tracker.query(0, p), tree.query(p));
    }
}
