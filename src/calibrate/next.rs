//! Which strip to pull next: the one after which the bound is expected to be largest.
//!
//! The gap between the bound and what the material really bears can only close from below, and what the material bears
//! does not change by being measured: the largest expected bound leaves the smallest expected gap. Every outcome of a
//! strip, from mark to mark of its gauge, reweights the nodes of the posterior; its probability is what both laws say of
//! it on average.

use super::bound::{Bound, Demand};
use super::fit::{Calibration, Observation};
use super::geometry::Geometry;
use super::refusal::Refusal;
use super::scatter::LAWS;
use super::simulated::Gauge;

/// A strip that could be pulled.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Candidate {
    /// Its hinges.
    pub geometry: Geometry,
    /// How many of them.
    pub hinges: u32,
}

/// The strip to pull next.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct NextStrip {
    /// Which of the candidates.
    pub candidate: usize,
    /// The marks at which to look: the first is expected to hold, and the steps are fine enough.
    pub gauge: Gauge,
    /// The bound as it stands; none if the sheet asked for is too far from all strips so far.
    pub now: Option<f64>,
    /// The bound that is expected after this strip.
    pub then: f64,
}

/// Steps that a gauge is made with.
const STEPS: [f64; 5] = [0.05, 0.025, 0.02, 0.01, 0.005];
/// So many steps between the stretches that one strip of six has torn by, and five of six: finer tells no more.
const STEPS_WITHIN: f64 = 3.0;
/// What is less likely than this is not looked at.
const UNLIKELY: f64 = 1e-3;

impl Calibration {
    /// The candidate that promises the largest bound for a sheet, with its gauge. The same strip as one already pulled may
    /// well be the best: it tells of the spread.
    ///
    /// # Errors
    /// [`Refusal`] if no candidate leads to a bound: of the last that was tried; [`Refusal::TooFew`] if there is none.
    pub fn next_strip(
        &self,
        candidates: &[Candidate],
        geometry: &Geometry,
        demand: &Demand,
        confidence: f64,
    ) -> Result<NextStrip, Refusal> {
        let now = self
            .bound(geometry, demand, confidence)
            .ok()
            .map(|b| b.sigma);
        let mut best: Option<NextStrip> = None;
        let mut refused = Refusal::TooFew {
            strips: self.observations.len(),
        };
        for (n, candidate) in candidates.iter().enumerate() {
            let expected = self.gauge(candidate).and_then(|gauge| {
                let then = self.expected_bound(candidate, &gauge, |after| {
                    after.bound(geometry, demand, confidence)
                })?;
                Ok((gauge, then))
            });
            match expected {
                Err(refusal) => refused = refusal,
                Ok((gauge, then)) => {
                    if best.as_ref().is_none_or(|b| then > b.then) {
                        best = Some(NextStrip {
                            candidate: n,
                            gauge,
                            now,
                            then,
                        });
                    }
                }
            }
        }
        best.ok_or(refused)
    }

    /// The marks for a strip: from where it almost surely holds, in steps of a third of its own uncertainty, to fully open.
    ///
    /// # Errors
    /// [`Refusal`]: a geometry far from the strips.
    pub fn gauge(&self, candidate: &Candidate) -> Result<Gauge, Refusal> {
        let count = candidate.hinges as usize;
        let at = |survival| self.expected(&candidate.geometry, count, survival);
        let wide = at(0.16)? - at(0.84)?;
        let step = STEPS
            .into_iter()
            .find(|step| step * STEPS_WITHIN <= wide)
            .unwrap_or(STEPS[STEPS.len() - 1]);
        let first = 1.0 + ((at(0.98)? - 1.0) / step).floor() * step;
        Ok(Gauge {
            from: first.max(1.0 + step),
            step,
            to: candidate.geometry.most_opening(),
        })
    }

    fn expected_bound(
        &self,
        candidate: &Candidate,
        gauge: &Gauge,
        bound: impl Fn(&Self) -> Result<Bound, Refusal>,
    ) -> Result<f64, Refusal> {
        let marks = gauge.marks();
        let ends = marks.iter().copied().map(Some).chain([None]);
        let starts = [1.0].into_iter().chain(marks.iter().copied());
        let place = self.width(&candidate.geometry);
        let (mut sum, mut total) = (0.0, 0.0);
        for (held, tore) in starts.zip(ends) {
            let observation = Observation::new(
                candidate.geometry,
                f64::from(candidate.hinges),
                held,
                tore,
                self.options.noise,
            );
            let mut after = self.clone();
            let mut chance = 0.0;
            for (law, nodes) in LAWS.into_iter().zip(&mut after.posterior) {
                for node in nodes.iter_mut() {
                    let level = node.level + node.exponent * place;
                    node.weight *= observation.likelihood(law, level, node.spread);
                }
                let evidence: f64 = nodes.iter().map(|n| n.weight).sum();
                chance += 0.5 * evidence;
                for node in nodes.iter_mut() {
                    node.weight /= evidence.max(f64::MIN_POSITIVE);
                }
            }
            if chance > UNLIKELY {
                after.observations.push(observation);
                sum += chance * bound(&after)?.sigma;
                total += chance;
            }
        }
        Ok(if total > 0.0 { sum / total } else { 1.0 })
    }
}
