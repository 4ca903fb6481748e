//! `linkage.obj` read back: the whole [`Linkage`] from the file alone.
//!
//! The file says which triangles share which points, and where each lies closed. Slit directions, colours and seams
//! follow. Two triangles at a hinge are slit opposite ways around, so one choice settles all that hang together, and the
//! sheet makes the choice: closed, the corner *before* the hinge in the counter-clockwise triangle lies on the corner
//! *after* it in the other. Every hinge that is no seam has a vote. Where all are seams, space decides: the slit is
//! the narrower of the two gaps. The lattice's direction is known up to 60°, and turning it by 60° swaps the colours
//! and [`Handedness`] together, which leaves every slit where it is: the direction within ±30° is taken, as `make` does.
//! What is left, triangles without hinges, is coloured by its direction.
//!
//! The lines are read here and not by `tobj`: it renumbers vertices wherever a `vt` or a group differs, and the numbers
//! in the file are the points' names. Groups, normals, materials and comments are passed over, so that a file that
//! went through another program still reads; a surface does not.

use std::collections::HashMap;

use nalgebra::{Complex, Point2, Point3, Vector2, Vector3};

use super::{Colour, Corner, Handedness, Hinge, Linkage, PointId, Triangle, TriangleId};
use crate::base::ids::{Id as _, Per};

/// Flat triangles may differ by this part of L.
const EQUAL: f64 = 1e-6;

/// … and by what is left of a coordinate in single precision, in which other programs keep texture coordinates:
/// two units in its last place.
const SINGLE: f64 = 1.0 / 4_194_304.0;

/// Flat corners closer than this (in L) are one point of the sheet: the nearest other one is 1 away.
const SAME_FLAT_POINT: f64 = 1e-3;

/// Largest coordinate, millimetres: a hundred kilometres.
const FARTHEST: f64 = 1e8;

/// Smallest triangle edge, millimetres: below it a file's decimals say nothing.
const LEAST_EDGE: f64 = 1e-6;

/// Directions this close to 30° (as a cosine) count as +30°, so that rounding does not decide.
const UNDECIDED: f64 = 1e-6;

/// Why a file is not read as a linkage: which file, where in it, and what.
#[derive(Debug)]
pub struct LinkageReadError {
    /// The file, or the name of what was read.
    pub file: String,
    /// The line, counted from 1, where one line is to blame.
    pub line: Option<usize>,
    /// What is wrong and what to do.
    pub problem: LinkageProblem,
}

impl std::fmt::Display for LinkageReadError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl std::error::Error for LinkageReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.problem)
    }
}

/// What is wrong with a linkage file. Faces, vertices (`v`) and flat corners (`vt`) are counted from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LinkageProblem {
    /// Zero bytes: UTF-16, or no text at all.
    #[error("is no plain text; save it as OBJ in UTF-8")]
    NotText,
    /// A coordinate cannot be used.
    #[error("{text:?} is not a finite number within 100 km; coordinates are millimetres")]
    NotANumber {
        /// As it stands there.
        text: String,
    },
    /// A `v` or `vt` has too few coordinates.
    #[error("{what} needs {wanted} coordinates; {found} found")]
    Short {
        /// `v` or `vt`.
        what: &'static str,
        /// How many it needs.
        wanted: usize,
        /// How many there are.
        found: usize,
    },
    /// No faces.
    #[error("has no faces; in a linkage every face is one rigid triangle")]
    Empty,
    /// A face names something that is not there.
    #[error("face {face} names {what} {text:?}, but the file has {count}")]
    BadIndex {
        /// The face.
        face: usize,
        /// `v` or `vt`.
        what: &'static str,
        /// What it names.
        text: String,
        /// How many there are.
        count: usize,
    },
    /// A face is no triangle.
    #[error(
        "face {face} has {corners} corners: in a linkage every face is one rigid triangle; do not merge or dissolve faces in another program"
    )]
    NotTriangle {
        /// The face.
        face: usize,
        /// Its corners.
        corners: usize,
    },
    /// A face has no flat position.
    #[error(
        "face {face} has no vt: a linkage has its closed position on the sheet there; export with texture coordinates (UVs), or use this file as a surface"
    )]
    NoFlat {
        /// The face.
        face: usize,
    },
    /// A face has one vertex twice.
    #[error(
        "face {face} has vertex {vertex} twice: no triangle; take linkage.obj as kagome wrote it"
    )]
    Twice {
        /// The face.
        face: usize,
        /// The vertex.
        vertex: usize,
    },
    /// A vertex has more than two faces.
    #[error(
        "vertex {vertex} belongs to faces {}, {} and {}: a hinge joins two triangles; this is a surface, or its vertices were merged by another program (export without merging by distance)", faces[0], faces[1], faces[2]
    )]
    TooManyFaces {
        /// The vertex.
        vertex: usize,
        /// Three of them.
        faces: [usize; 3],
    },
    /// Two faces share an edge.
    #[error(
        "faces {} and {} share vertices {} and {}: triangles of a linkage meet in one hinge; this is a surface, or its vertices were merged by another program (export without merging by distance)", faces[0], faces[1], vertices[0], vertices[1]
    )]
    SharedEdge {
        /// The faces.
        faces: [usize; 2],
        /// The vertices.
        vertices: [usize; 2],
    },
    /// A vertex has no face.
    #[error("vertex {vertex} belongs to no face; delete it and keep the others in their order")]
    Unused {
        /// The vertex.
        vertex: usize,
    },
    /// A flat triangle is not equilateral, or of another size.
    #[error(
        "face {face} is no equilateral triangle of edge {edge_mm:.6} mm on the sheet (vt): its edges are {:.6}, {:.6} and {:.6} mm ({count} such faces); take linkage.obj as kagome wrote it, or use this file as a surface", edges_mm[0], edges_mm[1], edges_mm[2]
    )]
    NotEquilateral {
        /// The first such face.
        face: usize,
        /// Median edge of all, millimetres.
        edge_mm: f64,
        /// Its edges, millimetres.
        edges_mm: [f64; 3],
        /// How many there are.
        count: usize,
    },
    /// The flat triangles have no size.
    #[error(
        "has flat triangles (vt) of edge {edge_mm:e} mm: too small to mean anything; were the texture coordinates scaled?"
    )]
    NoSize {
        /// Their edge, millimetres.
        edge_mm: f64,
    },
    /// A flat triangle runs clockwise.
    #[error(
        "face {face} is mirrored on the sheet: its vt run clockwise, its v counter-clockwise seen from outside ({count} such faces); turn the faces over, or mirror the texture coordinates back"
    )]
    Mirrored {
        /// The first such face.
        face: usize,
        /// How many there are.
        count: usize,
    },
    /// Slits cannot run opposite ways around in the two triangles of every hinge.
    #[error(
        "faces {} and {} cannot be hinged at vertex {vertex}: by their other hinges both are slit the same way around; were triangles joined by hand?", faces[0], faces[1]
    )]
    SameWayAround {
        /// The hinge.
        vertex: usize,
        /// The faces.
        faces: [usize; 2],
    },
    /// Closed, the triangles of a hinge do not continue one lattice.
    #[error(
        "faces {} and {}, hinged at vertex {vertex}, cannot be closed together: on the sheet (vt) they are turned by {turn_deg:.3}° against each other, and the pattern goes on across a seam only after multiples of 60°", faces[0], faces[1]
    )]
    Unclosable {
        /// The hinge.
        vertex: usize,
        /// The faces.
        faces: [usize; 2],
        /// The turn.
        turn_deg: f64,
    },
}

/// A problem and the line it is in, if one is to blame.
type Located = (Option<usize>, LinkageProblem);

/// Reads what [`write_obj`](super::write_obj) wrote, or another program after it: the linkage and the position of every
/// point, millimetres, both in the order of the file. `name` is what errors call it.
///
/// # Errors
/// [`LinkageReadError`] if it is no linkage, with the line, face or vertex.
pub fn read_obj(bytes: &[u8], name: &str) -> Result<(Linkage, Vec<Point3<f64>>), LinkageReadError> {
    read(bytes).map_err(|(line, problem)| LinkageReadError {
        file: name.into(),
        line,
        problem,
    })
}

/// Whether a file is meant as a linkage, sound or broken, and not as a surface: its first line says so, or it has faces
/// with a `vt` at every corner that hang together by single vertices, as no surface does.
pub fn is_linkage(bytes: &[u8]) -> bool {
    if bytes.contains(&0) {
        return false;
    }
    let text = String::from_utf8_lossy(bytes);
    if text.lines().next().is_some_and(|l| l.starts_with(HEADER)) {
        return true;
    }
    let Ok(raw) = scan(&text) else {
        return false;
    };
    // Sides that two faces share make a surface, vertices that two faces share a linkage.
    let mut sides: HashMap<(usize, usize), usize> = HashMap::new();
    let mut uses = vec![0u32; raw.positions.len()];
    for face in &raw.faces {
        for k in 0..3 {
            let (a, b) = (face.points[k], face.points[(k + 1) % 3]);
            *sides.entry((a.min(b), a.max(b))).or_default() += 1;
            uses[a] += 1;
        }
    }
    let shared = sides.values().filter(|&&n| n > 1).count();
    let hinges = uses.iter().filter(|&&n| n == 2).count();
    // A few merged vertices make a broken linkage, not a surface.
    hinges > 10 * shared
}

/// How the first line of `linkage.obj` begins.
pub(super) const HEADER: &str = "# kagome linkage";

/// A face as it stands in the file.
struct Face {
    line: usize,
    points: [usize; 3],
    flat: [usize; 3],
}

/// Numbers of a file, checked one by one.
struct Raw {
    positions: Vec<Point3<f64>>,
    flat: Vec<Point2<f64>>,
    faces: Vec<Face>,
}

fn read(bytes: &[u8]) -> Result<(Linkage, Vec<Point3<f64>>), Located> {
    if bytes.contains(&0) {
        return Err((None, LinkageProblem::NotText));
    }
    // Names and comments may be in another encoding; nothing else is.
    let raw = scan(&String::from_utf8_lossy(bytes))?;
    let (edge_mm, flat) = flat_triangles(&raw)?;
    let joints = joints(&raw)?;
    let ways = ways_around(&raw, &flat, &joints, edge_mm)?;
    let triangles: Per<TriangleId, Triangle> = raw
        .faces
        .iter()
        .zip(&flat)
        .zip(&ways.colours)
        .map(|((face, &flat), &colour)| Triangle {
            points: face.points.map(PointId::from_index),
            colour,
            flat,
            trim: None,
        })
        .collect();
    let mut hinges = Vec::with_capacity(joints.len());
    for (point, joint) in &joints {
        let first_ccw = ways.handedness.counter_clockwise(ways.colours[joint[0].0]);
        let [ccw, cw] = if first_ccw {
            *joint
        } else {
            [joint[1], joint[0]]
        };
        hinges.push(hinge(&raw, &flat, *point, ccw, cw, edge_mm)?);
    }
    let linkage = Linkage::from_parts(
        edge_mm,
        ways.handedness,
        triangles,
        hinges,
        raw.positions.len(),
    );
    Ok((linkage, raw.positions))
}

/// Looks at every line; every index is in range afterwards.
fn scan(text: &str) -> Result<Raw, Located> {
    let (mut positions, mut flat, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    // Indices beyond what the file has had so far: vertices may follow the faces that use them.
    let mut largest = [None::<(usize, usize, usize)>; 2];
    for (at, line) in text.lines().enumerate() {
        let here = |problem| (Some(at + 1), problem);
        let line = line.split('#').next().unwrap_or(line);
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => positions.push(Point3::from(numbers(words, "v").map_err(here)?)),
            Some("vt") => flat.push(Point2::from(numbers(words, "vt").map_err(here)?)),
            Some("f") => {
                let face = faces.len() + 1;
                let corners = words.clone().count();
                if corners != 3 {
                    return Err(here(LinkageProblem::NotTriangle { face, corners }));
                }
                let mut both = [[0; 3]; 2];
                for (corner, word) in words.enumerate() {
                    let mut parts = word.split('/');
                    let named = [
                        ("v", parts.next(), positions.len()),
                        ("vt", parts.next().filter(|t| !t.is_empty()), flat.len()),
                    ];
                    for (kind, (what, text, count)) in named.into_iter().enumerate() {
                        let text = text.ok_or_else(|| here(LinkageProblem::NoFlat { face }))?;
                        let index = index(text, count).ok_or_else(|| {
                            here(LinkageProblem::BadIndex {
                                face,
                                what,
                                text: text.into(),
                                count,
                            })
                        })?;
                        if largest[kind].is_none_or(|(most, _, _)| index > most) {
                            largest[kind] = Some((index, face, at + 1));
                        }
                        both[kind][corner] = index;
                    }
                }
                faces.push(Face {
                    line: at + 1,
                    points: both[0],
                    flat: both[1],
                });
            }
            _ => {}
        }
    }
    if faces.is_empty() {
        return Err((None, LinkageProblem::Empty));
    }
    let counts = [positions.len(), flat.len()];
    for (kind, what) in ["v", "vt"].into_iter().enumerate() {
        match largest[kind] {
            Some((index, face, line)) if index >= counts[kind] => {
                return Err((
                    Some(line),
                    LinkageProblem::BadIndex {
                        face,
                        what,
                        text: (index + 1).to_string(),
                        count: counts[kind],
                    },
                ));
            }
            _ => {}
        }
    }
    Ok(Raw {
        positions,
        flat,
        faces,
    })
}

/// The first N coordinates; what follows (weights, colours) is passed over.
fn numbers<'a, const N: usize>(
    mut words: impl Iterator<Item = &'a str>,
    what: &'static str,
) -> Result<[f64; N], LinkageProblem> {
    let mut found = [0.0; N];
    for (n, x) in found.iter_mut().enumerate() {
        let text = words.next().ok_or(LinkageProblem::Short {
            what,
            wanted: N,
            found: n,
        })?;
        *x = match text.parse::<f64>() {
            Ok(x) if x.abs() <= FARTHEST => x,
            _ => return Err(LinkageProblem::NotANumber { text: text.into() }),
        };
    }
    Ok(found)
}

/// An index counted from 0; negative ones count back from the last of `count` so far.
fn index(text: &str, count: usize) -> Option<usize> {
    let number: i64 = text.parse().ok()?;
    let index = if number < 0 {
        count as i64 + number
    } else {
        number - 1
    };
    // Point numbers are 32 bits wide.
    (0..i64::from(u32::MAX))
        .contains(&index)
        .then_some(index as usize)
}

/// Corners on the sheet, millimetres.
type FlatTriangle = [Point2<f64>; 3];

/// The mean edge and the flat triangles, which are equilateral, alike and counter-clockwise.
fn flat_triangles(raw: &Raw) -> Result<(f64, Vec<FlatTriangle>), Located> {
    let flat: Vec<FlatTriangle> = raw
        .faces
        .iter()
        .map(|f| f.flat.map(|t| raw.flat[t]))
        .collect();
    let edges = |t: &FlatTriangle| [0, 1, 2].map(|k| (t[(k + 1) % 3] - t[k]).norm());
    let mut lengths: Vec<f64> = flat.iter().flat_map(edges).collect();
    let mean = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
    let middle = lengths.len() / 2;
    let edge_mm = *lengths.select_nth_unstable_by(middle, f64::total_cmp).1;
    if edge_mm < LEAST_EDGE {
        return Err((None, LinkageProblem::NoSize { edge_mm }));
    }
    let far = flat
        .iter()
        .flatten()
        .map(|p| p.coords.amax())
        .fold(0.0, f64::max);
    let slack = EQUAL * edge_mm + SINGLE * far;
    let unequal = |t: &FlatTriangle| edges(t).iter().any(|e| (e - edge_mm).abs() > slack);
    let first_of = |bad: &dyn Fn(&FlatTriangle) -> bool| {
        let count = flat.iter().filter(|t| bad(t)).count();
        flat.iter().position(bad).map(|n| (n, count))
    };
    if let Some((n, count)) = first_of(&unequal) {
        return Err((
            Some(raw.faces[n].line),
            LinkageProblem::NotEquilateral {
                face: n + 1,
                edge_mm,
                edges_mm: edges(&flat[n]),
                count,
            },
        ));
    }
    let mirrored = |t: &FlatTriangle| (t[1] - t[0]).perp(&(t[2] - t[0])) < 0.0;
    if let Some((n, count)) = first_of(&mirrored) {
        let face = n + 1;
        return Err((
            Some(raw.faces[n].line),
            LinkageProblem::Mirrored { face, count },
        ));
    }
    Ok((mean, flat))
}

/// A corner as (face, corner).
type Place = (usize, usize);

/// Points of two faces, in the order of the points, with their corners.
fn joints(raw: &Raw) -> Result<Vec<(usize, [Place; 2])>, Located> {
    let mut uses: Vec<[Option<Place>; 2]> = vec![[None; 2]; raw.positions.len()];
    for (n, face) in raw.faces.iter().enumerate() {
        for (corner, &point) in face.points.iter().enumerate() {
            let there = &mut uses[point];
            let problem = match *there {
                [None, _] => {
                    there[0] = Some((n, corner));
                    continue;
                }
                [Some((a, _)), None] if a != n => {
                    there[1] = Some((n, corner));
                    continue;
                }
                [Some((a, _)), Some((b, _))] if a != n && b != n => LinkageProblem::TooManyFaces {
                    vertex: point + 1,
                    faces: [a + 1, b + 1, n + 1],
                },
                _ => LinkageProblem::Twice {
                    face: n + 1,
                    vertex: point + 1,
                },
            };
            return Err((Some(face.line), problem));
        }
    }
    let unused = uses.iter().position(|u| u[0].is_none());
    let joints: Vec<(usize, [Place; 2])> = uses
        .into_iter()
        .enumerate()
        .filter_map(|(point, [a, b])| Some((point, [a?, b?])))
        .collect();
    let mut pairs = HashMap::with_capacity(joints.len());
    for (point, [a, b]) in &joints {
        if let Some(other) = pairs.insert((a.0, b.0), *point) {
            return Err((
                Some(raw.faces[b.0].line),
                LinkageProblem::SharedEdge {
                    faces: [a.0 + 1, b.0 + 1],
                    vertices: [other + 1, point + 1],
                },
            ));
        }
    }
    match unused {
        Some(point) => Err((None, LinkageProblem::Unused { vertex: point + 1 })),
        None => Ok(joints),
    }
}

/// Which slit pattern, and every triangle's colour in it.
struct Ways {
    handedness: Handedness,
    colours: Vec<Colour>,
}

/// Finds out which way around every triangle is slit; see the head of this module.
fn ways_around(
    raw: &Raw,
    flat: &[FlatTriangle],
    joints: &[(usize, [Place; 2])],
    edge_mm: f64,
) -> Result<Ways, Located> {
    let count = flat.len();
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (j, (_, ends)) in joints.iter().enumerate() {
        ends.iter().for_each(|end| at[end.0].push(j));
    }
    // +1 or −1 by turns, within what hangs together.
    let mut sign = vec![0i8; count];
    // Of each group: its triangles.
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for first in 0..count {
        if sign[first] != 0 {
            continue;
        }
        sign[first] = 1;
        let mut group = vec![first];
        let mut next = 0;
        while let Some(&t) = group.get(next) {
            next += 1;
            for &j in &at[t] {
                let (point, ends) = &joints[j];
                let other = if ends[0].0 == t { ends[1].0 } else { ends[0].0 };
                if sign[other] == 0 {
                    sign[other] = -sign[t];
                    group.push(other);
                } else if sign[other] == sign[t] {
                    return Err((
                        Some(raw.faces[t.max(other)].line),
                        LinkageProblem::SameWayAround {
                            vertex: point + 1,
                            faces: [t.min(other) + 1, t.max(other) + 1],
                        },
                    ));
                }
            }
        }
        groups.push(group);
    }

    // Directions, tripled: alike for alike colours, opposite for opposite ones.
    let direction: Vec<Complex<f64>> = flat
        .iter()
        .map(|t| {
            let d = (t[1] - t[0]) / edge_mm;
            Complex::new(d.x, d.y).powu(3)
        })
        .collect();
    let mut known = Complex::new(0.0, 0.0);
    let mut unknown = Vec::new();
    for group in groups {
        let mut votes = 0.0;
        let mut gaps = 0.0;
        for &t in &group {
            for &j in &at[t] {
                let (point, ends) = &joints[j];
                if ends[0].0 == t {
                    votes += f64::from(sign[t]) * flat_vote(flat, ends, edge_mm);
                    gaps += f64::from(sign[t]) * space_vote(raw, *point, ends);
                }
            }
        }
        let vote = if votes != 0.0 { votes } else { gaps };
        if vote < 0.0 {
            group.iter().for_each(|&t| sign[t] = -sign[t]);
        }
        if vote == 0.0 || !vote.is_finite() {
            unknown.push(group);
        } else {
            known += group
                .iter()
                .map(|&t| direction[t] * f64::from(sign[t]))
                .sum::<Complex<f64>>();
        }
    }
    // `known` is the direction of triangles that are slit counter-clockwise: up in the right pattern.
    let right = known.re >= -UNDECIDED * known.norm();
    let handedness = if right {
        Handedness::Right
    } else {
        Handedness::Left
    };
    let up = match known.norm() {
        n if n > 0.0 && right => known,
        n if n > 0.0 => -known,
        _ => Complex::new(1.0, 0.0),
    };
    for group in unknown {
        let sum: Complex<f64> = group
            .iter()
            .map(|&t| direction[t] * f64::from(sign[t]))
            .sum();
        let along = (sum * up.conj()).re;
        if (along >= -UNDECIDED * sum.norm() * up.norm()) != right {
            group.iter().for_each(|&t| sign[t] = -sign[t]);
        }
    }
    let colours = sign
        .iter()
        .map(|&s| {
            if (s > 0) == right {
                Colour::Up
            } else {
                Colour::Down
            }
        })
        .collect();
    Ok(Ways {
        handedness,
        colours,
    })
}

/// +1 if, closed, the first triangle's slit side ends at its corner, −1 if the second's does; 0 at a seam.
fn flat_vote(flat: &[FlatTriangle], [a, b]: &[Place; 2], edge_mm: f64) -> f64 {
    let corner = |place: &Place, step: usize| flat[place.0][(place.1 + step) % 3];
    let near = |p: Point2<f64>, q: Point2<f64>| (p - q).norm() < SAME_FLAT_POINT * edge_mm;
    if !near(corner(a, 0), corner(b, 0)) {
        return 0.0;
    }
    f64::from(u8::from(near(corner(a, 2), corner(b, 1))))
        - f64::from(u8::from(near(corner(a, 1), corner(b, 2))))
}

/// By how much wider (radians) the gap before the second triangle is than that after the first, in space: positive if
/// the first is slit counter-clockwise.
fn space_vote(raw: &Raw, point: usize, [a, b]: &[Place; 2]) -> f64 {
    let hinge = raw.positions[point];
    let arm = |place: &Place, step: usize| {
        raw.positions[raw.faces[place.0].points[(place.1 + step) % 3]] - hinge
    };
    let angle = |u: Vector3<f64>, v: Vector3<f64>| u.cross(&v).norm().atan2(u.dot(&v));
    angle(arm(a, 1), arm(b, 2)) - angle(arm(a, 2), arm(b, 1))
}

/// The hinge of two corners, if the pattern goes on from one triangle to the other.
fn hinge(
    raw: &Raw,
    flat: &[FlatTriangle],
    point: usize,
    ccw: Place,
    cw: Place,
    edge_mm: f64,
) -> Result<Hinge, Located> {
    let corner = |place: Place, step: usize| flat[place.0][(place.1 + step) % 3];
    let apart = |p: Point2<f64>, q: Point2<f64>| (p - q).norm() > SAME_FLAT_POINT * edge_mm;
    // The slit's sides as the two have them.
    let mine: Vector2<f64> = corner(ccw, 2) - corner(ccw, 0);
    let theirs: Vector2<f64> = corner(cw, 1) - corner(cw, 0);
    let turn = mine.perp(&theirs).atan2(mine.dot(&theirs));
    let sixth = std::f64::consts::FRAC_PI_3;
    if (turn - (turn / sixth).round() * sixth).abs() > SAME_FLAT_POINT {
        return Err((
            Some(raw.faces[ccw.0.max(cw.0)].line),
            LinkageProblem::Unclosable {
                vertex: point + 1,
                faces: [ccw.0.min(cw.0) + 1, ccw.0.max(cw.0) + 1],
                turn_deg: turn.to_degrees(),
            },
        ));
    }
    let named = |place: Place| Corner {
        triangle: TriangleId::from_index(place.0),
        corner: place.1,
    };
    Ok(Hinge {
        point: PointId::from_index(point),
        ccw: named(ccw),
        cw: named(cw),
        seam: apart(corner(ccw, 0), corner(cw, 0)) || apart(corner(ccw, 2), corner(cw, 1)),
    })
}
