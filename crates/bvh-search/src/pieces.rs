//! Work on disjoint subtrees of a tree at once, with the same result on any number of threads.
//!
//! Every piece is a small tree of its own while it is worked on. Pieces are cut anew every round, at another size, and
//! between rounds moves have the whole tree, so that everything can move everywhere.

use crate::cooling::{Move, cool};
use crate::starts::{self, Starts};
use crate::stream::stream;
use crate::working::{ANCHOR, NONE, Node, Working};
use crate::{Observer, Quota, Tally, reinsertion};
use rand::RngExt;

/// Streams of random numbers per round: one for the whole tree, one for every piece.
pub(crate) const STREAMS: u64 = 1 << 24;

/// Smaller subtrees are not worked on alone.
const LEAST: u32 = 16;

/// The part of the work that is done on the whole tree: 1/16 was worse at equal work, 1/4 not better.
const WHOLE: f64 = 0.125;

/// How many levels below the roots of the pieces moves on the whole tree may begin.
const BELOW: u8 = 6;

/// One round of cooling of a `tree` in preorder, which it is again in the end: at first in about so many pieces, if
/// more than one, then as a whole, where the moves begin near the nodes that are in no piece.
pub(crate) fn cool_in_pieces<M: Move>(
    mover: &(impl Fn() -> M + Sync),
    tree: &mut Working,
    heat: [f64; 2],
    quota: Quota,
    pieces: u32,
    [seed, first]: [u64; 2],
    observer: &dyn Observer,
) -> Tally {
    let (mut rng, mut whole, mut done) = (stream(seed, first), mover(), Tally::default());
    if pieces > 1 && tree.objects() as f64 >= f64::from(pieces) * f64::from(LEAST) {
        // At another size in every round, so that other subtrees are at the borders.
        let smaller = 0.5 + 0.5 * rng.random::<f64>();
        let (parts, starts) = cut(tree, smaller / f64::from(pieces), |at| starts::weight(tree, at));
        let all: f64 = parts.iter().map(|part| part.weight).sum();
        let share = |part: &Part| {
            let work = quota.work as f64 * (1.0 - WHOLE) * (part.weight / all);
            Quota { work: work as u64, moves: quota.moves / (parts.len() as u64 + 1) }
        };
        let found = each(&parts, |number, part| {
            let mut piece = part.take(tree);
            let rng = &mut stream(seed, first + 1 + number as u64);
            let tally = cool(&mut mover(), &mut piece, heat, share(part), rng, observer);
            piece.sort_in_preorder();
            (piece, tally)
        });
        done += put_back(tree, &parts, found);
        *whole.starts() = Starts::among(starts);
    }
    done += cool(&mut whole, tree, heat, quota.less(&done), &mut rng, observer);
    tree.sort_in_preorder();
    done
}

/// Sweeps of reinsertion to a local optimum of a `tree` in preorder, at first in pieces, if more than one.
pub(crate) fn descend_in_pieces(
    tree: &mut Working,
    pieces: u32,
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let mut done = Tally::default();
    if pieces > 1 {
        let (parts, _) = cut(tree, 1.0 / f64::from(pieces), |_| 1.0);
        let share = |all: u64| all / (2 * parts.len().max(1) as u64);
        let share = Quota { work: share(quota.work), moves: share(quota.moves) };
        let found = each(&parts, |_, part| {
            let mut piece = part.take(tree);
            let tally = reinsertion::to_local_optimum(&mut piece, share, observer);
            piece.sort_in_preorder();
            (piece, tally)
        });
        done += put_back(tree, &parts, found);
    }
    done += reinsertion::to_local_optimum(tree, quota.less(&done), observer);
    done
}

/// A subtree: its nodes in preorder are these of the tree.
#[derive(Clone, Copy, Debug)]
struct Part {
    root: u32,
    nodes: u32,
    /// That of all these nodes.
    weight: f64,
}

/// The largest subtrees that weigh at most `most` of the whole each, without the smallest, of a tree in preorder; and the
/// nodes that are in none or near the top of one. O(n).
fn cut(tree: &Working, most: f64, weight: impl Fn(u32) -> f64) -> (Vec<Part>, Vec<u32>) {
    let mut totals = vec![(1u32, 0.0); tree.nodes.len()];
    for (at, node) in tree.nodes.iter().enumerate().skip(1).rev() {
        let mut total = (1, weight(at as u32));
        if !node.is_leaf() {
            for (nodes, weight) in node.children.map(|child| totals[child as usize]) {
                total = (total.0 + nodes, total.1 + weight);
            }
        }
        totals[at] = total;
    }
    let most = most * tree.root().map_or(0.0, |root| totals[root as usize].1);
    // The level in a part, 1 for its root; 0 outside.
    let mut depths = vec![0u8; tree.nodes.len()];
    let (mut parts, mut starts) = (vec![], vec![]);
    for (at, node) in (0..).zip(&tree.nodes).skip(1) {
        let above = depths[node.parent as usize];
        let (nodes, weight) = totals[at as usize];
        if above > 0 {
            depths[at as usize] = above.saturating_add(1);
        } else if weight <= most {
            depths[at as usize] = 1;
            if nodes >= 2 * LEAST {
                parts.push(Part { root: at, nodes, weight });
            }
        }
        if depths[at as usize] <= BELOW {
            starts.push(at);
        }
    }
    (parts, starts)
}

impl Part {
    /// A copy as a tree of its own.
    fn take(&self, tree: &Working) -> Working {
        let range = self.root as usize..(self.root + self.nodes) as usize;
        let mut nodes = Vec::with_capacity(range.len() + 1);
        nodes.push(Node { children: [1, NONE], ..tree.nodes[ANCHOR as usize] });
        nodes.extend(tree.nodes[range].iter().map(|node| moved(node, |at| at.wrapping_sub(self.root - 1))));
        nodes[1].parent = ANCHOR;
        Working::from_nodes(nodes)
    }
}

/// The node with all its links changed.
fn moved(node: &Node, place: impl Fn(u32) -> u32) -> Node {
    let children = if node.is_leaf() { node.children } else { node.children.map(&place) };
    let parent = if node.parent == ANCHOR { ANCHOR } else { place(node.parent) };
    Node { children, parent, ..*node }
}

/// Puts trees, in preorder, where they were taken from. O(n).
fn put_back(tree: &mut Working, parts: &[Part], found: Vec<(Working, Tally)>) -> Tally {
    let mut done = Tally::default();
    let mut nodes = std::mem::take(tree).nodes;
    for (part, (piece, tally)) in parts.iter().zip(found) {
        done += tally;
        let to = part.root as usize;
        let parent = nodes[to].parent;
        for (old, new) in nodes[to..].iter_mut().zip(&piece.nodes[1..]) {
            *old = moved(new, |at| at + part.root - 1);
        }
        nodes[to].parent = parent;
    }
    *tree = Working::from_nodes(nodes);
    done
}

/// What `work` finds for each, on all threads of the current pool.
fn each<T: Send>(parts: &[Part], work: impl Fn(usize, &Part) -> T + Send + Sync) -> Vec<T> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        parts.par_iter().enumerate().with_max_len(1).map(|(number, part)| work(number, part)).collect()
    }
    #[cfg(not(feature = "rayon"))]
    parts.iter().enumerate().map(|(number, part)| work(number, part)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;

    #[test]
    fn pieces_are_disjoint_and_putting_them_back_restores_the_tree() {
        let boxes = scatter(3000);
        let mut tree = built(&muller_fellner::Config::default(), &boxes);
        tree.sort_in_preorder();
        for most in [0.007, 0.03, 0.3, 0.99] {
            let (parts, starts) = cut(&tree, most, |_| 1.0);
            assert!(parts.windows(2).all(|pair| pair[0].root + pair[0].nodes <= pair[1].root));
            assert!(
                parts.iter().all(|part| f64::from(part.nodes) <= most * 5999.0 && starts.contains(&part.root))
            );
            assert!(parts.iter().all(|part| f64::from(part.nodes).to_bits() == part.weight.to_bits()));
            let covered: u32 = parts.iter().map(|part| part.nodes).sum();
            assert!(covered > if most > 0.01 { 3000 } else { 1000 }, "{covered}");
            let taken = |part: &Part| (part.take(&tree), Tally { work: 1, ..Tally::default() });
            let mut again = tree.clone();
            let tally = put_back(&mut again, &parts, parts.iter().map(taken).collect());
            assert_eq!(tally.work, parts.len() as u64);
            assert_eq!(again.to_bvh(), tree.to_bvh());
            assert!((again.area() - tree.area()).abs() <= 1e-12 * tree.area());
        }
    }
}
