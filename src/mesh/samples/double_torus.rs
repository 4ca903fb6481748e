//! Two rings that have grown together: a closed surface with two handles.
//!
//! It has three mirror planes, which cut it into eight right-angled pentagons. Each is meshed like half a tube, as a
//! grid of rows along the ring and columns around the tube; only the rows at the inside of the ring turn down into the
//! middle between the two rings. So four quadrilaterals meet everywhere but at the two points where a hole comes
//! nearest to the middle: there it is eight, as two handles ask for. One pentagon is laid on the surface, evened out,
//! copied by the mirrors and split into triangles.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Point2, Point3, Vector3, center};

use super::SampleError;
use super::parameter::{Parameter, parameters};
use super::revolve::Arrays;

parameters! {
    /// A double torus lying flat: two tori of radii R (ring) and r (tube), t = R/r, whose centre lines touch in the
    /// origin, melted into each other. On it d(p) = 0 for the smooth minimum d = −k ln(e^{−d₁/k} + e^{−d₂/k}) of the
    /// distances d₁ and d₂ from the two, with k = r/2.
    DoubleTorus {
        /// R/r: radius of each ring over that of its tube
        t = 3.0 in 2.0..=3.5,
        /// width over all, along X
        width_mm = 200.0 in 1.0..=10000.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

/// How far the two tubes melt into each other, in tube radii: as round a fork as leaves the holes open at t = 2.
const MELT: f64 = 0.5;

/// Rounds of evening out on the first mesh, and after each division. The first has some 40 edges along its longest
/// side, and a round carries a change over one edge; a division only shifts what is between.
const ROUNDS: (usize, usize) = (400, 12);

/// The first mesh has fewer edges around the half tube than this.
const COARSE: usize = 12;

impl DoubleTorus {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        // In tube radii: the length of a pentagon along the ring, the mean of outside and inside, and of the inside the
        // part along the hole.
        let shape = Melted { ring: self.t };
        let (outer, hole, middle) = (
            (self.t + 1.0) * shape.meeting(),
            (self.t - 1.0) * PI,
            FRAC_PI_2,
        );
        let along = 0.5 * (outer + hole + middle);
        let quads = self.faces / 16.0;
        let mut across = ((quads * PI / along).sqrt().round() as usize).max(2);
        let mut divisions = 0;
        while across >= COARSE {
            across = across.div_ceil(2);
            divisions += 1;
        }
        let columns = (quads / 4f64.powi(divisions) / across as f64)
            .round()
            .max(4.0);
        let turn = (columns * hole / (hole + middle)).round();
        let turn = turn.clamp(2.0, columns - 1.0) as usize;
        let mut eighth = Eighth::new(&shape, across, columns as usize, turn);
        eighth.even_out(&shape, ROUNDS.0);
        for _ in 0..divisions {
            eighth = eighth.divided(&shape);
            eighth.even_out(&shape, ROUNDS.1);
        }
        let half = eighth.points.iter().map(|p| p.x).fold(0.0, f64::max);
        Ok(eighth.mirrored(0.5 * self.width_mm / half))
    }
}

/// The surface in tube radii.
struct Melted {
    /// Radius of each ring.
    ring: f64,
}

impl Melted {
    /// The angle around a ring at which its outside meets that of the other.
    fn meeting(&self) -> f64 {
        (-self.ring / (self.ring + 1.0)).acos()
    }

    /// The function that is 0 on the surface, negative inside, and its gradient.
    fn distance(&self, p: Point3<f64>) -> (f64, Vector3<f64>) {
        let one = |centre: f64| {
            let (x, y) = (p.x - centre, p.y);
            let radial = x.hypot(y).max(1e-9);
            let (out, up) = (radial - self.ring, p.z);
            let from_core = out.hypot(up).max(1e-9);
            let slope = out / from_core / radial;
            let gradient = Vector3::new(slope * x, slope * y, up / from_core);
            (from_core - 1.0, gradient)
        };
        let ((a, da), (b, db)) = (one(self.ring), one(-self.ring));
        // The nearer one weighs 1 or less; the other less than it.
        let share = 1.0 / (1.0 + (-(a - b).abs() / MELT).exp());
        let (near, far) = (share, 1.0 - share);
        let (wa, wb) = if a < b { (near, far) } else { (far, near) };
        (a.min(b) + MELT * share.ln(), da * wa + db * wb)
    }

    /// The point of the surface that a few Newton steps along the gradient lead to, without leaving the mirror planes
    /// in which the point lies.
    fn project(&self, mut p: Point3<f64>, free: [bool; 3]) -> Point3<f64> {
        for _ in 0..30 {
            let (distance, mut gradient) = self.distance(p);
            for k in 0..3 {
                if !free[k] {
                    gradient[k] = 0.0;
                }
            }
            let slope = gradient.norm_squared().max(1e-6);
            // No farther than a tube's radius at once: the gradient is not that good a guide.
            let step = (distance / slope).clamp(-0.5, 0.5);
            p -= gradient * step;
            if distance.abs() < 1e-14 {
                break;
            }
        }
        p
    }
}

/// The grid of the part with x, y, z ≥ 0.
struct Eighth {
    /// Edges around the half tube.
    across: usize,
    /// Edges along the ring.
    columns: usize,
    /// The column at which the hole's side ends on the X axis and the inside turns down into the middle.
    turn: usize,
    /// Column by column, each from the outside over the top to the inside.
    points: Vec<Point3<f64>>,
}

impl Eighth {
    /// The grid, straight in the coordinates of the right tube (around the ring, around the tube from its outside over
    /// the top to its inside), laid on the surface.
    fn new(shape: &Melted, across: usize, columns: usize, turn: usize) -> Self {
        let mut grid = Self {
            across,
            columns,
            turn,
            points: Vec::with_capacity((across + 1) * (columns + 1)),
        };
        for i in 0..=columns {
            let outside = Point2::new(shape.meeting() * i as f64 / columns as f64, 0.0);
            let inside = if i <= turn {
                Point2::new(PI * i as f64 / turn as f64, PI)
            } else {
                let down = (i - turn) as f64 / (columns - turn) as f64;
                Point2::new(PI, PI - FRAC_PI_2 * down)
            };
            for j in 0..=across {
                let flat = outside + (inside - outside) * (j as f64 / across as f64);
                let ((sin, cos), (up, out)) = (flat.x.sin_cos(), flat.y.sin_cos());
                let radius = shape.ring + out;
                let raw = Point3::new(shape.ring + radius * cos, radius * sin, up);
                let free = grid.free(i, j);
                grid.points.push(shape.project(held(raw, free), free));
            }
        }
        grid
    }

    fn at(&self, column: usize, row: usize) -> usize {
        column * (self.across + 1) + row
    }

    /// False for the coordinates that are 0 because the point lies in a mirror plane.
    fn free(&self, column: usize, row: usize) -> [bool; 3] {
        let inside = row == self.across;
        [
            column < self.columns,
            column > 0 && !(inside && column >= self.turn),
            row > 0 && !(inside && column <= self.turn),
        ]
    }

    /// Moves every point towards the mean of its neighbours, those beyond a mirror among them, and back to the surface,
    /// again and again.
    fn even_out(&mut self, shape: &Melted, rounds: usize) {
        let mut edges: Vec<(usize, usize, f64)> = Vec::new();
        for i in 0..=self.columns {
            for j in 0..=self.across {
                // An edge inside has its mirror image; one in a mirror plane is its own.
                let share = |on_side: bool| if on_side { 1.0 } else { 2.0 };
                if i < self.columns {
                    let on_side = j == 0 || j == self.across;
                    edges.push((self.at(i, j), self.at(i + 1, j), share(on_side)));
                }
                if j < self.across {
                    let on_side = i == 0 || i == self.columns;
                    edges.push((self.at(i, j), self.at(i, j + 1), share(on_side)));
                }
            }
        }
        let mut pulls = vec![(Vector3::zeros(), 0.0); self.points.len()];
        for _ in 0..rounds {
            pulls.fill((Vector3::zeros(), 0.0));
            for &(a, b, share) in &edges {
                let edge = self.points[b] - self.points[a];
                // A long edge pulls harder, which makes the lengths even.
                let weight = share * edge.norm();
                for (end, pull) in [(a, edge), (b, -edge)] {
                    pulls[end].0 += pull * weight;
                    pulls[end].1 += weight;
                }
            }
            for i in 0..=self.columns {
                for j in 0..=self.across {
                    let (n, free) = (self.at(i, j), self.free(i, j));
                    let (pull, weight) = pulls[n];
                    let moved = self.points[n] + pull * (0.5 / weight);
                    self.points[n] = shape.project(held(moved, free), free);
                }
            }
        }
    }

    /// Every quadrilateral in four.
    fn divided(&self, shape: &Melted) -> Self {
        let mut fine = Self {
            across: 2 * self.across,
            columns: 2 * self.columns,
            turn: 2 * self.turn,
            points: Vec::with_capacity((2 * self.across + 1) * (2 * self.columns + 1)),
        };
        for i in 0..=fine.columns {
            for j in 0..=fine.across {
                let pair = |i: usize| {
                    let (a, b) = (self.at(i, j / 2), self.at(i, j.div_ceil(2)));
                    center(&self.points[a], &self.points[b])
                };
                let free = fine.free(i, j);
                let middle = center(&pair(i / 2), &pair(i.div_ceil(2)));
                fine.points.push(shape.project(held(middle, free), free));
            }
        }
        fine
    }

    /// All eight parts as triangles, `scale` times as large. Quadrilaterals are split along their shorter diagonal.
    fn mirrored(&self, scale: f64) -> Arrays {
        let mut halves = Vec::with_capacity(2 * self.across * self.columns);
        for i in 0..self.columns {
            for j in 0..self.across {
                let [a, b, c, d] =
                    [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| self.at(i, j));
                let length = |a: usize, b: usize| (self.points[a] - self.points[b]).norm();
                if length(a, c) < length(b, d) {
                    halves.extend([[a, b, c], [a, c, d]]);
                } else {
                    halves.extend([[a, b, d], [b, c, d]]);
                }
            }
        }
        let mut positions = Vec::new();
        let mut faces = Vec::with_capacity(8 * halves.len());
        // A point in a mirror plane is its own image.
        let mut known: BTreeMap<(usize, usize), u32> = BTreeMap::new();
        for octant in 0..8usize {
            let mut copies = Vec::with_capacity(self.points.len());
            for i in 0..=self.columns {
                for j in 0..=self.across {
                    let (n, free) = (self.at(i, j), self.free(i, j));
                    let flips = (0..3).filter(|k| free[*k]).map(|k| octant & 1 << k).sum();
                    copies.push(*known.entry((n, flips)).or_insert_with(|| {
                        let mut p = self.points[n] * scale;
                        (0..3)
                            .filter(|k| flips >> k & 1 == 1)
                            .for_each(|k| p[k] = -p[k]);
                        positions.push(p);
                        positions.len() as u32 - 1
                    }));
                }
            }
            let odd = octant.count_ones() % 2 == 1;
            for half in &halves {
                let [a, b, c] = half.map(|v| copies[v]);
                faces.push(if odd { [a, c, b] } else { [a, b, c] });
            }
        }
        (positions, faces)
    }
}

/// The point in the mirror planes that hold it.
fn held(mut p: Point3<f64>, free: [bool; 3]) -> Point3<f64> {
    (0..3).filter(|k| !free[*k]).for_each(|k| p[k] = 0.0);
    p
}
