//! The best place for a subtree: branch and bound over all nodes of the tree, exact.
//!
//! Placing a box B beside a node X costs the area of the node around both, and what the ancestors of X grow. No place
//! below X costs less than what X and its ancestors grow plus the area of B, which bounds the search. It begins at a
//! place that is likely good and looks near it first (Meister & Bittner 2018), so that the bound is low from the start.

use crate::working::{ANCHOR, NONE, Working};
use bvh_core::PackedAabb;

/// A binary tree in which a place can be looked for, and a subtree moved there.
pub(crate) trait Linked {
    /// What is above the root.
    const ABOVE: u32;
    /// What a node is below.
    fn parent(&self, at: u32) -> u32;
    /// Both children, none of a leaf.
    fn children(&self, at: u32) -> Option<[u32; 2]>;
    /// The child of `at` that is not `child`.
    fn other(&self, at: u32, child: u32) -> u32;
    /// Exact union of everything below.
    fn aabb(&self, at: u32) -> PackedAabb;
    /// Its half area.
    fn area(&self, at: u32) -> f64;
    /// Moves `node` and what is below it beside `place`, which is neither below it nor its parent nor its sibling. Boxes
    /// are made tight. Returns the nodes visited.
    fn reinsert(&mut self, node: u32, place: u32) -> u64;
}

/// Buffers of a search, and how many nodes it visited.
#[derive(Debug, Default)]
pub(crate) struct PlaceSearch {
    /// From the first place up to the root.
    path: Vec<Step>,
    /// Inner nodes whose children are to be looked at, with the growth of everything down to and with them.
    stack: Vec<(u32, f64)>,
    /// Nodes visited by all searches so far.
    pub visits: u64,
}

/// A node of the path.
#[derive(Clone, Copy, Debug)]
struct Step {
    node: u32,
    /// The child the path came from, `NONE` for the first.
    below: u32,
    /// Area of the node's box and B's.
    joint: f64,
    /// That, less the node's own area; later with that of all nodes above.
    growth: f64,
}

/// All that is below a node on one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Region {
    pub above: u32,
    pub side: usize,
}

impl Region {
    /// The whole tree.
    pub const ALL: Self = Self { above: ANCHOR, side: 0 };

    /// What is below `above`, which has this child.
    #[inline(always)]
    pub fn of(tree: &Working, above: u32, child: u32) -> Self {
        Self { above, side: usize::from(tree.nodes[above as usize].children[0] != child) }
    }

    /// Its root.
    #[inline(always)]
    pub fn root(self, tree: &Working) -> u32 {
        tree.nodes[self.above as usize].children[self.side]
    }

    /// The smallest one with this and more whose box holds `aabb`, or the whole tree.
    #[inline(always)]
    pub fn around(self, tree: &Working, aabb: &PackedAabb) -> Self {
        let mut region = self;
        while region.above != ANCHOR {
            let root = region.above;
            region = Self::of(tree, tree.nodes[root as usize].parent, root);
            let whole = &tree.nodes[root as usize].aabb;
            if whole.union(aabb) == *whole {
                break;
            }
        }
        region
    }
}

/// A place and what it costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    pub beside: u32,
    pub cost: f64,
}

/// What is to be placed: its box and that box's half area.
type Item<'a> = (&'a PackedAabb, f64);

impl PlaceSearch {
    /// The cheapest place in a region for a *detached* item, if one costs less than `limit`. The region is the whole tree
    /// or its box holds the item's. Begins at `first` in it, or at its root if `first` is itself detached.
    #[inline(always)]
    pub fn detached(
        &mut self,
        tree: &Working,
        region: Region,
        item: Item,
        first: u32,
        limit: f64,
    ) -> Option<Place> {
        self.path.clear();
        let (mut at, mut below) = (first, NONE);
        while at != region.above {
            if at == NONE {
                self.path.clear();
                (at, below) = (region.root(tree), NONE);
            }
            let node = &tree.nodes[at as usize];
            let joint = node.aabb.union(item.0).half_area();
            self.path.push(Step { node: at, below, joint, growth: joint - node.area });
            (below, at) = (at, node.parent);
        }
        let mut best = Place { beside: NONE, cost: limit };
        self.climb(&mut best);
        self.search(tree, item, &mut best);
        (best.beside != NONE).then_some(best)
    }

    /// The cheapest place for `node`, which stays where it is while the search pretends that it is gone. `None` if no
    /// place costs less than its own by more than `tolerance` times that. Also returns what its own costs.
    #[inline(always)]
    pub fn attached<T: Linked>(&mut self, tree: &T, node: u32, tolerance: f64) -> (Option<Place>, f64) {
        let (aabb, area, parent) = (tree.aabb(node), tree.area(node), tree.parent(node));
        self.path.clear();
        let sibling = tree.other(parent, node);
        let (mut rest, rest_area) = (tree.aabb(sibling), tree.area(sibling));
        let (joint, mut at) = (tree.area(parent), tree.parent(parent));
        self.path.push(Step { node: sibling, below: NONE, joint, growth: joint - rest_area });
        let mut below = parent;
        while at != T::ABOVE {
            let area = tree.area(at);
            rest.grow(&tree.aabb(tree.other(at, below)));
            self.path.push(Step { node: at, below, joint: area, growth: area - rest.half_area() });
            (below, at) = (at, tree.parent(at));
        }
        let mut best = Place { beside: NONE, cost: f64::INFINITY };
        self.climb(&mut best);
        let own = self.path[0].growth + rest_area;
        if best.cost >= own * (1.0 - tolerance) || best.beside == sibling {
            best = Place { beside: NONE, cost: own * (1.0 - tolerance) };
        }
        self.search(tree, (&aabb, area), &mut best);
        ((best.beside != NONE).then_some(best), own)
    }

    /// Tries the places beside the path's nodes, and sums up their growth.
    #[inline(always)]
    fn climb(&mut self, best: &mut Place) {
        let mut growth = 0.0;
        for step in self.path.iter_mut().rev() {
            let cost = growth + step.joint;
            if cost < best.cost {
                *best = Place { beside: step.node, cost };
            }
            growth += step.growth;
            step.growth = growth;
        }
        self.visits += self.path.len() as u64;
    }

    /// Looks at everything beside and below the path, from its first node up.
    #[inline(always)]
    fn search(&mut self, tree: &impl Linked, item: Item, best: &mut Place) {
        for &Step { node: at, below, growth, .. } in &self.path {
            if growth + item.1 >= best.cost {
                continue;
            }
            let mut next = (at, growth);
            if below != NONE {
                let other = tree.other(at, below);
                self.visits += 1;
                next = (other, try_place(tree, other, item.0, growth, best));
                if next.1 + item.1 >= best.cost {
                    continue;
                }
            }
            // Everything below, the more promising child first.
            loop {
                let (node, growth) = next;
                if let Some([left, right]) = tree.children(node) {
                    self.visits += 2;
                    let mut first = (left, try_place(tree, left, item.0, growth, best));
                    let mut second = (right, try_place(tree, right, item.0, growth, best));
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

/// The next node on the stack below which there may be a place for less than `limit`.
#[inline(always)]
fn pop(stack: &mut Vec<(u32, f64)>, area: f64, limit: f64) -> Option<(u32, f64)> {
    while let Some(next) = stack.pop() {
        if next.1 + area < limit {
            return Some(next);
        }
    }
    None
}

/// Tries the place beside a node. Returns the growth down to and with the node, infinite for a leaf.
#[inline(always)]
fn try_place(tree: &impl Linked, at: u32, aabb: &PackedAabb, growth: f64, best: &mut Place) -> f64 {
    let cost = growth + tree.aabb(at).union(aabb).half_area();
    if cost < best.cost {
        *best = Place { beside: at, cost };
    }
    if tree.children(at).is_none() { f64::INFINITY } else { cost - tree.area(at) }
}
