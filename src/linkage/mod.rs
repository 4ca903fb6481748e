//! Stage 3: the flat layout and a triangle lattice become a [`Linkage`]: rigid triangles joined in pairs.
//!
//! [`fit`] warps a [`Layout`] so that a lattice goes on across its seams, with a vertex on every cone. [`build`] lays
//! the lattice of edge L on it, keeps the triangles that lie wholly on the surface (or are trimmed by its smooth rim, [`Trim`])
//! and are held by at least two others,
//! cuts the seam along lattice lines, places every triangle flat and closed on the sheet, and lifts the linkage, opened
//! as λ asks, back onto the surface. [`Flaps`] are the rows of triangles that are cut a second time along the seam, to be
//! glued on.
//! [`write_obj`] is the format that other programs read, [`read_obj`] takes it back.

mod clip;
mod continuity;
mod flaps;
mod gltf;
mod guide;
#[cfg(test)]
pub(crate) use guide::tests::vase as vase_with_lattice;
mod lattice;
mod lift;
mod net;
mod obj;
mod orientation;
mod pieces;
mod read;
mod seam;
mod split;
mod trim;
mod types;
mod walk;

use nalgebra::{Point2, Point3};

pub use continuity::{Fitted, fit};
#[cfg(test)]
pub(crate) use flaps::tests::{cone_sheet as cone_with_flaps, cylinder as cylinder_with_flaps};
pub use flaps::{Flap, Flaps, SeamSegment};
pub use gltf::write_glb;
pub use guide::SeamGuide;
pub use lattice::Lattice;
pub use lift::opening_turn;
pub use obj::write_obj;
pub use read::{LinkageProblem, LinkageReadError, is_linkage, read_obj};
pub use trim::{SmoothRim, Trim};
pub use types::{Cell, Colour, Corner, Handedness, Hinge, Linkage, PointId, Triangle, TriangleId};

use crate::base::progress::{Interrupted, Progress};
use crate::base::sparse::FactorError;
use crate::conformal::Layout;
use crate::mesh::Surface;

/// How the lattice lies on the layout.
#[derive(Clone, Copy, Debug)]
pub struct LinkageOptions {
    /// Triangle edge L, millimetres.
    pub edge_mm: f64,
    /// Direction of the lattice against the layout's X, radians.
    pub orientation: f64,
    /// Which of the two slit patterns.
    pub handedness: Handedness,
    /// Triangles to drop around each cone of +1 unit: 4 are those at it, 16 those and the ring around them. In
    /// proportion at sharper cones, where two triangles go in any case; none at negative ones.
    pub remove_at_cone: usize,
    /// Largest scale factor: the lift opens no farther.
    pub sigma: f64,
}

/// A linkage with its start and what it cost.
#[derive(Clone, Debug)]
pub struct Built {
    /// The linkage, with closed flat positions.
    pub linkage: Linkage,
    /// Where every point starts, on the surface, opened; by point.
    pub start: Vec<Point3<f64>>,
    /// Triangles that lay on the surface but hung by fewer than two others, or were not part of the largest piece.
    pub lost: usize,
    /// Triangles removed at cones, as asked.
    pub removed: usize,
    /// The number of each triangle among all that were laid: what [`build_without`] leaves out goes by these.
    pub numbers: Vec<u32>,
    /// Pairs of triangles that lie on one another on the sheet: none, or a mistake of this program.
    pub overlaps: Vec<(TriangleId, TriangleId)>,
    /// Pairs of triangles that lie side by side on the sheet and are not joined, because a rim of the surface runs between
    /// them: a slot without width.
    pub slots: Vec<(TriangleId, TriangleId)>,
    /// Pieces of the sheet: more than one where it would lie on itself otherwise.
    pub pieces: usize,
    /// Length of the seam in lattice edges; 0 without.
    pub seam_edges: usize,
    /// Doubled rows along the seam, which are cut but are no part of the linkage.
    pub flaps: Flaps,
    /// Where the triangles lie on the layout.
    laid: Vec<clip::Laid>,
}

impl Built {
    /// Where every point starts on the surface in another shape (the same faces, moved), opened as the layout's λ asks
    /// there: millimetres, by point. `layout` is the one that the linkage was built on, with the λ of that shape.
    pub fn start_on(&self, shape: &Surface, layout: &Layout, sigma: f64) -> Vec<Point3<f64>> {
        lift::lift(shape, layout, &self.laid, &self.linkage, sigma)
    }
}

/// Why there is no linkage.
#[derive(Debug, thiserror::Error)]
pub enum LinkageError {
    /// No triangle with enough neighbours fits.
    #[error(
        "no linkage fits: the triangle edge is {edge_mm:.2} mm, the flattened surface only {width_mm:.0} × {height_mm:.0} mm; ask for smaller triangles (--edge {suggestion_mm:.2} or --triangles 500) or a larger surface (--size)"
    )]
    NothingFits {
        /// Edge asked for.
        edge_mm: f64,
        /// Layout's extent in X.
        width_mm: f64,
        /// Layout's extent in Y.
        height_mm: f64,
        /// An edge that would give some hundred triangles.
        suggestion_mm: f64,
    },
    /// More triangles than this program handles.
    #[error(
        "an edge of {edge_mm} mm gives about {count:.0} triangles, more than {limit}: choose a larger --edge"
    )]
    TooMany {
        /// Edge asked for.
        edge_mm: f64,
        /// Triangles it would give.
        count: f64,
        /// Largest number.
        limit: usize,
    },
    /// No lattice of about this size goes on across the seams.
    #[error(
        "no lattice of triangles of about {edge_mm:.2} mm goes on across the seams without folding the sheet: two cones are too close to each other for it; ask for smaller triangles (--triangles or --edge), or for other cones"
    )]
    NoLattice {
        /// Edge asked for.
        edge_mm: f64,
    },
    /// The linear system of a warp failed.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// The person asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// Largest number of triangles accepted. The exact solve took 7.5 GB for half as many.
const MOST_TRIANGLES: usize = 2_000_000;

/// Builds the linkage of a layout.
///
/// # Errors
/// [`LinkageError`]: nothing fits, far too much fits, interruption.
pub fn build(
    surface: &Surface,
    layout: &Layout,
    options: &LinkageOptions,
    progress: &dyn Progress,
) -> Result<Built, LinkageError> {
    let guide = SeamGuide::new(surface);
    build_without(
        surface,
        layout,
        options,
        &Without::nothing(&guide),
        progress,
    )
}

/// What a linkage is built without, and where it is cut.
#[derive(Clone, Copy, Debug)]
pub struct Without<'a> {
    /// Triangles to leave out, by their [`Built::numbers`]: openings where the sheet cannot follow. Numbers that are none
    /// are passed over.
    pub triangles: &'a [u32],
    /// Where the seam runs, as far as the cones and rims that it must join leave it free.
    pub guide: &'a SeamGuide,
    /// The smooth rim beyond which nothing is cut; `None` for one along lattice edges.
    pub rim: Option<&'a SmoothRim>,
}

impl<'a> Without<'a> {
    /// All triangles that lie wholly on the surface.
    pub fn nothing(guide: &'a SeamGuide) -> Self {
        Self {
            triangles: &[],
            guide,
            rim: None,
        }
    }
}

/// Builds the linkage of a layout without some triangles.
///
/// # Errors
/// [`LinkageError`]: nothing fits, far too much fits, interruption.
pub fn build_without(
    surface: &Surface,
    layout: &Layout,
    options: &LinkageOptions,
    without: &Without<'_>,
    progress: &dyn Progress,
) -> Result<Built, LinkageError> {
    let guide = without.guide;
    let edge_mm = options.edge_mm;
    let (area, [width_mm, height_mm]) = (layout.area_mm2(), layout.extent_mm());
    let triangle_area = 0.5 * lattice::HEIGHT * edge_mm * edge_mm;
    let nothing = || LinkageError::NothingFits {
        edge_mm,
        width_mm,
        height_mm,
        suggestion_mm: (area / (500.0 * 0.5 * lattice::HEIGHT)).sqrt(),
    };
    if area / triangle_area > MOST_TRIANGLES as f64 {
        return Err(LinkageError::TooMany {
            edge_mm,
            count: area / triangle_area,
            limit: MOST_TRIANGLES,
        });
    }
    let lattice = Lattice::new(edge_mm, options.orientation);
    let size = (edge_mm, options.handedness);
    let laid = clip::lay(surface, layout, &lattice, size, without.rim, progress)?;
    let mut dropped = clip::around_cones(&laid, options.remove_at_cone);
    let removed = dropped.iter().filter(|d| **d).count();
    for &number in without.triangles {
        if let Some(dropped) = dropped.get_mut(number as usize) {
            *dropped = true;
        }
    }
    let (kept, lost) = clip::core(&laid, |n| !dropped[n]);
    if kept.is_empty() {
        return Err(nothing());
    }
    progress.check()?;
    let prices = guide.prices(surface, layout, &kept, edge_mm);
    let flat = pieces::flatten(&kept, &lattice, middle(&kept), &|t, side| prices[t][side]);
    let cells: Vec<Cell> = kept
        .iter()
        .zip(&flat.corners)
        .map(|(place, corners)| Cell {
            colour: place.colour,
            flat: *corners,
            neighbours: place.neighbours,
            trim: place.trim.clone(),
        })
        .collect();
    let linkage = Linkage::assemble(edge_mm, options.handedness, &cells);
    let start = lift::lift(surface, layout, &kept, &linkage, options.sigma);
    let id = |t: usize| TriangleId(t as u32);
    Ok(Built {
        linkage,
        start,
        lost,
        removed,
        numbers: kept.iter().map(|l| l.number).collect(),
        overlaps: flat.overlaps.iter().map(|&(a, b)| (id(a), id(b))).collect(),
        slots: slots(&kept, &flat.corners, edge_mm)
            .into_iter()
            .map(|(a, b)| (id(a), id(b)))
            .collect(),
        pieces: flat.pieces,
        seam_edges: flat.seam_edges,
        flaps: flat.flaps,
        laid: kept,
    })
}

/// Pairs of triangles with a common side on the sheet that are no neighbours.
fn slots(kept: &[clip::Laid], flat: &[[Point2<f64>; 3]], edge_mm: f64) -> Vec<(usize, usize)> {
    // Middles of sides lie on a lattice of half the edge: rounding to a hundredth of it finds the same ones.
    let key = |t: usize, side: usize| {
        let middle = nalgebra::center(&flat[t][side], &flat[t][(side + 1) % 3]);
        let whole = |x: f64| (x * 100.0 / edge_mm).round() as i64;
        (whole(middle.x), whole(middle.y))
    };
    let near =
        |(x, y): (i64, i64)| (-1..=1).flat_map(move |i| (-1..=1).map(move |j| (x + i, y + j)));
    let mut there = std::collections::HashMap::new();
    let mut found = Vec::new();
    for t in 0..kept.len() {
        for side in 0..3 {
            let here = key(t, side);
            match near(here).find_map(|k| there.get(&k).copied()) {
                Some(other) => {
                    if kept[t].neighbours[side].is_none_or(|n| n.0 != other) {
                        found.push((other, t));
                    }
                }
                None => {
                    there.insert(here, t);
                }
            }
        }
    }
    found
}

/// The triangle nearest to the mean centroid: most of the sheet then lies as it does on the layout.
fn middle(laid: &[clip::Laid]) -> usize {
    let centre = |l: &clip::Laid| {
        Point2::from((l.corners[0].coords + l.corners[1].coords + l.corners[2].coords) / 3.0)
    };
    let mean = laid
        .iter()
        .map(|l| centre(l).coords)
        .sum::<nalgebra::Vector2<f64>>()
        / laid.len() as f64;
    let distance = |n: usize| (centre(&laid[n]).coords - mean).norm();
    (0..laid.len())
        .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
        .unwrap_or(0)
}
