//! What the seam is told about the surface: where it would be seen, and which paths a person wants it to follow.
//!
//! The seam is a line of glue or stitches. Where the holonomy leaves it free it runs over the back and the underside and
//! through valleys: an edge of the lattice costs 1, more where it looks to the front, and more on a ridge than in a
//! valley. Near a path that was asked for it costs a tenth of what it costs elsewhere, whatever it looks like there: the
//! seam then makes any reasonable detour to run along the path, and still reaches every cone and rim that it must.
//! Everything is measured on the surface at the scale of the lattice, so that the roughness of a scan does not count.

use nalgebra::{Point2, Point3, Vector3};

use super::clip::{self, Laid};
use crate::base::ids::Per;
use crate::conformal::{ConformalError, Layout, Stretch, from_vertices, straight_way};
use crate::mesh::{FaceId, Surface, VertexId};

/// What an edge costs more, in edges, where the surface looks straight to the front. Measured on eight scans at 2500
/// triangles: 2 makes no seam more than 1.13 times as long, and takes up to three quarters off what is seen of it; with
/// 4 one of them gets 1.6 times as long.
const SEEN: f64 = 2.0;
/// What an edge costs more, in edges, on a sharp ridge than in a sharp valley. Enough to decide between ways of much
/// the same length, little enough that it never decides against the front.
const RIDGE: f64 = 0.5;
/// Angle between the normals of an edge's two triangles from which on it counts as sharp, radians: a cylinder of 1.4 L
/// radius, much more than the surface bends in most places at a useful size of triangles.
const SHARP: f64 = 0.4;
/// How many times as much an edge costs away from the paths that were asked for. The seam leaves a path for a way that
/// is so many times shorter.
const AWAY: f64 = 10.0;
/// Farther than this from a path, in L, its exact distance does not matter: the price rises from one L to two.
const NEAR: f64 = 3.0;

/// Steers the choice of the seam; see [`super::build_without`].
#[derive(Clone, Debug)]
pub struct SeamGuide {
    /// Towards the eye.
    front: Vector3<f64>,
    /// The paths, stretch by stretch.
    paths: Vec<Stretch>,
    /// About how far from the nearest path the corners of every face are, millimetres; 0 where one passes through it.
    off_path: Per<FaceId, [f64; 3]>,
}

impl SeamGuide {
    /// The seam keeps off the front of the surface, [`Surface::front`], and off ridges.
    pub fn new(surface: &Surface) -> Self {
        Self::facing(surface.front().0)
    }

    /// As [`SeamGuide::new`], looked at from the direction `front`, a unit vector; zero if no side is the front.
    pub fn facing(front: Vector3<f64>) -> Self {
        Self {
            front,
            paths: Vec::new(),
            off_path: Per::filled(0, [0.0; 3]),
        }
    }

    /// The seam follows these paths too: vertices of `surface`, each path joined by straight ways over the surface. The
    /// surface that is built on may be this one slit along darts.
    ///
    /// # Errors
    /// [`ConformalError::NoSuchVertex`], [`ConformalError::DartTooShort`] where no way leads on.
    pub fn along(
        mut self,
        surface: &Surface,
        paths: &[Vec<VertexId>],
    ) -> Result<Self, ConformalError> {
        for pair in paths.iter().flat_map(|stops| stops.windows(2)) {
            if pair[0] != pair[1] {
                self.paths.extend(straight_way(surface, pair[0], pair[1])?);
            }
        }
        if self.paths.is_empty() {
            return Ok(self);
        }
        let near = self.paths.iter().flat_map(|stretch| {
            let corners = surface.faces()[stretch.face];
            corners.map(|v| (v, stretch.distance_mm(surface.position(v))))
        });
        let distance = from_vertices(surface, near);
        let corners = surface.faces().iter().map(|v| v.map(|v| distance[v]));
        self.off_path = corners.collect();
        for stretch in &self.paths {
            self.off_path[stretch.face] = [0.0; 3];
        }
        Ok(self)
    }

    /// How far a point of a face is from the nearest path, millimetres; exact as far as the price depends on it. The
    /// straight distance alone would take the other side of a thin wall for near.
    fn off_path_mm(&self, face: FaceId, weights: [f64; 3], at: &Point3<f64>, edge_mm: f64) -> f64 {
        let about: f64 = (0..3).map(|k| self.off_path[face][k] * weights[k]).sum();
        if about > NEAR * edge_mm {
            return about;
        }
        let stretches = self.paths.iter().map(|stretch| stretch.distance_mm(*at));
        stretches.fold(f64::INFINITY, f64::min)
    }

    /// Price of every side of the triangles, for [`super::seam::Price`].
    pub(super) fn prices(
        &self,
        surface: &Surface,
        layout: &Layout,
        laid: &[Laid],
        edge_mm: f64,
    ) -> Vec<[f64; 3]> {
        let walker = clip::walker(surface, layout, edge_mm);
        // The middles of the sides on the surface, and how far they are from a path.
        let middles: Vec<[(Point3<f64>, f64); 3]> = laid
            .iter()
            .map(|l| {
                let c = &l.corners;
                let centre = Point2::from((c[0].coords + c[1].coords + c[2].coords) / 3.0);
                [0, 1, 2].map(|side| {
                    let middle = nalgebra::center(&c[side], &c[(side + 1) % 3]);
                    let (face, weights) = match walker.walk(l.face, centre, middle) {
                        Some(end) => (
                            end.face,
                            walker.barycentric(end.face, end.motion.apply(middle)),
                        ),
                        // A notch in the rim bars the way.
                        None => (l.face, l.barycentric),
                    };
                    let p = surface.corners(face);
                    let at: Vector3<f64> = (0..3).map(|k| p[k].coords * weights[k]).sum();
                    let at = Point3::from(at);
                    let off = if self.paths.is_empty() {
                        0.0
                    } else {
                        self.off_path_mm(face, weights, &at, edge_mm)
                    };
                    (at, off)
                })
            })
            .collect();
        let normal = |t: usize| {
            let [a, b, c] = middles[t].map(|m| m.0);
            (b - a)
                .cross(&(c - a))
                .try_normalize(0.0)
                .unwrap_or_else(Vector3::zeros)
        };
        let centre = |t: usize| {
            let [a, b, c] = middles[t].map(|m| m.0.coords);
            (a + b + c) / 3.0
        };
        (0..laid.len())
            .map(|t| {
                std::array::from_fn(|side| {
                    let Some((other, _)) = laid[t].neighbours[side] else {
                        return 1.0;
                    };
                    let (here, there) = (normal(t), normal(other));
                    let across = (centre(other) - centre(t))
                        .try_normalize(0.0)
                        .unwrap_or_else(Vector3::zeros);
                    let bend = (there - here).dot(&across);
                    let facing = ((here + there) * 0.5).dot(&self.front).max(0.0);
                    let ridge = (0.5 + 0.5 * bend / SHARP).clamp(0.0, 1.0);
                    let look = 1.0 + SEEN * facing + RIDGE * ridge;
                    if self.paths.is_empty() {
                        return look;
                    }
                    let away = (middles[t][side].1 / edge_mm - 1.0).clamp(0.0, 1.0);
                    (1.0 - away) + away * AWAY * look
                })
            })
            .collect()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::{Built, Handedness, LinkageOptions, Without, build_without, fit};
    use super::*;
    use crate::base::progress::Silent;
    use crate::conformal::{FlattenOptions, Flattened, MetricSolver, Singularities, Sizing};
    use crate::mesh::Sample;

    /// A vase flattened as a tube, for a seam from rim to rim that may be anywhere.
    pub(crate) fn vase() -> (Surface, Layout, LinkageOptions) {
        let surface = Sample::parse("vase:faces=4000").unwrap();
        let surface = surface.generate().unwrap();
        let options = FlattenOptions {
            sigma: 2.0,
            sizing: Sizing::Triangles(800.0),
            cone_clearance: 0.7,
        };
        let tube = Singularities {
            turnings: vec![0],
            ..Singularities::default()
        };
        let mut solver = MetricSolver::new(&surface).unwrap();
        let flat = Flattened::solve(&mut solver, &tube, &options, &Silent).unwrap();
        let fitted = fit(&surface, &flat.layout, flat.edge_mm, false, None, &Silent).unwrap();
        let lattice = LinkageOptions {
            edge_mm: fitted.edge_mm,
            orientation: fitted.orientation_deg.to_radians(),
            handedness: Handedness::Right,
            remove_at_cone: 0,
            sigma: 2.0,
        };
        (surface, fitted.layout, lattice)
    }

    /// The middles of the edges of the seam, in space.
    fn seam(built: &Built) -> Vec<Vector3<f64>> {
        let triangles = &built.linkage.triangles;
        let middle = |t| -> Vector3<f64> {
            let corners = triangles[t].points.iter();
            corners
                .map(|p| built.start[p.0 as usize].coords / 3.0)
                .sum()
        };
        let hinges = built.linkage.hinges.iter().filter(|h| h.seam);
        hinges
            .map(|h| (middle(h.ccw.triangle) + middle(h.cw.triangle)) / 2.0)
            .collect()
    }

    #[test]
    fn the_seam_of_a_vase_is_behind_it_from_wherever_one_looks() {
        let (surface, layout, lattice) = vase();
        let build = |guide: &SeamGuide| {
            build_without(
                &surface,
                &layout,
                &lattice,
                &Without::nothing(guide),
                &Silent,
            )
            .unwrap()
        };
        let shortest = build(&SeamGuide::facing(Vector3::zeros())).seam_edges;
        for deg in [10.0f64, 130.0, 250.0] {
            let (sin, cos) = deg.to_radians().sin_cos();
            let front = Vector3::new(cos, sin, 0.0);
            let built = build(&SeamGuide::facing(front));
            let seam = seam(&built);
            assert!(built.seam_edges > 10 && seam.len() == built.seam_edges);
            assert!(seam.iter().all(|p| p.dot(&front) < 0.0), "{deg}°");
            // A turned body is as high on every side.
            assert_eq!(built.seam_edges, shortest, "{deg}°");
        }
    }

    #[test]
    fn the_seam_of_a_vase_follows_a_cut_on_any_side() {
        let (surface, layout, lattice) = vase();
        let (low, high) = surface.bounds();
        for deg in [0.0f64, 97.0, 215.0] {
            let (sin, cos) = deg.to_radians().sin_cos();
            let side = Vector3::new(cos, sin, 0.0);
            let ends = [low.z, high.z].map(|z| {
                let far = |v: &VertexId| {
                    let p = surface.position(*v);
                    (p.z - z).abs() * 1e3 + (side * p.coords.xy().norm() - p.coords).xy().norm()
                };
                let all = surface.positions().ids();
                all.min_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
            });
            // In full view: what a person asks for counts more.
            let guide = SeamGuide::facing(side)
                .along(&surface, &[ends.to_vec()])
                .unwrap();
            let built = build_without(
                &surface,
                &layout,
                &lattice,
                &Without::nothing(&guide),
                &Silent,
            )
            .unwrap();
            let seam = seam(&built);
            assert!(seam.len() > 10);
            for p in seam {
                let angle = (cos * p.y - sin * p.x).atan2(cos * p.x + sin * p.y);
                let off = p.xy().norm() * angle.abs();
                assert!(off < 2.0 * lattice.edge_mm, "{deg}°: {off} mm at {p:?}");
            }
        }
    }

    #[test]
    fn a_path_that_no_seam_needs_makes_none() {
        let surface = Sample::parse("cap:half_angle_deg=50,faces=1000").unwrap();
        let surface = surface.generate().unwrap();
        let options = FlattenOptions {
            sigma: 2.0,
            sizing: Sizing::Triangles(200.0),
            cone_clearance: 0.7,
        };
        let mut solver = MetricSolver::new(&surface).unwrap();
        let none = Singularities::default();
        let flat = Flattened::solve(&mut solver, &none, &options, &Silent).unwrap();
        let lattice = LinkageOptions {
            edge_mm: flat.edge_mm,
            orientation: 0.0,
            handedness: Handedness::Right,
            remove_at_cone: 0,
            sigma: 2.0,
        };
        let path = vec![VertexId(0), surface.rims()[0][0]];
        let guide = SeamGuide::new(&surface).along(&surface, &[path]).unwrap();
        let built = build_without(
            &surface,
            &flat.layout,
            &lattice,
            &Without::nothing(&guide),
            &Silent,
        )
        .unwrap();
        assert_eq!((built.seam_edges, built.pieces), (0, 1));
    }
}
