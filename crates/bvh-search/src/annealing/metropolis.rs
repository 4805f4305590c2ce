//! A series of Metropolis moves while the temperature falls.

use crate::run::{Observer, Quota, Stream, Tally};
use crate::tree::{Metric, Working};
use crate::tuning::MOVES_PER_TEMPERATURE;
use bvh_core::with_vector_instructions;

pub(crate) trait Mover: Send {
    /// Begins a series of moves on a tree in preorder, near these nodes, or anywhere if there are
    /// none. O(n), in the memory of an earlier series.
    fn begin(&mut self, tree: &Working<impl Metric>, near: Vec<u32>);
    /// Changes the tree, and undoes the change unless Metropolis accepts it. Returns whether it was
    /// accepted. Calls `tree.begin()` before a change, or `undo` would revert the last accepted one,
    /// and adds to the work in any case, or a run that only work ends would never end.
    fn step(&mut self, tree: &mut Working<impl Metric>, temperature: f64, rng: &mut Stream)
    -> bool;
    /// Nodes visited by all moves so far.
    fn work(&self) -> u64;
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
        tally.kept += u64::from(mover.step(tree, temperature, rng));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;
    use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

    /// Makes moves that take this work and change nothing.
    struct Idle {
        each: u64,
        work: u64,
    }

    impl Mover for Idle {
        fn begin(&mut self, _: &Working<impl Metric>, _: Vec<u32>) {}
        fn step(&mut self, _: &mut Working<impl Metric>, _: f64, _: &mut Stream) -> bool {
            self.work += self.each;
            false
        }
        fn work(&self) -> u64 {
            self.work
        }
    }

    struct Polls(AtomicU64);

    impl Observer for Polls {
        fn cancelled(&self) -> bool {
            self.0.fetch_add(1, Relaxed);
            false
        }
    }

    #[test]
    fn the_observer_is_polled_after_every_long_move_and_now_and_then_after_short_ones() {
        let mut tree = built(&muller_fellner::Config::default(), &scatter(10));
        let moves = 10 * MOVES_PER_TEMPERATURE;
        for (each, expected) in [(LONG_MOVE, 10), (LONG_MOVE + 1, moves)] {
            let mover = &mut Idle { each, work: 0 };
            let quota = Quota { moves, work: u64::MAX };
            let polls = Polls(0.into());
            cool_plain(mover, &mut tree, vec![], [0.5, 0.4], quota, &mut stream(1, 0), &polls);
            // The first is before the beginning.
            assert_eq!(polls.0.into_inner(), 1 + expected, "{each} nodes");
        }
    }
}
