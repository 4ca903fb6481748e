//! From a map to a judged linkage with its flat sheet in place on the bed.
//!
//! Cheap steps first: linkage and sheet show whether the request can work at all before the long solve. Where a linkage
//! fails by a few triangles only, it is made once more without them.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Point2, Point3};

use super::MakeError;
use super::maps::{Ground, Map};
use super::request::{ConeWish, Request};
use super::sheets::Sheets;
use super::targets::{Shaped, Targets};
use super::verdict::{Verdict, place};
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::conformal::{FlattenOptions, Flattened, Layout, Sizing};
use crate::linkage::{
    Built, Flaps, Linkage, LinkageOptions, SmoothRim, TriangleId, Without, build_without, fit,
};
use crate::machine::Machine;
use crate::mesh::Surface;
use crate::pattern::{Sheet, SheetOptions};
use crate::rationalize::{Effort, Quality, STAGE_COUNT, failing, rationalize};

/// A smooth rim.
pub(crate) struct Rim {
    /// Where it runs.
    pub cut: SmoothRim,
    /// The surface that ends there: what is to be covered.
    pub inner: Arc<Surface>,
}

/// What the sheet is to be, whatever its shape.
pub(crate) struct Stock<'a> {
    /// Largest scale factor.
    pub sigma: f64,
    /// With which confidence no hinge fails, where strips say so.
    pub confidence: Option<f64>,
    /// Hinge width, kerf and shapes.
    pub options: SheetOptions,
    /// Whose bed it must fit.
    pub machine: &'a Machine,
    /// A piece of stock in the bed's corner, millimetres; `None`: as large as the bed.
    pub stock_mm: Option<[f64; 2]>,
    /// Divide what does not fit.
    pub divide: bool,
    /// Where the sheet is cut along the smooth rim of its surface; `None` for lattice edges.
    pub rim: Option<Rim>,
    /// Tabs for each part.
    pub tabs: usize,
    /// Width of each, millimetres.
    pub tab_width_mm: f64,
}

/// A linkage solved and judged, and its sheet.
pub(crate) struct Shape {
    /// The surface as it was mapped, and its darts.
    pub ground: Arc<Ground>,
    /// The map.
    pub flat: Flattened,
    /// The linkage as it was laid, before it was moved to its place on the bed.
    pub built: Built,
    /// Triangles removed at each positive cone.
    pub removed: usize,
    /// Triangles left out beside those at cones, by their numbers; see [`Built::numbers`].
    pub left_out: Vec<u32>,
    /// Direction of the lattice against the layout's X, degrees.
    pub orientation_deg: f64,
    /// Angle distortion that fitting the lattice to the seams added, root mean square; 0 for none.
    pub distortion: f64,
    /// Doubled rows along the seams, as they are cut.
    pub flaps: Flaps,
    /// True if the sheet fits the bed only without the doubled rows that it should have.
    pub flaps_too_large: bool,
    /// True if the sheet was divided because it does not fit as one.
    pub divided: bool,
    /// The sheets, each in its place on the bed; none if triangles lie on one another.
    pub sheets: Vec<Sheet>,
    /// The linkage with its flat positions there.
    pub linkage: Linkage,
    /// The layout's corners there, by face.
    pub chart: Vec<[Point2<f64>; 3]>,
    /// On each target, in their order.
    pub fits: Vec<Fit>,
    /// Whether it may be cut, as far as its shape goes.
    pub verdict: Verdict,
    /// Share of each target in the surface that the pattern is laid on.
    pub shares: Vec<f64>,
}

/// The linkage on one target.
pub(crate) struct Fit {
    /// Where the points are in space, millimetres.
    pub positions: Vec<Point3<f64>>,
    /// What the solver did.
    pub effort: Effort,
    /// How good it is.
    pub quality: Quality,
}

/// Where a linkage fails by a few triangles only, it is made again without them, so often at the most.
const MENDED: usize = 4;
/// Rounds of closing slots.
const MOST_SLOTS: usize = 8;
/// Part of all triangles that may be left out like this.
const MOST_LEFT_OUT: f64 = 0.015;
/// The same where one sheet is to fit several surfaces: their outlines are no conformal images of each other, so that
/// what hangs over the rim of one or the other goes. How much of each is covered is judged in any case.
const MOST_LEFT_OUT_OF_SEVERAL: f64 = 0.05;

/// Lays a linkage on a map, solves and judges it; where it fails by a few triangles only, it is made once more without
/// them.
pub(crate) fn attempt(
    request: &Request,
    map: Map,
    stock: &Stock<'_>,
    targets: &Targets,
    progress: &dyn Progress,
) -> Result<Shape, MakeError> {
    let mut left_out = request.left_out.clone().unwrap_or_default();
    let mut laid = lay_out(request, &map, &left_out, stock, progress)?;
    if request.left_out.is_none() {
        let (layout, lattice) = (&laid.flat.layout, &laid.lattice);
        close_slots(
            &map,
            stock,
            (layout, lattice),
            &mut laid.built,
            &mut left_out,
            progress,
        )?;
    }
    progress.note(&describe_map(&laid.flat, &map.ground.surface, stock.sigma));
    let (flat, lattice) = (laid.flat.clone(), laid.lattice);
    let (orientation_deg, distortion) = (laid.orientation_deg, laid.distortion);
    let whole = laid.built.linkage.triangles.len();
    let first = solve(request, &map, laid, &left_out, stock, targets, progress)?;
    if first.verdict.pass || request.left_out.is_some() {
        return Ok(first);
    }
    let part = if targets.several() {
        MOST_LEFT_OUT_OF_SEVERAL
    } else {
        MOST_LEFT_OUT
    };
    let most = (part * whole as f64) as usize;
    let mut failing = first.failing(request, stock, targets);
    for _ in 0..MENDED {
        left_out.extend(&failing);
        left_out.sort_unstable();
        if failing.is_empty() || left_out.len() > most {
            break;
        }
        progress.note(&format!("left out: {} triangles", left_out.len()));
        let surface = &map.ground.surface;
        let layout = &flat.layout;
        let without = without(&map, stock, &left_out);
        let mut built = build_without(surface, layout, &lattice, &without, progress)
            .map_err(MakeError::Linkage)?;
        let laid_on = (layout, &lattice);
        close_slots(&map, stock, laid_on, &mut built, &mut left_out, progress)?;
        let laid = Laid {
            flat: flat.clone(),
            built,
            lattice,
            orientation_deg,
            distortion,
        };
        let mended = solve(request, &map, laid, &left_out, stock, targets, progress)?;
        if mended.verdict.pass {
            return Ok(mended);
        }
        failing = mended.failing(request, stock, targets);
    }
    Ok(first)
}

/// Leaves out triangles until the sheet has no slot without width, which could not be cut. Where triangles go, its seam
/// may run otherwise and leave a new one.
fn close_slots(
    map: &Map,
    stock: &Stock<'_>,
    (layout, lattice): (&Layout, &LinkageOptions),
    built: &mut Built,
    left_out: &mut Vec<u32>,
    progress: &dyn Progress,
) -> Result<(), MakeError> {
    for _ in 0..MOST_SLOTS {
        let later: BTreeSet<u32> = built
            .slots
            .iter()
            .map(|slot| built.numbers[slot.1.0 as usize])
            .collect();
        if later.is_empty() {
            break;
        }
        left_out.extend(later);
        left_out.sort_unstable();
        let surface = &map.ground.surface;
        let without = without(map, stock, left_out);
        *built = build_without(surface, layout, lattice, &without, progress)
            .map_err(MakeError::Linkage)?;
    }
    Ok(())
}

fn without<'a>(map: &'a Map, stock: &'a Stock<'_>, triangles: &'a [u32]) -> Without<'a> {
    Without {
        triangles,
        guide: &map.ground.guide,
        rim: stock.rim.as_ref().map(|r| &r.cut),
    }
}

/// Solves and judges a linkage, and draws its sheet.
fn solve(
    request: &Request,
    map: &Map,
    laid: Laid,
    left_out: &[u32],
    stock: &Stock<'_>,
    targets: &Targets,
    progress: &dyn Progress,
) -> Result<Shape, MakeError> {
    let ground = Arc::clone(&map.ground);
    let surface = &ground.surface;
    let Laid {
        flat,
        built,
        orientation_deg,
        distortion,
        ..
    } = laid;
    // The sheet depends on flat positions only: what does not fit the bed is known before the long solve.
    let sheets = Sheets::lay(built, request, stock)?;
    let mut linkage = sheets.built.linkage.clone();
    for (n, triangle) in linkage.triangles.iter_mut().enumerate() {
        let id = TriangleId(n as u32);
        triangle.flat = triangle.flat.map(|p| sheets.place(id, p));
    }
    // A layout of which the pieces lie here and there has no place of its own.
    let moved = |p: Point2<f64>| match sheets.motion() {
        Some(motion) => {
            let (x, y) = motion.apply(p.x, p.y);
            Point2::new(x, y)
        }
        None => p,
    };
    let chart = flat.layout.corners.iter().map(|c| c.map(moved)).collect();
    let built = &sheets.built;

    let mut fits = Vec::with_capacity(targets.0.len());
    let mut verdict = Verdict::default();
    for (n, target) in targets.0.iter().enumerate() {
        let name = targets.several().then_some(target.name.as_str());
        let step = name.map_or_else(
            || "rationalising".to_owned(),
            |name| format!("rationalising on {name}"),
        );
        progress.start(&step, Some(STAGE_COUNT));
        let shape = ground.shapes.get(n);
        let start = match shape {
            Some(shape) => {
                built.start_on(&shape.surface, &on_shape(&flat.layout, shape), stock.sigma)
            }
            None => built.start.clone(),
        };
        let (positions, effort) = rationalize(
            &linkage,
            &start,
            &target.closest,
            stock.sigma,
            request.solver,
            progress,
        )
        .map_err(MakeError::Rationalize)?;
        let surface = shape.map_or(surface, |shape| &shape.surface);
        let wanted = stock.rim.as_ref().map_or(surface, |rim| &rim.inner);
        let quality = Quality::measure(&linkage, &positions, wanted, &target.closest, stock.sigma);
        let judged = Verdict::judge(
            &quality,
            &flat,
            surface,
            // The sheet is one for all.
            if n == 0 { built.overlaps.len() } else { 0 },
            request.accept_distance,
            request.cones == ConeWish::Auto,
        );
        verdict.add(judged, n, name);
        fits.push(Fit {
            positions,
            effort,
            quality,
        });
    }
    Ok(Shape {
        ground: Arc::clone(&ground),
        flat,
        removed: map.removal,
        left_out: left_out.to_vec(),
        orientation_deg,
        distortion,
        built: sheets.built,
        flaps: sheets.flaps,
        flaps_too_large: sheets.flaps_too_large,
        divided: sheets.divided,
        sheets: sheets.sheets,
        linkage,
        chart,
        fits,
        verdict,
        shares: vec![1.0],
    })
}

/// A layout with the λ that a shape of its surface asks for.
pub(crate) fn on_shape(layout: &Layout, shape: &Shaped) -> Layout {
    let mut layout = layout.clone();
    layout.spread = None;
    for (own, more) in layout.log_scale.iter_mut().zip(shape.log_factor.iter()) {
        *own += more;
    }
    layout
}

/// A lattice laid on a map.
pub(crate) struct Laid {
    /// The map, warped so that the lattice goes on across its seams.
    pub flat: Flattened,
    built: Built,
    lattice: LinkageOptions,
    pub orientation_deg: f64,
    distortion: f64,
}

impl Shape {
    /// On the first target.
    pub fn first(&self) -> &Fit {
        // There is no shape without a target.
        &self.fits[0]
    }

    /// The largest distance from any target, in L.
    pub fn worst_distance(&self) -> f64 {
        let of = |fit: &Fit| fit.quality.distance_max.value;
        self.fits.iter().map(of).fold(0.0, f64::max)
    }

    /// The numbers of the triangles by which it fails, on any target.
    fn failing(&self, request: &Request, stock: &Stock<'_>, targets: &Targets) -> Vec<u32> {
        let accept = request.accept_distance;
        let numbers: BTreeSet<u32> = self
            .fits
            .iter()
            .zip(&targets.0)
            .flat_map(|(fit, target)| {
                let (positions, closest) = (&fit.positions, &target.closest);
                failing(&self.linkage, positions, closest, stock.sigma, accept)
            })
            .map(|t| self.built.numbers[t.0 as usize])
            .collect();
        numbers.into_iter().collect()
    }
}

/// Lays the lattice. With a number of triangles asked for, the edge is corrected once for those that the rim costs.
pub(crate) fn lay_out(
    request: &Request,
    map: &Map,
    left_out: &[u32],
    stock: &Stock<'_>,
    progress: &dyn Progress,
) -> Result<Laid, MakeError> {
    let surface = &map.ground.surface;
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
            sigma: stock.sigma,
        };
        let without = without(map, stock, left_out);
        let built = build_without(surface, &fit.layout, &lattice, &without, progress)
            .map_err(MakeError::Linkage)?;
        flat.layout = fit.layout;
        Ok(Laid {
            flat,
            built,
            lattice,
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
