//! Continuity: the lattice must go on across every seam, so every transition has to map it onto itself.
//!
//! Rotations are multiples of 120° already. Translations are whole lattice vectors if the cones lie on lattice vertices
//! and the loops around rims and handles are whole; [`fit`] makes them so. The cut graph is a graph of segments; a
//! spanning tree of it leaves as free values one position for each cone, one translation for each rim and one for each
//! segment outside the tree. All other transitions follow, because going once around a vertex must turn about it.
//!
//! To round the free values the chart is warped. The displacement of least ∫ |∂̄d|² + 10⁻³ |∂d|² depends linearly (over
//! ℂ) on the change of the free values, so one solve for each gives the price of any rounding as a small Hermitian
//! form. That makes it cheap to try many lattices: edge length and orientation are chosen first so that little is left
//! to round, and only the rest is warped.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::{Complex, ComplexField as _, DMatrix, Point2};

use super::LinkageError;
use super::lattice::Lattice;
use super::orientation;
use crate::base::ids::Per;
use crate::base::progress::Progress;
use crate::base::sparse::{Cholesky, Pattern};
use crate::conformal::{Layout, Transition};
use crate::mesh::{FaceId, HalfedgeId, Surface, VertexId};

type C = Complex<f64>;

/// Part of L by which a lattice may be larger or smaller than asked, where its size is left open.
const SIZE_ROOM: f64 = 0.04;

/// Weight of stretching against shearing in a warp: enough to keep it unique and smooth, little enough that the chart
/// rather swells a little than loses its angles.
const STRETCH_WEIGHT: f64 = 1e-3;

/// Lattices whose warp costs no more than this times the least, and no more than [`EQUAL_DISTORTION`] anyway, are equal
/// as far as the seams go; then the one that covers most of the sheet is taken. 10⁻³ is far below the angles that a
/// layout is off by itself.
const EQUAL_PRICE: f64 = 1.1;
/// See [`EQUAL_PRICE`]; root mean square, as [`Fitted::distortion`].
const EQUAL_DISTORTION: f64 = 1e-3;
/// Lattices compared at most: each is laid for it.
const COMPARED: usize = 6;
/// A part of the sheet too small to leave the order of the candidates for.
const EQUAL_COVER: f64 = 1e-3;

/// A lattice that goes on across the seams of a layout.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The layout, warped so that every transition maps the lattice onto itself.
    pub layout: Layout,
    /// Triangle edge L, millimetres.
    pub edge_mm: f64,
    /// Direction of the lattice against the layout's X, degrees.
    pub orientation_deg: f64,
    /// Root mean square over the sheet of (|∂̄d|² + 10⁻³ |∂d|²)^½ for the displacement d that warping added: in the main
    /// the distortion of angles; 0 if nothing was warped.
    pub distortion: f64,
}

/// Fits a lattice of about `edge_mm`, exactly that if `exact`, and of the given orientation. Where that is `None`, the
/// seams decide, and what they leave open is taken so that rims cost fewest triangles, or a straight hem or the mirror
/// axis of the outline is followed if that costs next to none.
///
/// # Errors
/// [`LinkageError::NoLattice`] if every rounding would fold the chart over; interruption, memory.
pub fn fit(
    surface: &Surface,
    layout: &Layout,
    edge_mm: f64,
    exact: bool,
    orientation_deg: Option<f64>,
    progress: &dyn Progress,
) -> Result<Fitted, LinkageError> {
    let mut layout = layout.clone();
    let frame = Frame::new(surface, &mut layout);
    if frame.values.iter().all(|x| x.modulus() == 0.0) {
        let corners = layout.corners.clone();
        let exact = frame.transitions(surface, &frame.values);
        layout.set_chart(surface, corners, &exact);
        let orientation_deg = match orientation_deg {
            Some(given) => given,
            None => orientation::search(surface, &layout, edge_mm, progress)?,
        };
        return Ok(Fitted {
            layout,
            edge_mm,
            orientation_deg,
            distortion: 0.0,
        });
    }
    progress.check()?;
    let warp = Warp::new(surface, &layout, &frame)?;
    progress.check()?;
    let area = layout.area_mm2();
    let many = area > super::MOST_TRIANGLES as f64 * edge_mm * edge_mm;
    let choose = orientation_deg.is_none() && !surface.rims().is_empty() && !many;
    let rounding = Rounding {
        values: &frame.values,
        root_place: &frame.root_place,
        price: &warp.price,
    };
    let found = candidates(&rounding, edge_mm, exact, orientation_deg);
    let least = found.first().map_or(0.0, |c| c.price);
    // The part of the sheet that it covers, and the lattice that does so best.
    let mut best: Option<(f64, Fitted)> = None;
    let mut tried: Vec<Candidate> = Vec::new();
    for candidate in found {
        let (edge_mm, orientation_deg) = (candidate.edge_mm, candidate.orientation_deg);
        let as_good = candidate.price <= EQUAL_PRICE * least + EQUAL_DISTORTION.powi(2) * area;
        if best.is_some() && (tried.len() >= COMPARED || !as_good) {
            break;
        }
        if tried.iter().any(|c| c.same_lattice(&candidate)) {
            continue;
        }
        tried.push(candidate);
        progress.check()?;
        let lattice = Lattice::new(edge_mm, orientation_deg.to_radians());
        let unit = C::from_polar(edge_mm, orientation_deg.to_radians());
        let rounded: Vec<C> = rounding
            .whole(unit)
            .iter()
            .map(|n| lattice.nearest(n * unit))
            .collect();
        let Some(warped) = warp.apply(surface, &layout, &frame, &rounded, &lattice) else {
            continue;
        };
        let fitted = Fitted {
            layout: warped,
            edge_mm,
            orientation_deg,
            distortion: (candidate.price / area).sqrt(),
        };
        if !choose {
            return Ok(fitted);
        }
        let kept = orientation::kept(surface, &fitted.layout, &lattice, edge_mm, progress)?;
        let covered = kept as f64 * edge_mm * edge_mm / area;
        if best.as_ref().is_none_or(|b| covered > b.0 + EQUAL_COVER) {
            best = Some((covered, fitted));
        }
    }
    if let Some((_, fitted)) = best {
        return Ok(fitted);
    }
    Err(LinkageError::NoLattice { edge_mm })
}

/// An end of the cut graph's segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Node {
    /// A whole rim.
    Rim(usize),
    /// A cone or a branch.
    Vertex(VertexId),
}

/// What a node's free value fixes.
#[derive(Clone, Copy, Debug)]
enum Rule {
    /// The segment's own translation is free value `value`.
    Free { segment: usize, value: usize },
    /// The segment towards the root follows from the others around the vertex, a cone or a branch.
    Around { segment: usize, vertex: VertexId },
}

/// Where a cone sits.
#[derive(Clone, Copy, Debug)]
struct Seat {
    /// The halfedge that leaves it, in the chart of whose face its position is measured.
    at: HalfedgeId,
    /// The free value that is its position; the root's position is fixed.
    value: Option<usize>,
}

impl Seat {
    fn position(&self, layout: &Layout) -> C {
        let p = layout.corners[self.at.face()][self.at.corner()];
        C::new(p.x, p.y)
    }
}

/// The free values of a cut chart, and how the transitions follow from them.
struct Frame {
    /// In the order in which they can be applied.
    rules: Vec<Rule>,
    /// Measured free values, millimetres.
    values: Vec<C>,
    /// Where the cut graph has a halfedge: its segment, and whether it runs with it.
    segment_of: BTreeMap<HalfedgeId, (usize, bool)>,
    /// The measured rotations of the segments.
    turns: Vec<C>,
    /// The cones.
    seats: BTreeMap<VertexId, Seat>,
    /// On a closed surface the place of the root's cone follows from the free values too: what is turned by all other
    /// cones and handles together turns about it. How far each value moves it; empty where there is no such cone.
    root_place: Vec<C>,
}

impl Frame {
    /// Finds the free values and moves the chart so that one of them is 0: the first cone, or the centre of a rotation
    /// around a rim.
    fn new(surface: &Surface, layout: &mut Layout) -> Self {
        let mut rim_of = BTreeMap::new();
        for (r, rim) in surface.rims().iter().enumerate() {
            rim_of.extend(rim.iter().map(|&v| (v, r)));
        }
        let node = |v: VertexId| rim_of.get(&v).map_or(Node::Vertex(v), |&r| Node::Rim(r));
        let mut segment_of = BTreeMap::new();
        let mut ends: Vec<[(Node, HalfedgeId); 2]> = Vec::new();
        for (s, segment) in layout.segments.iter().enumerate() {
            for &h in &segment.halfedges {
                segment_of.insert(h, (s, true));
                if let Some(twin) = surface.twin(h) {
                    segment_of.insert(twin, (s, false));
                }
            }
            let first = segment.halfedges[0];
            let last = segment.halfedges[segment.halfedges.len() - 1];
            let back = surface.twin(last).unwrap_or(last);
            ends.push([
                (node(surface.tail(first)), first),
                (node(surface.head(last)), back),
            ]);
        }
        let root = if surface.rims().is_empty() {
            layout.cones.first().map(|c| Node::Vertex(c.vertex))
        } else {
            Some(Node::Rim(0))
        }
        .or_else(|| ends.first().map(|e| e[0].0));

        // A spanning tree from the root; the way towards it is a node's own segment.
        let mut parent: Vec<(Node, usize, HalfedgeId)> = Vec::new();
        let mut reached: Vec<Node> = root.into_iter().collect();
        let mut in_tree = vec![false; ends.len()];
        let mut next = 0;
        while next < reached.len() {
            let here = reached[next];
            next += 1;
            for (s, [a, b]) in ends.iter().enumerate() {
                for (from, to) in [(a, b), (b, a)] {
                    if from.0 == here && !reached.contains(&to.0) {
                        reached.push(to.0);
                        parent.push((to.0, s, to.1));
                        in_tree[s] = true;
                    }
                }
            }
        }
        let mut frame = Self {
            rules: Vec::new(),
            values: Vec::new(),
            segment_of,
            turns: layout.segments.iter().map(|s| s.transition.turn).collect(),
            seats: BTreeMap::new(),
            root_place: Vec::new(),
        };
        let is_cone = |v: VertexId| layout.cones.iter().any(|c| c.vertex == v);
        if let Some(Node::Vertex(v)) = root
            && is_cone(v)
            && let Some(at) = surface.around(v).next()
        {
            frame.seats.insert(v, Seat { at, value: None });
        }
        for s in (0..ends.len()).filter(|&s| !in_tree[s]) {
            frame.free(s, layout.segments[s].transition.shift);
        }
        for &(node, segment, outgoing) in parent.iter().rev() {
            match node {
                Node::Rim(_) => frame.free(segment, layout.segments[segment].transition.shift),
                Node::Vertex(vertex) => {
                    if is_cone(vertex) {
                        let seat = Seat {
                            at: outgoing,
                            value: Some(frame.values.len()),
                        };
                        frame.values.push(seat.position(layout));
                        frame.seats.insert(vertex, seat);
                    }
                    frame.rules.push(Rule::Around { segment, vertex });
                }
            }
        }
        frame.move_origin(layout);
        if let Some((&vertex, _)) = frame.seats.iter().find(|(_, s)| s.value.is_none()) {
            let unit = |k: usize| {
                let mut values = vec![C::new(0.0, 0.0); frame.values.len()];
                values[k] = C::new(1.0, 0.0);
                frame.centre(surface, vertex, &values)
            };
            frame.root_place = (0..frame.values.len()).map(unit).collect();
        }
        frame
    }

    /// What the transitions around a cone turn about, in the chart of its first wedge.
    fn centre(&self, surface: &Surface, vertex: VertexId, values: &[C]) -> C {
        let over = self.transitions(surface, values);
        let mut around = Transition::IDENTITY;
        let spokes: Vec<HalfedgeId> = surface.around(vertex).collect();
        for &h in spokes.iter().skip(1).chain(spokes.first()) {
            around = around.then(&self.across(&over, h).inverse());
        }
        around.shift / (C::new(1.0, 0.0) - around.turn)
    }

    fn free(&mut self, segment: usize, shift: C) {
        let value = self.values.len();
        self.values.push(shift);
        self.rules.push(Rule::Free { segment, value });
    }

    /// Moves the chart's origin to the root's cone, else to the last cone, else to a rim's centre of rotation.
    fn move_origin(&mut self, layout: &mut Layout) {
        let one = C::new(1.0, 0.0);
        let fixed = |rule: &Rule| match *rule {
            Rule::Free { segment, value } if (one - self.turns[segment]).modulus() > 0.5 => {
                Some(self.values[value] / (one - self.turns[segment]))
            }
            _ => None,
        };
        let root = self.seats.values().find(|seat| seat.value.is_none());
        let last = self.seats.values().max_by_key(|seat| seat.value);
        let cone = root.or(last).map(|seat| seat.position(layout));
        let Some(origin) = cone.or_else(|| self.rules.iter().find_map(fixed)) else {
            return;
        };
        layout.moved(&Transition {
            turn: one,
            shift: -origin,
        });
        for rule in &self.rules {
            if let Rule::Free { segment, value } = *rule {
                self.values[value] -= (one - self.turns[segment]) * origin;
            }
        }
        for value in self.seats.values().filter_map(|seat| seat.value) {
            self.values[value] -= origin;
        }
        // What was moved to 0 is 0, without rounding.
        let tiny = 1e-12 * (layout.area_mm2().sqrt() + origin.modulus());
        for x in &mut self.values {
            if x.modulus() < tiny {
                *x = C::new(0.0, 0.0);
            }
        }
    }

    /// The transitions of all segments for the given free values.
    fn transitions(&self, surface: &Surface, values: &[C]) -> Vec<Transition> {
        let mut over: Vec<Transition> = self
            .turns
            .iter()
            .map(|&turn| Transition {
                turn,
                shift: C::new(0.0, 0.0),
            })
            .collect();
        for rule in &self.rules {
            match *rule {
                Rule::Free { segment, value } => over[segment].shift = values[value],
                Rule::Around { segment, vertex } => {
                    // Counter-clockwise from the own segment once around, back to just before it.
                    let spokes: Vec<HalfedgeId> = surface
                        .around(vertex)
                        .filter(|h| self.segment_of.contains_key(h))
                        .collect();
                    let own =
                        |h: &HalfedgeId| self.segment_of.get(h).is_some_and(|s| s.0 == segment);
                    let Some(start) = spokes.iter().position(own) else {
                        continue;
                    };
                    let mut others = Transition::IDENTITY;
                    for i in 1..spokes.len() {
                        let h = spokes[(start + i) % spokes.len()];
                        others = others.then(&self.across(&over, h).inverse());
                    }
                    let (_, with) = self.segment_of[&spokes[start]];
                    // The own transition, crossed the same way, closes the circle: a turn about the cone.
                    let own_turn = if with {
                        over[segment].turn.conj()
                    } else {
                        over[segment].turn
                    };
                    let turn = own_turn * others.turn;
                    // A branch turns about nothing, wherever it is.
                    let value = self.seats.get(&vertex).and_then(|seat| seat.value);
                    let place = value.map_or(C::new(0.0, 0.0), |v| values[v]);
                    let about = Transition {
                        turn,
                        shift: (C::new(1.0, 0.0) - turn) * place,
                    };
                    let closing = others.inverse().then(&about);
                    over[segment] = if with { closing.inverse() } else { closing };
                    over[segment].turn = self.turns[segment];
                }
            }
        }
        over
    }

    /// The transition across a halfedge of the cut, from its left to its right.
    fn across(&self, over: &[Transition], h: HalfedgeId) -> Transition {
        match self.segment_of.get(&h) {
            Some(&(s, true)) => over[s],
            Some(&(s, false)) => over[s].inverse(),
            None => Transition::IDENTITY,
        }
    }
}

/// How the chart follows a change of the free values.
struct Warp {
    /// The motion from the first wedge of a vertex to that of each corner, for the corners of vertices on the cut.
    wedges: BTreeMap<(FaceId, usize), Transition>,
    /// The rotation of the same, for all corners.
    turn: Per<FaceId, [C; 3]>,
    /// Displacement of every vertex in its first wedge, for a unit change of each free value.
    response: Vec<Per<VertexId, C>>,
    /// ∫ |∂̄d|² + 10⁻³ |∂d|² as a Hermitian form of the change.
    price: DMatrix<C>,
}

/// ∂̄ and ∂ of a function on a flat triangle, as weights of its corner values: (i/4A) eₖ and its conjugate, with eₖ the
/// side opposite corner k; and the area A. `None` for a triangle without area.
fn derivatives(corners: &[Point2<f64>; 3]) -> Option<([C; 3], f64)> {
    let side = |k: usize| {
        let e = corners[(k + 2) % 3] - corners[(k + 1) % 3];
        C::new(e.x, e.y)
    };
    let area = 0.5 * (corners[1] - corners[0]).perp(&(corners[2] - corners[0]));
    let longest = (0..3)
        .map(|k| side(k).modulus_squared())
        .fold(0.0, f64::max);
    (area > 1e-9 * longest).then(|| {
        (
            std::array::from_fn(|k| C::new(0.0, 0.25 / area) * side(k)),
            area,
        )
    })
}

impl Warp {
    fn new(surface: &Surface, layout: &Layout, frame: &Frame) -> Result<Self, LinkageError> {
        let measured = frame.transitions(surface, &frame.values);
        let wedges = wedges(surface, frame, &measured);
        let mut turn = Per::filled(surface.faces().len(), [C::new(1.0, 0.0); 3]);
        for (&(face, corner), motion) in &wedges {
            turn[face][corner] = motion.turn;
        }
        let mut row = Per::filled(surface.positions().len(), u32::MAX);
        let mut rows = 0;
        let floating = layout.cones.is_empty()
            && frame
                .turns
                .iter()
                .all(|t| (t - C::new(1.0, 0.0)).modulus() < 0.5);
        for vertex in surface.positions().ids().skip(usize::from(floating)) {
            if !frame.seats.contains_key(&vertex) {
                row[vertex] = rows as u32;
                rows += 1;
            }
        }
        let edges = surface
            .edges()
            .map(|h| (row[surface.tail(h)], row[surface.head(h)]));
        let pairs = edges.filter(|&(i, j)| i != u32::MAX && j != u32::MAX && i != j);
        let mut cholesky = Cholesky::new(Pattern::new(rows, pairs).expanded(2))?;
        let mut matrix = vec![0.0; cholesky.pattern().entries()];
        for (face, v) in surface.faces().iter_ids() {
            let Some(form) = face_form(&layout.corners[face]) else {
                continue;
            };
            let r = v.map(|v| row[v]);
            for i in 0..3 {
                for j in 0..3 {
                    if r[i] == u32::MAX || r[j] == u32::MAX || r[i] < r[j] {
                        continue;
                    }
                    let h = turn[face][i].conj() * form[i][j] * turn[face][j];
                    let block = [[h.re, -h.im], [h.im, h.re]];
                    for (a, line) in block.iter().enumerate() {
                        for (b, value) in line.iter().enumerate() {
                            let at = (2 * r[i] as usize + a, 2 * r[j] as usize + b);
                            if at.0 >= at.1
                                && let Some(slot) = cholesky.pattern().slot(at.0, at.1)
                            {
                                matrix[slot] += value;
                            }
                        }
                    }
                }
            }
        }
        cholesky.factor(&matrix)?;
        let mut warp = Self {
            wedges,
            turn,
            response: Vec::new(),
            price: DMatrix::zeros(frame.values.len(), frame.values.len()),
        };
        let mut offsets = Vec::new();
        let mut rhs = vec![0.0; 2 * rows];
        for k in 0..frame.values.len() {
            let mut values = frame.values.clone();
            values[k] += 1.0;
            let over = frame.transitions(surface, &values);
            let changed = warp.offsets(surface, frame, &over);
            let mut d = warp.cone_displacements(surface, frame, &changed, k);
            rhs.fill(0.0);
            for (face, v) in surface.faces().iter_ids() {
                let known = warp.corner_values(face, v, &d, &changed);
                if known.iter().all(|c| c.modulus_squared() == 0.0) {
                    continue;
                }
                let Some(form) = face_form(&layout.corners[face]) else {
                    continue;
                };
                for i in 0..3 {
                    if row[v[i]] == u32::MAX {
                        continue;
                    }
                    let pull: C = (0..3).map(|j| form[i][j] * known[j]).sum();
                    let pull = warp.turn[face][i].conj() * pull;
                    rhs[2 * row[v[i]] as usize] -= pull.re;
                    rhs[2 * row[v[i]] as usize + 1] -= pull.im;
                }
            }
            cholesky.solve(&mut rhs);
            for (vertex, &r) in row.iter_ids() {
                if r != u32::MAX {
                    d[vertex] = C::new(rhs[2 * r as usize], rhs[2 * r as usize + 1]);
                }
            }
            warp.response.push(d);
            offsets.push(changed);
        }
        for (face, &v) in surface.faces().iter_ids() {
            let Some(form) = face_form(&layout.corners[face]) else {
                continue;
            };
            let f: Vec<[C; 3]> = (0..warp.response.len())
                .map(|k| warp.corner_values(face, &v, &warp.response[k], &offsets[k]))
                .collect();
            for (a, fa) in f.iter().enumerate() {
                for (b, fb) in f.iter().enumerate() {
                    for i in 0..3 {
                        for j in 0..3 {
                            warp.price[(a, b)] += fa[i].conj() * form[i][j] * fb[j];
                        }
                    }
                }
            }
        }
        Ok(warp)
    }

    /// How the wedges' translations differ with other transitions.
    fn offsets(
        &self,
        surface: &Surface,
        frame: &Frame,
        over: &[Transition],
    ) -> BTreeMap<(FaceId, usize), C> {
        wedges(surface, frame, over)
            .into_iter()
            .map(|(key, after)| (key, after.shift - self.wedges[&key].shift))
            .collect()
    }

    /// Displacements of the cones in their first wedges, 0 elsewhere, where free value `changed` grows by 1: it moves its
    /// cone in the wedge in which it was measured, and the root's.
    fn cone_displacements(
        &self,
        surface: &Surface,
        frame: &Frame,
        offsets: &BTreeMap<(FaceId, usize), C>,
        changed: usize,
    ) -> Per<VertexId, C> {
        let mut d = Per::filled(surface.positions().len(), C::new(0.0, 0.0));
        for (vertex, seat) in &frame.seats {
            let key = (seat.at.face(), seat.at.corner());
            let own = C::new(f64::from(u8::from(seat.value == Some(changed))), 0.0);
            let there = match seat.value {
                Some(_) => own,
                None => frame.root_place.get(changed).copied().unwrap_or_default(),
            };
            if let (Some(motion), Some(offset)) = (self.wedges.get(&key), offsets.get(&key)) {
                d[*vertex] = motion.turn.conj() * (there - offset);
            }
        }
        d
    }

    /// Displacements of a face's corners in its own chart.
    fn corner_values(
        &self,
        face: FaceId,
        v: &[VertexId; 3],
        d: &Per<VertexId, C>,
        offsets: &BTreeMap<(FaceId, usize), C>,
    ) -> [C; 3] {
        std::array::from_fn(|k| {
            let turned = self.turn[face][k] * d[v[k]];
            offsets.get(&(face, k)).map_or(turned, |c| turned + c)
        })
    }

    /// The layout with the free values `rounded`; `None` if a face would be folded over.
    fn apply(
        &self,
        surface: &Surface,
        layout: &Layout,
        frame: &Frame,
        rounded: &[C],
        lattice: &Lattice,
    ) -> Option<Layout> {
        let mut whole = frame.transitions(surface, rounded);
        whole
            .iter_mut()
            .for_each(|t| t.shift = lattice.nearest(t.shift));
        let offsets = self.offsets(surface, frame, &whole);
        let mut d = Per::filled(surface.positions().len(), C::new(0.0, 0.0));
        for (k, response) in self.response.iter().enumerate() {
            let change = rounded[k] - frame.values[k];
            d.iter_mut()
                .zip(response.iter())
                .for_each(|(d, r)| *d += change * r);
        }
        let mut warped = layout.clone();
        let mut corners = layout.corners.clone();
        let count = surface.positions().len();
        let mut areas = Per::<VertexId, [f64; 2]>::filled(count, [0.0; 2]);
        let mean = layout.area_mm2() / surface.faces().len() as f64;
        for (face, v) in surface.faces().iter_ids() {
            let moved = self.corner_values(face, v, &d, &offsets);
            for (corner, by) in corners[face].iter_mut().zip(moved) {
                corner.x += by.re;
                corner.y += by.im;
            }
            let area = |c: &[Point2<f64>; 3]| 0.5 * (c[1] - c[0]).perp(&(c[2] - c[0]));
            let (old, new) = (area(&layout.corners[face]), area(&corners[face]));
            if old > 1e-9 * mean && new <= 0.0 {
                return None;
            }
            for v in v {
                areas[*v][0] += old;
                areas[*v][1] += new;
            }
        }
        for (log, [old, new]) in warped.log_scale.iter_mut().zip(areas.iter()) {
            if *old > 0.0 && *new > 0.0 {
                *log -= 0.5 * (new / old).ln();
            }
        }
        warped.set_chart(surface, corners, &whole);
        Some(warped)
    }
}

/// The energy of one face as a Hermitian form of the displacements of its corners, times its area.
fn face_form(corners: &[Point2<f64>; 3]) -> Option<[[C; 3]; 3]> {
    let (shear, area) = derivatives(corners)?;
    Some(std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let stretch = shear[i] * shear[j].conj() * STRETCH_WEIGHT;
            (shear[i].conj() * shear[j] + stretch) * area
        })
    }))
}

/// The motion from the first wedge of a vertex to that of each corner, for the corners of vertices on the cut.
fn wedges(
    surface: &Surface,
    frame: &Frame,
    over: &[Transition],
) -> BTreeMap<(FaceId, usize), Transition> {
    let mut found = BTreeMap::new();
    let mut on_cut: Vec<VertexId> = frame.segment_of.keys().map(|&h| surface.tail(h)).collect();
    on_cut.sort_unstable();
    on_cut.dedup();
    for vertex in on_cut {
        let mut motion = Transition::IDENTITY;
        for (i, h) in surface.around(vertex).enumerate() {
            if i > 0 {
                motion = motion.then(&frame.across(over, h).inverse());
            }
            found.insert((h.face(), h.corner()), motion);
        }
    }
    found
}

/// A lattice worth trying.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    edge_mm: f64,
    orientation_deg: f64,
    /// Warp energy that rounding to it costs, mm².
    price: f64,
    /// What it is sorted by.
    score: f64,
}

impl Candidate {
    fn same_lattice(&self, other: &Self) -> bool {
        let turn = (self.orientation_deg - other.orientation_deg) / 60.0;
        (self.edge_mm / other.edge_mm - 1.0).abs() < 1e-6 && (turn - turn.round()).abs() < 1e-7
    }
}

/// Sizes and orientations tried on a grid before the best are refined.
const GRID: (usize, usize) = (33, 240);
/// Grid points refined.
const REFINED: usize = 40;

/// How free values become whole.
struct Rounding<'a> {
    values: &'a [C],
    /// See [`Frame::root_place`].
    root_place: &'a [C],
    price: &'a DMatrix<C>,
}

impl Rounding<'_> {
    /// Lattice vectors, of a lattice whose first edge is `unit`, for the free values, in units of it: the nearest; or,
    /// where those would turn the root's cone about the middle of a triangle, which a turn by 120° can, the cheapest
    /// for which one value goes to a neighbour instead.
    fn whole(&self, unit: C) -> Vec<C> {
        let one = Lattice::new(1.0, 0.0);
        let mut whole: Vec<C> = self.values.iter().map(|x| one.nearest(x / unit)).collect();
        let place: C = self.root_place.iter().zip(&whole).map(|(c, n)| c * n).sum();
        let off = |z: C| (one.nearest(z) - z).modulus() > 0.1;
        if !off(place) {
            return whole;
        }
        let rest: Vec<C> = whole
            .iter()
            .zip(self.values)
            .map(|(n, x)| unit * n - x)
            .collect();
        let pull: Vec<C> = (0..rest.len())
            .map(|i| (0..rest.len()).map(|j| self.price[(i, j)] * rest[j]).sum())
            .collect();
        let mut best: Option<(f64, usize, C)> = None;
        for (k, part) in self.root_place.iter().enumerate() {
            for turn in 0..6 {
                let step = one.nearest(C::from_polar(1.0, f64::from(turn) * PI / 3.0));
                if off(place + part * step) {
                    continue;
                }
                let by = unit * step;
                let more =
                    2.0 * (by.conj() * pull[k]).re + by.modulus_squared() * self.price[(k, k)].re;
                if best.is_none_or(|b| more < b.0) {
                    best = Some((more, k, step));
                }
            }
        }
        if let Some((_, k, step)) = best {
            whole[k] += step;
        }
        whole
    }

    fn form(&self, a: &[C], b: &[C]) -> C {
        let mut sum = C::new(0.0, 0.0);
        for (i, x) in a.iter().enumerate() {
            for (j, y) in b.iter().enumerate() {
                sum += x.conj() * self.price[(i, j)] * y;
            }
        }
        sum
    }

    /// What a warp to the lattice costs.
    fn cost(&self, unit: C) -> f64 {
        let whole = self.whole(unit);
        let off: Vec<C> = whole
            .iter()
            .zip(self.values)
            .map(|(n, x)| unit * n - x)
            .collect();
        self.form(&off, &off).re.max(0.0)
    }
}

/// Lattices around the wanted one, the best first.
fn candidates(
    rounding: &Rounding<'_>,
    edge_mm: f64,
    exact: bool,
    orientation_deg: Option<f64>,
) -> Vec<Candidate> {
    let scale: f64 = rounding
        .values
        .iter()
        .map(|x| x.modulus_squared())
        .sum::<f64>()
        .max(1e-300);
    let (sizes, angles) = (
        if exact { 1 } else { GRID.0 },
        if orientation_deg.is_some() { 1 } else { GRID.1 },
    );
    let make = |edge: f64, deg: f64| {
        let found = rounding.cost(C::from_polar(edge, deg.to_radians()));
        let away = (edge / edge_mm).ln() / SIZE_ROOM;
        Candidate {
            edge_mm: edge,
            orientation_deg: deg,
            price: found,
            score: found / scale + 1e-6 * away * away,
        }
    };
    let mut all = Vec::with_capacity(sizes * angles);
    for i in 0..sizes {
        let part = if sizes == 1 {
            0.0
        } else {
            2.0 * i as f64 / (sizes - 1) as f64 - 1.0
        };
        for j in 0..angles {
            // The lattice comes back to itself after 60°.
            let deg = orientation_deg.unwrap_or(60.0 * j as f64 / angles as f64 - 30.0);
            all.push(make(edge_mm * (part * SIZE_ROOM).exp(), deg));
        }
    }
    let order = |a: &Candidate, b: &Candidate| a.score.total_cmp(&b.score);
    all.sort_by(order);
    all.truncate(REFINED);
    for candidate in &mut all {
        for _ in 0..10 {
            let at = C::from_polar(candidate.edge_mm, candidate.orientation_deg.to_radians());
            let n = rounding.whole(at);
            // Least squares for the complex scale s of s·n ≈ x.
            let (above, below) = (rounding.form(&n, rounding.values), rounding.form(&n, &n).re);
            if below <= 0.0 {
                break;
            }
            let best = match orientation_deg {
                Some(deg) => C::from_polar(1.0, deg.to_radians()).conj() * above / below,
                None => above / below,
            };
            let edge = if exact {
                edge_mm
            } else {
                let wished = if orientation_deg.is_some() {
                    best.re
                } else {
                    best.modulus()
                };
                wished.clamp(edge_mm * (-SIZE_ROOM).exp(), edge_mm * SIZE_ROOM.exp())
            };
            let deg = orientation_deg.unwrap_or_else(|| best.argument() * 180.0 / PI);
            let next = make(edge, deg);
            if next.score >= candidate.score {
                break;
            }
            *candidate = next;
        }
    }
    all.sort_by(order);
    all
}
