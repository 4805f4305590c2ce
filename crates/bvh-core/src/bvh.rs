//! The one tree type: flat nodes with adjacent siblings, and leaves that refer to ranges of object
//! ids.

use crate::{Aabb, Frame};
use bytemuck::{Pod, Zeroable};

/// The largest number of objects in one tree. It keeps node indices and counts within 31 bits.
pub const MAX_OBJECTS: usize = 1 << 30;

const LEAF: u32 = 1 << 31;

/// A node of a [`Bvh`]: 32 bytes of plain data.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// A box around everything below the node. The builders of this workspace make it the exact
    /// union.
    pub aabb: Aabb,
    first: u32,
    /// The count, with its highest bit set for a leaf.
    tagged_count: u32,
}

const _: () = assert!(size_of::<Node>() == 32);

/// The children or the objects of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeKind {
    /// Two or more children at `nodes[first..first + count]`.
    Inner {
        /// Index of the first child, greater than the index of the node.
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
    /// Makes an inner node over `nodes[first..first + count]`. `count` must be below 2^31.
    #[inline]
    pub fn inner(aabb: Aabb, first: u32, count: u32) -> Self {
        debug_assert!(count < LEAF);
        Self { aabb, first, tagged_count: count }
    }

    /// Makes a leaf over `prim_ids[first..first + count]`. `count` must be below 2^31.
    #[inline]
    pub fn leaf(aabb: Aabb, first: u32, count: u32) -> Self {
        debug_assert!(count < LEAF);
        Self { aabb, first, tagged_count: count | LEAF }
    }

    /// Returns the children or the objects of the node.
    #[inline]
    pub fn kind(&self) -> NodeKind {
        let first = self.first;
        let count = self.tagged_count & !LEAF;
        if self.is_leaf() {
            NodeKind::Leaf { first, count }
        } else {
            NodeKind::Inner { first, count }
        }
    }

    /// Returns whether the node is a leaf.
    #[inline]
    pub fn is_leaf(&self) -> bool {
        self.tagged_count & LEAF != 0
    }

    /// Returns the indices of the node's children in `nodes`; empty for a leaf.
    #[inline]
    pub fn children(&self) -> core::ops::Range<usize> {
        match self.kind() {
            NodeKind::Inner { first, count } => first as usize..first as usize + count as usize,
            NodeKind::Leaf { .. } => 0..0,
        }
    }

    /// Returns the positions of the leaf's objects in `prim_ids`; empty for an inner node.
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
/// Node 0 is the root. The children of a node are adjacent and come after their parent. An inner
/// node has two *or more* children, because Goldsmith–Salmon trees need wide nodes. Leaves refer to
/// ranges of `prim_ids`, a permutation of the objects. A tree over no objects has no nodes.
/// [`validate`](crate::validate()) checks all of this. A function on a tree that it rejects may panic,
/// not return or take all memory, unless the function says that it checks the tree.
///
/// ```
/// # use bvh_core::{Aabb, Bvh, Node, validate};
/// let boxes = [Aabb::from([[0.0; 3], [1.0; 3]]), Aabb::from([[2.0; 3], [3.0; 3]])];
/// let root = Node::inner(boxes[0].union(&boxes[1]), 1, 2);
/// let leaves = [Node::leaf(boxes[0], 0, 1), Node::leaf(boxes[1], 1, 1)];
/// let tree = Bvh::new(vec![root, leaves[0], leaves[1]], vec![1, 0]);
/// assert!(validate(&tree, &[boxes[1], boxes[0]]).is_ok());
/// assert!(validate(&tree, &boxes).is_err(), "objects in the wrong leaves");
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh {
    /// The nodes; one entry per node, the root first.
    pub nodes: Vec<Node>,
    /// The object ids in the order of the leaves; one entry per object.
    pub prim_ids: Vec<u32>,
    /// The frame that the boxes lie in; `None` for the axes of the file. Builders and searches,
    /// which see boxes alone, return `None`: whoever made the boxes knows their frame.
    pub frame: Option<Frame>,
}

/// A borrowed [`Bvh`], in a mapped file for example. Traversals accept this type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhView<'a> {
    /// The nodes, see [`Bvh::nodes`].
    pub nodes: &'a [Node],
    /// The object ids, see [`Bvh::prim_ids`].
    pub prim_ids: &'a [u32],
    /// The frame, see [`Bvh::frame`].
    pub frame: Option<&'a Frame>,
}

impl<'a> From<&'a Bvh> for BvhView<'a> {
    #[inline(always)]
    fn from(tree: &'a Bvh) -> Self {
        Self { nodes: &tree.nodes, prim_ids: &tree.prim_ids, frame: tree.frame.as_ref() }
    }
}

impl Bvh {
    /// Makes a tree of its nodes and object ids, with boxes along the file's axes.
    pub fn new(nodes: Vec<Node>, prim_ids: Vec<u32>) -> Self {
        Self { nodes, prim_ids, frame: None }
    }

    /// Returns the root's box; `None` for the tree over no objects.
    pub fn root_aabb(&self) -> Option<Aabb> {
        self.nodes.first().map(|root| root.aabb)
    }

    /// Returns the number of inner nodes. O(nodes).
    pub fn inner_count(&self) -> usize {
        self.nodes.iter().filter(|node| !node.is_leaf()).count()
    }

    /// Returns the number of edges from the root to the deepest leaf; 0 for a tree of at most one
    /// node. O(nodes) time and memory.
    pub fn depth(&self) -> usize {
        // One pass from the front is enough, because children come after their parents.
        let mut depth = vec![0u32; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate() {
            let below = depth[index] + 1;
            depth[node.children()].fill(below);
        }
        depth.into_iter().max().unwrap_or(0) as usize
    }

    /// Halves leaves of more than `most` objects, and of more than one, in the order of their
    /// objects. The halves keep the leaf's box; [`refit`](Self::refit) makes them tight. O(nodes).
    pub fn halve_leaves(&mut self, most: usize) {
        let mut index = 0;
        // The halves are appended, and so they are visited and halved again if necessary.
        while index < self.nodes.len() {
            let Node { aabb, .. } = self.nodes[index];
            let range = self.nodes[index].prims();
            if range.len() > most.max(1) {
                let half = (range.len() / 2) as u32;
                let start = range.start as u32;
                self.nodes[index] = Node::inner(aabb, self.nodes.len() as u32, 2);
                self.nodes.push(Node::leaf(aabb, start, half));
                self.nodes.push(Node::leaf(aabb, start + half, range.len() as u32 - half));
            }
            index += 1;
        }
    }

    /// Recomputes every box from the leaves up. Makes boxes tight again after objects have moved,
    /// or after another library has padded the boxes. O(nodes + objects).
    ///
    /// # Panics
    /// Panics if `boxes` has fewer entries than the tree has objects.
    pub fn refit(&mut self, boxes: &[Aabb]) {
        // Children come after their parents, so a pass from the back meets them first.
        for index in (0..self.nodes.len()).rev() {
            self.nodes[index].aabb = self.around(&self.nodes[index], boxes);
        }
    }

    /// Returns whether every box is the smallest box around the node's children or objects. If it
    /// is, [`refit`](Self::refit) would change nothing. O(nodes + objects).
    ///
    /// # Panics
    /// Under the same conditions as [`refit`](Self::refit).
    pub fn is_tight(&self, boxes: &[Aabb]) -> bool {
        self.nodes.iter().all(|node| node.aabb == self.around(node, boxes))
    }

    fn around(&self, node: &Node, boxes: &[Aabb]) -> Aabb {
        match node.kind() {
            NodeKind::Inner { .. } => {
                Aabb::union_of(self.nodes[node.children()].iter().map(|child| &child.aabb))
            }
            NodeKind::Leaf { .. } => {
                Aabb::union_of(self.prim_ids[node.prims()].iter().map(|&id| &boxes[id as usize]))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tests::two_cubes;

    #[test]
    fn a_tree_with_a_padded_box_is_not_tight_until_it_is_refitted() {
        for loose in 0..3 {
            let mut tree = two_cubes();
            let boxes = [1, 2].map(|leaf| tree.nodes[leaf].aabb);
            assert!(tree.is_tight(&boxes));
            tree.nodes[loose].aabb = Aabb::from(([0.0; 3], [4.0; 3]));
            assert!(!tree.is_tight(&boxes), "{loose}");
            tree.refit(&boxes);
            assert!(tree.is_tight(&boxes));
        }
    }
}
