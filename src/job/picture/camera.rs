//! Where one looks from, and where on the picture a point of space lands.

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};

use crate::mesh::Surface;

/// A direction of looking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// From what is seen towards the eye.
    pub direction: Vector3<f64>,
    /// What is up on the picture; need not be perpendicular.
    pub up: Vector3<f64>,
}

impl View {
    /// A flat sheet: X right, Y up.
    pub fn flat() -> Self {
        Self {
            direction: Vector3::z(),
            up: Vector3::y(),
        }
    }

    /// A surface from its front: along its mean normal, +Y up (−Z or +Z where it faces up or down), as the layout
    /// turns it.
    pub fn front(surface: &Surface) -> Self {
        let (direction, up) = surface.front();
        Self { direction, up }
    }

    /// The eye moved around the object: to its own right by `azimuth`, then upwards by `elevation`, radians.
    pub fn turned(&self, azimuth: f64, elevation: f64) -> Self {
        let [right, up, _] = self.axes();
        let around = UnitQuaternion::from_axis_angle(&Unit::new_unchecked(up), azimuth);
        let right = around * right;
        let over = UnitQuaternion::from_axis_angle(&Unit::new_unchecked(right), -elevation);
        let turn = over * around;
        Self {
            direction: turn * self.direction,
            up: turn * up,
        }
    }

    /// Right, up and towards the eye: orthonormal, whatever the view holds.
    pub fn axes(&self) -> [Vector3<f64>; 3] {
        let toward = self.direction.try_normalize(0.0).unwrap_or_else(Vector3::z);
        let right = [self.up, Vector3::y(), Vector3::z()]
            .iter()
            .find_map(|up| up.cross(&toward).try_normalize(1e-9))
            .unwrap_or_else(Vector3::x);
        [right, toward.cross(&right), toward]
    }
}

/// A rectangle of a picture, pixels, Y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Frame {
    /// A whole picture.
    pub fn whole(width: usize, height: usize) -> Self {
        Self {
            x: 0.0,
            y: 0.0,
            width: width as f64,
            height: height as f64,
        }
    }
}

/// A parallel projection onto a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    axes: [Vector3<f64>; 3],
    /// What lands in the middle of the frame.
    target: Point3<f64>,
    /// The middle of the frame, pixels.
    middle: [f64; 2],
    /// Pixels a millimetre.
    pub scale: f64,
}

impl Camera {
    /// The largest picture of all `points` in a frame, with `margin` (pixels) left free all round. Points that are
    /// not finite are not looked at.
    pub fn fit(
        view: &View,
        points: impl Iterator<Item = Point3<f64>>,
        frame: Frame,
        margin: f64,
    ) -> Self {
        let axes = view.axes();
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in points.filter(|p| p.iter().all(|x| x.is_finite())) {
            for k in 0..3 {
                let at = axes[k].dot(&p.coords);
                low[k] = low[k].min(at);
                high[k] = high[k].max(at);
            }
        }
        if low[0] > high[0] {
            (low, high) = ([0.0; 3], [1.0; 3]);
        }
        let room = |size: f64| (size - 2.0 * margin).max(1.0);
        let extent = |k: usize| (high[k] - low[k]).max(f64::MIN_POSITIVE);
        let scale = (room(frame.width) / extent(0))
            .min(room(frame.height) / extent(1))
            .min(1e12);
        let centre = (0..3)
            .map(|k| axes[k] * (0.5 * low[k] + 0.5 * high[k]))
            .sum::<Vector3<f64>>();
        Self {
            axes,
            target: Point3::from(centre),
            middle: [frame.x + 0.5 * frame.width, frame.y + 0.5 * frame.height],
            scale,
        }
    }

    /// The same middle at another scale, in pixels a millimetre: several pictures of one object to one measure.
    pub fn with_scale(mut self, scale: f64) -> Self {
        self.scale = scale;
        self
    }

    /// Pixels from the left, pixels from the top, millimetres towards the eye.
    #[inline]
    pub fn project(&self, point: &Point3<f64>) -> [f64; 3] {
        let offset = point - self.target;
        [
            self.middle[0] + self.axes[0].dot(&offset) * self.scale,
            self.middle[1] - self.axes[1].dot(&offset) * self.scale,
            self.axes[2].dot(&offset),
        ]
    }

    /// A direction in the camera's own frame: right, up, towards the eye.
    #[inline]
    pub fn local(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.axes[0].dot(direction),
            self.axes[1].dot(direction),
            self.axes[2].dot(direction),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn the_flat_view_has_x_right_and_y_up_and_fills_the_frame_to_the_margin() {
        let corners = [Point3::new(0.0, 0.0, 0.0), Point3::new(20.0, 10.0, 0.0)];
        let camera = Camera::fit(
            &View::flat(),
            corners.into_iter(),
            Frame::whole(120, 100),
            10.0,
        );
        assert_eq!(camera.scale, 5.0);
        assert_eq!(camera.project(&corners[0]), [10.0, 75.0, 0.0]);
        assert_eq!(camera.project(&corners[1]), [110.0, 25.0, 0.0]);
    }

    #[test]
    fn the_eye_turns_to_the_right_and_up() {
        let side = View::flat().turned(FRAC_PI_2, 0.0);
        assert!((side.direction - Vector3::x()).norm() < 1e-12);
        assert!((side.up - Vector3::y()).norm() < 1e-12);
        let above = View::flat().turned(0.0, FRAC_PI_2);
        assert!((above.direction - Vector3::y()).norm() < 1e-12);
        assert!((above.up + Vector3::z()).norm() < 1e-12);
    }

    #[test]
    fn nothing_to_see_and_no_direction_still_give_a_camera() {
        let nowhere = View {
            direction: Vector3::zeros(),
            up: Vector3::zeros(),
        };
        let camera = Camera::fit(&nowhere, std::iter::empty(), Frame::whole(10, 10), 20.0);
        assert!(
            camera
                .project(&Point3::origin())
                .iter()
                .all(|x| x.is_finite())
        );
    }
}
