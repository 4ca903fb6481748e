//! From a surface to a layout at its true size: which cone, how large on the sheet, how long the triangle edge.

use super::{Cone, ConformalError, Layout, Metric, MetricSolver, ScaleSummary, cut_to_rim};
use crate::base::progress::Progress;
use crate::mesh::{Surface, VertexId};

/// Which cones a person asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ConeRequest {
    /// None if λ stays within [1, σ] without; otherwise one at the vertex of largest λ if that brings more of the
    /// surface inside.
    #[default]
    Auto,
    /// Exactly these; an empty list is no cone.
    Given(Vec<Cone>),
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
    /// Cones wanted.
    pub cones: ConeRequest,
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
    /// Triangle edge L, millimetres.
    pub edge_mm: f64,
    /// λ over the layout.
    pub scale: ScaleSummary,
    /// The smallest λ asked for; a little over 1 where σ leaves room, because nearly closed triangles jam.
    pub floor: f64,
}

/// Room left above λ = 1 where σ permits: triangles that are all but closed overlap at the slightest unevenness.
const FLOOR_WITHOUT_CONES: f64 = 1.02;
/// The same with cones, around which λ is steeper than one triangle can follow.
const FLOOR_WITH_CONES: f64 = 1.08;

/// Flattens a disk: decides on the cone, solves, unfolds and scales.
///
/// # Errors
/// [`ConformalError`]: not a disk, a cone on the rim, no convergence, interruption.
pub fn flatten(
    surface: &Surface,
    options: &FlattenOptions,
    progress: &dyn Progress,
) -> Result<Flattened, ConformalError> {
    check_disk(surface)?;
    let mut solver = MetricSolver::new(surface)?;
    let mut attempt = |cones: &[Cone]| -> Result<Flattened, ConformalError> {
        let metric = solver.solve(cones, progress)?;
        let cut = cones
            .first()
            .map_or_else(Vec::new, |cone| cut_to_rim(surface, cone.vertex));
        let layout = Layout::unfold(surface, &metric, cones, &cut);
        Ok(size(surface, layout, metric, options))
    };
    match &options.cones {
        ConeRequest::Given(cones) => {
            check_cones(surface, cones)?;
            attempt(cones)
        }
        ConeRequest::Auto => {
            let plain = attempt(&[])?;
            if plain.scale.max <= options.sigma {
                return Ok(plain);
            }
            let vertex = plain.scale.max_vertex;
            if surface.on_rim(vertex) {
                return Ok(plain);
            }
            let coned = attempt(&[Cone { vertex, units: 1 }])?;
            Ok(if coned.scale.inside > plain.scale.inside {
                coned
            } else {
                plain
            })
        }
    }
}

/// Scales a layout and chooses L. Whatever chose L, the result is the one that this L alone would give, to the last
/// bit: a design file that names the edge makes the same sheet again.
fn size(
    surface: &Surface,
    unscaled: Layout,
    metric: Metric,
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
        let scale = layout.scale_summary(surface, options.cone_clearance * edge_mm, options.sigma);
        floor = (options.sigma * scale.min / scale.max).clamp(1.0, cap);
        let factor = scale.min / floor;
        layout = layout.rescaled(factor);
        let before = edge_mm;
        edge_mm = edge_for(layout.area_mm2());
        if (factor - 1.0).abs() < 1e-12 && (edge_mm / before - 1.0).abs() < 1e-12 {
            break;
        }
    }
    (layout, edge_mm, floor)
}

impl Flattened {
    /// The same map at another triangle size; nothing is solved again.
    pub fn resize(self, surface: &Surface, options: &FlattenOptions) -> Self {
        size(surface, self.unscaled, self.metric, options)
    }
}

fn check_disk(surface: &Surface) -> Result<(), ConformalError> {
    let (rims, handles) = (surface.rims().len(), surface.genus());
    if rims == 1 && handles == 0 {
        return Ok(());
    }
    let advice = match (rims, handles) {
        (0, _) => {
            "this one is closed: cut a hole into it, or keep only the part that you want to cover"
        }
        (_, 0) => {
            "close the holes that you do not need, or cut the surface open from one rim to the other"
        }
        _ => "cut the handles open, or keep only a part of the surface",
    };
    Err(ConformalError::NotADisk {
        rims,
        handles,
        advice,
    })
}

fn check_cones(surface: &Surface, cones: &[Cone]) -> Result<(), ConformalError> {
    if cones.len() > 1 {
        return Err(ConformalError::TooManyCones { count: cones.len() });
    }
    for cone in cones {
        if cone.vertex.0 as usize >= surface.positions().len() {
            return Err(ConformalError::NoSuchVertex {
                vertex: u64::from(cone.vertex.0) + 1,
                count: surface.positions().len(),
            });
        }
        if surface.on_rim(cone.vertex) {
            return Err(ConformalError::ConeOnRim {
                vertex: cone.vertex,
            });
        }
        if cone.units.abs() != 1 {
            return Err(ConformalError::ConeUnits { units: cone.units });
        }
    }
    Ok(())
}

/// The number that a person sees for a vertex counts from 1; this turns it into an id.
pub fn vertex_from_number(number: u64) -> Option<VertexId> {
    number
        .checked_sub(1)
        .and_then(|n| u32::try_from(n).ok())
        .map(VertexId)
}
