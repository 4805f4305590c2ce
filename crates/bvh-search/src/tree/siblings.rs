//! Reinsertion in the flat tree itself, with a separate list of parents, for searches of a few
//! milliseconds: conversion to and from the working form would take much of that time.
//!
//! Siblings stay adjacent: a moving node takes its pair along, as in Meister & Bittner 2018. A
//! parent may then come after its children, which [`Siblings::into_tree`] repairs.

use super::NONE;
use super::linked::Linked;
use bvh_core::{Bvh, Node, NodeKind, PackedAabb};
use std::hint::select_unpredictable;

/// A mutable binary tree. The root is node 0; siblings form pairs: nodes 1 and 2, 3 and 4, and so
/// on.
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Siblings {
    tree: Bvh,
    /// The parent of every pair.
    parents: Vec<u32>,
}

#[inline(always)]
fn pair(index: u32) -> usize {
    (index as usize - 1) / 2
}

#[inline(always)]
fn first(pair: u32) -> usize {
    2 * pair as usize + 1
}

impl Siblings {
    /// Wraps a tight binary tree of two objects or more, whose siblings are adjacent. O(n).
    pub fn new(tree: Bvh) -> Self {
        debug_assert!(tree.nodes.iter().all(|node| node.is_leaf() || node.children().len() == 2));
        let pairs = tree.nodes.len() / 2;
        // Leaves write to a dummy slot, so the store needs no branch, which the processor could not
        // predict.
        let mut parents = vec![0; pairs + 1];
        for (node, index) in tree.nodes.iter().zip(0..) {
            let pair = if node.is_leaf() { pairs } else { pair(node.children().start as u32) };
            parents[pair] = index;
        }
        parents.truncate(pairs);
        Self { tree, parents }
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.tree.nodes.len()
    }

    #[inline(always)]
    fn node(&self, index: u32) -> &Node {
        &self.tree.nodes[index as usize]
    }

    /// Writes a node to `index` and links its children to it.
    #[inline(always)]
    fn put(&mut self, index: u32, node: Node) {
        if !node.is_leaf() {
            self.parents[pair(node.children().start as u32)] = index;
        }
        self.tree.nodes[index as usize] = node;
    }

    /// Makes the boxes from `index` upwards tight until one does not change. Returns the number of
    /// nodes visited.
    #[inline(always)]
    fn tighten(&mut self, mut index: u32) -> u64 {
        let mut visits = 0;
        while index != NONE {
            let [left, right] =
                self.children(index).expect("an inner node").map(|child| self.node(child).aabb);
            visits += 1;
            let aabb = left.union(&right);
            let node = &mut self.tree.nodes[index as usize];
            if aabb == node.aabb {
                break;
            }
            node.aabb = aabb;
            index = self.parent(index);
        }
        visits
    }

    /// Returns the tree with parents before their children again. O(n).
    pub fn into_tree(self) -> Bvh {
        let Self { tree: Bvh { nodes, prim_ids }, parents } = self;
        let sequence = order_of_pairs(&parents);
        let mut places = vec![0; sequence.len()];
        sequence.iter().zip(0..).for_each(|(&from, to)| places[from as usize] = to);
        let moved = |mut node: Node| {
            let (NodeKind::Inner { first: before, .. } | NodeKind::Leaf { first: before, .. }) =
                node.kind();
            let below = select_unpredictable(node.is_leaf(), 0, pair(before.max(1)));
            let after = 2 * places[below] + 1;
            node.set_first(select_unpredictable(node.is_leaf(), before, after));
            node
        };
        let mut ordered = Vec::with_capacity(nodes.len());
        ordered.push(moved(nodes[0]));
        for from in sequence.into_iter().map(first) {
            ordered.extend([moved(nodes[from]), moved(nodes[from + 1])]);
        }
        Bvh { nodes: ordered, prim_ids }
    }
}

/// Returns an order of the pairs in which each comes after its parent's pair: by number, except that
/// a pair with a lower number than its parent's pair follows that pair at once.
fn order_of_pairs(parents: &[u32]) -> Vec<u32> {
    const DONE: u32 = NONE - 1;
    // Linked lists: per pair, the last entry of `waiting` that waits for it. An entry is a pair and
    // the previous entry.
    let mut last = vec![NONE; parents.len()];
    let mut waiting = Vec::new();
    let mut sequence = Vec::with_capacity(parents.len());
    let mut ready = Vec::new();
    for (number, &parent) in (0..).zip(parents) {
        if parent != 0 && last[pair(parent)] != DONE {
            let entry = waiting.len() as u32;
            waiting.push((number, std::mem::replace(&mut last[pair(parent)], entry)));
            continue;
        }
        ready.push(number);
        while let Some(index) = ready.pop() {
            sequence.push(index);
            // Everything that waited for this pair may follow now, the last entry first.
            let mut entry = std::mem::replace(&mut last[index as usize], DONE);
            while entry != NONE {
                let (waits, before) = waiting[entry as usize];
                ready.push(waits);
                entry = before;
            }
        }
    }
    sequence
}

impl Linked for Siblings {
    const ABOVE: u32 = NONE;

    #[inline(always)]
    fn parent(&self, index: u32) -> u32 {
        if index == 0 { NONE } else { self.parents[pair(index)] }
    }

    #[inline(always)]
    fn children(&self, index: u32) -> Option<[u32; 2]> {
        let node = self.node(index);
        let first = node.children().start as u32;
        (!node.is_leaf()).then_some([first, first + 1])
    }

    #[inline(always)]
    fn other(&self, _at: u32, child: u32) -> u32 {
        ((child - 1) ^ 1) + 1
    }

    #[inline(always)]
    fn aabb(&self, index: u32) -> PackedAabb {
        PackedAabb::from(&self.node(index).aabb)
    }

    #[inline(always)]
    fn area(&self, index: u32) -> f64 {
        self.aabb(index).half_area()
    }

    #[inline(always)]
    fn size(&self, aabb: &PackedAabb) -> f64 {
        aabb.half_area()
    }

    #[inline(always)]
    fn reinsert(&mut self, node: u32, position: u32) -> u64 {
        let parent = self.parent(node);
        let sibling = self.other(NONE, node);
        let rest = *self.node(sibling);
        let displaced = *self.node(position);
        let joint = self.node(node).aabb.union(&displaced.aabb);
        // The pair of the moving node stays together: its sibling's place takes the displaced node,
        // and the sibling moves up to the parent's place.
        self.put(sibling, displaced);
        self.put(parent, rest);
        self.put(position, Node::inner(joint, node.min(sibling), 2));
        2 + self.tighten(self.parent(parent)) + self.tighten(self.parent(position))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::scatter;
    use crate::tree::PositionSearch;
    use bvh_build::{Builder, muller_fellner, ploc};
    use bvh_core::{Aabb, cost, validate};
    use rand::RngExt;

    fn starts(boxes: &[Aabb]) -> [Bvh; 2] {
        [
            ploc::Config::default().build(boxes).unwrap(),
            muller_fellner::Config::default().build(boxes).unwrap(),
        ]
    }

    /// The positions to which a node other than the root may move.
    fn positions(tree: &Siblings, node: u32) -> Vec<u32> {
        let allowed = |&place: &u32| {
            let mut above = std::iter::successors(Some(place), |&index| {
                Some(tree.parent(index)).filter(|&index| index != NONE)
            });
            place != tree.parent(node)
                && place != tree.other(NONE, node)
                && above.all(|index| index != node)
        };
        (0..tree.len() as u32).filter(allowed).collect()
    }

    #[test]
    fn a_tree_stays_valid_and_tight_whatever_moves_are_made() {
        let boxes = scatter(40);
        let mut rng = stream(1, 0);
        for start in starts(&boxes) {
            let mut tree = Siblings::new(start);
            for _ in 0..2000 {
                let node = rng.random_range(1..tree.len() as u32);
                let positions = positions(&tree, node);
                if let Some(&place) = positions.get(rng.random_range(0..positions.len().max(1))) {
                    tree.reinsert(node, place);
                }
                let ordered = tree.clone().into_tree();
                validate(&ordered, &boxes).unwrap();
                assert!(ordered.is_tight(&boxes));
                assert_eq!(ordered.nodes.len(), tree.len());
            }
        }
    }

    #[test]
    fn the_position_found_is_the_best_of_all_and_saves_what_is_said() {
        let boxes = scatter(60);
        let mut rng = stream(2, 0);
        let mut search = PositionSearch::default();
        for start in starts(&boxes) {
            let mut tree = Siblings::new(start);
            for _ in 0..200 {
                let node = rng.random_range(1..tree.len() as u32);
                let before = cost::internal_area(&tree.tree);
                let (found, current) = search.position_of_attached(&tree, node, 0.0);
                let least = positions(&tree, node).into_iter().map(|place| {
                    let mut moved = tree.clone();
                    moved.reinsert(node, place);
                    cost::internal_area(&moved.tree)
                });
                let least = least.fold(before, f64::min);
                let after = before - current + found.map_or(current, |place| place.cost);
                assert!((after - least).abs() <= 1e-12 * before, "{after} {least}");
                if let Some(place) = found {
                    tree.reinsert(node, place.sibling);
                    assert!((cost::internal_area(&tree.tree) - after).abs() <= 1e-12 * before);
                }
            }
        }
    }

    #[test]
    fn a_tree_in_which_nothing_moved_comes_out_as_it_was() {
        for objects in [2, 3, 100] {
            for start in starts(&scatter(objects)) {
                assert_eq!(Siblings::new(start.clone()).into_tree(), start);
            }
        }
    }
}
