//! Compares the base cost of the stand-ins with a cost that is computed from the objects alone.

use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, Bvh, cost};
use bvh_scenes::Scene;
use bvh_scenes::builtin::stand_ins::STAND_INS;

/// Returns the sum of inner half areas. Computes every node's box from the objects below it, and
/// reads no box of the tree.
fn from_objects(tree: &Bvh, boxes: &[Aabb]) -> f64 {
    let mut total = 0.0;
    let mut below = vec![Aabb::EMPTY; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let objects = tree.prim_ids[node.prims()].iter().map(|&id| boxes[id as usize]);
        below[index] = objects
            .chain(below[node.children()].iter().copied())
            .fold(Aabb::EMPTY, |a, b| a.union(&b));
        if !node.is_leaf() {
            let [x, y, z] = (below[index].max.as_dvec3() - below[index].min.as_dvec3()).to_array();
            total += x * y + y * z + z * x;
        }
    }
    total
}

#[test]
fn the_base_cost_of_every_stand_in_follows_from_its_objects_and_has_the_papers_magnitude() {
    let paper = [1.710e7, 1.845e9, 4.820e5, 1.027e14, 1.361e6];
    for (stand_in, paper) in STAND_INS.iter().zip(paper) {
        let boxes = Scene::load(stand_in.name).unwrap().boxes;
        let tree = muller_fellner::Config::default().build(&boxes).unwrap();
        bvh_core::validate(&tree, &boxes).unwrap();
        let reported = cost::internal_area(&tree);
        let computed = from_objects(&tree, &boxes);
        assert!((reported - computed).abs() < 1e-12 * computed, "{}", stand_in.name);
        assert!((0.5..2.0).contains(&(reported / paper)), "{}: {reported}", stand_in.name);
    }
}
