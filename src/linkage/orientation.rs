//! Which way the lattice lies, where nothing else decides: so that rims cost few triangles, a straight hem runs along a
//! row of them, and a symmetric sheet gets a symmetric outline.
//!
//! The lattice comes back to itself after 60°, so the angles of one sixth are tried. First those that let the rims pass
//! through fewest triangles, which takes a walk along the rims; then the best of them, and the directions of hem and
//! mirror, with all that laying a lattice involves. (The slits are chiral: only the outline can be symmetric.)

use std::f64::consts::{PI, TAU};

use nalgebra::{Point2, Vector2};

use super::LinkageError;
use super::clip;
use super::lattice::{Key, Lattice};
use super::types::Handedness;
use crate::base::progress::Progress;
use crate::conformal::Layout;
use crate::mesh::{HalfedgeId, Surface};

/// Directions of the first look: 0.5° moves the ends of a sheet of 100 triangles' width by half a triangle.
const FIRST: usize = 120;

/// The best of them that are laid. A lattice of 2500 triangles takes some milliseconds.
const LAID: usize = 6;

/// Lattices that keep the same number of triangles up to this part count as equal, and the look of the rim decides:
/// one triangle in 200 is worth a straight hem.
const EQUAL: f64 = 0.005;

/// A direction that is off by less is followed, radians: 0.1° is a fifth of a triangle over 100.
const FOLLOWED: f64 = 0.1 * PI / 180.0;

/// A stretch of a rim is straight while it turns by less than this in all, radians.
const STRAIGHT: f64 = 5.0 * PI / 180.0;

/// A shorter straight stretch, in L, is no hem.
const HEM: f64 = 5.0;

/// Points of an outline that are compared with their mirror images, and axes tried.
const MIRROR_POINTS: usize = 180;

/// Outline and mirror image may differ by this much on average, in L, and other axes must do this many times worse: all
/// axes are a circle's.
const MIRROR_GAP: f64 = 0.15;
const MIRROR_CLEAR: f64 = 3.0;

/// Directions, radians, that a lattice may go by.
struct Guides {
    /// Of the longest straight stretch of a rim.
    hem: Option<f64>,
    /// Of the axis of a symmetric outline.
    axis: Option<f64>,
}

impl Guides {
    /// How well a lattice follows: a hem along a row counts 2, an axis along or across one 1.
    fn followed(&self, angle: f64) -> u32 {
        let near = |guide: Option<f64>, period: f64| {
            let off = |g: f64| ((g - angle) / period - ((g - angle) / period).round()) * period;
            guide.is_some_and(|g| off(g).abs() < FOLLOWED)
        };
        2 * u32::from(near(self.hem, PI / 3.0)) + u32::from(near(self.axis, PI / 6.0))
    }
}

/// Number of triangles of the linkage that a lattice leaves, none taken away at cones.
pub(super) fn kept(
    surface: &Surface,
    layout: &Layout,
    lattice: &Lattice,
    edge_mm: f64,
    progress: &dyn Progress,
) -> Result<usize, LinkageError> {
    // Neither the slits' direction nor a smooth rim changes which way suits the seams.
    let size = (edge_mm, Handedness::Right);
    let laid = clip::lay(surface, layout, lattice, size, None, progress)?;
    Ok(clip::core(&laid, |_| true).0.len())
}

/// The direction, in degrees within ±30, of a lattice of edge `edge_mm` with a vertex at the chart's origin: 0 where
/// there is no rim to go by.
pub(super) fn search(
    surface: &Surface,
    layout: &Layout,
    edge_mm: f64,
    progress: &dyn Progress,
) -> Result<f64, LinkageError> {
    let rims = rims(surface, layout);
    if rims.is_empty() || layout.area_mm2() > super::MOST_TRIANGLES as f64 * edge_mm * edge_mm {
        return Ok(0.0);
    }
    let points: Vec<Point2<f64>> = rims
        .iter()
        .flat_map(|r| sampled(r, edge_mm / 6.0))
        .collect();
    let step = PI / 3.0 / FIRST as f64;
    let mut first: Vec<(usize, usize)> = (0..FIRST)
        .map(|n| {
            let lattice = Lattice::new(edge_mm, n as f64 * step - PI / 6.0);
            (crossed(&lattice, &points), n)
        })
        .collect();
    first.sort_unstable();
    let guides = Guides {
        hem: hem(&rims, HEM * edge_mm),
        axis: if layout.segments.is_empty() {
            axis(&points, edge_mm)
        } else {
            None
        },
    };
    let mut angles: Vec<f64> = vec![0.0];
    angles.extend(guides.hem);
    angles.extend(guides.axis.iter().flat_map(|a| [*a, a + PI / 6.0]));
    // Neighbours of a good direction are as good; take the best of each neighbourhood.
    let mut taken: Vec<usize> = Vec::new();
    for &(_, n) in &first {
        let apart = |m: &usize| {
            let gap = n.abs_diff(*m);
            gap.min(FIRST - gap) > 2
        };
        if taken.len() < LAID && taken.iter().all(apart) {
            taken.push(n);
        }
    }
    angles.extend(taken.iter().map(|&n| n as f64 * step - PI / 6.0));
    let mut found: Vec<(usize, u32, f64)> = Vec::new();
    for angle in angles {
        progress.check()?;
        let within = angle - (angle / (PI / 3.0)).round() * (PI / 3.0);
        // No longer in a design file than it need be: over 100 triangles the rest is a hundredth of one.
        let deg = (within.to_degrees() * 100.0).round() / 100.0;
        let lattice = Lattice::new(edge_mm, deg.to_radians());
        let count = kept(surface, layout, &lattice, edge_mm, progress)?;
        found.push((count, guides.followed(angle), deg));
    }
    let most = found.iter().map(|f| f.0).max().unwrap_or(0) as f64;
    found.retain(|f| f.0 as f64 >= most * (1.0 - EQUAL));
    found.sort_by(|a, b| {
        (b.1, b.0)
            .cmp(&(a.1, a.0))
            .then(a.2.abs().total_cmp(&b.2.abs()))
    });
    Ok(found.first().map_or(0.0, |f| f.2))
}

/// The rims as they lie on the chart: a polyline from seam to seam, closed (first point last) where no seam meets it.
fn rims(surface: &Surface, layout: &Layout) -> Vec<Vec<Point2<f64>>> {
    let mut lines = Vec::new();
    for rim in surface.rims() {
        let mut line: Vec<Point2<f64>> = Vec::new();
        for (i, &tail) in rim.iter().enumerate() {
            let head = rim[(i + 1) % rim.len()];
            let side = surface
                .around(tail)
                .find(|&h| surface.head(h) == head && surface.twin(h).is_none());
            let Some(h) = side else { continue };
            let [a, b] = ends(layout, h);
            // A rim runs on where it is the same point of the chart.
            if line
                .last()
                .is_some_and(|p| (p - a).norm() > 1e-9 * (b - a).norm())
            {
                lines.push(std::mem::take(&mut line));
            }
            if line.is_empty() {
                line.push(a);
            }
            line.push(b);
        }
        lines.push(line);
    }
    lines.retain(|line| line.len() > 1);
    lines
}

fn ends(layout: &Layout, h: HalfedgeId) -> [Point2<f64>; 2] {
    let corners = &layout.corners[h.face()];
    [corners[h.corner()], corners[(h.corner() + 1) % 3]]
}

/// Points along a polyline no farther than `step` from each other.
fn sampled(line: &[Point2<f64>], step: f64) -> Vec<Point2<f64>> {
    let mut points = Vec::new();
    for pair in line.windows(2) {
        let along = pair[1] - pair[0];
        let count = (along.norm() / step).ceil().max(1.0);
        points.extend((0..count as usize).map(|i| pair[0] + along * (i as f64 / count)));
    }
    points
}

/// Number of lattice triangles that hold one of the points.
fn crossed(lattice: &Lattice, points: &[Point2<f64>]) -> usize {
    let mut keys: Vec<Key> = points.iter().map(|&p| lattice.key_at_centroid(p)).collect();
    keys.sort_unstable();
    keys.dedup();
    keys.len()
}

/// Direction of the longest stretch of at least `least_mm` that turns by less than [`STRAIGHT`].
fn hem(rims: &[Vec<Point2<f64>>], least_mm: f64) -> Option<f64> {
    let mut best: Option<(f64, f64)> = None;
    for line in rims {
        // A closed one goes round once more, so that no stretch is split at its beginning.
        let closed = (line[0] - line[line.len() - 1]).norm() < 1e-9 * least_mm;
        let again = if closed { line.len() - 1 } else { 0 };
        let sides: Vec<Vector2<f64>> = line.windows(2).map(|p| p[1] - p[0]).collect();
        let side = |i: usize| sides[i % sides.len()];
        for start in 0..sides.len() {
            let first = side(start).y.atan2(side(start).x);
            let (mut low, mut high, mut chord) = (0.0f64, 0.0f64, Vector2::zeros());
            for i in start..(sides.len() + again).min(start + sides.len()) {
                let turn = side(i).y.atan2(side(i).x) - first;
                let turn = turn - (turn / TAU).round() * TAU;
                (low, high) = (low.min(turn), high.max(turn));
                if high - low > STRAIGHT {
                    break;
                }
                chord += side(i);
            }
            let length = chord.norm();
            if length >= least_mm && best.is_none_or(|b| length > b.0 * (1.0 + 1e-9)) {
                best = Some((length, chord.y.atan2(chord.x)));
            }
        }
    }
    best.map(|b| b.1)
}

/// Direction of the line through the middle of the outline about which it is its own mirror image, if there is one and
/// it does not matter little.
fn axis(points: &[Point2<f64>], edge_mm: f64) -> Option<f64> {
    let middle = points.iter().map(|p| p.coords).sum::<Vector2<f64>>() / points.len() as f64;
    let few = MIRROR_POINTS.min(points.len());
    let outline: Vec<Vector2<f64>> = (0..few)
        .map(|i| points[i * points.len() / few].coords - middle)
        .collect();
    // Mean distance of the mirror images from the outline.
    let gap = |angle: f64| -> f64 {
        let (sin, cos) = (2.0 * angle).sin_cos();
        let nearest = |p: &Vector2<f64>| {
            let image = Vector2::new(cos * p.x + sin * p.y, sin * p.x - cos * p.y);
            segments(&outline)
                .map(|(a, b)| distance(image, a, b))
                .fold(f64::INFINITY, f64::min)
        };
        outline.iter().map(nearest).sum::<f64>() / few as f64
    };
    let step = PI / 90.0;
    let gaps: Vec<f64> = (0..90).map(|n| gap(f64::from(n) * step)).collect();
    let best = (0..90).min_by(|&a, &b| gaps[a].total_cmp(&gaps[b]))?;
    let typical = gaps.iter().sum::<f64>() / 90.0;
    // Between the neighbours of the best, by thirds.
    let (mut low, mut high) = (best as f64 * step - step, best as f64 * step + step);
    for _ in 0..20 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if gap(a) < gap(b) {
            high = b;
        } else {
            low = a;
        }
    }
    let at = 0.5 * (low + high);
    let found = gap(at);
    (found < MIRROR_GAP * edge_mm && typical > MIRROR_CLEAR * found.max(0.05 * edge_mm))
        .then_some(at)
}

/// The sides of a closed outline.
fn segments(outline: &[Vector2<f64>]) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> + '_ {
    (0..outline.len()).map(|i| (outline[i], outline[(i + 1) % outline.len()]))
}

fn distance(p: Vector2<f64>, a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    let along = b - a;
    let part = (p - a).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
    (p - a - along * part.clamp(0.0, 1.0)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::progress::Silent;
    use crate::conformal::{ConeRequest, FlattenOptions, Sizing, flatten};
    use crate::mesh::Sample;

    fn turned(points: &[(f64, f64)], angle: f64) -> Vec<Point2<f64>> {
        let turn = nalgebra::Rotation2::new(angle);
        points
            .iter()
            .map(|p| turn * Point2::new(p.0, p.1))
            .collect()
    }

    /// An arrowhead: one of its two long sides is the hem, its axis stands on the base.
    #[test]
    fn hem_and_axis_of_an_arrowhead_turn_with_it() {
        let outline = [(-50.0, 0.0), (50.0, 0.0), (0.0, 95.0), (-50.0, 0.0)];
        for angle in [0.0, 0.3, 1.2, 2.9] {
            let line = turned(&outline, angle);
            let period = |x: f64| x - (x / PI).round() * PI;
            let found = hem(std::slice::from_ref(&line), 20.0).unwrap();
            let side = (95f64).atan2(-50.0) + angle;
            let other = (-95f64).atan2(-50.0) + angle;
            assert!(period(found - side).abs().min(period(found - other).abs()) < 1e-9);
            let across = axis(&sampled(&line, 1.0), 5.0).unwrap();
            assert!(period(across - angle - PI / 2.0).abs() < 0.01, "{across}");
            assert!(hem(std::slice::from_ref(&line), 150.0).is_none());
        }
    }

    /// All axes are a circle's, no axis a crooked quadrilateral's.
    #[test]
    fn a_circle_and_a_crooked_shape_have_no_axis() {
        let circle: Vec<Point2<f64>> = (0..360)
            .map(|n| f64::from(n).to_radians().sin_cos())
            .map(|(sin, cos)| Point2::new(80.0 * cos, 80.0 * sin))
            .collect();
        assert_eq!(axis(&circle, 5.0), None);
        let crooked = turned(
            &[
                (0.0, 0.0),
                (90.0, 10.0),
                (60.0, 70.0),
                (-40.0, 50.0),
                (0.0, 0.0),
            ],
            0.4,
        );
        assert_eq!(axis(&sampled(&crooked, 1.0), 5.0), None);
    }

    /// The direction found leaves at least as much of a saddle as any of a finer search, but for the part that a
    /// symmetric outline may cost.
    #[test]
    fn no_direction_keeps_clearly_more_of_a_saddle() {
        let surface = Sample::parse("saddle:faces=3000")
            .unwrap()
            .generate()
            .unwrap();
        let options = FlattenOptions {
            sigma: 2.0,
            sizing: Sizing::Triangles(600.0),
            cone_clearance: 0.7,
        };
        let flat = flatten(&surface, &ConeRequest::Auto, &options, &Silent).unwrap();
        let found = search(&surface, &flat.layout, flat.edge_mm, &Silent).unwrap();
        let count = |deg: f64| {
            let lattice = Lattice::new(flat.edge_mm, deg.to_radians());
            kept(&surface, &flat.layout, &lattice, flat.edge_mm, &Silent).unwrap() as f64
        };
        let best = (-15..15)
            .map(|n| count(2.0 * f64::from(n)))
            .fold(0.0, f64::max);
        assert!(
            count(found) >= 0.99 * best,
            "{} at {found}° against {best}",
            count(found)
        );
    }
}
