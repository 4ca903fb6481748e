//! Divides a sheet that is too large along straight lattice lines, so that every piece fits.
//!
//! A line of the lattice is a line of slits already: cut through, its two sides are new seams, straight ones, and get
//! doubled rows like every other. Each piece that is too large is cut again by the line that cuts fewest edges among
//! those that leave neither side much smaller than the other. In space nothing changes: the linkage keeps its triangles
//! and hinges, only their places on the sheet do.

use std::collections::BTreeMap;

use nalgebra::Point2;

use super::flaps;
use super::lattice::Lattice;
use super::net::{Net, Spot};
use super::pieces::{joined, seam_edges};
use super::types::{Cell, Linkage};
use super::{Built, Flaps};

/// The smaller side of a cut has at least this part of the triangles, where any line allows it.
const LEAST_SHARE: f64 = 0.3;

/// Price of a piece more than two, in edges of the cut: a piece of its own has to be handled and joined.
const PIECE_PRICE: usize = 12;

/// Lines of fewest edges that are looked at more closely.
const CANDIDATES: usize = 24;

/// Lattice columns left free between two pieces: for a doubled row on each and a gap.
const GAP: i32 = 5;

/// More pieces than this are no sheet that anybody would glue.
const MOST_PIECES: usize = 200;

impl Built {
    /// The same linkage with its sheet divided until `fits` says yes to every piece: it gets the corners of a piece's
    /// triangles, without doubled rows. `None` if a single triangle does not fit, or hundreds of pieces would come of
    /// it.
    pub fn divided(&self, fits: &dyn Fn(&[Point2<f64>]) -> bool) -> Option<Built> {
        let edge_mm = self.linkage.edge_mm;
        let first = self.linkage.triangles.iter().next()?;
        let side = first.flat[1] - first.flat[0];
        let lattice = Lattice::new(edge_mm, side.y.atan2(side.x));
        let mut spots: Vec<[Spot; 3]> = self
            .linkage
            .triangles
            .iter()
            .map(|t| {
                t.flat.map(|p| {
                    let (i, j) = lattice.coordinates(p);
                    (i.round() as i32, j.round() as i32)
                })
            })
            .collect();
        let net = Net::new(&self.laid);
        let mut waiting = components(&net, &spots, (0..spots.len()).collect());
        let mut done: Vec<Vec<usize>> = Vec::new();
        let place = |(i, j): Spot| lattice.point(f64::from(i), f64::from(j));
        while let Some(piece) = waiting.pop() {
            let corners: Vec<Point2<f64>> =
                piece.iter().flat_map(|t| spots[*t].map(place)).collect();
            if fits(&corners) {
                done.push(piece);
                continue;
            }
            if piece.len() < 2 || done.len() + waiting.len() >= MOST_PIECES {
                return None;
            }
            waiting.extend(cut(&net, &spots, &piece)?);
        }
        // Largest first, then in the order of their triangles.
        done.iter_mut().for_each(|piece| piece.sort_unstable());
        done.sort_by_key(|piece| (std::cmp::Reverse(piece.len()), piece[0]));
        let mut next = 0;
        for piece in &done {
            let columns = || piece.iter().flat_map(|t| spots[*t]).map(|s| s.0);
            let (low, high) = (columns().min().unwrap_or(0), columns().max().unwrap_or(0));
            let shift = next - low;
            next += high - low + GAP;
            for &t in piece {
                spots[t] = spots[t].map(|(i, j)| (i + shift, j));
            }
        }
        let cells: Vec<Cell> = self
            .laid
            .iter()
            .zip(&spots)
            .map(|(laid, spots)| Cell {
                colour: laid.colour,
                flat: spots.map(place),
                neighbours: laid.neighbours,
                trim: laid.trim.clone(),
            })
            .collect();
        let seam_edges = seam_edges(&net, &spots);
        let flaps: Flaps = flaps::rows(&net, &spots, &self.laid, &lattice);
        Some(Built {
            linkage: Linkage::assemble(edge_mm, self.linkage.handedness, &cells),
            pieces: done.len(),
            seam_edges,
            flaps,
            slots: Vec::new(),
            ..self.clone()
        })
    }
}

/// The pieces in which some triangles hang together on the sheet.
fn components(net: &Net, spots: &[[Spot; 3]], of: Vec<usize>) -> Vec<Vec<usize>> {
    let mut free: BTreeMap<usize, ()> = of.into_iter().map(|t| (t, ())).collect();
    let mut found = Vec::new();
    while let Some((first, ())) = free.pop_first() {
        let mut piece = vec![first];
        let mut at = 0;
        while at < piece.len() {
            let t = piece[at];
            at += 1;
            for side in 3 * t..3 * t + 3 {
                if let Some(twin) = net.twin[side]
                    && net.held[side]
                    && joined(spots, side, twin)
                    && free.remove(&(twin / 3)).is_some()
                {
                    piece.push(twin / 3);
                }
            }
        }
        found.push(piece);
    }
    found
}

/// Cuts a piece along the best lattice line; none if it has no line inside.
fn cut(net: &Net, spots: &[[Spot; 3]], piece: &[usize]) -> Option<Vec<Vec<usize>>> {
    // Three times a triangle's height across each family of lines: never a multiple of 3, so no triangle is on a line.
    let height = |t: usize, family: usize| -> i32 {
        let of = |(i, j): Spot| [i, j, i + j][family];
        spots[t].iter().map(|s| of(*s)).sum()
    };
    let mut inside = vec![false; spots.len()];
    piece.iter().for_each(|t| inside[*t] = true);
    // Every pair of neighbours lies across one line at the most: all lines are counted in one go.
    let mut lines: Vec<(usize, usize, i32)> = Vec::new();
    for least in [LEAST_SHARE, 0.0] {
        for family in 0..3 {
            let mut heights: Vec<i32> = piece.iter().map(|t| height(*t, family)).collect();
            heights.sort_unstable();
            let (low, high) = (
                heights.first()?.div_euclid(3) + 1,
                heights.last()?.div_euclid(3),
            );
            let mut crossed = vec![0; (high - low + 1).max(0) as usize];
            for side in piece.iter().flat_map(|t| 3 * t..3 * t + 3) {
                let Some(twin) = net.twin[side].filter(|twin| inside[twin / 3]) else {
                    continue;
                };
                let (a, b) = (height(side / 3, family), height(twin / 3, family));
                let line = b.div_euclid(3);
                if a < 3 * line && joined(spots, side, twin) {
                    crossed[(line - low) as usize] += 1;
                }
            }
            for line in low..=high {
                let below = heights.partition_point(|h| *h < 3 * line);
                let smaller = below.min(piece.len() - below);
                if smaller > 0 && smaller as f64 >= least * piece.len() as f64 {
                    lines.push((crossed[(line - low) as usize], family, line));
                }
            }
        }
        if !lines.is_empty() {
            break;
        }
    }
    lines.sort_unstable();
    lines.truncate(CANDIDATES);
    let best = lines.into_iter().min_by_key(|&(crossed, family, line)| {
        let sides = sides(piece, |t| height(t, family) < 3 * line);
        let pieces: usize = sides
            .into_iter()
            .map(|s| components(net, spots, s).len())
            .sum();
        (
            crossed + PIECE_PRICE * pieces.saturating_sub(2),
            family,
            line,
        )
    });
    let (_, family, line) = best?;
    let sides = sides(piece, |t| height(t, family) < 3 * line);
    Some(
        sides
            .into_iter()
            .flat_map(|s| components(net, spots, s))
            .collect(),
    )
}

fn sides(piece: &[usize], below: impl Fn(usize) -> bool) -> [Vec<usize>; 2] {
    let (a, b) = piece.iter().partition(|t| below(**t));
    [a, b]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::base::progress::Silent;
    use crate::linkage::{TriangleId, vase_with_lattice};

    fn extent(corners: &[Point2<f64>]) -> [f64; 2] {
        [0, 1].map(|k| {
            let of = corners.iter().map(|p| p[k]);
            of.clone().fold(f64::MIN, f64::max) - of.fold(f64::MAX, f64::min)
        })
    }

    #[test]
    fn pieces_fit_lie_apart_and_the_linkage_in_space_stays_what_it_was() {
        let (surface, layout, lattice) = vase_with_lattice();
        let guide = crate::linkage::SeamGuide::facing(nalgebra::Vector3::z());
        let built = crate::linkage::build_without(
            &surface,
            &layout,
            &lattice,
            &crate::linkage::Without::nothing(&guide),
            &Silent,
        )
        .unwrap();
        let all: Vec<Point2<f64>> = built
            .linkage
            .triangles
            .iter()
            .flat_map(|t| t.flat)
            .collect();
        let whole = extent(&all);
        for share in [0.7, 0.4, 0.25] {
            let most = whole.map(|w| w * share);
            let fits = |c: &[Point2<f64>]| extent(c)[0] <= most[0] && extent(c)[1] <= most[1];
            let divided = built.divided(&fits).unwrap();
            assert!(divided.pieces > 1);
            let (old, new) = (&built.linkage, &divided.linkage);
            assert_eq!(old.hinges.len(), new.hinges.len());
            for (a, b) in old.hinges.iter().zip(&new.hinges) {
                assert_eq!((a.point, a.ccw, a.cw), (b.point, b.ccw, b.cw));
                assert!(!a.seam || b.seam, "an old seam stays one");
            }
            assert_eq!(
                new.hinges.iter().filter(|h| h.seam).count(),
                divided.seam_edges
            );
            // Pieces of what is joined on the sheet.
            let beside = new.flat_neighbours();
            let mut left: BTreeSet<u32> = (0..new.triangles.len() as u32).collect();
            let mut pieces = 0;
            while let Some(first) = left.pop_first() {
                let mut piece = vec![TriangleId(first)];
                let mut at = 0;
                while at < piece.len() {
                    for (t, _) in beside[piece[at]].iter().flatten() {
                        if left.remove(&t.0) {
                            piece.push(*t);
                        }
                    }
                    at += 1;
                }
                let corners: Vec<Point2<f64>> =
                    piece.iter().flat_map(|t| new.triangles[*t].flat).collect();
                assert!(fits(&corners));
                pieces += 1;
            }
            assert_eq!(pieces, divided.pieces);
            // Every new seam has room for its doubled row, but for a few triangles at its ends.
            let rows: usize = divided.flaps.segments.iter().map(|s| s.row).sum();
            assert!(
                divided.flaps.flaps.len() * 10 > rows * 8,
                "{} of {rows}",
                divided.flaps.flaps.len()
            );
            let options = crate::pattern::SheetOptions::plain(0.3, 0.1);
            let sheet = crate::pattern::Sheet::with_flaps(new, &divided.flaps, &options).unwrap();
            let (parts, part_of) = sheet.parts();
            assert_eq!(
                (parts.len(), part_of.len()),
                (divided.pieces, new.triangles.len())
            );
            let slits: usize = parts.iter().map(|p| p.slits.len()).sum();
            assert_eq!(slits, sheet.slits.len());
        }
        assert!(built.divided(&|_| false).is_none());
        let same = built.divided(&|_| true).unwrap();
        assert_eq!(same.pieces, built.pieces);
        assert_eq!(same.flaps.flaps.len(), built.flaps.flaps.len());
    }
}
