//! λ at every vertex against closed forms, with cones and with turning rims.
//!
//! Away from the cones the error is that of the mesh alone, so that it falls as the edge gets shorter; a map that is
//! wrong anywhere by more than its mesh explains fails here, though its range of λ may be right.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use std::f64::consts::PI;

use kagome::base::progress::Silent;
use kagome::conformal::{Cone, Layout, MetricSolver, Singularities, cut_graph};
use kagome::mesh::{Sample, Surface, VertexId};
use nalgebra::{Complex, Point3};

fn sample(text: &str) -> Surface {
    Sample::parse(text).unwrap().generate().unwrap()
}

/// ln λ at every vertex; the map must close.
fn log_scale(surface: &Surface, wanted: &Singularities) -> Vec<f64> {
    let metric = MetricSolver::new(surface)
        .unwrap()
        .solve(wanted, &Silent)
        .unwrap();
    let cut = cut_graph(surface, &wanted.cones);
    let layout = Layout::unfold(surface, &metric, &wanted.cones, &cut).unwrap();
    assert!(layout.closure < 1e-9 && layout.seam_gap_mm < 1e-8);
    layout.log_scale.iter().copied().collect()
}

/// The largest difference of two functions that may differ by a constant: the median of their difference.
fn error(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut off: Vec<f64> = pairs.map(|(found, exact)| found - exact).collect();
    off.sort_by(f64::total_cmp);
    let median = off[off.len() / 2];
    off.iter().map(|x| (x - median).abs()).fold(0.0, f64::max)
}

/// The error on a mesh is below `allowed`, and on one of half the edge less than half. What is allowed below is twice the
/// largest error measured; halving the edge divided the errors by 3.2 to 4.6, as it should for an error of second order.
fn falls(name: &str, allowed: f64, at: impl Fn(usize) -> f64) {
    let (coarse, fine) = (at(1), at(2));
    assert!(coarse < allowed, "{name}: ln λ is off by {coarse:.2e}");
    assert!(
        fine < 0.5 * coarse,
        "{name}: ln λ is off by {coarse:.2e}, and on the finer mesh by {fine:.2e}"
    );
}

/// The vertex nearest to a point, which is there.
fn vertex_at(surface: &Surface, point: Point3<f64>) -> VertexId {
    let away = |v: VertexId| (surface.position(v) - point).norm();
    let ids = surface.positions().ids();
    let vertex = ids.min_by(|a, b| away(*a).total_cmp(&away(*b))).unwrap();
    assert!(away(vertex) < 1e-6, "no vertex at {point}");
    vertex
}

/// Where a line from the bottom of the unit sphere through `p` meets the plane through its equator.
fn stereographic(p: Point3<f64>) -> Complex<f64> {
    Complex::new(p.x, p.y) / (1.0 + p.z)
}

/// A sphere with cones of +1 at the corners of an octahedron, at z = 0, ∞, ±1, ±i in the plane: the flat metric is
/// |z (z⁴ − 1)|^(−1/3) |dz|, the sphere's own is 2 |dz| / (1 + |z|²).
#[test]
fn a_sphere_with_the_cones_of_an_octahedron() {
    falls("octahedron", 3e-3, |fineness| {
        let sphere = sample(&format!("octasphere:faces={}", 2048 * fineness * fineness));
        let radius = sphere.position(VertexId(0)).coords.norm();
        let mut cones = Vec::new();
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let mut corner = Point3::origin();
                corner[axis] = sign * radius;
                let vertex = vertex_at(&sphere, corner);
                cones.push(Cone { vertex, units: 1 });
            }
        }
        let found = log_scale(&sphere, &Singularities::cones(&sphere, cones.clone()));
        let kept = sphere.positions().ids().filter(|v| {
            let near = |c: &Cone| (sphere.position(*v) - sphere.position(c.vertex)).norm();
            cones.iter().all(|c| near(c) > 0.4 * radius)
        });
        error(kept.map(|v| {
            let z = stereographic(sphere.position(v) / radius);
            let cones = (z * (z.powi(4) - 1.0)).norm().cbrt();
            let exact = (2.0 / (1.0 + z.norm_sqr()) * cones).ln();
            (found[v.0 as usize], exact)
        }))
    });
}

/// A spherical cap with a cone of +1 at its pole: the flat metric is |z|^(−1/3) |dz|.
#[test]
fn a_cap_with_a_cone_at_its_pole() {
    for half_angle_deg in [60.0f64, 110.0] {
        falls(&format!("cap of {half_angle_deg}°"), 1.5e-3, |fineness| {
            let faces = 2000 * fineness * fineness;
            let cap = sample(&format!(
                "cap:half_angle_deg={half_angle_deg},faces={faces}"
            ));
            let z_of = |v: VertexId| cap.position(v).z;
            let ids = || cap.positions().ids();
            let pole = ids().max_by(|a, b| z_of(*a).total_cmp(&z_of(*b))).unwrap();
            let depth = z_of(pole) - z_of(cap.rims()[0][0]);
            let radius = depth / (1.0 - half_angle_deg.to_radians().cos());
            let cone = Cone {
                vertex: pole,
                units: 1,
            };
            let found = log_scale(&cap, &Singularities::cones(&cap, vec![cone]));
            let kept =
                ids().filter(|v| (cap.position(*v) - cap.position(pole)).norm() > 0.3 * radius);
            error(kept.map(|v| {
                let top = cap.position(pole);
                let on_unit = Point3::from((cap.position(v) - top) / radius);
                let z = stereographic(Point3::new(on_unit.x, on_unit.y, on_unit.z + 1.0)).norm();
                (found[v.0 as usize], (2.0 / (1.0 + z * z) * z.cbrt()).ln())
            }))
        });
    }
}

/// A surface of revolution by rings of `around` vertices, each ring turned by half a vertex against the last. `at` is
/// the profile (r, z) by the isothermal coordinate t = ∫ ds / r, which runs over `span` at steps that make the
/// triangles equilateral but for the curvature; the same t for every vertex of a ring comes along.
fn revolved(
    around: usize,
    span: (f64, f64),
    at: &dyn Fn(f64) -> (f64, f64),
) -> (Surface, Vec<f64>) {
    let step = 0.75f64.sqrt() * 2.0 * PI / around as f64;
    let rings = ((span.1 - span.0) / step).round() as usize;
    let (mut positions, mut heights, mut faces) = (vec![], vec![], vec![]);
    for ring in 0..=rings {
        let t = span.0 + (span.1 - span.0) * ring as f64 / rings as f64;
        let (r, z) = at(t);
        for i in 0..around {
            let angle = (i as f64 + 0.5 * (ring % 2) as f64) * 2.0 * PI / around as f64;
            positions.push(Point3::new(r * angle.cos(), r * angle.sin(), z));
            heights.push(t);
        }
    }
    for ring in 0..rings {
        for i in 0..around {
            let vertex = |ring: usize, i: usize| (ring * around + i % around) as u32;
            let (here, next, odd) = (ring, ring + 1, ring % 2);
            let above = vertex(next, i + odd);
            faces.push([vertex(here, i), vertex(here, i + 1), above]);
            faces.push([vertex(here, i + 1), vertex(next, i + 1 + odd), above]);
        }
    }
    (Surface::new(positions, faces).unwrap(), heights)
}

/// With rims that turn by ∓2πa a surface of revolution becomes a fan, or for a = 0 a strip, and λ = r e^(−at).
fn turned_to_a_fan(name: &str, span: (f64, f64), at: &dyn Fn(f64) -> (f64, f64), allowed: f64) {
    for third in -3..=3i32 {
        let off = |fineness: usize| {
            let (surface, heights) = revolved(32 * fineness, span, at);
            // a > 0 opens the fan towards large t: the rim at small t is the inner one and turns by −2πa.
            let first_is_low = heights[surface.rims()[0][0].0 as usize] < 0.5 * (span.0 + span.1);
            let wanted = Singularities {
                turnings: vec![if first_is_low { third } else { -third }],
                ..Singularities::default()
            };
            let found = log_scale(&surface, &wanted);
            let exact = |t: f64| at(t).0.ln() - f64::from(third) / 3.0 * t;
            error(found.iter().zip(&heights).map(|(l, t)| (*l, exact(*t))))
        };
        if third == 0 {
            // All rings become equally long, whatever the mesh.
            assert!(off(1) < 1e-9, "{name}: {:e}", off(1));
        } else {
            falls(&format!("{name} turned by {third}/3"), allowed, off);
        }
    }
}

/// A frustum, r = r₀ + s sin α: t = ln(r / r₀) / sin α. Turned by sin α it would be developable.
#[test]
fn a_frustum_unrolled_to_fans() {
    let alpha = 25f64.to_radians();
    let profile = |t: f64| {
        let r = 40.0 * (t * alpha.sin()).exp();
        (r, (r - 40.0) / alpha.tan())
    };
    turned_to_a_fan("frustum", (0.0, 2.5), &profile, 3e-3);
    // With sin α = 1/3 it is, turned by a third: λ is then the same everywhere but for the corners that the rings have.
    let alpha = (1.0f64 / 3.0).asin();
    let profile = |t: f64| {
        let r = 40.0 * (t / 3.0).exp();
        (r, (r - 40.0) / alpha.tan())
    };
    turned_to_a_fan("developable frustum", (0.0, 2.5), &profile, 3e-3);
}

/// The tractrix about its axis, r = R sech x, z = R (x − tanh x), of curvature −1/R²: t = cosh x, so that r = R / t.
#[test]
fn a_pseudosphere_unrolled_to_fans() {
    let profile = |t: f64| {
        let x = t.acosh();
        (100.0 / t, 100.0 * (x - x.tanh()))
    };
    turned_to_a_fan("pseudosphere", (1.05, 3.5), &profile, 7e-3);
}
