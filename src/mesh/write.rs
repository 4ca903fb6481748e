//! Surfaces as OBJ text.
//!
//! Numbers are written with nine decimals (a picometre): the same surface always gives the same bytes.

use std::fmt::Write as _;

use nalgebra::{Point2, Point3};

use super::surface::{Surface, VertexId};
use crate::base::ids::Id as _;
use crate::base::units::fixed;

/// Decimals of every coordinate.
const DECIMALS: usize = 9;

/// OBJ text of `faces` over `positions` (mm, counter-clockwise from outside).
///
/// With `chart`, one flat position for each corner of each face, a `vt` is written for each *different* position
/// (as written, after rounding) of a vertex, so that a corner pair is shared exactly where the chart is not cut
/// there, and faces are `v/vt` pairs. `comment` goes into `#` lines at the top. A `chart` that is shorter than
/// `faces` leaves the remaining faces without `vt`.
pub fn obj_text(
    comment: &str,
    positions: &[Point3<f64>],
    faces: &[[VertexId; 3]],
    chart: Option<&[[Point2<f64>; 3]]>,
) -> String {
    let mut text = String::with_capacity(positions.len() * 48 + faces.len() * 40);
    for line in comment.lines() {
        text.push_str("# ");
        text.push_str(line);
        text.push('\n');
    }
    // Writing into a String cannot fail.
    for p in positions {
        let _ = writeln!(
            text,
            "v {} {} {}",
            fixed(p.x, DECIMALS),
            fixed(p.y, DECIMALS),
            fixed(p.z, DECIMALS)
        );
    }
    let corners = chart.map(|chart| number_corners(positions.len(), faces, chart, &mut text));
    for (i, face) in faces.iter().enumerate() {
        text.push('f');
        for (k, v) in face.iter().enumerate() {
            match corners.as_ref().and_then(|c| c.get(3 * i + k)) {
                Some(vt) => {
                    let _ = write!(text, " {}/{vt}", v.index() + 1);
                }
                None => {
                    let _ = write!(text, " {}", v.index() + 1);
                }
            }
        }
        text.push('\n');
    }
    text
}

/// Writes the `vt` lines and gives each corner its number, counted from 1 in the order of first use.
fn number_corners(
    vertices: usize,
    faces: &[[VertexId; 3]],
    chart: &[[Point2<f64>; 3]],
    text: &mut String,
) -> Vec<u32> {
    // For each vertex a chain of the texts already given out: (text, number, next in chain).
    let mut first: Vec<Option<usize>> = vec![None; vertices];
    let mut given: Vec<(String, Option<usize>)> = Vec::new();
    let mut numbers = Vec::with_capacity(3 * faces.len());
    for (face, places) in faces.iter().zip(chart) {
        for (v, place) in face.iter().zip(places) {
            let here = format!("{} {}", fixed(place.x, DECIMALS), fixed(place.y, DECIMALS));
            let mut known = first.get(v.index()).copied().flatten();
            while let Some(i) = known
                && given[i].0 != here
            {
                known = given[i].1;
            }
            let number = known.unwrap_or_else(|| {
                let _ = writeln!(text, "vt {here}");
                let next = first
                    .get_mut(v.index())
                    .and_then(|slot| slot.replace(given.len()));
                given.push((here, next));
                given.len() - 1
            });
            numbers.push(number as u32 + 1);
        }
    }
    numbers
}

/// OBJ text of a surface, without a chart.
pub fn surface_obj(comment: &str, surface: &Surface) -> String {
    obj_text(comment, surface.positions(), surface.faces(), None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> (Vec<Point3<f64>>, Vec<[VertexId; 3]>) {
        let positions = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]]
            .map(|[x, y]| Point3::new(x, y, -0.0))
            .to_vec();
        (
            positions,
            vec![[0, 1, 2].map(VertexId), [0, 2, 3].map(VertexId)],
        )
    }

    #[test]
    fn corners_share_a_vt_exactly_where_the_chart_is_not_cut() {
        let (positions, faces) = square();
        let flat = |v: VertexId| positions[v.index()].xy();
        let whole: Vec<_> = faces.iter().map(|f| f.map(flat)).collect();
        let text = obj_text("whole", &positions, &faces, Some(&whole));
        assert_eq!(text.lines().filter(|l| l.starts_with("vt ")).count(), 4);
        assert!(text.ends_with("f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"), "{text}");
        let mut cut = whole;
        cut[1][1].x += 5.0;
        let text = obj_text("", &positions, &faces, Some(&cut));
        assert!(text.ends_with("f 1/1 2/2 3/3\nf 1/1 3/4 4/5\n"), "{text}");
        assert!(!text.contains("-0.0"), "no negative zero");
    }

    #[test]
    fn what_is_written_is_read_back_to_the_last_decimal() {
        let positions = vec![
            Point3::new(1.0 / 3.0, -2.0e-4 / 7.0, 1234.5678901234),
            Point3::new(1.0, 0.0, 0.0),
            Point3::new(0.0, 1.0, 0.0),
        ];
        let text = obj_text("a\nb", &positions, &[[0, 1, 2].map(VertexId)], None);
        assert!(text.starts_with("# a\n# b\nv 0.333333333 -0.000028571 1234.567890123\n"));
    }
}
