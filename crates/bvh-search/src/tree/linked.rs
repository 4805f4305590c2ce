//! [`Linked`]: the tree operations that the position search needs.

use super::{ANCHOR, Metric, Working};
use bvh_core::PackedAabb;

/// A binary tree whose subtrees can be moved to other positions.
pub(crate) trait Linked {
    /// The parent of the root, a value that is no node.
    const ABOVE: u32;
    /// The parent of a node.
    fn parent(&self, index: u32) -> u32;
    /// Both children; `None` for a leaf.
    fn children(&self, index: u32) -> Option<[u32; 2]>;
    /// The child of `index` that is not `child`.
    fn other(&self, index: u32, child: u32) -> u32;
    /// Exact union of all boxes below the node.
    fn aabb(&self, index: u32) -> PackedAabb;
    /// Size of the node's box.
    fn area(&self, index: u32) -> f64;
    /// Size of any box.
    fn size(&self, aabb: &PackedAabb) -> f64;
    /// Moves the subtree of `node` next to `position`, which is not inside the subtree and neither
    /// its parent nor its sibling. Makes boxes tight. Returns the number of nodes visited.
    fn reinsert(&mut self, node: u32, position: u32) -> u64;
}

impl<M: Metric> Linked for Working<M> {
    const ABOVE: u32 = ANCHOR;

    #[inline(always)]
    fn parent(&self, index: u32) -> u32 {
        self.nodes[index as usize].parent
    }

    #[inline(always)]
    fn children(&self, index: u32) -> Option<[u32; 2]> {
        let node = &self.nodes[index as usize];
        (!node.is_leaf()).then_some(node.children)
    }

    #[inline(always)]
    fn other(&self, index: u32, child: u32) -> u32 {
        self.nodes[index as usize].other(child)
    }

    #[inline(always)]
    fn aabb(&self, index: u32) -> PackedAabb {
        self.nodes[index as usize].aabb
    }

    #[inline(always)]
    fn area(&self, index: u32) -> f64 {
        self.nodes[index as usize].area
    }

    #[inline(always)]
    fn size(&self, aabb: &PackedAabb) -> f64 {
        self.metric.of(aabb)
    }

    #[inline(always)]
    fn reinsert(&mut self, node: u32, position: u32) -> u64 {
        self.begin();
        let (_, _, visits) = self.detach(node);
        visits + self.attach(node, position).1
    }
}
