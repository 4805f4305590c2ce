//! The pinhole camera of pictures and of timed rays: a view in world units, and the directions through its pixels.

use bvh_core::Aabb;
use glam::DVec3;

/// A view of a scene, in world units.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The eye.
    pub from: DVec3,
    /// The point in the middle of the picture.
    pub at: DVec3,
    /// Angle of view from the lower edge of the picture to the upper one, degrees, above 0 and below 180.
    pub fov: f64,
}

impl View {
    /// The default angle of view, in degrees: a moderate wide angle.
    pub const FOV: f64 = 40.0;

    /// Whether the eye is in this box.
    pub fn is_inside(&self, bounds: &Aabb) -> bool {
        let eye = self.from.as_vec3();
        bounds.contains(&Aabb { min: eye, max: eye })
    }
}

/// The directions of right and top in a picture seen in the direction `forward`.
pub fn frame(forward: DVec3, up: DVec3) -> [DVec3; 2] {
    // Seen straight up or down, any direction may be the right one.
    let right = forward
        .cross(up)
        .try_normalize()
        .unwrap_or_else(|| forward.any_orthonormal_vector());
    [right, right.cross(forward)]
}

/// A view ready to make rays.
#[derive(Clone, Debug)]
pub struct Camera {
    /// The point at which all rays begin.
    pub origin: DVec3,
    /// From the origin to the upper left corner of the picture, at distance 1 along the view.
    pub(crate) corner: DVec3,
    /// From one pixel to the next, to the right and down.
    pub(crate) steps: [DVec3; 2],
}

impl Camera {
    /// The camera of a picture of this size in pixels. A view from the point that it looks at looks along −z.
    pub fn new(view: &View, up: DVec3, width: u32, height: u32) -> Self {
        let forward = (view.at - view.from)
            .try_normalize()
            .unwrap_or(DVec3::NEG_Z);
        let [right, top] = frame(forward, up);
        let pixel = 2.0 * libm::tan(view.fov.to_radians() / 2.0) / f64::from(height);
        let steps = [right * pixel, -top * pixel];
        let corner = forward - (steps[0] * f64::from(width) + steps[1] * f64::from(height)) * 0.5;
        Self { origin: view.from, corner, steps }
    }

    /// The unit direction through a point of the picture, in pixels from its upper left corner.
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        (self.corner + self.steps[0] * x + self.steps[1] * y).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_picture_looks_at_the_middle_of_the_view() {
        for at in [DVec3::X, DVec3::Y, DVec3::new(1.0, -2.0, 0.3)] {
            let camera =
                Camera::new(&View { from: DVec3::ZERO, at, fov: 60.0 }, DVec3::Y, 640, 480);
            assert!(
                camera
                    .direction(320.0, 240.0)
                    .distance(at.normalize())
                    < 1e-12
            );
        }
    }
}
