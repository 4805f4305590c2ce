//! Binary nodes that hold the boxes of their children, as the GPU tracers of Aila and Laine read them.

use super::unpack::{Part, unpack};
use crate::collapse::binary;
use crate::{Aabb, Bvh, InvalidBvh, NodeKind};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};

/// A binary node of 64 bytes, one fetch for both children: the order of the fields is that of `tinybvh`'s `BVH_GPU`.
///
/// | bytes | type | field |
/// |---|---|---|
/// | 0..12 | `f32[3]` | lower corner of the left child |
/// | 12..16 | `u32` | index of the left child |
/// | 16..28 | `f32[3]` | its upper corner |
/// | 28..32 | `u32` | index of the right child |
/// | 32..44 | `f32[3]` | lower corner of the right child |
/// | 44..48 | `u32` | number of object ids of a leaf; 0 for an inner node |
/// | 48..60 | `f32[3]` | upper corner of the right child |
/// | 60..64 | `u32` | position of the leaf's first object id |
///
/// A leaf's own box is that of the left child, which readers need not look at.
///
/// Source: Aila & Laine 2009, 'Understanding the efficiency of ray traversal on GPUs'. Differs from the paper: leaves are nodes,
/// as in `tinybvh`, and fields are in another order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct AilaLaineNode {
    /// Lower corner of the left child.
    pub left_min: [f32; 3],
    /// Index of the left child.
    pub left: u32,
    /// Upper corner of the left child.
    pub left_max: [f32; 3],
    /// Index of the right child.
    pub right: u32,
    /// Lower corner of the right child.
    pub right_min: [f32; 3],
    /// Number of object ids of a leaf; 0 for an inner node.
    pub count: u32,
    /// Upper corner of the right child.
    pub right_max: [f32; 3],
    /// Position of the leaf's first object id.
    pub first: u32,
}

impl Bvh {
    /// The tree as nodes that hold their children's boxes, the root first, to be used with the tree's
    /// [`prim_ids`](Bvh::prim_ids). Nodes with more than two children become several. O(nodes).
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) refuses.
    pub fn to_aila_laine(&self) -> Vec<AilaLaineNode> {
        let tree = binary(self);
        let corners = |aabb: &Aabb| (aabb.min.to_array(), aabb.max.to_array());
        let node = |node: &crate::Node| match node.kind() {
            NodeKind::Leaf { first, count } => {
                let (left_min, left_max) = corners(&node.aabb);
                AilaLaineNode { left_min, left_max, first, count, ..Default::default() }
            }
            NodeKind::Inner { first: left, .. } => {
                let [(left_min, left_max), (right_min, right_max)] =
                    [left, left + 1].map(|child| corners(&tree.nodes[child as usize].aabb));
                let (right, count, first) = (left + 1, 0, 0);
                AilaLaineNode { left_min, left, left_max, right, right_min, count, right_max, first }
            }
        };
        tree.nodes.iter().map(node).collect()
    }

    /// The tree of such nodes, in depth-first order. Nodes and ids that cannot be reached are left out. Refuses indices out of
    /// bounds and nodes with two parents; does not look at the boxes. O(nodes).
    pub fn from_aila_laine(nodes: &[AilaLaineNode], prim_ids: &[u32]) -> Result<Self, InvalidBvh> {
        unpack(nodes.len(), prim_ids, None, |from, parts| {
            let node = &nodes[from];
            let left = Aabb::from([node.left_min, node.left_max]);
            if node.count > 0 {
                parts.push((left, Part::Leaf { first: node.first, count: node.count }));
            } else {
                let right = Aabb::from([node.right_min, node.right_max]);
                parts
                    .extend([(left, Part::Node(node.left as usize)), (right, Part::Node(node.right as usize))]);
            }
            Ok(())
        })
    }
}
