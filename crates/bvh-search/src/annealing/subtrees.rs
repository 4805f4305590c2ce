//! Annealing and local search on disjoint subtrees in parallel, with the same result on any number
//! of threads.
//!
//! Every subtree is a separate small tree while a thread works on it. Every round cuts different
//! subtrees, of a different size, and moves on the whole tree follow, so every node can move
//! everywhere.

use super::metropolis::{self, Mover};
use super::node_sampler::{self, NodeSampler};
use crate::local::reinsertion;
use crate::parallel;
use crate::run::{Observer, Quota, Tally, stream};
use crate::tree::{ANCHOR, Metric, NONE, Node, Working};
use crate::tuning::{BELOW_SUBTREE_ROOTS, LEAST_SUBTREE, SMALLEST_SUBTREES, WHOLE_TREE};
use rand::RngExt;

/// Random streams per round: one for the whole tree, one for every subtree.
pub(crate) const STREAMS: u64 = 1 << 24;

/// Makes one round of annealing: first on about `count` subtrees, if more than one, then on the
/// whole tree, where moves begin near the nodes outside all subtrees. The `tree` is in preorder
/// before, and after unless the observer cancels.
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
    let mut whole = mover();
    let mut done = Tally::default();
    if count > 1 && tree.objects() as f64 >= f64::from(count) * f64::from(LEAST_SUBTREE) {
        // A different size in every round moves the borders, across which nothing moves.
        let smaller = SMALLEST_SUBTREES + (1.0 - SMALLEST_SUBTREES) * rng.random::<f64>();
        let (subtrees, starts) =
            cut(tree, smaller / f64::from(count), |index| node_sampler::weight(tree, index));
        let all: f64 = subtrees
            .iter()
            .map(|subtree| subtree.weight)
            .sum();
        let share = |subtree: &Subtree| {
            let work = quota.work as f64 * (1.0 - WHOLE_TREE) * (subtree.weight / all);
            Quota { work: work as u64, moves: quota.moves / (subtrees.len() as u64 + 1) }
        };
        let found = parallel::map(subtrees.len(), |number| {
            // A cancelled search must return soon, and no move would change the copy.
            if observer.cancelled() {
                return None;
            }
            let mut small = subtrees[number].take(tree);
            // A stream per subtree, not per thread: the result must not depend on the schedule of
            // threads.
            let rng = &mut stream(seed, first + 1 + number as u64);
            let quota = share(&subtrees[number]);
            let tally = metropolis::cool(&mut mover(), &mut small, heat, quota, rng, observer);
            // Sorted here, in parallel; `put_back` then leaves the full tree in preorder.
            small.sort_in_preorder();
            Some((small, tally))
        });
        done += put_back(tree, &subtrees, found);
        *whole.sampler() = NodeSampler::among(starts);
    }
    done += metropolis::cool(&mut whole, tree, heat, quota.less(&done), &mut rng, observer);
    // A cancelled search must return soon, and every later round would sort first.
    if !observer.cancelled() {
        tree.sort_in_preorder_unless(&|| observer.cancelled());
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
        let (subtrees, _) = cut(tree, 1.0 / f64::from(count), |_| 1.0);
        // One half of the quota for all subtrees together, one for the whole tree.
        let parts = 2 * subtrees.len().max(1) as u64;
        let share = Quota { work: quota.work / parts, moves: quota.moves / parts };
        let found = parallel::map(subtrees.len(), |number| {
            if observer.cancelled() {
                return None;
            }
            let mut small = subtrees[number].take(tree);
            let tally = reinsertion::to_local_optimum(&mut small, share, observer);
            small.sort_in_preorder();
            Some((small, tally))
        });
        done += put_back(tree, &subtrees, found);
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

/// Returns the largest subtrees of a tree in preorder that each have at most the fraction `most` of
/// its weight, except tiny ones; and the nodes that are outside all subtrees or near the root of
/// one. O(n).
fn cut(
    tree: &Working<impl Metric>,
    most: f64,
    weight: impl Fn(u32) -> f64,
) -> (Vec<Subtree>, Vec<u32>) {
    let mut totals = vec![(1u32, 0.0); tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().skip(1).rev() {
        let mut total = (1, weight(index as u32));
        if !node.is_leaf() {
            for (nodes, weight) in node.children.map(|child| totals[child as usize]) {
                total = (total.0 + nodes, total.1 + weight);
            }
        }
        totals[index] = total;
    }
    let most = most
        * tree
            .root()
            .map_or(0.0, |root| totals[root as usize].1);
    // The level in a subtree, 1 for its root; 0 outside all subtrees.
    let mut depths = vec![0u8; tree.nodes.len()];
    let mut subtrees = vec![];
    let mut starts = vec![];
    for (index, node) in (0..).zip(&tree.nodes).skip(1) {
        let above = depths[node.parent as usize];
        let (nodes, weight) = totals[index as usize];
        if above > 0 {
            depths[index as usize] = above.saturating_add(1);
        } else if weight <= most {
            depths[index as usize] = 1;
            // A smaller subtree is left to the moves on the whole tree.
            if nodes >= 2 * LEAST_SUBTREE {
                subtrees.push(Subtree { root: index, nodes, weight });
            }
        }
        if depths[index as usize] <= BELOW_SUBTREE_ROOTS {
            starts.push(index);
        }
    }
    (subtrees, starts)
}

impl Subtree {
    /// Copies the subtree into a separate tree.
    fn take<A: Metric>(&self, tree: &Working<A>) -> Working<A> {
        let range = self.root as usize..(self.root + self.nodes) as usize;
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

/// Puts annealed subtrees, in preorder, back to their place; `None` leaves a subtree as it is. O(n).
fn put_back<A: Metric>(
    tree: &mut Working<A>,
    subtrees: &[Subtree],
    found: Vec<Option<(Working<A>, Tally)>>,
) -> Tally {
    let mut done = Tally::default();
    let mut nodes = std::mem::take(&mut tree.nodes);
    for (subtree, found) in subtrees.iter().zip(found) {
        let Some((small, tally)) = found else { continue };
        done += tally;
        let to = subtree.root as usize;
        // The root's link leads out of the subtree and must survive the copy.
        let parent = nodes[to].parent;
        for (old, new) in nodes[to..].iter_mut().zip(&small.nodes[1..]) {
            *old = moved(new, |index| index + subtree.root - 1);
        }
        nodes[to].parent = parent;
    }
    *tree = Working::from_nodes(nodes, tree.metric());
    done
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
            let (subtrees, starts) = cut(&tree, most, |_| 1.0);
            assert!(
                subtrees
                    .windows(2)
                    .all(|pair| pair[0].root + pair[0].nodes <= pair[1].root)
            );
            assert!(
                subtrees
                    .iter()
                    .all(|subtree| f64::from(subtree.nodes) <= most * 5999.0
                        && starts.contains(&subtree.root))
            );
            assert!(
                subtrees
                    .iter()
                    .all(|subtree| f64::from(subtree.nodes).to_bits() == subtree.weight.to_bits())
            );
            let covered: u32 = subtrees.iter().map(|subtree| subtree.nodes).sum();
            assert!(covered > if most > 0.01 { 3000 } else { 1000 }, "{covered}");
            let taken = |subtree: &Subtree| {
                Some((subtree.take(&tree), Tally { work: 1, ..Tally::default() }))
            };
            let mut again = tree.clone();
            let tally = put_back(&mut again, &subtrees, subtrees.iter().map(taken).collect());
            assert_eq!(tally.work, subtrees.len() as u64);
            put_back(&mut again, &subtrees, vec![None; subtrees.len()]);
            assert_eq!(again.to_bvh(), tree.to_bvh());
            assert!((again.area() - tree.area()).abs() <= 1e-12 * tree.area());
        }
    }
}
