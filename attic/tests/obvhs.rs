//! Trees can be converted to another library and back, and both libraries find the same hits in
//! them.

use ::obvhs::bvh2::builder::build_bvh2;
use ::obvhs::ray::RayHit;
use ::obvhs::{BvhBuildParams, aabb};
use attic::obvhs::{to_our_tree, to_theirs};
use bvh_core::{PreparedRay, Ray, Triangle, nearest_hit, validate};
use bvh_scenes::Scene;

#[test]
fn a_tree_of_obvhs_survives_a_round_trip_and_traces_the_same_hits() {
    for n in [1, 2, 3, 50, 4000] {
        let scene = Scene::load(&format!("S36:{n}")).unwrap();
        let (triangles, boxes) = (scene.triangles().unwrap(), &scene.boxes);
        let mut their_boxes = Vec::new();
        for aabb in boxes {
            let min = aabb.min.to_array();
            let max = aabb.max.to_array();
            their_boxes.push(aabb::Aabb::new(min.into(), max.into()));
        }
        for params in [BvhBuildParams::fast_build(), BvhBuildParams::medium_build()] {
            let built = build_bvh2(&their_boxes, params, &mut Default::default());
            let tree = to_our_tree(&built);
            validate(&tree, boxes).unwrap();
            assert_eq!(tree.nodes.len(), built.nodes.len());
            let returned = to_theirs(&tree);
            returned.validate(&their_boxes, false, true);
            assert_eq!(to_our_tree(&returned), tree);
            for i in 0..200u8 {
                let origin = [-3.0, f32::from(i % 14), f32::from(i / 14)];
                let direction = [1.0, 0.05, f32::from(i) * 0.01 - 1.0];
                let ray = Ray::half_line(origin, direction).unwrap();
                let their_ray = ::obvhs::ray::Ray::new_inf(origin.into(), direction.into());
                let expected = nearest_hit(&tree, triangles, &ray).map(|hit| hit.t);
                let mut hit = RayHit::none();
                let found = returned.ray_traverse(their_ray, &mut hit, |_, position| {
                    distance(triangles, &ray, returned.primitive_indices[position])
                });
                assert_eq!(found.then_some(hit.t), expected, "{n} triangles, ray {i}");
            }
        }
    }
}

/// Returns the distance of a triangle, or infinity as `obvhs` expects it for a miss.
fn distance(triangles: &[Triangle], ray: &Ray, id: u32) -> f32 {
    let hit = triangles[id as usize].intersect(&PreparedRay::new(ray), f32::MAX);
    hit.unwrap_or(f32::INFINITY)
}
