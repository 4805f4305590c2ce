//! The best position for a subtree: an exact branch and bound over all nodes of the tree.
//!
//! Placing an item with the box B *beside* a node X puts a new node J in place of X, around X and B, and every ancestor
//! of X has to reach B as well. A(·) is the half area of a box, or any other monotone measure:
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
//! For a node Y below X, the ancestors are those of X and X itself, and the new node there is no smaller than B:
//!
//! ```text
//!   cost beside Y ≥ A(B) + growth(X) + growth(P) + growth(R),   growth(N) = A(N ∪ B) − A(N)
//! ```
//!
//! A subtree whose bound reaches the best cost so far is not entered. The search begins at a node that is likely to be
//! good and looks near it first (Meister & Bittner 2018), so that the bound is tight from the start.

use super::linked::Linked;
use super::{ANCHOR, Metric, NONE, Working};
use bvh_core::PackedAabb;

/// Finds positions. Holds the buffers of a search, and counts the nodes it visits.
#[derive(Debug, Default)]
pub(crate) struct PositionSearch {
    /// From the first node up to the root.
    path: Vec<Step>,
    /// Inner nodes whose children remain to be examined, each with the growth of the node and all its ancestors.
    stack: Vec<(u32, f64)>,
    /// Nodes visited by all searches so far.
    pub visits: u64,
}

/// A node of the path.
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

/// The subtree in which positions are looked for, named by its parent, since its root changes when subtrees move.
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

    /// The smallest larger subtree that contains this one and whose box contains `aabb`, or else the whole tree.
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

/// A position for a subtree, and the area that placing the subtree there adds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Position {
    pub beside: u32,
    pub cost: f64,
}

/// The box of the subtree to be placed, and its half area.
type Item<'a> = (&'a PackedAabb, f64);

impl PositionSearch {
    /// The cheapest position in a scope for a *detached* item, if one costs less than `limit`. The scope is the whole
    /// tree, or its box contains that of the item. The search begins at `first` inside the scope, or at the scope's root
    /// if `first` is itself detached.
    #[inline(always)]
    pub fn detached(
        &mut self,
        tree: &Working<impl Metric>,
        scope: Scope,
        item: Item,
        first: u32,
        limit: f64,
    ) -> Option<Position> {
        self.path.clear();
        let mut at = first;
        let mut below = NONE;
        while at != scope.above {
            if at == NONE {
                self.path.clear();
                (at, below) = (scope.root(tree), NONE);
            }
            let node = &tree.nodes[at as usize];
            let joint = tree.metric().of(&node.aabb.union(item.0));
            self.path
                .push(Step { node: at, below, joint, growth: joint - node.area });
            (below, at) = (at, node.parent);
        }
        let mut best = Position { beside: NONE, cost: limit };
        self.climb(&mut best);
        self.search(tree, item, &mut best);
        (best.beside != NONE).then_some(best)
    }

    /// The cheapest position for `node`, which stays in the tree while the search pretends that it is gone; and the cost
    /// of its present position. `None` if no position is cheaper than the present one by more than the fraction
    /// `tolerance`.
    ///
    /// Ancestors have their boxes *without* the node here, so that their present boxes are the unions with B.
    #[inline(always)]
    pub fn attached<T: Linked>(
        &mut self,
        tree: &T,
        node: u32,
        tolerance: f64,
    ) -> (Option<Position>, f64) {
        let aabb = tree.aabb(node);
        let area = tree.area(node);
        let parent = tree.parent(node);
        self.path.clear();
        let sibling = tree.other(parent, node);
        let mut rest = tree.aabb(sibling);
        let rest_area = tree.area(sibling);
        let joint = tree.area(parent);
        let mut at = tree.parent(parent);
        self.path
            .push(Step { node: sibling, below: NONE, joint, growth: joint - rest_area });
        let mut below = parent;
        while at != T::ABOVE {
            let area = tree.area(at);
            rest.grow(&tree.aabb(tree.other(at, below)));
            self.path
                .push(Step { node: at, below, joint: area, growth: area - tree.size(&rest) });
            (below, at) = (at, tree.parent(at));
        }
        let mut best = Position { beside: NONE, cost: f64::INFINITY };
        self.climb(&mut best);
        let own = self.path[0].growth + rest_area;
        if best.cost >= own * (1.0 - tolerance) || best.beside == sibling {
            best = Position { beside: NONE, cost: own * (1.0 - tolerance) };
        }
        self.search(tree, (&aabb, area), &mut best);
        ((best.beside != NONE).then_some(best), own)
    }

    /// Tries the positions beside the path's nodes, and sums up their growth.
    #[inline(always)]
    fn climb(&mut self, best: &mut Position) {
        let mut growth = 0.0;
        for step in self.path.iter_mut().rev() {
            let cost = growth + step.joint;
            if cost < best.cost {
                *best = Position { beside: step.node, cost };
            }
            growth += step.growth;
            step.growth = growth;
        }
        self.visits += self.path.len() as u64;
    }

    /// Examines everything beside and below the path, from its first node up.
    #[inline(always)]
    fn search(&mut self, tree: &impl Linked, item: Item, best: &mut Position) {
        for &Step { node: at, below, growth, .. } in &self.path {
            if growth + item.1 >= best.cost {
                continue;
            }
            let mut next = (at, growth);
            if below != NONE {
                let other = tree.other(at, below);
                self.visits += 1;
                next = (other, try_position(tree, other, item.0, growth, best));
                if next.1 + item.1 >= best.cost {
                    continue;
                }
            }
            // Everything below, the more promising child first.
            loop {
                let (node, growth) = next;
                if let Some([left, right]) = tree.children(node) {
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

/// The next node on the stack below which a position may cost less than `limit`.
#[inline(always)]
fn pop(stack: &mut Vec<(u32, f64)>, area: f64, limit: f64) -> Option<(u32, f64)> {
    while let Some(next) = stack.pop() {
        if next.1 + area < limit {
            return Some(next);
        }
    }
    None
}

/// Tries the position beside a node. Returns the growth of the node and all its ancestors, infinite for a leaf.
#[inline(always)]
fn try_position(
    tree: &impl Linked,
    at: u32,
    aabb: &PackedAabb,
    growth: f64,
    best: &mut Position,
) -> f64 {
    let cost = growth + tree.size(&tree.aabb(at).union(aabb));
    if cost < best.cost {
        *best = Position { beside: at, cost };
    }
    if tree.children(at).is_none() { f64::INFINITY } else { cost - tree.area(at) }
}
