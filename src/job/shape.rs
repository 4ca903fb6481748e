//! From a surface to a judged linkage with its flat sheet in place on the bed.
//!
//! Cheap steps first: map, linkage and sheet show whether the request can work at all before the long solve. Where
//! the number of triangles to remove at a cone is left open, more are removed only if fewer do not do.

use nalgebra::{Point2, Point3};

use super::MakeError;
use super::load::Loaded;
use super::request::{ConeWish, Request};
use super::verdict::{Verdict, place};
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::conformal::{
    Cone, ConformalError, FlattenOptions, Flattened, MetricSolver, SearchOptions, Singularities,
    Sizing, choose_turnings_with_hems, search,
};
use crate::linkage::{Built, Linkage, LinkageOptions, build, fit};
use crate::machine::Machine;
use crate::mesh::{ClosestPoint, Surface};
use crate::pattern::{self, Sheet};
use crate::rationalize::{Effort, Quality, rationalize};

/// What the sheet is to be, whatever its shape.
pub(crate) struct Stock<'a> {
    /// Largest scale factor.
    pub sigma: f64,
    /// Ligament width, millimetres.
    pub hinge_width_mm: f64,
    /// Width of the cut, millimetres.
    pub kerf_mm: f64,
    /// Whose bed it must fit.
    pub machine: &'a Machine,
}

/// A linkage solved and judged, and its sheet.
pub(crate) struct Shape {
    /// The map.
    pub flat: Flattened,
    /// The linkage as it was laid, before it was moved to its place on the bed.
    pub built: Built,
    /// Triangles removed at each positive cone.
    pub removed: usize,
    /// Direction of the lattice against the layout's X, degrees.
    pub orientation_deg: f64,
    /// Angle distortion that fitting the lattice to the seams added, root mean square; 0 for none.
    pub distortion: f64,
    /// The sheet in its place on the bed; none if triangles lie on one another.
    pub sheet: Option<Sheet>,
    /// The linkage with its flat positions there.
    pub linkage: Linkage,
    /// The layout's corners there, by face.
    pub chart: Vec<[Point2<f64>; 3]>,
    /// Where the points are in space, millimetres.
    pub positions: Vec<Point3<f64>>,
    /// What the solver did.
    pub effort: Effort,
    /// How good it is.
    pub quality: Quality,
    /// Whether it may be cut, as far as its shape goes.
    pub verdict: Verdict,
}

/// Triangles around a positive cone that are tried in turn unless a number is given: those at it, then those and the
/// next ring. λ falls to 0 at such a cone, and the finer the triangles, the deeper they reach into the fall.
const REMOVALS: [usize; 2] = [4, 16];

/// Sets of singularities that the search proposes and that are mapped.
const MAPPED: usize = 6;
/// Maps on which a linkage is tried, until one passes.
const TRIED: usize = 4;

/// Finds the shape: the first number of removed triangles that passes, else the one that comes closest.
pub(crate) fn shape(
    request: &Request,
    loaded: &Loaded,
    stock: &Stock<'_>,
    closest: &ClosestPoint,
    progress: &dyn Progress,
) -> Result<Shape, MakeError> {
    let mut best: Option<Shape> = None;
    let mut refused: Option<MakeError> = None;
    for map in maps(request, loaded, stock.sigma, progress)? {
        let surface = &loaded.import.surface;
        let shape = match attempt(request, surface, map, stock, closest, progress) {
            Ok(shape) => shape,
            // A map may ask for triangles that are too small for the hinges, or for too many, where another does not.
            Err(error @ (MakeError::Pattern(_) | MakeError::Linkage(_)))
                if progress.check().is_ok() =>
            {
                refused = refused.or(Some(error));
                continue;
            }
            Err(error) => return Err(error),
        };
        if shape.verdict.pass {
            return Ok(shape);
        }
        let nearer =
            |old: &Shape| shape.quality.distance_max.value < old.quality.distance_max.value;
        if best.as_ref().is_none_or(nearer) {
            best = Some(shape);
        }
    }
    best.ok_or_else(|| refused.unwrap_or_else(|| MakeError::Internal("no layout was tried".into())))
}

/// A map with the options that made it and the number of triangles to remove.
struct Map {
    flat: Flattened,
    options: FlattenOptions,
    removal: usize,
}

/// The maps worth trying, the most promising first. With cones left to the program: without one, and, if that leaves
/// [1, σ], with what is proposed instead; with the number of triangles to remove left open: each of [`REMOVALS`].
fn maps(
    request: &Request,
    loaded: &Loaded,
    sigma: f64,
    progress: &dyn Progress,
) -> Result<Vec<Map>, MakeError> {
    let surface = &loaded.import.surface;
    let mut solver = MetricSolver::new(surface).map_err(MakeError::Conformal)?;
    let options = |removal: usize| FlattenOptions {
        sigma,
        sizing: request.sizing,
        cone_clearance: clearance(removal),
    };
    let removals = |cones: &[Cone]| match request.remove_at_cone {
        _ if cones.iter().all(|c| c.units <= 0) => vec![0],
        Some(count) => vec![count],
        None => REMOVALS.to_vec(),
    };
    let resized = |flat: Flattened| -> Vec<Map> {
        let map = |removal: usize| Map {
            flat: flat.clone().resize(surface, &options(removal)),
            options: options(removal),
            removal,
        };
        removals(&flat.layout.cones).into_iter().map(map).collect()
    };
    // With the turnings of the rims as asked for, or those that suit these cones best.
    let mut with_cones = |cones: &[Cone]| -> Result<Vec<Map>, ConformalError> {
        progress.start("conformal map", None);
        let first = options(removals(cones)[0]);
        let flat = match &request.turnings {
            Some(turnings) => {
                let given = Singularities {
                    cones: cones.to_vec(),
                    turnings: turnings.clone(),
                    straight: request.straight.clone(),
                };
                Flattened::solve(&mut solver, &given, &first, progress)
            }
            None => {
                choose_turnings_with_hems(&mut solver, cones, &request.straight, &first, progress)
            }
        };
        flat.map(resized)
    };
    let mut maps = match &loaded.cones {
        Some(cones) => with_cones(cones).map_err(MakeError::Conformal)?,
        None => {
            let mut refused = None;
            let mut maps = match with_cones(&[]) {
                // A closed surface may need cones.
                Err(error @ ConformalError::TotalCurvature { .. }) => {
                    refused = Some(error);
                    Vec::new()
                }
                plain => plain.map_err(MakeError::Conformal)?,
            };
            if maps.first().is_some_and(|m| m.flat.scale.within(sigma)) {
                return Ok(maps);
            }
            // The obvious cone; the search may find a better one, or that none is worth its price.
            let obvious = maps
                .first()
                .and_then(|m| m.flat.proposed_cone(surface, sigma));
            if let Some(cone) = obvious {
                maps.extend(with_cones(&[cone]).map_err(MakeError::Conformal)?);
            }
            progress.start("searching for cones", None);
            let edge_mm = match request.sizing {
                Sizing::EdgeMm(edge) => edge,
                // Half of a surface is about as much as its sheet.
                Sizing::Triangles(count) => (surface.area() / (2.0 * count * 0.433)).sqrt(),
            };
            let wish = SearchOptions { sigma, edge_mm };
            let mut sets = search(&mut solver, &wish, progress).map_err(MakeError::Conformal)?;
            // The search knows nothing of hems: what it proposes goes where they turn by 0.
            sets.iter_mut()
                .for_each(|set| set.straight = request.straight.clone());
            sets.retain(|set| set.check(surface).is_ok());
            let known: Vec<Singularities> =
                maps.iter().map(|m| m.flat.singularities.clone()).collect();
            for set in sets.into_iter().filter(|s| !known.contains(s)).take(MAPPED) {
                let first = options(removals(&set.cones)[0]);
                match Flattened::solve(&mut solver, &set, &first, progress) {
                    Ok(flat) => maps.extend(resized(flat)),
                    // Cones on a surface with handles rarely close around them.
                    Err(
                        error @ (ConformalError::Holonomy { .. }
                        | ConformalError::NotConverged { .. }),
                    ) => refused = Some(error),
                    Err(error) => return Err(MakeError::Conformal(error)),
                }
            }
            if let Some(error) = refused.filter(|_| maps.is_empty()) {
                return Err(MakeError::Conformal(error));
            }
            maps
        }
    };
    // A map within [1, σ] comes first, the one that removes least of those; else the one that leaves least of the
    // surface outside. The sort is stable.
    let outside = |map: &Map| {
        if map.flat.scale.within(sigma) {
            0.0
        } else {
            1.0 - map.flat.scale.inside
        }
    };
    maps.sort_by(|a, b| outside(a).total_cmp(&outside(b)));
    maps.truncate(TRIED);
    Ok(maps)
}

fn attempt(
    request: &Request,
    surface: &Surface,
    map: Map,
    stock: &Stock<'_>,
    closest: &ClosestPoint,
    progress: &dyn Progress,
) -> Result<Shape, MakeError> {
    let Laid {
        flat,
        built,
        orientation_deg,
        distortion,
    } = lay_out(request, surface, &map, stock.sigma, progress)?;
    progress.note(&describe_map(&flat, surface, stock.sigma));
    // The sheet depends on flat positions only: what does not fit the bed is known before the long solve.
    let (mut sheet, mut motion) = (None, None);
    if built.overlaps.is_empty() {
        let drawn = Sheet::new(&built.linkage, stock.hinge_width_mm, stock.kerf_mm)
            .map_err(MakeError::Pattern)?;
        let (placed, how) =
            pattern::placed(&drawn, stock.machine, request.mirror).map_err(MakeError::Pattern)?;
        (sheet, motion) = (Some(placed), Some(how));
    }
    let moved = |p: Point2<f64>| match &motion {
        Some(motion) => {
            let (x, y) = motion.apply(p.x, p.y);
            Point2::new(x, y)
        }
        None => p,
    };
    let mut linkage = built.linkage.clone();
    linkage
        .triangles
        .iter_mut()
        .for_each(|t| t.flat = t.flat.map(moved));
    let chart = flat.layout.corners.iter().map(|c| c.map(moved)).collect();

    progress.start("rationalising", Some(5));
    let (positions, effort) = rationalize(
        &linkage,
        &built.start,
        closest,
        stock.sigma,
        request.solver,
        progress,
    )
    .map_err(MakeError::Rationalize)?;
    let quality = Quality::measure(&linkage, &positions, surface, closest, stock.sigma);
    let verdict = Verdict::judge(
        &quality,
        &flat,
        surface,
        built.overlaps.len(),
        request.accept_distance,
        request.cones == ConeWish::Auto,
    );
    Ok(Shape {
        flat,
        built,
        removed: map.removal,
        orientation_deg,
        distortion,
        sheet,
        linkage,
        chart,
        positions,
        effort,
        quality,
        verdict,
    })
}

/// A lattice laid on a map.
struct Laid {
    /// The map, warped so that the lattice goes on across its seams.
    flat: Flattened,
    built: Built,
    orientation_deg: f64,
    distortion: f64,
}

/// Lays the lattice. With a number of triangles asked for, the edge is corrected once for those that the rim costs.
fn lay_out(
    request: &Request,
    surface: &Surface,
    map: &Map,
    sigma: f64,
    progress: &dyn Progress,
) -> Result<Laid, MakeError> {
    let resized = |sizing: Sizing| {
        let options = FlattenOptions {
            sizing,
            ..map.options.clone()
        };
        map.flat.clone().resize(surface, &options)
    };
    let fitted = |flat: &Flattened, exact: bool, orientation_deg: Option<f64>| {
        fit(
            surface,
            &flat.layout,
            flat.edge_mm,
            exact,
            orientation_deg,
            progress,
        )
        .map_err(MakeError::Linkage)
    };
    let lay = |mut flat: Flattened, exact: bool| -> Result<Laid, MakeError> {
        let hem = request
            .straight
            .first()
            .and_then(|&rim| surface.rims().get(rim))
            .map(|rim| flat.layout.rim_direction(surface, rim).to_degrees());
        let mut fit = fitted(&flat, exact, request.orientation_deg.or(hem))?;
        if !exact || request.orientation_deg.is_none() {
            // Whatever chose edge and orientation, the result is the one that these two alone would give, to the last
            // bit.
            flat = resized(Sizing::EdgeMm(fit.edge_mm));
            fit = fitted(&flat, true, Some(fit.orientation_deg))?;
        }
        let lattice = LinkageOptions {
            edge_mm: fit.edge_mm,
            orientation: fit.orientation_deg.to_radians(),
            handedness: request.handedness,
            remove_at_cone: map.removal,
            sigma,
        };
        let built = build(surface, &fit.layout, &lattice, progress).map_err(MakeError::Linkage)?;
        flat.layout = fit.layout;
        Ok(Laid {
            flat,
            built,
            orientation_deg: fit.orientation_deg,
            distortion: fit.distortion,
        })
    };
    match request.sizing {
        Sizing::EdgeMm(_) => lay(map.flat.clone(), true),
        Sizing::Triangles(wanted) => {
            let got = lay(map.flat.clone(), false)?.built.linkage.triangles.len() as f64;
            lay(resized(Sizing::Triangles(wanted * wanted / got)), false)
        }
    }
}

/// Radius around a cone, in L, that no triangle's centre comes within: 1/√3 with all triangles in place, 2/√3 without
/// the four at the cone, 2 rings without sixteen; taken a little smaller for the second and third because corners
/// reach further in than centres.
fn clearance(removal: usize) -> f64 {
    if removal == 0 {
        0.7
    } else {
        (removal as f64 / 4.0).sqrt().floor().max(1.0) + 0.1
    }
}

/// One line about the map: the cones, λ, the edge length.
fn describe_map(flat: &Flattened, surface: &Surface, sigma: f64) -> String {
    let cones: Vec<String> = flat
        .layout
        .cones
        .iter()
        .map(|c| format!("{:+} at {}", c.units, place(surface.position(c.vertex))))
        .collect();
    let cones = match cones.len() {
        0 => "no cone".to_owned(),
        1 => format!("one cone, {}", cones[0]),
        n => format!("{n} cones, {}", cones.join(", ")),
    };
    let turnings: Vec<String> = flat
        .singularities
        .rim_turnings_deg()
        .iter()
        .map(|deg| format!("{deg}°"))
        .collect();
    let rims = match turnings.len() {
        0 => String::new(),
        _ => format!("; inner rims turning by {}", turnings.join(", ")),
    };
    let hems: Vec<String> = flat
        .singularities
        .straight_rims()
        .iter()
        .map(|rim| format!("; rim {rim} straight"))
        .collect();
    let rims = rims + &hems.concat();
    format!(
        "conformal map: {cones}{rims}; λ from {} to {} (σ = {}), triangle edge {} mm",
        short(flat.scale.min, 3),
        short(flat.scale.max, 3),
        short(sigma, 3),
        short(flat.edge_mm, 3),
    )
}
