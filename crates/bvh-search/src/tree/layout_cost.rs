//! The cost of the layout of a working tree, by the sizes that its nodes have.

use super::{Metric, Working};
use crate::parallel;
use bvh_core::cost::{LayoutTree, layout_row};

impl<M: Metric> Working<M> {
    /// Returns the cost of the tree's layout, computed on all threads. O(nodes).
    pub(crate) fn layout_cost(&self) -> f64 {
        self.root()
            .map_or(0.0, |root| layout_row(self, root as usize, &parallel::call_both).value())
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
