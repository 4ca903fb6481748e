//! PLY through ply-rs-bw, text and binary: the elements `vertex` (x, y, z) and `face` (`vertex_indices` or
//! `vertex_index`).

use nalgebra::Point3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};

use super::{Format, Located, Problem, Soup, anywhere};

pub(super) fn read(bytes: &[u8]) -> Result<Soup, Located> {
    let syntax = |line: Option<usize>, reason: String| {
        (
            line,
            Problem::Syntax {
                format: "PLY",
                reason,
            },
        )
    };
    let ply = Parser::<DefaultElement>::new()
        .read_ply(&mut &bytes[..])
        .map_err(|e| {
            let words: Vec<String> = e.to_string().split_whitespace().map(String::from).collect();
            syntax(e.line(), words.join(" "))
        })?;
    let elements = |name: &str| {
        ply.payload
            .get(name)
            .ok_or_else(|| syntax(None, format!("it has no element named {name:?}")))
    };
    let mut soup = Soup::new(Format::Ply);
    for (i, vertex) in elements("vertex")?.iter().enumerate() {
        let mut xyz = [0.0; 3];
        for (x, key) in xyz.iter_mut().zip(["x", "y", "z"]) {
            *x = vertex
                .get(key)
                .and_then(scalar)
                .ok_or_else(|| syntax(None, format!("its vertices have no number {key:?}")))?;
        }
        if !xyz.iter().all(|x| x.is_finite()) {
            return Err(anywhere(Problem::NotFinite { vertex: i + 1 }));
        }
        soup.positions.push(Point3::from(xyz));
    }
    for face in elements("face")? {
        let corners = face
            .get("vertex_indices")
            .or_else(|| face.get("vertex_index"))
            .and_then(indices)
            .ok_or_else(|| {
                syntax(
                    None,
                    format!("face {} has no list of vertex indices", soup.file_faces + 1),
                )
            })?;
        let count = soup.positions.len();
        let mut polygon = Vec::with_capacity(corners.len());
        for corner in corners {
            let good = u32::try_from(corner).ok().filter(|c| (*c as usize) < count);
            polygon.push(good.ok_or_else(|| {
                anywhere(Problem::BadIndex {
                    face: soup.file_faces + 1,
                    text: format!("{corner} (counted from 0)"),
                    vertices: count,
                })
            })?);
        }
        if polygon.len() < 3 {
            // Points and lines written as faces are no part of a surface.
            soup.file_faces += 1;
            continue;
        }
        soup.push_polygon(&polygon).map_err(anywhere)?;
    }
    Ok(soup)
}

fn scalar(property: &Property) -> Option<f64> {
    Some(match property {
        Property::Char(x) => f64::from(*x),
        Property::UChar(x) => f64::from(*x),
        Property::Short(x) => f64::from(*x),
        Property::UShort(x) => f64::from(*x),
        Property::Int(x) => f64::from(*x),
        Property::UInt(x) => f64::from(*x),
        Property::Float(x) => f64::from(*x),
        Property::Double(x) => *x,
        _ => return None,
    })
}

fn indices(property: &Property) -> Option<Vec<i64>> {
    Some(match property {
        Property::ListChar(v) => v.iter().map(|x| i64::from(*x)).collect(),
        Property::ListUChar(v) => v.iter().map(|x| i64::from(*x)).collect(),
        Property::ListShort(v) => v.iter().map(|x| i64::from(*x)).collect(),
        Property::ListUShort(v) => v.iter().map(|x| i64::from(*x)).collect(),
        Property::ListInt(v) => v.iter().map(|x| i64::from(*x)).collect(),
        Property::ListUInt(v) => v.iter().map(|x| i64::from(*x)).collect(),
        _ => return None,
    })
}
