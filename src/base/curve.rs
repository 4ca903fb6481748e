//! Lines made of straight pieces and circular arcs: what a sheet consists of and a controller follows.
//!
//! A [`Curve`] is a row of vertices, each with the *bulge* of the piece that leaves it: the tangent of a quarter of the
//! angle that the arc turns, positive to the left, 0 for a straight piece. DXF and offset libraries speak the same, an
//! arc needs no centre that could disagree with its ends, and turning or shifting a curve leaves its bulges alone.

use kurbo::{Point, Rect, Vec2};

/// A vertex and the piece that leaves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Where it is, millimetres.
    pub at: Point,
    /// Bulge of the piece to the next vertex; meaningless at the end of an open curve, and 0 there.
    pub bulge: f64,
}

/// A line of straight pieces and arcs, open or closed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// The vertices in order; the first is not repeated at the end of a closed curve.
    pub vertices: Vec<Vertex>,
    /// Whether the last vertex is joined to the first.
    pub closed: bool,
}

/// Bulges below this are straight: on a piece of a metre they stray by half a micrometre.
const STRAIGHT: f64 = 1e-6;

/// Shorter pieces have no direction, millimetres.
const NOTHING: f64 = 1e-9;

/// One piece of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Where it begins.
    pub from: Point,
    /// Where it ends.
    pub to: Point,
    /// Its bulge, exactly 0 if it is straight.
    pub bulge: f64,
}

/// The circle of an arc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Centre.
    pub centre: Point,
    /// Radius, millimetres.
    pub radius: f64,
    /// Direction from the centre to the arc's beginning, radians.
    pub start: f64,
    /// Angle that it turns, radians, positive to the left.
    pub sweep: f64,
}

impl Piece {
    /// A piece; a bulge that makes no difference becomes 0.
    pub fn new(from: Point, to: Point, bulge: f64) -> Self {
        let bulge = if bulge.abs() < STRAIGHT { 0.0 } else { bulge };
        Self { from, to, bulge }
    }

    /// Its circle, unless it is straight or its ends are one point.
    pub fn arc(&self) -> Option<Arc> {
        let chord = self.to - self.from;
        let length = chord.hypot();
        if self.bulge == 0.0 || length < NOTHING {
            return None;
        }
        let b = self.bulge;
        // Distance of the centre from the chord's middle, to the left of the chord for a positive bulge below 1.
        let reach = length * (1.0 - b * b) / (4.0 * b);
        let left = Vec2::new(-chord.y, chord.x) / length;
        let centre = self.from.midpoint(self.to) + left * reach;
        Some(Arc {
            centre,
            radius: length * (1.0 + b * b) / (4.0 * b.abs()),
            start: (self.from - centre).atan2(),
            sweep: 4.0 * b.atan(),
        })
    }

    /// Its length, millimetres.
    pub fn length(&self) -> f64 {
        match self.arc() {
            Some(arc) => arc.radius * arc.sweep.abs(),
            None => self.from.distance(self.to),
        }
    }

    /// The point at a part of its length, 0 to 1.
    pub fn at(&self, part: f64) -> Point {
        if part <= 0.0 {
            return self.from;
        }
        if part >= 1.0 {
            return self.to;
        }
        match self.arc() {
            Some(arc) => arc.centre + Vec2::from_angle(arc.start + part * arc.sweep) * arc.radius,
            None => self.from.lerp(self.to, part),
        }
    }

    /// Its direction there, of length 1; zero if the piece has none.
    pub fn direction(&self, part: f64) -> Vec2 {
        match self.arc() {
            Some(arc) => {
                let out = Vec2::from_angle(arc.start + part * arc.sweep);
                Vec2::new(-out.y, out.x) * arc.sweep.signum()
            }
            None => {
                let d = self.to - self.from;
                let length = d.hypot();
                if length < NOTHING {
                    Vec2::ZERO
                } else {
                    d / length
                }
            }
        }
    }

    /// The same the other way round.
    pub fn reversed(&self) -> Self {
        Self {
            from: self.to,
            to: self.from,
            bulge: -self.bulge,
        }
    }

    /// The part between two parts of its length, `0 ≤ a ≤ b ≤ 1`.
    pub fn between(&self, a: f64, b: f64) -> Self {
        let bulge = match self.arc() {
            Some(arc) => (arc.sweep * (b - a) / 4.0).tan(),
            None => 0.0,
        };
        Self::new(self.at(a), self.at(b), bulge)
    }

    /// Ends of straight pieces that stay within `error_mm` of it, the last being its own end.
    pub fn chords(&self, error_mm: f64) -> impl Iterator<Item = Point> + use<> {
        let this = *self;
        let n = match self.arc() {
            Some(arc) => {
                let step = 2.0 * (1.0 - error_mm / arc.radius.max(error_mm)).acos();
                (arc.sweep.abs() / step).ceil().clamp(1.0, MOST_CHORDS) as usize
            }
            None => 1,
        };
        (1..=n).map(move |k| this.at(k as f64 / n as f64))
    }
}

/// Chords for one arc at the most.
const MOST_CHORDS: f64 = 20_000.0;

impl Curve {
    /// Straight pieces between points.
    pub fn polyline(points: impl IntoIterator<Item = Point>, closed: bool) -> Self {
        let vertices = points
            .into_iter()
            .map(|at| Vertex { at, bulge: 0.0 })
            .collect();
        Self { vertices, closed }
    }

    /// One straight piece.
    pub fn line(from: Point, to: Point) -> Self {
        Self::polyline([from, to], false)
    }

    /// A circle as two half turns, counter-clockwise or not, from its rightmost point.
    pub fn circle(centre: Point, radius: f64, counter_clockwise: bool) -> Self {
        let bulge = if counter_clockwise { 1.0 } else { -1.0 };
        let at = [radius, -radius].map(|r| Vertex {
            at: centre + (r, 0.0),
            bulge,
        });
        Self {
            vertices: at.to_vec(),
            closed: true,
        }
    }

    /// From pieces that follow each other.
    pub fn of_pieces(pieces: impl IntoIterator<Item = Piece>) -> Self {
        let mut curve = Self::default();
        let mut end = None;
        for piece in pieces {
            curve.vertices.push(Vertex {
                at: piece.from,
                bulge: piece.bulge,
            });
            end = Some(piece.to);
        }
        curve
            .vertices
            .extend(end.map(|at| Vertex { at, bulge: 0.0 }));
        curve
    }

    /// Number of pieces.
    pub fn len(&self) -> usize {
        if self.closed {
            self.vertices.len()
        } else {
            self.vertices.len().saturating_sub(1)
        }
    }

    /// Whether it has no piece.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Its pieces in order.
    pub fn pieces(&self) -> impl DoubleEndedIterator<Item = Piece> + ExactSizeIterator + '_ {
        let n = self.vertices.len();
        (0..self.len()).map(move |i| {
            let (a, b) = (self.vertices[i], self.vertices[(i + 1) % n]);
            Piece::new(a.at, b.at, a.bulge)
        })
    }

    /// The first vertex's place.
    pub fn start(&self) -> Option<Point> {
        self.vertices.first().map(|v| v.at)
    }

    /// Where it ends: at its start if it is closed.
    pub fn end(&self) -> Option<Point> {
        if self.closed {
            self.start()
        } else {
            self.vertices.last().map(|v| v.at)
        }
    }

    /// Its length, millimetres.
    pub fn length(&self) -> f64 {
        self.pieces().map(|p| p.length()).sum()
    }

    /// Area inside, if it is closed: negative where it runs clockwise.
    pub fn signed_area(&self) -> f64 {
        self.pieces()
            .map(|p| {
                let chord = 0.5 * p.from.to_vec2().cross(p.to.to_vec2());
                // The segment of the circle between the arc and its chord.
                chord
                    + p.arc().map_or(0.0, |a| {
                        0.5 * a.radius * a.radius * (a.sweep - a.sweep.sin())
                    })
            })
            .sum()
    }

    /// The smallest upright rectangle around it; none around nothing.
    pub fn bounds(&self) -> Option<Rect> {
        let first = self.start()?;
        let mut rect = Rect::from_points(first, first);
        for v in &self.vertices {
            rect = rect.union_pt(v.at);
        }
        for arc in self.pieces().filter_map(|p| p.arc()) {
            for quarter in 0..4 {
                let angle = f64::from(quarter) * std::f64::consts::FRAC_PI_2;
                let turn = (angle - arc.start) * arc.sweep.signum();
                if turn.rem_euclid(std::f64::consts::TAU) <= arc.sweep.abs() {
                    rect = rect.union_pt(arc.centre + Vec2::from_angle(angle) * arc.radius);
                }
            }
        }
        Some(rect)
    }

    /// The same line the other way round. A closed one keeps its first vertex.
    pub fn reversed(&self) -> Self {
        let n = self.vertices.len();
        let vertices = (0..n)
            .map(|i| {
                let at = if self.closed { (n - i) % n } else { n - 1 - i };
                // The piece that led here now leaves, the other way.
                let before = (at + n - 1) % n;
                let bulge = if !self.closed && at == 0 {
                    0.0
                } else {
                    -self.vertices[before].bulge
                };
                Vertex {
                    at: self.vertices[at].at,
                    bulge,
                }
            })
            .collect();
        Self {
            vertices,
            closed: self.closed,
        }
    }

    /// Every point moved by a motion of the plane; `mirrors` says that the motion turns left into right.
    pub fn moved(&self, motion: impl Fn(Point) -> Point, mirrors: bool) -> Self {
        let vertices = self.vertices.iter().map(|v| Vertex {
            at: motion(v.at),
            bulge: if mirrors { -v.bulge } else { v.bulge },
        });
        Self {
            vertices: vertices.collect(),
            closed: self.closed,
        }
    }

    /// A closed curve begun and ended at the point `part` of the way along piece `index`, as an open one.
    pub fn opened_at(&self, index: usize, part: f64) -> Self {
        let pieces: Vec<Piece> = self.pieces().collect();
        let Some(first) = pieces.get(index) else {
            return self.clone();
        };
        let mut row = Vec::with_capacity(pieces.len() + 1);
        if part < 1.0 {
            row.push(first.between(part, 1.0));
        }
        row.extend((1..pieces.len()).map(|k| pieces[(index + k) % pieces.len()]));
        if part > 0.0 {
            row.push(first.between(0.0, part));
        }
        Self::of_pieces(row)
    }

    /// The stretch between two distances from the start, millimetres, of an open curve.
    pub fn between(&self, from_mm: f64, to_mm: f64) -> Self {
        let mut row = Vec::new();
        let mut done = 0.0;
        for piece in self.pieces() {
            let length = piece.length();
            let (a, b) = ((from_mm - done).max(0.0), (to_mm - done).min(length));
            if b - a > NOTHING {
                row.push(piece.between(a / length, b / length));
            }
            done += length;
        }
        Self::of_pieces(row)
    }

    /// Another curve that begins where this one ends, put behind it. Both are open.
    pub fn join(&mut self, next: &Self) {
        if self.vertices.is_empty() {
            *self = next.clone();
            return;
        }
        let Some((first, rest)) = next.vertices.split_first() else {
            return;
        };
        if let Some(last) = self.vertices.last_mut() {
            last.bulge = first.bulge;
        }
        self.vertices.extend_from_slice(rest);
    }

    /// Points of straight pieces within `error_mm` of it, from the start; a closed curve's start is not repeated.
    pub fn flattened(&self, error_mm: f64) -> Vec<Point> {
        let mut points: Vec<Point> = self.start().into_iter().collect();
        for piece in self.pieces() {
            points.extend(piece.chords(error_mm));
        }
        if self.closed && points.len() > 1 {
            points.pop();
        }
        points
    }

    /// Whether every coordinate and bulge is a plain number.
    pub fn is_finite(&self) -> bool {
        let plain = |v: &Vertex| v.at.is_finite() && v.bulge.is_finite();
        self.vertices.iter().all(plain)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    use proptest::prelude::*;

    use super::*;

    /// A quarter turn to the left around the origin, then straight, then a three-quarter turn.
    fn sample() -> Curve {
        let quarter = (FRAC_PI_2 / 4.0).tan();
        Curve {
            vertices: vec![
                Vertex {
                    at: Point::new(2.0, 0.0),
                    bulge: quarter,
                },
                Vertex {
                    at: Point::new(0.0, 2.0),
                    bulge: 0.0,
                },
                Vertex {
                    at: Point::new(-3.0, 2.0),
                    bulge: (0.75 * TAU / 4.0).tan(),
                },
                Vertex {
                    at: Point::new(-4.0, 3.0),
                    bulge: 0.0,
                },
            ],
            closed: false,
        }
    }

    #[test]
    fn lengths_and_centres_are_those_of_the_circles() {
        let pieces: Vec<Piece> = sample().pieces().collect();
        let arc = pieces[0].arc().unwrap();
        assert!(arc.centre.to_vec2().hypot() < 1e-12 && (arc.radius - 2.0).abs() < 1e-12);
        assert!((pieces[0].length() - PI).abs() < 1e-12);
        assert!((pieces[2].arc().unwrap().radius - 1.0).abs() < 1e-12);
        assert!((sample().length() - PI - 3.0 - 1.5 * PI).abs() < 1e-12);
        assert!((pieces[0].direction(0.0) - Vec2::new(0.0, 1.0)).hypot() < 1e-12);
        assert!((pieces[0].direction(1.0) - Vec2::new(-1.0, 0.0)).hypot() < 1e-12);
    }

    #[test]
    fn a_circle_has_its_area_bounds_and_chords() {
        for ccw in [true, false] {
            let c = Curve::circle(Point::new(3.0, -1.0), 2.0, ccw);
            let sign = if ccw { 1.0 } else { -1.0 };
            assert!((c.signed_area() - sign * 4.0 * PI).abs() < 1e-12);
            assert!((c.reversed().signed_area() + sign * 4.0 * PI).abs() < 1e-12);
            let b = c.bounds().unwrap();
            assert!((b.x0 - 1.0).abs() < 1e-12 && (b.y1 - 1.0).abs() < 1e-12);
            let points = c.flattened(0.01);
            for (i, p) in points.iter().enumerate() {
                let m = p.midpoint(points[(i + 1) % points.len()]);
                let out = m.distance(Point::new(3.0, -1.0));
                assert!((1.99 - 1e-12..=2.0 + 1e-12).contains(&out));
            }
        }
    }

    proptest! {
        #[test]
        fn cutting_and_turning_a_curve_loses_nothing(a in 0.0f64..1.0, b in 0.0f64..1.0, index in 0usize..2) {
            let curve = sample();
            let whole = curve.length();
            let (a, b) = (a.min(b) * whole, a.max(b) * whole);
            prop_assert!((curve.between(a, b).length() - (b - a)).abs() < 1e-8);
            let mut joined = curve.between(0.0, a);
            joined.join(&curve.between(a, whole));
            prop_assert!((joined.length() - whole).abs() < 1e-8);
            let back = curve.reversed();
            prop_assert!((back.length() - whole).abs() < 1e-12);
            prop_assert_eq!(back.start(), curve.end());
            prop_assert_eq!(back.reversed(), curve);
            let ring = Curve::circle(Point::ORIGIN, 5.0, true);
            let open = ring.opened_at(index, a / whole);
            prop_assert!((open.length() - ring.length()).abs() < 1e-9);
            prop_assert!(open.start().unwrap().distance(open.end().unwrap()) < 1e-9);
        }

        #[test]
        fn parts_of_an_arc_lie_on_it(bulge in -3.0f64..3.0, a in 0.0f64..1.0, b in 0.0f64..1.0, t in 0.0f64..1.0) {
            prop_assume!(bulge.abs() > 1e-3 && (a - b).abs() > 1e-3);
            let arc = Piece::new(Point::new(1.0, 2.0), Point::new(4.0, 3.0), bulge);
            let circle = arc.arc().unwrap();
            let part = arc.between(a.min(b), a.max(b));
            prop_assert!((part.at(t).distance(circle.centre) - circle.radius).abs() < 1e-6 * circle.radius);
            prop_assert!((part.length() - (a - b).abs() * arc.length()).abs() < 1e-9 * arc.length().max(1.0));
        }
    }
}
