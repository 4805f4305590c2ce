//! Annealing and local search on disjoint subtrees in parallel, with the same result on any number
//! of threads.
//!
//! Every subtree is a separate small tree while a thread works on it. Every round cuts different
//! subtrees, of a different size, and moves on the whole tree follow, so every node can move
//! everywhere.

use super::metropolis::{self, Mover};
use super::node_sampler;
use crate::local::reinsertion;
use crate::parallel;
use crate::run::{Observer, Quota, Tally, stream};
use crate::tree::{ANCHOR, Metric, NONE, Node, Working};
use crate::tuning::{
    BELOW_SUBTREE_ROOTS, LEAST_SUBTREE, MOVES_AT_BORDERS, SMALLEST_SUBTREES, WHOLE_TREE,
};
use rand::RngExt;

/// Random streams per round: one for the whole tree, one for every subtree.
pub(crate) const STREAMS: u64 = 1 << 24;

pub(crate) struct Round {
    /// The first and the last temperature.
    pub heat: [f64; 2],
    pub quota: Quota,
    /// The number of subtrees, about.
    pub count: u32,
    /// The seed, and the number of the first random stream.
    pub streams: [u64; 2],
}

/// Makes one round of annealing: first on the subtrees, if more than one, each with a new `mover`,
/// then on the whole tree, where moves begin near the nodes outside all subtrees. The `tree` is in
/// preorder before, and after unless the observer cancels.
pub(crate) fn cool<M: Mover>(
    round: &Round,
    mover: &(impl Fn() -> M + Sync),
    whole: &mut M,
    tree: &mut Working<impl Metric>,
    observer: &dyn Observer,
) -> Tally {
    let Round { heat, quota, count, streams: [seed, first] } = *round;
    let mut rng = stream(seed, first);
    let mut done = Tally::default();
    let mut near = Vec::new();
    if count > 1 && tree.objects() as f64 >= f64::from(count) * f64::from(LEAST_SUBTREE) {
        // A different size in every round moves the borders, across which nothing moves.
        let smaller = SMALLEST_SUBTREES + (1.0 - SMALLEST_SUBTREES) * rng.random::<f64>();
        let cut = cut(tree, smaller / f64::from(count), |index| node_sampler::weight(tree, index));
        let in_subtrees: f64 = cut.subtrees.iter().map(|subtree| subtree.weight).sum();
        let quota_of = |subtree: &Subtree| {
            let work = quota.work as f64 * (1.0 - cut.whole_tree) * (subtree.weight / in_subtrees);
            Quota { work: work as u64, moves: quota.moves / (cut.subtrees.len() as u64 + 1) }
        };
        done += improve_each(tree, &cut.subtrees, observer, |number, small| {
            // A stream per subtree, not per thread: the result must not depend on the schedule of
            // threads.
            let rng = &mut stream(seed, first + 1 + number as u64);
            let quota = quota_of(&cut.subtrees[number]);
            metropolis::cool(&mut mover(), small, Vec::new(), heat, quota, rng, observer)
        });
        near = cut.starts;
    }
    done += metropolis::cool(whole, tree, near, heat, quota.less(&done), &mut rng, observer);
    // A cancelled search must return soon, and every later round would sort first.
    if !observer.cancelled() {
        tree.sort_in_preorder();
    }
    done
}

/// Improves a `tree` in preorder to a local optimum of reinsertion, first on about `count`
/// subtrees, if more than one.
pub(crate) fn to_local_optimum(
    tree: &mut Working<impl Metric>,
    count: u32,
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let mut done = Tally::default();
    if count > 1 {
        let Cut { subtrees, .. } = cut(tree, 1.0 / f64::from(count), |_| 1.0);
        // One half of the quota for all subtrees together, one for the whole tree.
        let parts = 2 * subtrees.len().max(1) as u64;
        let share = Quota { work: quota.work / parts, moves: quota.moves / parts };
        done += improve_each(tree, &subtrees, observer, |_, small| {
            reinsertion::to_local_optimum(small, share, observer)
        });
    }
    done += reinsertion::to_local_optimum(tree, quota.less(&done), observer);
    done
}

/// A subtree of a tree in preorder. Its nodes are contiguous.
#[derive(Clone, Copy, Debug)]
struct Subtree {
    root: u32,
    nodes: u32,
    /// Sum of the weights of its nodes.
    weight: f64,
}

/// The subtrees of a round, and the rest of the tree.
struct Cut {
    /// Disjoint, in the order of their nodes.
    subtrees: Vec<Subtree>,
    /// The nodes that are outside all subtrees or near the root of one.
    starts: Vec<u32>,
    /// The part of a round's work that moves on the whole tree get.
    whole_tree: f64,
}

/// Returns the largest subtrees of a tree in preorder that each have at most the fraction `most` of
/// its weight, except tiny ones. O(n).
fn cut(tree: &Working<impl Metric>, most: f64, weight: impl Fn(u32) -> f64) -> Cut {
    // Weights of subtrees.
    let mut totals = vec![0.0; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().skip(1).rev() {
        totals[index] = weight(index as u32);
        if !node.is_leaf() {
            for child in node.children {
                totals[index] += totals[child as usize];
            }
        }
    }
    let all = tree.root().map_or(0.0, |root| totals[root as usize]);
    // The level in a subtree, 1 for its root; 0 outside all subtrees.
    let mut depths = vec![0u8; tree.nodes.len()];
    let mut subtrees: Vec<Subtree> = vec![];
    let mut starts = vec![];
    let mut of_starts = 0.0;
    for (index, node) in (0..).zip(&tree.nodes).skip(1) {
        let above = depths[node.parent as usize];
        let total = totals[index as usize];
        if above > 0 {
            depths[index as usize] = above.saturating_add(1);
            if let Some(subtree) = subtrees.last_mut() {
                subtree.nodes += 1;
            }
        } else if total <= most * all {
            depths[index as usize] = 1;
            subtrees.push(Subtree { root: index, nodes: 1, weight: total });
        }
        if depths[index as usize] <= BELOW_SUBTREE_ROOTS {
            starts.push(index);
            of_starts += weight(index);
        }
    }
    // A smaller subtree is left to the moves on the whole tree.
    subtrees.retain(|subtree| subtree.nodes >= 2 * LEAST_SUBTREE);
    let whole_tree = (MOVES_AT_BORDERS * of_starts / all).min(WHOLE_TREE);
    Cut { subtrees, starts, whole_tree }
}

/// Improves a copy of every subtree, given its number, and puts it back in preorder; then the full
/// tree is in preorder, too. A cancelled search leaves the rest of the subtrees as they are.
fn improve_each<A: Metric>(
    tree: &mut Working<A>,
    subtrees: &[Subtree],
    observer: &dyn Observer,
    improve: impl Fn(usize, &mut Working<A>) -> Tally + Send + Sync,
) -> Tally {
    let metric = tree.metric();
    let mut tasks = Vec::with_capacity(subtrees.len());
    let mut rest = &mut tree.nodes[..];
    let mut first = 0;
    for (number, subtree) in subtrees.iter().enumerate() {
        let (_, from) = rest.split_at_mut((subtree.root - first) as usize);
        let (nodes, after) = from.split_at_mut(subtree.nodes as usize);
        tasks.push((number, nodes));
        rest = after;
        first = subtree.root + subtree.nodes;
    }
    let improved = parallel::map(tasks, |(number, nodes)| {
        // A cancelled search must return soon, and no move would change the copy.
        if observer.cancelled() {
            return Tally::default();
        }
        let subtree = &subtrees[number];
        let mut small = subtree.take(nodes, metric);
        let tally = improve(number, &mut small);
        subtree.put_back(nodes, &small);
        tally
    });
    let mut done = Tally::default();
    improved.into_iter().for_each(|tally| done += tally);
    // Sums of differences would gather the errors of all rounds.
    tree.forget_changes();
    done
}

impl Subtree {
    /// Copies the subtree, whose nodes are these, into a separate tree.
    fn take<A: Metric>(&self, nodes: &[Node], metric: A) -> Working<A> {
        let place = |index: u32| index.wrapping_sub(self.root - 1);
        let mut copy = Vec::with_capacity(nodes.len() + 1);
        copy.push(Node { children: [1, NONE], ..Node::ANCHOR });
        copy.extend(nodes.iter().map(|node| {
            let children = if node.is_leaf() { node.children } else { node.children.map(place) };
            Node { children, parent: place(node.parent), stamp: 0, ..*node }
        }));
        copy[1].parent = ANCHOR;
        Working::from_nodes(copy, metric)
    }

    /// Copies a tree, in preorder, to the nodes of the subtree that it was taken from.
    fn put_back(&self, nodes: &mut [Node], small: &Working<impl Metric>) {
        // The root's link leads out of the subtree.
        let above = nodes[0].parent;
        small.visit_in_preorder(|index, place, parent, side| {
            let node = &small.nodes[index as usize];
            let parent = parent + self.root - 1;
            nodes[place as usize - 1] = Node { parent, stamp: 0, ..*node };
            // The place of the small tree's anchor is not in the subtree.
            if place > 1 {
                nodes[(parent - self.root) as usize].children[side] = place + self.root - 1;
            }
        });
        nodes[0].parent = above;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;

    #[test]
    fn subtrees_are_disjoint_and_putting_them_back_restores_the_tree() {
        let boxes = scatter(3000);
        let mut tree = built(&muller_fellner::Config::default(), &boxes);
        tree.sort_in_preorder();
        for most in [0.007, 0.03, 0.3, 0.99] {
            let Cut { subtrees, starts, whole_tree } = cut(&tree, most, |_| 1.0);
            let of_starts = starts.len() as f64 / 5999.0;
            assert_eq!(whole_tree, WHOLE_TREE.min(MOVES_AT_BORDERS * of_starts));
            assert!(subtrees.windows(2).all(|pair| pair[0].root + pair[0].nodes <= pair[1].root));
            assert!(subtrees.iter().all(|subtree| f64::from(subtree.nodes) <= most * 5999.0
                && starts.contains(&subtree.root)));
            assert!(
                subtrees
                    .iter()
                    .all(|subtree| f64::from(subtree.nodes).to_bits() == subtree.weight.to_bits())
            );
            let covered: u32 = subtrees.iter().map(|subtree| subtree.nodes).sum();
            assert!(covered > if most > 0.01 { 3000 } else { 1000 }, "{covered}");
            let mut again = tree.clone();
            let tally = improve_each(&mut again, &subtrees, &(), |number, small| {
                assert_eq!(small.nodes.len(), subtrees[number].nodes as usize + 1);
                Tally { work: 1, ..Tally::default() }
            });
            assert_eq!(tally.work, subtrees.len() as u64);
            assert_eq!(again.to_bvh(), tree.to_bvh());
            assert!((again.area() - tree.area()).abs() <= 1e-12 * tree.area());
        }
    }
}
