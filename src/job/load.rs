//! Reading what a request names: the surface, its hash, and the cones as vertices of it.

use nalgebra::Point3;
use sha2::{Digest as _, Sha256};

use super::MakeError;
use super::design::ConeChoice;
use super::request::{ConePlace, ConeWish, Request, Source};
use crate::conformal::{Cone, vertex_from_number};
use crate::mesh::{ClosestPoint, Import, Sample, import_bytes, insert_point};

/// A surface with the decisions about it.
pub(crate) struct Loaded {
    /// The surface, with a vertex at every cone asked for by point.
    pub import: Import,
    /// SHA-256 of the mesh file, hexadecimal.
    pub sha256: Option<String>,
    /// Cones, as vertices; `None` while the program decides.
    pub cones: Option<Vec<Cone>>,
    /// As they will stand in the design file; `None` while the program decides.
    pub cone_choices: Option<Vec<ConeChoice>>,
}

/// Reads the surface, checks its hash, and turns the cones asked for into vertices.
pub(crate) fn load(request: &Request) -> Result<Loaded, MakeError> {
    let (mut import, sha256) = match &request.source {
        Source::Sample(text) => {
            let sample = Sample::parse(text).map_err(MakeError::Sample)?;
            (
                sample.import(&request.import).map_err(MakeError::Sample)?,
                None,
            )
        }
        Source::File { path, sha256 } => {
            let name = path.display().to_string();
            let bytes = std::fs::read(path).map_err(|source| MakeError::Read {
                path: path.clone(),
                source,
            })?;
            let found: String = Sha256::digest(&bytes)
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect();
            if let Some(expected) = sha256
                && !expected.eq_ignore_ascii_case(&found)
            {
                return Err(MakeError::Changed {
                    path: path.clone(),
                    expected: expected.clone(),
                    found,
                });
            }
            (
                import_bytes(&name, &bytes, &request.import).map_err(MakeError::Import)?,
                Some(found),
            )
        }
    };
    let wished = match &request.cones {
        ConeWish::Auto => {
            return Ok(Loaded {
                import,
                sha256,
                cones: None,
                cone_choices: None,
            });
        }
        ConeWish::Given(wished) => wished,
    };
    let (mut cones, mut choices) = (Vec::new(), Vec::new());
    for &(place, units) in wished {
        match place {
            ConePlace::Vertex(number) => {
                let count = import.surface.positions().len();
                let vertex = vertex_from_number(number)
                    .filter(|v| (v.0 as usize) < count)
                    .ok_or(MakeError::NoSuchVertex {
                        vertex: number,
                        count,
                    })?;
                cones.push(Cone { vertex, units });
                choices.push(ConeChoice {
                    vertex: Some(number),
                    at_mm: None,
                    units,
                });
            }
            ConePlace::Point(at) => {
                let found = ClosestPoint::new(&import.surface).query(Point3::from(at));
                let (low, high) = import.surface.bounds();
                if found.distance > 0.1 * (high - low).norm() {
                    return Err(MakeError::ConeFarAway {
                        at,
                        distance_mm: found.distance,
                    });
                }
                let (surface, vertex) =
                    insert_point(&import.surface, found.face, found.barycentric)
                        .map_err(MakeError::Edit)?;
                import.surface = surface;
                cones.push(Cone { vertex, units });
                choices.push(ConeChoice {
                    vertex: None,
                    at_mm: Some(at),
                    units,
                });
            }
        }
    }
    Ok(Loaded {
        import,
        sha256,
        cones: Some(cones),
        cone_choices: Some(choices),
    })
}
