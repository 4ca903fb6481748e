//! The conformal maps that a linkage is tried on: with the singularities that were asked for, or those that the program
//! proposes, on the surface with its darts open.

use std::sync::Arc;

use super::MakeError;
use super::request::Request;
use super::targets::{Shaped, Target, spread};
use crate::base::progress::Progress;
use crate::conformal::{
    Cone, Dart, FlattenOptions, Flattened, MetricSolver, Wish, proposals, slit_along, with_cones,
};
use crate::linkage::SeamGuide;
use crate::mesh::Surface;

/// Triangles around a positive cone that are tried in turn unless a number is given: those at it, then those and the
/// next ring. λ falls to 0 at such a cone, and the finer the triangles, the deeper they reach into the fall.
const REMOVALS: [usize; 2] = [4, 16];

/// The surface as it is mapped.
#[derive(Debug)]
pub(crate) struct Ground {
    /// Slit along the darts. Faces and one copy of each vertex have the ids that they have on the surface itself.
    pub surface: Surface,
    /// The darts, by vertices of the surface itself.
    pub darts: Vec<Dart>,
    /// Where the seam is to run.
    pub guide: SeamGuide,
    /// The targets, slit likewise; empty if the surface itself is the only one.
    pub shapes: Vec<Shaped>,
}

impl Ground {
    /// A surface with its darts open, for a pattern that is to fit these `targets`: none, or one, if it is to fit the
    /// surface itself.
    ///
    /// # Errors
    /// [`slit_along`].
    pub fn new(
        surface: &Surface,
        darts: &[Dart],
        guide: &SeamGuide,
        targets: &[Target],
    ) -> Result<Self, MakeError> {
        let darts = darts.to_vec();
        let surface = if darts.is_empty() {
            surface.clone()
        } else {
            slit_along(surface, &darts).map_err(MakeError::Conformal)?
        };
        let shaped = |target: &Target| Shaped::new(&target.surface, &surface);
        let shapes = match targets {
            [] | [_] => Vec::new(),
            several => several.iter().map(shaped).collect::<Result<_, _>>()?,
        };
        Ok(Self {
            surface,
            darts,
            guide: guide.clone(),
            shapes,
        })
    }
}

impl Ground {
    /// The surface that a person is told of: the first target, with the vertices of the one that is mapped.
    pub fn shown(&self) -> &Surface {
        self.shapes
            .first()
            .map_or(&self.surface, |shape| &shape.surface)
    }
}

/// A map with the options that made it and the number of triangles to remove.
pub(crate) struct Map {
    pub ground: Arc<Ground>,
    pub flat: Flattened,
    pub options: FlattenOptions,
    pub removal: usize,
}

impl Map {
    /// What the map asks for beyond the sheet, in L; 0 where σ suffices.
    pub fn misfit(&self) -> f64 {
        self.flat.misfit()
    }
}

/// The maps worth trying, the most promising first. With cones left to the program: without one, and, if that leaves
/// [1, σ], with what is proposed instead; with the number of triangles to remove left open: each of [`REMOVALS`].
pub(crate) fn maps(
    request: &Request,
    given: Option<&[Cone]>,
    ground: &Arc<Ground>,
    sigma: f64,
    progress: &dyn Progress,
) -> Result<Vec<Map>, MakeError> {
    let surface = &ground.surface;
    let mut solver = MetricSolver::new(surface)
        .map_err(MakeError::Conformal)?
        .among(spread(&ground.shapes));
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
            ground: Arc::clone(ground),
        };
        removals(&flat.layout.cones).into_iter().map(map).collect()
    };
    let wish = Wish {
        turnings: request.turnings.clone(),
        straight: request.straight.clone(),
    };
    let found = match given {
        Some(cones) => {
            progress.start("conformal map", None);
            let first = options(removals(cones)[0]);
            with_cones(&mut solver, cones, &wish, &first, progress).map(|flat| vec![flat])
        }
        // With the clearance of most removed triangles, which shows what the cones are worth.
        None => {
            let most = request
                .remove_at_cone
                .unwrap_or(REMOVALS[REMOVALS.len() - 1]);
            proposals(&mut solver, &wish, &options(most), progress)
        }
    };
    let found = found.map_err(MakeError::Conformal)?;
    let mut maps: Vec<Map> = found.into_iter().flat_map(resized).collect();
    // By what they will miss the surface; of those that miss nothing the one that removes least. The sort is stable.
    maps.sort_by(|a, b| a.misfit().total_cmp(&b.misfit()));
    Ok(maps)
}

/// Radius around each cone, on the sheet, in which `removal` triangles leave it open, millimetres; 0 for none.
pub(crate) fn cone_opening_mm(removal: usize, edge_mm: f64) -> f64 {
    match removal {
        0 => 0.0,
        removed => clearance(removed) * edge_mm,
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
