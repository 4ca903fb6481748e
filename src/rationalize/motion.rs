//! The softest ways in which a linkage gives way: how it will sag, bulge or be squeezed off its shape.
//!
//! Rigid triangles leave thousands of motions in space, and what tells them apart is how much the hinges have to turn.
//! If every hinge resists turning alike in every direction, a motion costs the sum of squares of the turns between the
//! two triangles of each hinge, and the softest motions are those that cost least for what they move: the lowest
//! eigenvectors of that sum among motions that keep all edge lengths (to first order) and are no rigid motion. The
//! lengths are held by a stiff penalty, rigid motions are projected out, and inverse iteration on a block of vectors
//! finds the lowest.

use std::fmt::Write as _;

use nalgebra::{DMatrix, Matrix3, Point3, SymmetricEigen, Vector3};

use super::freedom::FreedomError;
use crate::base::ids::Id as _;
use crate::base::progress::Progress;
use crate::base::sparse::{Cholesky, FactorError, Pattern};
use crate::base::union::Union;
use crate::base::units::fixed;
use crate::linkage::{Linkage, PointId};

/// Stiffness of an edge against that of a hinge (in units of L).
const STIFF: f64 = 1e4;

/// Added to all eigenvalues, so that rigid motions do not make the system singular: about the softest bending of a sheet
/// 300 triangles wide, and above rounding.
const SHIFT: f64 = 1e-8;

/// Vectors beyond those wanted: the more, the faster the wanted ones converge.
const SPARE: usize = 6;

/// Iterations at most; some dozen are needed.
const MOST_ITERATIONS: usize = 60;

/// Eigenvalues that change by less than this part are found.
const FOUND: f64 = 1e-6;

/// A triangle whose inertia (in units of L, where it should be ¼) has a smaller determinant has collapsed: how fast it
/// turns is not defined, and its hinges cost nothing.
const COLLAPSED: f64 = 1e-9;

/// Largest number of motions that are looked for.
pub const MOST_MOTIONS: usize = 50;

/// One way in which a linkage moves, to first order.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Motion {
    /// The point that moves farthest, counted from 1 as in `linkage.obj`.
    pub point: u32,
    /// Where that is, millimetres.
    pub at_mm: [f64; 3],
    /// Part of the points that move at least half as far.
    pub moving: f64,
    /// How far hinges turn for each millimetre that it moves, root mean square.
    pub turn_rms_deg_per_mm: f64,
    /// … and that of the hinge that turns most.
    pub turn_max_deg_per_mm: f64,
    /// Displacement of every point for each millimetre that the farthest moves.
    #[serde(skip)]
    pub displacement: Vec<Vector3<f64>>,
}

/// The softest `count` motions (at most [`MOST_MOTIONS`]) of a linkage at `positions` (millimetres, by point), the softest
/// first. Fewer if it has no more.
///
/// # Errors
/// [`FreedomError`]: memory, interruption.
pub fn softest(
    linkage: &Linkage,
    positions: &[Point3<f64>],
    count: usize,
    progress: &dyn Progress,
) -> Result<Vec<Motion>, FreedomError> {
    let at: Vec<Vector3<f64>> = positions
        .iter()
        .map(|p| p.coords / linkage.edge_mm)
        .collect();
    let size = 3 * at.len();
    let turns = Turns::new(linkage, &at);
    let rigid = rigid_motions(linkage, &at);
    let wanted = count.min(MOST_MOTIONS);
    let width = (wanted + SPARE).min(size - rigid.len().min(size));
    if wanted == 0 || width == 0 {
        return Ok(Vec::new());
    }
    progress.start("softest motions", None);
    let (pattern, values) = stiffness(linkage, &at, &turns);
    let mut cholesky = Cholesky::new(pattern.clone())?;
    cholesky.factor(&values)?;

    let mut block = scattered(size, width);
    let mut product = DMatrix::zeros(size, width);
    let mut before = vec![f64::INFINITY; width];
    for _ in 0..MOST_ITERATIONS {
        progress.check()?;
        cholesky.solve_columns(block.as_mut_slice(), width);
        // Twice, for what is left after once is rounding of what was large.
        for _ in 0..2 {
            rigid.iter().for_each(|motion| motion.remove(&mut block));
            block = block.qr().q();
        }
        for (x, y) in block
            .as_slice()
            .chunks(size)
            .zip(product.as_mut_slice().chunks_mut(size))
        {
            pattern.multiply(&values, x, y);
        }
        let small = block.transpose() * &product;
        // Positions beyond all measure: the decomposition would search without end.
        if small.iter().any(|x| !x.is_finite()) {
            return Err(FactorError::NotPositiveDefinite.into());
        }
        let eigen = SymmetricEigen::new(small);
        let mut order: Vec<usize> = (0..width).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let vectors = DMatrix::from_fn(width, width, |i, j| eigen.eigenvectors[(i, order[j])]);
        block = &block * vectors;
        let now: Vec<f64> = order.iter().map(|&i| eigen.eigenvalues[i]).collect();
        let still = |(a, b): (&f64, &f64)| (a - b).abs() <= FOUND * a.abs();
        let done = now.iter().zip(&before).take(wanted).all(still);
        before = now;
        if done {
            break;
        }
    }
    // What costs as much as stretching an edge is no motion.
    let soft = before.iter().take(wanted).filter(|v| **v < 0.01 * STIFF);
    Ok((0..soft.count())
        .map(|k| {
            motion(
                positions,
                linkage.edge_mm,
                &turns,
                block.column(k).as_slice(),
            )
        })
        .collect())
}

/// The linkage at rest and moved by each motion, the farthest point by half an edge, as objects of one plain OBJ.
pub fn motions_obj(linkage: &Linkage, positions: &[Point3<f64>], motions: &[Motion]) -> String {
    let mut text = format!(
        "# kagome motions: the farthest point moves by {} mm, the others in proportion\n",
        fixed(0.5 * linkage.edge_mm, 4)
    );
    let mut object = |name: String, number: usize, at: &dyn Fn(usize) -> Vector3<f64>| {
        let _ = writeln!(text, "o {name}");
        for i in 0..positions.len() {
            let [x, y, z] = <[f64; 3]>::from(at(i)).map(|x| fixed(x, 6));
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        for t in linkage.triangles.iter() {
            let [a, b, c] = t.points.map(|p| p.index() + 1 + number * positions.len());
            let _ = writeln!(text, "f {a} {b} {c}");
        }
    };
    object("rest".into(), 0, &|i| positions[i].coords);
    for (n, motion) in motions.iter().enumerate() {
        object(format!("motion_{}", n + 1), n + 1, &|i| {
            positions[i].coords + motion.displacement[i] * (0.5 * linkage.edge_mm)
        });
    }
    text
}

/// How fast triangles and hinges turn when points move.
struct Turns {
    /// Of each hinge: points, and what a unit velocity of each adds to the turn between its two triangles.
    hinges: Vec<[(usize, Matrix3<f64>); 6]>,
}

impl Turns {
    fn new(linkage: &Linkage, at: &[Vector3<f64>]) -> Self {
        // The angular velocity of a rigid triangle is I⁻¹ Σ r × v, with r from its centroid and I = Σ |r|² − r rᵀ.
        let triangles: Vec<[(usize, Matrix3<f64>); 3]> = linkage
            .triangles
            .iter()
            .map(|t| {
                let points = t.points.map(|p| p.index());
                let centre = points.iter().map(|&p| at[p]).sum::<Vector3<f64>>() / 3.0;
                let arms = points.map(|p| at[p] - centre);
                let inertia: Matrix3<f64> = arms
                    .iter()
                    .map(|r| Matrix3::identity() * r.norm_squared() - r * r.transpose())
                    .sum();
                let inverse = match inertia.try_inverse() {
                    Some(inverse) if inertia.determinant() > COLLAPSED => inverse,
                    _ => Matrix3::zeros(),
                };
                [0, 1, 2].map(|k| (points[k], inverse * arms[k].cross_matrix()))
            })
            .collect();
        let hinges = linkage
            .hinges
            .iter()
            .map(|h| {
                let [a, b] = [h.ccw, h.cw].map(|c| triangles[c.triangle.index()]);
                let minus = |(p, m): (usize, Matrix3<f64>)| (p, -m);
                [a[0], a[1], a[2], minus(b[0]), minus(b[1]), minus(b[2])]
            })
            .collect();
        Self { hinges }
    }

    /// The turn of each hinge under velocities x.
    fn of<'a>(&'a self, x: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let velocity = |p: usize| Vector3::new(x[3 * p], x[3 * p + 1], x[3 * p + 2]);
        self.hinges.iter().map(move |h| {
            let turn: Vector3<f64> = h.iter().map(|(p, m)| m * velocity(*p)).sum();
            turn.norm()
        })
    }
}

/// The matrix of the cost: hinges, edges, shift.
fn stiffness(linkage: &Linkage, at: &[Vector3<f64>], turns: &Turns) -> (Pattern, Vec<f64>) {
    let of_hinges = turns.hinges.iter().flat_map(|h| {
        let points = h.map(|(p, _)| p as u32);
        points.into_iter().flat_map(move |a| points.map(|b| (a, b)))
    });
    let of_edges = linkage
        .triangles
        .iter()
        .flat_map(|t| [0, 1, 2].map(|k| (t.points[k].0, t.points[(k + 1) % 3].0)));
    let pattern = Pattern::new(at.len(), of_hinges.chain(of_edges)).expanded(3);
    let mut values = vec![0.0; pattern.entries()];
    let mut add = |p: usize, q: usize, block: Matrix3<f64>| {
        for (r, c) in (0..9).map(|n| (n / 3, n % 3)) {
            let (row, col) = (3 * p + r, 3 * q + c);
            if row >= col
                && let Some(slot) = pattern.slot(row, col)
            {
                values[slot] += block[(r, c)];
            }
        }
    };
    for h in &turns.hinges {
        for (p, m) in h {
            for (q, n) in h {
                add(*p, *q, m.transpose() * n);
            }
        }
    }
    for t in linkage.triangles.iter() {
        for k in 0..3 {
            let [p, q] = [t.points[k], t.points[(k + 1) % 3]].map(|p| p.index());
            let along = (at[q] - at[p])
                .try_normalize(0.0)
                .unwrap_or_else(Vector3::zeros);
            let block = along * along.transpose() * STIFF;
            add(p, p, block);
            add(q, q, block);
            add(p, q, -block);
            add(q, p, -block);
        }
    }
    for i in 0..pattern.size() {
        values[pattern.diagonal(i)] += SHIFT;
    }
    (pattern, values)
}

/// A rigid motion of one piece, of length 1: velocities of its points.
struct Rigid {
    points: std::rc::Rc<Vec<usize>>,
    velocity: Vec<Vector3<f64>>,
}

impl Rigid {
    /// Takes it out of every column.
    fn remove(&self, block: &mut DMatrix<f64>) {
        for mut column in block.column_iter_mut() {
            let with = self.points.iter().zip(&self.velocity);
            let along: f64 = with
                .clone()
                .map(|(&p, v)| (0..3).map(|k| column[3 * p + k] * v[k]).sum::<f64>())
                .sum();
            for (&p, v) in with {
                (0..3).for_each(|k| column[3 * p + k] -= along * v[k]);
            }
        }
    }
}

/// An orthonormal basis of the rigid motions, six for each piece.
fn rigid_motions(linkage: &Linkage, at: &[Vector3<f64>]) -> Vec<Rigid> {
    let mut sets = Union::new(at.len());
    for t in linkage.triangles.iter() {
        let [a, b, c] = t.points.map(|p| p.index());
        sets.join(a, b);
        sets.join(b, c);
    }
    let mut pieces: std::collections::BTreeMap<usize, Vec<usize>> = Default::default();
    for point in 0..at.len() {
        pieces.entry(sets.root(point)).or_default().push(point);
    }
    let mut all = Vec::new();
    for points in pieces.into_values() {
        let points = std::rc::Rc::new(points);
        let centre = points.iter().map(|&p| at[p]).sum::<Vector3<f64>>() / points.len() as f64;
        let mut basis: Vec<Vec<Vector3<f64>>> = Vec::new();
        for n in 0..6 {
            let axis = Vector3::ith(n % 3, 1.0);
            let mut velocity: Vec<Vector3<f64>> = points
                .iter()
                .map(|&p| {
                    if n < 3 {
                        axis
                    } else {
                        axis.cross(&(at[p] - centre))
                    }
                })
                .collect();
            let dot = |a: &[Vector3<f64>], b: &[Vector3<f64>]| -> f64 {
                a.iter().zip(b).map(|(x, y)| x.dot(y)).sum()
            };
            for _ in 0..2 {
                for other in &basis {
                    let along = dot(&velocity, other);
                    velocity
                        .iter_mut()
                        .zip(other)
                        .for_each(|(v, o)| *v -= o * along);
                }
            }
            let length = dot(&velocity, &velocity).sqrt();
            // Points on a line turn about it without moving.
            if length > 1e-6 {
                velocity.iter_mut().for_each(|v| *v /= length);
                basis.push(velocity);
            }
        }
        all.extend(basis.into_iter().map(|velocity| Rigid {
            points: points.clone(),
            velocity,
        }));
    }
    all
}

/// Columns without any pattern, the same every time.
fn scattered(size: usize, width: usize) -> DMatrix<f64> {
    let mut state = 1u64;
    DMatrix::from_fn(size, width, |_, _| {
        // Knuth's linear congruential generator; the upper bits are good enough for a start.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 30) as f64 - 1.0
    })
}

/// An eigenvector in millimetres and degrees.
fn motion(positions: &[Point3<f64>], edge_mm: f64, turns: &Turns, x: &[f64]) -> Motion {
    let moves: Vec<Vector3<f64>> = x
        .chunks(3)
        .map(|v| Vector3::new(v[0], v[1], v[2]))
        .collect();
    let (farthest, most) =
        moves
            .iter()
            .map(Vector3::norm)
            .enumerate()
            .fold(
                (0, 0.0),
                |best, (i, d)| if d > best.1 { (i, d) } else { best },
            );
    let most = f64::max(most, f64::MIN_POSITIVE);
    // A motion is as good backwards; the farthest point's largest step is made positive.
    let step = moves[farthest];
    let sign = step[step.iamax()].signum();
    let (mut sum, mut widest) = (0.0, 0.0f64);
    for turn in turns.of(x) {
        sum += turn * turn;
        widest = widest.max(turn);
    }
    let per_mm = |turn: f64| (turn / most / edge_mm).to_degrees();
    Motion {
        point: PointId::from_index(farthest).0 + 1,
        at_mm: positions[farthest].into(),
        moving: moves.iter().filter(|m| m.norm() >= 0.5 * most).count() as f64 / moves.len() as f64,
        turn_rms_deg_per_mm: per_mm((sum / turns.hinges.len().max(1) as f64).sqrt()),
        turn_max_deg_per_mm: per_mm(widest),
        displacement: moves.iter().map(|m| m * (sign / most)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::progress::Silent;
    use crate::linkage::Handedness;
    use crate::rationalize::freedom;

    /// A patch opened and bent like a dish, L = 3 mm.
    fn dish(radius: i32) -> (Linkage, Vec<Point3<f64>>) {
        let linkage = Linkage::patch(3.0, Handedness::Right, &Linkage::hexagon_cells(radius));
        let mut at = vec![Point3::origin(); linkage.point_count()];
        for t in linkage.triangles.iter() {
            let centre = t
                .flat
                .iter()
                .map(|p| p.coords)
                .sum::<nalgebra::Vector2<f64>>()
                / 3.0;
            let turn =
                crate::linkage::opening_turn(1.3) * linkage.handedness.opening_sense(t.colour);
            for k in 0..3 {
                let p = centre * 1.3 + nalgebra::Rotation2::new(turn) * (t.flat[k].coords - centre);
                at[t.points[k].index()] = Point3::new(p.x, p.y, 0.01 * p.norm_squared());
            }
        }
        (linkage, at)
    }

    /// Dense: the cost on an orthonormal basis of the null space of the edge lengths, with its six zeros.
    #[test]
    fn the_softest_motions_are_those_of_a_dense_eigenvalue_problem() {
        let (linkage, at) = dish(2);
        let x: Vec<Vector3<f64>> = at.iter().map(|p| p.coords / linkage.edge_mm).collect();
        let size = 3 * x.len();
        let turns = Turns::new(&linkage, &x);
        let mut lengths = DMatrix::zeros(size, size);
        for (n, t) in linkage.triangles.iter().enumerate() {
            for k in 0..3 {
                let [p, q] = [t.points[k], t.points[(k + 1) % 3]].map(|p| p.index());
                let along = (x[q] - x[p]).normalize();
                for c in 0..3 {
                    lengths[(3 * n + k, 3 * p + c)] = -along[c];
                    lengths[(3 * n + k, 3 * q + c)] = along[c];
                }
            }
        }
        let svd = lengths.svd(false, true);
        let v = svd.v_t.unwrap();
        let null: Vec<usize> = (0..size)
            .filter(|&i| svd.singular_values[i] < 1e-9)
            .collect();
        let motions = freedom(&linkage, &at, &Silent).unwrap().space.motions;
        assert_eq!(null.len(), motions + 6);
        let mut cost = DMatrix::zeros(size, size);
        for h in &turns.hinges {
            for (p, m) in h {
                for (q, n) in h {
                    let block = m.transpose() * n;
                    let mut view = cost.fixed_view_mut::<3, 3>(3 * p, 3 * q);
                    view += block;
                }
            }
        }
        let basis = DMatrix::from_fn(size, null.len(), |i, j| v[(null[j], i)]);
        let mut exact: Vec<f64> = SymmetricEigen::new(basis.transpose() * cost * &basis)
            .eigenvalues
            .iter()
            .copied()
            .collect();
        exact.sort_by(f64::total_cmp);
        assert!(
            exact[5].abs() < 1e-9 && exact[6] > 1e-6,
            "six rigid motions"
        );
        let found = softest(&linkage, &at, 5, &Silent).unwrap();
        for (k, motion) in found.iter().enumerate() {
            let moves: Vec<f64> = motion
                .displacement
                .iter()
                .flat_map(|d| [d.x, d.y, d.z])
                .collect();
            let size: f64 = moves.iter().map(|m| m * m).sum();
            let cost: f64 = turns.of(&moves).map(|t| t * t).sum();
            assert!(
                (cost / size / exact[6 + k] - 1.0).abs() < 2e-3,
                "{k}: {} {}",
                cost / size,
                exact[6 + k]
            );
            // Lengths are kept.
            for t in linkage.triangles.iter() {
                for c in 0..3 {
                    let [p, q] = [t.points[c], t.points[(c + 1) % 3]].map(|p| p.index());
                    let along = (x[q] - x[p]).normalize();
                    let rate = along.dot(&(motion.displacement[q] - motion.displacement[p]));
                    assert!(rate.abs() < 1e-3, "{rate}");
                }
            }
            let farthest = motion
                .displacement
                .iter()
                .map(Vector3::norm)
                .fold(0.0, f64::max);
            assert!((farthest - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_lone_triangle_has_no_motion_and_a_pair_three() {
        use crate::linkage::Colour;
        for (cells, motions) in [
            (vec![(0, 0, Colour::Up)], 0),
            (vec![(0, 0, Colour::Up), (0, 0, Colour::Down)], 3),
        ] {
            let linkage = Linkage::patch(3.0, Handedness::Left, &cells);
            let mut at = vec![Point3::origin(); linkage.point_count()];
            for t in linkage.triangles.iter() {
                (0..3).for_each(|k| {
                    at[t.points[k].index()] = Point3::new(t.flat[k].x, t.flat[k].y, 0.0)
                });
            }
            let found = softest(&linkage, &at, 9, &Silent).unwrap();
            assert_eq!(found.len(), motions);
            let text = motions_obj(&linkage, &at, &found);
            assert_eq!(text.matches("\no ").count(), motions + 1);
            assert!(!crate::linkage::is_linkage(text.as_bytes()));
        }
    }
}
