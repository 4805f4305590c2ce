//! The cost of the wide layout of a tree that changes.
//!
//! Areas of boxes propose the moves, as always, and the
//! [cost of the layout](bvh_core::cost::LayoutCost) accepts or rejects them. A move recomputes the
//! rows of costs of the nodes that it has written and of their ancestors, from the lowest up: about
//! a hundred per move.

use crate::tree::{ANCHOR, Metric, NONE, Working};
use bvh_core::cost::LayoutCost;
use bvh_core::with_vector_instructions;

/// A row of costs for every node of a tree, and the rows that undo a change.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    rows: Vec<LayoutCost>,
    /// The rows that the current change has replaced.
    replaced: Vec<(u32, LayoutCost)>,
    /// Per node, the number of the last change that gave it a new row.
    marks: Vec<u32>,
    change: u32,
    stack: Vec<(u32, bool)>,
    /// The cost of the tree after the last accepted change.
    pub cost: f64,
    /// The number of rows computed so far.
    pub visits: u64,
}

impl Layout {
    /// Computes all rows. O(nodes).
    #[inline(never)]
    pub fn fill(&mut self, tree: &Working<impl Metric>) {
        let count = tree.nodes.len();
        self.rows.clear();
        self.rows.resize(count, LayoutCost::leaf(0.0, 0));
        self.marks.clear();
        self.marks.resize(count, 0);
        self.change = 0;
        fill_rows(self, tree);
        self.cost = self.root(tree);
    }

    #[inline(always)]
    fn row(&self, tree: &Working<impl Metric>, index: u32) -> LayoutCost {
        let node = &tree.nodes[index as usize];
        if node.is_leaf() {
            return LayoutCost::leaf(node.area, 1);
        }
        let [left, right] = node.children.map(|child| &self.rows[child as usize]);
        LayoutCost::join(node.area, left, right)
    }

    fn root(&self, tree: &Working<impl Metric>) -> f64 {
        tree.root().map_or(0.0, |root| self.rows[root as usize].value())
    }

    /// Returns whether the tree's current change makes the layout more expensive by less than
    /// `most`. Otherwise restores the rows, and the caller must undo the change.
    #[inline(always)]
    pub fn accepts(&mut self, tree: &Working<impl Metric>, most: f64) -> bool {
        if self.rows.len() < tree.nodes.len() {
            // The tree has gained leaves since the last call.
            self.rows.resize(tree.nodes.len(), LayoutCost::leaf(0.0, 0));
            self.marks.resize(tree.nodes.len(), 0);
        }
        // A mark equals the current change only during this call, so marks never need to be
        // cleared.
        self.replaced.clear();
        self.change += 1;
        for written in tree.changed() {
            let mut index = written;
            // A node that the change has removed has no parent, or a parent without one.
            while index != ANCHOR && index != NONE && self.marks[index as usize] != self.change {
                self.marks[index as usize] = self.change;
                index = tree.nodes[index as usize].parent;
            }
        }
        // Mark the ancestors first, then visit the marked nodes from the root: every row is
        // computed once, after its children, although the paths of the changed nodes overlap.
        self.stack.clear();
        self.stack.extend(tree.root().map(|root| (root, false)));
        while let Some((index, children_done)) = self.stack.pop() {
            let node = &tree.nodes[index as usize];
            if !children_done && !node.is_leaf() {
                self.stack.push((index, true));
                let marked = node
                    .children
                    .into_iter()
                    .filter(|&child| self.marks[child as usize] == self.change);
                self.stack.extend(marked.map(|child| (child, false)));
                continue;
            }
            self.visits += 1;
            let row = self.row(tree, index);
            self.replaced.push((index, self.rows[index as usize]));
            self.rows[index as usize] = row;
        }
        let cost = self.root(tree);
        if cost - self.cost < most {
            self.cost = cost;
            return true;
        }
        // The move is rejected: restore the rows, as the caller restores the tree.
        for &(index, row) in &self.replaced {
            self.rows[index as usize] = row;
        }
        false
    }
}

with_vector_instructions! {
    /// Computes the row of every node.
    fill_rows = fill_rows_plain<M: Metric>(layout: &mut Layout, tree: &Working<M>)
}

#[inline(always)]
fn fill_rows_plain<M: Metric>(layout: &mut Layout, tree: &Working<M>) {
    // Children before parents, because a row depends on the rows of both children. In a sorted tree
    // this is the order in memory; to find any other order takes longer than the rows.
    for (index, node) in tree.nodes.iter().enumerate().skip(1).rev() {
        let index = index as u32;
        if !node.is_leaf() && node.children.iter().any(|&child| child <= index) {
            for &index in tree.preorder().iter().rev() {
                layout.rows[index as usize] = layout.row(tree, index);
            }
            return;
        }
        layout.rows[index as usize] = layout.row(tree, index);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;
    use bvh_core::cost::layout_area;
    use rand::RngExt;

    #[test]
    fn rows_that_follow_moves_equal_recomputed_rows() {
        let mut tree = built(&muller_fellner::Config::default(), &scatter(120));
        let mut rng = stream(3, 0);
        let mut layout = Layout::default();
        layout.fill(&tree);
        let mut accepted = 0;
        let mut rejected = 0;
        for _ in 0..4000 {
            let draw = |rng: &mut crate::run::Stream| rng.random_range(1..tree.nodes.len() as u32);
            let node = draw(&mut rng);
            let sibling = draw(&mut rng);
            let mut above = sibling;
            while above != ANCHOR && above != node {
                above = tree.nodes[above as usize].parent;
            }
            let parent = tree.nodes[node as usize].parent;
            if above == node || parent == ANCHOR || sibling == parent {
                continue;
            }
            let before = (layout.cost, tree.to_bvh());
            tree.begin();
            tree.detach(node);
            tree.attach(node, sibling);
            if layout.accepts(&tree, 0.05 * before.0 * rng.random::<f64>().powi(4)) {
                accepted += 1;
            } else {
                tree.undo();
                rejected += 1;
                assert_eq!((layout.cost, tree.to_bvh()), before);
            }
            let followed = layout.cost;
            let recomputed = tree.layout_cost();
            assert_eq!(followed, recomputed);
            assert!((recomputed - layout_area(&tree.to_bvh())).abs() <= 1e-12 * recomputed);
        }
        assert!(accepted > 100 && rejected > 1000, "{accepted} {rejected}");
        // The moves have left the nodes in no order.
        let followed = layout.cost;
        layout.fill(&tree);
        assert_eq!(layout.cost, followed);
    }
}
