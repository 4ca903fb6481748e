//! Points of a cloud near a place: a uniform grid, sorted by cell.

use nalgebra::Vector3;

/// Points sorted by the cube that they lie in.
pub(crate) struct PointGrid<'a> {
    points: &'a [Vector3<f64>],
    cell: f64,
    /// (cube, point), sorted.
    sorted: Vec<([i32; 3], u32)>,
}

impl<'a> PointGrid<'a> {
    /// A grid for searches up to about the distance `reach`.
    pub fn new(points: &'a [Vector3<f64>], reach: f64) -> Self {
        let mut sorted: Vec<_> = points
            .iter()
            .enumerate()
            .map(|(i, p)| (cube(p, reach), i as u32))
            .collect();
        sorted.sort_unstable();
        Self {
            points,
            cell: reach,
            sorted,
        }
    }

    /// Calls `visit` for every point within `reach` of `centre`; `reach` must not exceed the grid's.
    pub fn near(&self, centre: &Vector3<f64>, reach: f64, mut visit: impl FnMut(usize)) {
        debug_assert!(reach <= self.cell);
        let [i, j, k] = cube(centre, self.cell);
        for a in i.saturating_sub(1)..=i.saturating_add(1) {
            for b in j.saturating_sub(1)..=j.saturating_add(1) {
                // The three cubes along the last axis are one run of the sorted list.
                let (from, to) = ([a, b, k.saturating_sub(1)], [a, b, k.saturating_add(1)]);
                let start = self.sorted.partition_point(|(c, _)| *c < from);
                for &(c, point) in &self.sorted[start..] {
                    if c > to {
                        break;
                    }
                    if (self.points[point as usize] - centre).norm_squared() <= reach * reach {
                        visit(point as usize);
                    }
                }
            }
        }
    }
}

fn cube(p: &Vector3<f64>, cell: f64) -> [i32; 3] {
    // `as` saturates, which keeps absurd coordinates in a far corner.
    [p.x, p.y, p.z].map(|x| (x / cell).floor() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn finds_what_a_plain_search_finds(
            raw in prop::collection::vec(prop::array::uniform3(-5.0..5.0f64), 0..60),
            centre in prop::array::uniform3(-6.0..6.0f64), reach in 0.3..2.0f64,
        ) {
            let points: Vec<_> = raw.into_iter().map(Vector3::from).collect();
            let centre = Vector3::from(centre);
            let mut found = Vec::new();
            PointGrid::new(&points, reach).near(&centre, reach, |i| found.push(i));
            found.sort_unstable();
            let plain: Vec<usize> =
                (0..points.len()).filter(|&i| (points[i] - centre).norm_squared() <= reach * reach).collect();
            prop_assert_eq!(found, plain);
        }
    }
}
