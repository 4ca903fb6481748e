//! What strips of the material say of a sheet: the σ that it is made for, and the proof when it stands.
//!
//! Before the map neither edge nor openings are known: σ is the bound for the smallest edge that may come out, with every
//! hinge open to it. When linkage and openings stand, the question is asked again with what they really are, and a sheet
//! with a hinge beyond its bound is refused. A σ by hand is only commented on.

use nalgebra::Point3;
use serde_json::{Value, json};

use super::MakeError;
use super::report::Margins;
use super::request::Request;
use super::shape::Fit;
use super::verdict::{Reason, place};
use crate::base::units::{floored, short};
use crate::calibrate::{Bound, Calibration, Demand, FitOptions, Geometry, Refusal, StoppedBy, fit};
use crate::conformal::Sizing;
use crate::linkage::Linkage;
use crate::material::Material;
use crate::pattern::SheetOptions;
use crate::rationalize::SIGMA_TOLERANCE;

/// The confidence that no hinge fails, unless another is asked for.
pub const CONFIDENCE: f64 = 0.9;

/// Area of a triangle of edge 1.
const TRIANGLE: f64 = 0.433_012_701_892_219_3;

/// Inside of a sheet every triangle has three hinges, each shared by two.
const HINGES_A_TRIANGLE: f64 = 1.5;

/// The bound hardly moves after so many turns of edge and σ around each other.
const TURNS: usize = 4;

/// What the strips of a material say.
pub(crate) struct Strength {
    material: String,
    calibration: Calibration,
    strips: usize,
    /// None where σ was given by hand.
    confidence: Option<f64>,
}

/// With which confidence the strips of a material decide; none where σ is by hand or there are no strips.
///
/// # Errors
/// [`MakeError::NoStrips`]: a confidence for a material without strips.
pub(crate) fn confidence(request: &Request, material: &Material) -> Result<Option<f64>, MakeError> {
    match (
        material.sigma.sample.is_empty(),
        request.sigma,
        request.confidence,
    ) {
        (true, _, Some(_)) => Err(MakeError::NoStrips {
            material: material.name.clone(),
        }),
        (true, _, None) | (false, Some(_), None) => Ok(None),
        (false, None, asked) => Ok(Some(asked.unwrap_or(CONFIDENCE))),
        (false, Some(_), asked) => Ok(asked),
    }
}

impl Strength {
    /// From the strips of a material's profile; none if it has none, or none that say anything of a σ by hand.
    ///
    /// # Errors
    /// [`MakeError::Strength`] with the reason, where σ is theirs to say.
    pub fn of(request: &Request, material: &Material) -> Result<Option<Self>, MakeError> {
        let confidence = confidence(request, material)?;
        let samples = &material.sigma.sample;
        if samples.is_empty() {
            return Ok(None);
        }
        match fit(samples, &FitOptions::default()) {
            Ok(calibration) => Ok(Some(Self {
                material: material.name.clone(),
                calibration,
                strips: samples.len(),
                confidence,
            })),
            Err(_) if confidence.is_none() => Ok(None),
            Err(refusal) => Err(MakeError::Strength {
                material: material.name.clone(),
                refusal,
            }),
        }
    }

    /// The σ for a sheet that is not laid out yet, for a surface of this area; none where σ was given by hand.
    ///
    /// # Errors
    /// [`MakeError::Strength`]: the sheet is too far from the strips.
    pub fn sigma(
        &self,
        request: &Request,
        options: &SheetOptions,
        material: &Material,
        area_mm2: f64,
    ) -> Result<Option<f64>, MakeError> {
        if request.sigma.is_some() {
            return Ok(None);
        }
        let confidence = self.confidence.unwrap_or(CONFIDENCE);
        let mut sigma: f64 = 2.0;
        for _ in 0..TURNS {
            let (edge_mm, triangles) = match request.sizing {
                // Closed, the most triangles cover it.
                Sizing::EdgeMm(edge) => (edge, area_mm2 / (TRIANGLE * edge * edge)),
                // All open to σ, the smallest do.
                Sizing::Triangles(count) => ((area_mm2 / (TRIANGLE * count)).sqrt() / sigma, count),
            };
            let demand = Demand::all((HINGES_A_TRIANGLE * triangles).ceil().max(1.0) as usize);
            let geometry = geometry(options, material.thickness_mm, edge_mm);
            let bound = self.calibration.bound(&geometry, &demand, confidence);
            sigma = bound.map_err(|refusal| self.refused(refusal))?.sigma;
        }
        // Never up; four digits are what a person reads in the design.
        Ok(Some(floored(sigma, 4)))
    }

    fn refused(&self, refusal: Refusal) -> MakeError {
        MakeError::Strength {
            material: self.material.clone(),
            refusal,
        }
    }

    /// Asks again for a linkage as it is, with the openings of its hinges on each surface.
    pub fn prove(
        &self,
        linkage: &Linkage,
        openings: &[&[f64]],
        options: &SheetOptions,
        thickness_mm: f64,
    ) -> Proof {
        let geometry = geometry(options, thickness_mm, linkage.edge_mm);
        let confidence = self.confidence.unwrap_or(CONFIDENCE);
        let one = |openings: &&[f64]| -> Result<Proved, Refusal> {
            let hinges = linkage.hinges.iter().zip(openings.iter()).enumerate();
            let kept: Vec<(usize, u32, f64)> = hinges
                .filter(|(_, (hinge, _))| linkage.keeps(hinge))
                .map(|(n, (hinge, opening))| (n, hinge.point.0, *opening))
                .collect();
            let open: Vec<f64> = kept.iter().map(|k| k.2).collect();
            let demand = Demand::of_openings(&open);
            let bound = self.calibration.bound(&geometry, &demand, confidence)?;
            let mut margins: Vec<HingeMargin> = kept
                .into_iter()
                .map(|(hinge, point, opening)| HingeMargin {
                    hinge,
                    point,
                    opening,
                    margin: bound.sigma / opening,
                })
                .collect();
            margins.sort_by(|a, b| a.margin.total_cmp(&b.margin).then(a.hinge.cmp(&b.hinge)));
            Ok(Proved {
                survival: self.calibration.survival(&geometry, &open)?,
                bound,
                margins,
            })
        };
        Proof {
            strips: self.strips,
            confidence,
            by_hand: self.confidence.is_none(),
            geometry,
            found: openings.iter().map(one).collect(),
        }
    }
}

/// The hinges of a sheet with these edges.
fn geometry(options: &SheetOptions, thickness_mm: f64, edge_mm: f64) -> Geometry {
    Geometry {
        hinge_width_mm: options.hinge_width_mm,
        kerf_mm: options.kerf_mm,
        tip_radius_mm: options.tip.radius_mm(options.kerf_mm),
        thickness_mm,
        edge_mm,
    }
}

/// How far a hinge is from its bound.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct HingeMargin {
    /// Number of the hinge in the linkage.
    pub hinge: usize,
    /// Its point.
    pub point: u32,
    /// How far it is open, λ.
    pub opening: f64,
    /// The bound for the widest hinge over that: below 1 it may fail with more than the allowed probability.
    pub margin: f64,
}

/// The strips' answer for a sheet that is laid out.
#[derive(Clone, Debug)]
pub(crate) struct Proof {
    strips: usize,
    confidence: f64,
    by_hand: bool,
    geometry: Geometry,
    /// On each surface, or why there is no answer.
    pub found: Result<Vec<Proved>, Refusal>,
}

/// The answer on one surface.
#[derive(Clone, Debug)]
pub(crate) struct Proved {
    /// Probability that no hinge fails.
    pub survival: f64,
    /// The largest opening with the confidence.
    pub bound: Bound,
    /// Of each hinge, the smallest first.
    pub margins: Vec<HingeMargin>,
}

impl Proved {
    fn holds(&self) -> bool {
        self.margins
            .first()
            .is_none_or(|m| m.opening <= self.bound.sigma + SIGMA_TOLERANCE)
    }

    fn middle(&self) -> Option<&HingeMargin> {
        self.margins.get(self.margins.len() / 2)
    }
}

impl Proof {
    /// What the page shows of one surface.
    pub fn margins(&self, surface: usize) -> Option<Margins<'_>> {
        let proved = self.found.as_ref().ok()?.get(surface)?;
        Some(Margins {
            bound: proved.bound.sigma,
            confidence: self.confidence,
            hinges: &proved.margins,
        })
    }

    /// Why the sheet may not be cut; `names` are those of several surfaces.
    pub fn reasons(&self, fits: &[Fit], names: &[String]) -> Vec<Reason> {
        if self.by_hand {
            return Vec::new();
        }
        let found = match &self.found {
            Ok(found) => found,
            Err(refusal) => {
                return vec![Reason::from(format!(
                    "the strips do not answer for this sheet: {refusal}"
                ))];
            }
        };
        let all = found.iter().zip(fits).enumerate();
        all.filter(|(_, (proved, _))| !proved.holds())
            .filter_map(|(n, (proved, fit))| {
                let worst = proved.margins.first()?;
                let at = fit.positions.get(worst.point as usize)?;
                Some(Reason {
                    text: format!(
                        "{}{}, and a hinge opens to {} at {}: the probability that none fails is {}. Make it with --sigma {} --confidence {}, with larger triangles or narrower hinges, or pull more strips",
                        on(n, names),
                        self.claim(proved),
                        short(worst.opening, 4),
                        place(*at),
                        chance(proved.survival),
                        short(floored(proved.bound.sigma, 3), 3),
                        self.confidence,
                    ),
                    at_mm: Some((*at).into()),
                    surface: n,
                })
            })
            .collect()
    }

    fn claim(&self, proved: &Proved) -> String {
        format!(
            "with a confidence of {}, {} strips allow the widest of {} hinges like these to open to {}",
            self.confidence,
            self.strips,
            proved.margins.len(),
            short(floored(proved.bound.sigma, 4), 4)
        )
    }

    /// What should be known before the cut.
    pub fn warnings(&self, sigma: f64, names: &[String]) -> Vec<String> {
        let found = match &self.found {
            Ok(found) => found,
            Err(refusal) if self.by_hand => {
                return vec![format!(
                    "σ = {} was given by hand, and the strips do not answer for this sheet: {refusal}",
                    short(sigma, 4)
                )];
            }
            Err(_) => return Vec::new(),
        };
        let mut warnings = Vec::new();
        if self.by_hand {
            for (n, proved) in found.iter().enumerate() {
                warnings.push(format!(
                    "{}σ = {} was given by hand; {}: the probability that no hinge of this sheet fails is {}",
                    on(n, names),
                    short(sigma, 4),
                    self.claim(proved),
                    chance(proved.survival)
                ));
            }
        }
        // The same on every surface: it is one sheet.
        let cautions = found.first().map(|p| p.bound.cautions.as_slice());
        warnings.extend(
            cautions
                .unwrap_or_default()
                .iter()
                .map(|c| format!("σ is not as sure as it could be: {c}")),
        );
        warnings
    }

    /// A line of the summary.
    pub fn line(&self) -> Option<(String, String)> {
        let found = self.found.as_ref().ok()?;
        let survival = found.iter().map(|p| p.survival).fold(1.0, f64::min);
        let tightest = found
            .iter()
            .filter_map(|p| p.margins.first())
            .min_by(|a, b| a.margin.total_cmp(&b.margin))?;
        let middle = found
            .iter()
            .filter_map(Proved::middle)
            .min_by(|a, b| a.margin.total_cmp(&b.margin))?;
        Some((
            "Hinges hold".to_owned(),
            format!(
                "with probability {}, from {} strips ({}); the tightest could open {} times as far, half of them {} times",
                chance(survival),
                self.strips,
                if self.by_hand {
                    "σ by hand".to_owned()
                } else {
                    format!("σ for a confidence of {}", self.confidence)
                },
                short(tightest.margin, 3),
                short(middle.margin, 3)
            ),
        ))
    }

    /// All figures.
    pub fn figures(&self, sigma: f64, fits: &[Fit]) -> Value {
        let found = match &self.found {
            Err(refusal) => json!({ "refused": refusal.to_string() }),
            Ok(found) => {
                let each = found.iter().zip(fits).map(|(proved, fit)| {
                    let tightest = proved.margins.first();
                    let at = tightest.and_then(|m| fit.positions.get(m.point as usize));
                    let stopped = match proved.bound.stopped_by {
                        StoppedBy::Material => "material",
                        StoppedBy::Strips => "strips",
                        StoppedBy::Geometry => "geometry",
                    };
                    json!({
                        "holds": proved.holds(),
                        "survival": proved.survival,
                        "hinges": proved.margins.len(),
                        "bound": proved.bound.sigma,
                        "stopped_by": stopped,
                        "widest": tightest.map(|m| m.opening),
                        "margin_min": tightest.map(|m| m.margin),
                        "margin_min_at_mm": at.map(|p: &Point3<f64>| p.coords.as_slice().to_vec()),
                        "margin_median": proved.middle().map(|m| m.margin),
                        "cautions": proved.bound.cautions.iter().map(ToString::to_string).collect::<Vec<_>>(),
                    })
                });
                Value::Array(each.collect())
            }
        };
        json!({
            "sigma": sigma,
            "from": if self.by_hand { "hand" } else { "strips" },
            "confidence": self.confidence,
            "strips": self.strips,
            "geometry": self.geometry,
            "on": found,
        })
    }
}

/// Which of several surfaces is spoken of.
fn on(n: usize, names: &[String]) -> String {
    match names {
        [_, _, ..] => format!("on {}: ", names.get(n).map_or("", String::as_str)),
        _ => String::new(),
    }
}

/// A probability: near 1 what is missing of it counts.
fn chance(p: f64) -> String {
    if p > 0.9995 {
        "above 0.999".to_owned()
    } else {
        short(p, if p < 0.01 { 5 } else { 3 })
    }
}
