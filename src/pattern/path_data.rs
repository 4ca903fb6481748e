//! Path data and transforms as drawing programs write them, down to straight pieces and arcs.
//!
//! All commands of SVG are read. Arcs of circles stay arcs; a cubic or quadratic curve becomes the fewest arcs and lines
//! that stay within a micrometre of it, for programs write arcs as such curves when they change a path.

use kurbo::{Affine, CubicBez, ParamCurve as _, Point, Vec2};

use crate::base::curve::{Curve, Piece, Vertex};

/// How far a line may stray from a curve that it replaces, millimetres.
const STRAY_MM: f64 = 1e-3;

/// A curve is halved so often at the most; what needs more is no arc.
const MOST_HALVINGS: u32 = 7;

/// Coordinates beyond a kilometre belong to no sheet, millimetres.
pub(super) const LARGEST_MM: f64 = 1e6;

/// Shorter pieces have no direction at the precision of the file, millimetres.
const SHORTEST_MM: f64 = 1e-3;

/// Radii that differ by more than this part are those of an ellipse.
const ROUND: f64 = 1e-3;

/// Numbers, letters and flags of an attribute.
struct Scanner<'a> {
    rest: &'a str,
}

impl<'a> Scanner<'a> {
    fn skip(&mut self) {
        self.rest = self
            .rest
            .trim_start_matches(|c: char| c.is_whitespace() || c == ',');
    }

    fn letter(&mut self) -> Option<char> {
        self.skip();
        let c = self.rest.chars().next().filter(char::is_ascii_alphabetic)?;
        self.rest = &self.rest[1..];
        Some(c)
    }

    fn has_number(&mut self) -> bool {
        self.skip();
        self.rest
            .starts_with(|c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+'))
    }

    /// The next number: its end need not be marked, as in `1.5.5-3`.
    fn number(&mut self) -> Option<f64> {
        self.skip();
        let bytes = self.rest.as_bytes();
        let at = |n: usize| bytes.get(n).copied().unwrap_or(b' ');
        let mut n = usize::from(matches!(at(0), b'-' | b'+'));
        let digits = |mut n: usize| {
            while at(n).is_ascii_digit() {
                n += 1;
            }
            n
        };
        n = digits(n);
        if at(n) == b'.' {
            n = digits(n + 1);
        }
        if matches!(at(n), b'e' | b'E') {
            let sign = usize::from(matches!(at(n + 1), b'-' | b'+'));
            if at(n + 1 + sign).is_ascii_digit() {
                n = digits(n + 1 + sign);
            }
        }
        let (number, rest) = self.rest.split_at(n);
        let value = number.parse::<f64>().ok()?;
        self.rest = rest;
        Some(value)
    }

    /// One digit, 0 or 1, which needs nothing behind it.
    fn flag(&mut self) -> Option<bool> {
        self.skip();
        let flag = match self.rest.chars().next()? {
            '0' => false,
            '1' => true,
            _ => return None,
        };
        self.rest = &self.rest[1..];
        Some(flag)
    }
}

/// All numbers of a list, if it holds nothing else.
pub(super) fn numbers(text: &str) -> Option<Vec<f64>> {
    let mut scanner = Scanner { rest: text };
    let mut all = Vec::new();
    while scanner.has_number() {
        all.push(scanner.number()?);
    }
    scanner.rest.is_empty().then_some(all)
}

/// A `transform` attribute.
pub(super) fn transform(text: &str) -> Result<Affine, String> {
    let bad = || format!("the transform {text:?} cannot be read");
    let mut all = Affine::IDENTITY;
    let mut rest = text.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
    while !rest.is_empty() {
        let (name, after) = rest.split_once('(').ok_or_else(bad)?;
        let (inside, after) = after.split_once(')').ok_or_else(bad)?;
        let values = numbers(inside).ok_or_else(bad)?;
        let one = match (name.trim(), values.as_slice()) {
            ("matrix", &[a, b, c, d, e, f]) => Affine::new([a, b, c, d, e, f]),
            ("translate", &[x]) => Affine::translate((x, 0.0)),
            ("translate", &[x, y]) => Affine::translate((x, y)),
            ("scale", &[s]) => Affine::scale(s),
            ("scale", &[x, y]) => Affine::scale_non_uniform(x, y),
            ("rotate", &[deg]) => Affine::rotate(deg.to_radians()),
            ("rotate", &[deg, x, y]) => Affine::rotate_about(deg.to_radians(), Point::new(x, y)),
            ("skewX", &[deg]) => Affine::skew(deg.to_radians().tan(), 0.0),
            ("skewY", &[deg]) => Affine::skew(0.0, deg.to_radians().tan()),
            _ => return Err(bad()),
        };
        all *= one;
        rest = after.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
    }
    if all.is_finite() { Ok(all) } else { Err(bad()) }
}

/// By how much a map enlarges, if it does so by the same in every direction: it moves, turns and may mirror.
pub(super) fn similarity(map: &Affine) -> Option<f64> {
    let [a, b, c, d, _, _] = map.as_coeffs();
    let (u, v) = (Vec2::new(a, b), Vec2::new(c, d));
    let scale = map.determinant().abs().sqrt();
    let uniform = u.dot(v).abs() <= 1e-6 * scale * scale
        && (u.hypot() - scale).abs() <= 1e-6 * scale
        && (v.hypot() - scale).abs() <= 1e-6 * scale;
    (uniform && scale > 0.0).then_some(scale)
}

/// Lines of path data, moved by `map`, which must be a similarity.
pub(super) fn curves(d: &str, map: &Affine) -> Result<Vec<Curve>, String> {
    // Long data would drown the message.
    let shown: String = d.chars().take(60).collect();
    let bad = |what: &str| format!("path data {shown:?} {what}");
    let Some(scale) = similarity(map) else {
        return Err(bad("is skewed or stretched"));
    };
    let mirrors = map.determinant() < 0.0;
    let mut scanner = Scanner { rest: d };
    let mut all: Vec<Curve> = Vec::new();
    let (mut here, mut start) = (Point::ORIGIN, Point::ORIGIN);
    // The last control point, for the short forms that mirror it.
    let mut control: Option<(char, Point)> = None;
    loop {
        scanner.skip();
        if scanner.rest.is_empty() {
            break;
        }
        let Some(mut command) = scanner.letter() else {
            return Err(bad("has a number where a command is due"));
        };
        if all.is_empty() && !matches!(command, 'M' | 'm') {
            return Err(bad("draws on from nowhere"));
        }
        loop {
            let relative = command.is_ascii_lowercase();
            let origin = if relative { here.to_vec2() } else { Vec2::ZERO };
            let mut number = || {
                scanner
                    .number()
                    .ok_or_else(|| bad("has no number where one is due"))
            };
            let mut last = None;
            match command.to_ascii_uppercase() {
                'M' => {
                    here = (Vec2::new(number()?, number()?) + origin).to_point();
                    start = here;
                    all.push(Curve::polyline([*map * here], false));
                    // Further pairs after a move are lines.
                    command = if relative { 'l' } else { 'L' };
                }
                'Z' => {
                    match all.last_mut() {
                        Some(line) if !line.closed => close(line),
                        _ => return Err(bad("closes what is not open")),
                    }
                    here = start;
                }
                letter => {
                    // After a closed line the next one begins where that began.
                    if all.last().is_none_or(|line| line.closed) {
                        all.push(Curve::polyline([*map * here], false));
                    }
                    let from = here;
                    let mut point =
                        || Ok::<_, String>((Vec2::new(number()?, number()?) + origin).to_point());
                    let mut to_cubic: Option<[Point; 2]> = None;
                    let mut arc = None;
                    match letter {
                        'L' => here = point()?,
                        'H' => here.x = number()? + origin.x,
                        'V' => here.y = number()? + origin.y,
                        'C' => {
                            let (a, b) = (point()?, point()?);
                            here = point()?;
                            (to_cubic, last) = (Some([a, b]), Some(('C', b)));
                        }
                        'S' => {
                            let a = mirrored(control, 'C', from);
                            let b = point()?;
                            here = point()?;
                            (to_cubic, last) = (Some([a, b]), Some(('C', b)));
                        }
                        'Q' | 'T' => {
                            let q = if letter == 'Q' {
                                point()?
                            } else {
                                mirrored(control, 'Q', from)
                            };
                            here = point()?;
                            let (a, b) = (from.lerp(q, 2.0 / 3.0), here.lerp(q, 2.0 / 3.0));
                            (to_cubic, last) = (Some([a, b]), Some(('Q', q)));
                        }
                        'A' => {
                            let (rx, ry, _turn) = (number()?, number()?, number()?);
                            let flag = || bad("has an arc without its two flags");
                            let large = scanner.flag().ok_or_else(flag)?;
                            let sweep = scanner.flag().ok_or_else(flag)?;
                            let mut number = || {
                                scanner
                                    .number()
                                    .ok_or_else(|| bad("has no number where one is due"))
                            };
                            here = (Vec2::new(number()?, number()?) + origin).to_point();
                            if (rx.abs() - ry.abs()).abs() > ROUND * rx.abs() {
                                return Err(bad(
                                    "has an arc of an ellipse; a sheet has arcs of circles only",
                                ));
                            }
                            arc = Some((rx.abs() * scale, large, sweep != mirrors));
                        }
                        _ => return Err(bad("has an unknown command")),
                    }
                    let (p, q) = (*map * from, *map * here);
                    let pieces = match (to_cubic, arc) {
                        (Some([a, b]), _) => {
                            let mut pieces = Vec::new();
                            let cubic = CubicBez::new(p, *map * a, *map * b, q);
                            if !arcs_of(&cubic, 0, &mut pieces) {
                                return Err(bad(
                                    "has a curve that is no row of arcs; a sheet has straight lines and arcs of circles only",
                                ));
                            }
                            pieces
                        }
                        (None, Some((radius, large, left))) => {
                            vec![Piece::new(p, q, bulge(p.distance(q), radius, large, left))]
                        }
                        (None, None) => vec![Piece::new(p, q, 0.0)],
                    };
                    if let Some(line) = all.last_mut() {
                        for piece in pieces {
                            if let Some(vertex) = line.vertices.last_mut() {
                                vertex.bulge = piece.bulge;
                            }
                            line.vertices.push(Vertex {
                                at: piece.to,
                                bulge: 0.0,
                            });
                        }
                    }
                }
            }
            control = last;
            if !here.is_finite() || (*map * here).to_vec2().hypot() > LARGEST_MM {
                return Err(bad("has a coordinate that is on no sheet"));
            }
            if matches!(command, 'Z' | 'z') || !scanner.has_number() {
                break;
            }
        }
    }
    for line in &all {
        if !line.is_finite() || line.is_empty() {
            return Err(bad("has a line without length"));
        }
        if line
            .pieces()
            .any(|p: Piece| p.from.distance(p.to) < SHORTEST_MM)
        {
            return Err(bad("has two neighbouring points on one spot"));
        }
    }
    Ok(all)
}

/// The control point that goes on smoothly from the last one of the same kind.
fn mirrored(control: Option<(char, Point)>, kind: char, here: Point) -> Point {
    match control {
        Some((of, at)) if of == kind => here + (here - at),
        _ => here,
    }
}

fn bulge(chord: f64, radius: f64, large: bool, left: bool) -> f64 {
    if radius == 0.0 {
        return 0.0;
    }
    let half = (0.5 * chord / radius).min(1.0).asin();
    let half = if large {
        std::f64::consts::PI - half
    } else {
        half
    };
    (0.5 * half).tan() * if left { 1.0 } else { -1.0 }
}

/// Lines and arcs along a cubic curve; false if it takes too many.
fn arcs_of(cubic: &CubicBez, halvings: u32, pieces: &mut Vec<Piece>) -> bool {
    let (p, q) = (cubic.p0, cubic.p3);
    let chord = (q - p).hypot();
    let middle = cubic.eval(0.5);
    let piece = Piece::new(p, q, {
        // The angle at the middle gives the turn of the circle through the three points.
        let (a, b) = (p - middle, q - middle);
        let turn = 2.0 * (std::f64::consts::PI - a.cross(b).abs().atan2(a.dot(b)));
        let side = (q - p).cross(middle - p);
        if side.abs() <= STRAY_MM * chord {
            0.0
        } else {
            (0.25 * turn).tan() * -side.signum()
        }
    });
    let near = |t: f64| {
        let at = cubic.eval(t);
        match piece.arc() {
            Some(arc) => (at.distance(arc.centre) - arc.radius).abs() <= STRAY_MM,
            None => (q - p).cross(at - p).abs() <= STRAY_MM * chord,
        }
    };
    if chord > STRAY_MM && (1..16).all(|k| near(f64::from(k) / 16.0)) {
        pieces.push(piece);
        return true;
    }
    if halvings == MOST_HALVINGS {
        return false;
    }
    let (one, two) = (cubic.subsegment(0.0..0.5), cubic.subsegment(0.5..1.0));
    arcs_of(&one, halvings + 1, pieces) && arcs_of(&two, halvings + 1, pieces)
}

/// Joins the end of a line to its beginning; an end that is there already is dropped.
pub(super) fn close(line: &mut Curve) {
    let (first, last) = (
        line.vertices.first().copied(),
        line.vertices.last().copied(),
    );
    if let (Some(first), Some(last)) = (first, last)
        && line.vertices.len() > 2
        && first.at.distance(last.at) < 2e-4
    {
        line.vertices.pop();
    }
    line.closed = true;
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn plain(d: &str) -> Vec<Curve> {
        curves(d, &Affine::IDENTITY).unwrap_or_else(|e| panic!("{e}"))
    }

    fn near(a: &Curve, b: &Curve) {
        assert_eq!((a.closed, a.len()), (b.closed, b.len()));
        for (u, v) in a.vertices.iter().zip(&b.vertices) {
            assert!(u.at.distance(v.at) < 1e-9, "{a:?} {b:?}");
            assert!((u.bulge - v.bulge).abs() < 1e-9, "{a:?} {b:?}");
        }
    }

    #[test]
    fn every_way_to_write_a_line_is_the_same_line() {
        let square = plain("M1,2 L4,2 L4,6 L1,6 Z");
        for other in [
            "m1 2 3 0 0 4-3 0z",
            "M1,2H4V6H1Z",
            "m1,2h3v4h-3v-4z",
            "M 1 2 C 2 2 3 2 4 2 c 0 1 0 2 0 4 L1,6Z",
            "M1 2Q2 2 4 2T4 6L1 6z",
            "M1.0.2e1L4+2 4,.6E+1 1 6ZM9 9l1 1",
        ] {
            let curves = plain(other);
            if other.contains('T') {
                // The mirrored control point makes a curve of it, which ends where it should.
                assert!(curves[0].len() > 4);
                assert!(
                    curves[0]
                        .vertices
                        .iter()
                        .any(|v| v.at == Point::new(4.0, 6.0))
                );
                continue;
            }
            near(&curves[0], &square[0]);
        }
        let two = plain("M0 0h1v1zl-1 0");
        assert_eq!(two.len(), 2);
        assert_eq!(two[1].vertices[1].at, Point::new(-1.0, 0.0));
    }

    #[test]
    fn arcs_stay_arcs_under_turning_and_mirroring() {
        let d = "M3,0 a3,3 0 0 1 -3,3 A3 3 0 1110.5 3";
        for map in [
            Affine::IDENTITY,
            Affine::rotate(0.7),
            Affine::scale_non_uniform(1.0, -1.0),
            Affine::translate((5.0, 1.0)) * Affine::scale_non_uniform(-2.0, 2.0),
        ] {
            let scale = similarity(&map).unwrap();
            let one = &curves(d, &map).unwrap()[0];
            let pieces: Vec<Piece> = one.pieces().collect();
            let arc = pieces[0].arc().unwrap();
            assert!(arc.centre.distance(map * Point::ORIGIN) < 1e-9);
            assert!((arc.sweep.abs() - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
            assert!((arc.radius - 3.0 * scale).abs() < 1e-9);
            assert!(pieces[1].bulge.abs() > 1.0 || pieces[1].length() > 10.0);
        }
        assert!(curves("M0 0A3 2 0 0 1 3 3", &Affine::IDENTITY).is_err());
        assert!(curves("M0 0L1 1", &Affine::scale_non_uniform(1.0, 2.0)).is_err());
    }

    #[test]
    fn what_is_no_path_is_refused() {
        for d in [
            "L1 1",
            "M1",
            "M0 0L",
            "M0 0 L1 x",
            "M0 0X1 1",
            "M0 0zz",
            "3 4",
            "M0 0L0 0",
            "M0 0L1e300 0",
            "M0 0A1 1 0 2 0 3 3",
            "M0 0",
            "M0 0Lé",
        ] {
            assert!(curves(d, &Affine::IDENTITY).is_err(), "{d}");
        }
        for t in [
            "scale(1",
            "turn(3)",
            "matrix(1,2)",
            "scale(nan)",
            "x",
            "rotate()",
        ] {
            assert!(transform(t).is_err(), "{t}");
        }
    }

    #[test]
    fn transforms_are_applied_from_the_right() {
        let all = transform("translate(10,20) rotate(90)scale(2) , matrix(1 0 0 1 3 0)").unwrap();
        assert!((all * Point::new(1.0, 0.0)).distance(Point::new(10.0, 28.0)) < 1e-12);
        let about = transform("rotate(90,1,1)").unwrap();
        assert!((about * Point::new(2.0, 1.0)).distance(Point::new(1.0, 2.0)) < 1e-12);
        assert_eq!(similarity(&transform("skewX(20)").unwrap()), None);
        assert_eq!(similarity(&transform("scale(0)").unwrap()), None);
    }

    proptest! {
        #[test]
        fn a_circle_as_cubic_curves_becomes_arcs_within_a_micrometre(radius in 0.2f64..60.0, turn in -6.0f64..6.0) {
            // Quarter turns with the control points that every program uses.
            let k = 0.552_284_75 * radius;
            let d = format!(
                "M{radius} 0C{radius} {k} {k} {radius} 0 {radius}S{} {k} {} 0", -radius, -radius
            );
            let line = &curves(&d, &Affine::rotate(turn)).unwrap()[0];
            for p in line.flattened(1e-4) {
                // The curves themselves stray by 2.7e-4 of the radius.
                prop_assert!((p.to_vec2().hypot() - radius).abs() < 1.2e-3 + 2.8e-4 * radius);
            }
            prop_assert!(line.len() <= 32);
        }

        #[test]
        fn nothing_makes_it_panic(d in "[MmLlHhVvCcSsQqTtAaZz0-9 .,eE+-]{0,40}") {
            let _ = curves(&d, &Affine::IDENTITY);
            let _ = transform(&d);
        }
    }
}
