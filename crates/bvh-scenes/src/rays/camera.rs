//! The pinhole camera of pictures and of timed rays: a view in world units, and the directions
//! through its pixels.

use bvh_core::Aabb;
use glam::DVec3;

/// A view of a scene, in world units.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The eye.
    pub from: DVec3,
    /// The point in the middle of the picture.
    pub at: DVec3,
    /// The angle between the lower and the upper edge of the picture, in degrees, above 0 and below
    /// 180.
    pub fov: f64,
}

impl View {
    /// The default angle of view, in degrees: a moderate wide angle.
    pub const FOV: f64 = 40.0;

    /// Returns whether the eye is in this box.
    pub fn is_inside(&self, bounds: &Aabb) -> bool {
        let eye = self.from.as_vec3();
        bounds.contains(&Aabb { min: eye, max: eye })
    }
}

/// Returns the directions of right and top in a picture whose view direction is `forward`.
pub fn frame(forward: DVec3, up: DVec3) -> [DVec3; 2] {
    // A view straight up or down has no preferred direction, so any perpendicular one will do.
    let right =
        forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
    [right, right.cross(forward)]
}

/// A view ready to make rays.
#[derive(Clone, Debug)]
pub struct Camera {
    /// The point at which all rays begin.
    pub origin: DVec3,
    /// The vector from the origin to the upper left corner of the picture at distance 1.
    corner: DVec3,
    /// The vectors from one pixel to the next one on the right and to the next one below.
    steps: [DVec3; 2],
}

impl Camera {
    /// Creates the camera of a picture of this size in pixels. If the eye is the point in the
    /// middle of the picture, the camera looks along −z.
    pub fn new(view: &View, up: DVec3, width: u32, height: u32) -> Self {
        let forward = (view.at - view.from).try_normalize().unwrap_or(DVec3::NEG_Z);
        let [right, top] = frame(forward, up);
        // The tangent of the platform's library would differ between machines.
        let pixel = 2.0 * libm::tan(view.fov.to_radians() / 2.0) / f64::from(height);
        let steps = [right * pixel, -top * pixel];
        let corner = forward - (steps[0] * f64::from(width) + steps[1] * f64::from(height)) * 0.5;
        Self { origin: view.from, corner, steps }
    }

    /// Returns the unit direction through a point of the picture, given in pixels from its upper
    /// left corner.
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        (self.corner + self.steps[0] * x + self.steps[1] * y).normalize()
    }
}
