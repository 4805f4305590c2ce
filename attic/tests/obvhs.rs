//! Trees can be converted to another library and back, and both libraries find the same hits in
//! them.

use ::obvhs::bvh2::{Bvh2, builder::build_bvh2, node::Bvh2Node};
use ::obvhs::cwbvh::{CwBvh, node::CwBvhNode};
use ::obvhs::ray::RayHit;
use ::obvhs::{BvhBuildParams, aabb};
use bvh_core::export::{CompressedBvh, CompressedNode};
use bvh_core::{Aabb, Bvh, FirstCountNode, PreparedRay, Ray, Triangle, nearest_hit, validate};

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

/// Converts nodes of `obvhs`. They have the same fields in another order.
fn from_theirs(bvh: &Bvh2) -> Vec<FirstCountNode> {
    let mut nodes = Vec::new();
    for node in &bvh.nodes {
        nodes.push(FirstCountNode {
            min: node.aabb().min.to_array(),
            first: node.first_index,
            max: node.aabb().max.to_array(),
            count: node.prim_count,
        });
    }
    nodes
}

/// Converts a tree to compressed nodes of `obvhs`, which have the planes in another order.
fn to_their_compressed(tree: &Bvh, boxes: &[Aabb]) -> CwBvh {
    let CompressedBvh { nodes, prim_ids } = CompressedBvh::new(tree, boxes).unwrap();
    let nodes = nodes.iter().map(to_their_compressed_node).collect();
    CwBvh { nodes, primitive_indices: prim_ids, ..Default::default() }
}

fn to_their_compressed_node(node: &CompressedNode) -> CwBvhNode {
    let ours = bytemuck::bytes_of(node);
    let mut theirs = ours.to_vec();
    for plane in 0..6 {
        let from = 32 + 8 * plane;
        let to = 32 + 8 * (2 * (plane % 3) + plane / 3);
        theirs[to..to + 8].copy_from_slice(&ours[from..from + 8]);
    }
    bytemuck::pod_read_unaligned(&theirs)
}

/// Converts a tree to a tree of `obvhs`.
fn to_theirs(tree: &Bvh) -> Bvh2 {
    let mut nodes = Vec::new();
    for node in tree.to_first_count() {
        let aabb = aabb::Aabb::new(node.min.into(), node.max.into());
        nodes.push(Bvh2Node::new(aabb, node.count, node.first));
    }
    Bvh2 {
        nodes,
        primitive_indices: tree.prim_ids.clone(),
        children_are_ordered_after_parents: true,
        max_depth: tree.depth() + 1,
        ..Default::default()
    }
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
            let tree =
                Bvh::from_first_count(&from_theirs(&built), &built.primitive_indices).unwrap();
            validate(&tree, &boxes).unwrap();
            assert_eq!(tree.nodes.len(), built.nodes.len());
            let returned = to_theirs(&tree);
            returned.validate(&their_boxes, false, true);
            let again = Bvh::from_first_count(&from_theirs(&returned), &returned.primitive_indices);
            assert_eq!(again.as_ref(), Ok(&tree));
            let compressed = to_their_compressed(&tree, &boxes);
            compressed.validate(&their_boxes, false);
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
                let mut hit = RayHit::none();
                let found = compressed.ray_traverse(their_ray, &mut hit, |_, position| {
                    distance(&triangles, &ray, compressed.primitive_indices[position])
                });
                assert_eq!(found.then_some(hit.t), expected, "compressed, {n} triangles, ray {i}");
            }
        }
    }
}

/// Returns the distance of a triangle, or infinity as `obvhs` expects it for a miss.
fn distance(triangles: &[Triangle], ray: &Ray, id: u32) -> f32 {
    let hit = triangles[id as usize].intersect(&PreparedRay::new(ray), f32::MAX);
    hit.unwrap_or(f32::INFINITY)
}
