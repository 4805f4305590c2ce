//! Binary nodes that contain the boxes of their children, as the GPU tracers of Aila and Laine read
//! them.

use super::unpack::{Part, unpack};
use crate::collapse::binary;
use crate::{Aabb, Bvh, InvalidBvh, Node, NodeKind};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};

/// A binary node of 64 bytes. One fetch reads the boxes of both children. The fields have the same
/// order as in `BVH_GPU` of `tinybvh`.
///
/// | bytes | type | field |
/// |---|---|---|
/// | 0..12 | `f32[3]` | lower corner of the left child |
/// | 12..16 | `u32` | index of the left child |
/// | 16..28 | `f32[3]` | upper corner of the left child |
/// | 28..32 | `u32` | index of the right child |
/// | 32..44 | `f32[3]` | lower corner of the right child |
/// | 44..48 | `u32` | number of object ids of a leaf; 0 for an inner node |
/// | 48..60 | `f32[3]` | upper corner of the right child |
/// | 60..64 | `u32` | position of the leaf's first object id |
///
/// A leaf stores its box instead of the left child's box. Readers need not use it.
///
/// Source: Aila & Laine 2009, 'Understanding the efficiency of ray traversal on GPUs'. Differs from
/// the paper: leaves are nodes, as in `tinybvh`, and fields are in another order.
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
    /// Converts the tree to nodes that contain their children's boxes, the root first. The nodes
    /// refer to the tree's [`prim_ids`](Bvh::prim_ids). A node with more than two children becomes
    /// several nodes. O(nodes).
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) rejects.
    pub fn to_aila_laine(&self) -> Vec<AilaLaineNode> {
        let tree = binary(self);
        tree.nodes.iter().map(|node| packed(node, &tree)).collect()
    }

    /// Makes a tree from such nodes, in depth-first order. Nodes and ids that cannot be reached
    /// from the root are skipped. Rejects indices out of bounds and nodes with two parents. Does
    /// not check the boxes. O(nodes).
    pub fn from_aila_laine(nodes: &[AilaLaineNode], prim_ids: &[u32]) -> Result<Self, InvalidBvh> {
        unpack(nodes.len(), prim_ids, None, |index, parts| {
            let node = &nodes[index];
            let left = Aabb::from([node.left_min, node.left_max]);
            let right = Aabb::from([node.right_min, node.right_max]);
            if node.count > 0 {
                parts.push((left, Part::Leaf { first: node.first, count: node.count }));
            } else {
                parts.push((left, Part::Node(node.left as usize)));
                parts.push((right, Part::Node(node.right as usize)));
            }
            Ok(())
        })
    }
}

/// Converts a node of a binary tree. The indices of nodes stay the same.
fn packed(node: &Node, tree: &Bvh) -> AilaLaineNode {
    match node.kind() {
        NodeKind::Leaf { first, count } => AilaLaineNode {
            left_min: node.aabb.min.to_array(),
            left_max: node.aabb.max.to_array(),
            first,
            count,
            ..Default::default()
        },
        NodeKind::Inner { first, .. } => {
            let left = &tree.nodes[first as usize].aabb;
            let right = &tree.nodes[first as usize + 1].aabb;
            AilaLaineNode {
                left_min: left.min.to_array(),
                left: first,
                left_max: left.max.to_array(),
                right: first + 1,
                right_min: right.min.to_array(),
                count: 0,
                right_max: right.max.to_array(),
                first: 0,
            }
        }
    }
}
