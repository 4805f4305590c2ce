//! Several changes that are undone together.

use super::{ANCHOR, Metric, NONE, Node, Working, contains};
use bvh_core::cost::Sum;

/// The state of a tree before some changes.
#[derive(Debug, Default)]
pub(crate) struct Checkpoint {
    /// The nodes that the changes have written, as they were before each of them.
    nodes: Vec<Node>,
    area: Sum,
}

impl<M: Metric> Working<M> {
    /// Makes the tree as it is a checkpoint.
    pub fn begin_checkpoint(&mut self, checkpoint: &mut Checkpoint) {
        self.begin();
        checkpoint.nodes.clear();
        checkpoint.area = self.area;
    }

    /// Adds the current change to the changes since the checkpoint.
    #[inline(always)]
    pub fn record(&self, checkpoint: &mut Checkpoint) {
        checkpoint.nodes.extend_from_slice(&self.journal);
    }

    /// Undoes the current change and all recorded ones, to the last bit.
    pub fn take_back(&mut self, checkpoint: &mut Checkpoint) {
        self.undo();
        // The oldest state of a node is written last.
        for node in checkpoint.nodes.drain(..).rev() {
            self.nodes[node.index as usize] = node;
        }
        self.area = checkpoint.area;
    }

    /// Returns what the current change has added to the area.
    #[inline(always)]
    pub fn added(&self) -> f64 {
        self.added
    }

    /// Returns whether a node is in the tree, where only the subtrees of the nodes `detached` are
    /// not. O(detached), and O(depth) if the box of one of them contains the node's box.
    #[inline(always)]
    pub fn is_attached(&self, node: u32, mut detached: impl Iterator<Item = u32>) -> bool {
        let Node { aabb, parent, .. } = self.nodes[node as usize];
        let may_be_below = |root: u32| contains(&self.nodes[root as usize].aabb, &aabb);
        parent != NONE && (!detached.any(may_be_below) || self.leads_to_anchor(parent))
    }

    /// Returns whether the ancestors of a node end at the anchor.
    #[inline(never)]
    fn leads_to_anchor(&self, mut node: u32) -> bool {
        while node != ANCHOR && node != NONE {
            node = self.nodes[node as usize].parent;
        }
        node == ANCHOR
    }
}
