//! OBJ through tobj, after a look at every line: tobj takes NaN for a number and does not say where it stumbled.
//! It is given positions and faces alone, so that colours, normals, groups and materials cannot make it stumble.

use std::collections::HashMap;

use nalgebra::Point3;

use super::{Format, Located, Problem, Soup, anywhere, three};

pub(super) fn read(bytes: &[u8]) -> Result<Soup, Located> {
    let mut soup = Soup::new(Format::Obj);
    // Names and comments may be in another encoding; nothing else is.
    let text = String::from_utf8_lossy(bytes);
    let Scan {
        positions,
        clean,
        polygons,
        faces: file_faces,
    } = scan(&text)?;
    soup.positions = positions;
    let mut file_numbers = polygons.into_iter();
    let options = tobj::LoadOptions {
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let (models, _) =
        tobj::load_obj_buf(&mut clean.as_bytes(), &options, |_| Ok(Default::default())).map_err(
            |error| {
                anywhere(Problem::Syntax {
                    format: "OBJ",
                    reason: error.to_string(),
                })
            },
        )?;
    // A mesh has its vertices renumbered: the file's own numbers come back by exact position.
    let mut number: HashMap<[u64; 3], u32> = HashMap::with_capacity(soup.positions.len());
    for (i, p) in soup.positions.iter().enumerate() {
        number.entry(bits(p)).or_insert(i as u32);
    }
    let mut polygon = Vec::new();
    for model in &models {
        let mesh = &model.mesh;
        let mut corners = mesh.indices.iter();
        let triangles = mesh.indices.len() / 3;
        let arity = |i: usize| mesh.face_arities.get(i).map_or(3, |a| *a as usize);
        let faces = if mesh.face_arities.is_empty() {
            triangles
        } else {
            mesh.face_arities.len()
        };
        for face in 0..faces {
            polygon.clear();
            soup.file_faces = file_numbers.next().unwrap_or(soup.file_faces);
            for &corner in corners.by_ref().take(arity(face)) {
                let at = 3 * corner as usize;
                let vertex = mesh
                    .positions
                    .get(at..at + 3)
                    .and_then(|p| number.get(&bits(&Point3::new(p[0], p[1], p[2]))));
                polygon.push(*vertex.ok_or_else(|| {
                    anywhere(Problem::BadIndex {
                        face: soup.file_faces + 1,
                        text: (corner + 1).to_string(),
                        vertices: soup.positions.len(),
                    })
                })?);
            }
            soup.push_polygon(&polygon).map_err(anywhere)?;
        }
    }
    soup.file_faces = file_faces;
    Ok(soup)
}

/// The bits of a position, with one kind of zero.
fn bits(p: &Point3<f64>) -> [u64; 3] {
    [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())
}

/// What a first look at a file gives.
struct Scan {
    positions: Vec<Point3<f64>>,
    /// The lines that tobj needs.
    clean: String,
    /// The number in the file, from 0, of each face that has three corners or more.
    polygons: Vec<usize>,
    /// Faces in the file.
    faces: usize,
}

/// Looks at every number and index.
fn scan(text: &str) -> Result<Scan, Located> {
    let mut polygons = Vec::new();
    let mut positions = Vec::new();
    let mut clean = String::with_capacity(text.len());
    // The largest index asked for: vertices may follow the faces that use them.
    let mut most: Option<(usize, usize, i64)> = None;
    let mut faces = 0;
    for (at, line) in text.split('\n').enumerate() {
        let here = |problem| (Some(at + 1), problem);
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                positions.push(Point3::from(three(words.clone()).map_err(here)?));
                clean.push('v');
                words.take(3).for_each(|word| append(&mut clean, word));
                clean.push('\n');
            }
            Some("f") => {
                faces += 1;
                let before = clean.len();
                let mut corners = 0;
                clean.push('f');
                for word in words.take_while(|w| !w.starts_with('#')) {
                    let bad = || {
                        here(Problem::BadIndex {
                            face: faces,
                            text: word.into(),
                            vertices: positions.len(),
                        })
                    };
                    let position = word.split('/').next().unwrap_or(word);
                    let index: i64 = position.parse().map_err(|_| bad())?;
                    // Negative indices count back from the last vertex so far.
                    if index == 0 || index < -(positions.len() as i64) {
                        return Err(bad());
                    }
                    if most.is_none_or(|m| index > m.2) {
                        most = Some((at + 1, faces, index));
                    }
                    append(&mut clean, position);
                    corners += 1;
                }
                clean.push('\n');
                if corners >= 3 {
                    polygons.push(faces - 1);
                } else {
                    // Points and lines written as faces are no part of a surface.
                    clean.truncate(before);
                }
            }
            _ => {}
        }
    }
    match most {
        Some((line, face, index)) if index > positions.len() as i64 => Err((
            Some(line),
            Problem::BadIndex {
                face,
                text: index.to_string(),
                vertices: positions.len(),
            },
        )),
        _ => Ok(Scan {
            positions,
            clean,
            polygons,
            faces,
        }),
    }
}

fn append(text: &mut String, word: &str) {
    text.push(' ');
    text.push_str(word);
}
