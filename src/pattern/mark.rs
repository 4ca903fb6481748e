//! What is engraved on a sheet: labels of seams, cones, the sheet's name, its front side.

use kurbo::{Point, Vec2};

use super::font;
use crate::base::curve::Curve;

/// What a mark is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MarkKind {
    /// A letter and a number at a seam, with an arrow: A1 meets A1.
    Seam,
    /// A cone singularity.
    Cone,
    /// The sheet's name.
    Name,
    /// Which side is outside.
    Side,
    /// Where the stretch of a strip is read, or the scale for it.
    Gauge,
}

impl MarkKind {
    /// All kinds with the names that drawings give them.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Seam, "seam"),
        (Self::Cone, "cone"),
        (Self::Name, "name"),
        (Self::Side, "side"),
        (Self::Gauge, "gauge"),
    ];
}

/// A line of text. It stays readable when a sheet is mirrored.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Capital letters, digits and what else the font has.
    pub text: String,
    /// The middle of the text, millimetres.
    pub at: Point,
    /// Which way is up, of length 1.
    pub up: Vec2,
    /// Height of a capital letter, millimetres.
    pub height_mm: f64,
}

/// One thing that is engraved.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// What for.
    pub kind: MarkKind,
    /// Lines as they are: arrows, crosses.
    pub lines: Vec<Curve>,
    /// Text.
    pub label: Option<Label>,
}

impl Mark {
    /// All its lines, those of the text with them, in the frame of the sheet.
    pub fn strokes(&self) -> Vec<Curve> {
        let mut all = self.lines.clone();
        if let Some(label) = &self.label {
            all.extend(font::lines(label));
        }
        all
    }

    /// The mark after a motion of the plane; `mirrors` says that the motion turns left into right.
    pub(super) fn moved(&self, motion: impl Fn(Point) -> Point, mirrors: bool) -> Self {
        let label = self.label.as_ref().map(|label| Label {
            at: motion(label.at),
            up: motion(label.at + label.up) - motion(label.at),
            ..label.clone()
        });
        Self {
            kind: self.kind,
            lines: self
                .lines
                .iter()
                .map(|l| l.moved(&motion, mirrors))
                .collect(),
            label,
        }
    }
}
