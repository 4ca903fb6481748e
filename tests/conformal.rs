//! Conformal maps against closed forms.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use kagome::base::progress::Silent;
use kagome::conformal::{Cone, ConeRequest, FlattenOptions, MetricSolver, Sizing, flatten};
use kagome::mesh::{Sample, Surface, VertexId};

fn sample(text: &str) -> Surface {
    Sample::parse(text).unwrap().generate().unwrap()
}

/// A cap lifted stereographically from a plane mesh is discretely conformally equivalent to it, so the map must come
/// back exactly: u* = ln((1 + cos θ)/(1 + cos φ)) for the half-angle θ and the angle φ from the pole.
#[test]
fn caps_come_back_to_ten_digits() {
    for half_angle_deg in [30.0f64, 45.0, 60.0, 75.0, 90.0, 120.0, 150.0] {
        let cap = sample(&format!("cap:half_angle_deg={half_angle_deg}"));
        let metric = MetricSolver::new(&cap)
            .unwrap()
            .solve(&[], &Silent)
            .unwrap();
        let top = cap
            .positions()
            .iter()
            .map(|p| p.z)
            .fold(f64::NEG_INFINITY, f64::max);
        let rim_z = cap.position(cap.rims()[0][0]).z;
        let cos = half_angle_deg.to_radians().cos();
        let radius = (top - rim_z) / (1.0 - cos);
        let mut worst = 0.0f64;
        for (vertex, p) in cap.positions().iter_ids() {
            let cos_here = 1.0 - (top - p.z) / radius;
            let exact = ((1.0 + cos) / (1.0 + cos_here)).ln();
            worst = worst.max((metric.u[vertex] - exact).abs());
        }
        assert!(
            worst < 1e-10,
            "{half_angle_deg}°: {worst:e} in {} steps",
            metric.steps
        );
        assert!(
            metric.steps <= 9,
            "{half_angle_deg}°: {} steps",
            metric.steps
        );
    }
}

/// The scale range of a cap is 1/cos²(θ/2): 1.3333 at 60°, 2 for the hemisphere (paper, §3.1.1).
#[test]
fn caps_need_the_sigma_of_their_closed_form() {
    for (half_angle_deg, sigma) in [
        (30.0, 1.07180),
        (45.0, 1.17157),
        (60.0, 1.33333),
        (75.0, 1.58879),
        (90.0, 2.0),
    ] {
        let cap = sample(&format!("cap:half_angle_deg={half_angle_deg}"));
        let options = FlattenOptions {
            sigma: 2.0,
            cones: ConeRequest::Auto,
            sizing: Sizing::Triangles(500.0),
            cone_clearance: 0.7,
        };
        let flat = flatten(&cap, &options, &Silent).unwrap();
        assert!(flat.layout.cones.is_empty(), "a cap within σ needs no cone");
        let ratio = flat.scale.max / flat.scale.min;
        assert!((ratio - sigma).abs() < 1e-5, "{half_angle_deg}°: {ratio}");
    }
}

/// Layouts close: edge lengths in the chart are those of the metric, and the map is conformal up to the mesh's size.
#[test]
fn unfolding_closes_with_and_without_a_cone() {
    let bump = sample("bump");
    let tip = bump
        .positions()
        .ids()
        .max_by(|a, b| bump.position(*a).z.total_cmp(&bump.position(*b).z))
        .unwrap();
    for cones in [
        vec![],
        vec![Cone {
            vertex: tip,
            units: 1,
        }],
    ] {
        let options = FlattenOptions {
            sigma: 2.0,
            cones: ConeRequest::Given(cones.clone()),
            sizing: Sizing::Triangles(1500.0),
            cone_clearance: 1.1,
        };
        let flat = flatten(&bump, &options, &Silent).unwrap();
        assert!(flat.layout.closure < 1e-9, "{:e}", flat.layout.closure);
        assert!(
            flat.layout
                .corners
                .iter()
                .all(|c| (c[1] - c[0]).perp(&(c[2] - c[0])) > 0.0)
        );
        if let Some(cone) = cones.first() {
            // The cone is the origin, and the angles around it sum to 240°.
            let mut sum = 0.0;
            for h in bump.around(cone.vertex) {
                let c = &flat.layout.corners[h.face()];
                let k = h.corner();
                assert!(c[k].coords.norm() < 1e-9);
                let (a, b) = (c[(k + 1) % 3] - c[k], c[(k + 2) % 3] - c[k]);
                sum += a.perp(&b).atan2(a.dot(&b));
            }
            assert!((sum.to_degrees() - 240.0).abs() < 1e-9);
            // Seam transitions really join the two sides.
            for (h, motion) in &flat.layout.seam {
                let twin = bump.twin(*h).unwrap();
                let (mine, theirs) = (
                    &flat.layout.corners[h.face()],
                    &flat.layout.corners[twin.face()],
                );
                let (a, b) = (mine[h.corner()], mine[(h.corner() + 1) % 3]);
                assert!((motion.apply(a) - theirs[(twin.corner() + 1) % 3]).norm() < 1e-8);
                assert!((motion.apply(b) - theirs[twin.corner()]).norm() < 1e-8);
            }
        }
    }
}

/// Rounding errors of the unfolding add up, they do not multiply: a mesh ten times finer still closes.
#[test]
fn a_fine_mesh_unfolds_as_well_as_a_coarse_one() {
    for faces in [5_000, 100_000] {
        let mask = sample(&format!("mask:faces={faces}"));
        let tip = mask
            .positions()
            .ids()
            .max_by(|a, b| mask.position(*a).z.total_cmp(&mask.position(*b).z))
            .unwrap();
        let options = FlattenOptions {
            sigma: 2.0,
            cones: ConeRequest::Given(vec![Cone {
                vertex: tip,
                units: 1,
            }]),
            sizing: Sizing::Triangles(500.0),
            cone_clearance: 1.1,
        };
        let layout = flatten(&mask, &options, &Silent).unwrap().layout;
        assert!(layout.closure < 1e-9, "{faces}: {:e}", layout.closure);
        assert!(
            layout.seam_gap_mm < 1e-9,
            "{faces}: {:e}",
            layout.seam_gap_mm
        );
    }
}

/// Same input, same bits: the solver's state from an earlier solve leaves no trace.
#[test]
fn a_reused_solver_gives_the_same_bits() {
    let bump = sample("bump");
    let mut solver = MetricSolver::new(&bump).unwrap();
    let first = solver.solve(&[], &Silent).unwrap();
    solver
        .solve(
            &[Cone {
                vertex: VertexId(0),
                units: -1,
            }],
            &Silent,
        )
        .unwrap();
    let again = solver.solve(&[], &Silent).unwrap();
    assert_eq!(first.u, again.u);
}

#[test]
fn what_is_no_disk_is_refused_with_advice() {
    for name in ["torus", "vase", "octasphere"] {
        let options = FlattenOptions {
            sigma: 2.0,
            cones: ConeRequest::Auto,
            sizing: Sizing::Triangles(500.0),
            cone_clearance: 0.7,
        };
        let error = flatten(&sample(name), &options, &Silent)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("not a disk") && error.contains("rims"),
            "{error}"
        );
    }
}
