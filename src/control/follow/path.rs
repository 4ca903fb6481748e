//! The way of the head through a job, as one line with a parameter.

use super::NotFollowed;
use crate::control::Job;
use crate::gcode::{self, Beam, Rule};

/// A straight piece of the way; arcs are many.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Piece {
    /// Index of its line in the job.
    pub line: usize,
    /// Where it begins, work coordinates, mm. Of the first piece the same as its end: nobody has said where the head was.
    pub from: [f64; 2],
    /// Where it ends.
    pub to: [f64; 2],
    /// The beam is on along it.
    pub burns: bool,
    /// What it puts into the sheet, power for speed: S word over mm/min.
    pub energy: f64,
}

impl Piece {
    /// Its length, mm.
    pub fn length_mm(&self) -> f64 {
        distance(self.from, self.to)
    }

    /// The point of it at this part, 0 to 1.
    pub fn at(&self, part: f64) -> [f64; 2] {
        std::array::from_fn(|k| self.from[k] + (self.to[k] - self.from[k]) * part)
    }

    /// The part at which the foot of the perpendicular from a point lies, on the piece or beyond it; none for a piece
    /// without length.
    pub fn foot(&self, point: [f64; 2]) -> Option<f64> {
        let d = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        let length_sqr = d[0] * d[0] + d[1] * d[1];
        let along = (point[0] - self.from[0]) * d[0] + (point[1] - self.from[1]) * d[1];
        (length_sqr > 0.0).then(|| along / length_sqr)
    }
}

/// Between two points, mm.
pub(crate) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// All pieces of a job, in the order of its lines.
///
/// # Errors
/// [`NotFollowed`] for the first line of which the interpreter cannot say what it does.
pub(super) fn pieces(job: &Job) -> Result<Vec<Piece>, NotFollowed> {
    // Units and distances are what a controller starts with, unless the job says otherwise.
    let mut text = String::from("G21G90\n");
    for (line, _) in job.lines() {
        text.push_str(line);
        text.push('\n');
    }
    // Lines of the text are counted from 1, and one was put before the job's.
    let index = |line: usize| line.saturating_sub(2);
    let program = gcode::read_as(&text, job.dialect());
    if let Some(finding) = program
        .findings
        .iter()
        .find(|f| matches!(f.rule, Rule::Syntax | Rule::Modes))
    {
        return Err(NotFollowed {
            line: finding
                .line
                .and_then(|line| job.line(index(line)))
                .map_or(0, |(_, number)| number),
            why: finding.text.clone(),
        });
    }
    Ok(program
        .moves
        .iter()
        .map(|m| {
            let to = [m.to.x, m.to.y];
            Piece {
                line: index(m.line),
                from: m.from.map_or(to, |p| [p.x, p.y]),
                to,
                // A burning move from an unknown place could not be told from one that burns nothing.
                burns: m.burns() && m.beam != Beam::Off,
                energy: if m.feed_mm_per_min > 0.0 {
                    m.power / m.feed_mm_per_min
                } else {
                    0.0
                },
            }
        })
        .collect())
}
