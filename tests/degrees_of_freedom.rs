//! A planar linkage has B₂ − 3 degrees of freedom up to rigid motions, B₂ being its boundary points that belong to one
//! triangle only (paper, appendix A, for disks). Counted and found by the library; the judge is a dense singular value
//! decomposition of the rigidity matrix, written out here.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use kagome::base::progress::Silent;
use kagome::conformal::{ConeRequest, FlattenOptions, Sizing, flatten};
use kagome::job::LinkageFigures;
use kagome::linkage::{Colour, Handedness, Linkage, LinkageOptions, build, opening_turn};
use kagome::mesh::{ClosestPoint, Sample};
use kagome::rationalize::{Freedom, Solver, freedom, rationalize, softest};
use nalgebra::{DMatrix, Point3, Rotation2, Vector2, Vector3};
use proptest::prelude::*;

/// Points of a planar linkage opened uniformly to `scale`.
fn opened(linkage: &Linkage, scale: f64) -> Vec<Point3<f64>> {
    let mut at = vec![Point3::origin(); linkage.point_count()];
    for t in linkage.triangles.iter() {
        let centre: Vector2<f64> = (t.flat[0].coords + t.flat[1].coords + t.flat[2].coords) / 3.0;
        let turn = Rotation2::new(opening_turn(scale) * linkage.handedness.opening_sense(t.colour));
        for k in 0..3 {
            let place = centre * scale + turn * (t.flat[k].coords - centre);
            at[t.points[k].0 as usize] = Point3::new(place.x, place.y, 0.0);
        }
    }
    at
}

/// Rank of the edge lengths under motions within the given directions at each point, and the singular values between
/// 10⁻⁶ and 10⁻⁴, of which it is not clear.
fn rank(
    linkage: &Linkage,
    at: &[Point3<f64>],
    directions: &dyn Fn(usize) -> Vec<Vector3<f64>>,
) -> (usize, usize) {
    let bases: Vec<Vec<Vector3<f64>>> = (0..at.len()).map(directions).collect();
    let starts: Vec<usize> = bases
        .iter()
        .scan(0, |sum, b| {
            *sum += b.len();
            Some(*sum - b.len())
        })
        .collect();
    let width = bases.iter().map(Vec::len).sum();
    let mut matrix = DMatrix::zeros(3 * linkage.triangles.len(), width);
    for (n, t) in linkage.triangles.iter().enumerate() {
        for k in 0..3 {
            let (i, j) = (t.points[k].0 as usize, t.points[(k + 1) % 3].0 as usize);
            let along = (at[j] - at[i]).normalize();
            for (point, sign) in [(i, -1.0), (j, 1.0)] {
                for (c, d) in bases[point].iter().enumerate() {
                    matrix[(3 * n + k, starts[point] + c)] = sign * along.dot(d);
                }
            }
        }
    }
    let values = matrix.singular_values();
    let above = |least: f64| values.iter().filter(|s| **s > least).count();
    (above(1e-6), above(1e-6) - above(1e-4))
}

fn plane(_: usize) -> Vec<Vector3<f64>> {
    vec![Vector3::x(), Vector3::y()]
}

fn space(_: usize) -> Vec<Vector3<f64>> {
    vec![Vector3::x(), Vector3::y(), Vector3::z()]
}

/// The library's figures, compared with the judge at the same places.
fn judged(linkage: &Linkage, at: &[Point3<f64>]) -> Freedom {
    let found = freedom(linkage, at, &Silent).unwrap();
    assert_eq!(
        rank(linkage, at, &space),
        (found.space.rank, found.space.nearly),
        "in space"
    );
    let tangents = tangents(linkage, at);
    assert_eq!(
        rank(linkage, at, &tangents),
        (found.surface.rank, found.surface.nearly),
        "on the surface"
    );
    for m in [found.sheet, found.space, found.surface] {
        assert_eq!(m.motions + m.rigid_motions + m.rank, m.unknowns);
        assert_eq!(
            m.motions as i64,
            m.counted + (m.lengths - m.rank) as i64,
            "each dependent length leaves a motion more"
        );
    }
    found
}

/// Two directions across the normal of each point.
fn tangents(linkage: &Linkage, at: &[Point3<f64>]) -> impl Fn(usize) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); at.len()];
    for t in linkage.triangles.iter() {
        let [a, b, c] = t.points.map(|p| at[p.0 as usize]);
        for p in t.points {
            normals[p.0 as usize] += (b - a).cross(&(c - a)).normalize();
        }
    }
    move |point: usize| {
        let n: Vector3<f64> = normals[point].normalize();
        let axis = if n.x.abs() < 0.9 {
            Vector3::x()
        } else {
            Vector3::y()
        };
        let u = n.cross(&axis).normalize();
        vec![u, n.cross(&u)]
    }
}

/// A planar linkage without seams: the sheet's figures too.
fn judged_flat(linkage: &Linkage) -> Freedom {
    let at = opened(linkage, 1.4);
    let found = judged(linkage, &at);
    assert_eq!(
        rank(linkage, &at, &plane),
        (found.sheet.rank, found.sheet.nearly),
        "in the plane"
    );
    assert_eq!(found.sheet_b2, found.b2);
    assert_eq!(
        found.sheet.counted,
        found.b2 as i64 - 3 * found.sheet_pieces as i64
    );
    found
}

#[test]
fn hexagonal_patches_have_b2_minus_3() {
    for radius in 1..=4 {
        for handedness in [Handedness::Right, Handedness::Left] {
            let linkage = Linkage::patch(5.0, handedness, &Linkage::hexagon_cells(radius));
            let found = judged_flat(&linkage);
            assert_eq!(found.b2, 6 * radius as usize);
            assert_eq!(found.sheet.motions, found.b2 - 3, "radius {radius}");
        }
    }
}

/// Too large for a dense decomposition: the theorem is the judge.
#[test]
fn a_patch_of_ten_thousand_triangles_has_b2_minus_3() {
    let linkage = Linkage::patch(5.0, Handedness::Left, &Linkage::hexagon_cells(40));
    let found = freedom(&linkage, &opened(&linkage, 1.4), &Silent).unwrap();
    assert_eq!((linkage.triangles.len(), found.b2), (9600, 240));
    assert_eq!((found.sheet.motions, found.sheet.nearly), (237, 0));
}

/// Where the free corners are held, everything is: the motions are those of the boundary.
fn assert_held_by_its_free_corners(
    linkage: &Linkage,
    at: &[Point3<f64>],
    directions: &dyn Fn(usize) -> Vec<Vector3<f64>>,
) {
    let mut hinge = vec![false; at.len()];
    linkage
        .hinges
        .iter()
        .for_each(|h| hinge[h.point.0 as usize] = true);
    let inner = |point: usize| {
        if hinge[point] {
            directions(point)
        } else {
            Vec::new()
        }
    };
    assert_eq!(rank(linkage, at, &inner).0, 2 * linkage.hinges.len());
}

/// Drops cells that hang by fewer than two others until none does.
fn core(mut cells: Vec<(i32, i32, Colour)>) -> Linkage {
    loop {
        let linkage = Linkage::patch(1.0, Handedness::Right, &cells);
        let held: Vec<bool> = linkage
            .neighbours()
            .iter()
            .map(|n| n.iter().flatten().count() >= 2)
            .collect();
        if held.iter().all(|h| *h) {
            return linkage;
        }
        let mut held = held.into_iter();
        cells.retain(|_| held.next().unwrap_or(false));
    }
}

#[test]
fn patches_of_other_shapes_have_b2_minus_3_too() {
    let parallelogram = core(
        (0..4)
            .flat_map(|i| (0..5).flat_map(move |j| [(i, j, Colour::Up), (i, j, Colour::Down)]))
            .collect(),
    );
    assert_eq!(
        parallelogram.triangles.len(),
        38,
        "a parallelogram loses its two sharp corners"
    );
    let found = judged_flat(&parallelogram);
    assert_eq!(found.sheet.motions, found.b2 - 3);
    // A hexagon with a bite out of its rim, at every place of the rim, or with a hole.
    for (bite_i, bite_j) in [(2, -1), (0, 2), (-3, 1), (-1, -2), (1, 1), (0, 0), (-1, 0)] {
        let mut cells = Linkage::hexagon_cells(3);
        let before = cells.len();
        cells.retain(|&(i, j, _)| (i, j) != (bite_i, bite_j));
        assert!(cells.len() < before);
        let bitten = core(cells);
        assert!(bitten.triangles.len() > 40);
        let found = judged_flat(&bitten);
        assert_eq!(
            found.sheet.motions,
            found.b2 - 3,
            "bite at {bite_i}, {bite_j}"
        );
        assert_held_by_its_free_corners(&bitten, &opened(&bitten, 1.4), &plane);
    }
}

/// Where triangles are flattened to a line, the longest edge of each follows from the other two; where almost, almost.
#[test]
fn lengths_that_follow_from_others_are_found_and_counted() {
    let linkage = Linkage::patch(2.0, Handedness::Left, &Linkage::hexagon_cells(3));
    for (squash, dependent) in [(1.0, false), (1e-2, false), (3e-6, true), (1e-9, true)] {
        let at: Vec<Point3<f64>> = opened(&linkage, 1.3)
            .iter()
            .map(|p| Point3::new(p.x + 0.3 * p.y, squash * p.y, 0.0))
            .collect();
        let found = judged(&linkage, &at);
        let follow = found.space.lengths - found.space.rank + found.space.nearly;
        assert_eq!(follow > 0, dependent, "{squash}: {follow}");
        assert_eq!(found.sheet.rank, found.sheet.lengths);
    }
    // All points in one place: nothing is held.
    let nowhere = vec![Point3::origin(); linkage.point_count()];
    let found = freedom(&linkage, &nowhere, &Silent).unwrap();
    assert_eq!((found.space.rank, found.surface.rank), (0, 0));
}

fn solved(name: &str, triangles: f64) -> (Linkage, Vec<Point3<f64>>) {
    let surface = Sample::parse(name).unwrap().generate().unwrap();
    let options = FlattenOptions {
        sigma: 2.0,
        sizing: Sizing::Triangles(triangles),
        cone_clearance: 1.1,
    };
    let flat = flatten(&surface, &ConeRequest::Auto, &options, &Silent).unwrap();
    let options = LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation: 0.0,
        handedness: Handedness::Right,
        remove_at_cone: 4,
        sigma: 2.0,
    };
    let built = build(&surface, &flat.layout, &options, &Silent).unwrap();
    let closest = ClosestPoint::new(&surface);
    let linkage = built.linkage;
    let (at, _) = rationalize(
        &linkage,
        &built.start,
        &closest,
        2.0,
        Solver::Exact,
        &Silent,
    )
    .unwrap();
    (linkage, at)
}

#[test]
fn samples_in_space_agree_with_the_judge() {
    for name in ["cap", "bump", "vase", "saddle", "torus:t=4", "octasphere"] {
        let (linkage, at) = solved(
            &format!(
                "{name}{}faces=2000",
                if name.contains(':') { "," } else { ":" }
            ),
            160.0,
        );
        let found = judged(&linkage, &at);
        let seams = linkage.hinges.iter().filter(|h| h.seam).count();
        assert_eq!(found.sheet_b2, found.b2 + 2 * seams);
        assert_held_by_its_free_corners(&linkage, &at, &tangents(&linkage, &at));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    /// Cells in no order and with gaps: several pieces, holes, dangling and loose triangles. In the plane the lengths
    /// are independent and the count holds for each piece.
    #[test]
    fn any_planar_patch_has_b2_minus_3_for_each_piece(
        cells in prop::collection::hash_set((-3..4i32, -3..4i32, any::<bool>()), 1..80),
    ) {
        let mut cells: Vec<_> = cells
            .into_iter()
            .map(|(i, j, up)| (i, j, if up { Colour::Up } else { Colour::Down }))
            .collect();
        cells.sort_unstable();
        let found = judged_flat(&Linkage::patch(3.0, Handedness::Right, &cells));
        prop_assert_eq!(found.sheet.motions, found.b2 - 3 * found.sheet_pieces);
    }
    /// Points anywhere, on one spot or very far away: figures, or an error, but no panic; and no rank above its bounds.
    #[test]
    fn positions_beyond_all_sense_are_survived(
        cells in prop::collection::hash_set((-2..3i32, -2..3i32, any::<bool>()), 1..30),
        seed in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 90), reach in prop::sample::select(vec![0.0, 1e-9, 3.0, 1e8]),
    ) {
        let mut cells: Vec<_> = cells
            .into_iter()
            .map(|(i, j, up)| (i, j, if up { Colour::Up } else { Colour::Down }))
            .collect();
        cells.sort_unstable();
        let linkage = Linkage::patch(3.0, Handedness::Right, &cells);
        let at: Vec<Point3<f64>> = (0..linkage.point_count())
            .map(|i| Point3::from(seed[i % seed.len()].map(|x| x * reach)))
            .collect();
        if let Ok(figures) = LinkageFigures::of(&linkage, &at, 2.0, &Silent) {
            let f = figures.freedom;
            prop_assert!(f.space.rank <= f.space.lengths && f.surface.rank <= f.space.rank + f.surface.nearly);
            prop_assert!(!figures.summary().is_empty() && !figures.answer().is_empty());
        }
        if let Ok(motions) = softest(&linkage, &at, 3, &Silent) {
            prop_assert!(motions.iter().all(|m| m.displacement.len() == at.len()));
        }
    }
}
