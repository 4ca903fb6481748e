//! OBJ through tobj, after a look at every line: tobj takes NaN for a number and does not say where it stumbled.

use std::collections::HashMap;

use nalgebra::Point3;

use super::{Format, Located, Problem, Soup, anywhere, three};

pub(super) fn read(bytes: &[u8]) -> Result<Soup, Located> {
    let mut soup = Soup::new(Format::Obj);
    // Names and comments may be in another encoding; nothing else is.
    let text = String::from_utf8_lossy(bytes);
    soup.positions = scan(&text)?;
    let options = tobj::LoadOptions {
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // Materials are of no interest: a library that is missing is not an error.
    let (models, _) =
        tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| Ok(Default::default())).map_err(
            |error| {
                anywhere(Problem::Syntax {
                    format: "OBJ",
                    reason: error.to_string(),
                })
            },
        )?;
    // Every group is a mesh with vertices renumbered: the file's own numbers come back by exact position.
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
    Ok(soup)
}

/// The bits of a position, with one kind of zero.
fn bits(p: &Point3<f64>) -> [u64; 3] {
    [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())
}

/// All vertices, once every number and index is known to be good.
fn scan(text: &str) -> Result<Vec<Point3<f64>>, Located> {
    let mut positions = Vec::new();
    // The largest index asked for: vertices may follow the faces that use them.
    let mut most: Option<(usize, usize, i64)> = None;
    let mut faces = 0;
    for (at, line) in text.split('\n').enumerate() {
        let here = |problem| (Some(at + 1), problem);
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                positions.push(Point3::from(three(words).map_err(here)?));
            }
            Some("f") => {
                faces += 1;
                for word in words.take_while(|w| !w.starts_with('#')) {
                    let bad = || {
                        here(Problem::BadIndex {
                            face: faces,
                            text: word.into(),
                            vertices: positions.len(),
                        })
                    };
                    let index: i64 = word
                        .split('/')
                        .next()
                        .and_then(|w| w.parse().ok())
                        .ok_or_else(bad)?;
                    // Negative indices count back from the last vertex so far.
                    if index == 0 || index < -(positions.len() as i64) {
                        return Err(bad());
                    }
                    if most.is_none_or(|m| index > m.2) {
                        most = Some((at + 1, faces, index));
                    }
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
        _ => Ok(positions),
    }
}
