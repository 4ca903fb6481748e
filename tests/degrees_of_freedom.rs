//! A planar linkage of disk type has B₂ − 3 degrees of freedom up to rigid motions, B₂ being its boundary points that
//! belong to one triangle only (paper, appendix A). Counted there; here found as the rank of the rigidity matrix.

use kagome::linkage::{Colour, Handedness, Linkage, opening_turn};
use nalgebra::{DMatrix, Point2, Rotation2, Vector2};

/// Points of a planar linkage opened uniformly to `scale`.
fn opened(linkage: &Linkage, scale: f64) -> Vec<Point2<f64>> {
    let mut at = vec![Point2::origin(); linkage.point_count()];
    for t in linkage.triangles.iter() {
        let centre: Vector2<f64> = (t.flat[0].coords + t.flat[1].coords + t.flat[2].coords) / 3.0;
        let turn = Rotation2::new(opening_turn(scale) * linkage.handedness.opening_sense(t.colour));
        for k in 0..3 {
            at[t.points[k].0 as usize] =
                Point2::from(centre * scale + turn * (t.flat[k].coords - centre));
        }
    }
    at
}

/// Degrees of freedom left by the edge lengths: unknowns − rank − 3 rigid motions.
fn freedom(linkage: &Linkage) -> usize {
    let at = opened(linkage, 1.4);
    let mut rows = Vec::new();
    for t in linkage.triangles.iter() {
        for k in 0..3 {
            let (i, j) = (t.points[k].0 as usize, t.points[(k + 1) % 3].0 as usize);
            rows.push((i, j, (at[j] - at[i]).normalize()));
        }
    }
    let mut matrix = DMatrix::zeros(rows.len(), 2 * at.len());
    for (row, (i, j, direction)) in rows.into_iter().enumerate() {
        for c in 0..2 {
            matrix[(row, 2 * i + c)] = -direction[c];
            matrix[(row, 2 * j + c)] = direction[c];
        }
    }
    2 * at.len() - matrix.rank(1e-9) - 3
}

fn free_corners(linkage: &Linkage) -> usize {
    linkage.point_count() - linkage.hinges.len()
}

#[test]
fn hexagonal_patches_have_b2_minus_3() {
    for radius in 1..=4 {
        for handedness in [Handedness::Right, Handedness::Left] {
            let linkage = Linkage::patch(5.0, handedness, &Linkage::hexagon_cells(radius));
            let b2 = free_corners(&linkage);
            assert_eq!(b2, 6 * radius as usize);
            assert_eq!(freedom(&linkage), b2 - 3, "radius {radius}");
        }
    }
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
    assert_eq!(freedom(&parallelogram), free_corners(&parallelogram) - 3);
    // A hexagon with a bite out of its rim, at every place of the rim.
    for (bite_i, bite_j) in [(2, -1), (0, 2), (-3, 1), (-1, -2), (1, 1)] {
        let mut cells = Linkage::hexagon_cells(3);
        let before = cells.len();
        cells.retain(|&(i, j, _)| (i, j) != (bite_i, bite_j));
        assert!(cells.len() < before);
        let bitten = core(cells);
        assert!(bitten.triangles.len() > 40);
        assert_eq!(
            freedom(&bitten),
            free_corners(&bitten) - 3,
            "bite at {bite_i}, {bite_j}"
        );
    }
}
