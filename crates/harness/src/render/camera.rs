//! Where the eye is: a view given or found, and the rays through its pixels.

use crate::scenes::{Primitives, Scene};
use bvh_core::Aabb;
use glam::DVec3;

/// A view of a scene, in world units.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The eye.
    pub from: DVec3,
    /// What is in the middle of the picture.
    pub at: DVec3,
    /// Angle of view from the lower edge of the picture to the upper one, degrees, above 0 and below 180.
    pub fov: f64,
}

impl View {
    /// Degrees, unless something else is asked for: a moderate wide angle.
    pub const FOV: f64 = 40.0;

    /// Whether the eye is in this box.
    pub fn is_inside(&self, bounds: &Aabb) -> bool {
        let eye = self.from.as_vec3();
        bounds.contains(&Aabb { min: eye, max: eye })
    }
}

/// Views of scenes that are to be seen from inside: name, eye, middle of the picture, angle.
const INSIDE: [(&str, [f64; 3], [f64; 3], f64); 1] = [("sponza", [-11.3, 1.9, -0.9], [3.0, 4.4, 0.5], 62.0)];

/// The direction that is up: y, as most modellers have it, but z in the stand-ins.
pub fn up(scene: &Scene) -> DVec3 {
    if scene.kind == "stand-in" { DVec3::Z } else { DVec3::Y }
}

/// A view for a scene: one known to be good, or else from outside, from above and a little from the side, at the
/// distance at which the whole box just fits.
pub fn automatic(scene: &Scene, bounds: &Aabb, aspect: f64) -> View {
    if let Some((_, from, at, fov)) = INSIDE.iter().find(|view| view.0 == scene.name) {
        let view = View { from: (*from).into(), at: (*at).into(), fov: *fov };
        // Another scene may have the same name.
        if view.is_inside(bounds) {
            return view;
        }
    }
    let up = up(scene);
    // From further above for meshes, whose floor would otherwise be seen edge on.
    let (side, height) = match scene.primitives {
        Primitives::Triangles(_) => (0.62, 0.58),
        Primitives::Spheres(_) => (0.20, 0.17),
    };
    let front = if up == DVec3::Y { DVec3::Z } else { -DVec3::Y };
    framing(bounds, up.cross(front) * side + up * height + front, up, aspect, View::FOV)
}

/// The view of a box from `towards_eye` at the least distance at which it is inside the picture, with a small border.
/// Of a box without extent or of none, from one unit away.
fn framing(bounds: &Aabb, towards_eye: DVec3, up: DVec3, aspect: f64, fov: f64) -> View {
    let (center, half) = match bounds.check() {
        Ok(()) => (bounds.doubled_centroid() * 0.5, bounds.extent() * 0.5),
        Err(_) => (DVec3::ZERO, DVec3::ZERO),
    };
    let back = towards_eye.normalize();
    let [right, top] = frame(-back, up);
    let slope = libm::tan(fov.to_radians() / 2.0) / 1.06;
    let mut distance: f64 = 0.0;
    for corner in 0..8 {
        let sign = |bit: i32| f64::from((corner >> bit & 1) * 2 - 1);
        let corner = half * DVec3::new(sign(0), sign(1), sign(2));
        let needed = (corner.dot(right).abs() / aspect).max(corner.dot(top).abs()) / slope;
        distance = distance.max(needed + corner.dot(back));
    }
    if distance == 0.0 {
        distance = 1.0;
    }
    View { from: center + back * distance, at: center, fov }
}

/// Right and top of a picture seen in this direction.
fn frame(forward: DVec3, up: DVec3) -> [DVec3; 2] {
    // Straight up or down: any right will do.
    let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
    [right, right.cross(forward)]
}

/// A view ready to make rays.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Where all rays begin.
    pub origin: DVec3,
    /// To the upper left corner of the picture.
    corner: DVec3,
    /// From one pixel to the next, to the right and down.
    steps: [DVec3; 2],
}

impl Camera {
    /// The camera of a picture of this size in pixels. A view from where it looks at looks along −z.
    pub fn new(view: &View, up: DVec3, width: u32, height: u32) -> Self {
        let forward = (view.at - view.from).try_normalize().unwrap_or(DVec3::NEG_Z);
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
    fn every_corner_of_every_box_is_in_the_picture_and_one_is_near_its_edge() {
        for (min, max) in
            [([0.0; 3], [1.0; 3]), ([-9.0, 2.0, 1e6], [4.0, 2.0, 2e6]), ([5e5, 3e5, 4e4], [6e5, 4e5, 5e4])]
        {
            let bounds = Aabb::from((min, max));
            let towards = DVec3::new(0.4, 0.6, 1.0);
            let view = framing(&bounds, towards, DVec3::Y, 1.5, 40.0);
            let camera = Camera::new(&view, DVec3::Y, 300, 200);
            let mut widest: f64 = 0.0;
            for corner in 0..8 {
                let pick = |bit: usize| if corner >> bit & 1 == 1 { bounds.max[bit] } else { bounds.min[bit] };
                let to = DVec3::from([0, 1, 2].map(|bit| f64::from(pick(bit)))) - camera.origin;
                let forward = camera.corner + camera.steps[0] * 150.0 + camera.steps[1] * 100.0;
                let scaled = to / to.dot(forward) - forward;
                let place = |axis: usize| scaled.dot(camera.steps[axis]) / camera.steps[axis].length_squared();
                assert!(place(0).abs() < 150.0 && place(1).abs() < 100.0, "{bounds:?}");
                widest = widest.max(place(0).abs() / 150.0).max(place(1).abs() / 100.0);
            }
            assert!(widest > 0.9, "{bounds:?}: {widest}");
        }
    }

    #[test]
    fn the_middle_of_the_picture_looks_at_the_middle_of_the_view() {
        for at in [DVec3::X, DVec3::Y, DVec3::new(1.0, -2.0, 0.3)] {
            let camera = Camera::new(&View { from: DVec3::ZERO, at, fov: 60.0 }, DVec3::Y, 640, 480);
            assert!(camera.direction(320.0, 240.0).distance(at.normalize()) < 1e-12);
        }
    }

    #[test]
    fn a_scene_without_extent_is_seen_from_somewhere() {
        for bounds in [Aabb::EMPTY, Aabb::from(([1.0; 3], [1.0; 3]))] {
            let view = framing(&bounds, DVec3::ONE, DVec3::Y, 1.0, 40.0);
            assert!(view.from.is_finite() && view.from != view.at);
        }
    }
}
