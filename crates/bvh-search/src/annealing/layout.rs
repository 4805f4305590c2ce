//! The cost of the wide layout of a tree that changes.
//!
//! Moves are proposed by the areas of boxes, as always, and judged by the [cost of the layout](bvh_core::cost::LayoutCost): of the
//! nodes that a move has written and of their ancestors, the rows of costs are made again from the lowest up, about a hundred per
//! move.

use crate::tree::{ANCHOR, Metric, NONE, Working};
use bvh_core::cost::LayoutCost;

/// A row of costs for every node of a tree, and what is needed to undo a change.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    rows: Vec<LayoutCost>,
    /// The rows that the present change has replaced.
    replaced: Vec<(u32, LayoutCost)>,
    /// Per node, the number of the change during which it was found to need a new row.
    marks: Vec<u32>,
    change: u32,
    stack: Vec<(u32, bool)>,
    cost: f64,
    /// Rows made so far.
    pub visits: u64,
}

impl Layout {
    /// Makes all rows, unless those of the tree are there.
    #[inline(always)]
    pub fn prepare(&mut self, tree: &Working<impl Metric>) {
        if self.rows.len() != tree.nodes.len() {
            self.fill(tree);
        }
    }

    /// Makes all rows. O(nodes).
    #[inline(never)]
    pub fn fill(&mut self, tree: &Working<impl Metric>) {
        self.rows.clear();
        self.rows.resize(tree.nodes.len(), LayoutCost::leaf(0.0, 0));
        self.marks.clear();
        self.marks.resize(tree.nodes.len(), 0);
        self.change = 0;
        for &at in tree.preorder().iter().rev() {
            self.rows[at as usize] = self.row(tree, at);
        }
        self.cost = self.root(tree);
    }

    #[inline(always)]
    fn row(&self, tree: &Working<impl Metric>, at: u32) -> LayoutCost {
        let node = &tree.nodes[at as usize];
        if node.is_leaf() {
            return LayoutCost::leaf(node.area, 1);
        }
        let [left, right] = node.children.map(|child| &self.rows[child as usize]);
        LayoutCost::join(node.area, left, right)
    }

    fn root(&self, tree: &Working<impl Metric>) -> f64 {
        tree.root().map_or(0.0, |root| self.rows[root as usize].value())
    }

    /// The cost of the tree's layout. O(nodes).
    pub fn cost(&mut self, tree: &Working<impl Metric>) -> f64 {
        self.fill(tree);
        self.cost
    }

    /// Whether the tree's present change makes the layout dearer by less than `most`. If it does not, the rows are as before the
    /// change, and the caller undoes it.
    #[inline(always)]
    pub fn accepts(&mut self, tree: &Working<impl Metric>, most: f64) -> bool {
        if self.rows.len() < tree.nodes.len() {
            // Leaves that were added since.
            self.rows.resize(tree.nodes.len(), LayoutCost::leaf(0.0, 0));
            self.marks.resize(tree.nodes.len(), 0);
        }
        self.replaced.clear();
        self.change += 1;
        for at in tree.changed() {
            let mut at = at;
            // A node that the change has taken out for good has no parent, or one that has none.
            while at != ANCHOR && at != NONE && self.marks[at as usize] != self.change {
                self.marks[at as usize] = self.change;
                at = tree.nodes[at as usize].parent;
            }
        }
        self.stack.clear();
        self.stack.extend(tree.root().map(|root| (root, false)));
        while let Some((at, children_done)) = self.stack.pop() {
            let node = &tree.nodes[at as usize];
            if !children_done && !node.is_leaf() {
                self.stack.push((at, true));
                let marked =
                    node.children.into_iter().filter(|&child| self.marks[child as usize] == self.change);
                self.stack.extend(marked.map(|child| (child, false)));
                continue;
            }
            self.visits += 1;
            let row = self.row(tree, at);
            self.replaced.push((at, self.rows[at as usize]));
            self.rows[at as usize] = row;
        }
        let cost = self.root(tree);
        if cost - self.cost < most {
            self.cost = cost;
            return true;
        }
        for &(at, row) in &self.replaced {
            self.rows[at as usize] = row;
        }
        false
    }
}
