//! Conformal maps against closed forms.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use kagome::base::progress::Silent;
use std::f64::consts::PI;

use kagome::conformal::{
    Cone, ConeRequest, FlattenOptions, Flattened, Layout, MetricSolver, Singularities, Sizing,
    cut_graph, flatten,
};
use kagome::linkage::fit;
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
            .solve(&Singularities::none(&cap), &Silent)
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
            sizing: Sizing::Triangles(500.0),
            cone_clearance: 0.7,
        };
        let flat = flatten(&cap, &ConeRequest::Auto, &options, &Silent).unwrap();
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
            sizing: Sizing::Triangles(1500.0),
            cone_clearance: 1.1,
        };
        let given = ConeRequest::Given(Singularities::cones(&bump, cones.clone()));
        let flat = flatten(&bump, &given, &options, &Silent).unwrap();
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
            sizing: Sizing::Triangles(500.0),
            cone_clearance: 1.1,
        };
        let cone = Cone {
            vertex: tip,
            units: 1,
        };
        let given = ConeRequest::Given(Singularities::cones(&mask, vec![cone]));
        let layout = flatten(&mask, &given, &options, &Silent).unwrap().layout;
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
    let none = Singularities::none(&bump);
    let first = solver.solve(&none, &Silent).unwrap();
    let cone = Cone {
        vertex: VertexId(0),
        units: -1,
    };
    let other = Singularities::cones(&bump, vec![cone]);
    solver.solve(&other, &Silent).unwrap();
    let again = solver.solve(&none, &Silent).unwrap();
    assert_eq!(first.u, again.u);
}

/// λ's largest over smallest value with these singularities; the map must close.
fn ratio(surface: &Surface, singularities: &Singularities) -> f64 {
    let metric = MetricSolver::new(surface)
        .unwrap()
        .solve(singularities, &Silent)
        .unwrap();
    let cut = cut_graph(surface, &singularities.cones);
    let layout = Layout::unfold(surface, &metric, &singularities.cones, &cut).unwrap();
    assert!(
        layout.closure < 1e-9 && layout.seam_gap_mm < 1e-8,
        "{:e} {:e}",
        layout.closure,
        layout.seam_gap_mm
    );
    let (low, high) = layout
        .log_scale
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| {
            (l.min(x), h.max(x))
        });
    (high - low).exp()
}

/// A torus needs no cone: its map is that of the paper (§3.1.1), with λ's ratio (t + 1)/(t − 1).
#[test]
fn a_torus_needs_the_ratio_of_its_closed_form() {
    for t in [13f64.sqrt(), 4.0, 6.0] {
        let torus = sample(&format!("torus:t={t},faces=20000"));
        let found = ratio(&torus, &Singularities::none(&torus));
        let exact = (t + 1.0) / (t - 1.0);
        assert!(
            (found / exact - 1.0).abs() < 2e-3,
            "t = {t}: {found}, not {exact}"
        );
    }
}

/// A surface of revolution is unrolled to a fan of angle 2πa, on which λ = r e^{−as} up to a factor, with the conformal
/// height s = ∫ dl / r. The turning of its rims chooses a in thirds, and the scale follows.
#[test]
fn the_turning_of_a_rim_changes_the_scale_as_on_a_fan() {
    for name in ["funnel", "vase", "catenoid"] {
        let surface = sample(&format!("{name}:faces=20000"));
        let mut profile: Vec<(f64, f64)> = surface
            .positions()
            .iter()
            .map(|p| (p.z, p.x.hypot(p.y)))
            .collect();
        profile.sort_by(|a, b| a.0.total_cmp(&b.0));
        profile.dedup_by(|b, a| (a.0 - b.0).abs() < 1e-6);
        let upwards = surface.position(surface.rims()[0][0]).z > profile[profile.len() / 2].0;
        for third in -3..=3 {
            let (mut s, mut low, mut high) = (0.0, f64::INFINITY, 0.0f64);
            let mut before = profile[0];
            for &(z, r) in &profile {
                s += (z - before.0).hypot(r - before.1) / (0.5 * (r + before.1));
                before = (z, r);
                let scale = r * (-f64::from(third) / 3.0 * s).exp();
                (low, high) = (low.min(scale), high.max(scale));
            }
            // a > 0 opens the fan upwards: the lower rim is the inner one and turns by −2πa.
            let turnings = vec![if upwards { -third } else { third }];
            let given = Singularities {
                turnings,
                ..Singularities::default()
            };
            let found = ratio(&surface, &given);
            assert!(
                (found / (high / low) - 1.0).abs() < 5e-3,
                "{name} at {third}: {found}, not {}",
                high / low
            );
        }
    }
}

/// How far the vertices of a rim, all their copies, are from one line; the cut's translation must be along it.
fn off_a_line(surface: &Surface, layout: &Layout, rim: &[VertexId]) -> f64 {
    let along = layout.rim_direction(surface, rim);
    (0..3)
        .map(|k| {
            let (sin, cos) = (along + f64::from(k) * PI / 3.0).sin_cos();
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for h in surface.halfedges() {
                if rim.contains(&surface.tail(h)) {
                    let p = layout.corners[h.face()][h.corner()];
                    let off = cos * p.y - sin * p.x;
                    (low, high) = (low.min(off), high.max(off));
                }
            }
            high - low
        })
        .fold(f64::INFINITY, f64::min)
}

/// The end of a tube becomes a line on the sheet, and a lattice along it has a row of edges along the hem.
#[test]
fn a_straight_hem_lies_on_a_line_that_the_lattice_follows() {
    // Sheared, so that nothing is straight by symmetry.
    let (mut positions, faces) = sample("vase:faces=3000").to_arrays();
    positions.iter_mut().for_each(|p| p.z += 0.4 * p.x);
    let vase = Surface::new(positions, faces).unwrap();
    let options = FlattenOptions {
        sigma: 2.0,
        sizing: Sizing::Triangles(400.0),
        cone_clearance: 0.7,
    };
    for straight in [vec![0], vec![1], vec![0, 1]] {
        let mut solver = MetricSolver::new(&vase).unwrap();
        let wanted = Singularities {
            turnings: vec![0],
            straight: straight.clone(),
            ..Singularities::default()
        };
        let flat = Flattened::solve(&mut solver, &wanted, &options, &Silent).unwrap();
        for (i, rim) in vase.rims().iter().enumerate() {
            let off = off_a_line(&vase, &flat.layout, rim);
            let u = rim.iter().map(|&v| flat.metric.u[v]);
            let (low, high) = (u.clone().fold(9.0, f64::min), u.fold(-9.0, f64::max));
            if straight.contains(&i) {
                assert!(off < 1e-9 && high - low > 0.01, "{off:e} mm off a line");
            } else {
                assert!(off > 1.0 && high == low, "{off:e} mm off a line");
            }
        }
        let along = flat.layout.rim_direction(&vase, &vase.rims()[straight[0]]);
        // Fourteen edges around: the lattice that follows the hem goes on across the seam as it is.
        let around = flat.layout.segments[0].transition.shift.norm();
        let edge_mm = around / 14.0;
        let deg = Some(along.to_degrees());
        let fitted = fit(&vase, &flat.layout, edge_mm, true, deg, &Silent).unwrap();
        let turned = fitted
            .layout
            .rim_direction(&vase, &vase.rims()[straight[0]]);
        assert!((turned.to_degrees() - fitted.orientation_deg).abs() < 1e-9);
        assert!(
            fitted.distortion < 1e-9,
            "warped by {:e}",
            fitted.distortion
        );
    }
    // What turns cannot be straight, and what was solved before leaves no trace.
    let mut solver = MetricSolver::new(&vase).unwrap();
    let turning = Singularities {
        turnings: vec![-1],
        straight: vec![1],
        ..Singularities::default()
    };
    let error = solver.solve(&turning, &Silent).unwrap_err().to_string();
    assert!(
        error.contains("rim 2") && error.contains("-120°"),
        "{error}"
    );
    let plain = Singularities {
        turnings: vec![0],
        ..Singularities::default()
    };
    let hemmed = Singularities {
        straight: vec![1],
        ..plain.clone()
    };
    let before = solver.solve(&plain, &Silent).unwrap();
    solver.solve(&hemmed, &Silent).unwrap();
    assert_eq!(solver.solve(&plain, &Silent).unwrap().u, before.u);
}

/// Cones of +1 at the vertices that are farthest along the axes.
fn octahedron(sphere: &Surface) -> Vec<Cone> {
    (0..6)
        .map(|i| {
            let axis = if i % 2 == 0 { 1.0 } else { -1.0 };
            let vertex = sphere
                .positions()
                .ids()
                .max_by(|a, b| {
                    let at = |v: &VertexId| sphere.position(*v)[i / 2] * axis;
                    at(a).total_cmp(&at(b))
                })
                .unwrap();
            Cone { vertex, units: 1 }
        })
        .collect()
}

/// A sphere with cones of +1 at the corners of an octahedron; and curvature that does not add up is refused.
#[test]
fn a_closed_surface_needs_cones_that_sum_to_its_curvature() {
    let sphere = sample("octasphere");
    let mut all = Singularities::cones(&sphere, octahedron(&sphere));
    assert!(ratio(&sphere, &all) > 2.0, "λ falls to 0 at the cones");
    all.cones.pop();
    let error = MetricSolver::new(&sphere)
        .unwrap()
        .solve(&all, &Silent)
        .unwrap_err();
    assert!(error.to_string().contains("exactly 6"), "{error}");
}

/// A mesh spoilt at random: vertices pulled almost onto a neighbour (needles), near the line between two neighbours
/// (caps), or, with every fourth seed, anywhere within some edges, so that faces overlap wildly.
fn spoilt(surface: &Surface, seed: u64, share: f64) -> Surface {
    let mut state = seed;
    let mut random = move || {
        // xorshift, so that a failure can be repeated.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..8).for_each(|_| {
        random();
    });
    let wild = seed.is_multiple_of(4);
    let edge = surface.length(kagome::mesh::HalfedgeId::side(kagome::mesh::FaceId(0), 0));
    let (mut positions, faces) = surface.to_arrays();
    for v in surface.positions().ids() {
        if random() >= share {
            continue;
        }
        let ring: Vec<VertexId> = surface.around(v).map(|h| surface.head(h)).collect();
        let mut pick = || {
            let i = (random() * ring.len() as f64) as usize;
            positions[ring[i.min(ring.len() - 1)].0 as usize]
        };
        let (a, b) = (pick(), pick());
        let part = [0.5, 0.9, 0.999, 1.0 - 1e-6][(random() * 4.0) as usize % 4];
        let p = positions[v.0 as usize];
        if wild {
            let n = p.coords.normalize();
            let d =
                nalgebra::Vector3::new(random() - 0.5, random() - 0.5, random() - 0.5) * 6.0 * edge;
            positions[v.0 as usize] = p + d - n * n.dot(&d);
            continue;
        }
        positions[v.0 as usize] = if random() < 0.5 || a == b {
            p + (a - p) * part
        } else {
            nalgebra::center(&a, &b) + (nalgebra::center(&a, &b) - p) * (random() - 0.5) * 0.2
        };
    }
    Surface::new(positions, faces).unwrap()
}

/// Whatever the triangles look like there is a flat metric, and its chart closes; where vertices only moved a little
/// along the surface, u stays what it was.
#[test]
fn spoilt_meshes_of_any_topology_are_flattened_all_the_same() {
    let mut flipped = 0;
    for seed in 1..=8 {
        for name in ["cap", "vase", "torus", "octasphere"] {
            let plain = sample(&format!("{name}:faces=800"));
            let cones: Vec<Cone> = match name {
                "octasphere" => octahedron(&plain),
                _ => Vec::new(),
            };
            let mut wanted = Singularities::cones(&plain, cones.clone());
            if name == "vase" {
                wanted.turnings = vec![0];
                wanted.straight = [vec![0], vec![]][seed % 2].clone();
            }
            let share = [0.02, 0.1, 0.3][seed % 3];
            let surface = spoilt(&plain, seed as u64, share);
            let metric = MetricSolver::new(&surface)
                .unwrap()
                .solve(&wanted, &Silent)
                .unwrap_or_else(|e| panic!("{name} {seed}: {e}"));
            flipped += usize::from(metric.flips > 0);
            assert!(metric.residual < 1e-8 && metric.broken.len() < surface.faces().len() / 20);
            let layout =
                Layout::unfold(&surface, &metric, &cones, &cut_graph(&surface, &cones)).unwrap();
            assert!(layout.seam_gap_mm < 1e-5, "{name} {seed}");
            for (face, flat) in layout.corners.iter_ids() {
                let lengths = metric.lengths(&surface, face);
                for k in 0..3 {
                    let off = (flat[(k + 1) % 3] - flat[k]).norm() - lengths[k];
                    assert!(off.abs() < 1e-6, "{name} {seed}: off by {off:e} mm");
                }
            }
            if share < 0.05 && seed % 4 > 0 {
                let before = MetricSolver::new(&plain).unwrap().solve(&wanted, &Silent);
                let mut change: Vec<f64> = before
                    .unwrap()
                    .u
                    .iter()
                    .zip(metric.u.iter())
                    .map(|(a, b)| (a - b).abs())
                    .collect();
                change.sort_by(f64::total_cmp);
                assert!(change[change.len() / 2] < 0.02, "{name} {seed}");
            }
        }
    }
    assert!(flipped > 16, "only {flipped} needed flips");
}
