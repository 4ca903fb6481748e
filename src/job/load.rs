//! Reading what a request names: the surface, its hash, and cones, darts and cuts by vertices of it.

use std::sync::Arc;

use nalgebra::Point3;
use sha2::{Digest as _, Sha256};

use super::MakeError;
use super::design::{ConeChoice, CutChoice, DartChoice};
use super::make::title;
use super::request::{ConePlace, ConeWish, DartWish, Request, RimWish, Source};
use super::shape::Rim;
use super::targets::{Target, Targets, check_match, follow};
use crate::base::ids::Id as _;
use crate::conformal::{Cone, Dart, Sizing, vertex_from_number};
use crate::linkage::SmoothRim;
use crate::mesh::{
    Closest, ClosestPoint, FaceId, HalfedgeId, Import, ImportOptions, Sample, Surface, Unit, Units,
    VertexId, import_bytes, insert_point, skirt,
};
use crate::pattern::SheetOptions;

/// A surface with the decisions about it.
pub(crate) struct Loaded {
    /// The surface, with a vertex at every cone asked for by point; continued beyond its rims where those are to be smooth.
    pub import: Import,
    /// That continuation.
    pub skirt: Option<Skirt>,
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

/// A surface's continuation beyond its rims.
pub(crate) struct Skirt {
    /// How far it reaches, millimetres.
    pub width_mm: f64,
    /// By face: whether it belongs to it.
    pub beyond: Vec<bool>,
    /// The surface without it.
    pub inner: Arc<Surface>,
    /// Rims without, by number from 0: the triangles' edges are the rim there.
    pub bare_rims: Vec<usize>,
}

/// A skirt is this much wider than a triangle's edge: what is cut off of a triangle reaches less than an edge beyond.
const SKIRT_IN_EDGES: f64 = 1.2;

/// How far a pattern opens on average, about: an edge on the sheet is so much longer a way on the surface.
const MEAN_OPENING: f64 = 1.3;

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
    /// Where the sheet is cut along the surface's own rim: beyond the tips of slits, which are a neck from their vertex. From
    /// a tip to the arm beside it and to a rim there it is as far, and more than a hinge's width.
    pub fn rim(&self, options: &SheetOptions) -> Option<Rim> {
        let skirt = self.skirt.as_ref()?;
        // Of the edge only the neck's check makes use.
        let metadata = options.metadata(1.0);
        let tip = metadata.tip.radius_mm(metadata.kerf_mm);
        Some(Rim {
            cut: SmoothRim {
                beyond: Arc::from(skirt.beyond.as_slice()),
                margin_mm: metadata.neck_mm() + tip,
            },
            inner: Arc::clone(&skirt.inner),
        })
    }

    /// Area of the surface, without its continuation, mm².
    pub fn area_mm2(&self) -> f64 {
        match &self.skirt {
            Some(skirt) => skirt.inner.area(),
            None => self.import.surface.area(),
        }
    }

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

/// Continues the surface beyond its rims, where those are to be smooth.
fn with_skirt(request: &Request, surface: &mut Surface) -> Result<Option<Skirt>, MakeError> {
    let RimWish::Smooth { skirt_mm } = request.sheet.rim else {
        return Ok(None);
    };
    if !request.also.is_empty() {
        return Err(MakeError::RimOfSeveral);
    }
    let width_mm = skirt_mm.unwrap_or_else(|| {
        SKIRT_IN_EDGES
            * match request.sizing {
                Sizing::EdgeMm(edge_mm) => MEAN_OPENING * edge_mm,
                // Opened, so many triangles cover it.
                Sizing::Triangles(count) => {
                    (surface.area() / (0.75f64.sqrt() * 0.5 * count)).sqrt()
                }
            }
    });
    let wide = skirt(surface, width_mm).map_err(MakeError::Skirt)?;
    let inner = std::mem::replace(surface, wide.surface);
    Ok(Some(Skirt {
        width_mm,
        beyond: wide.beyond,
        inner: Arc::new(inner),
        bare_rims: wide.bare_rims,
    }))
}

/// Reads the surface, checks its hash, and turns the cones asked for into vertices.
pub(crate) fn load(request: &Request) -> Result<Loaded, MakeError> {
    let (mut import, sha256) = read(&request.source, &request.import)?;
    let mut also = read_also(request, &import)?;
    let mut skirt = with_skirt(request, &mut import.surface)?;
    let before = (!also.is_empty()).then(|| import.surface.clone());
    let mut cones = None;
    let mut cone_choices = None;
    if let ConeWish::Given(wished) = &request.cones {
        let (mut list, mut choices) = (Vec::new(), Vec::new());
        for &(place, units) in wished {
            let vertex = vertex_at("cone", place, &mut import.surface, &mut skirt)?;
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
                .map(|&place| vertex_at("dart", place, &mut import.surface, &mut skirt))
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
        skirt,
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
    skirt: &mut Option<Skirt>,
) -> Result<VertexId, MakeError> {
    match place {
        ConePlace::Vertex(number) => numbered(what, number, surface),
        ConePlace::Point(at) => {
            let found = found_at(what, at, surface)?;
            let (changed, vertex) =
                insert_point(surface, found.face, found.barycentric).map_err(MakeError::Edit)?;
            if let Some(skirt) = skirt {
                // A part of a split face has two of its corners, and is where it was.
                let around = (0..3).filter_map(|k| surface.twin(HalfedgeId::side(found.face, k)));
                let old: Vec<FaceId> = std::iter::once(found.face)
                    .chain(around.map(HalfedgeId::face))
                    .collect();
                for new in surface.faces().len()..changed.faces().len() {
                    let corners = changed.faces()[FaceId(new as u32)];
                    let of = old.iter().find(|f| {
                        let own = &surface.faces()[**f];
                        corners.iter().filter(|c| own.contains(c)).count() == 2
                    });
                    let beyond = of.is_some_and(|f| skirt.beyond[f.index()]);
                    skirt.beyond.push(beyond);
                }
            }
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
