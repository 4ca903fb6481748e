//! One strip of hinges, to be pulled by two grips.
//!
//! Three rows of triangles, without the two corners that would hang by one hinge. A grip is an arm on the middle row's last
//! triangle with a pad behind it: out of reach of the other triangles however far they turn, and in line with the strip's
//! middle, so that a pull opens all rows alike. Two triangles of one colour carry the gauge's marks: they turn alike, and
//! the way from one to the other grows by λ exactly, as every way of the pattern does.

use kurbo::{Point, Vec2};

use super::Strip;
use crate::base::curve::{Curve, Piece};
use crate::linkage::{Colour, Handedness, Linkage};
use crate::pattern::{Contour, Label, Mark, MarkKind, PatternError, Sheet, SheetOptions};

/// Rows of triangles.
const ROWS: i32 = 3;

/// Hinges are far from what pulls if a strip is at least so many columns long.
const LEAST_COLUMNS: i32 = 5;

/// The gauge's marks are at least this far apart, millimetres: half a millimetre there is 1 %.
const LEAST_GAUGE_MM: f64 = 45.0;

/// A strip's columns at the most: longer ones only use up sheet.
const MOST_COLUMNS: i32 = 40;

/// The other triangles reach an edge's length from the end of the strip when they turn; the pad begins behind that.
const ARM_IN_EDGES: f64 = 1.15;

/// Height of the arm, in edges.
const ARM_HEIGHT: f64 = 0.4;

/// Pad of a grip: width, height, diameter of its hole; millimetres.
const PAD_MM: [f64; 3] = [22.0, 14.0, 6.0];

/// Height of the name, millimetres.
const TEXT_MM: f64 = 4.0;

/// Arms of a gauge mark, in inradii of its triangle.
const MARK_IN_RADII: f64 = 0.35;

impl Strip {
    /// The strip of hinges of this width and edge, with as many columns as its gauge needs; the name is left empty.
    pub fn new(hinge_width_mm: f64, edge_mm: f64) -> Self {
        let columns =
            ((LEAST_GAUGE_MM / edge_mm).ceil() as i32 + 1).clamp(LEAST_COLUMNS, MOST_COLUMNS);
        Self {
            name: String::new(),
            hinge_width_mm,
            edge_mm,
            hinges: linkage(edge_mm, columns).hinges.len() as u32,
            gauge_mm: f64::from(columns - 1) * edge_mm,
        }
    }

    fn columns(&self) -> i32 {
        ((self.gauge_mm / self.edge_mm).round() as i32 + 1).clamp(LEAST_COLUMNS, MOST_COLUMNS)
    }

    /// Its triangles and hinges, closed.
    pub fn linkage(&self) -> Linkage {
        linkage(self.edge_mm, self.columns())
    }

    /// The numbers of the two triangles that carry the gauge's marks, in the middles of them.
    pub fn gauge_triangles(&self) -> [usize; 2] {
        let cells = cells(self.columns());
        [0, self.columns() - 1].map(|i| {
            let cell = (i, 1, Colour::Up);
            cells.iter().position(|c| *c == cell).unwrap_or(0)
        })
    }

    /// Its sheet: slits, rim with grips, holes, name and gauge marks. Engraved marks are crosses; without engraving they are
    /// holes, `engraved` says which.
    ///
    /// # Errors
    /// [`PatternError`] if the hinges are too wide for the triangles.
    pub fn sheet(&self, shapes: &SheetOptions, engraved: bool) -> Result<Sheet, PatternError> {
        let options = SheetOptions {
            hinge_width_mm: self.hinge_width_mm,
            alignment_hole_mm: 0.0,
            ..*shapes
        };
        let linkage = self.linkage();
        let mut sheet = Sheet::new(&linkage, &options)?;
        let pads = self.add_grips(&mut sheet);
        let marks = self.gauge_triangles().map(|t| {
            let [a, b, c] = sheet.triangles[t];
            ((a.to_vec2() + b.to_vec2() + c.to_vec2()) / 3.0).to_point()
        });
        let inradius = self.edge_mm / 12f64.sqrt();
        if engraved {
            let arm = MARK_IN_RADII * inradius;
            for at in marks {
                let line = |d: Vec2| Curve::line(at - d * arm, at + d * arm);
                sheet.marks.push(Mark {
                    kind: MarkKind::Gauge,
                    lines: vec![line(Vec2::new(1.0, 0.0)), line(Vec2::new(0.0, 1.0))],
                    label: None,
                });
            }
            // The name beside the hole, towards the strip.
            let at = pads[0] + Vec2::new(0.2 * PAD_MM[0], 0.0);
            sheet.marks.push(label(&self.name, at, TEXT_MM));
        } else {
            let radius = (MARK_IN_RADII * inradius)
                .min(1.5)
                .max(1.5 * shapes.kerf_mm);
            let holes = marks.map(|at| Contour {
                line: Curve::circle(at, radius, false),
                outer: false,
            });
            sheet.contours.extend(holes);
        }
        Ok(sheet)
    }

    /// Adds both grips to the rim, and their holes; the middles of the pads.
    fn add_grips(&self, sheet: &mut Sheet) -> [Point; 2] {
        let (l, n) = (self.edge_mm, f64::from(self.columns()));
        let lattice = |i: f64, j: f64| Point::new((i + 0.5 * j) * l, j * 0.75f64.sqrt() * l);
        let pads = [
            (lattice(0.0, 2.0), lattice(0.0, 1.0), -1.0),
            (lattice(n, 1.0), lattice(n, 2.0), 1.0),
        ]
        .map(|(from, to, side)| self.add_grip(sheet, from, to, side));
        let holes = pads.map(|pad| Contour {
            line: Curve::circle(pad.1, 0.5 * PAD_MM[2], false),
            outer: false,
        });
        sheet.contours.extend(holes);
        pads.map(|pad| pad.0)
    }

    /// Adds a grip to the side from one lattice vertex to the next, on the strip's left (−1) or right (1): the middles of its
    /// pad and of its hole.
    fn add_grip(&self, sheet: &mut Sheet, from: Point, to: Point, side: f64) -> (Point, Point) {
        let middle = from.midpoint(to);
        // Along the rim: down on the left, up on the right.
        let along = (to - from) / (to - from).hypot();
        let half_arm = 0.5 * ARM_HEIGHT * self.edge_mm;
        let out = Vec2::new(side, 0.0);
        let up = Vec2::new(0.0, 1.0) * along.y.signum();
        // On the rim where the arm begins and ends; its edges are level.
        let rim = |sign: f64| middle + along * (sign * half_arm / along.y.abs());
        let pad_at = middle.x + side * ARM_IN_EDGES * self.edge_mm;
        let near = |sign: f64| Point::new(pad_at, middle.y) + up * (sign * half_arm);
        let half_pad = (0.5 * PAD_MM[1]).max(half_arm);
        let corner = |away: f64, sign: f64| {
            Point::new(pad_at, middle.y) + out * away + up * (sign * half_pad)
        };
        let mut path = vec![rim(-1.0), near(-1.0)];
        if half_pad > half_arm {
            path.push(corner(0.0, -1.0));
        }
        path.extend([corner(PAD_MM[0], -1.0), corner(PAD_MM[0], 1.0)]);
        if half_pad > half_arm {
            path.push(corner(0.0, 1.0));
        }
        path.extend([near(1.0), rim(1.0)]);
        for contour in &mut sheet.contours {
            let mut pieces: Vec<Piece> = Vec::new();
            for piece in contour.line.pieces() {
                let line = Curve::line(piece.from, piece.to);
                let on = |p: Point| {
                    line.pieces().all(|l| {
                        let d = l.to - l.from;
                        ((p - l.from).cross(d) / d.hypot()).abs() < 1e-6 * self.edge_mm
                            && (p - l.from).dot(d) > 0.0
                            && (p - l.to).dot(d) < 0.0
                    })
                };
                if contour.outer && on(path[0]) && on(path[path.len() - 1]) {
                    let whole = [piece.from]
                        .into_iter()
                        .chain(path.clone())
                        .chain([piece.to]);
                    let points: Vec<Point> = whole.collect();
                    pieces.extend(points.windows(2).map(|w| Piece::new(w[0], w[1], 0.0)));
                } else {
                    pieces.push(piece);
                }
            }
            if pieces.len() > contour.line.len() {
                let mut line = Curve::of_pieces(pieces);
                line.vertices.pop();
                line.closed = true;
                contour.line = line;
            }
        }
        let pad = Point::new(pad_at, middle.y) + out * (0.5 * PAD_MM[0]);
        let hole = Point::new(pad_at, middle.y) + out * (PAD_MM[0] - 0.5 * PAD_MM[1]);
        (pad, hole)
    }
}

/// A line of text.
pub(super) fn label(text: &str, at: Point, height_mm: f64) -> Mark {
    Mark {
        kind: MarkKind::Name,
        lines: Vec::new(),
        label: Some(Label {
            text: text.to_owned(),
            at,
            up: Vec2::new(0.0, 1.0),
            height_mm,
        }),
    }
}

fn cells(columns: i32) -> Vec<(i32, i32, Colour)> {
    let mut cells = Vec::new();
    for j in 0..ROWS {
        for i in 0..columns {
            for colour in [Colour::Up, Colour::Down] {
                let corner = [(0, 0, Colour::Up), (columns - 1, ROWS - 1, Colour::Down)];
                if !corner.contains(&(i, j, colour)) {
                    cells.push((i, j, colour));
                }
            }
        }
    }
    cells
}

fn linkage(edge_mm: f64, columns: i32) -> Linkage {
    Linkage::patch(edge_mm, Handedness::Right, &cells(columns))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;
    use crate::base::ids::Id as _;
    use crate::base::progress::Silent;
    use crate::linkage::TriangleId;
    use crate::rationalize::opening_path;

    #[test]
    fn a_strip_has_the_counted_hinges_and_no_triangle_hangs_by_one() {
        for edge in [4.0, 7.0, 12.0, 25.0] {
            let strip = Strip::new(0.8, edge);
            let (linkage, n) = (strip.linkage(), strip.columns());
            assert_eq!(linkage.triangles.len() as i32, 6 * n - 2);
            // Every side but those of the rim is a hinge.
            assert_eq!(strip.hinges as i32, (3 * (6 * n - 2) - (2 * n + 4)) / 2);
            assert_eq!(linkage.hinges.len(), strip.hinges as usize);
            for sides in linkage.neighbours().iter() {
                assert!(sides.iter().flatten().count() >= 2);
            }
            assert!(strip.gauge_mm >= LEAST_GAUGE_MM.min(4.0 * edge));
        }
    }

    #[test]
    fn grips_are_part_of_the_strip_and_keep_out_of_reach() {
        for (edge, kerf) in [(5.0, 0.15), (9.0, 0.2), (25.0, 1.3)] {
            for engraved in [false, true] {
                let strip = Strip {
                    name: "A1".into(),
                    ..Strip::new(0.15 * edge, edge)
                };
                let bare =
                    Sheet::new(&strip.linkage(), &SheetOptions::plain(0.15 * edge, kerf)).unwrap();
                let sheet = strip
                    .sheet(&SheetOptions::plain(1.0, kerf), engraved)
                    .unwrap();
                assert_eq!(sheet.contours.iter().filter(|c| c.outer).count(), 1);
                let holes = if engraved { 2 } else { 4 };
                assert_eq!(sheet.contours.iter().filter(|c| !c.outer).count(), holes);
                let (a, b) = (bare.figures(), sheet.figures());
                assert_eq!(a.slits, b.slits);
                // Pad, and arm up to the slanting side, on either end; less the holes.
                let pad = PAD_MM[0] * PAD_MM[1].max(ARM_HEIGHT * edge);
                let arm = ARM_HEIGHT * edge * ARM_IN_EDGES * edge;
                let gone: f64 = sheet.contours[1..]
                    .iter()
                    .map(|c| c.line.signed_area())
                    .sum();
                let added = b.area_mm2 - a.area_mm2 - gone;
                assert!((added - 2.0 * (pad + arm)).abs() < 1e-6, "{edge}: {added}");
                sheet.check_ligaments().unwrap();
                // No vertex of the strip's end comes within an edge's length of a pad.
                let low = sheet.contours[0].line.bounds().unwrap().x0 + PAD_MM[0];
                assert!(bare.bounds().x0 - low > 0.0);
            }
        }
    }

    #[test]
    fn the_gauge_reads_the_stretch_of_a_strip_that_the_solver_opened() {
        for edge in [7.0, 10.5, 23.5] {
            let strip = Strip::new(0.1 * edge, edge);
            let linkage = strip.linkage();
            let mut closed = vec![Point3::origin(); linkage.point_count()];
            for triangle in linkage.triangles.iter() {
                for (point, flat) in triangle.points.iter().zip(&triangle.flat) {
                    closed[point.index()] = Point3::new(flat.x, flat.y, 0.0);
                }
            }
            let path = opening_path(&linkage, &closed, [1.0, 1.9], 9, 2.0, &Silent).unwrap();
            assert_eq!(path.states.len(), 10);
            for state in &path.states {
                assert!(state.sound());
                let [a, b] = strip.gauge_triangles().map(|t| {
                    let corners = linkage.triangles[TriangleId::from_index(t)].points;
                    corners.iter().fold(Vector3::zeros(), |sum, p| {
                        sum + state.positions[p.index()].coords / 3.0
                    })
                });
                let read = (b - a).norm() / strip.gauge_mm;
                let off = read / state.mean() - 1.0;
                assert!(off.abs() < 0.01, "{edge} mm, {}: {off}", state.mean());
            }
        }
    }
}
