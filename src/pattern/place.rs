//! Where a sheet lies on the bed.

use kurbo::Point;

use super::sheet::{PatternError, Sheet, check_width};
use crate::machine::Machine;

/// From the frame of a sheet to its place on the bed: mirrored or not, turned by 90° or not, then shifted. Apply it to
/// everything that shares the sheet's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// X is negated first: the sheet is cut from its back.
    pub mirror: bool,
    /// Then turned by 90° counter-clockwise.
    pub quarter_turn: bool,
    /// Then shifted, millimetres.
    pub shift_mm: [f64; 2],
}

impl Motion {
    /// Where a point goes.
    pub fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        let x = if self.mirror { -x } else { x };
        let (x, y) = if self.quarter_turn { (-y, x) } else { (x, y) };
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
/// turned by 90° only if it fits no other way.
///
/// # Errors
/// [`PatternError::TooLarge`] with both sizes and the edge length or scale that would fit.
pub fn placed(
    sheet: &Sheet,
    machine: &Machine,
    mirror: bool,
) -> Result<(Sheet, Motion), PatternError> {
    check_width("kerf", sheet.metadata.kerf_mm)?;
    let reach = machine.reach();
    let margin = machine.bed.margin_mm;
    let (bed_width, bed_height) = (
        reach.max[0] - reach.min[0] - 2.0 * margin,
        reach.max[1] - reach.min[1] - 2.0 * margin,
    );
    let bounds = sheet.bounds();
    // The beam's centre runs half a kerf outside the contour, and burns half a kerf beyond itself.
    let kerf = sheet.metadata.kerf_mm;
    let (width, height) = (bounds.width() + 2.0 * kerf, bounds.height() + 2.0 * kerf);
    let fits = |w: f64, h: f64| w <= bed_width && h <= bed_height;
    let quarter_turn = !fits(width, height);
    if quarter_turn && !fits(height, width) {
        let room = |w: f64, h: f64| {
            ((bed_width - 2.0 * kerf) / (w - 2.0 * kerf))
                .min((bed_height - 2.0 * kerf) / (h - 2.0 * kerf))
        };
        // Rounded down, so that following the advice is enough.
        let scale = (room(width, height).max(room(height, width)).max(0.0) * 1e4).floor() / 1e4;
        return Err(PatternError::TooLarge {
            width_mm: width,
            height_mm: height,
            bed_width_mm: bed_width,
            bed_height_mm: bed_height,
            fitting_edge_mm: (sheet.metadata.edge_mm * scale * 1e3).floor() / 1e3,
            fitting_scale: scale,
        });
    }
    let mut motion = Motion {
        mirror,
        quarter_turn,
        shift_mm: [0.0, 0.0],
    };
    let (ax, ay) = motion.apply(bounds.x0, bounds.y0);
    let (bx, by) = motion.apply(bounds.x1, bounds.y1);
    motion.shift_mm = [
        reach.min[0] + margin + kerf - ax.min(bx),
        reach.min[1] + margin + kerf - ay.min(by),
    ];
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
                assert!(!motion.quarter_turn);
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
        assert!(motion.quarter_turn);
        assert!(there.bounds().height() > 300.0 && there.bounds().x0 > 5.0);
        let error = placed(&strip(30, 20.0), &machine, false).unwrap_err();
        let PatternError::TooLarge {
            fitting_edge_mm, ..
        } = error
        else {
            panic!("{error}");
        };
        assert!(placed(&strip(30, fitting_edge_mm), &machine, false).is_ok());
        assert!(placed(&strip(30, fitting_edge_mm * 1.002), &machine, false).is_err());
    }
}
