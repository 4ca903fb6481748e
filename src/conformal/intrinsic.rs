//! The conformal map where the mesh's own triangles cannot carry it: edges are flipped while it is solved.
//!
//! A set of edge lengths up to scaling at the vertices is a discrete conformal class, and a Ptolemaic flip (the new
//! diagonal times the old one is the sum of the products of opposite sides) changes the triangles without leaving it. So
//! the energy is evaluated on the Delaunay triangulation of the scaled metric, whatever u is: no triangle breaks, and a
//! solution exists for all angles that Gauss–Bonnet allows (Gillespie, Springborn, Crane: Discrete conformal equivalence
//! of polyhedral surfaces, 2021; Campen et al.: Efficient and robust discrete conformal equivalence with boundary, 2021).
//! The start is the intrinsic Delaunay triangulation of the surface's own metric, by flips that keep that metric. A
//! surface with rims is doubled, the two copies glued at the rims; vertices that are each other's image share an unknown.
//!
//! The mesh's faces get the result by undoing the flips, last one first, in the flat metric: two flat triangles side by
//! side are a quadrilateral in the plane, and its other diagonal is measured there. All that is lost is that a face that
//! the flat metric turns over comes out turned over, and is reported.

use std::collections::VecDeque;
use std::f64::consts::PI;

use nalgebra::Complex;

use super::metric::angles;
use super::system::{Energy, System, Unknowns};
use crate::base::sparse::FactorError;
use crate::mesh::{HalfedgeId, Surface};

/// By how much sin² α/2 + sin² β/2 of the two angles opposite an edge may exceed 1, where the Delaunay condition says 0:
/// rounding must not flip four points on a circle to and fro.
const ROUND: f64 = 1e-12;

/// Flips at the most in one go, for each edge: a guard against rounding that never settles.
const MOST_FLIPS: usize = 100;

/// Every triangle of the start has at least this much room in its triangle inequalities, as part of the mean length:
/// angles at an edge of 10⁻⁶ of its neighbours' length have an error of 10⁻¹⁰, and a micrometre on a metre does not show.
const ROOM: f64 = 1e-6;

/// How a flip measures the new diagonal.
#[derive(Clone, Copy, PartialEq)]
enum Rule {
    /// In the plane: keeps the metric.
    Euclid,
    /// By Ptolemy's theorem: keeps the conformal class.
    Ptolemy,
}

/// A face of the mesh in the flat metric.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlatFace {
    /// Its sides as vectors (side k from corner k to k + 1), in a frame of its own.
    pub sides: [Complex<f64>; 3],
}

impl FlatFace {
    /// Whether it has no area or is turned over: its corners run clockwise.
    pub fn is_broken(&self) -> bool {
        (self.sides[0].conj() * self.sides[1]).im <= 0.0
    }
}

fn unit(z: Complex<f64>) -> Complex<f64> {
    z / z.norm()
}

/// A triangulation of the surface's vertices whose edges need not be edges of the mesh. Halfedges keep their numbers
/// when they are flipped; at the start they are those of the surface.
pub(super) struct Intrinsic {
    tail: Vec<u32>,
    next: Vec<u32>,
    twin: Vec<u32>,
    /// Unscaled length of each halfedge' edge.
    length: Vec<f64>,
    /// The halfedges flipped, in order.
    flips: Vec<u32>,
    /// Halfedges of the surface itself; those behind them are the second copy's.
    own: usize,
    /// The unknowns, for the second copy's vertices too.
    unknowns: Unknowns,
    /// Equations of the triangulation at hand.
    system: Option<System>,
    /// e^{u/2} of every unknown.
    half: Vec<f64>,
}

impl Intrinsic {
    /// The intrinsic Delaunay triangulation of a surface with these side lengths.
    pub fn new(surface: &Surface, lengths: &[[f64; 3]], unknowns: &Unknowns) -> Self {
        let own = surface.faces().len() * 3;
        let doubled = !surface.rims().is_empty();
        let mut all = Unknowns {
            of: unknowns.of.clone(),
            count: unknowns.count,
        };
        let mut tail: Vec<u32> = surface.halfedges().map(|h| surface.tail(h).0).collect();
        let mut length: Vec<f64> = lengths.iter().flatten().copied().collect();
        let longer = mollifier(lengths);
        length.iter_mut().for_each(|length| *length += longer);
        let mut twin: Vec<u32> = Vec::with_capacity(2 * own);
        // Side k of a face is side 2 − k of its image.
        let image = |h: HalfedgeId| own as u32 + 3 * h.face().0 + 2 - h.corner() as u32;
        twin.extend(
            surface
                .halfedges()
                .map(|h| surface.twin(h).map_or_else(|| image(h), |t| t.0)),
        );
        if doubled {
            let mut vertex_image = Vec::with_capacity(surface.positions().len());
            for v in surface.positions().ids() {
                if surface.on_rim(v) {
                    vertex_image.push(v.0);
                } else {
                    vertex_image.push(all.of.len() as u32);
                    all.of.push(unknowns.of[v.0 as usize]);
                }
            }
            tail.resize(2 * own, 0);
            length.resize(2 * own, 0.0);
            twin.resize(2 * own, 0);
            for h in surface.halfedges() {
                let at = image(h) as usize;
                tail[at] = vertex_image[surface.head(h).0 as usize];
                length[at] = length[h.0 as usize];
                twin[at] = surface.twin(h).map_or(h.0, image);
            }
        }
        let next = (0..tail.len() as u32)
            .map(|h| if h % 3 == 2 { h - 2 } else { h + 1 })
            .collect();
        let mut triangulation = Self {
            tail,
            next,
            twin,
            length,
            flips: Vec::new(),
            own,
            half: vec![1.0; all.count + 1],
            unknowns: all,
            system: None,
        };
        triangulation.make_delaunay(Rule::Euclid);
        triangulation
    }

    /// How many copies of the surface angle sums count: 2 if it was doubled.
    pub fn copies(&self) -> f64 {
        (self.tail.len() / self.own) as f64
    }

    /// Flips done.
    pub fn flips(&self) -> usize {
        self.flips.len()
    }

    fn at(&self, h: u32) -> usize {
        self.unknowns.of[self.tail[h as usize] as usize] as usize
    }

    fn around(&self, h: u32) -> [u32; 3] {
        let second = self.next[h as usize];
        [h, second, self.next[second as usize]]
    }

    /// Length of a halfedge in the scaled metric.
    fn scaled(&self, h: u32) -> f64 {
        let ends = self.half[self.at(h)] * self.half[self.at(self.next[h as usize])];
        self.length[h as usize] * ends
    }

    /// sin² of half the angle opposite a halfedge in its triangle, in the scaled metric; above 1 where that is broken.
    fn opposite(&self, h: u32) -> f64 {
        let [e, a, b] = self.around(h).map(|h| self.scaled(h));
        let gap = (a - b).abs();
        (e - gap) * (e + gap) / (4.0 * a * b)
    }

    /// Flips edges until the scaled metric is Delaunay; true if any was.
    fn make_delaunay(&mut self, rule: Rule) -> bool {
        let edge = |twin: &[u32], h: u32| h.min(twin[h as usize]);
        let count = self.tail.len() as u32;
        let mut waiting: Vec<u32> = (0..count).filter(|&h| h < self.twin[h as usize]).collect();
        let mut is_waiting = vec![true; count as usize];
        let mut left = MOST_FLIPS * waiting.len();
        let before = self.flips.len();
        while let Some(h) = waiting.pop() {
            is_waiting[h as usize] = false;
            let t = self.twin[h as usize];
            let [_, h1, h2] = self.around(h);
            // Both sides one triangle: there is no quadrilateral, and the two angles are less than π.
            let both = self.opposite(h) + self.opposite(t);
            if h1 == t || h2 == t || both.is_nan() || both <= 1.0 + ROUND {
                continue;
            }
            if left == 0 {
                break;
            }
            left -= 1;
            let [_, t1, t2] = self.around(t);
            self.flip(h, rule);
            for side in [h1, h2, t1, t2].map(|side| edge(&self.twin, side)) {
                if !std::mem::replace(&mut is_waiting[side as usize], true) {
                    waiting.push(side);
                }
            }
        }
        self.flips.len() > before
    }

    /// Turns an edge counter-clockwise to the other diagonal of its quadrilateral.
    fn flip(&mut self, h: u32, rule: Rule) {
        let t = self.twin[h as usize];
        let ([_, h1, h2], [_, t1, t2]) = (self.around(h), self.around(t));
        let (left, right) = (self.tail[h2 as usize], self.tail[t2 as usize]);
        let [e, a, b, c, d] = [h, h1, h2, t1, t2].map(|h| self.length[h as usize]);
        let length = match rule {
            Rule::Ptolemy => (a * c + b * d) / e,
            Rule::Euclid => {
                let (k, l) = (apex(e, b, a, 1.0), apex(e, c, d, -1.0));
                (k[0] - l[0]).hypot(k[1] - l[1])
            }
        };
        for (from, to) in [(h, h2), (h2, t1), (t1, h), (t, t2), (t2, h1), (h1, t)] {
            self.next[from as usize] = to;
        }
        (self.tail[h as usize], self.tail[t as usize]) = (right, left);
        (self.length[h as usize], self.length[t as usize]) = (length, length);
        self.flips.push(h);
    }

    /// The surface's faces in the scaled metric at `u`, which must be flat or nearly: unfolds the triangulation and undoes
    /// all flips.
    ///
    /// Sides are kept as vectors, each face in a frame of its own, with the rotation over every edge: an undone flip adds
    /// two vectors, and errors add up instead of growing with every needle on the way.
    pub fn flat_faces(mut self, u: &[f64]) -> Vec<FlatFace> {
        for (half, u) in self.half.iter_mut().zip(u) {
            *half = (0.5 * u).exp();
        }
        let mut side = self.unfolded();
        // From the frame of a halfedge' face to that of its twin's.
        let mut over: Vec<Complex<f64>> = (0..side.len())
            .map(|h| unit(-side[self.twin[h] as usize] * side[h].conj()))
            .collect();
        while let Some(h) = self.flips.pop() {
            let t = self.twin[h as usize];
            // See `flip`: the edge runs from l to k, i is on its left and j on its right.
            let ([_, h2, t1], [_, t2, h1]) = (self.around(h), self.around(t));
            // Everything in the frame of the left face.
            let back = over[t as usize];
            for outer in [t2, h1] {
                let twin = self.twin[outer as usize];
                side[outer as usize] *= back;
                over[outer as usize] = unit(over[outer as usize] * back.conj());
                over[twin as usize] = over[outer as usize].conj();
            }
            let mut across = side[t1 as usize] + side[t2 as usize];
            if across.norm_sqr() < f64::MIN_POSITIVE {
                // Two corners at one place: any direction will do, but it must be one.
                across = Complex::new(1e-150, 0.0);
            }
            (side[h as usize], side[t as usize]) = (across, -across);
            (over[h as usize], over[t as usize]) = (Complex::ONE, Complex::ONE);
            for (from, to) in [(h, h1), (h1, h2), (h2, h), (t, t1), (t1, t2), (t2, t)] {
                self.next[from as usize] = to;
            }
            (self.tail[h as usize], self.tail[t as usize]) =
                (self.tail[t1 as usize], self.tail[h1 as usize]);
        }
        (0..self.own / 3)
            .map(|face| FlatFace {
                sides: std::array::from_fn(|k| side[3 * face + k]),
            })
            .collect()
    }

    /// All sides as vectors of the plane, face by face across a spanning tree of edges.
    fn unfolded(&self) -> Vec<Complex<f64>> {
        let count = self.tail.len();
        let mut side = vec![Complex::ZERO; count];
        let mut met = vec![false; count];
        for start in 0..count as u32 {
            let mut queue = VecDeque::new();
            if !met[start as usize] {
                queue.push_back((start, 0.0));
                for h in self.around(start) {
                    met[h as usize] = true;
                }
            }
            while let Some((first, along)) = queue.pop_front() {
                let sides = self.around(first);
                let lengths = sides.map(|h| self.scaled(h));
                let (angle, ..) = angles(lengths);
                let second = along + PI - angle[2];
                for ((h, length), direction) in
                    sides
                        .into_iter()
                        .zip(lengths)
                        .zip([along, second, second + PI - angle[0]])
                {
                    side[h as usize] = Complex::from_polar(length, direction);
                    let twin = self.twin[h as usize];
                    if !met[twin as usize] {
                        for h in self.around(twin) {
                            met[h as usize] = true;
                        }
                        // Kept small: a large angle has fewer digits left.
                        queue.push_back((twin, (direction + PI).rem_euclid(2.0 * PI)));
                    }
                }
            }
        }
        side
    }
}

/// What is added to all lengths so that no triangle is all but degenerate (Sharp, Crane: A Laplacian for nonmanifold
/// triangle meshes, 2020, §4.5); 0 on most meshes.
fn mollifier(lengths: &[[f64; 3]]) -> f64 {
    let mean = lengths.iter().flatten().sum::<f64>() / (3.0 * lengths.len() as f64);
    let least = lengths
        .iter()
        .flat_map(|&[a, b, c]| [a + b - c, b + c - a, c + a - b]);
    (ROOM * mean - least.fold(f64::INFINITY, f64::min)).max(0.0)
}

/// Where the third corner of a triangle lies whose first side runs from the origin along X: its distances from the two
/// ends are `near` and `far`, and it lies above X if `sign` is 1.
fn apex(base: f64, near: f64, far: f64, sign: f64) -> [f64; 2] {
    if base <= 0.0 {
        return [0.0, sign * near];
    }
    let slack = |x: f64, y: f64, z: f64| ((y.max(z) - x) + y.min(z)).max(0.0);
    let area4 = ((base + near + far) * slack(base, near, far)).sqrt()
        * (slack(near, far, base) * slack(far, base, near)).sqrt();
    [
        0.5 * ((near - far) * (near + far) / base + base),
        sign * 0.5 * area4 / base,
    ]
}

impl Energy for Intrinsic {
    fn count(&self) -> usize {
        self.unknowns.count
    }

    fn evaluate(
        &mut self,
        u: &[f64],
        target: &[f64],
        gradient: &mut [f64],
    ) -> Result<usize, FactorError> {
        if !u.iter().all(|u| u.abs() < 500.0) {
            // No metric that could be computed: the line search comes nearer.
            gradient.fill(f64::INFINITY);
            return Ok(0);
        }
        for (half, u) in self.half.iter_mut().zip(u) {
            *half = (0.5 * u).exp();
        }
        let flipped = self.make_delaunay(Rule::Ptolemy);
        let system = match self.system.take().filter(|_| !flipped) {
            Some(system) => system,
            None => {
                let first = |h: &u32| {
                    let [_, h1, h2] = self.around(*h);
                    *h < h1 && *h < h2
                };
                let faces: Vec<[u32; 3]> = (0..self.tail.len() as u32)
                    .filter(first)
                    .map(|h| self.around(h))
                    .collect();
                let lengths = faces.iter().map(|f| f.map(|h| self.length[h as usize]));
                let corners = faces.iter().map(|f| f.map(|h| self.tail[h as usize]));
                System::new(&self.unknowns, corners, lengths.collect(), |_| true)?
            }
        };
        self.system.insert(system).evaluate(u, target, gradient)
    }

    fn step(
        &mut self,
        gradient: &[f64],
        forcing: Option<f64>,
        step: &mut [f64],
    ) -> Result<(), FactorError> {
        match &mut self.system {
            Some(system) => system.step(gradient, forcing, step),
            None => Err(FactorError::NotPositiveDefinite),
        }
    }
}
