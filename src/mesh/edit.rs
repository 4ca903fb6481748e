//! Changing a surface where a design asks for it: a point made a vertex, because a cone can only stand at one, and slits.

use super::surface::{FaceId, HalfedgeId, Surface, TopologyError, VertexId};
use crate::base::ids::Id as _;

/// A vertex or side is taken instead of the point if it is nearer than this part of the side's length. Splitting
/// closer would leave slivers, whose angles are worth little to the conformal map; moving a cone by this much is far
/// below the size of a triangle of the linkage.
pub const NEAR: f64 = 0.1;

/// Why a point cannot be inserted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EditError {
    /// There is no such face.
    #[error("face {face} does not exist: the surface has {count}")]
    NoFace {
        /// As asked.
        face: FaceId,
        /// Faces that there are.
        count: usize,
    },
    /// The weights do not describe a point of the face.
    #[error(
        "{barycentric:?} is not a point of a face: three numbers, none negative, that sum to 1"
    )]
    NotInFace {
        /// As given.
        barycentric: [f64; 3],
    },
    /// The result is not a surface, which means that the input had degenerate faces.
    #[error("the face cannot be split there: {0}")]
    Topology(#[from] TopologyError),
    /// A slit that cuts a piece off.
    #[error(
        "slit there the surface falls into {parts} parts: a dart must end inside it, or at another rim"
    )]
    FallsApart {
        /// Parts that would be left.
        parts: usize,
    },
}

/// The surface cut open along the given edges: their two sides become rims. Faces keep their ids, and so does one copy
/// of every vertex; its other copies are appended, at the same place. A slit that begins at a rim makes that rim longer,
/// one inside the surface is a rim of its own. An edge on a rim is open already.
///
/// # Errors
/// [`EditError::FallsApart`] if the surface were no longer in one part.
pub fn slit(surface: &Surface, edges: &[HalfedgeId]) -> Result<Surface, EditError> {
    let mut open = vec![false; 3 * surface.faces().len()];
    for &h in edges {
        open[h.index()] = true;
        if let Some(twin) = surface.twin(h) {
            open[twin.index()] = true;
        }
    }
    let (mut positions, mut faces) = surface.to_arrays();
    for vertex in surface.positions().ids() {
        let fan: Vec<HalfedgeId> = surface.around(vertex).collect();
        let cuts = fan.iter().filter(|h| open[h.index()]).count();
        if cuts == 0 {
            continue;
        }
        // At a rim the fan begins on it; elsewhere begin behind a cut, so that no wedge is split by the start of the turn.
        let start = if surface.on_rim(vertex) {
            0
        } else {
            fan.iter().position(|h| open[h.index()]).unwrap_or(0)
        };
        let mut name = vertex.0;
        for i in 0..fan.len() {
            let h = fan[(start + i) % fan.len()];
            if i > 0 && open[h.index()] {
                name = positions.len() as u32;
                positions.push(surface.position(vertex));
            }
            faces[h.face().index()][h.corner()] = name;
        }
    }
    let slit = Surface::new(positions, faces)?;
    match slit.parts().len() {
        1 => Ok(slit),
        parts => Err(EditError::FallsApart { parts }),
    }
}

/// A surface that has a vertex at the point of `face` with these barycentric weights, and that vertex.
///
/// - Within [`NEAR`] times the shorter of the two sides at a corner, that corner is returned, nothing is changed.
/// - Within [`NEAR`] times its length of a side, the side is split where the point projects onto it, and the two
///   faces become four (on a rim: one becomes two).
/// - Otherwise the face is split into three around the point.
///
/// Vertices and faces keep their ids (a split face's id goes to one of its parts); new ones are appended.
///
/// # Errors
/// [`EditError`].
pub fn insert_point(
    surface: &Surface,
    face: FaceId,
    barycentric: [f64; 3],
) -> Result<(Surface, VertexId), EditError> {
    let count = surface.faces().len();
    if face.index() >= count {
        return Err(EditError::NoFace { face, count });
    }
    // Rounding of a barycentric computation, not a point outside.
    let tolerance = 1e-9;
    let sum: f64 = barycentric.iter().sum();
    let inside = barycentric.iter().all(|w| *w >= -tolerance) && (sum - 1.0).abs() <= tolerance;
    if !inside {
        return Err(EditError::NotInFace { barycentric });
    }
    let corners = surface.corners(face);
    let [a, b, c] = corners;
    let point = a + (b - a) * barycentric[1] + (c - a) * barycentric[2];
    let length = |k: usize| surface.length(HalfedgeId::side(face, k));

    let nearest = [0, 1, 2]
        .map(|k| ((point - corners[k]).norm(), k))
        .into_iter()
        .fold(
            (f64::INFINITY, 0),
            |best, d| if d.0 < best.0 { d } else { best },
        );
    let (distance, k) = nearest;
    if distance <= NEAR * length(k).min(length((k + 2) % 3)) {
        return Ok((surface.clone(), surface.faces()[face][k]));
    }

    let (mut positions, mut faces) = surface.to_arrays();
    let new = positions.len() as u32;
    let side = [0, 1, 2]
        .map(|k| {
            let (from, along) = (corners[k], corners[(k + 1) % 3] - corners[k]);
            let t = ((point - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            let foot = from + along * t;
            ((point - foot).norm() / along.norm(), k, foot)
        })
        .into_iter()
        .min_by(|x, y| x.0.total_cmp(&y.0));
    match side {
        Some((gap, k, foot)) if gap <= NEAR => {
            positions.push(foot);
            let halfedge = HalfedgeId::side(face, k);
            for h in [Some(halfedge), surface.twin(halfedge)]
                .into_iter()
                .flatten()
            {
                let (i, k) = (h.face().index(), h.corner());
                let (tail, head, top) = (faces[i][k], faces[i][(k + 1) % 3], faces[i][(k + 2) % 3]);
                faces[i] = [tail, new, top];
                faces.push([new, head, top]);
            }
        }
        _ => {
            positions.push(point);
            let [a, b, c] = faces[face.index()];
            faces[face.index()] = [a, b, new];
            faces.push([b, c, new]);
            faces.push([c, a, new]);
        }
    }
    Ok((Surface::new(positions, faces)?, VertexId(new)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Sample;

    fn surface(name: &str) -> Surface {
        Sample::parse(&format!("{name}:faces=400"))
            .unwrap()
            .generate()
            .unwrap()
    }

    /// V − E + F of a disk with `slits` inside is 1 − slits; faces stay as they were.
    #[test]
    fn a_slit_lengthens_its_rim_or_is_one_of_its_own() {
        let disk = surface("cap");
        let rim = disk.rims()[0].clone();
        // Straight in from the rim, over three edges.
        let spoke = |v: VertexId| disk.around(v).nth(1).unwrap();
        let mut path = vec![spoke(rim[0])];
        while path.len() < 3 {
            let here = disk.head(*path.last().unwrap());
            let fan: Vec<HalfedgeId> = disk.around(here).collect();
            let back = fan
                .iter()
                .position(|h| disk.twin(*h) == path.last().copied());
            path.push(fan[(back.unwrap() + fan.len() / 2) % fan.len()]);
        }
        let open = slit(&disk, &path).unwrap();
        assert_eq!((open.rims().len(), open.euler_characteristic()), (1, 1));
        assert_eq!(open.rims()[0].len(), rim.len() + 6);
        assert_eq!(open.positions().len(), disk.positions().len() + 3);
        let inner = slit(&disk, &path[1..]).unwrap();
        assert_eq!((inner.rims().len(), inner.euler_characteristic()), (2, 0));
        for (face, corners) in disk.faces().iter_ids() {
            assert_eq!(open.corners(face), corners.map(|v| disk.position(v)));
        }
        assert_eq!(slit(&disk, &[]).unwrap().to_arrays(), disk.to_arrays());
        let around: Vec<HalfedgeId> = disk
            .around(path.last().map(|h| disk.head(*h)).unwrap())
            .map(HalfedgeId::next)
            .collect();
        assert_eq!(
            slit(&disk, &around).unwrap_err(),
            EditError::FallsApart { parts: 2 }
        );
    }

    #[test]
    fn face_side_rim_and_corner() {
        let flat = surface("saddle");
        let third = [1.0 / 3.0; 3];
        let (split, v) = insert_point(&flat, FaceId(7), third).unwrap();
        assert_eq!(split.around(v).count(), 3);
        assert_eq!(split.faces().len(), flat.faces().len() + 2);

        let (split, v) = insert_point(&flat, FaceId(7), [0.5, 0.49, 0.01]).unwrap();
        assert_eq!(split.around(v).count(), 4);
        assert_eq!(split.faces().len(), flat.faces().len() + 2);

        let rim = flat.halfedges().find(|h| flat.twin(*h).is_none()).unwrap();
        let mut middle = [0.0; 3];
        middle[rim.corner()] = 0.5;
        middle[(rim.corner() + 1) % 3] = 0.5;
        let (split, v) = insert_point(&flat, rim.face(), middle).unwrap();
        assert!(split.on_rim(v));
        assert_eq!(split.faces().len(), flat.faces().len() + 1);
        assert_eq!(split.rims()[0].len(), flat.rims()[0].len() + 1);

        let (same, v) = insert_point(&flat, FaceId(7), [0.04, 0.95, 0.01]).unwrap();
        assert_eq!(v, flat.faces()[FaceId(7)][1]);
        assert_eq!(same.faces().len(), flat.faces().len());
    }

    #[test]
    fn what_is_no_point_of_a_face_is_refused() {
        let torus = surface("torus");
        for weights in [[0.5, 0.6, -0.1], [0.5, 0.6, 0.1], [f64::NAN, 0.5, 0.5]] {
            assert!(matches!(
                insert_point(&torus, FaceId(0), weights),
                Err(EditError::NotInFace { .. })
            ));
        }
        assert!(matches!(
            insert_point(&torus, FaceId(1 << 20), [1.0, 0.0, 0.0]),
            Err(EditError::NoFace { .. })
        ));
    }

    proptest! {
        #![proptest_config(crate::base::cases::cases(64))]
        #[test]
        fn topology_and_area_stay_and_the_vertex_is_near_the_point(
            which in 0usize..10, face in 0u32..300, s in 0.0..1.0f64, t in 0.0..1.0f64,
        ) {
            let before = surface(Sample::all()[which].name());
            let root = s.sqrt();
            let weights = [1.0 - root, root * (1.0 - t), root * t];
            let face = FaceId(face);
            let (after, v) = insert_point(&before, face, weights).unwrap();
            prop_assert_eq!(after.euler_characteristic(), before.euler_characteristic());
            prop_assert_eq!(after.rims().len(), before.rims().len());
            prop_assert!((after.area() / before.area() - 1.0).abs() < 1e-9);
            let [a, b, c] = before.corners(face);
            let point = a + (b - a) * weights[1] + (c - a) * weights[2];
            let longest = (0..3).map(|k| before.length(HalfedgeId::side(face, k))).fold(0.0, f64::max);
            prop_assert!((after.position(v) - point).norm() <= NEAR * longest * (1.0 + 1e-9));
        }
    }
}
