//! Every layout for other libraries can be converted back to a tree that traces the same hits, and
//! has the documented bytes.

use crate::support::{Random, SHAPES, ball, boxes, chain, grid_box, rays, scaled, soup, tree};
use bvh_core::export::{ExportError, FirstCountNode, Layout, Target, ThreeMeshNode};
use bvh_core::{
    Aabb, Bvh, Frame, InvalidBvh, Node, Triangle, any_hit, file, nearest_hit, validate,
};
use glam::{DMat3, DVec3, Vec3};
use proptest::prelude::*;

fn returned(tree: &Bvh) -> [(&'static str, Bvh); 3] {
    let ids = &tree.prim_ids;
    [
        ("binary", Bvh::from_first_count(&tree.to_first_count(), ids).unwrap()),
        ("aligned", Bvh::from_first_count(&tree.to_first_count_aligned(), ids).unwrap()),
        ("three-mesh-bvh", Bvh::from_three_mesh(&tree.to_three_mesh(), ids).unwrap()),
    ]
}

fn one_leaf(boxes: &[Aabb]) -> Bvh {
    let count = boxes.len() as u32;
    Bvh::new(vec![Node::leaf(Aabb::union_of(boxes), 0, count)], (0..count).collect())
}

fn check(name: &str, tree: &Bvh, triangles: &[Triangle], random: &mut Random) -> usize {
    let boxes = boxes(triangles);
    let rays = rays(triangles, 600, random);
    for (layout, returned) in returned(tree) {
        for ray in &rays {
            let [found, expected] = [&returned, tree].map(|tree| nearest_hit(tree, triangles, ray));
            assert_eq!(found, expected, "{name}, {layout}: {ray:?}");
        }
        // Boxes are never smaller than the tight ones.
        let mut tight = returned.clone();
        tight.refit(&boxes);
        validate(&tight, &boxes).unwrap();
        for (node, tight_node) in returned.nodes.iter().zip(&tight.nodes) {
            assert!(node.aabb.contains(&tight_node.aabb), "{name}, {layout}");
        }
        assert_eq!(returned.prim_ids.len(), tree.prim_ids.len());
    }
    rays.iter().filter(|ray| any_hit(tree, triangles, ray)).count()
}

#[test]
fn every_layout_traces_the_hits_of_the_tree_at_every_scale() {
    let mut random = Random(1);
    let mut hits = 0;
    let mut flat = soup(60, &mut random);
    for corner in flat.iter_mut().flat_map(|triangle| &mut triangle.0) {
        corner.y = 0.25;
    }
    let scenes = [
        ("soup", soup(150, &mut random)),
        ("grid", grid_box(4)),
        ("ball", ball(2)),
        ("flat", flat),
    ];
    for (name, scene) in scenes {
        for exponent in [-140, -60, 0, 60, 126] {
            let root = libm::exp2f(exponent as f32 / 2.0);
            let triangles = scaled(&scene, root * root);
            for shape in SHAPES {
                let tree = tree(&boxes(&triangles), shape, &mut random);
                let name = format!("{name} * 2^{exponent}, {shape:?}");
                hits += check(&name, &tree, &triangles, &mut random);
            }
        }
    }
    assert!(hits > 10_000, "{hits}");
}

#[test]
fn small_trees_deep_trees_and_trees_of_points_have_layouts() {
    let mut random = Random(2);
    let points = vec![Triangle([Vec3::new(1.0, 2.0, 3.0); 3]); 30];
    let huge = [1.0, -1.0]
        .map(|sign| Triangle([Vec3::splat(f32::MAX * sign), Vec3::ZERO, Vec3::X * sign]));
    for triangles in
        [soup(1, &mut random), soup(3, &mut random), points, soup(300, &mut random), huge.into()]
    {
        let boxes = boxes(&triangles);
        check("one leaf", &one_leaf(&boxes), &triangles, &mut random);
        check("chain", &chain(&boxes), &triangles, &mut random);
    }
    for (layout, returned) in returned(&Bvh::default()) {
        assert_eq!(returned, Bvh::default(), "{layout}");
    }
}

#[test]
fn a_tracer_takes_trees_along_the_file_and_divided_ones_where_its_queries_find_no_object_twice() {
    let cube = Aabb::from([[0.0; 3], [1.0; 3]]);
    let leaves = [Node::leaf(cube, 0, 1), Node::leaf(cube, 1, 1)];
    let nodes = [&[Node::inner(cube, 1, 2)], &leaves[..]].concat();
    let tree = |ids| Bvh::new(nodes.clone(), ids);
    let frame = Frame::new(DMat3::from_rotation_z(0.5), DVec3::ZERO).unwrap();
    for target in Target::ALL {
        let divided = target.check(&tree(vec![0, 0]), 1, false);
        let expected = ["tinybvh", "obvhs", "madmann91-bvh"].contains(&target.name);
        assert_eq!(divided.is_ok(), expected, "{divided:?}");
        assert_eq!(target.check(&tree(vec![0, 0]), 1, true), Ok(()));
        assert_eq!(target.check(&tree(vec![0, 1]), 2, false), Ok(()));
        let framed = Bvh { frame: Some(frame), ..tree(vec![0, 1]) };
        assert_eq!(target.check(&framed, 2, true), Err(ExportError::Framed));
    }
}

#[test]
fn the_bytes_are_the_documented_ones() {
    assert_eq!([size_of::<FirstCountNode>(), size_of::<ThreeMeshNode>()], [32; 2]);
    let cube = |x: f32| Aabb::from([[x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]]);
    let boxes = [cube(0.0), cube(509.0)];
    let nodes = vec![
        Node::inner(boxes[0].union(&boxes[1]), 1, 2),
        Node::leaf(boxes[0], 0, 1),
        Node::leaf(boxes[1], 1, 1),
    ];
    let tree = Bvh::new(nodes, vec![1, 0]);
    let mut refitted = tree.clone();
    refitted.refit(&boxes);
    let nodes = refitted.to_three_mesh();
    let bytes: &[u8] = bytemuck::cast_slice(&nodes);
    // The root's children lie side by side along x; leaves have the mark 0xffff behind the count.
    assert_eq!([24, 28].map(|offset| word(bytes, offset)), [2, 0]);
    assert_eq!([32 + 24, 64 + 24].map(|offset| word(bytes, offset)), [1, 0]);
    assert_eq!(bytes[32 + 28..64], [1, 0, 0xff, 0xff]);
    assert!(float(bytes, 64) < 509.0 && float(bytes, 64 + 12) > 510.0);
}

#[test]
fn pairs_begin_at_even_indices_if_aligned_and_invalid_indices_are_rejected() {
    let tree = chain(&boxes(&soup(4, &mut Random(5))));
    for (index, node) in tree.to_first_count_aligned().iter().enumerate() {
        // Index 1 is the unused node.
        assert!(index == 1 || node.count > 0 || node.first % 2 == 0, "{index}");
    }
    // The error after the fields of one node were replaced.
    let rejection = |index: usize, first, count| {
        let mut nodes = tree.to_first_count();
        nodes[index] = FirstCountNode { first, count, ..nodes[index] };
        Bvh::from_first_count(&nodes, &tree.prim_ids).unwrap_err()
    };
    for first in [6, u32::MAX] {
        let bad_children = InvalidBvh::BadChildren { node: 0, first, count: 2, nodes: 7 };
        assert_eq!(rejection(0, first, 0), bad_children);
    }
    assert!(matches!(rejection(0, 0, 0), InvalidBvh::Parents { parents: 2, .. }));
    // The far child's index is what a node of three-mesh-bvh has.
    let mut nodes = tree.to_three_mesh();
    nodes[0].below = 999;
    let bad_children = InvalidBvh::BadChildren { node: 0, first: 999, count: 2, nodes: 7 };
    assert_eq!(Bvh::from_three_mesh(&nodes, &tree.prim_ids), Err(bad_children));
    for (first, count) in [(4, 1), (1, u32::MAX)] {
        let bad_leaf = InvalidBvh::BadLeaf { node: 1, first, count, objects: 4 };
        assert_eq!(rejection(1, first, count), bad_leaf);
    }
    assert!(matches!(rejection(1, 0, 4), InvalidBvh::ObjectCount { objects: 4, .. }));
}

fn float(bytes: &[u8], offset: usize) -> f32 {
    f32::from_bits(word(bytes, offset))
}

fn word(bytes: &[u8], offset: usize) -> u32 {
    let (word, _) = bytes[offset..].split_first_chunk().unwrap();
    u32::from_le_bytes(*word)
}

#[test]
fn a_fitted_tree_has_what_the_tracer_accepts_and_traces_the_same_hits() {
    let mut random = Random(4);
    let triangles = soup(700, &mut random);
    let boxes = boxes(&triangles);
    let rays = rays(&triangles, 300, &mut random);
    let trees = [tree(&boxes, SHAPES[0], &mut random), chain(&boxes), one_leaf(&boxes)];
    let strict = Target { most_objects: 3, most_depth: 11, ..Target::OBVHS };
    for target in Target::ALL.into_iter().chain([strict]) {
        for tree in &trees {
            let fitted = target.fit(tree);
            validate(&fitted, &boxes).unwrap();
            assert!(fitted.depth() <= target.most_depth, "{target:?}: {}", fitted.depth());
            for node in &fitted.nodes {
                assert!(node.prims().len() <= target.most_objects as usize);
                assert!(node.is_leaf() || node.children().len() == 2);
                let areas = fitted.nodes[node.children()].iter().map(|node| node.aabb.half_area());
                assert!(areas.rev().is_sorted(), "{target:?}");
            }
            // A tree that is accepted as it is never becomes dearer.
            let binary = Bvh::from_first_count(&tree.to_first_count(), &tree.prim_ids).unwrap();
            let most = binary.nodes.iter().map(|node| node.prims().len()).max().unwrap();
            if binary.depth() <= target.most_depth && most <= target.most_objects as usize {
                assert!(target.cost(&fitted) <= target.cost(&binary), "{target:?}");
            }
            for ray in &rays {
                let [found, expected] =
                    [&fitted, tree].map(|tree| nearest_hit(tree, &triangles, ray));
                assert_eq!(found, expected);
            }
        }
    }
}

#[test]
fn a_file_for_a_tracer_has_the_documented_header_nodes_and_ids() {
    let mut random = Random(5);
    let boxes = boxes(&soup(90, &mut random));
    let tree = tree(&boxes, SHAPES[0], &mut random);
    for target in Target::ALL {
        let fitted = target.fit(&tree);
        let bytes = target.bytes(&fitted, &boxes);
        let (nodes, ids): (Vec<FirstCountNode>, Vec<u32>) = if target.layout == Layout::Json {
            let text = String::from_utf8(bytes).unwrap().replace(['\n', ']', '}'], "");
            let (nodes, ids) =
                text.strip_prefix("{\"nodes\":[").unwrap().split_once(",\"ids\":[").unwrap();
            let node = |text: &str| {
                let words = text.split(',').filter(|word| !word.is_empty());
                let numbers: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
                let exact = |number: f64| {
                    assert_eq!(f64::from(number as f32), number);
                    number as f32
                };
                let [min, max] = [0, 3].map(|at| [0, 1, 2].map(|i| exact(numbers[at + i])));
                let [first, count] = [6, 7].map(|at| numbers[at] as u32);
                FirstCountNode { min, first, max, count }
            };
            let ids = ids.split(", ").map(|id| id.parse().unwrap()).collect();
            (nodes.split('[').skip(1).map(node).collect(), ids)
        } else {
            let [version, nodes, ids, checksum] = [4, 8, 12, 16].map(|at| word(&bytes, at));
            assert_eq!((&bytes[..4], version), (&b"BVHX"[..], 1));
            assert_eq!(checksum, file::boxes_checksum(&boxes));
            assert_eq!(bytes[20..32], [0; 12]);
            let (nodes, all_ids) = bytes[32..].split_at(32 * nodes as usize);
            assert_eq!(all_ids.len(), 4 * ids as usize);
            let expected = match target.layout {
                Layout::ThreeMesh => bytemuck::cast_slice(&fitted.to_three_mesh()).to_vec(),
                Layout::FirstCountAligned => {
                    bytemuck::cast_slice(&fitted.to_first_count_aligned()).to_vec()
                }
                _ => bytemuck::cast_slice(&fitted.to_first_count()).to_vec(),
            };
            assert_eq!(nodes, expected, "{target:?}");
            let ids = all_ids.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
            (fitted.to_first_count(), ids)
        };
        assert_eq!(Bvh::from_first_count(&nodes, &ids).unwrap(), fitted, "{target:?}");
    }
}

proptest! {
    #[test]
    fn bytes_that_are_no_tree_are_rejected_or_give_a_tree_that_can_be_traversed(
        bytes in prop::collection::vec(prop_oneof![Just(0u8), 0u8..6, any::<u8>()], 0..640),
        ids in prop::collection::vec(0u32..8, 0..8),
    ) {
        fn nodes<T: bytemuck::Pod>(bytes: &[u8]) -> Vec<T> {
            bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
        }
        let trees: [Result<Bvh, InvalidBvh>; 2] = [
            Bvh::from_first_count(&nodes(&bytes), &ids),
            Bvh::from_three_mesh(&nodes(&bytes), &ids),
        ];
        for tree in trees.into_iter().flatten() {
            prop_assert!(tree.prim_ids.len() <= ids.len());
            prop_assert!(tree.depth() < 1 + tree.nodes.len());
        }
    }
}
