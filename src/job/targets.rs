//! The surfaces that one pattern is to fit, and the one that it is laid on.
//!
//! Several targets are one mesh in several shapes (paper, Fig. 4): the same faces, other positions. So every place of one
//! is a place of all, and a pattern that is laid on one, or on a mean of them, has a start on each. Which surface it is
//! laid on is decided by trying: see [`Targets::patterns`].

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};

use super::MakeError;
use crate::base::ids::{Id as _, Per};
use crate::conformal::Spread;
use crate::mesh::{ClosestPoint, Surface, VertexId};

/// One surface that the sheet is to take the shape of.
pub(crate) struct Target {
    /// What a person calls it.
    pub name: String,
    /// The surface, millimetres.
    pub surface: Surface,
    /// Closest points on it.
    pub closest: ClosestPoint,
}

impl Target {
    pub fn new(name: String, surface: Surface) -> Self {
        Self {
            name,
            closest: ClosestPoint::new(&surface),
            surface,
        }
    }
}

/// All surfaces that the sheet is to take the shape of; at least one.
pub(crate) struct Targets(pub Vec<Target>);

/// Shapes nearer to each other than this part of their size, once they are laid over each other, are one shape.
const SAME: f64 = 1e-9;

impl Targets {
    /// Whether there are more than one.
    pub fn several(&self) -> bool {
        self.0.len() > 1
    }

    /// The shares of the targets in the surfaces that a pattern may be laid on, the most promising first: their mean,
    /// then each of them; the first alone where all are of one shape.
    pub fn patterns(&self) -> Vec<Vec<f64>> {
        let count = self.0.len();
        let alone = |k: usize| (0..count).map(|i| f64::from(u8::from(i == k))).collect();
        let Some((first, others)) = self.0.split_first() else {
            return Vec::new();
        };
        let size = {
            let (low, high) = first.surface.bounds();
            (high - low).norm()
        };
        let same = |other: &Target| {
            let laid = laid_over(&other.surface, &first.surface);
            let pairs = laid.iter().zip(first.surface.positions().iter());
            pairs
                .into_iter()
                .all(|(a, b)| (a - b).norm() <= SAME * size)
        };
        if others.iter().all(same) {
            return vec![alone(0)];
        }
        std::iter::once(vec![1.0 / count as f64; count])
            .chain((0..count).map(alone))
            .collect()
    }

    /// The surface in which every target has its share; one alone as it is, of several each laid over the first.
    ///
    /// # Errors
    /// [`MakeError::Shares`] for shares that do not fit the targets.
    pub fn mixed(&self, shares: &[f64]) -> Result<Surface, MakeError> {
        let wrong = || MakeError::Shares {
            shares: shares.to_vec(),
            surfaces: self.0.len(),
        };
        let sum: f64 = shares.iter().sum();
        let sound = shares.iter().all(|s| (0.0..=1.0).contains(s)) && (sum - 1.0).abs() < 1e-6;
        let first = self.0.first().ok_or_else(wrong)?;
        if !sound || shares.len() != self.0.len() {
            return Err(wrong());
        }
        if let Some(alone) = shares.iter().position(|&s| s == 1.0) {
            return Ok(self.0[alone].surface.clone());
        }
        let count = first.surface.positions().len();
        let mut sums = vec![Vector3::zeros(); count];
        for (target, &share) in self.0.iter().zip(shares) {
            let laid = laid_over(&target.surface, &first.surface);
            for (sum, p) in sums.iter_mut().zip(&laid) {
                *sum += p.coords * share;
            }
        }
        let (_, faces) = first.surface.to_arrays();
        Surface::new(sums.into_iter().map(Point3::from).collect(), faces)
            .map_err(|e| MakeError::Internal(format!("the mean of the surfaces: {e}")))
    }
}

/// The vertices of a surface, moved rigidly to where they are nearest to those of another one of the same mesh (Kabsch).
fn laid_over(surface: &Surface, onto: &Surface) -> Vec<Point3<f64>> {
    let (from, to) = (surface.positions(), onto.positions());
    let mean = |of: &Per<VertexId, Point3<f64>>| {
        of.iter().map(|p| p.coords).sum::<Vector3<f64>>() / of.len().max(1) as f64
    };
    let (middle, there) = (mean(from), mean(to));
    let covariance: Matrix3<f64> = from
        .iter()
        .zip(to.iter())
        .map(|(p, q)| (q.coords - there) * (p.coords - middle).transpose())
        .sum();
    let svd = covariance.svd(true, true);
    let turn = match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => {
            let mirrored = (u * v_t).determinant() < 0.0;
            // The weakest direction gives way, so that nothing is mirrored.
            let mut signs = Vector3::repeat(1.0);
            if mirrored {
                signs[svd.singular_values.imin()] = -1.0;
            }
            u * Matrix3::from_diagonal(&signs) * v_t
        }
        _ => Matrix3::identity(),
    };
    let turn = Rotation3::from_matrix_unchecked(turn);
    from.iter()
        .map(|p| Point3::from(there + turn * (p.coords - middle)))
        .collect()
}

/// Refuses a surface that is not the first one's mesh in another shape.
///
/// # Errors
/// [`MakeError::NoMatch`] with the first difference.
pub(crate) fn check_match(
    first: (&str, &Surface),
    other: (&str, &Surface),
) -> Result<(), MakeError> {
    let counts = |s: &Surface| [s.positions().len(), s.faces().len()];
    let (a, b) = (counts(first.1), counts(other.1));
    let words = |[v, f]: [usize; 2]| format!("{v} vertices and {f} faces");
    let difference = if a != b {
        format!("it has {}, {} has {}", words(b), first.0, words(a))
    } else {
        let mut pairs = first.1.faces().iter().zip(other.1.faces().iter());
        match pairs.position(|(f, g)| f != g) {
            None => return Ok(()),
            Some(face) => format!(
                "both have {}, but their faces differ from face {} on",
                words(a),
                face + 1
            ),
        }
    };
    Err(MakeError::NoMatch {
        first: first.0.to_owned(),
        other: other.0.to_owned(),
        difference,
    })
}

/// A shape of the surface `before`, with the vertices that were put into it in `after` (faces split, ids kept).
///
/// # Errors
/// [`MakeError::Internal`] only.
pub(crate) fn follow(
    shape: &Surface,
    before: &Surface,
    after: &Surface,
) -> Result<Surface, MakeError> {
    let (mut positions, _) = shape.to_arrays();
    if after.positions().len() == positions.len() {
        return Ok(shape.clone());
    }
    let closest = ClosestPoint::new(before);
    for vertex in after.positions().ids().skip(positions.len()) {
        let found = closest.query(after.position(vertex));
        let corners = shape.corners(found.face);
        let at = (0..3).map(|k| corners[k].coords * found.barycentric[k]);
        positions.push(Point3::from(at.sum::<Vector3<f64>>()));
    }
    let (_, faces) = after.to_arrays();
    Surface::new(positions, faces)
        .map_err(|e| MakeError::Internal(format!("a point in a further surface: {e}")))
}

/// A surface slit as another one of the same mesh is: its faces, with the copies of vertices that the slits made.
///
/// # Errors
/// [`MakeError::Internal`] only.
pub(crate) fn slit_like(shape: &Surface, slit: &Surface) -> Result<Surface, MakeError> {
    let mut positions = vec![Point3::origin(); slit.positions().len()];
    for (face, corners) in slit.faces().iter_ids() {
        for (v, p) in corners.iter().zip(shape.corners(face)) {
            positions[v.index()] = p;
        }
    }
    let (_, faces) = slit.to_arrays();
    Surface::new(positions, faces)
        .map_err(|e| MakeError::Internal(format!("a further surface, slit: {e}")))
}

/// A target as the map sees it: slit along the darts, with how much larger it is than the surface that is mapped.
#[derive(Debug)]
pub(crate) struct Shaped {
    /// The same mesh as the mapped surface.
    pub surface: Surface,
    /// ln of the factor by which lengths grow from there to here, at every vertex.
    pub log_factor: Per<VertexId, f64>,
}

impl Shaped {
    /// # Errors
    /// [`MakeError::Internal`] only.
    pub fn new(target: &Surface, mapped: &Surface) -> Result<Self, MakeError> {
        let surface = slit_like(target, mapped)?;
        let (from, to) = (areas(mapped), areas(&surface));
        // Areas of whole fans: single faces of a scan say little.
        let log_factor = from
            .iter()
            .zip(to.iter())
            .map(|(a, b)| 0.5 * (b.max(f64::MIN_POSITIVE) / a.max(f64::MIN_POSITIVE)).ln())
            .collect();
        Ok(Self {
            surface,
            log_factor,
        })
    }
}

/// Over all shapes; none if there is one only.
pub(crate) fn spread(shapes: &[Shaped]) -> Option<Spread> {
    let first = shapes.first().filter(|_| shapes.len() > 1)?;
    let factors: Vec<_> = shapes.iter().map(|s| s.log_factor.clone()).collect();
    Some(Spread::over(first.log_factor.len(), &factors))
}

/// Area of the faces around each vertex, mm².
fn areas(surface: &Surface) -> Per<VertexId, f64> {
    let mut areas = Per::<VertexId, f64>::filled(surface.positions().len(), 0.0);
    for (face, corners) in surface.faces().iter_ids() {
        let area = surface.face_area(face);
        corners.iter().for_each(|&v| areas[v] += area);
    }
    areas
}
