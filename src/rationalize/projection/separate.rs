//! Projections onto what a pair of neighbouring triangles may do: conditions (3) to (6) and the bound σ.
//!
//! Each gives how far the edge vectors move, and is called only where its condition is broken.

use nalgebra::Vector3;

/// Which projection onto non-penetration, conditions (3) and (4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Separation {
    /// The paper's Appendix B with its index corrected (`i3 = idI_[3]`): v₂ and v₃ move to the line in space that fits
    /// them best. It flattens what stands out of the plane, and moves about three times as far as needed.
    Printed,
    /// The line is fitted in the plane of v₁ and v₂, and v₃ keeps its part normal to that plane: close to the nearest
    /// feasible move.
    #[default]
    InPlane,
}

/// How far v₂ and v₃ move when (v₁ × v₂)·(v₂ × v₃) < 0; `normal` is along v₁ × v₂, unit. v₁ stays.
#[inline]
pub(super) fn separate(
    kind: Separation,
    normal: &Vector3<f64>,
    v2: &Vector3<f64>,
    v3: &Vector3<f64>,
) -> [Vector3<f64>; 2] {
    let inside = match kind {
        Separation::Printed => *v3,
        Separation::InPlane => v3 - normal * normal.dot(v3),
    };
    // The line that fits two vectors best is spanned by v₂ cos φ + v₃ sin φ with φ from their products: the singular
    // vectors of [v₂, v₃] without its singular value decomposition.
    let (a, b, c) = (v2.norm_squared(), v2.dot(&inside), inside.norm_squared());
    let (s, d) = (2.0 * b, a - c);
    let r = s.hypot(d);
    // tan φ = s / (r + d), taken from the larger of the two equal quotients.
    let along = if d >= 0.0 {
        v2 * (r + d) + inside * s
    } else {
        v2 * s + inside * (r - d)
    };
    let Some(h) = along.try_normalize(0.0) else {
        return [Vector3::zeros(); 2];
    };
    [h * h.dot(v2) - v2, h * h.dot(&inside) - inside]
}

/// How far v₁ and v₂ move when |v₁ + v₂ − v₃ − v₄| exceeds `bound`; v₃ and v₄ move by the opposite. The nearest move.
#[inline]
pub(super) fn close(apart: &Vector3<f64>, bound: f64) -> Vector3<f64> {
    apart * (0.25 * (bound / apart.norm() - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rationalize::problem::{Condition, hinge_scale};
    use nalgebra::Matrix3x2;
    use proptest::prelude::*;

    /// (v₁ × v₂)·(v₂ × v₃) with a unit normal.
    fn value(v: &[Vector3<f64>; 3]) -> f64 {
        v[0].cross(&v[1]).normalize().dot(&v[1].cross(&v[2]))
    }

    fn moved(kind: Separation, v: &[Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        let [d2, d3] = separate(kind, &v[0].cross(&v[1]).normalize(), &v[1], &v[2]);
        [v[0], v[1] + d2, v[2] + d3]
    }

    /// The nearest point of the boundary, by Newton's method on the conditions for it: from the last iterate z the next
    /// is the nearest one on the tangent plane of the boundary there.
    fn nearest(v: &[Vector3<f64>; 3]) -> Option<[Vector3<f64>; 3]> {
        let evaluate = |z: &[Vector3<f64>; 3]| {
            let zero = Vector3::zeros();
            let p = [zero, z[0], z[1], z[2], zero];
            Condition::SecondClear
                .evaluate(&p)
                .map(|s| (s.value, [s.gradient[1], s.gradient[2], s.gradient[3]]))
        };
        let mut z = *v;
        for _ in 0..200 {
            let (c, g) = evaluate(&z)?;
            let along: f64 = (0..3).map(|k| g[k].dot(&(z[k] - v[k]))).sum();
            let length: f64 = g.iter().map(Vector3::norm_squared).sum();
            let next: [Vector3<f64>; 3] =
                std::array::from_fn(|k| v[k] + g[k] * ((along - c) / length));
            let step: f64 = (0..3).map(|k| (next[k] - z[k]).norm()).sum();
            z = next;
            if step < 1e-12 {
                return (evaluate(&z)?.0.abs() < 1e-10).then_some(z);
            }
        }
        None
    }

    fn length(from: &[Vector3<f64>; 3], to: &[Vector3<f64>; 3]) -> f64 {
        (0..3)
            .map(|k| (to[k] - from[k]).norm_squared())
            .sum::<f64>()
            .sqrt()
    }

    /// A triangle's two edges and the third arm turned by `inwards` into it and out of its plane by `tilt`.
    fn arms(inwards: f64, tilt: f64, jitter: [f64; 9]) -> [Vector3<f64>; 3] {
        let at = |angle: f64| Vector3::new(angle.cos(), angle.sin(), 0.0);
        let third = std::f64::consts::FRAC_PI_3;
        let mut v = [
            at(0.0),
            at(third),
            at(third - inwards) * tilt.cos() + Vector3::z() * tilt.sin(),
        ];
        for (k, j) in jitter.iter().enumerate() {
            v[k / 3][k % 3] += j;
        }
        v
    }

    #[test]
    fn in_the_plane_is_near_the_nearest_move_and_as_printed_is_not() {
        let mut ratios = [Separation::InPlane, Separation::Printed].map(|k| (k, Vec::new()));
        // Additive recurrences cover the ranges evenly.
        let part = |n: usize, k: usize| {
            let golden = 0.618_033_988_749_894_9f64;
            (n as f64 * golden.powi(k as i32 + 1) + 0.37 * k as f64).fract()
        };
        for n in 0..4000 {
            let jitter = std::array::from_fn(|k| 0.06 * (part(n, k + 2) - 0.5));
            let v = arms(0.25 * part(n, 0), 1.2 * (part(n, 1) - 0.5), jitter);
            if value(&v) >= -1e-3 {
                continue;
            }
            let Some(z) = nearest(&v) else { continue };
            let least = length(&v, &z);
            for (kind, ratios) in &mut ratios {
                let ratio = length(&v, &moved(*kind, &v)) / least;
                assert!(
                    ratio > 1.0 - 1e-6,
                    "{ratio}: nothing is nearer than the nearest"
                );
                ratios.push(ratio);
            }
        }
        let [in_plane, printed] = ratios.map(|(_, mut r)| {
            assert!(r.len() > 2000);
            r.sort_by(f64::total_cmp);
            r[r.len() / 2]
        });
        assert!(in_plane < 1.2, "{in_plane}");
        assert!(printed > 3.0 * in_plane, "{printed}");
    }

    proptest! {
        #[test]
        fn both_end_on_the_boundary_and_move_only_what_penetrates(
            inwards in 0.01..1.0f64, tilt in -0.6..0.6f64, jitter in prop::array::uniform9(-0.1..0.1f64),
        ) {
            let v = arms(inwards, tilt, jitter);
            prop_assume!(value(&v) < 0.0);
            let n = v[0].cross(&v[1]).normalize();
            for kind in [Separation::Printed, Separation::InPlane] {
                let z = moved(kind, &v);
                prop_assert!(n.dot(&z[1].cross(&z[2])).abs() < 1e-12);
            }
            let z = moved(Separation::InPlane, &v);
            prop_assert!((n.dot(&z[2]) - n.dot(&v[2])).abs() < 1e-12, "the normal part stays");
            // Appendix B word for word.
            let svd = Matrix3x2::from_columns(&[v[1], v[2]]).svd_unordered(true, false);
            let u = svd.u.unwrap();
            let larger = usize::from(svd.singular_values[1] > svd.singular_values[0]);
            let h = u.column(larger).into_owned();
            let z = moved(Separation::Printed, &v);
            for k in 1..3 {
                prop_assert!((z[k] - h * h.dot(&v[k])).norm() < 1e-7);
            }
        }

        #[test]
        fn closing_a_hinge_ends_at_sigma(
            seed in prop::array::uniform12(-3.0..3.0f64), sigma in 1.0..2.0f64,
        ) {
            let mut p = [Vector3::zeros(); 5];
            for (k, s) in seed.iter().enumerate() {
                p[1 + k / 3][k % 3] = *s;
            }
            prop_assume!(hinge_scale(&p).value > sigma);
            let d = close(&(p[1] + p[2] - p[3] - p[4]), 3f64.sqrt() * sigma);
            for (k, sign) in [1.0, 1.0, -1.0, -1.0].into_iter().enumerate() {
                p[k + 1] += d * sign;
            }
            prop_assert!((hinge_scale(&p).value - sigma).abs() < 1e-12);
        }
    }
}
