//! Trees can be converted to another library and back, and both libraries find the same hits in
//! them.

use ::obvhs::bvh2::builder::build_bvh2;
use ::obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use ::obvhs::ray::RayHit;
use ::obvhs::{BvhBuildParams, aabb};
use attic::obvhs::{to_our_tree, to_their_ray, to_theirs};
use attic::tracing::rays::rays;
use bvh_core::export::Target;
use bvh_core::{Aabb, PreparedRay, Ray, Triangle, nearest_hit, validate};
use bvh_scenes::Scene;
use bvh_scenes::rays::{Kind, Viewpoint};
use bvh_search::{Bake, Budget};

/// Makes small triangles at pseudo-random points.
fn triangles(n: u32) -> Vec<Triangle> {
    let coordinate = |i: u32| (i.wrapping_mul(2_654_435_761) >> 22) as f32 / 64.0;
    let mut triangles = Vec::new();
    for i in 0..n {
        let [x, y, z] = [3 * i, 3 * i + 1, 3 * i + 2].map(coordinate);
        let size = 0.25 + (i % 7) as f32 * 0.25;
        triangles.push(Triangle::from([
            [x, y, z],
            [x + size, y, z + 0.5],
            [x, y + size, z - 0.25],
        ]));
    }
    triangles
}

#[test]
fn a_tree_of_obvhs_survives_a_round_trip_and_traces_the_same_hits() {
    for n in [1, 2, 3, 50, 4000] {
        let triangles = triangles(n);
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        let mut their_boxes = Vec::new();
        for aabb in &boxes {
            let min = aabb.min.to_array();
            let max = aabb.max.to_array();
            their_boxes.push(aabb::Aabb::new(min.into(), max.into()));
        }
        for params in [BvhBuildParams::fast_build(), BvhBuildParams::medium_build()] {
            let built = build_bvh2(&their_boxes, params, &mut Default::default());
            let tree = to_our_tree(&built);
            validate(&tree, &boxes).unwrap();
            assert_eq!(tree.nodes.len(), built.nodes.len());
            let returned = to_theirs(&tree);
            returned.validate(&their_boxes, false, true);
            assert_eq!(to_our_tree(&returned), tree);
            for i in 0..200u8 {
                let origin = [-3.0, f32::from(i % 14), f32::from(i / 14)];
                let direction = [1.0, 0.05, f32::from(i) * 0.01 - 1.0];
                let ray = Ray::half_line(origin, direction).unwrap();
                let their_ray = ::obvhs::ray::Ray::new_inf(origin.into(), direction.into());
                let expected = nearest_hit(&tree, &triangles, &ray).map(|hit| hit.t);
                let mut hit = RayHit::none();
                let found = returned.ray_traverse(their_ray, &mut hit, |_, position| {
                    distance(&triangles, &ray, returned.primitive_indices[position])
                });
                assert_eq!(found.then_some(hit.t), expected, "{n} triangles, ray {i}");
            }
        }
    }
}

#[test]
fn rays_find_the_same_hits_in_both_of_its_trees_made_of_divided_triangles() {
    let scene = Scene::load("escher:5000").unwrap();
    let triangles = scene.triangles().unwrap();
    let budget = Budget { max_work: Some(5_000_000), ..Budget::UNLIMITED };
    let references = Target::OBVHS.references;
    let bake =
        Bake { shapes: Some(&scene.primitives), references, budget, ..Bake::new(&scene.boxes) };
    let tree = bake.search(None, &()).unwrap().outcome.tree;
    assert!(tree.prim_ids.len() > 6000);
    let binary = to_theirs(&Target::OBVHS.fit(&tree));
    // Its conversion merges leaves itself.
    let wide = bvh2_to_cwbvh(&to_theirs(&tree), 3, true, false);
    let mut hits = 0;
    for kind in [Kind::Primary, Kind::Incoherent] {
        for ray in rays(kind, 50_000, &scene, &tree, &Viewpoint::default(), 1) {
            let expected = nearest_hit(&tree, triangles, &ray).map(|hit| hit.t);
            hits += usize::from(expected.is_some());
            let mut hit = RayHit::none();
            let is_hit = binary.ray_traverse(to_their_ray(&ray), &mut hit, |_, position| {
                distance(triangles, &ray, binary.primitive_indices[position])
            });
            assert_eq!(is_hit.then_some(hit.t), expected, "{ray:?}");
            let mut hit = RayHit::none();
            let is_hit = wide.ray_traverse(to_their_ray(&ray), &mut hit, |_, position| {
                distance(triangles, &ray, wide.primitive_indices[position])
            });
            assert_eq!(is_hit.then_some(hit.t), expected, "wide, {ray:?}");
        }
    }
    assert!(hits > 20_000, "{hits}");
}

/// Returns the distance of a triangle, or infinity as `obvhs` expects it for a miss.
fn distance(triangles: &[Triangle], ray: &Ray, id: u32) -> f32 {
    let hit = triangles[id as usize].intersect(&PreparedRay::new(ray), f32::MAX);
    hit.unwrap_or(f32::INFINITY)
}
