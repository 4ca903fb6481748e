//! From sample surfaces to exact linkages, and what happens where σ forbids one.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use kagome::base::progress::Silent;
use kagome::conformal::{ConeRequest, FlattenOptions, Singularities, Sizing, flatten};
use kagome::linkage::{Built, Handedness, LinkageOptions, build};
use kagome::mesh::{ClosestPoint, Sample, Surface};
use kagome::rationalize::{AlternatingProjection, ProjectionOptions, Quality, Solver, rationalize};
use proptest::prelude::*;

struct Case {
    surface: Surface,
    built: Built,
    sigma: f64,
}

fn case(
    name: &str,
    triangles: f64,
    remove: usize,
    cones: ConeRequest,
    orientation: f64,
    handedness: Handedness,
) -> Case {
    let surface = Sample::parse(name).unwrap().generate().unwrap();
    let sigma = 2.0;
    let options = FlattenOptions {
        sigma,
        sizing: Sizing::Triangles(triangles),
        cone_clearance: if remove > 0 { 1.1 } else { 0.7 },
    };
    let flat = flatten(&surface, &cones, &options, &Silent).unwrap();
    let options = LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation,
        handedness,
        remove_at_cone: remove,
        sigma,
    };
    let built = build(&surface, &flat.layout, &options, &Silent).unwrap();
    Case {
        surface,
        built,
        sigma,
    }
}

impl Case {
    fn solve(&self, solver: Solver) -> Quality {
        let closest = ClosestPoint::new(&self.surface);
        let linkage = &self.built.linkage;
        let (positions, _) = rationalize(
            linkage,
            &self.built.start,
            &closest,
            self.sigma,
            solver,
            &Silent,
        )
        .unwrap();
        Quality::measure(linkage, &positions, &self.surface, &closest, self.sigma)
    }
}

fn assert_sound(q: &Quality, what: &str) {
    assert!(
        q.edge_error_max <= 1e-12,
        "{what}: edges {:e}",
        q.edge_error_max
    );
    assert!(
        q.distance_max.value <= 0.1,
        "{what}: distance {}",
        q.distance_max.value
    );
    assert_eq!(
        (q.penetrations, q.intersections, q.facing_away, q.over_sigma),
        (0, 0, 0, 0),
        "{what}"
    );
    assert!(q.coverage >= 0.9, "{what}: coverage {}", q.coverage);
}

#[test]
fn what_is_within_reach_is_reached_exactly() {
    for (name, remove) in [("hemisphere", 0), ("cap", 0), ("saddle", 0), ("bump", 4)] {
        for handedness in [Handedness::Right, Handedness::Left] {
            let case = case(name, 500.0, remove, ConeRequest::Auto, 0.0, handedness);
            assert!(case.built.overlaps.is_empty());
            assert_sound(&case.solve(Solver::Exact), name);
        }
    }
}

#[test]
fn a_steep_bump_without_its_cone_keeps_its_edges_and_shows_the_distance() {
    let case = case(
        "bump",
        700.0,
        0,
        ConeRequest::Given(Singularities::default()),
        0.0,
        Handedness::Right,
    );
    let q = case.solve(Solver::Exact);
    assert!(q.edge_error_max < 1e-12, "{:e}", q.edge_error_max);
    assert!(q.distance_max.value > 0.3, "{}", q.distance_max.value);
    // The place is the tip: within a few edges of the axis.
    let [x, y, _] = q.distance_max.at_mm;
    assert!(x.hypot(y) < 4.0 * q.edge_mm);
}

#[test]
fn the_papers_projection_comes_close_and_accelerated_it_is_exact() {
    let case = case("cap", 500.0, 0, ConeRequest::Auto, 0.0, Handedness::Right);
    let printed = projected(&case, &ProjectionOptions::as_printed());
    assert!(printed.edge_error_max < 1e-2 && printed.distance_max.value < 0.05);
    assert_eq!(printed.penetrations, 0);
    let accelerated = case.solve(Solver::Projection);
    assert!(
        accelerated.edge_error_max < 1e-7,
        "{:e}",
        accelerated.edge_error_max
    );
    assert!(accelerated.edge_error_max < 1e-2 * printed.edge_error_max);
}

/// What alternating projections end with.
fn projected(case: &Case, options: &ProjectionOptions) -> Quality {
    let closest = ClosestPoint::new(&case.surface);
    let linkage = &case.built.linkage;
    let mut solver =
        AlternatingProjection::new(linkage, &case.built.start, &closest, options).unwrap();
    solver.run(&Silent).unwrap();
    let positions = solver.positions();
    Quality::measure(linkage, &positions, &case.surface, &closest, case.sigma)
}

/// A point reached 250 iterations from the lift against the same number without acceleration, and against four times
/// as many.
#[test]
fn acceleration_gains_orders_of_magnitude() {
    for (name, gain, gain_over_four) in [("hemisphere", 1e6, 1e5), ("vase", 1e6, 1e5)] {
        let case = case(name, 1300.0, 0, ConeRequest::Auto, 0.0, Handedness::Right);
        let run = |window, finishing| {
            let options = ProjectionOptions {
                window,
                finishing,
                ..ProjectionOptions::default()
            };
            projected(&case, &options)
        };
        let (plain, four, fast) = (run(0, 200), run(0, 950), run(5, 200));
        for (slow, gain) in [(plain, gain), (four, gain_over_four)] {
            assert!(
                fast.edge_error_max * gain < slow.edge_error_max,
                "{name}: {:e} against {:e}",
                fast.edge_error_max,
                slow.edge_error_max
            );
            assert!(fast.distance_max.value * gain < slow.distance_max.value);
        }
        assert_eq!(fast.penetrations, 0);
    }
}

#[test]
fn a_preview_with_held_closest_points_shows_the_shape() {
    let case = case("cap", 500.0, 0, ConeRequest::Auto, 0.0, Handedness::Right);
    let q = projected(&case, &ProjectionOptions::preview());
    assert!(q.edge_error_max < 1e-2 && q.distance_max.value < 0.05);
    assert_eq!(q.penetrations, 0);
}

#[test]
fn removing_triangles_at_the_cone_leaves_four_then_sixteen_fewer() {
    let count = |remove| {
        let case = case(
            "bump",
            800.0,
            remove,
            ConeRequest::Auto,
            0.0,
            Handedness::Right,
        );
        (
            case.built.linkage.triangles.len() + case.built.lost,
            case.built.removed,
        )
    };
    // λ is normalised alike for both, so the lattices are the same.
    let (with_four, four) = count(4);
    let (with_sixteen, sixteen) = count(16);
    assert_eq!((four, sixteen), (4, 16));
    assert_eq!(with_four - with_sixteen, 12);
}

/// Surfaces within reach at σ = 2, without a seam that would have to be fitted, and triangles to remove at their cone.
const WITHIN_REACH: [(&str, usize); 5] = [
    ("cap", 0),
    ("saddle", 0),
    ("hemisphere", 0),
    ("bump", 4),
    ("bump:height_mm=40", 0),
];

/// A linkage in a random direction with L between 1/15 and 1/60 of the surface's longest side, opened, and each point
/// moved by up to 0.2 L in a random direction, must come back to an exact one.
fn noisy_start_reaches_strict(which: usize, fineness: f64, orientation: f64, seed: u64) {
    let (name, remove) = WITHIN_REACH[which];
    let surface = Sample::parse(name).unwrap().generate().unwrap();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in surface.positions().iter() {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let sigma = 2.0;
    let options = FlattenOptions {
        sigma,
        sizing: Sizing::EdgeMm(size / fineness),
        cone_clearance: if remove > 0 { 1.1 } else { 0.7 },
    };
    let flat = flatten(&surface, &ConeRequest::Auto, &options, &Silent).unwrap();
    let options = LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation,
        handedness: Handedness::Right,
        remove_at_cone: remove,
        sigma,
    };
    let mut built = build(&surface, &flat.layout, &options, &Silent).unwrap();
    // A small generator of our own, so that a case can be named by its seed.
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    };
    for p in &mut built.start {
        let noise = loop {
            let v = nalgebra::Vector3::new(random(), random(), random());
            if v.norm() <= 1.0 {
                break v;
            }
        };
        *p += noise * 0.2 * flat.edge_mm;
    }
    let case = Case {
        surface,
        built,
        sigma,
    };
    let what = format!("{name} L = size/{fineness:.2} at {orientation:.4} rad, seed {seed}");
    assert_sound(&case.solve(Solver::Exact), &what);
}

#[test]
fn noisy_starts_reach_strict() {
    for which in 0..WITHIN_REACH.len() {
        for k in 0..2 {
            let n = (2 * which + k) as f64;
            noisy_start_reaches_strict(which, 15.0 + 1.3 * n, 0.7 * n, n as u64);
        }
    }
}

/// Slow: 500 of them, by two threads.
#[test]
#[ignore = "minutes"]
fn five_hundred_noisy_starts_reach_strict() {
    let run = |thread: u64| {
        for n in (thread..500).step_by(2) {
            // Golden-ratio steps spread the sizes (by their logarithm) and directions evenly.
            let part = |ratio: f64| (n as f64 * ratio).fract();
            let fineness = 15.0 * 4f64.powf(part(0.618_033_988_75));
            let orientation = std::f64::consts::TAU * part(0.754_877_666_25);
            noisy_start_reaches_strict((n % 5) as usize, fineness, orientation, n);
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| run(0));
        run(1);
    });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any orientation, size and handedness: every triangle is held by two others at least, every seam hinge turns by
    /// 120° and keeps colours, flat triangles are equilateral and distinct, and the solve ends exact.
    #[test]
    fn any_lattice_on_a_bump_is_consistent(
        orientation in 0.0..6.3f64, triangles in 200.0..700.0f64, left: bool, remove in prop::sample::select(vec![0usize, 4, 16]),
    ) {
        let handedness = if left { Handedness::Left } else { Handedness::Right };
        let case = case("bump", triangles, remove, ConeRequest::Auto, orientation, handedness);
        let linkage = &case.built.linkage;
        let edge = linkage.edge_mm;
        for t in linkage.triangles.iter() {
            for k in 0..3 {
                prop_assert!(((t.flat[(k + 1) % 3] - t.flat[k]).norm() / edge - 1.0).abs() < 1e-9);
            }
            prop_assert!((t.flat[1] - t.flat[0]).perp(&(t.flat[2] - t.flat[0])) > 0.0);
        }
        for n in linkage.neighbours().iter() {
            prop_assert!(n.iter().flatten().count() >= 2);
        }
        for h in linkage.hinges.iter() {
            let (a, b) = (&linkage.triangles[h.ccw.triangle], &linkage.triangles[h.cw.triangle]);
            prop_assert!(a.colour != b.colour);
            // The slit edge as both triangles see it on the sheet.
            let (i, j) = (h.ccw.corner, h.cw.corner);
            let (mine, theirs) = (a.flat[(i + 2) % 3] - a.flat[i], b.flat[(j + 1) % 3] - b.flat[j]);
            let turn = mine.perp(&theirs).atan2(mine.dot(&theirs)).to_degrees();
            let expected = if h.seam { 120.0 } else { 0.0 };
            prop_assert!((turn.abs() - expected).abs() < 1e-6, "turn {turn}, seam {}", h.seam);
        }
        prop_assert!(case.built.overlaps.is_empty());
        let q = case.solve(Solver::Exact);
        prop_assert!(q.edge_error_max < 1e-12);
        prop_assert_eq!((q.penetrations, q.over_sigma), (0, 0));
    }
}
