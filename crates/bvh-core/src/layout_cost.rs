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
use crate::{Bvh, Node, PackedAabb};
use alloc::vec::Vec;

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
        const NEVER: f64 = f64::INFINITY;
        let [a, b, c, d, e, f, g] = right.as_children;
        let right_children = [a, b, c, d, e, f, g, NEVER];
        // `split[k - 2]` is the cost as k children. The last entries exceed the children of a node
        // and are ignored; a fixed length lets the compiler unroll the loops.
        let mut split = [NEVER; 14];
        for (first, cost) in left.as_children.iter().enumerate() {
            for (second, other) in right_children.iter().enumerate() {
                let sum = cost + other;
                let least = &mut split[first + second];
                *least = if sum < *least { sum } else { *least };
            }
        }
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
    layout(tree, None)
}

/// Returns the same as [`layout_area`], with the measure instead of the half area. O(nodes).
pub fn layout_measure(tree: &Bvh, measure: &dyn Measure) -> f64 {
    layout(tree, Some(measure))
}

#[cfg(feature = "std")]
crate::with_vector_instructions! {
    layout = layout_plain(tree: &Bvh, measure: Option<&dyn Measure>) -> f64
}
#[cfg(not(feature = "std"))]
use layout_plain as layout;

#[inline(always)]
fn layout_plain(tree: &Bvh, measure: Option<&dyn Measure>) -> f64 {
    let size = |node: &Node| match measure {
        Some(measure) => measure.of(&PackedAabb::from(&node.aabb)),
        None => node.aabb.half_area(),
    };
    let tree = binary(tree);
    // Children before parents, so that the rows of a path suffice: a row for every node would take
    // twice the memory of the tree.
    let mut rows: Vec<LayoutCost> = Vec::new();
    let mut pending = Vec::new();
    if !tree.nodes.is_empty() {
        pending.push((0, false));
    }
    while let Some((index, has_rows)) = pending.pop() {
        let node = &tree.nodes[index];
        let children = node.children();
        if children.is_empty() {
            rows.push(LayoutCost::leaf(size(node), node.prims().len() as u32));
        } else if has_rows {
            let both = rows.len() - 2;
            let joined = LayoutCost::join(size(node), &rows[both], &rows[both + 1]);
            rows.truncate(both);
            rows.push(joined);
        } else {
            pending.push((index, true));
            pending.extend(children.rev().map(|child| (child, false)));
        }
    }
    rows.first().map_or(0.0, LayoutCost::value)
}
