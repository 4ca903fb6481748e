//! A surface with a skirt: a strip beyond its rims, on which what the rim cuts off can lie.
//!
//! A pattern that is cut along a smooth rim has triangles of which a part lies outside. To place them whole, the surface
//! goes on straight from its rims, along its tangent planes, by a little more than a triangle. The strip grows in layers,
//! as a front that moves outwards: where it bends inwards points meet and become one, where it spreads it gets new ones.

use nalgebra::{Point3, Vector3};

use super::surface::{Surface, TopologyError};
use crate::base::ids::Id as _;

/// A rim that would shrink below this part of its length gets no skirt: a hole about to close.
const LEAST_LENGTH: f64 = 0.35;

/// Layers of a skirt, at least and at most.
const LAYERS: (usize, usize) = (2, 12);

/// An edge of the front that shrank to this part of what it was, or of a layer, has its ends merged.
const MERGE: f64 = 0.3;

/// An edge of the front this many layers long is split.
const SPLIT: f64 = 2.0;

/// A corner of the rim moves out by this much of a layer at the most.
const MOST_MITRE: f64 = 2.0;

/// A surface with skirts.
#[derive(Clone, Debug)]
pub struct Skirted {
    /// The surface: its own vertices and faces first, as they were, then those of the skirts.
    pub surface: Surface,
    /// By face: whether it belongs to a skirt.
    pub beyond: Vec<bool>,
    /// Rims that got none, by their number on the original surface: holes too small for it.
    pub bare_rims: Vec<usize>,
}

/// A point of the front.
#[derive(Clone, Copy)]
struct Post {
    at: Point3<f64>,
    normal: Vector3<f64>,
    id: u32,
}

/// The surface, continued by `width_mm` beyond every rim that has room for it.
///
/// # Errors
/// [`TopologyError`] if the rims are such that no surface comes of it.
pub fn skirt(surface: &Surface, width_mm: f64) -> Result<Skirted, TopologyError> {
    let normals = surface.vertex_normals();
    let (mut positions, mut faces) = surface.to_arrays();
    let own = faces.len();
    let mut bare_rims = Vec::new();
    for (number, rim) in surface.rims().iter().enumerate() {
        let mut front: Vec<Post> = rim
            .iter()
            .map(|&v| Post {
                at: surface.position(v),
                normal: normals[v],
                id: v.index() as u32,
            })
            .collect();
        let length = perimeter(&front);
        // An outline at a distance w is longer by w times its turning.
        if length + surface.rim_turning(rim).min(0.0) * width_mm < LEAST_LENGTH * length {
            bare_rims.push(number);
            continue;
        }
        let spacing = length / front.len() as f64;
        let layers = ((width_mm / spacing).ceil() as usize).clamp(LAYERS.0, LAYERS.1);
        let step = width_mm / layers as f64;
        for _ in 0..layers {
            let Some(next) = grown(&front, step, &mut positions, &mut faces) else {
                break;
            };
            front = next;
        }
    }
    let beyond = (0..faces.len()).map(|f| f >= own).collect();
    Ok(Skirted {
        surface: Surface::new(positions, faces)?,
        beyond,
        bare_rims,
    })
}

fn perimeter(front: &[Post]) -> f64 {
    let n = front.len();
    (0..n)
        .map(|i| (front[(i + 1) % n].at - front[i].at).norm())
        .sum()
}

/// The front one layer farther out, with the faces in between; `None`, and nothing done, if nothing would be left of it.
fn grown(
    front: &[Post],
    step: f64,
    positions: &mut Vec<Point3<f64>>,
    faces: &mut Vec<[u32; 3]>,
) -> Option<Vec<Post>> {
    let n = front.len();
    // Of the edge from each point to the next.
    let outwards: Vec<Vector3<f64>> = (0..n)
        .map(|i| {
            let (a, b) = (&front[i], &front[(i + 1) % n]);
            (b.at - a.at)
                .cross(&(a.normal + b.normal))
                .try_normalize(0.0)
                .unwrap_or_else(Vector3::zeros)
        })
        .collect();
    let moved: Vec<Point3<f64>> = (0..n)
        .map(|i| {
            let (before, after) = (outwards[(i + n - 1) % n], outwards[i]);
            let sum = before + after;
            // Both edges move out by a whole step: |sum|/2 is the cosine of half the corner.
            let mitre = (2.0 / sum.norm()).min(MOST_MITRE);
            match sum.try_normalize(1e-9) {
                Some(direction) => front[i].at + direction * (step * mitre),
                None => front[i].at,
            }
        })
        .collect();
    // Which points of the front become one: edges that shrank or turned round.
    let mut joined: Vec<bool> = (0..n)
        .map(|i| {
            let old = front[(i + 1) % n].at - front[i].at;
            let new = moved[(i + 1) % n] - moved[i];
            new.dot(&old) < MERGE * old.norm_squared() || new.norm() < MERGE * step
        })
        .collect();
    // Groups of joined points, in order; the walk begins behind an edge that stays.
    let first = (0..n).find(|&i| !joined[i])?;
    joined.rotate_left((first + 1) % n);
    let index = |k: usize| (first + 1 + k) % n;
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut group = vec![index(0)];
    for k in 0..n - 1 {
        if !joined[k] {
            groups.push(std::mem::take(&mut group));
        }
        group.push(index(k + 1));
    }
    groups.push(group);
    if groups.len() < 3 {
        return None;
    }
    let posts: Vec<Post> = groups
        .iter()
        .map(|group| {
            let count = group.len() as f64;
            let at = group.iter().map(|&i| moved[i].coords).sum::<Vector3<f64>>() / count;
            let normal: Vector3<f64> = group.iter().map(|&i| front[i].normal).sum();
            Post {
                at: at.into(),
                normal: normal.try_normalize(0.0).unwrap_or(front[group[0]].normal),
                id: 0,
            }
        })
        .collect();
    let mut next: Vec<Post> = Vec::with_capacity(2 * posts.len());
    let mut place = |mut post: Post, next: &mut Vec<Post>| {
        post.id = positions.len() as u32;
        positions.push(post.at);
        next.push(post);
        post.id
    };
    let count = posts.len();
    let mut ids: Vec<u32> = Vec::with_capacity(count);
    let mut between: Vec<Option<u32>> = Vec::with_capacity(count);
    for g in 0..count {
        ids.push(place(posts[g], &mut next));
        let other = &posts[(g + 1) % count];
        let long = (other.at - posts[g].at).norm() > SPLIT * step;
        between.push(long.then(|| {
            let middle = Post {
                at: nalgebra::center(&posts[g].at, &other.at),
                normal: (posts[g].normal + other.normal)
                    .try_normalize(0.0)
                    .unwrap_or(other.normal),
                id: 0,
            };
            place(middle, &mut next)
        }));
    }
    for g in 0..count {
        let group = &groups[g];
        for pair in group.windows(2) {
            faces.push([front[pair[1]].id, front[pair[0]].id, ids[g]]);
        }
        let (a, b) = (
            front[group[group.len() - 1]].id,
            front[groups[(g + 1) % count][0]].id,
        );
        let (c, d) = (ids[g], ids[(g + 1) % count]);
        match between[g] {
            Some(middle) => {
                faces.push([b, a, middle]);
                faces.push([a, c, middle]);
                faces.push([b, middle, d]);
            }
            None => {
                faces.push([b, a, c]);
                faces.push([b, c, d]);
            }
        }
    }
    Some(next)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Sample, SampleError};

    fn sample(text: &str) -> Result<Surface, SampleError> {
        Sample::parse(text)?.generate()
    }

    #[test]
    fn the_skirt_of_a_flat_disk_is_the_ring_around_it() {
        // A fan: the rim is a regular 60-gon.
        let n = 60u32;
        let at = |i: u32| {
            let a = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            Point3::new(50.0 * a.cos(), 50.0 * a.sin(), 0.0)
        };
        let mut positions: Vec<Point3<f64>> = (0..n).map(at).collect();
        positions.push(Point3::origin());
        let faces = (0..n).map(|i| [i, (i + 1) % n, n]).collect();
        let disk = Surface::new(positions, faces).unwrap();
        let wide = skirt(&disk, 8.0).unwrap();
        assert!(wide.bare_rims.is_empty());
        let half = std::f64::consts::PI / f64::from(n);
        let area = |apothem: f64| f64::from(n) * apothem * apothem * half.tan();
        let expected = area(50.0 * half.cos() + 8.0);
        assert!(
            (wide.surface.area() / expected - 1.0).abs() < 1e-9,
            "{} for {expected}",
            wide.surface.area()
        );
        assert_eq!(wide.surface.rims().len(), 1);
        assert!(wide.surface.positions().iter().all(|p| p.z.abs() < 1e-12));
        assert_eq!(wide.beyond.iter().filter(|b| !**b).count(), 60);
        // The surface's own part is untouched.
        let (own, all) = (disk.to_arrays(), wide.surface.to_arrays());
        assert_eq!(own.0[..], all.0[..own.0.len()]);
        assert_eq!(own.1[..], all.1[..own.1.len()]);
    }

    #[test]
    fn every_rim_that_has_room_gets_a_skirt_and_the_topology_stays() {
        for (text, width, bare) in [
            ("cap:half_angle_deg=60,faces=2000", 9.0, 0),
            ("mask", 9.0, 0),
            ("vase", 6.0, 0),
            ("catenoid", 10.0, 0),
        ] {
            let surface = sample(text).unwrap();
            let wide = skirt(&surface, width).unwrap();
            assert_eq!(wide.bare_rims.len(), bare, "{text}");
            assert_eq!(
                wide.surface.euler_characteristic(),
                surface.euler_characteristic(),
                "{text}"
            );
            assert_eq!(wide.surface.rims().len(), surface.rims().len(), "{text}");
            // About as much is added as a strip along the rims has.
            let strip: f64 = surface
                .rims()
                .iter()
                .map(|rim| {
                    let n = rim.len();
                    let length: f64 = (0..n)
                        .map(|i| {
                            (surface.position(rim[(i + 1) % n]) - surface.position(rim[i])).norm()
                        })
                        .sum();
                    width * (length + 0.5 * width * surface.rim_turning(rim))
                })
                .sum();
            let added = wide.surface.area() - surface.area();
            assert!(
                (added / strip - 1.0).abs() < 0.25,
                "{text}: {added} for {strip}"
            );
        }
    }

    #[test]
    fn a_hole_narrower_than_the_skirt_keeps_its_rim() {
        let n = 48u32;
        let at = |i: u32| {
            let a = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            let r = if i < n { 50.0 } else { 10.0 };
            Point3::new(r * a.cos(), r * a.sin(), 0.0)
        };
        let faces = (0..n).flat_map(|i| {
            let j = (i + 1) % n;
            [[i, j, n + i], [j, n + j, n + i]]
        });
        let ring = Surface::new((0..2 * n).map(at).collect(), faces.collect()).unwrap();
        for (width, bare) in [(4.0, 0), (6.0, 0), (8.0, 1)] {
            let wide = skirt(&ring, width).unwrap();
            assert_eq!(wide.bare_rims.len(), bare, "{width}");
            if bare == 0 {
                let expected =
                    std::f64::consts::PI * ((50.0 + width).powi(2) - (10.0 - width).powi(2));
                let area = wide.surface.area();
                assert!(
                    (area / expected - 1.0).abs() < 0.01,
                    "{area} for {expected}"
                );
            }
        }
    }
}
