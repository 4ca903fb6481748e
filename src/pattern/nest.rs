//! Parts on stock: each turned and shifted so that many fit on few sheets.
//!
//! Parts are laid one after the other, the largest first, at the lowest place where they touch nothing, then farthest to
//! the left; on the first sheet that has room, else on a new one. They are tried in a few directions. Whether two touch
//! is seen on a grid of cells, each part grown by half the gap that must stay between two: exact to a cell, and always
//! on the safe side.

use kurbo::{Point, Rect};

use super::place::Motion;
use super::sheet::{PatternError, Sheet, Slit};
use crate::base::plane;
use crate::machine::Machine;

/// Cells along the longer side of the stock.
const CELLS: f64 = 400.0;

/// Directions in which a part is tried, in turn, degrees. The first four leave it in its own shape's grain.
const TURNS_DEG: [f64; 12] = [
    0.0, 90.0, 180.0, 270.0, 30.0, 120.0, 60.0, 150.0, 15.0, 105.0, 45.0, 135.0,
];

/// The free rectangle of a stock sheet and what must stay between two parts, millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StockArea {
    /// Where cuts may be.
    pub free: Rect,
    /// Between the finished edges of two parts.
    pub gap_mm: f64,
}

/// Between two parts on one sheet, millimetres, besides four kerfs: room for leads, and for a person's fingers.
const GAP_MM: f64 = 2.0;

impl StockArea {
    /// The bed inside its margins, or the piece of stock in its corner (width and height, millimetres), for this kerf.
    pub fn of(machine: &Machine, stock_mm: Option<[f64; 2]>, kerf_mm: f64) -> Self {
        let reach = machine.reach();
        let margin = machine.bed.margin_mm;
        let mut free = Rect::new(
            reach.min[0] + margin,
            reach.min[1] + margin,
            reach.max[0] - margin,
            reach.max[1] - margin,
        );
        if let Some([width, height]) = stock_mm {
            free.x1 = free.x1.min(reach.min[0] + width - margin);
            free.y1 = free.y1.min(reach.min[1] + height - margin);
        }
        Self {
            free,
            gap_mm: GAP_MM + 4.0 * kerf_mm,
        }
    }
}

/// Where one part goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nested {
    /// Which stock sheet, from 0.
    pub sheet: usize,
    /// How the part gets there.
    pub motion: Motion,
}

/// Points of a triangle of which a smooth rim, which leaves two corners, leaves one.
fn kept_points(triangle: &[Point; 3]) -> [Point; 4] {
    let middle = plane::centroid(triangle);
    let towards = |k: usize| middle.lerp(triangle[k], 0.5);
    [middle, towards(0), towards(1), towards(2)]
}

impl Sheet {
    /// One sheet for each part, a rim with all that is inside it; and for each triangle the number of its part.
    pub fn parts(&self) -> (Vec<Sheet>, Vec<usize>) {
        let rims: Vec<usize> = (0..self.contours.len())
            .filter(|c| self.contours[*c].outer)
            .collect();
        if rims.len() < 2 {
            return (vec![self.clone()], vec![0; self.triangles.len()]);
        }
        let outlines: Vec<(Rect, Vec<Point>)> = rims
            .iter()
            .map(|c| {
                let line = &self.contours[*c].line;
                (line.bounds().unwrap_or(Rect::ZERO), line.flattened(0.05))
            })
            .collect();
        // The part of a point that lies inside one; on a rim the nearest.
        let around = |p: Point| {
            (0..outlines.len()).find(|n| {
                let (bounds, points) = &outlines[*n];
                bounds.contains(p) && plane::encloses(points, p)
            })
        };
        let part_of = |p: Point| -> usize {
            around(p).unwrap_or_else(|| {
                let away = |n: &usize| {
                    let b = outlines[*n].0;
                    let q = Point::new(p.x.clamp(b.x0, b.x1), p.y.clamp(b.y0, b.y1));
                    q.distance(p)
                };
                (0..outlines.len())
                    .min_by(|a, b| away(a).total_cmp(&away(b)))
                    .unwrap_or(0)
            })
        };
        let part_of_triangle = |t: &[Point; 3]| {
            let hit = kept_points(t).into_iter().find_map(around);
            hit.unwrap_or_else(|| part_of(plane::centroid(t)))
        };
        let mut parts: Vec<Sheet> = rims
            .iter()
            .map(|c| Sheet {
                slits: Vec::new(),
                contours: vec![self.contours[*c].clone()],
                triangles: Vec::new(),
                flaps: Vec::new(),
                marks: Vec::new(),
                tabs: Vec::new(),
                metadata: self.metadata,
            })
            .collect();
        for slit in &self.slits {
            // Tails and tips may lie on a rim; the middle never does.
            parts[part_of(slit.tail.midpoint(slit.tip))]
                .slits
                .push(*slit);
        }
        for hole in self.contours.iter().filter(|c| !c.outer) {
            let inside = hole.line.start().map_or(0, part_of);
            parts[inside].contours.push(hole.clone());
        }
        let mut numbers = Vec::with_capacity(self.triangles.len());
        for triangle in &self.triangles {
            let part = part_of_triangle(triangle);
            parts[part].triangles.push(*triangle);
            numbers.push(part);
        }
        for flap in &self.flaps {
            parts[part_of_triangle(flap)].flaps.push(*flap);
        }
        for mark in &self.marks {
            let at = mark.strokes().first().and_then(|l| l.start());
            parts[at.map_or(0, part_of)].marks.push(mark.clone());
        }
        for tab in &self.tabs {
            parts[part_of(tab.at)].tabs.push(*tab);
        }
        for part in &mut parts {
            let mut number = 0;
            let mut last = None;
            for slit in &mut part.slits {
                if last.is_some_and(|l| l != slit.star) {
                    number += 1;
                }
                last = Some(slit.star);
                slit.star = number;
            }
        }
        (parts, numbers)
    }

    /// Several sheets that lie apart in one frame, as one: the first one's widths hold for all.
    ///
    /// Without any there is nothing to cut: an empty sheet with the widths of none.
    pub fn together(sheets: impl IntoIterator<Item = Sheet>) -> Sheet {
        let mut sheets = sheets.into_iter();
        let Some(mut all) = sheets.next() else {
            return Sheet::empty();
        };
        for sheet in sheets {
            let stars = all.slits.last().map_or(0, |s| s.star + 1);
            all.slits.extend(sheet.slits.into_iter().map(|s| Slit {
                star: s.star + stars,
                ..s
            }));
            all.contours.extend(sheet.contours);
            all.triangles.extend(sheet.triangles);
            all.flaps.extend(sheet.flaps);
            all.marks.extend(sheet.marks);
            all.tabs.extend(sheet.tabs);
        }
        all
    }
}

/// Whether points, with `around_mm` on every side, have room on an empty stock sheet in one of the directions that
/// [`nest`] tries.
pub fn fits_stock(points: &[Point], around_mm: f64, stock: &StockArea) -> bool {
    // The nest's cells and its gap cost as much.
    let cell_mm = stock.free.width().max(stock.free.height()) / CELLS;
    let around = around_mm + 0.5 * stock.gap_mm + 2.0 * cell_mm;
    TURNS_DEG.iter().any(|turn| {
        let motion = Motion::turned(false, turn.to_radians());
        let mut moved = points.iter().map(|p| Point::from(motion.apply(p.x, p.y)));
        let Some(first) = moved.next() else {
            return true;
        };
        let b = moved
            .fold(Rect::from_points(first, first), |r, p| r.union_pt(p))
            .inflate(around, around);
        b.width() <= stock.free.width() && b.height() <= stock.free.height()
    })
}

/// Cells of a rectangle, one bit each, row by row.
#[derive(Clone)]
struct Mask {
    columns: usize,
    rows: usize,
    words: usize,
    bits: Vec<u64>,
}

impl Mask {
    fn new(columns: usize, rows: usize) -> Self {
        let words = columns.div_ceil(64);
        Self {
            columns,
            rows,
            words,
            bits: vec![0; words * rows],
        }
    }

    fn fill(&mut self, row: usize, from: usize, to: usize) {
        for c in from..to.min(self.columns) {
            self.bits[row * self.words + c / 64] |= 1 << (c % 64);
        }
    }

    /// Whether `part` shifted by columns and rows has a cell in common with this one.
    fn meets(&self, part: &Self, column: usize, row: usize) -> bool {
        let (skip, shift) = (column / 64, column % 64);
        (0..part.rows).any(|r| {
            let here = &self.bits[(row + r) * self.words..(row + r + 1) * self.words];
            let there = &part.bits[r * part.words..(r + 1) * part.words];
            there.iter().enumerate().any(|(w, &bits)| {
                let low = bits << shift;
                let high = if shift == 0 { 0 } else { bits >> (64 - shift) };
                (low != 0 && here.get(skip + w).is_some_and(|h| h & low != 0))
                    || (high != 0 && here.get(skip + w + 1).is_some_and(|h| h & high != 0))
            })
        })
    }

    fn add(&mut self, part: &Self, column: usize, row: usize) {
        for r in 0..part.rows {
            for c in 0..part.columns {
                if part.bits[r * part.words + c / 64] >> (c % 64) & 1 == 1 {
                    self.fill(row + r, column + c, column + c + 1);
                }
            }
        }
    }

    /// The cells that a closed line encloses or touches, grown by `grow_mm`; the line's box begins at the first cell's
    /// corner when grown.
    fn of(
        points: &[Point],
        corner: Point,
        cell_mm: f64,
        grow_mm: f64,
        size: (usize, usize),
    ) -> Self {
        let mut mask = Self::new(size.0, size.1);
        let n = points.len();
        let column = |x: f64| ((x - corner.x) / cell_mm).floor().max(0.0) as usize;
        for row in 0..size.1 {
            let y0 = corner.y + row as f64 * cell_mm - grow_mm;
            let y1 = y0 + cell_mm + 2.0 * grow_mm;
            // What edges touch in the band of this row.
            for i in 0..n {
                let (a, b) = (points[i], points[(i + 1) % n]);
                let (low, high) = (a.y.min(b.y), a.y.max(b.y));
                if high < y0 || low > y1 {
                    continue;
                }
                let at = |y: f64| {
                    if high > low {
                        a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0)
                    } else {
                        a.x
                    }
                };
                let (p, q) = if high > low {
                    (at(y0.max(low)), at(y1.min(high)))
                } else {
                    (a.x, b.x)
                };
                mask.fill(
                    row,
                    column(p.min(q) - grow_mm),
                    column(p.max(q) + grow_mm) + 1,
                );
            }
            // And what lies between them, seen along the row's middle.
            let y = 0.5 * (y0 + y1);
            let mut xs: Vec<f64> = (0..n)
                .filter_map(|i| {
                    let (a, b) = (points[i], points[(i + 1) % n]);
                    ((a.y > y) != (b.y > y)).then(|| a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x))
                })
                .collect();
            xs.sort_by(f64::total_cmp);
            for pair in xs.chunks_exact(2) {
                mask.fill(row, column(pair[0]), column(pair[1]) + 1);
            }
        }
        mask
    }
}

/// Lays parts on as few stock sheets as this simple way finds.
///
/// # Errors
/// [`PatternError::TooLarge`] for a part that fits on an empty sheet in no direction that is tried.
pub fn nest(parts: &[Sheet], stock: &StockArea, mirror: bool) -> Result<Vec<Nested>, PatternError> {
    let (width, height) = (stock.free.width(), stock.free.height());
    if !(width > 0.0 && height > 0.0) {
        let part = parts.first().map_or_else(Sheet::empty, Sheet::clone);
        return Err(too_large(&part, width.max(0.0), height.max(0.0)));
    }
    let cell_mm = width.max(height) / CELLS;
    let (columns, rows) = (
        (width / cell_mm).floor() as usize,
        (height / cell_mm).floor() as usize,
    );
    let mut order: Vec<usize> = (0..parts.len()).collect();
    let size = |n: &usize| parts[*n].bounds().area();
    order.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.cmp(b)));
    let mut sheets: Vec<Mask> = Vec::new();
    let mut found: Vec<Option<Nested>> = vec![None; parts.len()];
    for n in order {
        let part = &parts[n];
        let shapes: Vec<_> = TURNS_DEG
            .iter()
            .filter_map(|turn| {
                let motion = Motion::turned(mirror, turn.to_radians());
                let points: Vec<Point> = part
                    .contours
                    .iter()
                    .find(|c| c.outer)?
                    .line
                    .flattened(0.05)
                    .into_iter()
                    .map(|p| Point::from(motion.apply(p.x, p.y)))
                    .collect();
                // Half the gap all round, and the kerf's burn is inside it.
                let grow = 0.5 * stock.gap_mm;
                let first = *points.first()?;
                let bounds = points
                    .iter()
                    .fold(Rect::from_points(first, first), |r, p| r.union_pt(*p))
                    .inflate(grow, grow);
                let size = (
                    (bounds.width() / cell_mm).ceil() as usize + 1,
                    (bounds.height() / cell_mm).ceil() as usize + 1,
                );
                (size.0 <= columns && size.1 <= rows).then(|| {
                    let corner = bounds.origin();
                    (
                        motion,
                        corner,
                        Mask::of(&points, corner, cell_mm, grow, size),
                    )
                })
            })
            .collect();
        let put = |sheets: &[Mask]| {
            for (s, sheet) in sheets.iter().enumerate() {
                let mut best: Option<(usize, usize, usize)> = None;
                for (k, (_, _, mask)) in shapes.iter().enumerate() {
                    'place: for row in 0..=rows - mask.rows {
                        if best.is_some_and(|(r, ..)| row + mask.rows > r) {
                            break;
                        }
                        for column in 0..=columns - mask.columns {
                            if !sheet.meets(mask, column, row) {
                                best = Some((row + mask.rows, column, k));
                                break 'place;
                            }
                        }
                    }
                }
                if let Some((top, column, k)) = best {
                    return Some((s, top - shapes[k].2.rows, column, k));
                }
            }
            None
        };
        let (s, row, column, k) = match put(&sheets) {
            Some(place) => place,
            None => {
                sheets.push(Mask::new(columns, rows));
                let last = sheets.len() - 1;
                match put(&sheets[last..]) {
                    Some((_, row, column, k)) => (last, row, column, k),
                    None => return Err(too_large(part, width, height)),
                }
            }
        };
        let (motion, corner, mask) = &shapes[k];
        sheets[s].add(mask, column, row);
        let mut motion = *motion;
        motion.shift_mm = [
            stock.free.x0 + column as f64 * cell_mm - corner.x,
            stock.free.y0 + row as f64 * cell_mm - corner.y,
        ];
        found[n] = Some(Nested { sheet: s, motion });
    }
    Ok(found.into_iter().flatten().collect())
}

fn too_large(part: &Sheet, width: f64, height: f64) -> PatternError {
    let b = part.bounds();
    let scale = (width / b.width()).min(height / b.height());
    let turned = (width / b.height()).min(height / b.width());
    let scale = (scale.max(turned) * 0.98 * 1e4).floor() / 1e4;
    PatternError::TooLarge {
        width_mm: b.width(),
        height_mm: b.height(),
        bed_width_mm: width,
        bed_height_mm: height,
        fitting_edge_mm: (part.metadata.edge_mm * scale * 1e3).floor() / 1e3,
        fitting_scale: scale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage};
    use crate::pattern::SheetOptions;

    fn hexagon(radius: i32) -> Sheet {
        let linkage = Linkage::patch(10.0, Handedness::Right, &Linkage::hexagon_cells(radius));
        Sheet::new(&linkage, &SheetOptions::plain(1.0, 0.2)).unwrap()
    }

    #[test]
    fn parts_lie_apart_inside_the_stock_and_small_ones_share_a_sheet() {
        let parts: Vec<Sheet> = [3, 1, 2, 1, 3, 1, 2].map(hexagon).to_vec();
        let stock = StockArea {
            free: Rect::new(5.0, 10.0, 135.0, 110.0),
            gap_mm: 2.0,
        };
        for mirror in [false, true] {
            let nested = nest(&parts, &stock, mirror).unwrap();
            assert_eq!(nested.len(), parts.len());
            let placed: Vec<(usize, Sheet)> = nested
                .iter()
                .zip(&parts)
                .map(|(n, p)| (n.sheet, n.motion.sheet(p)))
                .collect();
            let sheets = nested.iter().map(|n| n.sheet).max().unwrap() + 1;
            // Area of all hexagons over that of the stock, and no sheet without use.
            assert!(sheets <= 3, "{sheets}");
            for (i, (sheet, a)) in placed.iter().enumerate() {
                let b = a.bounds();
                assert!(b.x0 > 5.0 && b.y0 > 10.0 && b.x1 < 135.0 && b.y1 < 110.0);
                for (_, other) in placed[..i].iter().filter(|(s, _)| s == sheet) {
                    let points = |s: &Sheet| s.contours[0].line.flattened(0.1);
                    for p in points(a) {
                        for q in points(other) {
                            assert!(p.distance(q) >= 2.0 - 1e-9);
                        }
                        assert!(!plane::encloses(&points(other), p), "one lies on the other");
                    }
                }
            }
        }
        assert!(matches!(
            nest(&[hexagon(9)], &stock, false),
            Err(PatternError::TooLarge { .. })
        ));
    }
}
