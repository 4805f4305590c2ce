//! Reinsertion: removes one subtree at a time and inserts it where it costs least, until a local
//! optimum.
//!
//! Bittner, Hapala & Havran 2013; the position search of Meister & Bittner 2018.
//!
//! The removal of X takes its parent P out of the tree, too, and its sibling S moves up. Every box
//! above shrinks to what is left. An insertion next to Y puts a new node J around both, and every
//! box above J grows. With A(·) for the half area, and for the boxes that X alone makes larger:
//!
//! ```text
//!          R                            R
//!        /   \                        /   \           saved:  A(P) + A(R) − A(R without X)
//!       P     Q        ─────→        S     Q          added:  A(J) + A(Q with X) − A(Q)
//!      / \   / \                          / \                   + A(R) − A(R without X)
//!     X   S Y   Z                        J   Z
//!                                       / \           The move pays if it saves more than it adds.
//!                                      X   Y
//! ```
//!
//! Both sums are the same kind: the cost of a position, which `PositionSearch` finds by branch
//! and bound over the whole tree while X stays where it is (`position_of_attached`). The move is
//! made by `Working::detach` and `Working::attach`.
//!
//! Differs from the papers: the search is exact and sequential, every node is tried, and the method
//! ends only when a full pass over the tree finds no improvement.

use super::TOLERANCE;
use super::incumbent::Incumbent;
use crate::run::{Found, Observer, Problem, Quota, Run, Tally, WORK_PER_POLL};
use crate::tree::{ANCHOR, Metric, PositionSearch, Working, search_by_metric};
use bvh_core::with_vector_instructions;

bvh_config::config! {
    /// Without parameters.
    pub struct Config {}
}

search_by_metric!(Config);

impl Config {
    fn search_by(&self, metric: impl Metric, problem: &Problem, _: u64, run: &mut Run) -> Found {
        let (mut best, mut tree) = Incumbent::build(problem, metric, run)?;
        best.improve(&mut tree, run, pass_by_area);
        Ok(best.tree)
    }
}

/// Performs one [`pass`] over all nodes, the largest first.
pub(crate) fn pass_by_area(
    tree: &mut Working<impl Metric>,
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    // The order of a large tree takes a second, which a cancelled search does not have.
    if observer.cancelled() {
        return Tally::default();
    }
    let mut order = tree.preorder();
    // The sort is stable. Areas are never negative, so their inverted bits are in reverse order. A
    // key is read from memory once and not at every comparison, which in large trees takes most of
    // the time.
    order.sort_by_cached_key(|&index| !tree.nodes[index as usize].area.to_bits());
    pass(tree, &order, quota, observer)
}

/// Repeats passes by area until a local optimum.
pub(crate) fn to_local_optimum(
    tree: &mut Working<impl Metric>,
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    repeat(quota, observer, |quota| pass_by_area(tree, quota, observer))
}

/// Repeats a pass until it keeps no move, the quota is used up, or the observer cancels.
pub(crate) fn repeat(
    quota: Quota,
    observer: &dyn Observer,
    mut pass: impl FnMut(Quota) -> Tally,
) -> Tally {
    let mut total = Tally::default();
    loop {
        let done = pass(quota.less(&total));
        total += done;
        if done.kept == 0 || quota.is_reached(&total) || observer.cancelled() {
            return total;
        }
    }
}

with_vector_instructions! {
    /// Moves each node of `order` to its best position if that saves more than [`TOLERANCE`], one
    /// after the other. Stops early when the quota is used up or the observer cancels. Returns the
    /// number of nodes tried and moved, and of nodes visited; one search for a position visits the
    /// whole tree at worst.
    pub(crate) pass = pass_plain(
        tree: &mut Working<impl Metric>, order: &[u32], quota: Quota, observer: &dyn Observer) -> Tally
}

#[inline(always)]
fn pass_plain(
    tree: &mut Working<impl Metric>,
    order: &[u32],
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let mut done = Tally::default();
    let mut search = PositionSearch::default();
    let mut work_at_poll = WORK_PER_POLL;
    for &node in order {
        if quota.is_reached(&done) {
            break;
        }
        if done.work >= work_at_poll {
            if observer.cancelled() {
                break;
            }
            work_at_poll = done.work + WORK_PER_POLL;
        }
        let is_root = tree.nodes[node as usize].parent == ANCHOR;
        if is_root {
            continue;
        }
        done.moves += 1;
        let visits_before = search.visits;
        let (position, _) = search.position_of_attached(tree, node, TOLERANCE);
        done.work += search.visits - visits_before;
        if let Some(position) = position {
            tree.begin();
            done.work += tree.detach(node).2;
            done.work += tree.attach(node, position.sibling).1;
            done.kept += 1;
        }
    }
    done
}
