//! The samples that a formula describes.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Point3, Vector3};

use super::SampleError;
use super::parameter::{Parameter, parameters};
use super::revolve::{Arrays, Ends, revolve};

parameters! {
    /// A spherical cap whose conformal map is known exactly, vertex by vertex.
    ///
    /// With φ the polar angle of a vertex and θ the half angle, the vertices are the stereographic images
    /// (from the south pole, onto the equatorial plane) of a planar disk mesh of radius tan(θ/2): a vertex at planar
    /// radius ρ = tan(φ/2) is lifted to R·(2x, 2y, 1 − ρ²)/(1 + ρ²). Chords then obey
    /// l₃ = e^{(wᵢ+wⱼ)/2} l₂ with w = ln(2R/(1 + ρ²)) exactly, so the flat disk is discretely conformal to the cap,
    /// and the log factor that is zero on the rim is
    ///
    /// u* = ln((1 + cos θ)/(1 + cos φ)) = ln((1 + cos θ)/(1 + z/R)).
    ///
    /// λ = e^{−u*} runs from 1 on the rim to 1/cos²(θ/2) at the top. This holds for this triangulation: flipping an
    /// edge changes the discrete conformal class.
    Cap {
        /// angle between axis and rim, seen from the centre of the sphere (90 is a hemisphere)
        half_angle_deg = 60.0 in 1.0..=170.0,
        /// radius of the sphere
        radius_mm = 115.0 in 1.0..=10000.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Cap {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        Ok(cap(
            self.radius_mm,
            self.half_angle_deg.to_radians(),
            self.faces,
        ))
    }
}

fn cap(radius_mm: f64, half_angle: f64, faces: f64) -> Arrays {
    revolve(
        |t| {
            let (sin, cos) = (t * half_angle).sin_cos();
            (radius_mm * sin, radius_mm * cos)
        },
        Ends::Tip,
        faces,
    )
}

parameters! {
    /// Half a sphere: the [`Cap`] of half angle 90°.
    Hemisphere {
        /// radius of the sphere
        radius_mm = 100.0 in 1.0..=10000.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Hemisphere {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        Ok(cap(self.radius_mm, FRAC_PI_2, self.faces))
    }
}

parameters! {
    /// A bell z = h·exp(−r²/2w²) over a disk (paper, Fig. 8). With the defaults the conformal map without a cone
    /// has max λ / min λ = 5.1; with one cone of +2π/3 at the tip it is 1.4 outside the nearest few millimetres.
    /// The tip is a vertex.
    Bump {
        /// diameter of the disk
        width_mm = 200.0 in 1.0..=10000.0,
        /// height of the bell, h
        height_mm = 120.0 in 0.0..=10000.0,
        /// width of the bell, w: where it is steepest
        spread_mm = 40.0 in 0.1..=10000.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Bump {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        Ok(revolve(
            |t| {
                let r = t * self.width_mm / 2.0;
                let x = r / self.spread_mm;
                (r, self.height_mm * (-0.5 * x * x).exp())
            },
            Ends::Tip,
            self.faces,
        ))
    }
}

parameters! {
    /// A hyperbolic paraboloid z = h·(x² − y²)/R² over a disk of radius R.
    Saddle {
        /// diameter of the disk, 2R
        width_mm = 200.0 in 1.0..=10000.0,
        /// height of the rim above the middle, h
        height_mm = 40.0 in 0.0..=10000.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Saddle {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        let radius_mm = self.width_mm / 2.0;
        let (mut positions, faces) = revolve(|t| (t * radius_mm, 0.0), Ends::Tip, self.faces);
        for p in &mut positions {
            p.z = self.height_mm * (p.x * p.x - p.y * p.y) / (radius_mm * radius_mm);
        }
        Ok((positions, faces))
    }
}

parameters! {
    /// A catenoid r = a·cosh(z/a) between two equal rings. It is conformal to a cylinder with λ = cosh(z/a), so
    /// max λ / min λ = cosh(height / 2a) when both rims turn by 0.
    Catenoid {
        /// radius at the waist, a
        waist_mm = 60.0 in 1.0..=10000.0,
        /// height from ring to ring
        height_mm = 130.0 in 1.0..=10000.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Catenoid {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        let ratio = self.height_mm / self.waist_mm;
        if ratio > 10.0 {
            return Err(SampleError::Contradiction {
                sample: "catenoid",
                why: format!(
                    "height_mm={} is {ratio:.3} times waist_mm={}, and the rings grow with its exponential: 10 times at most",
                    self.height_mm, self.waist_mm
                ),
            });
        }
        Ok(revolve(
            |t| {
                let z = self.height_mm * (0.5 - t);
                (self.waist_mm * (z / self.waist_mm).cosh(), z)
            },
            Ends::Open,
            self.faces,
        ))
    }
}

/// From 0 to 1 with two continuous derivatives and both flat at the ends, so that profiles blended with it have
/// continuous curvature.
fn blend(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 - t * (15.0 - 6.0 * t))
}

parameters! {
    /// A vase without bottom: foot, belly, neck, lip. As for every surface of revolution that is mapped to a
    /// cylinder (both rims turn by 0), max λ / min λ is the ratio of its largest to its smallest radius.
    Vase {
        /// height
        height_mm = 200.0 in 1.0..=10000.0,
        /// radius of the rim it stands on
        foot_mm = 58.0 in 1.0..=10000.0,
        /// radius at the belly, at 0.4 of the height
        belly_mm = 90.0 in 1.0..=10000.0,
        /// radius at the neck, at 0.82 of the height
        neck_mm = 52.0 in 1.0..=10000.0,
        /// radius of the upper rim
        lip_mm = 62.0 in 1.0..=10000.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Vase {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        let stations = [
            (0.0, self.foot_mm),
            (0.4, self.belly_mm),
            (0.82, self.neck_mm),
            (1.0, self.lip_mm),
        ];
        let radius = |up: f64| {
            stations.windows(2).fold(stations[0].1, |r, pair| {
                let part = (up - pair[0].0) / (pair[1].0 - pair[0].0);
                r + (pair[1].1 - pair[0].1) * blend(part)
            })
        };
        Ok(revolve(
            |t| (radius(1.0 - t), self.height_mm * (1.0 - t)),
            Ends::Open,
            self.faces,
        ))
    }
}

parameters! {
    /// A trumpet whose radius grows exponentially from throat to mouth. With the defaults max λ / min λ is 3.1,
    /// 1.4 and 1.7 for a turning of 0, −120° and −240° at the throat.
    Funnel {
        /// radius at the wide end, which is up
        mouth_mm = 100.0 in 1.0..=10000.0,
        /// radius at the narrow end
        throat_mm = 32.0 in 1.0..=10000.0,
        /// height
        height_mm = 120.0 in 1.0..=10000.0,
        /// flare: 0 is a straight cone, larger keeps narrow for longer
        flare = 1.0 in 0.0..=6.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Funnel {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        let grown = |t: f64| {
            if self.flare == 0.0 {
                t
            } else {
                (self.flare * t).exp_m1() / self.flare.exp_m1()
            }
        };
        Ok(revolve(
            |t| {
                let up = 1.0 - t;
                let r = self.throat_mm + (self.mouth_mm - self.throat_mm) * grown(up);
                (r, self.height_mm * up)
            },
            Ends::Open,
            self.faces,
        ))
    }
}

parameters! {
    /// A torus of radii R (ring) and r (tube), t = R/r, lying flat. It is conformal to a flat torus of modulus
    /// √(t² − 1) with max λ / min λ = (t + 1)/(t − 1).
    Torus {
        /// R/r: radius of the ring over that of the tube
        t = 4.0 in 1.05..=100.0,
        /// diameter over all, 2(R + r)
        width_mm = 200.0 in 1.0..=10000.0,
        /// number of triangles wanted, about
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Torus {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        let tube_mm = self.width_mm / 2.0 / (1.0 + self.t);
        Ok(revolve(
            |s| {
                let (sin, cos) = (TAU * s).sin_cos();
                (tube_mm * (self.t + cos), -tube_mm * sin)
            },
            Ends::Closed,
            self.faces,
        ))
    }
}

parameters! {
    /// A closed sphere: each face of an octahedron divided into n² triangles and blown up. Its six corners are
    /// vertices of degree four, which is where six cones of +2π/3 make the sphere an octahedron.
    Octasphere {
        /// radius of the sphere
        radius_mm = 100.0 in 1.0..=10000.0,
        /// number of triangles wanted, about (8 n² are made)
        faces = 12000.0 in 100.0..=2000000.0,
    }
}

impl Octasphere {
    pub(super) fn arrays(&self) -> Result<Arrays, SampleError> {
        let n = ((self.faces / 8.0).sqrt().round() as i64).max(2);
        // The lattice points of |x| + |y| + |z| = n are the vertices; sorted, each is found by bisection.
        let mut lattice: Vec<[i64; 3]> = Vec::new();
        for z in -n..=n {
            let m = n - z.abs();
            for y in -m..=m {
                let x = m - y.abs();
                lattice.push([z, y, -x]);
                if x != 0 {
                    lattice.push([z, y, x]);
                }
            }
        }
        let at = |p: [i64; 3]| lattice.binary_search(&p).unwrap_or(0) as u32;
        // Sines instead of plain barycentric coordinates divide the octahedron's edges into equal arcs.
        let sine = |i: i64| (i as f64 / n as f64 * FRAC_PI_2).sin();
        let positions = lattice
            .iter()
            .map(|&[z, y, x]| {
                let direction = Vector3::new(sine(x), sine(y), sine(z)).normalize();
                Point3::from(self.radius_mm * direction)
            })
            .collect();
        let mut faces = Vec::with_capacity((8 * n * n) as usize);
        for octant in 0..8 {
            let sign = [0, 1, 2].map(|k| if octant >> k & 1 == 0 { 1 } else { -1 });
            // (i, j, n − i − j) with these signs; an odd number of mirrors turns the face round.
            let vertex = |i: i64, j: i64| at([sign[2] * (n - i - j), sign[1] * j, sign[0] * i]);
            let odd = sign.iter().product::<i64>() < 0;
            let mut push = |[a, b, c]: [u32; 3]| {
                faces.push(if odd { [a, c, b] } else { [a, b, c] });
            };
            for i in 0..n {
                for j in 0..n - i {
                    push([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]);
                    if i + j + 1 < n {
                        push([vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]);
                    }
                }
            }
        }
        Ok((positions, faces))
    }
}
