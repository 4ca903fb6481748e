//! The flat layout: the faces unfolded into the plane, with the scale factor λ that takes them back to the surface.
//!
//! Coordinates are millimetres on the closed sheet: X right, Y up, seen from outside. The chart is continuous except
//! across the cut; there a [`Transition`] takes coordinates of one side to those of the other, so that one can walk
//! across the seam: a rotation by a multiple of 120°, exactly, and a translation, the same along a whole [`Segment`] of
//! the cut. With cones the chart's origin is the first of them, without the chart's centre of area.

use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Complex, ComplexField as _, Point2};

use super::cut::{self, Segment};
use super::{CURVATURE_UNIT, Cone, ConformalError, Metric, distance};
use crate::base::ids::{Id as _, Per};
use crate::mesh::{FaceId, HalfedgeId, Surface, VertexId};

/// A rigid motion of the plane: z ↦ `turn` · z + `shift`, with |turn| = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    /// Unit complex number: the rotation.
    pub turn: Complex<f64>,
    /// Translation, millimetres.
    pub shift: Complex<f64>,
}

impl Transition {
    /// The motion that moves nothing.
    pub const IDENTITY: Self = Self {
        turn: Complex::new(1.0, 0.0),
        shift: Complex::new(0.0, 0.0),
    };

    /// Applies the motion to a point.
    #[inline]
    pub fn apply(&self, point: Point2<f64>) -> Point2<f64> {
        let z = self.turn * Complex::new(point.x, point.y) + self.shift;
        Point2::new(z.re, z.im)
    }
    /// `self` first, then `next`.
    #[inline]
    pub fn then(&self, next: &Self) -> Self {
        Self {
            turn: next.turn * self.turn,
            shift: next.turn * self.shift + next.shift,
        }
    }
    /// The motion back.
    #[inline]
    pub fn inverse(&self) -> Self {
        let turn = self.turn.conj();
        Self {
            turn,
            shift: -(turn * self.shift),
        }
    }
}

/// A flat chart of a surface.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Flat corners of every face, millimetres.
    pub corners: Per<FaceId, [Point2<f64>; 3]>,
    /// ln λ per vertex; λ is millimetres on the surface per millimetre on the closed sheet.
    pub log_scale: Per<VertexId, f64>,
    /// What is beside it where one sheet is to take several shapes.
    pub spread: Option<Spread>,
    /// The cones, in the order given.
    pub cones: Vec<Cone>,
    /// Flat distance of every vertex from the nearest cone, millimetres; infinite without cones.
    pub cone_distance_mm: Per<VertexId, f64>,
    /// The cut along which it was unfolded, with the transition across each stretch.
    pub segments: Vec<Segment>,
    /// The transition of every halfedge on the cut: from the chart at its face to that at its twin's.
    pub seam: BTreeMap<HalfedgeId, Transition>,
    /// Largest relative error of a flat edge length against the metric: how well the unfolding closed.
    pub closure: f64,
    /// How far the two sides of the cut are from being each other's image under the transitions, millimetres:
    /// rounding, gathered on the way around cones and handles.
    pub seam_gap_mm: f64,
}

/// How λ differs between several shapes that one sheet is to take: at each vertex the least and the largest ln of the
/// factor by which a shape is larger there than the surface that is mapped.
#[derive(Clone, Debug)]
pub struct Spread(Arc<Per<VertexId, [f64; 2]>>);

impl Spread {
    /// Over shapes, at least one, that are given by their ln factor at each vertex.
    pub fn over(vertices: usize, shapes: &[Per<VertexId, f64>]) -> Self {
        let mut ends =
            Per::<VertexId, [f64; 2]>::filled(vertices, [f64::INFINITY, f64::NEG_INFINITY]);
        for shape in shapes {
            for ([low, high], factor) in ends.iter_mut().zip(shape.iter()) {
                *low = low.min(*factor);
                *high = high.max(*factor);
            }
        }
        Self(Arc::new(ends))
    }
}

/// A rotation across the cut may be this far from a multiple of 120°, radians: far above rounding, far below what a
/// pattern could follow.
const TURN_TOLERANCE: f64 = 1e-6;

/// How much worse it is to ask the sheet to shrink than to stretch too far. Triangles can bridge a dent or a small tip
/// that they cannot follow; where the sheet is too large they run into each other.
pub(super) const BELOW: f64 = 3.0;

/// The range of λ over a layout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleSummary {
    /// Smallest λ outside the cones' neighbourhoods.
    pub min: f64,
    /// Largest λ outside the cones' neighbourhoods.
    pub max: f64,
    /// Where the largest is.
    pub max_vertex: VertexId,
    /// Part of the surface's area with λ in [1, σ] for the σ asked about.
    pub inside: f64,
    /// (∫ e² dA)^½ in millimetres, with e how far ln λ lies outside [0, ln σ]: where a patch of radius R asks for e more
    /// than the sheet has, the sheet misses it by about e · R.
    pub misfit_mm: f64,
}

impl ScaleSummary {
    /// The stretch that the map asks for: largest over smallest λ.
    pub fn ratio(&self) -> f64 {
        self.max / self.min
    }

    /// Whether a sheet that stretches up to `sigma` can follow everywhere, the cones' neighbourhoods left out.
    pub fn within(&self, sigma: f64) -> bool {
        self.max <= self.min * sigma
    }
}

impl Layout {
    /// Unfolds a metric, cut open along `edges` (see [`super::cut_graph`]), which must leave a disk. λ is normalised so
    /// that the metric's own lengths are millimetres; see [`Layout::rescale`].
    ///
    /// # Errors
    /// [`ConformalError::Holonomy`] if the metric turns by something else than a multiple of 120° along a handle.
    pub fn unfold(
        surface: &Surface,
        metric: &Metric,
        cones: &[Cone],
        edges: &[HalfedgeId],
    ) -> Result<Self, ConformalError> {
        let is_cut = cut::on_both_sides(surface, edges);
        let (wedge_of, wedges) = wedges(surface, &is_cut);
        let mut place: Vec<Option<Point2<f64>>> = vec![None; wedges];
        let mut visited = Per::<FaceId, bool>::filled(surface.faces().len(), false);
        // From the middle outwards, so that rounding errors travel the shortest way. Each face carries the direction of
        // its side 0, and a new corner is an old one plus a side: errors add up. Intersecting circles around two old
        // corners instead would multiply them from face to face: 10⁻¹⁰ on 10⁴ faces, nonsense on 10⁵.
        let root = central_face(surface);
        let root_lengths = metric.lengths(surface, root);
        let w = wedge_of[root];
        place[w[0]] = Some(Point2::origin());
        place[w[1]] = Some(Point2::new(root_lengths[0], 0.0));
        let mut queue = VecDeque::from([(HalfedgeId::side(root, 0), 0.0)]);
        visited[root] = true;
        while let Some((h, along)) = queue.pop_front() {
            let (face, k) = (h.face(), h.corner());
            let w = wedge_of[face];
            let lengths = metric.lengths(surface, face);
            let turns = metric.turns(surface, face, k);
            let mut direction = [0.0; 3];
            direction[k] = along;
            direction[(k + 1) % 3] = along + turns[0];
            direction[(k + 2) % 3] = direction[(k + 1) % 3] + turns[1];
            if let (Some(b), None) = (place[w[(k + 1) % 3]], place[w[(k + 2) % 3]]) {
                let (sin, cos) = direction[(k + 1) % 3].sin_cos();
                place[w[(k + 2) % 3]] =
                    Some(b + nalgebra::Vector2::new(cos, sin) * lengths[(k + 1) % 3]);
            }
            for side in 0..3 {
                let across = HalfedgeId::side(face, side);
                if let Some(twin) = surface.twin(across)
                    && !is_cut[across]
                    && !visited[twin.face()]
                {
                    visited[twin.face()] = true;
                    // Kept small: a large angle has fewer digits left.
                    queue.push_back((twin, (direction[side] + PI).rem_euclid(2.0 * PI)));
                }
            }
        }
        let corners: Per<FaceId, [Point2<f64>; 3]> = wedge_of
            .iter()
            .map(|w| w.map(|w| place[w].unwrap_or_else(Point2::origin)))
            .collect();
        let mut layout = Self {
            corners,
            log_scale: metric.u.iter().map(|u| -u).collect(),
            spread: None,
            cones: cones.to_vec(),
            cone_distance_mm: distance::from_cones(surface, metric, cones),
            segments: cut::segments(surface, cones, edges),
            seam: BTreeMap::new(),
            closure: 0.0,
            seam_gap_mm: 0.0,
        };
        layout.closure = layout.closure_error(surface, metric);
        let centre = match cones.first() {
            Some(cone) => layout.vertex_position(surface, cone.vertex),
            None => layout.centre_of_area(),
        };
        let upright = layout.upright_turn(surface);
        let shift = -(upright * Complex::new(centre.x, centre.y));
        layout.moved(&Transition {
            turn: upright,
            shift,
        });
        layout.measure_seam(surface)?;
        Ok(layout)
    }

    /// Enlarges the chart by `factor`: flat lengths grow, λ shrinks.
    pub fn rescale(&mut self, factor: f64) {
        self.corners
            .iter_mut()
            .flatten()
            .for_each(|p| p.coords *= factor);
        self.cone_distance_mm.iter_mut().for_each(|d| *d *= factor);
        self.segments
            .iter_mut()
            .for_each(|s| s.transition.shift *= factor);
        self.seam.values_mut().for_each(|t| t.shift *= factor);
        self.log_scale.iter_mut().for_each(|x| *x -= factor.ln());
        self.seam_gap_mm *= factor;
    }

    /// Flat area in mm².
    pub fn area_mm2(&self) -> f64 {
        self.corners.iter().map(doubled_area).sum::<f64>() * 0.5
    }

    /// Width and height of the box around the chart, millimetres.
    pub fn extent_mm(&self) -> [f64; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in self.corners.iter().flatten() {
            for k in 0..2 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        [high[0] - low[0], high[1] - low[1]]
    }

    /// λ at a point of a face, given by its barycentric coordinates: ln λ is interpolated linearly.
    #[inline]
    pub fn scale_at(&self, surface: &Surface, face: FaceId, barycentric: [f64; 3]) -> f64 {
        let v = surface.faces()[face];
        (0..3)
            .map(|k| barycentric[k] * self.log_scale[v[k]])
            .sum::<f64>()
            .exp()
    }

    /// The least and the largest ln λ at a vertex, over all shapes that the sheet is to take.
    #[inline]
    pub fn range(&self, vertex: VertexId) -> [f64; 2] {
        let own = self.log_scale[vertex];
        match &self.spread {
            Some(spread) => spread.0[vertex].map(|more| own + more),
            None => [own; 2],
        }
    }

    /// The same in the middle of a face, of which these are the corners.
    #[inline]
    pub fn face_range(&self, corners: &[VertexId; 3]) -> [f64; 2] {
        let ends = corners.map(|v| self.range(v));
        [0, 1].map(|end| ends.iter().map(|e| e[end]).sum::<f64>() / 3.0)
    }

    /// λ's range over the vertices farther than `exclude_mm` (on the flat sheet) from every cone, and the part of the
    /// surface's area, the cones' neighbourhoods left out, where λ lies in [1, `sigma`].
    pub fn scale_summary(&self, surface: &Surface, exclude_mm: f64, sigma: f64) -> ScaleSummary {
        let mut summary = ScaleSummary {
            min: f64::INFINITY,
            max: 0.0,
            max_vertex: VertexId(0),
            inside: 0.0,
            misfit_mm: 0.0,
        };
        let mut total = 0.0;
        for (face, v) in self.far_from_cones(surface, exclude_mm) {
            for &v in v.iter().filter(|v| self.cone_distance_mm[**v] > exclude_mm) {
                let [least, scale] = self.range(v).map(f64::exp);
                summary.min = summary.min.min(least);
                if scale > summary.max || (scale == summary.max && v < summary.max_vertex) {
                    (summary.max, summary.max_vertex) = (scale, v);
                }
            }
            let (area, ends) = (surface.face_area(face), self.face_range(v).map(f64::exp));
            total += area;
            summary.misfit_mm += area * excess(ends, sigma).powi(2);
            if ends[0] >= 1.0 - 1e-9 && ends[1] <= sigma + 1e-9 {
                summary.inside += area;
            }
        }
        summary.inside /= f64::max(total, f64::MIN_POSITIVE);
        summary.misfit_mm = summary.misfit_mm.sqrt();
        summary
    }

    /// The faces with a corner farther than `exclude_mm` (on the flat sheet) from every cone.
    fn far_from_cones<'s>(
        &'s self,
        surface: &'s Surface,
        exclude_mm: f64,
    ) -> impl Iterator<Item = (FaceId, &'s [VertexId; 3])> {
        let far = move |v: &VertexId| self.cone_distance_mm[*v] > exclude_mm;
        surface
            .faces()
            .iter_ids()
            .filter(move |(_, v)| v.iter().any(far))
    }

    /// The smallest λ of the window [λ, σ λ] outside which the surface has the least misfit, the cones' neighbourhoods
    /// left out.
    pub fn best_window(&self, surface: &Surface, exclude_mm: f64, sigma: f64) -> f64 {
        let parts: Vec<([f64; 2], f64)> = self
            .far_from_cones(surface, exclude_mm)
            .map(|(face, v)| (self.face_range(v), surface.face_area(face)))
            .collect();
        let width = sigma.ln();
        // Half the derivative of ∫ e² dA by the window's lower end; it grows, so its zero is found by halving.
        let slope = |low: f64| -> f64 {
            let each = |&([least, most], area): &([f64; 2], f64)| {
                let (below, above) = ((low - least).max(0.0), (most - low - width).max(0.0));
                area * (BELOW * BELOW * below - above)
            };
            parts.iter().map(each).sum()
        };
        let mut low = parts.iter().map(|p| p.0[0]).fold(f64::INFINITY, f64::min) - width;
        let mut high = (parts.iter().map(|p| p.0[1])).fold(f64::NEG_INFINITY, f64::max);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if slope(middle) > 0.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        (0.5 * (low + high)).exp()
    }

    /// Angle distortion per face: the ratio of the singular values of the flat → surface map, 1 if conformal.
    pub fn quasi_conformal_error(&self, surface: &Surface) -> Per<FaceId, f64> {
        self.corners
            .iter_ids()
            .map(|(face, flat)| {
                let p = surface.corners(face);
                let (e1, e2) = (flat[1] - flat[0], flat[2] - flat[0]);
                let det = e1.perp(&e2);
                if det.abs() < f64::MIN_POSITIVE {
                    return f64::INFINITY;
                }
                let (f1, f2) = (p[1] - p[0], p[2] - p[0]);
                let (dx, dy) = ((f1 * e2.y - f2 * e1.y) / det, (f2 * e1.x - f1 * e2.x) / det);
                let (a, b, c) = (dx.norm_squared(), dx.dot(&dy), dy.norm_squared());
                let half_gap = (0.25 * (a - c) * (a - c) + b * b).sqrt();
                let mean = 0.5 * (a + c);
                ((mean + half_gap) / (mean - half_gap).max(f64::MIN_POSITIVE)).sqrt()
            })
            .collect()
    }

    /// Applies a rigid motion of the sheet.
    pub fn moved(&mut self, motion: &Transition) {
        self.corners
            .iter_mut()
            .flatten()
            .for_each(|p| *p = motion.apply(*p));
        let back = motion.inverse();
        let segments = self.segments.iter_mut().map(|s| &mut s.transition);
        for transition in segments.chain(self.seam.values_mut()) {
            *transition = back.then(transition).then(motion);
        }
    }

    /// Puts other corners and transitions (one a segment, in their order) in place of the chart's own.
    pub fn set_chart(
        &mut self,
        surface: &Surface,
        corners: Per<FaceId, [Point2<f64>; 3]>,
        transitions: &[Transition],
    ) {
        self.corners = corners;
        for (segment, transition) in self.segments.iter_mut().zip(transitions) {
            segment.transition = *transition;
        }
        self.spread_transitions(surface);
    }

    /// Direction of a rim in the chart, radians, modulo 60°: that of its edges in the mean, which for a straight hem is
    /// that of all. Modulo 60° it is the same on both sides of the cut, and all that a lattice needs.
    pub fn rim_direction(&self, surface: &Surface, rim: &[VertexId]) -> f64 {
        let sixfold: Complex<f64> = rim
            .iter()
            .filter_map(|&v| surface.around(v).next())
            .map(|h| {
                let flat = &self.corners[h.face()];
                let edge = flat[(h.corner() + 1) % 3] - flat[h.corner()];
                let edge = Complex::new(edge.x, edge.y);
                let length = edge.modulus().max(f64::MIN_POSITIVE);
                (edge / length).powi(6) * length
            })
            .sum();
        sixfold.argument() / 6.0
    }

    fn vertex_position(&self, surface: &Surface, vertex: VertexId) -> Point2<f64> {
        surface
            .around(vertex)
            .next()
            .map_or_else(Point2::origin, |h| self.corners[h.face()][h.corner()])
    }

    fn centre_of_area(&self) -> Point2<f64> {
        let (mut sum, mut total) = (Point2::origin(), 0.0);
        for flat in self.corners.iter() {
            let area = doubled_area(flat);
            let centre = (flat[0].coords + flat[1].coords + flat[2].coords) / 3.0;
            sum += centre * area;
            total += area;
        }
        Point2::from(sum.coords / total)
    }

    /// The rotation that makes the sheet look like the surface seen along its mean normal, +Y up (+Z where the surface
    /// faces up or down): a mask lies upright on the sheet.
    fn upright_turn(&self, surface: &Surface) -> Complex<f64> {
        let (normal, up) = surface.front();
        let right = up.cross(&normal).normalize();
        let up = normal.cross(&right);
        let mut fit = Complex::new(0.0, 0.0);
        for (face, flat) in self.corners.iter_ids() {
            let p = surface.corners(face);
            for k in 0..3 {
                let (edge, target) = (flat[(k + 1) % 3] - flat[k], p[(k + 1) % 3] - p[k]);
                fit += Complex::new(edge.x, edge.y).conj()
                    * Complex::new(target.dot(&right), target.dot(&up));
            }
        }
        if fit.modulus() > 0.0 {
            fit / fit.modulus()
        } else {
            Complex::new(1.0, 0.0)
        }
    }

    fn closure_error(&self, surface: &Surface, metric: &Metric) -> f64 {
        let mut worst = 0.0f64;
        for (face, flat) in self.corners.iter_ids() {
            let lengths = metric.lengths(surface, face);
            for k in 0..3 {
                worst = worst.max(((flat[(k + 1) % 3] - flat[k]).norm() / lengths[k] - 1.0).abs());
            }
        }
        worst
    }

    /// Measures the transition across each segment and snaps its rotation to the multiple of 120° that it must be.
    fn measure_seam(&mut self, surface: &Surface) -> Result<(), ConformalError> {
        let complex = |p: Point2<f64>| Complex::new(p.x, p.y);
        // A typical edge.
        let unit = (self.area_mm2().abs() / self.corners.len() as f64).sqrt();
        for i in 0..self.segments.len() {
            let sides = || {
                let halfedges = self.segments[i].halfedges.iter();
                halfedges.filter_map(|&h| self.both_sides(surface, h))
            };
            let turned: Complex<f64> = sides()
                .map(|[(a, b), (ta, tb)]| complex(tb - ta.coords) * complex(b - a.coords).conj())
                .sum();
            let thirds = turned.argument() / CURVATURE_UNIT;
            let off = (thirds - thirds.round()).abs() * CURVATURE_UNIT;
            // A cut through tiny edges alone says little about angles: there the shift that the error makes must not show.
            let tiny = off < 0.01 && off * turned.modulus().sqrt() < TURN_TOLERANCE * unit;
            if off > TURN_TOLERANCE && !tiny {
                return Err(ConformalError::Holonomy {
                    turn_deg: turned.argument().to_degrees(),
                });
            }
            let turn = Complex::from_polar(1.0, thirds.round() * CURVATURE_UNIT);
            let shifts: Vec<Complex<f64>> = sides()
                .flat_map(|[(a, b), (ta, tb)]| [(a, ta), (b, tb)])
                .map(|(here, there)| complex(there) - turn * complex(here))
                .collect();
            let shift = shifts.iter().sum::<Complex<f64>>() / f64::max(shifts.len() as f64, 1.0);
            self.segments[i].transition = Transition { turn, shift };
        }
        self.spread_transitions(surface);
        Ok(())
    }

    /// The ends of a halfedge as its own face has them, and as its twin's face has the same two.
    fn both_sides(
        &self,
        surface: &Surface,
        h: HalfedgeId,
    ) -> Option<[(Point2<f64>, Point2<f64>); 2]> {
        let ends = |h: HalfedgeId| {
            let c = &self.corners[h.face()];
            (c[h.corner()], c[(h.corner() + 1) % 3])
        };
        let (b, a) = ends(surface.twin(h)?);
        Some([ends(h), (a, b)])
    }

    /// Gives every halfedge on the cut the transition of its segment, and measures the gap that is left.
    fn spread_transitions(&mut self, surface: &Surface) {
        self.seam_gap_mm = 0.0;
        self.seam.clear();
        for segment in &self.segments {
            for &h in &segment.halfedges {
                let (Some(twin), Some([(a, b), (ta, tb)])) =
                    (surface.twin(h), self.both_sides(surface, h))
                else {
                    continue;
                };
                let over = segment.transition;
                let gap = (over.apply(a) - ta).norm().max((over.apply(b) - tb).norm());
                self.seam_gap_mm = self.seam_gap_mm.max(gap);
                self.seam.insert(h, over);
                self.seam.insert(twin, over.inverse());
            }
        }
    }
}

/// How far ln λ, from its least to its largest value, reaches outside [0, ln σ], what is below counted [`BELOW`] times.
pub(super) fn excess([least, most]: [f64; 2], sigma: f64) -> f64 {
    (most / sigma).ln().max(-BELOW * least.ln()).max(0.0)
}

#[inline]
fn doubled_area(flat: &[Point2<f64>; 3]) -> f64 {
    (flat[1] - flat[0]).perp(&(flat[2] - flat[0]))
}

/// For every corner of every face the number of its copy in the cut-open surface, and how many there are.
fn wedges(surface: &Surface, is_cut: &Per<HalfedgeId, bool>) -> (Per<FaceId, [usize; 3]>, usize) {
    let mut wedge_of = Per::filled(surface.faces().len(), [usize::MAX; 3]);
    let mut count = 0;
    for vertex in surface.positions().ids() {
        let fan: Vec<HalfedgeId> = surface.around(vertex).collect();
        // Begin behind a cut edge if there is one, so that no wedge is split by the start of the turn.
        let start = fan
            .iter()
            .position(|h| is_cut[*h])
            .filter(|_| !surface.on_rim(vertex))
            .unwrap_or(0);
        for i in 0..fan.len() {
            let h = fan[(start + i) % fan.len()];
            if i == 0 || is_cut[h] {
                count += 1;
            }
            wedge_of[h.face()][h.corner()] = count - 1;
        }
    }
    (wedge_of, count)
}

/// A face as far from the rim as faces go (in steps across edges).
fn central_face(surface: &Surface) -> FaceId {
    let mut seen = Per::<FaceId, bool>::filled(surface.faces().len(), false);
    let mut queue = VecDeque::new();
    for h in surface.halfedges() {
        if surface.twin(h).is_none() && !seen[h.face()] {
            seen[h.face()] = true;
            queue.push_back(h.face());
        }
    }
    let mut last = FaceId::from_index(0);
    while let Some(face) = queue.pop_front() {
        last = face;
        for k in 0..3 {
            if let Some(twin) = surface.twin(HalfedgeId::side(face, k))
                && !seen[twin.face()]
            {
                seen[twin.face()] = true;
                queue.push_back(twin.face());
            }
        }
    }
    last
}
