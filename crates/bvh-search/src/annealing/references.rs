//! Moves that change the references: they divide an object between two leaves, or reunite two
//! leaves of an object.
//!
//! ```text
//!     P ⊇ L ∪ T                        P' ⊇ L ∪ T₁      Q' ⊇ R ∪ T₂
//!     ├── L       T sticks far   ⇒     ├── L            ├── R
//!     └── T       out of L             └── T₁           └── T₂
//! ```
//!
//! A leaf that enlarges its ancestors is cut where one of them would end without the leaf; each
//! part then gets the best position. A move is kept if the tree's cost, leaves included, falls by
//! more than the price of a reference. Reuniting reverses a division, so a split that does not pay
//! its price is undone, whichever method made it.
//!
//! Spatial splits: Stich, Friedrich & Dietrich 2009. The search over them is new.

use super::layout::Layout;
use crate::run::{Observer, Quota, Splits, Stream, Tally, WORK_PER_POLL};
use crate::tree::{ANCHOR, Metric, NONE, Node, PositionSearch, Scope, Working};
use crate::tuning::{DIVISION_DEARER_BY_AREA, LEVELS_OF_PLANES, PRICE_OF_A_REFERENCE};
use bvh_core::{Aabb, PackedAabb, with_vector_instructions};
use rand::RngExt;

/// Changes the references of a tree.
#[derive(Debug)]
pub(crate) struct Divider<'a> {
    splits: Splits<'a>,
    search: PositionSearch,
    /// The layout whose cost judges the moves, unless the tree's area does.
    layout: Option<Layout>,
    /// Per leaf, the next leaf of the same object; the leaves of an object form a ring. `NONE` for
    /// leaves out of the tree.
    ring: Vec<u32>,
    /// Leaves out of the tree, each with its spare parent.
    spares: Vec<u32>,
    /// References in the tree.
    count: usize,
    planes: Vec<(usize, f32)>,
    /// Nodes visited outside of the position search.
    visits: u64,
}

impl<'a> Divider<'a> {
    pub fn new(splits: Splits<'a>, by_layout: bool) -> Self {
        let (search, ring, spares, planes) = Default::default();
        let layout = by_layout.then(Layout::default);
        Self { splits, search, layout, ring, spares, count: 0, planes, visits: 0 }
    }

    /// Tries to reunite the leaves of every object, then to divide leaves until `quota` is used up.
    /// The tree is in preorder before and after.
    pub fn pass<A: Metric>(
        &mut self,
        tree: &mut Working<A>,
        quota: Quota,
        rng: &mut Stream,
        observer: &dyn Observer,
    ) -> Tally {
        self.tie(tree);
        self.layout.iter_mut().for_each(|layout| layout.fill(tree));
        let tally = change(self, tree, quota, rng, observer);
        tree.sort_in_preorder();
        tally
    }

    fn work(&self) -> u64 {
        self.visits + self.search.visits + self.layout.as_ref().map_or(0, |layout| layout.visits)
    }

    /// Links the leaves of every object into a ring. O(nodes).
    fn tie(&mut self, tree: &Working<impl Metric>) {
        self.ring.clear();
        self.ring.resize(tree.nodes.len(), NONE);
        self.spares.clear();
        self.count = tree.objects();
        let leaves = || (0..).zip(&tree.nodes).skip(1).filter(|(_, node)| node.is_leaf());
        let objects = leaves().map(|(_, node)| node.children[1] as usize + 1).max().unwrap_or(0);
        let mut last = vec![NONE; objects];
        for (index, node) in leaves() {
            let last = &mut last[node.children[1] as usize];
            self.ring[index as usize] = index;
            if *last != NONE {
                self.ring[index as usize] = self.ring[*last as usize];
                self.ring[*last as usize] = index;
            }
            *last = index;
        }
    }

    /// Reunites `leaf` with `other`, another leaf of its object, if that costs less.
    #[inline(always)]
    fn reunite(&mut self, tree: &mut Working<impl Metric>, leaf: u32, other: u32) -> bool {
        let [a, b] = [leaf, other].map(|leaf| tree.nodes[leaf as usize]);
        // A root cannot be detached.
        if b.parent == ANCHOR {
            return false;
        }
        let object = a.children[1];
        let whole = self.splits.objects.clip(object, &Aabb::from(&a.aabb.union(&b.aabb)));
        // A degenerate object may vanish under clipping; it stays divided.
        if whole == Aabb::EMPTY {
            return false;
        }
        let whole = PackedAabb::from(&whole);
        let area = tree.metric().of(&whole);
        let price = self.price(tree);
        tree.begin();
        let (saved_other, _, visits) = tree.detach(other);
        self.visits += visits;
        if tree.nodes[leaf as usize].parent == ANCHOR {
            tree.undo();
            return false;
        }
        let (saved, sibling, visits) = tree.detach(leaf);
        self.visits += visits;
        let limit =
            self.limit(saved + saved_other + leaf_cost(tree, a.area + b.area - area)) + price;
        // The detached leaf gets an empty box of no area, so that sums over all leaves stay right.
        tree.resize_leaf(other, object, PackedAabb::EMPTY, 0.0);
        tree.resize_leaf(leaf, object, whole, area);
        let position = (area < limit)
            .then(|| {
                self.search.position_of_detached(tree, Scope::ALL, (&whole, area), sibling, limit)
            })
            .flatten();
        let Some(position) = position else {
            tree.undo();
            return false;
        };
        self.visits += tree.attach(leaf, position.sibling).1;
        if !self.accepts(tree, price) {
            return false;
        }
        // Rings are singly linked: find the predecessor to unlink the leaf.
        let mut before = leaf;
        while self.ring[before as usize] != other {
            before = self.ring[before as usize];
        }
        self.ring[before as usize] = self.ring[other as usize];
        self.spares.push(other);
        self.count -= 1;
        true
    }

    /// Divides `leaf` at a random candidate plane, if that costs less.
    #[inline(always)]
    fn divide(&mut self, tree: &mut Working<impl Metric>, leaf: u32, rng: &mut Stream) -> bool {
        let Node { aabb, area, children: [_, object], parent, .. } = tree.nodes[leaf as usize];
        if parent == ANCHOR || self.count >= self.splits.most {
            return false;
        }
        self.find_planes(tree, leaf);
        if self.planes.is_empty() {
            return false;
        }
        let (axis, plane) = self.planes[rng.random_range(0..self.planes.len())];
        let parts = Aabb::from(&aabb)
            .halves(axis, plane)
            .map(|region| self.splits.objects.clip(object, &region));
        // One side is empty, so the plane divides the box but not the object.
        if parts.contains(&Aabb::EMPTY) {
            return false;
        }
        let parts = parts.map(|part| PackedAabb::from(&part));
        let areas = parts.map(|part| tree.metric().of(&part));
        let price = self.price(tree);
        tree.begin();
        let (saved, sibling, visits) = tree.detach(leaf);
        self.visits += visits;
        let mut limit = self.limit(saved + leaf_cost(tree, area - areas[0] - areas[1]));
        if self.layout.is_none() {
            limit -= price;
        }
        // Even positions without any growth would cost too much.
        if limit <= areas[0] + areas[1] {
            tree.undo();
            return false;
        }
        // Leaves that a reunion has removed are used again, so nodes grow only to the largest
        // number of references.
        let spare = self.spares.last().copied().unwrap_or_else(|| {
            let spare = tree.push_spare(object);
            self.ring.resize(tree.nodes.len(), NONE);
            self.spares.push(spare);
            spare
        });
        for (side, leaf) in [leaf, spare].into_iter().enumerate() {
            let part = parts[side];
            let area = areas[side];
            tree.resize_leaf(leaf, object, part, area);
            // The other part will cost at least its area, which tightens the limit of the first
            // search.
            let rest = if side == 0 { areas[1] } else { 0.0 };
            let Some(position) = self.search.position_of_detached(
                tree,
                Scope::ALL,
                (&part, area),
                sibling,
                limit - rest,
            ) else {
                tree.undo();
                return false;
            };
            self.visits += tree.attach(leaf, position.sibling).1;
            limit -= position.cost;
        }
        if !self.accepts(tree, -price) {
            return false;
        }
        // Only an accepted move uses the spare; a rejected move leaves it for the next one.
        self.spares.pop();
        self.ring[spare as usize] = self.ring[leaf as usize];
        self.ring[leaf as usize] = spare;
        self.count += 1;
        true
    }

    /// Returns the saving that a division needs, and the cost that a reunion may have. The number
    /// of references is limited, and the cost only approximates the rays that are traced, so a
    /// division that saves almost nothing is no gain.
    #[inline(always)]
    fn price(&self, tree: &Working<impl Metric>) -> f64 {
        let cost = self.layout.as_ref().map_or(tree.area(), |layout| layout.cost);
        PRICE_OF_A_REFERENCE * cost / self.count as f64
    }

    /// Returns the maximum cost of the new positions, if the removal saved `saved`. With a layout,
    /// the area may rise, because the layout decides.
    #[inline(always)]
    fn limit(&self, saved: f64) -> f64 {
        if self.layout.is_some() { DIVISION_DEARER_BY_AREA * saved } else { saved }
    }

    /// Returns whether the layout, if there is one, becomes more expensive by less than `most`.
    /// Otherwise undoes the change.
    #[inline(always)]
    fn accepts(&mut self, tree: &mut Working<impl Metric>, most: f64) -> bool {
        let accepted = self.layout.as_mut().is_none_or(|layout| layout.accepts(tree, most));
        if !accepted {
            tree.undo();
        }
        accepted
    }

    /// Finds the planes at which to cut a leaf: the planes where an ancestor would end without the
    /// leaf, and the middle of the leaf's longest side.
    #[inline(always)]
    fn find_planes(&mut self, tree: &Working<impl Metric>, leaf: u32) {
        let item = tree.nodes[leaf as usize].aabb;
        let [negated_low, high] = item.planes();
        self.planes.clear();
        let mut below = leaf;
        let mut index = tree.nodes[leaf as usize].parent;
        let mut rest = PackedAabb::EMPTY;
        for _ in 0..LEVELS_OF_PLANES {
            // Once the rest covers the leaf, no ancestor further up is larger because of it.
            if index == ANCHOR || rest.union(&item) == rest {
                break;
            }
            rest.grow(&tree.nodes[tree.nodes[index as usize].other(below) as usize].aabb);
            let [negated_rest_low, rest_high] = rest.planes();
            for axis in 0..3 {
                for plane in [-negated_rest_low[axis], rest_high[axis]] {
                    if -negated_low[axis] < plane && plane < high[axis] {
                        self.planes.push((axis, plane));
                    }
                }
            }
            self.visits += 1;
            (below, index) = (index, tree.nodes[index as usize].parent);
        }
        let aabb = Aabb::from(&item);
        let axis = aabb.longest_axis();
        let middle = (0.5 * aabb.doubled_centroid()[axis]) as f32;
        if aabb.min[axis] < middle && middle < aabb.max[axis] {
            self.planes.push((axis, middle));
        }
    }
}

fn leaf_cost<A: Metric>(tree: &Working<A>, area: f64) -> f64 {
    tree.metric().leaf_cost() * area
}

with_vector_instructions! {
    /// The moves of [`Divider::pass`].
    change = change_plain<A: Metric>(
        divider: &mut Divider<'_>, tree: &mut Working<A>, quota: Quota, rng: &mut Stream, observer: &dyn Observer)
        -> Tally
}

#[inline(always)]
fn change_plain<A: Metric>(
    divider: &mut Divider<'_>,
    tree: &mut Working<A>,
    quota: Quota,
    rng: &mut Stream,
    observer: &dyn Observer,
) -> Tally {
    let mut done = Tally::default();
    let before = divider.work();
    let mut poll = WORK_PER_POLL;
    let mut is_over = |divider: &Divider, done: &mut Tally| {
        done.work = divider.work() - before;
        let polled = done.work >= poll;
        if polled {
            poll = done.work + WORK_PER_POLL;
        }
        quota.is_reached(done) || polled && observer.cancelled()
    };
    // Leaves are drawn by the square root of their area, like the nodes of other moves: large
    // leaves gain most. The tiny summand keeps points drawable.
    let mut sums = Vec::with_capacity(tree.nodes.len());
    let mut sum = 0.0;
    let leaves: Vec<u32> = (1..tree.nodes.len() as u32)
        .filter(|&index| tree.nodes[index as usize].is_leaf())
        .collect();
    for &leaf in &leaves {
        // The leaf with the higher index leaves the tree, so every pair is tried from one side
        // only.
        loop {
            let other = divider.ring[leaf as usize];
            if other == NONE || other <= leaf || is_over(divider, &mut done) {
                break;
            }
            done.moves += 1;
            if !divider.reunite(tree, leaf, other) {
                break;
            }
            divider.ring[other as usize] = NONE;
            done.kept += 1;
        }
    }
    for &leaf in &leaves {
        let out = divider.ring[leaf as usize] == NONE;
        sum += if out { 0.0 } else { tree.nodes[leaf as usize].area.sqrt() + f64::MIN_POSITIVE };
        sums.push(sum);
    }
    while !leaves.is_empty() && divider.count < divider.splits.most && !is_over(divider, &mut done)
    {
        let drawn = rng.random::<f64>() * sum;
        let leaf = leaves[sums.partition_point(|&sum| sum <= drawn).min(leaves.len() - 1)];
        done.moves += 1;
        divider.visits += 1;
        if divider.ring[leaf as usize] != NONE {
            done.kept += u64::from(divider.divide(tree, leaf, rng));
        }
    }
    done
}

#[cfg(test)]
mod tests;
