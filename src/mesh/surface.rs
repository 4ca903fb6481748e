//! An oriented manifold triangle mesh in millimetres: positions, faces and how they hang together.
//!
//! The topology is stored per *halfedge*: side `k` of face `f`, from its corner `k` to corner `k + 1`, faces
//! counter-clockwise seen from outside. A halfedge without a twin lies on a rim.

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};

use crate::base::ids::{Id, Per, typed_id};

typed_id!(
    /// A vertex of a [`Surface`].
    VertexId
);
typed_id!(
    /// A face of a [`Surface`].
    FaceId
);
typed_id!(
    /// A side of a face, `3 · face + k`: from the face's corner `k` to its corner `k + 1`.
    HalfedgeId
);

impl HalfedgeId {
    /// Side `k` (0, 1, 2) of `face`.
    #[inline]
    pub fn side(face: FaceId, k: usize) -> Self {
        Self(face.0 * 3 + k as u32)
    }
    /// The face that this is a side of.
    #[inline]
    pub fn face(self) -> FaceId {
        FaceId(self.0 / 3)
    }
    /// Which side of its face: 0, 1 or 2.
    #[inline]
    pub fn corner(self) -> usize {
        (self.0 % 3) as usize
    }
    /// The next side counter-clockwise in the same face.
    #[inline]
    pub fn next(self) -> Self {
        if self.0 % 3 == 2 {
            Self(self.0 - 2)
        } else {
            Self(self.0 + 1)
        }
    }
    /// The side before this one in the same face.
    #[inline]
    pub fn prev(self) -> Self {
        if self.0.is_multiple_of(3) {
            Self(self.0 + 2)
        } else {
            Self(self.0 - 1)
        }
    }
}

/// Why triangles do not form a [`Surface`]. Numbers count from 1, as in OBJ files.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TopologyError {
    /// There is no face.
    #[error("the mesh has no faces")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has a coordinate that is not a number")]
    NotFinite {
        /// The vertex.
        vertex: VertexId,
    },
    /// A face names a vertex that does not exist, or one vertex twice.
    #[error("face {face} is degenerate: it names a vertex twice, or one that does not exist")]
    BadFace {
        /// The face.
        face: FaceId,
    },
    /// An edge has more than two faces, or two that run along it in the same direction.
    #[error(
        "the edge between vertices {tail} and {head} has {count} faces on one side: the surface is not manifold or not oriented there (face {face})"
    )]
    NotManifoldEdge {
        /// One end.
        tail: VertexId,
        /// The other end.
        head: VertexId,
        /// Faces that run from `tail` to `head`; one at the most is right.
        count: usize,
        /// One of them.
        face: FaceId,
    },
    /// The faces around a vertex form more than one fan.
    #[error(
        "vertex {vertex} joins {fans} fans of faces that touch only there: the surface is not manifold"
    )]
    NotManifoldVertex {
        /// The vertex.
        vertex: VertexId,
        /// Number of fans.
        fans: usize,
    },
    /// No face uses the vertex.
    #[error("vertex {vertex} belongs to no face")]
    UnusedVertex {
        /// The vertex.
        vertex: VertexId,
    },
}

/// An oriented manifold triangle mesh, with or without rims, in millimetres. It may have several parts;
/// [`Surface::parts`] counts them.
#[derive(Clone, Debug)]
pub struct Surface {
    positions: Per<VertexId, Point3<f64>>,
    faces: Per<FaceId, [VertexId; 3]>,
    twins: Per<HalfedgeId, Option<HalfedgeId>>,
    /// For each vertex an outgoing halfedge; on a rim the one that has no twin, so that turning
    /// counter-clockwise from it meets every face of the fan.
    outgoing: Per<VertexId, HalfedgeId>,
    rims: Vec<Vec<VertexId>>,
}

impl Surface {
    /// Builds the topology and checks it: every edge one or two faces, consistently oriented; every vertex one fan.
    ///
    /// # Errors
    /// [`TopologyError`] with the first element that is wrong.
    pub fn new(positions: Vec<Point3<f64>>, faces: Vec<[u32; 3]>) -> Result<Self, TopologyError> {
        let count = positions.len();
        if faces.is_empty() {
            return Err(TopologyError::Empty);
        }
        for (i, p) in positions.iter().enumerate() {
            if !p.iter().all(|x| x.is_finite()) {
                return Err(TopologyError::NotFinite {
                    vertex: VertexId::from_index(i),
                });
            }
        }
        for (i, f) in faces.iter().enumerate() {
            if f.iter().any(|&v| v as usize >= count)
                || f[0] == f[1]
                || f[1] == f[2]
                || f[2] == f[0]
            {
                return Err(TopologyError::BadFace {
                    face: FaceId::from_index(i),
                });
            }
        }
        let faces: Per<FaceId, [VertexId; 3]> =
            faces.into_iter().map(|f| f.map(VertexId)).collect();
        let twins = pair_halfedges(&faces)?;
        let outgoing = choose_outgoing(count, &faces, &twins)?;
        let mut surface = Self {
            positions: Per::new(positions),
            faces,
            twins,
            outgoing,
            rims: Vec::new(),
        };
        surface.rims = surface.trace_rims();
        Ok(surface)
    }

    /// Vertex positions in millimetres.
    pub fn positions(&self) -> &Per<VertexId, Point3<f64>> {
        &self.positions
    }
    /// The three vertices of every face, counter-clockwise from outside.
    pub fn faces(&self) -> &Per<FaceId, [VertexId; 3]> {
        &self.faces
    }
    /// Position of a vertex.
    #[inline]
    pub fn position(&self, vertex: VertexId) -> Point3<f64> {
        self.positions[vertex]
    }
    /// The corners of a face.
    #[inline]
    pub fn corners(&self, face: FaceId) -> [Point3<f64>; 3] {
        self.faces[face].map(|v| self.positions[v])
    }
    /// The same edge seen from the other face; `None` on a rim.
    #[inline]
    pub fn twin(&self, halfedge: HalfedgeId) -> Option<HalfedgeId> {
        self.twins[halfedge]
    }
    /// Where a halfedge starts.
    #[inline]
    pub fn tail(&self, halfedge: HalfedgeId) -> VertexId {
        self.faces[halfedge.face()][halfedge.corner()]
    }
    /// Where a halfedge ends.
    #[inline]
    pub fn head(&self, halfedge: HalfedgeId) -> VertexId {
        self.faces[halfedge.face()][(halfedge.corner() + 1) % 3]
    }
    /// All halfedges.
    pub fn halfedges(&self) -> impl ExactSizeIterator<Item = HalfedgeId> + use<> {
        self.twins.ids()
    }
    /// One halfedge for each edge.
    pub fn edges(&self) -> impl Iterator<Item = HalfedgeId> + '_ {
        self.twins
            .iter_ids()
            .filter(|(h, t)| t.is_none_or(|t| *h < t))
            .map(|(h, _)| h)
    }
    /// Outgoing halfedges around a vertex, counter-clockwise; at a rim vertex starting with the one on the rim.
    /// (The last edge of a rim vertex, incoming along the rim, has no outgoing halfedge.)
    pub fn around(&self, vertex: VertexId) -> impl Iterator<Item = HalfedgeId> + '_ {
        let first = self.outgoing[vertex];
        let mut next = Some(first);
        std::iter::from_fn(move || {
            let here = next?;
            next = self.twin(here.prev()).filter(|h| *h != first);
            Some(here)
        })
    }
    /// True if the vertex lies on a rim.
    #[inline]
    pub fn on_rim(&self, vertex: VertexId) -> bool {
        self.twins[self.outgoing[vertex]].is_none()
    }
    /// The rims: closed loops of vertices, the surface on the left, each starting at its lowest vertex, the
    /// longest (by vertices) first.
    pub fn rims(&self) -> &[Vec<VertexId>] {
        &self.rims
    }
    /// Length of an edge in millimetres.
    #[inline]
    pub fn length(&self, halfedge: HalfedgeId) -> f64 {
        (self.position(self.head(halfedge)) - self.position(self.tail(halfedge))).norm()
    }
    /// Twice the area of a face times its outward unit normal.
    #[inline]
    pub fn face_normal_doubled(&self, face: FaceId) -> Vector3<f64> {
        let [a, b, c] = self.corners(face);
        (b - a).cross(&(c - a))
    }
    /// Area of a face in mm².
    pub fn face_area(&self, face: FaceId) -> f64 {
        0.5 * self.face_normal_doubled(face).norm()
    }
    /// Area of the surface in mm².
    pub fn area(&self) -> f64 {
        self.faces.ids().map(|f| self.face_area(f)).sum()
    }
    /// Unit normals at the vertices: face normals weighted by the corner's angle. Zero where every face is degenerate.
    pub fn vertex_normals(&self) -> Per<VertexId, Vector3<f64>> {
        let mut normals = Per::filled(self.positions.len(), Vector3::zeros());
        for (face, corners) in self.faces.iter_ids() {
            let Some(normal) = self.face_normal_doubled(face).try_normalize(0.0) else {
                continue;
            };
            for k in 0..3 {
                normals[corners[k]] += normal * self.corner_angle(HalfedgeId::side(face, k));
            }
        }
        for n in normals.iter_mut() {
            *n = n.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        }
        normals
    }
    /// How the surface is looked at from its front: the direction towards the eye (its mean normal) and up: +Y, or
    /// ∓Z where it faces up or down. Both unit vectors, not always perpendicular.
    pub fn front(&self) -> (Vector3<f64>, Vector3<f64>) {
        let sum: Vector3<f64> = self.faces.ids().map(|f| self.face_normal_doubled(f)).sum();
        let normal = sum
            .try_normalize(1e-12 * self.area())
            .unwrap_or_else(Vector3::z);
        let up = if normal.y.abs() > 0.9 {
            -Vector3::z() * normal.y.signum()
        } else {
            Vector3::y()
        };
        (normal, up)
    }
    /// Angle of a face at the tail of one of its halfedges, radians.
    #[inline]
    pub fn corner_angle(&self, halfedge: HalfedgeId) -> f64 {
        let (p, k) = (self.corners(halfedge.face()), halfedge.corner());
        let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
        u.cross(&v).norm().atan2(u.dot(&v))
    }
    /// Turning of a rim: its total geodesic curvature with the surface on the left, radians.
    pub fn rim_turning(&self, rim: &[VertexId]) -> f64 {
        let angle_sum = |v: VertexId| self.around(v).map(|h| self.corner_angle(h)).sum::<f64>();
        rim.iter().map(|&v| PI - angle_sum(v)).sum()
    }
    /// V − E + F.
    pub fn euler_characteristic(&self) -> i64 {
        self.positions.len() as i64 - self.edges().count() as i64 + self.faces.len() as i64
    }
    /// Handles of a connected surface: (2 − χ − rims) / 2.
    pub fn genus(&self) -> i64 {
        (2 - self.euler_characteristic() - self.rims.len() as i64) / 2
    }
    /// Connected parts as face lists, each in ascending order, in the order of their first face.
    pub fn parts(&self) -> Vec<Vec<FaceId>> {
        let mut part = Per::<FaceId, u32>::filled(self.faces.len(), u32::MAX);
        let mut parts: Vec<Vec<FaceId>> = Vec::new();
        for seed in self.faces.ids() {
            if part[seed] != u32::MAX {
                continue;
            }
            let label = parts.len() as u32;
            part[seed] = label;
            let mut members = vec![seed];
            let mut next = 0;
            while next < members.len() {
                for k in 0..3 {
                    if let Some(twin) = self.twin(HalfedgeId::side(members[next], k))
                        && part[twin.face()] == u32::MAX
                    {
                        part[twin.face()] = label;
                        members.push(twin.face());
                    }
                }
                next += 1;
            }
            members.sort_unstable();
            parts.push(members);
        }
        parts
    }
    /// The corners of the smallest box around the surface.
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        self.positions.iter().fold(
            (
                Point3::from([f64::INFINITY; 3]),
                Point3::from([f64::NEG_INFINITY; 3]),
            ),
            |(low, high), p| (low.inf(p), high.sup(p)),
        )
    }
    /// The same triangles with every position multiplied by `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        let mut surface = self.clone();
        surface
            .positions
            .iter_mut()
            .for_each(|p| p.coords *= factor);
        surface
    }
    /// Positions and faces as plain arrays, for building a changed surface.
    pub fn to_arrays(&self) -> (Vec<Point3<f64>>, Vec<[u32; 3]>) {
        (
            self.positions.to_vec(),
            self.faces.iter().map(|f| f.map(|v| v.0)).collect(),
        )
    }

    fn trace_rims(&self) -> Vec<Vec<VertexId>> {
        let mut seen = Per::<VertexId, bool>::filled(self.positions.len(), false);
        let mut rims = Vec::new();
        for start in self.positions.ids() {
            if seen[start] || !self.on_rim(start) {
                continue;
            }
            let (mut rim, mut here) = (Vec::new(), start);
            while !seen[here] {
                seen[here] = true;
                rim.push(here);
                here = self.head(self.outgoing[here]);
            }
            rims.push(rim);
        }
        rims.sort_by_key(|rim: &Vec<VertexId>| std::cmp::Reverse(rim.len()));
        rims
    }
}

fn pair_halfedges(
    faces: &Per<FaceId, [VertexId; 3]>,
) -> Result<Per<HalfedgeId, Option<HalfedgeId>>, TopologyError> {
    let ends = |h: HalfedgeId| {
        (
            faces[h.face()][h.corner()],
            faces[h.face()][(h.corner() + 1) % 3],
        )
    };
    let mut by_edge: Vec<(VertexId, VertexId, HalfedgeId)> = (0..faces.len() * 3)
        .map(|i| {
            let h = HalfedgeId::from_index(i);
            let (tail, head) = ends(h);
            (tail.min(head), tail.max(head), h)
        })
        .collect();
    by_edge.sort_unstable();
    let mut twins = Per::filled(faces.len() * 3, None);
    for group in by_edge.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        match *group {
            [_] => {}
            [(.., a), (.., b)] if ends(a).0 == ends(b).1 => {
                twins[a] = Some(b);
                twins[b] = Some(a);
            }
            _ => {
                let (tail, head) = ends(group[0].2);
                let count = group.iter().filter(|(.., h)| ends(*h).0 == tail).count();
                let (tail, head, count) = if count > 1 {
                    (tail, head, count)
                } else {
                    (head, tail, group.len() - count)
                };
                return Err(TopologyError::NotManifoldEdge {
                    tail,
                    head,
                    count,
                    face: group[0].2.face(),
                });
            }
        }
    }
    Ok(twins)
}

fn choose_outgoing(
    vertices: usize,
    faces: &Per<FaceId, [VertexId; 3]>,
    twins: &Per<HalfedgeId, Option<HalfedgeId>>,
) -> Result<Per<VertexId, HalfedgeId>, TopologyError> {
    let mut corners = Per::<VertexId, u32>::filled(vertices, 0);
    let mut outgoing = Per::<VertexId, Option<HalfedgeId>>::filled(vertices, None);
    let mut rim_starts = Per::<VertexId, u32>::filled(vertices, 0);
    for (h, twin) in twins.iter_ids() {
        let vertex = faces[h.face()][h.corner()];
        corners[vertex] += 1;
        if twin.is_none() {
            rim_starts[vertex] += 1;
            outgoing[vertex] = Some(h);
        } else if outgoing[vertex].is_none() {
            outgoing[vertex] = Some(h);
        }
    }
    let mut chosen = Vec::with_capacity(vertices);
    for (vertex, first) in outgoing.iter_ids() {
        let first = first.ok_or(TopologyError::UnusedVertex { vertex })?;
        let (mut here, mut met) = (Some(first), 0);
        while let Some(h) = here {
            met += 1;
            here = twins[h.prev()].filter(|next| *next != first && met <= corners[vertex]);
        }
        if met != corners[vertex] || rim_starts[vertex] > 1 {
            let fans = rim_starts[vertex].max(2) as usize;
            return Err(TopologyError::NotManifoldVertex { vertex, fans });
        }
        chosen.push(first);
    }
    Ok(Per::new(chosen))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[[f64; 3]]) -> Vec<Point3<f64>> {
        list.iter().map(|&p| Point3::from(p)).collect()
    }

    fn tetrahedron() -> (Vec<Point3<f64>>, Vec<[u32; 3]>) {
        let p = points(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]]);
        (p, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    }

    #[test]
    fn a_closed_surface_has_no_rim_and_an_open_one_has_its_rim_on_the_left() {
        let (p, mut f) = tetrahedron();
        let closed = Surface::new(p.clone(), f.clone()).unwrap();
        assert_eq!(
            (
                closed.rims().len(),
                closed.euler_characteristic(),
                closed.genus()
            ),
            (0, 2, 0)
        );
        f.pop();
        let open = Surface::new(p, f).unwrap();
        assert_eq!(open.euler_characteristic(), 1);
        let rim: Vec<u32> = open.rims()[0].iter().map(|v| v.0).collect();
        // The missing face is 2 → 0 → 3; seen from the remaining faces its edges run the other way.
        assert_eq!(rim, [0, 2, 3]);
        for v in open.positions().ids() {
            let fan: Vec<_> = open.around(v).collect();
            assert!(fan.iter().all(|h| open.tail(*h) == v));
            assert_eq!(fan.len(), if v.0 == 1 { 3 } else { 2 });
        }
    }

    #[test]
    fn an_annulus_has_genus_zero_and_a_torus_one() {
        let grid = |rows: u32, closed: bool| {
            let n = 6u32;
            let vertices = (0..rows * n)
                .map(|i| Point3::new(i as f64, (i * i) as f64, 0.3 * i as f64))
                .collect();
            let mut faces = Vec::new();
            for i in 0..if closed { rows } else { rows - 1 } {
                for j in 0..n {
                    let at = |i: u32, j: u32| (i % rows) * n + j % n;
                    faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                    faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
            Surface::new(vertices, faces).unwrap()
        };
        let annulus = grid(3, false);
        assert_eq!((annulus.rims().len(), annulus.genus()), (2, 0));
        let torus = grid(5, true);
        assert_eq!((torus.rims().len(), torus.genus()), (0, 1));
        assert_eq!(torus.parts().len(), 1);
    }

    #[test]
    fn what_is_not_a_surface_is_refused_with_the_place() {
        let (p, f) = tetrahedron();
        let mut flipped = f.clone();
        flipped[3].swap(0, 1);
        assert!(matches!(
            Surface::new(p.clone(), flipped),
            Err(TopologyError::NotManifoldEdge { .. })
        ));
        let mut three = f.clone();
        three.push([0, 1, 2]);
        assert!(matches!(
            Surface::new(p.clone(), three),
            Err(TopologyError::NotManifoldEdge { .. })
        ));
        let mut nan = p.clone();
        nan[2].y = f64::NAN;
        assert_eq!(
            Surface::new(nan, f.clone()).unwrap_err(),
            TopologyError::NotFinite {
                vertex: VertexId(2)
            }
        );
        assert_eq!(
            Surface::new(p.clone(), vec![[0, 0, 1]]).unwrap_err(),
            TopologyError::BadFace { face: FaceId(0) }
        );
        assert_eq!(
            Surface::new(p.clone(), vec![]).unwrap_err(),
            TopologyError::Empty
        );
        // Two triangles that touch in one point only.
        let bow = points(&[
            [0., 0., 0.],
            [1., 0., 0.],
            [1., 1., 0.],
            [-1., 0., 0.],
            [-1., -1., 0.],
        ]);
        let error = Surface::new(bow, vec![[0, 1, 2], [0, 3, 4]]).unwrap_err();
        assert_eq!(
            error,
            TopologyError::NotManifoldVertex {
                vertex: VertexId(0),
                fans: 2
            }
        );
    }
}
