//! Which ends lie near which.

use std::f64::consts::TAU;

use kurbo::{Point, Vec2};
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::Way;
use super::heat::Heat;

/// Ends kept for each end, the nearest first; with returns half of them are at the end that a stroke does not begin at.
const KEPT: usize = 8;
/// Of them the nearest ones where heat makes the nearest dear; the others lie where it no longer does.
const NEAREST_OF_THEM: usize = 3;
/// Directions in which ends beyond the reach of heat are looked for.
const DIRECTIONS: usize = 6;

type Located = GeomWithData<[f64; 2], u32>;

/// For each end, other strokes' ends with what a link to them costs, the cheapest first.
pub(super) struct Near {
    ends: Vec<(u32, f64)>,
    from: Vec<u32>,
}

impl Near {
    pub(super) fn of(&self, end: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.list(end).iter().copied()
    }

    /// Other strokes' ends near an end, with what a link to them costs, the cheapest first.
    pub(super) fn list(&self, end: u32) -> &[(u32, f64)] {
        let (a, b) = match (self.from.get(end as usize), self.from.get(end as usize + 1)) {
            (Some(&a), Some(&b)) => (a as usize, b as usize),
            _ => (0, 0),
        };
        &self.ends[a..b]
    }

    /// The lists of all ends, the start's last (the place `2 · strokes`).
    pub(super) fn find(ends: &[[Point; 2]], start: Point, way: Way, heat: Heat) -> Self {
        let all: Vec<Located> = ends
            .iter()
            .enumerate()
            .flat_map(|(i, e)| {
                [0, 1].map(|k| Located::new([e[k].x, e[k].y], 2 * i as u32 + k as u32))
            })
            .collect();
        let tree = RTree::bulk_load(all.clone());
        let mut near = Self {
            ends: Vec::with_capacity(KEPT * (all.len() + 1)),
            from: vec![0],
        };
        let kept = if way == Way::Back { 2 * KEPT } else { KEPT };
        let heats = heat.counts();
        let mut list: Vec<(u32, f64)> = Vec::new();
        for end in all
            .iter()
            .chain([&Located::new([start.x, start.y], u32::MAX)])
        {
            list.clear();
            // One way, what is left links to what is entered; the start is left.
            let entered = end.data < u32::MAX && end.data.is_multiple_of(2);
            let fits = |other: u32| way != Way::Forwards || other.is_multiple_of(2) != entered;
            let here = ends.get(end.data as usize / 2);
            let cost = |other: u32, d2: f64| {
                let hot = match (heats, here) {
                    (true, Some(here)) => heat.between(here, &ends[other as usize / 2], 1),
                    _ => 0.0,
                };
                (other, d2.sqrt() + hot)
            };
            let nearest = if heats { NEAREST_OF_THEM } else { kept };
            list.extend(
                tree.nearest_neighbor_iter_with_distance_2(*end.geom())
                    .filter(|(e, _)| e.data / 2 != end.data / 2 && fits(e.data))
                    .take(nearest)
                    .map(|(e, d2)| cost(e.data, d2)),
            );
            if heats {
                for radius in [1.0, 1.4] {
                    for k in 0..DIRECTIONS {
                        let angle = TAU * k as f64 / DIRECTIONS as f64;
                        let [x, y] = *end.geom();
                        let there = radius * heat.reach_mm * Vec2::from_angle(angle);
                        if let Some(e) = tree.nearest_neighbor([x + there.x, y + there.y])
                            && e.data / 2 != end.data / 2
                            && fits(e.data)
                        {
                            let [ex, ey] = *e.geom();
                            list.push(cost(e.data, (ex - x).powi(2) + (ey - y).powi(2)));
                        }
                    }
                }
                list.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                list.dedup_by_key(|e| e.0);
                list.truncate(kept);
            }
            near.ends.extend_from_slice(&list);
            near.from.push(near.ends.len() as u32);
        }
        near
    }
}
