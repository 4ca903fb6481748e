//! Darts: open cuts, where no set of cones keeps λ inside [1, σ].
//!
//! A tailor's dart takes up what a cloth cannot stretch. Here the surface is slit along a path of mesh edges before it
//! is mapped. The two sides of the slit belong to a rim then, along which u is constant, so any curvature may gather
//! there and λ near it is that of the rim; the pattern does not go on across (paper, Fig. 13: the cut behind the ear).
//! A slit around a handle opens the handle.
//!
//! [`patches`] says where a map asks for what the sheet does not have, the worst first; [`to_goals`] leads a dart from
//! there to a rim or an earlier dart, [`around_handles`] finds the loops that open all handles.

use super::cut::{loops, on_both_sides};
use super::paths::ShortestPaths;
use super::{ConformalError, Layout};
use crate::base::ids::{Id as _, Per};
use crate::base::union::Union;
use crate::mesh::{HalfedgeId, Surface, VertexId, slit};

/// An open cut: vertices of the surface, joined by shortest ways along its edges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dart {
    /// Where it passes, in order; at least two.
    pub stops: Vec<VertexId>,
}

impl Dart {
    /// The edges of the dart, one halfedge each, in its direction.
    ///
    /// # Errors
    /// [`ConformalError::NoSuchVertex`], or [`ConformalError::DartTooShort`] if it has no edge.
    pub fn edges(&self, surface: &Surface) -> Result<Vec<HalfedgeId>, ConformalError> {
        let count = surface.positions().len();
        if let Some(stop) = self.stops.iter().find(|v| v.index() >= count) {
            return Err(ConformalError::NoSuchVertex {
                vertex: u64::from(stop.0) + 1,
                count,
            });
        }
        let mut edges = Vec::new();
        for pair in self.stops.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            let mut paths = ShortestPaths::new(surface);
            paths.extend(&[from], |v| v == to);
            let mut part: Vec<HalfedgeId> = paths.back(to).collect();
            part.reverse();
            edges.extend(part);
        }
        if edges.is_empty() {
            return Err(ConformalError::DartTooShort);
        }
        Ok(edges)
    }
}

/// The surface slit along all darts. Faces, and one copy of each vertex, keep their ids.
///
/// # Errors
/// [`Dart::edges`], or the surface would fall apart.
pub fn slit_along(surface: &Surface, darts: &[Dart]) -> Result<Surface, ConformalError> {
    let mut edges = Vec::new();
    for dart in darts {
        edges.extend(dart.edges(surface)?);
    }
    slit(surface, &edges).map_err(ConformalError::Dart)
}

/// A part of a surface where λ leaves [1, σ].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Where it leaves farthest, off the rims if any vertex is.
    pub peak: VertexId,
    /// λ there.
    pub scale: f64,
    /// (∫ e² dA)^½ in millimetres; see [`super::ScaleSummary::misfit_mm`].
    pub misfit_mm: f64,
}

/// The patches in which λ leaves [1, `sigma`], the neighbourhoods of cones (`exclude_mm` on the sheet) left out, the one
/// of largest misfit first.
pub fn patches(surface: &Surface, layout: &Layout, exclude_mm: f64, sigma: f64) -> Vec<Patch> {
    let off = |face| {
        let v: [VertexId; 3] = surface.faces()[face];
        if v.iter().all(|v| layout.cone_distance_mm[*v] <= exclude_mm) {
            return 0.0;
        }
        super::layout::excess(layout.face_range(&v).map(f64::exp), sigma)
    };
    let excess: Per<_, f64> = surface.faces().ids().map(off).collect();
    let mut joined = Union::new(surface.faces().len());
    for h in surface.edges() {
        if let Some(twin) = surface.twin(h)
            && excess[h.face()] > 0.0
            && excess[twin.face()] > 0.0
        {
            joined.join(h.face().index(), twin.face().index());
        }
    }
    // By root: the sum, and the peak as (off the rims, excess, vertex).
    let mut found: std::collections::BTreeMap<usize, (f64, (bool, f64, VertexId))> =
        std::collections::BTreeMap::new();
    for (face, v) in surface.faces().iter_ids() {
        if excess[face] <= 0.0 {
            continue;
        }
        let entry = found
            .entry(joined.root(face.index()))
            .or_insert((0.0, (false, 0.0, v[0])));
        entry.0 += surface.face_area(face) * excess[face] * excess[face];
        for &v in v {
            let rank = (!surface.on_rim(v), excess[face]);
            if (rank.0, rank.1) > (entry.1.0, entry.1.1) {
                entry.1 = (rank.0, rank.1, v);
            }
        }
    }
    let mut patches: Vec<Patch> = found
        .into_values()
        .map(|(sum, (_, _, peak))| Patch {
            peak,
            scale: layout.range(peak)[1].exp(),
            misfit_mm: sum.sqrt(),
        })
        .collect();
    patches.sort_by(|a, b| {
        b.misfit_mm
            .total_cmp(&a.misfit_mm)
            .then(a.peak.cmp(&b.peak))
    });
    patches
}

/// A dart from a vertex the shortest way to a rim, an earlier dart, or one of the `goals`; none if there is none.
pub fn to_goals(
    surface: &Surface,
    darts: &[Dart],
    from: VertexId,
    goals: &[VertexId],
) -> Result<Option<Dart>, ConformalError> {
    let mut goal = Per::<VertexId, bool>::filled(surface.positions().len(), false);
    surface
        .rims()
        .iter()
        .flatten()
        .chain(goals)
        .for_each(|&v| goal[v] = true);
    for dart in darts {
        for h in dart.edges(surface)? {
            goal[surface.tail(h)] = true;
            goal[surface.head(h)] = true;
        }
    }
    if goal[from] {
        return Ok(None);
    }
    let met = ShortestPaths::new(surface).extend(&[from], |v| goal[v]);
    Ok(met.map(|to| Dart {
        stops: vec![from, to],
    }))
}

/// Vertices from which a loop around a handle is looked for. Of all loops the shortest passes near some of them.
const ROOTS: usize = 48;

/// Loops that open all handles: one for each, around it the short way. The surface keeps its rims, gains two for each
/// loop, and has genus 0.
///
/// # Errors
/// [`ConformalError::Dart`] if no loop opens a handle that is left.
pub fn around_handles(surface: &Surface) -> Result<Vec<Dart>, ConformalError> {
    let mut darts: Vec<Dart> = Vec::new();
    let mut open = surface.clone();
    while open.genus() > 0 {
        // Copies of vertices along earlier loops go by the names of the originals.
        let mut original = Per::<VertexId, VertexId>::filled(open.positions().len(), VertexId(0));
        for (face, v) in open.faces().iter_ids() {
            (0..3).for_each(|k| original[v[k]] = surface.faces()[face][k]);
        }
        let step = (open.positions().len() / ROOTS).max(1);
        let mut candidates: Vec<(f64, Vec<VertexId>)> = open
            .positions()
            .ids()
            .step_by(step)
            .flat_map(|root| loops_from(&open, root))
            .collect();
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut last = ConformalError::DartTooShort;
        let mut found = false;
        for (_, stops) in candidates {
            let stops = stops.into_iter().map(|v| original[v]).collect();
            darts.push(Dart { stops });
            match slit_along(surface, &darts) {
                Ok(slit) if slit.genus() < open.genus() => {
                    open = slit;
                    found = true;
                    break;
                }
                Ok(_) => {}
                Err(error) => last = error,
            }
            darts.pop();
        }
        if !found {
            return Err(last);
        }
    }
    Ok(darts)
}

/// The generating loops from a root, each with its length and without the stem that its two ways share.
fn loops_from(surface: &Surface, root: VertexId) -> Vec<(f64, Vec<VertexId>)> {
    let mut paths = ShortestPaths::new(surface);
    paths.extend(&[root], |_| false);
    let none = on_both_sides(surface, &[]);
    loops(surface, &paths, &none)
        .into_iter()
        .map(|h| {
            // Out from the root to the edge, across it, and back.
            let way = |v: VertexId| {
                let mut way: Vec<VertexId> = vec![v];
                way.extend(paths.back(v).map(|h| surface.tail(h)));
                way.reverse();
                way
            };
            let (mut out, mut back) = (way(surface.tail(h)), way(surface.head(h)));
            let stem = out.iter().zip(&back).take_while(|(a, b)| a == b).count();
            let branch = out[stem.saturating_sub(1)];
            out.drain(..stem);
            back.drain(..stem);
            let mut stops = vec![branch];
            stops.extend(out);
            stops.extend(back.into_iter().rev());
            stops.push(branch);
            let gap = |p: &[VertexId]| (surface.position(p[1]) - surface.position(p[0])).norm();
            (stops.windows(2).map(gap).sum(), stops)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Sample;

    #[test]
    fn one_loop_opens_a_torus_to_a_tube() {
        let torus = Sample::parse("torus:faces=900")
            .unwrap()
            .generate()
            .unwrap();
        let darts = around_handles(&torus).unwrap();
        assert_eq!(darts.len(), 1);
        let tube = slit_along(&torus, &darts).unwrap();
        assert_eq!(
            (tube.genus(), tube.rims().len(), tube.euler_characteristic()),
            (0, 2, 0)
        );
        assert_eq!(tube.rims()[0].len(), tube.rims()[1].len());
    }

    #[test]
    fn two_short_loops_open_a_double_torus() {
        let sample = Sample::parse("double_torus:faces=2000").and_then(|s| s.generate());
        let surface = sample.unwrap();
        let darts = around_handles(&surface).unwrap();
        let open = slit_along(&surface, &darts).unwrap();
        assert_eq!((darts.len(), open.genus(), open.rims().len()), (2, 0, 4));
    }

    #[test]
    fn a_dart_runs_to_the_nearest_rim_or_dart_and_is_found_again_by_its_ends() {
        let cap = Sample::parse("cap:faces=900").unwrap().generate().unwrap();
        let top = cap
            .positions()
            .iter_ids()
            .max_by(|a, b| a.1.z.total_cmp(&b.1.z))
            .unwrap()
            .0;
        let dart = to_goals(&cap, &[], top, &[]).unwrap().unwrap();
        let edges = dart.edges(&cap).unwrap();
        let rims = edges.iter().filter(|h| cap.on_rim(cap.head(**h))).count();
        assert!(cap.on_rim(dart.stops[1]) && rims == 1);
        assert_eq!(
            to_goals(&cap, std::slice::from_ref(&dart), top, &[]).unwrap(),
            None
        );
        let open = slit_along(&cap, &[dart]).unwrap();
        assert_eq!((open.rims().len(), open.euler_characteristic()), (1, 1));
    }
}
