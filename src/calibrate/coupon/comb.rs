//! What is cut beside the strips: a plate with squares for calipers, a plate of squares that are each cut in another way,
//! and the gauge card.

use kurbo::{Point, Rect, Vec2};

use super::strip::label;
use super::{KerfPiece, SettingSquare, Strip};
use crate::base::curve::Curve;
use crate::calibrate::kerf::Side;
use crate::pattern::{Contour, Mark, MarkKind, Sheet, SheetOptions};

/// Between two holes, and from a hole to a rim, millimetres.
const WALL_MM: f64 = 6.0;

/// Squares for calipers, and the slot between them: width and height as they shall be, millimetres.
const SQUARES_MM: [[f64; 2]; 3] = [[20.0, 20.0], [14.0, 14.0], [20.0, 5.0]];

/// Room for a name below each square, millimetres.
const NAME_MM: f64 = 5.0;

/// Height of names and numbers, millimetres.
const TEXT_MM: f64 = 3.0;

/// Ticks of the card, millimetres: at tenths, at halves of them, and between.
const TICKS_MM: [f64; 3] = [5.0, 3.5, 2.0];

/// Height of one scale on the card, millimetres.
const SCALE_MM: f64 = 14.0;

/// An empty sheet with a rectangle for its rim.
fn plate(rect: Rect, shapes: &SheetOptions) -> Sheet {
    Sheet {
        contours: vec![Contour {
            line: rectangle(rect, true),
            outer: true,
        }],
        slits: Vec::new(),
        triangles: Vec::new(),
        flaps: Vec::new(),
        marks: Vec::new(),
        tabs: Vec::new(),
        // There is no lattice here; a sound number for what asks for one.
        metadata: shapes.metadata(10.0 * (shapes.hinge_width_mm + shapes.kerf_mm)),
    }
}

fn rectangle(r: Rect, counter_clockwise: bool) -> Curve {
    let points = [(r.x0, r.y0), (r.x1, r.y0), (r.x1, r.y1), (r.x0, r.y1)].map(Point::from);
    let line = Curve::polyline(points, true);
    if counter_clockwise {
        line
    } else {
        line.reversed()
    }
}

/// The plate for calipers: its holes, and the pieces that fall out of them, side by side with their names.
pub(super) fn kerf_plate(shapes: &SheetOptions, engraved: bool) -> (Sheet, Vec<KerfPiece>) {
    let height = SQUARES_MM.iter().map(|s| s[1]).fold(0.0, f64::max) + 2.0 * WALL_MM + NAME_MM;
    let width: f64 = SQUARES_MM.iter().map(|s| s[0] + WALL_MM).sum::<f64>() + WALL_MM;
    let mut sheet = plate(Rect::new(0.0, 0.0, width, height), shapes);
    let mut pieces = Vec::new();
    let mut x = WALL_MM;
    for (n, [w, h]) in SQUARES_MM.into_iter().enumerate() {
        let y = WALL_MM + NAME_MM;
        sheet.contours.push(Contour {
            line: rectangle(Rect::new(x, y, x + w, y + h), false),
            outer: false,
        });
        let name = format!("K{}", n + 1);
        if engraved {
            let at = Point::new(x + 0.5 * w, 0.5 * WALL_MM + 0.5 * NAME_MM);
            sheet.marks.push(label(&name, at, TEXT_MM));
        }
        // The hole is cut to its size: the beam's middle runs half a kerf inside it. Of the slot, its width.
        let nominal_mm = h - shapes.kerf_mm;
        pieces.push(KerfPiece {
            name: format!("{name}-HOLE"),
            side: Side::Hole,
            nominal_mm,
        });
        pieces.push(KerfPiece {
            name: format!("{name}-PIECE"),
            side: Side::Piece,
            nominal_mm,
        });
        x += w + WALL_MM;
    }
    (sheet, pieces)
}

/// The grid of settings: a square hole with this side for each power (along X) and speed (downwards), and the middle of each.
pub(super) fn setting_plate(
    powers: &[f64],
    speeds: &[f64],
    side_mm: f64,
    shapes: &SheetOptions,
    engraved: bool,
) -> (Sheet, Vec<(SettingSquare, Point)>) {
    let pitch = Vec2::new(side_mm + WALL_MM, side_mm + NAME_MM + 1.0);
    let rect = Rect::new(
        0.0,
        0.0,
        pitch.x * powers.len() as f64 + WALL_MM,
        pitch.y * speeds.len() as f64 + WALL_MM,
    );
    let mut sheet = plate(rect, shapes);
    let mut squares = Vec::new();
    for (row, &speed_mm_per_min) in speeds.iter().enumerate() {
        for (column, &power_percent) in powers.iter().enumerate() {
            let at = Point::new(
                WALL_MM + pitch.x * column as f64,
                rect.y1 - pitch.y * (row + 1) as f64 + NAME_MM - WALL_MM + 1.0,
            );
            sheet.contours.push(Contour {
                line: rectangle(Rect::from_origin_size(at, (side_mm, side_mm)), false),
                outer: false,
            });
            let name = format!("P{}", squares.len() + 1);
            let middle = at + Vec2::new(0.5, 0.5) * side_mm;
            if engraved {
                let below = Point::new(middle.x, at.y - 0.5 * NAME_MM);
                sheet.marks.push(label(&name, below, TEXT_MM));
            }
            let square = SettingSquare {
                name,
                power_percent,
                speed_mm_per_min,
            };
            squares.push((square, middle));
        }
    }
    (sheet, squares)
}

/// The different lengths between the gauge marks of some strips, the shortest first.
pub(super) fn gauges(strips: &[Strip]) -> Vec<f64> {
    let mut lengths: Vec<f64> = strips.iter().map(|s| s.gauge_mm).collect();
    lengths.sort_by(f64::total_cmp);
    lengths.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    lengths
}

/// The gauge card: for each length between marks a scale, whose zero is laid on one mark and which tells the stretch at the
/// other.
pub(super) fn card(strips: &[Strip], step: f64, shapes: &SheetOptions) -> Sheet {
    let lengths = gauges(strips);
    let longest = lengths.last().copied().unwrap_or(0.0);
    let rect = Rect::new(
        0.0,
        0.0,
        2.0 * longest + 2.0 * WALL_MM,
        SCALE_MM * lengths.len() as f64 + 2.0,
    );
    let mut sheet = plate(rect, shapes);
    for (n, &length) in lengths.iter().enumerate() {
        // Ticks hang from the upper edge of each scale.
        let top = rect.y1 - SCALE_MM * n as f64 - 1.5;
        // As tall as lets a number stand beside the next.
        let room = 0.8 * 0.1 * length;
        let tall = 0.8 * TEXT_MM * (room / crate::pattern::width_mm("1.8", 0.8 * TEXT_MM)).min(1.0);
        let mut lines = vec![tick(WALL_MM, top, TICKS_MM[0])];
        for (stretch, rank) in ticks(step) {
            let x = WALL_MM + stretch * length;
            lines.push(tick(x, top, TICKS_MM[rank]));
            if rank == 0 {
                let at = Point::new(x, top - TICKS_MM[0] - 0.8 - 0.5 * tall);
                sheet.marks.push(label(&format!("{stretch:.1}"), at, tall));
            }
        }
        sheet.marks.push(Mark {
            kind: MarkKind::Gauge,
            lines,
            label: None,
        });
        let names: Vec<&str> = strips
            .iter()
            .filter(|s| (s.gauge_mm - length).abs() < 1e-6)
            .map(|s| s.name.as_str())
            .collect();
        let text = names.join(" ");
        let width = crate::pattern::width_mm(&text, 0.8 * TEXT_MM);
        let at = Point::new(
            (WALL_MM + 2.0 + 0.5 * width).min(0.5 * longest + WALL_MM),
            top - TICKS_MM[0] - 0.8 - 0.4 * TEXT_MM,
        );
        sheet.marks.push(label(&text, at, 0.8 * TEXT_MM));
    }
    sheet
}

fn tick(x: f64, top: f64, length: f64) -> Curve {
    Curve::line(Point::new(x, top), Point::new(x, top - length))
}

/// The stretches of a scale, from 1 to 2 in steps, and what each is: 0 a tenth, which has its number, 1 half of one, 2 other.
pub(super) fn ticks(step: f64) -> Vec<(f64, usize)> {
    let count = (1.0 / step).round().max(1.0) as usize;
    let whole = |v: f64| (v - v.round()).abs() < 1e-6;
    (0..=count)
        .map(|k| {
            let stretch = 1.0 + k as f64 * step;
            let rank = if whole(10.0 * stretch) {
                0
            } else if whole(20.0 * stretch) {
                1
            } else {
                2
            };
            (stretch, rank)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::units::fixed;

    #[test]
    fn on_the_card_the_stretch_stands_where_the_other_mark_comes_to_lie() {
        let strips = [7.0, 10.5, 12.0].map(|edge| Strip {
            name: format!("S{edge}"),
            ..Strip::new(1.0, edge)
        });
        let card = card(&strips, 0.025, &SheetOptions::plain(1.0, 0.2));
        let scales: Vec<&Mark> = card
            .marks
            .iter()
            .filter(|m| m.kind == MarkKind::Gauge)
            .collect();
        let lengths = gauges(&strips);
        assert_eq!(scales.len(), lengths.len());
        for strip in &strips {
            // The scale with the strip's name below its zero.
            let index = lengths
                .iter()
                .position(|l| (l - strip.gauge_mm).abs() < 1e-6)
                .unwrap();
            let places: Vec<Point> = scales[index]
                .lines
                .iter()
                .map(|l| l.vertices[0].at)
                .collect();
            let (zero, ticks) = places.split_first().unwrap();
            assert_eq!(ticks.len(), 41);
            for (n, tick) in ticks.iter().enumerate() {
                let stretch = 1.0 + 0.025 * n as f64;
                assert!((tick.x - zero.x - stretch * strip.gauge_mm).abs() < 1e-9);
                assert!((tick.y - zero.y).abs() < 1e-9);
            }
            let named = |text: &str| -> Vec<Point> {
                let labels = card.marks.iter().filter_map(|m| m.label.as_ref());
                labels.filter(|l| l.text == text).map(|l| l.at).collect()
            };
            for tenth in 10..=20 {
                let stretch = 0.1 * f64::from(tenth);
                let x = zero.x + stretch * strip.gauge_mm;
                let at = named(&fixed(stretch, 1));
                assert!(at.iter().any(|p| (p.x - x).abs() < 1e-9 && p.y < zero.y));
            }
            let name = named(&strip.name)[0];
            assert!(name.y < zero.y && zero.y - name.y < SCALE_MM);
        }
        assert!(
            card.bounds().x1
                > scales
                    .iter()
                    .flat_map(|m| &m.lines)
                    .map(|l| l.vertices[0].at.x)
                    .fold(0.0, f64::max)
        );
    }
}
