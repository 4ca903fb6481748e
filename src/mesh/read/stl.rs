//! STL through stl_io, text and binary. Every triangle brings its own corners; they are welded later.

use nalgebra::Point3;

use super::{Format, Located, Problem, Soup, anywhere, three};

/// Bytes before the first triangle of a binary file, and bytes of a triangle.
const HEADER: usize = 84;
const RECORD: usize = 50;

/// A binary file says its number of triangles and is exactly as long as that: more reliable than the word `solid`,
/// with which many binary files begin too.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    bytes.get(80..HEADER).is_some_and(|count| {
        let count = count.iter().rev().fold(0usize, |n, b| n << 8 | *b as usize);
        count.checked_mul(RECORD) == Some(bytes.len() - HEADER)
    })
}

pub(super) fn read(bytes: &[u8]) -> Result<Soup, Located> {
    let binary = is_binary(bytes);
    if !binary {
        scan(bytes)?;
    }
    let syntax = |reason: String| {
        anywhere(Problem::Syntax {
            format: "STL",
            reason,
        })
    };
    if !binary && !bytes.trim_ascii_start().starts_with(b"solid") {
        return Err(syntax(
            "it is cut off, or neither text nor binary STL; export it again".into(),
        ));
    }
    // A binary header that begins with `solid` would send stl_io down the wrong path.
    let mut owned;
    let mut source = std::io::Cursor::new(if binary {
        owned = bytes.to_vec();
        owned[..80].fill(0);
        &owned[..]
    } else {
        bytes
    });
    let triangles = stl_io::create_stl_reader(&mut source).map_err(|e| syntax(e.to_string()))?;
    let mut soup = Soup::new(Format::Stl);
    for triangle in triangles {
        let triangle = triangle.map_err(|e| syntax(e.to_string()))?;
        let first = soup.positions.len() as u32;
        for corner in triangle.vertices {
            let p = Point3::from(corner.0.map(f64::from));
            if !p.iter().all(|x| x.is_finite()) {
                return Err(anywhere(Problem::NotFinite {
                    vertex: soup.positions.len() + 1,
                }));
            }
            soup.positions.push(p);
        }
        soup.push_polygon(&[first, first + 1, first + 2])
            .map_err(anywhere)?;
    }
    Ok(soup)
}

/// Looks at the numbers of a text file, for the line of a bad one.
fn scan(bytes: &[u8]) -> Result<(), Located> {
    for (at, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_whitespace();
        if words.next() == Some("vertex") {
            three(words).map_err(|problem| (Some(at + 1), problem))?;
        }
    }
    Ok(())
}
