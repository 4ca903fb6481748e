//! From the posterior to the σ of one sheet.

use super::fit::{Calibration, SAME_THICKNESS, normal_nodes};
use super::geometry::{Geometry, Scale};
use super::refusal::{Measure, Refusal};
use super::scatter::{LAWS, Law};
use crate::base::units::short;

/// Confidences that can be asked for.
pub const CONFIDENCES: std::ops::RangeInclusive<f64> = 0.5..=0.999;

/// The share of the allowed risk that the posterior may use. The rest is for what it does not know: the prior of the spread
/// ends somewhere, the law of scatter is one of two, the gauge has marks. Measured: with all of it, cells with a Weibull
/// scatter of 8 % cover 0.87 of 0.9.
const USED: f64 = 0.7;
/// Hinges are counted in so many classes of opening, each as far open as the widest in it.
const CLASSES: usize = 100;

/// The hinges of a sheet and how far each is open when the widest is open to σ.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// Share of the way from closed to σ, in (0, 1], and how many hinges go so far.
    groups: Vec<(f64, f64)>,
}

/// What is no number counts as fully open.
fn stretch(opening: f64) -> f64 {
    if opening.is_finite() {
        opening.clamp(0.0, 2.0)
    } else {
        2.0
    }
}

fn widest(openings: &[f64]) -> f64 {
    openings.iter().map(|o| stretch(*o)).fold(1.0, f64::max)
}

impl Demand {
    /// `count` hinges, all of them open to σ: the worst case.
    pub fn all(count: usize) -> Self {
        Self {
            groups: vec![(1.0, count as f64)],
        }
    }

    /// Hinges with their openings λ; with σ each of them changes in proportion, λ − 1 with σ − 1.
    pub fn of_openings(openings: &[f64]) -> Self {
        let widest = widest(openings);
        let mut counts = [0.0; CLASSES];
        for &opening in openings {
            let share = (stretch(opening) - 1.0) / (widest - 1.0);
            if share > 0.0 {
                let class = (share * CLASSES as f64 - 1e-9).ceil() as usize;
                counts[class.clamp(1, CLASSES) - 1] += 1.0;
            }
        }
        let groups = (1..=CLASSES)
            .zip(counts)
            .filter(|(_, count)| *count > 0.0)
            .map(|(class, count)| (class as f64 / CLASSES as f64, count))
            .collect();
        Self { groups }
    }

    /// How many hinges open at all.
    pub fn hinges(&self) -> f64 {
        self.groups.iter().map(|g| g.1).sum()
    }

    /// ln of the probability that none fails, at a σ, for hinges of one level and spread.
    pub(super) fn ln_survival(
        &self,
        scale: &Scale,
        sigma: f64,
        law: Law,
        level: f64,
        spread: f64,
    ) -> f64 {
        let table = law.table();
        self.groups
            .iter()
            .map(|&(share, count)| {
                let load = scale.load(1.0 + share * (sigma - 1.0));
                count * table.at((load - level) / spread)
            })
            .sum()
    }

    fn loads(&self, scale: &Scale, sigma: f64) -> Vec<(f64, f64)> {
        self.groups
            .iter()
            .map(|&(share, count)| (scale.load(1.0 + share * (sigma - 1.0)), count))
            .collect()
    }
}

/// A question that lies a little outside of the strips: answered with a wider margin.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Caution {
    /// Which measure.
    pub what: Measure,
    /// What was asked, millimetres.
    pub asked: f64,
    /// The least that was pulled.
    pub low: f64,
    /// The most that was pulled.
    pub high: f64,
}

impl std::fmt::Display for Caution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let asked = short(self.asked, 3);
        write!(
            f,
            "{} of {asked} mm is outside of the strips, {} to {} mm: the bound was lowered for that; a strip of {asked} mm would tell",
            self.what.words(),
            short(self.low, 3),
            short(self.high, 3),
        )
    }
}

/// What stops σ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum StoppedBy {
    /// The material: with more, a hinge may fail.
    Material,
    /// The strips: none was strained farther.
    Strips,
    /// The hinges are fully open.
    Geometry,
}

/// The σ that a sheet may have.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Bound {
    /// The largest stretch λ.
    pub sigma: f64,
    /// The confidence that no hinge fails.
    pub confidence: f64,
    /// What stops it.
    pub stopped_by: StoppedBy,
    /// Where the question lies outside of the strips.
    pub cautions: Vec<Caution>,
}

/// The posterior at one geometry.
pub(super) struct Predictive {
    pub(super) scale: Scale,
    pub(super) cautions: Vec<Caution>,
    /// Level, spread and weight, by law.
    nodes: [Vec<(f64, f64, f64)>; 2],
}

/// How far outside of the strips' range a measure may be.
struct Reach {
    what: Measure,
    /// Up to this factor it is as good as inside.
    same: f64,
    /// Beyond this factor nothing is said.
    most: f64,
    /// How far a factor e may move the limit away from the model, as a standard deviation of ln ε: judgement, not
    /// measured.
    sd: f64,
}

const REACHES: [Reach; 4] = [
    Reach {
        what: Measure::Width,
        same: 1.03,
        most: 1.5,
        sd: 0.3,
    },
    Reach {
        what: Measure::Kerf,
        same: 1.15,
        most: 2.0,
        sd: 0.1,
    },
    Reach {
        what: Measure::Tip,
        same: 1.15,
        most: 2.0,
        sd: 0.4,
    },
    Reach {
        what: Measure::Edge,
        same: 1.1,
        most: 2.0,
        sd: 0.2,
    },
];

impl Calibration {
    fn range(&self, of: impl Fn(&Geometry) -> f64) -> [f64; 2] {
        self.observations
            .iter()
            .fold([f64::INFINITY, 0.0], |[low, high], o| {
                let value = of(&o.scale.geometry);
                [low.min(value), high.max(value)]
            })
    }

    /// How far the limit may be from the model outside of the strips, as a standard deviation of ln ε.
    fn discrepancy(&self, geometry: &Geometry) -> Result<(f64, Vec<Caution>), Refusal> {
        if !geometry.is_sound() {
            return Err(Refusal::Unsound {
                hinge_width_mm: geometry.hinge_width_mm,
                kerf_mm: geometry.kerf_mm,
                edge_mm: geometry.edge_mm,
            });
        }
        let value = |what: Measure| {
            move |g: &Geometry| match what {
                Measure::Width => g.hinge_width_mm,
                Measure::Kerf => g.kerf_mm,
                Measure::Tip => g.tip_radius_mm,
                Measure::Thickness => g.thickness_mm,
                Measure::Edge => g.edge_mm,
            }
        };
        let outside = |what: Measure| {
            let [low, high] = self.range(value(what));
            let asked = value(what)(geometry);
            let factor = (low / asked).max(asked / high).max(1.0);
            let caution = Caution {
                what,
                asked,
                low,
                high,
            };
            (factor, caution)
        };
        let refuse = |c: Caution| Refusal::Outside {
            what: c.what,
            asked: c.asked,
            low: c.low,
            high: c.high,
        };
        let (factor, caution) = outside(Measure::Thickness);
        if factor > SAME_THICKNESS {
            return Err(refuse(caution));
        }
        let (mut variance, mut cautions) = (0.0, Vec::new());
        for reach in &REACHES {
            let (factor, caution) = outside(reach.what);
            if factor > reach.most {
                return Err(refuse(caution));
            }
            if factor > reach.same {
                variance += (reach.sd * factor.ln()).powi(2);
                cautions.push(caution);
            }
        }
        Ok((variance.sqrt(), cautions))
    }

    pub(super) fn at(&self, geometry: &Geometry) -> Result<Predictive, Refusal> {
        let (discrepancy, cautions) = self.discrepancy(geometry)?;
        Ok(Predictive {
            cautions,
            ..self.blurred(geometry, discrepancy)
        })
    }

    /// The posterior at a geometry, its level uncertain by a further standard deviation.
    pub(super) fn blurred(&self, geometry: &Geometry, discrepancy: f64) -> Predictive {
        let place = self.width(geometry);
        let nodes = [0, 1].map(|law| {
            let own = self.posterior[law]
                .iter()
                .map(|n| (n.level + n.exponent * place, n.spread, n.weight));
            if discrepancy == 0.0 {
                return own.collect();
            }
            own.flat_map(|(level, spread, weight)| {
                normal_nodes()
                    .map(move |(e, w): (f64, f64)| (level + discrepancy * e, spread, weight * w))
            })
            .collect()
        });
        Predictive {
            scale: Scale::of(*geometry),
            cautions: Vec::new(),
            nodes,
        }
    }

    /// The largest load that a strip bore.
    fn most_borne(&self) -> f64 {
        self.observations
            .iter()
            .filter(|o| o.held > 1.0)
            .map(|o| o.scale.load(o.held))
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// The largest σ such that, with this confidence, no hinge of a sheet fails; under whichever law of scatter is less
    /// favourable.
    ///
    /// # Errors
    /// [`Refusal`]: a geometry far from the strips, a confidence outside of 0.5 to 0.999, no hinges.
    pub fn bound(
        &self,
        geometry: &Geometry,
        demand: &Demand,
        confidence: f64,
    ) -> Result<Bound, Refusal> {
        if !CONFIDENCES.contains(&confidence) {
            return Err(Refusal::Confidence { confidence });
        }
        if demand.groups.is_empty() || demand.hinges() <= 0.0 {
            return Err(Refusal::NoHinges);
        }
        let predictive = self.at(geometry)?;
        let (sigma, stopped_by) = predictive.bound(demand, confidence, self.most_borne());
        Ok(Bound {
            sigma,
            confidence,
            stopped_by,
            cautions: predictive.cautions,
        })
    }

    /// Probability that no hinge fails of a sheet whose hinges are open to these λ; under the less favourable law.
    ///
    /// # Errors
    /// [`Refusal`]: a geometry far from the strips.
    pub fn survival(&self, geometry: &Geometry, openings: &[f64]) -> Result<f64, Refusal> {
        let widest = widest(openings);
        let demand = Demand::of_openings(openings);
        Ok(self.at(geometry)?.survival(&demand, widest))
    }

    /// Probability that no hinge of a sheet fails at a σ, under the less favourable law: what [`Calibration::bound`] compares
    /// with its confidence.
    ///
    /// # Errors
    /// [`Refusal`]: a geometry far from the strips.
    pub fn chance(&self, geometry: &Geometry, demand: &Demand, sigma: f64) -> Result<f64, Refusal> {
        let sigma = sigma.clamp(1.0, geometry.most_opening());
        Ok(self.at(geometry)?.survival(demand, sigma))
    }

    /// The margin that a region of a sheet keeps: its own bound, as if it were alone, less its widest opening. Negative
    /// where a hinge may fail with more than the allowed probability.
    ///
    /// # Errors
    /// As [`Calibration::bound`].
    pub fn margin(
        &self,
        geometry: &Geometry,
        openings: &[f64],
        confidence: f64,
    ) -> Result<f64, Refusal> {
        let widest = widest(openings);
        let bound = self.bound(geometry, &Demand::of_openings(openings), confidence)?;
        Ok(bound.sigma - widest)
    }

    /// The stretch that a strip of `count` hinges survives with probability `survival`, averaged over the laws: what the
    /// fit expects of it, for a plot or a comparison with its reading. Not a bound.
    ///
    /// # Errors
    /// As [`Calibration::survival`].
    pub fn expected(
        &self,
        geometry: &Geometry,
        count: usize,
        survival: f64,
    ) -> Result<f64, Refusal> {
        let predictive = self.at(geometry)?;
        let demand = Demand::all(count);
        Ok(bisect(predictive.scale.most, |sigma| {
            let [a, b] = predictive.survivals(&demand, sigma);
            0.5 * (a + b) >= survival
        }))
    }
}

/// The largest σ for which `holds`, between 1 and `most`.
pub(super) fn bisect(most: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (1.0, most);
    for _ in 0..32 {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

impl Predictive {
    pub(super) fn survivals(&self, demand: &Demand, sigma: f64) -> [f64; 2] {
        let loads = demand.loads(&self.scale, sigma);
        let mut result = [0.0; 2];
        for ((law, nodes), result) in LAWS.iter().zip(&self.nodes).zip(&mut result) {
            let table = law.table();
            *result = nodes
                .iter()
                .map(|&(level, spread, weight)| {
                    let ln: f64 = loads
                        .iter()
                        .map(|&(load, count)| count * table.at((load - level) / spread))
                        .sum();
                    weight * ln.exp()
                })
                .sum();
        }
        result
    }

    pub(super) fn survival(&self, demand: &Demand, sigma: f64) -> f64 {
        let [a, b] = self.survivals(demand, sigma);
        a.min(b)
    }

    pub(super) fn bound(&self, demand: &Demand, confidence: f64, borne: f64) -> (f64, StoppedBy) {
        let confidence = 1.0 - USED * (1.0 - confidence);
        let most = self.scale.opening(borne).min(self.scale.most);
        if self.survival(demand, most) >= confidence {
            let stopped = if most < self.scale.most {
                StoppedBy::Strips
            } else {
                StoppedBy::Geometry
            };
            return (most, stopped);
        }
        let sigma = bisect(most, |sigma| self.survival(demand, sigma) >= confidence);
        (sigma, StoppedBy::Material)
    }
}
