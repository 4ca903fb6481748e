//! Stage 12: the whole line in one call: from a surface to verified, rehearsed G-code with a report.
//!
//! A [`Request`] is what a person asks for; [`make()`] takes it through every stage, and a [`Design`] is what was
//! decided, so that the same sheet can be made again. A [`Verdict`] says whether it may be cut; only then is there a
//! pattern or a job. One sheet may be made for several surfaces, see [`Request::also`]: the verdict holds for all.

mod choose;
mod coupon;
mod cut;
mod design;
mod explore;
mod linkage_figures;
mod load;
mod make;
mod map_figures;
mod maps;
pub mod picture;
mod remedy;
pub mod report;
mod request;
mod several;
mod shape;
mod sheets;
mod states;
mod strength;
mod targets;
mod tell;
mod verdict;

use std::path::PathBuf;

pub use coupon::{COUPON_FILES, CouponFiles, FitPlot, make_coupon, with_fit};
pub use cut::{CutDrawing, cut_drawing};
pub use design::{
    AlsoChoice, ConeChoice, CutChoice, DartChoice, Design, LinkageChoice, SheetChoice, SolveChoice,
    SurfaceChoice,
};
pub use explore::{Explored, explore};
pub use linkage_figures::LinkageFigures;
pub use make::{FILES, Made, make};
pub use map_figures::{ConeFigures, MapFigures};
pub use request::{
    ACCEPT_DISTANCE, COOL_REACH_MM, ConePlace, ConeWish, DEFAULT_TRIANGLES, DartWish, FlapWish,
    Request, RimWish, SheetWish, Source, TAB_WIDTH_MM,
};
pub use states::{Opening, StateFigures, StateFiles};
pub use strength::{CONFIDENCE, HingeMargin};
pub use verdict::{COVERAGE_WANTED, EDGE_TOLERANCE, Reason, Verdict};

use crate::base::catalog::CatalogError;
use crate::base::document::DocumentError;
use crate::base::progress::Interrupted;
use crate::mesh::VertexId;

/// Why nothing was made.
#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    /// A coupon that cannot be.
    #[error(transparent)]
    Coupon(#[from] crate::calibrate::CouponError),
    /// The stock has no room for anything.
    #[error(
        "the stock leaves {width_mm} x {height_mm} mm inside margins of {margin_mm} mm: nothing that has a hinge fits. Use larger stock (--stock), or a smaller margin_mm in the machine's profile"
    )]
    NoStock {
        /// Room.
        width_mm: f64,
        /// Room.
        height_mm: f64,
        /// Margin on each side.
        margin_mm: f64,
    },
    /// The sheet would be divided into more sheets than anybody would cut.
    #[error(
        "the sheet fills {sheets} pieces of stock, and {most} is the most: make it smaller (--size, --scale), or use larger stock (--stock) or a larger machine"
    )]
    TooManySheets {
        /// How many it would be.
        sheets: usize,
        /// The most.
        most: usize,
    },
    /// A smooth rim for several surfaces.
    #[error(
        "a smooth rim goes with one surface only: leave --also away, or let the rim follow the triangles (--rim lattice)"
    )]
    RimOfSeveral,
    /// The surface cannot be continued beyond its rims.
    #[error(
        "the surface cannot be continued beyond its rim for a smooth edge: {0}. Let the rim follow the triangles (--rim lattice), or mend the mesh there"
    )]
    Skirt(crate::mesh::TopologyError),
    /// The mesh file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The mesh is not the one that the design was made for.
    #[error(
        "{path} is not the mesh that this design was made for: its SHA-256 is {found}, the design names {expected}. Put the old mesh back, or delete the line sha256 and look at the result again"
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// In the design.
        expected: String,
        /// Of the file.
        found: String,
    },
    /// A further surface is not the first one's mesh in another shape.
    #[error(
        "--also {other} does not match {first}: {difference}. One pattern for several surfaces needs the same mesh in several shapes, with the same vertices and faces in the same order"
    )]
    NoMatch {
        /// The first surface.
        first: String,
        /// The further one.
        other: String,
        /// What is different, in words.
        difference: String,
    },
    /// Surfaces of sizes that no one sheet has.
    #[error(
        "{larger} is {factor:.2} times as large as {smaller} on half of its area, and a sheet of σ = {sigma} cannot be both: σ must be larger, or the files brought nearer to one size"
    )]
    SizesApart {
        /// The larger surface.
        larger: String,
        /// The smaller one.
        smaller: String,
        /// By what lengths differ.
        factor: f64,
        /// The largest stretch.
        sigma: f64,
    },
    /// More surfaces than there are names for their files.
    #[error("{count} surfaces were asked for; one pattern can be fitted to {most} at the most")]
    TooManySurfaces {
        /// As asked.
        count: usize,
        /// The largest number.
        most: usize,
    },
    /// Shares of the surfaces that cannot be meant.
    #[error(
        "the shares of the surfaces in that which the pattern is laid on are {shares:?}: there must be {surfaces}, from 0 to 1, that sum to 1"
    )]
    Shares {
        /// As given.
        shares: Vec<f64>,
        /// Surfaces there are.
        surfaces: usize,
    },
    /// σ is not a stretch that the pattern can take.
    #[error(
        "σ = {sigma} is not possible: the pattern stretches by more than 1 (closed) and at most 2 (fully open); most sheets take 1.2 to 1.8"
    )]
    Sigma {
        /// As given.
        sigma: f64,
    },
    /// A confidence where no strips were pulled.
    #[error(
        "--confidence goes with strips that were pulled, and the profile of {material} has none: cut a coupon (kagome calibrate), or leave it away"
    )]
    NoStrips {
        /// The material.
        material: String,
    },
    /// The strips of the material do not answer for such a sheet.
    #[error(
        "the strips of {material} give no σ for this sheet: {refusal}. Or give one by hand, --sigma"
    )]
    Strength {
        /// The material.
        material: String,
        /// Why not.
        refusal: crate::calibrate::Refusal,
    },
    /// A size that is none.
    #[error("{what} is {value}, it must be positive: for example {example}")]
    Size {
        /// What it is the size of.
        what: &'static str,
        /// As given.
        value: f64,
        /// What could be given.
        example: &'static str,
    },
    /// A number outside its range.
    #[error("{what} is {value}; it must lie between {least} and {most}")]
    Range {
        /// What it is.
        what: &'static str,
        /// As given.
        value: f64,
        /// The smallest value.
        least: f64,
        /// The largest value.
        most: f64,
    },
    /// A cone, a dart or a cut at a vertex that does not exist.
    #[error("--{what} v{vertex}: there is no such vertex, the surface has v1 to v{count}")]
    NoSuchVertex {
        /// What was to be there: cone, dart or cut.
        what: &'static str,
        /// As given.
        vertex: u64,
        /// Vertices there are.
        count: usize,
    },
    /// A cone, a dart or a cut at a point far from the surface.
    #[error(
        "--{what} {},{},{}: the surface is {distance_mm:.1} mm away from there; coordinates are millimetres after --unit, --scale and --size (see `kagome inspect`)",
        at[0], at[1], at[2]
    )]
    FarAway {
        /// What was to be there: cone, dart or cut.
        what: &'static str,
        /// As given.
        at: [f64; 3],
        /// Distance from the surface.
        distance_mm: f64,
    },
    /// A cut whose places are all at one vertex.
    #[error(
        "--cut: all its places are nearest to v{vertex} at {},{},{}: give two or more that are farther apart than the mesh's edges, as X,Y,Z;X,Y,Z",
        at[0], at[1], at[2]
    )]
    CutTooShort {
        /// The vertex.
        vertex: VertexId,
        /// Where it is, millimetres.
        at: [f64; 3],
    },
    /// The mesh file is no surface.
    #[error(transparent)]
    Import(crate::mesh::ImportError),
    /// The sample cannot be made.
    #[error(transparent)]
    Sample(crate::mesh::SampleError),
    /// A cone could not be placed.
    #[error(transparent)]
    Edit(crate::mesh::edit::EditError),
    /// The material profile cannot be used.
    #[error(transparent)]
    Material(CatalogError),
    /// The machine profile cannot be used.
    #[error(transparent)]
    Machine(CatalogError),
    /// The machine cannot cut the material.
    #[error(transparent)]
    Cut(crate::material::CutError),
    /// The design file cannot be used.
    #[error(transparent)]
    Design(DocumentError),
    /// No conformal map.
    #[error(transparent)]
    Conformal(crate::conformal::ConformalError),
    /// No linkage.
    #[error(transparent)]
    Linkage(crate::linkage::LinkageError),
    /// No solution at all.
    #[error(transparent)]
    Rationalize(crate::rationalize::RationalizeError),
    /// The drawing is no sheet.
    #[error(transparent)]
    Drawing(crate::pattern::SvgError),
    /// No sheet, or none that fits the bed.
    #[error(transparent)]
    Pattern(crate::pattern::PatternError),
    /// No toolpath.
    #[error(transparent)]
    Toolpath(crate::toolpath::ToolpathError),
    /// No G-code.
    #[error(transparent)]
    Gcode(crate::gcode::GcodeError),
    /// The rehearsal did not come to its end.
    #[error(transparent)]
    Rehearsal(crate::sim::RehearsalError),
    /// The person asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// A fault of this program.
    #[error("internal fault: {0}; please report it with the design file")]
    Internal(String),
}
