//! The page of a map alone: λ on the layout and on the surface, before there is a linkage.

use std::fmt::Write as _;

use nalgebra::Point3;

use super::text::escape;
use super::{Stretch, foot, head, stretch, summary};
use crate::conformal::Layout;
use crate::mesh::Surface;

/// All that the page shows.
#[derive(Clone, Copy, Debug)]
pub struct MapPage<'a> {
    /// Name of the surface.
    pub title: &'a str,
    /// Whether σ suffices.
    pub suffices: bool,
    /// The same in words.
    pub answer: &'a str,
    /// Name and value, in the order of reading.
    pub summary: &'a [(String, String)],
    /// The surface, millimetres.
    pub surface: &'a Surface,
    /// Its layout; λ is taken from here.
    pub layout: &'a Layout,
    /// Radius around each cone, on the sheet, in which triangles are removed, millimetres; 0 for none.
    pub cone_opening_mm: f64,
    /// The largest λ that the material allows.
    pub sigma: f64,
    /// Where λ is largest, millimetres; ringed.
    pub largest_at: Point3<f64>,
    /// All figures.
    pub figures: &'a serde_json::Value,
}

/// The page as text.
pub fn map_html(page: &MapPage<'_>) -> String {
    let mut out = String::with_capacity(1 << 20);
    head(&mut out, page.title);
    let (class, headline) = if page.suffices {
        ("pass", "✓ The stretch suffices")
    } else {
        ("fail", "✗ The stretch does not suffice")
    };
    let _ = write!(
        out,
        "<section class=\"verdict {class}\"><strong>{headline}</strong>{}<div>1 rings the place of the largest stretch (dashed: behind the object).</div></section>",
        escape(page.answer)
    );
    summary(&mut out, page.summary);
    let places = [(1, page.largest_at)];
    let map = Stretch {
        surface: page.surface,
        layout: page.layout,
        cone_opening_mm: page.cone_opening_mm,
        sigma: page.sigma,
    };
    stretch(&mut out, &map, &places);
    foot(&mut out, page.figures);
    out
}
