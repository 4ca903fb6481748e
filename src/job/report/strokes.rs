//! The toolpath as a drawing: in which order the machine cuts, and how it travels between.

use std::fmt::Write as _;

use nalgebra::Point2;

use crate::base::units::short;
use crate::job::picture::{Rgb, mix};

/// What the machine does along a [`Stroke`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Moves with the beam off.
    Travel,
    /// Cuts a slit or anything else within the sheet.
    Cut,
    /// Cuts an outline.
    Contour,
    /// Engraves.
    Mark,
}

/// One uninterrupted stroke of the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// What is done along it.
    pub role: Role,
    /// Where it runs: millimetres, X right, Y up.
    pub points: Vec<Point2<f64>>,
}

/// First and last colour of the cuts; contours and marks; travel.
pub(super) const FIRST: Rgb = Rgb::hex(0x2a6fdb);
pub(super) const LAST: Rgb = Rgb::hex(0xe8682c);
pub(super) const MARK: Rgb = Rgb::hex(0x3d8f4d);
pub(super) const TRAVEL: Rgb = Rgb::hex(0xb4bac2);

/// Shades between the first and the last: enough for a smooth run, few enough paths for a light page.
const SHADES: usize = 48;

/// Decimals of coordinates: a hundredth of a millimetre is far below a screen's pixel.
const DECIMALS: usize = 2;

/// Draws strokes in their order. `None` if there is nothing finite to draw.
pub fn drawing(strokes: &[Stroke]) -> Option<String> {
    let finite = |p: &&Point2<f64>| p.x.is_finite() && p.y.is_finite();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in strokes.iter().flat_map(|s| &s.points).filter(finite) {
        for k in 0..2 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    if low[0] > high[0] {
        return None;
    }
    let size = (high[0] - low[0]).max(high[1] - low[1]).max(1e-3);
    let room = 0.03 * size;
    let mut svg = format!(
        "<svg viewBox=\"{} {} {} {}\" role=\"img\" aria-label=\"toolpath in the order of cutting\" fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">",
        short(low[0] - room, DECIMALS),
        short(-high[1] - room, DECIMALS),
        short(high[0] - low[0] + 2.0 * room, DECIMALS),
        short(high[1] - low[1] + 2.0 * room, DECIMALS)
    );
    // Order counts by length cut, so that the colour runs as time does.
    let length = |s: &Stroke| -> f64 {
        s.points
            .windows(2)
            .map(|w| (w[1] - w[0]).norm())
            .filter(|x| x.is_finite())
            .sum()
    };
    let cuts = |s: &&Stroke| matches!(s.role, Role::Cut | Role::Contour);
    let total: f64 = strokes.iter().filter(cuts).map(length).sum();
    let mut travels = String::new();
    let mut marks = String::new();
    let mut outlines = vec![String::new(); SHADES];
    let mut slits = vec![String::new(); SHADES];
    let mut done = 0.0;
    for stroke in strokes {
        let shade = if total > 0.0 {
            (done / total * SHADES as f64) as usize
        } else {
            0
        };
        let shade = shade.min(SHADES - 1);
        let data = match stroke.role {
            Role::Travel => &mut travels,
            Role::Mark => &mut marks,
            Role::Cut => &mut slits[shade],
            Role::Contour => &mut outlines[shade],
        };
        for (i, p) in stroke.points.iter().filter(finite).enumerate() {
            let letter = if i == 0 { 'M' } else { 'L' };
            let _ = write!(
                data,
                "{letter}{} {}",
                short(p.x, DECIMALS),
                short(-p.y, DECIMALS)
            );
        }
        if cuts(&stroke) {
            done += length(stroke);
        }
    }
    let mut path = |data: &str, colour: Rgb, width: f64| {
        if !data.is_empty() {
            let _ = write!(
                svg,
                "<path d=\"{data}\" stroke=\"{}\" stroke-width=\"{width}px\"/>",
                colour.css()
            );
        }
    };
    path(&travels, TRAVEL, 0.6);
    path(&marks, MARK, 1.0);
    for (data, width) in [(&slits, 1.2), (&outlines, 2.0)] {
        for (i, data) in data.iter().enumerate() {
            path(
                data,
                mix(FIRST, LAST, i as f64 / (SHADES - 1) as f64),
                width,
            );
        }
    }
    let working = |s: &&Stroke| s.role != Role::Travel;
    if let Some(start) = strokes
        .iter()
        .find(working)
        .and_then(|s| s.points.iter().find(finite))
    {
        let _ = write!(
            svg,
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\" stroke=\"#fff\" stroke-width=\"{}\"/>",
            short(start.x, DECIMALS),
            short(-start.y, DECIMALS),
            short(0.011 * size, 3),
            FIRST.css(),
            short(0.004 * size, 3)
        );
    }
    svg.push_str("</svg>");
    Some(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stroke(role: Role, points: &[[f64; 2]]) -> Stroke {
        Stroke {
            role,
            points: points.iter().map(|p| Point2::new(p[0], p[1])).collect(),
        }
    }

    #[test]
    fn cuts_run_from_the_first_colour_to_the_last_and_y_points_up() {
        let strokes = [
            stroke(Role::Travel, &[[0., 0.], [10., 5.]]),
            stroke(Role::Cut, &[[10., 5.], [20., 5.]]),
            stroke(Role::Travel, &[[20., 5.], [0., 0.]]),
            stroke(Role::Contour, &[[0., 0.], [0.01, 0.], [0., 0.]]),
        ];
        let svg = drawing(&strokes).unwrap();
        let path = |d: &str, c: Rgb| format!("d=\"{d}\" stroke=\"{}\"", c.css());
        assert!(svg.contains(&path("M10 -5L20 -5", FIRST)), "{svg}");
        assert!(svg.contains(&path("M0 0L0.01 0L0 0", LAST)), "{svg}");
        assert!(svg.contains(&path("M0 0L10 -5M20 -5L0 0", TRAVEL)), "{svg}");
        assert!(svg.contains("<circle cx=\"10\" cy=\"-5\""));
        assert!(svg.contains("viewBox=\"-0.6 -5.6 21.2 6.2\""), "{svg}");
    }

    #[test]
    fn nothing_finite_gives_no_drawing() {
        assert_eq!(drawing(&[]), None);
        assert_eq!(drawing(&[stroke(Role::Cut, &[[f64::NAN, 0.]])]), None);
    }
}
