//! What both solvers solve: the conditions on a linkage's points, in units of L.
//!
//! At a hinge h the two triangles have the edge vectors v1 = b1 − h, v2 = a1 − h and v3 = a2 − h, v4 = b2 − h (paper,
//! Fig. 10), counter-clockwise seen from outside in this order; closed, v2 = v3. The conditions are
//!
//! - (3) n₁·(v₂ × v₃) ≥ 0 and (4) n₂·(v₃ × v₂) ≥ 0: no triangle enters the other, the paper's non-penetration, as
//!   signed lengths (n₁, n₂ unit normals along v₁ × v₂ and v₄ × v₃);
//! - (5) n₁·(v₁ × v₃) ≥ 0 and (6) n₂·(v₄ × v₂) ≥ 0: no hinge opens past 180°, which the paper does not ask but needs,
//!   or triangles come around from behind;
//! - λ ≤ σ, where λ = √3 |c₁ − c₂| / L for the centroids c₁, c₂ (equal to 2 sin(γ/2) for rigid triangles).

use nalgebra::Vector3;

use crate::base::ids::Id as _;
use crate::linkage::Linkage;

/// Conditions (5) and (6) keep this distance (in L) from 180°: there both normals of the four arms turn degenerate
/// together. It costs 1.1° at a fully open hinge, λ = 1.9999.
pub(crate) const OPEN_MARGIN: f64 = 0.02;

/// A triangle whose doubled area (in L²) is below this has collapsed: its normal means nothing.
const COLLAPSED: f64 = 1e-12;

/// Points of a hinge: `[h, b1, a1, a2, b2]`.
pub(crate) type HingePoints = [u32; 5];

/// The linkage as the solvers see it.
#[derive(Clone, Debug)]
pub struct Problem {
    pub(crate) points: usize,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) hinges: Vec<HingePoints>,
    /// Largest scale factor.
    pub(crate) sigma: f64,
}

impl Problem {
    /// The problem of a linkage whose hinges may open to the scale factor `sigma`.
    pub fn new(linkage: &Linkage, sigma: f64) -> Self {
        let triangles = linkage
            .triangles
            .iter()
            .map(|t| t.points.map(|p| p.0))
            .collect();
        let hinges = linkage
            .hinges
            .iter()
            .map(|h| {
                let [b1, a1, a2, b2] = h.arms(&linkage.triangles);
                [h.point, b1, a1, a2, b2].map(|p| p.index() as u32)
            })
            .collect();
        Self {
            points: linkage.point_count(),
            triangles,
            hinges,
            sigma,
        }
    }
}

/// A condition's value and its gradient with respect to `[h, b1, a1, a2, b2]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Signed {
    pub value: f64,
    pub gradient: [Vector3<f64>; 5],
}

/// n·(x × y) for n = unit(a × b), with y one of three arms; gradients of a, b and the third arm.
/// `side` gives (x, y) = (b, c) for (3)/(4) or (a, c) for (5)/(6).
#[inline]
fn signed_side(
    a: Vector3<f64>,
    b: Vector3<f64>,
    c: Vector3<f64>,
    from_a: bool,
) -> Option<(f64, [Vector3<f64>; 3])> {
    let normal = a.cross(&b);
    let length = normal.norm();
    if length < COLLAPSED {
        return None;
    }
    let n = normal / length;
    let arm = if from_a { a } else { b };
    let w = arm.cross(&c);
    let value = n.dot(&w);
    // d(n·w) through the normal: q·d(a × b).
    let q = (w - n * value) / length;
    let (mut da, mut db, dc) = (b.cross(&q), q.cross(&a), n.cross(&arm));
    let through_arm = c.cross(&n);
    if from_a {
        da += through_arm
    } else {
        db += through_arm
    }
    Some((value, [da, db, dc]))
}

/// What a hinge's arms must keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Condition {
    /// (3): the second triangle stays out of the first.
    SecondClear,
    /// (4): the first stays out of the second.
    FirstClear,
    /// (5): open at most 180°, seen from the first.
    FirstOpen,
    /// (6): open at most 180°, seen from the second.
    SecondOpen,
    /// λ ≤ σ.
    Scale,
}

/// All conditions, in the order of [`hinge_violations`].
pub(crate) const CONDITIONS: [Condition; 5] = [
    Condition::SecondClear,
    Condition::FirstClear,
    Condition::FirstOpen,
    Condition::SecondOpen,
    Condition::Scale,
];

/// By how much a hinge violates each of [`CONDITIONS`], in L; negative where it keeps them, −∞ where a triangle has
/// collapsed and there is nothing to say.
#[inline]
pub(crate) fn hinge_violations(p: &[Vector3<f64>; 5], sigma: f64) -> [f64; 5] {
    let (v1, v2, v3, v4) = (p[1] - p[0], p[2] - p[0], p[3] - p[0], p[4] - p[0]);
    let (first, second, across) = (v1.cross(&v2), v4.cross(&v3), v2.cross(&v3));
    let per = |normal: &Vector3<f64>| {
        let length = normal.norm();
        if length < COLLAPSED {
            f64::NAN
        } else {
            1.0 / length
        }
    };
    let (first_per, second_per) = (per(&first), per(&second));
    let open = |value: f64| (OPEN_MARGIN - value).max(f64::NEG_INFINITY);
    [
        (-first.dot(&across) * first_per).max(f64::NEG_INFINITY),
        (second.dot(&across) * second_per).max(f64::NEG_INFINITY),
        open(first.dot(&v1.cross(&v3)) * first_per),
        open(second.dot(&v4.cross(&v2)) * second_per),
        3f64.sqrt() / 3.0 * (v1 + v2 - v3 - v4).norm() - sigma,
    ]
}

impl Condition {
    /// The signed length at a hinge with points `[h, b1, a1, a2, b2]`, or its scale factor; `None` where a triangle has
    /// collapsed.
    #[inline]
    pub fn evaluate(self, p: &[Vector3<f64>; 5]) -> Option<Signed> {
        let (v1, v2, v3, v4) = (p[1] - p[0], p[2] - p[0], p[3] - p[0], p[4] - p[0]);
        let zero = Vector3::zeros();
        let (value, gradient) = match self {
            Self::SecondClear | Self::FirstOpen => {
                let (value, [d1, d2, d3]) = signed_side(v1, v2, v3, self == Self::FirstOpen)?;
                (value, [-(d1 + d2 + d3), d1, d2, d3, zero])
            }
            Self::FirstClear | Self::SecondOpen => {
                let (value, [d4, d3, d2]) = signed_side(v4, v3, v2, self == Self::SecondOpen)?;
                (value, [-(d4 + d3 + d2), zero, d2, d3, d4])
            }
            Self::Scale => return Some(hinge_scale(p)),
        };
        Some(Signed { value, gradient })
    }

    /// The gradient of its violation with respect to `[h, b1, a1, a2, b2]`; `None` where a triangle has collapsed.
    #[inline]
    pub fn violation_gradient(self, p: &[Vector3<f64>; 5]) -> Option<[Vector3<f64>; 5]> {
        let gradient = self.evaluate(p)?.gradient;
        Some(match self {
            Self::Scale => gradient,
            _ => gradient.map(|g| -g),
        })
    }
}

/// The hinge's scale factor λ = √3 |c₁ − c₂| (in units of L) and its gradient.
#[inline]
pub(crate) fn hinge_scale(p: &[Vector3<f64>; 5]) -> Signed {
    // c₁ − c₂: the hinge itself cancels.
    let d = (p[1] + p[2] - p[3] - p[4]) / 3.0;
    let length = d.norm();
    let g = d * (3f64.sqrt() / 3.0 / length.max(1e-300));
    Signed {
        value: 3f64.sqrt() * length,
        gradient: [Vector3::zeros(), g, g, -g, -g],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two unit triangles hinged at the origin, opened by `gap` (radians), in the plane.
    fn pair(gap: f64) -> [Vector3<f64>; 5] {
        let at = |angle: f64| Vector3::new(angle.cos(), angle.sin(), 0.0);
        let third = std::f64::consts::FRAC_PI_3;
        [
            Vector3::zeros(),
            at(0.0),
            at(third),
            at(third + gap),
            at(2.0 * third + gap),
        ]
    }

    #[test]
    fn closed_is_zero_opening_positive_closing_negative() {
        let value =
            |c: Condition, gap_deg: f64| c.evaluate(&pair(gap_deg.to_radians())).unwrap().value;
        for c in [Condition::SecondClear, Condition::FirstClear] {
            assert!(value(c, 0.0).abs() < 1e-15);
            assert!((value(c, 1.0) - 1f64.to_radians().sin()).abs() < 1e-12);
            assert!((value(c, -1.0) + 1f64.to_radians().sin()).abs() < 1e-12);
        }
        for c in [Condition::FirstOpen, Condition::SecondOpen] {
            assert!(
                value(c, 119.0) > 0.0 && value(c, 121.0) < 0.0,
                "180° between the outer arms and the far inner one"
            );
            assert!(value(c, 0.0) > 0.5);
        }
    }

    #[test]
    fn the_scale_of_a_hinge_is_twice_the_sine_of_half_its_opening() {
        for gap_deg in [0.0f64, 10.0, 60.0, 120.0] {
            let gamma = (60.0 + gap_deg).to_radians();
            assert!(
                (hinge_scale(&pair(gap_deg.to_radians())).value - 2.0 * (0.5 * gamma).sin()).abs()
                    < 1e-12
            );
        }
    }

    proptest! {
        #[test]
        fn violations_are_the_conditions_below_their_margins(
            raw in prop::array::uniform15(-1.0..1.0f64), sigma in 1.0..2.0f64,
        ) {
            let p: [Vector3<f64>; 5] = std::array::from_fn(|i| Vector3::new(raw[3 * i], raw[3 * i + 1], raw[3 * i + 2]));
            for (condition, violation) in CONDITIONS.into_iter().zip(hinge_violations(&p, sigma)) {
                let value = condition.evaluate(&p).unwrap().value;
                let expected = match condition {
                    Condition::SecondClear | Condition::FirstClear => -value,
                    Condition::FirstOpen | Condition::SecondOpen => OPEN_MARGIN - value,
                    Condition::Scale => value - sigma,
                };
                prop_assert!((violation - expected).abs() < 1e-12);
            }
        }

        #[test]
        fn gradients_agree_with_differences(seed in prop::array::uniform15(-0.2..0.2f64), gap in -0.3..2.0f64) {
            let mut p = pair(gap);
            for (k, s) in seed.iter().enumerate() {
                p[k / 3][k % 3] += s;
            }
            let check = |f: &dyn Fn(&[Vector3<f64>; 5]) -> Signed| {
                let exact = f(&p);
                for k in 0..15 {
                    let step = 1e-6;
                    let (mut up, mut down) = (p, p);
                    up[k / 3][k % 3] += step;
                    down[k / 3][k % 3] -= step;
                    let slope = (f(&up).value - f(&down).value) / (2.0 * step);
                    prop_assert!((slope - exact.gradient[k / 3][k % 3]).abs() < 1e-6 * (1.0 + slope.abs()));
                }
                Ok(())
            };
            for condition in CONDITIONS {
                check(&|p| condition.evaluate(p).unwrap())?;
            }
        }
    }
}
