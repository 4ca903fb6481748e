//! What a surface is like: the figures that `kagome inspect` prints.

use serde::Serialize;

use super::surface::{FaceId, HalfedgeId, Surface, VertexId};
use crate::base::ids::Per;

/// Figures of a surface. Lengths are millimetres; angles are degrees, as they are for people to read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of edges.
    pub edges: usize,
    /// Number of faces.
    pub faces: usize,
    /// Connected parts.
    pub parts: usize,
    /// Handles, if there is one part.
    pub genus: Option<i64>,
    /// V − E + F.
    pub euler_characteristic: i64,
    /// The rims, those with the most vertices first.
    pub rims: Vec<Rim>,
    /// Sides of the box along x, y and z.
    pub box_mm: [f64; 3],
    /// Area in mm².
    pub area_mm2: f64,
    /// Shortest, mean and longest edge.
    pub edge_mm: [f64; 3],
    /// Sum of the angle defects inside: Gaussian curvature of the whole. With the turnings of the rims it makes
    /// 360° times the Euler characteristic.
    pub total_curvature_deg: f64,
    /// The smallest corner angle of all faces.
    pub least_angle_deg: f64,
    /// The worst face by 4√3 · area / sum of squared sides: 1 is equilateral, 0 flat.
    pub worst_face: WorstFace,
}

/// A rim of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rim {
    /// Its vertices.
    pub vertices: usize,
    /// Its length.
    pub length_mm: f64,
    /// Total geodesic curvature with the surface on the left: 360° around a flat disk, −360° around a hole in it.
    pub turning_deg: f64,
}

/// The face of the worst shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstFace {
    /// Its number, counted from 1 in the surface as it is used.
    pub face: u64,
    /// Its quality: 4√3 · area / sum of squared sides.
    pub quality: f64,
    /// Its middle, in millimetres.
    pub at_mm: [f64; 3],
}

impl Inspection {
    /// Measures a surface.
    pub fn of(surface: &Surface) -> Self {
        let mut angle_sum = Per::<VertexId, f64>::filled(surface.positions().len(), 0.0);
        let mut least = f64::INFINITY;
        let mut worst = (f64::INFINITY, FaceId(0));
        for (face, vertices) in surface.faces().iter_ids() {
            let p = surface.corners(face);
            let mut squares = 0.0;
            for k in 0..3 {
                let angle = surface.corner_angle(HalfedgeId::side(face, k));
                angle_sum[vertices[k]] += angle;
                least = least.min(angle);
                squares += (p[(k + 1) % 3] - p[k]).norm_squared();
            }
            let quality = 4.0 * 3f64.sqrt() * surface.face_area(face) / squares;
            if quality < worst.0 {
                worst = (quality, face);
            }
        }
        let flat = std::f64::consts::TAU;
        let total: f64 = angle_sum
            .iter_ids()
            .filter(|(v, _)| !surface.on_rim(*v))
            .map(|(_, sum)| flat - sum)
            .sum();
        let rims = surface
            .rims()
            .iter()
            .map(|rim| {
                let next = rim.iter().cycle().skip(1);
                Rim {
                    vertices: rim.len(),
                    length_mm: rim
                        .iter()
                        .zip(next)
                        .map(|(a, b)| (surface.position(*b) - surface.position(*a)).norm())
                        .sum(),
                    turning_deg: surface.rim_turning(rim).to_degrees(),
                }
            })
            .collect();
        let (mut edges, mut sum, mut shortest, mut longest) = (0, 0.0, f64::INFINITY, 0.0f64);
        for edge in surface.edges() {
            let length = surface.length(edge);
            edges += 1;
            sum += length;
            shortest = shortest.min(length);
            longest = longest.max(length);
        }
        let (low, high) = surface.bounds();
        let parts = surface.parts().len();
        let [a, b, c] = surface.corners(worst.1);
        Self {
            vertices: surface.positions().len(),
            edges,
            faces: surface.faces().len(),
            parts,
            genus: (parts == 1).then(|| surface.genus()),
            euler_characteristic: surface.euler_characteristic(),
            rims,
            box_mm: (high - low).into(),
            area_mm2: surface.area(),
            edge_mm: [shortest, sum / edges.max(1) as f64, longest],
            total_curvature_deg: total.to_degrees(),
            least_angle_deg: least.to_degrees(),
            worst_face: WorstFace {
                face: u64::from(worst.1.0) + 1,
                quality: worst.0,
                at_mm: ((a.coords + b.coords + c.coords) / 3.0).into(),
            },
        }
    }

    /// What kind of surface it is, in a few words.
    pub fn kind(&self) -> String {
        match (self.genus, self.rims.len()) {
            (None, _) => format!("{} parts", self.parts),
            (Some(0), 0) => "closed, like a sphere".into(),
            (Some(0), 1) => "a disk: one rim".into(),
            (Some(0), 2) => "an annulus: two rims".into(),
            (Some(0), n) => format!("a sphere with {n} holes"),
            (Some(1), 0) => "closed, like a torus".into(),
            (Some(g), 0) => format!("closed, with {g} handles"),
            (Some(g), n) => format!("{g} handles and {n} rims"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Sample;

    #[test]
    fn curvature_and_turning_make_360_degrees_times_the_euler_characteristic() {
        for sample in Sample::all() {
            let found = Inspection::of(&sample.generate().unwrap());
            let turning: f64 = found.rims.iter().map(|r| r.turning_deg).sum();
            let gauss_bonnet = 360.0 * found.euler_characteristic as f64;
            assert!(
                (found.total_curvature_deg + turning - gauss_bonnet).abs() < 1e-6,
                "{sample}"
            );
        }
    }

    #[test]
    fn figures_of_a_hemisphere_and_an_octasphere() {
        let half = Inspection::of(&Sample::parse("hemisphere").unwrap().generate().unwrap());
        assert!((half.area_mm2 / (std::f64::consts::TAU * 1e4) - 1.0).abs() < 2e-3);
        assert!((half.rims[0].length_mm / (std::f64::consts::TAU * 100.0) - 1.0).abs() < 1e-3);
        // The rim of a hemisphere is a geodesic; its mesh turns by half a triangle's share.
        assert!(half.rims[0].turning_deg.abs() < 10.0, "{:?}", half.rims);
        assert_eq!(half.kind(), "a disk: one rim");
        assert!(half.edge_mm[0] < half.edge_mm[1] && half.edge_mm[1] < half.edge_mm[2]);
        let ball = Inspection::of(&Sample::parse("octasphere").unwrap().generate().unwrap());
        assert!((ball.total_curvature_deg - 720.0).abs() < 1e-6);
        assert_eq!((ball.genus, ball.rims.len()), (Some(0), 0));
        assert!(ball.worst_face.quality > 0.8 && ball.worst_face.quality <= 1.0);
    }
}
