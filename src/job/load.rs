//! Reading what a request names: the surface, its hash, and cones, darts and cuts by vertices of it.

use nalgebra::Point3;
use sha2::{Digest as _, Sha256};

use super::MakeError;
use super::design::{ConeChoice, CutChoice, DartChoice};
use super::make::title;
use super::request::{ConePlace, ConeWish, DartWish, Request, Source};
use super::targets::{Target, Targets, check_match, follow};
use crate::conformal::{Cone, Dart, vertex_from_number};
use crate::mesh::{
    Closest, ClosestPoint, Import, ImportOptions, Sample, Surface, Unit, Units, VertexId,
    import_bytes, insert_point,
};

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
    /// Darts; `None` while the program decides.
    pub darts: Option<Vec<Dart>>,
    /// As they will stand in the design file; `None` while the program decides.
    pub dart_choices: Option<Vec<DartChoice>>,
    /// Paths that the seam follows.
    pub cuts: Vec<Vec<VertexId>>,
    /// As they will stand in the design file.
    pub cut_choices: Vec<CutChoice>,
    /// Further surfaces that the pattern is to fit, with the same vertices.
    pub also: Vec<Also>,
}

/// A further surface.
pub(crate) struct Also {
    /// What a person calls it.
    pub name: String,
    /// The surface.
    pub import: Import,
    /// SHA-256 of the mesh file, hexadecimal.
    pub sha256: Option<String>,
}

/// Surfaces at the most that one pattern is fitted to: there are names for so many files.
pub(crate) const MOST_SURFACES: usize = 9;

impl Loaded {
    /// All surfaces that the pattern is to fit; `source` is that of the first.
    pub fn targets(&self, source: &Source) -> Targets {
        let first = Target::new(title(source), self.import.surface.clone());
        let further = self.also.iter();
        let further = further.map(|a| Target::new(a.name.clone(), a.import.surface.clone()));
        Targets(std::iter::once(first).chain(further).collect())
    }
}

/// A surface as it is, with the SHA-256 of its file.
fn read(source: &Source, options: &ImportOptions) -> Result<(Import, Option<String>), MakeError> {
    match source {
        Source::Sample(text) => {
            let sample = Sample::parse(text).map_err(MakeError::Sample)?;
            Ok((sample.import(options).map_err(MakeError::Sample)?, None))
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
            Ok((
                import_bytes(&name, &bytes, options).map_err(MakeError::Import)?,
                Some(found),
            ))
        }
    }
}

/// A source as it was given.
fn named(source: &Source) -> String {
    match source {
        Source::Sample(text) => format!("sample:{}", text.trim_start_matches("sample:")),
        Source::File { path, .. } => path.display().to_string(),
    }
}

/// The further surfaces of a request. They take the first one's millimetres per unit, so that how large they are beside
/// each other stays as it is in the files.
fn read_also(request: &Request, first: &Import) -> Result<Vec<Also>, MakeError> {
    let count = 1 + request.also.len();
    if count > MOST_SURFACES {
        return Err(MakeError::TooManySurfaces {
            count,
            most: MOST_SURFACES,
        });
    }
    let options = ImportOptions {
        units: Units {
            unit: Unit::Millimetre,
            scale: first.report.mm_per_unit,
            size_mm: None,
        },
        ..request.import
    };
    let titles: Vec<String> = std::iter::once(&request.source)
        .chain(&request.also)
        .map(title)
        .collect();
    let further = |(n, source): (usize, &Source)| {
        let (import, sha256) = read(source, &options)?;
        check_match(
            (&named(&request.source), &first.surface),
            (&named(source), &import.surface),
        )?;
        // Files of one name in several folders are told apart by their numbers.
        let number = n + 2;
        let name = &titles[n + 1];
        let taken = titles[..=n].contains(name);
        Ok(Also {
            name: if taken {
                format!("{name} ({number})")
            } else {
                name.clone()
            },
            import,
            sha256,
        })
    };
    request.also.iter().enumerate().map(further).collect()
}

/// Reads the surface, checks its hash, and turns the cones asked for into vertices.
pub(crate) fn load(request: &Request) -> Result<Loaded, MakeError> {
    let (mut import, sha256) = read(&request.source, &request.import)?;
    let mut also = read_also(request, &import)?;
    let before = (!also.is_empty()).then(|| import.surface.clone());
    let mut cones = None;
    let mut cone_choices = None;
    if let ConeWish::Given(wished) = &request.cones {
        let (mut list, mut choices) = (Vec::new(), Vec::new());
        for &(place, units) in wished {
            let vertex = vertex_at("cone", place, &mut import.surface)?;
            list.push(Cone { vertex, units });
            let (number, at_mm) = match place {
                ConePlace::Vertex(number) => (Some(number), None),
                ConePlace::Point(at) => (None, Some(at)),
            };
            choices.push(ConeChoice {
                vertex: number,
                at_mm,
                units,
            });
        }
        (cones, cone_choices) = (Some(list), Some(choices));
    }
    let mut darts = None;
    let mut dart_choices = None;
    if let DartWish::Given(wished) = &request.darts {
        let (mut list, mut choices) = (Vec::new(), Vec::new());
        for places in wished {
            let stops = places
                .iter()
                .map(|&place| vertex_at("dart", place, &mut import.surface))
                .collect::<Result<Vec<_>, _>>()?;
            let (vertices, points_mm) = written(places, &stops, &import.surface);
            list.push(Dart { stops });
            choices.push(DartChoice {
                vertices,
                points_mm,
            });
        }
        (darts, dart_choices) = (Some(list), Some(choices));
    }
    if let Some(before) = before {
        for further in &mut also {
            let shape = &mut further.import.surface;
            *shape = follow(shape, &before, &import.surface)?;
        }
    }
    let (mut cuts, mut cut_choices) = (Vec::new(), Vec::new());
    for places in &request.cuts {
        let surface = &import.surface;
        let stops = places
            .iter()
            .map(|&place| vertex_near("cut", place, surface))
            .collect::<Result<Vec<_>, _>>()?;
        if let Some(&vertex) = stops.first()
            && stops.iter().all(|&v| v == vertex)
        {
            let at = surface.position(vertex).into();
            return Err(MakeError::CutTooShort { vertex, at });
        }
        let (vertices, points_mm) = written(places, &stops, surface);
        cuts.push(stops);
        cut_choices.push(CutChoice {
            vertices,
            points_mm,
        });
    }
    Ok(Loaded {
        import,
        sha256,
        cones,
        cone_choices,
        darts,
        dart_choices,
        cuts,
        cut_choices,
        also,
    })
}

/// The places of a path as a design names them: all by their numbers or all as points.
fn written(
    places: &[ConePlace],
    stops: &[VertexId],
    surface: &Surface,
) -> (Vec<u64>, Vec<[f64; 3]>) {
    let (mut vertices, mut points_mm) = (Vec::new(), Vec::new());
    for &place in places {
        match place {
            ConePlace::Vertex(number) => vertices.push(number),
            ConePlace::Point(at) => points_mm.push(at),
        }
    }
    if !vertices.is_empty() && !points_mm.is_empty() {
        vertices.clear();
        points_mm = stops.iter().map(|&v| surface.position(v).into()).collect();
    }
    (vertices, points_mm)
}

/// The vertex at a place, made one if it is none.
fn vertex_at(
    what: &'static str,
    place: ConePlace,
    surface: &mut Surface,
) -> Result<VertexId, MakeError> {
    match place {
        ConePlace::Vertex(number) => numbered(what, number, surface),
        ConePlace::Point(at) => {
            let found = found_at(what, at, surface)?;
            let (changed, vertex) =
                insert_point(surface, found.face, found.barycentric).map_err(MakeError::Edit)?;
            *surface = changed;
            Ok(vertex)
        }
    }
}

/// The vertex nearest to a place; the surface stays as it is.
fn vertex_near(
    what: &'static str,
    place: ConePlace,
    surface: &Surface,
) -> Result<VertexId, MakeError> {
    match place {
        ConePlace::Vertex(number) => numbered(what, number, surface),
        ConePlace::Point(at) => {
            let found = found_at(what, at, surface)?;
            let far = |k: usize| (surface.corners(found.face)[k] - found.point).norm();
            let nearest = (1..3).fold(0, |best, k| if far(k) < far(best) { k } else { best });
            Ok(surface.faces()[found.face][nearest])
        }
    }
}

/// The vertex with a number, counted from 1.
fn numbered(what: &'static str, number: u64, surface: &Surface) -> Result<VertexId, MakeError> {
    let count = surface.positions().len();
    vertex_from_number(number)
        .filter(|v| (v.0 as usize) < count)
        .ok_or(MakeError::NoSuchVertex {
            what,
            vertex: number,
            count,
        })
}

/// The nearest point of the surface, unless it is far away.
fn found_at(what: &'static str, at: [f64; 3], surface: &Surface) -> Result<Closest, MakeError> {
    let found = ClosestPoint::new(surface).query(Point3::from(at));
    let (low, high) = surface.bounds();
    if found.distance > 0.1 * (high - low).norm() {
        return Err(MakeError::FarAway {
            what,
            at,
            distance_mm: found.distance,
        });
    }
    Ok(found)
}
