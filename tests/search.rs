//! What the search for singularities proposes belongs to the shape, not to where it lies or how large it is.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use kagome::base::progress::Silent;
use kagome::conformal::{FlattenOptions, Flattened, MetricSolver, SearchOptions, Sizing, search};
use kagome::mesh::{Sample, Surface};
use nalgebra::{Rotation3, Vector3};

/// The cones that the search puts first, their units sorted, and λ's ratio on the map with them.
fn proposal(surface: &Surface, edge_mm: f64) -> (Vec<i32>, f64) {
    let sigma = 2.0;
    let mut solver = MetricSolver::new(surface).unwrap();
    let wish = SearchOptions {
        sigma,
        edge_mm,
        turnings: None,
    };
    let best = search(&mut solver, &wish, &Silent).unwrap().remove(0);
    let mut units: Vec<i32> = best.cones.iter().map(|c| c.units).collect();
    units.sort_unstable();
    let options = FlattenOptions {
        sigma,
        sizing: Sizing::EdgeMm(edge_mm),
        cone_clearance: 1.1,
    };
    let flat = Flattened::solve(&mut solver, &best, &options, &Silent).unwrap();
    (units, flat.scale.ratio())
}

/// The octasphere has many proposals of equal worth, and rounding picks among them: λ's ratio differed by 2 % at most; the
/// bump has one.
#[test]
fn a_surface_turned_and_scaled_gets_as_many_cones_and_the_same_stretch() {
    for (name, edge_mm) in [("octasphere:faces=2000", 14.0), ("bump:faces=2000", 9.0)] {
        let surface = Sample::parse(name).unwrap().generate().unwrap();
        let (units, ratio) = proposal(&surface, edge_mm);
        assert!(!units.is_empty(), "{name} needs cones");
        for (axis, angle, size) in [
            (Vector3::new(1.0, 2.0, -0.5), 0.7, 1.0),
            (Vector3::new(-0.3, 0.4, 1.0), 2.1, 0.37),
            (Vector3::new(0.0, 1.0, 0.2), 1.3, 5.5),
        ] {
            let turn = Rotation3::new(axis.normalize() * angle);
            let (mut positions, faces) = surface.to_arrays();
            positions.iter_mut().for_each(|p| *p = turn * *p * size);
            let moved = Surface::new(positions, faces).unwrap();
            let (moved_units, moved_ratio) = proposal(&moved, edge_mm * size);
            assert_eq!(units, moved_units, "{name} scaled by {size}");
            assert!(
                (moved_ratio / ratio - 1.0).abs() < 0.1,
                "{name} scaled by {size}: λ's ratio is {moved_ratio}, not {ratio}"
            );
        }
    }
}
