//! The lines that the middle of the beam follows to cut one star of slits.
//!
//! Up to three slits leave a lattice vertex at 120° to each other. Each is an [`Arm`]: a straight shaft, and at its end,
//! where a wide tip is asked for, a loop around what falls out. Where corners are rounded, arcs join neighbouring arms
//! tangentially; between three arms nothing is left of the vertex then, and the shafts begin where the arcs do.

use kurbo::{Point, Vec2};

use super::sheet::{SheetMetadata, Slit, Tip};
use crate::base::curve::{Curve, Piece};

/// Half the angle at which a teardrop opens, radians.
const TEARDROP: f64 = std::f64::consts::FRAC_PI_6;

/// Neighbouring arms stand at 120°; in a drawing that somebody edited, at that within about a degree.
const THIRD_COSINE: f64 = -0.5;
const THIRD_SLACK: f64 = 0.02;

/// One slit of a star.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Straight, from the star to where the tip begins.
    pub shaft: Curve,
    /// Around a wide tip: from the shaft's end back to it.
    pub tip: Option<Curve>,
    /// Outwards, of length 1.
    pub direction: Vec2,
    /// Distances from the star's centre between which no ligament is beside the arm, millimetres: where a wide pierce
    /// may be.
    pub free_mm: (f64, f64),
}

impl Arm {
    /// From the star outwards, around the tip.
    pub fn outwards(&self) -> Curve {
        let mut line = self.shaft.clone();
        if let Some(tip) = &self.tip {
            line.join(tip);
        }
        line
    }

    /// The outer part from a distance from the centre, and the inner one from there to the star.
    pub fn split(&self, centre: Point, at_mm: f64) -> (Curve, Curve) {
        let at = centre + self.direction * at_mm;
        let (root, end) = (
            self.shaft.start().unwrap_or(centre),
            self.shaft.end().unwrap_or(at),
        );
        let mut outer = Curve::line(at, end);
        if let Some(tip) = &self.tip {
            outer.join(tip);
        }
        (outer, Curve::line(at, root))
    }
}

/// All slits with one tail.
#[derive(Clone, Debug, PartialEq)]
pub struct Star {
    /// The lattice vertex.
    pub centre: Point,
    /// Its slits, in their order.
    pub arms: Vec<Arm>,
    /// Arcs between arms: from the first one's shaft to the second one's.
    pub fillets: Vec<([usize; 2], Curve)>,
    /// With two arms and an arc between them: the sharp way through the centre, on the side that is not rounded.
    pub spokes: Option<Curve>,
}

impl Star {
    /// The star of these slits, which share a tail. `slits` must not be empty; without any, the star has no arms.
    pub fn new(slits: &[Slit], metadata: &SheetMetadata) -> Self {
        let centre = slits.first().map_or(Point::ORIGIN, |s| s.tail);
        let directions: Vec<Vec2> = slits
            .iter()
            .map(|s| {
                let d = s.tip - s.tail;
                let length = d.hypot();
                if length > 0.0 { d / length } else { Vec2::ZERO }
            })
            .collect();
        let half = 0.5 * metadata.kerf_mm;
        let fillet_mm = metadata.corner_radius_mm + half;
        let begin_mm = fillet_mm / 3f64.sqrt();
        let mut fillets = Vec::new();
        if metadata.corner_radius_mm > 0.0 {
            for i in 0..slits.len() {
                for j in i + 1..slits.len() {
                    let (u, v) = (directions[i], directions[j]);
                    if (u.dot(v) - THIRD_COSINE).abs() > THIRD_SLACK {
                        continue;
                    }
                    // Inwards along one arm, outwards along the other: a turn by 60° away from the centre.
                    let turn = (-u).cross(v).atan2((-u).dot(v));
                    let arc = Piece::new(
                        centre + u * begin_mm,
                        centre + v * begin_mm,
                        (0.25 * turn).tan(),
                    );
                    fillets.push(([i, j], Curve::of_pieces([arc])));
                }
            }
        }
        // Between three arms the middle falls out; between two it stays on the unrounded side.
        let hollow = fillets.len() == 3;
        let spokes = (fillets.len() == 1).then(|| {
            let [i, j] = fillets[0].0;
            let ends = [i, j].map(|k| centre + directions[k] * begin_mm);
            Curve::polyline([ends[0], centre, ends[1]], false)
        });
        let arms = slits
            .iter()
            .zip(&directions)
            .enumerate()
            .map(|(n, (slit, &d))| {
                let joined = fillets.iter().any(|(of, _)| of.contains(&n));
                let root_mm = if joined && (hollow || spokes.is_some()) {
                    begin_mm
                } else {
                    0.0
                };
                arm(slit, d, root_mm, metadata)
            })
            .collect();
        Self {
            centre,
            arms,
            fillets,
            spokes,
        }
    }

    /// Every line that must be cut, each once.
    pub fn lines(&self) -> impl Iterator<Item = Curve> + '_ {
        let arms = self.arms.iter().map(Arm::outwards);
        let fillets = self.fillets.iter().map(|(_, arc)| arc.clone());
        arms.chain(fillets).chain(self.spokes.clone())
    }
}

fn arm(slit: &Slit, d: Vec2, root_mm: f64, metadata: &SheetMetadata) -> Arm {
    let whole = slit.tail.distance(slit.tip);
    let half = 0.5 * metadata.kerf_mm;
    let radius = metadata.tip.radius_mm(metadata.kerf_mm);
    // The middle of the beam goes around half a kerf inside the finished edge.
    let around = radius - half;
    let (back, tip) = if around <= 0.0 || metadata.tip == Tip::Plain || slit.through {
        (0.0, None)
    } else {
        let back = base_mm(metadata.tip, around).min(0.9 * whole);
        (back, Some(loop_at(slit.tip, d, around, metadata.tip, back)))
    };
    let neck = metadata.neck_mm();
    Arm {
        shaft: Curve::line(slit.tail + d * root_mm, slit.tip - d * back),
        tip,
        direction: d,
        free_mm: ((0.5 * neck).max(root_mm), whole - back.max(radius)),
    }
}

/// How far before the centre of a tip the slit begins to widen.
fn base_mm(tip: Tip, around_mm: f64) -> f64 {
    match tip {
        Tip::Plain => 0.0,
        Tip::Round { .. } => around_mm,
        Tip::Teardrop { .. } => around_mm / TEARDROP.sin(),
    }
}

/// How far a tip with its loop reaches back from its centre, millimetres: a slit must be longer.
pub(super) fn tip_reach_mm(metadata: &SheetMetadata) -> f64 {
    let around = metadata.tip.radius_mm(metadata.kerf_mm) - 0.5 * metadata.kerf_mm;
    base_mm(metadata.tip, around.max(0.0))
}

fn loop_at(centre: Point, d: Vec2, around: f64, tip: Tip, back: f64) -> Curve {
    let from = centre - d * back;
    let left = Vec2::new(-d.y, d.x);
    if matches!(tip, Tip::Round { .. }) || back <= around {
        let far = centre + d * around;
        let near = centre - d * around;
        return Curve::of_pieces([Piece::new(near, far, 1.0), Piece::new(far, near, 1.0)]);
    }
    // Where the tangents from `from` touch the circle.
    let sine = (around / back).min(1.0);
    let cosine = (1.0 - sine * sine).sqrt();
    let touch = |side: f64| centre - d * (around * sine) + left * (side * around * cosine);
    let sweep = std::f64::consts::PI + 2.0 * sine.asin();
    Curve::of_pieces([
        Piece::new(from, touch(-1.0), 0.0),
        Piece::new(touch(-1.0), touch(1.0), (0.25 * sweep).tan()),
        Piece::new(touch(1.0), from, 0.0),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage};
    use crate::pattern::{Sheet, SheetOptions};

    fn full_star(tip: Tip, corner_radius_mm: f64) -> (Star, SheetMetadata) {
        let linkage = Linkage::patch(12.0, Handedness::Right, &Linkage::hexagon_cells(2));
        let options = SheetOptions {
            tip,
            corner_radius_mm,
            ..SheetOptions::plain(1.0, 0.2)
        };
        let sheet = Sheet::new(&linkage, &options).unwrap();
        let slits = sheet
            .slits
            .chunk_by(|a, b| a.star == b.star)
            .find(|s| s.len() == 3)
            .unwrap();
        (Star::new(slits, &sheet.metadata), sheet.metadata)
    }

    #[test]
    fn a_wide_tip_is_a_closed_loop_that_turns_once_around_its_centre() {
        for tip in [
            Tip::Round { radius_mm: 0.5 },
            Tip::Teardrop { radius_mm: 0.5 },
        ] {
            let (star, metadata) = full_star(tip, 0.0);
            for arm in &star.arms {
                let around = arm.tip.as_ref().unwrap();
                assert!(around.start().unwrap().distance(around.end().unwrap()) < 1e-9);
                assert!(arm.shaft.end().unwrap().distance(around.start().unwrap()) < 1e-9);
                let mut closed = around.clone();
                closed.vertices.pop();
                closed.closed = true;
                let r = 0.5 - 0.5 * metadata.kerf_mm;
                // Round: a circle. Teardrop: 210° + 2 · tangent triangles of r · r√3 / 2.
                let wanted = match tip {
                    Tip::Round { .. } => std::f64::consts::PI * r * r,
                    _ => (2.0 / 3.0 * std::f64::consts::PI + 3f64.sqrt()) * r * r,
                };
                assert!((closed.signed_area() - wanted).abs() < 1e-9);
                assert!(arm.free_mm.0 < arm.free_mm.1);
            }
        }
    }

    #[test]
    fn fillets_touch_both_arms_along_their_direction() {
        let (star, metadata) = full_star(Tip::Plain, 0.7);
        assert_eq!(star.fillets.len(), 3);
        for ([i, j], arc) in &star.fillets {
            let piece = arc.pieces().next().unwrap();
            assert!((piece.arc().unwrap().radius - 0.7 - 0.5 * metadata.kerf_mm).abs() < 1e-9);
            assert!((piece.direction(0.0) + star.arms[*i].direction).hypot() < 1e-9);
            assert!((piece.direction(1.0) - star.arms[*j].direction).hypot() < 1e-9);
            assert!(star.arms[*i].shaft.start().unwrap().distance(piece.from) < 1e-9);
        }
    }
}
