//! The measures of a hinge that its limit depends on, and what an opening does to it.

use crate::material::{Reading, neck_mm};
use crate::pattern::Ligament;

/// Width, tip, thickness and edge of the hinges of one strip or sheet; millimetres.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Geometry {
    /// Width h of a ligament.
    pub hinge_width_mm: f64,
    /// Kerf k.
    pub kerf_mm: f64,
    /// Finished radius r of the slit's tip; half the kerf for a plain one.
    pub tip_radius_mm: f64,
    /// Thickness t of the sheet.
    pub thickness_mm: f64,
    /// Edge L of the triangles.
    pub edge_mm: f64,
}

/// An opened hinge: the stretch, the bend of its ligaments and its slope.
///
/// A ligament's middle lies half-way between the slit's tip, a neck c before the vertex, and its foot on the arm, c/2
/// along it: at (5/8, √3/8) c from the vertex, 0.66 c away. The triangles turn by α about these two points and not about
/// the vertex; the distance of their centroids gives λ = R sin(α + φ) + ¾ q, with q = c/L and
/// R e^{iφ} = 2 e^{iπ/6} − 2√3 q (5/8 + i √3/8). For q = 0 this is the linkage's own α = asin(λ/2) − 30°.
#[derive(Clone, Copy, Debug)]
struct Opening {
    radius: f64,
    phase: f64,
    offset: f64,
}

impl Opening {
    fn of(neck_in_edges: f64) -> Self {
        let root = 3f64.sqrt();
        let x = root - 2.0 * root * neck_in_edges * 0.625;
        let y = 1.0 - 2.0 * root * neck_in_edges * (root / 8.0);
        Self {
            radius: x.hypot(y),
            phase: y.atan2(x),
            offset: 0.75 * neck_in_edges,
        }
    }
}

impl Geometry {
    /// The geometry of a strip that was pulled.
    pub fn of(reading: &Reading) -> Self {
        Self {
            hinge_width_mm: reading.hinge_width_mm,
            kerf_mm: reading.kerf_mm,
            tip_radius_mm: reading.tip_radius_mm.unwrap_or(0.5 * reading.kerf_mm),
            thickness_mm: reading.thickness_mm,
            edge_mm: reading.edge_mm,
        }
    }

    /// With plain tips, as the beam leaves them.
    pub fn plain(hinge_width_mm: f64, kerf_mm: f64, thickness_mm: f64, edge_mm: f64) -> Self {
        Self {
            hinge_width_mm,
            kerf_mm,
            tip_radius_mm: 0.5 * kerf_mm,
            thickness_mm,
            edge_mm,
        }
    }

    /// True if every measure is positive and the necks leave something of the edge.
    pub fn is_sound(&self) -> bool {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        [
            self.hinge_width_mm,
            self.kerf_mm,
            self.tip_radius_mm,
            self.thickness_mm,
            self.edge_mm,
        ]
        .into_iter()
        .all(positive)
            && 2.0 * self.neck_mm() < self.edge_mm
    }

    /// The neck c, millimetres.
    pub fn neck_mm(&self) -> f64 {
        neck_mm(self.hinge_width_mm, self.kerf_mm, self.tip_radius_mm)
    }

    /// The largest stretch λ that these hinges allow, a little under 2: there the triangles' centroids are farthest apart.
    pub fn most_opening(&self) -> f64 {
        let opening = Opening::of(self.neck_mm() / self.edge_mm);
        opening.radius + opening.offset
    }

    /// How far each ligament is bent at a stretch λ, radians: 0 at and below 1; beyond the largest stretch, what it is
    /// there.
    pub fn bend_at(&self, opening: f64) -> f64 {
        let o = Opening::of(self.neck_mm() / self.edge_mm);
        let sine = ((opening - o.offset) / o.radius).clamp(-1.0, 1.0);
        (sine.asin() - o.phase).max(0.0)
    }

    /// The stretch λ at which each ligament is bent by `bend` radians.
    pub fn opening_at(&self, bend: f64) -> f64 {
        let o = Opening::of(self.neck_mm() / self.edge_mm);
        let most = std::f64::consts::FRAC_PI_2 - o.phase;
        o.radius * (bend.clamp(0.0, most) + o.phase).sin() + o.offset
    }

    /// Nominal strain for each radian of bend in the plane: 1/(2 h² J₃).
    pub fn strain_per_bend(&self) -> f64 {
        Ligament::beside(
            self.hinge_width_mm,
            self.tip_radius_mm,
            self.neck_mm(),
            self.thickness_mm,
        )
        .strain_in_plane(1.0)
    }
}

/// A geometry made ready for many questions: from a stretch to the logarithm of the strain and back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub(super) geometry: Geometry,
    log_strain_per_bend: f64,
    /// The largest stretch.
    pub(super) most: f64,
}

impl Scale {
    pub(super) fn of(geometry: Geometry) -> Self {
        Self {
            geometry,
            log_strain_per_bend: geometry.strain_per_bend().ln(),
            most: geometry.most_opening(),
        }
    }

    /// ln ε at a stretch; −∞ where nothing is bent.
    pub(super) fn load(&self, opening: f64) -> f64 {
        self.geometry.bend_at(opening).ln() + self.log_strain_per_bend
    }

    /// The stretch at which ln ε is `load`; the largest one if it is never reached.
    pub(super) fn opening(&self, load: f64) -> f64 {
        self.geometry
            .opening_at((load - self.log_strain_per_bend).exp())
    }

    /// d ln λ / d ln ε at a stretch: how much of a relative change of the limit shows in σ.
    pub(super) fn slope(&self, opening: f64) -> f64 {
        let step = 1e-4;
        let load = self.load(opening);
        (self.opening(load + step) / self.opening(load - step)).ln() / (2.0 * step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_neck_of_nothing_is_the_linkage_itself_and_a_real_one_bends_farther() {
        let fine = Geometry::plain(1e-7, 1e-7, 1.0, 10.0);
        let real = Geometry::plain(1.0, 0.2, 1.0, 10.0);
        assert!((fine.most_opening() - 2.0).abs() < 1e-6);
        for opening in [1.01, 1.2, 1.5, 1.8, 1.95] {
            let own = Ligament::bend_at(opening);
            assert!((fine.bend_at(opening) - own).abs() < 1e-5);
            let most = real.most_opening();
            if opening < most {
                assert!(real.bend_at(opening) > own);
            }
        }
        assert!(real.bend_at(1.0).abs() < 1e-12);
    }

    #[test]
    fn the_stretch_is_that_of_two_triangles_turned_about_their_ligaments() {
        // Two triangles beside a slit along x that ends before the vertex at the origin, turned each about the middle of
        // its own ligament.
        let g = Geometry::plain(1.0, 0.3, 2.0, 12.0);
        let c = g.neck_mm();
        let tip = [c, 0.0];
        let foot = [0.25 * c, 0.75f64.sqrt() * 0.5 * c];
        let pivot = [0.5 * (tip[0] + foot[0]), 0.5 * (tip[1] + foot[1])];
        assert!((pivot[0].hypot(pivot[1]) / c - crate::pattern::PIVOT_IN_NECKS).abs() < 0.01);
        let reach = g.edge_mm / 3f64.sqrt();
        let centroid = [reach * 0.75f64.sqrt(), reach * 0.5];
        for bend in [0.0, 0.05, 0.3, 0.6, 0.9] {
            let (sin, cos) = f64::sin_cos(bend);
            let y = pivot[1] + sin * (centroid[0] - pivot[0]) + cos * (centroid[1] - pivot[1]);
            let stretch = y / centroid[1];
            assert!((g.opening_at(bend) - stretch).abs() < 1e-12);
            assert!((g.bend_at(stretch) - bend).abs() < 1e-9);
        }
        let scale = Scale::of(g);
        for opening in [1.001, 1.1, 1.4, 1.7] {
            assert!((scale.opening(scale.load(opening)) - opening).abs() < 1e-9);
        }
        assert_eq!(scale.load(1.0), f64::NEG_INFINITY);
    }
}
