//! The surfaces that one pattern is to fit, and the one that it is laid on.
//!
//! Several targets are one mesh in several shapes (paper, Fig. 4): the same faces, other positions. So every place of one
//! is a place of all, and a pattern that is laid on one, or on a mean of them, has a start on each.

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

    /// Refuses surfaces so far apart in size that no sheet takes both shapes.
    ///
    /// # Errors
    /// [`MakeError::SizesApart`].
    pub fn check_sizes(&self, sigma: f64) -> Result<(), MakeError> {
        for (i, a) in self.0.iter().enumerate() {
            for b in &self.0[i + 1..] {
                let factor = middle_factor(&a.surface, &b.surface);
                let (larger, smaller) = if factor < 1.0 { (a, b) } else { (b, a) };
                let factor = factor.max(1.0 / factor);
                if factor > sigma {
                    return Err(MakeError::SizesApart {
                        larger: larger.name.clone(),
                        smaller: smaller.name.clone(),
                        factor,
                        sigma,
                    });
                }
            }
        }
        Ok(())
    }

    /// The shares of the targets in the surfaces that a pattern may be laid on: their mean, then each of them; the first
    /// alone where all are of one shape.
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

/// The factor by which lengths grow from one surface to another of the same mesh, on half of the area more.
fn middle_factor(from: &Surface, to: &Surface) -> f64 {
    let mut factors: Vec<(f64, f64)> = from
        .faces()
        .ids()
        .map(|face| {
            let (a, b) = (from.face_area(face), to.face_area(face));
            let (a, b) = (a.max(f64::MIN_POSITIVE), b.max(f64::MIN_POSITIVE));
            ((b / a).sqrt(), (a * b).sqrt())
        })
        .collect();
    factors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * factors.iter().map(|f| f.1).sum::<f64>();
    let mut sum = 0.0;
    let middle = factors.iter().find(|f| {
        sum += f.1;
        sum >= half
    });
    middle.map_or(1.0, |f| f.0)
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

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;
    use crate::base::progress::Silent;
    use crate::conformal::{FlattenOptions, Flattened, MetricSolver, Singularities, Sizing};
    use crate::mesh::{FaceId, Sample, insert_point};

    fn cap() -> Surface {
        Sample::parse("cap:faces=400").unwrap().generate().unwrap()
    }

    fn moved(surface: &Surface, how: impl Fn(Point3<f64>) -> Point3<f64>) -> Surface {
        let (positions, faces) = surface.to_arrays();
        Surface::new(positions.into_iter().map(how).collect(), faces).unwrap()
    }

    fn targets(surfaces: &[&Surface]) -> Targets {
        let target = |s: &&Surface| Target::new("s".into(), (*s).clone());
        Targets(surfaces.iter().map(target).collect())
    }

    proptest! {
        /// Where two shapes are congruent their mean is the shape, wherever they lie, and there is one pattern to try.
        #[test]
        fn the_mean_of_congruent_surfaces_is_congruent(
            turn in proptest::array::uniform3(-3.0..3.0f64),
            shift in proptest::array::uniform3(-500.0..500.0f64),
            share in 0.1..0.9f64,
        ) {
            let cap = cap();
            let turn = Rotation3::new(turn.into());
            let other = moved(&cap, |p| turn * p + Vector3::from(shift));
            let both = targets(&[&cap, &other]);
            let mean = both.mixed(&[share, 1.0 - share]).unwrap();
            for (a, b) in mean.positions().iter().zip(cap.positions().iter()) {
                prop_assert!((a - b).norm() < 1e-9);
            }
            prop_assert_eq!(both.patterns(), vec![vec![1.0, 0.0]]);
        }

        /// The mean of two sizes is the size between; a mirror image is not taken for the shape itself.
        #[test]
        fn sizes_are_mixed_and_mirror_images_are_other_shapes(factor in 0.5..2.0f64) {
            let cap = cap();
            let larger = moved(&cap, |p| p * factor);
            let mean = targets(&[&cap, &larger]).mixed(&[0.5, 0.5]).unwrap();
            let wanted = 0.25 * (1.0 + factor) * (1.0 + factor);
            prop_assert!((mean.area() / cap.area() / wanted - 1.0).abs() < 1e-9);
            let shaped = Shaped::new(&larger, &cap).unwrap();
            for log in shaped.log_factor.iter() {
                prop_assert!((log - factor.ln()).abs() < 1e-9);
            }
            let lopsided = moved(&cap, |p| Point3::new(p.x + 0.3 * p.y, p.y, p.z + 0.1 * p.x));
            let mirrored = moved(&lopsided, |p| Point3::new(-p.x, p.y, p.z));
            prop_assert_eq!(targets(&[&lopsided, &mirrored]).patterns().len(), 3);
        }

        /// λ of every shape lies in [1, σ] wherever σ has room for all of them, and the sheet is as large as it may be.
        #[test]
        fn the_window_holds_for_all_shapes(factors in proptest::array::uniform2(0.7..1.1f64)) {
            let cap = cap();
            let shapes: Vec<Shaped> = factors
                .iter()
                .map(|f| Shaped::new(&moved(&cap, |p| p * *f), &cap).unwrap())
                .collect();
            let mut solver = MetricSolver::new(&cap).unwrap().among(spread(&shapes));
            let options = FlattenOptions {
                sigma: 2.0,
                sizing: Sizing::EdgeMm(10.0),
                cone_clearance: 0.7,
            };
            let none = Singularities::none(&cap);
            let flat = Flattened::solve(&mut solver, &none, &options, &Silent).unwrap();
            let own = flat.layout.log_scale.iter().map(|x| x.exp());
            let least = own.clone().fold(f64::INFINITY, f64::min);
            let most = own.fold(0.0, f64::max);
            let [small, large] = [factors[0].min(factors[1]), factors[0].max(factors[1])];
            prop_assume!(most * large / (least * small) < 1.9);
            prop_assert!((least * small / flat.floor - 1.0).abs() < 1e-9);
            prop_assert!((flat.scale.min / (least * small) - 1.0).abs() < 1e-9);
            prop_assert!((flat.scale.max / (most * large) - 1.0).abs() < 1e-9);
            prop_assert!(flat.scale.max <= 2.0 && flat.scale.inside == 1.0);
        }

        /// A point put into one shape is put into the others at the same weights of the same face.
        #[test]
        fn inserted_points_follow(face in 0u32..300, a in 0.2..0.4f64, b in 0.2..0.4f64) {
            let cap = cap();
            let shape = moved(&cap, |p| Point3::new(1.3 * p.x, p.y, 0.5 * p.z));
            let weights = [a, b, 1.0 - a - b];
            let (after, vertex) = insert_point(&cap, FaceId(face), weights).unwrap();
            prop_assume!(after.positions().len() > cap.positions().len());
            let followed = follow(&shape, &cap, &after).unwrap();
            prop_assert_eq!(followed.faces(), after.faces());
            // The change of shape is linear, so the image of the point is known.
            let p = after.position(vertex);
            let image = Point3::new(1.3 * p.x, p.y, 0.5 * p.z);
            prop_assert!((followed.position(vertex) - image).norm() < 1e-9);
        }
    }

    #[test]
    fn shares_that_do_not_fit_are_refused() {
        let cap = cap();
        let both = targets(&[&cap, &moved(&cap, |p| p * 1.5)]);
        for shares in [&[1.0][..], &[0.5, 0.6], &[1.5, -0.5], &[f64::NAN, 1.0], &[]] {
            assert!(matches!(both.mixed(shares), Err(MakeError::Shares { .. })));
        }
        assert!(both.check_sizes(1.6).is_ok());
        assert!(matches!(
            both.check_sizes(1.4),
            Err(MakeError::SizesApart { factor, .. }) if (factor - 1.5).abs() < 1e-9
        ));
    }
}
