//! A solid body with the surface on top and a flat base: printed or milled, it is what a sheet is formed over by hand
//! (the paper's Fig. 15).
//!
//! Of a surface with a rim, further rims are capped, walls run straight down from the lowest rim, and the base is the
//! polygon below it. A closed surface is cut by a plane. Either way every edge belongs to two triangles that run along it
//! in opposite directions, by construction: walls and base use the rim's own vertices, and a cut uses one new vertex for
//! each edge that it crosses.

use std::collections::BTreeMap;

use nalgebra::{Point2, Point3, Rotation3, Vector3};

use super::surface::{Surface, VertexId};
use crate::base::ids::Id as _;

/// How a body is made of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyOptions {
    /// Which way is up: the base is on the other side. None takes the surface's mean normal, of a closed one +Z.
    pub up: Option<Vector3<f64>>,
    /// Height of the walls below the lowest point of a surface with a rim; of a closed one, what is cut off at its lower
    /// end. Millimetres.
    pub base_mm: f64,
    /// The surface is moved outwards by this first, inwards if negative: half a sheet's thickness inwards, for example, so
    /// that the middle of the sheet comes to lie on the surface. Millimetres.
    pub offset_mm: f64,
}

/// A watertight body: base at z = 0, up is +Z, triangles counter-clockwise seen from outside.
#[derive(Clone, Debug)]
pub struct Body {
    /// Vertices, millimetres.
    pub positions: Vec<Point3<f64>>,
    /// Triangles.
    pub faces: Vec<[u32; 3]>,
}

/// Why there is no body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// A length that is none.
    #[error("{what} is {value_mm} mm; it must be {wanted}")]
    Length {
        /// `the base (--base)`, `the offset (--offset)`.
        what: &'static str,
        /// As given.
        value_mm: f64,
        /// What it may be.
        wanted: &'static str,
    },
    /// No direction.
    #[error(
        "the direction upwards has no length: give three numbers that are not all 0 (--up 0,0,1)"
    )]
    NoUp,
    /// More than one part.
    #[error("the surface is in {parts} parts; take one of them (--part largest)")]
    Parts {
        /// How many.
        parts: usize,
    },
    /// The rim seen from above crosses itself.
    #[error(
        "seen along the direction upwards, the outline of the base crosses itself or runs the wrong way near ({x:.2}, {y:.2}, {z:.2}) mm: choose another direction (--up X,Y,Z)"
    )]
    Outline {
        /// Where, in the surface's frame.
        x: f64,
        /// Where.
        y: f64,
        /// Where.
        z: f64,
    },
    /// The plane misses a closed surface.
    #[error(
        "a cut {base_mm} mm above the lowest point misses the surface, which is {height_mm:.3} mm high"
    )]
    Missed {
        /// Height of the cut.
        base_mm: f64,
        /// Height of the surface.
        height_mm: f64,
    },
    /// A ring-shaped cut.
    #[error(
        "cut {base_mm} mm above the lowest point, the surface has a base with holes in it: choose another height (--base) or direction (--up)"
    )]
    Hollow {
        /// Height of the cut.
        base_mm: f64,
    },
}

impl Body {
    /// Makes the body of a surface, which must be in one part.
    ///
    /// # Errors
    /// [`BodyError`].
    pub fn new(surface: &Surface, options: &BodyOptions) -> Result<Self, BodyError> {
        let least = if surface.rims().is_empty() {
            f64::MIN_POSITIVE
        } else {
            0.0
        };
        if !(least..=1e5).contains(&options.base_mm) {
            return Err(BodyError::Length {
                what: "the base (--base)",
                value_mm: options.base_mm,
                wanted: if least > 0.0 {
                    "above 0 for a closed surface"
                } else {
                    "0 or above"
                },
            });
        }
        if options.offset_mm.is_nan() || options.offset_mm.abs() > 1e4 {
            return Err(BodyError::Length {
                what: "the offset (--offset)",
                value_mm: options.offset_mm,
                wanted: "a plain number",
            });
        }
        let parts = surface.parts().len();
        if parts != 1 {
            return Err(BodyError::Parts { parts });
        }
        let up = match options.up {
            Some(up) => up,
            None if surface.rims().is_empty() => Vector3::z(),
            None => surface.front().0,
        };
        let up = up
            .try_normalize(1e-12)
            .filter(|u| u.iter().all(|c| c.is_finite()))
            .ok_or(BodyError::NoUp)?;
        // The turn that needs least; upside down about X.
        let turn = Rotation3::rotation_between(&up, &Vector3::z()).unwrap_or_else(|| {
            Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
        });
        let normals = surface.vertex_normals();
        let positions: Vec<Point3<f64>> = surface
            .positions()
            .iter()
            .zip(normals.iter())
            .map(|(p, n)| turn * (p + n * options.offset_mm))
            .collect();
        let faces: Vec<[u32; 3]> = surface.faces().iter().map(|f| f.map(|v| v.0)).collect();
        let mut body = Self { positions, faces };
        if surface.rims().is_empty() {
            body.cut(options.base_mm)?;
        } else {
            let rims: Vec<Vec<u32>> = surface
                .rims()
                .iter()
                .map(|rim| rim.iter().map(|v: &VertexId| v.index() as u32).collect())
                .collect();
            body.stand(&rims, options.base_mm).map_err(|n| {
                let p = surface.position(VertexId::from_index(n));
                BodyError::Outline {
                    x: p.x,
                    y: p.y,
                    z: p.z,
                }
            })?;
        }
        Ok(body)
    }

    /// Volume, cubic millimetres.
    pub fn volume_mm3(&self) -> f64 {
        let corner = |v: u32| self.positions[v as usize].coords;
        self.faces
            .iter()
            .map(|&[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c))) / 6.0)
            .sum()
    }

    /// Width, depth and height, millimetres.
    pub fn size_mm(&self) -> [f64; 3] {
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for p in &self.positions {
            for k in 0..3 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        [0, 1, 2].map(|k| (high[k] - low[k]).max(0.0))
    }

    /// Binary STL.
    pub fn stl(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(84 + 50 * self.faces.len());
        let mut title =
            *b"kagome form: millimetres, base at z = 0                                         ";
        title[79] = b' ';
        bytes.extend_from_slice(&title);
        bytes.extend_from_slice(&(self.faces.len() as u32).to_le_bytes());
        for face in &self.faces {
            let [a, b, c] = face.map(|v| self.positions[v as usize]);
            let normal = (b - a).cross(&(c - a));
            let normal = normal.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
            for v in [normal, a.coords, b.coords, c.coords] {
                for k in 0..3 {
                    bytes.extend_from_slice(&(v[k] as f32).to_le_bytes());
                }
            }
            bytes.extend_from_slice(&[0, 0]);
        }
        bytes
    }

    /// Caps all rims but the lowest, and puts that one on walls and a base. `Err` has a vertex where that fails. A rim has
    /// the surface on its left.
    fn stand(&mut self, rims: &[Vec<u32>], base_mm: f64) -> Result<(), usize> {
        let height = |rim: &Vec<u32>| {
            let sum: f64 = rim.iter().map(|&v| self.positions[v as usize].z).sum();
            sum / rim.len() as f64
        };
        let lowest = (0..rims.len())
            .min_by(|&a, &b| height(&rims[a]).total_cmp(&height(&rims[b])))
            .unwrap_or(0);
        for (n, rim) in rims.iter().enumerate() {
            if n != lowest {
                self.cap(rim);
            }
        }
        let floor = self.positions.iter().map(|p| p.z).fold(f64::MAX, f64::min) - base_mm;
        self.positions.iter_mut().for_each(|p| p.z -= floor);
        let rim = &rims[lowest];
        let below = self.positions.len() as u32;
        for &v in rim {
            let p = self.positions[v as usize];
            self.positions.push(Point3::new(p.x, p.y, 0.0));
        }
        let n = rim.len() as u32;
        for i in 0..n {
            let j = (i + 1) % n;
            let (a, b) = (rim[i as usize], rim[j as usize]);
            // The surface runs from a to b along the rim; the wall runs back.
            self.faces.push([b, a, below + i]);
            self.faces.push([b, below + i, below + j]);
        }
        // Walls run along the base's edges from i to j, so that the base runs from j to i: seen from above against the
        // clock as the rim is, seen from below with it.
        let outline: Vec<Point2<f64>> = (below..below + n)
            .map(|v| self.positions[v as usize].xy())
            .collect();
        let triangles = triangulated(&outline).map_err(|i| rim[i] as usize)?;
        for [a, b, c] in triangles {
            self.faces.push([below + a, below + c, below + b]);
        }
        Ok(())
    }

    /// A fan over a rim, from its middle.
    fn cap(&mut self, rim: &[u32]) {
        let sum: Vector3<f64> = rim.iter().map(|&v| self.positions[v as usize].coords).sum();
        let middle = self.positions.len() as u32;
        self.positions.push(Point3::from(sum / rim.len() as f64));
        for (i, &a) in rim.iter().enumerate() {
            self.faces.push([rim[(i + 1) % rim.len()], a, middle]);
        }
    }

    /// Keeps what is above a plane and closes it there.
    fn cut(&mut self, base_mm: f64) -> Result<(), BodyError> {
        let z = || self.positions.iter().map(|p| p.z);
        let (low, high) = (z().fold(f64::MAX, f64::min), z().fold(f64::MIN, f64::max));
        let height_mm = high - low;
        if base_mm >= height_mm {
            return Err(BodyError::Missed { base_mm, height_mm });
        }
        // A vertex on the plane would give triangles without area: the plane goes just beside all of them.
        let near = 1e-7 * height_mm;
        let mut heights: Vec<f64> = z().collect();
        heights.sort_by(f64::total_cmp);
        let mut plane = low + base_mm;
        for &h in &heights[heights.partition_point(|h| *h < plane - near)..] {
            if h > plane + near {
                break;
            }
            plane = h + 2.0 * near;
        }
        if plane >= high {
            return Err(BodyError::Missed { base_mm, height_mm });
        }
        let above: Vec<bool> = z().map(|z| z > plane).collect();
        let (old, faces) = (self.positions.clone(), std::mem::take(&mut self.faces));
        self.positions.clear();
        let mut kept: Vec<u32> = vec![u32::MAX; old.len()];
        let mut crossed: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        // From a point of the cut to the next one, the material on the left seen from above.
        let mut next: BTreeMap<u32, u32> = BTreeMap::new();
        for face in faces {
            let mut polygon: Vec<u32> = Vec::with_capacity(4);
            let mut leaves = [None, None];
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                let (here, there) = (above[a as usize], above[b as usize]);
                if here {
                    let known = &mut kept[a as usize];
                    if *known == u32::MAX {
                        *known = self.positions.len() as u32;
                        let p = old[a as usize];
                        self.positions.push(Point3::new(p.x, p.y, p.z - plane));
                    }
                    polygon.push(*known);
                }
                if here != there {
                    let key = (a.min(b), a.max(b));
                    let positions = &mut self.positions;
                    let point = *crossed.entry(key).or_insert_with(|| {
                        let (p, q) = (old[key.0 as usize], old[key.1 as usize]);
                        let t = (plane - p.z) / (q.z - p.z);
                        let at = p + (q - p) * t;
                        positions.push(Point3::new(at.x, at.y, 0.0));
                        positions.len() as u32 - 1
                    });
                    polygon.push(point);
                    leaves[usize::from(there)] = Some(point);
                }
            }
            for k in 2..polygon.len() {
                self.faces.push([polygon[0], polygon[k - 1], polygon[k]]);
            }
            // The face runs from where it goes down to where it comes up.
            if let [Some(down), Some(up)] = leaves {
                next.insert(down, up);
            }
        }
        while let Some((&start, _)) = next.iter().next() {
            let mut around = vec![start];
            let mut at = next.remove(&start);
            while let Some(point) = at.filter(|p| *p != start) {
                around.push(point);
                at = next.remove(&point);
            }
            let outline: Vec<Point2<f64>> = around
                .iter()
                .map(|&v| self.positions[v as usize].xy())
                .collect();
            let triangles = triangulated(&outline).map_err(|_| BodyError::Hollow { base_mm })?;
            for t in triangles {
                let [a, b, c] = t.map(|i| around[i as usize]);
                self.faces.push([a, c, b]);
            }
        }
        Ok(())
    }
}

/// Triangles of a simple polygon that runs against the clock, by cutting off ears. `Err` has a corner where it crosses
/// itself or runs with the clock.
fn triangulated(outline: &[Point2<f64>]) -> Result<Vec<[u32; 3]>, usize> {
    let n = outline.len();
    let cross = |a: usize, b: usize, c: usize| {
        let (u, v) = (outline[b] - outline[a], outline[c] - outline[a]);
        u.x * v.y - u.y * v.x
    };
    let mut left: Vec<usize> = (0..n).collect();
    let mut triangles = Vec::with_capacity(n.saturating_sub(2));
    let area: f64 = (1..n.saturating_sub(1)).map(|i| cross(0, i, i + 1)).sum();
    if n < 3 || area <= 0.0 {
        return Err(0);
    }
    // Rounding of the corner that is cut off last, and of straight rims.
    let flat = 1e-12 * area;
    let mut at = 0;
    let mut tried = 0;
    while left.len() > 3 {
        let m = left.len();
        let (a, b, c) = (left[(at + m - 1) % m], left[at % m], left[(at + 1) % m]);
        let ear = cross(a, b, c) > flat && {
            let inside = |p: usize| {
                p != a
                    && p != b
                    && p != c
                    && cross(a, b, p) >= 0.0
                    && cross(b, c, p) >= 0.0
                    && cross(c, a, p) >= 0.0
            };
            // Only corners that bend inwards can lie in an ear.
            !(0..m).any(|k| {
                inside(left[k]) && cross(left[(k + m - 1) % m], left[k], left[(k + 1) % m]) <= flat
            })
        };
        // After a whole round without an ear, a corner on a straight line may go: its triangle has no area, and the edges
        // of the body still meet in pairs.
        let straight = tried >= m && tried < 2 * m && cross(a, b, c).abs() <= flat;
        if ear || straight {
            triangles.push([a as u32, b as u32, c as u32]);
            left.remove(at % m);
            // The corners beside it may have become ears; going on from the one before gives no long fans.
            at %= m - 1;
            tried = 0;
        } else {
            at = (at + 1) % m;
            tried += 1;
            if tried >= 2 * m {
                return Err(b);
            }
        }
    }
    triangles.push([left[0] as u32, left[1] as u32, left[2] as u32]);
    Ok(triangles)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Sample;

    fn watertight(body: &Body) {
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for f in &body.faces {
            for k in 0..3 {
                assert_ne!(f[k], f[(k + 1) % 3]);
                *edges.entry((f[k], f[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        for (&(a, b), &count) in &edges {
            assert_eq!(count, 1, "the edge {a} to {b}");
            assert_eq!(edges.get(&(b, a)), Some(&1), "the edge {a} to {b}, back");
        }
        let floor = body.positions.iter().map(|p| p.z).fold(f64::MAX, f64::min);
        assert!(floor.abs() < 1e-9, "{floor}");
    }

    fn of(name: &str, options: BodyOptions) -> Body {
        let surface = Sample::parse(name).unwrap().generate().unwrap();
        let body = Body::new(&surface, &options).unwrap();
        watertight(&body);
        body
    }

    const PLAIN: BodyOptions = BodyOptions {
        up: None,
        base_mm: 10.0,
        offset_mm: 0.0,
    };

    #[test]
    fn a_hemisphere_has_the_volume_of_the_closed_form() {
        for (offset_mm, base_mm) in [(0.0, 10.0), (0.0, 0.0), (2.0, 10.0), (-1.0, 25.0)] {
            let options = BodyOptions {
                base_mm,
                offset_mm,
                ..PLAIN
            };
            let body = of("hemisphere:faces=20000", options);
            let size = body.size_mm();
            let r = 100.0 + offset_mm;
            assert!((size[0] - 2.0 * r).abs() < 0.1, "{size:?}");
            assert!((size[2] - r - base_mm).abs() < 0.1, "{size:?}");
            let wanted = 2.0 / 3.0 * PI * r.powi(3) + PI * r * r * base_mm;
            let found = body.volume_mm3();
            assert!((found / wanted - 1.0).abs() < 2e-3, "{found} {wanted}");
        }
    }

    #[test]
    fn rims_above_are_capped_and_the_lowest_stands_on_the_base() {
        for name in ["vase", "funnel", "catenoid", "mask", "bump", "saddle"] {
            let up = Some(Vector3::z());
            let body = of(name, BodyOptions { up, ..PLAIN });
            assert!(body.volume_mm3() > 0.0, "{name}");
        }
    }

    #[test]
    fn a_closed_surface_is_cut_flat() {
        for base_mm in [30.0, 100.0, 0.5] {
            let body = of("octasphere", BodyOptions { base_mm, ..PLAIN });
            // A ball less a cap.
            let (r, h) = (100.0, base_mm);
            let wanted = 4.0 / 3.0 * PI * r * r * r - PI * h * h * (r - h / 3.0);
            assert!((body.volume_mm3() / wanted - 1.0).abs() < 1e-2);
            assert!((body.size_mm()[2] - 200.0 + base_mm).abs() < 0.5);
        }
        let sphere = Sample::parse("octasphere").unwrap().generate().unwrap();
        for base_mm in [0.0, 200.1, -1.0, f64::NAN] {
            assert!(Body::new(&sphere, &BodyOptions { base_mm, ..PLAIN }).is_err());
        }
        // Across a torus the cut is a ring.
        let torus = Sample::parse("torus").unwrap().generate().unwrap();
        let options = BodyOptions {
            base_mm: 20.0,
            up: Some(Vector3::z()),
            ..PLAIN
        };
        assert!(matches!(
            Body::new(&torus, &options),
            Err(BodyError::Hollow { .. })
        ));
        let along = BodyOptions {
            base_mm: 10.0,
            up: Some(Vector3::x()),
            ..PLAIN
        };
        watertight(&Body::new(&torus, &along).unwrap());
    }

    #[test]
    fn up_may_be_chosen_and_what_cannot_stand_is_refused() {
        let surface = Sample::parse("cap:half_angle_deg=60")
            .unwrap()
            .generate()
            .unwrap();
        let tilted = BodyOptions {
            up: Some(Vector3::new(0.3, 0.0, 1.0)),
            ..PLAIN
        };
        let straight = Body::new(&surface, &PLAIN).unwrap();
        let body = Body::new(&surface, &tilted).unwrap();
        watertight(&body);
        assert!(body.volume_mm3() > straight.volume_mm3());
        for up in [
            Vector3::zeros(),
            -Vector3::z(),
            Vector3::new(f64::NAN, 0.0, 0.0),
        ] {
            let error = Body::new(
                &surface,
                &BodyOptions {
                    up: Some(up),
                    ..PLAIN
                },
            );
            assert!(error.is_err(), "{up}");
        }
    }

    #[test]
    fn the_stl_is_read_back() {
        let body = of("cap:half_angle_deg=45,faces=500", PLAIN);
        let bytes = body.stl();
        let mut cursor = std::io::Cursor::new(&bytes);
        let read = stl_io::read_stl(&mut cursor).unwrap();
        assert_eq!(read.faces.len(), body.faces.len());
        read.validate().unwrap();
    }

    proptest! {
        #[test]
        fn star_shaped_polygons_are_divided_without_loss(radii in proptest::collection::vec(0.2f64..3.0, 3..40)) {
            let n = radii.len() as f64;
            let points: Vec<Point2<f64>> = radii.iter().enumerate().map(|(i, r)| {
                let angle = std::f64::consts::TAU * i as f64 / n;
                Point2::new(r * angle.cos(), r * angle.sin())
            }).collect();
            let area = |t: &[usize]| -> f64 {
                (0..t.len()).map(|i| {
                    let (p, q) = (points[t[i]], points[t[(i + 1) % t.len()]]);
                    0.5 * (p.x * q.y - p.y * q.x)
                }).sum()
            };
            let triangles = triangulated(&points).unwrap();
            prop_assert_eq!(triangles.len(), points.len() - 2);
            let each: Vec<f64> = triangles.iter().map(|t| area(&t.map(|i| i as usize))).collect();
            prop_assert!(each.iter().all(|a| *a >= -1e-12));
            let whole = area(&(0..points.len()).collect::<Vec<_>>());
            prop_assert!((each.iter().sum::<f64>() - whole).abs() < 1e-9);
            let backwards: Vec<Point2<f64>> = points.iter().rev().copied().collect();
            prop_assert!(triangulated(&backwards).is_err());
        }
    }
}
