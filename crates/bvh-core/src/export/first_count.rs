//! Conversion from and to the arrays of other libraries: binary nodes with the fields `first` and
//! `count`.

use super::unpack::{Part, unpack};
use crate::collapse::binary;
use crate::{Aabb, Bvh, InvalidBvh, NodeKind};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};

/// A binary node of 32 bytes, as in most libraries. The fields have the same order as in `BVHNode`
/// of `tinybvh` and in many GPU tracers. `obvhs` has the same fields in another order.
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
    /// Converts the tree to binary nodes, the root first and children after their parents. The
    /// nodes refer to the tree's [`prim_ids`](Bvh::prim_ids). A node with more than two children
    /// becomes several nodes, which halve the children in their order. O(nodes).
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) rejects.
    pub fn to_first_count(&self) -> Vec<FirstCountNode> {
        first_count(&binary(self), 0)
    }

    /// Converts the tree like [`to_first_count`](Self::to_first_count), but with an unused node at
    /// index 1. Every pair of siblings then begins at an even index and shares a cache line, as in
    /// `tinybvh`.
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) rejects.
    pub fn to_first_count_aligned(&self) -> Vec<FirstCountNode> {
        first_count(&binary(self), 1)
    }

    /// Makes a tree from binary nodes and object ids, in depth-first order. Children may come
    /// before their parents. Nodes and ids that cannot be reached from the root are skipped.
    /// Rejects indices out of bounds and nodes with two parents. O(nodes).
    ///
    /// Does not check the boxes: [`validate`](crate::validate()) checks boxes, and
    /// [`refit`](Bvh::refit) makes padded boxes tight.
    pub fn from_first_count(
        nodes: &[FirstCountNode],
        prim_ids: &[u32],
    ) -> Result<Self, InvalidBvh> {
        let root = nodes.first().map(FirstCountNode::aabb);
        unpack(nodes.len(), prim_ids, root, |index, parts| {
            let node = &nodes[index];
            let first = node.first;
            if node.count > 0 {
                parts.push((node.aabb(), Part::Leaf { first, count: node.count }));
                return Ok(());
            }
            let left = first as usize;
            let Some([left_node, right_node]) = nodes.get(left..).and_then(<[_]>::first_chunk)
            else {
                return Err(InvalidBvh::BadChildren {
                    node: index,
                    first,
                    count: 2,
                    nodes: nodes.len(),
                });
            };
            parts.push((left_node.aabb(), Part::Node(left)));
            parts.push((right_node.aabb(), Part::Node(left + 1)));
            Ok(())
        })
    }
}

impl FirstCountNode {
    fn aabb(&self) -> Aabb {
        Aabb::from([self.min, self.max])
    }
}

/// Converts the nodes of a binary tree, with `spare` unused nodes after the root. In the tree
/// itself every pair of siblings begins at an odd index.
fn first_count(tree: &Bvh, spare: usize) -> Vec<FirstCountNode> {
    let mut nodes = alloc::vec![FirstCountNode::default(); tree.nodes.len()];
    // A root without children needs no spare node.
    if nodes.len() > 1 {
        nodes.resize(nodes.len() + spare, FirstCountNode::default());
    }
    for (index, node) in tree.nodes.iter().enumerate() {
        let (first, count) = match node.kind() {
            NodeKind::Inner { first, .. } => (first + spare as u32, 0),
            NodeKind::Leaf { first, count } => (first, count),
        };
        let place = if index == 0 { 0 } else { index + spare };
        let min = node.aabb.min.to_array();
        let max = node.aabb.max.to_array();
        nodes[place] = FirstCountNode { min, first, max, count };
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Node, validate};
    use alloc::vec;

    /// Makes a tree over seven boxes. The root has three children, and leaves have up to three
    /// objects.
    fn scene() -> (Bvh, Vec<Aabb>) {
        let mut boxes = Vec::new();
        for x in (0..7u8).map(f32::from) {
            boxes.push(Aabb::from([[x, 0.0, 0.0], [x + 2.0, 1.0, x]]));
        }
        let nodes = vec![
            Node::inner(Aabb::EMPTY, 1, 3),
            Node::leaf(Aabb::EMPTY, 0, 1),
            Node::inner(Aabb::EMPTY, 4, 2),
            Node::leaf(Aabb::EMPTY, 6, 1),
            Node::leaf(Aabb::EMPTY, 1, 3),
            Node::leaf(Aabb::EMPTY, 4, 2),
        ];
        let mut tree = Bvh { nodes, prim_ids: vec![6, 5, 4, 3, 2, 1, 0] };
        tree.refit(&boxes);
        (tree, boxes)
    }

    #[test]
    fn a_binary_tree_survives_a_round_trip() {
        let (tree, boxes) = scene();
        let binary = Bvh::from_first_count(&tree.to_first_count(), &tree.prim_ids).unwrap();
        validate(&binary, &boxes).unwrap();
        assert_eq!(binary.nodes.len(), 7);
        assert_eq!(binary.prim_ids, tree.prim_ids);
        for nodes in [binary.to_first_count(), binary.to_first_count_aligned()] {
            assert_eq!(Bvh::from_first_count(&nodes, &binary.prim_ids), Ok(binary.clone()));
        }
        for (index, node) in binary.to_first_count_aligned().iter().enumerate() {
            // Index 1 is the unused node.
            if index != 1 && node.count == 0 {
                assert_eq!(node.first % 2, 0, "{index}");
            }
        }
    }

    #[test]
    fn trees_of_no_node_and_of_one_have_arrays() {
        let aabb = Aabb::from([[0.0; 3], [1.0; 3]]);
        for tree in [Bvh::default(), Bvh { nodes: vec![Node::leaf(aabb, 0, 1)], prim_ids: vec![0] }]
        {
            for nodes in [tree.to_first_count(), tree.to_first_count_aligned()] {
                assert_eq!(Bvh::from_first_count(&nodes, &tree.prim_ids), Ok(tree.clone()));
                assert_eq!(nodes.len(), tree.nodes.len());
            }
        }
    }

    #[test]
    fn arrays_with_invalid_indices_are_rejected() {
        let (tree, _) = scene();
        for first in [6, u32::MAX] {
            let bad_children = InvalidBvh::BadChildren { node: 0, first, count: 2, nodes: 7 };
            assert_eq!(rejection(&tree, 0, first, 0), bad_children);
        }
        assert!(matches!(rejection(&tree, 0, 0, 0), InvalidBvh::Parents { parents: 2, .. }));
        for (first, count) in [(7, 1), (1, u32::MAX)] {
            let bad_leaf = InvalidBvh::BadLeaf { node: 1, first, count, objects: 7 };
            assert_eq!(rejection(&tree, 1, first, count), bad_leaf);
        }
        assert!(matches!(rejection(&tree, 1, 0, 7), InvalidBvh::ObjectCount { objects: 7, .. }));
    }

    /// Returns the error of the tree's array after the fields of one node were replaced.
    fn rejection(tree: &Bvh, index: usize, first: u32, count: u32) -> InvalidBvh {
        let mut nodes = tree.to_first_count();
        nodes[index].first = first;
        nodes[index].count = count;
        Bvh::from_first_count(&nodes, &tree.prim_ids).unwrap_err()
    }
}
