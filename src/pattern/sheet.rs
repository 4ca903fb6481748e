//! Slits whose ligaments are exactly as wide as asked, and the sheet around them.
//!
//! All widths are those of the finished part: the kerf and the shape of the slits' tips are taken off before, so that a
//! ligament is what was asked for, whatever burns it.
//!
//! At a smooth rim triangles are trimmed ([`crate::linkage::Trim`]): a slit that begins beyond it begins at it, and one
//! whose hinge it cut off runs out.

use std::borrow::Cow;
use std::collections::BTreeMap;

use kurbo::{Point, Rect};

use super::contour;
use super::ligament::Ligament;
use super::mark::Mark;
use super::star;
use crate::base::curve::Curve;
use crate::base::ids::{Id, Per};
use crate::base::plane;
use crate::base::union::Union;
use crate::linkage::{Flaps, Linkage, Triangle, TriangleId};
use crate::material::{self, TipShape};

/// Largest neck c (the uncut end of a slit's lattice edge) in edge lengths.
///
/// Up to 2/3 the narrowest ligament is the one that the formula knows; beyond 1/2 the slit is shorter than its neck, the
/// triangles hardly turn, and nothing of the linkage is left.
pub const MAX_NECK: f64 = 0.5;

/// Largest part of a slit that its widened end may take.
const TIP_SHARE: f64 = 0.8;

/// A slit shorter than this is none: the rim crosses its line in its end.
const SAME_END_MM: f64 = 1e-6;

/// One slit: an open cut on its centre line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slit {
    /// The end at a lattice vertex, where up to three slits meet, or where a smooth rim crosses it.
    pub tail: Point,
    /// The end before the hinge, or at the rim if it runs out there.
    pub tip: Point,
    /// The star: slits with the same number have one tail. Counted from 0 without gaps.
    pub star: u32,
    /// True if it runs along a flap triangle.
    pub flap: bool,
    /// True if it has no hinge: it runs out at a smooth rim.
    pub through: bool,
}

/// A closed edge of the finished part, material on the left.
#[derive(Clone, Debug, PartialEq)]
pub struct Contour {
    /// The edge: closed, straight pieces and arcs, no two neighbouring straight ones collinear.
    pub line: Curve,
    /// True: counter-clockwise, the rim of a part. False: clockwise, a hole.
    pub outer: bool,
}

/// A short uncut stretch of a contour that holds the part in the stock until a person breaks it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tab {
    /// Its middle, on a contour.
    pub at: Point,
    /// What remains uncut, millimetres.
    pub width_mm: f64,
}

/// The shape of a slit's end before its hinge. A wide round end spreads the bend of the two ligaments over a longer way
/// and starts no crack.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Tip {
    /// As the beam leaves it: round, half a kerf in radius.
    #[default]
    Plain,
    /// A round hole.
    Round {
        /// Its finished radius, millimetres.
        radius_mm: f64,
    },
    /// A round hole into which the slit widens along tangents, so that no corner is left between the two.
    Teardrop {
        /// The finished radius of its round end, millimetres.
        radius_mm: f64,
    },
}

impl From<material::Tip> for Tip {
    /// As a profile that was checked has it.
    fn from(tip: material::Tip) -> Self {
        match (tip.shape, tip.radius_mm) {
            (TipShape::Round, Some(radius_mm)) => Self::Round { radius_mm },
            (TipShape::Teardrop, Some(radius_mm)) => Self::Teardrop { radius_mm },
            _ => Self::Plain,
        }
    }
}

impl Tip {
    /// Radius of the finished end for a kerf, millimetres: no end is finer than the beam.
    pub fn radius_mm(self, kerf_mm: f64) -> f64 {
        match self {
            Self::Plain => 0.5 * kerf_mm,
            Self::Round { radius_mm } | Self::Teardrop { radius_mm } => {
                radius_mm.max(0.5 * kerf_mm)
            }
        }
    }
}

/// What is asked of a sheet besides its linkage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetOptions {
    /// Width h of the narrowest ligament, millimetres.
    pub hinge_width_mm: f64,
    /// Width k of the cut, millimetres.
    pub kerf_mm: f64,
    /// Shape of the slits' ends.
    pub tip: Tip,
    /// Finished radius of the triangles' corners, at the centres of stars and on the rim, millimetres; 0 leaves them
    /// sharp.
    pub corner_radius_mm: f64,
    /// Diameter of a hole in the middle of every flap triangle and of its double, for a pin or a rivet, millimetres;
    /// 0 for none.
    pub alignment_hole_mm: f64,
}

impl SheetOptions {
    /// Plain slits and corners.
    pub fn plain(hinge_width_mm: f64, kerf_mm: f64) -> Self {
        Self {
            hinge_width_mm,
            kerf_mm,
            tip: Tip::Plain,
            corner_radius_mm: 0.0,
            alignment_hole_mm: 0.0,
        }
    }

    /// The numbers that go with a sheet of triangles of this edge.
    pub fn metadata(&self, edge_mm: f64) -> SheetMetadata {
        SheetMetadata {
            hinge_width_mm: self.hinge_width_mm,
            kerf_mm: self.kerf_mm,
            edge_mm,
            tip: self.tip,
            corner_radius_mm: self.corner_radius_mm,
        }
    }

    /// The ligaments of such a sheet, of this thickness.
    pub fn ligament(&self, edge_mm: f64, thickness_mm: f64) -> Ligament {
        Ligament::of(&self.metadata(edge_mm), thickness_mm)
    }
}

/// The numbers that belong to a sheet and not to its drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetMetadata {
    /// Width h of the narrowest ligament, millimetres.
    pub hinge_width_mm: f64,
    /// Width k of the cut, millimetres.
    pub kerf_mm: f64,
    /// Triangle edge L, millimetres.
    pub edge_mm: f64,
    /// Shape of the slits' ends.
    pub tip: Tip,
    /// Finished radius of the triangles' corners, millimetres.
    pub corner_radius_mm: f64,
}

/// A sheet to be cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// All slits, star by star.
    pub slits: Vec<Slit>,
    /// All contours.
    pub contours: Vec<Contour>,
    /// The triangles, for the eye; never cut.
    pub triangles: Vec<[Point; 3]>,
    /// The flap triangles of doubled rows along the seam, for the eye; their slits and edges are among the others.
    pub flaps: Vec<[Point; 3]>,
    /// What is engraved.
    pub marks: Vec<Mark>,
    /// Where contours are interrupted.
    pub tabs: Vec<Tab>,
    /// Hinge width, kerf, edge, shapes of tips and corners.
    pub metadata: SheetMetadata,
}

/// What a sheet amounts to.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Number of triangles, flap triangles not counted.
    pub triangles: usize,
    /// Number of flap triangles.
    pub flaps: usize,
    /// Number of slits, all in all.
    pub slits: usize,
    /// Number of slits along flap triangles.
    pub flap_slits: usize,
    /// Number of stars.
    pub stars: usize,
    /// Number of closed contours.
    pub contours: usize,
    /// Total length of the slits, millimetres.
    pub slit_length_mm: f64,
    /// Total length of the contours, millimetres.
    pub contour_length_mm: f64,
    /// Area inside the contours, square millimetres.
    pub area_mm2: f64,
    /// Width of the box, millimetres.
    pub width_mm: f64,
    /// Height of the box, millimetres.
    pub height_mm: f64,
}

/// Why a linkage gives no sheet. Positions are in the sheet's frame, millimetres.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatternError {
    /// Nothing to cut.
    #[error("the linkage has no triangles: nothing is left to cut")]
    Empty,
    /// A width is negative, zero or not a number.
    #[error("the {what} is {value_mm} mm; it must be a plain number above 0")]
    Width {
        /// `hinge width`, `kerf`, `edge length`, `margin`.
        what: &'static str,
        /// The value.
        value_mm: f64,
    },
    /// A radius, diameter or the like is negative or not a number.
    #[error("the {what} is {value_mm} mm; it must be a plain number, 0 or above")]
    Size {
        /// `corner radius`, `alignment hole`, `tip radius`.
        what: &'static str,
        /// The value.
        value_mm: f64,
    },
    /// A rounded corner would thin out the hinge beside it.
    #[error(
        "corners rounded to {corner_radius_mm} mm would thin out the hinges; with a hinge of {hinge_width_mm} mm and tips of {tip_radius_mm:.3} mm they can have {most_mm:.3} mm (corner_radius_mm in the material's profile)"
    )]
    CornerTooRound {
        /// The radius asked for.
        corner_radius_mm: f64,
        /// Hinge width.
        hinge_width_mm: f64,
        /// Radius of the slits' ends.
        tip_radius_mm: f64,
        /// The largest radius that leaves the hinges alone.
        most_mm: f64,
    },
    /// An alignment hole would leave too little of its triangle.
    #[error(
        "an alignment hole of {hole_mm} mm leaves less than a hinge's width around it in triangles of {edge_mm:.3} mm: {most_mm:.3} mm is the most"
    )]
    HoleTooWide {
        /// Its diameter.
        hole_mm: f64,
        /// Edge of the triangles.
        edge_mm: f64,
        /// The largest diameter.
        most_mm: f64,
    },
    /// The ligaments leave no room for slits.
    #[error(
        "a hinge {hinge_width_mm} mm wide, a kerf of {kerf_mm} mm{} need triangles with edges of {least_edge_mm:.3} mm or more; these have {edge_mm:.3} mm. Make the triangles larger (--edge, or fewer --triangles){}", with_tip(*.tip_radius_mm), narrower(*.largest_hinge_mm)
    )]
    TooWide {
        /// Radius of a slit's widened end, or 0.
        tip_radius_mm: f64,
        /// Hinge width asked for.
        hinge_width_mm: f64,
        /// Kerf.
        kerf_mm: f64,
        /// Edge of the triangles.
        edge_mm: f64,
        /// Smallest edge that would do.
        least_edge_mm: f64,
        /// Widest hinge that this edge allows; negative if the kerf alone is too wide.
        largest_hinge_mm: f64,
    },
    /// Two triangles lie on top of each other.
    #[error(
        "the flat sheet overlaps itself: triangles {first} and {second} lie on one another near ({x:.3}, {y:.3}) mm. Move the cut or the cones so that the layout lies flat without overlap"
    )]
    Overlap {
        /// One triangle.
        first: TriangleId,
        /// The other.
        second: TriangleId,
        /// Where.
        x: f64,
        /// Where.
        y: f64,
    },
    /// Tabs are asked for, and none fits a part's rim.
    #[error(
        "a tab of {width_mm} mm finds no straight stretch of the rim that is long enough, and the part would fall out when it is cut free: tabs can be {most_mm:.3} mm wide at the most (--tabs N:WIDTH)"
    )]
    NoTab {
        /// Width of a tab.
        width_mm: f64,
        /// The widest that fits.
        most_mm: f64,
    },
    /// The boundary sides do not close to loops.
    #[error("the rim of the sheet does not close near ({x:.3}, {y:.3}) mm")]
    OpenRim {
        /// Where.
        x: f64,
        /// Where.
        y: f64,
    },
    /// A ligament of an edited drawing is too narrow.
    #[error(
        "near ({x:.3}, {y:.3}) mm only {width_mm:.3} mm of material are left between a slit and {other}, and the drawing asks for hinges of {hinge_width_mm} mm: move or shorten the slit"
    )]
    Thin {
        /// Where.
        x: f64,
        /// Where.
        y: f64,
        /// What is left; 0 where cuts cross.
        width_mm: f64,
        /// What is asked for.
        hinge_width_mm: f64,
        /// `another slit` or `the contour`.
        other: &'static str,
    },
    /// A drawing that is not on the bed.
    #[error(
        "the drawing lies at ({x0:.1}, {y0:.1}) to ({x1:.1}, {y1:.1}) mm with its cut, and machine `{machine}` reaches from ({from_x:.1}, {from_y:.1}) to ({to_x:.1}, {to_y:.1}) mm: move it in the drawing program, or let it be moved into the corner (--place)"
    )]
    OffBed {
        /// Left of the drawing.
        x0: f64,
        /// Its lower edge.
        y0: f64,
        /// Its right.
        x1: f64,
        /// Its upper edge.
        y1: f64,
        /// The machine.
        machine: String,
        /// Left of the bed.
        from_x: f64,
        /// Its lower edge.
        from_y: f64,
        /// Its right.
        to_x: f64,
        /// Its upper edge.
        to_y: f64,
    },
    /// Larger than the bed.
    #[error(
        "the sheet is {width_mm:.1} x {height_mm:.1} mm with its cut, and there is room for {bed_width_mm:.1} x {bed_height_mm:.1} mm inside the margins, whichever way it is turned. It fits with triangles of edge {fitting_edge_mm:.3} mm or less in the same number (--scale {fitting_scale:.4} of this size), or on a larger machine"
    )]
    TooLarge {
        /// Width with half a cut on each side.
        width_mm: f64,
        /// Height with half a cut on each side.
        height_mm: f64,
        /// Bed inside its margins.
        bed_width_mm: f64,
        /// Bed inside its margins.
        bed_height_mm: f64,
        /// Edge with which the same pattern fits.
        fitting_edge_mm: f64,
        /// Scale with which the same pattern fits.
        fitting_scale: f64,
    },
}

fn with_tip(tip_radius_mm: f64) -> String {
    if tip_radius_mm > 0.0 {
        format!(" and tips of radius {tip_radius_mm} mm")
    } else {
        String::new()
    }
}

fn narrower(largest_hinge_mm: f64) -> String {
    if largest_hinge_mm > 0.0 {
        format!(", or the hinge at most {largest_hinge_mm:.3} mm wide (--hinge)")
    } else {
        ": the cut alone is too wide for them".into()
    }
}

/// Checks that a width can be calculated with.
pub(super) fn check_width(what: &'static str, value_mm: f64) -> Result<(), PatternError> {
    if value_mm.is_finite() && value_mm > 0.0 {
        Ok(())
    } else {
        Err(PatternError::Width { what, value_mm })
    }
}

/// Checks a size that may be zero.
fn check_size(what: &'static str, value_mm: f64) -> Result<(), PatternError> {
    if value_mm.is_finite() && value_mm >= 0.0 {
        Ok(())
    } else {
        Err(PatternError::Size { what, value_mm })
    }
}

impl SheetMetadata {
    /// How far before its hinge a slit's tip has its centre: c = (2/√3)(h + k/2 + r) for a finished tip of radius r,
    /// which is k/2 for a plain one.
    ///
    /// The neighbouring arms leave the hinge's vertex at ±60° from the slit, so the tip's centre is c · sin 60° =
    /// h + k/2 + r from their centre lines: r is the tip's own, half a kerf the arm's, and h remains.
    pub fn neck_mm(&self) -> f64 {
        let tip = self.tip.radius_mm(self.kerf_mm);
        crate::material::neck_mm(self.hinge_width_mm, self.kerf_mm, tip)
    }

    /// The largest finished radius of corners that leaves the ligaments alone: h + r.
    ///
    /// A fillet in a corner of 120° begins ρ/√3 from it and a ligament's foot on the arm is c/2 away; on centre lines
    /// that is (ρ + k/2)/√3 ≤ c/2.
    pub fn most_corner_mm(&self) -> f64 {
        self.hinge_width_mm + self.tip.radius_mm(self.kerf_mm)
    }

    fn check(&self) -> Result<(), PatternError> {
        check_width("hinge width", self.hinge_width_mm)?;
        check_width("kerf", self.kerf_mm)?;
        check_width("edge length", self.edge_mm)?;
        check_size("tip radius", self.tip.radius_mm(0.0))?;
        check_size("corner radius", self.corner_radius_mm)?;
        // Room for the neck, and for a wide tip on the slit that remains.
        let least =
            (self.neck_mm() / MAX_NECK).max(self.neck_mm() + star::tip_reach_mm(self) / TIP_SHARE);
        if least > self.edge_mm {
            let tip = self.tip.radius_mm(self.kerf_mm);
            return Err(PatternError::TooWide {
                tip_radius_mm: if self.tip == Tip::Plain { 0.0 } else { tip },
                hinge_width_mm: self.hinge_width_mm,
                kerf_mm: self.kerf_mm,
                edge_mm: self.edge_mm,
                least_edge_mm: least,
                largest_hinge_mm: MAX_NECK * self.edge_mm * 0.75f64.sqrt()
                    - 0.5 * self.kerf_mm
                    - tip,
            });
        }
        if self.corner_radius_mm > self.most_corner_mm() {
            return Err(PatternError::CornerTooRound {
                corner_radius_mm: self.corner_radius_mm,
                hinge_width_mm: self.hinge_width_mm,
                tip_radius_mm: self.tip.radius_mm(self.kerf_mm),
                most_mm: self.most_corner_mm(),
            });
        }
        Ok(())
    }
}

impl Sheet {
    /// The sheet of a linkage in the frame of its flat positions.
    ///
    /// # Errors
    /// [`PatternError`]: nothing to cut, widths that the triangles do not allow, a layout that overlaps itself.
    pub fn new(linkage: &Linkage, options: &SheetOptions) -> Result<Self, PatternError> {
        Self::with_flaps(linkage, &Flaps::default(), options)
    }

    /// As [`Sheet::new`], with doubled rows along the seam, which are cut like all else.
    ///
    /// # Errors
    /// As [`Sheet::new`].
    pub fn with_flaps(
        linkage: &Linkage,
        flaps: &Flaps,
        options: &SheetOptions,
    ) -> Result<Self, PatternError> {
        let metadata = options.metadata(linkage.edge_mm);
        metadata.check()?;
        if linkage.triangles.is_empty() {
            return Err(PatternError::Empty);
        }
        let own = linkage.triangles.len();
        let whole = if flaps.flaps.is_empty() {
            Cow::Borrowed(linkage)
        } else {
            Cow::Owned(flaps.on_sheet(linkage))
        };
        let mut triangles: Vec<[Point; 3]> = whole
            .triangles
            .iter()
            .map(|t| t.flat.map(|p| Point::new(p.x, p.y)))
            .collect();
        check_overlap(&triangles, linkage.edge_mm)?;
        let neighbours = whole.flat_neighbours();
        let mut contours = contour::trace(&whole, &neighbours)?;
        for contour in &mut contours {
            contour.line = contour::rounded(&contour.line, metadata.corner_radius_mm);
        }
        contours.extend(alignment_holes(&triangles, flaps, own, &metadata, options)?);
        Ok(Self {
            slits: slits(&whole, &neighbours, metadata.neck_mm(), own),
            contours,
            flaps: triangles.split_off(own),
            triangles,
            marks: Vec::new(),
            tabs: Vec::new(),
            metadata,
        })
    }

    /// Nothing to cut.
    pub(super) fn empty() -> Self {
        Self {
            slits: Vec::new(),
            contours: Vec::new(),
            triangles: Vec::new(),
            flaps: Vec::new(),
            marks: Vec::new(),
            tabs: Vec::new(),
            metadata: SheetMetadata {
                hinge_width_mm: 1.0,
                kerf_mm: 0.1,
                edge_mm: 10.0,
                tip: Tip::Plain,
                corner_radius_mm: 0.0,
            },
        }
    }

    /// The smallest rectangle around all contours.
    pub fn bounds(&self) -> Rect {
        let all = self.contours.iter().filter_map(|c| c.line.bounds());
        all.reduce(|a, b| a.union(b)).unwrap_or(Rect::ZERO)
    }

    /// Counts, lengths, area.
    pub fn figures(&self) -> Figures {
        let bounds = self.bounds();
        Figures {
            triangles: self.triangles.len(),
            flaps: self.flaps.len(),
            slits: self.slits.len(),
            flap_slits: self.slits.iter().filter(|s| s.flap).count(),
            stars: self
                .slits
                .iter()
                .map(|s| s.star as usize + 1)
                .max()
                .unwrap_or(0),
            contours: self.contours.len(),
            slit_length_mm: self.slits.iter().map(|s| s.tail.distance(s.tip)).sum(),
            contour_length_mm: self.contours.iter().map(|c| c.line.length()).sum(),
            area_mm2: self.contours.iter().map(|c| c.line.signed_area()).sum(),
            width_mm: bounds.width(),
            height_mm: bounds.height(),
        }
    }
}

/// Round holes in the middle of every flap triangle and of the triangle that it is glued on.
fn alignment_holes(
    triangles: &[[Point; 3]],
    flaps: &Flaps,
    own: usize,
    metadata: &SheetMetadata,
    options: &SheetOptions,
) -> Result<Vec<Contour>, PatternError> {
    check_size("alignment hole", options.alignment_hole_mm)?;
    if options.alignment_hole_mm == 0.0 {
        return Ok(Vec::new());
    }
    let inradius = metadata.edge_mm / 12f64.sqrt();
    let most = 2.0 * (inradius - 0.5 * metadata.kerf_mm - metadata.hinge_width_mm);
    if options.alignment_hole_mm > most {
        return Err(PatternError::HoleTooWide {
            hole_mm: options.alignment_hole_mm,
            edge_mm: metadata.edge_mm,
            most_mm: most.max(0.0),
        });
    }
    let mut places: Vec<usize> = (own..triangles.len()).collect();
    places.extend(flaps.flaps.iter().map(|f| f.double.index()));
    places.sort_unstable();
    places.dedup();
    let hole = |t: usize| Contour {
        line: Curve::circle(
            plane::centroid(&triangles[t]),
            0.5 * options.alignment_hole_mm,
            false,
        ),
        outer: false,
    };
    Ok(places.into_iter().map(hole).collect())
}

/// The slits of all hinges that the sheet does not cut open, star by star, in each those along flaps last. The flap
/// triangles are those from number `flaps_from` on.
fn slits(
    linkage: &Linkage,
    neighbours: &Per<TriangleId, [Option<(TriangleId, usize)>; 3]>,
    neck_mm: f64,
    flaps_from: usize,
) -> Vec<Slit> {
    let vertex = flat_vertices(&linkage.triangles, neighbours);
    let mut found: Vec<(u32, usize, Slit)> = Vec::with_capacity(linkage.hinges.len());
    // Slits that begin at the rim are stars of their own.
    let mut own = 3 * linkage.triangles.len() as u32;
    for (order, hinge) in linkage.hinges.iter().enumerate().filter(|(_, h)| !h.seam) {
        let triangle = &linkage.triangles[hinge.ccw.triangle];
        let (from, to) = ((hinge.ccw.corner + 2) % 3, hinge.ccw.corner);
        let [a, b] = [from, to].map(|k| Point::new(triangle.flat[k].x, triangle.flat[k].y));
        let through = !linkage.keeps(hinge);
        // The side runs from `from` to `to`.
        let left = match &triangle.trim {
            Some(trim) => trim.side(from),
            None => [0.0, 1.0],
        };
        let tail = if left[0] > 0.0 { a.lerp(b, left[0]) } else { a };
        let tip = if through {
            a.lerp(b, left[1])
        } else {
            b + (a - b).normalize() * neck_mm
        };
        if tail.distance(tip) <= SAME_END_MM {
            continue;
        }
        let star = if left[0] > 0.0 {
            own += 1;
            own
        } else {
            vertex[hinge.ccw.triangle.index() * 3 + from]
        };
        let flap = [hinge.ccw, hinge.cw]
            .iter()
            .any(|c| c.triangle.index() >= flaps_from);
        let slit = Slit {
            tail,
            tip,
            star: 0,
            flap,
            through,
        };
        found.push((star, order, slit));
    }
    found.sort_by_key(|&(star, order, slit)| (star, slit.flap, order));
    let mut numbers = BTreeMap::new();
    found
        .into_iter()
        .map(|(root, _, slit)| {
            let next = numbers.len() as u32;
            Slit {
                star: *numbers.entry(root).or_insert(next),
                ..slit
            }
        })
        .collect()
}

/// For corner `k` of triangle `t` at `3 t + k`: a number shared by all corners of one fan around one point.
pub(super) fn flat_vertices(
    triangles: &Per<TriangleId, Triangle>,
    neighbours: &Per<TriangleId, [Option<(TriangleId, usize)>; 3]>,
) -> Vec<u32> {
    let mut fans = Union::new(3 * triangles.len());
    for (t, sides) in neighbours.iter_ids() {
        for (k, across) in sides.iter().enumerate() {
            let Some((other, side)) = *across else {
                continue;
            };
            // Neighbouring sides run in opposite directions.
            for (mine, theirs) in [(k, (side + 1) % 3), ((k + 1) % 3, side)] {
                fans.join(t.index() * 3 + mine, other.index() * 3 + theirs);
            }
        }
    }
    (0..3 * triangles.len())
        .map(|i| fans.root(i) as u32)
        .collect()
}

/// Two equilateral triangles that do not overlap have centroids two inradii apart or more, L/√3: closer is overlap.
/// On one lattice, where sheets lie, the converse holds too.
fn check_overlap(triangles: &[[Point; 3]], edge_mm: f64) -> Result<(), PatternError> {
    let least = edge_mm / 3f64.sqrt() * (1.0 - 1e-6);
    let cell = |p: Point| {
        (
            (p.x / edge_mm).floor() as i64,
            (p.y / edge_mm).floor() as i64,
        )
    };
    let mut grid: BTreeMap<(i64, i64), Vec<u32>> = BTreeMap::new();
    for (i, t) in triangles.iter().enumerate() {
        let here = plane::centroid(t);
        let (x, y) = cell(here);
        for near in (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| (x, y))) {
            for &j in grid.get(&near).into_iter().flatten() {
                if plane::centroid(&triangles[j as usize]).distance(here) < least {
                    return Err(PatternError::Overlap {
                        first: TriangleId(j),
                        second: TriangleId::from_index(i),
                        x: here.x,
                        y: here.y,
                    });
                }
            }
        }
        grid.entry((x, y)).or_default().push(i as u32);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Colour, Handedness};

    fn hexagon(radius: i32, edge: f64) -> Linkage {
        Linkage::patch(edge, Handedness::Right, &Linkage::hexagon_cells(radius))
    }

    #[test]
    fn a_hexagon_has_the_counted_slits_area_and_rim() {
        for radius in 1..5 {
            let (edge, hinge, kerf) = (10.0, 0.8, 0.2);
            let sheet =
                Sheet::new(&hexagon(radius, edge), &SheetOptions::plain(hinge, kerf)).unwrap();
            let f = sheet.figures();
            let (triangles, r) = (6 * radius * radius, f64::from(radius));
            assert_eq!(f.triangles as i32, triangles);
            assert_eq!(f.slits as i32, (3 * triangles - 6 * radius) / 2);
            let slit = edge - (hinge + kerf) * 2.0 / 3f64.sqrt();
            assert!((f.slit_length_mm - slit * f.slits as f64).abs() < 1e-9);
            assert!(
                (f.area_mm2 - f64::from(triangles) * 0.75f64.sqrt() / 2.0 * edge * edge).abs()
                    < 1e-9
            );
            assert!((f.contour_length_mm - 6.0 * r * edge).abs() < 1e-9);
            assert_eq!(sheet.contours.len(), 1);
            assert_eq!(sheet.contours[0].line.len(), 6, "collinear sides are one");
            assert!(sheet.contours[0].outer);
            // Every inner vertex is a star of three.
            let mut sizes = vec![0; f.stars];
            for slit in &sheet.slits {
                sizes[slit.star as usize] += 1;
            }
            let inner = 1 + 3 * radius * (radius - 1);
            assert_eq!(sizes.iter().filter(|n| **n == 3).count() as i32, inner);
        }
    }

    #[test]
    fn the_narrowest_ligament_is_the_hinge_width_exactly() {
        for (hinge, kerf) in [(0.5, 0.2), (1.0, 0.1), (1.7, 0.4)] {
            for handedness in [Handedness::Right, Handedness::Left] {
                let linkage = Linkage::patch(5.0, handedness, &Linkage::hexagon_cells(3));
                let sheet = Sheet::new(&linkage, &SheetOptions::plain(hinge, kerf)).unwrap();
                let mut narrowest = f64::INFINITY;
                for (i, slit) in sheet.slits.iter().enumerate() {
                    for other in sheet
                        .slits
                        .iter()
                        .enumerate()
                        .filter(|(j, o)| *j != i && o.star != slit.star)
                    {
                        let (a, b) = (other.1.tail, other.1.tip);
                        let t = ((slit.tip - a).dot(b - a) / (b - a).hypot2()).clamp(0.0, 1.0);
                        narrowest = narrowest.min(slit.tip.distance(a.lerp(b, t)) - kerf);
                    }
                }
                assert!((narrowest - hinge).abs() < 1e-9, "{narrowest} for {hinge}");
            }
        }
    }

    #[test]
    fn widths_that_leave_no_slit_are_refused_with_what_would_do() {
        let error = Sheet::new(&hexagon(2, 2.0), &SheetOptions::plain(1.0, 0.2)).unwrap_err();
        let PatternError::TooWide {
            least_edge_mm,
            largest_hinge_mm,
            ..
        } = error
        else {
            panic!("{error}");
        };
        assert!(
            Sheet::new(
                &hexagon(2, least_edge_mm * 1.0001),
                &SheetOptions::plain(1.0, 0.2)
            )
            .is_ok()
        );
        assert!(
            Sheet::new(
                &hexagon(2, 2.0),
                &SheetOptions::plain(largest_hinge_mm * 0.9999, 0.2)
            )
            .is_ok()
        );
        assert!(
            Sheet::new(
                &hexagon(2, 2.0),
                &SheetOptions::plain(largest_hinge_mm * 1.0001, 0.2)
            )
            .is_err()
        );
        for (h, k) in [
            (0.0, 0.1),
            (f64::NAN, 0.1),
            (1.0, -0.1),
            (1.0, f64::INFINITY),
        ] {
            assert!(matches!(
                Sheet::new(&hexagon(2, 9.0), &SheetOptions::plain(h, k)),
                Err(PatternError::Width { .. })
            ));
        }
        assert_eq!(
            Sheet::new(
                &Linkage::patch(9.0, Handedness::Right, &[]),
                &SheetOptions::plain(1.0, 0.1)
            ),
            Err(PatternError::Empty)
        );
    }

    #[test]
    fn a_layout_that_lies_on_itself_is_refused() {
        let mut linkage = hexagon(2, 9.0);
        linkage.triangles[TriangleId(5)].flat = linkage.triangles[TriangleId(0)].flat;
        assert!(matches!(
            Sheet::new(&linkage, &SheetOptions::plain(1.0, 0.1)),
            Err(PatternError::Overlap { .. })
        ));
    }

    #[test]
    fn the_ring_has_an_inner_contour_and_a_pinch_does_not_confuse_it() {
        let mut cells = Linkage::hexagon_cells(2);
        cells.retain(|&(i, j, c)| !Linkage::hexagon_cells(1).contains(&(i, j, c)));
        let sheet = Sheet::new(
            &Linkage::patch(9.0, Handedness::Right, &cells),
            &SheetOptions::plain(1.0, 0.1),
        )
        .unwrap();
        let outer: Vec<bool> = sheet.contours.iter().map(|c| c.outer).collect();
        assert_eq!(outer.iter().filter(|o| **o).count(), 1);
        assert_eq!(outer.len(), 2);
        // Two holes that touch at a vertex, one triangle each.
        let mut cells = Linkage::hexagon_cells(3);
        cells.retain(|c| *c != (0, 0, Colour::Up) && *c != (-1, -1, Colour::Down));
        let sheet = Sheet::new(
            &Linkage::patch(9.0, Handedness::Right, &cells),
            &SheetOptions::plain(1.0, 0.1),
        )
        .unwrap();
        assert_eq!(sheet.contours.len(), 3);
        for hole in sheet.contours.iter().filter(|c| !c.outer) {
            assert_eq!(hole.line.len(), 3, "each hole is a loop of its own");
        }
        let whole = cells.len() as f64 * 0.75f64.sqrt() / 2.0 * 81.0;
        assert!((sheet.figures().area_mm2 - whole).abs() < 1e-9);
    }
    #[test]
    fn a_doubled_row_is_cut_like_the_rest_of_the_sheet() {
        for (around, across) in [(5, 2), (9, 6)] {
            let (linkage, flaps) = crate::linkage::cylinder_with_flaps(10.0, around, across);
            let bare = Sheet::new(&linkage, &SheetOptions::plain(0.8, 0.2)).unwrap();
            let sheet =
                Sheet::with_flaps(&linkage, &flaps, &SheetOptions::plain(0.8, 0.2)).unwrap();
            let (old, new) = (bare.figures(), sheet.figures());
            let row = 2 * across as usize - 1;
            assert_eq!((old.flaps, new.flaps), (0, row));
            assert_eq!(old.triangles, new.triangles);
            // One slit an edge of the seam, and one between each two of the row.
            let slits = across as usize + row - 1;
            assert_eq!((old.flap_slits, new.flap_slits), (0, slits));
            assert_eq!(new.slits, old.slits + slits);
            let each = 0.75f64.sqrt() / 2.0 * 100.0;
            assert!((new.area_mm2 - old.area_mm2 - row as f64 * each).abs() < 1e-9);
            // Still one part; n edges of its rim are inside now, a trapezium of n − 1 and twice 1 is around them.
            assert_eq!(sheet.contours.len(), 1);
            assert!((new.contour_length_mm - old.contour_length_mm - 10.0).abs() < 1e-9);
            // The slits of the sheet are where they were.
            let mut kept = sheet.slits.iter().filter(|s| !s.flap);
            let near =
                |a: &Slit, b: &Slit| a.tail.distance(b.tail) < 1e-9 && a.tip.distance(b.tip) < 1e-9;
            assert!(kept.all(|s| bare.slits.iter().any(|o| near(s, o))));
            // Star by star, three arms at most, at 120° to each other.
            for star in sheet.slits.chunk_by(|a, b| a.star == b.star) {
                assert!(star.len() <= 3);
                for (n, s) in star.iter().enumerate().skip(1) {
                    assert!(s.tail.distance(star[0].tail) < 1e-9);
                    let (u, v) = (star[n - 1].tip - star[n - 1].tail, s.tip - s.tail);
                    assert!((u.dot(v) / u.hypot2() + 0.5).abs() < 1e-9);
                }
            }
            let numbers: Vec<u32> = sheet.slits.iter().map(|s| s.star).collect();
            assert!(numbers.is_sorted());
        }
    }
}
