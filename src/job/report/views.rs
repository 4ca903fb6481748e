//! The pictures of the page, with numbered rings at the places that the verdict speaks of.

use std::fmt::Write as _;

use nalgebra::Point3;

use super::text::escape;
use crate::base::units::short;
use crate::job::picture::{Camera, Canvas, Frame, Image, Rgb, Scene, View};

/// Background of the figures on the page.
const PAPER: Rgb = Rgb::hex(0xffffff);

/// Left free around the object, pixels.
const MARGIN: f64 = 14.0;

/// One view of a scene, by name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Named {
    pub name: &'static str,
    pub view: View,
}

/// Radians that the eye moves to the right and up for the three-quarter view.
const THREE_QUARTER: [f64; 2] = [0.66, 0.28];

/// Front, three-quarter and side.
pub(super) fn around(front: View) -> [Named; 3] {
    let [azimuth, elevation] = THREE_QUARTER;
    [
        Named {
            name: "front",
            view: front,
        },
        Named {
            name: "three-quarter",
            view: front.turned(azimuth, elevation),
        },
        Named {
            name: "side",
            view: front.turned(std::f64::consts::FRAC_PI_2, 0.0),
        },
    ]
}

/// How a scene is turned into figures.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    /// Width and height of each picture, pixels.
    pub size: [usize; 2],
    /// Reach of the shade in corners, millimetres; 0 for none.
    pub shade_mm: f64,
}

/// Figures of a scene from several views, all to one measure, each with its name and a ring at every place. A ring is
/// dashed where the place is hidden behind the object.
pub(super) fn figures(
    scene: &Scene<'_>,
    what: &str,
    views: &[Named],
    style: Style,
    places: &[(usize, Point3<f64>)],
) -> String {
    let [width, height] = style.size;
    let mut cameras: Vec<Camera> = views
        .iter()
        .map(|v| Camera::fit(&v.view, scene.points(), Frame::whole(width, height), MARGIN))
        .collect();
    let scale = cameras
        .iter()
        .map(|c| c.scale)
        .fold(f64::INFINITY, f64::min);
    cameras.iter_mut().for_each(|c| *c = c.with_scale(scale));
    let draw = &|named: &Named, camera: &Camera| {
        let mut canvas = Canvas::new(width, height, Some(PAPER));
        scene.draw(&mut canvas, camera);
        if style.shade_mm > 0.0 {
            canvas.occlude(camera, style.shade_mm, 0.55);
        }
        let rings = rings(&canvas, camera, style.size, places);
        let alt = if named.name.is_empty() {
            what.to_owned()
        } else {
            format!("{what}, {}", named.name)
        };
        figure(&canvas.image(), &alt, named.name, &rings)
    };
    // A picture is a thread's work of its own; the page is put together in the order of the views.
    std::thread::scope(|scope| {
        let drawing: Vec<_> = views
            .iter()
            .zip(&cameras)
            .map(|(named, camera)| scope.spawn(move || draw(named, camera)))
            .collect();
        drawing
            .into_iter()
            .map(|picture| match picture.join() {
                Ok(html) => html,
                Err(panic) => std::panic::resume_unwind(panic),
            })
            .collect()
    })
}

fn figure(image: &Image, alt: &str, caption: &str, overlay: &str) -> String {
    let mut html = format!(
        "<figure><div class=\"stack\"><img src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\">{overlay}</div>",
        image.data_uri(),
        image.width,
        image.height,
        escape(alt)
    );
    if !caption.is_empty() {
        let _ = write!(html, "<figcaption>{}</figcaption>", escape(caption));
    }
    html.push_str("</figure>");
    html
}

fn rings(
    canvas: &Canvas,
    camera: &Camera,
    [width, height]: [usize; 2],
    places: &[(usize, Point3<f64>)],
) -> String {
    if places.is_empty() {
        return String::new();
    }
    let mut svg = format!("<svg viewBox=\"0 0 {width} {height}\" aria-hidden=\"true\">");
    let radius = 0.022 * width.min(height) as f64;
    for (number, place) in places {
        let [x, y, _] = camera.project(place);
        if !(x.is_finite() && y.is_finite()) {
            continue;
        }
        // A place may lie off the surface by what is wrong with it: a ring's radius of slack.
        let hidden = !canvas.sees(camera, place, radius / camera.scale);
        let (x, y) = (x.clamp(0.0, width as f64), y.clamp(0.0, height as f64));
        let dash = if hidden {
            " stroke-dasharray=\"4 4\""
        } else {
            ""
        };
        // White under black: visible on every colour.
        for (colour, stroke) in [("#fff", 5.0), ("#14181d", 2.5)] {
            let _ = write!(
                svg,
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{stroke}\"{}/>",
                short(x, 1),
                short(y, 1),
                short(radius, 1),
                if colour == "#fff" { "" } else { dash }
            );
        }
        // Beside the ring, on the side where there is room.
        let right = x < 0.85 * width as f64;
        let _ = write!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"{}\" style=\"font-size:{}px;font-weight:700;fill:#14181d;stroke:#fff;stroke-width:4px;paint-order:stroke\">{number}</text>",
            short(
                if right {
                    x + 1.3 * radius
                } else {
                    x - 1.3 * radius
                },
                1
            ),
            short(y - 0.6 * radius, 1),
            if right { "start" } else { "end" },
            short(0.036 * width.min(height) as f64, 1)
        );
    }
    svg.push_str("</svg>");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::picture::ColourScale;
    use crate::mesh::Surface;

    #[test]
    fn places_get_numbered_rings_dashed_where_hidden() {
        let p = [[0., 0.], [10., 0.], [0., 10.]].map(|[x, y]| Point3::new(x, y, 0.0));
        let surface = Surface::new(p.to_vec(), vec![[0, 1, 2]]).unwrap();
        let scale = ColourScale::scale_factor(2.0);
        let values = crate::base::ids::Per::filled(3, 1.5);
        let scene = Scene::surface(&surface, &values, &scale);
        let views = around(View::front(&surface));
        let style = Style {
            size: [80, 80],
            shade_mm: 0.0,
        };
        let places = [
            (1, Point3::new(2.0, 2.0, 0.0)),
            (2, Point3::new(2.0, 2.0, -5.0)),
            (3, Point3::new(f64::NAN, 0.0, 0.0)),
        ];
        let html = figures(&scene, "a <test>", &views[..1], style, &places);
        assert_eq!(html.matches("<circle").count(), 4);
        assert_eq!(html.matches("stroke-dasharray").count(), 1);
        assert!(html.contains(">1</text>") && html.contains(">2</text>"));
        assert!(html.contains("alt=\"a &lt;test&gt;, front\""));
        assert_eq!(
            figures(&scene, "x", &views, style, &[])
                .matches("<figure>")
                .count(),
            3
        );
    }
}
