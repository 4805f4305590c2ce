//! Trees go to another library and come back, and both libraries find the same hits in them.

use bvh_core::export::{CompressedBvh, CompressedNode};
use bvh_core::{Aabb, Bvh, FirstCountNode, Ray, Triangle, nearest_hit, validate};
use obvhs::bvh2::{Bvh2, builder::build_bvh2, node::Bvh2Node};
use obvhs::cwbvh::CwBvh;
use obvhs::ray::RayHit;
use obvhs::{BvhBuildParams, aabb};

/// Small triangles strewn by a multiplicative generator.
fn triangles(n: u32) -> Vec<Triangle> {
    let coordinate = |i: u32| (i.wrapping_mul(2_654_435_761) >> 22) as f32 / 64.0;
    let point = |i: u32| [coordinate(3 * i), coordinate(3 * i + 1), coordinate(3 * i + 2)];
    (0..n)
        .map(|i| {
            let [x, y, z] = point(i);
            let size = 0.25 + (i % 7) as f32 * 0.25;
            Triangle::from([[x, y, z], [x + size, y, z + 0.5], [x, y + size, z - 0.25]])
        })
        .collect()
}

/// Our form of their nodes: the fields are the same but for their order.
fn from_theirs(bvh: &Bvh2) -> Vec<FirstCountNode> {
    let node = |node: &Bvh2Node| FirstCountNode {
        min: node.aabb().min.to_array(),
        first: node.first_index,
        max: node.aabb().max.to_array(),
        count: node.prim_count,
    };
    bvh.nodes.iter().map(node).collect()
}

/// Their form of our compressed nodes, which have the planes in another order.
fn to_their_compressed(tree: &Bvh, boxes: &[Aabb]) -> CwBvh {
    let CompressedBvh { nodes, prim_ids } = CompressedBvh::new(tree, boxes).unwrap();
    let node = |node: &CompressedNode| {
        let mut theirs = *bytemuck::bytes_of(node).first_chunk::<80>().unwrap();
        for plane in 0..6 {
            let to = 32 + 8 * (2 * (plane % 3) + plane / 3);
            theirs[to..to + 8].copy_from_slice(&bytemuck::bytes_of(node)[32 + 8 * plane..][..8]);
        }
        bytemuck::pod_read_unaligned(&theirs)
    };
    CwBvh { nodes: nodes.iter().map(node).collect(), primitive_indices: prim_ids, ..Default::default() }
}

/// Their form of our tree.
fn to_theirs(tree: &Bvh) -> Bvh2 {
    let node = |node: &FirstCountNode| {
        Bvh2Node::new(aabb::Aabb::new(node.min.into(), node.max.into()), node.count, node.first)
    };
    Bvh2 {
        nodes: tree.to_first_count().iter().map(node).collect(),
        primitive_indices: tree.prim_ids.clone(),
        children_are_ordered_after_parents: true,
        max_depth: tree.depth() + 1,
        ..Default::default()
    }
}

#[test]
fn a_tree_of_obvhs_comes_here_and_goes_back() {
    for n in [1, 2, 3, 50, 4000] {
        let triangles = triangles(n);
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        let theirs: Vec<aabb::Aabb> =
            boxes.iter().map(|b| aabb::Aabb::new(b.min.to_array().into(), b.max.to_array().into())).collect();
        for params in [BvhBuildParams::fast_build(), BvhBuildParams::medium_build()] {
            let built = build_bvh2(&theirs, params, &mut Default::default());
            let tree = Bvh::from_first_count(&from_theirs(&built), &built.primitive_indices).unwrap();
            validate(&tree, &boxes).unwrap();
            assert_eq!(tree.nodes.len(), built.nodes.len());
            let returned = to_theirs(&tree);
            returned.validate(&theirs, false, true);
            assert_eq!(
                Bvh::from_first_count(&from_theirs(&returned), &returned.primitive_indices),
                Ok(tree.clone())
            );
            let compressed = to_their_compressed(&tree, &boxes);
            compressed.validate(&theirs, false);
            for i in 0..200u8 {
                let (origin, direction) =
                    ([-3.0, f32::from(i % 14), f32::from(i / 14)], [1.0, 0.05, f32::from(i) * 0.01 - 1.0]);
                let ray = Ray::half_line(origin, direction).unwrap();
                let shear = bvh_core::Shear::new(&ray);
                let ours = nearest_hit(&tree, &triangles, &ray);
                let mut hit = RayHit::none();
                let their_ray = obvhs::ray::Ray::new_inf(origin.into(), direction.into());
                let found = returned.ray_traverse(their_ray, &mut hit, |_, at| {
                    let id = returned.primitive_indices[at] as usize;
                    triangles[id].intersect(&shear, f32::MAX).unwrap_or(f32::INFINITY)
                });
                assert_eq!(ours.map(|hit| hit.t), found.then_some(hit.t), "{n} triangles, ray {i}");
                let mut hit = RayHit::none();
                let found = compressed.ray_traverse(their_ray, &mut hit, |_, at| {
                    let id = compressed.primitive_indices[at] as usize;
                    triangles[id].intersect(&shear, f32::MAX).unwrap_or(f32::INFINITY)
                });
                assert_eq!(ours.map(|hit| hit.t), found.then_some(hit.t), "compressed, {n} triangles, ray {i}");
            }
        }
    }
}
