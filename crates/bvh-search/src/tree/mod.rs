//! Mutable trees, and the search for the best position in them.
//!
//! [`Working`] is the working form of all searches: parents, packed boxes, cached areas, and a
//! journal that undoes a change.
//!
//! Node 0 is the *anchor*, whose first child is the root, so the root needs no
//! special case. A detached subtree keeps its parent node, and attaching reuses that node, so no
//! move allocates memory.

mod convert;
mod metric;
mod order;
mod position;
mod subsets;

use crate::parallel;
use bvh_core::PackedAabb;
use bvh_core::cost::{LayoutTree, Sum, layout_row};
pub(crate) use convert::Shape;
pub(crate) use metric::{HalfArea, Measured, Metric, search_by_metric};
pub(crate) use position::{PositionSearch, Scope};
pub(crate) use subsets::Subsets;

pub(crate) const NONE: u32 = u32::MAX;

/// The parent of the root.
pub(crate) const ANCHOR: u32 = 0;

/// A node of the working form: one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Exact union of all boxes below.
    pub aabb: PackedAabb,
    /// Half area of `aabb`, or its size by another metric.
    pub area: f64,
    /// Number of the change during which the node was last written to the journal.
    pub stamp: u64,
    /// `NONE` for the spare parent of a detached subtree.
    pub parent: u32,
    /// Both children, or `[NONE, object]`.
    pub children: [u32; 2],
    /// In the journal only: the node's index in the tree.
    pub index: u32,
}

impl Node {
    pub const ANCHOR: Self = Self {
        aabb: PackedAabb::EMPTY,
        area: 0.0,
        stamp: 0,
        parent: NONE,
        children: [NONE; 2],
        index: NONE,
    };

    #[inline(always)]
    pub fn is_leaf(&self) -> bool {
        self.children[0] == NONE
    }

    /// The child that is not `child`.
    #[inline(always)]
    pub fn other(&self, child: u32) -> u32 {
        self.children[usize::from(self.children[0] == child)]
    }
}

/// A mutable binary tree. Leaves hold one object each.
#[derive(Clone, Debug)]
pub(crate) struct Working<M = HalfArea> {
    metric: M,
    pub nodes: Vec<Node>,
    /// [`area`](Self::area) when the current change began, and what the change has added since.
    area: Sum,
    added: f64,
    journal: Vec<Node>,
    change: u64,
    /// Always empty; `sort_in_preorder` reuses its capacity, except in large trees.
    spare: Vec<Node>,
}

impl<M: Metric> Working<M> {
    fn new(nodes: Vec<Node>, metric: M) -> Self {
        let (area, journal, spare) = Default::default();
        Self { metric, nodes, area, added: 0.0, journal, change: 0, spare }
    }

    /// The metric that measures the boxes.
    pub fn metric(&self) -> M {
        self.metric
    }

    /// Builds a tree from linked nodes, the anchor first.
    pub fn from_nodes(nodes: Vec<Node>, metric: M) -> Self {
        let mut tree = Self::new(nodes, metric);
        tree.forget_changes();
        tree
    }

    /// Begins again with the nodes as they are. O(n).
    pub fn forget_changes(&mut self) {
        let mut area = Sum::default();
        // Once over the nodes of a large tree takes a tenth of a second.
        for node in &mut self.nodes {
            node.stamp = 0;
            area.add(part(node, self.metric));
        }
        self.restart(area);
    }

    /// The root, unless there are no objects.
    pub fn root(&self) -> Option<u32> {
        Some(self.nodes[0].children[0]).filter(|&root| root != NONE)
    }

    /// Number of objects.
    pub fn objects(&self) -> usize {
        self.nodes.len() / 2
    }

    /// The total area of all inner nodes, and of the leaves times their cost, updated
    /// incrementally by a compensated sum: every change adds a single rounding error.
    pub fn area(&self) -> f64 {
        self.area.value() + self.added
    }

    /// Returns the cost of the tree's layout, computed on all threads. O(nodes).
    pub fn layout_cost(&self) -> f64 {
        self.root()
            .map_or(0.0, |root| layout_row(self, root as usize, &parallel::call_both).value())
    }

    /// [`area`](Self::area), recomputed. O(n).
    #[cfg(test)]
    pub fn internal_area(&self) -> f64 {
        self.nodes.iter().map(|node| part(node, self.metric)).collect::<Sum>().value()
    }

    /// Begins a change, which can be undone until the next change begins.
    #[inline(always)]
    pub fn begin(&mut self) {
        self.change += 1;
        self.journal.clear();
        // Folding the change into the compensated sum here keeps `undo` exact: it only drops
        // `added`.
        self.area.add(self.added);
        self.added = 0.0;
    }

    /// The nodes that the current change has written.
    #[inline(always)]
    pub fn changed(&self) -> impl Iterator<Item = u32> + '_ {
        self.journal.iter().map(|node| node.index)
    }

    /// Undoes the current change exactly, to the last bit: the tree is as it was after `begin`.
    #[inline(always)]
    pub fn undo(&mut self) {
        self.added = 0.0;
        // Every node is in the journal once, in its state before the change, so the order is
        // irrelevant.
        for node in self.journal.drain(..) {
            self.nodes[node.index as usize] = node;
        }
    }

    /// Returns the node for writing, after recording it in the journal.
    #[inline(always)]
    fn write(&mut self, index: u32) -> &mut Node {
        let node = &mut self.nodes[index as usize];
        if node.stamp != self.change {
            self.journal.push(Node { index, ..*node });
            node.stamp = self.change;
        }
        node
    }

    #[inline(always)]
    fn replace_child(&mut self, parent: u32, old: u32, new: u32) {
        let children = &mut self.write(parent).children;
        children[usize::from(children[0] != old)] = new;
        self.write(new).parent = parent;
    }

    /// Removes the subtree of `node`, which is not the root, together with its parent node. Makes
    /// boxes tight. Returns the area saved, the sibling that replaced the parent, and the number of
    /// nodes visited.
    #[inline(always)]
    pub fn detach(&mut self, node: u32) -> (f64, u32, u64) {
        let parent = self.nodes[node as usize].parent;
        let Node { parent: above, area, .. } = self.nodes[parent as usize];
        let sibling = self.nodes[parent as usize].other(node);
        self.write(parent).parent = NONE;
        self.replace_child(above, parent, sibling);
        let shrunk = |tree: &Self, index: u32| tree.union_of(tree.nodes[index as usize].children);
        let (added, visits) = self.resize_above(above, -area, shrunk);
        (-added, sibling, visits)
    }

    /// Inserts a detached `node` next to `position`, with its parent node above both. Returns the
    /// area added and the number of nodes visited.
    #[inline(always)]
    pub fn attach(&mut self, node: u32, position: u32) -> (f64, u64) {
        let Node { aabb: added_box, parent, .. } = self.nodes[node as usize];
        let Node { aabb, parent: above, .. } = self.nodes[position as usize];
        self.replace_child(above, position, parent);
        self.write(position).parent = parent;
        let aabb = aabb.union(&added_box);
        let area = self.metric.of(&aabb);
        let joint = self.write(parent);
        (joint.children, joint.aabb, joint.area) = ([position, node], aabb, area);
        self.resize_above(above, area, |tree, index| {
            tree.nodes[index as usize].aabb.union(&added_box)
        })
    }

    /// Gives the node `index` and its ancestors new boxes, up to one whose box stays the same, and
    /// with it all boxes above. Returns the area that the change has `added` before and here, and
    /// the number of nodes visited.
    #[inline(always)]
    fn resize_above(
        &mut self,
        mut index: u32,
        mut added: f64,
        box_of: impl Fn(&Self, u32) -> PackedAabb,
    ) -> (f64, u64) {
        let mut visits = 2;
        while index != ANCHOR {
            let aabb = box_of(self, index);
            visits += 1;
            if aabb == self.nodes[index as usize].aabb {
                break;
            }
            let area = self.metric.of(&aabb);
            let node = self.write(index);
            added += area - node.area;
            (node.aabb, node.area) = (aabb, area);
            index = node.parent;
        }
        self.added += added;
        (added, visits)
    }

    /// Adds a detached leaf with its parent node, so that it can be attached. The boxes are empty.
    pub fn push_spare(&mut self, object: u32) -> u32 {
        let leaf = self.nodes.len() as u32;
        self.nodes.push(Node { parent: leaf + 1, children: [NONE, object], ..Node::ANCHOR });
        self.nodes.push(Node { children: [leaf; 2], ..Node::ANCHOR });
        leaf
    }

    /// Gives a detached leaf another box, of this area. The cost of leaves changes accordingly.
    #[inline(always)]
    pub fn resize_leaf(&mut self, leaf: u32, object: u32, aabb: PackedAabb, area: f64) {
        let node = self.write(leaf);
        let before = node.area;
        (node.children, node.aabb, node.area) = ([NONE, object], aabb, area);
        self.added += self.metric.leaf_cost() * (area - before);
    }

    /// The box around two nodes.
    #[inline(always)]
    pub fn union_of(&self, [left, right]: [u32; 2]) -> PackedAabb {
        self.nodes[left as usize].aabb.union(&self.nodes[right as usize].aabb)
    }

    /// Gives the inner node `index` these children and makes its box tight. Does not update its
    /// ancestors: if several nodes get new children, the lowest must come first, and the highest
    /// must keep its set of objects.
    #[inline(always)]
    pub fn join(&mut self, index: u32, children: [u32; 2]) {
        let aabb = self.union_of(children);
        let area = self.metric.of(&aabb);
        children.into_iter().for_each(|child| self.write(child).parent = index);
        let node = self.write(index);
        let before = node.area;
        (node.children, node.aabb, node.area) = (children, aabb, area);
        self.added += area - before;
    }

    /// The number of changes begun so far, comparable with a node's `stamp`.
    pub fn changes(&self) -> u64 {
        self.change
    }

    /// Forgets the current change and sets the area.
    fn restart(&mut self, area: Sum) {
        (self.area, self.added, self.change) = (Sum::default(), 0.0, 0);
        self.area.add(area.value());
        self.journal.clear();
    }
}

impl<M: Metric> LayoutTree for Working<M> {
    #[inline(always)]
    fn size(&self, node: usize) -> f64 {
        self.nodes[node].area
    }

    #[inline(always)]
    fn children(&self, node: usize) -> Result<[usize; 2], u32> {
        let node = &self.nodes[node];
        if node.is_leaf() {
            return Err(1);
        }
        Ok(node.children.map(|child| child as usize))
    }
}

/// Returns the node's part of the area of a tree. Adding 0 for a leaf changes no sum.
#[inline(always)]
fn part(node: &Node, metric: impl Metric) -> f64 {
    let of_leaf = metric.leaf_cost() * node.area;
    core::hint::select_unpredictable(node.is_leaf(), of_leaf, node.area)
}

#[cfg(test)]
mod tests;
