//! How good a rationalised linkage is, in numbers: measured from positions alone, whatever solver made them.

use nalgebra::{Point3, Vector3};

use super::grid::PointGrid;
use super::overlap::{OVERLAP_TOLERANCE, centroids, crossing};
use super::problem::{Condition, Problem, hinge_scale};
use crate::base::ids::Id as _;
use crate::linkage::{Linkage, PointId, TriangleId};
use crate::mesh::{ClosestPoint, Surface, distance_to_triangle};

/// A hinge that opens farther than 180° by more than this (radians) counts as over-opened.
const OPEN_SLACK: f64 = 1e-3;

/// Reach of the linkage in L: a point of the surface this near to a triangle is covered.
const COVERAGE_RADIUS: f64 = 1.0;

/// A figure with the point that has it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Worst {
    /// The figure.
    pub value: f64,
    /// The point, counted from 1 as in `linkage.obj`.
    pub point: u32,
    /// Where it is, millimetres.
    pub at_mm: [f64; 3],
}

/// What the positions of a linkage tell by themselves, without its surface. Lengths in L unless named otherwise.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Soundness {
    /// Largest relative error of an edge length.
    pub edge_error_max: f64,
    /// Root mean square of the relative edge errors.
    pub edge_error_rms: f64,
    /// Hinges whose triangles penetrate each other (conditions 3 and 4).
    pub penetrations: usize,
    /// Deepest penetration, in L.
    pub penetration_depth: Worst,
    /// Pairs of triangles without a common point that cross in space.
    pub intersections: usize,
    /// Where one of those pairs is.
    pub intersection_at: Option<Worst>,
    /// Smallest, mean and largest scale factor over the hinges.
    pub opening: [f64; 3],
    /// The hinge that is open widest.
    pub opening_max: Worst,
    /// Hinges opened past 180°.
    pub over_open: usize,
    /// Hinges over σ by more than 10⁻⁴, or opened past 180°.
    pub over_sigma: usize,
    /// The bound itself.
    pub sigma: f64,
}

impl Soundness {
    /// Measures `positions` (millimetres, by point) of a linkage whose hinges may open to `sigma`.
    pub fn measure(linkage: &Linkage, positions: &[Point3<f64>], sigma: f64) -> Self {
        let problem = Problem::new(linkage, sigma);
        let x = in_edges(linkage, positions);
        Self::of(
            linkage,
            positions,
            &problem,
            &x,
            &centroids(&problem.triangles, &x),
        )
    }

    fn of(
        linkage: &Linkage,
        positions: &[Point3<f64>],
        problem: &Problem,
        x: &[Vector3<f64>],
        centroids: &[Vector3<f64>],
    ) -> Self {
        let sigma = problem.sigma;
        let worst = |value: f64, point: usize| worst(positions, value, point);
        let (mut edge_error_max, mut edge_sum) = (0.0f64, 0.0);
        for t in &problem.triangles {
            for k in 0..3 {
                let error = ((x[t[(k + 1) % 3] as usize] - x[t[k] as usize]).norm() - 1.0).abs();
                edge_error_max = edge_error_max.max(error);
                edge_sum += error * error;
            }
        }
        let mut penetrations = 0;
        let mut penetration_depth = worst(0.0, 0);
        let mut opening = [f64::INFINITY, 0.0, 0.0];
        let mut opening_max = worst(0.0, 0);
        let (mut over_sigma, mut past_open) = (0, 0);
        for h in &problem.hinges {
            let p = h.map(|i| x[i as usize]);
            let (depth, past) = penetration(&p);
            let over_open = past > OPEN_SLACK && depth <= past;
            if depth > OVERLAP_TOLERANCE && !over_open {
                penetrations += 1;
                if depth > penetration_depth.value {
                    penetration_depth = worst(depth, h[0] as usize);
                }
            }
            let scale = hinge_scale(&p).value;
            opening[0] = opening[0].min(scale);
            opening[1] += scale / problem.hinges.len() as f64;
            if scale > opening[2] {
                opening[2] = scale;
                opening_max = worst(scale, h[0] as usize);
            }
            past_open += usize::from(over_open);
            over_sigma += usize::from(scale > sigma + SIGMA_TOLERANCE || over_open);
        }
        if problem.hinges.is_empty() {
            opening[0] = 0.0;
        }
        let (intersections, one) = intersections(problem, x, centroids);
        Self {
            edge_error_max,
            edge_error_rms: (edge_sum / (3 * problem.triangles.len()).max(1) as f64).sqrt(),
            penetrations,
            penetration_depth,
            intersections,
            intersection_at: one.map(|t| worst(1.0, linkage.triangles[t].points[0].index())),
            opening,
            opening_max,
            over_open: past_open,
            over_sigma,
            sigma,
        }
    }
}

/// A figure with its point.
fn worst(positions: &[Point3<f64>], value: f64, point: usize) -> Worst {
    Worst {
        value,
        point: PointId::from_index(point).0 + 1,
        at_mm: positions
            .get(point)
            .copied()
            .unwrap_or_else(Point3::origin)
            .into(),
    }
}

/// Positions in units of L.
fn in_edges(linkage: &Linkage, positions: &[Point3<f64>]) -> Vec<Vector3<f64>> {
    positions
        .iter()
        .map(|p| p.coords / linkage.edge_mm)
        .collect()
}

/// Quality of a rationalised linkage. Lengths in L unless named otherwise.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Quality {
    /// Triangles.
    pub triangles: usize,
    /// Hinges.
    pub hinges: usize,
    /// Triangle edge, millimetres.
    pub edge_mm: f64,
    /// Largest relative error of an edge length.
    pub edge_error_max: f64,
    /// Root mean square of the relative edge errors.
    pub edge_error_rms: f64,
    /// Largest distance of a point from the surface, in L.
    pub distance_max: Worst,
    /// Mean distance of the points from the surface, in L.
    pub distance_mean: f64,
    /// Hinges whose triangles penetrate each other (conditions 3 and 4).
    pub penetrations: usize,
    /// Deepest penetration, in L.
    pub penetration_depth: Worst,
    /// Pairs of triangles without a common point that cross in space.
    pub intersections: usize,
    /// Where one of those pairs is.
    pub intersection_at: Option<Worst>,
    /// Triangles that face away from the surface.
    pub facing_away: usize,
    /// Smallest, mean and largest scale factor over the hinges.
    pub opening: [f64; 3],
    /// The hinge that is open widest.
    pub opening_max: Worst,
    /// Hinges over σ by more than 10⁻⁴, or opened past 180°.
    pub over_sigma: usize,
    /// The bound itself.
    pub sigma: f64,
    /// Part of the surface's area within L of a triangle.
    pub coverage: f64,
}

/// Slack on σ before a hinge counts as over it.
pub const SIGMA_TOLERANCE: f64 = 1e-4;

impl Quality {
    /// Measures `positions` (millimetres, by point) of a linkage against its surface.
    pub fn measure(
        linkage: &Linkage,
        positions: &[Point3<f64>],
        surface: &Surface,
        closest: &ClosestPoint,
        sigma: f64,
    ) -> Self {
        let edge_mm = linkage.edge_mm;
        let problem = Problem::new(linkage, sigma);
        let x = in_edges(linkage, positions);
        let worst = |value: f64, point: usize| worst(positions, value, point);

        let mut distance_max = worst(0.0, 0);
        let mut distance_sum = 0.0;
        for (i, p) in positions.iter().enumerate() {
            let distance = closest.query(*p).distance / edge_mm;
            distance_sum += distance;
            if distance > distance_max.value {
                distance_max = worst(distance, i);
            }
        }

        let centroids = centroids(&problem.triangles, &x);
        let facing_away = problem
            .triangles
            .iter()
            .zip(&centroids)
            .filter(|(t, centroid)| {
                faces_away(&t.map(|i| x[i as usize]), centroid, closest, edge_mm)
            })
            .count();
        let own = Soundness::of(linkage, positions, &problem, &x, &centroids);

        Self {
            triangles: problem.triangles.len(),
            hinges: problem.hinges.len(),
            edge_mm,
            edge_error_max: own.edge_error_max,
            edge_error_rms: own.edge_error_rms,
            distance_max,
            distance_mean: distance_sum / positions.len().max(1) as f64,
            penetrations: own.penetrations,
            penetration_depth: own.penetration_depth,
            intersections: own.intersections,
            intersection_at: own.intersection_at,
            facing_away,
            opening: own.opening,
            opening_max: own.opening_max,
            over_sigma: own.over_sigma,
            sigma,
            coverage: coverage(surface, &problem, &x, &centroids, edge_mm),
        }
    }
}

/// The triangles by which a linkage fails: those with a point farther than `accept_distance` (in L) from the surface,
/// those that face away from it, and those that run into another, in ascending order.
pub fn failing(
    linkage: &Linkage,
    positions: &[Point3<f64>],
    closest: &ClosestPoint,
    sigma: f64,
    accept_distance: f64,
) -> Vec<TriangleId> {
    let edge_mm = linkage.edge_mm;
    let problem = Problem::new(linkage, sigma);
    let x: Vec<Vector3<f64>> = positions.iter().map(|p| p.coords / edge_mm).collect();
    let far: Vec<bool> = positions
        .iter()
        .map(|p| closest.query(*p).distance > accept_distance * edge_mm)
        .collect();
    let centroids = centroids(&problem.triangles, &x);
    let mut fails: Vec<bool> = problem
        .triangles
        .iter()
        .zip(&centroids)
        .map(|(t, centroid)| {
            t.iter().any(|&i| far[i as usize])
                || faces_away(&t.map(|i| x[i as usize]), centroid, closest, edge_mm)
        })
        .collect();
    for (hinge, h) in linkage.hinges.iter().zip(&problem.hinges) {
        if penetration(&h.map(|i| x[i as usize])).0 > OVERLAP_TOLERANCE {
            fails[hinge.ccw.triangle.index()] = true;
            fails[hinge.cw.triangle.index()] = true;
        }
    }
    crossing(&problem.triangles, &x, &centroids, |a, b| {
        (fails[a], fails[b]) = (true, true)
    });
    (0..fails.len())
        .filter(|&t| fails[t])
        .map(TriangleId::from_index)
        .collect()
}

/// How deep the triangles of a hinge penetrate each other, and how far it is opened past 180°, in L; negative where
/// they do not.
fn penetration(p: &[Vector3<f64>; 5]) -> (f64, f64) {
    let value = |c: Condition| c.evaluate(p).map_or(f64::NEG_INFINITY, |s| s.value);
    let depth = -value(Condition::SecondClear).min(value(Condition::FirstClear));
    let past = -value(Condition::FirstOpen).min(value(Condition::SecondOpen));
    (depth, past)
}

/// Whether a triangle (in L) faces away from the surface where that is nearest.
fn faces_away(
    [a, b, c]: &[Vector3<f64>; 3],
    centroid: &Vector3<f64>,
    closest: &ClosestPoint,
    edge_mm: f64,
) -> bool {
    let face = closest.query(Point3::from(centroid * edge_mm)).face;
    (b - a).cross(&(c - a)).dot(&closest.normal(face)) < 0.0
}

/// Pairs of triangles without a common point that cross, and one of them.
fn intersections(
    problem: &Problem,
    x: &[Vector3<f64>],
    centroids: &[Vector3<f64>],
) -> (usize, Option<TriangleId>) {
    let (mut count, mut first) = (0, None);
    crossing(&problem.triangles, x, centroids, |a, _| {
        count += 1;
        first.get_or_insert(TriangleId::from_index(a));
    });
    (count, first)
}

/// Part of the surface's area that lies within [`COVERAGE_RADIUS`] of a triangle, sampled at every face's centroid
/// (faces larger than L are sampled by L-sized pieces).
fn coverage(
    surface: &Surface,
    problem: &Problem,
    x: &[Vector3<f64>],
    centroids: &[Vector3<f64>],
    edge_mm: f64,
) -> f64 {
    let reach = COVERAGE_RADIUS + 1.0 / 3f64.sqrt();
    let grid = PointGrid::new(centroids, reach);
    let covered = |p: &Vector3<f64>| {
        let mut found = false;
        grid.near(p, reach, |t| {
            if !found {
                let corners = problem.triangles[t].map(|i| Point3::from(x[i as usize]));
                found = distance_to_triangle(&corners, &Point3::from(*p)) <= COVERAGE_RADIUS;
            }
        });
        found
    };
    let (mut inside, mut total) = (0.0, 0.0);
    for face in surface.faces().ids() {
        let area = surface.face_area(face);
        let p = surface.corners(face).map(|p| p.coords / edge_mm);
        let longest = (0..3)
            .map(|k| (p[(k + 1) % 3] - p[k]).norm())
            .fold(0.0, f64::max);
        let pieces = (longest.ceil() as usize).clamp(1, 64);
        let share = area / (pieces * pieces) as f64;
        for i in 0..pieces {
            for j in 0..2 * (pieces - i) - 1 {
                // Row i of a triangle cut into pieces² equal ones; odd j are the upside-down ones.
                let (u, v) = if j % 2 == 0 {
                    (i as f64 + 1.0 / 3.0, (j / 2) as f64 + 1.0 / 3.0)
                } else {
                    (i as f64 + 2.0 / 3.0, (j / 2) as f64 + 2.0 / 3.0)
                };
                let at = p[0] + ((p[1] - p[0]) * u + (p[2] - p[0]) * v) / pieces as f64;
                total += share;
                if covered(&at) {
                    inside += share;
                }
            }
        }
    }
    if total > 0.0 { inside / total } else { 0.0 }
}
