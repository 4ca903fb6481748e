//! Lays the triangles flat: unfolded piece by piece along the seam, no two on one another, the pieces side by side.
//!
//! A seam that opens every cone still does not promise that distant parts of the sheet stay off each other. Where they
//! meet, the sheet is divided: a piece grows ring by ring and refuses what would lie on it, or against it along a cut
//! that has no width; what it refused grows into further pieces, and pieces that fit together are joined again. All
//! positions are whole lattice positions.

use std::collections::{HashMap, VecDeque};

use nalgebra::Point2;

use super::clip::Laid;
use super::flaps::{self, Flaps};
use super::lattice::Lattice;
use super::net::{Net, Spot, beyond};
use super::seam::{Price, Seam};

/// Lattice rows free between two pieces: one for a doubled row along the seam, one that keeps it off the other piece.
const ROWS_BETWEEN: i32 = 2;
/// Starts that are tried for dividing a sheet; the one that gives fewest pieces is taken. A few far-apart ones do.
const STARTS: usize = 8;
/// A piece of fewer triangles is a scrap: each of its triangles goes wherever it fits.
const SCRAP: usize = 3;

/// Flat triangles.
#[derive(Clone, Debug)]
pub(crate) struct Flat {
    /// Closed corners on the sheet, millimetres, per triangle.
    pub corners: Vec<[Point2<f64>; 3]>,
    /// Pieces of the sheet.
    pub pieces: usize,
    /// Pairs of triangles that lie on one another all the same: none, unless something above is wrong.
    pub overlaps: Vec<(usize, usize)>,
    /// Lattice edges of the seam: those between neighbours that do not lie side by side.
    pub seam_edges: usize,
    /// Doubled rows along the seam.
    pub flaps: Flaps,
}

/// Chooses the seam and lays every triangle flat. The piece of `root` keeps the place that it has in its chart; `price`
/// makes the seam avoid places that it costs more to cut.
pub(crate) fn flatten(laid: &[Laid], lattice: &Lattice, root: usize, price: Price<'_>) -> Flat {
    let net = Net::new(laid);
    let start = laid[root].corners.map(|c| {
        let (i, j) = lattice.coordinates(c);
        (i.round() as i32, j.round() as i32)
    });
    let (spots, pieces) = lay(&net, root, start, price);
    let seam_edges = seam_edges(&net, &spots);
    let mut there = HashMap::with_capacity(spots.len());
    let overlaps = (0..spots.len())
        .filter_map(|t| there.insert(middle(&spots[t]), t).map(|other| (other, t)))
        .collect();
    let corners = spots
        .iter()
        .map(|s| s.map(|(i, j)| lattice.point(f64::from(i), f64::from(j))))
        .collect();
    Flat {
        corners,
        pieces,
        overlaps,
        seam_edges,
        flaps: flaps::rows(&net, &spots, laid, lattice),
    }
}

/// Whether two neighbours lie side by side on the sheet.
pub(super) fn joined(spots: &[[Spot; 3]], side: usize, twin: usize) -> bool {
    beyond(&spots[side / 3], side, twin) == spots[twin / 3]
}

/// Lattice edges between neighbours that do not.
pub(super) fn seam_edges(net: &Net, spots: &[[Spot; 3]]) -> usize {
    (0..net.twin.len())
        .filter_map(|side| net.twin[side].map(|twin| (side, twin)))
        .filter(|&(side, twin)| side < twin && !joined(spots, side, twin))
        .count()
}

/// Lattice corners of every triangle and the number of pieces.
pub(super) fn lay(
    net: &Net,
    root: usize,
    start: [Spot; 3],
    price: Price<'_>,
) -> (Vec<[Spot; 3]>, usize) {
    let seam = Seam::choose(net, price);
    let mut sheet = Sheet {
        net,
        cut: seam.cut,
        spots: vec![start; net.twin.len() / 3],
    };
    let mut pieces: Vec<Vec<usize>> = Vec::new();
    for part in sheet.unfold(root) {
        pieces.extend(sheet.divide(&part));
    }
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for piece in pieces {
        if piece.len() < SCRAP {
            parts.extend(piece.into_iter().map(|t| vec![t]));
        } else {
            parts.push(piece);
        }
    }
    let mut pieces = sheet.join(parts, root);
    sheet.pack(&mut pieces, root);
    (sheet.spots, pieces.len())
}

/// A motion of the lattice: a turn by so many times 60°, then a shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    turn: usize,
    shift: Spot,
}

impl Motion {
    /// A spot turned about the origin.
    pub(super) fn turned((i, j): Spot, turn: usize) -> Spot {
        (0..turn).fold((i, j), |(i, j), _| (-j, i + j))
    }

    /// Where a spot goes.
    pub(super) fn apply(&self, spot: Spot) -> Spot {
        let (i, j) = Self::turned(spot, self.turn);
        (i + self.shift.0, j + self.shift.1)
    }

    fn inverse(&self) -> Self {
        let turn = (6 - self.turn) % 6;
        let (i, j) = Self::turned(self.shift, turn);
        Self {
            turn,
            shift: (-i, -j),
        }
    }

    /// The motion that takes one triangle to another.
    pub(super) fn between(from: &[Spot; 3], to: &[Spot; 3]) -> Self {
        let side = |t: &[Spot; 3]| (t[1].0 - t[0].0, t[1].1 - t[0].1);
        let turn = (0..6)
            .find(|&k| Self::turned(side(from), k) == side(to))
            .unwrap_or(0);
        let (i, j) = Self::turned(from[0], turn);
        Self {
            turn,
            shift: (to[0].0 - i, to[0].1 - j),
        }
    }
}

/// Three times a triangle's centroid: no other triangle has the same.
pub(super) fn middle(corners: &[Spot; 3]) -> Spot {
    corners
        .iter()
        .fold((0, 0), |sum, c| (sum.0 + c.0, sum.1 + c.1))
}

/// Three times the centroid of the lattice triangle across a side.
pub(super) fn middle_beyond(corners: &[Spot; 3], side: usize) -> Spot {
    middle(&beyond(corners, side, 0))
}

/// Triangles being laid.
struct Sheet<'a> {
    net: &'a Net,
    cut: Vec<bool>,
    spots: Vec<[Spot; 3]>,
}

impl Sheet<'_> {
    /// The triangles that share a side with `t` across which nothing is cut, with the two names of that side.
    fn uncut(&self, t: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        (3 * t..3 * t + 3)
            .filter(|&side| !self.cut[side])
            .filter_map(|side| self.net.twin[side].map(|twin| (side, twin)))
    }

    /// Unfolds the parts into which the seam divides the sheet, that of `root` first; each other one starts against a
    /// part before it, across the seam, so that colours agree.
    fn unfold(&mut self, root: usize) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.spots.len()];
        let mut parts = Vec::new();
        let mut starts = VecDeque::from([(root, self.spots[root])]);
        while let Some((seed, corners)) = starts.pop_front() {
            if std::mem::replace(&mut seen[seed], true) {
                continue;
            }
            self.spots[seed] = corners;
            let mut part = vec![seed];
            let mut done = 0;
            while done < part.len() {
                let t = part[done];
                done += 1;
                for side in 3 * t..3 * t + 3 {
                    let Some(twin) = self.net.twin[side] else {
                        continue;
                    };
                    let corners = beyond(&self.spots[t], side, twin);
                    if self.cut[side] {
                        starts.push_back((twin / 3, corners));
                    } else if !std::mem::replace(&mut seen[twin / 3], true) {
                        self.spots[twin / 3] = corners;
                        part.push(twin / 3);
                    }
                }
            }
            parts.push(part);
        }
        parts
    }

    /// Whether `t`, with these corners, cannot lie on a sheet that holds `there`: its place is taken, or it would lie
    /// against a triangle that is not its neighbour, along a cut without width.
    fn bars(&self, t: usize, corners: &[Spot; 3], there: &HashMap<Spot, usize>) -> bool {
        let net = self.net;
        there.contains_key(&middle(corners))
            || (0..3).any(|k| {
                let Some(&other) = there.get(&middle_beyond(corners, k)) else {
                    return false;
                };
                let mine = net.twin[3 * t + k];
                if mine.is_some_and(|twin| {
                    beyond(corners, k, twin) == self.spots[other] && twin / 3 == other
                }) {
                    return false;
                }
                // A slot of the surface's own rim is no fault of the seam's.
                let facing = (3 * other..3 * other + 3)
                    .find(|&side| middle_beyond(&self.spots[other], side) == middle(corners));
                mine.is_some() || facing.is_some_and(|side| net.twin[side].is_some())
            })
    }

    /// Divides a part into pieces without overlap.
    fn divide(&self, part: &[usize]) -> Vec<Vec<usize>> {
        let mut best = self.divide_from(part, part[0]);
        if best.len() == 1 {
            return best;
        }
        let mut far = vec![usize::MAX; self.spots.len()];
        let mut seed = part[0];
        for _ in 1..STARTS {
            self.measure(seed, &mut far);
            seed = part
                .iter()
                .copied()
                .max_by_key(|&t| (far[t], t))
                .unwrap_or(seed);
            let other = self.divide_from(part, seed);
            let scraps = |pieces: &[Vec<usize>]| {
                let least = pieces.iter().map(Vec::len).min();
                (pieces.len(), std::cmp::Reverse(least))
            };
            if scraps(&other) < scraps(&best) {
                best = other;
            }
        }
        best
    }

    /// Lowers `far` to the distance from `seed`, in triangles.
    fn measure(&self, seed: usize, far: &mut [usize]) {
        far[seed] = 0;
        let mut queue = VecDeque::from([seed]);
        while let Some(t) = queue.pop_front() {
            for (_, twin) in self.uncut(t) {
                if far[t] + 1 < far[twin / 3] {
                    far[twin / 3] = far[t] + 1;
                    queue.push_back(twin / 3);
                }
            }
        }
    }

    /// The pieces that grow from `seed` and then from what the earlier ones refused, farthest first.
    fn divide_from(&self, part: &[usize], seed: usize) -> Vec<Vec<usize>> {
        let mut far = vec![usize::MAX; self.spots.len()];
        self.measure(seed, &mut far);
        let mut order = part.to_vec();
        order.sort_unstable_by_key(|&t| (far[t], t));
        let mut free = vec![false; self.spots.len()];
        part.iter().for_each(|&t| free[t] = true);
        let mut pieces = Vec::new();
        for start in std::iter::once(seed).chain(order.into_iter().rev()) {
            if free[start] {
                pieces.push(self.grow(start, &mut free));
            }
        }
        pieces
    }

    /// A piece of free triangles, ring by ring around `start`.
    fn grow(&self, start: usize, free: &mut [bool]) -> Vec<usize> {
        let mut there = HashMap::from([(middle(&self.spots[start]), start)]);
        free[start] = false;
        let mut piece = vec![start];
        let mut done = 0;
        while done < piece.len() {
            let t = piece[done];
            done += 1;
            for (_, twin) in self.uncut(t) {
                let other = twin / 3;
                if free[other] && !self.bars(other, &self.spots[other], &there) {
                    free[other] = false;
                    there.insert(middle(&self.spots[other]), other);
                    piece.push(other);
                }
            }
        }
        piece
    }

    /// Joins pieces that can lie side by side along a common side, the smallest first, each with the neighbour of the
    /// longest common rim. The piece of `root` stays where it is.
    fn join(&mut self, mut pieces: Vec<Vec<usize>>, root: usize) -> Vec<Vec<usize>> {
        let mut of = vec![0; self.spots.len()];
        loop {
            pieces.sort_by_key(|p| (p.len(), p[0]));
            for (n, piece) in pieces.iter().enumerate() {
                piece.iter().for_each(|&t| of[t] = n);
            }
            let fitting = (0..pieces.len()).find_map(|n| Some((n, self.fit(&pieces, &of, n)?)));
            let Some((n, (host, motion))) = fitting else {
                return pieces;
            };
            // Whichever moves, the root's piece does not.
            let (moving, motion) = if pieces[n].contains(&root) {
                (host, motion.inverse())
            } else {
                (n, motion)
            };
            for &t in &pieces[moving] {
                self.spots[t] = self.spots[t].map(|s| motion.apply(s));
            }
            let guest = pieces[n].clone();
            pieces[host].extend(guest);
            pieces.remove(n);
        }
    }

    /// The piece that piece `n` can be joined to, and the motion that takes it there.
    fn fit(&self, pieces: &[Vec<usize>], of: &[usize], n: usize) -> Option<(usize, Motion)> {
        // For every neighbour and every way of laying the piece against it: the number of common sides.
        let mut ways: Vec<(usize, Motion, usize)> = Vec::new();
        for side in pieces[n].iter().flat_map(|&t| 3 * t..3 * t + 3) {
            let Some(twin) = self.net.twin[side].filter(|twin| of[twin / 3] != n) else {
                continue;
            };
            let goal = beyond(&self.spots[twin / 3], twin, side);
            let motion = Motion::between(&self.spots[side / 3], &goal);
            let host = of[twin / 3];
            match ways.iter_mut().find(|(h, m, _)| *h == host && *m == motion) {
                Some(way) => way.2 += 1,
                None => ways.push((host, motion, 1)),
            }
        }
        ways.sort_by_key(|way| std::cmp::Reverse(way.2));
        ways.into_iter()
            .find(|(host, motion, _)| {
                let there = pieces[*host]
                    .iter()
                    .map(|&t| (middle(&self.spots[t]), t))
                    .collect();
                !pieces[n]
                    .iter()
                    .any(|&t| self.bars(t, &self.spots[t].map(|s| motion.apply(s)), &there))
            })
            .map(|(host, motion, _)| (host, motion))
    }

    /// Moves every piece but that of `root` to where the box around all stays smallest, with free rows between.
    fn pack(&mut self, pieces: &mut [Vec<usize>], root: usize) {
        pieces.sort_by_key(|p| (!p.contains(&root), std::cmp::Reverse(p.len()), p[0]));
        let mut taken = std::collections::HashSet::new();
        let mut all = Bounds::EMPTY;
        for (n, piece) in pieces.iter().enumerate() {
            let spots: Vec<Spot> = vertices(piece.iter().flat_map(|&t| self.spots[t]));
            let motion = if n == 0 {
                Motion {
                    turn: 0,
                    shift: (0, 0),
                }
            } else {
                place(&spots, &all, &taken)
            };
            for &t in piece {
                self.spots[t] = self.spots[t].map(|s| motion.apply(s));
            }
            for spot in spots.iter().map(|&s| motion.apply(s)) {
                all.add(spot);
                for i in 1 - ROWS_BETWEEN..ROWS_BETWEEN {
                    for j in 1 - ROWS_BETWEEN..ROWS_BETWEEN {
                        if (i + j).abs() < ROWS_BETWEEN {
                            taken.insert((spot.0 + i, spot.1 + j));
                        }
                    }
                }
            }
        }
    }
}

/// Every spot once.
fn vertices(spots: impl Iterator<Item = Spot>) -> Vec<Spot> {
    let mut spots: Vec<Spot> = spots.collect();
    spots.sort_unstable();
    spots.dedup();
    spots
}

/// A box in half steps along the lattice's first axis and in rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    low: [i64; 2],
    high: [i64; 2],
}

impl Bounds {
    pub(super) const EMPTY: Self = Self {
        low: [i64::MAX; 2],
        high: [i64::MIN; 2],
    };

    pub(super) fn add(&mut self, (i, j): Spot) {
        let at = [2 * i64::from(i) + i64::from(j), i64::from(j)];
        for k in 0..2 {
            self.low[k] = self.low[k].min(at[k]);
            self.high[k] = self.high[k].max(at[k]);
        }
    }

    /// Area of the box around both, then its half perimeter, in a measure that is the same for all.
    pub(super) fn cost_with(&self, other: &Self, shift: [i64; 2]) -> (i64, i64) {
        let extent: [i64; 2] = std::array::from_fn(|k| {
            self.high[k].max(other.high[k] + shift[k]) - self.low[k].min(other.low[k] + shift[k])
        });
        (extent[0] * extent[1], extent[0] + 2 * extent[1])
    }
}

/// Where a piece with these vertices goes: turned by a multiple of 120°, which keeps its colours, and shifted.
fn place(spots: &[Spot], all: &Bounds, taken: &std::collections::HashSet<Spot>) -> Motion {
    let mut ways = Vec::new();
    for turn in [0, 2, 4] {
        let mut own = Bounds::EMPTY;
        spots.iter().for_each(|&s| own.add(Motion::turned(s, turn)));
        // Beyond this the boxes are apart, and apart they are packed well enough at its edge.
        let range = |k: usize| {
            let room = i64::from(ROWS_BETWEEN) * if k == 0 { 2 } else { 1 };
            all.low[k] - room - own.high[k]..=all.high[k] + room - own.low[k]
        };
        for y in range(1) {
            for x in range(0).filter(|x| (x - y) % 2 == 0) {
                let shift = (((x - y) / 2) as i32, y as i32);
                ways.push((all.cost_with(&own, [x, y]), turn, shift));
            }
        }
    }
    ways.sort_unstable();
    ways.into_iter()
        .map(|(_, turn, shift)| Motion { turn, shift })
        .find(|motion| spots.iter().all(|&s| !taken.contains(&motion.apply(s))))
        .unwrap_or(Motion {
            turn: 0,
            shift: (0, 0),
        })
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::Colour;
    use super::super::clip::{around_cones, core};
    use super::*;
    use crate::mesh::FaceId;
    use proptest::prelude::*;

    type Sides = [Option<(usize, usize)>; 3];

    /// Coarse triangles by their vertices, joined along edges that run both ways.
    fn joined(faces: &[[usize; 3]]) -> Vec<Sides> {
        let find = |a: usize, b: usize| {
            (0..faces.len())
                .flat_map(|f| (0..3).map(move |s| (f, s)))
                .find(|&(f, s)| (faces[f][s], faces[f][(s + 1) % 3]) == (a, b))
        };
        let sides = |f: &[usize; 3]| std::array::from_fn(|s| find(f[(s + 1) % 3], f[s]));
        faces.iter().map(sides).collect()
    }

    /// Every coarse triangle divided into n² lattice triangles; colours alternate from the first triangle on.
    fn divided(coarse: &[Sides], n: i32) -> Vec<Laid> {
        let mut keys = Vec::new();
        for f in 0..coarse.len() {
            for j in 0..n {
                for i in 0..n - j {
                    keys.push((f, i, j, Colour::Up));
                    if i + j < n - 1 {
                        keys.push((f, i, j, Colour::Down));
                    }
                }
            }
        }
        let index: HashMap<_, _> = keys.iter().enumerate().map(|(k, key)| (*key, k)).collect();
        let neighbour = |&(f, i, j, colour): &(usize, i32, i32, Colour), s: usize| {
            let inside = |i, j, colour, side| index.get(&(f, i, j, colour)).map(|&k| (k, side));
            let over = |place: i32| {
                let (g, side) = coarse[f][s]?;
                let p = n - 1 - place;
                let (i, j) = [(p, 0), (n - 1 - p, p), (0, n - 1 - p)][side];
                Some((index[&(g, i, j, Colour::Up)], side))
            };
            match (colour, s) {
                (Colour::Up, 0) if j == 0 => over(i),
                (Colour::Up, 1) if i + j == n - 1 => over(j),
                (Colour::Up, 2) if i == 0 => over(n - 1 - j),
                (Colour::Up, 0) => inside(i, j - 1, Colour::Down, 1),
                (Colour::Up, 1) => inside(i, j, Colour::Down, 2),
                (Colour::Up, _) => inside(i - 1, j, Colour::Down, 0),
                (Colour::Down, 0) => inside(i + 1, j, Colour::Up, 2),
                (Colour::Down, 1) => inside(i, j + 1, Colour::Up, 0),
                (Colour::Down, _) => inside(i, j, Colour::Up, 1),
            }
        };
        let laid = keys
            .iter()
            .map(|key| bare(std::array::from_fn(|s| neighbour(key, s))));
        coloured(laid.collect())
    }

    fn bare(neighbours: Sides) -> Laid {
        let (face, corners, barycentric) = (FaceId(0), [Point2::origin(); 3], [1.0, 0.0, 0.0]);
        Laid {
            face,
            barycentric,
            corners,
            colour: Colour::Up,
            number: 0,
            neighbours,
            held: [true; 3],
            trim: None,
        }
    }

    fn coloured(mut laid: Vec<Laid>) -> Vec<Laid> {
        let mut seen = vec![false; laid.len()];
        let mut stack = Vec::new();
        for seed in 0..laid.len() {
            stack.extend((!seen[seed]).then_some((seed, Colour::Up)));
            while let Some((t, colour)) = stack.pop() {
                if !std::mem::replace(&mut seen[t], true) {
                    laid[t].colour = colour;
                    stack.extend(
                        laid[t]
                            .neighbours
                            .iter()
                            .flatten()
                            .map(|n| (n.0, colour.other())),
                    );
                }
                assert_eq!(laid[t].colour, colour, "the test surface has two colours");
            }
        }
        laid
    }

    pub(in crate::linkage) fn octahedron(n: i32) -> Vec<Laid> {
        let faces = [
            [0, 1, 2],
            [0, 2, 3],
            [0, 3, 4],
            [0, 4, 1],
            [5, 2, 1],
            [5, 3, 2],
            [5, 4, 3],
            [5, 1, 4],
        ];
        divided(&joined(&faces), n)
    }

    /// The vertex of `size` triangles, divided, without the triangles of the `hole` rings around it.
    pub(in crate::linkage) fn cone(size: usize, n: i32, hole: usize) -> Vec<Laid> {
        let fan: Vec<Sides> = (0..size)
            .map(|k| {
                [
                    Some(((k + size - 1) % size, 2)),
                    None,
                    Some(((k + 1) % size, 0)),
                ]
            })
            .collect();
        let laid = divided(&fan, n);
        let apex = Net::new(&laid).node[0];
        let mut gone = vec![false; laid.len()];
        let net = Net::new(&laid);
        let mut nodes = vec![apex];
        for _ in 0..hole {
            for side in 0..net.node.len() {
                if nodes.contains(&net.node[side]) {
                    gone[side / 3] = true;
                }
            }
            nodes = (0..net.node.len())
                .filter(|s| gone[s / 3])
                .map(|s| net.node[s])
                .collect();
        }
        core(&laid, |t| !gone[t]).0
    }

    /// A parallelogram of a × b cells, its sides glued by translation, after `skew` cells, where asked.
    pub(in crate::linkage) fn parallelogram(
        a: i32,
        b: i32,
        skew: i32,
        glued: [bool; 2],
    ) -> Vec<Laid> {
        let at = |mut i: i32, mut j: i32, down: i32, side: usize| {
            if !(0..b).contains(&j) {
                if !glued[1] {
                    return None;
                }
                i += skew * j.div_euclid(b);
                j = j.rem_euclid(b);
            }
            if !(0..a).contains(&i) && !glued[0] {
                return None;
            }
            Some(((2 * (j * a + i.rem_euclid(a)) + down) as usize, side))
        };
        let laid = (0..a * b).flat_map(|k| {
            let (i, j) = (k % a, k / a);
            [
                bare([at(i, j - 1, 1, 1), at(i, j, 1, 2), at(i - 1, j, 1, 0)]),
                bare([at(i + 1, j, 0, 2), at(i, j + 1, 0, 0), at(i, j, 0, 1)]),
            ]
        });
        coloured(laid.collect())
    }

    /// Two tori, joined along the rims of a hexagon taken from each: six vertices of eight triangles, two handles.
    pub(in crate::linkage) fn double_torus(n: i32) -> Vec<Laid> {
        let torus = parallelogram(n, n, 0, [true, true]);
        let net = Net::new(&torus);
        let centre = net.node[3 * (n * n) as usize];
        let holed = core(&torus, |t| {
            (3 * t..3 * t + 3).all(|s| net.node[s] != centre)
        })
        .0;
        let net = Net::new(&holed);
        let mut rim = Vec::new();
        let mut side = (0..net.twin.len())
            .find(|&s| net.twin[s].is_none())
            .unwrap();
        while !rim.contains(&side) {
            rim.push(side);
            side = super::super::net::next(side);
            while let Some(twin) = net.twin[side] {
                side = super::super::net::next(twin);
            }
        }
        assert_eq!(rim.len(), 6);
        let count = holed.len();
        let mut both = holed.clone();
        both.extend(holed.iter().map(|l| {
            let mut copy = l.clone();
            copy.neighbours = l.neighbours.map(|n| n.map(|(t, s)| (t + count, s)));
            copy
        }));
        // Opposite colours meet, and the second rim runs the other way.
        let shift = usize::from(holed[rim[0] / 3].colour == holed[rim[5] / 3].colour) + 5;
        let shift = if holed[rim[0] / 3].colour == holed[rim[shift % 6] / 3].colour {
            shift + 1
        } else {
            shift
        };
        for k in 0..6 {
            let (a, b) = (rim[k], rim[(shift + 6 - k) % 6]);
            both[a / 3].neighbours[a % 3] = Some((b / 3 + count, b % 3));
            both[b / 3 + count].neighbours[b % 3] = Some((a / 3, a % 3));
        }
        coloured(both)
    }

    /// A vertex of eight triangles between two of four; see the faces.
    pub(in crate::linkage) fn saddle_between_cones(n: i32) -> Vec<Laid> {
        let mut faces: Vec<[usize; 3]> = (0..8).map(|k| [0, 1 + k, 1 + (k + 1) % 8]).collect();
        faces.extend([[1, 8, 9], [1, 9, 2], [5, 4, 10], [5, 10, 6]]);
        divided(&joined(&faces), n)
    }

    struct Laying {
        pieces: usize,
        seam_edges: usize,
    }

    /// Lays a linkage flat and checks everything that holds for any.
    fn checked(laid: &[Laid]) -> Laying {
        let net = Net::new(laid);
        let start = [(0, 0), (1, 0), (0, 1)];
        let (spots, pieces) = lay(&net, 0, start, &|_, _| 1.0);
        // Colours: up triangles are up on the sheet, wherever their piece was moved.
        for (t, s) in spots.iter().enumerate() {
            let up = middle(s).0.rem_euclid(3) == 1;
            assert_eq!(
                up,
                laid[t].colour == laid[0].colour,
                "triangle {t} changed its colour"
            );
            let e = (s[1].0 - s[0].0, s[1].1 - s[0].1);
            assert_eq!(
                (s[2].0 - s[0].0, s[2].1 - s[0].1),
                (-e.1, e.0 + e.1),
                "counter-clockwise, equilateral"
            );
        }
        let mut there: HashMap<Spot, usize> = HashMap::new();
        for (t, s) in spots.iter().enumerate() {
            assert_eq!(
                there.insert(middle(s), t),
                None,
                "triangle {t} lies on another"
            );
        }
        // What lies side by side is joined, or a slot in the rim; what is joined and does not is the seam.
        let mut flat = laid.to_vec();
        let mut seam_edges = 0;
        for side in 0..net.twin.len() {
            let (t, s) = (side / 3, &spots[side / 3]);
            if let Some(twin) = net.twin[side] {
                if beyond(s, side, twin) == spots[twin / 3] {
                    continue;
                }
                flat[t].neighbours[side % 3] = None;
                assert!(
                    !there.contains_key(&middle_beyond(s, side)),
                    "a cut of no width at {t}"
                );
                seam_edges += 1;
            }
        }
        // The cut sheet has nothing left that would not lie flat, and is as many pieces as it says.
        let open = Net::new(&flat);
        for node in 0..open.flat.len() {
            assert!(open.flat[node], "a node of the cut sheet turns or shifts");
        }
        let mut groups: Vec<usize> = (0..flat.len()).collect();
        let mut count = 0;
        for seed in 0..flat.len() {
            if groups[seed] != seed {
                continue;
            }
            count += 1;
            let mut stack = vec![seed];
            let mut rims = std::collections::BTreeSet::new();
            let (mut nodes, mut sides, mut triangles) = (std::collections::BTreeSet::new(), 0, 0);
            let mut seen = std::collections::BTreeSet::from([seed]);
            while let Some(t) = stack.pop() {
                groups[t] = seed;
                triangles += 1;
                for side in 3 * t..3 * t + 3 {
                    let node = open.node[side];
                    nodes.insert(node);
                    if open.rim[node] {
                        rims.insert(node);
                    }
                    if let Some(twin) = open.twin[side] {
                        sides += usize::from(side < twin);
                        if seen.insert(twin / 3) {
                            stack.push(twin / 3);
                        }
                    }
                }
            }
            groups[seed] = seed;
            // Rims shrunk to points leave a sphere: Euler's number is 2, and a rim there is.
            assert_eq!(nodes.len() + triangles, sides + 2, "a piece with a handle");
            assert!(!rims.is_empty());
        }
        assert_eq!(count, pieces);
        Laying {
            pieces,
            seam_edges: seam_edges / 2,
        }
    }

    #[test]
    fn an_octahedron_is_opened_along_a_tree_of_its_six_corners() {
        for n in [2, 3, 5] {
            let laying = checked(&octahedron(n));
            // Five edges join six corners.
            assert_eq!((laying.pieces, laying.seam_edges), (1, 5 * n as usize));
        }
    }

    #[test]
    fn a_torus_is_opened_along_its_two_shortest_loops() {
        for (a, b, skew, length) in [(4, 4, 0, 8), (6, 3, 0, 9), (5, 7, 2, 12), (7, 3, 3, 10)] {
            let laid = parallelogram(a, b, skew, [true, true]);
            assert_eq!(Net::new(&laid).handles(), 1);
            let laying = checked(&laid);
            assert_eq!(
                (laying.pieces, laying.seam_edges),
                (1, length),
                "{a} × {b}, {skew}"
            );
        }
    }

    #[test]
    fn a_cylinder_shifts_without_turning_and_is_slit_straight_across() {
        for (around, across) in [(5, 4), (12, 7)] {
            let laying = checked(&parallelogram(around, across, 0, [true, false]));
            assert_eq!((laying.pieces, laying.seam_edges), (1, across as usize));
        }
    }

    #[test]
    fn a_strip_and_a_plate_with_a_plain_hole_need_no_seam() {
        assert_eq!(
            checked(&parallelogram(9, 4, 0, [false, false])).seam_edges,
            0
        );
        let laying = checked(&cone(6, 6, 2));
        assert_eq!((laying.pieces, laying.seam_edges), (1, 0));
    }

    #[test]
    fn a_cone_is_slit_from_tip_or_hole_to_rim() {
        for (size, n, hole) in [(4, 5, 0), (4, 6, 1), (4, 8, 2), (2, 5, 1), (2, 8, 3)] {
            let laying = checked(&cone(size, n, hole));
            let length = n as usize - hole;
            assert_eq!(
                (laying.pieces, laying.seam_edges),
                (1, length),
                "{size} {n} {hole}"
            );
        }
    }

    #[test]
    fn a_lone_vertex_of_eight_triangles_is_cut_right_through() {
        for size in [8, 10] {
            let laying = checked(&cone(size, 5, 0));
            assert_eq!((laying.pieces, laying.seam_edges), (2, 10), "{size}");
        }
    }

    #[test]
    fn a_vertex_of_eight_triangles_lies_flat_in_one_piece_on_the_way_to_one_of_four() {
        for n in [2, 3, 6] {
            let laid = saddle_between_cones(n);
            let laying = checked(&laid);
            // One way from either cone to the saddle or the rim, and none of them is a detour.
            assert_eq!(laying.pieces, 1);
            assert!(laying.seam_edges <= 3 * n as usize, "{}", laying.seam_edges);
        }
    }

    #[test]
    fn a_double_torus_lies_flat() {
        for n in [5, 8] {
            let laid = double_torus(n);
            let net = Net::new(&laid);
            assert_eq!(net.handles(), 2);
            assert_eq!((0..net.flat.len()).filter(|&v| net.crowded(v)).count(), 6);
            checked(&laid);
        }
    }

    #[test]
    fn a_dear_place_is_gone_around() {
        // A cylinder with all but one of its ways across made dear.
        let laid = parallelogram(8, 6, 0, [true, false]);
        let net = Net::new(&laid);
        let cheap = |t: usize, _: usize| if (t / 2) % 8 == 5 { 1.0 } else { 50.0 };
        let seam = Seam::choose(&net, &cheap);
        for side in (0..seam.cut.len()).filter(|&s| seam.cut[s]) {
            let twin = net.twin[side].unwrap();
            assert!((side / 6) % 8 == 5 && (twin / 6) % 8 == 5, "{side}");
        }
    }

    #[test]
    fn removal_takes_whole_rings_of_cones_only() {
        let count = |laid: &[Laid], n| around_cones(laid, n).iter().filter(|r| **r).count();
        let sphere = octahedron(8);
        assert_eq!([0, 4, 16, 7].map(|n| count(&sphere, n)), [0, 24, 96, 42]);
        assert_eq!([0, 4, 16].map(|n| count(&cone(2, 6, 0), n)), [2, 2, 8]);
        assert_eq!(count(&cone(8, 6, 0), 16), 0);
        assert_eq!(count(&cone(6, 6, 0), 16), 0);
        // The rings are those of the vertex: what is left of a cone is the cone with a hole.
        let laid = cone(4, 6, 0);
        let gone = around_cones(&laid, 16);
        assert_eq!(core(&laid, |t| !gone[t]).0.len(), cone(4, 6, 2).len());
    }

    /// One of six surfaces without some of its triangles.
    pub(in crate::linkage) fn with_holes(which: usize, holes: &[u32]) -> Vec<Laid> {
        let laid = match which {
            0 => octahedron(5),
            1 => parallelogram(9, 8, 3, [true, true]),
            2 => cone(8, 6, 0),
            3 => saddle_between_cones(4),
            4 => cone(2, 9, 1),
            _ => double_torus(6),
        };
        let mut keep = vec![true; laid.len()];
        holes
            .iter()
            .for_each(|h| keep[*h as usize % laid.len()] = false);
        core(&laid, |t| keep[t]).0
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..crate::base::cases::cases(40) })]

        /// Whatever is missing from whatever surface: it lies flat.
        #[test]
        fn anything_with_holes_lies_flat(which in 0usize..6, holes in prop::collection::vec(any::<u32>(), 0..60)) {
            let left = with_holes(which, &holes);
            if !left.is_empty() {
                checked(&left);
            }
        }
    }
}
