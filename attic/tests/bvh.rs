//! Our trees in the crate `bvh`: the same shapes for every ray, by fewer tests.

use ::bvh::aabb::{Aabb as TheirAabb, Bounded, IntersectsAabb};
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::{Bvh as TheirBvh, BvhNode};
use ::bvh::ray::Ray as TheirRay;
use bvh_core::{Bvh, Ray};
use bvh_scenes::Scene;
use bvh_scenes::rays::{Kind, Viewpoint, rays};
use bvh_search::{Budget, Objects, Options, OwnedTree};
use std::cell::Cell;

/// Converts a tree with one object per leaf, and tells the shapes, in the order of its objects,
/// their leaves.
fn to_theirs<S: BHShape<f32, 3>>(tree: &Bvh, shapes: &mut [S]) -> TheirBvh<f32, 3> {
    let ours = tree.to_first_count();
    let mut parents = vec![0; ours.len()];
    let mut nodes = Vec::new();
    for (index, node) in ours.iter().enumerate() {
        let (first, parent_index) = (node.first as usize, parents[index]);
        if node.count > 0 {
            let shape_index = tree.prim_ids[first] as usize;
            shapes[shape_index].set_bh_node_index(index);
            nodes.push(BvhNode::Leaf { parent_index, shape_index });
            continue;
        }
        parents[first..first + 2].fill(index);
        let [child_l_aabb, child_r_aabb] = [first, first + 1]
            .map(|child| TheirAabb { min: ours[child].min.into(), max: ours[child].max.into() });
        nodes.push(BvhNode::Node {
            parent_index,
            child_l_index: first,
            child_l_aabb,
            child_r_index: first + 1,
            child_r_aabb,
        });
    }
    TheirBvh { nodes }
}

struct Shape {
    aabb: TheirAabb<f32, 3>,
    leaf: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> TheirAabb<f32, 3> {
        self.aabb
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, leaf: usize) {
        self.leaf = leaf;
    }

    fn bh_node_index(&self) -> usize {
        self.leaf
    }
}

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
        let shape = |aabb: &bvh_core::Aabb| Shape {
            aabb: TheirAabb { min: aabb.min.to_array().into(), max: aabb.max.to_array().into() },
            leaf: usize::MAX,
        };
        let mut shapes: Vec<Shape> = scene.boxes.iter().map(shape).collect();
        let built = TheirBvh::build(&mut shapes);
        let ours = to_theirs(searched.tree(), &mut shapes);
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
