//! Finds a view of a whole scene.

use crate::Scene;
use crate::rays::{Camera, View, frame};
use crate::trace::Accelerator;
use bvh_core::{Aabb, Primitives, Ray};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// Views of scenes that should be seen from inside: the name, the eye, the point in the middle of
/// the picture, and the angle.
const INSIDE: [(&str, [f64; 3], [f64; 3], f64); 1] =
    [("sponza", [-11.3, 1.9, -0.9], [3.0, 4.4, 0.5], 62.0)];

/// Returns a view of a scene: the view in `INSIDE`, or otherwise a view from outside, from above
/// and a little from the side, whose distance just fits the whole box.
pub fn automatic(scene: &Scene, bounds: &Aabb, aspect: f64) -> View {
    if let Some((_, from, at, fov)) = INSIDE.iter().find(|view| view.0 == scene.name) {
        let view = View { from: (*from).into(), at: (*at).into(), fov: *fov };
        // A different scene may have the same name.
        if view.is_inside(bounds) {
            return view;
        }
    }
    let up = scene.up();
    // Meshes are seen from higher above, because their floor would otherwise be edge on.
    let (side, height) = match scene.primitives {
        Primitives::Triangles(_) => (0.62, 0.58),
        Primitives::Spheres(_) => (0.20, 0.17),
    };
    let front = front(up);
    framing(bounds, up.cross(front) * side + up * height + front, up, aspect, View::FOV)
}

/// Returns the direction from the middle of a scene to its front.
fn front(up: DVec3) -> DVec3 {
    if up == DVec3::Y { DVec3::Z } else { -DVec3::Y }
}

/// Returns the view, of a few from all sides and distances, in which most objects are seen. Most
/// rays hit the scene in it, unless no view is so.
pub fn of_most_objects(scene: &Scene, accelerator: &Accelerator, aspect: f64) -> View {
    const SIDES: u8 = 8;
    /// The share of rays that hit in a picture without too much background.
    const FULL: f64 = 0.7;
    let bounds = Aabb::union_of(&scene.boxes);
    let up = scene.up();
    let front = front(up);
    let right = up.cross(front);
    let mut views = Vec::new();
    for nearness in [1.0, 0.7, 0.45, 0.25] {
        for height in [0.58, 0.2] {
            for side in 0..SIDES {
                let angle = TAU * (f64::from(side) + 0.6) / f64::from(SIDES);
                let around = right * libm::cos(angle) + front * libm::sin(angle);
                let view = framing(&bounds, around + up * height, up, aspect, View::FOV);
                views.push(View { from: view.at.lerp(view.from, nearness), ..view });
            }
        }
    }
    let seen: Vec<(f64, usize)> =
        views.par_iter().map(|view| seen(view, up, accelerator, aspect)).collect();
    // Of equally good views, the first shows most around the scene.
    let best = (0..views.len()).rev().max_by(|&a, &b| {
        let [full_a, full_b] = [a, b].map(|view| seen[view].0.min(FULL));
        full_a.total_cmp(&full_b).then(seen[a].1.cmp(&seen[b].1))
    });
    best.map_or_else(|| automatic(scene, &bounds, aspect), |best| views.swap_remove(best))
}

/// Returns the share of the rays of a small picture that hit, and the number of objects that they
/// hit.
fn seen(view: &View, up: DVec3, accelerator: &Accelerator, aspect: f64) -> (f64, usize) {
    const ROWS: u32 = 40;
    let columns = (f64::from(ROWS) * aspect) as u32;
    let camera = Camera::new(view, up, columns, ROWS);
    let mut hits = 0;
    let mut objects = BTreeSet::new();
    for pixel in 0..columns * ROWS {
        let [x, y] = [pixel % columns, pixel / columns].map(|place| f64::from(place) + 0.5);
        let ray = Ray::half_line(camera.origin.as_vec3(), camera.direction(x, y).as_vec3());
        if let Some(hit) = ray.ok().and_then(|ray| accelerator.nearest_hit(&ray)) {
            hits += 1;
            objects.insert(hit.object);
        }
    }
    (f64::from(hits) / f64::from((columns * ROWS).max(1)), objects.len())
}

/// Returns the view of a box from the direction `towards_eye`, at the smallest distance that shows
/// the whole box with a small border. An empty box and a single point are seen from one unit away.
fn framing(bounds: &Aabb, towards_eye: DVec3, up: DVec3, aspect: f64, fov: f64) -> View {
    let (center, half) = match bounds.check() {
        Ok(()) => (bounds.doubled_centroid() * 0.5, bounds.extent() * 0.5),
        Err(_) => (DVec3::ZERO, DVec3::ZERO),
    };
    let back = towards_eye.normalize();
    let [right, top] = frame(-back, up);
    // The border is 6 % of the picture.
    let slope = libm::tan(fov.to_radians() / 2.0) / 1.06;
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
    View { from: center + back * distance, at: center, fov }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SPHERES;
    use crate::builtin::stand_ins::STAND_INS;
    use bvh_build::{Builder, median_cut};

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
    fn most_rays_of_the_view_of_most_objects_hit_every_built_in_scene() {
        let stand_ins = STAND_INS.map(|scene| scene.name);
        for name in stand_ins.into_iter().chain(SPHERES.map(|(name, _)| name)) {
            let scene = Scene::load(name).unwrap();
            let tree = median_cut::Config::default().build(&scene.boxes).unwrap();
            let accelerator = Accelerator::of_tree(&scene.primitives, &tree);
            let view = of_most_objects(&scene, &accelerator, 1.6);
            let (share, objects) = seen(&view, scene.up(), &accelerator, 1.6);
            assert!(share > 0.5 && objects > 20, "{name}: {share} of the rays, {objects} objects");
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
