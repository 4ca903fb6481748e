//! kagome: from a surface mesh to an auxetic sheet, cut and verified.
//!
//! Cut with a regular pattern of slits, an inextensible sheet becomes *auxetic*: rigid triangles turn about small
//! hinges and the sheet stretches the same in every direction, up to a factor σ that the material sets. This crate
//! takes a surface and ends with a machine that has cut the sheet that opens into it, after *Beyond Developable:
//! Computational Design and Fabrication with Auxetic Materials* (SIGGRAPH 2016), called "the paper" throughout.
//!
//! # The tour
//!
//! The folders of `src/` are the stages, each depending only on earlier ones:
//!
//! | stage | takes → gives |
//! |---|---|
//! | [`material`], [`machine`] | TOML → checked profiles |
//! | [`mesh`] | file or sample → [`mesh::Surface`]: oriented, manifold, millimetres; a body to form over |
//! | [`conformal`] | surface, cones, darts → [`conformal::Layout`]: flat chart with the scale factor λ |
//! | [`linkage`] | layout, edge length → [`linkage::Linkage`]: rigid triangles and hinges, flat and lifted |
//! | [`rationalize`] | linkage, surface, σ → positions in space, [`rationalize::Quality`] |
//! | [`pattern`] | linkage, hinge width, kerf → [`pattern::Sheet`]: slits, contours and marks; SVG, also edited, DXF, paper |
//! | [`planner`] | moves, machine limits → motion in time |
//! | [`toolpath`] | sheet → ordered cuts, the kerf allowed for |
//! | [`gcode`] | cuts → text; text → what it burns, and a verdict |
//! | [`control`] | job → controller over a transport: checked before, followed by position, stopped with proof, resumed |
//! | [`sim`] | a simulated laser (GRBL, grblHAL, FluidNC) with faults on command, and a sheet that remembers what was burnt |
//! | [`calibrate`] | readings of pulled strips → the σ that holds with a stated confidence; kerf from calipers |
//! | [`job`] | all of it: design file, verdict, report |
//! | [`cli`] | one file a verb; the program does nothing that the library cannot |
//!
//! [`base`] is what all of them stand on.
//!
//! # Frames, units, signs
//!
//! Lengths are millimetres, speeds mm/min, angles radians (degrees at the command line and in names that say `_deg`).
//! *Surface*: as in the file after its units; faces counter-clockwise seen from outside. *Layout and sheet*: X right,
//! Y up, seen from outside, the front; the beam strikes the front unless mirrored. λ takes lengths on the closed sheet
//! to lengths on the surface: 1 closed, 2 fully open. SVG is written with its Y flipped, so that a viewer shows the
//! same. *Machine*: the bed's own corner is where its profile says.
//!
//! # Example
//!
//! One surface through every stage, in memory:
//!
//! ```
//! use kagome::base::progress::Silent;
//! use kagome::conformal::{ConeRequest, FlattenOptions, Sizing, flatten};
//! use kagome::linkage::{Handedness, LinkageOptions, build};
//! use kagome::mesh::{ClosestPoint, Sample};
//! use kagome::pattern::{Sheet, SheetOptions, placed};
//! use kagome::rationalize::{Quality, Solver, rationalize};
//! use kagome::toolpath::CutOptions;
//! use kagome::{gcode, machine, material, toolpath};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let (material, machine) = (material::load("leather-1.6")?, machine::load("co2-600x400")?);
//! let (sigma, setting) = (material.sigma.max, material.cut_for(&machine)?);
//! let surface = Sample::parse("cap:half_angle_deg=60,faces=2000")?.generate()?;
//!
//! // The conformal map; λ of a 60° cap needs 4/3 and no cone.
//! let options = FlattenOptions {
//!     sigma,
//!     sizing: Sizing::Triangles(150.0),
//!     cone_clearance: 0.7,
//! };
//! let flat = flatten(&surface, &ConeRequest::Auto, &options, &Silent)?;
//! assert!(flat.layout.cones.is_empty());
//!
//! // The linkage, flat and closed on the sheet, opened on the surface; then made exact.
//! let lattice = LinkageOptions {
//!     edge_mm: flat.edge_mm,
//!     orientation: 0.0,
//!     handedness: Handedness::Right,
//!     remove_at_cone: 0,
//!     sigma,
//! };
//! let built = build(&surface, &flat.layout, &lattice, &Silent)?;
//! let closest = ClosestPoint::new(&surface);
//! let (positions, _) =
//!     rationalize(&built.linkage, &built.start, &closest, sigma, Solver::Exact, &Silent)?;
//! let quality = Quality::measure(&built.linkage, &positions, &surface, &closest, sigma);
//! assert!(quality.edge_error_max < 1e-9 && quality.distance_max.value < 1e-3);
//! assert_eq!(quality.penetrations + quality.intersections + quality.over_sigma, 0);
//!
//! // The sheet, the job, and the proof that one cuts the other.
//! let shapes = SheetOptions::plain(material.hinge_width_mm, setting.kerf_mm);
//! let sheet = Sheet::with_flaps(&built.linkage, &built.flaps, &shapes)?;
//! let (sheet, _) = placed(&sheet, &machine, false)?;
//! let how = CutOptions::of(&setting, &machine, material.mark_for(&machine).as_ref());
//! let cuts = toolpath::plan(&sheet, &how, machine.park_mm())?;
//! let text = gcode::write(&cuts, &machine, &material)?;
//! assert!(gcode::verify(&text, &machine, Some(&sheet), Some(setting.passes))?.passed());
//! # Ok(())
//! # }
//! ```

// In the order of the pipeline; the empty lines keep the formatter from sorting them by name.

pub mod base;

pub mod material;

pub mod machine;

pub mod mesh;

pub mod conformal;

pub mod linkage;

pub mod rationalize;

pub mod pattern;

pub mod planner;

pub mod toolpath;

pub mod gcode;

pub mod control;

pub mod sim;

pub mod calibrate;

pub mod job;

pub mod cli;
