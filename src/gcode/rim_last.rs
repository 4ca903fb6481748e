//! The order of a job: a rim sets its part loose, so it comes after everything inside it.

use super::compare::{Kind, Wanted};
use super::coverage::Segment;
use super::finding::{Finding, Rule, place};
use crate::base::plane;
use crate::pattern::Sheet;

/// No rim is begun before everything inside it is done.
pub(super) fn check_order(
    sheet: &Sheet,
    wanted: &Wanted,
    burnt: &[(Option<usize>, Segment)],
    findings: &mut Vec<Finding>,
) {
    // For each cut when it is first and last burnt, as numbers of burnt pieces.
    let mut when: Vec<Option<(usize, usize)>> = vec![None; wanted.cuts.len()];
    let mut near = Vec::new();
    for (n, (_, segment)) in burnt.iter().enumerate() {
        let middle = segment.a.midpoint(segment.b);
        // Only the closest: a rim passes half a kerf from the slits that begin at it, which may be less than the tolerance.
        if let Some(cut) = wanted.closest(middle, &mut near) {
            when[cut] = Some(when[cut].map_or((n, n), |(first, _)| (first, n)));
        }
    }
    let rims: Vec<usize> = (0..wanted.cuts.len())
        .filter(|c| wanted.cuts[*c].kind == Kind::Rim)
        .collect();
    let only_one = sheet.contours.iter().filter(|c| c.outer).count() == 1;
    for (c, cut) in wanted
        .cuts
        .iter()
        .enumerate()
        .filter(|(_, c)| c.kind != Kind::Rim)
    {
        let Some((_, last)) = when[c] else { continue };
        let at = wanted.segments[cut.range.start].a;
        let early = rims.iter().find(|r| {
            let inside = || {
                let of = wanted.cuts[**r].contour.and_then(|n| sheet.contours.get(n));
                of.is_some_and(|contour| {
                    only_one || plane::encloses(&contour.line.flattened(0.01), at)
                })
            };
            when[**r].is_some_and(|(first, _)| first < last) && inside()
        });
        if let Some(rim) = early {
            let first = when[*rim].map_or(0, |w| w.0);
            findings.push(Finding {
                line: burnt.get(first).and_then(|b| b.0),
                rule: Rule::Order,
                text: format!(
                    "the rim is begun before the cut near {} is done: the part may be loose by then",
                    place(at)
                ),
            });
            // One is enough: a rim that comes first is before everything.
            return;
        }
    }
}
