//! Scrap: the places of a sheet where a lead may burn and a pierce may be, as nothing that stays is near.

use std::collections::HashMap;

use kurbo::Point;

use super::compare::Wanted;
use super::coverage::{Index, Segment, distance};
use super::finding::TOLERANCE_MM;
use crate::base::plane;
use crate::pattern::Sheet;

/// Everything outside what stays: where leads may burn.
pub(super) struct Outside<'a> {
    edges: Index,
    /// The same edges by height, for counting crossings.
    rows: HashMap<i64, Vec<u32>>,
    row_mm: f64,
    wanted: &'a Index,
    half_mm: f64,
}

impl<'a> Outside<'a> {
    pub fn new(sheet: &Sheet, wanted: &'a Wanted) -> Self {
        let mut edges = Vec::new();
        for contour in &sheet.contours {
            let points = contour.line.flattened(0.0005);
            let n = points.len();
            edges.extend((0..n).map(|i| Segment {
                a: points[i],
                b: points[(i + 1) % n],
            }));
        }
        let row_mm = sheet.metadata.edge_mm;
        let mut rows: HashMap<i64, Vec<u32>> = HashMap::new();
        for (n, e) in edges.iter().enumerate() {
            let (low, high) = (e.a.y.min(e.b.y), e.a.y.max(e.b.y));
            for row in (low / row_mm).floor() as i64..=(high / row_mm).floor() as i64 {
                rows.entry(row).or_default().push(n as u32);
            }
        }
        Self {
            edges: Index::new(edges),
            rows,
            row_mm,
            wanted: &wanted.index,
            half_mm: 0.5 * sheet.metadata.kerf_mm,
        }
    }

    /// Whether a burnt piece touches nothing that stays but what is burnt anyway: the last half kerf before the line
    /// that it leads to.
    pub fn is_scrap(&self, piece: &Segment) -> bool {
        let mut near = Vec::new();
        let reach = self.half_mm - TOLERANCE_MM;
        // Steps of a tenth of a kerf: no edge comes nearer than the tolerance between two of them.
        let steps = (piece.length() / (0.2 * self.half_mm))
            .ceil()
            .clamp(1.0, 100_000.0) as usize;
        (0..=steps).all(|k| {
            let p = piece.a.lerp(piece.b, k as f64 / steps as f64);
            let spot = Segment { a: p, b: p };
            self.wanted.near(&spot, self.half_mm, &mut near);
            let burnt_anyway = near
                .iter()
                .any(|n| distance(&spot, &self.wanted.segment(*n)) <= self.half_mm);
            if burnt_anyway {
                return true;
            }
            self.edges.near(&spot, self.half_mm, &mut near);
            let clear = near
                .iter()
                .all(|n| distance(&spot, &self.edges.segment(*n)) >= reach);
            clear && !self.inside(p)
        })
    }

    /// Distance from a point to what stays, up to `limit`; 0 inside it.
    pub fn clearance(&self, p: Point, limit: f64) -> f64 {
        if self.inside(p) {
            return 0.0;
        }
        let mut near = Vec::new();
        let spot = Segment { a: p, b: p };
        self.edges.near(&spot, limit, &mut near);
        near.iter()
            .map(|n| distance(&spot, &self.edges.segment(*n)))
            .fold(f64::INFINITY, f64::min)
    }

    fn inside(&self, p: Point) -> bool {
        let row = (p.y / self.row_mm).floor() as i64;
        let crossed = self.rows.get(&row).into_iter().flatten().filter(|n| {
            let e = self.edges.segment(**n);
            plane::crosses(e.a, e.b, p)
        });
        crossed.count() % 2 == 1
    }
}
