//! Where the beam goes on to cut: a pierce makes a hole wider than the kerf, and it must not eat what has to hold.

use kurbo::{Point, Vec2};

use super::coverage::{Index, Segment, distance};
use super::finding::{Finding, Rule, TOLERANCE_MM, place};
use super::outside::Outside;
use crate::base::units::short;
use crate::pattern::Sheet;

/// Every pierce hole keeps away from ligaments and, in scrap, from what stays. In the middle of an arm it widens the slit,
/// which is where it may be.
pub(super) fn check_pierces(
    sheet: &Sheet,
    outside: &Outside<'_>,
    starts: &[(Option<usize>, Point)],
    pierce_mm: f64,
    findings: &mut Vec<Finding>,
) {
    let meta = &sheet.metadata;
    let neck = meta.neck_mm();
    let turned = |d: Vec2, angle: f64| {
        let (sin, cos) = angle.sin_cos();
        Vec2::new(cos * d.x - sin * d.y, sin * d.x + cos * d.y)
    };
    // From every tip to where the ligament meets the arms beside it: half a neck from the vertex.
    let mut spans = Vec::with_capacity(2 * sheet.slits.len());
    let mut slits = Vec::with_capacity(sheet.slits.len());
    for slit in &sheet.slits {
        slits.push(Segment {
            a: slit.tail,
            b: slit.tip,
        });
        if slit.through {
            continue;
        }
        let d = slit.tip - slit.tail;
        let Some(d) = (d.hypot() > 0.0).then(|| d / d.hypot()) else {
            continue;
        };
        let vertex = slit.tip + d * neck;
        for side in [-1.0, 1.0] {
            let arm = turned(-d, side * std::f64::consts::FRAC_PI_3);
            spans.push(Segment {
                a: slit.tip,
                b: vertex + arm * (0.5 * neck),
            });
        }
    }
    let (spans, slits) = (Index::new(spans), Index::new(slits));
    let half = 0.5 * pierce_mm;
    let mut near = Vec::new();
    for &(line, at) in starts {
        let spot = Segment { a: at, b: at };
        slits.near(&spot, TOLERANCE_MM, &mut near);
        let on_slit = near
            .iter()
            .any(|n| distance(&spot, &slits.segment(*n)) <= 2.0 * TOLERANCE_MM);
        let room = if on_slit {
            spans.near(&spot, half, &mut near);
            near.iter()
                .map(|n| distance(&spot, &spans.segment(*n)))
                .fold(f64::INFINITY, f64::min)
        } else {
            outside.clearance(at, half)
        };
        if room < half - TOLERANCE_MM {
            let what = if on_slit { "a ligament" } else { "what stays" };
            findings.push(Finding {
                line,
                rule: Rule::Pierce,
                text: format!(
                    "the pierce at {} makes a hole of {} mm, and {what} is {} mm from its middle",
                    place(at),
                    short(pierce_mm, 3),
                    short(room, 3)
                ),
            });
        }
    }
}
