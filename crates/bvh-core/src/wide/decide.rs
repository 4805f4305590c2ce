//! Decides which nodes of a tree become wide nodes, leaves or nothing, by dynamic programming from
//! the leaves up.

use super::triangles::TriangleBlock;
use crate::{Bvh, NodeKind};

/// Expected time of visiting a wide node: the unit.
pub(crate) const NODE_COST: f32 = 1.0;
/// Expected time of testing a block. Rays were no faster with half of it or twice as much.
pub(crate) const BLOCK_COST: f32 = 1.0;

/// The slots of a wide node that the two children of a subtree get: of the first child in the low
/// half, of the second in the high half; 0 for a subtree that is one child itself.
type Slots = u8;

/// How a subtree becomes children of a wide node.
#[derive(Clone, Copy)]
pub(super) struct Decision {
    /// For at most 2 to 7 slots, and last for the 8 of a wide node.
    slots: [Slots; 7],
    /// Whether, as one child, it is a leaf.
    pub(super) is_leaf: bool,
    pub(super) objects: u32,
}

impl Decision {
    #[inline]
    fn slots(&self, count: usize) -> Slots {
        if count == 1 { 0 } else { self.slots[count - 2] }
    }
}

/// The least expected time of a subtree in at most 1 to 7 slots, times the root's area; last, in
/// the 8 slots of a wide node.
pub(super) type Costs = [f32; 8];

/// Decides for every node of `tree`, each of which has two children or none. O(n).
// Costs take most of the memory. They are separate, so that the layout is made after they are
// dropped.
pub(super) fn decide(tree: &Bvh, visits: &[f32]) -> (Vec<Decision>, Vec<Costs>) {
    let one_child = Decision { slots: [0; 7], is_leaf: true, objects: 0 };
    let mut decisions = vec![one_child; tree.nodes.len()];
    let mut costs = vec![[0.0; 8]; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let visits = visits[index];
        let leaf_cost = |objects: u32| {
            let blocks = objects.div_ceil(TriangleBlock::LANES as u32);
            visits * (BLOCK_COST * blocks as f32)
        };
        match (node.kind(), &decisions[node.children()], &costs[node.children()]) {
            (NodeKind::Inner { .. }, [a, b], [costs_of_a, costs_of_b]) => {
                let objects = a.objects + b.objects;
                let (mut least, mut slots) = share(costs_of_a, costs_of_b);
                let as_node = least[7] + visits * NODE_COST;
                let as_leaf = leaf_cost(objects);
                let is_leaf = as_leaf < as_node
                    || (as_leaf == as_node && objects <= TriangleBlock::LANES as u32);
                least[0] = if is_leaf { as_leaf } else { as_node };
                // Fewer slots where more are no better.
                for more in 1..7 {
                    if least[more - 1] <= least[more] {
                        least[more] = least[more - 1];
                        slots[more] = slots[more - 1];
                    }
                }
                let [_, slots @ ..] = slots;
                decisions[index] = Decision { slots, is_leaf, objects };
                costs[index] = least;
            }
            (kind, ..) => {
                let objects = if let NodeKind::Leaf { count, .. } = kind { count } else { 0 };
                decisions[index].objects = objects;
                costs[index] = [leaf_cost(objects); 8];
            }
        }
    }
    (decisions, costs)
}

/// Returns the least cost of two siblings together in 2 to 8 slots, and how they share the slots,
/// both from index 1 on.
fn share(a: &Costs, b: &Costs) -> (Costs, [Slots; 8]) {
    let mut costs = [0.0; 8];
    let mut shares = [0; 8];
    for slots in 2..=8 {
        // Costs may be infinite, if the visits are: some division is needed all the same.
        let mut least = a[0] + b[slots - 2];
        let mut share = 1 | (slots - 1) << 4;
        for first in 2..slots {
            let cost = a[first - 1] + b[slots - first - 1];
            if cost < least {
                least = cost;
                share = first | (slots - first) << 4;
            }
        }
        costs[slots - 1] = least;
        shares[slots - 1] = share as Slots;
    }
    (costs, shares)
}

/// The roots of the subtrees that become the children of the wide node of `subtree`, which is no
/// leaf, and how many there are.
pub(super) fn children(tree: &Bvh, decisions: &[Decision], subtree: usize) -> ([usize; 8], usize) {
    // At most 8 slots are shared out: no more than 8 parts wait at any time.
    let mut parts = [(subtree, decisions[subtree].slots(8)); 8];
    let mut count = 1;
    let mut lanes = 0;
    let mut children = [0; 8];
    while count > 0 {
        count -= 1;
        let (part, slots) = parts[count];
        if slots == 0 {
            children[lanes] = part;
            lanes += 1;
            continue;
        }
        let first = tree.nodes[part].children().start;
        for (part, slots) in [(first + 1, slots >> 4), (first, slots & 15)] {
            parts[count] = (part, decisions[part].slots(usize::from(slots)));
            count += 1;
        }
    }
    (children, lanes)
}

/// The part of the lines through the root's box that meet each node's.
pub(super) fn areas(tree: &Bvh) -> Vec<f32> {
    let root_area = tree.nodes[0].aabb.half_area();
    let scale = if root_area > 0.0 { 1.0 / root_area } else { 0.0 };
    tree.nodes.iter().map(|node| (node.aabb.half_area() * scale) as f32).collect()
}
