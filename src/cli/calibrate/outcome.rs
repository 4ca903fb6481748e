//! What readings say: σ for a reference sheet, kerf and setting of each machine, and which strip to pull next.

use serde::Serialize;

use crate::base::units::{floored, short};
use crate::calibrate::{
    Bound, Calibration, Candidate, Demand, FitOptions, Gauge, Geometry, Kerf, LAWS, Readings,
    Refusal, StoppedBy, TriedSetting, fit,
};
use crate::cli::Failure;
use crate::material::Reading;

/// Decimals of a σ in a profile, rounded down.
pub(super) const SIGMA_DECIMALS: i32 = 3;

/// The sheet for which a profile's `sigma.max` is stated.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Reference {
    #[serde(flatten)]
    pub geometry: Geometry,
    pub hinges: usize,
}

/// What one machine's coupons say of its cuts.
#[derive(Debug, Serialize)]
pub(super) struct Machined {
    pub machine: String,
    pub kerf: Option<Kerf>,
    pub cleanest: Option<TriedSetting>,
    /// Whether only the setting grid was read: nothing else was cut with another setting.
    #[serde(skip)]
    pub grid_alone: bool,
}

/// What the strips say.
#[derive(Debug, Serialize)]
pub(super) struct Strips {
    pub reference: Reference,
    pub strips: usize,
    pub failed: usize,
    /// Spread of hinges relative to σ, under the law that makes it larger.
    pub spread: f64,
    pub bound: Option<Bound>,
    /// Why there is none.
    pub refused: Option<String>,
    pub next: Option<Next>,
    /// The fit itself.
    #[serde(skip)]
    pub calibration: Calibration,
}

/// The strip to pull next.
#[derive(Debug, Serialize)]
pub(super) struct Next {
    #[serde(flatten)]
    pub strip: Candidate,
    pub gauge: Gauge,
    pub now: Option<f64>,
    pub then: f64,
}

/// The middle one of some measures.
pub(super) fn middle(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

/// Asks the strips about a reference sheet.
///
/// # Errors
/// [`Failure::No`] with the reason where the readings give no calibration at all.
pub(super) fn strips(
    all: &[Reading],
    reference: Reference,
    confidence: f64,
) -> Result<Strips, Failure> {
    let calibration = fit(all, &FitOptions::default())
        .map_err(|refusal| Failure::No(format!("there is no σ: {refusal}")))?;
    let demand = Demand::all(reference.hinges);
    let bound = calibration.bound(&reference.geometry, &demand, confidence);
    let bound = bound.and_then(|bound| {
        // Closed is no stretch.
        if bound.sigma <= 1.001 {
            return Err(Refusal::AllTore {
                tore: all.iter().filter_map(|r| r.tore).fold(1.0, f64::max),
            });
        }
        Ok(bound)
    });
    let next = next(&calibration, all, &reference, &demand, confidence);
    let (bound, refused) = match bound {
        Ok(bound) => (Some(bound), None),
        Err(refusal) => (None, Some(refusal.to_string())),
    };
    Ok(Strips {
        reference,
        strips: all.len(),
        failed: all.iter().filter(|r| r.tore.is_some()).count(),
        spread: LAWS
            .map(|law| calibration.spread(law))
            .into_iter()
            .fold(0.0, f64::max),
        bound,
        refused,
        next,
        calibration,
    })
}

/// Among strips as they were pulled, and such with the hinges of the reference.
fn next(
    calibration: &Calibration,
    all: &[Reading],
    reference: &Reference,
    demand: &Demand,
    confidence: f64,
) -> Option<Next> {
    let hinges = middle(all.iter().map(|r| f64::from(r.hinges)))? as u32;
    let mut candidates: Vec<Candidate> = Vec::new();
    for geometry in all
        .iter()
        .map(Geometry::of)
        .chain(std::iter::once(reference.geometry))
    {
        if !candidates.iter().any(|c| c.geometry == geometry) {
            candidates.push(Candidate { geometry, hinges });
        }
    }
    let next = calibration
        .next_strip(&candidates, &reference.geometry, demand, confidence)
        .ok()?;
    Some(Next {
        strip: candidates[next.candidate],
        gauge: next.gauge,
        now: next.now,
        then: next.then,
    })
}

/// What the coupons of each machine say of its cuts, in the order of the readings.
///
/// # Errors
/// [`Failure::No`]: the kerf's readings contradict each other.
pub(super) fn machined(all: &[Readings], confidence: f64) -> Result<Vec<Machined>, Failure> {
    let mut machines: Vec<Machined> = Vec::new();
    for machine in all.iter().map(|r| &r.machine) {
        if machines.iter().any(|m| m.machine == *machine) {
            continue;
        }
        // A coupon that is given twice counts once.
        let mut pooled: Option<Readings> = None;
        for own in all.iter().filter(|r| r.machine == *machine) {
            match &mut pooled {
                None => pooled = Some(own.clone()),
                Some(pooled) => {
                    let fresh = |p: &_| !pooled.kerf.contains(p);
                    let pieces: Vec<_> = own.kerf.iter().filter(|p| fresh(*p)).cloned().collect();
                    pooled.kerf.extend(pieces);
                    let fresh = |p: &_| !pooled.setting.contains(p);
                    let squares: Vec<_> =
                        own.setting.iter().filter(|p| fresh(*p)).cloned().collect();
                    pooled.setting.extend(squares);
                    pooled.strips.extend(own.strips.iter().cloned());
                }
            }
        }
        let Some(pooled) = pooled else { continue };
        let kerf = match pooled.measured_kerf(confidence) {
            None | Some(Err(crate::calibrate::KerfError::TooFew { .. })) => None,
            Some(Ok(kerf)) => Some(kerf),
            Some(Err(error)) => {
                return Err(Failure::No(format!(
                    "there is no kerf of {machine}: {error}"
                )));
            }
        };
        machines.push(Machined {
            machine: machine.clone(),
            kerf,
            cleanest: pooled.cleanest().cloned(),
            grid_alone: pooled.kerf.is_empty() && pooled.strips.is_empty(),
        });
    }
    Ok(machines)
}

/// A sheet's hinges in words.
pub(super) fn sheet_words(reference: &Reference) -> String {
    let g = &reference.geometry;
    format!(
        "hinges of {} mm, a kerf of {} mm{}, edges of {} mm, {} mm thick; {} hinges, all open to σ",
        short(g.hinge_width_mm, 3),
        short(g.kerf_mm, 3),
        if (g.tip_radius_mm - 0.5 * g.kerf_mm).abs() < 1e-9 {
            String::new()
        } else {
            format!(", tips of radius {} mm", short(g.tip_radius_mm, 3))
        },
        short(g.edge_mm, 2),
        short(g.thickness_mm, 3),
        reference.hinges
    )
}

impl Strips {
    /// In lines, for a person.
    pub fn lines(&self, material: &str, confidence: f64) -> Vec<String> {
        let mut lines = Vec::new();
        if let Some(bound) = &self.bound {
            lines.push(format!(
                "{material}: σ = {} with confidence {confidence}",
                short(floored(bound.sigma, SIGMA_DECIMALS), 3)
            ));
            lines.push(format!("  for {}", sheet_words(&self.reference)));
            lines.push(format!(
                "  from {} strips, of which {} failed; hinges scatter by {} % of σ",
                self.strips,
                self.failed,
                short(100.0 * self.spread, 1)
            ));
            lines.push(format!(
                "  {}",
                match bound.stopped_by {
                    StoppedBy::Material => "beyond it a hinge may fail",
                    StoppedBy::Strips => "no strip was strained farther: pull farther for more",
                    StoppedBy::Geometry => "there the hinges are fully open",
                }
            ));
            lines.extend(bound.cautions.iter().map(|c| format!("  caution: {c}")));
        }
        lines.extend(self.next.iter().map(Next::words));
        lines
    }
}

impl Next {
    /// In words.
    pub fn words(&self) -> String {
        let g = &self.strip.geometry;
        format!(
            "next: a strip of {} hinges of {} mm on edges of {} mm, looked at from {} in steps of {}: σ is then expected at {}{}",
            self.strip.hinges,
            short(g.hinge_width_mm, 3),
            short(g.edge_mm, 2),
            short(self.gauge.from, 3),
            short(self.gauge.step, 3),
            short(self.then, 3),
            self.now
                .map_or(String::new(), |now| format!(", now {}", short(now, 3)))
        )
    }
}
