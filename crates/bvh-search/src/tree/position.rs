//! The best position for a subtree: an exact branch and bound over all nodes of the tree.
//!
//! Inserting an item with the box B *next to* a node X replaces X by a new node J around X and B,
//! and every ancestor of X grows to contain B. A(·) is the half area of a box, or any other
//! monotone measure:
//!
//! ```text
//!            R
//!          /   \
//!         P     ·          cost = A(X ∪ B)           the new node J
//!       /   \                   + A(P ∪ B) − A(P)    growth of X's parent
//!      ·     J                  + A(R ∪ B) − A(R)    growth of every further ancestor, up to the root
//!          /   \
//!         X     B
//! ```
//!
//! The ancestors of a node Y below X include X and its ancestors, and the new node there is no
//! smaller than B:
//!
//! ```text
//!   cost next to Y ≥ A(B) + growth(X) + growth(P) + growth(R),   growth(N) = A(N ∪ B) − A(N)
//! ```
//!
//! The search does not enter a subtree whose bound reaches the best cost so far. It begins at a
//! promising node and examines the neighbourhood first (Meister & Bittner 2018), so the bound is
//! tight from the start.

use super::{ANCHOR, Metric, NONE, Node, Working};
use bvh_core::PackedAabb;

/// Finds positions. Holds the buffers of a search and counts the nodes that it visits.
#[derive(Debug, Default)]
pub(crate) struct PositionSearch {
    /// From the first node up to the root.
    path: Vec<Step>,
    /// Inner nodes whose children remain to be examined, each with the growth of the node and all
    /// its ancestors.
    stack: Vec<(u32, f64)>,
    /// Nodes visited by all searches so far.
    pub visits: u64,
}

#[derive(Clone, Copy, Debug)]
struct Step {
    node: u32,
    /// The child the path came from, `NONE` for the first node.
    below: u32,
    /// A(node ∪ B).
    joint: f64,
    /// A(node ∪ B) − A(node); after `climb`, summed over the node and its ancestors.
    growth: f64,
}

/// The subtree that is searched for positions, identified by its parent, because its root changes
/// when subtrees move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scope {
    pub above: u32,
    pub side: usize,
}

impl Scope {
    /// The whole tree.
    pub const ALL: Self = Self { above: ANCHOR, side: 0 };

    /// The subtree of `child`, a child of `above`.
    #[inline(always)]
    pub fn of(tree: &Working<impl Metric>, above: u32, child: u32) -> Self {
        Self { above, side: usize::from(tree.nodes[above as usize].children[0] != child) }
    }

    /// The root of the subtree.
    #[inline(always)]
    pub fn root(self, tree: &Working<impl Metric>) -> u32 {
        tree.nodes[self.above as usize].children[self.side]
    }

    /// Returns the smallest larger subtree that contains this one and whose box contains `aabb`, or
    /// the whole tree.
    #[inline(always)]
    pub fn around(self, tree: &Working<impl Metric>, aabb: &PackedAabb) -> Self {
        let mut scope = self;
        while scope.above != ANCHOR {
            let root = scope.above;
            scope = Self::of(tree, tree.nodes[root as usize].parent, root);
            let whole = &tree.nodes[root as usize].aabb;
            if whole.union(aabb) == *whole {
                break;
            }
        }
        scope
    }
}

/// A position for a subtree, named by its future sibling, and the area that inserting the subtree
/// there adds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Position {
    pub sibling: u32,
    pub cost: f64,
}

/// The box of the subtree to be inserted, and its half area.
type Item<'a> = (&'a PackedAabb, f64);

impl PositionSearch {
    /// Returns the cheapest position in a scope for a *detached* item, if one costs less than
    /// `limit`. The scope is the whole tree, or its box contains the item's box. The search begins
    /// at `first` inside the scope, or at the scope's root if `first` is itself detached.
    #[inline(always)]
    pub fn position_of_detached(
        &mut self,
        tree: &Working<impl Metric>,
        scope: Scope,
        item: Item,
        first: u32,
        limit: f64,
    ) -> Option<Position> {
        self.path.clear();
        let mut index = first;
        let mut below = NONE;
        while index != scope.above {
            // The first node is detached, so its path does not lead to the scope; start at the
            // scope's root instead.
            if index == NONE {
                self.path.clear();
                (index, below) = (scope.root(tree), NONE);
            }
            let node = &tree.nodes[index as usize];
            let joint = tree.metric().of(&node.aabb.union(item.0));
            self.path.push(Step { node: index, below, joint, growth: joint - node.area });
            (below, index) = (index, node.parent);
        }
        let mut best = Position { sibling: NONE, cost: limit };
        self.climb(&mut best);
        self.search(tree, item, &mut best);
        (best.sibling != NONE).then_some(best)
    }

    /// Returns the cheapest position for `node`, which stays in the tree while the search treats it
    /// as removed, and the cost of its current position. `None` if no position is cheaper than the
    /// current one by more than the fraction `tolerance`.
    ///
    /// The boxes of ancestors count *without* the node here, so their current boxes are the unions
    /// with B.
    #[inline(always)]
    pub fn position_of_attached(
        &mut self,
        tree: &Working<impl Metric>,
        node: u32,
        tolerance: f64,
    ) -> (Option<Position>, f64) {
        let node_at = |index: u32| &tree.nodes[index as usize];
        let Node { aabb, area, parent, .. } = *node_at(node);
        self.path.clear();
        let sibling = node_at(parent).other(node);
        let Node { aabb: mut rest, area: rest_area, .. } = *node_at(sibling);
        let joint = node_at(parent).area;
        let mut index = node_at(parent).parent;
        self.path.push(Step { node: sibling, below: NONE, joint, growth: joint - rest_area });
        let mut below = parent;
        while index != ANCHOR {
            let node = node_at(index);
            rest.grow(&node_at(node.other(below)).aabb);
            let growth = node.area - tree.metric.of(&rest);
            self.path.push(Step { node: index, below, joint: node.area, growth });
            (below, index) = (index, node.parent);
        }
        let mut best = Position { sibling: NONE, cost: f64::INFINITY };
        self.climb(&mut best);
        let current = self.path[0].growth + rest_area;
        if best.cost >= current * (1.0 - tolerance) || best.sibling == sibling {
            best = Position { sibling: NONE, cost: current * (1.0 - tolerance) };
        }
        self.search(tree, (&aabb, area), &mut best);
        ((best.sibling != NONE).then_some(best), current)
    }

    /// Tries the positions next to the path's nodes, and sums up their growth.
    #[inline(always)]
    fn climb(&mut self, best: &mut Position) {
        let mut growth = 0.0;
        for step in self.path.iter_mut().rev() {
            let cost = growth + step.joint;
            if cost < best.cost {
                *best = Position { sibling: step.node, cost };
            }
            // Stored sums are the growth of a node and all its ancestors, the bound for everything
            // below.
            growth += step.growth;
            step.growth = growth;
        }
        self.visits += self.path.len() as u64;
    }

    /// Examines everything next to and below the path, from its first node up.
    #[inline(always)]
    fn search(&mut self, tree: &Working<impl Metric>, item: Item, best: &mut Position) {
        for &Step { node: index, below, growth, .. } in &self.path {
            if growth + item.1 >= best.cost {
                continue;
            }
            let mut next = (index, growth);
            if below != NONE {
                let other = tree.nodes[index as usize].other(below);
                self.visits += 1;
                next = (other, try_position(tree, other, item.0, growth, best));
                if next.1 + item.1 >= best.cost {
                    continue;
                }
            }
            // Descend, the more promising child first: a lower best cost rejects more of the rest.
            loop {
                let (node, growth) = next;
                let [left, right] = tree.nodes[node as usize].children;
                if left != NONE {
                    self.visits += 2;
                    let mut first = (left, try_position(tree, left, item.0, growth, best));
                    let mut second = (right, try_position(tree, right, item.0, growth, best));
                    if second.1 < first.1 {
                        std::mem::swap(&mut first, &mut second);
                    }
                    if second.1 + item.1 < best.cost {
                        self.stack.push(second);
                    }
                    if first.1 + item.1 < best.cost {
                        next = first;
                        continue;
                    }
                }
                let Some(rest) = pop(&mut self.stack, item.1, best.cost) else { break };
                next = rest;
            }
        }
    }
}

/// Pops the next node below which a position may cost less than `limit`.
#[inline(always)]
fn pop(stack: &mut Vec<(u32, f64)>, area: f64, limit: f64) -> Option<(u32, f64)> {
    while let Some(next) = stack.pop() {
        if next.1 + area < limit {
            return Some(next);
        }
    }
    None
}

/// Tries the position next to a node. Returns the growth of the node and all its ancestors,
/// infinite for a leaf.
#[inline(always)]
fn try_position(
    tree: &Working<impl Metric>,
    index: u32,
    aabb: &PackedAabb,
    growth: f64,
    best: &mut Position,
) -> f64 {
    let node = &tree.nodes[index as usize];
    let cost = growth + tree.metric.of(&node.aabb.union(aabb));
    if cost < best.cost {
        *best = Position { sibling: index, cost };
    }
    if node.is_leaf() { f64::INFINITY } else { cost - node.area }
}
