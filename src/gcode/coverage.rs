//! Which parts of one set of segments lie along another, exactly.
//!
//! No sampling: the points of a segment within a distance τ of another one form an interval, because the second one's
//! neighbourhood (a capsule) is convex. Intervals are collected through a spatial index and counted by sweeping.

use kurbo::{Point, Vec2};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use crate::base::plane;

/// A directed segment; one of zero length is a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub a: Point,
    pub b: Point,
}

/// A piece of a segment, as distances from its first point.
pub(super) type Interval = (f64, f64);

/// Shorter than this there is no direction, millimetres: a millionth of a micrometre.
const POINT: f64 = 1e-9;

impl Segment {
    pub fn length(&self) -> f64 {
        self.a.distance(self.b)
    }

    pub fn at(&self, distance: f64) -> Point {
        let length = self.length();
        if length < POINT {
            self.a
        } else {
            self.a.lerp(self.b, distance / length)
        }
    }

    /// The piece of `self` within `tolerance` of `other`. With `caps`, of all of it; without, only beside it: between
    /// the perpendiculars at its ends, so that consecutive segments of a line do not overlap.
    pub fn along(&self, other: &Self, tolerance: f64, caps: bool) -> Option<Interval> {
        let length = self.length();
        let u = if length < POINT {
            Vec2::ZERO
        } else {
            (self.b - self.a) / length
        };
        let mut found: Option<Interval> = None;
        let mut add = |low: f64, high: f64| {
            let (low, high) = (low.max(0.0), high.min(length));
            if low <= high {
                found = Some(found.map_or((low, high), |f| (f.0.min(low), f.1.max(high))));
            }
        };
        let width = other.length();
        if width >= POINT {
            let v = (other.b - other.a) / width;
            let w = self.a - other.a;
            let beside = cut(
                (f64::NEG_INFINITY, f64::INFINITY),
                w.dot(v),
                u.dot(v),
                0.0,
                width,
            )
            .and_then(|i| cut(i, v.cross(w), v.cross(u), -tolerance, tolerance));
            if let Some((low, high)) = beside {
                add(low, high);
            }
        }
        if caps {
            for end in [other.a, other.b] {
                let w = end - self.a;
                let middle = w.dot(u);
                let square = tolerance * tolerance - (w.hypot2() - middle * middle);
                if square >= 0.0 {
                    add(middle - square.sqrt(), middle + square.sqrt());
                }
            }
        }
        found
    }
}

/// The part of an interval where `low ≤ offset + slope · t ≤ high`.
fn cut(interval: Interval, offset: f64, slope: f64, low: f64, high: f64) -> Option<Interval> {
    // A slope that changes nothing over a metre is none.
    if slope.abs() < 1e-15 {
        return (offset >= low && offset <= high).then_some(interval);
    }
    let (p, q) = ((low - offset) / slope, (high - offset) / slope);
    let (from, to) = (interval.0.max(p.min(q)), interval.1.min(p.max(q)));
    (from <= to).then_some((from, to))
}

/// Least distance between two segments.
pub(super) fn distance(a: &Segment, b: &Segment) -> f64 {
    plane::between_segments([a.a, a.b], [b.a, b.b])
}

/// Segments by place.
pub(super) struct Index {
    segments: Vec<Segment>,
    tree: RTree<GeomWithData<Rectangle<[f64; 2]>, u32>>,
}

/// Pieces into which a long segment is put into the index: otherwise the box of a long slanted one holds everything.
const PIECE_MM: f64 = 20.0;

impl Index {
    pub fn new(segments: Vec<Segment>) -> Self {
        let mut boxes = Vec::with_capacity(segments.len());
        for (i, s) in segments.iter().enumerate() {
            let pieces = (s.length() / PIECE_MM).ceil().clamp(1.0, 10_000.0) as usize;
            for k in 0..pieces {
                let p = s.a.lerp(s.b, k as f64 / pieces as f64);
                let q = s.a.lerp(s.b, (k + 1) as f64 / pieces as f64);
                boxes.push(GeomWithData::new(
                    Rectangle::from_corners([p.x, p.y], [q.x, q.y]),
                    i as u32,
                ));
            }
        }
        Self {
            segments,
            tree: RTree::bulk_load(boxes),
        }
    }

    /// An indexed segment by its number.
    pub fn segment(&self, n: u32) -> Segment {
        self.segments[n as usize]
    }

    /// The segments whose neighbourhood may touch `segment`, each once, into `found`.
    pub fn near(&self, segment: &Segment, tolerance: f64, found: &mut Vec<u32>) {
        found.clear();
        let pieces = (segment.length() / PIECE_MM).ceil().clamp(1.0, 10_000.0) as usize;
        for k in 0..pieces {
            let p = segment.a.lerp(segment.b, k as f64 / pieces as f64);
            let q = segment.a.lerp(segment.b, (k + 1) as f64 / pieces as f64);
            let area = AABB::from_corners(
                [p.x.min(q.x) - tolerance, p.y.min(q.y) - tolerance],
                [p.x.max(q.x) + tolerance, p.y.max(q.y) + tolerance],
            );
            found.extend(
                self.tree
                    .locate_in_envelope_intersecting(area)
                    .map(|g| g.data),
            );
        }
        found.sort_unstable();
        found.dedup();
    }

    /// All pieces of `segment` along the indexed ones: beside them, and with their caps.
    pub fn along(&self, segment: &Segment, tolerance: f64, pieces: &mut Pieces) {
        self.near(segment, tolerance, &mut pieces.near);
        pieces.beside.clear();
        pieces.capped.clear();
        for &i in &pieces.near {
            let other = &self.segments[i as usize];
            pieces.beside.extend(segment.along(other, tolerance, false));
            pieces.capped.extend(segment.along(other, tolerance, true));
        }
    }
}

/// Room for the answers of [`Index::along`], reused from segment to segment.
#[derive(Default)]
pub(super) struct Pieces {
    near: Vec<u32>,
    pub beside: Vec<Interval>,
    pub capped: Vec<Interval>,
    events: Vec<(f64, i32)>,
}

impl Pieces {
    /// The runs of `0..=length` where the count of intervals is `wrong`, each longer than `least`.
    pub fn runs(
        &mut self,
        capped: bool,
        length: f64,
        least: f64,
        wrong: impl Fn(i32) -> bool,
        mut report: impl FnMut(Interval, i32),
    ) {
        let intervals = if capped { &self.capped } else { &self.beside };
        self.events.clear();
        for &(low, high) in intervals {
            self.events.push((low, 1));
            self.events.push((high, -1));
        }
        self.events.push((length, 0));
        self.events
            .sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let (mut count, mut from) = (0, 0.0);
        let mut open: Option<(f64, i32)> = None;
        for &(at, change) in &self.events {
            if at - from > 0.0 {
                if wrong(count) {
                    let run = open.get_or_insert((from, count));
                    run.1 = if (run.1 - 1).abs() > (count - 1).abs() {
                        run.1
                    } else {
                        count
                    };
                } else if at - from > 1e-9
                    && let Some((start, worst)) = open.take()
                    && from - start > least
                {
                    report((start, from), worst);
                }
                from = at;
            }
            count += change;
        }
        if let Some((start, worst)) = open
            && from - start > least
        {
            report((start, from), worst);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(a: (f64, f64), b: (f64, f64)) -> Segment {
        Segment {
            a: a.into(),
            b: b.into(),
        }
    }

    #[test]
    fn intervals_are_those_of_the_capsule() {
        let s = segment((0.0, 0.0), (10.0, 0.0));
        let near = |a: Option<Interval>, b: Interval| {
            let a = a.unwrap();
            (a.0 - b.0).abs() < 1e-12 && (a.1 - b.1).abs() < 1e-12
        };
        // Parallel at distance 3 with radius 5: caps reach 4 further.
        let other = segment((7.0, 3.0), (5.0, 3.0));
        assert!(near(s.along(&other, 5.0, true), (1.0, 10.0)));
        assert!(near(s.along(&other, 5.0, false), (5.0, 7.0)));
        assert_eq!(s.along(&other, 2.9, true), None);
        // Crossing at a right angle.
        let other = segment((4.0, -9.0), (4.0, 9.0));
        assert!(near(s.along(&other, 0.5, true), (3.5, 4.5)));
        // A point, both ways.
        let point = segment((4.0, 0.3), (4.0, 0.3));
        assert!(near(s.along(&point, 0.5, true), (3.6, 4.4)));
        assert_eq!(point.along(&s, 0.5, true), Some((0.0, 0.0)));
        assert_eq!(point.along(&s, 0.2, true), None);
    }

    #[test]
    fn random_pairs_agree_with_the_distance() {
        let mut seed = 1u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as f64 / (1u64 << 24) as f64 * 4.0
        };
        let from_point = |p: Point, s: &Segment| {
            let d = s.b - s.a;
            let t = ((p - s.a).dot(d) / d.hypot2()).clamp(0.0, 1.0);
            p.distance(s.a.lerp(s.b, t))
        };
        for _ in 0..500 {
            let s = segment((next(), next()), (next(), next()));
            let o = segment((next(), next()), (next(), next()));
            let found = s.along(&o, 0.7, true);
            for k in 0..=50 {
                let t = s.length() * f64::from(k) / 50.0;
                let inside = found.is_some_and(|f| f.0 - 1e-9 <= t && t <= f.1 + 1e-9);
                let d = from_point(s.at(t), &o);
                assert!(if inside {
                    d < 0.7 + 1e-6
                } else {
                    d > 0.7 - 1e-6
                });
            }
        }
    }

    #[test]
    fn runs_are_counted_by_sweeping() {
        let mut pieces = Pieces {
            capped: vec![(0.0, 4.0), (3.0, 6.0), (8.0, 9.0)],
            ..Pieces::default()
        };
        let mut runs = Vec::new();
        pieces.runs(
            true,
            10.0,
            0.1,
            |n| n != 1,
            |run, worst| runs.push((run, worst)),
        );
        assert_eq!(runs, [((3.0, 4.0), 2), ((6.0, 8.0), 0), ((9.0, 10.0), 0)]);
        runs.clear();
        pieces.runs(
            true,
            10.0,
            1.5,
            |n| n < 1,
            |run, worst| runs.push((run, worst)),
        );
        assert_eq!(runs, [((6.0, 8.0), 0)]);
    }
}
