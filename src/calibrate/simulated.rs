//! A material whose limits are known to the simulation and to nobody else: the judge of the fit.

use super::bound::{Demand, bisect};
use super::geometry::{Geometry, Scale};
use super::scatter::Law;
use crate::base::random::Random;
use crate::material::{Failure, Reading};

/// The marks at which a strip is looked at: from the first, in equal steps, to the last.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Gauge {
    /// The first stretch.
    pub from: f64,
    /// From mark to mark.
    pub step: f64,
    /// The last one.
    pub to: f64,
}

impl Gauge {
    /// Its marks, in order: at most a thousand, none of them closed, none beyond 2.
    pub fn marks(&self) -> Vec<f64> {
        let mark = |i: u32| self.from + self.step * f64::from(i);
        (0..1000)
            .map(mark)
            .take_while(|m| *m <= self.to.min(2.0) + 1e-9)
            .map(|m| m.min(2.0))
            .filter(|m| *m > 1.0)
            .collect()
    }
}

/// A material with hidden limits. Every hinge that is drawn is another one; the sequence follows from the seed.
#[derive(Clone, Debug)]
pub struct SimulatedMaterial {
    /// Stretch at which half of the hinges of the reference geometry have failed, if that is below fully open.
    pub sigma: f64,
    /// Standard deviation of a hinge's limit relative to it, at that stretch.
    pub spread: f64,
    /// How it is distributed.
    pub law: Law,
    /// Exponent by which the limit (strain) goes with the hinge width, beyond the beam's.
    pub width_exponent: f64,
    /// Standard deviation of the mean limit of whole strips and sheets, relative to σ, on top of that of their hinges.
    pub between: f64,
    /// Standard deviation of a reading, relative; common to the readings of one strip.
    pub noise: f64,
    /// How its hinges fail.
    pub failure: Failure,
    reference: Scale,
    random: Random,
}

impl SimulatedMaterial {
    /// A material whose σ and spread are stated for hinges of this geometry; which tear; without
    /// width effect, noise, and differences between strips.
    pub fn new(reference: Geometry, sigma: f64, spread: f64, law: Law, seed: u64) -> Self {
        Self {
            sigma,
            spread,
            law,
            width_exponent: 0.0,
            between: 0.0,
            noise: 0.0,
            failure: Failure::Torn,
            reference: Scale::of(reference),
            random: Random::new(seed),
        }
    }

    /// Mean and standard deviation of ln ε at failure, at a geometry.
    fn limit(&self, geometry: &Geometry) -> (f64, f64) {
        let spread = self.spread / self.reference.slope(self.sigma);
        let width = geometry.hinge_width_mm / self.reference.geometry.hinge_width_mm;
        let median = self.law.weakest(1.0, 0.5);
        let level = self.reference.load(self.sigma) - spread * median;
        (level + self.width_exponent * width.ln(), spread)
    }

    /// What one strip or sheet has of its own.
    fn own(&mut self) -> f64 {
        self.between / self.reference.slope(self.sigma) * self.random.normal()
    }

    /// The load at which the weakest of a strip's hinges fails.
    fn weakest(&mut self, geometry: &Geometry, count: u32) -> f64 {
        let (level, spread) = self.limit(geometry);
        let survival = 1.0 - self.random.unit();
        self.own() + level + spread * self.law.weakest(f64::from(count), survival)
    }

    /// Pulls a strip from mark to mark until it fails, and reads it.
    pub fn pull(&mut self, geometry: &Geometry, hinges: u32, gauge: &Gauge, date: &str) -> Reading {
        let weakest = self.weakest(geometry, hinges);
        let factor = (self.noise * self.random.normal()).exp();
        let scale = Scale::of(*geometry);
        let (mut held, mut tore) = (1.0, None);
        for mark in gauge.marks() {
            // What the gauge shows is off by the factor; nobody reads more than fully open.
            let real = mark * factor;
            if scale.load(real) > weakest {
                tore = Some(mark);
                break;
            }
            held = mark.min(scale.most);
            if real >= scale.most || mark >= scale.most {
                break;
            }
        }
        Reading {
            strip: None,
            date: date.to_owned(),
            hinge_width_mm: geometry.hinge_width_mm,
            kerf_mm: geometry.kerf_mm,
            tip_radius_mm: Some(geometry.tip_radius_mm),
            thickness_mm: geometry.thickness_mm,
            edge_mm: geometry.edge_mm,
            hinges,
            held,
            tore,
            failure: tore.map(|_| self.failure),
        }
    }

    /// Whether no hinge of a sheet fails when they are open to these λ: one sheet, drawn anew.
    pub fn sheet_survives(&mut self, geometry: &Geometry, openings: &[f64]) -> bool {
        let (level, spread) = self.limit(geometry);
        let level = level + self.own();
        let scale = Scale::of(*geometry);
        openings.iter().all(|&opening| {
            let survival = 1.0 - self.random.unit();
            scale.load(opening) <= level + spread * self.law.weakest(1.0, survival)
        })
    }

    /// Probability that no hinge of a sheet fails at a σ: exact but for the integral over what a sheet has of its own.
    pub fn survival(&self, geometry: &Geometry, demand: &Demand, sigma: f64) -> f64 {
        let (level, spread) = self.limit(geometry);
        let scale = Scale::of(*geometry);
        let at = |own: f64| {
            demand
                .ln_survival(&scale, sigma, self.law, level + own, spread)
                .exp()
        };
        if self.between == 0.0 {
            return at(0.0);
        }
        // The trapezoidal rule over ±5 standard deviations.
        let sd = self.between / self.reference.slope(self.sigma);
        let nodes = (-20..=20).map(|i| 0.25 * f64::from(i));
        let (sum, total) = nodes.fold((0.0, 0.0), |(sum, total), e| {
            let weight = (-0.5 * e * e).exp();
            (sum + weight * at(sd * e), total + weight)
        });
        sum / total
    }

    /// The largest σ that survives with this confidence: the best that anyone could state who knows the material.
    pub fn true_bound(&self, geometry: &Geometry, demand: &Demand, confidence: f64) -> f64 {
        let most = geometry.most_opening();
        if self.survival(geometry, demand, most) >= confidence {
            return most;
        }
        bisect(most, |sigma| {
            self.survival(geometry, demand, sigma) >= confidence
        })
    }
}
