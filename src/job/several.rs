//! Which surface the pattern is laid on, where one sheet is to fit several.
//!
//! The mean of all is nearest to each, and its map asks for least beyond the sheet where the surfaces are near to each
//! other: on two faces it leaves out half as many triangles as a pattern laid on either. Of shapes far apart it may be
//! worse than any of them (halfway between a plate and a tube is a narrow plate). So the maps without singularities are
//! compared first, which takes a moment, and the surfaces are tried in that order until a sheet passes on all targets.

use std::sync::Arc;

use super::MakeError;
use super::choose::choose;
use super::load::Loaded;
use super::maps::{Ground, maps};
use super::request::Request;
use super::shape::{Shape, Stock};
use super::targets::Targets;
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::linkage::SeamGuide;
use crate::mesh::Surface;

/// The mean is tried first unless another surface has less than this part of its misfit: the map without singularities
/// says little about the one with them.
const MUCH_BETTER: f64 = 0.5;

/// Finds the shape that fits all targets: on the surface that the request names to lay the pattern on, else on the first
/// on which one passes, else on that which comes closest to its worst target.
///
/// # Errors
/// [`MakeError`] if there is none on any surface.
pub(crate) fn choose_for_all(
    request: &Request,
    loaded: &Loaded,
    stock: &Stock<'_>,
    targets: &Targets,
    progress: &dyn Progress,
) -> Result<Shape, MakeError> {
    let patterns = match &request.shares {
        Some(shares) => vec![shares.clone()],
        None => ordered(request, loaded, stock, targets, progress)?,
    };
    let mut best: Option<Shape> = None;
    let mut refused = None;
    for shares in patterns {
        if targets.several() {
            progress.note(&laid_on(&shares, targets));
        }
        let surface = targets.mixed(&shares)?;
        let shape = match choose(request, loaded, &surface, stock, targets, progress) {
            Ok(shape) => Shape { shares, ..shape },
            // Where a mean cannot be used, one of the surfaces may.
            Err(error) if targets.several() && progress.check().is_ok() => {
                refused.get_or_insert(error);
                continue;
            }
            Err(error) => return Err(error),
        };
        if shape.verdict.pass {
            return Ok(shape);
        }
        let nearer = |old: &Shape| shape.worst_distance() < old.worst_distance();
        if best.as_ref().is_none_or(nearer) {
            best = Some(shape);
        }
    }
    let nothing = || MakeError::Internal("no pattern was tried".into());
    best.ok_or_else(|| refused.unwrap_or_else(nothing))
}

/// The shares to try, the most promising first.
fn ordered(
    request: &Request,
    loaded: &Loaded,
    stock: &Stock<'_>,
    targets: &Targets,
    progress: &dyn Progress,
) -> Result<Vec<Vec<f64>>, MakeError> {
    let patterns = targets.patterns();
    if patterns.len() < 2 {
        return Ok(patterns);
    }
    let mut misfits = Vec::with_capacity(patterns.len());
    for shares in &patterns {
        let surface = targets.mixed(shares)?;
        let misfit = misfit(request, loaded, &surface, stock, targets, progress);
        progress.check()?;
        misfits.push(misfit.unwrap_or(f64::INFINITY));
    }
    let mut order: Vec<usize> = (0..patterns.len()).collect();
    let least = misfits.iter().copied().fold(f64::INFINITY, f64::min);
    if least < MUCH_BETTER * misfits[0] {
        order.sort_by(|&a, &b| misfits[a].total_cmp(&misfits[b]));
    }
    Ok(order.into_iter().map(|k| patterns[k].clone()).collect())
}

/// What the map of one surface asks for beyond the sheet, over all targets, in L: without singularities but those that
/// were asked for.
fn misfit(
    request: &Request,
    loaded: &Loaded,
    surface: &Surface,
    stock: &Stock<'_>,
    targets: &Targets,
    progress: &dyn Progress,
) -> Result<f64, MakeError> {
    let darts = loaded.darts.as_deref().unwrap_or_default();
    let guide = SeamGuide::new(surface);
    let ground = Arc::new(Ground::new(surface, darts, &guide, &targets.0)?);
    let cones = loaded.cones.as_deref().unwrap_or_default();
    let found = maps(request, Some(cones), &ground, stock.sigma, progress)?;
    Ok(found
        .first()
        .map_or(f64::INFINITY, super::maps::Map::misfit))
}

/// Which surface the pattern is laid on, in words.
fn laid_on(shares: &[f64], targets: &Targets) -> String {
    match shares.iter().position(|&s| s == 1.0) {
        Some(alone) => format!("the pattern is laid on {}", targets.0[alone].name),
        None => {
            let shares: Vec<String> = shares.iter().map(|s| short(100.0 * s, 1)).collect();
            format!(
                "the pattern is laid on the mean of the surfaces ({} %)",
                shares.join(" + ")
            )
        }
    }
}
