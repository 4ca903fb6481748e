//! Where a sheet misses its surface: which bound holds it back, and what would help, tried out rather than guessed.

use nalgebra::Point3;

use super::MakeError;
use super::request::Request;
use super::shape::{Shape, Stock};
use super::targets::Targets;
use super::verdict::{Reason, place};
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::linkage::{Linkage, LinkageOptions, Without, build_without, fit};
use crate::mesh::{ClosestPoint, Surface};
use crate::rationalize::{Bounds, Quality, Solver, rationalize};

/// Hinges within so many L of the worst point are asked what holds them.
const NEAR: f64 = 2.5;
/// A hinge cannot open farther.
const FULLY_OPEN: f64 = 2.0;
/// A σ that would do is found to this much.
const SIGMA_STEP: f64 = 0.01;
/// Triangles smaller by this factor are tried.
const SMALLER: f64 = 1.5;

/// Adds to the verdict, after the distance that is too large, what holds the sheet back there and what was found to help.
/// Costs a few solves; does nothing if the distance is as it should be.
///
/// # Errors
/// [`MakeError`]: interruption, memory.
pub(crate) fn explain(
    request: &Request,
    shape: &mut Shape,
    stock: &Stock<'_>,
    targets: &Targets,
    progress: &dyn Progress,
) -> Result<(), MakeError> {
    let missing = shape
        .fits
        .iter()
        .enumerate()
        .filter(|(_, fit)| fit.quality.distance_max.value > request.accept_distance)
        .max_by(|a, b| {
            let of = |fit: &super::shape::Fit| fit.quality.distance_max.value;
            of(a.1).total_cmp(&of(b.1))
        });
    let Some((n, fit)) = missing else {
        return Ok(());
    };
    let worst = fit.quality.distance_max;
    progress.start("looking for what would help", None);
    let trial = Trial {
        request,
        shape,
        stock,
        closest: &targets.0[n].closest,
        surface: match shape.ground.shapes.get(n) {
            Some(shape) => &shape.surface,
            None => &shape.ground.surface,
        },
        progress,
    };
    let mut text = trial.what_holds(&fit.positions, worst.at_mm.into());
    let found = match trial.sigma(&fit.positions)? {
        None if !targets.several() => trial.smaller()?,
        found => found,
    };
    if let Some(found) = found {
        text += &found;
    }
    if targets.several() {
        text = format!("on {}: {text}", targets.0[n].name);
    }
    let reasons = &mut shape.verdict.reasons;
    let after = reasons
        .iter()
        .position(|r| r.at_mm == Some(worst.at_mm) && r.surface == n)
        .map_or(reasons.len(), |i| i + 1);
    reasons.insert(
        after,
        Reason {
            text,
            at_mm: None,
            surface: n,
        },
    );
    Ok(())
}

struct Trial<'a> {
    request: &'a Request,
    shape: &'a Shape,
    stock: &'a Stock<'a>,
    closest: &'a ClosestPoint,
    surface: &'a Surface,
    progress: &'a dyn Progress,
}

impl Trial<'_> {
    /// Which bound holds the linkage near its worst point.
    fn what_holds(&self, positions: &[Point3<f64>], worst: Point3<f64>) -> String {
        let sigma = self.stock.sigma;
        let bounds = Bounds::near(&self.shape.linkage, positions, sigma, worst, NEAR);
        let Bounds {
            hinges,
            open,
            closed,
        } = bounds;
        let at = place(worst);
        let sigma = short(sigma, 3);
        match (open, closed) {
            (0, 0) => format!(
                "none of the {hinges} hinges around {at} stands at a bound: the triangles are too large for the surface there."
            ),
            (_, 0) => format!(
                "of {hinges} hinges around {at} {open} are open to σ = {sigma}: the sheet would have to stretch more there."
            ),
            (0, _) => format!(
                "of {hinges} hinges around {at} {closed} are closed: the sheet would have to shrink there."
            ),
            _ => format!(
                "of {hinges} hinges around {at} {open} are open to σ = {sigma} and {closed} are closed: the sheet would have to stretch more one way than the other."
            ),
        }
    }

    /// How far a linkage misses the surface, in L.
    fn misses(
        &self,
        linkage: &Linkage,
        start: &[Point3<f64>],
        sigma: f64,
    ) -> Result<f64, MakeError> {
        let solver = Solver::Exact;
        let (positions, _) =
            rationalize(linkage, start, self.closest, sigma, solver, self.progress)
                .map_err(MakeError::Rationalize)?;
        let quality = Quality::measure(linkage, &positions, self.surface, self.closest, sigma);
        Ok(quality.distance_max.value)
    }

    /// The least σ with which this very sheet would do, or that none would.
    fn sigma(&self, positions: &[Point3<f64>]) -> Result<Option<String>, MakeError> {
        let accept = self.request.accept_distance;
        let with = |sigma: f64| self.misses(&self.shape.linkage, positions, sigma);
        if self.stock.sigma + SIGMA_STEP > FULLY_OPEN || with(FULLY_OPEN)? > accept {
            return Ok(None);
        }
        let (mut no, mut yes) = (self.stock.sigma, FULLY_OPEN);
        while yes - no > SIGMA_STEP {
            let middle = 0.5 * (no + yes);
            if with(middle)? <= accept {
                yes = middle;
            } else {
                no = middle;
            }
        }
        let least = ((yes / SIGMA_STEP).ceil() * SIGMA_STEP).min(FULLY_OPEN);
        Ok(Some(format!(
            " This very sheet would do with a material of σ = {}",
            short(least, 2)
        )))
    }

    /// What triangles of two thirds the size would do.
    fn smaller(&self) -> Result<Option<String>, MakeError> {
        let (surface, layout) = (self.surface, &self.shape.flat.layout);
        let orientation_deg = Some(self.shape.orientation_deg);
        let wanted = self.shape.flat.edge_mm / SMALLER;
        let fitted = fit(
            surface,
            layout,
            wanted,
            false,
            orientation_deg,
            self.progress,
        );
        let built = fitted.and_then(|fitted| {
            let lattice = LinkageOptions {
                edge_mm: fitted.edge_mm,
                orientation: fitted.orientation_deg.to_radians(),
                handedness: self.request.handedness,
                remove_at_cone: self.shape.removed,
                sigma: self.stock.sigma,
            };
            let without = Without {
                rim: self.stock.rim.as_ref().map(|r| &r.cut),
                ..Without::nothing(&self.shape.ground.guide)
            };
            build_without(surface, &fitted.layout, &lattice, &without, self.progress)
        });
        // What cannot be laid out is no help, and no error here.
        let Ok(built) = built else {
            self.progress.check().map_err(MakeError::Interrupted)?;
            return Ok(None);
        };
        let edge_mm = built.linkage.edge_mm;
        let left = self.misses(&built.linkage, &built.start, self.stock.sigma)?;
        let verdict = if left <= self.request.accept_distance {
            ", which would do"
        } else {
            ": that alone is not enough"
        };
        Ok(Some(format!(
            " Triangles of {} mm would miss by {} L{verdict}",
            short(edge_mm, 2),
            short(left, 2),
        )))
    }
}
