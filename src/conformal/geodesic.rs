//! Straight ways over a surface.
//!
//! The shortest way along edges goes off to one side wherever the mesh has no edges in its direction, and in a regular
//! mesh there are many of the same length. A straight way crosses faces: from its start it goes down the distance from
//! its goal, face by face. Over each edge the distances of the two ends place the goal in the plane of the face, as they
//! do when they are computed ([`super::distance`]), and the way crosses the edge in a straight line to it.

use nalgebra::Point3;

use super::distance::from_vertices;
use super::{ConformalError, Dart};
use crate::base::ids::Per;
use crate::mesh::{FaceId, HalfedgeId, Surface, VertexId};

/// The part of a way that lies on one face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    /// The face; one of two where the way follows an edge.
    pub face: FaceId,
    /// Where it begins, millimetres.
    pub from: Point3<f64>,
    /// Where it ends, millimetres.
    pub to: Point3<f64>,
}

impl Stretch {
    /// Distance of a point of space from it, millimetres.
    pub fn distance_mm(&self, point: Point3<f64>) -> f64 {
        let (way, there) = (self.to - self.from, point - self.from);
        let part = (there.dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
        // Without length it is its beginning.
        let part = if part.is_nan() { 0.0 } else { part };
        (there - way * part).norm()
    }
}

/// A crossing this near to the end of an edge, in lengths of the edge, is the vertex there.
const AT_END: f64 = 1e-6;

/// A straight way from one vertex to another; along edges where the distances lead nowhere, as they may in needles.
///
/// # Errors
/// [`ConformalError::NoSuchVertex`], [`ConformalError::DartTooShort`] if no way leads there.
pub(crate) fn straight_way(
    surface: &Surface,
    from: VertexId,
    to: VertexId,
) -> Result<Vec<Stretch>, ConformalError> {
    let stops = vec![from, to];
    let edges = Dart { stops }.edges(surface)?;
    let distance = from_vertices(surface, std::iter::once((to, 0.0)));
    Ok(descend(surface, &distance, from, to).unwrap_or_else(|| {
        let along = |h: &HalfedgeId| Stretch {
            face: h.face(),
            from: surface.position(surface.tail(*h)),
            to: surface.position(surface.head(*h)),
        };
        edges.iter().map(along).collect()
    }))
}

/// Where a way has come to.
enum At {
    Vertex(VertexId),
    /// On the side of the face that it enters.
    Side(HalfedgeId),
}

/// Goes down the distances; none if they rise.
fn descend(
    surface: &Surface,
    distance: &Per<VertexId, f64>,
    from: VertexId,
    to: VertexId,
) -> Option<Vec<Stretch>> {
    let mut way = Vec::new();
    let (mut at, mut point, mut left) = (At::Vertex(from), surface.position(from), distance[from]);
    loop {
        let sides: Vec<HalfedgeId> = match at {
            At::Vertex(v) if v == to => return Some(way),
            At::Vertex(v) => surface
                .around(v)
                .map(|h| HalfedgeId::side(h.face(), (h.corner() + 1) % 3))
                .collect(),
            At::Side(h) => [1, 2]
                .map(|k| HalfedgeId::side(h.face(), (h.corner() + k) % 3))
                .to_vec(),
        };
        let mut best: Option<(f64, f64, f64, HalfedgeId)> = None;
        for side in sides {
            let (part, here, rest) = crossing(surface, distance, point, side);
            if best.is_none_or(|(least, ..)| here + rest < least) {
                best = Some((here + rest, part, rest, side));
            }
        }
        let (_, part, rest, side) = best?;
        if rest.is_nan() || rest >= left {
            return None;
        }
        left = rest;
        let (tail, head) = (surface.tail(side), surface.head(side));
        let (a, b) = (surface.position(tail), surface.position(head));
        let next = a + (b - a) * part;
        way.push(Stretch {
            face: side.face(),
            from: point,
            to: next,
        });
        point = next;
        at = if part <= 0.0 {
            At::Vertex(tail)
        } else if part >= 1.0 {
            At::Vertex(head)
        } else {
            // A straight way does not leave over a rim: there the distances lead to one of its ends.
            At::Side(surface.twin(side)?)
        };
    }
}

/// Where the straight way from a point of a face crosses one of its sides, as a part of it, how far that is, and how
/// far it is from there to the goal.
fn crossing(
    surface: &Surface,
    distance: &Per<VertexId, f64>,
    point: Point3<f64>,
    side: HalfedgeId,
) -> (f64, f64, f64) {
    let (tail, head) = (surface.tail(side), surface.head(side));
    let (a, b) = (surface.position(tail), surface.position(head));
    let (near, far) = (distance[tail], distance[head]);
    let base = (b - a).norm();
    let along = (b - a) / base;
    let apex = (point - a).dot(&along);
    let height = (point - a - along * apex).norm();
    let goal = (base * base + near * near - far * far) / (2.0 * base);
    let depth = (near * near - goal * goal).max(0.0).sqrt();
    let crossing = (goal * height + apex * depth) / (height + depth);
    let mut part = (crossing / base).clamp(0.0, 1.0);
    let barred = surface.twin(side).is_none();
    if part < AT_END || barred && part < 0.5 {
        part = 0.0;
    } else if part > 1.0 - AT_END || barred {
        part = 1.0;
    }
    let x = part * base;
    let rest = match part {
        0.0 => near,
        1.0 => far,
        _ => (x - goal).hypot(depth),
    };
    (part, (x - apex).hypot(height), rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Sample;

    #[test]
    fn ways_on_a_sphere_are_great_circles() {
        let cap = Sample::parse("cap:half_angle_deg=80,faces=3000").unwrap();
        let cap = cap.generate().unwrap();
        let nearest = |x: f64, y: f64, z: f64| {
            let wanted = Point3::new(x, y, z) * 100.0;
            let far = |v: &VertexId| (cap.position(*v) - wanted).norm();
            let all = cap.positions().ids();
            all.min_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
        };
        let radius = cap.position(VertexId(0)).coords.norm();
        for (a, b) in [
            ((0.9, 0.0, 0.4), (-0.3, 0.8, 0.5)),
            ((0.7, 0.7, 0.1), (-0.7, -0.6, 0.4)),
            ((0.0, 0.0, 1.0), (0.0, 0.9, 0.4)),
        ] {
            let (from, to) = (nearest(a.0, a.1, a.2), nearest(b.0, b.1, b.2));
            let (p, q) = (cap.position(from).coords, cap.position(to).coords);
            let normal = p.cross(&q).normalize();
            let way = straight_way(&cap, from, to).unwrap();
            assert_eq!(way[0].from.coords, p);
            assert_eq!(way[way.len() - 1].to.coords, q);
            assert!(way.windows(2).all(|w| w[0].to == w[1].from));
            let length: f64 = way.iter().map(|s| (s.to - s.from).norm()).sum();
            let arc = radius * p.angle(&q);
            assert!((length / arc - 1.0).abs() < 0.01, "{length} for {arc}");
            for stretch in &way {
                let off = stretch.to.coords.dot(&normal).abs();
                assert!(off < 0.03 * radius, "{off} mm off the great circle");
            }
        }
    }

    #[test]
    fn a_way_around_a_corner_of_the_rim_keeps_to_the_surface() {
        // A square plate without its upper right quarter, from one arm to the other: over the inner corner.
        let n = 8u32;
        let point = |k: u32| Point3::new(f64::from(k % (n + 1)), f64::from(k / (n + 1)), 0.0);
        let mut faces = Vec::new();
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            if i < n / 2 || j < n / 2 {
                let v = j * (n + 1) + i;
                faces.extend([[v, v + 1, v + n + 2], [v, v + n + 2, v + n + 1]]);
            }
        }
        let used: Vec<u32> = (0..(n + 1) * (n + 1))
            .filter(|v| faces.iter().flatten().any(|w| w == v))
            .collect();
        let number = |v: u32| used.binary_search(&v).unwrap() as u32;
        let faces = faces.iter().map(|f| f.map(number)).collect();
        let plate = Surface::new(used.iter().map(|&v| point(v)).collect(), faces).unwrap();
        let at = |i: u32, j: u32| VertexId(number(j * (n + 1) + i));
        let way = straight_way(&plate, at(2, 8), at(8, 2)).unwrap();
        let length: f64 = way.iter().map(|s| (s.to - s.from).norm()).sum();
        // (2, 8) → (4, 4) → (8, 2).
        assert!((length - 2.0 * 20f64.sqrt()).abs() < 0.1, "{length}");
    }
}
