//! The cost of a tree's wide layout, computed without building the layout: the expected cost of
//! tracing a ray through it.
//!
//! A wide node replaces up to seven binary nodes, and a block holds up to four triangles, so the
//! cost of the layout is not proportional to the cost of the tree. A search that lowers the
//! internal area of a greedy tree by a quarter lowers its layout's cost by a twelfth; a search that
//! minimises the layout's cost lowers it by a fifth. Dynamic programming finds the best layout from
//! the leaves up:
//!
//! ```text
//!   as k children:      cost(P, k) = min over i + j = k of cost(L, i) + cost(R, j)         P
//!   as a wide node:     cost(P, 8) + A(P) · node                                         /   \
//!   as a leaf:          A(P) · block · ⌈objects / 4⌉                                    L     R
//! ```
//!
//! Source: Ylitie, Karras & Laine 2017, section 4.1. A subtree contributes a row of seven costs,
//! and a changed node changes only the rows above it, which makes searches that minimise this cost
//! possible.

use crate::collapse::binary;
use crate::cost::Measure;
use crate::wide::{BLOCK_COST, NODE_COST, TriangleBlock};
use crate::{Bvh, PackedAabb};

/// The costs of a subtree as parts of a wide layout, in the unit of its boxes' sizes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct LayoutCost {
    /// The least costs as at most 1 to 7 children of a wide node.
    as_children: [f64; 7],
    objects: u32,
}

impl LayoutCost {
    /// Returns the costs of a leaf whose box has this size.
    #[inline(always)]
    pub fn leaf(size: f64, objects: u32) -> Self {
        Self { as_children: [leaf_cost(size, objects); 7], objects }
    }

    /// Returns the costs of a node with two children, whose box has this size.
    #[inline(always)]
    pub fn join(size: f64, left: &Self, right: &Self) -> Self {
        // A leaf costs the same as any number of children. Half of all nodes are leaves, and the
        // least sum with a constant needs one addition instead of the search for it.
        let split = if left.is_constant() {
            right.plus(left.value())
        } else if right.is_constant() {
            left.plus(right.value())
        } else {
            left.split_with(right)
        };
        let objects = left.objects + right.objects;
        let as_node = split[6] + size * f64::from(NODE_COST);
        let as_leaf = leaf_cost(size, objects);
        let one = if as_leaf < as_node { as_leaf } else { as_node };
        let mut as_children = [one; 7];
        for k in 1..7 {
            let fewer = as_children[k - 1];
            let exactly = split[k - 1];
            as_children[k] = if exactly < fewer { exactly } else { fewer };
        }
        Self { as_children, objects }
    }

    /// Returns whether more children lower the cost.
    #[inline(always)]
    fn is_constant(&self) -> bool {
        // Rows never rise.
        self.as_children[0] == self.as_children[6]
    }

    /// Returns the costs together with another subtree of constant cost, as 2 to 8 children.
    #[inline(always)]
    fn plus(&self, constant: f64) -> [f64; 7] {
        self.as_children.map(|cost| cost + constant)
    }

    /// Returns the least costs together with another subtree, as 2 to 8 children.
    #[inline(always)]
    fn split_with(&self, other: &Self) -> [f64; 7] {
        const NEVER: f64 = f64::INFINITY;
        let [a, b, c, d, e, f, g] = other.as_children;
        let other_children = [a, b, c, d, e, f, g, NEVER];
        // The last entries exceed the children of a node and are dropped; a fixed length lets the
        // compiler unroll the loops.
        let mut split = [NEVER; 14];
        for (first, cost) in self.as_children.iter().enumerate() {
            for (second, other) in other_children.iter().enumerate() {
                let sum = cost + other;
                let least = &mut split[first + second];
                *least = if sum < *least { sum } else { *least };
            }
        }
        let [a, b, c, d, e, f, g, ..] = split;
        [a, b, c, d, e, f, g]
    }

    /// Returns the cost of the subtree as one child or as the root: a wide node or a leaf.
    #[inline(always)]
    pub fn value(&self) -> f64 {
        self.as_children[0]
    }
}

#[inline(always)]
fn leaf_cost(size: f64, objects: u32) -> f64 {
    size * (f64::from(BLOCK_COST) * f64::from(objects.div_ceil(TriangleBlock::LANES as u32)))
}

/// Returns the cost of the cheapest wide layout of `tree` for endless uniform lines, times the
/// root's half area: nodes and blocks of triangles, each weighted by the half area of its box, in
/// world units squared. Nodes with more than two children are halved first. O(nodes).
pub fn layout_area(tree: &Bvh) -> f64 {
    layout_cost(tree, None, &call_in_turn)
}

/// Calls two functions, one after the other: the [`CallBoth`] of a program without threads.
pub fn call_in_turn(first: &mut (dyn FnMut() + Send), second: &mut (dyn FnMut() + Send)) {
    first();
    second();
}

/// A function that calls two functions, one after the other or at once, and returns when both have
/// returned. This crate starts no threads; with `rayon`, `&|a, b| _ = rayon::join(a, b)` calls both
/// at once.
pub type CallBoth<'a> = &'a (dyn Fn(&mut (dyn FnMut() + Send), &mut (dyn FnMut() + Send)) + Sync);

/// Returns the same as [`layout_area`], or with a measure instead of the half area. Passes the two
/// subtrees of nodes near the root to `both`; the result is the same, bit by bit, however it calls
/// them. O(nodes).
pub fn layout_cost(tree: &Bvh, measure: Option<&dyn Measure>, both: CallBoth) -> f64 {
    if tree.nodes.is_empty() {
        return 0.0;
    }
    layout_row(&Measured { tree: &binary(tree), measure }, 0, both).value()
}

/// A tree with two children per inner node, whose nodes have sizes and are identified by index.
pub trait LayoutTree: Sync {
    /// Returns the size of a node's box.
    fn size(&self, node: usize) -> f64;
    /// Returns the two children of a node; the number of objects of a leaf as an error.
    fn children(&self, node: usize) -> Result<[usize; 2], u32>;
}

/// A binary tree with the half areas of its boxes or with another measure.
struct Measured<'a> {
    tree: &'a Bvh,
    measure: Option<&'a dyn Measure>,
}

impl LayoutTree for Measured<'_> {
    #[inline(always)]
    fn size(&self, node: usize) -> f64 {
        let aabb = &self.tree.nodes[node].aabb;
        match self.measure {
            Some(measure) => measure.of(&PackedAabb::from(aabb)),
            None => aabb.half_area(),
        }
    }

    #[inline(always)]
    fn children(&self, node: usize) -> Result<[usize; 2], u32> {
        let node = &self.tree.nodes[node];
        if node.is_leaf() {
            return Err(node.prims().len() as u32);
        }
        let first = node.children().start;
        Ok([first, first + 1])
    }
}

/// Returns the costs of a node as parts of a wide layout. Passes the two subtrees of nodes near it
/// to `both`. O(nodes below it).
pub fn layout_row(tree: &impl LayoutTree, node: usize, both: CallBoth) -> LayoutCost {
    /// The number of levels whose subtrees are passed to `both`: enough for many threads and for
    /// unequal subtrees.
    const LEVELS_AT_ONCE: u32 = 10;
    row(tree, node, LEVELS_AT_ONCE, both)
}

/// Returns the row of a node; the subtrees of so many `levels` from it are computed at once.
fn row(tree: &impl LayoutTree, node: usize, levels: u32, both: CallBoth) -> LayoutCost {
    let children = tree.children(node).ok().filter(|_| levels > 0);
    let Some([first, second]) = children else { return row_alone(tree, node) };
    let [mut left, mut right] = [LayoutCost::leaf(0.0, 0); 2];
    both(&mut || left = row(tree, first, levels - 1, both), &mut || {
        right = row(tree, second, levels - 1, both)
    });
    LayoutCost::join(tree.size(node), &left, &right)
}

crate::with_vector_instructions! {
    row_alone = row_alone_plain<T: LayoutTree>(tree: &T, root: usize) -> LayoutCost
}

/// Returns the row of a node, computed by this thread.
#[inline(always)]
fn row_alone_plain<T: LayoutTree>(tree: &T, root: usize) -> LayoutCost {
    // Children before parents, so that the rows of a path suffice: a row for every node would take
    // twice the memory of the tree.
    let mut rows: Vec<LayoutCost> = Vec::new();
    let mut pending = vec![(root, false)];
    while let Some((node, has_rows)) = pending.pop() {
        match tree.children(node) {
            Err(objects) => rows.push(LayoutCost::leaf(tree.size(node), objects)),
            Ok(_) if has_rows => {
                let both = rows.len() - 2;
                let joined = LayoutCost::join(tree.size(node), &rows[both], &rows[both + 1]);
                rows.truncate(both);
                rows.push(joined);
            }
            Ok([first, second]) => pending.extend([(node, true), (second, false), (first, false)]),
        }
    }
    // Every node below the root has been joined.
    rows[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_constant_row_needs_no_search_for_the_least_sum(
            leaf in (0.0..10f64, 1u32..20),
            mut costs in prop::array::uniform7(0.0..10f64),
        ) {
            let leaf = LayoutCost::leaf(leaf.0, leaf.1);
            costs.sort_unstable_by(|a, b| b.total_cmp(a));
            let other = LayoutCost { as_children: costs, objects: 9 };
            prop_assert!(leaf.is_constant());
            let expected = leaf.split_with(&other);
            prop_assert_eq!(other.plus(leaf.value()), expected);
            prop_assert_eq!(other.split_with(&leaf), expected);
        }
    }
}
