//! The search for singularities: the fewest cones, with their signs and places, and the turnings of the rims, that
//! bring λ into [1, σ].
//!
//! [`Field`] prices a set of singularities in microseconds by a model that is linear in their curvatures, so sets are
//! changed greedily: a cone is added, removed, moved or strengthened, a rim turned, and, where no single change helps,
//! a pair of opposite cones added. From the end of such a descent each cone is torn out in turn and the descent repeated
//! without its place, which leaves most of the local minima behind. The best few sets are then mapped in full, and
//! there the model is taken anew: right at the set itself, and to first order around it. With it the cones slide over
//! the mesh to their final places. (Compare Li, Liu, et al.: Computing sparse integer-constrained cones for conformal
//! parameterizations, 2022, which solves a continuous problem first.)

use super::field::{Change, Field, Pricer, Set};
use super::paths::ShortestPaths;
use super::{ConformalError, MetricSolver, Singularities};
use crate::base::ids::Per;
use crate::base::progress::Progress;
use crate::mesh::{Surface, VertexId};

/// What the search needs to know beside the surface.
#[derive(Clone, Debug)]
pub struct SearchOptions {
    /// Largest scale factor that the material allows.
    pub sigma: f64,
    /// About how long a triangle edge is on the surface, millimetres: λ counts only some edges away from the cones.
    pub edge_mm: f64,
    /// Turnings of the inner rims, if they are not to be searched.
    pub turnings: Option<Vec<i32>>,
}

/// Places where a cone may sit.
const CANDIDATES: usize = 240;
/// Cones at the most, beyond those that a closed surface must have.
const MOST_CONES: usize = 12;
/// Cones closer than this to each other or to a rim, in triangle edges, are not proposed.
const APART: f64 = 4.0;
/// A cone is moved by so many times the distance between candidates at once.
const MOVE: f64 = 4.0;
/// Positive cones for which a negative one is looked for: those that do least harm alone.
const PAIRED: usize = 6;
/// Strongest cone.
const MOST_UNITS: i32 = 2;
/// Descents from a set with one cone torn out, in all.
const TORN: usize = 10;
/// Sets that are mapped in full and polished.
const POLISHED: usize = 2;
/// Rounds of moving all cones over one distance.
const ROUNDS: usize = 6;
/// A change must lower the price by this part, so that rounding cannot keep the search going around.
const GAIN: f64 = 1e-5;
/// Changes in one descent, at the most: far more than any has taken.
const CHANGES: usize = 100;

/// Sets of singularities worth mapping, the best first: what the search ended with, the next best ends, and what it
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
    let mut searcher = Searcher::new(solver, options, progress)?;
    let (ends, passed) = searcher.explore(progress)?;
    let mut sets: Vec<Singularities> = Vec::new();
    let mut add = |set: Singularities| {
        if set.check(surface).is_ok() && !sets.contains(&set) {
            sets.push(set);
        }
    };
    let mut polished: Vec<(f64, Singularities)> = Vec::new();
    for end in ends.iter().take(POLISHED) {
        let set = searcher.field.singularities(end);
        match polish(solver, &set, options, progress) {
            Ok(found) => polished.push(found),
            // Cones on a surface with handles may have no flat metric that closes; the caller hears of it.
            Err(error @ (ConformalError::Interrupted(_) | ConformalError::Factor(_))) => {
                return Err(error);
            }
            Err(_) => polished.push((f64::INFINITY, set)),
        }
    }
    polished.sort_by(|a, b| a.0.total_cmp(&b.0));
    polished.into_iter().for_each(|(_, set)| add(set));
    for set in ends.iter().skip(POLISHED).chain(passed.iter().rev()) {
        add(searcher.field.singularities(set));
    }
    Ok(sets)
}

/// The model and the rules of the search.
struct Searcher {
    field: Field,
    apart_mm: f64,
    /// How far a cone is moved at once: where it would have to go farther, tearing it out finds the place.
    move_mm: f64,
    start: Vec<i32>,
    /// Whether rims may turn otherwise.
    free_rims: bool,
    /// Places that are not to be used for now.
    banned: Vec<bool>,
}

impl Searcher {
    fn new(
        solver: &mut MetricSolver<'_>,
        options: &SearchOptions,
        progress: &dyn Progress,
    ) -> Result<Self, ConformalError> {
        let surface = solver.surface();
        let mut model = solver.linear_model()?;
        let places = candidates(surface, model.start(), options.edge_mm);
        let mut field = Field::new(surface, &mut model, options);
        progress.check()?;
        field.places_at(&mut model, surface, &places);
        let natural = || Singularities::natural_turnings(surface);
        Ok(Self {
            apart_mm: APART * options.edge_mm,
            move_mm: MOVE * spacing(surface),
            start: options.turnings.clone().unwrap_or_else(natural),
            free_rims: options.turnings.is_none(),
            banned: vec![false; field.places.len()],
            field,
        })
    }

    /// The ends of all descents, the best first, and the sets that the first descent passed.
    fn explore(&mut self, progress: &dyn Progress) -> Result<(Vec<Set>, Vec<Set>), ConformalError> {
        let empty = Set {
            cones: Vec::new(),
            turnings: self.start.clone(),
        };
        let mut passed = vec![empty.clone()];
        let first = self.descend(empty, Some(&mut passed), progress)?;
        let mut ends = vec![first];
        let mut torn = 0;
        'best: loop {
            let (price, best) = ends[0].clone();
            for i in 0..best.cones.len() {
                if torn == TORN {
                    break 'best;
                }
                torn += 1;
                let gone = self.field.places[best.cones[i].0].at;
                let near = |p: &super::field::Place| (p.at - gone).norm() < self.apart_mm;
                self.banned = self.field.places.iter().map(near).collect();
                let other = self.descend(best.changed(Change::Remove { cone: i }), None, progress);
                self.banned.fill(false);
                let other = self.descend(other?.1, None, progress)?;
                if !ends.iter().any(|e| same(&e.1, &other.1)) {
                    ends.push(other);
                    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
                }
                if ends[0].0 < price * (1.0 - GAIN) {
                    continue 'best;
                }
            }
            break;
        }
        Ok((ends.into_iter().map(|e| e.1).collect(), passed))
    }

    /// Whether a cone may sit there, beside those of the set but `except`.
    fn free(&self, set: &Set, place: usize, except: Option<usize>) -> bool {
        let at = self.field.places[place].at;
        !self.banned.get(place).is_some_and(|b| *b)
            && set.cones.iter().enumerate().all(|(i, c)| {
                Some(i) == except || (self.field.places[c.0].at - at).norm() >= self.apart_mm
            })
    }

    /// Greedy descent from a set; every set that was the best for its time goes to `passed`.
    fn descend(
        &self,
        mut best: Set,
        mut passed: Option<&mut Vec<Set>>,
        progress: &dyn Progress,
    ) -> Result<(f64, Set), ConformalError> {
        let mut price = Pricer::new(&self.field, &best).price();
        for _ in 0..CHANGES {
            progress.check()?;
            let must = self.field.missing(&best) != 0;
            // The best change; one that places curvature that has to be placed is taken at any price.
            let mut winner: Option<(f64, Change)> = None;
            let mut pricer = Pricer::new(&self.field, &best);
            for change in self.changes(&best, must) {
                let found = pricer.after(change);
                if found.is_finite() && winner.is_none_or(|(p, _)| found < p) {
                    winner = Some((found, change));
                }
            }
            match winner {
                Some((found, change)) if must || found < price * (1.0 - GAIN) => {
                    (price, best) = (found, best.changed(change));
                }
                _ => {
                    // A pair of opposite cones may help where neither does alone.
                    let Some(pair) = self.pair(&best, price, progress)? else {
                        return Ok((price, best));
                    };
                    (price, best) = pair;
                }
            }
            if let Some(passed) = &mut passed {
                passed.push(best.clone());
            }
        }
        Ok((price, best))
    }

    /// All single changes; while curvature is missing, only those that place some.
    fn changes(&self, set: &Set, must: bool) -> Vec<Change> {
        let mut changes = Vec::new();
        let missing = self.field.missing(set);
        let signs: &[i32] = match (self.field.total, missing.signum()) {
            (None, _) => &[1, -1],
            (Some(_), 1) => &[1],
            (Some(_), -1) => &[-1],
            (Some(_), _) => &[],
        };
        for &units in signs {
            for place in 0..self.field.places.len() {
                let room = must || set.cones.len() < MOST_CONES;
                if room && self.free(set, place, None) {
                    changes.push(Change::Add { place, units });
                }
            }
            for &(place, old) in &set.cones {
                if (old + units).abs() <= MOST_UNITS && old + units != 0 {
                    changes.push(Change::Add { place, units });
                }
            }
        }
        if must {
            return changes;
        }
        for cone in 0..set.cones.len() {
            if self.field.total.is_none() {
                changes.push(Change::Remove { cone });
            }
            let from = self.field.places[set.cones[cone].0].at;
            for place in 0..self.field.places.len() {
                let near = (self.field.places[place].at - from).norm() < self.move_mm;
                if near && place != set.cones[cone].0 && self.free(set, place, Some(cone)) {
                    changes.push(Change::Move { cone, place });
                }
            }
        }
        if self.free_rims {
            for rim in 0..set.turnings.len() {
                changes.extend([-1, 1].map(|units| Change::Turn { rim, units }));
            }
        }
        changes
    }

    /// The best pair of a positive and a negative cone that lowers the price, if there is one: for each positive one
    /// in turn the best negative one.
    fn pair(
        &self,
        best: &Set,
        price: f64,
        progress: &dyn Progress,
    ) -> Result<Option<(f64, Set)>, ConformalError> {
        let toll = self.field.toll(best);
        if best.cones.len() + 2 > MOST_CONES || price < 4.0 * self.field.least_gain() + toll {
            return Ok(None);
        }
        let places = || 0..self.field.places.len();
        // The positive ones that do least harm alone.
        let mut pricer = Pricer::new(&self.field, best);
        let mut alone: Vec<(f64, usize)> = places()
            .filter(|&place| self.free(best, place, None))
            .map(|place| (pricer.after(Change::Add { place, units: 1 }), place))
            .collect();
        alone.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut winner: Option<(f64, Set)> = None;
        for &(_, place) in alone.iter().take(PAIRED) {
            progress.check()?;
            let half = best.changed(Change::Add { place, units: 1 });
            let mut pricer = Pricer::new(&self.field, &half);
            for place in places().filter(|&place| self.free(&half, place, None)) {
                let change = Change::Add { place, units: -1 };
                let found = pricer.after(change);
                if found < winner.as_ref().map_or(price * (1.0 - GAIN), |w| w.0) {
                    winner = Some((found, half.changed(change)));
                }
            }
        }
        Ok(winner)
    }
}

/// About how far candidates are from each other, millimetres.
fn spacing(surface: &Surface) -> f64 {
    (surface.area() / CANDIDATES as f64).sqrt()
}

/// Whether two sets are the same whatever the order of their cones.
fn same(a: &Set, b: &Set) -> bool {
    let sorted = |set: &Set| {
        let mut cones = set.cones.clone();
        cones.sort_unstable();
        cones
    };
    a.turnings == b.turnings && sorted(a) == sorted(b)
}

/// Moves the cones of a set over the mesh, ever shorter ways, while that lowers the price around its full map; the
/// price and the set reached.
fn polish(
    solver: &mut MetricSolver<'_>,
    set: &Singularities,
    options: &SearchOptions,
    progress: &dyn Progress,
) -> Result<(f64, Singularities), ConformalError> {
    let surface = solver.surface();
    let metric = solver.solve(set, progress)?;
    let mut model = solver.linear_model_at(&metric)?;
    let mut field = Field::new(surface, &mut model, options);
    let mut best = Set {
        cones: Vec::new(),
        turnings: set.turnings.clone(),
    };
    let vertices: Vec<VertexId> = set.cones.iter().map(|c| c.vertex).collect();
    let places = field.places_at(&mut model, surface, &vertices);
    best.cones
        .extend(places.into_iter().zip(set.cones.iter().map(|c| c.units)));
    field.anchor(&best, &metric);
    let mut price = Pricer::new(&field, &best).price();
    let mean =
        surface.edges().map(|h| surface.length(h)).sum::<f64>() / surface.edges().count() as f64;
    let mut edges = ((0.5 * spacing(surface) / mean).round() as usize).clamp(1, 32);
    loop {
        for _ in 0..ROUNDS {
            let before = price;
            progress.check()?;
            let stars: Vec<Vec<VertexId>> = best
                .cones
                .iter()
                .map(|c| star(surface, field.places[c.0].vertex, edges))
                .collect();
            // All at once: columns solved together are cheap.
            field.places_at(&mut model, surface, &stars.concat());
            for (cone, star) in stars.iter().enumerate() {
                for place in field.places_at(&mut model, surface, star) {
                    let apart = best.cones.iter().enumerate().all(|(i, c)| {
                        let gap = (field.places[c.0].at - field.places[place].at).norm();
                        i == cone || gap >= APART * options.edge_mm
                    });
                    let change = Change::Move { cone, place };
                    if apart && place != best.cones[cone].0 {
                        let found = Pricer::new(&field, &best).after(change);
                        if found < price {
                            (price, best) = (found, best.changed(change));
                        }
                    }
                }
            }
            if price >= before * (1.0 - GAIN) {
                break;
            }
        }
        if edges == 1 {
            return Ok((price, field.singularities(&best)));
        }
        edges /= 2;
    }
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
        let options = SearchOptions {
            sigma,
            edge_mm,
            turnings: None,
        };
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
