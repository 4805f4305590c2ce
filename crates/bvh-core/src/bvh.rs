//! The one tree type: flat nodes with adjacent siblings, and leaves that name ranges of object ids.

use crate::Aabb;
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};

/// The most objects one tree may hold: node indices and counts stay within 31 bits.
pub const MAX_OBJECTS: usize = 1 << 30;

const LEAF: u32 = 1 << 31;

/// A node of a [`Bvh`]: 32 bytes, plain data.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Contains everything below the node. The builders of this workspace make it the exact union.
    pub aabb: Aabb,
    first: u32,
    /// The count, with its highest bit set for a leaf.
    tagged_count: u32,
}

/// What a node refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeKind {
    /// Two or more children at `nodes[first..first + count]`.
    Inner {
        /// Index of the first child; greater than the node's own.
        first: u32,
        /// Number of children, at least 2.
        count: u32,
    },
    /// One or more objects, `prim_ids[first..first + count]`.
    Leaf {
        /// Index of the first entry in `prim_ids`.
        first: u32,
        /// Number of objects, at least 1.
        count: u32,
    },
}

impl Node {
    /// An inner node over `nodes[first..first + count]`. `count` must be below 2^31.
    #[inline]
    pub fn inner(aabb: Aabb, first: u32, count: u32) -> Self {
        debug_assert!(count < LEAF);
        Self { aabb, first, tagged_count: count }
    }

    /// A leaf over `prim_ids[first..first + count]`. `count` must be below 2^31.
    #[inline]
    pub fn leaf(aabb: Aabb, first: u32, count: u32) -> Self {
        debug_assert!(count < LEAF);
        Self { aabb, first, tagged_count: count | LEAF }
    }

    /// What the node refers to.
    #[inline]
    pub fn kind(&self) -> NodeKind {
        let (first, count) = (self.first, self.tagged_count & !LEAF);
        if self.is_leaf() { NodeKind::Leaf { first, count } } else { NodeKind::Inner { first, count } }
    }

    /// Moves the node's range of children or of entries of `prim_ids`, without changing its length, to `first`.
    #[inline(always)]
    pub fn set_first(&mut self, first: u32) {
        self.first = first;
    }

    /// `first`, and the count with its highest bit set for a leaf.
    #[inline(always)]
    pub(crate) fn words(&self) -> [u32; 2] {
        [self.first, self.tagged_count]
    }

    /// Whether the node is a leaf.
    #[inline]
    pub fn is_leaf(&self) -> bool {
        self.tagged_count & LEAF != 0
    }

    /// The indices in `nodes` of the node's children; empty for a leaf.
    #[inline]
    pub fn children(&self) -> core::ops::Range<usize> {
        match self.kind() {
            NodeKind::Inner { first, count } => first as usize..first as usize + count as usize,
            NodeKind::Leaf { .. } => 0..0,
        }
    }

    /// The positions in `prim_ids` of the leaf's objects; empty for an inner node.
    #[inline]
    pub fn prims(&self) -> core::ops::Range<usize> {
        match self.kind() {
            NodeKind::Leaf { first, count } => first as usize..first as usize + count as usize,
            NodeKind::Inner { .. } => 0..0,
        }
    }
}

/// A bounding volume hierarchy over objects `0..n`.
///
/// Node 0 is the root. The children of a node are adjacent and come after it; inner nodes have two *or more* of them, as
/// Goldsmith–Salmon trees need. Leaves name ranges of `prim_ids`, a permutation of the objects. A tree over no objects
/// has no nodes. [`validate`](crate::validate()) checks all of this.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh {
    /// The nodes; one entry per node, the root first.
    pub nodes: Vec<Node>,
    /// Object ids, in leaf order; one entry per object.
    pub prim_ids: Vec<u32>,
}

/// A borrowed [`Bvh`], in a mapped file for example; traversals take this type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhView<'a> {
    /// As [`Bvh::nodes`].
    pub nodes: &'a [Node],
    /// As [`Bvh::prim_ids`].
    pub prim_ids: &'a [u32],
}

impl<'a> From<&'a Bvh> for BvhView<'a> {
    #[inline(always)]
    fn from(tree: &'a Bvh) -> Self {
        Self { nodes: &tree.nodes, prim_ids: &tree.prim_ids }
    }
}

impl Bvh {
    /// The root's box; `None` for the tree over no objects.
    pub fn root_aabb(&self) -> Option<Aabb> {
        self.nodes.first().map(|root| root.aabb)
    }

    /// Number of inner nodes, in O(nodes).
    pub fn inner_count(&self) -> usize {
        self.nodes.iter().filter(|node| !node.is_leaf()).count()
    }

    /// Number of edges from the root to the deepest leaf, in O(nodes) time and memory; 0 for at most one node.
    ///
    /// # Panics
    /// May panic on a tree that [`validate`](crate::validate()) refuses.
    pub fn depth(&self) -> usize {
        let mut depth = alloc::vec![0u32; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate() {
            let below = depth[index] + 1;
            depth[node.children()].fill(below);
        }
        depth.into_iter().max().unwrap_or(0) as usize
    }

    /// Recomputes every box from the leaves up. Boxes are tight again after objects have moved, or after another library
    /// has padded them. O(nodes + objects).
    ///
    /// # Panics
    /// Panics if `boxes` has fewer entries than the tree's objects, or the tree is one that
    /// [`validate`](crate::validate()) refuses.
    pub fn refit(&mut self, boxes: &[Aabb]) {
        for index in (0..self.nodes.len()).rev() {
            self.nodes[index].aabb = self.around(&self.nodes[index], boxes);
        }
    }

    /// Whether every box is the smallest around the node's children or objects, so that [`refit`](Self::refit) would
    /// change nothing. O(nodes + objects).
    ///
    /// # Panics
    /// As [`refit`](Self::refit).
    pub fn is_tight(&self, boxes: &[Aabb]) -> bool {
        self.nodes.iter().all(|node| node.aabb == self.around(node, boxes))
    }

    /// The box around a node's children or objects.
    fn around(&self, node: &Node, boxes: &[Aabb]) -> Aabb {
        match node.kind() {
            NodeKind::Inner { .. } => {
                self.nodes[node.children()].iter().fold(Aabb::EMPTY, |b, child| b.union(&child.aabb))
            }
            NodeKind::Leaf { .. } => {
                self.prim_ids[node.prims()].iter().fold(Aabb::EMPTY, |b, &id| b.union(&boxes[id as usize]))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn a_node_is_plain_data_of_32_bytes() {
        assert_eq!(size_of::<Node>(), 32);
        assert!(!core::mem::needs_drop::<Node>());
    }

    #[test]
    fn a_tree_is_tight_until_a_box_has_room_to_spare_and_again_when_refitted() {
        let boxes = [0.0, 2.0].map(|x| Aabb::from(([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0])));
        let padded = Aabb::from(([0.0; 3], [4.0; 3]));
        for loose in 0..3 {
            let mut tree = Bvh {
                nodes: vec![
                    Node::inner(boxes[0].union(&boxes[1]), 1, 2),
                    Node::leaf(boxes[0], 0, 1),
                    Node::leaf(boxes[1], 1, 1),
                ],
                prim_ids: vec![0, 1],
            };
            assert!(tree.is_tight(&boxes));
            tree.nodes[loose].aabb = padded;
            assert!(!tree.is_tight(&boxes), "{loose}");
            tree.refit(&boxes);
            assert!(tree.is_tight(&boxes));
        }
    }

    #[test]
    fn depth_counts_edges_to_the_deepest_leaf() {
        let unit = Aabb::from(([0.0; 3], [1.0; 3]));
        let leaf = |i| Node::leaf(unit, i, 1);
        let tree = Bvh {
            nodes: vec![Node::inner(unit, 1, 3), leaf(0), Node::inner(unit, 4, 2), leaf(1), leaf(2), leaf(3)],
            prim_ids: vec![0, 1, 2, 3],
        };
        assert_eq!(tree.depth(), 2);
        assert_eq!(Bvh::default().depth(), 0);
    }

    #[test]
    fn refitting_restores_tight_boxes() {
        let boxes = [Aabb::from(([0.0; 3], [1.0; 3])), Aabb::from(([4.0; 3], [5.0; 3]))];
        let wide = Aabb::from(([-9.0; 3], [9.0; 3]));
        let mut tree = Bvh {
            nodes: vec![Node::inner(wide, 1, 2), Node::leaf(wide, 0, 1), Node::leaf(wide, 1, 1)],
            prim_ids: vec![1, 0],
        };
        tree.refit(&boxes);
        assert_eq!(
            tree.nodes.iter().map(|n| n.aabb).collect::<Vec<_>>(),
            [boxes[0].union(&boxes[1]), boxes[1], boxes[0]]
        );
    }
}
