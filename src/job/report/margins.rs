//! How much of what the strips allow each hinge keeps.

use std::fmt::Write as _;

use nalgebra::Point3;

use super::views::{self, Named, Style};
use super::{Page, Pose, VIEW_SIZE};
use crate::base::units::short;
use crate::job::picture::{ColourScale, Scene, legend};
use crate::job::strength::HingeMargin;

/// The bound for one surface, and what each hinge keeps of it.
#[derive(Clone, Copy, Debug)]
pub struct Margins<'a> {
    /// The largest opening that the strips allow.
    pub bound: f64,
    /// With which confidence.
    pub confidence: f64,
    /// The hinges, the smallest margin first.
    pub hinges: &'a [HingeMargin],
}

/// Hinges in the table of the tightest.
const SHOWN: usize = 5;

/// Parts of all hinges whose margin is told.
const PARTS: [(f64, &str); 4] = [
    (0.0, "the tightest"),
    (0.01, "1 of 100 keeps less than"),
    (0.1, "1 of 10 keeps less than"),
    (0.5, "half of them keep less than"),
];

pub(super) fn margins(out: &mut String, page: &Page<'_>, pose: &Pose<'_>, around: &[Named]) {
    let Some(margins) = pose.margins else { return };
    if margins.hinges.is_empty() || margins.bound <= 1.0 {
        return;
    }
    // The way from closed to the bound: a ratio of λ alone would show hardly any difference.
    let mut values = vec![0.0; pose.positions.len()];
    for hinge in margins.hinges {
        if let Some(value) = values.get_mut(hinge.point as usize) {
            *value = ((hinge.opening - 1.0) / (margins.bound - 1.0)).max(0.0);
        }
    }
    let scale = ColourScale::distance(1.0);
    let scene = Scene::linkage_by_value(page.linkage, pose.positions, &values, &scale);
    let numbered: Vec<(usize, Point3<f64>)> = margins
        .hinges
        .iter()
        .take(SHOWN)
        .enumerate()
        .filter_map(|(n, m)| Some((n + 1, *pose.positions.get(m.point as usize)?)))
        .collect();
    let rows: String = margins
        .hinges
        .iter()
        .take(SHOWN)
        .enumerate()
        .map(|(n, m)| {
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td></tr>",
                n + 1,
                short(m.opening, 3),
                short(m.margin, 3)
            )
        })
        .collect();
    let last = margins.hinges.len() - 1;
    let parts: String = PARTS
        .iter()
        .map(|(part, words)| {
            let at = &margins.hinges[(part * last as f64) as usize];
            format!("<tr><td>{words}</td><td>{}</td></tr>", short(at.margin, 3))
        })
        .collect();
    let _ = write!(
        out,
        "<section><h2>Margins</h2><p class=\"lead\">How far each hinge is on its way from closed to {}. So far the widest may open, and the others in proportion, by the strips that were pulled and with a confidence of {}. A margin is this over the hinge's own opening; folds between triangles are not in it.</p><div class=\"key\">{}</div><div class=\"grid\">{}</div><table><tr><th>place</th><th>open λ</th><th>margin</th></tr>{rows}</table><table><tr><th>hinges</th><th>margin</th></tr>{parts}</table></section>",
        short(margins.bound, 3),
        margins.confidence,
        legend(&scale, "", "", "beyond what the strips allow"),
        views::figures(
            &scene,
            "margins of the hinges",
            around,
            Style {
                size: VIEW_SIZE,
                shade_mm: 0.0,
            },
            &numbered
        )
    );
}
