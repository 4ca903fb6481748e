//! The opened lift: every rigid triangle at its place on the surface, turned as far as λ asks.
//!
//! At scale λ the directions from a hinge to its two centroids make the angle γ = 2 asin(λ/2): 60° closed, 180° open.
//! So each triangle turns by α = asin(λ/2) − 30°, one colour clockwise and the other counter-clockwise. A start that is
//! opened already is what keeps the solver out of the folded minima that a start with closed slits falls into.

use std::f64::consts::PI;

use nalgebra::{Point2, Point3, Vector3};

use super::clip::Laid;
use super::{Handedness, Linkage};
use crate::base::ids::Per;
use crate::conformal::Layout;
use crate::mesh::{Surface, VertexId};

/// The angle by which a triangle turns at scale factor `scale` (clipped to [1, 2]), radians: asin(λ/2) − 30°.
pub fn opening_turn(scale: f64) -> f64 {
    (0.5 * scale.clamp(1.0, 2.0)).asin() - PI / 6.0
}

/// Starting positions of all points, millimetres: each hinge is the mean of where its two triangles want it.
pub(crate) fn lift(
    surface: &Surface,
    layout: &Layout,
    laid: &[Laid],
    linkage: &Linkage,
    sigma: f64,
) -> Vec<Point3<f64>> {
    let normals = surface.vertex_normals();
    let mut sum = vec![Vector3::zeros(); linkage.point_count()];
    let mut count = vec![0.0f64; linkage.point_count()];
    for (triangle, place) in linkage.triangles.iter().zip(laid) {
        let turn = opening_turn(
            layout
                .scale_at(surface, place.face, place.barycentric)
                .min(sigma),
        );
        let angle = turn * linkage.handedness.opening_sense(place.colour);
        for (point, at) in triangle.points.iter().zip(raised(
            surface,
            layout,
            &normals,
            place,
            angle,
            linkage.edge_mm,
        )) {
            sum[point.0 as usize] += at.coords;
            count[point.0 as usize] += 1.0;
        }
    }
    sum.into_iter()
        .zip(count)
        .map(|(s, n)| Point3::from(s / n.max(1.0)))
        .collect()
}

/// The corners of one rigid triangle in the tangent plane at its centroid.
fn raised(
    surface: &Surface,
    layout: &Layout,
    normals: &Per<VertexId, Vector3<f64>>,
    place: &Laid,
    angle: f64,
    edge_mm: f64,
) -> [Point3<f64>; 3] {
    let v = surface.faces()[place.face];
    let p = surface.corners(place.face);
    // Discretely conformal triangles are projective images of each other (circumcircles to circumcircles): weights
    // e^{−ln λ} make the lifted lattice smoother than linear interpolation does.
    let mut weights: [f64; 3] =
        std::array::from_fn(|k| place.barycentric[k] * (-layout.log_scale[v[k]]).exp());
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= total);
    let centre = Point3::from(
        (0..3)
            .map(|k| p[k].coords * weights[k])
            .sum::<Vector3<f64>>(),
    );
    let normal = (0..3)
        .map(|k| normals[v[k]] * place.barycentric[k])
        .sum::<Vector3<f64>>();
    let normal = normal
        .try_normalize(1e-9)
        .or_else(|| surface.face_normal_doubled(place.face).try_normalize(0.0))
        .unwrap_or_else(Vector3::z);
    let flat_centre =
        (place.corners[0].coords + place.corners[1].coords + place.corners[2].coords) / 3.0;
    let ahead = push(
        layout.corners[place.face],
        p,
        place.corners[0].coords - flat_centre,
    );
    let ahead = (ahead - normal * normal.dot(&ahead))
        .try_normalize(0.0)
        .unwrap_or_else(|| {
            let any = if normal.x.abs() < 0.9 {
                Vector3::x()
            } else {
                Vector3::y()
            };
            normal.cross(&any).normalize()
        });
    let left = normal.cross(&ahead);
    let radius = edge_mm / 3f64.sqrt();
    std::array::from_fn(|k| {
        let (sin, cos) = (angle + k as f64 * 2.0 * PI / 3.0).sin_cos();
        centre + (ahead * cos + left * sin) * radius
    })
}

/// Image of a flat direction under the linear map of one face.
fn push(
    flat: [Point2<f64>; 3],
    p: [Point3<f64>; 3],
    direction: nalgebra::Vector2<f64>,
) -> Vector3<f64> {
    let (e1, e2) = (flat[1] - flat[0], flat[2] - flat[0]);
    let det = e1.perp(&e2);
    let (s, t) = (direction.perp(&e2) / det, e1.perp(&direction) / det);
    (p[1] - p[0]) * s + (p[2] - p[0]) * t
}

impl Handedness {
    /// Which way a triangle turns when the linkage opens: +1 if triangles of this colour turn counter-clockwise (seen from outside) as the linkage opens, −1 otherwise.
    pub fn opening_sense(self, colour: super::Colour) -> f64 {
        if self.counter_clockwise(colour) {
            -1.0
        } else {
            1.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// In the plane a uniform scale is an exact motion of the linkage: the two triangles of every hinge agree
        /// where it is. A wrong angle or sense would tear them apart.
        #[test]
        fn a_flat_linkage_opens_exactly(scale in 1.0..2.0f64, left: bool, radius in 1i32..5) {
            let handedness = if left { Handedness::Left } else { Handedness::Right };
            let linkage = Linkage::patch(3.0, handedness, &Linkage::hexagon_cells(radius));
            let corner = |c: super::super::Corner| {
                let t = &linkage.triangles[c.triangle];
                let centre = (t.flat[0].coords + t.flat[1].coords + t.flat[2].coords) / 3.0;
                let turn = opening_turn(scale) * handedness.opening_sense(t.colour);
                centre * scale + nalgebra::Rotation2::new(turn) * (t.flat[c.corner].coords - centre)
            };
            for hinge in &linkage.hinges {
                prop_assert!((corner(hinge.ccw) - corner(hinge.cw)).norm() < 1e-12 * 3.0 * 10.0);
            }
        }
    }

    #[test]
    fn closed_does_not_turn_and_open_turns_by_sixty_degrees() {
        assert_eq!(opening_turn(1.0), 0.5f64.asin() - PI / 6.0);
        assert!(opening_turn(1.0).abs() < 1e-15);
        assert!((opening_turn(2.0) - PI / 3.0).abs() < 1e-15);
        assert_eq!(opening_turn(0.3), opening_turn(1.0));
    }
}
