//! The figures of a linkage that stands in a file, for a person and for a machine.

use std::collections::BTreeMap;

use nalgebra::Point3;
use serde::Serialize;

use super::verdict::place;
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::linkage::Linkage;
use crate::rationalize::{Freedom, FreedomError, Mobility, Soundness, freedom};

/// What there is to know of a linkage without its surface.
#[derive(Clone, Debug, Serialize)]
pub struct LinkageFigures {
    /// Triangles.
    pub triangles: usize,
    /// Hinges.
    pub hinges: usize,
    /// Those of them that the sheet is cut open at.
    pub seam_hinges: usize,
    /// Points: hinges and free corners.
    pub points: usize,
    /// Points of one triangle only.
    pub free_corners: usize,
    /// Triangles by the number of hinges that they hang by, 0 to 3.
    pub held_by: [usize; 4],
    /// Lattice vertices with triangles all around, by their number: 6, or a cone.
    pub rounds: BTreeMap<usize, usize>,
    /// Triangle edge, millimetres.
    pub edge_mm: f64,
    /// Sides of the box around it in space, millimetres.
    pub box_mm: [f64; 3],
    /// Sides of the box around it closed, millimetres.
    pub sheet_mm: [f64; 2],
    /// Edges, openings, overlaps.
    pub soundness: Soundness,
    /// Degrees of freedom.
    pub freedom: Freedom,
}

impl LinkageFigures {
    /// Measures a linkage at `positions` (millimetres, by point); `sigma` is the largest scale factor that its hinges are
    /// held against.
    ///
    /// # Errors
    /// [`FreedomError`]: memory, interruption.
    pub fn of(
        linkage: &Linkage,
        positions: &[Point3<f64>],
        sigma: f64,
        progress: &dyn Progress,
    ) -> Result<Self, FreedomError> {
        let mut held_by = [0; 4];
        for sides in linkage.neighbours().iter() {
            held_by[sides.iter().flatten().count()] += 1;
        }
        let extent = |of: &mut dyn Iterator<Item = f64>| {
            let (low, high) = of.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
                (a.min(x), b.max(x))
            });
            (high - low).max(0.0)
        };
        let flat = || linkage.triangles.iter().flat_map(|t| t.flat);
        Ok(Self {
            triangles: linkage.triangles.len(),
            hinges: linkage.hinges.len(),
            seam_hinges: linkage.hinges.iter().filter(|h| h.seam).count(),
            points: linkage.point_count(),
            free_corners: linkage.point_count() - linkage.hinges.len(),
            held_by,
            rounds: linkage.rounds(),
            edge_mm: linkage.edge_mm,
            box_mm: [0, 1, 2].map(|k| extent(&mut positions.iter().map(|p| p[k]))),
            sheet_mm: [0, 1].map(|k| extent(&mut flat().map(|p| p[k]))),
            soundness: Soundness::measure(linkage, positions, sigma),
            freedom: freedom(linkage, positions, progress)?,
        })
    }

    /// What it is and what it is made of, a label and a value each.
    pub fn summary(&self) -> Vec<(&'static str, String)> {
        let mut lines = Vec::new();
        let mut say = |what, value: String| lines.push((what, value));
        let [x, y, z] = self.box_mm.map(|s| short(s, 1));
        say("size", format!("{x} × {y} × {z} mm"));
        let [x, y] = self.sheet_mm.map(|s| short(s, 1));
        let pieces = match self.freedom.sheet_pieces {
            1 => String::new(),
            n => format!(", in {n} pieces"),
        };
        say("sheet", format!("{x} × {y} mm closed{pieces}"));
        say(
            "triangles",
            format!("{}, edge {} mm", self.triangles, short(self.edge_mm, 4)),
        );
        let seam = match self.seam_hinges {
            0 => "no seam".to_owned(),
            n => format!("{n} of them across the seam"),
        };
        say("hinges", format!("{}, {seam}", self.hinges));
        say("free corners", self.free_corners.to_string());
        let [none, one, two, _] = self.held_by;
        if none + one + two > 0 {
            let many = [(two, "two"), (one, "one"), (none, "no")].into_iter();
            let held: Vec<String> = many
                .filter(|(n, _)| *n > 0)
                .map(|(n, by)| format!("{n} by {by}"))
                .collect();
            say(
                "held by less",
                format!(
                    "{} hinge{}; the others by three",
                    held.join(", "),
                    if one > 0 && two + none == 0 { "" } else { "s" }
                ),
            );
        }
        if self.freedom.pieces != 1 {
            say("pieces", format!("{}, not joined", self.freedom.pieces));
        }
        let cones: Vec<String> = self
            .rounds
            .iter()
            .filter(|(n, _)| **n != 6)
            .map(|(n, count)| {
                format!(
                    "{count} of {n} triangles ({:+}°)",
                    60 * (6 - i64::try_from(*n).unwrap_or(6))
                )
            })
            .collect();
        if !cones.is_empty() {
            say("cones", cones.join(", "));
        }
        self.say_soundness(&mut say);
        self.say_freedom(&mut say);
        lines
    }

    fn say_soundness(&self, say: &mut dyn FnMut(&'static str, String)) {
        let q = &self.soundness;
        say(
            "edge error",
            format!(
                "{:.1e} L at most, {:.1e} L rms",
                q.edge_error_max, q.edge_error_rms
            ),
        );
        if self.hinges == 0 {
            return;
        }
        let [least, mean, most] = q.opening.map(|s| short(s, 4));
        let at =
            |w: &crate::rationalize::Worst| format!("vertex {} {}", w.point, place(w.at_mm.into()));
        say(
            "openings",
            format!("λ {least} to {most}, {mean} in the mean (1 closed, 2 fully open)"),
        );
        say("σ needed", format!("{most}, at {}", at(&q.opening_max)));
        if q.over_sigma > 0 {
            say(
                "too wide",
                format!(
                    "{} hinges open beyond σ = {}{}",
                    q.over_sigma,
                    short(q.sigma, 4),
                    match q.over_open {
                        0 => String::new(),
                        n => format!(", {n} of them past 180°"),
                    }
                ),
            );
        }
        let mut overlaps = Vec::new();
        if q.penetrations > 0 {
            overlaps.push(format!(
                "the triangles of {} hinges run into each other, the deepest by {} L at {}",
                q.penetrations,
                short(q.penetration_depth.value, 4),
                at(&q.penetration_depth)
            ));
        }
        if q.intersections > 0 {
            overlaps.push(format!(
                "{} pairs of other triangles cross{}",
                q.intersections,
                q.intersection_at
                    .map_or_else(String::new, |w| format!(", one at {}", at(&w)))
            ));
        }
        say(
            "overlaps",
            if overlaps.is_empty() {
                "none".into()
            } else {
                overlaps.join("; ")
            },
        );
    }

    fn say_freedom(&self, say: &mut dyn FnMut(&'static str, String)) {
        let f = &self.freedom;
        let found = |m: &Mobility| {
            let mut text = format!("{} found (rank {})", m.motions, m.rank);
            if m.motions as i64 != m.counted {
                text += &format!(
                    ": {} lengths follow from others, so the count does not hold",
                    m.lengths - m.rank
                );
            }
            if m.nearly > 0 {
                text += &format!(
                    "; uncertain: with the least play in the hinges {} more",
                    m.nearly
                );
            }
            text
        };
        let less = |each: usize, pieces: usize| match pieces {
            1 => each.to_string(),
            n => format!("{each} · {n}"),
        };
        let seam = if self.seam_hinges > 0 {
            ", cut open at its seam"
        } else {
            ""
        };
        say(
            "free, planar",
            format!(
                "B₂ − {} = {} counted (B₂ = {}{seam}), {}",
                less(3, f.sheet_pieces),
                f.sheet.counted,
                f.sheet_b2,
                found(&f.sheet)
            ),
        );
        say(
            "free, in space",
            format!(
                "{} − {} − {} = {} counted, {}",
                f.space.unknowns,
                f.space.lengths,
                less(6, f.pieces),
                f.space.counted,
                found(&f.space)
            ),
        );
        say(
            "free, on a form",
            format!("B₂ = {} counted, {}", f.surface.counted, found(&f.surface)),
        );
    }

    /// What its freedom means for whoever holds it, in a sentence or two.
    pub fn answer(&self) -> String {
        let f = &self.freedom;
        let held = match f.surface.motions {
            0 => "Held to its surface, as on a form, it cannot move.".to_owned(),
            1 => "Held to its surface, as on a form, it can move in one way.".to_owned(),
            n => format!(
                "Held to its surface, as on a form, it can move in {n} ways: about one for each of its {} free corners, so holding its rims holds all of it.",
                self.free_corners
            ),
        };
        match f.space.motions {
            0 => "It is rigid: it cannot move but as a whole.".to_owned(),
            n => format!(
                "Rigid triangles alone leave it {n} motions in space: like cloth, it keeps its shape by the stiffness of its hinges, or on a form.\n{held}"
            ),
        }
    }
}
