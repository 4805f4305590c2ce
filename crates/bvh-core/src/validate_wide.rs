//! The validator of wide layouts: nothing in one that passes leads out of bounds or in circles.

use crate::validate::Marks;
use crate::wide::{WideTarget, WideView};
use crate::{Aabb, MAX_OBJECTS};

/// Why a wide layout was refused. Nodes, lanes and blocks are named by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the indices that the messages name
pub enum InvalidWide {
    /// Triangles without blocks, or the reverse.
    #[error("the layout has {nodes} nodes and {blocks} blocks over {objects} triangles")]
    Counts { nodes: usize, blocks: usize, objects: usize },
    /// Children follow their parent, leaves begin where one before has ended, and each has one parent.
    #[error("lane {lane} of node {node} names no child, or one that has another parent")]
    Child { node: usize, lane: usize },
    /// A box is finite, and inside that of the lane that names its node; unused lanes are NaN throughout.
    #[error("lane {lane} of node {node} has no box inside its parent's")]
    Box { node: usize, lane: usize },
    /// A node that no lane names.
    #[error("node {node} has no parent")]
    NoParent { node: usize },
    /// A leaf that no lane names, or that does not end.
    #[error("block {block} begins no leaf that is named, or ends none")]
    Leaf { block: usize },
    /// An id outside the scene or in two places.
    #[error("block {block} names object {object}, of {objects}, or names it a second time")]
    Object { block: usize, object: u32, objects: usize },
    /// A triangle that is not inside its leaf's box.
    #[error("a triangle of block {block} is not inside its leaf")]
    Outside { block: usize },
    /// A triangle that is in no block.
    #[error("object {object} is in no leaf")]
    Missing { object: usize },
}

/// Checks that `wide` is a layout over `objects` triangles: every node and leaf reached once, every triangle in exactly
/// one leaf, every box inside its parent's. O(nodes + blocks), no recursion; safe on any bits.
pub(crate) fn check_wide(wide: WideView, objects: usize) -> Result<(), InvalidWide> {
    let WideView { nodes, blocks, .. } = wide;
    if objects > MAX_OBJECTS || blocks.is_empty() != (objects == 0) || nodes.len() > 2 * objects {
        return Err(InvalidWide::Counts { nodes: nodes.len(), blocks: blocks.len(), objects });
    }
    let (mut reached, mut leaves) = (Marks::new(nodes.len()), Marks::new(blocks.len()));
    let begins_leaf = |block: usize| block == 0 || blocks[block - 1].is_last();
    // The boxes that nodes and leaves must lie in, as their parents give them.
    let mut node_bounds = alloc::vec![wide.bounds; nodes.len()];
    let mut leaf_bounds = alloc::vec![wide.bounds; blocks.len()];
    if nodes.is_empty() && !blocks.is_empty() {
        leaves.set(0);
    }
    for (index, node) in nodes.iter().enumerate() {
        for lane in 0..8 {
            let plane = |plane: usize| node.planes[plane][lane];
            let aabb = Aabb::from([[plane(0), plane(1), plane(2)], [plane(3), plane(4), plane(5)]]);
            if (0..6).all(|number| plane(number).is_nan()) {
                if node.children[lane].target() != WideTarget::Node(0) {
                    return Err(InvalidWide::Child { node: index, lane });
                }
                continue;
            }
            if aabb.check().is_err() || !node_bounds[index].contains(&aabb) {
                return Err(InvalidWide::Box { node: index, lane });
            }
            let is_named_once = match node.children[lane].target() {
                WideTarget::Node(child) if child > index && child < nodes.len() => {
                    node_bounds[child] = aabb;
                    reached.set(child)
                }
                WideTarget::Block(first) if first < blocks.len() && begins_leaf(first) => {
                    leaf_bounds[first] = aabb;
                    leaves.set(first)
                }
                _ => false,
            };
            if !is_named_once {
                return Err(InvalidWide::Child { node: index, lane });
            }
        }
    }
    if let Some(node) = (1..nodes.len()).find(|&node| !reached.get(node)) {
        return Err(InvalidWide::NoParent { node });
    }
    let mut seen = Marks::new(objects);
    for (index, block) in blocks.iter().enumerate() {
        if begins_leaf(index) != leaves.get(index) || (index + 1 == blocks.len() && !block.is_last()) {
            return Err(InvalidWide::Leaf { block: index });
        }
        if !begins_leaf(index) {
            leaf_bounds[index] = leaf_bounds[index - 1];
        }
        for (lane, id) in block.ids().into_iter().enumerate() {
            let Some(object) = id else { continue };
            if object as usize >= objects || !seen.set(object as usize) {
                return Err(InvalidWide::Object { block: index, object, objects });
            }
            if !block.triangle(lane).is_some_and(|(_, t)| leaf_bounds[index].contains(&t.aabb())) {
                return Err(InvalidWide::Outside { block: index });
            }
        }
    }
    match (0..objects).find(|&object| !seen.get(object)) {
        Some(object) => Err(InvalidWide::Missing { object }),
        None => Ok(()),
    }
}
