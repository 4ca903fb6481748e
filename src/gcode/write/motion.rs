//! A cut as a controller is told it: ends in whole micrometres, arcs where they stay arcs after rounding, and no piece
//! shorter than the planner can be fed with where that can be avoided.

use kurbo::Point;

use crate::base::curve::Piece;
use crate::toolpath::Step;

/// Farthest that what is written may stray from what was planned, millimetres, besides the rounding of ends. Arcs that
/// become chords take three quarters of it, short pieces that are joined the rest.
const STRAY_MM: f64 = 0.002;
const CHORD_MM: f64 = 0.75 * STRAY_MM;
const JOIN_MM: f64 = STRAY_MM - CHORD_MM;

/// Micrometres in a millimetre: GRBL prints and keeps no more, and the verifier tolerates ten.
const PER_MM: f64 = 1000.0;

/// Difference of the two radii of an arc, micrometres. Rounding the centre makes it up to 1.5; GRBL takes 5, or a
/// thousandth of the radius, and LinuxCNC 2.9 takes 25, likewise.
const RADII_UM: f64 = 2.0;

/// Larger radii are straight enough for chords, millimetres. GRBL computes with 24 bits: at a metre they are worth 0.06
/// micrometres, and at a hundred metres six.
const LARGEST_RADIUS_MM: f64 = 1000.0;

/// Ends of an arc nearer than this are a matter of rounding for some controllers, which may go all the way round.
const NEAREST_ENDS_UM: i64 = 20;

/// Arcs flatter than this are straight, millimetres.
const FLAT_MM: f64 = 0.000_25;

/// How far the middle of a rounded arc may be turned from where it was, radians: more means the other way round.
const TURN: f64 = 0.2;

/// A place in whole micrometres.
pub(super) type Spot = [i64; 2];

/// A place rounded; `None` if it is not a number, or farther away than any machine reaches.
pub(super) fn spot(p: Point) -> Option<Spot> {
    const FARTHEST_MM: f64 = 1e9;
    let fine = |v: f64| v.abs() < FARTHEST_MM;
    (fine(p.x) && fine(p.y)).then(|| [(p.x * PER_MM).round() as i64, (p.y * PER_MM).round() as i64])
}

fn point(s: Spot) -> Point {
    Point::new(s[0] as f64 / PER_MM, s[1] as f64 / PER_MM)
}

/// What may be written for a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rules {
    /// Whether it takes arcs.
    pub arcs: bool,
    /// Short lines that it takes in a second.
    pub lines_per_s: f64,
}

/// One line of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    /// Its end.
    pub to: Spot,
    /// Its centre, seen from its beginning, and whether it runs clockwise; none if it is straight.
    pub arc: Option<(Spot, bool)>,
    /// Per cent of the cut's speed.
    pub speed_percent: f64,
    /// The torch is held off.
    pub off: bool,
}

/// The strokes of a cut that begins at `start`. Each begins where the one before it ends, and none ends where it begins.
pub(super) fn strokes(
    start: Spot,
    steps: &[Step],
    rules: Rules,
    feed_mm_per_min: f64,
) -> Vec<Stroke> {
    let mut maker = Maker {
        at: start,
        done: Vec::with_capacity(steps.len()),
        pending: vec![point(start)],
        speed_percent: 100.0,
        off: false,
        shortest_mm: 0.0,
    };
    for step in steps {
        let same = step.speed_percent == maker.speed_percent && step.off == maker.off;
        if !same || maker.shortest_mm == 0.0 {
            maker.flush();
            (maker.speed_percent, maker.off) = (step.speed_percent, step.off);
            let feed = feed_mm_per_min * step.speed_percent / 100.0;
            maker.shortest_mm = feed / 60.0 / rules.lines_per_s;
        }
        maker.piece(&step.piece, rules.arcs);
    }
    maker.flush();
    maker.done
}

struct Maker {
    at: Spot,
    done: Vec<Stroke>,
    /// Corners that are not yet written, the first being where the head is.
    pending: Vec<Point>,
    speed_percent: f64,
    off: bool,
    shortest_mm: f64,
}

impl Maker {
    fn piece(&mut self, piece: &Piece, arcs: bool) {
        let Some(arc) = piece.arc() else {
            self.pending.push(piece.to);
            return;
        };
        // From the middle of the chord to the arc.
        let height = arc.radius * (1.0 - (0.5 * arc.sweep.abs()).cos());
        if height < FLAT_MM && arc.sweep.abs() < 1.0 {
            self.pending.push(piece.to);
        } else if arc.sweep.abs() > 1.01 * std::f64::consts::PI {
            // More than half a turn: its ends come close to each other.
            self.piece(&piece.between(0.0, 0.5), arcs);
            self.piece(&piece.between(0.5, 1.0), arcs);
        } else {
            if arcs {
                self.flush();
                if let Some(stroke) = self.rounded(piece) {
                    self.push(stroke);
                    self.pending = vec![piece.to];
                    return;
                }
            }
            self.pending.extend(piece.chords(CHORD_MM));
        }
    }

    fn push(&mut self, stroke: Stroke) {
        if stroke.to != self.at {
            self.at = stroke.to;
            self.done.push(stroke);
        }
    }

    /// Writes the pending corners. A piece that is too short is joined with the next ones as long as what is left out
    /// lies on the joined piece.
    fn flush(&mut self) {
        let points = std::mem::take(&mut self.pending);
        let last = points.len() - 1;
        let mut i = 0;
        while i < last {
            let mut j = i + 1;
            while j < last
                && points[i].distance(points[j]) < self.shortest_mm
                && lies_on(&points[i..=j + 1])
            {
                j += 1;
            }
            if let Some(to) = spot(points[j]) {
                self.push(Stroke {
                    to,
                    arc: None,
                    speed_percent: self.speed_percent,
                    off: self.off,
                });
            }
            i = j;
        }
        self.pending.push(points[last]);
    }

    /// An arc from where the head is to the rounded end of `piece`, if it stays that arc.
    fn rounded(&self, piece: &Piece) -> Option<Stroke> {
        let (from, to) = (self.at, spot(piece.to)?);
        let chord = [to[0] - from[0], to[1] - from[1]];
        if chord[0].abs().max(chord[1].abs()) < NEAREST_ENDS_UM {
            return None;
        }
        // The bulge and not the centre: so that the ends decide.
        let arc = Piece::new(point(from), point(to), piece.bulge).arc()?;
        if arc.radius > LARGEST_RADIUS_MM {
            return None;
        }
        let centre = spot(arc.centre)?;
        let about = [centre[0] - from[0], centre[1] - from[1]];
        let length = |x: i64, y: i64| (x as f64).hypot(y as f64);
        let radii = (
            length(about[0], about[1]),
            length(chord[0] - about[0], chord[1] - about[1]),
        );
        if (radii.0 - radii.1).abs() > RADII_UM {
            return None;
        }
        let clockwise = piece.bulge < 0.0;
        // What the controller makes of it must be what was planned.
        let centre = point(centre);
        let (a, b) = (point(from) - centre, point(to) - centre);
        let mut sweep = (b.atan2() - a.atan2()).rem_euclid(std::f64::consts::TAU);
        if clockwise {
            sweep -= std::f64::consts::TAU;
        }
        if (sweep - arc.sweep).abs() > TURN {
            return None;
        }
        for part in [0.25, 0.5, 0.75] {
            let radius = a.hypot() + part * (b.hypot() - a.hypot());
            if (piece.at(part).distance(centre) - radius).abs() > STRAY_MM {
                return None;
            }
        }
        Some(Stroke {
            to,
            arc: Some((about, clockwise)),
            speed_percent: self.speed_percent,
            off: self.off,
        })
    }
}

/// Whether all points lie on the straight piece from the first to the last, in their order.
fn lies_on(points: &[Point]) -> bool {
    let (Some(&a), Some(&b)) = (points.first(), points.last()) else {
        return true;
    };
    let whole = b - a;
    let length = whole.hypot();
    if length == 0.0 {
        return false;
    }
    let mut along = 0.0;
    points[1..points.len() - 1].iter().all(|p| {
        let d = *p - a;
        let (before, aside) = (along, d.cross(whole).abs() / length);
        along = d.dot(whole) / length;
        aside <= JOIN_MM && along >= before && along <= length
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const RULES: Rules = Rules {
        arcs: true,
        lines_per_s: 330.0,
    };

    fn step(piece: Piece) -> Step {
        Step {
            piece,
            speed_percent: 100.0,
            off: false,
        }
    }

    /// Farthest point of a piece from the strokes that stand for it, mm, by samples.
    fn stray(piece: &Piece, start: Spot, strokes: &[Stroke]) -> f64 {
        let mut worst: f64 = 0.0;
        for k in 0..=100 {
            let p = piece.at(f64::from(k) / 100.0);
            let mut from = start;
            let mut nearest = f64::INFINITY;
            for s in strokes {
                let (a, b) = (point(from), point(s.to));
                nearest = nearest.min(match s.arc {
                    Some((c, _)) => {
                        let c = point([from[0] + c[0], from[1] + c[1]]);
                        (p.distance(c) - a.distance(c)).abs()
                    }
                    None => {
                        let t = ((p - a).dot(b - a) / (b - a).hypot2()).clamp(0.0, 1.0);
                        p.distance(a.lerp(b, t))
                    }
                });
                from = s.to;
            }
            worst = worst.max(nearest);
        }
        worst
    }

    proptest! {
        #![proptest_config(crate::base::cases::cases(512))]

        #[test]
        fn an_arc_stays_within_its_tolerance_and_its_radii_agree(
            x in -500.0..500.0, y in -500.0..500.0, angle in -3.0..3.0, size in -2.0..2.5, bulge in -3.0..3.0, arcs: bool,
        ) {
            let from = Point::new(x, y);
            let to = from + kurbo::Vec2::from_angle(angle) * 10f64.powf(size);
            let piece = Piece::new(from, to, bulge);
            let start = spot(from).unwrap();
            let made = strokes(start, &[step(piece)], Rules { arcs, ..RULES }, 900.0);
            prop_assert_eq!(made.last().unwrap().to, spot(to).unwrap());
            // Rounding of the ends moves the whole by up to 0.7 µm, and a steep arc by more.
            let rounding = 0.0015 * (1.0 + bulge.abs());
            prop_assert!(stray(&piece, start, &made) <= STRAY_MM + rounding);
            let mut from = start;
            for s in &made {
                prop_assert!(s.to != from);
                if let Some((c, clockwise)) = s.arc {
                    prop_assert!(arcs && clockwise == (bulge < 0.0));
                    let r = (c[0] as f64).hypot(c[1] as f64);
                    let q = ((s.to[0] - from[0] - c[0]) as f64).hypot((s.to[1] - from[1] - c[1]) as f64);
                    prop_assert!((r - q).abs() <= RADII_UM);
                }
                from = s.to;
            }
            let round = piece.arc().is_some_and(|a| a.radius < 0.99 * LARGEST_RADIUS_MM);
            if arcs && round && size > -0.5 && bulge.abs() > 0.04 {
                prop_assert!(made.len() <= 4 && made.iter().all(|s| s.arc.is_some()), "{:?}", made);
            }
        }
    }

    #[test]
    fn short_pieces_of_a_straight_line_become_pieces_that_the_planner_can_be_fed_with() {
        let points: Vec<Point> = (0..=1000)
            .map(|k| Point::new(0.01 * f64::from(k), 3.0))
            .collect();
        let steps: Vec<Step> = points
            .windows(2)
            .map(|w| step(Piece::new(w[0], w[1], 0.0)))
            .collect();
        // 100 mm/s at 330 lines/s: 0.3 mm.
        let made = strokes([0, 3000], &steps, RULES, 6000.0);
        let mut from = 0;
        for s in &made[..made.len() - 1] {
            assert!(s.to[0] - from >= 303, "{made:?}");
            from = s.to[0];
        }
        assert_eq!(made.last().unwrap().to, [10_000, 3000]);
        assert!(made.len() <= 34);
        // A corner is never joined away, however short its sides.
        let corner = [(0.0, 0.0), (0.05, 0.0), (0.05, 0.05)].map(Point::from);
        let steps: Vec<Step> = corner
            .windows(2)
            .map(|w| step(Piece::new(w[0], w[1], 0.0)))
            .collect();
        assert_eq!(strokes([0, 0], &steps, RULES, 6000.0).len(), 2);
    }

    #[test]
    fn what_rounds_to_nothing_is_not_written() {
        let piece = Piece::new(Point::new(0.0, 0.0), Point::new(0.0003, 0.0), 0.0);
        assert_eq!(strokes([0, 0], &[step(piece)], RULES, 900.0), []);
        assert_eq!(spot(Point::new(f64::NAN, 0.0)), None);
        assert_eq!(spot(Point::new(0.0, 1e300)), None);
    }
}
