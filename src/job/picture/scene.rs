//! What is drawn: triangles with their paint, and lines, kept apart from any camera so that one scene gives many views.

use nalgebra::{Point2, Point3, Vector3};

use super::camera::Camera;
use super::canvas::{Canvas, Material, Paint};
use super::colour::{ColourScale, Rgb};
use crate::base::ids::{Id as _, Per};
use crate::conformal::Layout;
use crate::linkage::{Colour, Linkage};
use crate::mesh::{HalfedgeId, Surface, VertexId};

/// The body under a linkage.
const BODY: Rgb = Rgb::hex(0xd8dfe6);
/// Triangles of the two colours: near enough to be one sheet, far enough to see how they turn.
const UP: Rgb = Rgb::hex(0xe39a4c);
const DOWN: Rgb = Rgb::hex(0xf1b56e);
/// Outlines.
const INK: Rgb = Rgb::hex(0x4a3423);
/// Rims of surfaces and layouts.
const RIM: Rgb = Rgb::hex(0x2b3440);

/// How far the body under a linkage is drawn inside the surface, in L: flat triangles cut the corner of a curved
/// surface by at most (L/√3)²/2r, which is 0.17 L at a radius of one L.
const INSET: f64 = 0.18;

/// Width of outlines, pixels.
const OUTLINE_PX: f64 = 0.9;

/// A line counts as lying on its surface if it is no farther behind it than this part of the whole drawing's size.
const LINE_LIFT: f64 = 1.2e-3;

/// Triangles of one kind.
#[derive(Clone, Debug)]
struct Part<'a> {
    corners: Vec<[Point3<f64>; 3]>,
    /// At the corners; empty: flat triangles.
    normals: Vec<[Vector3<f64>; 3]>,
    paint: Paints<'a>,
    material: Material,
}

/// The paint of all triangles of a part.
#[derive(Clone, Debug)]
enum Paints<'a> {
    Plain(Rgb),
    Each(Vec<Rgb>),
    Values(Vec<[f64; 3]>, &'a ColourScale),
}

#[derive(Clone, Copy, Debug)]
struct Line {
    ends: [Point3<f64>; 2],
    width_px: f64,
    colour: Rgb,
}

/// Triangles and lines in space, millimetres.
#[derive(Clone, Debug, Default)]
pub struct Scene<'a> {
    parts: Vec<Part<'a>>,
    lines: Vec<Line>,
}

impl<'a> Scene<'a> {
    /// A surface coloured by a value at each vertex.
    pub fn surface(surface: &Surface, values: &Per<VertexId, f64>, scale: &'a ColourScale) -> Self {
        let part = Part {
            corners: surface.faces().ids().map(|f| surface.corners(f)).collect(),
            normals: corner_normals(surface),
            paint: Paints::Values(face_values(surface, values), scale),
            material: Material::MAP,
        };
        let lines = surface
            .halfedges()
            .filter(|h| surface.twin(*h).is_none())
            .map(|h| Line {
                ends: [
                    surface.position(surface.tail(h)),
                    surface.position(surface.head(h)),
                ],
                width_px: 1.2,
                colour: RIM,
            })
            .collect();
        Self {
            parts: vec![part],
            lines,
        }
    }

    /// A layout in the plane z = 0 coloured by a value at each vertex, with its outline (rim and cut).
    pub fn layout(
        surface: &Surface,
        layout: &Layout,
        values: &Per<VertexId, f64>,
        scale: &'a ColourScale,
    ) -> Self {
        let part = Part {
            corners: layout.corners.iter().map(|c| c.map(in_plane)).collect(),
            normals: Vec::new(),
            paint: Paints::Values(face_values(surface, values), scale),
            material: Material::FLAT,
        };
        let lines = surface
            .halfedges()
            .filter(|h| surface.twin(*h).is_none() || layout.seam.contains_key(h))
            .map(|h: HalfedgeId| {
                let c = layout.corners[h.face()];
                Line {
                    ends: [in_plane(c[h.corner()]), in_plane(c[(h.corner() + 1) % 3])],
                    width_px: 1.4,
                    colour: RIM,
                }
            })
            .collect();
        Self {
            parts: vec![part],
            lines,
        }
    }

    /// A linkage over its surface, which shows pale through the openings. `positions` are by point; triangles with a
    /// point that has none are left out.
    pub fn linkage(surface: &Surface, linkage: &Linkage, positions: &[Point3<f64>]) -> Self {
        let mut scene = Self::default();
        scene.body(surface, INSET * linkage.edge_mm);
        let (corners, ids): (Vec<_>, Vec<_>) = placed(linkage, positions).unzip();
        let colours = ids
            .iter()
            .map(|&t| match linkage.triangles[t].colour {
                Colour::Up => UP,
                Colour::Down => DOWN,
            })
            .collect();
        scene.rigid(corners, Paints::Each(colours), Material::BODY);
        scene
    }

    /// A linkage coloured by a value at each of its points; without the surface, which would hide the triangles that
    /// lie under it.
    pub fn linkage_by_value(
        linkage: &Linkage,
        positions: &[Point3<f64>],
        values: &[f64],
        scale: &'a ColourScale,
    ) -> Self {
        let mut scene = Self::default();
        let (corners, ids): (Vec<_>, Vec<_>) = placed(linkage, positions).unzip();
        let values = ids
            .iter()
            .map(|&t| {
                linkage.triangles[t]
                    .points
                    .map(|p| values.get(p.index()).copied().unwrap_or(f64::NAN))
            })
            .collect();
        scene.rigid(corners, Paints::Values(values, scale), Material::MAP);
        scene
    }

    /// The closed linkage on the sheet, in the plane z = 0, with its slits.
    pub fn sheet(linkage: &Linkage) -> Self {
        /// Part of a slit's side that stays at the hinge: for the eye only, wider than a real hinge.
        const HINGE: f64 = 0.12;
        let part = Part {
            corners: linkage
                .triangles
                .iter()
                .map(|t| t.flat.map(in_plane))
                .collect(),
            normals: Vec::new(),
            paint: Paints::Plain(DOWN),
            material: Material::FLAT,
        };
        let neighbours = linkage.flat_neighbours();
        let mut lines = Vec::new();
        for (id, triangle) in linkage.triangles.iter_ids() {
            let ccw = linkage.handedness.counter_clockwise(triangle.colour);
            for side in 0..3 {
                let (a, b) = (triangle.flat[side], triangle.flat[(side + 1) % 3]);
                let (from, hinge) = if ccw { (a, b) } else { (b, a) };
                let joined = neighbours[id][side].is_some();
                // A shared slit is drawn once, from its counter-clockwise triangle; a side of the outline in full.
                if joined && !ccw {
                    continue;
                }
                let to = if joined {
                    from + (hinge - from) * (1.0 - HINGE)
                } else {
                    hinge
                };
                lines.push(Line {
                    ends: [in_plane(from), in_plane(to)],
                    width_px: if joined { 1.0 } else { 1.6 },
                    colour: INK,
                });
            }
        }
        Self {
            parts: vec![part],
            lines,
        }
    }

    /// Every corner that is drawn: what a camera is fitted to.
    pub fn points(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        self.parts
            .iter()
            .flat_map(|p| p.corners.iter().flatten().copied())
    }

    /// Draws everything.
    pub fn draw(&self, canvas: &mut Canvas, camera: &Camera) {
        for part in &self.parts {
            for (i, corners) in part.corners.iter().enumerate() {
                let paint = match &part.paint {
                    Paints::Plain(colour) => Paint::Plain(*colour),
                    Paints::Each(colours) => Paint::Plain(colours[i]),
                    Paints::Values(values, scale) => Paint::Values(values[i], scale),
                };
                canvas.triangle(camera, corners, part.normals.get(i), paint, &part.material);
            }
        }
        let lift = self.lift(camera);
        for line in &self.lines {
            canvas.line(camera, &line.ends, line.width_px, lift, line.colour);
        }
    }

    /// How far (millimetres) a line may lie behind the surface that it lies on.
    fn lift(&self, camera: &Camera) -> f64 {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for [x, y, _] in self.points().map(|p| camera.project(&p)) {
            low = low.min(x).min(y);
            high = high.max(x).max(y);
        }
        if low < high {
            LINE_LIFT * (high - low) / camera.scale
        } else {
            0.0
        }
    }

    /// The pale surface, moved inwards along its normals.
    fn body(&mut self, surface: &Surface, inset_mm: f64) {
        let normals = surface.vertex_normals();
        let inside: Per<VertexId, Point3<f64>> = surface
            .positions()
            .iter_ids()
            .map(|(v, p)| p - normals[v] * inset_mm)
            .collect();
        self.parts.push(Part {
            corners: surface
                .faces()
                .iter()
                .map(|f| f.map(|v| inside[v]))
                .collect(),
            normals: corner_normals(surface),
            paint: Paints::Plain(BODY),
            material: Material::BODY,
        });
    }

    /// Flat triangles with outlines.
    fn rigid(&mut self, corners: Vec<[Point3<f64>; 3]>, paint: Paints<'a>, material: Material) {
        for t in &corners {
            for k in 0..3 {
                self.lines.push(Line {
                    ends: [t[k], t[(k + 1) % 3]],
                    width_px: OUTLINE_PX,
                    colour: INK,
                });
            }
        }
        self.parts.push(Part {
            corners,
            normals: Vec::new(),
            paint,
            material,
        });
    }
}

fn in_plane(p: Point2<f64>) -> Point3<f64> {
    Point3::new(p.x, p.y, 0.0)
}

fn corner_normals(surface: &Surface) -> Vec<[Vector3<f64>; 3]> {
    let normals = surface.vertex_normals();
    surface
        .faces()
        .iter()
        .map(|f| f.map(|v| normals[v]))
        .collect()
}

fn face_values(surface: &Surface, values: &Per<VertexId, f64>) -> Vec<[f64; 3]> {
    surface
        .faces()
        .iter()
        .map(|f| f.map(|v| values.get(v.index()).copied().unwrap_or(f64::NAN)))
        .collect()
}

/// Triangles whose points all have a position.
fn placed<'l>(
    linkage: &'l Linkage,
    positions: &'l [Point3<f64>],
) -> impl Iterator<Item = ([Point3<f64>; 3], crate::linkage::TriangleId)> + 'l {
    linkage.triangles.iter_ids().filter_map(|(id, t)| {
        let [a, b, c] = t.points.map(|p| positions.get(p.index()).copied());
        Some(([a?, b?, c?], id))
    })
}

#[cfg(test)]
mod tests {
    use super::super::camera::{Frame, View};
    use super::*;
    use crate::linkage::Handedness;

    fn square() -> Surface {
        let p = [[0., 0.], [10., 0.], [10., 10.], [0., 10.]];
        let p = p.map(|[x, y]| Point3::new(x, y, 0.0)).to_vec();
        Surface::new(p, vec![[0, 1, 2], [0, 2, 3]]).unwrap()
    }

    #[test]
    fn a_surface_shows_the_colours_of_its_values_and_its_rim() {
        let surface = square();
        let scale = ColourScale::scale_factor(2.0);
        let values = Per::filled(4, 3.0);
        let scene = Scene::surface(&surface, &values, &scale);
        let camera = Camera::fit(
            &View::front(&surface),
            scene.points(),
            Frame::whole(60, 60),
            5.0,
        );
        let mut canvas = Canvas::new(60, 60, None);
        scene.draw(&mut canvas, &camera);
        let image = canvas.image();
        let [r, g, b] = scale.flags().1.0;
        let [r2, g2, b2, a] = image.pixels[20 * 60 + 30];
        assert_eq!(a, 255);
        for (flag, seen) in [(r, r2), (g, g2), (b, b2)] {
            assert!((f64::from(flag) - f64::from(seen)).abs() < 25.0);
        }
        // The rim's line covers half of the outermost pixel.
        assert!(image.pixels[5 * 60 + 30][0] + 60 < r2);
    }

    #[test]
    fn a_sheet_has_all_its_triangles_and_a_line_for_every_slit_and_rim_side() {
        let linkage = Linkage::patch(5.0, Handedness::Left, &Linkage::hexagon_cells(3));
        let scene = Scene::sheet(&linkage);
        assert_eq!(scene.points().count(), 3 * linkage.triangles.len());
        let rim = 3 * linkage.triangles.len() - 2 * linkage.hinges.len();
        assert_eq!(scene.lines.len(), linkage.hinges.len() + rim);
    }

    #[test]
    fn triangles_without_positions_are_left_out() {
        let linkage = Linkage::patch(1.0, Handedness::Right, &Linkage::hexagon_cells(1));
        let scene = Scene::linkage(&square(), &linkage, &[Point3::origin()]);
        assert_eq!(scene.points().count(), 6);
        let scale = ColourScale::distance(0.1);
        let all = vec![Point3::origin(); linkage.point_count()];
        let scene = Scene::linkage_by_value(&linkage, &all, &[], &scale);
        assert_eq!(scene.points().count(), 18);
    }
}
