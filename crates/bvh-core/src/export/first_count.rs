//! Conversion from and to the arrays of other libraries: binary nodes with `first` and `count`.

use super::unpack::{Part, unpack};
use crate::collapse::binary;
use crate::{Aabb, Bvh, InvalidBvh, NodeKind};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};

/// A binary node of 32 bytes, as in most libraries. The order of the fields is that of `tinybvh`'s `BVHNode` and of many
/// GPU tracers; `obvhs` has the same fields in another order.
///
/// | bytes | type | field |
/// |---|---|---|
/// | 0..12 | `f32[3]` | lower corner of the box |
/// | 12..16 | `u32` | index of the first of two adjacent children, or position of the leaf's first object id |
/// | 16..28 | `f32[3]` | upper corner |
/// | 28..32 | `u32` | number of object ids of a leaf; 0 for an inner node |
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FirstCountNode {
    /// Lower corner of the box.
    pub min: [f32; 3],
    /// Index of the first of two adjacent children, or position of the leaf's first object id.
    pub first: u32,
    /// Upper corner of the box.
    pub max: [f32; 3],
    /// Number of object ids of a leaf; 0 for an inner node.
    pub count: u32,
}

impl Bvh {
    /// The tree as binary nodes, the root first and children after their parents, to be used with the tree's
    /// [`prim_ids`](Bvh::prim_ids). A node with more than two children becomes several, which halve them in their order.
    /// O(nodes).
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) refuses.
    pub fn to_first_count(&self) -> Vec<FirstCountNode> {
        first_count(&binary(self), 0)
    }

    /// As [`to_first_count`](Self::to_first_count), with an unused node at index 1. So every pair of siblings begins at
    /// an even index and shares a cache line, as in `tinybvh`.
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) refuses.
    pub fn to_first_count_aligned(&self) -> Vec<FirstCountNode> {
        first_count(&binary(self), 1)
    }

    /// The tree of binary nodes and object ids, in depth-first order. Children may come before their parents; nodes and
    /// ids that cannot be reached from the root are left out. Refuses indices out of bounds and nodes with two parents.
    /// O(nodes).
    ///
    /// Does not look at the boxes: [`validate`](crate::validate()) checks them, and [`refit`](Bvh::refit) makes padded
    /// ones tight.
    pub fn from_first_count(nodes: &[FirstCountNode], prim_ids: &[u32]) -> Result<Self, InvalidBvh> {
        let box_of = |node: &FirstCountNode| Aabb::from([node.min, node.max]);
        unpack(nodes.len(), prim_ids, nodes.first().map(box_of), |from, parts| {
            let FirstCountNode { first, count, .. } = nodes[from];
            if count > 0 {
                parts.push((box_of(&nodes[from]), Part::Leaf { first, count }));
                return Ok(());
            }
            let bad = InvalidBvh::BadChildren { node: from, first, count: 2, nodes: nodes.len() };
            let (pair, _) = nodes.get(first as usize..).and_then(<[_]>::split_first_chunk::<2>).ok_or(bad)?;
            parts.extend((first as usize..).zip(pair).map(|(child, node)| (box_of(node), Part::Node(child))));
            Ok(())
        })
    }
}

/// The nodes of a binary tree, with `spare` unused ones after the root. In the tree itself pairs of siblings begin at odd
/// indices.
fn first_count(tree: &Bvh, spare: usize) -> Vec<FirstCountNode> {
    let mut nodes = alloc::vec![FirstCountNode::default(); tree.nodes.len()];
    if nodes.len() > 1 {
        nodes.resize(nodes.len() + spare, FirstCountNode::default());
    }
    let place = |index: usize| if index == 0 { 0 } else { index + spare };
    for (index, node) in tree.nodes.iter().enumerate() {
        let (first, count) = match node.kind() {
            NodeKind::Inner { first, .. } => (place(first as usize) as u32, 0),
            NodeKind::Leaf { first, count } => (first, count),
        };
        let (min, max) = (node.aabb.min.to_array(), node.aabb.max.to_array());
        nodes[place(index)] = FirstCountNode { min, first, max, count };
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Node, validate};
    use alloc::vec;

    /// A node of three children over seven boxes, with leaves of up to three.
    fn scene() -> (Bvh, Vec<Aabb>) {
        let boxes: Vec<Aabb> =
            (0..7u8).map(f32::from).map(|x| Aabb::from([[x, 0.0, 0.0], [x + 2.0, 1.0, x]])).collect();
        let leaf = |first, count| Node::leaf(Aabb::EMPTY, first, count);
        let inner = |first, count| Node::inner(Aabb::EMPTY, first, count);
        let nodes = vec![inner(1, 3), leaf(0, 1), inner(4, 2), leaf(6, 1), leaf(1, 3), leaf(4, 2)];
        let mut tree = Bvh { nodes, prim_ids: vec![6, 5, 4, 3, 2, 1, 0] };
        tree.refit(&boxes);
        (tree, boxes)
    }

    #[test]
    fn a_binary_tree_survives_the_way_there_and_back() {
        let (tree, boxes) = scene();
        let binary = Bvh::from_first_count(&tree.to_first_count(), &tree.prim_ids).unwrap();
        validate(&binary, &boxes).unwrap();
        assert_eq!((binary.nodes.len(), &binary.prim_ids), (7, &tree.prim_ids));
        for nodes in [binary.to_first_count(), binary.to_first_count_aligned()] {
            assert_eq!(Bvh::from_first_count(&nodes, &binary.prim_ids), Ok(binary.clone()));
        }
        let aligned = binary.to_first_count_aligned();
        assert!(aligned.iter().enumerate().all(|(at, node)| at == 1 || node.count > 0 || node.first % 2 == 0));
    }

    #[test]
    fn trees_of_no_node_and_of_one_have_arrays() {
        let aabb = Aabb::from([[0.0; 3], [1.0; 3]]);
        for tree in [Bvh::default(), Bvh { nodes: vec![Node::leaf(aabb, 0, 1)], prim_ids: vec![0] }] {
            for nodes in [tree.to_first_count(), tree.to_first_count_aligned()] {
                assert_eq!(Bvh::from_first_count(&nodes, &tree.prim_ids), Ok(tree.clone()));
                assert_eq!(nodes.len(), tree.nodes.len());
            }
        }
    }

    #[test]
    fn arrays_that_lead_astray_are_refused() {
        let (tree, _) = scene();
        let nodes = tree.to_first_count();
        let refusal = |at: usize, first, count| {
            let mut nodes = nodes.clone();
            (nodes[at].first, nodes[at].count) = (first, count);
            Bvh::from_first_count(&nodes, &tree.prim_ids).unwrap_err()
        };
        assert_eq!(refusal(0, 6, 0), InvalidBvh::BadChildren { node: 0, first: 6, count: 2, nodes: 7 });
        assert_eq!(
            refusal(0, u32::MAX, 0),
            InvalidBvh::BadChildren { node: 0, first: u32::MAX, count: 2, nodes: 7 }
        );
        assert!(matches!(refusal(0, 0, 0), InvalidBvh::Parents { parents: 2, .. }));
        assert_eq!(refusal(1, 7, 1), InvalidBvh::BadLeaf { node: 1, first: 7, count: 1, objects: 7 });
        assert_eq!(
            refusal(1, 1, u32::MAX),
            InvalidBvh::BadLeaf { node: 1, first: 1, count: u32::MAX, objects: 7 }
        );
        assert!(matches!(refusal(1, 0, 7), InvalidBvh::ObjectCount { objects: 7, .. }));
    }
}
