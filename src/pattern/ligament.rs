//! How hard a hinge is strained: a beam model, simple and stated.
//!
//! A hinge is two ligaments in series. At a stretch λ the two triangles have turned by 2α against each other, with
//! α = asin(λ/2) − 30°, and each ligament is bent by α in the plane of the sheet. Where the sheet also folds there by an
//! angle φ, each takes φ/2 out of the plane.
//!
//! A ligament lies between the straight edge of an arm and the end of a slit that comes in at 60° to it. Along the arm
//! its width is w(x) = h + r − √(r² − x²): a round notch of the tip's radius r, h wide at the narrowest. On the vertex's
//! side the notch ends in solid material; on the other it goes over, at 60°, into the slit's straight flank, from where
//! w grows by tan 60° for each unit of x. As a beam of varying width that is bent by a moment M and stretches linearly
//! over its section (plane sections, as for notch hinges: Paros and Weisbord 1965),
//!
//! - in the plane, α = 12 M/(E t) · J₃ and ε = 6 M/(E t h²), so that **ε = α / (2 h² J₃)**;
//! - out of it, φ/2 = 12 M/(E t³) · J₁ and ε = 6 M/(E t² h), so that **ε = (φ/2) · t / (2 h J₁)**,
//!
//! with Jₙ = ∫ dx / wⁿ in closed form. The strain is nominal: beyond yield it says how hinges compare, not what the
//! metal feels. What a hinge may bear is what it bears at the material's σ: the *share* of a hinge is its strain divided
//! by that of a flat one at σ. The true σ of a material depends on h, r, t and L as well; that is for calibration to say.
//!
//! The pivots of a hinge sit about 0.66 c from the vertex, c being the neck: half-way along the ligaments, and not in the
//! vertex where the linkage has them.

use nalgebra::{Point3, Vector3};

use super::sheet::SheetMetadata;
use crate::base::ids::Id as _;
use crate::linkage::{Linkage, TriangleId};

/// Where the effective pivot of a hinge sits, in necks from the lattice vertex (design figure, measured on sheets).
pub const PIVOT_IN_NECKS: f64 = 0.66;

/// Angle at which a slit comes in on the arm beside it, radians.
const FLANK: f64 = std::f64::consts::FRAC_PI_3;

/// The flank counts until it is so many necks wide: beyond, the triangle is stiff.
const FLANK_IN_NECKS: f64 = 2.0;

/// One of the two ligaments of a hinge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ligament {
    /// Narrowest width h, millimetres.
    pub width_mm: f64,
    /// Finished radius r of the slit's tip, millimetres.
    pub tip_radius_mm: f64,
    /// Thickness t of the sheet, millimetres.
    pub thickness_mm: f64,
    /// Width up to which its flank bends, millimetres.
    pub flank_mm: f64,
}

impl Ligament {
    /// The ligaments of a sheet.
    pub fn of(metadata: &SheetMetadata, thickness_mm: f64) -> Self {
        Self {
            width_mm: metadata.hinge_width_mm,
            tip_radius_mm: metadata.tip.radius_mm(metadata.kerf_mm),
            thickness_mm,
            flank_mm: FLANK_IN_NECKS * metadata.neck_mm(),
        }
    }

    /// The ligaments beside a neck of `neck_mm`, with a tip of finished radius `tip_radius_mm`.
    pub fn beside(width_mm: f64, tip_radius_mm: f64, neck_mm: f64, thickness_mm: f64) -> Self {
        Self {
            width_mm,
            tip_radius_mm,
            thickness_mm,
            flank_mm: FLANK_IN_NECKS * neck_mm,
        }
    }

    /// How far it is bent at a stretch λ, radians: α = asin(λ/2) − 30°. Below 1 it is bent the other way.
    pub fn bend_at(opening: f64) -> f64 {
        (0.5 * opening.clamp(-2.0, 2.0)).asin() - std::f64::consts::FRAC_PI_6
    }

    /// Jₙ = ∫ dx/wⁿ along it, for n = 1 or 3, in mm^(1−n).
    fn flexibility(&self, n: i32) -> f64 {
        let r = self.tip_radius_mm;
        let b = 1.0 + self.width_mm / r;
        let arc = |of: i32| {
            antiderivative(b, of, FLANK) - antiderivative(b, of, -std::f64::consts::FRAC_PI_2)
        };
        // With x = r sin θ: ∫ r cos θ dθ / (rⁿ (b − cos θ)ⁿ), and cos θ = b − (b − cos θ).
        let notch = r.powi(1 - n) * (b * arc(n) - arc(n - 1));
        let slope = FLANK.tan();
        let from = self.width_mm + r * (1.0 - FLANK.cos());
        let to = self.flank_mm.max(from);
        let flank = match n {
            1 => (to / from).ln() / slope,
            _ => (from.powi(1 - n) - to.powi(1 - n)) / (f64::from(n - 1) * slope),
        };
        notch + flank
    }

    /// Nominal strain when it is bent by `bend` radians in the plane of the sheet.
    pub fn strain_in_plane(&self, bend: f64) -> f64 {
        bend.abs() / (2.0 * self.width_mm.powi(2) * self.flexibility(3))
    }

    /// Nominal strain when it is bent by `bend` radians out of the plane.
    pub fn strain_out_of_plane(&self, bend: f64) -> f64 {
        bend.abs() * self.thickness_mm / (2.0 * self.width_mm * self.flexibility(1))
    }

    /// Nominal strain at a stretch λ and a fold of `fold` radians between the triangles: both add up in a corner of the
    /// section.
    pub fn strain(&self, opening: f64, fold: f64) -> f64 {
        self.strain_in_plane(Self::bend_at(opening)) + self.strain_out_of_plane(0.5 * fold)
    }
}

/// ∫ dθ / (b − cos θ)ⁿ up to θ in [−π/2, π/2], for b > 1.
fn antiderivative(b: f64, n: i32, theta: f64) -> f64 {
    match n {
        0 => theta,
        1 => {
            let root = (b * b - 1.0).sqrt();
            2.0 / root * (((b + 1.0) / (b - 1.0)).sqrt() * (0.5 * theta).tan()).atan()
        }
        _ => {
            let m = f64::from(n - 1);
            let ends = theta.sin() / (b - theta.cos()).powi(n - 1);
            let lower = (2.0 * m - 1.0) * b * antiderivative(b, n - 1, theta)
                - (m - 1.0) * antiderivative(b, n - 2, theta);
            (ends + lower) / (m * (b * b - 1.0))
        }
    }
}

/// How much of what the material bears a hinge uses.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct HingeRisk {
    /// Number of the hinge in the linkage.
    pub hinge: usize,
    /// Its point.
    pub point: u32,
    /// How far it is open, λ.
    pub opening: f64,
    /// Angle between its triangles' planes, degrees.
    pub fold_deg: f64,
    /// Nominal strain.
    pub strain: f64,
    /// Strain over that of a flat hinge at σ: above 1 it is beyond what the material was found to bear.
    pub share: f64,
}

/// The risk at every hinge of an opened linkage, in their order. `openings` are λ by hinge, `positions` by point; hinges
/// without either are left out, and so are those that a smooth rim cuts off.
pub fn hinge_risks(
    linkage: &Linkage,
    positions: &[Point3<f64>],
    openings: &[f64],
    ligament: &Ligament,
    sigma: f64,
) -> Vec<HingeRisk> {
    let allowed = ligament.strain(sigma, 0.0);
    let normal = |t: TriangleId| -> Option<Vector3<f64>> {
        let [a, b, c] = linkage.triangles[t].points;
        let at = |p: crate::linkage::PointId| positions.get(p.index());
        let (a, b, c) = (at(a)?, at(b)?, at(c)?);
        (b - a).cross(&(c - a)).try_normalize(1e-12)
    };
    linkage
        .hinges
        .iter()
        .zip(openings)
        .enumerate()
        .filter(|(_, (hinge, _))| linkage.keeps(hinge))
        .filter_map(|(n, (hinge, &opening))| {
            let (u, v) = (normal(hinge.ccw.triangle)?, normal(hinge.cw.triangle)?);
            let fold = u.cross(&v).norm().atan2(u.dot(&v));
            let strain = ligament.strain(opening, fold);
            Some(HingeRisk {
                hinge: n,
                point: hinge.point.0,
                opening,
                fold_deg: fold.to_degrees(),
                strain,
                share: strain / allowed,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ dx/wⁿ by Simpson's rule, from the profile itself.
    fn by_quadrature(l: &Ligament, n: i32) -> f64 {
        let (h, r) = (l.width_mm, l.tip_radius_mm);
        let simpson = |from: f64, to: f64, f: &dyn Fn(f64) -> f64| {
            let m = 20_000;
            let step = (to - from) / f64::from(m);
            let sum: f64 = (0..=m)
                .map(|k| {
                    let weight = if k == 0 || k == m {
                        1.0
                    } else if k % 2 == 1 {
                        4.0
                    } else {
                        2.0
                    };
                    weight * f(from + step * f64::from(k))
                })
                .sum();
            sum * step / 3.0
        };
        // In θ, where the profile has no vertical tangent.
        let notch = simpson(-std::f64::consts::FRAC_PI_2, FLANK, &|t| {
            r * t.cos() / (h + r - r * t.cos()).powi(n)
        });
        let x1 = r * FLANK.sin();
        let w1 = h + r - r * FLANK.cos();
        let length = (l.flank_mm.max(w1) - w1) / FLANK.tan();
        notch + simpson(x1, x1 + length, &|x| (w1 + (x - x1) * FLANK.tan()).powi(-n))
    }

    #[test]
    fn the_closed_form_is_the_integral_over_the_profile() {
        for h in [0.3, 1.0, 2.5] {
            for r in [0.05, 0.4, 3.0] {
                let l = Ligament {
                    width_mm: h,
                    tip_radius_mm: r,
                    thickness_mm: 1.0,
                    flank_mm: 4.0 * (h + r),
                };
                for n in [1, 3] {
                    let (closed, sum) = (l.flexibility(n), by_quadrature(&l, n));
                    assert!(
                        (closed / sum - 1.0).abs() < 1e-8,
                        "{h} {r} {n}: {closed} {sum}"
                    );
                }
            }
        }
    }

    #[test]
    fn wider_tips_and_narrower_ligaments_are_strained_less_and_a_flat_closed_one_not_at_all() {
        let l = Ligament {
            width_mm: 1.0,
            tip_radius_mm: 0.1,
            thickness_mm: 1.6,
            flank_mm: 4.0,
        };
        assert_eq!(l.strain(1.0, 0.0), 0.0);
        let wider = Ligament {
            tip_radius_mm: 0.6,
            ..l
        };
        let narrower = Ligament { width_mm: 0.5, ..l };
        let thinner = Ligament {
            thickness_mm: 0.8,
            ..l
        };
        for opening in [1.1, 1.5, 1.9] {
            assert!(wider.strain(opening, 0.1) < l.strain(opening, 0.1));
            assert!(narrower.strain(opening, 0.0) < l.strain(opening, 0.0));
            assert_eq!(thinner.strain(opening, 0.0), l.strain(opening, 0.0));
            assert!(thinner.strain(opening, 0.3) < l.strain(opening, 0.3));
        }
        // Fully open, each ligament has turned by 60°.
        assert!((Ligament::bend_at(2.0) - std::f64::consts::FRAC_PI_3).abs() < 1e-12);
        // A very wide notch is a beam of its width: the strain goes with √h as for a circular notch hinge.
        let ratio = |h: f64| {
            let wide = Ligament {
                width_mm: h,
                tip_radius_mm: 1e4 * h,
                thickness_mm: 1.0,
                flank_mm: 0.0,
            };
            wide.strain_in_plane(1.0) * (wide.tip_radius_mm / h).sqrt()
        };
        // Paros and Weisbord's short form for one notch, ε ≈ θ h / (2 · 3π/(8√2) · √(h r)) · …: independent of h.
        assert!((ratio(0.5) / ratio(2.0) - 1.0).abs() < 1e-6);
        assert!(
            (ratio(1.0) - 4.0 * 2f64.sqrt() / (3.0 * std::f64::consts::PI) * 0.5).abs() < 1e-2,
            "{}",
            ratio(1.0)
        );
    }
}
