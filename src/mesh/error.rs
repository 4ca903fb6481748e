//! What can be wrong with a surface file, in words for whoever has to mend it.

/// Why a file does not become a surface: which file, where in it, and what.
#[derive(Debug)]
pub struct ImportError {
    /// The file, or the name of what was read.
    pub file: String,
    /// The line, counted from 1, where the format has lines.
    pub line: Option<usize>,
    /// What is wrong and what to do.
    pub problem: Problem,
}

impl std::fmt::Display for ImportError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl std::error::Error for ImportError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.problem)
    }
}

/// What is wrong with a surface file. Vertices and faces are counted from 1 in the order of the file.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The operating system refused.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// Neither content nor name tells a format.
    #[error("is no mesh that kagome reads: OBJ, STL and PLY are")]
    UnknownFormat,
    /// A number cannot be used.
    #[error("{text:?} is not a finite number; coordinates must be")]
    NotANumber {
        /// As it stands there.
        text: String,
    },
    /// A coordinate is NaN or infinite, in a binary file.
    #[error(
        "vertex {vertex} has a coordinate that is not a finite number; delete the vertex, or export again as text to find it"
    )]
    NotFinite {
        /// The vertex.
        vertex: usize,
    },
    /// A vertex has fewer than three coordinates.
    #[error("a vertex needs three coordinates; {found} found")]
    ShortVertex {
        /// How many there are.
        found: usize,
    },
    /// A face names something that is no vertex.
    #[error("face {face} names vertex {text:?}, but the file has {vertices} vertices")]
    BadIndex {
        /// The face.
        face: usize,
        /// What it names.
        text: String,
        /// Vertices in the file.
        vertices: usize,
    },
    /// The format's reader gave up.
    #[error("cannot be read as {format}: {reason}")]
    Syntax {
        /// The format.
        format: &'static str,
        /// Its reader's reason.
        reason: String,
    },
    /// The file has no face.
    #[error("has no faces: a surface of triangles or polygons is needed, not points or curves")]
    Empty,
    /// A polygon crosses itself or has no area.
    #[error(
        "face {face} has {corners} corners and cannot be divided into triangles: it crosses itself or has no area; triangulate it in the modelling program"
    )]
    BadPolygon {
        /// The face.
        face: usize,
        /// Its corners.
        corners: usize,
    },
    /// A triangle with three different corners has no area.
    #[error(
        "face {face} (vertices {a}, {b}, {c}) has no area: its corners lie on one line; merge or dissolve it in the modelling program ({count} such faces)"
    )]
    FlatFace {
        /// The first such face.
        face: usize,
        /// A corner.
        a: usize,
        /// A corner.
        b: usize,
        /// A corner.
        c: usize,
        /// How many there are.
        count: usize,
    },
    /// An edge has more than two faces.
    #[error(
        "is not manifold: the edge between vertices {tail} and {head} has {faces} faces (one is face {face}), and a surface has two at the most (such edges: {count}); delete the extra faces (Blender: Select > All by Trait > Non Manifold)"
    )]
    NotManifoldEdge {
        /// One end.
        tail: usize,
        /// The other end.
        head: usize,
        /// Faces on that edge.
        faces: usize,
        /// One of them.
        face: usize,
        /// Such edges in all.
        count: usize,
    },
    /// Faces touch in a single point.
    #[error(
        "is not manifold: at vertex {vertex}, {fans} groups of faces touch in that one point only; split the vertex or delete one group"
    )]
    NotManifoldVertex {
        /// The vertex.
        vertex: usize,
        /// Groups of faces around it.
        fans: usize,
    },
    /// The surface has one side, like a Möbius band.
    #[error(
        "has no outside: going round from face to face, face {face} would have to be turned both ways, as on a Möbius band; cut it open there"
    )]
    NotOrientable {
        /// The face at which it shows.
        face: usize,
    },
    /// There are several parts, and one is wanted.
    #[error(
        "has {count} parts that are not joined, of {sizes} faces{also}; add --part largest to use the largest alone, or join them in the modelling program"
    )]
    SeveralParts {
        /// How many.
        count: usize,
        /// Their faces, the largest first.
        sizes: String,
        /// What else is wrong, if something is.
        also: String,
    },
    /// A unit, scale or size is no positive number.
    #[error("{what} {value} cannot be used: it must be a positive number")]
    BadScale {
        /// Which option.
        what: &'static str,
        /// As given.
        value: f64,
    },
    /// The surface is too small or too large to be meant in these units.
    #[error("is {} mm long at its longest side, which is {}; say what a unit of the file is with --unit mm|cm|m|in, or how long the longest side should be with --size MM", length(*longest_mm), if *longest_mm < 1.0 { "less than 1 mm" } else { "more than 20 m" })]
    OddSize {
        /// The longest side of its box in millimetres.
        longest_mm: f64,
    },
    /// The triangles do not form a surface for a reason not foreseen above.
    #[error("is no surface: {0}")]
    Topology(#[from] super::surface::TopologyError),
}

/// A length for reading: four decimals, or powers of ten where they would show nothing.
fn length(mm: f64) -> String {
    if (1e-3..1e7).contains(&mm) {
        crate::base::units::short(mm, 4)
    } else {
        format!("{mm:.3e}")
    }
}
