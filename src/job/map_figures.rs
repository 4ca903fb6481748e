//! The figures of a conformal map, for a person and for a machine.

use nalgebra::Point3;
use serde::Serialize;

use super::verdict::place;
use crate::base::units::short;

/// A cone of a map.
#[derive(Clone, Debug, Serialize)]
pub struct ConeFigures {
    /// Vertex of the imported surface, counted from 1; none for one that was made for a point asked for.
    pub vertex: Option<u64>,
    /// Where it is, millimetres.
    pub at_mm: [f64; 3],
    /// Curvature in units of 120°.
    pub units: i32,
}

/// What there is to know of a map. λ counts outside the cones' neighbourhoods, which get no triangles.
#[derive(Clone, Debug, Serialize)]
pub struct MapFigures {
    /// Its cones.
    pub cones: Vec<ConeFigures>,
    /// How far each rim turns on the sheet, degrees; the first too, which takes what the others leave.
    pub rim_turnings_deg: Vec<i64>,
    /// Rims that are straight hems, counted from 1.
    pub straight_rims: Vec<usize>,
    /// Open cuts, each by the points that it passes, millimetres.
    pub darts_mm: Vec<Vec<[f64; 3]>>,
    /// Triangles that each positive cone loses.
    pub remove_at_cone: usize,
    /// The largest stretch allowed.
    pub sigma: f64,
    /// Whether that suffices.
    pub suffices: bool,
    /// Smallest λ.
    pub lambda_min: f64,
    /// Largest λ.
    pub lambda_max: f64,
    /// The stretch that the surface asks for: largest over smallest λ.
    pub lambda_ratio: f64,
    /// Where λ is largest, millimetres.
    pub lambda_max_at_mm: [f64; 3],
    /// Part of the surface's area with λ in [1, σ].
    pub area_inside_sigma: f64,
    /// What the map asks for beyond the sheet, in triangle edges; see
    /// [`ScaleSummary::misfit_mm`](crate::conformal::ScaleSummary::misfit_mm).
    pub misfit_in_l: f64,
    /// Width and height of the layout, millimetres.
    pub layout_mm: [f64; 2],
    /// Area of the layout, mm².
    pub layout_area_mm2: f64,
    /// Triangle edge L, millimetres, before it is fitted to the seams.
    pub edge_mm: f64,
    /// Triangles of that edge that have the layout's area.
    pub triangles: f64,
    /// Angle distortion, 1 if conformal: median over the faces.
    pub quasi_conformal_median: f64,
    /// Angle distortion that one face in a hundred exceeds.
    pub quasi_conformal_99_percent: f64,
    /// Faces too thin for the map.
    pub broken_faces: usize,
    /// The arguments that ask for exactly this map at the same size and σ.
    pub arguments: Vec<String>,
    /// Where the map has no cones and σ does not suffice: the argument for the obvious one.
    pub obvious_cone: Option<String>,
}

impl MapFigures {
    /// The arguments as a shell takes them.
    pub fn command_line(&self) -> String {
        let quoted = |word: &String| match word.contains(';') {
            true => format!("\"{word}\""),
            false => word.clone(),
        };
        self.arguments
            .iter()
            .map(quoted)
            .collect::<Vec<_>>()
            .join(" ")
    }

    /// Whether σ suffices, in words.
    pub fn answer(&self) -> String {
        let (sigma, ratio) = (short(self.sigma, 3), short(self.lambda_ratio, 3));
        if self.suffices {
            return format!("σ = {sigma} suffices: the surface asks for a stretch of {ratio}");
        }
        format!(
            "σ = {sigma} does not suffice: the surface asks for a stretch of {ratio}, and {} % of it lies outside [1, σ]",
            short(100.0 * (1.0 - self.area_inside_sigma), 1),
        )
    }

    /// The cones in a few words.
    pub fn cones_in_words(&self) -> String {
        if self.cones.is_empty() {
            return "none".into();
        }
        let one = |c: &ConeFigures| format!("{:+} at {}", c.units, place(c.at_mm.into()));
        self.cones.iter().map(one).collect::<Vec<_>>().join("; ")
    }

    /// Name and value of what a person asks first.
    pub fn summary(&self) -> Vec<(String, String)> {
        let degrees = |all: &[i64]| {
            let each = all.iter().map(|t| format!("{t}°"));
            each.collect::<Vec<_>>().join(", ")
        };
        let mut lines: Vec<(String, String)> = Vec::new();
        let mut say = |name: &str, value: String| lines.push((name.to_owned(), value));
        say(
            "λ",
            format!(
                "{} to {}, a stretch of {}; largest near {}",
                short(self.lambda_min, 3),
                short(self.lambda_max, 3),
                short(self.lambda_ratio, 3),
                place(Point3::from(self.lambda_max_at_mm)),
            ),
        );
        say(
            "inside [1, σ]",
            format!(
                "{} % of the area; misfit {} L",
                short(100.0 * self.area_inside_sigma, 1),
                short(self.misfit_in_l, 3)
            ),
        );
        say("cones", self.cones_in_words());
        if !self.rim_turnings_deg.is_empty() {
            let mut turnings = degrees(&self.rim_turnings_deg);
            for rim in &self.straight_rims {
                turnings += &format!("; rim {rim} is straight");
            }
            say("rims turn", turnings);
        }
        if !self.darts_mm.is_empty() {
            let ends = |d: &Vec<[f64; 3]>| match (d.first(), d.last()) {
                (Some(a), Some(b)) => format!("{} to {}", place((*a).into()), place((*b).into())),
                _ => String::new(),
            };
            let all: Vec<String> = self.darts_mm.iter().map(ends).collect();
            say("darts", all.join("; "));
        }
        say(
            "layout",
            format!(
                "{} × {} mm, {} cm²",
                short(self.layout_mm[0], 1),
                short(self.layout_mm[1], 1),
                short(self.layout_area_mm2 / 100.0, 1)
            ),
        );
        say(
            "triangles",
            format!(
                "{} of {} mm, about",
                short(self.triangles, 0),
                short(self.edge_mm, 2)
            ),
        );
        let broken = match self.broken_faces {
            0 => String::new(),
            n => format!("; {n} faces are too thin for the map"),
        };
        say(
            "angles",
            format!(
                "distorted by {} in the median, {} at the 99th percentile (1 is conformal){broken}",
                short(self.quasi_conformal_median, 3),
                short(self.quasi_conformal_99_percent, 3)
            ),
        );
        say("arguments", self.command_line());
        lines
    }
}
