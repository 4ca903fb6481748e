//! Interactive posing: a linkage that stays a linkage while points of it are dragged (paper, §5, Fig. 16).
//!
//! A [`Session`] holds points, factor and history between frames. [`Session::apply`] takes edits, all or none;
//! [`Session::step`] runs one iteration and is meant to be called once a frame. With a target surface it iterates as
//! [`super::AlternatingProjection`] does; without one, handles take the place of closeness, and a smoothness term
//! spreads what they ask for. Conditions (5), (6) and the bound σ hold as well, as projections of a hinge's four edge vectors:
//! λ ≤ σ bounds the length of one linear function of them.
//!
//! **Smoothness.** Bouaziz et al. (2012) make the Laplacian of the positions small. Here it is that of the triangles'
//! centroids over their neighbours across hinges, and not of the points: in a linkage opened evenly each triangle's
//! three neighbours stand symmetrically around it at every opening, so this Laplacian vanishes whatever λ is and
//! measures bending and uneven opening alone, where the Laplacian of the points measures how triangles are turned. A
//! vector between neighbouring centroids is a linear function of their hinge's four edge vectors, so the term is one
//! more projection of edge vectors and leaves the pattern of the matrix as it is. Triangles on fewer than three hinges
//! have none: a rim bends freely.
//!
//! Hard handles and pins are eliminated from the system, so they are exactly where they were put. What a session ends
//! with is near, not exact: [`Session::positions`] and [`Session::held`] are what an exact solve starts from.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use super::projection::kernel::{Kernel, Outcome, Rest, Rules};
use super::projection::{Follower, Separation};
use super::{Problem, RationalizeError};
use crate::base::ids::Id as _;
use crate::linkage::{Linkage, PointId, TriangleId};
use crate::mesh::ClosestPoint;

/// Differences that the acceleration looks back.
const WINDOW: usize = 5;

/// Two points of a triangle may be held this much nearer or farther apart than L, as a part of L.
pub const HELD_EDGE_TOLERANCE: f64 = 1e-6;

/// How a point is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    /// It is exactly there.
    Hard,
    /// It is drawn there by this weight, against 1 for the length of an edge.
    Soft(f64),
}

/// One change to a session.
#[derive(Clone)]
pub enum Edit {
    /// Puts a handle on a point, or moves the one that is there. Places in millimetres.
    Handle {
        /// The point.
        point: PointId,
        /// Where it is to be.
        place_mm: Point3<f64>,
        /// How.
        hold: Hold,
    },
    /// Holds a point exactly where it is.
    Pin(PointId),
    /// Takes handle or pin off a point; without one nothing happens.
    Release(PointId),
    /// The largest scale factor, from which (5) and (6) hold as well; `None`: neither.
    Sigma(Option<f64>),
    /// The smoothness: its weight against 1 for the length of an edge (0: none), and what is smooth.
    Smoothness(f64, Rest),
    /// The surface to which all points are drawn by a weight; `None`: none.
    Target(Option<(Arc<ClosestPoint>, f64)>),
}

/// Why an edit is refused. The session is as it was.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EditError {
    /// There is no such point.
    #[error("there is no point {point}: the linkage has points 1 to {points}")]
    NoSuchPoint {
        /// The point asked for.
        point: PointId,
        /// How many there are.
        points: usize,
    },
    /// A coordinate is not a finite number.
    #[error("the place of point {point} is not three finite numbers")]
    NotFinite {
        /// The point.
        point: PointId,
    },
    /// A number is out of its range.
    #[error("{what} must be {range}, not {value}")]
    OutOfRange {
        /// What it is for.
        what: &'static str,
        /// What is allowed.
        range: &'static str,
        /// What was given.
        value: f64,
    },
    /// Two hard places for one point at the same time.
    #[error(
        "point {point} cannot be held at two places {apart_mm:.3} mm apart; drop one of them or make it soft"
    )]
    TwoPlaces {
        /// The point.
        point: PointId,
        /// The distance between the places.
        apart_mm: f64,
    },
    /// Two held points of one triangle are not an edge apart.
    #[error(
        "points {} and {} of triangle {triangle} would be held {apart_mm:.6} mm apart, but the edge between them is \
         {edge_mm:.6} mm; hold one of them softly, or let the linkage settle before both are pinned",
        points[0], points[1]
    )]
    NotAnEdgeApart {
        /// The two points.
        points: [PointId; 2],
        /// Their triangle.
        triangle: TriangleId,
        /// Their distance as asked for.
        apart_mm: f64,
        /// L.
        edge_mm: f64,
    },
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The energy after it, in L²: that of eq. (2), with handles and smoothness.
    pub energy: f64,
    /// Farthest that a point moved, millimetres.
    pub moved_mm: f64,
    /// Nothing lowers the energy any more: until the next edit steps do nothing and take no time.
    pub settled: bool,
}

#[derive(Clone, Copy, PartialEq)]
struct Held {
    place_mm: Point3<f64>,
    hold: Hold,
}

/// A linkage being posed.
pub struct Session {
    problem: Problem,
    edge_mm: f64,
    kernel: Kernel,
    follower: Option<Follower<Arc<ClosestPoint>>>,
    held: BTreeMap<u32, Held>,
    /// The matrix no longer fits weights and held points.
    stale_matrix: bool,
    /// The energy no longer fits.
    stale_energy: bool,
    /// The places on the target are not those of the points.
    stale_places: bool,
    /// Nothing was left to do after the last step.
    settled: bool,
}

impl Session {
    /// At `start` (millimetres, one position a point of the linkage): no handles, no target, no σ, no smoothness.
    ///
    /// # Errors
    /// [`RationalizeError::Factor`]: memory.
    pub fn new(linkage: &Linkage, start: &[Point3<f64>]) -> Result<Self, RationalizeError> {
        let problem = Problem::new(linkage, 2.0);
        let x: Vec<Vector3<f64>> = start.iter().map(|p| p.coords / linkage.edge_mm).collect();
        let rules = Rules {
            separation: Separation::InPlane,
            bounds: None,
            smoothness: 0.0,
            rest: Rest::Flat,
        };
        Ok(Self {
            kernel: Kernel::new(&problem, &x, rules, WINDOW)?,
            problem,
            edge_mm: linkage.edge_mm,
            follower: None,
            held: BTreeMap::new(),
            stale_matrix: true,
            stale_energy: true,
            stale_places: false,
            settled: false,
        })
    }

    /// Makes these changes, all of them or, if one is refused, none. Takes no time worth telling; the next step sees
    /// to the matrix where it has to change: not when a handle only moves.
    ///
    /// # Errors
    /// [`EditError`].
    pub fn apply(&mut self, edits: &[Edit]) -> Result<(), EditError> {
        let mut held = self.held.clone();
        let mut places: BTreeMap<u32, Point3<f64>> = BTreeMap::new();
        for edit in edits {
            let (point, new) = match edit {
                Edit::Handle {
                    point,
                    place_mm,
                    hold,
                } => {
                    self.check_point(*point)?;
                    if !place_mm.iter().all(|c| c.is_finite()) {
                        return Err(EditError::NotFinite { point: *point });
                    }
                    if let Hold::Soft(weight) = hold {
                        positive("the weight of a soft handle", *weight)?;
                    }
                    (
                        point,
                        Held {
                            place_mm: *place_mm,
                            hold: *hold,
                        },
                    )
                }
                Edit::Pin(point) => {
                    let place_mm = self.position(*point).ok_or(self.no_such_point(*point))?;
                    (
                        point,
                        Held {
                            place_mm,
                            hold: Hold::Hard,
                        },
                    )
                }
                Edit::Release(point) => {
                    self.check_point(*point)?;
                    held.remove(&point.0);
                    places.remove(&point.0);
                    continue;
                }
                Edit::Sigma(Some(sigma)) => {
                    if !(1.0..=2.0).contains(sigma) {
                        return Err(EditError::OutOfRange {
                            what: "σ",
                            range: "between 1 and 2",
                            value: *sigma,
                        });
                    }
                    continue;
                }
                Edit::Smoothness(weight, _) => {
                    if *weight != 0.0 {
                        positive("the weight of the smoothness", *weight)?;
                    }
                    continue;
                }
                Edit::Target(Some((_, weight))) => {
                    positive("the weight of the target", *weight)?;
                    continue;
                }
                Edit::Sigma(None) | Edit::Target(None) => continue,
            };
            if new.hold == Hold::Hard
                && let Some(other) = places.insert(point.0, new.place_mm)
                && other != new.place_mm
            {
                return Err(EditError::TwoPlaces {
                    point: *point,
                    apart_mm: (other - new.place_mm).norm(),
                });
            }
            held.insert(point.0, new);
        }
        self.check_edges(&held)?;

        for edit in edits {
            match edit {
                Edit::Sigma(sigma) => self.kernel.rules().bounds = *sigma,
                Edit::Smoothness(weight, rest) => {
                    let rules = self.kernel.rules();
                    self.stale_matrix |= rules.smoothness != *weight;
                    (rules.smoothness, rules.rest) = (*weight, *rest);
                }
                Edit::Target(target) => {
                    let (surface, weight) = match target {
                        Some((surface, weight)) => (Some(surface.clone()), *weight),
                        None => (None, 0.0),
                    };
                    self.stale_matrix |= self.kernel.pull_all(weight);
                    self.follower = surface.map(|s| Follower::new(s, &self.kernel, self.edge_mm));
                    self.stale_places = true;
                }
                Edit::Handle { .. } | Edit::Pin(_) | Edit::Release(_) => {}
            }
        }
        // A handle that only moves leaves the matrix as it is.
        let weights = |held: &BTreeMap<u32, Held>| -> Vec<_> {
            held.iter().map(|(p, h)| (*p, h.hold)).collect()
        };
        self.stale_matrix |= weights(&self.held) != weights(&held);
        (self.stale_energy, self.settled) = (true, false);
        self.stale_places |= self.follower.is_some() && !places.is_empty();
        self.held = held;
        self.put();
        Ok(())
    }

    /// Hands the held points to the kernel.
    fn put(&mut self) {
        let edge_mm = self.edge_mm;
        let of = |hard: bool| {
            self.held
                .iter()
                .filter(move |(_, h)| (h.hold == Hold::Hard) == hard)
                .map(move |(p, h)| {
                    let weight = match h.hold {
                        Hold::Hard => 0.0,
                        Hold::Soft(weight) => weight,
                    };
                    (*p, weight, h.place_mm.coords / edge_mm)
                })
        };
        self.kernel
            .hold(of(true).map(|(p, _, place)| (p, place)), of(false));
    }

    /// One iteration. Where edits have changed weights or held points, the matrix is factored first.
    ///
    /// # Errors
    /// [`RationalizeError::Factor`]: the weights given are so far apart that the matrix is singular to rounding.
    pub fn step(&mut self) -> Result<Step, RationalizeError> {
        if self.settled {
            return Ok(Step {
                energy: self.kernel.energy(),
                moved_mm: 0.0,
                settled: true,
            });
        }
        if self.stale_matrix {
            self.kernel.refactor()?;
            self.stale_matrix = false;
        }
        let follower = &mut self.follower;
        let mut track = |x: &[[f64; 3]], places: &mut [[f64; 3]]| {
            if let Some(follower) = follower {
                follower.follow(x, places);
            }
        };
        if self.stale_places {
            self.kernel.restart(&mut track);
        } else if self.stale_energy {
            // No point has moved.
            self.kernel.restart(&mut |_, _| {});
        }
        (self.stale_energy, self.stale_places) = (false, false);
        self.settled = self.kernel.iterate(&mut track) == Outcome::Settled;
        Ok(Step {
            energy: self.kernel.energy(),
            moved_mm: self.kernel.moved() * self.edge_mm,
            settled: self.settled,
        })
    }

    /// Positions in millimetres, by point of the linkage; hard-held points exactly at their places.
    pub fn positions(&self) -> Vec<Point3<f64>> {
        let mut positions: Vec<_> = self
            .kernel
            .positions()
            .map(|p| Point3::from(p * self.edge_mm))
            .collect();
        for (point, place_mm) in self.held() {
            positions[point.index()] = place_mm;
        }
        positions
    }

    /// Where one point is, millimetres; `None` if there is no such point.
    pub fn position(&self, point: PointId) -> Option<Point3<f64>> {
        match self.held.get(&point.0) {
            Some(held) if held.hold == Hold::Hard => Some(held.place_mm),
            _ => Some(Point3::from(self.kernel.position(point.0)? * self.edge_mm)),
        }
    }

    /// The points that are held hard, with their places in millimetres, in ascending order.
    pub fn held(&self) -> impl Iterator<Item = (PointId, Point3<f64>)> {
        self.held
            .iter()
            .filter(|(_, h)| h.hold == Hold::Hard)
            .map(|(p, h)| (PointId(*p), h.place_mm))
    }

    /// Numeric factorisations so far.
    pub fn factorizations(&self) -> usize {
        self.kernel.factorizations()
    }

    fn no_such_point(&self, point: PointId) -> EditError {
        EditError::NoSuchPoint {
            point,
            points: self.problem.points,
        }
    }

    fn check_point(&self, point: PointId) -> Result<(), EditError> {
        if point.index() < self.problem.points {
            Ok(())
        } else {
            Err(self.no_such_point(point))
        }
    }

    fn check_edges(&self, held: &BTreeMap<u32, Held>) -> Result<(), EditError> {
        let hard = |p: u32| {
            held.get(&p)
                .filter(|h| h.hold == Hold::Hard)
                .map(|h| h.place_mm)
        };
        for (t, points) in self.problem.triangles.iter().enumerate() {
            for k in 0..3 {
                let pair = [points[k], points[(k + 1) % 3]];
                let [Some(a), Some(b)] = pair.map(hard) else {
                    continue;
                };
                let apart_mm = (a - b).norm();
                if (apart_mm - self.edge_mm).abs() > HELD_EDGE_TOLERANCE * self.edge_mm {
                    return Err(EditError::NotAnEdgeApart {
                        points: pair.map(PointId),
                        triangle: TriangleId::from_index(t),
                        apart_mm,
                        edge_mm: self.edge_mm,
                    });
                }
            }
        }
        Ok(())
    }
}

fn positive(what: &'static str, value: f64) -> Result<(), EditError> {
    // Beyond these the matrix would be singular to rounding.
    if (1e-6..=1e6).contains(&value) {
        Ok(())
    } else {
        Err(EditError::OutOfRange {
            what,
            range: "between 1e-6 and 1e6",
            value,
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::linkage::{Colour, Handedness};
    use crate::mesh::Sample;
    use crate::rationalize::hinge_scales;

    const EDGE: f64 = 5.0;

    /// A flat hexagon of triangles, opened evenly to the scale `lambda` (design: each triangle turns by
    /// asin(λ/2) − 30°, by colour).
    pub(in crate::rationalize) fn opened(radius: i32, lambda: f64) -> (Linkage, Vec<Point3<f64>>) {
        let linkage = Linkage::patch(EDGE, Handedness::Right, &Linkage::hexagon_cells(radius));
        let turn = (lambda / 2.0).asin() - std::f64::consts::FRAC_PI_6;
        let mut start = vec![Point3::origin(); linkage.point_count()];
        for t in linkage.triangles.iter() {
            let centre = t
                .flat
                .iter()
                .map(|p| p.coords)
                .sum::<nalgebra::Vector2<f64>>()
                / 3.0;
            let angle = if t.colour == Colour::Up { -turn } else { turn };
            for k in 0..3 {
                let p =
                    centre * lambda + nalgebra::Rotation2::new(angle) * (t.flat[k].coords - centre);
                let p = Point3::new(p.x, p.y, 0.0);
                let point = &mut start[t.points[k].index()];
                assert!(*point == Point3::origin() || (*point - p).norm() < 1e-9);
                *point = p;
            }
        }
        (linkage, start)
    }

    fn handle(point: u32, place_mm: Point3<f64>, hold: Hold) -> Edit {
        Edit::Handle {
            point: PointId(point),
            place_mm,
            hold,
        }
    }

    fn middle(start: &[Point3<f64>]) -> u32 {
        (0..start.len() as u32)
            .min_by(|a, b| {
                let far = |i: &u32| start[*i as usize].coords.norm();
                far(a).total_cmp(&far(b))
            })
            .unwrap()
    }

    /// Points at least this part of the largest radius out.
    fn rim(start: &[Point3<f64>], part: f64) -> Vec<u32> {
        let largest = start.iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
        (0..start.len() as u32)
            .filter(|&i| start[i as usize].coords.norm() > part * largest)
            .collect()
    }

    fn run(session: &mut Session, steps: usize) -> Step {
        (0..steps).map(|_| session.step().unwrap()).last().unwrap()
    }

    fn edge_error(linkage: &Linkage, positions: &[Point3<f64>]) -> f64 {
        linkage
            .triangles
            .iter()
            .flat_map(|t| (0..3).map(|k| [t.points[k], t.points[(k + 1) % 3]]))
            .map(|[a, b]| ((positions[a.index()] - positions[b.index()]).norm() / EDGE - 1.0).abs())
            .fold(0.0, f64::max)
    }

    fn farthest(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).norm())
            .fold(0.0, f64::max)
    }

    #[test]
    fn a_handle_moved_there_and_back_leaves_the_start() {
        let (linkage, start) = opened(5, 1.4);
        let mut session = Session::new(&linkage, &start).unwrap();
        let mut edits = vec![Edit::Sigma(Some(1.9)), Edit::Smoothness(1.0, Rest::Start)];
        // What the smoothness leaves free: every triangle on fewer than three hinges.
        for (t, across) in linkage.neighbours().iter_ids() {
            if across.iter().flatten().count() < 3 {
                edits.extend(linkage.triangles[t].points.map(Edit::Pin));
            }
        }
        session.apply(&edits).unwrap();
        let point = middle(&start);
        let home = start[point as usize];
        for lift in [2.0, 4.0, 6.0, 3.0, 0.0] {
            let place = home + Vector3::z() * lift;
            session
                .apply(&[handle(point, place, Hold::Soft(10.0))])
                .unwrap();
            run(&mut session, 60);
            let positions = session.positions();
            if lift > 0.0 {
                assert!((positions[point as usize].z - lift).abs() < 0.2 * lift);
            }
        }
        // Bending is the slowest: a flat linkage resists it only to second order.
        let far = farthest(&session.positions(), &start);
        run(&mut session, 300);
        let near = farthest(&session.positions(), &start);
        assert!(near < 0.02 * EDGE && near < 0.5 * far, "{far} then {near}");
    }

    #[test]
    fn what_is_held_hard_does_not_move_by_a_bit() {
        let (linkage, start) = opened(4, 1.5);
        let mut session = Session::new(&linkage, &start).unwrap();
        let start = session.positions();
        let pins = rim(&start, 0.9);
        let mut edits: Vec<Edit> = pins.iter().map(|&p| Edit::Pin(PointId(p))).collect();
        edits.push(Edit::Smoothness(0.05, Rest::Flat));
        let top = start[middle(&start) as usize] + Vector3::new(0.1, -0.2, 3.3);
        edits.push(handle(middle(&start), top, Hold::Hard));
        session.apply(&edits).unwrap();
        run(&mut session, 80);
        let positions = session.positions();
        for p in pins {
            assert_eq!(positions[p as usize], start[p as usize]);
        }
        assert_eq!(positions[middle(&start) as usize], top);
        assert_eq!(
            session
                .held()
                .filter(|(p, _)| p.0 == middle(&start))
                .count(),
            1
        );
        assert!(farthest(&positions, &start) > 3.0);
    }

    #[test]
    fn the_matrix_is_factored_only_when_it_changes() {
        let (linkage, start) = opened(3, 1.4);
        let mut session = Session::new(&linkage, &start).unwrap();
        let home = start[7];
        let mut expect = |edits: &[Edit], more: usize, what: &str| {
            let before = session.factorizations();
            session.apply(edits).unwrap();
            run(&mut session, 3);
            assert_eq!(session.factorizations() - before, more, "{what}");
        };
        expect(&[], 1, "the first step");
        expect(&[handle(7, home, Hold::Soft(1.0))], 1, "a new handle");
        expect(
            &[handle(7, home + Vector3::x(), Hold::Soft(1.0))],
            0,
            "it moves",
        );
        expect(&[handle(7, home, Hold::Soft(2.0))], 1, "another weight");
        expect(&[handle(7, home, Hold::Hard)], 1, "hard");
        expect(
            &[handle(7, home + Vector3::z(), Hold::Hard)],
            0,
            "it moves, hard",
        );
        expect(&[Edit::Sigma(Some(1.8))], 0, "a bound");
        expect(&[Edit::Sigma(Some(1.6))], 0, "another bound");
        expect(&[Edit::Smoothness(0.1, Rest::Flat)], 1, "smoothness");
        expect(&[Edit::Smoothness(0.1, Rest::Start)], 0, "another rest");
        expect(&[Edit::Release(PointId(9))], 0, "nothing to release");
        expect(
            &[
                Edit::Release(PointId(7)),
                Edit::Pin(PointId(3)),
                Edit::Sigma(None),
            ],
            1,
            "several at once",
        );
    }

    #[test]
    fn equal_edits_give_equal_bits() {
        let (linkage, start) = opened(4, 1.4);
        let surface = Sample::parse("cap:faces=3000").unwrap().generate().unwrap();
        let tree = Arc::new(ClosestPoint::new(&surface));
        let play = || {
            let mut session = Session::new(&linkage, &start).unwrap();
            let top = start[11] + Vector3::z() * 2.0;
            let script: [Vec<Edit>; 4] = [
                vec![handle(11, top, Hold::Soft(3.0)), Edit::Sigma(Some(1.7))],
                vec![Edit::Pin(PointId(40)), Edit::Smoothness(0.2, Rest::Flat)],
                vec![Edit::Target(Some((tree.clone(), 0.01)))],
                vec![Edit::Target(None), Edit::Release(PointId(11))],
            ];
            for edits in script {
                session.apply(&edits).unwrap();
                run(&mut session, 15);
            }
            session.positions()
        };
        assert_eq!(play(), play());
    }

    #[test]
    fn contradictions_are_refused_and_change_nothing() {
        let (linkage, start) = opened(3, 1.4);
        let mut session = Session::new(&linkage, &start).unwrap();
        session.apply(&[handle(0, start[0], Hold::Hard)]).unwrap();
        run(&mut session, 2);
        let before = (session.positions(), session.factorizations());
        let [a, b, _] = linkage.triangles[TriangleId(0)].points;
        let (at_a, at_b) = (start[a.index()], start[b.index()]);
        let surface = Sample::parse("cap:faces=300").unwrap().generate().unwrap();
        let tree = Arc::new(ClosestPoint::new(&surface));
        let points = linkage.point_count() as u32;
        let away = at_b + (at_b - at_a) * 0.01;
        let refused = [
            (vec![Edit::Pin(PointId(points))], "points 1 to"),
            (vec![Edit::Release(PointId(u32::MAX))], "there is no point"),
            (
                vec![handle(2, Point3::new(0.0, f64::NAN, 0.0), Hold::Hard)],
                "point 3 is not three finite numbers",
            ),
            (
                vec![
                    handle(5, start[5], Hold::Hard),
                    handle(5, start[5] + Vector3::x(), Hold::Hard),
                ],
                "point 6 cannot be held at two places 1.000 mm apart",
            ),
            (
                vec![handle(a.0, at_a, Hold::Hard), handle(b.0, away, Hold::Hard)],
                "5.050000 mm apart, but the edge between them is 5.000000 mm",
            ),
            (
                vec![handle(5, start[5], Hold::Soft(-1.0))],
                "soft handle must be",
            ),
            (
                vec![Edit::Sigma(Some(0.9))],
                "σ must be between 1 and 2, not 0.9",
            ),
            (vec![Edit::Sigma(Some(f64::NAN))], "NaN"),
            (
                vec![Edit::Smoothness(f64::INFINITY, Rest::Flat)],
                "smoothness",
            ),
            (vec![Edit::Target(Some((tree, 0.0)))], "target"),
        ];
        for (edits, text) in refused {
            // A good edit before the bad one must not come through either.
            let mut edits = edits;
            edits.insert(0, handle(8, start[8] + Vector3::z(), Hold::Hard));
            let error = session.apply(&edits).unwrap_err().to_string();
            assert!(error.contains(text), "{error}");
        }
        assert_eq!((session.positions(), session.factorizations()), before);
        assert_eq!(session.held().count(), 1);
        let mut untouched = Session::new(&linkage, &start).unwrap();
        untouched.apply(&[handle(0, start[0], Hold::Hard)]).unwrap();
        run(&mut untouched, 5);
        run(&mut session, 3);
        assert_eq!(session.positions(), untouched.positions());
    }

    #[test]
    fn sigma_bounds_how_far_hinges_open() {
        let (linkage, start) = opened(4, 1.5);
        let pulled = |sigma: Option<f64>| {
            let mut session = Session::new(&linkage, &start).unwrap();
            let mut edits: Vec<Edit> = rim(&start, 0.85)
                .into_iter()
                .map(|p| handle(p, start[p as usize] * 1.25, Hold::Soft(0.005)))
                .collect();
            edits.push(Edit::Sigma(sigma));
            session.apply(&edits).unwrap();
            run(&mut session, 200);
            hinge_scales(&linkage, &session.positions())
                .into_iter()
                .fold(0.0, f64::max)
        };
        let (free, bound) = (pulled(None), pulled(Some(1.6)));
        assert!(free > 1.7 && bound < 1.61);
    }

    #[test]
    fn a_target_draws_the_linkage_to_it_and_can_be_swapped() {
        let (linkage, start) = opened(4, 1.4);
        let mut session = Session::new(&linkage, &start).unwrap();
        for name in ["cap:faces=3000", "saddle:faces=3000"] {
            let surface = Sample::parse(name).unwrap().generate().unwrap();
            let tree = Arc::new(ClosestPoint::new(&surface));
            session
                .apply(&[Edit::Target(Some((tree.clone(), 0.1)))])
                .unwrap();
            run(&mut session, 250);
            let positions = session.positions();
            let distance = positions
                .iter()
                .map(|p| tree.query(*p).distance / EDGE)
                .fold(0.0, f64::max);
            assert!(distance < 0.05 && edge_error(&linkage, &positions) < 1e-3);
        }
    }
}
