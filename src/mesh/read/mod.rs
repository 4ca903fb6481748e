//! Files into triangles: OBJ, STL (both kinds), PLY (both kinds). What the triangles are worth is decided in
//! [`super::repair`].

mod obj;
mod ply;
mod polygon;
mod stl;

use std::path::Path;

use nalgebra::Point3;

use super::error::{ImportError, Problem};

/// Kinds of file that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// STL as text or binary.
    Stl,
    /// PLY as text or binary.
    Ply,
}

impl Format {
    /// Its usual name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Obj => "OBJ",
            Self::Stl => "STL",
            Self::Ply => "PLY",
        }
    }

    /// By content first (people rename files), by the name's extension where content does not tell.
    fn detect(name: &str, bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Some(Self::Ply);
        }
        if stl::is_binary(bytes) {
            return Some(Self::Stl);
        }
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
        let first_words: Vec<&str> = head
            .lines()
            .filter_map(|l| l.split_whitespace().next())
            .filter(|w| !w.starts_with('#'))
            .collect();
        if first_words.first() == Some(&"solid") && !first_words.contains(&"v") {
            return Some(Self::Stl);
        }
        if first_words.contains(&"v") && !head.contains('\0') {
            return Some(Self::Obj);
        }
        let extension = Path::new(name).extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "obj" => Some(Self::Obj),
            "stl" => Some(Self::Stl),
            "ply" => Some(Self::Ply),
            _ => None,
        }
    }
}

/// Triangles as they stand in a file: nothing welded, dropped or turned.
#[derive(Clone, Debug)]
pub struct Soup {
    /// What kind of file it was.
    pub format: Format,
    /// Vertices in the order of the file, in its units, finite.
    pub positions: Vec<Point3<f64>>,
    /// Triangles with indices into `positions`.
    pub faces: Vec<[u32; 3]>,
    /// For each triangle the face of the file that it is a part of, counted from 0.
    pub source: Vec<u32>,
    /// Faces in the file.
    pub file_faces: usize,
    /// Faces in the file with more than three corners.
    pub polygons: usize,
}

impl Soup {
    fn new(format: Format) -> Self {
        Self {
            format,
            positions: Vec::new(),
            faces: Vec::new(),
            source: Vec::new(),
            file_faces: 0,
            polygons: 0,
        }
    }

    /// Adds a face of the file; its number is counted on.
    fn push_polygon(&mut self, corners: &[u32]) -> Result<(), Problem> {
        let face = self.file_faces;
        self.file_faces += 1;
        polygon::triangulate(&self.positions, corners, &mut self.faces).ok_or(
            Problem::BadPolygon {
                face: face + 1,
                corners: corners.len(),
            },
        )?;
        self.polygons += usize::from(corners.len() > 3);
        self.source.resize(self.faces.len(), face as u32);
        Ok(())
    }
}

/// A problem and the line it is in, if known.
type Located = (Option<usize>, Problem);

fn anywhere(problem: Problem) -> Located {
    (None, problem)
}

/// Reads bytes that came from `name`.
///
/// # Errors
/// [`ImportError`] with the line where there are lines.
pub fn read_bytes(name: &str, bytes: &[u8]) -> Result<Soup, ImportError> {
    let result = match Format::detect(name, bytes) {
        Some(Format::Obj) => obj::read(bytes),
        Some(Format::Stl) => stl::read(bytes),
        Some(Format::Ply) => ply::read(bytes),
        None => Err(anywhere(Problem::UnknownFormat)),
    };
    result.map_err(|(line, problem)| ImportError {
        file: name.into(),
        line,
        problem,
    })
}

/// Reads a file.
///
/// # Errors
/// [`ImportError`].
pub fn read_file(path: &Path) -> Result<Soup, ImportError> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|source| ImportError {
        file: name.clone(),
        line: None,
        problem: source.into(),
    })?;
    read_bytes(&name, &bytes)
}

/// A coordinate as text.
fn coordinate(text: &str) -> Result<f64, Problem> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(Problem::NotANumber { text: text.into() }),
    }
}

/// Three coordinates, and whatever follows them.
fn three<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<[f64; 3], Problem> {
    let mut xyz = [0.0; 3];
    for (found, x) in xyz.iter_mut().enumerate() {
        *x = coordinate(words.next().ok_or(Problem::ShortVertex { found })?)?;
    }
    Ok(xyz)
}

#[cfg(test)]
mod tests;
