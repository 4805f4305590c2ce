//! Finds a view of a whole scene.

use crate::Scene;
use crate::rays::{View, frame};
use bvh_core::{Aabb, Primitives};
use glam::DVec3;

/// Views of scenes that should be seen from inside: the name, the eye, the point in the middle of
/// the picture, and the angle.
const INSIDE: [(&str, [f64; 3], [f64; 3], f64); 1] =
    [("sponza", [-11.3, 1.9, -0.9], [3.0, 4.4, 0.5], 62.0)];

/// Returns a view of a scene: the view in `INSIDE`, or otherwise a view from outside, from above
/// and a little from the side, whose distance just fits the whole box.
pub fn automatic(scene: &Scene, aspect: f64) -> View {
    let bounds = &Aabb::union_of(&scene.boxes);
    if let Some((_, from, at, fov)) = INSIDE.iter().find(|view| view.0 == scene.name) {
        let view = View { from: (*from).into(), at: (*at).into(), fov: *fov };
        // A different scene may have the same name.
        if view.is_inside(bounds) {
            return view;
        }
    }
    let up = scene.up();
    let front = if up == DVec3::Y { DVec3::Z } else { -DVec3::Y };
    // Meshes are seen from higher above, because their floor would otherwise be edge on.
    let (side, height) = match scene.primitives {
        Primitives::Triangles(_) => (0.62, 0.58),
        Primitives::Spheres(_) => (0.20, 0.17),
    };
    framing(bounds, up.cross(front) * side + up * height + front, up, aspect)
}

/// Returns the view of a box from the direction `towards_eye`, at the smallest distance that shows
/// the whole box with a small border. An empty box and a single point are seen from one unit away.
fn framing(bounds: &Aabb, towards_eye: DVec3, up: DVec3, aspect: f64) -> View {
    let (center, half) = match bounds.check() {
        Ok(()) => (bounds.doubled_centroid() * 0.5, bounds.extent() * 0.5),
        Err(_) => (DVec3::ZERO, DVec3::ZERO),
    };
    let back = towards_eye.normalize();
    let [right, top] = frame(-back, up);
    // The border is 6 % of the picture.
    let slope = libm::tan(View::FOV.to_radians() / 2.0) / 1.06;
    let mut distance: f64 = 0.0;
    for number in 0..8 {
        // The bits of the number choose the corner's side along each axis.
        let signs = [0, 1, 2].map(|bit| f64::from((number >> bit & 1) * 2 - 1));
        let corner = half * DVec3::from_array(signs);
        let needed = (corner.dot(right).abs() / aspect).max(corner.dot(top).abs()) / slope;
        distance = distance.max(needed + corner.dot(back));
    }
    if distance == 0.0 {
        distance = 1.0;
    }
    View { from: center + back * distance, at: center, fov: View::FOV }
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
            let view = framing(&bounds, towards, DVec3::Y, 1.5);
            let camera = Camera::new(&view, DVec3::Y, 300, 200);
            let mut widest: f64 = 0.0;
            for number in 0..8 {
                let corner = DVec3::from([0, 1, 2].map(|axis| {
                    let side = if number >> axis & 1 == 1 { bounds.max } else { bounds.min };
                    f64::from(side[axis])
                }));
                let to = corner - camera.origin;
                let forward = camera.corner + camera.steps[0] * 150.0 + camera.steps[1] * 100.0;
                let scaled = to / to.dot(forward) - forward;
                // The corner's distance from the middle of the picture, in pixels.
                let [x, y] =
                    camera.steps.map(|step| (scaled.dot(step) / step.length_squared()).abs());
                assert!(x < 150.0 && y < 100.0, "{bounds:?}");
                widest = widest.max(x / 150.0).max(y / 100.0);
            }
            assert!(widest > 0.9, "{bounds:?}: {widest}");
        }
    }

    #[test]
    fn a_scene_without_extent_is_seen_from_somewhere() {
        for bounds in [Aabb::EMPTY, Aabb::from(([1.0; 3], [1.0; 3]))] {
            let view = framing(&bounds, DVec3::ONE, DVec3::Y, 1.0);
            assert!(view.from.is_finite() && view.from != view.at);
        }
    }
}
