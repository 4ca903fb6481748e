//! A star of slits in as few strokes as its pierces allow.
//!
//! Where the pierce mark is no wider than the kerf, a stroke may begin anywhere: three arms are two strokes. A wider
//! pierce may stand neither at the star's centre, which is a lattice vertex with three ligaments around it, nor at a
//! tip; it goes into the middle of an arm, and from there one stroke runs out to the tip and another one inwards. A
//! tip is never a beginning and each one is an end, and one stroke has to end at the centre: four strokes and two
//! pierces are the fewest for three arms.

use kurbo::Point;

use super::path::ToolpathError;
use crate::base::curve::Curve;
use crate::pattern::Star;

/// The strokes of a star. `pierce_mm` is the diameter of the pierce hole where it is wider than the kerf; strokes then
/// must not be turned round, for each begins with its pierce.
///
/// # Errors
/// [`ToolpathError::NoRoomToPierce`] if an arm is too short for the hole between its ligaments.
pub(super) fn strokes(star: &Star, pierce_mm: Option<f64>) -> Result<Vec<Curve>, ToolpathError> {
    match pierce_mm {
        None => Ok(fine(star)),
        Some(diameter) => wide(star, diameter),
    }
}

/// One curve behind another.
fn joined(parts: impl IntoIterator<Item = Curve>) -> Curve {
    let mut whole = Curve::default();
    for part in parts {
        whole.join(&part);
    }
    whole
}

/// The arc from one arm to another.
fn fillet(star: &Star, from: usize, to: usize) -> Option<Curve> {
    star.fillets.iter().find_map(|([i, j], arc)| {
        if (*i, *j) == (from, to) {
            Some(arc.clone())
        } else if (*i, *j) == (to, from) {
            Some(arc.reversed())
        } else {
            None
        }
    })
}

fn fine(star: &Star) -> Vec<Curve> {
    let out = |n: usize| star.arms[n].outwards();
    let inwards = |n: usize| star.arms[n].outwards().reversed();
    if let (3, [_, _, _]) = (star.arms.len(), star.fillets.as_slice()) {
        let arc = |i, j| fillet(star, i, j).unwrap_or_default();
        return vec![
            joined([inwards(0), arc(0, 1), out(1)]),
            joined([inwards(2), arc(2, 0)]),
            arc(2, 1),
        ];
    }
    let mut strokes = Vec::new();
    for first in (0..star.arms.len()).step_by(2) {
        let second = first + 1;
        if second < star.arms.len() {
            let arc = fillet(star, first, second).unwrap_or_default();
            strokes.push(joined([inwards(first), arc, out(second)]));
        } else {
            strokes.push(out(first));
        }
    }
    strokes.extend(star.spokes.clone());
    strokes
}

fn wide(star: &Star, diameter: f64) -> Result<Vec<Curve>, ToolpathError> {
    let mut halves = Vec::with_capacity(star.arms.len());
    for arm in &star.arms {
        let (low, high) = arm.free_mm;
        if high - low < diameter {
            let at: Point = star.centre + arm.direction * (0.5 * (low + high));
            return Err(ToolpathError::NoRoomToPierce {
                x: at.x,
                y: at.y,
                pierce_mm: diameter,
                room_mm: (high - low).max(0.0),
            });
        }
        halves.push(arm.split(star.centre, 0.5 * (low + high)));
    }
    let mut strokes = Vec::new();
    if !star.fillets.is_empty() {
        // Every arc gets its own way in; each arm is pierced once, in its middle.
        let mut used = vec![false; star.arms.len()];
        for ([i, j], _) in &star.fillets {
            // An arm's inner half leads to one arc only: the other end of the arc is met by its own arm.
            let (from, to) = if used[*i] { (*j, *i) } else { (*i, *j) };
            used[from] = true;
            let arc = fillet(star, from, to).unwrap_or_default();
            strokes.push(joined([halves[from].1.clone(), arc]));
        }
        for (n, (outer, inner)) in halves.iter().enumerate() {
            strokes.push(outer.clone());
            if !used[n] {
                let spokes = star.spokes.clone().map(|s| s.reversed());
                strokes.push(joined([inner.clone()].into_iter().chain(spokes)));
            }
        }
        return Ok(strokes);
    }
    for first in (0..star.arms.len()).step_by(2) {
        let second = first + 1;
        let (outer, inner) = halves[first].clone();
        if second < star.arms.len() {
            strokes.push(joined([inner, star.arms[second].outwards()]));
        } else {
            strokes.push(inner);
        }
        strokes.push(outer);
    }
    Ok(strokes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage};
    use crate::pattern::{Sheet, SheetOptions, Tip};

    #[test]
    fn every_line_of_a_star_is_followed_once_whatever_its_shape_and_pierce() {
        for (tip, corner_radius_mm) in [
            (Tip::Plain, 0.0),
            (Tip::Round { radius_mm: 0.6 }, 0.0),
            (Tip::Teardrop { radius_mm: 0.6 }, 0.9),
        ] {
            let options = SheetOptions {
                tip,
                corner_radius_mm,
                ..SheetOptions::plain(1.0, 0.2)
            };
            let linkage = Linkage::patch(20.0, Handedness::Left, &Linkage::hexagon_cells(3));
            let sheet = Sheet::new(&linkage, &options).unwrap();
            for slits in sheet.slits.chunk_by(|a, b| a.star == b.star) {
                let star = Star::new(slits, &sheet.metadata);
                let wanted: f64 = star.lines().map(|l| l.length()).sum();
                for pierce in [None, Some(2.0)] {
                    let strokes = strokes(&star, pierce).unwrap();
                    let length: f64 = strokes.iter().map(Curve::length).sum();
                    assert!(
                        (length - wanted).abs() < 1e-9,
                        "{tip:?} {pierce:?} {slits:?}"
                    );
                    let count = match (pierce, corner_radius_mm > 0.0, slits.len()) {
                        (None, false, n) => n.div_ceil(2),
                        (None, true, n) => [1, 2, 3][n - 1],
                        (Some(_), false, n) => [2, 2, 4][n - 1],
                        (Some(_), true, n) => [2, 4, 6][n - 1],
                    };
                    assert_eq!(strokes.len(), count, "{tip:?} {pierce:?} {}", slits.len());
                    for (line, pierce) in strokes.iter().filter_map(|l| Some((l.start()?, pierce?)))
                    {
                        let away = line.distance(star.centre);
                        assert!(away >= 0.5 * sheet.metadata.neck_mm() + 0.5 * pierce - 1e-9);
                    }
                }
                assert!(matches!(
                    strokes_error(&star),
                    Some(ToolpathError::NoRoomToPierce { .. })
                ));
            }
        }
    }

    fn strokes_error(star: &Star) -> Option<ToolpathError> {
        strokes(star, Some(19.0)).err()
    }
}
