//! Conversion from and to the arrays of other libraries: binary nodes with the fields `first` and
//! `count`.

use super::unpack::{Below, unpack};
use crate::collapse::binary;
use crate::{Aabb, Bvh, InvalidBvh, NodeKind};
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
#[allow(missing_docs)] // The table explains the fields.
pub struct FirstCountNode {
    pub min: [f32; 3],
    pub first: u32,
    pub max: [f32; 3],
    pub count: u32,
}

impl Bvh {
    /// Converts the tree to binary nodes, the root first and children after their parents. The
    /// nodes refer to the tree's [`prim_ids`](Bvh::prim_ids). A node with more than two children
    /// becomes several nodes, which halve the children in their order. Boxes lie in the tree's
    /// [frame](Bvh::frame). O(nodes).
    pub fn to_first_count(&self) -> Vec<FirstCountNode> {
        first_count(&binary(self), 0)
    }

    /// Converts the tree like [`to_first_count`](Self::to_first_count), but with an unused node at
    /// index 1. Every pair of siblings then begins at an even index and shares a cache line, as in
    /// `tinybvh`.
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
        unpack(nodes.len(), prim_ids, |index| {
            let FirstCountNode { min, first, max, count } = nodes[index];
            let below = match count {
                0 => {
                    let low = first as usize;
                    Below::Children { named: first, at: [low, low.saturating_add(1)] }
                }
                _ => Below::Objects { first, count },
            };
            (Aabb::from([min, max]), below)
        })
    }
}

/// Converts the nodes of a binary tree, with `spare` unused nodes after the root. In the tree
/// itself every pair of siblings begins at an odd index.
fn first_count(tree: &Bvh, spare: usize) -> Vec<FirstCountNode> {
    let mut nodes = vec![FirstCountNode::default(); tree.nodes.len()];
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
