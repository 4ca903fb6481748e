//! Near-isotropic meshes of surfaces of revolution, ring by ring.
//!
//! Rings stand at equal arc length along the profile, and each carries as many vertices as its circumference asks
//! for, so that triangles keep their size where the surface narrows. Neighbouring rings are sewn by always taking
//! the diagonal that is shorter in angle, compared in whole numbers: the same on every machine.

use nalgebra::Point3;

/// Circumferential over meridional spacing: π/3 gives a flat disk of rings with 6, 12, 18 … vertices, and keeps
/// triangles between the equilateral (1.155) and the square (1) cell.
const ASPECT: f64 = std::f64::consts::FRAC_PI_3;

/// Samples of the profile from which its arc length is measured.
const PROFILE_STEPS: usize = 4096;

/// How the ends of a profile are closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ends {
    /// It begins on the axis: a disk with one rim and a vertex at the tip.
    Tip,
    /// Both ends are rims.
    Open,
    /// It is a closed curve: the last ring is sewn to the first.
    Closed,
}

/// A mesh in plain arrays: positions and counter-clockwise faces.
pub(super) type Arrays = (Vec<Point3<f64>>, Vec<[u32; 3]>);

/// Turns `profile`, a curve (distance from the axis, height) over 0..=1, around the Z axis, with about `faces`
/// faces. The outside is on the left of the direction of travel when the axis is on the left too: a profile that
/// starts at the top of the axis, or runs down a wall, gives outward faces.
pub(super) fn revolve(profile: impl Fn(f64) -> (f64, f64), ends: Ends, faces: f64) -> Arrays {
    let mut length_at = Vec::with_capacity(PROFILE_STEPS + 1);
    let (mut length, mut area) = (0.0, 0.0);
    let mut last = profile(0.0);
    length_at.push(0.0);
    for i in 1..=PROFILE_STEPS {
        let here = profile(i as f64 / PROFILE_STEPS as f64);
        let step = (here.0 - last.0).hypot(here.1 - last.1);
        area += std::f64::consts::PI * (here.0 + last.0) * step;
        length += step;
        length_at.push(length);
        last = here;
    }
    // Two faces for each cell of spacing × ASPECT · spacing.
    let wanted = (2.0 * area / (ASPECT * faces)).sqrt();
    let strips = ((length / wanted).round() as usize).max(3);
    let spacing = length / strips as f64;
    let rings = if ends == Ends::Closed {
        strips
    } else {
        strips + 1
    };

    let mut positions = Vec::new();
    let mut starts = Vec::with_capacity(rings);
    for ring in 0..rings {
        starts.push((positions.len(), offset(ends, ring)));
        let (r, z) = profile(if ring == strips {
            1.0
        } else {
            parameter_at(&length_at, ring as f64 * spacing)
        });
        if ring == 0 && ends == Ends::Tip {
            positions.push(Point3::new(0.0, 0.0, z));
            continue;
        }
        let count = ((std::f64::consts::TAU * r / (ASPECT * spacing)).round() as usize).max(6);
        for i in 0..count {
            let turn = (2 * i + starts[ring].1) as f64 / (2 * count) as f64;
            let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
            positions.push(Point3::new(r * cos, r * sin, z));
        }
    }

    let mut triangles = Vec::new();
    let count =
        |ring: usize| starts.get(ring + 1).map_or(positions.len(), |s| s.0) - starts[ring].0;
    for strip in 0..strips {
        let next = (strip + 1) % rings;
        let ring = |k: usize| Ring {
            first: starts[k].0,
            count: count(k),
            offset: starts[k].1,
        };
        sew(&ring(strip), &ring(next), &mut triangles);
    }
    (positions, triangles)
}

/// Half a step on every second ring makes equal rings equilateral; rings of a disk grow by six and keep their
/// sixfold symmetry without it.
fn offset(ends: Ends, ring: usize) -> usize {
    if ends == Ends::Tip { 0 } else { ring % 2 }
}

/// The parameter at which the profile has this arc length, by inversion of the table.
fn parameter_at(length_at: &[f64], length: f64) -> f64 {
    let above = length_at
        .partition_point(|l| *l <= length)
        .clamp(1, length_at.len() - 1);
    let (low, high) = (length_at[above - 1], length_at[above]);
    let part = if high > low {
        (length - low) / (high - low)
    } else {
        0.0
    };
    (above as f64 - 1.0 + part) / (length_at.len() - 1) as f64
}

/// A ring of vertices; `offset` is its start in half steps.
struct Ring {
    first: usize,
    count: usize,
    offset: usize,
}

impl Ring {
    fn vertex(&self, i: usize) -> u32 {
        (self.first + i % self.count) as u32
    }
    /// Angle of vertex `i` times 2 · own count · other count / 2π: a whole number for both rings.
    fn angle(&self, i: usize, other: &Ring) -> i64 {
        ((2 * i + self.offset) * other.count) as i64
    }
}

/// Fills the strip between two rings.
fn sew(upper: &Ring, lower: &Ring, faces: &mut Vec<[u32; 3]>) {
    if upper.count == 1 {
        faces.extend(
            (0..lower.count).map(|i| [upper.vertex(0), lower.vertex(i), lower.vertex(i + 1)]),
        );
        return;
    }
    let (mut a, mut b) = (0, 0);
    while a < upper.count || b < lower.count {
        let if_upper = (upper.angle(a + 1, lower) - lower.angle(b, upper)).abs();
        let if_lower = (lower.angle(b + 1, upper) - upper.angle(a, lower)).abs();
        if b == lower.count || (a < upper.count && if_upper < if_lower) {
            faces.push([upper.vertex(a), lower.vertex(b), upper.vertex(a + 1)]);
            a += 1;
        } else {
            faces.push([upper.vertex(a), lower.vertex(b), lower.vertex(b + 1)]);
            b += 1;
        }
    }
}
