//! The conformal map alone, for trying cones, darts and rims before anything is made of it.
//!
//! [`explore`] takes the same [`Request`] as [`make`](super::make()) and goes as far as the map: what stretch the
//! surface asks for, where, and what of it the sheet does not have. With cones given, or none, that is one linear
//! factorisation and a few Newton steps. Asked to propose, it also searches for singularities, as `make` does, and
//! tells each set in the words in which it can be asked for.

use std::path::Path;
use std::sync::Arc;

use super::MakeError;
use super::design::Design;
use super::load::{Loaded, load};
use super::make::{Taken, check_sizing, checked_sigma, decided, stock, title};
use super::map_figures::{ConeFigures, MapFigures};
use super::maps::{Ground, Map, cone_opening_mm, maps};
use super::report::{MapPage, map_html};
use super::request::Request;
use super::shape::lay_out;
use super::strength::Strength;
use crate::base::progress::Progress;
use crate::conformal::{Cone, ConformalError, around_handles};
use crate::linkage::SeamGuide;
use crate::mesh::{Surface, VertexId, write};

/// Maps of a surface, the most promising first; never empty.
pub struct Explored {
    request: Request,
    loaded: Loaded,
    sigma: f64,
    maps: Vec<Map>,
}

/// Maps the surface of `request`. With cones left to the program this is the map without any, unless it is asked to
/// `propose`, or none is possible without. Further surfaces are not looked at.
///
/// # Errors
/// [`MakeError`] for input that cannot be used, a map that does not exist, or an interruption.
pub fn explore(
    request: &Request,
    propose: bool,
    progress: &dyn Progress,
) -> Result<Explored, MakeError> {
    // A map is one of the first surface.
    let request = &Request {
        also: Vec::new(),
        shares: None,
        ..request.clone()
    };
    let material = crate::material::load(&request.material).map_err(MakeError::Material)?;
    let mut sigma = checked_sigma(request.sigma.unwrap_or(material.sigma.max))?;
    check_sizing(request.sizing)?;
    let strength = Strength::of(request, &material)?;
    progress.start("reading the surface", None);
    let loaded = load(request)?;
    if let Some(strength) = strength.filter(|_| request.sigma.is_none()) {
        let machine = crate::machine::load(&request.machine).map_err(MakeError::Machine)?;
        let setting = material.cut_for(&machine).map_err(MakeError::Cut)?;
        let options = stock(request, &material, &machine, &setting)?.options;
        if let Some(own) = strength.sigma(request, &options, &material, loaded.area_mm2())? {
            sigma = checked_sigma(own)?;
        }
    }
    let surface = &loaded.import.surface;
    // As `make` does: handles around which the pattern cannot close are opened where that is left to the program.
    let free = request.darts_are_free();
    let mut darts = loaded.darts.clone().unwrap_or_default();
    // No sheet is cut here, so that it is all one where a seam would run.
    let guide = SeamGuide::new(surface);
    let mut found = loop {
        let ground = Arc::new(Ground::new(surface, &darts, &guide, &[])?);
        match mapped(request, &loaded, &ground, sigma, propose, progress) {
            Err(MakeError::Conformal(
                error @ (ConformalError::Holonomy { .. } | ConformalError::TotalCurvature { .. }),
            )) if free && darts.is_empty() && surface.genus() > 0 => {
                progress.note(&format!("the handles are cut open: {error}"));
                darts = around_handles(surface).map_err(MakeError::Conformal)?;
            }
            found => break found?,
        }
    };
    // Of maps that differ only in the triangles that their cones lose, the best one: they are sorted.
    let mut maps: Vec<Map> = Vec::new();
    for map in found.drain(..) {
        let known = |m: &Map| m.flat.singularities == map.flat.singularities;
        if !maps.iter().any(known) {
            maps.push(map);
        }
    }
    Ok(Explored {
        request: request.clone(),
        loaded,
        sigma,
        maps,
    })
}

fn mapped(
    request: &Request,
    loaded: &Loaded,
    ground: &Arc<Ground>,
    sigma: f64,
    propose: bool,
    progress: &dyn Progress,
) -> Result<Vec<Map>, MakeError> {
    let given = loaded.cones.as_deref();
    let plain: Option<&[Cone]> = if propose { None } else { Some(&[]) };
    match maps(request, given.or(plain), ground, sigma, progress) {
        // A ball has no flat map without cones.
        Err(MakeError::Conformal(ConformalError::TotalCurvature { .. }))
            if given.is_none() && !propose && ground.surface.genus() == 0 =>
        {
            progress.note("a closed surface needs cones: searching for them");
            maps(request, None, ground, sigma, progress)
        }
        found => found,
    }
}

impl Explored {
    /// Figures of all maps, the most promising first.
    pub fn figures(&self) -> Vec<MapFigures> {
        self.maps.iter().map(|map| self.figures_of(map)).collect()
    }

    /// A page with pictures of the most promising map.
    ///
    /// # Errors
    /// [`MakeError::Internal`] only.
    pub fn html(&self) -> Result<String, MakeError> {
        let map = self.best()?;
        let figures = self.figures_of(map);
        let value = serde_json::to_value(&figures).map_err(internal)?;
        let largest = map.flat.scale.max_vertex;
        Ok(map_html(&MapPage {
            title: &title(&self.request.source),
            suffices: figures.suffices,
            answer: &figures.answer(),
            summary: &figures.summary(),
            surface: &map.ground.surface,
            layout: &map.flat.layout,
            cone_opening_mm: cone_opening_mm(map.removal, map.flat.edge_mm),
            sigma: self.sigma,
            largest_at: map.ground.surface.position(largest),
            figures: &value,
        }))
    }

    /// The most promising map as OBJ text: the surface, with its layout as texture coordinates in millimetres.
    ///
    /// # Errors
    /// [`MakeError::Internal`] only.
    pub fn obj(&self) -> Result<String, MakeError> {
        let map = self.best()?;
        let surface = &map.ground.surface;
        let chart: Vec<_> = map.flat.layout.corners.iter().copied().collect();
        Ok(write::obj_text(
            "kagome layout: the surface in mm, vt = conformal layout on the sheet in mm",
            surface.positions(),
            surface.faces(),
            Some(&chart),
        ))
    }

    /// The most promising map as a design that `make` takes, with every decision filled in as `make` would for this
    /// map: edge and orientation are those of the lattice fitted to it, and no triangle is left out. `folder` is where
    /// the design will lie.
    ///
    /// # Errors
    /// [`MakeError`]: profiles that do not fit each other, no lattice, interruption.
    pub fn design(&self, folder: &Path, progress: &dyn Progress) -> Result<Design, MakeError> {
        let request = &self.request;
        let material = crate::material::load(&request.material).map_err(MakeError::Material)?;
        let machine = crate::machine::load(&request.machine).map_err(MakeError::Machine)?;
        let setting = material.cut_for(&machine).map_err(MakeError::Cut)?;
        let mut stock = stock(request, &material, &machine, &setting)?;
        stock.rim = self.loaded.rim(&stock.options);
        stock.sigma = self.sigma;
        let map = self.best()?;
        let laid = lay_out(request, map, &[], &stock, progress)?;
        let taken = Taken {
            flat: &laid.flat,
            darts: &map.ground.darts,
            removed: map.removal,
            left_out: &[],
            orientation_deg: laid.orientation_deg,
            shares: &[1.0],
        };
        Ok(decided(request, folder, &self.loaded, &taken, &stock))
    }

    fn best(&self) -> Result<&Map, MakeError> {
        self.maps
            .first()
            .ok_or_else(|| MakeError::Internal("no map was made".into()))
    }

    fn figures_of(&self, map: &Map) -> MapFigures {
        let (surface, flat) = (&map.ground.surface, &map.flat);
        let scale = &flat.scale;
        let at = |v: VertexId| -> [f64; 3] { surface.position(v).into() };
        let set = &flat.singularities;
        let first = (!surface.rims().is_empty()).then(|| 120 * set.rest(surface));
        let inner = set.rim_turnings_deg().into_iter().map(i64::from);
        let area = flat.layout.area_mm2();
        let mut distortion = flat.layout.quasi_conformal_error(surface).into_vec();
        distortion.sort_by(f64::total_cmp);
        let quantile = |part: f64| {
            let at = part * distortion.len().saturating_sub(1) as f64;
            distortion.get(at as usize).copied().unwrap_or(1.0)
        };
        let obvious = flat
            .proposed_cone(surface, self.sigma)
            .filter(|_| set.cones.is_empty() && self.is_original(map, scale.max_vertex));
        MapFigures {
            cones: set
                .cones
                .iter()
                .map(|c| ConeFigures {
                    vertex: Some(u64::from(c.vertex.0) + 1).filter(|_| self.by_number()),
                    at_mm: at(c.vertex),
                    units: c.units,
                })
                .collect(),
            rim_turnings_deg: first.into_iter().chain(inner).collect(),
            straight_rims: set.straight_rims(),
            darts_mm: map
                .ground
                .darts
                .iter()
                .map(|d| d.stops.iter().map(|&v| at(v)).collect())
                .collect(),
            remove_at_cone: map.removal,
            sigma: self.sigma,
            suffices: scale.within(self.sigma),
            lambda_min: scale.min,
            lambda_max: scale.max,
            lambda_ratio: scale.ratio(),
            lambda_max_at_mm: at(scale.max_vertex),
            area_inside_sigma: scale.inside,
            misfit_in_l: map.misfit(),
            layout_mm: flat.layout.extent_mm(),
            layout_area_mm2: area,
            edge_mm: flat.edge_mm,
            triangles: area / (0.75f64.sqrt() * 0.5 * flat.edge_mm * flat.edge_mm),
            quasi_conformal_median: quantile(0.5),
            quasi_conformal_99_percent: quantile(0.99),
            broken_faces: flat.metric.broken.len(),
            arguments: self.arguments(map),
            obvious_cone: obvious.map(|c| format!("--cone {}", self.place(surface, c.vertex))),
        }
    }

    /// Whether the surface has the vertices of the file only, so that their numbers mean something to a person.
    fn by_number(&self) -> bool {
        let cones = self.loaded.cone_choices.iter().flatten();
        let darts = self.loaded.dart_choices.iter().flatten();
        cones.into_iter().all(|c| c.at_mm.is_none())
            && darts.into_iter().all(|d| d.points_mm.is_empty())
    }

    /// Whether a vertex of the mapped surface is one of the surface itself, not a second copy along a dart.
    fn is_original(&self, map: &Map, vertex: VertexId) -> bool {
        map.ground.darts.is_empty()
            || (vertex.0 as usize) < self.loaded.import.surface.positions().len()
    }

    /// A place as an argument names it.
    fn place(&self, surface: &Surface, vertex: VertexId) -> String {
        if self.by_number() {
            format!("v{}", u64::from(vertex.0) + 1)
        } else {
            point(surface.position(vertex).into())
        }
    }

    fn arguments(&self, map: &Map) -> Vec<String> {
        let (surface, set) = (&map.ground.surface, &map.flat.singularities);
        let mut words: Vec<String> = Vec::new();
        let mut add = |name: &str, value: String| words.extend([name.to_owned(), value]);
        let units = |units: i32| match units {
            1 => String::new(),
            units => format!(":{units}"),
        };
        match &self.loaded.cone_choices {
            _ if set.cones.is_empty() => add("--cone", "none".into()),
            // As they were asked for.
            Some(choices) => {
                for choice in choices {
                    let place = match (choice.at_mm, choice.vertex) {
                        (Some(at), _) => point(at),
                        (None, vertex) => format!("v{}", vertex.unwrap_or(0)),
                    };
                    add("--cone", place + &units(choice.units));
                }
            }
            None => {
                for cone in &set.cones {
                    let place = self.place(surface, cone.vertex);
                    add("--cone", place + &units(cone.units));
                }
            }
        }
        match &self.loaded.dart_choices {
            Some(choices) => {
                for choice in choices {
                    let by_number = choice.vertices.iter().map(|v| format!("v{v}"));
                    let by_point = choice.points_mm.iter().map(|&p| point(p));
                    let places: Vec<String> = by_number.chain(by_point).collect();
                    add("--dart", places.join(";"));
                }
            }
            None => {
                for dart in &map.ground.darts {
                    let stops = dart.stops.iter().map(|&v| self.place(surface, v));
                    add("--dart", stops.collect::<Vec<_>>().join(";"));
                }
            }
        }
        for degrees in set.rim_turnings_deg() {
            add("--turning", degrees.to_string());
        }
        for rim in set.straight_rims() {
            add("--hem", rim.to_string());
        }
        if map.removal > 0 {
            add("--remove", map.removal.to_string());
        }
        words
    }
}

fn point([x, y, z]: [f64; 3]) -> String {
    format!("{x},{y},{z}")
}

fn internal(error: serde_json::Error) -> MakeError {
    MakeError::Internal(format!("figures: {error}"))
}
