//! From a surface to a layout at its true size: which singularities, how large on the sheet, how long the triangle edge.

use super::{
    Cone, ConformalError, Layout, Metric, MetricSolver, ScaleSummary, SearchOptions, Singularities,
    cut_graph, search,
};
use crate::base::progress::Progress;
use crate::mesh::{Surface, VertexId};

/// Which singularities a person asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ConeRequest {
    /// None if λ stays within [1, σ] without; otherwise the map of least misfit among the [`proposals`].
    #[default]
    Auto,
    /// Exactly these.
    Given(Singularities),
}

/// How large the triangles are to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sizing {
    /// Triangle edge in millimetres.
    EdgeMm(f64),
    /// About this many triangles: the sheet's area divided by the triangle's.
    Triangles(f64),
}

/// What [`flatten`] needs to know beside the surface.
#[derive(Clone, Debug)]
pub struct FlattenOptions {
    /// Largest scale factor that the material allows.
    pub sigma: f64,
    /// Triangle size.
    pub sizing: Sizing,
    /// Radius around a cone, in triangle edges, in which λ is ignored: it runs to 0 or ∞ there, but no triangle's
    /// centre lies closer than 0.58 to a cone, and 1.15 if the triangles at the cone are removed.
    pub cone_clearance: f64,
}

/// A layout at true size with the choices made for it.
#[derive(Clone, Debug)]
pub struct Flattened {
    /// The layout, scaled so that λ's smallest value is `floor`.
    pub layout: Layout,
    /// The layout before scaling, for [`Flattened::resize`].
    unscaled: Layout,
    /// The metric behind it.
    pub metric: Metric,
    /// The singularities that it has.
    pub singularities: Singularities,
    /// Triangle edge L, millimetres.
    pub edge_mm: f64,
    /// λ over the layout.
    pub scale: ScaleSummary,
    /// The smallest λ asked for; a little over 1 where σ leaves room, because nearly closed triangles jam.
    pub floor: f64,
}

/// Room left above λ = 1 where σ permits: triangles that are all but closed overlap at the slightest unevenness.
const FLOOR_WITHOUT_CONES: f64 = 1.02;
/// The same with cones, around which λ is steeper than one triangle can follow: at the edge of the hole that is left
/// around a cone it still changes by a tenth from one triangle to the next.
const FLOOR_WITH_CONES: f64 = 1.15;

/// Flattens a surface: decides on the singularities, solves, unfolds and scales.
///
/// # Errors
/// [`ConformalError`]: impossible singularities, no convergence, interruption.
pub fn flatten(
    surface: &Surface,
    cones: &ConeRequest,
    options: &FlattenOptions,
    progress: &dyn Progress,
) -> Result<Flattened, ConformalError> {
    let mut solver = MetricSolver::new(surface)?;
    match cones {
        ConeRequest::Given(given) => Flattened::solve(&mut solver, given, options, progress),
        ConeRequest::Auto => {
            let found = proposals(&mut solver, &Wish::default(), options, progress)?;
            let least = |a: &Flattened, b: &Flattened| a.misfit().total_cmp(&b.misfit());
            match found.into_iter().min_by(least) {
                Some(best) => Ok(best),
                None => {
                    let none = Singularities::none(surface);
                    Flattened::solve(&mut solver, &none, options, progress)
                }
            }
        }
    }
}

/// What is asked for where the cones are left to the program.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wish {
    /// Turning of each rim but the first in units of 120°; `None`: what needs least stretch.
    pub turnings: Option<Vec<i32>>,
    /// Rims that are straight hems (0-based, ascending).
    pub straight: Vec<usize>,
}

/// Sets of singularities that the search proposes and that are mapped.
const MAPPED: usize = 6;

/// The map with these cones, the rims as wished.
///
/// # Errors
/// [`ConformalError`]: impossible singularities, no convergence, interruption.
pub fn with_cones(
    solver: &mut MetricSolver<'_>,
    cones: &[Cone],
    wish: &Wish,
    options: &FlattenOptions,
    progress: &dyn Progress,
) -> Result<Flattened, ConformalError> {
    match &wish.turnings {
        Some(turnings) => {
            let given = Singularities {
                cones: cones.to_vec(),
                turnings: turnings.clone(),
                straight: wish.straight.clone(),
            };
            Flattened::solve(solver, &given, options, progress)
        }
        None => choose_turnings_with_hems(solver, cones, &wish.straight, options, progress),
    }
}

/// The maps worth looking at: that without a cone, alone if λ stays within [1, σ]; otherwise also that with the obvious
/// cone and those that [`search`] proposes. In no order of worth; at least one.
///
/// # Errors
/// [`ConformalError`]: no set of singularities gives a map, interruption.
pub fn proposals(
    solver: &mut MetricSolver<'_>,
    wish: &Wish,
    options: &FlattenOptions,
    progress: &dyn Progress,
) -> Result<Vec<Flattened>, ConformalError> {
    let surface = solver.surface();
    progress.start("conformal map", None);
    let mut refused = None;
    let mut maps = match with_cones(solver, &[], wish, options, progress) {
        // A closed surface may need cones.
        Err(error @ ConformalError::TotalCurvature { .. }) => {
            refused = Some(error);
            Vec::new()
        }
        plain => vec![plain?],
    };
    if maps.first().is_some_and(|m| m.scale.within(options.sigma)) {
        return Ok(maps);
    }
    // The obvious cone; the search may find a better one, or that none is worth its price.
    let obvious = maps
        .first()
        .and_then(|m| m.proposed_cone(surface, options.sigma));
    if let Some(cone) = obvious {
        maps.push(with_cones(solver, &[cone], wish, options, progress)?);
    }
    progress.start("searching for cones", None);
    let edge_mm = match options.sizing {
        Sizing::EdgeMm(edge) => edge,
        // Half of a surface is about as much as its sheet.
        Sizing::Triangles(count) => (surface.area() / (2.0 * count * 0.433)).sqrt(),
    };
    let asked = SearchOptions {
        sigma: options.sigma,
        edge_mm,
        turnings: wish.turnings.clone(),
    };
    let mut sets = search(solver, &asked, progress)?;
    // The search knows nothing of hems: what it proposes goes where they turn by 0.
    sets.iter_mut()
        .for_each(|set| set.straight.clone_from(&wish.straight));
    sets.retain(|set| set.check(surface).is_ok());
    let known: Vec<Singularities> = maps.iter().map(|m| m.singularities.clone()).collect();
    for set in sets.into_iter().filter(|s| !known.contains(s)).take(MAPPED) {
        match Flattened::solve(solver, &set, options, progress) {
            Ok(flat) => maps.push(flat),
            // Cones on a surface with handles rarely close around them.
            Err(
                error @ (ConformalError::Holonomy { .. } | ConformalError::NotConverged { .. }),
            ) => refused = Some(error),
            Err(error) => return Err(error),
        }
    }
    match refused.filter(|_| maps.is_empty()) {
        Some(error) => Err(error),
        None => Ok(maps),
    }
}

/// Scales a layout and chooses L. Whatever chose L, the result is the one that this L alone would give, to the last
/// bit: a design file that names the edge makes the same sheet again.
fn size(
    surface: &Surface,
    unscaled: Layout,
    metric: Metric,
    singularities: Singularities,
    options: &FlattenOptions,
) -> Flattened {
    let (mut layout, mut edge_mm, mut floor) = scaled(surface, &unscaled, options, options.sizing);
    if let Sizing::Triangles(_) = options.sizing {
        (layout, edge_mm, floor) = scaled(surface, &unscaled, options, Sizing::EdgeMm(edge_mm));
    }
    let scale = layout.scale_summary(surface, options.cone_clearance * edge_mm, options.sigma);
    Flattened {
        layout,
        unscaled,
        metric,
        singularities,
        edge_mm,
        scale,
        floor,
    }
}

/// The layout at true size, L, and the smallest λ. Size and L depend on each other through the neighbourhood of the
/// cones that is left out; a few rounds settle it.
fn scaled(
    surface: &Surface,
    unscaled: &Layout,
    options: &FlattenOptions,
    sizing: Sizing,
) -> (Layout, f64, f64) {
    let cap = if unscaled.cones.is_empty() {
        FLOOR_WITHOUT_CONES
    } else {
        FLOOR_WITH_CONES
    };
    let edge_for = |area: f64| match sizing {
        Sizing::EdgeMm(edge) => edge,
        Sizing::Triangles(count) => (area / (count * 0.75f64.sqrt() * 0.5)).sqrt(),
    };
    let mut layout = unscaled.clone();
    let mut edge_mm = edge_for(layout.area_mm2());
    let mut floor = 1.0;
    for _ in 0..20 {
        let exclude_mm = options.cone_clearance * edge_mm;
        let scale = layout.scale_summary(surface, exclude_mm, options.sigma);
        let room = options.sigma * scale.min / scale.max;
        let low = if room < 1.0 {
            layout.best_window(surface, exclude_mm, options.sigma)
        } else {
            scale.min
        };
        floor = room.clamp(1.0, cap);
        let factor = low / floor;
        layout.rescale(factor);
        let before = edge_mm;
        edge_mm = edge_for(layout.area_mm2());
        if (factor - 1.0).abs() < 1e-12 && (edge_mm / before - 1.0).abs() < 1e-12 {
            break;
        }
    }
    (layout, edge_mm, floor)
}

impl Flattened {
    /// The map with the given singularities.
    ///
    /// # Errors
    /// [`ConformalError`]: impossible singularities, no convergence, interruption.
    pub fn solve(
        solver: &mut MetricSolver<'_>,
        singularities: &Singularities,
        options: &FlattenOptions,
        progress: &dyn Progress,
    ) -> Result<Self, ConformalError> {
        let surface = solver.surface();
        let metric = solver.solve(singularities, progress)?;
        let cut = cut_graph(surface, &singularities.cones);
        let mut layout = Layout::unfold(surface, &metric, &singularities.cones, &cut)?;
        layout.spread = solver.spread().cloned();
        Ok(size(
            surface,
            layout,
            metric,
            singularities.clone(),
            options,
        ))
    }

    /// The same map at another triangle size; nothing is solved again.
    pub fn resize(self, surface: &Surface, options: &FlattenOptions) -> Self {
        size(
            surface,
            self.unscaled,
            self.metric,
            self.singularities,
            options,
        )
    }

    /// What the map asks for beyond the sheet, in triangle edges; 0 where σ suffices. See [`ScaleSummary::misfit_mm`].
    pub fn misfit(&self) -> f64 {
        self.scale.misfit_mm / self.edge_mm
    }

    /// What may do better where this map without cones leaves [1, σ]: a cone at the vertex of largest λ.
    pub fn proposed_cone(&self, surface: &Surface, sigma: f64) -> Option<Cone> {
        let vertex = self.scale.max_vertex;
        let outside = self.scale.max > sigma && !surface.on_rim(vertex);
        outside.then_some(Cone { vertex, units: 1 })
    }
}

/// The map with these cones and the turnings of the rims that need least stretch. The search starts from how far the
/// rims turn on the surface itself and goes on by one unit at one rim while that helps.
///
/// # Errors
/// [`ConformalError`]: impossible cones, no convergence, interruption.
pub fn choose_turnings(
    solver: &mut MetricSolver<'_>,
    cones: &[Cone],
    options: &FlattenOptions,
    progress: &dyn Progress,
) -> Result<Flattened, ConformalError> {
    choose_turnings_with_hems(solver, cones, &[], options, progress)
}

/// As [`choose_turnings`], these rims (0-based, ascending) being straight hems, which turn by 0.
///
/// # Errors
/// [`ConformalError`]: impossible cones or hems, no convergence, interruption.
pub fn choose_turnings_with_hems(
    solver: &mut MetricSolver<'_>,
    cones: &[Cone],
    straight: &[usize],
    options: &FlattenOptions,
    progress: &dyn Progress,
) -> Result<Flattened, ConformalError> {
    let surface = solver.surface();
    let mut start = Singularities {
        cones: cones.to_vec(),
        turnings: Singularities::natural_turnings(surface),
        straight: straight.to_vec(),
    };
    let is_straight = |rim: usize| straight.contains(&(rim + 1));
    let inner = 0..start.turnings.len();
    inner
        .clone()
        .filter(|&rim| is_straight(rim))
        .for_each(|rim| start.turnings[rim] = 0);
    if straight.contains(&0) {
        // The first rim leaves nothing to itself: another one takes it.
        let rest = start.rest(surface) as i32;
        if let Some(rim) = inner.rev().find(|&rim| !is_straight(rim)) {
            start.turnings[rim] += rest;
        }
    }
    let mut best = Flattened::solve(solver, &start, options, progress)?;
    let mut improved = true;
    while improved {
        improved = false;
        for rim in 0..start.turnings.len() {
            for step in [-1, 1] {
                let mut tried = best.singularities.clone();
                tried.turnings[rim] += step;
                // A straight rim must go on turning by 0.
                if tried.check(surface).is_err() {
                    continue;
                }
                let flat = Flattened::solve(solver, &tried, options, progress)?;
                if flat.scale.ratio() < best.scale.ratio() {
                    best = flat;
                    improved = true;
                }
            }
        }
    }
    Ok(best)
}

/// The number that a person sees for a vertex counts from 1; this turns it into an id.
pub fn vertex_from_number(number: u64) -> Option<VertexId> {
    number
        .checked_sub(1)
        .and_then(|n| u32::try_from(n).ok())
        .map(VertexId)
}
