//! What goes on a coupon and where: on one piece of stock, in three jobs that are cut one after the other.
//!
//! The *settings* come first, a grid of squares around the profile's power and speed, because nothing else can be measured
//! while the cut is not clean; then the *kerf* plate, because the strips' hinges are as wide as the kerf leaves them; then
//! the *strips* with the gauge card. Every part has its place from the beginning, so that the sheet may lie where it is.

use kurbo::{Point, Rect};

use super::comb::{card, kerf_plate, setting_plate};
use super::{Coupon, FORMAT, Strip};
use crate::base::units::rounded;
use crate::machine::{HeightControl, Machine};
use crate::material::{CutError, CutSetting, Material, neck_mm};
use crate::pattern::{PatternError, Sheet, SheetOptions, StockArea, Tip, nest};
use crate::toolpath::{Cut, CutOptions, Role, Toolpath, ToolpathError, plan};

/// Widths of the hinges, in the material's own.
const WIDTHS: [f64; 3] = [0.7, 1.0, 1.4];

/// Edges of the triangles, in necks of the material's own hinge: where the beam of the ligaments is slender, and half as
/// long again.
const EDGES_IN_NECKS: [f64; 2] = [5.0, 7.5];

/// A fit needs this many strips at the least.
const FEWEST_STRIPS: usize = 3;

/// More strips are no evening's work.
pub const MOST_STRIPS: usize = 26;

/// Powers and speeds of the grid, in those of the profile.
const POWERS: [f64; 4] = [0.7, 0.85, 1.0, 1.2];
const SPEEDS: [f64; 4] = [1.4, 1.0, 0.75, 0.5];

/// From mark to mark of the gauge, as a stretch.
pub const GAUGE_STEP: f64 = 0.025;

/// What is asked of a coupon.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CouponWish {
    /// Widths of the hinges, millimetres; around the material's own if empty.
    pub hinge_widths_mm: Vec<f64>,
    /// Edges of the triangles, millimetres; as they suit the hinges if empty.
    pub edges_mm: Vec<f64>,
    /// The piece of stock in the bed's corner, millimetres; the material's, else as large as the bed, if left out.
    pub stock_mm: Option<[f64; 2]>,
}

/// Why there is no coupon.
#[derive(Debug, thiserror::Error)]
pub enum CouponError {
    /// The machine does not cut the material.
    #[error(transparent)]
    Cut(#[from] CutError),
    /// A length that is none.
    #[error("the {what} is {value_mm} mm; give plain numbers from {low} to {high} mm")]
    Size {
        /// `hinge width` or `edge`.
        what: &'static str,
        /// The value.
        value_mm: f64,
        /// The least.
        low: f64,
        /// The most.
        high: f64,
    },
    /// Too many.
    #[error(
        "{widths} hinge widths and {edges} edges are {count} strips; {MOST_STRIPS} is the most"
    )]
    TooManyStrips {
        /// How many widths.
        widths: usize,
        /// How many edges.
        edges: usize,
        /// How many strips.
        count: usize,
    },
    /// A strip that cannot be drawn.
    #[error("strip {name} (hinges of {hinge_width_mm} mm, triangles of {edge_mm} mm): {source}")]
    Strip {
        /// Its name.
        name: String,
        /// Its hinges.
        hinge_width_mm: f64,
        /// Its triangles.
        edge_mm: f64,
        /// The reason.
        source: Box<PatternError>,
    },
    /// The stock is too small.
    #[error(
        "the stock has {width_mm:.0} x {height_mm:.0} mm inside its margins, and {FEWEST_STRIPS} strips with their grips, the squares and the card do not fit on it together: use a larger piece (--stock), or finer strips (--edge, --hinge-width)"
    )]
    NoRoom {
        /// Room.
        width_mm: f64,
        /// Room.
        height_mm: f64,
    },
    /// A part that cannot be cut.
    #[error("{job}: {source}")]
    Toolpath {
        /// The job.
        job: &'static str,
        /// The reason.
        source: ToolpathError,
    },
}

/// One of a coupon's jobs: what is cut, and how.
#[derive(Clone, Debug)]
pub struct CouponJob {
    /// `settings`, `kerf` or `strips`: also the name of its file.
    pub name: &'static str,
    /// The parts, each in its place, with its own cuts.
    pub parts: Vec<(Sheet, Toolpath)>,
    /// All of them, with the narrowest hinge for theirs.
    pub sheet: Sheet,
    /// The cuts, in order.
    pub toolpath: Toolpath,
}

/// A coupon ready to be cut.
#[derive(Clone, Debug)]
pub struct CouponPlan {
    /// What is on it.
    pub coupon: Coupon,
    /// In the order in which they are cut.
    pub jobs: Vec<CouponJob>,
    /// The gauge card at the origin, with numbers also where the machine cannot engrave: to be printed.
    pub card: Sheet,
    /// Whether names and marks are engraved; without, marks are holes and the card is printed.
    pub engraved: bool,
    /// What the parts take of the stock, millimetres.
    pub used: Rect,
    /// Strips that were wished for and found no room.
    pub left_out: Vec<Strip>,
}

/// Plans a coupon for a sheet of `material` on `machine`.
///
/// # Errors
/// [`CouponError`].
pub fn coupon(
    machine: &Machine,
    material: &Material,
    wish: &CouponWish,
) -> Result<CouponPlan, CouponError> {
    let setting = material.cut_for(machine)?;
    let shapes = SheetOptions {
        tip: material.tip.map_or(Tip::Plain, Tip::from),
        corner_radius_mm: material.corner_radius_mm.unwrap_or(0.0),
        ..SheetOptions::plain(material.hinge_width_mm, setting.kerf_mm)
    };
    let engraved = material.mark_for(machine).is_some();
    let area = StockArea::of(
        machine,
        wish.stock_mm.or(material.stock_mm.map(|s| [s.x, s.y])),
        setting.kerf_mm,
    );
    let wanted = strips(&shapes, wish)?;
    // Strips are left away from the end until the rest has room on one piece.
    for count in (FEWEST_STRIPS.min(wanted.len())..=wanted.len()).rev() {
        let (on, out) = wanted.split_at(count);
        let parts = Parts::draw(on, &shapes, machine, material, &setting, engraved)?;
        if let Some(placed) = parts.placed(&area) {
            return placed.plan(machine, material, &setting, &shapes, out);
        }
    }
    Err(CouponError::NoRoom {
        width_mm: area.free.width().max(0.0),
        height_mm: area.free.height().max(0.0),
    })
}

/// The strips of a wish, those that say most first: all widths of the finest triangles, then the next edge.
fn strips(shapes: &SheetOptions, wish: &CouponWish) -> Result<Vec<Strip>, CouponError> {
    let neck = neck_mm(
        shapes.hinge_width_mm,
        shapes.kerf_mm,
        shapes.tip.radius_mm(shapes.kerf_mm),
    );
    let or = |given: &[f64], own: Vec<f64>| {
        if given.is_empty() {
            own
        } else {
            given.to_vec()
        }
    };
    let widths = or(
        &wish.hinge_widths_mm,
        WIDTHS
            .iter()
            // A width that a person can read.
            .map(|w| rounded(w * shapes.hinge_width_mm, 2))
            .collect(),
    );
    let edges = or(
        &wish.edges_mm,
        EDGES_IN_NECKS
            .iter()
            .map(|n| (2.0 * n * neck).ceil() / 2.0)
            .collect(),
    );
    for (what, list, low, high) in [
        ("hinge width", &widths, 0.02, 50.0),
        ("edge", &edges, 0.5, 1000.0),
    ] {
        if let Some(&value_mm) = list.iter().find(|v| !(low..=high).contains(*v)) {
            return Err(CouponError::Size {
                what,
                value_mm,
                low,
                high,
            });
        }
    }
    let count = widths.len() * edges.len();
    if count > MOST_STRIPS {
        return Err(CouponError::TooManyStrips {
            widths: widths.len(),
            edges: edges.len(),
            count,
        });
    }
    let mut strips = Vec::with_capacity(count);
    for (letter, edge) in ('A'..='Z').zip(&edges) {
        for (number, width) in widths.iter().enumerate() {
            strips.push(Strip {
                name: format!("{letter}{}", number + 1),
                ..Strip::new(*width, *edge)
            });
        }
    }
    Ok(strips)
}

/// Everything on a coupon, drawn; not yet in its place.
struct Parts {
    coupon: Coupon,
    /// The grid, with the middle of each square; none if the machine's own table sets power and speed.
    settings: Option<Sheet>,
    middles: Vec<Point>,
    kerf: Sheet,
    strips: Vec<Sheet>,
    card: Sheet,
    engraved: bool,
}

impl Parts {
    fn draw(
        strips: &[Strip],
        shapes: &SheetOptions,
        machine: &Machine,
        material: &Material,
        setting: &CutSetting,
        engraved: bool,
    ) -> Result<Self, CouponError> {
        let [powers, speeds] = grid(machine, setting);
        let (settings, squares) =
            setting_plate(&powers, &speeds, square_mm(machine), shapes, engraved);
        let (kerf, kerf_pieces) = kerf_plate(shapes, engraved);
        let sheets = strips.iter().map(|strip| {
            strip
                .sheet(shapes, engraved)
                .and_then(|sheet| sheet.check_ligaments().map(|()| sheet))
                .map_err(|source| CouponError::Strip {
                    name: strip.name.clone(),
                    hinge_width_mm: strip.hinge_width_mm,
                    edge_mm: strip.edge_mm,
                    source: Box::new(source),
                })
        });
        let has_grid = !squares.is_empty();
        let (setting_squares, middles) = squares.into_iter().unzip();
        Ok(Self {
            settings: has_grid.then_some(settings),
            middles,
            kerf,
            strips: sheets.collect::<Result<_, _>>()?,
            card: card(strips, GAUGE_STEP, shapes),
            engraved,
            coupon: Coupon {
                format: FORMAT,
                material: material.name.clone(),
                machine: machine.name.clone(),
                thickness_mm: material.thickness_mm,
                kerf_mm: shapes.kerf_mm,
                tip_radius_mm: (shapes.tip != Tip::Plain)
                    .then(|| shapes.tip.radius_mm(shapes.kerf_mm)),
                gauge_step: GAUGE_STEP,
                strip: strips.to_vec(),
                kerf: kerf_pieces,
                setting: setting_squares,
            },
        })
    }

    /// All parts in their places, if one piece of stock has room for them.
    fn placed(&self, area: &StockArea) -> Option<Placed<'_>> {
        let parts: Vec<Sheet> = self
            .settings
            .iter()
            .chain([&self.kerf])
            .chain(&self.strips)
            .chain(self.engraved.then_some(&self.card))
            .cloned()
            .collect();
        let nested = nest(&parts, area, false).ok()?;
        if nested.iter().any(|n| n.sheet > 0) {
            return None;
        }
        let moved: Vec<Sheet> = nested
            .iter()
            .zip(&parts)
            .map(|(n, part)| n.motion.sheet(part))
            .collect();
        let middles = self.middles.iter().map(|p| {
            nested
                .first()
                .map_or(*p, |n| Point::from(n.motion.apply(p.x, p.y)))
        });
        let used = moved.iter().map(Sheet::bounds).reduce(|a, b| a.union(b))?;
        Some(Placed {
            parts: self,
            middles: middles.collect(),
            moved,
            used,
        })
    }
}

/// Parts in their places, in the order of the jobs.
struct Placed<'a> {
    parts: &'a Parts,
    middles: Vec<Point>,
    moved: Vec<Sheet>,
    used: Rect,
}

impl Placed<'_> {
    fn plan(
        self,
        machine: &Machine,
        material: &Material,
        setting: &CutSetting,
        shapes: &SheetOptions,
        left_out: &[Strip],
    ) -> Result<CouponPlan, CouponError> {
        let marks = material.mark_for(machine);
        let options = CutOptions::of(setting, machine, marks.as_ref());
        let job = |name: &'static str, parts: Vec<Sheet>| -> Result<CouponJob, CouponError> {
            let failed = |source| CouponError::Toolpath { job: name, source };
            let sheet = merged(&parts, shapes);
            let parts = planned(parts, &options, machine.park_mm()).map_err(failed)?;
            let toolpaths = parts.iter().map(|part| part.1.clone());
            Ok(CouponJob {
                // No job is without parts.
                toolpath: together(toolpaths).map_or_else(
                    || plan(&sheet, &options, machine.park_mm()).map_err(failed),
                    Ok,
                )?,
                sheet,
                name,
                parts,
            })
        };
        let mut moved = self.moved.into_iter();
        let mut jobs = Vec::with_capacity(3);
        if self.parts.settings.is_some() {
            let mut settings = job("settings", moved.by_ref().take(1).collect())?;
            set_squares(&mut settings.toolpath, &self.middles, &self.parts.coupon);
            jobs.push(settings);
        }
        jobs.push(job("kerf", moved.by_ref().take(1).collect())?);
        jobs.push(job("strips", moved.collect())?);
        Ok(CouponPlan {
            coupon: self.parts.coupon.clone(),
            jobs,
            card: self.parts.card.clone(),
            engraved: self.parts.engraved,
            used: self.used,
            left_out: left_out.to_vec(),
        })
    }
}

/// Powers and speeds of the grid; none where the table's own list of materials sets them.
fn grid(machine: &Machine, setting: &CutSetting) -> [Vec<f64>; 2] {
    // QtPlasmaC takes the speed from the material that is chosen on its panel, one for the whole job.
    let of_table = machine
        .plasma()
        .is_some_and(|torch| torch.height_control == HeightControl::QtPlasmaC);
    if of_table {
        return [Vec::new(), Vec::new()];
    }
    // A torch's current is not the job's to set.
    let powers = match machine.plasma() {
        Some(_) => vec![setting.power_percent],
        None => within(&POWERS, setting.power_percent, 100.0),
    };
    let rates = machine.motion.rate_mm_per_min;
    let fastest = rates.x.min(rates.y);
    [powers, within(&SPEEDS, setting.speed_mm_per_min, fastest)]
}

/// Multiples of a value, in whole numbers where these are two digits or more, none above a limit, none twice.
fn within(factors: &[f64], value: f64, most: f64) -> Vec<f64> {
    let mut list: Vec<f64> = factors
        .iter()
        .map(|f| {
            let v = f * value;
            let digit = 10f64.powf(v.log10().floor() - 1.0).min(1.0);
            ((v / digit).round() * digit).min(most)
        })
        .collect();
    list.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    list
}

/// Side of a square of the grid, millimetres: such that a torch does not take it for a small hole.
fn square_mm(machine: &Machine) -> f64 {
    const LASER_MM: f64 = 8.0;
    const PLASMA_MM: f64 = 30.0;
    let small = machine
        .plasma()
        .and_then(|torch| torch.small_hole)
        .map_or(0.0, |hole| hole.below_mm);
    match machine.plasma() {
        Some(_) => PLASMA_MM.max(0.75 * small),
        None => LASER_MM,
    }
}

/// The parts as one sheet. Each has its own hinges; the narrowest of them holds for all.
fn merged(parts: &[Sheet], shapes: &SheetOptions) -> Sheet {
    let narrowest = parts
        .iter()
        .filter(|p| !p.slits.is_empty())
        .map(|p| p.metadata)
        .min_by(|a, b| a.hinge_width_mm.total_cmp(&b.hinge_width_mm));
    let mut sheet = Sheet::together(parts.iter().cloned());
    sheet.metadata = narrowest.unwrap_or_else(|| {
        parts
            .first()
            .map_or_else(|| shapes.metadata(1.0), |p| p.metadata)
    });
    sheet
}

/// Every part with its cuts, each planned with its own hinges for a head that comes from the part before.
fn planned(
    parts: Vec<Sheet>,
    options: &CutOptions,
    start: [f64; 2],
) -> Result<Vec<(Sheet, Toolpath)>, ToolpathError> {
    let mut at = start;
    let one = |part: Sheet| {
        let toolpath = plan(&part, options, at)?;
        if let Some(end) = toolpath.cuts.last().and_then(Cut::end) {
            at = [end.x, end.y];
        }
        Ok((part, toolpath))
    };
    parts.into_iter().map(one).collect()
}

/// The cuts of all parts: marks of all before slits of all, rims last.
fn together(parts: impl Iterator<Item = Toolpath>) -> Option<Toolpath> {
    let mut whole = parts.reduce(|mut all, part| {
        all.cuts.extend(part.cuts);
        all
    })?;
    // Stable: within a role part after part.
    whole.cuts.sort_by_key(|cut| cut.role);
    Some(whole)
}

/// Gives every square of the grid its power and speed.
fn set_squares(toolpath: &mut Toolpath, middles: &[Point], coupon: &Coupon) {
    for cut in &mut toolpath.cuts {
        if cut.role != Role::Inner {
            continue;
        }
        let Some(bounds) = cut.line.bounds() else {
            continue;
        };
        let square = middles
            .iter()
            .position(|middle| bounds.contains(*middle))
            .and_then(|n| coupon.setting.get(n));
        if let Some(square) = square {
            cut.power_percent = square.power_percent;
            cut.feed_mm_per_min = square.speed_mm_per_min;
        }
    }
}
