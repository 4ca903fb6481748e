//! Where a sheet lies on the bed.
//!
//! As it is if it fits; else turned by 90°; else in the direction in which the box around it is smallest, for a long
//! sheet may fit along the diagonal.

use kurbo::{Point, Rect};

use super::sheet::{PatternError, Sheet, check_width};
use crate::machine::Machine;

/// From the frame of a sheet to its place on the bed: mirrored or not, turned, then shifted. Apply it to everything that
/// shares the sheet's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// X is negated first: the sheet is cut from its back.
    pub mirror: bool,
    /// Then turned counter-clockwise by this angle, as its cosine and sine: exact for quarter turns.
    pub turn: [f64; 2],
    /// Then shifted, millimetres.
    pub shift_mm: [f64; 2],
}

impl Motion {
    /// A turn by an angle in radians, without a shift.
    pub fn turned(mirror: bool, angle: f64) -> Self {
        let quarters = angle / std::f64::consts::FRAC_PI_2;
        let turn = if (quarters - quarters.round()).abs() < 1e-12 {
            [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]
                [(quarters.round() as i64).rem_euclid(4) as usize]
        } else {
            [angle.cos(), angle.sin()]
        };
        Self {
            mirror,
            turn,
            shift_mm: [0.0, 0.0],
        }
    }

    /// Where a point goes.
    pub fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        let x = if self.mirror { -x } else { x };
        let [cos, sin] = self.turn;
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        (x + self.shift_mm[0], y + self.shift_mm[1])
    }

    fn point(&self, p: Point) -> Point {
        self.apply(p.x, p.y).into()
    }

    /// The sheet in its place. Contours keep the material on their left.
    pub fn sheet(&self, sheet: &Sheet) -> Sheet {
        let mut moved = sheet.clone();
        for slit in &mut moved.slits {
            slit.tail = self.point(slit.tail);
            slit.tip = self.point(slit.tip);
        }
        for contour in &mut moved.contours {
            contour.line = contour.line.moved(|p| self.point(p), self.mirror);
            if self.mirror {
                contour.line = contour.line.reversed();
            }
        }
        for mark in &mut moved.marks {
            *mark = mark.moved(|p| self.point(p), self.mirror);
        }
        for tab in &mut moved.tabs {
            tab.at = self.point(tab.at);
        }
        for triangle in moved.triangles.iter_mut().chain(&mut moved.flaps) {
            *triangle = triangle.map(|p| self.point(p));
            if self.mirror {
                triangle.swap(1, 2);
            }
        }
        moved
    }
}

/// Puts a sheet into the corner of a machine's bed with the smallest coordinates, the whole cut inside the margins;
/// turned only if it does not fit as it is.
///
/// # Errors
/// [`PatternError::TooLarge`] with both sizes and the edge length or scale that would fit.
pub fn placed(
    sheet: &Sheet,
    machine: &Machine,
    mirror: bool,
) -> Result<(Sheet, Motion), PatternError> {
    let reach = machine.reach();
    let margin = machine.bed.margin_mm;
    let free = Rect::new(
        reach.min[0] + margin,
        reach.min[1] + margin,
        reach.max[0] - margin,
        reach.max[1] - margin,
    );
    placed_on(sheet, free, mirror)
}

/// The same in the corner of any rectangle that may be cut, millimetres.
///
/// # Errors
/// [`PatternError::TooLarge`].
pub fn placed_on(sheet: &Sheet, free: Rect, mirror: bool) -> Result<(Sheet, Motion), PatternError> {
    check_width("kerf", sheet.metadata.kerf_mm)?;
    let (bed_width, bed_height) = (free.width(), free.height());
    // The beam's centre runs half a kerf outside the contour, and burns half a kerf beyond itself.
    let kerf = sheet.metadata.kerf_mm;
    let room = (bed_width - 2.0 * kerf, bed_height - 2.0 * kerf);
    let rims: Vec<Point> = sheet
        .contours
        .iter()
        .flat_map(|c| c.line.flattened(0.01))
        .collect();
    let around = |angle: f64| {
        let motion = Motion::turned(mirror, angle);
        let bounds = if motion.turn[0] * motion.turn[1] == 0.0 {
            // Exact for arcs too.
            let b = sheet.bounds();
            let ends = [motion.apply(b.x0, b.y0), motion.apply(b.x1, b.y1)].map(Point::from);
            Rect::from_points(ends[0], ends[1])
        } else {
            let mut points = rims.iter().map(|p| motion.point(*p));
            let first = points.next().unwrap_or(Point::ORIGIN);
            points
                .fold(Rect::from_points(first, first), |r, p| r.union_pt(p))
                .inflate(0.01, 0.01)
        };
        (motion, bounds)
    };
    let fits = |b: &Rect| b.width() <= room.0 && b.height() <= room.1;
    let quarter = std::f64::consts::FRAC_PI_2;
    let found = [0.0, quarter]
        .map(around)
        .into_iter()
        .find(|(_, b)| fits(b))
        .or_else(|| {
            // In steps of a degree, the smallest box first.
            let mut all: Vec<_> = (1..180)
                .map(|d| around(f64::from(d).to_radians()))
                .collect();
            all.sort_by(|a, b| a.1.area().total_cmp(&b.1.area()));
            all.into_iter().find(|(_, b)| fits(b))
        });
    let Some((mut motion, bounds)) = found else {
        let b = sheet.bounds();
        let share = |w: f64, h: f64| (room.0 / w).min(room.1 / h);
        // Rounded down, so that following the advice is enough.
        let scale = share(b.width(), b.height())
            .max(share(b.height(), b.width()))
            .max(0.0);
        let scale = (scale * 1e4).floor() / 1e4;
        return Err(PatternError::TooLarge {
            width_mm: b.width() + 2.0 * kerf,
            height_mm: b.height() + 2.0 * kerf,
            bed_width_mm: bed_width,
            bed_height_mm: bed_height,
            fitting_edge_mm: (sheet.metadata.edge_mm * scale * 1e3).floor() / 1e3,
            fitting_scale: scale,
        });
    };
    motion.shift_mm = [free.x0 + kerf - bounds.x0, free.y0 + kerf - bounds.y0];
    Ok((motion.sheet(sheet), motion))
}

/// Checks that a sheet can be cut where it lies.
///
/// # Errors
/// [`PatternError::OffBed`] with both extents.
pub fn on_bed(sheet: &Sheet, machine: &Machine) -> Result<(), PatternError> {
    let reach = machine.reach();
    // The middle of the beam runs half a kerf outside the contour.
    let half = 0.5 * sheet.metadata.kerf_mm;
    let cut = sheet.bounds().inflate(half, half);
    let inside = cut.x0 >= reach.min[0]
        && cut.y0 >= reach.min[1]
        && cut.x1 <= reach.max[0]
        && cut.y1 <= reach.max[1];
    if inside {
        return Ok(());
    }
    Err(PatternError::OffBed {
        x0: cut.x0,
        y0: cut.y0,
        x1: cut.x1,
        y1: cut.y1,
        machine: machine.name.clone(),
        from_x: reach.min[0],
        from_y: reach.min[1],
        to_x: reach.max[0],
        to_y: reach.max[1],
    })
}

#[cfg(test)]
mod tests {
    use super::super::sheet::SheetOptions;
    use super::*;
    use crate::linkage::{Colour, Handedness, Linkage};

    fn strip(length: i32, edge: f64) -> Sheet {
        let cells: Vec<_> = (0..length)
            .flat_map(|i| [(i, 0, Colour::Up), (i, 0, Colour::Down)])
            .collect();
        let linkage = Linkage::patch(edge, Handedness::Right, &cells);
        Sheet::new(&linkage, &SheetOptions::plain(1.0, 0.2)).unwrap()
    }

    #[test]
    fn the_cut_starts_at_the_margin_and_nothing_is_distorted() {
        let mut machine = crate::machine::load(crate::machine::DEFAULT).unwrap();
        for origin in [
            crate::machine::Origin::FrontLeft,
            crate::machine::Origin::RearRight,
        ] {
            machine.bed.origin = origin;
            for mirror in [false, true] {
                let sheet = strip(5, 20.0);
                let (there, motion) = placed(&sheet, &machine, mirror).unwrap();
                let b = there.bounds();
                let start = machine.reach().min.map(|v| v + machine.bed.margin_mm + 0.2);
                assert!((b.x0 - start[0]).abs() < 1e-9 && (b.y0 - start[1]).abs() < 1e-9);
                assert_eq!(motion.turn, [1.0, 0.0]);
                let (f, g) = (sheet.figures(), there.figures());
                assert!(
                    (f.area_mm2 - g.area_mm2).abs() < 1e-9,
                    "also the sign of contours"
                );
                assert!((f.slit_length_mm - g.slit_length_mm).abs() < 1e-9);
                assert!(there.contours[0].outer);
            }
        }
    }

    #[test]
    fn a_long_sheet_is_turned_and_one_too_long_is_told_what_fits() {
        let mut machine = crate::machine::load(crate::machine::DEFAULT).unwrap();
        machine.bed.width_mm = 100.0;
        let (there, motion) = placed(&strip(15, 20.0), &machine, false).unwrap();
        assert_eq!(motion.turn, [0.0, 1.0]);
        assert!(there.bounds().height() > 300.0 && there.bounds().x0 > 5.0);
        // Longer than both sides, shorter than the diagonal.
        machine.bed.width_mm = 400.0;
        machine.bed.height_mm = 400.0;
        let (there, motion) = placed(&strip(23, 20.0), &machine, false).unwrap();
        assert!(motion.turn[0] * motion.turn[1] != 0.0);
        assert!(
            machine
                .reach()
                .contains([there.bounds().x1, there.bounds().y1], -5.0)
        );
        let slant = there.figures();
        assert!((slant.area_mm2 - strip(23, 20.0).figures().area_mm2).abs() < 1e-6);
        machine.bed.width_mm = 100.0;
        let error = placed(&strip(30, 20.0), &machine, false).unwrap_err();
        let PatternError::TooLarge {
            fitting_edge_mm, ..
        } = error
        else {
            panic!("{error}");
        };
        assert!(placed(&strip(30, fitting_edge_mm), &machine, false).is_ok());
        assert!(placed(&strip(30, fitting_edge_mm * 1.2), &machine, false).is_err());
    }
}
