//! A series of Metropolis moves while the temperature falls.

use crate::run::{Observer, Quota, Stream, Tally};
use crate::tree::{Metric, Working};
use crate::tuning::MOVES_PER_TEMPERATURE;
use bvh_core::with_vector_instructions;

/// Makes moves of one kind.
pub(crate) trait Mover: Send {
    /// Begins a series of moves on a tree in preorder, near these nodes, or anywhere if there are
    /// none. O(n), in the memory of an earlier series.
    fn begin(&mut self, tree: &Working<impl Metric>, near: Vec<u32>);
    /// Changes the tree, and undoes the change unless Metropolis accepts it. Returns whether it was
    /// accepted.
    fn step(&mut self, tree: &mut Working<impl Metric>, temperature: f64, rng: &mut Stream)
    -> bool;
    /// Nodes visited by all moves so far.
    fn work(&self) -> u64;
    /// The reinsertions of the last move, which was accepted; `None` if they cannot be repeated on a
    /// copy of the tree.
    fn last_move(&self) -> Option<Reinsertions<'_>> {
        None
    }
}

/// A move, as a copy of the tree can repeat it.
pub(crate) struct Reinsertions<'a> {
    /// The roots of the subtrees, in the order of their removal.
    pub removed: &'a [u32],
    /// The same roots, each with its new sibling, in the order of their insertion.
    pub inserted: &'a [[u32; 2]],
    /// The area that the move may add.
    pub limit: f64,
}

/// Work of a move after which the observer is polled at once, so that less than a millisecond
/// passes between two polls.
const LONG_MOVE: u64 = 1 << 11;

with_vector_instructions! {
    /// Begins a series of moves near these nodes, and makes moves until the quota is used up, while
    /// the temperature falls geometrically from `hot` to `cold`.
    pub(crate) cool = cool_plain<M: Mover>(
        mover: &mut M, tree: &mut Working<impl Metric>, near: Vec<u32>, heat: [f64; 2], quota: Quota, rng: &mut Stream, observer: &dyn Observer)
        -> Tally
}

#[inline(always)]
fn cool_plain<M: Mover>(
    mover: &mut M,
    tree: &mut Working<impl Metric>,
    near: Vec<u32>,
    [hot, cold]: [f64; 2],
    quota: Quota,
    rng: &mut Stream,
    observer: &dyn Observer,
) -> Tally {
    // The beginning takes tenths of a second in a large tree.
    if observer.cancelled() {
        return Tally::default();
    }
    mover.begin(tree, near);
    moves(mover, tree, [hot, cold], quota, rng, observer, |_, _| ())
}

/// Makes moves until the quota is used up, while the temperature falls geometrically. Calls
/// `accepted` after each move that is accepted.
#[inline(always)]
pub(super) fn moves<M: Mover, A: Metric>(
    mover: &mut M,
    tree: &mut Working<A>,
    [hot, cold]: [f64; 2],
    quota: Quota,
    rng: &mut Stream,
    observer: &dyn Observer,
    mut accepted: impl FnMut(&M, &mut Working<A>),
) -> Tally {
    let mut tally = Tally::default();
    let before = mover.work();
    let mut temperature = hot;
    loop {
        let work = mover.work() - before;
        let long_move = work - tally.work > LONG_MOVE;
        tally.work = work;
        // Checked before every move, so that a budget is exceeded by one move at most.
        if quota.is_reached(&tally) {
            return tally;
        }
        // The temperature changes little within a few moves, so the power and the poll are needed
        // only now and then.
        if tally.moves % MOVES_PER_TEMPERATURE == 0 {
            if observer.cancelled() {
                return tally;
            }
            // `libm` returns the same bits on every platform; the standard library's `powf` does
            // not.
            temperature = hot * libm::pow(cold / hot, tally.work as f64 / quota.work as f64);
        } else if long_move && observer.cancelled() {
            return tally;
        }
        tally.moves += 1;
        if mover.step(tree, temperature, rng) {
            tally.kept += 1;
            accepted(mover, tree);
        }
    }
}
