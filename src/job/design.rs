//! `design.toml`: every decision that a sheet depends on, so that it can be made again, byte for byte, or changed by
//! hand.
//!
//! `kagome make` decides what was left open (the cone, the edge length, hinge and kerf from the material) and writes
//! down what it decided. Nothing here depends on the day or the machine that ran it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::MakeError;
use super::request::{
    ConePlace, ConeWish, DartWish, FlapWish, Request, RimWish, SheetWish, Source,
};
use crate::base::document::{Complaint, Document, ranged};
use crate::calibrate::CONFIDENCES;
use crate::conformal::Sizing;
use crate::linkage::Handedness;
use crate::material::TipShape;
use crate::mesh::{ImportOptions, PartChoice, Unit, Units};
use crate::pattern::Tip;
use crate::rationalize::Solver;
use crate::toolpath::Heat;

/// The version of the format that this program writes and reads.
pub const FORMAT: u32 = 1;

/// A design file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// Version of this format.
    pub format: u32,
    /// Where the surface comes from.
    pub surface: SurfaceChoice,
    /// Further surfaces that the sheet is to fit; none if the list is absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<AlsoChoice>,
    /// What it is cut from, and with what.
    pub sheet: SheetChoice,
    /// How the lattice lies on it.
    pub linkage: LinkageChoice,
    /// How it is solved and judged.
    pub solve: SolveChoice,
    /// The cones; none if the list is absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cone: Vec<ConeChoice>,
    /// The darts; none if the list is absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub dart: Vec<DartChoice>,
    /// Paths that the seam follows; none if the list is absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cut: Vec<CutChoice>,
}

/// `[surface]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceChoice {
    /// A mesh file, relative to the design file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// A sample with its parameters, in place of a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample: Option<String>,
    /// SHA-256 of the mesh file: a changed mesh is not silently cut with an old design.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Millimetres per unit of the file.
    pub mm_per_unit: f64,
    /// True if only the largest of several parts is used.
    #[serde(default, skip_serializing_if = "is_false")]
    pub largest_part: bool,
}

/// `[[also]]`: a further surface, the first one's mesh in another shape, with its millimetres per unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AlsoChoice {
    /// A mesh file, relative to the design file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// A sample with its parameters, in place of a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample: Option<String>,
    /// SHA-256 of the mesh file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

/// `[sheet]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SheetChoice {
    /// Name or file of the material profile.
    pub material: String,
    /// Name or file of the machine profile.
    pub machine: String,
    /// Largest scale factor.
    pub sigma: f64,
    /// With which confidence no hinge fails; absent where no strips were pulled, and where σ is by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    /// Width of the ligaments, millimetres.
    pub hinge_width_mm: f64,
    /// Width of the cut, millimetres.
    pub kerf_mm: f64,
    /// True if the beam strikes the back.
    #[serde(default, skip_serializing_if = "is_false")]
    pub mirror: bool,
    /// Width and height of the piece of stock, millimetres; absent: as large as the bed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stock_mm: Option<[f64; 2]>,
    /// True if a sheet that does not fit is refused and not divided.
    #[serde(default, skip_serializing_if = "is_false")]
    pub undivided: bool,
    /// How far the surface is continued to cut the sheet along its smooth rim, millimetres; absent: its edge follows the
    /// triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smooth_rim_skirt_mm: Option<f64>,
    /// Shape of the slits' tips; absent: as the beam leaves them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip: Option<TipShape>,
    /// Finished radius of those tips, millimetres.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tip_radius_mm: f64,
    /// Finished radius of the triangles' corners, millimetres.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub corner_radius_mm: f64,
    /// Diameter of the holes in flaps and their doubles, millimetres.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub alignment_hole_mm: f64,
    /// Tabs for each part.
    #[serde(default, skip_serializing_if = "is_none_of")]
    pub tabs: usize,
    /// Width of each, millimetres.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tab_width_mm: f64,
    /// What it costs to cut next to a cut just made, millimetres of travel.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub cool_price_mm: f64,
    /// From how far away on it costs nothing, millimetres.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub cool_reach_mm: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_none_of(count: &usize) -> bool {
    *count == 0
}

impl SheetChoice {
    fn wish(&self) -> SheetWish {
        let radius_mm = self.tip_radius_mm;
        SheetWish {
            stock_mm: self.stock_mm,
            divide: !self.undivided,
            rim: match self.smooth_rim_skirt_mm {
                None => RimWish::Lattice,
                skirt_mm => RimWish::Smooth { skirt_mm },
            },
            tip: Some(match self.tip {
                None | Some(TipShape::Plain) => Tip::Plain,
                Some(TipShape::Round) => Tip::Round { radius_mm },
                Some(TipShape::Teardrop) => Tip::Teardrop { radius_mm },
            }),
            corner_radius_mm: Some(self.corner_radius_mm),
            alignment_hole_mm: self.alignment_hole_mm,
            tabs: self.tabs,
            tab_width_mm: self.tab_width_mm,
            heat: Heat {
                price_mm: self.cool_price_mm,
                reach_mm: self.cool_reach_mm,
            },
        }
    }
}

/// `[linkage]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkageChoice {
    /// Triangle edge L, millimetres.
    pub edge_mm: f64,
    /// Lattice direction against the layout's X, degrees.
    pub orientation_deg: f64,
    /// Which of the two slit patterns.
    pub pattern: Handedness,
    /// Triangles dropped at each positive cone.
    pub remove_at_cone: usize,
    /// Triangles left out where the sheet cannot follow, by their numbers on the lattice.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<u32>,
    /// How far each rim but the first turns, multiples of 120°.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rim_turnings_deg: Vec<i32>,
    /// Doubled rows along the seams.
    #[serde(default)]
    pub flaps: FlapWish,
    /// Share of each surface, in their order, in the one that the pattern is laid on; absent: the only one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shares: Vec<f64>,
    /// Rims that are straight hems, counted from 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub straight_rims: Vec<usize>,
}

/// `[solve]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolveChoice {
    /// Which solver.
    pub solver: Solver,
    /// Distance from the surface that passes, in L.
    pub accept_distance: f64,
}

/// `[[cone]]`: at a vertex of the mesh or at a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConeChoice {
    /// Vertex of the imported surface, counted from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertex: Option<u64>,
    /// Point in millimetres; the nearest point of the surface is taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_mm: Option<[f64; 3]>,
    /// Curvature in units of 2π/3.
    pub units: i32,
}

/// `[[dart]]`: an open cut past vertices of the mesh or past points, joined by shortest ways along its edges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DartChoice {
    /// Vertices of the imported surface, counted from 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub vertices: Vec<u64>,
    /// Points in millimetres; the nearest points of the surface are taken.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points_mm: Vec<[f64; 3]>,
}

/// `[[cut]]`: a path that the seam follows where it can, past vertices of the mesh or past points, joined by straight
/// ways over it. Unlike a dart it opens nothing: the pattern goes on across it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CutChoice {
    /// Vertices of the imported surface, counted from 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub vertices: Vec<u64>,
    /// Points in millimetres; the nearest vertices of the surface are taken.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points_mm: Vec<[f64; 3]>,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
fn is_false(value: &bool) -> bool {
    !value
}

/// A path is given by vertices or by points, two or more.
fn check_path(key: &str, vertices: &[u64], points_mm: &[[f64; 3]]) -> Result<(), Complaint> {
    for value in points_mm.iter().flatten() {
        ranged(&format!("{key}.points_mm"), *value, -1e6, 1e6)?;
    }
    let stops = vertices.len().max(points_mm.len());
    if vertices.is_empty() == points_mm.is_empty() || stops < 2 {
        return Err(Complaint::new(
            key,
            "needs either vertices or points_mm, at least two",
        ));
    }
    Ok(())
}

/// The places that a path passes.
fn path(vertices: &[u64], points_mm: &[[f64; 3]]) -> Vec<ConePlace> {
    let by_number = vertices.iter().map(|&v| ConePlace::Vertex(v));
    by_number
        .chain(points_mm.iter().map(|&p| ConePlace::Point(p)))
        .collect()
}

/// Rims as a person counts them, from 1, as ascending indices.
fn hems(rims: &[usize]) -> Vec<usize> {
    let mut hems: Vec<usize> = rims.iter().filter_map(|rim| rim.checked_sub(1)).collect();
    hems.sort_unstable();
    hems.dedup();
    hems
}

impl Design {
    /// Reads a design file's text; `name` is what messages call it.
    ///
    /// # Errors
    /// [`MakeError::Design`] with file, line and key.
    pub fn parse(name: &str, text: &str) -> Result<Self, MakeError> {
        Document::new(name, text)
            .read(Self::validate)
            .map_err(MakeError::Design)
    }

    /// The file's text.
    ///
    /// # Errors
    /// None in practice: every value has a TOML form. A failure is passed on rather than hidden.
    pub fn to_text(&self) -> Result<String, MakeError> {
        let body =
            toml::to_string(self).map_err(|e| MakeError::Internal(format!("design.toml: {e}")))?;
        Ok(format!(
            "# Every decision of this sheet. `kagome make design.toml -o OTHER` makes it again.\n{body}"
        ))
    }

    fn validate(&self) -> Result<(), Complaint> {
        if self.format != FORMAT {
            return Err(Complaint::new(
                "format",
                format!("is {}; this kagome reads format {FORMAT}", self.format),
            ));
        }
        match (&self.surface.file, &self.surface.sample) {
            (Some(_), None) | (None, Some(_)) => {}
            _ => {
                return Err(Complaint::new(
                    "surface",
                    "needs exactly one of file and sample",
                ));
            }
        }
        for (i, also) in self.also.iter().enumerate() {
            if also.file.is_some() == also.sample.is_some() {
                return Err(Complaint::new(
                    format!("also[{i}]"),
                    "needs exactly one of file and sample",
                ));
            }
        }
        let surfaces = 1 + self.also.len();
        if surfaces > 1 && self.linkage.shares.len() != surfaces {
            return Err(Complaint::new(
                "linkage.shares",
                format!("needs {surfaces} numbers, one for each surface"),
            ));
        }
        for share in &self.linkage.shares {
            ranged("linkage.shares", *share, 0.0, 1.0)?;
        }
        ranged("surface.mm_per_unit", self.surface.mm_per_unit, 1e-9, 1e9)?;
        if let Some(confidence) = self.sheet.confidence {
            ranged(
                "sheet.confidence",
                confidence,
                *CONFIDENCES.start(),
                *CONFIDENCES.end(),
            )?;
        }
        ranged(
            "sheet.hinge_width_mm",
            self.sheet.hinge_width_mm,
            0.01,
            100.0,
        )?;
        ranged("sheet.kerf_mm", self.sheet.kerf_mm, 0.0, 20.0)?;
        for size in self.sheet.stock_mm.into_iter().flatten() {
            ranged("sheet.stock_mm", size, 1.0, 1e5)?;
        }
        if let Some(skirt) = self.sheet.smooth_rim_skirt_mm {
            ranged("sheet.smooth_rim_skirt_mm", skirt, 1e-3, 1e5)?;
        }
        ranged("sheet.tip_radius_mm", self.sheet.tip_radius_mm, 0.0, 100.0)?;
        let wide = self.sheet.tip.is_some_and(|tip| tip != TipShape::Plain);
        if wide != (self.sheet.tip_radius_mm > 0.0) {
            return Err(Complaint::new(
                "sheet.tip_radius_mm",
                "goes with tip: give both or neither",
            ));
        }
        ranged(
            "sheet.corner_radius_mm",
            self.sheet.corner_radius_mm,
            0.0,
            100.0,
        )?;
        ranged(
            "sheet.alignment_hole_mm",
            self.sheet.alignment_hole_mm,
            0.0,
            100.0,
        )?;
        ranged("sheet.tabs", self.sheet.tabs as f64, 0.0, 1000.0)?;
        ranged("sheet.tab_width_mm", self.sheet.tab_width_mm, 0.0, 100.0)?;
        ranged("sheet.cool_price_mm", self.sheet.cool_price_mm, 0.0, 1e4)?;
        ranged("sheet.cool_reach_mm", self.sheet.cool_reach_mm, 0.0, 1e4)?;
        if (self.sheet.cool_price_mm > 0.0) != (self.sheet.cool_reach_mm > 0.0) {
            return Err(Complaint::new(
                "sheet.cool_reach_mm",
                "goes with cool_price_mm: give both or neither",
            ));
        }
        ranged("linkage.edge_mm", self.linkage.edge_mm, 0.01, 1e5)?;
        ranged(
            "linkage.orientation_deg",
            self.linkage.orientation_deg,
            -360.0,
            360.0,
        )?;
        if let Some(wrong) = self.linkage.rim_turnings_deg.iter().find(|t| *t % 120 != 0) {
            return Err(Complaint::new(
                "linkage.rim_turnings_deg",
                format!("has {wrong}, which is no multiple of 120"),
            ));
        }
        if self.linkage.straight_rims.contains(&0) {
            return Err(Complaint::new(
                "linkage.straight_rims",
                "has 0: rims are counted from 1",
            ));
        }
        ranged(
            "solve.accept_distance",
            self.solve.accept_distance,
            0.0,
            100.0,
        )?;
        for (i, dart) in self.dart.iter().enumerate() {
            check_path(&format!("dart[{i}]"), &dart.vertices, &dart.points_mm)?;
        }
        for (i, cut) in self.cut.iter().enumerate() {
            check_path(&format!("cut[{i}]"), &cut.vertices, &cut.points_mm)?;
        }
        for (i, cone) in self.cone.iter().enumerate() {
            for value in cone.at_mm.into_iter().flatten() {
                ranged(&format!("cone[{i}].at_mm"), value, -1e6, 1e6)?;
            }
            if cone.vertex.is_some() == cone.at_mm.is_some() {
                return Err(Complaint::new(
                    format!("cone[{i}]"),
                    "needs exactly one of vertex and at_mm",
                ));
            }
        }
        Ok(())
    }

    /// What to make; file names are taken relative to `folder`, where the design file lies.
    pub fn request(&self, folder: &Path) -> Request {
        let beside = |name: &str| -> PathBuf { folder.join(name) };
        // A profile is a name or a file beside the design.
        let profile = |name: &str| -> String {
            let path = beside(name);
            if path.is_file() {
                path.to_string_lossy().into_owned()
            } else {
                name.to_owned()
            }
        };
        let source =
            |file: &Option<String>, sample: &Option<String>, sha256: &Option<String>| match (
                file, sample,
            ) {
                (Some(file), _) => Source::File {
                    path: beside(file),
                    sha256: sha256.clone(),
                },
                (None, sample) => Source::Sample(sample.clone().unwrap_or_default()),
            };
        let surface = &self.surface;
        let further = self.also.iter();
        let cones = self
            .cone
            .iter()
            .map(|c| {
                let place = match (c.at_mm, c.vertex) {
                    (Some(at), _) => ConePlace::Point(at),
                    (None, vertex) => ConePlace::Vertex(vertex.unwrap_or(0)),
                };
                (place, c.units)
            })
            .collect();
        let darts = self.dart.iter().map(|d| path(&d.vertices, &d.points_mm));
        let cuts = self.cut.iter().map(|c| path(&c.vertices, &c.points_mm));
        Request {
            source: source(&surface.file, &surface.sample, &surface.sha256),
            also: further
                .map(|also| source(&also.file, &also.sample, &also.sha256))
                .collect(),
            shares: Some(self.linkage.shares.clone()).filter(|shares| !shares.is_empty()),
            import: ImportOptions {
                units: Units {
                    unit: Unit::Millimetre,
                    scale: self.surface.mm_per_unit,
                    size_mm: None,
                },
                parts: if self.surface.largest_part {
                    PartChoice::Largest
                } else {
                    PartChoice::Refuse
                },
            },
            material: profile(&self.sheet.material),
            machine: profile(&self.sheet.machine),
            sigma: Some(self.sheet.sigma),
            confidence: self.sheet.confidence,
            hinge_width_mm: Some(self.sheet.hinge_width_mm),
            kerf_mm: Some(self.sheet.kerf_mm),
            mirror: self.sheet.mirror,
            sheet: self.sheet.wish(),
            sizing: Sizing::EdgeMm(self.linkage.edge_mm),
            cones: ConeWish::Given(cones),
            darts: DartWish::Given(darts.collect()),
            cuts: cuts.collect(),
            turnings: Some(
                self.linkage
                    .rim_turnings_deg
                    .iter()
                    .map(|t| t / 120)
                    .collect(),
            ),
            straight: hems(&self.linkage.straight_rims),
            orientation_deg: Some(self.linkage.orientation_deg),
            handedness: self.linkage.pattern,
            remove_at_cone: Some(self.linkage.remove_at_cone),
            left_out: Some(self.linkage.left_out.clone()),
            flaps: self.linkage.flaps,
            solver: self.solve.solver,
            accept_distance: self.solve.accept_distance,
        }
    }
}
