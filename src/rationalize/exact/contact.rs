//! Conditions that keep two triangles apart that no hinge joins.
//!
//! Two triangles that cross are parted the shortest way. Where they lie nearly in one plane, as on opposite sides of an
//! opening, a corner of one must stay outside a side of the other, measured in its plane: the same signed length as
//! condition (3). Where they stand across each other, as two leaves of a fold, it must stay on its side of the other's
//! plane.

use nalgebra::Vector3;

use super::super::overlap::{centroids, crossing};
use super::super::problem::{Condition, Problem, Signed};

/// Normals that enclose less than this (its cosine) count as nearly one plane.
const ONE_PLANE: f64 = 0.5;

/// A corner that must keep clear of another triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Contact {
    /// The triangle's corners, then the corner that keeps clear: h, b, a and c for [`Kind::Beside`].
    pub points: [u32; 4],
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Outside the side h–a of the triangle h, b, a.
    Beside,
    /// On the side of the triangle's plane that its normal points to, for +1, or away from it, for −1.
    Facing(f64),
}

impl Contact {
    /// The signed length by which the corner keeps clear and its gradient; `None` where the triangle has collapsed.
    pub fn evaluate(&self, x: &[Vector3<f64>]) -> Option<(f64, [Vector3<f64>; 4])> {
        let p = self.points.map(|i| x[i as usize]);
        match self.kind {
            Kind::Beside => {
                let Signed { value, gradient } =
                    Condition::SecondClear.evaluate(&[p[0], p[1], p[2], p[3], p[3]])?;
                let [h, b, a, c, _] = gradient;
                Some((value, [h, b, a, c]))
            }
            Kind::Facing(side) => {
                let (value, gradient) = off_plane(&p)?;
                Some((side * value, gradient.map(|g| g * side)))
            }
        }
    }
}

/// How far the last of four points is off the plane of the others, on the side that they turn counter-clockwise seen from,
/// and the gradient; `None` where they have collapsed.
pub(super) fn off_plane(p: &[Vector3<f64>; 4]) -> Option<(f64, [Vector3<f64>; 4])> {
    let (u, v, w) = (p[1] - p[0], p[2] - p[0], p[3] - p[0]);
    let normal = u.cross(&v);
    let length = normal.norm();
    let n = normal.try_normalize(1e-12)?;
    let value = n.dot(&w);
    let q = (w - n * value) / length;
    let (du, dv) = (v.cross(&q), q.cross(&u));
    Some((value, [-(du + dv + n), du, dv, n]))
}

/// Contacts that part all triangles that cross at `x` (in L).
pub(super) fn contacts(problem: &Problem, x: &[Vector3<f64>]) -> Vec<Contact> {
    let mut found = Vec::new();
    crossing(
        &problem.triangles,
        x,
        &centroids(&problem.triangles, x),
        |a, b| part(problem.triangles[a], problem.triangles[b], x, &mut found),
    );
    found
}

/// The contacts that part two triangles the shortest way.
fn part(first: [u32; 3], second: [u32; 3], x: &[Vector3<f64>], found: &mut Vec<Contact>) {
    let at = |t: [u32; 3]| t.map(|i| x[i as usize]);
    let normal = |p: [Vector3<f64>; 3]| (p[1] - p[0]).cross(&(p[2] - p[0])).try_normalize(0.0);
    let (Some(n1), Some(n2)) = (normal(at(first)), normal(at(second))) else {
        return;
    };
    // (depth, contacts) of the way with the least depth.
    let mut best: Option<(f64, Vec<Contact>)> = None;
    for (host, guest) in [(first, second), (second, first)] {
        let kinds: Vec<(Kind, [u32; 3])> = if n1.dot(&n2) > ONE_PLANE {
            // Outside each of the sides: h, the third corner, a.
            (0..3)
                .map(|k| {
                    (
                        Kind::Beside,
                        [host[k], host[(k + 2) % 3], host[(k + 1) % 3]],
                    )
                })
                .collect()
        } else {
            [1.0, -1.0].map(|side| (Kind::Facing(side), host)).into()
        };
        for (kind, host) in kinds {
            let way = guest.map(|c| Contact {
                points: [host[0], host[1], host[2], c],
                kind,
            });
            let clear = way.map(|contact| contact.evaluate(x).map_or(0.0, |(value, _)| value));
            let depth = clear.iter().fold(0.0f64, |m, c| m.max(-c));
            if best.as_ref().is_none_or(|(least, _)| depth < *least) {
                // Corners that are clear now are watched too: the triangle may turn.
                best = Some((depth, way.to_vec()));
            }
        }
    }
    found.extend(best.into_iter().flat_map(|(_, way)| way));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A unit triangle at `centre`, turned by `turn` in the plane and `tilt` out of it.
    fn triangle(centre: Vector3<f64>, turn: f64, tilt: f64) -> [Vector3<f64>; 3] {
        std::array::from_fn(|k| {
            let angle = turn + k as f64 * 2.0 * std::f64::consts::FRAC_PI_3;
            let flat = Vector3::new(angle.cos(), angle.sin(), 0.0) / 3f64.sqrt();
            centre + nalgebra::Rotation3::from_euler_angles(tilt, 0.0, 0.0) * flat
        })
    }

    proptest! {
        #[test]
        fn moving_along_the_gradients_parts_any_two_triangles_that_cross(
            dx in -1.0..1.0f64, dy in -1.0..1.0f64, dz in -0.3..0.3f64,
            turn in 0.0..2.1f64, tilt in -3.1..3.1f64,
        ) {
            let mut x: Vec<_> = triangle(Vector3::zeros(), 0.3, 0.0).into();
            x.extend(triangle(Vector3::new(dx, dy, dz), turn, tilt));
            let problem = Problem { points: 6, triangles: vec![[0, 1, 2], [3, 4, 5]], hinges: Vec::new(), sigma: 2.0 };
            let all = contacts(&problem, &x);
            prop_assert!(all.is_empty() || all.len() == 3);
            // Newton steps on the violated ones alone; the triangles may bend.
            for _ in 0..60 {
                for contact in &all {
                    let (value, gradient) = contact.evaluate(&x).unwrap();
                    if value < 1e-3 {
                        let square: f64 = gradient.iter().map(|g| g.norm_squared()).sum();
                        for (i, g) in contact.points.iter().zip(gradient) {
                            x[*i as usize] += g * ((1e-3 - value) / square);
                        }
                    }
                }
            }
            prop_assert!(contacts(&problem, &x).is_empty());
        }

        #[test]
        fn gradients_agree_with_differences(raw in prop::array::uniform12(-1.0..1.0f64), which in 0..3usize) {
            let x: Vec<_> = raw.chunks(3).map(|c| Vector3::new(c[0], c[1], c[2])).collect();
            let kind = [Kind::Beside, Kind::Facing(1.0), Kind::Facing(-1.0)][which];
            let contact = Contact { points: [0, 1, 2, 3], kind };
            prop_assume!((x[1] - x[0]).cross(&(x[2] - x[0])).norm() > 0.1);
            let (_, gradient) = contact.evaluate(&x).unwrap();
            for k in 0..12 {
                let (mut up, mut down) = (x.clone(), x.clone());
                up[k / 3][k % 3] += 1e-6;
                down[k / 3][k % 3] -= 1e-6;
                let slope = (contact.evaluate(&up).unwrap().0 - contact.evaluate(&down).unwrap().0) / 2e-6;
                prop_assert!((slope - gradient[k / 3][k % 3]).abs() < 1e-5 * (1.0 + slope.abs()));
            }
        }
    }
}
