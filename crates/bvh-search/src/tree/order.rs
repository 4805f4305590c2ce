//! The order of the nodes in memory.

use super::{ANCHOR, Metric, NONE, Node, Working, part};
use bvh_core::cost::Sum;

/// The number of nodes from which a tree is sorted in place, because memory is scarcer than time.
const SORTED_IN_PLACE: usize = 1 << 20;

/// The number of nodes that `sort_in_place` collects at once, 256 KB.
const SORTED_AT_ONCE: usize = 1 << 12;

impl<M: Metric> Working<M> {
    /// Returns all nodes except the anchor, parents before children, left before right. O(n).
    pub fn preorder(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.nodes.len());
        self.visit_in_preorder(|index, _, _, _| order.push(index));
        order
    }

    /// Sorts the nodes in preorder, so that neighbours in the tree are neighbours in memory. O(n).
    pub fn sort_in_preorder(&mut self) {
        if self.nodes.len() >= SORTED_IN_PLACE {
            self.sort_in_place(SORTED_AT_ONCE);
        } else {
            self.sort_into_spare();
        }
    }

    /// Sorts chunks of so many nodes, with an eighth of the memory of `sort_into_spare`. The nodes
    /// of a chunk are collected, the nodes in their way take the places that become free, and the
    /// chunk is written.
    pub(super) fn sort_in_place(&mut self, at_once: usize) {
        // The old index of the node at each place, and the place of the node at each index.
        let mut order = self.preorder();
        order.insert(0, ANCHOR);
        let mut places = vec![NONE; self.nodes.len()];
        let mut area = Sum::default();
        for (place, &index) in (0..).zip(&order) {
            places[index as usize] = place;
            area.add(part(&self.nodes[index as usize], self.metric));
        }
        let kept = order.len();
        // Nodes outside the tree go to the end.
        for (index, place) in (0..).zip(&mut places) {
            if *place == NONE {
                *place = order.len() as u32;
                order.push(index);
            }
        }
        for node in &mut self.nodes {
            node.stamp = 0;
            if node.parent != NONE {
                node.parent = places[node.parent as usize];
            }
            if node.is_leaf() {
                continue;
            }
            // The anchor has one child.
            for child in node.children.iter_mut().filter(|child| **child != NONE) {
                *child = places[*child as usize];
            }
        }
        let mut chunk = Vec::with_capacity(at_once);
        for start in (0..order.len()).step_by(at_once) {
            let end = order.len().min(start + at_once);
            chunk.clear();
            chunk.extend(order[start..end].iter().map(|&index| self.nodes[index as usize]));
            let mut in_the_way = start;
            for place in start..end {
                let free = order[place] as usize;
                // Places before the chunk are final, and those in it are about to be written.
                if free < end {
                    continue;
                }
                while (places[in_the_way] as usize) < end {
                    in_the_way += 1;
                }
                self.nodes[free] = self.nodes[in_the_way];
                places[free] = places[in_the_way];
                order[places[free] as usize] = free as u32;
                in_the_way += 1;
            }
            self.nodes[start..end].copy_from_slice(&chunk);
        }
        self.nodes.truncate(kept);
        self.restart(area);
    }

    /// Calls a function with every node except the anchor in preorder: its index, its place, which
    /// is 1 for the root, the place of its parent, and its side there. O(n).
    #[inline(always)]
    pub fn visit_in_preorder(&self, mut visit: impl FnMut(u32, u32, u32, usize)) {
        // Pending nodes: index, place of the parent, side.
        let mut stack: Vec<(u32, u32, usize)> =
            self.root().map(|root| (root, ANCHOR, 0)).into_iter().collect();
        let mut place = 0;
        while let Some((index, parent, side)) = stack.pop() {
            place += 1;
            visit(index, place, parent, side);
            let node = &self.nodes[index as usize];
            if !node.is_leaf() {
                stack.extend([(node.children[1], place, 1), (node.children[0], place, 0)]);
            }
        }
    }

    pub(super) fn sort_into_spare(&mut self) {
        let mut nodes = std::mem::take(&mut self.spare);
        nodes.reserve(self.nodes.len());
        nodes.push(Node { stamp: 0, ..self.nodes[0] });
        let mut area = Sum::default();
        self.visit_in_preorder(|index, place, parent, side| {
            let node = &self.nodes[index as usize];
            nodes.push(Node { parent, stamp: 0, ..*node });
            nodes[parent as usize].children[side] = place;
            area.add(part(node, self.metric));
        });
        self.spare = std::mem::replace(&mut self.nodes, nodes);
        self.spare.clear();
        self.restart(area);
    }
}
