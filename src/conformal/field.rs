//! What the search for cones looks at: the linear model of all maps at once, at some vertices only, and what a set of
//! singularities is worth there.
//!
//! In the smooth theory Δu = K − Σ κᵢ δᵢ is linear in the curvatures of the cones, so u ≈ base + Σ κᵢ Gᵢ + Σ τᵣ Hᵣ, with
//! one Green's column Gᵢ for each place where a cone may sit and one Hᵣ for each inner rim. The columns are kept at
//! sample vertices; a set then costs a weighted sum, and one change of a set a single column more. On a closed surface
//! the units of all cones sum to 3χ: there the base has all of that curvature spread over the area, and every column is
//! that of a cone whose curvature is taken from what is spread.
//!
//! The price of a set is the area-weighted square of how far ln λ lies outside a window of width ln σ, away from the
//! cones, a little for its unevenness inside, and a toll for each cone.

use nalgebra::Point3;

use super::layout::BELOW;
use super::linear::LinearModel;
use super::{Cone, Metric, SearchOptions, Singularities};
use crate::base::ids::Per;
use crate::mesh::{Surface, VertexId};

/// Vertices at which λ is looked at.
const SAMPLES: usize = 1600;
/// Toll of one cone of +1: worth it if it removes a squared excess of ln λ of this much, averaged over the area (a third
/// of a percent of the surface off by a factor of e^0.3).
const TOLL: f64 = 3e-4;
/// A negative cone costs more: the sheet must be cut through it. So does a cone of two units, at whose tip not even a
/// ring of triangles is left.
const TOLL_DEAR: f64 = 6e-4;
/// Around a cone λ is not looked at, in triangle edges on the surface.
const CLEARANCE: f64 = 2.0;
/// How much worse it is to ask the sheet to shrink than to stretch too far, in squares.
const PRICE_BELOW: f64 = BELOW * BELOW;
/// Price of unevenness inside the window: decides between sets that all stay inside.
const UNEVEN: f64 = 0.02;
/// Room kept below σ and above 1 while searching: the model is not the map, and triangles are not points.
const MARGIN: f64 = 1.06;

/// A set of singularities by the numbers of their places.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Set {
    /// Place and units of each cone.
    pub cones: Vec<(usize, i32)>,
    /// Turning of each inner rim, units of 120°.
    pub turnings: Vec<i32>,
}

/// A vertex where a cone may sit.
pub(super) struct Place {
    pub vertex: VertexId,
    pub at: Point3<f64>,
    /// What a cone of +1 adds to u at the samples.
    column: Vec<f64>,
    /// The samples that lie so close that a cone here hides them.
    hides: Vec<u32>,
}

/// One step from a set to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Change {
    Add { place: usize, units: i32 },
    Remove { cone: usize },
    Move { cone: usize, place: usize },
    Turn { rim: usize, units: i32 },
}

impl Set {
    /// The set after a change; a cone added where one is sums with it.
    pub fn changed(&self, change: Change) -> Self {
        let mut set = self.clone();
        match change {
            Change::Add { place, units } => {
                match set.cones.iter_mut().find(|c| c.0 == place) {
                    Some(cone) => cone.1 += units,
                    None => set.cones.push((place, units)),
                }
                set.cones.retain(|c| c.1 != 0);
            }
            Change::Remove { cone } => {
                set.cones.remove(cone);
            }
            Change::Move { cone, place } => set.cones[cone].0 = place,
            Change::Turn { rim, units } => set.turnings[rim] += units,
        }
        set
    }
}

/// The model at the sample vertices.
pub(super) struct Field {
    pub places: Vec<Place>,
    samples: Vec<VertexId>,
    positions: Vec<Point3<f64>>,
    /// Part of the area that each sample stands for.
    weight: Vec<f64>,
    base: Vec<f64>,
    /// u of one unit of turning at each inner rim.
    rims: Vec<Vec<f64>>,
    /// u of one unit spread over the area; only on closed surfaces.
    even: Option<Vec<f64>>,
    /// Units that the cones of a closed surface sum to.
    pub total: Option<i32>,
    /// Logarithm of the width of the window for λ.
    window: f64,
    clear_mm: f64,
}

impl Field {
    /// The samples and what every set has in common; no place yet.
    pub fn new(surface: &Surface, model: &mut LinearModel<'_>, options: &SearchOptions) -> Self {
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
        let mut base = take(model.start());
        let total = surface
            .rims()
            .is_empty()
            .then(|| 3 * surface.euler_characteristic() as i32);
        let even = total.map(|_| take(&model.spread(&area)));
        if let (Some(even), Some(total)) = (&even, total) {
            base.iter_mut()
                .zip(even)
                .for_each(|(u, e)| *u += f64::from(total) * e);
        }
        let rims = (1..surface.rims().len())
            .map(|r| take(&model.rim(r)))
            .collect();
        Self {
            places: Vec::new(),
            positions: samples.iter().map(|&v| surface.position(v)).collect(),
            weight: samples.iter().map(|&v| area[v] / all).collect(),
            samples,
            base,
            rims,
            even,
            total,
            window: (options.sigma / (MARGIN * MARGIN)).max(1.02).ln(),
            clear_mm: CLEARANCE * options.edge_mm,
        }
    }

    /// Sets the model right at one set, whose full map is known.
    pub fn anchor(&mut self, set: &Set, metric: &Metric) {
        let model = self.sum(set);
        for ((base, &v), model) in self.base.iter_mut().zip(&self.samples).zip(model) {
            *base += metric.u[v] - model;
        }
    }

    /// The places at some vertices, new ones where need be, in their order.
    pub fn places_at(
        &mut self,
        model: &mut LinearModel<'_>,
        surface: &Surface,
        vertices: &[VertexId],
    ) -> Vec<usize> {
        let known = |field: &Self, v: VertexId| field.places.iter().position(|p| p.vertex == v);
        let mut new: Vec<VertexId> = vertices.to_vec();
        new.sort_unstable();
        new.dedup();
        new.retain(|&v| known(self, v).is_none());
        let columns = model.cones(&new, &self.samples);
        for (vertex, mut column) in new.into_iter().zip(columns) {
            if let Some(even) = &self.even {
                column.iter_mut().zip(even).for_each(|(c, e)| *c -= e);
            }
            let at = surface.position(vertex);
            let reach = self.clear_mm * self.clear_mm;
            let near = |s: &usize| (self.positions[*s] - at).norm_squared() < reach;
            let hides = (0..self.samples.len())
                .filter(near)
                .map(|s| s as u32)
                .collect();
            self.places.push(Place {
                vertex,
                at,
                column,
                hides,
            });
        }
        vertices.iter().filter_map(|&v| known(self, v)).collect()
    }

    pub fn singularities(&self, set: &Set) -> Singularities {
        let cone = |&(place, units): &(usize, i32)| Cone {
            vertex: self.places[place].vertex,
            units,
        };
        Singularities {
            cones: set.cones.iter().map(cone).collect(),
            turnings: set.turnings.clone(),
            straight: Vec::new(),
        }
    }

    /// Units that are still to be placed.
    pub fn missing(&self, set: &Set) -> i32 {
        let placed: i32 = set.cones.iter().map(|c| c.1).sum();
        self.total.map_or(0, |total| total - placed)
    }

    pub fn toll(&self, set: &Set) -> f64 {
        set.cones.iter().map(|c| toll_of(c.1)).sum()
    }

    /// The toll of a set after a change, without making that set.
    fn toll_after(&self, set: &Set, change: Change) -> f64 {
        let left = set
            .cones
            .iter()
            .enumerate()
            .map(|(i, &(at, units))| match change {
                Change::Remove { cone } if cone == i => 0,
                Change::Add { place, units: more } if place == at => units + more,
                _ => units,
            });
        let new = match change {
            Change::Add { place, units } if set.cones.iter().all(|c| c.0 != place) => units,
            _ => 0,
        };
        left.chain(std::iter::once(new)).map(toll_of).sum()
    }

    /// What the cheapest change is worth at the least.
    pub fn least_gain(&self) -> f64 {
        TOLL
    }

    fn sum(&self, set: &Set) -> Vec<f64> {
        let mut u = self.base.clone();
        let mut add = |column: &[f64], times: i32| {
            let times = f64::from(times);
            u.iter_mut().zip(column).for_each(|(u, c)| *u += times * c);
        };
        for &(place, units) in &set.cones {
            add(&self.places[place].column, units);
        }
        for (rim, &turning) in self.rims.iter().zip(&set.turnings) {
            add(rim, turning);
        }
        u
    }
}

/// The toll of one cone; none of no cone.
fn toll_of(units: i32) -> f64 {
    match units {
        0 => 0.0,
        1 => TOLL,
        _ => TOLL_DEAR,
    }
}

/// Prices of one set and of all its neighbours: what they share is summed once.
pub(super) struct Pricer<'f> {
    field: &'f Field,
    set: &'f Set,
    /// u of the set.
    u: Vec<f64>,
    /// Weights, 0 where a cone hides the sample.
    weight: Vec<f64>,
    /// Scratch: ln λ and weight of the set that is priced.
    trial: Vec<f64>,
    trial_weight: Vec<f64>,
    /// Where the last window began: the next one begins nearby.
    start: f64,
}

impl<'f> Pricer<'f> {
    pub fn new(field: &'f Field, set: &'f Set) -> Self {
        let u = field.sum(set);
        let mut weight = field.weight.clone();
        for &(place, _) in &set.cones {
            field.places[place]
                .hides
                .iter()
                .for_each(|&s| weight[s as usize] = 0.0);
        }
        let mut pricer = Self {
            field,
            set,
            trial: vec![0.0; u.len()],
            trial_weight: weight.clone(),
            u,
            weight,
            start: f64::NAN,
        };
        // Begin at the mean, less half the window.
        let all: f64 = pricer.weight.iter().sum();
        let mean = pricer
            .u
            .iter()
            .zip(&pricer.weight)
            .map(|(u, w)| -u * w)
            .sum::<f64>();
        pricer.start = mean / all.max(f64::MIN_POSITIVE) - 0.5 * field.window;
        pricer
    }

    /// The price of the set itself.
    pub fn price(&mut self) -> f64 {
        let toll = self.field.toll(self.set);
        self.trial_weight.copy_from_slice(&self.weight);
        for (x, u) in self.trial.iter_mut().zip(&self.u) {
            *x = -u;
        }
        toll + self.excess()
    }

    /// The price of the set after a change; the caller sees to it that cones stay apart.
    pub fn after(&mut self, change: Change) -> f64 {
        let toll = self.field.toll_after(self.set, change);
        let field = self.field;
        match change {
            Change::Add { place, units } => {
                let place = &field.places[place];
                self.load(&place.column, f64::from(units), None);
                self.hide(&place.hides);
            }
            Change::Turn { rim, units } => self.load(&field.rims[rim], f64::from(units), None),
            Change::Remove { cone } => {
                let (place, units) = self.set.cones[cone];
                self.load(&field.places[place].column, -f64::from(units), None);
                self.reveal(cone);
            }
            Change::Move { cone, place } => {
                let (old, units) = self.set.cones[cone];
                let new = &field.places[place];
                let times = f64::from(units);
                self.load(
                    &new.column,
                    times,
                    Some((&field.places[old].column, -times)),
                );
                self.reveal(cone);
                self.hide(&new.hides);
            }
        }
        toll + self.excess()
    }

    fn load(&mut self, column: &[f64], times: f64, other: Option<(&[f64], f64)>) {
        self.trial_weight.copy_from_slice(&self.weight);
        match other {
            None => {
                for ((x, u), c) in self.trial.iter_mut().zip(&self.u).zip(column) {
                    *x = -(u + times * c);
                }
            }
            Some((more, by)) => {
                let pairs = column.iter().zip(more);
                for ((x, u), (c, d)) in self.trial.iter_mut().zip(&self.u).zip(pairs) {
                    *x = -(u + times * c + by * d);
                }
            }
        }
    }

    fn hide(&mut self, samples: &[u32]) {
        samples
            .iter()
            .for_each(|&s| self.trial_weight[s as usize] = 0.0);
    }

    /// Shows again what only this cone hides.
    fn reveal(&mut self, cone: usize) {
        let field = self.field;
        for &s in &field.places[self.set.cones[cone].0].hides {
            self.trial_weight[s as usize] = field.weight[s as usize];
        }
        for (i, &(place, _)) in self.set.cones.iter().enumerate() {
            if i != cone {
                self.hide(&field.places[place].hides);
            }
        }
    }

    /// The excess of the trial at the best place of the window. It is convex and piecewise quadratic in that place, so
    /// Newton's method is exact after a few steps.
    fn excess(&mut self) -> f64 {
        let mut last = f64::INFINITY;
        for _ in 0..10 {
            let (value, slope, bend) = self.at(self.start);
            last = value;
            if bend <= 0.0 {
                break;
            }
            let step = slope / bend;
            self.start -= step;
            if step.abs() < 1e-2 {
                // What this step gains: exact as long as no sample crosses an end of the window on it.
                return value - 0.5 * slope * step;
            }
        }
        last
    }

    /// Excess, its first and its second derivative for a window that begins at `start`.
    fn at(&self, start: f64) -> (f64, f64, f64) {
        let window = self.field.window;
        // Four sums side by side: the processor adds them at once, and their order is fixed.
        let (mut value, mut slope, mut bend) = ([0.0f64; 4], [0.0f64; 4], [0.0f64; 4]);
        let mut add = |k: usize, x: f64, w: f64| {
            let off = x - start - 0.5 * window;
            let below = (start - x).max(0.0);
            let above = (x - start - window).max(0.0);
            let steep = if below > 0.0 { PRICE_BELOW } else { 0.0 };
            let flat = if above > 0.0 { 1.0 } else { 0.0 };
            value[k] += w * (PRICE_BELOW * below * below + above * above + UNEVEN * off * off);
            slope[k] += w * 2.0 * (PRICE_BELOW * below - above - UNEVEN * off);
            bend[k] += w * 2.0 * (steep + flat + UNEVEN);
        };
        let (xs, ws) = (
            self.trial.chunks_exact(4),
            self.trial_weight.chunks_exact(4),
        );
        for (k, (x, w)) in xs.remainder().iter().zip(ws.remainder()).enumerate() {
            add(k, *x, *w);
        }
        for (x, w) in xs.zip(ws) {
            for k in 0..4 {
                add(k, x[k], w[k]);
            }
        }
        let all = |s: [f64; 4]| (s[0] + s[1]) + (s[2] + s[3]);
        (all(value), all(slope), all(bend))
    }
}
