//! From readings to a posterior, by quadrature.

use super::geometry::{Geometry, Scale};
use super::refusal::Refusal;
use super::scatter::{LAWS, Law};
use crate::material::{Failure, Reading};

/// Which failure σ shall keep clear of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Limit {
    /// A hinge tears; that it stays bent is no failure: for a form that stays. A strip that was given up when it stayed
    /// bent had not torn until then.
    #[default]
    Tear,
    /// A hinge tears or stays bent, whichever comes first: for a sheet that shall spring back.
    Damage,
}

/// How readings are to be understood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Which failure counts.
    pub limit: Limit,
    /// Standard deviation of a stretch read from the gauge, relative to it, common to the readings of one strip. Noise
    /// beyond this is taken for scatter of the hinges, which is the safe side.
    pub noise: f64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            limit: Limit::Tear,
            noise: 0.005,
        }
    }
}

/// The most noise that makes sense.
const MOST_NOISE: f64 = 0.1;
/// The spread of hinges, relative to σ, is somewhere between, and the prior of its logarithm is flat there: with a flat
/// level, this is the measure for which predictions are right at every spread (the right Haar measure). No sheet's hinges
/// differ by less than the first: readings that agree within the marks of a gauge would let it go to zero.
pub(super) const SPREAD: [f64; 2] = [0.01, 0.25];
pub(super) const SPREADS: usize = 16;
/// How far the exponent of the hinge width may be from the beam's.
pub(super) const EXPONENT_SD: f64 = 0.3;
/// Less than this of the likeliest node so far is not worth the other strips.
const NEGLIGIBLE: f64 = 1e-12;
/// Less than this of the posterior is left out.
const LEAST: f64 = 1e-9;
/// Nodes of level and exponent, to each side of the middle.
const LEVELS: i32 = 8;
const EXPONENTS: i32 = 4;
/// Their distance, in standard deviations of the normal approximation.
const STEP: f64 = 0.9;
/// Less than this of the posterior may lie in the outermost nodes.
const EDGE: f64 = 2e-4;
/// A strip so many deviations from the middle one is asked whether it is an outlier; this costs another fit.
const FAR: f64 = 4.0;
/// A strip is called an outlier below this probability, times the number of strips.
const OUTLIER: f64 = 0.002;
/// Sheets whose thicknesses differ by more than this factor are different materials.
pub(super) const SAME_THICKNESS: f64 = 1.1;

/// Nodes and weights of Gauss and Hermite for a standard normal variable: the roots of x³ − 3x.
pub(super) fn normal_nodes() -> [(f64, f64); 3] {
    let root = 3f64.sqrt();
    [(-root, 1.0 / 6.0), (0.0, 2.0 / 3.0), (root, 1.0 / 6.0)]
}

/// A strip's result between two loads (ln ε), for each node of the reading noise.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    pub(super) scale: Scale,
    pub(super) count: f64,
    pub(super) held: f64,
    pub(super) tore: Option<f64>,
    /// Load that held, load that did not (+∞ if there was none), weight.
    nodes: Vec<(f64, f64, f64)>,
}

impl Observation {
    pub(super) fn new(
        geometry: Geometry,
        count: f64,
        held: f64,
        tore: Option<f64>,
        noise: f64,
    ) -> Self {
        let scale = Scale::of(geometry);
        let node = |(e, weight): (f64, f64)| {
            let factor = (noise * e).exp();
            // Closed is closed, however it is read.
            let low = if held <= 1.0 {
                f64::NEG_INFINITY
            } else {
                scale.load(held * factor)
            };
            let high = tore.map_or(f64::INFINITY, |t| scale.load(t * factor));
            (low, high, weight)
        };
        let nodes = if noise > 0.0 {
            normal_nodes().into_iter().map(node).collect()
        } else {
            vec![node((0.0, 1.0))]
        };
        Self {
            scale,
            count,
            held,
            tore,
            nodes,
        }
    }

    /// The probability that its weakest hinge bears a load.
    #[inline]
    fn survives(&self, law: Law, level: f64, spread: f64) -> impl Fn(f64) -> f64 {
        let (table, count) = (law.table(), self.count);
        move |load| (count * table.at((load - level) / spread)).exp()
    }

    /// Probability that the strip's weakest hinge lies between what held and what tore.
    #[inline]
    pub(super) fn likelihood(&self, law: Law, level: f64, spread: f64) -> f64 {
        let survives = self.survives(law, level, spread);
        self.nodes
            .iter()
            .map(|&(low, high, weight)| weight * (survives(low) - survives(high)))
            .sum()
    }

    /// Probabilities that the weakest hinge is below what tore, and above what held.
    fn tails(&self, law: Law, level: f64, spread: f64) -> [f64; 2] {
        let survives = self.survives(law, level, spread);
        self.nodes
            .iter()
            .fold([0.0; 2], |[below, above], &(low, high, weight)| {
                [
                    below + weight * (1.0 - survives(high)),
                    above + weight * survives(low),
                ]
            })
    }

    /// About where the weakest hinge's load is, and how well that is known, for a strip that scatters by `own`.
    fn about(&self, own: f64, noise: f64) -> (f64, f64) {
        let high = self
            .tore
            .map_or(self.scale.most, |t| t.min(self.scale.most));
        if self.tore.is_none() {
            let load = self.scale.load(self.held.min(self.scale.most));
            return (load + own, 1.5 * own + 0.1);
        }
        let low = if self.held > 1.0 {
            self.held
        } else {
            1.0 + 0.3 * (high - 1.0)
        };
        let (from, to) = (
            self.scale.load(low.min(self.scale.most)),
            self.scale.load(high),
        );
        let read = noise / self.scale.slope(0.5 * (low + high)).max(0.02);
        let width = (to - from) / 12f64.sqrt();
        (
            0.5 * (from + to),
            (own * own + width * width + read * read).sqrt(),
        )
    }
}

/// One node of the posterior.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Mean of ln ε at failure, at the reference width.
    pub(super) level: f64,
    /// Exponent of the width beyond the beam's.
    pub(super) exponent: f64,
    /// Standard deviation of ln ε at failure.
    pub(super) spread: f64,
    pub(super) weight: f64,
}

/// What readings say about a material: the posterior under each law of scatter.
#[derive(Clone)]
pub struct Calibration {
    pub(super) options: FitOptions,
    pub(super) observations: Vec<Observation>,
    /// Logarithm of the geometric mean of the strips' hinge widths.
    pub(super) log_width: f64,
    /// d ln λ / d ln ε where the strips failed.
    pub(super) slope: f64,
    pub(super) posterior: [Vec<Node>; 2],
}

impl std::fmt::Debug for Calibration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Calibration")
            .field("strips", &self.observations.len())
            .field("spread", &LAWS.map(|law| self.spread(law)))
            .finish_non_exhaustive()
    }
}

/// Fits readings. Their order does not matter.
///
/// # Errors
/// [`Refusal`] with the reason and what to do.
pub fn fit(readings: &[Reading], options: &FitOptions) -> Result<Calibration, Refusal> {
    if !(0.0..=MOST_NOISE).contains(&options.noise) {
        return Err(Refusal::Noise {
            noise: options.noise,
            most: MOST_NOISE,
        });
    }
    let mut observations = Vec::with_capacity(readings.len());
    for (i, reading) in readings.iter().enumerate() {
        observations.push(observe(reading, i, options)?);
    }
    let label = |i: usize| readings[i].label(i);
    refuse_hopeless(&observations)?;
    let thickness = |o: &Observation| o.scale.geometry.thickness_mm;
    if let Some(i) = observations.iter().position(|o| {
        let ratio = thickness(o) / thickness(&observations[0]);
        !(1.0 / SAME_THICKNESS..=SAME_THICKNESS).contains(&ratio)
    }) {
        return Err(Refusal::Thicknesses {
            strip: label(i),
            thickness_mm: thickness(&observations[i]),
            other_mm: thickness(&observations[0]),
        });
    }
    let calibration = Calibration::of(observations, *options);
    match calibration.outlier() {
        Some((i, below)) => Err(Refusal::Contradiction {
            strip: label(i),
            low: below,
        }),
        None => Ok(calibration),
    }
}

fn observe(reading: &Reading, i: usize, options: &FitOptions) -> Result<Observation, Refusal> {
    reading
        .check(&reading.label(i))
        .map_err(|c| Refusal::Reading(c.to_string()))?;
    let geometry = Geometry::of(reading);
    let most = geometry.most_opening();
    // A strip that only stayed bent had not torn until then.
    let (held, tore) = match (options.limit, reading.failure, reading.tore) {
        (Limit::Tear, Some(Failure::Plastic), Some(bent)) => (bent, None),
        (_, _, tore) => (reading.held, tore),
    };
    let beyond = if tore.is_some() {
        held >= most
    } else {
        held > most * (1.0 + 3.0 * options.noise) + 0.02
    };
    if beyond {
        return Err(Refusal::BeyondOpen {
            strip: reading.label(i),
            held,
            most,
        });
    }
    Ok(Observation::new(
        geometry,
        f64::from(reading.hinges),
        held,
        tore,
        options.noise,
    ))
}

/// Readings that no statistics can help.
fn refuse_hopeless(observations: &[Observation]) -> Result<(), Refusal> {
    if observations.len() < 2 {
        return Err(Refusal::TooFew {
            strips: observations.len(),
        });
    }
    if observations.iter().all(|o| o.tore.is_none()) {
        let held = observations.iter().map(|o| o.held).fold(2.0, f64::min);
        let full = observations.iter().all(|o| o.held >= o.scale.most - 0.03);
        return Err(Refusal::NothingTore { held, full });
    }
    if observations.iter().all(|o| o.held <= 1.0) {
        let tore = observations
            .iter()
            .filter_map(|o| o.tore)
            .fold(1.0, f64::max);
        return Err(Refusal::AllTore { tore });
    }
    Ok(())
}

impl Calibration {
    pub(super) fn of(observations: Vec<Observation>, options: FitOptions) -> Self {
        let count = observations.len().max(1) as f64;
        let width = |o: &Observation| o.scale.geometry.hinge_width_mm.ln();
        let log_width = observations.iter().map(width).sum::<f64>() / count;
        let mut slopes: Vec<f64> = observations
            .iter()
            .map(|o| {
                let high = o.tore.unwrap_or(o.scale.most).min(o.scale.most);
                // Near closed and near open the slope vanishes, and with it the scale of the prior.
                o.scale
                    .slope((0.5 * (o.held + high)).clamp(1.03, 0.98 * o.scale.most))
            })
            .collect();
        slopes.sort_by(f64::total_cmp);
        let slope = slopes.get(slopes.len() / 2).copied().unwrap_or(0.25);
        let mut calibration = Self {
            options,
            observations,
            log_width,
            slope,
            posterior: [Vec::new(), Vec::new()],
        };
        calibration.posterior = LAWS.map(|law| calibration.nodes(law));
        calibration
    }

    /// Where a strip's width stands, on the logarithmic scale of the exponent.
    pub(super) fn width(&self, geometry: &Geometry) -> f64 {
        geometry.hinge_width_mm.ln() - self.log_width
    }

    fn nodes(&self, law: Law) -> Vec<Node> {
        let mut span = 1.0;
        loop {
            let (nodes, edge) = self.grid(law, span);
            // Also where nothing has any weight, and the share is no number.
            if edge < EDGE || span > 5.0 || nodes.is_empty() {
                return nodes;
            }
            span *= 1.6;
        }
    }

    /// The posterior on a grid that lies where the normal approximation puts it, and the share in its outermost nodes.
    fn grid(&self, law: Law, span: f64) -> (Vec<Node>, f64) {
        let side = (2 * LEVELS + 1) * (2 * EXPONENTS + 1);
        let mut nodes = Vec::with_capacity(SPREADS * side as usize);
        let mut outer = 0.0;
        let ratio = (SPREAD[1] / SPREAD[0]).ln() / (SPREADS - 1) as f64;
        // The strips' own medians and deviations, in units of the hinges' spread.
        let weakest: Vec<(f64, f64)> = self
            .observations
            .iter()
            .map(|o| law.weakest_spread(o.count))
            .collect();
        let places: Vec<f64> = self
            .observations
            .iter()
            .map(|o| self.width(&o.scale.geometry))
            .collect();
        let mut top = 0.0f64;
        for k in 0..SPREADS {
            let spread = SPREAD[0] * (ratio * k as f64).exp() / self.slope;
            let about = self.approximate(spread, &weakest, &places);
            let area = about.level_sd * about.exponent_sd;
            for i in -LEVELS..=LEVELS {
                for j in -EXPONENTS..=EXPONENTS {
                    let v = STEP * span * f64::from(j);
                    let u = STEP * span * f64::from(i);
                    let node = Node {
                        exponent: about.exponent + about.exponent_sd * v,
                        level: about.level + about.level_sd * u + about.level_by_exponent * v,
                        spread,
                        weight: 0.0,
                    };
                    let prior = (-0.5 * (node.exponent / EXPONENT_SD).powi(2)).exp() * area;
                    let weight =
                        self.observations
                            .iter()
                            .zip(&places)
                            .fold(prior, |p, (o, &place)| {
                                if p > NEGLIGIBLE * top {
                                    p * o.likelihood(
                                        law,
                                        node.level + node.exponent * place,
                                        spread,
                                    )
                                } else {
                                    0.0
                                }
                            });
                    top = top.max(weight);
                    if i.abs() == LEVELS || j.abs() == EXPONENTS {
                        outer += weight;
                    }
                    nodes.push(Node { weight, ..node });
                }
            }
        }
        let total: f64 = nodes.iter().map(|n| n.weight).sum();
        nodes.retain(|n| n.weight > LEAST * total);
        let kept: f64 = nodes.iter().map(|n| n.weight).sum();
        for node in &mut nodes {
            node.weight /= kept;
        }
        (nodes, outer / total)
    }

    /// Least squares for level and exponent at one spread.
    fn approximate(&self, spread: f64, weakest: &[(f64, f64)], places: &[f64]) -> Approximation {
        let mut p = [[0.0, 0.0], [0.0, EXPONENT_SD.powi(-2)]];
        let mut right = [0.0; 2];
        for ((o, &(median, deviation)), &x) in self.observations.iter().zip(weakest).zip(places) {
            let (load, sd) = o.about(spread * deviation, self.options.noise);
            let weight = sd.powi(-2);
            let y = load - spread * median;
            p[0][0] += weight;
            p[0][1] += weight * x;
            p[1][1] += weight * x * x;
            right[0] += weight * y;
            right[1] += weight * x * y;
        }
        let det = p[0][0] * p[1][1] - p[0][1] * p[0][1];
        let exponent_sd = (p[0][0] / det).sqrt();
        Approximation {
            level: (p[1][1] * right[0] - p[0][1] * right[1]) / det,
            level_sd: p[0][0].sqrt().recip(),
            exponent: (p[0][0] * right[1] - p[0][1] * right[0]) / det,
            exponent_sd,
            level_by_exponent: -p[0][1] / p[0][0] * exponent_sd,
        }
    }

    /// The strip farthest from the middle one: its number, whether it failed earlier, and how far it is, in deviations of
    /// the strips as their median says them.
    fn farthest(&self) -> Option<(usize, bool, f64)> {
        let loads: Vec<f64> = self
            .observations
            .iter()
            .map(|o| o.about(0.0, 0.0).0)
            .collect();
        let median = |mut of: Vec<f64>| {
            of.sort_by(f64::total_cmp);
            of.get(of.len() / 2).copied()
        };
        let middle = median(loads.clone())?;
        let distances: Vec<f64> = loads.iter().map(|l| (l - middle).abs()).collect();
        let i = (0..loads.len()).max_by(|a, b| distances[*a].total_cmp(&distances[*b]))?;
        let far = distances[i] / median(distances)?.max(1e-9);
        Some((i, loads[i] < middle, far))
    }

    /// The strip that the others contradict, if it is beyond what either law and any spread can explain: its number, and
    /// whether it failed too early.
    fn outlier(&self) -> Option<(usize, bool)> {
        let (i, low, far) = self.farthest()?;
        // Readings so far apart that no node has any weight.
        if self.posterior.iter().any(Vec::is_empty) {
            return Some((i, low));
        }
        let count = self.observations.len();
        if count < 3 || far < FAR {
            return None;
        }
        let mut rest = self.observations.clone();
        let own = rest.remove(i);
        let others = Self::of(rest, self.options);
        let place = others.width(&own.scale.geometry);
        // Under the law that explains it better.
        let tail = LAWS
            .iter()
            .zip(&others.posterior)
            .map(|(law, nodes)| {
                nodes
                    .iter()
                    .map(|n| {
                        let level = n.level + n.exponent * place;
                        n.weight * own.tails(*law, level, n.spread)[usize::from(!low)]
                    })
                    .sum::<f64>()
            })
            .fold(0.0, f64::max);
        (2.0 * count as f64 * tail < OUTLIER).then_some((i, low))
    }

    /// Median over the posterior of a hinge's spread, relative to σ, under one law.
    pub fn spread(&self, law: Law) -> f64 {
        let nodes = &self.posterior[law as usize];
        let mut by_spread: Vec<(f64, f64)> = nodes.iter().map(|n| (n.spread, n.weight)).collect();
        by_spread.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut sum = 0.0;
        for (spread, weight) in by_spread {
            sum += weight;
            if sum >= 0.5 {
                return spread * self.slope;
            }
        }
        0.0
    }
}

/// The posterior of level and exponent at one spread as a normal law: where the grid lies.
#[derive(Clone, Copy, Debug)]
struct Approximation {
    level: f64,
    /// Of the level where the exponent is known.
    level_sd: f64,
    exponent: f64,
    exponent_sd: f64,
    /// How far the level moves when the exponent moves by its standard deviation.
    level_by_exponent: f64,
}
