//! Whether a sheet that somebody edited still has hinges as wide as it says.
//!
//! Beside every slit, material as wide as a hinge must stay: between its tip and all other cuts, and between its sides
//! and the slits of other stars. Sheets that come from a linkage are so by construction.

use kurbo::Point;
use rstar::primitives::{GeomWithData, Line};
use rstar::{AABB, RTree};

use super::sheet::{PatternError, Sheet};
use crate::base::plane;

/// What rounding in a file may take away, millimetres.
const ROUNDING_MM: f64 = 0.003;

/// Contours as chords, millimetres.
const CHORD_MM: f64 = 0.0005;

type Indexed = GeomWithData<Line<[f64; 2]>, u32>;

fn indexed(a: Point, b: Point, n: usize) -> Indexed {
    GeomWithData::new(Line::new([a.x, a.y], [b.x, b.y]), n as u32)
}

fn ends(line: &Indexed) -> [Point; 2] {
    let line = line.geom();
    [line.from, line.to].map(|p| Point::new(p[0], p[1]))
}

/// The box around a segment, larger by `room` on each side.
fn around([a, b]: [Point; 2], room: f64) -> AABB<[f64; 2]> {
    AABB::from_corners(
        [a.x.min(b.x) - room, a.y.min(b.y) - room],
        [a.x.max(b.x) + room, a.y.max(b.y) + room],
    )
}

/// Where two segments cross, if they do.
fn crossing([a, b]: [Point; 2], [c, d]: [Point; 2]) -> Option<Point> {
    let (u, v) = (b - a, d - c);
    let area = u.cross(v);
    // Slits on one line of the lattice: what lies between is told by their ends.
    if area.abs() <= 1e-9 * u.hypot() * v.hypot() {
        return None;
    }
    let (s, t) = ((c - a).cross(v) / area, (c - a).cross(u) / area);
    ((0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t)).then(|| a.lerp(b, s))
}

/// Distance of two segments, and where the first is nearest to the other.
fn apart(s: [Point; 2], t: [Point; 2]) -> (f64, Point) {
    if let Some(at) = crossing(s, t) {
        return (0.0, at);
    }
    let nearest = |p: Point| s[0].lerp(s[1], plane::nearest_part(s[0], s[1], p));
    [
        (plane::from_segment(s[0], t[0], t[1]), s[0]),
        (plane::from_segment(s[1], t[0], t[1]), s[1]),
        (plane::from_segment(t[0], s[0], s[1]), nearest(t[0])),
        (plane::from_segment(t[1], s[0], s[1]), nearest(t[1])),
    ]
    .into_iter()
    .fold((f64::INFINITY, s[0]), |a, b| if b.0 < a.0 { b } else { a })
}

impl Sheet {
    /// Marks the slits that have no hinge: their tip lies on a contour, within half a kerf.
    pub(super) fn find_through(&mut self) {
        let near = 0.5 * self.metadata.kerf_mm;
        let rim = RTree::bulk_load(self.edges());
        for slit in &mut self.slits {
            let at = around([slit.tip, slit.tip], near);
            slit.through = rim.locate_in_envelope_intersecting(at).any(|edge| {
                let [a, b] = ends(edge);
                plane::from_segment(slit.tip, a, b) <= near
            });
        }
    }

    /// The contours' chords.
    fn edges(&self) -> Vec<Indexed> {
        let mut edges = Vec::new();
        for contour in &self.contours {
            let points = contour.line.flattened(CHORD_MM);
            for (i, a) in points.iter().enumerate() {
                edges.push(indexed(*a, points[(i + 1) % points.len()], i));
            }
        }
        edges
    }

    /// Checks that everything beside the slits is as wide as the hinges should be.
    ///
    /// # Errors
    /// [`PatternError::Thin`] with the first place where it is not.
    pub fn check_ligaments(&self) -> Result<(), PatternError> {
        let meta = &self.metadata;
        let half = 0.5 * meta.kerf_mm;
        let tip = meta.tip.radius_mm(meta.kerf_mm);
        let thin = |at: Point, width_mm: f64, other: &'static str| PatternError::Thin {
            x: at.x,
            y: at.y,
            width_mm: width_mm.max(0.0),
            hinge_width_mm: meta.hinge_width_mm,
            other,
        };
        let narrow = |width: f64| width < meta.hinge_width_mm - ROUNDING_MM;
        let slits: Vec<Indexed> = self
            .slits
            .iter()
            .enumerate()
            .map(|(n, s)| indexed(s.tail, s.tip, n))
            .collect();
        let tree = RTree::bulk_load(slits);
        let room = meta.hinge_width_mm + 2.0 * tip.max(half);
        for (n, slit) in self.slits.iter().enumerate().filter(|(_, s)| !s.through) {
            let own = [slit.tail, slit.tip];
            for near in tree.locate_in_envelope_intersecting(around(own, room)) {
                let m = near.data as usize;
                if m == n {
                    continue;
                }
                let other = &self.slits[m];
                let line = ends(near);
                let mut least = (
                    plane::from_segment(slit.tip, line[0], line[1]) - tip - half,
                    slit.tip,
                );
                let tips = slit.tip.distance(other.tip) - 2.0 * tip;
                if tips < least.0 && !other.through {
                    least.0 = tips;
                }
                if other.star != slit.star {
                    let (distance, at) = apart(own, line);
                    if distance - meta.kerf_mm < least.0 {
                        least = (distance - meta.kerf_mm, at);
                    }
                }
                if narrow(least.0) {
                    return Err(thin(least.1, least.0, "another slit"));
                }
            }
        }
        let tree = RTree::bulk_load(self.edges());
        // A slit on the rim begins there; where corners are rounded, a little outside.
        let begin = 2.0 * (meta.kerf_mm + meta.corner_radius_mm);
        for slit in self.slits.iter().filter(|s| !s.through) {
            let own = [slit.tail, slit.tip];
            for near in tree.locate_in_envelope_intersecting(around(own, room)) {
                let line = ends(near);
                let width = plane::from_segment(slit.tip, line[0], line[1]) - tip;
                if narrow(width) {
                    return Err(thin(slit.tip, width, "the contour"));
                }
                if let Some(at) = crossing(own, line).filter(|at| at.distance(slit.tail) > begin) {
                    return Err(thin(at, 0.0, "the contour"));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use kurbo::Vec2;

    use super::*;
    use crate::linkage::{Flaps, Handedness, Linkage, cone_with_flaps, cylinder_with_flaps};
    use crate::pattern::{SheetOptions, Slit, Tip, read_svg, svg};

    fn sheets() -> Vec<Sheet> {
        let hexagon = Linkage::patch(9.0, Handedness::Right, &Linkage::hexagon_cells(4));
        let mut all = Vec::new();
        for (linkage, flaps) in [
            (hexagon, Flaps::default()),
            cylinder_with_flaps(8.0, 9, 5),
            cone_with_flaps(8.0, 4, 5, 1),
            cone_with_flaps(8.0, 8, 5, 0),
        ] {
            for (tip, corner_radius_mm) in [
                (Tip::Plain, 0.0),
                (Tip::Plain, 0.8),
                (Tip::Round { radius_mm: 0.4 }, 0.5),
                (Tip::Teardrop { radius_mm: 0.3 }, 0.0),
            ] {
                let options = SheetOptions {
                    tip,
                    corner_radius_mm,
                    ..SheetOptions::plain(0.8, 0.2)
                };
                all.push(Sheet::with_flaps(&linkage, &flaps, &options).unwrap());
            }
        }
        all
    }

    #[test]
    fn sheets_are_as_wide_as_they_say_also_after_they_were_written() {
        for sheet in sheets() {
            sheet.check_ligaments().unwrap();
            read_svg(&svg(&sheet)).unwrap().check_ligaments().unwrap();
        }
    }

    #[test]
    fn a_slit_that_was_moved_made_longer_or_added_is_found_with_its_place() {
        let thin = |sheet: &Sheet, near: Point| match sheet.check_ligaments() {
            Err(PatternError::Thin { x, y, width_mm, .. }) => {
                assert!(
                    near.distance(Point::new(x, y)) < 8.0,
                    "({x}, {y}) and {near}"
                );
                width_mm
            }
            other => panic!("{other:?}"),
        };
        for sheet in sheets() {
            for n in (0..sheet.slits.len()).step_by(7) {
                let slit = sheet.slits[n];
                let along = (slit.tip - slit.tail).normalize();
                // Longer by a third of a millimetre: the ligament is at 60° to the slit, on the rim a little wider.
                let mut edited = sheet.clone();
                edited.slits[n].tip += along * 0.3;
                let width = thin(&edited, slit.tip);
                assert!(width < sheet.metadata.hinge_width_mm - 0.05, "{width}");
                // Shorter is well.
                let mut edited = sheet.clone();
                edited.slits[n].tip -= along * 0.5;
                edited.check_ligaments().unwrap();
                // Deleted is well, too: nothing else gets narrower.
                let mut edited = sheet.clone();
                edited.slits.remove(n);
                edited.check_ligaments().unwrap();
                // One more, through the middle of triangles and across its slit.
                let mut edited = sheet.clone();
                let middle = slit.tail.midpoint(slit.tip);
                let across = Vec2::new(-along.y, along.x);
                edited.slits.push(Slit {
                    tail: middle - across,
                    tip: middle + across,
                    star: u32::MAX,
                    flap: false,
                    through: false,
                });
                assert_eq!(thin(&edited, middle), 0.0);
            }
        }
    }

    #[test]
    fn a_slit_across_the_rim_is_refused() {
        let mut sheet = sheets().remove(0);
        let rim = sheet.contours[0].line.pieces().next().unwrap();
        let out = rim.direction(0.5);
        let out = Vec2::new(out.y, -out.x);
        let middle = rim.at(0.4);
        sheet.slits.clear();
        sheet.slits.push(Slit {
            tail: middle - out * 3.0,
            tip: middle + out * 3.0,
            star: 0,
            flap: false,
            through: false,
        });
        let text = sheet.check_ligaments().unwrap_err().to_string();
        assert!(text.contains("the contour"), "{text}");
    }
}
