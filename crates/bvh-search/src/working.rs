//! The one working form of a tree that local search changes: parents, packed boxes, cached areas, and a journal.
//!
//! Node 0 is no node but the *anchor* whose first child is the root, so that the root needs no special case. Detaching
//! a subtree keeps its parent node with it; attaching uses that node again, so that nothing is ever allocated.

use crate::SearchError;
use bvh_core::cost::Sum;
use bvh_core::{Aabb, Bvh, Node as BvhNode, NodeKind, PackedAabb};

/// No node.
pub(crate) const NONE: u32 = u32::MAX;

/// The index above the root.
pub(crate) const ANCHOR: u32 = 0;

/// One cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Exact union of everything below.
    pub aabb: PackedAabb,
    /// Half area of `aabb`.
    pub area: f64,
    /// The change during which the node was last written to the journal.
    pub stamp: u64,
    /// `NONE` for a detached subtree's spare parent.
    pub parent: u32,
    /// Both children, or `[NONE, object]`.
    pub children: [u32; 2],
    /// In the journal only: where the node belongs.
    pub index: u32,
}

impl Node {
    const ANCHOR: Self =
        Self { aabb: PackedAabb::EMPTY, area: 0.0, stamp: 0, parent: NONE, children: [NONE; 2], index: NONE };

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

/// A binary tree under change. Leaves hold one object each.
#[derive(Clone, Debug)]
pub(crate) struct Working {
    pub nodes: Vec<Node>,
    /// Total area of the inner nodes when the change began, and what the change has added since.
    area: Sum,
    added: f64,
    journal: Vec<Node>,
    change: u64,
}

impl Default for Working {
    fn default() -> Self {
        Self { nodes: vec![Node::ANCHOR], area: Sum::default(), added: 0.0, journal: Vec::new(), change: 0 }
    }
}

impl Working {
    /// The working form of a valid tree with one object per leaf, in O(n); boxes are made tight. Refuses inner nodes with
    /// more than two children.
    pub fn from_bvh(tree: &Bvh, boxes: &[Aabb]) -> Result<Self, SearchError> {
        let mut nodes = Vec::with_capacity(tree.nodes.len() + 1);
        nodes.push(Node::ANCHOR);
        for (index, node) in tree.nodes.iter().enumerate() {
            let children = match node.kind() {
                NodeKind::Inner { first, count: 2 } => [first + 1, first + 2],
                NodeKind::Leaf { first, .. } => [NONE, tree.prim_ids[first as usize]],
                NodeKind::Inner { count, .. } => {
                    return Err(SearchError::NotBinary { node: index, children: count });
                }
            };
            nodes.push(Node { children, ..Node::ANCHOR });
        }
        if nodes.len() > 1 {
            nodes[0].children[0] = 1;
            nodes[1].parent = ANCHOR;
        }
        for at in (1..nodes.len()).rev() {
            let [left, right] = nodes[at].children;
            let aabb = if left == NONE {
                PackedAabb::from(&boxes[right as usize])
            } else {
                nodes[left as usize].parent = at as u32;
                nodes[right as usize].parent = at as u32;
                nodes[left as usize].aabb.union(&nodes[right as usize].aabb)
            };
            nodes[at].aabb = aabb;
            nodes[at].area = aabb.half_area();
        }
        Ok(Self::from_nodes(nodes))
    }

    /// As [`from_bvh`](Self::from_bvh) for a tree whose boxes are tight and whose internal area is `area`: in one pass.
    pub fn from_tight(tree: &Bvh, area: f64) -> Result<Self, SearchError> {
        let mut nodes = Vec::with_capacity(tree.nodes.len() + 1);
        nodes.push(Node::ANCHOR);
        // Two more than there are nodes, for what leaves write: whether a node is one cannot be predicted.
        let mut parents = vec![ANCHOR; tree.nodes.len() + 2];
        for (index, (node, at)) in tree.nodes.iter().zip(1..).enumerate() {
            let (first, count, leaf) = match node.kind() {
                NodeKind::Inner { first, count } => (first, count, false),
                NodeKind::Leaf { first, .. } => (first, 2, true),
            };
            if count != 2 {
                return Err(SearchError::NotBinary { node: index, children: count });
            }
            let below = if leaf { tree.nodes.len() } else { first as usize };
            (parents[below], parents[below + 1]) = (at, at);
            let object = tree.prim_ids[if leaf { first as usize } else { 0 }];
            let children = if leaf { [NONE, object] } else { [first + 1, first + 2] };
            let aabb = PackedAabb::from(&node.aabb);
            let (area, parent) = (aabb.half_area(), parents[index]);
            nodes.push(Node { aabb, area, parent, children, ..Node::ANCHOR });
        }
        if nodes.len() > 1 {
            nodes[0].children[0] = 1;
        }
        let mut working = Self { nodes, ..Self::default() };
        working.area.add(area);
        Ok(working)
    }

    /// A tree of nodes written elsewhere, linked, the anchor first.
    pub fn from_nodes(mut nodes: Vec<Node>) -> Self {
        nodes.iter_mut().for_each(|node| node.stamp = 0);
        let mut tree = Self { nodes, ..Self::default() };
        tree.area.add(tree.internal_area());
        tree
    }

    /// The tree, children adjacent and left before right, objects in leaf order.
    pub fn to_bvh(&self) -> Bvh {
        let mut tree = Bvh::default();
        let Some(root) = self.root() else { return tree };
        let count = self.nodes.len() - 1;
        let placeholder = BvhNode::leaf(Aabb::EMPTY, 0, 0);
        tree.nodes = vec![placeholder; count];
        tree.prim_ids = Vec::with_capacity(self.objects());
        let mut free = 1;
        let mut stack = Vec::with_capacity(64);
        let mut next = Some((root, 0));
        while let Some((at, to)) = next {
            let node = &self.nodes[at as usize];
            let aabb = Aabb::from(&node.aabb);
            let [left, right] = node.children;
            if left == NONE {
                tree.nodes[to as usize] = BvhNode::leaf(aabb, tree.prim_ids.len() as u32, 1);
                tree.prim_ids.push(right);
                next = stack.pop();
            } else {
                tree.nodes[to as usize] = BvhNode::inner(aabb, free, 2);
                stack.push((right, free + 1));
                next = Some((left, free));
                free += 2;
            }
        }
        tree
    }

    /// As [`to_bvh`](Self::to_bvh), but level by level: faster if large nodes are close to each other in memory, and for
    /// rays a little slower.
    pub fn to_bvh_level_by_level(&self) -> Bvh {
        let mut tree = Bvh::default();
        let Some(root) = self.root() else { return tree };
        let (count, objects) = (self.nodes.len() - 1, self.objects());
        tree.nodes.reserve_exact(count);
        // Room for what is written whether or not a node is a leaf, which cannot be predicted.
        tree.prim_ids = vec![0; objects + 1];
        let mut sources = vec![root; count + 2];
        let (mut free, mut leaves) = (1, 0);
        for at in 0..count {
            let node = &self.nodes[sources[at] as usize];
            let (leaf, aabb) = (node.is_leaf(), Aabb::from(&node.aabb));
            (sources[free], sources[free + 1]) = (node.children[0], node.children[1]);
            tree.prim_ids[leaves] = node.children[1];
            let (inner_node, leaf_node) =
                (BvhNode::inner(aabb, free as u32, 2), BvhNode::leaf(aabb, leaves as u32, 1));
            tree.nodes.push(if leaf { leaf_node } else { inner_node });
            free += 2 * usize::from(!leaf);
            leaves += usize::from(leaf);
        }
        tree.prim_ids.truncate(objects);
        tree
    }

    /// The root, unless there are no objects.
    pub fn root(&self) -> Option<u32> {
        Some(self.nodes[0].children[0]).filter(|&root| root != NONE)
    }

    /// Number of objects.
    pub fn objects(&self) -> usize {
        self.nodes.len() / 2
    }

    /// The total area of all inner nodes, kept incrementally: its error does not grow with the number of changes beyond
    /// that of one rounding each.
    pub fn area(&self) -> f64 {
        self.area.value() + self.added
    }

    /// The total area of all inner nodes, recomputed. O(n).
    pub fn internal_area(&self) -> f64 {
        self.nodes.iter().filter(|node| !node.is_leaf()).map(|node| node.area).collect::<Sum>().value()
    }

    /// Begins a change: what follows can be undone back to here.
    #[inline(always)]
    pub fn begin(&mut self) {
        self.change += 1;
        self.journal.clear();
        self.area.add(self.added);
        self.added = 0.0;
    }

    /// Takes the change back, bit by bit.
    #[inline(always)]
    pub fn undo(&mut self) {
        self.added = 0.0;
        for node in self.journal.drain(..) {
            self.nodes[node.index as usize] = node;
        }
    }

    /// The node, about to be written.
    #[inline(always)]
    fn write(&mut self, at: u32) -> &mut Node {
        let node = &mut self.nodes[at as usize];
        if node.stamp != self.change {
            self.journal.push(Node { index: at, ..*node });
            node.stamp = self.change;
        }
        node
    }

    /// Lets `new` take the place of `old` below `parent`.
    #[inline(always)]
    fn replace_child(&mut self, parent: u32, old: u32, new: u32) {
        let children = &mut self.write(parent).children;
        children[usize::from(children[0] != old)] = new;
        self.write(new).parent = parent;
    }

    /// Takes `node`, not the root, and what is below it out of the tree, its parent node with it. Boxes are made tight.
    /// Returns the area saved, the sibling that took the parent's place, and the nodes visited.
    #[inline(always)]
    pub fn detach(&mut self, node: u32) -> (f64, u32, u64) {
        let parent = self.nodes[node as usize].parent;
        let Node { parent: above, area, .. } = self.nodes[parent as usize];
        let sibling = self.nodes[parent as usize].other(node);
        self.write(parent).parent = NONE;
        self.replace_child(above, parent, sibling);
        let (mut saved, mut at, mut visits) = (area, above, 2);
        while at != ANCHOR {
            let aabb = self.union_of(self.nodes[at as usize].children);
            visits += 1;
            if aabb == self.nodes[at as usize].aabb {
                break;
            }
            let area = aabb.half_area();
            let node = self.write(at);
            saved += node.area - area;
            (node.aabb, node.area) = (aabb, area);
            at = node.parent;
        }
        self.added -= saved;
        (saved, sibling, visits)
    }

    /// Puts a detached `node` beside `place`, its parent node above both. Returns the area added and the nodes visited.
    #[inline(always)]
    pub fn attach(&mut self, node: u32, place: u32) -> (f64, u64) {
        let Node { aabb: added_box, parent, .. } = self.nodes[node as usize];
        let Node { aabb, parent: above, .. } = self.nodes[place as usize];
        self.replace_child(above, place, parent);
        self.write(place).parent = parent;
        let aabb = aabb.union(&added_box);
        let area = aabb.half_area();
        let joint = self.write(parent);
        (joint.children, joint.aabb, joint.area) = ([place, node], aabb, area);
        let (mut added, mut at, mut visits) = (area, above, 2);
        while at != ANCHOR {
            let grown = self.nodes[at as usize].aabb.union(&added_box);
            visits += 1;
            if grown == self.nodes[at as usize].aabb {
                break;
            }
            let area = grown.half_area();
            let node = self.write(at);
            added += area - node.area;
            (node.aabb, node.area) = (grown, area);
            at = node.parent;
        }
        self.added += added;
        (added, visits)
    }

    /// The box around two nodes.
    #[inline(always)]
    pub fn union_of(&self, [left, right]: [u32; 2]) -> PackedAabb {
        self.nodes[left as usize].aabb.union(&self.nodes[right as usize].aabb)
    }

    /// Gives the inner node `at` these children and makes its box tight. What is above stays as it is: when several nodes
    /// are joined anew, the lowest come first, and the highest must have the objects it had.
    #[inline(always)]
    pub fn join(&mut self, at: u32, children: [u32; 2]) {
        let aabb = self.union_of(children);
        let area = aabb.half_area();
        children.into_iter().for_each(|child| self.write(child).parent = at);
        let node = self.write(at);
        let before = node.area;
        (node.children, node.aabb, node.area) = (children, aabb, area);
        self.added += area - before;
    }

    /// How many changes have begun: what a node's `stamp` is compared with.
    pub fn changes(&self) -> u64 {
        self.change
    }

    /// All nodes but the anchor, parents before children, left before right. O(n).
    pub fn preorder(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut stack: Vec<u32> = self.root().into_iter().collect();
        while let Some(at) = stack.pop() {
            order.push(at);
            let node = &self.nodes[at as usize];
            if !node.is_leaf() {
                stack.extend([node.children[1], node.children[0]]);
            }
        }
        order
    }

    /// The same tree with its nodes in preorder, so that neighbours in the tree are neighbours in memory. O(n).
    pub fn in_preorder(&self) -> Self {
        let order = self.preorder();
        let mut new = vec![ANCHOR; self.nodes.len()];
        order.iter().zip(1..).for_each(|(&old, at)| new[old as usize] = at);
        let mut nodes = vec![self.nodes[0]];
        nodes.extend(order.iter().map(|&old| self.nodes[old as usize]));
        for node in &mut nodes {
            if !node.is_leaf() {
                node.children =
                    node.children.map(|child| if child == NONE { NONE } else { new[child as usize] });
            }
            if node.parent != NONE {
                node.parent = new[node.parent as usize];
            }
        }
        Self::from_nodes(nodes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::place::PlaceSearch;
    use crate::stream::stream;
    use bvh_build::{Builder, muller_fellner};
    use bvh_core::validate;
    use rand::RngExt;

    fn scene(n: usize) -> (Vec<Aabb>, Working) {
        let mut rng = stream(1, 0);
        let mut coordinate = |scale: f32| scale * rng.random::<f32>();
        let boxes: Vec<Aabb> = (0..n)
            .map(|_| {
                let low = [(); 3].map(|()| coordinate(1.0));
                let size = coordinate(0.3);
                Aabb::from((low, low.map(|c| c + coordinate(size))))
            })
            .collect();
        let tree = muller_fellner::Config::default().build(&boxes).unwrap();
        let working = Working::from_bvh(&tree, &boxes).unwrap();
        (boxes, working)
    }

    #[test]
    fn a_tight_tree_is_taken_over_as_it_is() {
        let (_, working) = scene(100);
        let tree = working.to_bvh();
        let taken = Working::from_tight(&tree, working.internal_area()).unwrap();
        assert_tight(&taken, &scene(100).0);
        assert_eq!((taken.area(), taken.to_bvh()), (working.internal_area(), tree));
    }

    #[test]
    fn a_tree_is_the_same_level_by_level() {
        for n in [1, 2, 3, 100] {
            let (boxes, working) = scene(n);
            let tree = working.to_bvh_level_by_level();
            validate(&tree, &boxes).unwrap();
            assert_eq!(Working::from_bvh(&tree, &boxes).unwrap().to_bvh(), working.to_bvh());
            assert!(tree.nodes.windows(2).all(|pair| pair[0].is_leaf()
                || pair[1].is_leaf()
                || pair[0].children().start < pair[1].children().start));
        }
    }

    /// Every box is the union below it, every parent the right one.
    fn assert_tight(tree: &Working, boxes: &[Aabb]) {
        let bvh = tree.to_bvh();
        validate(&bvh, boxes).unwrap();
        let mut tight = bvh.clone();
        tight.refit(boxes);
        assert_eq!(bvh, tight);
        for at in tree.preorder() {
            let node = &tree.nodes[at as usize];
            assert!(
                node.is_leaf() || node.children.iter().all(|&child| tree.nodes[child as usize].parent == at)
            );
            assert_eq!(node.area, node.aabb.half_area());
        }
    }

    /// A random node that is not the root.
    fn any(tree: &Working, rng: &mut impl RngExt) -> u32 {
        loop {
            let node = rng.random_range(1..tree.nodes.len() as u32);
            if tree.nodes[node as usize].parent != ANCHOR {
                return node;
            }
        }
    }

    #[test]
    fn conversion_there_and_back_changes_nothing() {
        for n in [0, 1, 2, 3, 50] {
            let (boxes, tree) = scene(n);
            let again = Working::from_bvh(&tree.to_bvh(), &boxes).unwrap();
            assert_eq!(again.to_bvh(), tree.to_bvh());
            assert_eq!(tree.in_preorder().to_bvh(), tree.to_bvh());
            assert_eq!(tree.objects(), n);
        }
    }

    #[test]
    fn the_incremental_area_equals_the_recomputed_one_after_each_of_a_million_moves() {
        let (boxes, mut tree) = scene(60);
        let mut rng = stream(2, 0);
        for number in 0..1_000_000 {
            tree.begin();
            let node = any(&tree, &mut rng);
            tree.detach(node);
            let places = tree.preorder();
            tree.attach(node, places[rng.random_range(0..places.len())]);
            if rng.random_bool(0.3) {
                tree.undo();
            }
            let recomputed = tree.internal_area();
            assert!((tree.area() - recomputed).abs() <= 1e-12 * recomputed, "{number}");
            if number % 10_000 == 0 {
                assert_tight(&tree, &boxes);
            }
        }
    }

    #[test]
    fn undoing_restores_every_bit() {
        let (_, mut tree) = scene(40);
        let mut rng = stream(3, 0);
        for _ in 0..1000 {
            let before = (tree.to_bvh(), tree.area().to_bits());
            tree.begin();
            for _ in 0..rng.random_range(1..5) {
                let node = any(&tree, &mut rng);
                tree.detach(node);
                let root = tree.nodes[0].children[0];
                tree.attach(node, root);
            }
            tree.undo();
            assert_eq!(before, (tree.to_bvh(), tree.area().to_bits()));
        }
    }

    #[test]
    fn the_best_place_is_the_best_of_all_whether_the_node_is_out_or_only_thought_to_be() {
        let (_, mut tree) = scene(60);
        let mut rng = stream(4, 0);
        let mut search = PlaceSearch::default();
        for _ in 0..300 {
            let node = any(&tree, &mut rng);
            let start = tree.area();
            let (found, own) = search.attached(&tree, node, 0.0);
            tree.begin();
            let (saved, sibling, _) = tree.detach(node);
            assert!((saved - own).abs() <= 1e-12 * saved);
            let without = tree.clone();
            let costs = without.preorder().into_iter().map(|place| {
                let mut tree = without.clone();
                tree.attach(node, place).0
            });
            let least = costs.fold(f64::INFINITY, f64::min);
            let (aabb, area) = (tree.nodes[node as usize].aabb, tree.nodes[node as usize].area);
            for first in [sibling, NONE, any(&tree, &mut rng)] {
                let place = search.detached(&tree, (&aabb, area), first, f64::INFINITY).unwrap();
                assert!((place.cost - least).abs() <= 1e-12 * least, "{} {least}", place.cost);
            }
            assert!(search.detached(&tree, (&aabb, area), sibling, least * (1.0 - 1e-9)).is_none());
            assert!((found.map_or(own, |place| place.cost) - least).abs() <= 1e-12 * least);
            let place = found.map_or(sibling, |place| place.beside);
            let (added, _) = tree.attach(node, place);
            assert!((added - least).abs() <= 1e-12 * least && tree.area() <= start * (1.0 + 1e-12));
        }
    }
}
