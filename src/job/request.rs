//! What a person asks `make` for: decisions taken, and those left to the program.

use std::path::PathBuf;

use crate::conformal::Sizing;
use crate::linkage::Handedness;
use crate::mesh::ImportOptions;
use crate::pattern::Tip;
use crate::rationalize::Solver;
use crate::toolpath::Heat;

/// Where the surface comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A mesh file.
    File {
        /// Its path.
        path: PathBuf,
        /// The SHA-256 (hexadecimal) that it must have, if it is known.
        sha256: Option<String>,
    },
    /// A sample with its parameters, `NAME:key=value,…`.
    Sample(String),
}

/// Where a cone is wanted, or a dart or a cut passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConePlace {
    /// At a vertex, counted from 1.
    Vertex(u64),
    /// At the point of the surface nearest to this one, millimetres.
    Point([f64; 3]),
}

/// Which cones are wanted.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ConeWish {
    /// As many as needed.
    #[default]
    Auto,
    /// Exactly these, with their curvature in units of 2π/3.
    Given(Vec<(ConePlace, i32)>),
}

/// Which darts are wanted: open cuts that take up what no cone can.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum DartWish {
    /// As few as needed, if cones are left to the program too.
    #[default]
    Auto,
    /// Exactly these, each by the places that it passes, joined by shortest ways.
    Given(Vec<Vec<ConePlace>>),
}

/// Which seams get doubled rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FlapWish {
    /// Every seam, where there is room, on the side that has more of it; none if the sheet fits the bed only without.
    #[default]
    Auto,
    /// None.
    None,
}

/// Where a sheet ends.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum RimWish {
    /// Along edges of triangles that lie wholly on the surface.
    #[default]
    Lattice,
    /// Along the surface's own rim, through the triangles that keep two hinges.
    Smooth {
        /// How far the surface is continued to lay those on, millimetres; `None`: a little more than a triangle.
        skirt_mm: Option<f64>,
    },
}

/// Shapes of what is cut, and the sheets that it is cut from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetWish {
    /// Width and height of a piece of stock in the corner of the bed, millimetres; `None`: as large as the bed.
    pub stock_mm: Option<[f64; 2]>,
    /// Divide what does not fit into pieces with flaps.
    pub divide: bool,
    /// Where it ends.
    pub rim: RimWish,
    /// Shape of the slits' tips, in place of the material's.
    pub tip: Option<Tip>,
    /// Radius of the triangles' corners, millimetres, in place of the material's.
    pub corner_radius_mm: Option<f64>,
    /// Diameter of the holes in flaps and their doubles, millimetres; 0 for none.
    pub alignment_hole_mm: f64,
    /// Tabs that hold each part in the stock.
    pub tabs: usize,
    /// Width of each, millimetres.
    pub tab_width_mm: f64,
    /// What it costs to cut close to the cuts just made.
    pub heat: Heat,
}

impl Default for SheetWish {
    fn default() -> Self {
        Self {
            stock_mm: None,
            divide: true,
            rim: RimWish::Lattice,
            tip: None,
            corner_radius_mm: None,
            alignment_hole_mm: 0.0,
            tabs: 0,
            tab_width_mm: TAB_WIDTH_MM,
            heat: Heat::NONE,
        }
    }
}

/// Width of a tab unless told otherwise, millimetres: broken by hand in leather and ply.
pub const TAB_WIDTH_MM: f64 = 0.5;

/// How far the heat of a cut is felt unless told otherwise, millimetres.
pub const COOL_REACH_MM: f64 = 20.0;

/// Everything that `make` needs.
#[derive(Clone, Debug)]
pub struct Request {
    /// The surface.
    pub source: Source,
    /// Further surfaces that the same pattern is to fit: the same mesh in other shapes, in the same units.
    pub also: Vec<Source>,
    /// Share of each surface in the one that the pattern is laid on; `None`: what fits all of them best.
    pub shares: Option<Vec<f64>>,
    /// Its units, and which part of it.
    pub import: ImportOptions,
    /// Material profile: a shipped name or a file.
    pub material: String,
    /// Machine profile: a shipped name or a file.
    pub machine: String,
    /// Largest scale factor, in place of the material's.
    pub sigma: Option<f64>,
    /// With which confidence no hinge fails, for a material of which strips were pulled; `None`: [`super::CONFIDENCE`], and
    /// if σ is given, nothing is proved.
    pub confidence: Option<f64>,
    /// Ligament width in millimetres, in place of the material's.
    pub hinge_width_mm: Option<f64>,
    /// Width of the cut in millimetres, in place of the material's.
    pub kerf_mm: Option<f64>,
    /// Cut from the back.
    pub mirror: bool,
    /// Shapes and sheets.
    pub sheet: SheetWish,
    /// Triangle size.
    pub sizing: Sizing,
    /// Cones.
    pub cones: ConeWish,
    /// Darts.
    pub darts: DartWish,
    /// Paths that the seam follows where it can, each by the places that it passes, joined by straight ways over the
    /// surface.
    pub cuts: Vec<Vec<ConePlace>>,
    /// Turning of each rim but the first in units of 120°; `None`: what needs least stretch.
    pub turnings: Option<Vec<i32>>,
    /// Rims (0-based, ascending) that become straight hems.
    pub straight: Vec<usize>,
    /// Lattice direction, degrees; `None`: along the first straight hem, else what fits the seams.
    pub orientation_deg: Option<f64>,
    /// Slit pattern.
    pub handedness: Handedness,
    /// Triangles to drop at the cone; `None`: at a positive cone 4, or 16 where λ asks for it.
    pub remove_at_cone: Option<usize>,
    /// Doubled rows along the seams.
    pub flaps: FlapWish,
    /// Triangles to leave out beside those at cones, by number; `None`: those few, if any, by which it fails.
    pub left_out: Option<Vec<u32>>,
    /// Solver.
    pub solver: Solver,
    /// Distance from the surface that passes, in L.
    pub accept_distance: f64,
}

/// Distance from the surface that passes unless told otherwise, in L.
pub const ACCEPT_DISTANCE: f64 = 0.1;

impl Request {
    /// Whether the program may open the surface by darts of its own: only where it chooses cones and turnings too.
    pub fn darts_are_free(&self) -> bool {
        self.darts == DartWish::Auto
            && self.cones == ConeWish::Auto
            && self.turnings.is_none()
            && self.straight.is_empty()
    }

    /// A request with every decision left to the program but the surface.
    pub fn new(source: Source) -> Self {
        Self {
            source,
            also: Vec::new(),
            shares: None,
            import: ImportOptions::default(),
            material: crate::material::DEFAULT.into(),
            machine: crate::machine::DEFAULT.into(),
            sigma: None,
            confidence: None,
            hinge_width_mm: None,
            kerf_mm: None,
            mirror: false,
            sheet: SheetWish::default(),
            sizing: Sizing::Triangles(DEFAULT_TRIANGLES),
            cones: ConeWish::Auto,
            darts: DartWish::Auto,
            cuts: Vec::new(),
            turnings: None,
            straight: Vec::new(),
            orientation_deg: None,
            handedness: Handedness::Right,
            remove_at_cone: None,
            left_out: None,
            flaps: FlapWish::Auto,
            solver: Solver::Exact,
            accept_distance: ACCEPT_DISTANCE,
        }
    }
}

/// Number of triangles unless a size is given: fine enough for a face, coarse enough for a first job.
pub const DEFAULT_TRIANGLES: f64 = 1500.0;
