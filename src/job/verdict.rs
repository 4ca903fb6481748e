//! Yes or no, with reasons in words, places, and what would help.

use nalgebra::Point3;

use crate::base::units::short;
use crate::conformal::Flattened;
use crate::mesh::Surface;
use crate::rationalize::{Quality, SIGMA_TOLERANCE};

/// Edges may be this wrong, relative: a hundredth of a micrometre on a 10 mm triangle.
pub const EDGE_TOLERANCE: f64 = 1e-6;
/// Part of the surface that must lie within L of a triangle.
pub const COVERAGE_WANTED: f64 = 0.9;

/// Why a linkage may not be cut.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Reason {
    /// In words, with the measured value, the place, and what would help.
    pub text: String,
    /// Where it is on the surface, millimetres, if it is somewhere.
    pub at_mm: Option<[f64; 3]>,
    /// On which of several surfaces, counted from 0.
    #[serde(skip_serializing_if = "is_first")]
    pub surface: usize,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
fn is_first(surface: &usize) -> bool {
    *surface == 0
}

impl From<String> for Reason {
    fn from(text: String) -> Self {
        Self {
            text,
            at_mm: None,
            surface: 0,
        }
    }
}

/// Whether a linkage may be cut.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// True if it may.
    pub pass: bool,
    /// Why not, the gravest first.
    pub reasons: Vec<Reason>,
}

impl Verdict {
    /// Judges by the figures; `accept_distance` in L, `flat_overlaps` pairs of triangles that overlap on the sheet,
    /// `cone_tried` true if the program was free to place a cone.
    pub fn judge(
        quality: &Quality,
        flat: &Flattened,
        surface: &Surface,
        flat_overlaps: usize,
        accept_distance: f64,
        cone_tried: bool,
    ) -> Self {
        let mut reasons: Vec<Reason> = Vec::new();
        let mut say = |at_mm: Option<[f64; 3]>, text: String| {
            reasons.push(Reason {
                text,
                at_mm,
                surface: 0,
            });
        };
        let q = quality;
        if q.distance_max.value > accept_distance {
            say(
                Some(q.distance_max.at_mm),
                format!(
                    "the sheet misses the surface by {} L ({} mm) at {}; {} L is allowed. {}",
                    short(q.distance_max.value, 2),
                    short(q.distance_max.value * q.edge_mm, 1),
                    place(q.distance_max.at_mm.into()),
                    short(accept_distance, 2),
                    stretch_advice(flat, surface, q.sigma, cone_tried),
                ),
            );
        }
        if q.over_sigma > 0 {
            say(
                Some(q.opening_max.at_mm),
                format!(
                    "{} hinges open beyond σ = {}, the widest to {} at {}. {}",
                    q.over_sigma,
                    short(q.sigma, 3),
                    short(q.opening[2], 4),
                    place(q.opening_max.at_mm.into()),
                    stretch_advice(flat, surface, q.sigma, cone_tried),
                ),
            );
        }
        if q.penetrations > 0 {
            say(
                Some(q.penetration_depth.at_mm),
                format!(
                    "{} pairs of neighbouring triangles run into each other, the deepest by {} L at {}: the sheet would have to shrink there. Larger λ helps: remove more triangles at the cone (--remove 16), or choose another cone",
                    q.penetrations,
                    short(q.penetration_depth.value, 4),
                    place(q.penetration_depth.at_mm.into()),
                ),
            );
        }
        if q.intersections > 0 {
            say(
                q.intersection_at.map(|w| w.at_mm),
                format!(
                    "{} pairs of triangles cross each other in space{}: the surface bends too sharply for triangles of {} mm; use smaller ones (--triangles or --edge), or place a cone there",
                    q.intersections,
                    q.intersection_at.map_or_else(String::new, |w| format!(
                        ", one at {}",
                        place(w.at_mm.into())
                    )),
                    short(q.edge_mm, 2),
                ),
            );
        }
        if q.facing_away > 0 {
            say(
                None,
                format!(
                    "{} triangles are folded over and face away from the surface; use smaller triangles, or place a cone where the surface is steepest",
                    q.facing_away
                ),
            );
        }
        if q.edge_error_max > EDGE_TOLERANCE {
            say(
                None,
                format!(
                    "triangle edges are wrong by up to {:.1e} of their length, {EDGE_TOLERANCE:.0e} is allowed: a rigid sheet would not take this shape. Use --solver exact if you did not, smaller triangles, or a material with a larger σ",
                    q.edge_error_max
                ),
            );
        }
        if flat_overlaps > 0 {
            say(
                None,
                format!(
                    "{flat_overlaps} pairs of triangles lie on one another on the flat sheet, and dividing it did not help: place the cones elsewhere (--cone X,Y,Z)"
                ),
            );
        }
        if q.coverage < COVERAGE_WANTED {
            say(
                None,
                format!(
                    "only {} % of the surface is covered, {} % is wanted: use smaller triangles, which lose less at the rim",
                    short(100.0 * q.coverage, 1),
                    short(100.0 * COVERAGE_WANTED, 0),
                ),
            );
        }
        Self {
            pass: reasons.is_empty(),
            reasons,
        }
    }

    /// Adds what was found on the surface with this number (from 0); `name` is told where there are several.
    pub(crate) fn add(&mut self, found: Self, surface: usize, name: Option<&str>) {
        self.pass &= found.pass;
        self.reasons
            .extend(found.reasons.into_iter().map(|reason| Reason {
                text: match name {
                    Some(name) => format!("on {name}: {}", reason.text),
                    None => reason.text,
                },
                surface,
                ..reason
            }));
    }
}

impl Default for Verdict {
    /// Nothing found yet: it passes.
    fn default() -> Self {
        Self {
            pass: true,
            reasons: Vec::new(),
        }
    }
}

/// A place in words.
pub(crate) fn place(p: Point3<f64>) -> String {
    format!(
        "({}, {}, {}) mm",
        short(p.x, 1),
        short(p.y, 1),
        short(p.z, 1)
    )
}

/// What the conformal map says about stretching: how much would be needed, where, and what helps.
fn stretch_advice(flat: &Flattened, surface: &Surface, sigma: f64, cone_tried: bool) -> String {
    let needed = flat.scale.ratio();
    if needed <= sigma + SIGMA_TOLERANCE {
        return "σ would suffice for the smooth surface, so the triangles are too large for its detail: use smaller ones (--triangles or --edge)".into();
    }
    let vertex = flat.scale.max_vertex;
    let at = surface.position(vertex);
    let help = if !flat.layout.cones.is_empty() {
        "another place for a cone (--cone X,Y,Z), an open cut from there to a rim (--dart), a surface trimmed there, or a material with a larger σ may help"
            .to_owned()
    } else if cone_tried {
        "cones were tried and do not do better; an open cut from there to a rim (--dart), a surface trimmed there, or a material with a larger σ may help".to_owned()
    } else {
        format!(
            "a cone there (--cone auto, or --cone {},{},{}) or a material with a larger σ may help",
            short(at.x, 1),
            short(at.y, 1),
            short(at.z, 1)
        )
    };
    let who = match flat.layout.spread {
        Some(_) => "The surfaces together ask",
        None => "The surface asks",
    };
    format!(
        "{who} for a stretch of {} at {}, σ is {}: {help}",
        short(needed, 2),
        place(at),
        short(sigma, 3),
    )
}
