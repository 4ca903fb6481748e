//! The linear system of one step: which numbers there are and where they go.
//!
//! Edges join points of one triangle, so the matrix of edges and pulls has a block for every edge and no other: at ten
//! thousand triangles it is factored seven times faster than with a block for every pair of arms of every hinge. The
//! blocks that a hinge's conditions need are added when one of them comes near to its bound, and then stay.

use nalgebra::{Matrix3, Vector3};

use super::super::problem::Problem;
use super::contact::Contact;
use crate::base::sparse::{Cholesky, FactorError, Pattern};

/// Where one 3 × 3 block of the matrix is stored: the slots of its three columns' first entries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    columns: [u32; 3],
}

/// Pairs of a clique's points, so that those of the first four come first.
const PAIRS: [(usize, usize); 10] = [
    (0, 1),
    (0, 2),
    (1, 2),
    (0, 3),
    (1, 3),
    (2, 3),
    (0, 4),
    (1, 4),
    (2, 4),
    (3, 4),
];

/// Stiffness that holds a pinned point, against 1 for an edge: what it gives way is undone by the caller.
const PINNED: f64 = 1e8;

/// A hinge without blocks of its own.
const NONE: u32 = u32::MAX;

/// Points that share conditions, and the blocks of their pairs.
#[derive(Clone, Copy, Debug)]
struct Blocks {
    /// Five, or four and the last once more.
    points: [u32; 5],
    /// Ten, or six that matter.
    pairs: [Block; 10],
}

/// A clique of a [`System`]: a hinge's five points, or a contact's four.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clique(u32);

/// Matrix and right-hand side, with the places of every term.
pub(super) struct System {
    cholesky: Cholesky,
    diagonal: Vec<Block>,
    /// For every triangle the blocks of its sides (k, k + 1).
    sides: Vec<[Block; 3]>,
    /// For every hinge its clique, or [`NONE`].
    hinges: Vec<u32>,
    /// The first contact's clique.
    contacts: u32,
    cliques: Vec<Blocks>,
    matrix: Vec<f64>,
    damped: Vec<f64>,
    rhs: Vec<f64>,
}

impl System {
    /// A system with blocks for the edges, for the hinges that `near` names and for the points of `contacts`.
    pub fn new(
        problem: &Problem,
        near: &[bool],
        contacts: &[Contact],
    ) -> Result<Self, FactorError> {
        let sides = problem
            .triangles
            .iter()
            .flat_map(|t| (0..3).map(move |k| (t[k], t[(k + 1) % 3])));
        let chosen = problem.hinges.iter().zip(near).filter(|(_, near)| **near);
        let pairs = chosen.flat_map(|(h, _)| PAIRS.iter().map(move |&(i, j)| (h[i], h[j])));
        let touching = contacts.iter().flat_map(|c| {
            let p = c.points;
            (0..3).map(move |i| (p[i], p[3]))
        });
        let points = Pattern::new(problem.points, sides.chain(pairs).chain(touching));
        let cholesky = Cholesky::new(points.expanded(3))?;
        let pattern = cholesky.pattern();
        let block = |i: u32, j: u32| -> Block {
            let (low, high) = (3 * i.min(j) as usize, 3 * i.max(j) as usize);
            let start = |c: usize| pattern.diagonal(low + c);
            // Below the first column's diagonal block of three rows, blocks of three rows follow in all columns alike.
            let below = if low == high {
                None
            } else {
                pattern.slot(low, high).map(|slot| slot - start(0) - 3)
            };
            Block {
                columns: std::array::from_fn(|c| {
                    (start(c) + below.map_or(0, |below| 3 - c + below)) as u32
                }),
            }
        };
        let diagonal = (0..problem.points as u32).map(|i| block(i, i)).collect();
        let sides = problem
            .triangles
            .iter()
            .map(|t| std::array::from_fn(|k| block(t[k], t[(k + 1) % 3])))
            .collect();
        let mut hinges = vec![NONE; problem.hinges.len()];
        let mut cliques = Vec::new();
        for (n, (h, near)) in problem.hinges.iter().zip(near).enumerate() {
            if *near {
                hinges[n] = cliques.len() as u32;
                cliques.push(Blocks {
                    points: *h,
                    pairs: PAIRS.map(|(i, j)| block(h[i], h[j])),
                });
            }
        }
        let first_contact = cliques.len() as u32;
        cliques.extend(contacts.iter().map(|contact| {
            let [h, b, a, c] = contact.points;
            let points = [h, b, a, c, c];
            Blocks {
                points,
                pairs: PAIRS.map(|(i, j)| block(points[i], points[j])),
            }
        }));
        let matrix = vec![0.0; pattern.entries()];
        Ok(Self {
            contacts: first_contact,
            diagonal,
            sides,
            hinges,
            cliques,
            damped: matrix.clone(),
            matrix,
            rhs: vec![0.0; 3 * problem.points],
            cholesky,
        })
    }

    /// The clique of a hinge, if it has blocks of its own.
    #[inline]
    pub fn hinge(&self, n: usize) -> Option<Clique> {
        let clique = self.hinges[n];
        (clique != NONE).then_some(Clique(clique))
    }

    /// The clique of a contact.
    #[inline]
    pub fn contact(&self, n: usize) -> Clique {
        Clique(self.contacts + n as u32)
    }

    /// Empties matrix and right-hand side.
    pub fn clear(&mut self) {
        self.matrix.fill(0.0);
        self.rhs.fill(0.0);
    }

    /// Adds `weight` · g gᵀ at a point.
    #[inline]
    pub fn add_outer(&mut self, i: u32, g: &Vector3<f64>, weight: f64) {
        let columns = self.diagonal[i as usize].columns;
        for c in 0..3 {
            for r in c..3 {
                self.matrix[columns[c] as usize + r - c] += weight * g[r] * g[c];
            }
        }
    }

    /// Adds `weight` times the identity at a point.
    #[inline]
    pub fn add_identity(&mut self, i: u32, weight: f64) {
        for slot in self.diagonal[i as usize].columns {
            self.matrix[slot as usize] += weight;
        }
    }

    /// Adds −g · residual to the right-hand side of a point.
    #[inline]
    pub fn pull(&mut self, i: u32, g: &Vector3<f64>, residual: f64) {
        for k in 0..3 {
            self.rhs[3 * i as usize + k] -= g[k] * residual;
        }
    }

    /// Adds the symmetric m between the ends of side `k` of a triangle: +m at both, −m between them.
    #[inline]
    pub fn add_side(&mut self, triangle: usize, k: usize, ends: [u32; 2], m: &Matrix3<f64>) {
        for i in ends {
            let columns = self.diagonal[i as usize].columns;
            for c in 0..3 {
                for r in c..3 {
                    self.matrix[columns[c] as usize + r - c] += m[(r, c)];
                }
            }
        }
        let block = self.sides[triangle][k];
        for c in 0..3 {
            for r in 0..3 {
                self.matrix[block.columns[c] as usize + r] -= m[(r, c)];
            }
        }
    }

    /// Adds a condition on a clique: `curvature` · g gᵀ and, to the right-hand side, −`slope` · g.
    pub fn add_clique(
        &mut self,
        clique: Clique,
        gradient: &[Vector3<f64>],
        curvature: f64,
        slope: f64,
    ) {
        let Blocks { points, pairs } = self.cliques[clique.0 as usize];
        for (&i, g) in points.iter().zip(gradient) {
            self.add_outer(i, g, curvature);
            self.pull(i, g, slope);
        }
        // Pairs of the first points come first.
        let count = gradient.len() * (gradient.len() - 1) / 2;
        for (block, &(i, j)) in pairs.iter().zip(&PAIRS).take(count) {
            let (column, row) = if points[i] < points[j] {
                (&gradient[i], &gradient[j])
            } else {
                (&gradient[j], &gradient[i])
            };
            for c in 0..3 {
                for r in 0..3 {
                    self.matrix[block.columns[c] as usize + r] += curvature * row[r] * column[c];
                }
            }
        }
    }

    /// Keeps a point where it is: nothing pulls it, and it gives way to nothing.
    pub fn pin(&mut self, i: u32) {
        self.add_identity(i, PINNED);
        self.rhs[3 * i as usize..][..3].fill(0.0);
    }

    /// Factors the matrix with `damping` on its diagonal.
    pub fn factor(&mut self, damping: f64) -> Result<(), FactorError> {
        self.damped.copy_from_slice(&self.matrix);
        for block in &self.diagonal {
            for slot in block.columns {
                self.damped[slot as usize] += damping;
            }
        }
        self.cholesky.factor(&self.damped)
    }

    /// The step that the factored system gives, into `step`, and by how much the quadratic model falls along it.
    pub fn solve(&mut self, step: &mut [f64]) -> f64 {
        step.copy_from_slice(&self.rhs);
        self.cholesky.solve(step);
        0.5 * step.iter().zip(&self.rhs).map(|(s, r)| s * r).sum::<f64>()
    }
}
