//! Finds a view of a whole scene.

use crate::Scene;
use crate::rays::{View, frame};
use bvh_core::{Aabb, Primitives};
use glam::DVec3;

/// Returns a view of a scene from outside, from above and a little from the side, whose distance
/// just fits the whole box.
pub fn automatic(scene: &Scene, aspect: f64) -> View {
    upright(scene, scene.up(), aspect)
}

/// Returns the view that [`automatic`] does, with this direction up.
pub fn upright(scene: &Scene, up: DVec3, aspect: f64) -> View {
    let bounds = &Aabb::union_of(&scene.boxes);
    let front = if up == DVec3::Y { DVec3::Z } else { -DVec3::Y };
    // Meshes are seen from higher above, because their floor would otherwise be edge on.
    let (side, height) = match scene.primitives {
        Primitives::Triangles(_) | Primitives::Doubles(_) => (0.62, 0.58),
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
            let forward = (view.at - view.from).normalize();
            let camera = Camera::new(&view, DVec3::Y, 300, 200);
            assert!(camera.direction(150.0, 100.0).distance(forward) < 1e-12, "{bounds:?}");
            let [right, top] = frame(forward, DVec3::Y);
            let slope = libm::tan(View::FOV.to_radians() / 2.0);
            let mut widest: f64 = 0.0;
            for number in 0..8 {
                let corner = DVec3::from([0, 1, 2].map(|axis| {
                    let side = if number >> axis & 1 == 1 { bounds.max } else { bounds.min };
                    f64::from(side[axis])
                }));
                let to = corner - view.from;
                // The distance from the middle of the picture over that of its edge.
                let far = to.dot(forward) * slope;
                let away = (to.dot(right).abs() / 1.5).max(to.dot(top).abs()) / far;
                assert!(far > 0.0 && away < 1.0, "{bounds:?}");
                widest = widest.max(away);
            }
            assert!(widest > 0.9, "{bounds:?}: {widest}");
        }
    }
}
