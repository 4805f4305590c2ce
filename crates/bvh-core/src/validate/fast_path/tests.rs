//! The fast path passes sound trees of its kind and rejects all others.

use super::super::{Leaves, find_fault as fault};
use super::*;
use crate::{Bvh, InvalidBvh};

fn find_fault(tree: BvhView, objects: usize) -> Result<(), InvalidBvh> {
    fault(tree, objects, Leaves::One)
}

/// A number of objects whose tree has more nodes than a block; fewer under Miri, which takes
/// thousands of times as long as a processor.
const SEVERAL_BLOCKS: u32 = if cfg!(miri) { 6 } else { 20 };

const UNIT: Aabb = Aabb { min: glam::Vec3::ZERO, max: glam::Vec3::ONE };

/// Makes a chain: each pair is a leaf and the parent of the next pair, on alternating sides.
fn chain(objects: u32) -> Bvh {
    let last_leaf = Node::leaf(UNIT, objects - 1, 1);
    let mut nodes: Vec<Node> = alloc::vec![last_leaf];
    let mut parent = 0;
    for object in 0..objects - 1 {
        let first = nodes.len();
        nodes.extend([Node::leaf(UNIT, object, 1), last_leaf]);
        nodes[parent] = Node::inner(UNIT, first as u32, 2);
        parent = first + 1;
        if object % 2 == 0 {
            nodes.swap(first, parent);
            parent = first;
        }
    }
    Bvh { nodes, prim_ids: (0..objects).map(|object| (object + 2) % objects).collect() }
}

/// Returns whether the check passes the tree: in one piece, in many pieces, and without vector
/// instructions.
fn passes(tree: &Bvh) -> bool {
    let objects = tree.prim_ids.len();
    let Some(mut pieces) = FastPath::new(tree.into(), objects) else { return false };
    let Some(mut portable) = FastPath::new(tree.into(), objects) else { return false };
    let bytes_of_nodes = size_of_val(&tree.nodes[..]);
    let bytes = bytes_of_nodes + size_of_val(&tree.prim_ids[..]);
    for start in (0..bytes).step_by(256) {
        pieces.add(start..bytes.min(start + 256));
    }
    portable.add_nodes_with(0..tree.nodes.len(), words);
    portable.add(bytes_of_nodes..bytes);
    let found = FastPath::passes(tree.into(), objects);
    assert_eq!([pieces.finish(), portable.finish()], [found; 2]);
    found
}

#[test]
fn sound_trees_pass() {
    for objects in (1..7 * SEVERAL_BLOCKS).chain([50 * SEVERAL_BLOCKS]) {
        let tree = chain(objects);
        assert_eq!(find_fault((&tree).into(), objects as usize), Ok(()));
        assert!(passes(&tree), "{objects}");
    }
}

#[test]
fn no_unsound_tree_passes() {
    // Fewer nodes than a block, and more than a block.
    for objects in [3, SEVERAL_BLOCKS] {
        let tree = chain(objects);
        let mut passed = 0;
        for index in 0..tree.nodes.len() {
            for node in nodes_that_refer_near(objects) {
                let mut damaged = tree.clone();
                damaged.nodes[index] = node;
                let sound = find_fault((&damaged).into(), objects as usize).is_ok();
                assert_eq!(passes(&damaged), sound, "{:?}", damaged.nodes);
                passed += usize::from(sound);
            }
        }
        assert_eq!(passed, tree.nodes.len(), "only changes that change nothing pass");
        for position in 0..tree.prim_ids.len() {
            for id in 0..objects + 3 {
                let mut damaged = tree.clone();
                damaged.prim_ids[position] = id;
                assert_eq!(passes(&damaged), damaged == tree);
            }
        }
    }
}

/// Makes inner nodes and leaves with every `first` around the indices of a tree, with and without
/// the highest bit, and with up to three children or objects.
fn nodes_that_refer_near(objects: u32) -> Vec<Node> {
    let mut nodes = Vec::new();
    let low_words = 0..2 * objects + 2;
    let high_words = low_words.clone().map(|word| word | 1 << 31);
    for first in low_words.chain(high_words).chain([u32::MAX]) {
        for count in 0..4 {
            nodes.push(Node::inner(UNIT, first, count));
            nodes.push(Node::leaf(UNIT, first, count));
        }
    }
    nodes
}

#[test]
fn no_tree_with_a_box_that_is_not_finite_or_is_inverted_passes() {
    let tree = chain(SEVERAL_BLOCKS);
    for index in 0..tree.nodes.len() {
        for axis in 0..3 {
            let mut damaged = tree.clone();
            for wrong in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.5] {
                damaged.nodes[index].aabb.min[axis] = wrong;
                assert_box_is_rejected(&damaged);
            }
            damaged.nodes[index].aabb.min[axis] = f32::MIN;
            assert!(passes(&damaged));
            for wrong in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.5] {
                damaged.nodes[index].aabb.min[axis] = 0.0;
                damaged.nodes[index].aabb.max[axis] = wrong;
                assert_box_is_rejected(&damaged);
            }
            damaged.nodes[index].aabb.max[axis] = f32::MAX;
            assert!(passes(&damaged));
        }
    }
}

fn assert_box_is_rejected(tree: &Bvh) {
    assert!(!passes(tree), "{:?}", tree.nodes);
    let fault = find_fault(tree.into(), tree.prim_ids.len());
    assert!(matches!(fault, Err(InvalidBvh::Box { .. })), "{fault:?}");
}

#[test]
fn sound_trees_of_another_kind_do_not_pass() {
    let mut tree = chain(4);
    for objects in [0, 3, 5] {
        assert!(!FastPath::passes((&tree).into(), objects), "{objects}");
    }
    tree.nodes.truncate(5);
    tree.nodes[4] = Node::leaf(UNIT, 2, 2);
    assert_eq!(find_fault((&tree).into(), 4), Ok(()));
    assert!(!passes(&tree));
}
