//! Cuts in their order, and what they amount to.

use kurbo::Point;

use super::{kerf, order};
use crate::material::CutSetting;
use crate::pattern::{Sheet, Slit};

/// What a cut is for; also the order in which cuts are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// One or two slits of a star.
    Slit,
    /// A hole.
    Inner,
    /// The rim of a part: last, because afterwards the part is loose.
    Outer,
}

/// One stroke of the beam.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// Where the middle of the beam runs, sheet frame, millimetres. A closed cut ends with its first point.
    pub points: Vec<Point>,
    /// What it is for.
    pub role: Role,
    /// Per cent of the machine's full power.
    pub power_percent: f64,
    /// Speed, millimetres per minute.
    pub feed_mm_per_min: f64,
    /// How often it is gone over: an open cut to and fro, a closed one round and round.
    pub passes: u32,
}

impl Cut {
    /// Whether it ends where it begins.
    pub fn is_closed(&self) -> bool {
        self.points.len() > 2 && self.points.first() == self.points.last()
    }

    /// Length of one pass, millimetres.
    pub fn length_mm(&self) -> f64 {
        self.points.windows(2).map(|w| w[0].distance(w[1])).sum()
    }

    /// Where the beam is when all passes are done.
    pub fn end(&self) -> Option<Point> {
        if self.passes.is_multiple_of(2) {
            self.points.first().copied()
        } else {
            self.points.last().copied()
        }
    }

    /// The points of all passes in a row.
    pub fn passes(&self) -> impl Iterator<Item = Point> + '_ {
        let (n, closed) = (self.points.len(), self.is_closed());
        (0..self.passes as usize).flat_map(move |pass| {
            let back = pass % 2 == 1 && !closed;
            // Every pass after the first starts where the one before it ended.
            (usize::from(pass > 0)..n).map(move |i| self.points[if back { n - 1 - i } else { i }])
        })
    }
}

/// All cuts of a sheet, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Toolpath {
    /// The cuts.
    pub cuts: Vec<Cut>,
    /// Where the head is before the first, millimetres.
    pub start: Point,
}

/// What a toolpath amounts to.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Strokes of the beam; each begins with a pierce.
    pub strokes: usize,
    /// Length burnt, all passes, millimetres.
    pub cut_length_mm: f64,
    /// Length travelled with the beam off, from the start to the last cut, millimetres.
    pub travel_mm: f64,
}

/// Why a sheet has no toolpath.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ToolpathError {
    /// The beam does not fit into a hole or a slot.
    #[error(
        "near ({x:.3}, {y:.3}) mm the contour leaves a gap narrower than the kerf of {kerf_mm} mm: the beam does not fit. Use larger triangles, or a finer kerf (--kerf)"
    )]
    NarrowSlot {
        /// Where, millimetres on the sheet.
        x: f64,
        /// Where, millimetres on the sheet.
        y: f64,
        /// The kerf.
        kerf_mm: f64,
    },
}

impl Toolpath {
    /// Lengths and counts.
    pub fn figures(&self) -> Figures {
        let mut at = self.start;
        let mut travel_mm = 0.0;
        for cut in &self.cuts {
            if let (Some(first), Some(end)) = (cut.points.first(), cut.end()) {
                travel_mm += at.distance(*first);
                at = end;
            }
        }
        Figures {
            strokes: self.cuts.len(),
            cut_length_mm: self
                .cuts
                .iter()
                .map(|c| c.length_mm() * f64::from(c.passes))
                .sum(),
            travel_mm,
        }
    }
}

/// The cuts of a sheet with these settings, for a head that starts at `start` (millimetres, frame of the sheet).
///
/// The kerf is the sheet's own: its slits were drawn for it.
///
/// # Errors
/// [`ToolpathError::NarrowSlot`].
pub fn plan(
    sheet: &Sheet,
    setting: &CutSetting,
    start: [f64; 2],
) -> Result<Toolpath, ToolpathError> {
    let start = Point::new(start[0], start[1]);
    let cut = |points: Vec<Point>, role: Role| Cut {
        points,
        role,
        power_percent: setting.power_percent,
        feed_mm_per_min: setting.speed_mm_per_min,
        passes: setting.passes.max(1),
    };
    let strokes = strokes(&sheet.slits);
    let ends: Vec<[Point; 2]> = strokes.iter().map(|s| [s[0], s[s.len() - 1]]).collect();
    // With an even number of passes a stroke ends where it began.
    let returns = setting.passes.is_multiple_of(2);
    let mut cuts = Vec::with_capacity(strokes.len() + sheet.contours.len());
    for (stroke, reversed) in order::order(&ends, start, returns) {
        let mut points = strokes[stroke].clone();
        if reversed {
            points.reverse();
        }
        cuts.push(cut(points, Role::Slit));
    }
    let mut at = cuts.last().and_then(Cut::end).unwrap_or(start);
    for role in [Role::Inner, Role::Outer] {
        let mut loops = Vec::new();
        for contour in sheet
            .contours
            .iter()
            .filter(|c| c.outer == (role == Role::Outer))
        {
            loops.push(kerf::outline(contour, sheet.metadata.kerf_mm)?);
        }
        for points in order::loops(loops, at) {
            at = points[0];
            cuts.push(cut(points, role));
        }
    }
    Ok(Toolpath { cuts, start })
}

/// Slits of one star in as few strokes as that takes: pairs through the centre, the odd one by itself.
fn strokes(slits: &[Slit]) -> Vec<Vec<Point>> {
    let mut strokes = Vec::with_capacity(slits.len());
    for star in slits.chunk_by(|a, b| a.star == b.star) {
        for pair in star.chunks(2) {
            strokes.push(match pair {
                [one, two] => vec![one.tip, one.tail, two.tip],
                _ => vec![pair[0].tail, pair[0].tip],
            });
        }
    }
    strokes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage};

    fn setting(passes: u32) -> CutSetting {
        let machine = crate::machine::load(crate::machine::DEFAULT).unwrap();
        let material = crate::material::load("leather-1.6").unwrap();
        let mut setting = material.cut_for(&machine).unwrap();
        setting.passes = passes;
        setting
    }

    fn ring() -> Sheet {
        let mut cells = Linkage::hexagon_cells(5);
        cells.retain(|c| !Linkage::hexagon_cells(1).contains(c));
        Sheet::new(&Linkage::patch(10.0, Handedness::Right, &cells), 1.0, 0.2).unwrap()
    }

    #[test]
    fn slits_come_before_holes_and_holes_before_rims_and_nothing_is_lost() {
        let sheet = ring();
        for passes in [1, 2, 3] {
            let path = plan(&sheet, &setting(passes), [0.0, 0.0]).unwrap();
            assert!(path.cuts.is_sorted_by_key(|c| c.role));
            let length = |role| {
                path.cuts
                    .iter()
                    .filter(|c| c.role == role)
                    .map(Cut::length_mm)
                    .sum::<f64>()
            };
            assert!((length(Role::Slit) - sheet.figures().slit_length_mm).abs() < 1e-9);
            assert_eq!(
                path.cuts.iter().filter(|c| c.role == Role::Inner).count(),
                1
            );
            let rim = path.cuts.last().unwrap();
            assert!(rim.role == Role::Outer && rim.is_closed());
            let burnt: f64 = path
                .cuts
                .iter()
                .map(|c| {
                    let all: Vec<Point> = c.passes().collect();
                    assert_eq!(
                        all.last().copied(),
                        if c.is_closed() {
                            c.points.last().copied()
                        } else {
                            c.end()
                        }
                    );
                    all.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>()
                })
                .sum();
            assert!((burnt - path.figures().cut_length_mm).abs() < 1e-6);
        }
    }

    #[test]
    fn a_star_of_three_is_two_strokes() {
        let sheet = ring();
        let mut sizes = vec![0usize; sheet.figures().stars];
        for slit in &sheet.slits {
            sizes[slit.star as usize] += 1;
        }
        let path = plan(&sheet, &setting(1), [0.0, 0.0]).unwrap();
        let strokes = path.cuts.iter().filter(|c| c.role == Role::Slit).count();
        assert_eq!(strokes, sizes.iter().map(|n| n.div_ceil(2)).sum::<usize>());
    }
}
