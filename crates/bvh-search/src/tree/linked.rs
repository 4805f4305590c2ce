//! What the search for a position asks of a tree, and how the working form answers.

use super::{ANCHOR, Metric, Working};
use bvh_core::PackedAabb;

/// A binary tree in which a subtree can be moved to another position.
pub(crate) trait Linked {
    /// The parent of the root.
    const ABOVE: u32;
    /// The parent of a node.
    fn parent(&self, at: u32) -> u32;
    /// Both children; `None` for a leaf.
    fn children(&self, at: u32) -> Option<[u32; 2]>;
    /// The child of `at` that is not `child`.
    fn other(&self, at: u32, child: u32) -> u32;
    /// Exact union of all boxes below the node.
    fn aabb(&self, at: u32) -> PackedAabb;
    /// Size of the node's box.
    fn area(&self, at: u32) -> f64;
    /// Size of any box.
    fn size(&self, aabb: &PackedAabb) -> f64;
    /// Moves the subtree of `node` beside `position`, which is neither inside it nor its parent nor its sibling. Boxes
    /// are made tight. Returns the number of nodes visited.
    fn reinsert(&mut self, node: u32, position: u32) -> u64;
}

impl<M: Metric> Linked for Working<M> {
    const ABOVE: u32 = ANCHOR;

    #[inline(always)]
    fn parent(&self, at: u32) -> u32 {
        self.nodes[at as usize].parent
    }

    #[inline(always)]
    fn children(&self, at: u32) -> Option<[u32; 2]> {
        let node = &self.nodes[at as usize];
        (!node.is_leaf()).then_some(node.children)
    }

    #[inline(always)]
    fn other(&self, at: u32, child: u32) -> u32 {
        self.nodes[at as usize].other(child)
    }

    #[inline(always)]
    fn aabb(&self, at: u32) -> PackedAabb {
        self.nodes[at as usize].aabb
    }

    #[inline(always)]
    fn area(&self, at: u32) -> f64 {
        self.nodes[at as usize].area
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
