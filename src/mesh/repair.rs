//! From the triangles of a file to a [`Surface`]: what can be mended without guessing is mended and reported, the
//! rest is refused with the place and the remedy.
//!
//! In this order: vertices at exactly the same place become one (for STL also those within a rounding error across a
//! crack); faces that thereby name a vertex twice, and copies of faces, are dropped; one part is chosen; edges with
//! more than two faces are refused; faces are turned to agree with the majority of their part, and outward if
//! it is closed; unused vertices go; lengths become millimetres.

use std::path::Path;

use nalgebra::{Point3, Vector3};

use super::error::{ImportError, Problem};
use super::read::{Format, Soup, read_bytes, read_file};
use super::surface::{Surface, TopologyError};
use super::units::Units;
use crate::base::ids::Id as _;
use crate::base::union::Union;

/// Which part of a surface in several parts is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PartChoice {
    /// None: several parts are an error.
    #[default]
    Refuse,
    /// The one with the most faces.
    Largest,
}

/// How a file is to be understood.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Lengths.
    pub units: Units,
    /// Parts.
    pub parts: PartChoice,
}

/// A surface and how it came to be.
#[derive(Clone, Debug)]
pub struct Import {
    /// The surface in millimetres.
    pub surface: Surface,
    /// What was read and mended.
    pub report: ImportReport,
}

/// What was read and mended. All zeros for a sample.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct ImportReport {
    /// `OBJ`, `STL`, `PLY` or `sample`.
    pub format: &'static str,
    /// Vertices in the file.
    pub file_vertices: usize,
    /// Faces in the file.
    pub file_faces: usize,
    /// Faces with more than three corners, divided into triangles.
    pub polygons: usize,
    /// Vertices that were copies of another at exactly the same place.
    pub welded: usize,
    /// Vertices across a crack that were joined though they differ by rounding (STL only).
    pub welded_cracks: usize,
    /// Faces dropped because they named one vertex twice.
    pub degenerate_faces: usize,
    /// Faces dropped because another has the same three vertices.
    pub duplicate_faces: usize,
    /// Faces turned round.
    pub turned_faces: usize,
    /// Vertices dropped because no face uses them.
    pub unused_vertices: usize,
    /// Parts found; one is kept.
    pub parts: usize,
    /// Faces of the parts that are not used.
    pub other_part_faces: usize,
    /// Millimetres for each unit in the file.
    pub mm_per_unit: f64,
}

impl ImportReport {
    /// What was mended, a line each; empty if nothing had to be.
    pub fn repairs(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let mut say = |count: usize, one: &str, many: &str| match count {
            0 => {}
            1 => lines.push(format!("1 {one}")),
            n => lines.push(format!("{n} {many}")),
        };
        // In an STL every triangle has corners of its own: welding them is no repair.
        if self.format != Format::Stl.name() {
            say(
                self.welded,
                "vertex was a copy of another and was welded to it",
                "vertices were copies of others and were welded to them",
            );
        }
        say(
            self.welded_cracks,
            "vertex was joined across a crack no wider than rounding",
            "vertices were joined across cracks no wider than rounding",
        );
        say(
            self.degenerate_faces,
            "face named a vertex twice and was dropped",
            "faces named a vertex twice and were dropped",
        );
        say(
            self.duplicate_faces,
            "face was a copy of another and was dropped",
            "faces were copies of others and were dropped",
        );
        say(
            self.turned_faces,
            "face was turned round to agree with the others",
            "faces were turned round to agree with the others",
        );
        say(
            self.unused_vertices,
            "vertex belonged to no face and was dropped",
            "vertices belonged to no face and were dropped",
        );
        if self.parts > 1 {
            lines.push(format!(
                "the largest of {} parts is used; {} faces of the others are left out",
                self.parts, self.other_part_faces
            ));
        }
        lines
    }
}

/// Reads a file and makes a surface of it.
///
/// # Errors
/// [`ImportError`] with file, line where there are lines, vertex or face as numbered in the file, and what to do.
pub fn import_file(path: &Path, options: &ImportOptions) -> Result<Import, ImportError> {
    named(&path.display().to_string(), read_file(path)?, options)
}

/// As [`import_file`], from bytes; `name` is used in errors and, by its extension, to tell the format.
///
/// # Errors
/// [`ImportError`].
pub fn import_bytes(
    name: &str,
    bytes: &[u8],
    options: &ImportOptions,
) -> Result<Import, ImportError> {
    named(name, read_bytes(name, bytes)?, options)
}

fn named(file: &str, soup: Soup, options: &ImportOptions) -> Result<Import, ImportError> {
    mend(soup, options).map_err(|problem| ImportError {
        file: file.into(),
        line: None,
        problem,
    })
}

/// Makes a surface of triangles as they stand in a file.
///
/// # Errors
/// [`Problem`], with vertices and faces as numbered in the file.
pub fn mend(soup: Soup, options: &ImportOptions) -> Result<Import, Problem> {
    let mut report = ImportReport {
        format: soup.format.name(),
        file_vertices: soup.positions.len(),
        file_faces: soup.file_faces,
        polygons: soup.polygons,
        ..Default::default()
    };
    if soup.faces.is_empty() {
        return Err(Problem::Empty);
    }
    let mut faces: Vec<Face> = (soup.faces.iter().zip(&soup.source))
        .map(|(corners, source)| Face {
            corners: *corners,
            source: *source,
        })
        .collect();
    weld_exact(&soup.positions, &mut faces, &mut report);
    if soup.format == Format::Stl {
        weld_cracks(&soup.positions, &mut faces, &mut report);
    }
    drop_bad(&mut faces, &mut report)?;
    choose_part(&mut faces, options.parts, &mut report)?;
    refuse_flat(&soup.positions, &faces)?;
    orient(&soup.positions, &mut faces, &mut report)?;
    finish(&soup.positions, &faces, options, report)
}

/// A triangle with the file's vertices, and the file's face that it comes from (both from 0).
#[derive(Clone, Copy)]
struct Face {
    corners: [u32; 3],
    source: u32,
}

/// Every vertex becomes the first one at the same place (the two zeros are one place).
fn weld_exact(positions: &[Point3<f64>], faces: &mut [Face], report: &mut ImportReport) {
    let key = |i: u32| {
        let p = positions[i as usize];
        [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())
    };
    let mut used = vec![false; positions.len()];
    for corner in faces.iter().flat_map(|f| f.corners) {
        used[corner as usize] = true;
    }
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by_key(|i| (key(*i), *i));
    let mut target: Vec<u32> = (0..positions.len() as u32).collect();
    for group in order.chunk_by(|a, b| key(*a) == key(*b)) {
        if group.iter().any(|i| used[*i as usize]) {
            report.welded += group.len() - 1;
        }
        for other in &group[1..] {
            target[*other as usize] = group[0];
        }
    }
    redirect(faces, &target);
}

fn redirect(faces: &mut [Face], target: &[u32]) {
    for corner in faces.iter_mut().flat_map(|f| &mut f.corners) {
        *corner = target[*corner as usize];
    }
}

/// Part of the box's diagonal within which rim vertices are one: sixteen times the rounding of a coordinate in
/// single precision, in which STL is written.
const CRACK: f64 = 1e-6;

/// Joins vertices on rims that are closer than a rounding error, if that leaves less rim.
fn weld_cracks(positions: &[Point3<f64>], faces: &mut [Face], report: &mut ImportReport) {
    let rim = |faces: &[Face]| -> Vec<u32> {
        let mut ends: Vec<u32> = edges(faces)
            .chunk_by(same_edge)
            .filter(|group| group.len() == 1)
            .flat_map(|group| [group[0].0, group[0].1])
            .collect();
        ends.sort_unstable();
        ends.dedup();
        ends
    };
    let before = rim(faces);
    if before.is_empty() {
        return;
    }
    let limit = CRACK * longest_side(positions, faces);
    // Sorted along a direction that no box is aligned with, near vertices are near in the list, and few others are.
    let direction = Vector3::new(0.6029, 0.5377, 0.5894);
    let along = |i: u32| positions[i as usize].coords.dot(&direction);
    let mut order = before.clone();
    order.sort_unstable_by(|a, b| along(*a).total_cmp(&along(*b)).then(a.cmp(b)));
    let mut target: Vec<u32> = (0..positions.len() as u32).collect();
    let mut joined = 0;
    for (i, &a) in order.iter().enumerate() {
        for &b in &order[i + 1..] {
            if along(b) - along(a) > limit {
                break;
            }
            let gap = positions[b as usize] - positions[a as usize];
            if gap.norm() <= limit && target[b as usize] == b {
                target[b as usize] = target[a as usize];
                joined += 1;
            }
        }
    }
    let mut closed = faces.to_vec();
    redirect(&mut closed, &target);
    closed.retain(|f| !names_twice(&f.corners));
    if joined > 0 && rim(&closed).len() + joined < before.len() {
        redirect(faces, &target);
        report.welded_cracks = joined;
    }
}

fn names_twice(c: &[u32; 3]) -> bool {
    c[0] == c[1] || c[1] == c[2] || c[2] == c[0]
}

/// Drops faces that name a vertex twice and copies of faces, keeping the first in the file.
fn drop_bad(faces: &mut Vec<Face>, report: &mut ImportReport) -> Result<(), Problem> {
    let before = faces.len();
    faces.retain(|f| !names_twice(&f.corners));
    report.degenerate_faces = before - faces.len();
    let key = |f: &Face| {
        let mut c = f.corners;
        c.sort_unstable();
        c
    };
    let mut order: Vec<usize> = (0..faces.len()).collect();
    order.sort_unstable_by_key(|i| (key(&faces[*i]), *i));
    let mut copy = vec![false; faces.len()];
    for pair in order.windows(2) {
        copy[pair[1]] = key(&faces[pair[0]]) == key(&faces[pair[1]]);
    }
    report.duplicate_faces = copy.iter().filter(|c| **c).count();
    let mut at = 0;
    faces.retain(|_| {
        at += 1;
        !copy[at - 1]
    });
    if faces.is_empty() {
        return Err(Problem::Empty);
    }
    Ok(())
}

/// An edge of a face: its ends in ascending order, and `3 · face + k` for the side it is.
type Edge = (u32, u32, usize);

fn edges(faces: &[Face]) -> Vec<Edge> {
    let mut list: Vec<Edge> = (0..faces.len() * 3)
        .map(|h| {
            let c = faces[h / 3].corners;
            let (a, b) = (c[h % 3], c[(h % 3 + 1) % 3]);
            (a.min(b), a.max(b), h)
        })
        .collect();
    list.sort_unstable();
    list
}

fn same_edge(a: &Edge, b: &Edge) -> bool {
    (a.0, a.1) == (b.0, b.1)
}

/// The first edge with more than two faces, as an error.
fn crowded_edge(faces: &[Face], edges: &[Edge]) -> Option<Problem> {
    let mut crowded = edges.chunk_by(same_edge).filter(|g| g.len() > 2);
    let first = crowded.next()?;
    Some(Problem::NotManifoldEdge {
        tail: first[0].0 as usize + 1,
        head: first[0].1 as usize + 1,
        faces: first.len(),
        face: faces[first[0].2 / 3].source as usize + 1,
        count: 1 + crowded.count(),
    })
}

/// Keeps one part; faces that share an edge belong together.
fn choose_part(
    faces: &mut Vec<Face>,
    choice: PartChoice,
    report: &mut ImportReport,
) -> Result<(), Problem> {
    let edges = edges(faces);
    // A set is named by its lowest face, so that ties are settled by the order of the file.
    let mut part = Union::new(faces.len());
    for group in edges.chunk_by(same_edge) {
        for pair in group.windows(2) {
            part.join(pair[0].2 / 3, pair[1].2 / 3);
        }
    }
    let mut size = vec![0usize; faces.len()];
    for i in 0..faces.len() {
        size[part.root(i)] += 1;
    }
    let mut parts: Vec<(usize, usize)> = size
        .iter()
        .enumerate()
        .filter(|(_, n)| **n > 0)
        .map(|(i, n)| (*n, i))
        .collect();
    parts.sort_unstable_by_key(|(n, i)| (std::cmp::Reverse(*n), *i));
    report.parts = parts.len();
    if parts.len() == 1 {
        return Ok(());
    }
    if choice == PartChoice::Refuse {
        let mut sizes: Vec<String> = parts.iter().take(6).map(|p| p.0.to_string()).collect();
        if parts.len() > 6 {
            sizes.push(format!("… (the smallest {})", parts[parts.len() - 1].0));
        }
        return Err(Problem::SeveralParts {
            count: parts.len(),
            sizes: sizes.join(", "),
            also: crowded_edge(faces, &edges)
                .map(|problem| format!(", and {problem}"))
                .unwrap_or_default(),
        });
    }
    let kept = parts[0].1;
    let before = faces.len();
    let mut at = 0;
    faces.retain(|_| {
        at += 1;
        part.root(at - 1) == kept
    });
    report.other_part_faces = before - faces.len();
    Ok(())
}

/// Refuses triangles whose corners lie exactly on one line: they have no angles to map.
fn refuse_flat(positions: &[Point3<f64>], faces: &[Face]) -> Result<(), Problem> {
    let flat = |f: &&Face| {
        let [a, b, c] = f.corners.map(|i| positions[i as usize]);
        // Relative to its own longest side: a product of tiny lengths is not yet an area of zero.
        let unit = (b - a).amax().max((c - a).amax());
        ((b - a) / unit).cross(&((c - a) / unit)).norm() == 0.0
    };
    let mut flats = faces.iter().filter(flat);
    let Some(first) = flats.next() else {
        return Ok(());
    };
    let [a, b, c] = first.corners.map(|v| v as usize + 1);
    Err(Problem::FlatFace {
        face: first.source as usize + 1,
        a,
        b,
        c,
        count: 1 + flats.count(),
    })
}

/// Turns faces so that all agree: with the majority, and outward if the surface is closed. One part is expected.
fn orient(
    positions: &[Point3<f64>],
    faces: &mut [Face],
    report: &mut ImportReport,
) -> Result<(), Problem> {
    let edges = edges(faces);
    if let Some(problem) = crowded_edge(faces, &edges) {
        return Err(problem);
    }
    let mut across = vec![usize::MAX; faces.len() * 3];
    let mut closed = true;
    for group in edges.chunk_by(same_edge) {
        match *group {
            [a, b] => (across[a.2], across[b.2]) = (b.2, a.2),
            _ => closed = false,
        }
    }
    let tail = |h: usize, faces: &[Face]| faces[h / 3].corners[h % 3];
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    turned[0] = Some(false);
    let mut queue = vec![0usize];
    let mut next = 0;
    while let Some(&face) = queue.get(next) {
        next += 1;
        let own = turned[face] == Some(true);
        for (k, &other) in across[3 * face..3 * face + 3].iter().enumerate() {
            let h = 3 * face + k;
            if other == usize::MAX {
                continue;
            }
            // Neighbours agree if they run along their edge in opposite directions.
            let disagree = tail(h, faces) == tail(other, faces);
            let wanted = own != disagree;
            match turned[other / 3] {
                None => {
                    turned[other / 3] = Some(wanted);
                    queue.push(other / 3);
                }
                Some(is) if is != wanted => {
                    return Err(Problem::NotOrientable {
                        face: faces[other / 3].source as usize + 1,
                    });
                }
                Some(_) => {}
            }
        }
    }
    let to_turn = |t: &Option<bool>| *t == Some(true);
    let mut all = turned.iter().filter(|t| to_turn(t)).count() * 2 > faces.len();
    if closed {
        let origin = positions[faces[0].corners[0] as usize];
        let volume: f64 = faces
            .iter()
            .zip(&turned)
            .map(|(f, t)| {
                let [a, b, c] = f.corners.map(|i| positions[i as usize] - origin);
                let v = a.dot(&b.cross(&c));
                if to_turn(t) { -v } else { v }
            })
            .sum();
        all = volume < 0.0;
    }
    for (face, t) in faces.iter_mut().zip(&turned) {
        if to_turn(t) != all {
            face.corners.swap(1, 2);
            report.turned_faces += 1;
        }
    }
    Ok(())
}

fn longest_side(positions: &[Point3<f64>], faces: &[Face]) -> f64 {
    let mut corners = faces
        .iter()
        .flat_map(|f| f.corners)
        .map(|i| positions[i as usize]);
    let first = corners.next().unwrap_or_else(Point3::origin);
    let (low, high) = corners.fold((first, first), |(l, h), p| (l.inf(&p), h.sup(&p)));
    (high - low).max()
}

/// Renumbers, scales and builds.
fn finish(
    positions: &[Point3<f64>],
    faces: &[Face],
    options: &ImportOptions,
    mut report: ImportReport,
) -> Result<Import, Problem> {
    report.mm_per_unit = options.units.factor(longest_side(positions, faces))?;
    let mut used = vec![false; positions.len()];
    for corner in faces.iter().flat_map(|f| f.corners) {
        used[corner as usize] = true;
    }
    let mut number = vec![u32::MAX; positions.len()];
    let mut origin = Vec::new();
    for (i, _) in used.iter().enumerate().filter(|(_, u)| **u) {
        number[i] = origin.len() as u32;
        origin.push(i);
    }
    // Copies were counted as welded; vertices of other parts are left out with them.
    if report.other_part_faces == 0 {
        report.unused_vertices =
            positions.len() - origin.len() - report.welded - report.welded_cracks;
    }
    let kept = origin
        .iter()
        .map(|&i| positions[i] * report.mm_per_unit)
        .collect();
    let corners = faces
        .iter()
        .map(|f| f.corners.map(|i| number[i as usize]))
        .collect();
    let surface = Surface::new(kept, corners).map_err(|error| match error {
        TopologyError::NotManifoldVertex { vertex, fans } => Problem::NotManifoldVertex {
            vertex: origin[vertex.index()] + 1,
            fans,
        },
        other => other.into(),
    })?;
    Ok(Import { surface, report })
}

#[cfg(test)]
mod tests;
