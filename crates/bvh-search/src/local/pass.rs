//! The common parts of all passes over a tree: repetition, an order of nodes, and the least
//! improvement.

use crate::run::{Observer, Quota, Tally};
use crate::tree::{Metric, Working};

/// The fraction of its cost that a move must save. It exceeds rounding errors, so no two moves undo
/// each other forever.
pub(crate) const TOLERANCE: f64 = 1e-12;

/// Sorts nodes by area, the largest first. The sort is stable: nodes of equal area keep their
/// order.
pub(crate) fn sort_by_area(tree: &Working<impl Metric>, order: &mut [u32]) {
    // Areas are never negative, so their inverted bits are in reverse order. A key is read from
    // memory once and not at every comparison, which in large trees takes most of the time.
    order.sort_by_cached_key(|&index| !tree.nodes[index as usize].area.to_bits());
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
