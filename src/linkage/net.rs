//! The triangles as a surface of their own, without coordinates: sides, nodes, and how the lattice turns around each.
//!
//! Side `s` of triangle `t` has the number 3t + s and runs from corner s to s + 1, the triangle on its left. A *node* is
//! a lattice vertex inside the linkage, or a whole rim shrunk to a point: a seam that reaches a rim may leave it again
//! anywhere, for there the sheet is open already. Unfolding triangles around a node ends where it began, or turned and
//! moved: the node's *holonomy*. Where it is the identity the node is flat, and only nodes that are not need a seam.

use super::clip::Laid;

/// A lattice vertex of the sheet, (i, j).
pub(super) type Spot = (i32, i32);

/// The side that follows in its triangle.
pub(super) fn next(side: usize) -> usize {
    if side % 3 == 2 { side - 2 } else { side + 1 }
}

/// The side before it in its triangle.
pub(super) fn previous(side: usize) -> usize {
    if side.is_multiple_of(3) {
        side + 2
    } else {
        side - 1
    }
}

/// Corners of the triangle beyond `side` from those of the triangle that has it, if `twin` is the same side over there.
pub(super) fn beyond(corners: &[Spot; 3], side: usize, twin: usize) -> [Spot; 3] {
    let (a, b, c) = (
        corners[side % 3],
        corners[next(side) % 3],
        corners[previous(side) % 3],
    );
    let mut there = [(0, 0); 3];
    there[twin % 3] = b;
    there[next(twin) % 3] = a;
    there[previous(twin) % 3] = (a.0 + b.0 - c.0, a.1 + b.1 - c.1);
    there
}

/// Connectivity of a set of triangles.
pub(super) struct Net {
    /// The same side as the neighbour counts it; none on a rim.
    pub twin: Vec<Option<usize>>,
    /// The node at the tail of each side.
    pub node: Vec<usize>,
    /// Sides that leave a node and have a twin; of a vertex counter-clockwise.
    pub leaving: Vec<Vec<usize>>,
    /// Whether the node is a rim.
    pub rim: Vec<bool>,
    /// Whether unfolding around the node ends where it began.
    pub flat: Vec<bool>,
    /// For each side whether the hinge over it has its ligaments; see [`Laid::held`].
    pub held: Vec<bool>,
}

impl Net {
    /// Rims come first among the nodes, then vertices in the order of their first side.
    pub fn new(laid: &[Laid]) -> Self {
        let twin: Vec<Option<usize>> = laid
            .iter()
            .flat_map(|l| l.neighbours.map(|n| n.map(|(t, s)| 3 * t + s)))
            .collect();
        let mut net = Self {
            node: vec![usize::MAX; twin.len()],
            twin,
            leaving: Vec::new(),
            rim: Vec::new(),
            flat: Vec::new(),
            held: laid.iter().flat_map(|l| l.held).collect(),
        };
        for side in 0..net.twin.len() {
            if net.twin[side].is_none() && net.node[side] == usize::MAX {
                net.add_rim(side);
            }
        }
        for side in 0..net.twin.len() {
            if net.node[side] == usize::MAX {
                net.add_vertex(side);
            }
        }
        net
    }

    /// The node at the end of a side.
    pub fn head(&self, side: usize) -> usize {
        self.node[next(side)]
    }

    /// Whether a node is a vertex with more than six triangles: more than fits around a point of the plane.
    pub fn crowded(&self, node: usize) -> bool {
        !self.rim[node] && self.leaving[node].len() > 6
    }

    /// Half of 2 − (nodes − sides + triangles): how many handles, rims filled in.
    pub fn handles(&self) -> usize {
        let sides = self.twin.iter().flatten().count() / 2;
        let euler = (self.leaving.len() + self.twin.len() / 3) as i64 - sides as i64;
        ((2 - euler) / 2).max(0) as usize
    }

    /// The rim side that follows a rim side, and the sides passed on the way, which all leave the vertex between them.
    fn along_rim(&self, side: usize) -> Vec<usize> {
        let mut passed = vec![next(side)];
        let mut at = next(side);
        while let Some(twin) = self.twin[at] {
            at = next(twin);
            passed.push(at);
        }
        passed
    }

    fn add_rim(&mut self, first: usize) {
        let id = self.leaving.len();
        let mut leaving = Vec::new();
        let start = [(0, 0), (1, 0), (0, 1)];
        let (mut side, mut corners) = (first, start);
        loop {
            let passed = self.along_rim(side);
            for &at in &passed {
                self.node[at] = id;
                if let Some(twin) = self.twin[at] {
                    leaving.push(at);
                    corners = beyond(&corners, at, twin);
                }
            }
            side = *passed.last().unwrap_or(&first);
            if side == first {
                break;
            }
        }
        self.leaving.push(leaving);
        self.rim.push(true);
        self.flat.push(corners == start);
    }

    fn add_vertex(&mut self, first: usize) {
        let mut leaving = Vec::new();
        let mut side = first;
        loop {
            self.node[side] = self.leaving.len();
            leaving.push(side);
            // A vertex on a rim was numbered before: every side on the way has a twin.
            side = self.twin[previous(side)].unwrap_or(first);
            if side == first {
                break;
            }
        }
        self.flat.push(leaving.len() == 6);
        self.leaving.push(leaving);
        self.rim.push(false);
    }
}
