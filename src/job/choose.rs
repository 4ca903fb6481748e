//! Which of many shapes: the first that passes, on a surface opened by as few darts as possible.
//!
//! The maps of [`maps`] are tried, the most promising first. Where cones are left to the program and no map is within
//! reach, the surface is opened by a dart where it is worst, and mapped again; handles around which the pattern cannot
//! close are cut open. In the end the darts are taken back that later ones have made needless.

use std::sync::Arc;

use super::MakeError;
use super::load::Loaded;
use super::maps::{Ground, Map, maps};
use super::request::Request;
use super::shape::{Shape, Stock, attempt};
use super::targets::Targets;
use super::verdict::place;
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::conformal::{ConformalError, Dart, around_handles, patches, to_goals};
use crate::linkage::SeamGuide;
use crate::mesh::{Surface, VertexId};

/// Linkages tried on one surface before it gets another dart, and in all once there is nothing more to open.
const TRIED: usize = 4;
/// Darts at the most that the program opens by itself, beside those that open handles.
const MOST_DARTS: usize = 8;
/// Maps tried without a dart that is to be taken back.
const RETRIED: usize = 2;
/// While there are darts to try, a map is laid out only if its misfit is smaller, in L. The solve spreads what a map
/// asks too much: a scan whose map was off by more than 1.5 came within 0.08 L of its surface without a dart, where a
/// bound of 0.7 gave it six.
const PROMISING: f64 = 3.0;

/// Finds the shape with the pattern on one surface, `original`: the first map that passes, with as few darts as possible,
/// else the one that comes closest.
pub(crate) fn choose(
    request: &Request,
    loaded: &Loaded,
    original: &Surface,
    stock: &Stock<'_>,
    targets: &Targets,
    progress: &dyn Progress,
) -> Result<Shape, MakeError> {
    let guide = SeamGuide::new(original)
        .along(original, &loaded.cuts)
        .map_err(MakeError::Conformal)?;
    let mut darts = loaded.darts.clone().unwrap_or_default();
    let mut free = request.darts_are_free();
    let mut tries = Tries::default();
    // Darts that are no proposal to be taken back: those asked for, and those that open handles.
    let mut fixed = darts.len();
    loop {
        let ground = Arc::new(Ground::new(original, &darts, &guide, &targets.0)?);
        free &= darts.len() < fixed + MOST_DARTS;
        let found = match maps(
            request,
            loaded.cones.as_deref(),
            &ground,
            stock.sigma,
            progress,
        ) {
            Err(MakeError::Conformal(
                error @ (ConformalError::Holonomy { .. } | ConformalError::TotalCurvature { .. }),
            )) if free && ground.surface.genus() > 0 => {
                // The pattern does not close around the handles.
                darts.extend(around_handles(original).map_err(MakeError::Conformal)?);
                fixed = darts.len();
                progress.note(&format!("the handles are cut open: {error}"));
                continue;
            }
            // A dart may leave a surface that cannot be mapped; what was found before it still counts.
            Err(MakeError::Conformal(error)) if darts.len() > fixed && progress.check().is_ok() => {
                tries.refused.get_or_insert(MakeError::Conformal(error));
                break;
            }
            found => found?,
        };
        let next = match found.first() {
            Some(map) if free => dart_for(original, map, stock.sigma)?,
            _ => None,
        };
        for map in found {
            let promising = map.misfit() < PROMISING;
            if tries.on(&ground) >= TRIED || next.is_some() && !promising {
                tries.waiting.push(map);
            } else if let Some(shape) = tries.attempt(request, map, stock, targets, progress)? {
                return with_fewer_darts(request, original, shape, fixed, stock, targets, progress);
            }
        }
        let Some(dart) = next else { break };
        let at = original.position(dart.stops[0]);
        progress.note(&format!(
            "no cones suffice: a dart is opened at {}",
            place(at)
        ));
        darts.push(dart);
    }
    // Nothing passed. The most promising of what was left for later, for the best answer to give.
    let mut waiting = std::mem::take(&mut tries.waiting);
    waiting.sort_by(|a, b| a.misfit().total_cmp(&b.misfit()));
    for map in waiting {
        if tries.count >= TRIED {
            break;
        }
        if let Some(shape) = tries.attempt(request, map, stock, targets, progress)? {
            return with_fewer_darts(request, original, shape, fixed, stock, targets, progress);
        }
    }
    let nothing = || MakeError::Internal("no layout was tried".into());
    tries
        .best
        .ok_or_else(|| tries.refused.unwrap_or_else(nothing))
}

/// Takes back the darts after the first `fixed`, one by one, that the shape passes without: what an early dart was for,
/// later ones may have taken over.
fn with_fewer_darts(
    request: &Request,
    original: &Surface,
    shape: Shape,
    fixed: usize,
    stock: &Stock<'_>,
    targets: &Targets,
    progress: &dyn Progress,
) -> Result<Shape, MakeError> {
    let mut best = shape;
    let mut next = fixed;
    // The last one was needed: it passed with it, and not without.
    while next + 1 < best.ground.darts.len() {
        progress.check().map_err(MakeError::Interrupted)?;
        let mut darts = best.ground.darts.clone();
        darts.remove(next);
        next += 1;
        let Ok(ground) = Ground::new(original, &darts, &best.ground.guide, &targets.0) else {
            continue;
        };
        let Ok(found) = maps(request, None, &Arc::new(ground), stock.sigma, progress) else {
            continue;
        };
        let mut tries = Tries::default();
        for map in found.into_iter().take(RETRIED) {
            if map.misfit() > PROMISING {
                break;
            }
            // What goes wrong here does not cost the shape that passes already.
            match tries.attempt(request, map, stock, targets, progress) {
                Ok(Some(shape)) => {
                    progress.note("one dart less will do");
                    best = shape;
                    next -= 1;
                    break;
                }
                Err(error @ MakeError::Interrupted(_)) => return Err(error),
                _ => {}
            }
        }
    }
    Ok(best)
}

/// The dart that takes up what a map misses most: from where λ is farthest outside to the nearest opening, on a surface
/// without one to the next such place.
fn dart_for(original: &Surface, map: &Map, sigma: f64) -> Result<Option<Dart>, MakeError> {
    let surface = &map.ground.surface;
    let exclude_mm = map.options.cone_clearance * map.flat.edge_mm;
    let patches = patches(surface, &map.flat.layout, exclude_mm, sigma);
    let count = original.positions().len();
    let known = |v: &VertexId| (v.0 as usize) < count;
    let mut peaks = patches.iter().map(|p| p.peak).filter(known);
    let Some(from) = peaks.next() else {
        return Ok(None);
    };
    let closed = surface.rims().is_empty();
    let goals: Vec<_> = if closed {
        peaks.take(1).collect()
    } else {
        Vec::new()
    };
    to_goals(original, &map.ground.darts, from, &goals).map_err(MakeError::Conformal)
}

/// What was tried so far.
#[derive(Default)]
struct Tries {
    count: usize,
    /// Tried on the surface of that many darts.
    here: (usize, usize),
    waiting: Vec<Map>,
    best: Option<Shape>,
    refused: Option<MakeError>,
}

impl Tries {
    /// How many were tried on this surface.
    fn on(&mut self, ground: &Ground) -> usize {
        if self.here.0 != ground.darts.len() {
            self.here = (ground.darts.len(), 0);
        }
        self.here.1
    }

    /// Tries a map; the shape if it passes.
    fn attempt(
        &mut self,
        request: &Request,
        map: Map,
        stock: &Stock<'_>,
        targets: &Targets,
        progress: &dyn Progress,
    ) -> Result<Option<Shape>, MakeError> {
        self.here.1 += 1;
        let shape = match attempt(request, map, stock, targets, progress) {
            Ok(shape) => shape,
            // A map may ask for triangles that are too small for the hinges, or for too many, where another does not.
            Err(error @ (MakeError::Pattern(_) | MakeError::Linkage(_)))
                if progress.check().is_ok() =>
            {
                self.refused.get_or_insert(error);
                return Ok(None);
            }
            Err(error) => return Err(error),
        };
        self.count += 1;
        if shape.verdict.pass {
            return Ok(Some(shape));
        }
        progress.note(&format!(
            "tried: the sheet misses {} by {} L",
            if targets.several() {
                "one of the surfaces"
            } else {
                "the surface"
            },
            short(shape.worst_distance(), 2)
        ));
        let nearer = |old: &Shape| shape.worst_distance() < old.worst_distance();
        if self.best.as_ref().is_none_or(nearer) {
            self.best = Some(shape);
        }
        Ok(None)
    }
}
