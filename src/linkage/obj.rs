//! `linkage.obj`: one face a rigid triangle, `v` in space, `vt` closed on the sheet.

use std::fmt::Write as _;

use nalgebra::Point3;

use super::Linkage;
use super::read::HEADER;
use crate::base::ids::Id as _;
use crate::base::units::fixed;

/// Decimals written, millimetres: a thousandth of a nanometre, so that edges read back are as exact as they were
/// solved.
const DECIMALS: usize = 12;

/// The linkage as plain OBJ: `v` are the points in millimetres (a vertex of two faces is a hinge, of one a free
/// corner), every face is one triangle counter-clockwise from outside, and the `vt` of each face corner is its closed
/// flat position in millimetres. `positions` holds one entry for each point.
pub fn write_obj(linkage: &Linkage, positions: &[Point3<f64>]) -> String {
    let mut text = String::with_capacity(positions.len() * 64 + linkage.triangles.len() * 160);
    text.push_str(HEADER);
    text.push_str(
        ": f = one rigid triangle, v = position in space (mm), vt = closed on the sheet (mm)\n",
    );
    for p in positions {
        let _ = writeln!(
            text,
            "v {} {} {}",
            fixed(p.x, DECIMALS),
            fixed(p.y, DECIMALS),
            fixed(p.z, DECIMALS)
        );
    }
    for corner in linkage.triangles.iter().flat_map(|t| t.flat) {
        let _ = writeln!(
            text,
            "vt {} {}",
            fixed(corner.x, DECIMALS),
            fixed(corner.y, DECIMALS)
        );
    }
    for (id, t) in linkage.triangles.iter_ids() {
        let first = 3 * id.index() + 1;
        let [a, b, c] = t.points;
        let _ = writeln!(text, "f {a}/{} {b}/{} {c}/{}", first, first + 1, first + 2);
    }
    text
}
