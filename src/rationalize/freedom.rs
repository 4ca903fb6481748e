//! How a linkage can still move once its edges keep their lengths: degrees of freedom, counted and found.
//!
//! The rows of the rigidity matrix J say how fast each edge would grow if the points moved; motions that keep all
//! lengths are its null space (infinitesimal motions: to first order). With T triangles, H hinges and P = 3T − H points
//! there are 3T lengths. In the plane the count 2P − 3T − 3 equals B₂ − 3, B₂ = P − H being the points of one triangle
//! only, for any shape of sheet, with holes too (their rims count among B₂): the paper's appendix A, where it is
//! derived for disks. The count is the truth if no length follows from the others, and each one that does leaves one
//! motion more. So what has to be found is the number of dependent rows: that of the vanishing eigenvalues of JJᵀ,
//! a sparse matrix, found by Sylvester's law of inertia: as many eigenvalues lie below τ² as JJᵀ − τ²I has negative
//! pivots. Two values of τ tell a gap from a slope.
//!
//! Three settings: the *sheet* as it is cut (open at its seams) in the plane, opened uniformly to half way, since closed,
//! where edges lie on edges, is no general position; *space*, at the positions given, where a linkage is about as soft as cloth; and
//! the *surface*, where every point is held to the tangent plane there (from the triangles at it) as on a form or a
//! body: that leaves about one motion for every free corner, all from the rims.

use nalgebra::{Point3, Rotation2, Vector2, Vector3};

use crate::base::ids::Id as _;
use crate::base::progress::{Interrupted, Progress};
use crate::base::sparse::{Cholesky, FactorError, Pattern, negative_eigenvalues};
use crate::base::union::Union;
use crate::linkage::{Linkage, opening_turn};

/// A length whose rate is this small under the best motion of unit size follows from the others: squared it is well
/// above rounding, and positions are more exact.
const DEPENDENT: f64 = 1e-6;

/// … and this small, it almost does.
const NEARLY: f64 = 1e-4;

/// The scale at which the sheet is looked at: half way between closed and fully open.
const OPENED: f64 = 1.4;

/// Motions of a linkage in one setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Mobility {
    /// Coordinates that may change.
    pub unknowns: usize,
    /// Edge lengths that must not: three for each triangle.
    pub lengths: usize,
    /// Motions as a whole, which are not counted below: 3 in the plane, 6 in space, for each piece. None on the surface,
    /// where sliding as a whole is one of the motions, if the surface permits it.
    pub rigid_motions: usize,
    /// Motions that remain if all lengths are independent; negative if there are too many lengths.
    pub counted: i64,
    /// The rank found.
    pub rank: usize,
    /// Motions that remain: unknowns − rank − rigid motions.
    pub motions: usize,
    /// Lengths that almost follow from others (to 10⁻⁴): as many motions more with the least play in the hinges. Where
    /// there are any, the rank is uncertain by so much.
    pub nearly: usize,
}

/// What a linkage consists of and how it can move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Freedom {
    /// Pieces that hang together in space.
    pub pieces: usize,
    /// Pieces of the sheet.
    pub sheet_pieces: usize,
    /// B₂ of the sheet: points that belong to one triangle, where it is cut open at its seams.
    pub sheet_b2: usize,
    /// B₂ in space: free corners.
    pub b2: usize,
    /// The sheet in the plane, opened.
    pub sheet: Mobility,
    /// In space, at the positions given.
    pub space: Mobility,
    /// At the positions given, every point held to the tangent plane.
    pub surface: Mobility,
}

/// Why there are no figures.
#[derive(Debug, thiserror::Error)]
pub enum FreedomError {
    /// The linear system failed.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// The person asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// Counts and finds the degrees of freedom of a linkage at `positions` (millimetres, by point).
///
/// # Errors
/// [`FreedomError`]: memory, interruption.
pub fn freedom(
    linkage: &Linkage,
    positions: &[Point3<f64>],
    progress: &dyn Progress,
) -> Result<Freedom, FreedomError> {
    progress.start("degrees of freedom", None);
    let corners: Vec<[usize; 3]> = linkage
        .triangles
        .iter()
        .map(|t| t.points.map(|p| p.index()))
        .collect();
    let at: Vec<Vector3<f64>> = positions
        .iter()
        .map(|p| p.coords / linkage.edge_mm)
        .collect();
    let [pieces, sheet_pieces] = [true, false].map(|seams| pieces(linkage, seams));
    let (sheet_corners, sheet_at) = opened_sheet(linkage);
    let sheet_points = sheet_at.len();

    let flat = dependent(&sheet_corners, &sheet_at, |_, u| *u)?;
    progress.check()?;
    let space = dependent(&corners, &at, |_, u| *u)?;
    progress.check()?;
    let normals = normals(&corners, &at);
    let surface = dependent(&corners, &at, |point, u| {
        u - normals[point] * normals[point].dot(u)
    })?;
    let lengths = 3 * corners.len();
    Ok(Freedom {
        pieces,
        sheet_pieces,
        sheet_b2: 2 * sheet_points - lengths,
        b2: linkage.point_count() - linkage.hinges.len(),
        sheet: mobility(2 * sheet_points, lengths, 3 * sheet_pieces, flat),
        space: mobility(3 * at.len(), lengths, 6 * pieces, space),
        surface: mobility(2 * at.len(), lengths, 0, surface),
    })
}

fn mobility(
    unknowns: usize,
    lengths: usize,
    rigid_motions: usize,
    [dependent, nearly]: [usize; 2],
) -> Mobility {
    let rank = lengths - dependent;
    Mobility {
        unknowns,
        lengths,
        rigid_motions,
        counted: unknowns as i64 - (lengths + rigid_motions) as i64,
        rank,
        motions: unknowns.saturating_sub(rank + rigid_motions),
        nearly: nearly.saturating_sub(dependent),
    }
}

/// Number of pieces that hang together by hinges, or by those that are no seam.
fn pieces(linkage: &Linkage, seams: bool) -> usize {
    let mut sets = Union::new(linkage.triangles.len());
    let joined = linkage
        .hinges
        .iter()
        .filter(|h| seams || !h.seam)
        .filter(|h| sets.join(h.ccw.triangle.index(), h.cw.triangle.index()))
        .count();
    linkage.triangles.len() - joined
}

/// The sheet as it is cut, opened in the plane: points of every triangle and their places in L. Seam hinges are two
/// points each.
fn opened_sheet(linkage: &Linkage) -> (Vec<[usize; 3]>, Vec<Vector3<f64>>) {
    let mut corners: Vec<[usize; 3]> = linkage
        .triangles
        .iter()
        .map(|t| t.points.map(|p| p.index()))
        .collect();
    let mut points = linkage.point_count();
    for hinge in linkage.hinges.iter().filter(|h| h.seam) {
        corners[hinge.cw.triangle.index()][hinge.cw.corner] = points;
        points += 1;
    }
    let mut at = vec![Vector3::zeros(); points];
    for (t, corners) in linkage.triangles.iter().zip(&corners) {
        let centre: Vector2<f64> = t.flat.iter().map(|p| p.coords).sum::<Vector2<f64>>() / 3.0;
        let turn = opening_turn(OPENED) * linkage.handedness.opening_sense(t.colour);
        for k in 0..3 {
            let arm = Rotation2::new(turn) * (t.flat[k].coords - centre);
            let place = (centre * OPENED + arm) / linkage.edge_mm;
            at[corners[k]] = Vector3::new(place.x, place.y, 0.0);
        }
    }
    (corners, at)
}

/// Unit normals at the points: of the triangle there, or between those of the two.
fn normals(corners: &[[usize; 3]], at: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); at.len()];
    for &[a, b, c] in corners {
        let normal = (at[b] - at[a]).cross(&(at[c] - at[a]));
        let unit = normal.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        [a, b, c].iter().for_each(|&p| normals[p] += unit);
    }
    for n in &mut normals {
        *n = n.try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
    }
    normals
}

/// Lengths that follow from the others, and those that do or almost do, where a point moves only as `allowed` projects.
fn dependent(
    corners: &[[usize; 3]],
    at: &[Vector3<f64>],
    allowed: impl Fn(usize, &Vector3<f64>) -> Vector3<f64>,
) -> Result<[usize; 2], FactorError> {
    // At every point: the edges that end there with the direction in which it lengthens them.
    let mut ends: Vec<Vec<(u32, Vector3<f64>)>> = vec![Vec::new(); at.len()];
    for (t, corners) in corners.iter().enumerate() {
        for k in 0..3 {
            let (tail, head) = (corners[k], corners[(k + 1) % 3]);
            let along = (at[head] - at[tail])
                .try_normalize(0.0)
                .unwrap_or_else(Vector3::zeros);
            let edge = (3 * t + k) as u32;
            ends[tail].push((edge, -along));
            ends[head].push((edge, along));
        }
    }
    let pairs = ends.iter().flat_map(|ends| {
        let all = move |(a, _): &(u32, Vector3<f64>)| {
            let a = *a;
            ends.iter().map(move |(b, _)| (a, *b))
        };
        ends.iter().flat_map(all)
    });
    let pattern = Pattern::new(3 * corners.len(), pairs);
    let mut gram = vec![0.0; pattern.entries()];
    for (point, ends) in ends.iter().enumerate() {
        for (n, (a, u)) in ends.iter().enumerate() {
            let rate = allowed(point, u);
            for (b, v) in &ends[..=n] {
                if let Some(slot) = pattern.slot(*a as usize, *b as usize) {
                    gram[slot] += rate.dot(v);
                }
            }
        }
    }
    let shifted = |tau: f64| {
        let mut values = gram.clone();
        for edge in 0..pattern.size() {
            values[pattern.diagonal(edge)] -= tau * tau;
        }
        values
    };
    // The usual case: all are independent, which a Cholesky factor proves.
    let mut cholesky = Cholesky::new(pattern.clone())?;
    if cholesky.factor(&shifted(NEARLY)).is_ok() {
        return Ok([0, 0]);
    }
    drop(cholesky);
    let count = |tau: f64| negative_eigenvalues(&pattern, &shifted(tau));
    Ok([count(DEPENDENT)?, count(NEARLY)?])
}
