//! Finds a view that shows a whole scene.

use crate::Scene;
use crate::rays::{View, frame};
use bvh_core::{Aabb, Primitives};
use glam::DVec3;

/// Views of scenes that should be seen from inside: name, eye, middle of the picture, angle.
const INSIDE: [(&str, [f64; 3], [f64; 3], f64); 1] =
    [("sponza", [-11.3, 1.9, -0.9], [3.0, 4.4, 0.5], 62.0)];

/// A view of a scene: a known good one, or else from outside, from above and a little from the side, at the distance at
/// which the whole box just fits.
pub fn automatic(scene: &Scene, bounds: &Aabb, aspect: f64) -> View {
    if let Some((_, from, at, fov)) = INSIDE.iter().find(|view| view.0 == scene.name) {
        let view = View { from: (*from).into(), at: (*at).into(), fov: *fov };
        // Another scene may have the same name.
        if view.is_inside(bounds) {
            return view;
        }
    }
    let up = scene.up();
    // Meshes are seen from further above, because their floor would otherwise be seen edge on.
    let (side, height) = match scene.primitives {
        Primitives::Triangles(_) => (0.62, 0.58),
        Primitives::Spheres(_) => (0.20, 0.17),
    };
    let front = if up == DVec3::Y { DVec3::Z } else { -DVec3::Y };
    framing(bounds, up.cross(front) * side + up * height + front, up, aspect, View::FOV)
}

/// The view of a box from the direction `towards_eye`, at the least distance at which the whole box is inside the
/// picture, with a small border. An empty box and a single point are seen from one unit away.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rays::Camera;

    #[test]
    fn every_corner_of_every_box_is_in_the_picture_and_one_is_near_its_edge() {
        for (min, max) in [
            ([0.0; 3], [1.0; 3]),
            ([-9.0, 2.0, 1e6], [4.0, 2.0, 2e6]),
            ([5e5, 3e5, 4e4], [6e5, 4e5, 5e4]),
        ] {
            let bounds = Aabb::from((min, max));
            let towards = DVec3::new(0.4, 0.6, 1.0);
            let view = framing(&bounds, towards, DVec3::Y, 1.5, 40.0);
            let camera = Camera::new(&view, DVec3::Y, 300, 200);
            let mut widest: f64 = 0.0;
            for corner in 0..8 {
                let pick = |bit: usize| {
                    if corner >> bit & 1 == 1 { bounds.max[bit] } else { bounds.min[bit] }
                };
                let to = DVec3::from([0, 1, 2].map(|bit| f64::from(pick(bit)))) - camera.origin;
                let forward = camera.corner + camera.steps[0] * 150.0 + camera.steps[1] * 100.0;
                let scaled = to / to.dot(forward) - forward;
                let place = |axis: usize| {
                    scaled.dot(camera.steps[axis]) / camera.steps[axis].length_squared()
                };
                assert!(place(0).abs() < 150.0 && place(1).abs() < 100.0, "{bounds:?}");
                widest = widest
                    .max(place(0).abs() / 150.0)
                    .max(place(1).abs() / 100.0);
            }
            assert!(widest > 0.9, "{bounds:?}: {widest}");
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
