//! The z-buffer: triangles and lines go in, an [`Image`] comes out.
//!
//! Each pixel has 2 × 2 samples with a depth and a colour; a triangle covers the samples whose centres lie in it. Light
//! is computed at corners and interpolated, colours by value are looked up at every sample, so that the edge between
//! good and flagged values is sharp.

use nalgebra::{Point3, Vector3};

use super::camera::Camera;
use super::colour::{ColourScale, Rgb, mix};
use super::image::Image;

/// Samples across one pixel, in each direction.
const SAMPLES: usize = 2;

/// The largest side of a picture, pixels: 16 samples of 8 bytes each for every pixel would be 2 GB beyond.
const LARGEST_SIDE: usize = 8192;

/// The colour of a triangle.
#[derive(Clone, Copy, Debug)]
pub enum Paint<'a> {
    /// The same everywhere.
    Plain(Rgb),
    /// By the values at its three corners, interpolated linearly, through a scale.
    Values([f64; 3], &'a ColourScale),
}

/// How a surface takes light, which comes from above and to the left of the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Brightness (1 is the paint's own) where no light falls.
    pub shadow: f64,
    /// Brightness added where light falls straight.
    pub light: f64,
    /// Seen from behind, the paint is mixed with grey by this part.
    pub back: f64,
}

impl Material {
    /// Little modelling: colours can be compared with a legend.
    pub const MAP: Self = Self {
        shadow: 0.80,
        light: 0.22,
        back: 0.55,
    };
    /// Plastic modelling for plain paint.
    pub const BODY: Self = Self {
        shadow: 0.52,
        light: 0.52,
        back: 0.45,
    };
    /// No light at all: flat drawings.
    pub const FLAT: Self = Self {
        shadow: 1.0,
        light: 0.0,
        back: 0.0,
    };

    /// Brightness of a surface with this unit normal (right, up, towards the eye).
    #[inline]
    fn brightness(&self, normal: &Vector3<f64>) -> f64 {
        // Unit vector from the upper left in front.
        const KEY: Vector3<f64> = Vector3::new(-0.36, 0.56, 0.746_2);
        // Half-Lambert: the light wraps around, so that forms are readable on the far side too.
        let wrapped = 0.5 + 0.5 * normal.dot(&KEY);
        self.shadow + self.light * wrapped * wrapped
    }
}

/// A picture being drawn.
#[derive(Clone, Debug)]
pub struct Canvas {
    width: usize,
    height: usize,
    /// Millimetres towards the eye, by sample.
    depth: Vec<f32>,
    /// By sample; alpha is 0 or 255.
    colour: Vec<[u8; 4]>,
}

impl Canvas {
    /// An empty picture; sides are brought into 1 to 8192 pixels.
    pub fn new(width: usize, height: usize, background: Option<Rgb>) -> Self {
        let (width, height) = (width.clamp(1, LARGEST_SIDE), height.clamp(1, LARGEST_SIDE));
        let count = width * height * SAMPLES * SAMPLES;
        let empty = background.map_or([255, 255, 255, 0], |Rgb([r, g, b])| [r, g, b, 255]);
        Self {
            width,
            height,
            depth: vec![f32::NEG_INFINITY; count],
            colour: vec![empty; count],
        }
    }

    /// Draws a triangle, counter-clockwise seen from outside. `normals` are unit vectors at the corners; without them
    /// the triangle is flat. A corner that is not finite: nothing is drawn.
    pub fn triangle(
        &mut self,
        camera: &Camera,
        corners: &[Point3<f64>; 3],
        normals: Option<&[Vector3<f64>; 3]>,
        paint: Paint<'_>,
        material: &Material,
    ) {
        let own = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let Some(own) = own.try_normalize(0.0) else {
            return;
        };
        let own = camera.local(&own);
        let from_behind = own.z < 0.0;
        let facing = if from_behind { -1.0 } else { 1.0 };
        let light: [f64; 3] = std::array::from_fn(|k| {
            let normal = normals.map_or(own, |n| camera.local(&n[k]));
            material.brightness(&(normal * facing))
        });
        let grey = if from_behind { material.back } else { 0.0 };
        let behind = |c: Rgb| {
            if from_behind {
                mix(c, Rgb::hex(0xb4b8bf), grey)
            } else {
                c
            }
        };
        let places = corners.map(|p| camera.project(&p));
        match paint {
            Paint::Plain(colour) => {
                let Rgb(c) = behind(colour);
                self.fill(&places, |w| lit(c, dot(&light, w)));
            }
            Paint::Values(values, scale) => self.fill(&places, |w| {
                let Rgb(c) = behind(scale.colour(dot(&values, w)));
                lit(c, dot(&light, w))
            }),
        }
    }

    /// Draws a line `width` pixels wide, hidden by what lies more than `lift` (millimetres) nearer to the eye.
    pub fn line(
        &mut self,
        camera: &Camera,
        ends: &[Point3<f64>; 2],
        width: f64,
        lift: f64,
        Rgb([r, g, b]): Rgb,
    ) {
        let [p, q] = ends.map(|p| camera.project(&p));
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        let length = (dx * dx + dy * dy).sqrt();
        let half = 0.5 * width;
        // Square ends, half a width beyond, close the corners of an outline.
        let (ex, ey) = if length > 1e-9 {
            (dx / length * half, dy / length * half)
        } else {
            (half, 0.0)
        };
        let corner = |p: &[f64; 3], along: f64, across: f64| {
            [
                p[0] + ex * along - ey * across,
                p[1] + ey * along + ex * across,
                p[2] + lift,
            ]
        };
        let quad = [
            corner(&p, -1.0, -1.0),
            corner(&q, 1.0, -1.0),
            corner(&q, 1.0, 1.0),
            corner(&p, -1.0, 1.0),
        ];
        for half in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
            self.fill(&half, |_| [r, g, b]);
        }
    }

    /// True if nothing drawn lies more than `slack` (millimetres) before this point.
    pub fn sees(&self, camera: &Camera, point: &Point3<f64>, slack: f64) -> bool {
        let [x, y, z] = camera.project(point);
        let (column, row) = (x * SAMPLES as f64, y * SAMPLES as f64);
        let (columns, rows) = (self.width * SAMPLES, self.height * SAMPLES);
        if !(column >= 0.0 && row >= 0.0 && column < columns as f64 && row < rows as f64) {
            return false;
        }
        f64::from(self.depth[row as usize * columns + column as usize]) <= z + slack
    }

    /// Fills the samples whose centres lie in a triangle (pixels, pixels, depth) and are nearer than what is there.
    /// `shade` gets the barycentric weights.
    #[inline]
    fn fill(&mut self, places: &[[f64; 3]; 3], mut shade: impl FnMut(&[f64; 3]) -> [u8; 3]) {
        if !places.iter().flatten().all(|x| x.is_finite()) {
            return;
        }
        let n = SAMPLES as f64;
        // In samples, with sample centres at whole numbers.
        let p = places.map(|p| [p[0] * n - 0.5, p[1] * n - 0.5]);
        let area =
            (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[1][1] - p[0][1]) * (p[2][0] - p[0][0]);
        // Zero for a triangle seen edge-on; not finite for one far beyond any picture.
        if !area.is_normal() {
            return;
        }
        let (columns, rows) = (self.width * SAMPLES, self.height * SAMPLES);
        let range = |k: usize, count: usize| {
            let low = p[0][k].min(p[1][k]).min(p[2][k]).ceil().max(0.0);
            let high = p[0][k]
                .max(p[1][k])
                .max(p[2][k])
                .floor()
                .min(count as f64 - 1.0);
            (low <= high).then_some((low as usize, high as usize))
        };
        let (Some((left, right)), Some((top, bottom))) = (range(0, columns), range(1, rows)) else {
            return;
        };
        // Weight k is the distance from the side opposite to corner k: w = a x + b y + c.
        let sides: [[f64; 3]; 3] = std::array::from_fn(|k| {
            let (s, t) = (p[(k + 1) % 3], p[(k + 2) % 3]);
            let (a, b) = ((s[1] - t[1]) / area, (t[0] - s[0]) / area);
            [a, b, -(a * s[0] + b * s[1])]
        });
        let depths = places.map(|p| p[2]);
        for y in top..=bottom {
            let base = y * columns;
            let row: [f64; 3] = std::array::from_fn(|k| sides[k][1] * y as f64 + sides[k][2]);
            for x in left..=right {
                let w: [f64; 3] = std::array::from_fn(|k| sides[k][0] * x as f64 + row[k]);
                if w[0] < 0.0 || w[1] < 0.0 || w[2] < 0.0 {
                    continue;
                }
                let depth = dot(&depths, &w) as f32;
                let at = base + x;
                if depth > self.depth[at] {
                    self.depth[at] = depth;
                    let [r, g, b] = shade(&w);
                    self.colour[at] = [r, g, b, 255];
                }
            }
        }
    }

    /// Darkens samples that lie in corners and behind edges: each looks around in its pixel plane within `reach`
    /// (millimetres) and is shaded by what stands before it, up to `strength` (0 to 1). Costs 12 looks a sample.
    pub fn occlude(&mut self, camera: &Camera, reach: f64, strength: f64) {
        // A sunflower's spiral: even over the disk, without a grid's stripes.
        const LOOKS: [[f64; 2]; 12] = [
            [0.2041, 0.0],
            [-0.2607, 0.2388],
            [0.0399, -0.4547],
            [0.3285, 0.4287],
            [-0.6030, -0.1068],
            [0.5716, -0.3636],
            [-0.1846, 0.7125],
            [-0.3645, -0.7015],
            [0.7924, 0.2740],
            [-0.8203, 0.3478],
            [0.3738, -0.8578],
            [0.3220, 0.9247],
        ];
        let (columns, rows) = (self.width * SAMPLES, self.height * SAMPLES);
        let radius = reach * camera.scale * SAMPLES as f64;
        let offsets = LOOKS.map(|[x, y]| [(x * radius) as isize, (y * radius) as isize]);
        for y in 0..rows {
            for x in 0..columns {
                let here = f64::from(self.depth[y * columns + x]);
                if !here.is_finite() {
                    continue;
                }
                let mut covered = 0.0;
                for [dx, dy] in offsets {
                    let (Some(x), Some(y)) = (x.checked_add_signed(dx), y.checked_add_signed(dy))
                    else {
                        continue;
                    };
                    if x >= columns || y >= rows {
                        continue;
                    }
                    let above = (f64::from(self.depth[y * columns + x]) - here) / reach;
                    // Something far in front is another object, not a corner: its shade fades.
                    if above > 0.05 {
                        covered += above.min(1.0) / (1.0 + (above - 1.0).max(0.0) * 2.0);
                    }
                }
                let light = 1.0 - strength * covered / LOOKS.len() as f64;
                let [r, g, b, a] = self.colour[y * columns + x];
                let [r, g, b] = lit([r, g, b], light);
                self.colour[y * columns + x] = [r, g, b, a];
            }
        }
    }

    /// The picture: samples averaged over each pixel, alpha by coverage.
    pub fn image(&self) -> Image {
        let columns = self.width * SAMPLES;
        let mut pixels = Vec::with_capacity(self.width * self.height);
        for y in 0..self.height {
            for x in 0..self.width {
                let (mut sum, mut alpha) = ([0u32; 3], 0u32);
                for row in 0..SAMPLES {
                    let at = (y * SAMPLES + row) * columns + x * SAMPLES;
                    for sample in &self.colour[at..at + SAMPLES] {
                        let a = u32::from(sample[3]);
                        alpha += a;
                        for k in 0..3 {
                            sum[k] += u32::from(sample[k]) * a;
                        }
                    }
                }
                let channel = |k: usize| ((sum[k] + alpha / 2) / alpha.max(1)) as u8;
                let count = (SAMPLES * SAMPLES) as u32;
                pixels.push([channel(0), channel(1), channel(2), (alpha / count) as u8]);
            }
        }
        Image {
            width: self.width,
            height: self.height,
            pixels,
        }
    }
}

#[inline]
fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A colour at a brightness, in fixed point: this runs for every sample.
#[inline]
fn lit(colour: [u8; 3], light: f64) -> [u8; 3] {
    let light = (light * 256.0 + 0.5) as u32;
    colour.map(|c| ((u32::from(c) * light + 128) >> 8).min(255) as u8)
}

#[cfg(test)]
mod tests {
    use super::super::camera::{Frame, View};
    use super::*;

    const RED: Rgb = Rgb::hex(0xff0000);
    const BLUE: Rgb = Rgb::hex(0x0000ff);

    /// One pixel a millimetre, the origin in the lower left corner.
    fn flat(size: usize) -> Camera {
        let s = size as f64;
        let corners = [Point3::origin(), Point3::new(s, s, 0.0)];
        Camera::fit(
            &View::flat(),
            corners.into_iter(),
            Frame::whole(size, size),
            0.0,
        )
    }

    fn right_triangle(size: f64, z: f64) -> [Point3<f64>; 3] {
        [[0.0, 0.0], [size, 0.0], [0.0, size]].map(|[x, y]| Point3::new(x, y, z))
    }

    #[test]
    fn a_known_triangle_covers_the_known_pixels() {
        let mut canvas = Canvas::new(8, 8, None);
        canvas.triangle(
            &flat(8),
            &right_triangle(8.0, 0.0),
            None,
            Paint::Plain(RED),
            &Material::FLAT,
        );
        let image = canvas.image();
        for y in 0..8 {
            for x in 0..8 {
                let pixel = image.pixels[y * 8 + x];
                // The lower left half; the diagonal runs from the upper left to the lower right corner. Of the four
                // samples of a pixel on it, two lie on the line itself and one below.
                let alpha = match x.cmp(&y) {
                    std::cmp::Ordering::Less => 255,
                    std::cmp::Ordering::Equal => 191,
                    std::cmp::Ordering::Greater => 0,
                };
                assert_eq!(pixel[3], alpha, "pixel {x}, {y}");
                if alpha > 0 {
                    assert_eq!(pixel[..3], RED.0);
                }
            }
        }
    }

    #[test]
    fn the_nearer_triangle_hides_the_farther_in_either_order() {
        let draw = |order: [(f64, Rgb); 2]| {
            let mut canvas = Canvas::new(8, 8, Some(Rgb::hex(0xffffff)));
            for (z, colour) in order {
                canvas.triangle(
                    &flat(8),
                    &right_triangle(8.0, z),
                    None,
                    Paint::Plain(colour),
                    &Material::FLAT,
                );
            }
            canvas.image()
        };
        let image = draw([(1.0, RED), (-1.0, BLUE)]);
        assert_eq!(image.pixels[7 * 8], [255, 0, 0, 255]);
        assert_eq!(image, draw([(-1.0, BLUE), (1.0, RED)]));
    }

    #[test]
    fn lines_are_hidden_by_what_is_before_them_unless_lifted() {
        let ends = [Point3::new(0.0, 2.0, -0.5), Point3::new(5.0, 2.0, -0.5)];
        for (lift, colour) in [(0.0, RED), (1.0, BLUE)] {
            let mut canvas = Canvas::new(8, 8, None);
            canvas.triangle(
                &flat(8),
                &right_triangle(8.0, 0.0),
                None,
                Paint::Plain(RED),
                &Material::FLAT,
            );
            canvas.line(&flat(8), &ends, 2.0, lift, BLUE);
            assert_eq!(canvas.image().pixels[5 * 8 + 2][..3], colour.0);
            assert!(!canvas.sees(&flat(8), &ends[0], 0.1));
            assert!(canvas.sees(&flat(8), &Point3::new(2.5, 2.5, lift - 0.5), 0.6));
        }
    }

    #[test]
    fn light_falls_from_the_upper_left_and_the_back_is_paler() {
        let shade = |normal: Vector3<f64>| Material::BODY.brightness(&normal.normalize());
        assert!(shade(Vector3::new(-1.0, 1.0, 1.0)) > shade(Vector3::new(1.0, -1.0, 1.0)));
        let paint = |mut corners: [Point3<f64>; 3], flip: bool| {
            if flip {
                corners.swap(1, 2);
            }
            let mut canvas = Canvas::new(8, 8, None);
            canvas.triangle(
                &flat(8),
                &corners,
                None,
                Paint::Plain(BLUE),
                &Material::BODY,
            );
            canvas.image().pixels[7 * 8]
        };
        let (front, back) = (
            paint(right_triangle(8.0, 0.0), false),
            paint(right_triangle(8.0, 0.0), true),
        );
        assert_eq!((front[0], front[1]), (0, 0));
        assert!(back[0] > 0 && back[2] < front[2]);
    }

    #[test]
    fn values_are_looked_up_at_every_sample_so_a_limit_is_a_sharp_line() {
        let scale = ColourScale::scale_factor(1.5);
        let mut canvas = Canvas::new(16, 16, None);
        let values = [1.0, 2.0, 1.0]; // 1.5 half-way to the right
        canvas.triangle(
            &flat(16),
            &right_triangle(16.0, 0.0),
            None,
            Paint::Values(values, &scale),
            &Material::FLAT,
        );
        let image = canvas.image();
        let flag = scale.flags().1.0;
        for x in 0..14 {
            assert_eq!(image.pixels[15 * 16 + x][..3] == flag, x >= 8, "column {x}");
        }
    }

    #[test]
    fn what_is_not_finite_or_far_outside_draws_nothing_and_does_not_fail() {
        let mut canvas = Canvas::new(4, 4, None);
        let before = canvas.image();
        let mut corners = right_triangle(4.0, 0.0);
        corners[1].x = f64::NAN;
        canvas.triangle(&flat(4), &corners, None, Paint::Plain(RED), &Material::BODY);
        let far = right_triangle(4.0, 0.0).map(|p| p + Vector3::new(1e300, 0.0, 0.0));
        canvas.triangle(&flat(4), &far, None, Paint::Plain(RED), &Material::BODY);
        canvas.line(
            &flat(4),
            &[Point3::new(f64::INFINITY, 0.0, 0.0), Point3::origin()],
            1.0,
            0.0,
            RED,
        );
        assert_eq!(canvas.image(), before);
        assert!(!canvas.sees(&flat(4), &Point3::new(f64::NAN, 0.0, 0.0), 0.0));
    }

    #[test]
    fn shade_gathers_below_an_edge_and_not_on_open_ground() {
        let mut canvas = Canvas::new(32, 32, None);
        let camera = flat(32);
        let white = Paint::Plain(Rgb::hex(0xffffff));
        canvas.triangle(
            &camera,
            &right_triangle(64.0, 0.0),
            None,
            white,
            &Material::FLAT,
        );
        canvas.triangle(
            &camera,
            &right_triangle(10.0, 3.0),
            None,
            white,
            &Material::FLAT,
        );
        canvas.occlude(&camera, 4.0, 0.8);
        let image = canvas.image();
        let beside = image.pixels[(31 - 6) * 32 + 6][0];
        assert!(beside < 240, "{beside}");
        assert_eq!(image.pixels[4 * 32 + 28], [255, 255, 255, 255]);
        assert_eq!(image.pixels[31 * 32], [255, 255, 255, 255]);
    }
}
