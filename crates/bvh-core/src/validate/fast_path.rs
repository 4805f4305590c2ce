//! The fast path of validation: passes sound trees with two children per inner node and one object per leaf.
//!
//! Most trees are of this kind, and whether a node is a leaf is unpredictable. Here no branch depends on it, which makes
//! the check several times faster than the general one, and loading a file with it.

use crate::{BvhView, MAX_OBJECTS};
use core::hint::select_unpredictable;

/// Whether `tree` is a sound tree of that kind over `objects` objects: every index is in bounds, children come after
/// their parents, every node but the root has one parent, and every object is in one leaf. O(nodes).
pub(super) fn passes(tree: BvhView, objects: usize) -> bool {
    let BvhView { nodes, prim_ids } = tree;
    let right_size =
        (1..=MAX_OBJECTS).contains(&objects) && nodes.len() == 2 * objects - 1 && prim_ids.len() == objects;
    if !right_size {
        return false;
    }
    // Every node and every object id refers to one slot: of a pair of siblings, of a position in `prim_ids`, or of an
    // object. There are as many slots as references, so if no slot stays unmarked, each is referred to once.
    let mut marks = alloc::vec![0u8; nodes.len() + objects];
    let (referenced, placed) = marks.split_at_mut(nodes.len());
    let (objects, pairs) = (objects as u32, objects as u32 - 1);
    let (mut wrong, mut in_bounds) = (false, true);
    for (index, node) in (0u32..).zip(nodes) {
        let [first, tagged_count] = node.words();
        let leaf = tagged_count >> 31 == 1;
        // Pairs of siblings fill the nodes from 1 on, so that each begins at an odd index.
        let wrong_leaf = (tagged_count != (1 << 31 | 1)) | (first >= objects);
        let wrong_inner = (tagged_count != 2) | (first % 2 == 0) | (first <= index) | (first / 2 >= pairs);
        wrong |= select_unpredictable(leaf, wrong_leaf, wrong_inner);
        let slot = select_unpredictable(leaf, pairs.wrapping_add(first), first / 2);
        match referenced.get_mut(slot as usize) {
            Some(mark) => *mark = 1,
            None => in_bounds = false,
        }
    }
    for &object in prim_ids {
        match placed.get_mut(object as usize) {
            Some(mark) => *mark = 1,
            None => in_bounds = false,
        }
    }
    !wrong && in_bounds && marks.iter().fold(1, |all, mark| all & mark) == 1
}

#[cfg(test)]
mod tests {
    use super::super::find_fault;
    use super::*;
    use crate::{Aabb, Bvh, Node};
    use alloc::vec::Vec;

    /// A chain: each pair is a leaf and the parent of the next pair, on alternating sides.
    fn chain(objects: u32) -> Bvh {
        let leaf = |object: u32| Node::leaf(Aabb::EMPTY, object, 1);
        let mut nodes: Vec<Node> = alloc::vec![leaf(objects - 1)];
        let mut parent = 0;
        for object in 0..objects - 1 {
            let first = nodes.len();
            nodes.extend([leaf(object), leaf(objects - 1)]);
            nodes[parent] = Node::inner(Aabb::EMPTY, first as u32, 2);
            parent = first + 1;
            if object % 2 == 0 {
                nodes.swap(first, parent);
                parent = first;
            }
        }
        Bvh { nodes, prim_ids: (0..objects).map(|object| (object + 2) % objects).collect() }
    }

    fn passes(tree: &Bvh) -> bool {
        super::passes(tree.into(), tree.prim_ids.len())
    }

    #[test]
    fn sound_trees_pass() {
        for objects in (1..70).chain([1000]) {
            let tree = chain(objects);
            assert_eq!(find_fault((&tree).into(), objects as usize), Ok(()));
            assert!(passes(&tree), "{objects}");
        }
    }

    #[test]
    fn no_unsound_tree_passes() {
        for objects in [3, 9] {
            let tree = chain(objects);
            let mut passed = 0;
            for at in 0..tree.nodes.len() {
                let words =
                    [0, 1 << 31].into_iter().flat_map(|high| (0..2 * objects + 2).map(move |low| high | low));
                for first in words.chain([u32::MAX]) {
                    for (count, node) in
                        (0..4).flat_map(|count| [(count, Node::inner as fn(_, _, _) -> _), (count, Node::leaf)])
                    {
                        let mut damaged = tree.clone();
                        damaged.nodes[at] = node(Aabb::EMPTY, first, count);
                        let sound = find_fault((&damaged).into(), objects as usize).is_ok();
                        assert_eq!(passes(&damaged), sound, "{:?}", damaged.nodes);
                        passed += usize::from(sound);
                    }
                }
            }
            assert_eq!(passed, tree.nodes.len(), "only changes that change nothing pass");
            for (at, id) in (0..objects as usize).flat_map(|at| (0..objects + 3).map(move |id| (at, id))) {
                let mut damaged = tree.clone();
                damaged.prim_ids[at] = id;
                assert_eq!(passes(&damaged), damaged == tree);
            }
        }
    }

    #[test]
    fn sound_trees_of_another_kind_do_not_pass() {
        let mut tree = chain(4);
        let of_objects = |objects| super::passes((&tree).into(), objects);
        assert!(!of_objects(3) && !of_objects(5) && !of_objects(0));
        tree.nodes.truncate(5);
        tree.nodes[4] = Node::leaf(Aabb::EMPTY, 2, 2);
        assert_eq!(find_fault((&tree).into(), 4), Ok(()));
        assert!(!passes(&tree));
    }
}
