//! From a linkage to the sheets that are cut: drawn, turned to fit, divided where they do not, and laid on the stock.

use kurbo::Point;
use nalgebra::Point2;

use super::MakeError;
use super::make::title;
use super::request::{FlapWish, Request};
use super::shape::Stock;
use crate::linkage::{Built, Flaps, TriangleId};
use crate::pattern::{self, MarkOptions, Motion, Nested, PatternError, Sheet, StockArea};

/// Where a linkage lies on its sheets.
pub(crate) struct Sheets {
    /// In the order of the jobs, each in its place on the bed. None if triangles lie on one another.
    pub sheets: Vec<Sheet>,
    /// The linkage, with the flat positions that its parts have before they are placed.
    pub built: Built,
    /// Doubled rows as they are cut.
    pub flaps: Flaps,
    /// Flaps were left away because the sheet fits without them only.
    pub flaps_too_large: bool,
    /// The sheet was divided because it was too large.
    pub divided: bool,
    /// How the parts get to their places, and which part each triangle belongs to; one motion if all move as one.
    placing: Placing,
}

enum Placing {
    None,
    One(Motion),
    Parts {
        nested: Vec<Nested>,
        part_of: Vec<usize>,
        /// Between one sheet and the next in the common frame, millimetres.
        apart_mm: f64,
    },
}

impl Sheets {
    /// Draws the sheet of `built`, and finds places for it.
    pub fn lay(built: Built, request: &Request, stock: &Stock<'_>) -> Result<Self, MakeError> {
        let mut this = Self {
            sheets: Vec::new(),
            flaps: match request.flaps {
                FlapWish::Auto => built.flaps.clone(),
                FlapWish::None => built.flaps.none(),
            },
            built,
            flaps_too_large: false,
            divided: false,
            placing: Placing::None,
        };
        if !this.built.overlaps.is_empty() {
            return Ok(this);
        }
        let whole = draw(&this.built, &this.flaps, request, stock)?;
        let area = stock.area();
        match pattern::placed_on(&whole, area.free, request.mirror) {
            Ok((sheet, motion)) => {
                this.sheets = vec![sheet];
                this.placing = Placing::One(motion);
            }
            Err(too_large @ PatternError::TooLarge { .. }) => {
                this.nest(whole, too_large, request, stock, &area)?;
            }
            Err(other) => return Err(MakeError::Pattern(other)),
        }
        for sheet in &mut this.sheets {
            sheet.tabs = sheet
                .tabs_for(stock.tabs, stock.tab_width_mm)
                .map_err(MakeError::Pattern)?;
        }
        Ok(this)
    }

    /// The sheet is too large: its parts one by one, without flaps if that is all it takes, else divided.
    fn nest(
        &mut self,
        whole: Sheet,
        too_large: PatternError,
        request: &Request,
        stock: &Stock<'_>,
        area: &StockArea,
    ) -> Result<(), MakeError> {
        if self.put(&whole, request, area).is_ok() {
            return Ok(());
        }
        if !self.flaps.flaps.is_empty() {
            let without = self.flaps.none();
            let bare = draw(&self.built, &without, request, stock)?;
            if let Ok((sheet, motion)) = pattern::placed_on(&bare, area.free, request.mirror) {
                self.sheets = vec![sheet];
                self.placing = Placing::One(motion);
                (self.flaps, self.flaps_too_large) = (without, true);
                return Ok(());
            }
        }
        if !stock.divide {
            return Err(MakeError::Pattern(too_large));
        }
        // A doubled row adds less than an edge's length on each side.
        let edge = self.built.linkage.edge_mm;
        let fits = |corners: &[Point2<f64>]| {
            let points: Vec<Point> = corners.iter().map(|p| Point::new(p.x, p.y)).collect();
            pattern::fits_stock(&points, edge, area)
        };
        let Some(divided) = self.built.divided(&fits) else {
            return Err(MakeError::Pattern(too_large));
        };
        self.built = divided;
        self.divided = true;
        self.flaps = match request.flaps {
            FlapWish::Auto => self.built.flaps.clone(),
            FlapWish::None => self.built.flaps.none(),
        };
        let whole = draw(&self.built, &self.flaps, request, stock)?;
        self.put(&whole, request, area).map_err(MakeError::Pattern)
    }

    /// Lays every part of a sheet on stock.
    fn put(
        &mut self,
        whole: &Sheet,
        request: &Request,
        area: &StockArea,
    ) -> Result<(), PatternError> {
        let (parts, part_of) = whole.parts();
        let nested = pattern::nest(&parts, area, request.mirror)?;
        let count = nested.iter().map(|n| n.sheet + 1).max().unwrap_or(0);
        self.sheets = (0..count)
            .map(|s| {
                let on = nested.iter().zip(&parts).filter(|(n, _)| n.sheet == s);
                Sheet::together(on.map(|(n, part)| n.motion.sheet(part)))
            })
            .collect();
        self.placing = Placing::Parts {
            nested,
            part_of,
            apart_mm: 1.1 * area.free.width().max(area.free.height()),
        };
        Ok(())
    }

    /// Whether all triangles lie on one sheet, moved as one.
    pub fn motion(&self) -> Option<&Motion> {
        match &self.placing {
            Placing::One(motion) => Some(motion),
            _ => None,
        }
    }

    /// Where a point of a triangle comes to lie, in one frame for all sheets: each stands to the right of the one before
    /// it, so that nothing lies on anything else.
    pub fn place(&self, triangle: TriangleId, p: Point2<f64>) -> Point2<f64> {
        let (motion, right_mm) = match &self.placing {
            Placing::None => return p,
            Placing::One(motion) => (motion, 0.0),
            Placing::Parts {
                nested,
                part_of,
                apart_mm,
            } => {
                let part = part_of.get(triangle.0 as usize).copied().unwrap_or(0);
                let Some(n) = nested.get(part) else { return p };
                (&n.motion, n.sheet as f64 * apart_mm)
            }
        };
        let (x, y) = motion.apply(p.x, p.y);
        Point2::new(x + right_mm, y)
    }
}

fn draw(
    built: &Built,
    flaps: &Flaps,
    request: &Request,
    stock: &Stock<'_>,
) -> Result<Sheet, MakeError> {
    let mut sheet =
        Sheet::with_flaps(&built.linkage, flaps, &stock.options).map_err(MakeError::Pattern)?;
    // Of a sample without its parameters.
    let name = title(&request.source);
    let told = MarkOptions {
        name: name.split(':').next().unwrap_or(""),
        back: request.mirror,
    };
    sheet.marks = pattern::marks(&built.linkage, &sheet, &told);
    Ok(sheet)
}

impl Stock<'_> {
    /// Where parts may lie.
    pub fn area(&self) -> StockArea {
        StockArea::of(self.machine, self.stock_mm, self.options.kerf_mm)
    }
}
