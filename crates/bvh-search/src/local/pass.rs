//! What all passes over a tree share: their repetition, an order of nodes, and what counts as an improvement.

use crate::run::{Observer, Quota, Tally};
use crate::tree::{Metric, Working};

/// A move must save more than this fraction of its cost: more than rounding errors, so that no two moves undo each other
/// for ever.
pub(crate) const TOLERANCE: f64 = 1e-12;

/// Sorts nodes by area, the largest first, and nodes of equal area in the order given.
pub(super) fn sort_by_area(tree: &Working<impl Metric>, order: &mut [u32]) {
    order.sort_by(|&a, &b| {
        tree.nodes[b as usize]
            .area
            .total_cmp(&tree.nodes[a as usize].area)
    });
}

/// Repeats a pass until it keeps no move, the quota is used up, or the observer cancels.
pub(super) fn repeat(
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
