//! What a job cuts, piece by piece: the units that are proved, counted and resumed.

use super::NotFollowed;
use super::path::{Piece, distance, pieces};
use crate::control::Job;

/// A stroke that puts less than this part of what the job's strongest does into the sheet is engraved, not cut. Cuts of one
/// job differ by a third where small holes are cut slowly; marks of shipped profiles are below a tenth.
const ENGRAVED_PART: f64 = 0.25;
/// No slit is as short as this, mm; hatches, dots and the strokes of letters are.
const SPECK_MM: f64 = 1.0;
/// Engraved strokes and specks that lie closer than this, mm, may be one mark.
const NEIGHBOUR_MM: f64 = 5.0;
/// A mark takes no further stroke once its way is so long, mm: about a label. Measured on a sheet of labels (12 strokes in
/// 8 mm) and slits: with at most one unconfirmed cut, strokes one by one cost 8.9 % of the time, labels 4.9 %; from two on
/// neither costs anything. Hatches of dots would be worse, and fill the journal.
const MARK_MM: f64 = 10.0;

/// One thing that is cut: a stretch with the beam on from where it is lit to where it goes out. Strokes of engraving and
/// specks that follow each other closely are one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// The first of its lines, as an index in the job: the one after the way to its beginning. Lines that only set
    /// something (power, feed, the beam's mode) before the first burning one belong to it.
    pub first_line: usize,
    /// The line that ends it.
    pub last_line: usize,
    /// Where it begins, work coordinates, mm.
    pub start_mm: [f64; 2],
    /// Length burnt, mm.
    pub length_mm: f64,
    /// Stretches with the beam on: 1, or those of a mark.
    pub strokes: usize,
    pub(super) first_piece: usize,
    pub(super) last_piece: usize,
}

/// The cuts of a job and the whole way of the head.
#[derive(Clone, Debug, PartialEq)]
pub struct Cuts {
    pub(super) pieces: Vec<Piece>,
    cuts: Vec<Cut>,
}

impl Cuts {
    /// The cuts of a job, in its order.
    ///
    /// # Errors
    /// [`NotFollowed`]: the job has a line of which nobody can say where it takes the head.
    pub fn of(job: &Job) -> Result<Self, NotFollowed> {
        let pieces = pieces(job)?;
        let cuts = marked(&pieces, &stretches(&pieces));
        Ok(Self { pieces, cuts })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.cuts.len()
    }

    /// True for a job that burns nothing.
    pub fn is_empty(&self) -> bool {
        self.cuts.is_empty()
    }

    /// The `k`th, from 0.
    pub fn get(&self, k: usize) -> Option<&Cut> {
        self.cuts.get(k)
    }

    /// All of them, in order.
    pub fn iter(&self) -> impl Iterator<Item = &Cut> {
        self.cuts.iter()
    }

    /// How many of the job's lines may be sent while all cuts from this one on must wait.
    pub(crate) fn lines_before(&self, cut: usize) -> usize {
        self.cuts.get(cut).map_or(usize::MAX, |c| c.first_line)
    }

    /// The line of the first motion of a cut.
    pub(crate) fn line_of_first_move(&self, cut: usize) -> Option<usize> {
        let first = self.cuts.get(cut)?;
        Some(self.pieces[first.first_piece].line)
    }

    /// Energy of every burning piece, S over mm/min, from this cut on.
    #[cfg(test)]
    pub(crate) fn burns_from(&self, cut: usize) -> impl Iterator<Item = f64> + '_ {
        let first = self.cuts[cut].first_piece;
        let rest = self.pieces[first..].iter();
        rest.filter(|p| p.burns).map(|p| p.energy)
    }

    /// [`Cuts::burns_from`] the first.
    #[cfg(test)]
    pub(crate) fn burns(&self) -> impl Iterator<Item = f64> + '_ {
        self.burns_from(0)
    }

    /// Whether a head that stands at this place has been left there by lines that ran to their end, of those from the one
    /// cut up to the other: it is where one of them ends. Anywhere else on their way it was stopped by something.
    pub(crate) fn leaves_head_at(
        &self,
        at_mm: [f64; 2],
        (first, end): (usize, usize),
        tolerance_mm: f64,
    ) -> bool {
        let from = match first.checked_sub(1) {
            Some(before) => self.cuts.get(before).map_or(0, |c| c.last_piece),
            None => 0,
        };
        let end = self.lines_before(end);
        let rest = &self.pieces[from..];
        let ends = |k: usize| rest.get(k + 1).is_none_or(|next| next.line != rest[k].line);
        rest.iter()
            .enumerate()
            .take_while(|(_, p)| p.line < end)
            .any(|(k, p)| ends(k) && distance(p.to, at_mm) <= tolerance_mm)
    }

    /// The same without the first cuts, after `lead` lines that take the place of all lines before the first one left.
    /// The way begins with a move to its beginning, which is line `travel` of those.
    pub(crate) fn starting_at_cut(&self, cut: usize, lead: usize, travel: usize) -> Option<Self> {
        let first = self.cuts.get(cut)?;
        let line = |line: usize| line - first.first_line + lead;
        let mut pieces = vec![Piece {
            line: travel,
            from: first.start_mm,
            to: first.start_mm,
            burns: false,
            energy: 0.0,
        }];
        pieces.extend(self.pieces[first.first_piece..].iter().map(|p| Piece {
            line: line(p.line),
            ..*p
        }));
        let piece = |piece: usize| piece - first.first_piece + 1;
        let cuts = self.cuts[cut..]
            .iter()
            .map(|c| Cut {
                first_line: line(c.first_line),
                last_line: line(c.last_line),
                first_piece: piece(c.first_piece),
                last_piece: piece(c.last_piece),
                ..*c
            })
            .collect();
        Some(Self { pieces, cuts })
    }
}

/// First and last piece of each stretch with the beam on that burns anything.
fn stretches(pieces: &[Piece]) -> Vec<(usize, usize)> {
    let mut stretches: Vec<(usize, usize)> = Vec::new();
    for (k, piece) in pieces.iter().enumerate() {
        match stretches.last_mut() {
            _ if !piece.burns => {}
            Some((_, last)) if *last + 1 == k => *last = k,
            _ => stretches.push((k, k)),
        }
    }
    // A move to where the head stands is dropped by the controller, and burns nothing under M4.
    stretches.retain(|&(a, b)| length(&pieces[a..=b]) > 0.0);
    stretches
}

fn length(pieces: &[Piece]) -> f64 {
    pieces.iter().map(Piece::length_mm).sum()
}

/// The stretches as cuts, those of marks taken together.
fn marked(pieces: &[Piece], stretches: &[(usize, usize)]) -> Vec<Cut> {
    let energy = |&(a, b): &(usize, usize)| {
        pieces[a..=b]
            .iter()
            .map(|p| p.energy)
            .fold(0.0f64, f64::max)
    };
    let strongest = stretches.iter().map(energy).fold(0.0f64, f64::max);
    let mut cuts: Vec<Cut> = Vec::new();
    // The way of the last mark, if it may take another stroke.
    let mut open: Option<f64> = None;
    for stretch in stretches {
        let &(a, b) = stretch;
        let length_mm = length(&pieces[a..=b]);
        let light = energy(stretch) < ENGRAVED_PART * strongest || length_mm < SPECK_MM;
        if let (true, Some(way), Some(mark)) = (light, open, cuts.last_mut()) {
            let travel = distance(pieces[mark.last_piece].to, pieces[a].from);
            if travel <= NEIGHBOUR_MM && way < MARK_MM {
                mark.last_line = pieces[b].line;
                mark.last_piece = b;
                mark.length_mm += length_mm;
                mark.strokes += 1;
                open = Some(way + travel + length_mm);
                continue;
            }
        }
        open = light.then_some(length_mm);
        cuts.push(Cut {
            first_line: a.checked_sub(1).map_or(0, |before| pieces[before].line + 1),
            last_line: pieces[b].line,
            start_mm: pieces[a].from,
            length_mm,
            strokes: 1,
            first_piece: a,
            last_piece: b,
        });
    }
    cuts
}
