//! The closest point on a surface, by a tree of boxes over its triangles.
//!
//! Nodes lie in one flat array, triangles are copied in the order of the leaves, and a query walks with a small stack
//! of its own: nothing is allocated. Among equally close faces the lowest id wins, and pruning leaves room for
//! rounding, so that the answer depends neither on the order of the walk nor on a hint.

mod tracker;

use nalgebra::{Point3, Vector3};

pub use tracker::ClosestTracker;

use super::surface::{FaceId, Surface};
use crate::base::ids::{Id as _, Per};

/// Triangles in a leaf: below four, walking costs more than testing.
const LEAF: usize = 4;

/// Depth of the tree at the most: it halves, and there are fewer than 2³² faces.
const DEPTH: usize = 40;

/// Relative slack on squared distances when pruning, many times their rounding (about 10 · 2⁻⁵³).
const SLACK: f64 = 1e-13;

/// Which part of the triangle is closest (Ericson, Real-Time Collision Detection, §5.1.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Its inside: the connection is perpendicular to the face.
    Inside,
    /// Its side `k`, from corner `k` to corner `k + 1`.
    Side(u8),
    /// Its corner `k`.
    Corner(u8),
}

/// A closest point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Where it is, in millimetres.
    pub point: Point3<f64>,
    /// A face that it lies in; the lowest id if there are several at exactly the same distance.
    pub face: FaceId,
    /// Weights of the face's corners; they are not negative and sum to 1.
    pub barycentric: [f64; 3],
    /// Distance from the query, in millimetres.
    pub distance: f64,
    /// What part of the face it lies on.
    pub feature: Feature,
}

#[derive(Clone, Copy)]
struct Node {
    low: Point3<f64>,
    high: Point3<f64>,
    /// A leaf: its first triangle. Otherwise: its right child; the left one is the next node.
    at: u32,
    /// Triangles in a leaf; 0 for an inner node.
    count: u32,
}

impl Node {
    #[inline]
    fn distance_squared(&self, p: &Point3<f64>) -> f64 {
        let outside = |k: usize| (self.low[k] - p[k]).max(p[k] - self.high[k]).max(0.0);
        let (x, y, z) = (outside(0), outside(1), outside(2));
        x * x + y * y + z * z
    }
}

#[derive(Clone, Copy)]
struct Triangle {
    corners: [Point3<f64>; 3],
    face: FaceId,
}

/// A triangle with what of it is closest.
#[derive(Clone, Copy)]
struct Candidate {
    hit: Hit,
    face: FaceId,
    slot: u32,
}

impl Candidate {
    /// The closer one; of equally close ones that with the lower id.
    #[inline]
    fn or(self, other: Self) -> Self {
        if (other.hit.squared, other.face) < (self.hit.squared, self.face) {
            other
        } else {
            self
        }
    }
}

/// Answers closest-point queries on one surface. Building is O(n log n).
pub struct ClosestPoint {
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
    slots: Per<FaceId, u32>,
}

impl ClosestPoint {
    /// Builds the tree. The surface is copied as far as needed.
    pub fn new(surface: &Surface) -> Self {
        let mut triangles: Vec<Triangle> = surface
            .faces()
            .ids()
            .map(|face| Triangle {
                corners: surface.corners(face),
                face,
            })
            .collect();
        let mut nodes = Vec::with_capacity(triangles.len());
        build(&mut triangles, 0, &mut nodes);
        let mut slots = Per::filled(triangles.len(), 0);
        for (slot, triangle) in triangles.iter().enumerate() {
            slots[triangle.face] = slot as u32;
        }
        Self {
            nodes,
            triangles,
            slots,
        }
    }

    /// The point of the surface closest to `p` (mm).
    pub fn query(&self, p: Point3<f64>) -> Closest {
        self.finish(self.search(&p, self.slots[FaceId(0)]))
    }

    /// As [`ClosestPoint::query`], and with the same answer, but faster if `hint` is a face close to it, such as the
    /// one found for the same point before it moved. A face that does not exist is ignored.
    pub fn query_from(&self, p: Point3<f64>, hint: FaceId) -> Closest {
        let known = hint.index() < self.slots.len();
        let first = self.slots[if known { hint } else { FaceId(0) }];
        self.finish(self.search(&p, first))
    }

    /// Outward unit normal of a face; zero if the face has no area.
    pub fn normal(&self, face: FaceId) -> Vector3<f64> {
        let [a, b, c] = self.triangles[self.slots[face] as usize].corners;
        (b - a)
            .cross(&(c - a))
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::zeros)
    }

    /// The best of triangle `slot`, as seen from `p`.
    #[inline]
    fn candidate(&self, p: &Point3<f64>, slot: u32) -> Candidate {
        let triangle = &self.triangles[slot as usize];
        Candidate {
            hit: on_triangle(&triangle.corners, p),
            face: triangle.face,
            slot,
        }
    }

    /// Starts from the triangle at `first`.
    fn search(&self, p: &Point3<f64>, first: u32) -> Candidate {
        let mut best = self.candidate(p, first);
        let mut stack = [(0u32, 0.0f64); DEPTH];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (node, bound) = stack[depth];
            if bound > best.hit.squared * (1.0 + SLACK) {
                continue;
            }
            let mut here = node as usize;
            loop {
                let node = &self.nodes[here];
                if node.count > 0 {
                    for slot in node.at..node.at + node.count {
                        best = best.or(self.candidate(p, slot));
                    }
                    break;
                }
                let (left, right) = (here + 1, node.at as usize);
                let to_left = self.nodes[left].distance_squared(p);
                let to_right = self.nodes[right].distance_squared(p);
                let (near, far) = if to_left <= to_right {
                    ((left, to_left), (right, to_right))
                } else {
                    ((right, to_right), (left, to_left))
                };
                let limit = best.hit.squared * (1.0 + SLACK);
                if far.1 <= limit && depth < DEPTH {
                    stack[depth] = (far.0 as u32, far.1);
                    depth += 1;
                }
                if near.1 > limit {
                    break;
                }
                here = near.0;
            }
        }
        best
    }

    fn finish(&self, Candidate { hit, face, slot }: Candidate) -> Closest {
        let corners = &self.triangles[slot as usize].corners;
        Closest {
            point: match hit.feature {
                Feature::Corner(k) => corners[k as usize],
                _ => combine(corners, hit.barycentric),
            },
            face,
            barycentric: hit.barycentric,
            distance: hit.squared.sqrt(),
            feature: hit.feature,
        }
    }
}

/// Appends the nodes of these triangles, which start at `first` in the whole list, and sorts them by leaf.
fn build(triangles: &mut [Triangle], first: usize, nodes: &mut Vec<Node>) {
    let mut low = Point3::from([f64::INFINITY; 3]);
    let mut high = Point3::from([f64::NEG_INFINITY; 3]);
    for p in triangles.iter().flat_map(|t| &t.corners) {
        (low, high) = (low.inf(p), high.sup(p));
    }
    let here = nodes.len();
    nodes.push(Node {
        low,
        high,
        at: first as u32,
        count: triangles.len() as u32,
    });
    if triangles.len() <= LEAF {
        return;
    }
    let axis = (high - low).imax();
    let middle = triangles.len() / 2;
    let key = |t: &Triangle| t.corners.iter().map(|c| c[axis]).sum::<f64>();
    triangles.select_nth_unstable_by(middle, |a, b| {
        key(a).total_cmp(&key(b)).then(a.face.cmp(&b.face))
    });
    let (left, right) = triangles.split_at_mut(middle);
    build(left, first, nodes);
    nodes[here].at = nodes.len() as u32;
    nodes[here].count = 0;
    build(right, first + middle, nodes);
}

#[derive(Clone, Copy)]
struct Hit {
    squared: f64,
    barycentric: [f64; 3],
    feature: Feature,
}

fn combine(corners: &[Point3<f64>; 3], weights: [f64; 3]) -> Point3<f64> {
    let [a, b, c] = corners;
    a + (b - a) * weights[1] + (c - a) * weights[2]
}

/// Distance of a point from one triangle, in the units of its corners.
pub fn distance_to_triangle(corners: &[Point3<f64>; 3], p: &Point3<f64>) -> f64 {
    on_triangle(corners, p).squared.sqrt()
}

/// Ericson's regions: first the corners, then the sides, then the inside.
#[inline]
fn on_triangle(corners: &[Point3<f64>; 3], p: &Point3<f64>) -> Hit {
    let [a, b, c] = corners;
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let at = |barycentric: [f64; 3], feature| {
        let gap: Vector3<f64> = ap - ab * barycentric[1] - ac * barycentric[2];
        Hit {
            squared: gap.norm_squared(),
            barycentric,
            feature,
        }
    };
    // Measured from the corner itself, so that all faces around a vertex tie exactly.
    let at_corner = |k: usize, gap: Vector3<f64>| {
        let mut barycentric = [0.0; 3];
        barycentric[k] = 1.0;
        Hit {
            squared: gap.norm_squared(),
            barycentric,
            feature: Feature::Corner(k as u8),
        }
    };
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return at_corner(0, ap);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return at_corner(1, bp);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return at([1.0 - t, t, 0.0], Feature::Side(0));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return at_corner(2, cp);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return at([1.0 - t, 0.0, t], Feature::Side(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return at([0.0, 1.0 - t, t], Feature::Side(1));
    }
    let sum = va + vb + vc;
    let (v, w) = (vb / sum, vc / sum);
    at([(1.0 - v - w).max(0.0), v, w], Feature::Inside)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Sample;

    fn brute(surface: &Surface, p: Point3<f64>) -> (f64, FaceId) {
        surface
            .faces()
            .ids()
            .map(|f| (on_triangle(&surface.corners(f), &p).squared, f))
            .fold(
                (f64::INFINITY, FaceId(0)),
                |best, d| if d < best { d } else { best },
            )
    }

    proptest! {
        #![proptest_config(crate::base::cases::cases(24))]
        #[test]
        fn it_agrees_with_trying_every_face_whatever_the_hint(
            which in 0usize..10,
            p in prop::array::uniform3(-150.0..150.0f64),
            hint in 0u32..700,
        ) {
            let sample = Sample::all()[which];
            let surface = Sample::parse(&format!("{}:faces=600", sample.name())).unwrap().generate().unwrap();
            let tree = ClosestPoint::new(&surface);
            let p = Point3::from(p);
            let found = tree.query(p);
            let (squared, face) = brute(&surface, p);
            prop_assert_eq!((found.distance, found.face), (squared.sqrt(), face));
            prop_assert_eq!(found, tree.query_from(p, FaceId(hint)));
            prop_assert!(((p - found.point).norm() - found.distance).abs() < 1e-9);
            prop_assert!(found.barycentric.iter().all(|w| *w >= 0.0));
            prop_assert!((found.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let zeros = found.barycentric.iter().filter(|w| **w == 0.0).count();
            match found.feature {
                Feature::Inside => {
                    let normal = surface.face_normal_doubled(found.face).normalize();
                    let gap = p - found.point;
                    prop_assert!(gap.cross(&normal).norm() < 1e-6);
                }
                Feature::Side(k) => prop_assert!(zeros >= 1 && found.barycentric[(k as usize + 2) % 3] == 0.0),
                Feature::Corner(k) => prop_assert_eq!(found.barycentric[k as usize], 1.0),
            }
        }
    }

    #[test]
    fn a_vertex_belongs_to_the_lowest_of_its_faces() {
        let surface = Sample::parse("octasphere:faces=200")
            .unwrap()
            .generate()
            .unwrap();
        let tree = ClosestPoint::new(&surface);
        for (vertex, p) in surface.positions().iter_ids() {
            let lowest = surface.around(vertex).map(|h| h.face()).min().unwrap();
            let found = tree.query(p + p.coords);
            assert_eq!(found.face, lowest);
            assert!(matches!(found.feature, Feature::Corner(_)));
            assert!((found.point - p).norm() < 1e-12);
        }
    }

    #[test]
    fn points_on_the_surface_are_at_distance_zero() {
        let surface = Sample::parse("torus:faces=5000")
            .unwrap()
            .generate()
            .unwrap();
        let tree = ClosestPoint::new(&surface);
        for face in surface.faces().ids() {
            let [a, b, c] = surface.corners(face);
            let p = Point3::from((a.coords + b.coords + c.coords) / 3.0);
            let found = tree.query_from(p, FaceId(u32::MAX));
            assert_eq!((found.face, found.feature), (face, Feature::Inside));
            assert!(found.distance < 1e-12);
        }
    }
}
