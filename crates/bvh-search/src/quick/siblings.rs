//! Reinsertion in a tree as it is, with a list of parents beside it: no other form has to be made, and siblings are
//! read together.
//!
//! Siblings stay adjacent: what moves takes its pair with it, as in Meister & Bittner 2018. Parents may then come after
//! their children, which is put right at the end.

use crate::place::Linked;
use crate::working::NONE;
use bvh_core::{Bvh, Node, NodeKind, PackedAabb};
use std::hint::select_unpredictable;

/// A binary tree under change. The root is node 0, its children are nodes 1 and 2, and so on by pairs.
pub(super) struct Siblings {
    tree: Bvh,
    /// The parent of every pair.
    parents: Vec<u32>,
}

/// The pair that a node other than the root belongs to.
#[inline(always)]
fn pair(at: u32) -> usize {
    (at as usize - 1) / 2
}

/// The first node of a pair.
#[inline(always)]
fn first(pair: u32) -> usize {
    2 * pair as usize + 1
}

impl Siblings {
    /// Takes over a tight binary tree of two objects or more, whose siblings are adjacent. O(n).
    pub fn new(tree: Bvh) -> Self {
        debug_assert!(tree.nodes.iter().all(|node| node.is_leaf() || node.children().len() == 2));
        let pairs = tree.nodes.len() / 2;
        // One more, for what leaves write: whether a node is one cannot be predicted.
        let mut parents = vec![0; pairs + 1];
        for (node, at) in tree.nodes.iter().zip(0..) {
            let pair = if node.is_leaf() { pairs } else { pair(node.children().start as u32) };
            parents[pair] = at;
        }
        parents.truncate(pairs);
        Self { tree, parents }
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.tree.nodes.len()
    }

    #[inline(always)]
    fn node(&self, at: u32) -> &Node {
        &self.tree.nodes[at as usize]
    }

    /// Writes what was elsewhere to `at`.
    #[inline(always)]
    fn put(&mut self, at: u32, node: Node) {
        if !node.is_leaf() {
            self.parents[pair(node.children().start as u32)] = at;
        }
        self.tree.nodes[at as usize] = node;
    }

    /// Makes the boxes from `at` up tight, until one is. Returns the nodes visited.
    #[inline(always)]
    fn tighten(&mut self, mut at: u32) -> u64 {
        let mut visits = 0;
        while at != NONE {
            let [left, right] = self.children(at).expect("an inner node").map(|child| self.node(child).aabb);
            visits += 1;
            let (aabb, node) = (left.union(&right), &mut self.tree.nodes[at as usize]);
            if aabb == node.aabb {
                break;
            }
            node.aabb = aabb;
            at = self.parent(at);
        }
        visits
    }

    /// The tree with parents before their children again. O(n).
    pub fn into_tree(self) -> Bvh {
        let Self { mut tree, parents } = self;
        let Order { sequence, late } = Order::of(&parents);
        let mut places = vec![0; sequence.len()];
        sequence.iter().zip(0..).for_each(|(&from, to)| places[from as usize] = to);
        let moved = |mut node: Node| {
            let (NodeKind::Inner { first: before, .. } | NodeKind::Leaf { first: before, .. }) = node.kind();
            let below = select_unpredictable(node.is_leaf(), 0, pair(before.max(1)));
            let after = 2 * places[below] + 1;
            node.set_first(select_unpredictable(node.is_leaf(), before, after));
            node
        };
        // The late ones are kept aside until it is their turn; the others move towards the front, if at all.
        let nodes = tree.nodes.as_mut_slice();
        let aside: Vec<Node> = late.iter().flat_map(|&pair| &nodes[first(pair)..][..2]).copied().collect();
        let (mut aside, mut next) = (aside.chunks_exact(2), 0);
        nodes[0] = moved(nodes[0]);
        for (to, from) in (0..).zip(sequence) {
            let (to, from, late) = (first(to), first(from), from < next);
            if late {
                let siblings = aside.next().expect("as many as late");
                (nodes[to], nodes[to + 1]) = (moved(siblings[0]), moved(siblings[1]));
            } else {
                (nodes[to], nodes[to + 1]) = (moved(nodes[from]), moved(nodes[from + 1]));
                next = (from / 2) as u32 + 1;
            }
        }
        tree
    }
}

/// The order of pairs in which each comes after its parent's, and otherwise by number: one that has a lower number than
/// its parent's follows that at once.
struct Order {
    sequence: Vec<u32>,
    /// Those that follow a pair of a higher number.
    late: Vec<u32>,
}

impl Order {
    fn of(parents: &[u32]) -> Self {
        const DONE: u32 = NONE - 1;
        // Per pair, the last entry of `waiting` that waits for it; there, a pair and the entry before.
        let (mut last, mut waiting) = (vec![NONE; parents.len()], Vec::new());
        let (mut sequence, mut late, mut ready) = (Vec::with_capacity(parents.len()), Vec::new(), Vec::new());
        for (number, &parent) in (0..).zip(parents) {
            if parent != 0 && last[pair(parent)] != DONE {
                let entry = waiting.len() as u32;
                waiting.push((number, std::mem::replace(&mut last[pair(parent)], entry)));
                continue;
            }
            ready.push(number);
            while let Some(at) = ready.pop() {
                sequence.push(at);
                if at != number {
                    late.push(at);
                }
                let mut entry = std::mem::replace(&mut last[at as usize], DONE);
                while entry != NONE {
                    let (waits, before) = waiting[entry as usize];
                    ready.push(waits);
                    entry = before;
                }
            }
        }
        Self { sequence, late }
    }
}

impl Linked for Siblings {
    const ABOVE: u32 = NONE;

    #[inline(always)]
    fn parent(&self, at: u32) -> u32 {
        if at == 0 { NONE } else { self.parents[pair(at)] }
    }

    #[inline(always)]
    fn children(&self, at: u32) -> Option<[u32; 2]> {
        let node = self.node(at);
        let first = node.children().start as u32;
        (!node.is_leaf()).then_some([first, first + 1])
    }

    #[inline(always)]
    fn other(&self, _at: u32, child: u32) -> u32 {
        ((child - 1) ^ 1) + 1
    }

    #[inline(always)]
    fn aabb(&self, at: u32) -> PackedAabb {
        PackedAabb::from(&self.node(at).aabb)
    }

    #[inline(always)]
    fn area(&self, at: u32) -> f64 {
        self.aabb(at).half_area()
    }

    #[inline(always)]
    fn reinsert(&mut self, node: u32, place: u32) -> u64 {
        let (parent, sibling) = (self.parent(node), self.other(NONE, node));
        let (rest, displaced) = (*self.node(sibling), *self.node(place));
        let joint = self.node(node).aabb.union(&displaced.aabb);
        self.put(sibling, displaced);
        self.put(parent, rest);
        self.put(place, Node::inner(joint, node.min(sibling), 2));
        2 + self.tighten(self.parent(parent)) + self.tighten(self.parent(place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::place::PlaceSearch;
    use crate::scatter::scatter;
    use crate::stream::stream;
    use bvh_build::{Builder, muller_fellner, ploc};
    use bvh_core::{Aabb, cost, validate};
    use rand::RngExt;

    fn starts(boxes: &[Aabb]) -> [Bvh; 2] {
        [ploc::Config::default().build(boxes).unwrap(), muller_fellner::Config::default().build(boxes).unwrap()]
    }

    /// The places that a node other than the root may be moved to.
    fn places(tree: &Siblings, node: u32) -> Vec<u32> {
        let allowed = |&place: &u32| {
            let mut above =
                std::iter::successors(Some(place), |&at| Some(tree.parent(at)).filter(|&at| at != NONE));
            place != tree.parent(node) && place != tree.other(NONE, node) && above.all(|at| at != node)
        };
        (0..tree.len() as u32).filter(allowed).collect()
    }

    fn copy(tree: &Siblings) -> Siblings {
        Siblings { tree: tree.tree.clone(), parents: tree.parents.clone() }
    }

    #[test]
    fn a_tree_stays_valid_and_tight_whatever_moves_are_made() {
        let boxes = scatter(40);
        let mut rng = stream(1, 0);
        for start in starts(&boxes) {
            let mut tree = Siblings::new(start);
            for _ in 0..2000 {
                let node = rng.random_range(1..tree.len() as u32);
                let places = places(&tree, node);
                if let Some(&place) = places.get(rng.random_range(0..places.len().max(1))) {
                    tree.reinsert(node, place);
                }
                let ordered = copy(&tree).into_tree();
                validate(&ordered, &boxes).unwrap();
                assert!(ordered.is_tight(&boxes));
                assert_eq!(ordered.nodes.len(), tree.len());
            }
        }
    }

    #[test]
    fn the_place_found_is_the_best_of_all_and_saves_what_is_said() {
        let boxes = scatter(60);
        let mut rng = stream(2, 0);
        let mut search = PlaceSearch::default();
        for start in starts(&boxes) {
            let mut tree = Siblings::new(start);
            for _ in 0..200 {
                let node = rng.random_range(1..tree.len() as u32);
                let before = cost::internal_area(&tree.tree);
                let (found, own) = search.attached(&tree, node, 0.0);
                let least = places(&tree, node).into_iter().map(|place| {
                    let mut moved = copy(&tree);
                    moved.reinsert(node, place);
                    cost::internal_area(&moved.tree)
                });
                let least = least.fold(before, f64::min);
                let after = before - own + found.map_or(own, |place| place.cost);
                assert!((after - least).abs() <= 1e-12 * before, "{after} {least}");
                if let Some(place) = found {
                    tree.reinsert(node, place.beside);
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
