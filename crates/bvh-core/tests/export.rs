//! Every layout for other libraries comes back as a tree that traces the same hits, and has its bytes where its documentation says.

mod support;

use bvh_core::export::{AilaLaineNode, CompressedBvh, CompressedNode, FirstCountNode};
use bvh_core::{Aabb, Bvh, InvalidBvh, Node, Triangle, nearest_hit, validate};
use glam::Vec3;
use proptest::prelude::*;
use support::{Random, SHAPES, ball, boxes, chain, grid_box, rays, scaled, soup, tree};

/// The tree there and back through every layout.
fn returned(tree: &Bvh, boxes: &[Aabb]) -> [(&'static str, Bvh); 3] {
    [
        ("binary", Bvh::from_first_count(&tree.to_first_count(), &tree.prim_ids).unwrap()),
        ("Aila-Laine", Bvh::from_aila_laine(&tree.to_aila_laine(), &tree.prim_ids).unwrap()),
        ("compressed", CompressedBvh::new(tree, boxes).unwrap().decode().unwrap()),
    ]
}

fn check(name: &str, tree: &Bvh, triangles: &[Triangle], random: &mut Random) -> usize {
    let boxes = boxes(triangles);
    let rays = rays(triangles, 600, random);
    let expected: Vec<_> = rays.iter().map(|ray| nearest_hit(tree, triangles, ray)).collect();
    for (layout, mut returned) in returned(tree, &boxes) {
        for (ray, expected) in rays.iter().zip(&expected) {
            assert_eq!(nearest_hit(&returned, triangles, ray), *expected, "{name}, {layout}: {ray:?}");
        }
        // Boxes are never smaller than the tight ones.
        let mut tight = returned.clone();
        tight.refit(&boxes);
        validate(&tight, &boxes).unwrap();
        assert!(returned.nodes.iter().zip(&tight.nodes).all(|(a, b)| a.aabb.contains(&b.aabb)));
        if layout != "compressed" {
            returned.refit(&boxes);
            assert_eq!(returned, tight);
            assert_eq!(returned.prim_ids.len(), tree.prim_ids.len());
        }
    }
    expected.iter().flatten().count()
}

#[test]
fn every_layout_traces_the_hits_of_the_tree_at_every_scale() {
    let mut random = Random(1);
    let mut hits = 0;
    let flat: Vec<Triangle> =
        soup(60, &mut random).iter().map(|t| Triangle(t.0.map(|p| Vec3::new(p.x, 0.25, p.z)))).collect();
    let scenes = [("soup", soup(150, &mut random)), ("grid", grid_box(4)), ("ball", ball(2)), ("flat", flat)];
    for (name, scene) in scenes {
        for exponent in [-140, -60, 0, 60, 126] {
            let triangles =
                scaled(&scene, libm::exp2f(exponent as f32 / 2.0) * libm::exp2f(exponent as f32 / 2.0));
            for shape in SHAPES {
                let tree = tree(&boxes(&triangles), shape, &mut random);
                hits += check(&format!("{name} * 2^{exponent}, {shape:?}"), &tree, &triangles, &mut random);
            }
        }
    }
    assert!(hits > 10_000, "{hits}");
}

#[test]
fn small_trees_deep_trees_and_trees_of_points_have_layouts() {
    let mut random = Random(2);
    let points = vec![Triangle([Vec3::new(1.0, 2.0, 3.0); 3]); 30];
    let huge = [1.0, -1.0].map(|sign| Triangle([Vec3::splat(f32::MAX * sign), Vec3::ZERO, Vec3::X * sign]));
    for triangles in [soup(1, &mut random), soup(3, &mut random), points, soup(300, &mut random), huge.into()] {
        let boxes = boxes(&triangles);
        let all = Node::leaf(boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(b)), 0, boxes.len() as u32);
        let one_leaf = Bvh { nodes: vec![all], prim_ids: (0..boxes.len() as u32).collect() };
        check("one leaf", &one_leaf, &triangles, &mut random);
        check("chain", &chain(&boxes), &triangles, &mut random);
    }
    for (layout, returned) in returned(&Bvh::default(), &[]) {
        assert_eq!(returned, Bvh::default(), "{layout}");
    }
}

#[test]
fn bytes_are_where_the_documentation_says() {
    assert_eq!(
        [size_of::<FirstCountNode>(), size_of::<AilaLaineNode>(), size_of::<CompressedNode>()],
        [32, 64, 80]
    );
    // Two cubes of side 1 at x = 0 and x = 510: the grid's step along x is 2 or 4, along y and z 1/128.
    let cube = |x: f32| Aabb::from([[x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]]);
    let boxes = [cube(0.0), cube(509.0)];
    let nodes = vec![
        Node::inner(boxes[0].union(&boxes[1]), 1, 2),
        Node::leaf(boxes[0], 0, 1),
        Node::leaf(boxes[1], 1, 1),
    ];
    let tree = Bvh { nodes, prim_ids: vec![1, 0] };
    let mut refitted = tree.clone();
    refitted.refit(&boxes);
    let float = |bytes: &[u8], at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let word = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());

    let nodes = refitted.to_aila_laine();
    let bytes: &[u8] = bytemuck::cast_slice(&nodes);
    let floats = [0, 16, 32, 48].map(|at| float(bytes, at));
    assert_eq!(floats, [509.0, 510.0, 0.0, 1.0]);
    assert_eq!([12, 28, 44].map(|at| word(bytes, at)), [1, 2, 0]);
    assert_eq!([64 + 44, 64 + 60, 128 + 44, 128 + 60].map(|at| word(bytes, at)), [1, 0, 1, 1]);

    let compressed = CompressedBvh::new(&refitted, &boxes).unwrap();
    let bytes: &[u8] = bytemuck::cast_slice(&compressed.nodes);
    // Both objects are one leaf, which is in one slot.
    assert_eq!(bytes.len(), 80);
    assert_eq!([0, 4, 8].map(|at| float(bytes, at)), [0.0; 3]);
    assert_eq!(bytes[12..16], [128, 120, 120, 0]);
    assert_eq!([word(bytes, 16), word(bytes, 20)], [1, 0]);
    let slot = (0..8).find(|slot| bytes[24 + slot] != 0).unwrap();
    assert_eq!(bytes[24 + slot], 0b011_00000);
    assert_eq!([32, 40, 48, 56, 64, 72].map(|at| bytes[at + slot]), [0, 0, 0, 255, 128, 128]);
    assert_eq!(compressed.prim_ids, [1, 0]);
}

#[test]
fn children_stand_in_the_slots_of_their_corners() {
    let corner = |at: u32| [2, 1, 0].map(|bit| (at >> bit & 1) as f32 * 10.0);
    let boxes: Vec<Aabb> = (0..8).map(corner).map(|low| Aabb::from([low, low.map(|c| c + 1.0)])).collect();
    let mut random = Random(3);
    for _ in 0..10 {
        let compressed = CompressedBvh::new(&tree(&boxes, SHAPES[2], &mut random), &boxes).unwrap();
        let bytes: &[u8] = bytemuck::cast_slice(&compressed.nodes);
        assert_eq!(bytes.len(), 80);
        for slot in 0..8 {
            assert_eq!((compressed.prim_ids[slot], bytes[24 + slot]), (slot as u32, 1 << 5 | slot as u8));
        }
    }
}

proptest! {
    #[test]
    fn bytes_that_are_no_tree_are_refused_or_give_one_that_can_be_walked(
        bytes in prop::collection::vec(prop_oneof![Just(0u8), 0u8..6, any::<u8>()], 0..640),
        ids in prop::collection::vec(0u32..8, 0..8),
    ) {
        fn nodes<T: bytemuck::Pod>(bytes: &[u8]) -> Vec<T> {
            bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
        }
        let compressed = CompressedBvh { nodes: nodes(&bytes), prim_ids: ids.clone() };
        let trees: [Result<Bvh, InvalidBvh>; 3] = [
            Bvh::from_first_count(&nodes(&bytes), &ids),
            Bvh::from_aila_laine(&nodes(&bytes), &ids),
            compressed.decode(),
        ];
        for tree in trees.into_iter().flatten() {
            prop_assert!(tree.prim_ids.len() <= ids.len());
            prop_assert!(tree.depth() < 1 + tree.nodes.len());
        }
    }
}
