//! Our trees in the crate `bvh`: the same shapes for every ray, by fewer tests.

use ::bvh::aabb::{Aabb as TheirAabb, IntersectsAabb};
use ::bvh::bvh::Bvh as TheirBvh;
use ::bvh::ray::Ray as TheirRay;
use attic::bvh::{Shape, shapes, to_theirs};
use attic::tracing::rays::rays;
use bvh_core::Ray;
use bvh_core::export::Target;
use bvh_scenes::Scene;
use bvh_scenes::rays::{Kind, Viewpoint};
use bvh_search::{Budget, Objects, Options, OwnedTree};
use std::cell::Cell;

/// A ray that counts the boxes that it is tested against.
struct CountingRay {
    ray: TheirRay<f32, 3>,
    boxes: Cell<u64>,
}

impl IntersectsAabb<f32, 3> for CountingRay {
    fn intersects_aabb(&self, aabb: &TheirAabb<f32, 3>) -> bool {
        self.boxes.set(self.boxes.get() + 1);
        self.ray.intersects_aabb(aabb)
    }
}

/// Returns the shapes that the library finds for the ray, in the order of their indices, and the number
/// of tested boxes.
fn found(tree: &TheirBvh<f32, 3>, shapes: &[Shape], ray: &Ray) -> (Vec<*const Shape>, u64) {
    let [origin, direction] = [ray.origin(), ray.direction()].map(|vector| vector.to_array());
    let ray = CountingRay { ray: TheirRay::new(origin.into(), direction.into()), boxes: 0.into() };
    let mut found: Vec<*const Shape> =
        tree.traverse(&ray, shapes).into_iter().map(std::ptr::from_ref).collect();
    found.sort_unstable();
    (found, ray.boxes.get())
}

#[test]
fn the_crate_bvh_finds_the_same_shapes_in_our_trees_by_fewer_tests() {
    for (name, most) in [("cloister:8000", 0.8), ("escher:5000", 0.9)] {
        let scene = Scene::load(name).unwrap();
        let budget = Budget { max_work: Some(5_000_000), ..Budget::UNLIMITED };
        let options = Options { budget, ..Options::default() };
        let objects = Objects::Boxes(scene.boxes.clone());
        let searched = OwnedTree::find(objects, &options, &()).unwrap();
        let mut shapes = shapes(scene.triangles().unwrap());
        let built = TheirBvh::build(&mut shapes);
        let ours = to_theirs(&Target::BVH.fit(searched.tree()), &mut shapes);
        assert!(ours.is_consistent(&shapes), "{name}");
        let viewpoint = Viewpoint::default();
        let kinds = [Kind::Primary, Kind::Incoherent];
        let all = kinds.map(|kind| rays(kind, 50_000, &scene, searched.tree(), &viewpoint, 1));
        let mut sums = [0, 0];
        for ray in all.iter().flatten() {
            let [theirs, mine] = [&built, &ours].map(|tree| found(tree, &shapes, ray));
            assert_eq!(theirs.0, mine.0, "{name}");
            sums[0] += theirs.1;
            sums[1] += mine.1;
        }
        let ratio = sums[1] as f64 / sums[0] as f64;
        assert!(ratio < most, "{name}: {ratio}");
    }
}
