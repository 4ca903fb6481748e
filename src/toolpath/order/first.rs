//! A first tour: the cheapest links first (the greedy tour of J. L. Bentley 1992).
//!
//! Strokes are pieces with two free ends. The cheapest link that joins two pieces is made until there is one piece: first
//! among the links to near neighbours, then, with far fewer ends left free, among those to the nearest of them.

use kurbo::Point;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::tour::End;

/// Ends of other pieces that are looked at for each end of a piece.
const LOOKED_AT: usize = 5;

const NONE: End = End::MAX;

/// A link that might be made: its cost, and the two ends.
pub(super) type Link = (f64, End, End);

/// The ring of strokes, the last of them the depot, each by the end at which it is entered. `points` are the places of
/// all ends, two a stroke, and `near` the links to make first. The depot's second end is never linked but to close
/// the ring. With `forwards`, a stroke's second end, and the depot's first, is linked to a first end only.
pub(super) fn greedy(points: &[Point], near: Vec<Link>, forwards: bool) -> Vec<End> {
    let mut pieces = Pieces::new(points.len() as u32);
    pieces.join_cheapest(near);
    let nowhere = points.len() as u32 - 1;
    loop {
        let free: Vec<GeomWithData<[f64; 2], End>> = (0..nowhere)
            .filter(|e| pieces.link[*e as usize] == NONE)
            .map(|e| GeomWithData::new(<(f64, f64)>::from(points[e as usize]).into(), e))
            .collect();
        // One piece is left: its ends are nowhere and where the tour ends.
        if free.len() < 2 {
            return pieces.ring();
        }
        let tree = RTree::bulk_load(free.clone());
        let mut links = Vec::with_capacity(LOOKED_AT * free.len());
        for end in &free {
            let far = pieces.far[end.data as usize];
            let entered = |e: End| e.is_multiple_of(2) && e + 1 != nowhere;
            let fits = |e: End| !forwards || entered(e) != entered(end.data);
            links.extend(
                tree.nearest_neighbor_iter_with_distance_2(*end.geom())
                    .filter(|(e, _)| e.data != end.data && e.data != far && fits(e.data))
                    .take(LOOKED_AT)
                    .map(|(e, d2)| (d2.sqrt(), end.data, e.data)),
            );
        }
        pieces.join_cheapest(links);
    }
}

struct Pieces {
    /// The end that an end is linked to.
    link: Vec<End>,
    /// For a free end, the other free end of its piece.
    far: Vec<End>,
}

impl Pieces {
    fn new(ends: u32) -> Self {
        Self {
            link: vec![NONE; ends as usize],
            far: (0..ends).map(|e| e ^ 1).collect(),
        }
    }

    fn join_cheapest(&mut self, mut links: Vec<Link>) {
        links.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for (_, a, b) in links {
            self.join(a, b);
        }
    }

    /// Joins two pieces at these ends, if both are free and not of one piece.
    fn join(&mut self, a: End, b: End) {
        let (i, j) = (a as usize, b as usize);
        if self.link[i] != NONE || self.link[j] != NONE || self.far[i] == b {
            return;
        }
        self.link[i] = b;
        self.link[j] = a;
        let (x, y) = (self.far[i], self.far[j]);
        self.far[x as usize] = y;
        self.far[y as usize] = x;
    }

    fn ring(&self) -> Vec<End> {
        let mut ring = Vec::with_capacity(self.link.len() / 2);
        let mut at = self.link.len() as u32 - 1;
        while at != NONE {
            ring.push(at);
            at = self.link[(at ^ 1) as usize];
        }
        ring
    }
}
