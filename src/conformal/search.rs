//! The search for singularities: the fewest cones, with their signs and places, and the turnings of the rims, that
//! bring λ into [1, σ].
//!
//! In the smooth theory Δu = K − Σ κᵢ δᵢ is linear in the curvatures of the cones. So the first Newton step of the map
//! is a model of all maps at once: u ≈ u₀ + Σ κᵢ Gᵢ, with one Green's column Gᵢ for each place where a cone may sit and
//! one for each rim. The columns of some hundred candidates are computed once and kept at some thousand sample
//! vertices; after that a set of singularities costs a weighted sum and its price microseconds, so that adding,
//! removing, moving and changing them one by one, and in pairs, is cheap. The price is the area-weighted square of how
//! far ln λ lies outside a window of width ln σ, away from the cones, a little for its unevenness inside, and a toll for
//! each cone. What the search
//! proposes the full map then confirms. (Compare Li, Liu, et al.: Computing sparse integer-constrained cones for
//! conformal parameterizations, 2022, which solves a continuous problem first.)
//!
//! On a closed surface the units of all cones sum to 3χ. While fewer are placed the rest is spread over the area.

use nalgebra::Point3;

use super::metric::LinearModel;
use super::paths::ShortestPaths;
use super::{Cone, ConformalError, MetricSolver, Singularities};
use crate::base::ids::Per;
use crate::base::progress::Progress;
use crate::mesh::{Surface, VertexId};

/// What the search needs to know beside the surface.
#[derive(Clone, Copy, Debug)]
pub struct SearchOptions {
    /// Largest scale factor that the material allows.
    pub sigma: f64,
    /// About how long a triangle edge is on the surface, millimetres: λ counts only some edges away from the cones.
    pub edge_mm: f64,
}

/// Places where a cone may sit.
const CANDIDATES: usize = 240;
/// Vertices at which λ is looked at.
const SAMPLES: usize = 4000;
/// Cones at the most, beyond those that a closed surface must have.
const MOST_CONES: usize = 12;
/// Toll of one cone of +1: worth it if it removes a squared excess of ln λ of this much, averaged over the area (a third
/// of a percent of the surface off by a factor of e^0.3).
const TOLL: f64 = 3e-4;
/// A negative cone costs more: the sheet must be cut through it.
const TOLL_NEGATIVE: f64 = 6e-4;
/// Around a cone λ is not looked at, in triangle edges on the surface.
const CLEARANCE: f64 = 2.0;
/// Cones closer than this to each other or to a rim, in triangle edges, are not proposed.
const APART: f64 = 4.0;
/// How much worse it is to ask the sheet to shrink than to stretch too far.
const PRICE_BELOW: f64 = 5.0;
/// Price of unevenness inside the window: decides between sets that all stay inside.
const UNEVEN: f64 = 0.02;
/// Rounds of moving all cones over one distance.
const ROUNDS: usize = 12;
/// Room kept below σ and above 1 while searching: the model is not the map, and triangles are not points.
const MARGIN: f64 = 1.06;

/// Sets of singularities worth mapping, the best first; the first is what the search ended with, the others what it
/// passed on its way.
///
/// # Errors
/// [`ConformalError`]: the linear system fails, interruption.
pub fn search(
    solver: &mut MetricSolver<'_>,
    options: &SearchOptions,
    progress: &dyn Progress,
) -> Result<Vec<Singularities>, ConformalError> {
    let surface = solver.surface();
    let mut model = solver.linear_model()?;
    let places = candidates(surface, model.start(), options.edge_mm);
    let mut field = Field::new(surface, &mut model, &places, options, progress)?;
    let mut found = field.descend(progress)?;
    field.refine(surface, &mut model, &mut found, progress)?;
    let mut sets: Vec<Singularities> = Vec::new();
    for set in found.into_iter().rev() {
        let singularities = field.singularities(&set);
        if singularities.check(surface).is_ok() && !sets.contains(&singularities) {
            sets.push(singularities);
        }
    }
    Ok(sets)
}

/// Vertices spread evenly over the surface (farthest-point sampling by edge paths, away from the rims), after the
/// extremes of u: the places where a cone helps most.
fn candidates(surface: &Surface, u: &Per<VertexId, f64>, edge_mm: f64) -> Vec<VertexId> {
    let rims: Vec<VertexId> = surface.rims().iter().flatten().copied().collect();
    let mut from_rim = ShortestPaths::new(surface);
    from_rim.extend(&rims, |_| false);
    let inside = |v: VertexId| from_rim.distance[v] > APART * edge_mm;
    let extreme = |v: VertexId| {
        let around = || surface.around(v).map(|h| u[surface.head(h)]);
        around().all(|x| x < u[v]) || around().all(|x| x > u[v])
    };
    let mut peaks: Vec<VertexId> = surface
        .positions()
        .ids()
        .filter(|&v| inside(v) && extreme(v))
        .collect();
    let mean = u.iter().sum::<f64>() / u.len() as f64;
    let off = |v: VertexId| (u[v] - mean).abs();
    peaks.sort_by(|a, b| off(*b).total_cmp(&off(*a)).then(a.cmp(b)));
    let mut chosen: Vec<VertexId> = Vec::new();
    let mut paths = ShortestPaths::new(surface);
    for peak in peaks {
        if chosen.len() < CANDIDATES / 4 && paths.distance[peak] > 2.0 * edge_mm {
            chosen.push(peak);
            paths.extend(&[peak], |_| false);
        }
    }
    while chosen.len() < CANDIDATES {
        let farthest = surface
            .positions()
            .ids()
            .filter(|&v| inside(v))
            .max_by(|a, b| {
                let far = |v: &VertexId| paths.distance[*v];
                far(a).total_cmp(&far(b)).then(b.cmp(a))
            });
        let Some(next) = farthest.filter(|v| paths.distance[*v] > 0.0) else {
            break;
        };
        chosen.push(next);
        paths.extend(&[next], |_| false);
    }
    chosen
}

/// A set of singularities by the numbers of their candidates.
#[derive(Clone, Debug, PartialEq)]
struct Set {
    cones: Vec<(usize, i32)>,
    turnings: Vec<i32>,
}

/// The model at the sample vertices.
struct Field {
    places: Vec<VertexId>,
    /// Where the candidates are.
    at: Vec<Point3<f64>>,
    samples: Vec<VertexId>,
    positions: Vec<Point3<f64>>,
    /// Part of the area that each sample stands for.
    weight: Vec<f64>,
    /// u without any singularity, the turnings 0.
    base: Vec<f64>,
    /// u of one unit at each candidate, sample by sample.
    columns: Vec<Vec<f64>>,
    /// u of one unit of turning at each inner rim.
    rims: Vec<Vec<f64>>,
    /// u of one unit spread over the area.
    even: Vec<f64>,
    /// Units that the cones of a closed surface sum to.
    total: Option<i32>,
    start: Vec<i32>,
    window: f64,
    clear_mm: f64,
    apart_mm: f64,
    /// Scratch: ln λ and weight of the set that is priced.
    scratch: Vec<(f64, f64)>,
}

impl Field {
    fn new(
        surface: &Surface,
        model: &mut LinearModel<'_>,
        places: &[VertexId],
        options: &SearchOptions,
        progress: &dyn Progress,
    ) -> Result<Self, ConformalError> {
        let count = surface.positions().len();
        // Scattered over the numbers by the golden ratio: every second vertex may be all of one side.
        let share = (u64::from(u32::MAX) * SAMPLES as u64 / count as u64) as u32;
        let chosen = |v: &VertexId| count <= SAMPLES || v.0.wrapping_mul(2_654_435_769) < share;
        let samples: Vec<VertexId> = surface.positions().ids().filter(chosen).collect();
        let mut area = Per::<VertexId, f64>::filled(count, 0.0);
        for (face, v) in surface.faces().iter_ids() {
            let third = surface.face_area(face) / 3.0;
            v.iter().for_each(|&v| area[v] += third);
        }
        let all: f64 = samples.iter().map(|&v| area[v]).sum();
        let take = |u: &Per<VertexId, f64>| samples.iter().map(|&v| u[v]).collect::<Vec<f64>>();
        let base = take(model.start());
        let even = take(&model.spread(&area));
        let rims = (1..surface.rims().len())
            .map(|r| take(&model.rim(r)))
            .collect();
        let euler = surface.euler_characteristic() as i32;
        let mut field = Self {
            places: Vec::new(),
            at: Vec::new(),
            columns: Vec::new(),
            positions: samples.iter().map(|&v| surface.position(v)).collect(),
            weight: samples.iter().map(|&v| area[v] / all).collect(),
            scratch: Vec::with_capacity(samples.len()),
            samples,
            base,
            rims,
            even,
            total: surface.rims().is_empty().then_some(3 * euler),
            start: Singularities::natural_turnings(surface),
            window: (options.sigma / (MARGIN * MARGIN)).max(1.02).ln(),
            clear_mm: CLEARANCE * options.edge_mm,
            apart_mm: APART * options.edge_mm,
        };
        for &place in places {
            progress.check()?;
            field.place(model, surface, place);
        }
        Ok(field)
    }

    fn singularities(&self, set: &Set) -> Singularities {
        let cone = |&(place, units): &(usize, i32)| Cone {
            vertex: self.places[place],
            units,
        };
        Singularities {
            cones: set.cones.iter().map(cone).collect(),
            turnings: set.turnings.clone(),
            straight: Vec::new(),
        }
    }

    /// Units that are still to be placed.
    fn missing(&self, set: &Set) -> i32 {
        let placed: i32 = set.cones.iter().map(|c| c.1).sum();
        self.total.map_or(0, |total| total - placed)
    }

    /// Price of a set: its toll and the excess of ln λ at the best shift. Infinite if two cones are too close.
    fn price(&mut self, set: &Set) -> f64 {
        for (i, a) in set.cones.iter().enumerate() {
            for b in &set.cones[..i] {
                if a.0 == b.0 || (self.at[a.0] - self.at[b.0]).norm() < self.apart_mm {
                    return f64::INFINITY;
                }
            }
        }
        let missing = f64::from(self.missing(set));
        self.scratch.clear();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for s in 0..self.samples.len() {
            let near = |c: &(usize, i32)| {
                (self.at[c.0] - self.positions[s]).norm_squared() < self.clear_mm * self.clear_mm
            };
            if set.cones.iter().any(near) {
                continue;
            }
            let mut u = self.base[s] + missing * self.even[s];
            for &(place, units) in &set.cones {
                u += f64::from(units) * self.columns[place][s];
            }
            for (rim, &turning) in self.rims.iter().zip(&set.turnings) {
                u += f64::from(turning) * rim[s];
            }
            // ln λ = −u.
            (low, high) = (low.min(-u), high.max(-u));
            self.scratch.push((-u, self.weight[s]));
        }
        if self.scratch.is_empty() {
            return f64::INFINITY;
        }
        // The excess is convex in the window's lower end: halve the interval by its slope.
        let window = self.window;
        let slope_and_excess = |start: f64| {
            let (mut slope, mut excess) = (0.0, 0.0);
            for &(x, w) in &self.scratch {
                let (below, above) = ((start - x).max(0.0), (x - start - window).max(0.0));
                let off = x - start - 0.5 * window;
                slope += w * (PRICE_BELOW * below - above - UNEVEN * off);
                excess += w * (PRICE_BELOW * below * below + above * above + UNEVEN * off * off);
            }
            (slope, excess)
        };
        let (mut a, mut b) = (low, high.max(low + window) - window);
        for _ in 0..16 {
            let middle = 0.5 * (a + b);
            if slope_and_excess(middle).0 > 0.0 {
                b = middle;
            } else {
                a = middle;
            }
        }
        slope_and_excess(0.5 * (a + b)).1 + self.toll(set)
    }

    /// Greedy descent; every set that was the best for its time, the last one last.
    fn descend(&mut self, progress: &dyn Progress) -> Result<Vec<Set>, ConformalError> {
        let mut best = Set {
            cones: Vec::new(),
            turnings: self.start.clone(),
        };
        let mut price = self.price(&best);
        let mut passed = vec![best.clone()];
        loop {
            progress.check()?;
            let must = self.missing(&best) != 0;
            // The best change; one that places curvature that has to be placed is taken at any price.
            let mut winner: Option<(f64, Set)> = None;
            let mut offer = |field: &mut Self, set: Set| {
                let found = field.price(&set);
                if found.is_finite() && winner.as_ref().is_none_or(|(p, _)| found < *p) {
                    winner = Some((found, set));
                }
            };
            if must || best.cones.len() < MOST_CONES {
                let missing = self.missing(&best);
                let signs: &[i32] = match (self.total, missing.signum()) {
                    (None, _) => &[1, -1],
                    (Some(_), 1) => &[1],
                    (Some(_), -1) => &[-1],
                    (Some(_), _) => &[],
                };
                for &units in signs {
                    for place in 0..self.places.len() {
                        let mut set = best.clone();
                        set.cones.push((place, units));
                        offer(self, set);
                    }
                }
            }
            if !must {
                for i in 0..best.cones.len() {
                    if self.total.is_none() {
                        let mut set = best.clone();
                        set.cones.remove(i);
                        offer(self, set);
                    }
                    for place in 0..self.places.len() {
                        let mut set = best.clone();
                        set.cones[i].0 = place;
                        offer(self, set);
                    }
                }
                for rim in 0..best.turnings.len() {
                    for step in [-1, 1] {
                        let mut set = best.clone();
                        set.turnings[rim] += step;
                        offer(self, set);
                    }
                }
            }
            let Some(mut next) = winner else { break };
            if !must && next.0 >= price * (1.0 - 1e-9) {
                // A pair of opposite cones may help where neither does alone.
                let Some(pair) = self.pair(&best, price, progress)? else {
                    break;
                };
                next = pair;
            }
            (price, best) = next;
            passed.push(best.clone());
        }
        Ok(passed)
    }

    /// The best pair of a positive and a negative cone that lowers the price, if there is one: for each positive one
    /// in turn the best negative one.
    fn pair(
        &mut self,
        best: &Set,
        price: f64,
        progress: &dyn Progress,
    ) -> Result<Option<(f64, Set)>, ConformalError> {
        if best.cones.len() + 2 > MOST_CONES || price < 4.0 * TOLL + self.toll(best) {
            return Ok(None);
        }
        let mut winner: Option<(f64, Set)> = None;
        // The positive ones that do least harm alone.
        let mut alone: Vec<(f64, usize)> = (0..self.places.len())
            .map(|place| {
                let mut set = best.clone();
                set.cones.push((place, 1));
                (self.price(&set), place)
            })
            .collect();
        alone.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for &(_, positive) in alone.iter().take(12) {
            progress.check()?;
            for negative in 0..self.places.len() {
                let mut set = best.clone();
                set.cones.extend([(positive, 1), (negative, -1)]);
                let found = self.price(&set);
                if found < price * (1.0 - 1e-9) && winner.as_ref().is_none_or(|(p, _)| found < *p) {
                    winner = Some((found, set));
                }
            }
        }
        Ok(winner)
    }

    fn toll(&self, set: &Set) -> f64 {
        let each = |c: &(usize, i32)| if c.1 > 0 { TOLL } else { TOLL_NEGATIVE };
        set.cones.iter().map(each).sum()
    }

    /// Moves the cones of the last set over the mesh, ever shorter ways, while that lowers the price.
    fn refine(
        &mut self,
        surface: &Surface,
        model: &mut LinearModel<'_>,
        found: &mut Vec<Set>,
        progress: &dyn Progress,
    ) -> Result<(), ConformalError> {
        let Some(mut best) = found.last().cloned() else {
            return Ok(());
        };
        let mut price = self.price(&best);
        for edges in [16usize, 8, 4, 2, 1] {
            for _ in 0..ROUNDS {
                let before = price;
                for i in 0..best.cones.len() {
                    progress.check()?;
                    let from = self.places[best.cones[i].0];
                    for vertex in star(surface, from, edges) {
                        let mut set = best.clone();
                        set.cones[i].0 = self.place(model, surface, vertex);
                        let there = self.price(&set);
                        if there < price {
                            (best, price) = (set, there);
                        }
                    }
                }
                if price >= before {
                    break;
                }
            }
        }
        found.push(best);
        Ok(())
    }

    /// The candidate at a vertex, a new one if need be.
    fn place(&mut self, model: &mut LinearModel<'_>, surface: &Surface, vertex: VertexId) -> usize {
        let known = self.places.iter().position(|v| *v == vertex);
        known.unwrap_or_else(|| {
            let column = model.cone(vertex);
            self.columns
                .push(self.samples.iter().map(|&v| column[v]).collect());
            self.places.push(vertex);
            self.at.push(surface.position(vertex));
            self.places.len() - 1
        })
    }
}

/// Inner vertices `edges` steps straight on from a vertex, along each of its spokes.
fn star(surface: &Surface, from: VertexId, edges: usize) -> Vec<VertexId> {
    surface
        .around(from)
        .map(|spoke| {
            let mut at = spoke;
            for _ in 1..edges {
                let spokes: Vec<_> = surface.around(surface.head(at)).collect();
                let Some(back) = spokes.iter().position(|s| surface.twin(*s) == Some(at)) else {
                    break;
                };
                at = spokes[(back + spokes.len() / 2) % spokes.len()];
            }
            surface.head(at)
        })
        .filter(|v| !surface.on_rim(*v))
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::panic, reason = "a test fails by panicking")]

    use super::*;
    use crate::base::progress::Silent;
    use crate::mesh::Sample;

    fn found(sample: &str, sigma: f64, edge_mm: f64) -> (Surface, Vec<Singularities>) {
        let surface = Sample::parse(sample).unwrap().generate().unwrap();
        let options = SearchOptions { sigma, edge_mm };
        let sets = search(&mut MetricSolver::new(&surface).unwrap(), &options, &Silent).unwrap();
        (surface, sets)
    }

    #[test]
    fn a_sphere_gets_six_cones_as_far_apart_as_an_octahedron() {
        let (surface, sets) = found("octasphere", 2.0, 8.0);
        assert_eq!(sets[0].cones.len(), 6);
        assert!(sets[0].cones.iter().all(|c| c.units == 1));
        for (i, a) in sets[0].cones.iter().enumerate() {
            for b in &sets[0].cones[..i] {
                let (a, b) = (
                    surface.position(a.vertex).coords,
                    surface.position(b.vertex).coords,
                );
                let angle = a.angle(&b).to_degrees();
                assert!(angle > 78.0, "two cones {angle}° apart");
            }
        }
    }

    /// Nothing is proposed where nothing is needed; a steep bump gets one cone, at its tip.
    #[test]
    fn a_hemisphere_needs_no_cone_and_a_bump_one_at_its_tip() {
        let (_, sets) = found("cap:half_angle_deg=75", 2.0, 8.0);
        assert!(sets[0].cones.is_empty(), "{:?}", sets[0]);
        let (surface, sets) = found("bump", 2.0, 5.0);
        let [cone] = sets[0].cones[..] else {
            panic!("{:?}", sets[0]);
        };
        let top = surface.positions().iter().map(|p| p.z).fold(0.0, f64::max);
        let at = surface.position(cone.vertex);
        assert!(cone.units == 1 && at.z > 0.95 * top, "{at} below {top}");
    }

    /// The model is the map's first Newton step: away from the cones the two agree to the mesh's accuracy.
    #[test]
    fn the_linear_model_predicts_the_full_map() {
        let (surface, sets) = found("bump", 2.0, 5.0);
        let mut solver = MetricSolver::new(&surface).unwrap();
        let u: Vec<f64> = {
            let mut model = solver.linear_model().unwrap();
            let mut u = model.start().to_vec();
            for cone in &sets[0].cones {
                let column = model.cone(cone.vertex);
                u.iter_mut()
                    .zip(column.iter())
                    .for_each(|(u, c)| *u += f64::from(cone.units) * c);
            }
            u
        };
        let full = solver.solve(&sets[0], &Silent).unwrap();
        let mut off: Vec<f64> = u
            .iter()
            .zip(full.u.iter())
            .map(|(a, b)| (a - b).abs())
            .collect();
        off.sort_by(f64::total_cmp);
        assert!(
            !sets[0].cones.is_empty() && off[off.len() / 2] < 0.02,
            "{}",
            off[off.len() / 2]
        );
    }
}
