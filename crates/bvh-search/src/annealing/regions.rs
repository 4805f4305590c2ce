//! Annealing and local search in disjoint regions of a tree in parallel, with the same result on
//! any number of threads.
//!
//! ```text
//!             ·                 the top: a small tree whose leaves are subtrees
//!          /     \
//!        ·         ·
//!      /   \     /   \
//!     △     ·   ·     △         subtrees: contiguous nodes of a tree in preorder
//!          / \ / \
//!         △  △ △  △             near a border, the top reaches down to small subtrees
//! ```
//!
//! A region keeps its objects while it changes, and so its box. All regions, the top included,
//! therefore change at the same time. Nothing moves between two subtrees except in the top, so the
//! top also contains what is near the border between two of its halves. Every round cuts regions of
//! another size.

use super::layout::Layout;
use super::metropolis::{self, Mover};
use super::node_sampler;
use super::references::{Divider, price};
use crate::local::reinsertion;
use crate::parallel;
use crate::run::{Observer, Quota, Splits, Stream, Tally, stream};
use crate::tree::{ANCHOR, Metric, NONE, Node, Working};
use crate::tuning::{LARGEST_TOP, SMALLEST_SUBTREES, WHOLE_PASSES};
use bvh_core::PackedAabb;
use bvh_core::cost::{LayoutCost, Sum};
use rand::RngExt;
use std::ops::Range;

/// Random streams per round: one for the whole tree, one for every region.
pub(crate) const STREAMS: u64 = 1 << 24;

/// Makes one round of annealing, in about `count` regions if more than one. The `tree` is in
/// preorder before, and after unless the observer cancels.
pub(crate) fn cool<M: Mover>(
    mover: &(impl Fn() -> M + Sync),
    tree: &mut Working<impl Metric>,
    heat: [f64; 2],
    quota: Quota,
    count: u32,
    [seed, first]: [u64; 2],
    observer: &dyn Observer,
) -> Tally {
    let mut rng = stream(seed, first);
    if count <= 1 {
        let done = metropolis::cool(&mut mover(), tree, heat, quota, &mut rng, observer);
        // A cancelled search must return soon, and every later round would sort first.
        if !observer.cancelled() {
            tree.sort_in_preorder();
        }
        return done;
    }
    // A different size in every round moves the borders.
    let smaller = SMALLEST_SUBTREES + (1.0 - SMALLEST_SUBTREES) * rng.random::<f64>();
    let most = (smaller * tree.nodes.len() as f64 / f64::from(count)) as usize;
    in_regions(tree, Cut { most, borders: true }, quota, &|place, region, quota| {
        let mut mover = mover();
        if place.number == 0 {
            mover.above(|| place.layouts());
        }
        // A stream per region, not per thread: the result must not depend on the schedule of
        // threads.
        let rng = &mut stream(seed, first + 1 + place.number as u64);
        metropolis::cool(&mut mover, region, heat, quota, rng, observer)
    })
}

/// Improves a `tree` in preorder to a local optimum of reinsertion, first in about `count` regions
/// if more than one.
pub(crate) fn to_local_optimum(
    tree: &mut Working<impl Metric>,
    count: u32,
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let mut done = Tally::default();
    if count > 1 {
        let [work, moves] = [quota.work, quota.moves].map(|limit| limit - limit / WHOLE_PASSES);
        done += reinsert(tree, count, Quota { work, moves }, observer);
    }
    done += reinsertion::to_local_optimum(tree, quota.less(&done), observer);
    done
}

/// Improves about `count` regions of a `tree` in preorder, each to a local optimum of reinsertion.
pub(crate) fn reinsert(
    tree: &mut Working<impl Metric>,
    count: u32,
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let most = tree.nodes.len() / count as usize;
    in_regions(tree, Cut { most, borders: true }, quota, &|_, region, quota| {
        reinsertion::to_local_optimum(region, quota, observer)
    })
}

/// Divides and reunites the references of a `tree` in preorder, in about `count` regions if more
/// than one. `cost` is the cost of the tree.
pub(crate) fn divide(
    tree: &mut Working<impl Metric>,
    (splits, by_layout, cost): (Splits, bool, f64),
    quota: Quota,
    count: u32,
    rng: &mut Stream,
    observer: &dyn Observer,
) -> Tally {
    if count <= 1 {
        return Divider::new(splits, by_layout).pass(tree, quota, rng, observer);
    }
    let seed = rng.random();
    let price = price(cost, tree.objects());
    let spare = splits.most.saturating_sub(tree.objects());
    let smaller = SMALLEST_SUBTREES + (1.0 - SMALLEST_SUBTREES) * rng.random::<f64>();
    let most = (smaller * tree.nodes.len() as f64 / f64::from(count)) as usize;
    in_regions(tree, Cut { most, borders: false }, quota, &|place, region, quota| {
        // The leaves of the top are subtrees, not objects.
        if place.number == 0 {
            return Tally::default();
        }
        let most = region.objects() + (spare as f64 * place.part) as usize;
        let mut divider = Divider::of_region(Splits { most, ..splits }, by_layout, price);
        let rng = &mut stream(seed, place.number as u64);
        divider.pass(region, quota, rng, observer)
    })
}

/// Where to cut a tree.
#[derive(Clone, Copy)]
struct Cut {
    /// Maximum number of nodes of a subtree.
    most: usize,
    /// True if the top contains what is near its borders.
    borders: bool,
}

/// Changes all regions of a tree in preorder at the same time, and joins them. `change` receives
/// the place of a region, the region, and a part of the quota in proportion to the region's weight,
/// the sum of the [weights](node_sampler::weight) of its nodes.
fn in_regions<A: Metric>(
    tree: &mut Working<A>,
    cut: Cut,
    quota: Quota,
    change: &(impl Fn(&Place<A>, &mut Working<A>, Quota) -> Tally + Sync + Send),
) -> Tally {
    let (top, subtrees) = cut.top(tree);
    let shared = &*tree;
    // A leaf or a pair has only one form.
    let large: Vec<Subtree> = subtrees
        .iter()
        .copied()
        .filter(|subtree| subtree.len() > 4)
        .collect();
    let mut weights = parallel::map(large.len() + 1, |number| match number {
        0 => weight(&top, 1..top.nodes.len() as u32),
        _ => weight(shared, large[number - 1].root..large[number - 1].end),
    });
    if top.objects() < 3 {
        weights[0] = 0.0;
    }
    let all: f64 = weights.iter().sum();
    let mut regions = parallel::map(weights.len(), |number| {
        let mut region = match number {
            0 => top.clone(),
            _ => large[number - 1].take(shared),
        };
        let part = weights[number] / all;
        let work = (quota.work as f64 * part) as u64;
        let moves = quota.moves / weights.len() as u64;
        let place = Place { number, tree: shared, subtrees: &subtrees, part };
        let mut tally = Tally::default();
        if part > 0.0 {
            tally = change(&place, &mut region, Quota { work, moves });
        }
        region.sort_in_preorder();
        (region, tally)
    });
    let mut done = Tally::default();
    for (_, tally) in &regions {
        done += *tally;
    }
    let below = regions.split_off(1);
    let (top, _) = &regions[0];
    join(tree, top, &subtrees, &below);
    done
}

/// Returns the sum of the weights of some nodes.
fn weight(tree: &Working<impl Metric>, nodes: Range<u32>) -> f64 {
    nodes
        .map(|index| node_sampler::weight(tree, index))
        .sum()
}

/// The place of a region in its tree.
struct Place<'a, A> {
    /// 0 is the top.
    number: usize,
    tree: &'a Working<A>,
    subtrees: &'a [Subtree],
    /// The region's part of the weight of all regions.
    part: f64,
}

impl<A: Metric> Place<'_, A> {
    /// Returns the costs of the layouts of all subtrees. O(nodes).
    fn layouts(&self) -> Vec<LayoutCost> {
        parallel::map(self.subtrees.len(), |number| {
            let Subtree { root, end } = self.subtrees[number];
            Layout::of_subtree(self.tree, root..end)
        })
    }
}

/// A subtree of a tree in preorder: the nodes `root..end`.
#[derive(Clone, Copy, Debug)]
struct Subtree {
    root: u32,
    end: u32,
}

/// A subtree that the cut has not visited.
struct Pending {
    subtree: Subtree,
    parent: u32,
    side: usize,
    /// The borders near the subtree's box: the boxes on their other sides.
    borders: Range<usize>,
}

impl Cut {
    /// Returns the top, whose objects are the numbers of subtrees, and the subtrees. Takes time in
    /// proportion to the nodes of the top.
    fn top<A: Metric>(self, tree: &Working<A>) -> (Working<A>, Vec<Subtree>) {
        let mut nodes = vec![Node { children: [NONE; 2], ..tree.nodes[ANCHOR as usize] }];
        let mut subtrees = Vec::new();
        let largest_top = (LARGEST_TOP * tree.nodes.len() as f64) as usize;
        let mut stack = Vec::new();
        let mut boxes: Vec<PackedAabb> = Vec::new();
        if let Some(root) = tree.root() {
            let subtree = Subtree { root, end: tree.nodes.len() as u32 };
            stack.push(Pending { subtree, parent: ANCHOR, side: 0, borders: 0..0 });
        }
        while let Some(Pending { subtree, parent, side, borders }) = stack.pop() {
            // Boxes after these belonged to subtrees that have been visited.
            boxes.truncate(borders.end);
            let place = nodes.len() as u32;
            let node = tree.nodes[subtree.root as usize];
            nodes[parent as usize].children[side] = place;
            let is_large = subtree.len() > self.most;
            let is_at_border = !borders.is_empty() && nodes.len() < largest_top;
            if node.is_leaf() || !is_large && !is_at_border {
                let children = [NONE, subtrees.len() as u32];
                nodes.push(Node { parent, children, stamp: 0, ..node });
                subtrees.push(subtree);
                continue;
            }
            nodes.push(Node { parent, stamp: 0, ..node });
            // The left subtree ends where the right one begins, because the nodes are in preorder.
            let [left, right] = node.children;
            let halves =
                [Subtree { root: left, end: right }, Subtree { root: right, end: subtree.end }];
            // If the top cannot grow further, another half is first in every size of regions.
            let last = (subtree.root as usize ^ self.most) & 1;
            for side in [last, 1 - last] {
                let half = halves[side];
                let aabb = &tree.nodes[half.root as usize].aabb;
                let start = boxes.len();
                for index in borders.clone() {
                    let other = boxes[index];
                    if is_near(aabb, &other) {
                        boxes.push(other);
                    }
                }
                if is_large && self.borders {
                    boxes.push(tree.nodes[halves[1 - side].root as usize].aabb);
                }
                let borders = start..boxes.len();
                stack.push(Pending { subtree: half, parent: place, side, borders });
            }
        }
        (Working::from_nodes(nodes, tree.metric()), subtrees)
    }
}

/// Returns whether a box is no further from another than its own extent, along every axis.
fn is_near(aabb: &PackedAabb, other: &PackedAabb) -> bool {
    // In f64 nothing overflows, so the scale of the scene has no effect.
    let [negated_low, high] = aabb.planes().map(|corner| corner.map(f64::from));
    let [other_negated_low, other_high] = other.planes().map(|corner| corner.map(f64::from));
    (0..3).all(|axis| {
        let extent = high[axis] + negated_low[axis];
        -negated_low[axis] - extent <= other_high[axis]
            && -other_negated_low[axis] - extent <= high[axis]
    })
}

impl Subtree {
    /// The number of nodes.
    fn len(&self) -> usize {
        (self.end - self.root) as usize
    }

    /// Copies the subtree into a separate tree.
    fn take<A: Metric>(&self, tree: &Working<A>) -> Working<A> {
        let range = self.root as usize..self.end as usize;
        let mut nodes = Vec::with_capacity(range.len() + 1);
        nodes.push(Node { children: [1, NONE], ..tree.nodes[ANCHOR as usize] });
        nodes.extend(
            tree.nodes[range]
                .iter()
                .map(|node| moved(node, |index| index.wrapping_sub(self.root - 1))),
        );
        nodes[1].parent = ANCHOR;
        Working::from_nodes(nodes, tree.metric())
    }
}

/// Returns the node with all its links mapped.
fn moved(node: &Node, place: impl Fn(u32) -> u32) -> Node {
    let children = if node.is_leaf() { node.children } else { node.children.map(&place) };
    let parent = if node.parent == ANCHOR { ANCHOR } else { place(node.parent) };
    Node { children, parent, ..*node }
}

/// Replaces `tree` by the tree with this `top`, whose leaves are the `subtrees` of `tree`. The
/// large subtrees have changed and are in `below`. All are in preorder, and so is the result.
fn join<A: Metric>(
    tree: &mut Working<A>,
    top: &Working<A>,
    subtrees: &[Subtree],
    below: &[(Working<A>, Tally)],
) {
    let mut changed = below.iter().map(|(region, _)| region);
    // The nodes of every subtree, and the index of the first in the tree where they are.
    let sources: Vec<(&[Node], u32, f64)> = subtrees
        .iter()
        .map(|subtree| match subtree.len() {
            0..=4 => {
                let nodes = &tree.nodes[subtree.root as usize..subtree.end as usize];
                let area = nodes.iter().filter_map(Working::<A>::part).sum();
                (nodes, subtree.root, area)
            }
            _ => {
                let region = changed
                    .next()
                    .expect("a region for every large subtree");
                (&region.nodes[1..], 1, region.area())
            }
        })
        .collect();
    let source = |node: &Node| sources[node.children[1] as usize];
    let mut places = vec![ANCHOR; top.nodes.len()];
    let mut next = 1;
    for (node, place) in top.nodes.iter().zip(&mut places).skip(1) {
        *place = next;
        next += if node.is_leaf() { source(node).0.len() as u32 } else { 1 };
    }
    let mut nodes = vec![tree.nodes[ANCHOR as usize]; next as usize];
    nodes[ANCHOR as usize].children[0] = 1;
    let mut area = Sum::default();
    // Every subtree has its own part of the nodes, so that threads can write at the same time.
    let mut copies = Vec::with_capacity(subtrees.len());
    let (_, mut rest) = nodes.split_at_mut(1);
    for (node, &place) in top.nodes.iter().zip(&places).skip(1) {
        let parent = places[node.parent as usize];
        let count = if node.is_leaf() { source(node).0.len() } else { 1 };
        let (to, after) = rest.split_at_mut(count);
        rest = after;
        if node.is_leaf() {
            area.add(source(node).2);
            copies.push((to, source(node), place, parent));
        } else {
            area.add(node.area);
            to[0] = Node { parent, ..moved(node, |index| places[index as usize]) };
        }
    }
    parallel::for_each(copies, |(to, (from, first, _), place, parent)| {
        for (to, node) in to.iter_mut().zip(from) {
            *to = moved(node, |index| index.wrapping_sub(first).wrapping_add(place));
        }
        // The root's link leads out of the subtree.
        to[0].parent = parent;
    });
    *tree = Working::with_area(nodes, tree.metric(), area.value());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;
    use bvh_core::validate;

    #[test]
    fn subtrees_are_disjoint_and_joining_them_restores_the_tree() {
        let boxes = scatter(3000);
        let mut tree = built(&muller_fellner::Config::default(), &boxes);
        tree.sort_in_preorder();
        for borders in [false, true] {
            for most in [0, 1, 40, 200, 2000, 5998, 5999] {
                let (top, subtrees) = Cut { most, borders }.top(&tree);
                assert_eq!(top.objects(), subtrees.len());
                let objects: usize = subtrees
                    .iter()
                    .map(|subtree| subtree.len().div_ceil(2))
                    .sum();
                assert_eq!(objects, boxes.len());
                assert!(
                    subtrees
                        .windows(2)
                        .all(|pair| pair[0].root != pair[1].root)
                );
                let mut again = tree.clone();
                let quota = Quota { work: 1 << 20, moves: u64::MAX };
                let count = |_: &Place<_>, _: &mut Working<_>, quota: Quota| Tally {
                    work: quota.work,
                    ..Tally::default()
                };
                let tally = in_regions(&mut again, Cut { most, borders }, quota, &count);
                assert!(tally.work <= quota.work && tally.work > quota.work / 2);
                assert_eq!(again.to_bvh(), tree.to_bvh());
                assert!((again.area() - tree.area()).abs() <= 1e-12 * tree.area());
            }
        }
    }

    #[test]
    fn regions_improve_a_tree_and_keep_it_valid() {
        let boxes = scatter(3000);
        let mut tree = built(&muller_fellner::Config::default(), &boxes);
        tree.sort_in_preorder();
        let before = tree.area();
        let tally = reinsert(&mut tree, 16, Quota::ENDLESS, &());
        assert!(tally.kept > 0 && tree.area() < before);
        assert!((tree.area() - tree.internal_area()).abs() <= 1e-12 * before);
        validate(&tree.to_bvh(), &boxes).unwrap();
    }
}
