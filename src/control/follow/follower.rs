//! Reported positions, looked up on the way of the job.

use super::Cuts;
use super::path::{Piece, distance};

/// A place on the way: the piece, and how much of it is behind, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Place {
    piece: usize,
    part: f64,
}

impl Place {
    /// What a report that allows it shows.
    fn sighting(self) -> Sighting {
        if self.piece == 0 {
            Sighting::Beginning
        } else {
            Sighting::OnTheWay
        }
    }
}

/// What a report showed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sighting {
    /// The head is on the way.
    OnTheWay,
    /// It is on the first way, from wherever it stood: nothing can be said of that.
    Beginning,
    /// It is nowhere that the lines sent so far could have taken it.
    Astray {
        /// Distance to the nearest place that would be, mm.
        by_mm: f64,
    },
}

/// Follows the head along the [`Cuts`] of a job.
///
/// The invariant: the machine has passed `proven`. A report allows every place on the way, from there to the end of
/// what was sent, that lies within the tolerance of it; the earliest of them is taken. By induction it is never beyond
/// the machine: the machine's own place is always among those allowed. A place counts only once a second report allows
/// it too, so that one damaged figure proves nothing.
#[derive(Clone, Debug)]
pub struct Follower<'a> {
    cuts: &'a Cuts,
    tolerance_mm: f64,
    /// Where the head stood before the job.
    start_mm: Option<[f64; 2]>,
    /// Passed for certain.
    passed: Place,
    /// What the last report allowed, seen from `passed`.
    last: Option<Place>,
    proven: usize,
}

impl<'a> Follower<'a> {
    /// Before the job's first line, the head standing at `start_mm` (work coordinates) if that is known. `tolerance_mm`:
    /// how far a report may be from the way at the most, from rounding, steps of the motors and chords of arcs. Too
    /// large costs a little lag; too small would make the machine's true place one that is not allowed.
    pub fn new(cuts: &'a Cuts, start_mm: Option<[f64; 2]>, tolerance_mm: f64) -> Self {
        Self {
            cuts,
            tolerance_mm,
            start_mm,
            passed: Place {
                piece: 0,
                part: 0.0,
            },
            last: None,
            proven: 0,
        }
    }

    /// Cuts that are made, of the first so many.
    pub fn proven(&self) -> usize {
        self.proven
    }

    /// A report shows the head at `at_mm`, work coordinates, when no more than the first `sent` lines of the job had been
    /// sent.
    pub fn sighted(&mut self, at_mm: [f64; 2], sent: usize) -> Sighting {
        let found = match self.look(at_mm, sent) {
            Ok(found) => found,
            Err(sighting) => {
                self.last = None;
                return sighting;
            }
        };
        if let Some(last) = self.last {
            // Both were looked for from the same place, so the earlier of them holds whichever is damaged.
            let both = if last < found { last } else { found };
            if both > self.passed {
                self.passed = both;
                self.count();
            }
        }
        self.last = Some(found);
        found.sighting()
    }

    /// As [`Follower::sighted`], where reports may be coarser than the tolerance, so that the machine's true place is not
    /// always among those allowed: nothing is proven.
    pub fn looked_up(&mut self, at_mm: [f64; 2], sent: usize) -> Sighting {
        self.last = None;
        self.look(at_mm, sent)
            .map_or_else(|sighting| sighting, Place::sighting)
    }

    /// The first place that a report allows.
    fn look(&mut self, at_mm: [f64; 2], sent: usize) -> Result<Place, Sighting> {
        let end = self.cuts.pieces.partition_point(|p| p.line < sent);
        if self.start_mm.is_none() && self.passed.piece == 0 {
            // From an unknown place the way to the first point may cross anything: only its end can be recognised.
            let first = self.cuts.pieces.first().filter(|_| end > 0);
            if let Some(first) = first.filter(|p| distance(p.to, at_mm) <= self.tolerance_mm) {
                self.start_mm = Some(first.to);
            }
            return Err(Sighting::Beginning);
        }
        if self.passed.piece == end
            && let Some(last) = end.checked_sub(1)
        {
            // Everything sent is done: it waits where that has ended.
            let by_mm = distance(self.piece(last).to, at_mm);
            return Err(if by_mm <= self.tolerance_mm {
                Sighting::OnTheWay
            } else {
                Sighting::Astray { by_mm }
            });
        }
        let mut nearest = f64::INFINITY;
        for k in self.passed.piece..end {
            let least = if k == self.passed.piece {
                self.passed.part
            } else {
                0.0
            };
            match entry(&self.piece(k), at_mm, least, self.tolerance_mm) {
                Ok(part) => return Ok(Place { piece: k, part }),
                Err(by_mm) => nearest = nearest.min(by_mm),
            }
        }
        Err(if self.passed.piece == 0 {
            Sighting::Beginning
        } else {
            Sighting::Astray { by_mm: nearest }
        })
    }

    /// The machine was seen idle after the first `lines` lines had all been acknowledged, and no more had been sent: all
    /// of them are done.
    pub fn rested(&mut self, lines: usize) {
        let piece = self.cuts.pieces.partition_point(|p| p.line < lines);
        let done = Place { piece, part: 0.0 };
        if done > self.passed {
            self.passed = done;
            self.last = None;
            self.count();
        }
    }

    fn count(&mut self) {
        while let Some(cut) = self.cuts.get(self.proven)
            && cut.last_piece < self.passed.piece
        {
            self.proven += 1;
        }
    }

    fn piece(&self, k: usize) -> Piece {
        let mut piece = self.cuts.pieces[k];
        if let (0, Some(start)) = (k, self.start_mm) {
            piece.from = start;
        }
        piece
    }
}

/// The first part of a piece, not before `least`, that lies within the tolerance of a point; else the distance to it.
fn entry(piece: &Piece, point: [f64; 2], least: f64, tolerance_mm: f64) -> Result<f64, f64> {
    if distance(piece.at(least), point) <= tolerance_mm {
        return Ok(least);
    }
    let Some(foot) = piece.foot(point) else {
        return Err(distance(piece.from, point));
    };
    let nearest = foot.clamp(least.min(1.0), 1.0);
    let away = distance(piece.at(nearest), point);
    if away > tolerance_mm {
        return Err(away);
    }
    // Back from the foot by half a chord of the circle round the point.
    let off = distance(piece.at(foot), point);
    let half = (tolerance_mm * tolerance_mm - off * off).max(0.0).sqrt() / piece.length_mm();
    Ok((foot - half).clamp(least.min(1.0), 1.0))
}
