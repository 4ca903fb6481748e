//! One picture that says what kagome does: the flat sheet, and what becomes of it.

use nalgebra::Point3;

use super::camera::{Camera, Frame, View};
use super::canvas::Canvas;
use super::colour::Rgb;
use super::image::Image;
use super::scene::Scene;
use crate::linkage::Linkage;
use crate::mesh::Surface;

/// Size, pixels.
const SIZE: [usize; 2] = [1200, 720];

/// Reach of the shade in corners, in L.
const SHADE_REACH: f64 = 0.45;

/// The closed sheet on the left and the opened linkage on its surface, from the front and a little aside, on the
/// right. `background`: none for transparent.
pub fn postcard(
    surface: &Surface,
    linkage: &Linkage,
    positions: &[Point3<f64>],
    background: Option<Rgb>,
) -> Image {
    let [width, height] = SIZE;
    let half = |x: f64| Frame {
        x,
        y: 0.0,
        width: 0.5 * width as f64,
        height: height as f64,
    };
    let (sheet, body) = (
        Scene::sheet(linkage),
        Scene::linkage(surface, linkage, positions),
    );
    let right_camera = Camera::fit(
        &View::front(surface).turned(0.32, 0.08),
        body.points(),
        half(0.5 * width as f64),
        28.0,
    );
    let left_camera = Camera::fit(&View::flat(), sheet.points(), half(0.0), 28.0);
    // Both to one measure: the sheet is smaller than what it becomes, and that is the point.
    let scale = left_camera.scale.min(right_camera.scale);
    let mut canvas = Canvas::new(width, height, background);
    // The body first: its shade must not know of the sheet, which is drawn without light.
    let camera = right_camera.with_scale(scale);
    body.draw(&mut canvas, &camera);
    canvas.occlude(&camera, SHADE_REACH * linkage.edge_mm, 0.6);
    sheet.draw(&mut canvas, &left_camera.with_scale(scale));
    canvas.image()
}
