//! A series of Metropolis moves while the temperature falls.

use super::node_sampler::NodeSampler;
use crate::run::{Observer, Quota, Stream, Tally, WORK_PER_POLL};
use crate::tree::Working;
use crate::tuning::MOVES_PER_TEMPERATURE;
use bvh_core::with_vector_instructions;

/// Makes moves of one kind.
pub(crate) trait Mover {
    /// Changes the tree, and undoes the change unless Metropolis accepts it. Returns whether it was accepted.
    fn step(&mut self, tree: &mut Working, temperature: f64, rng: &mut Stream) -> bool;
    /// Nodes visited by all moves so far.
    fn work(&self) -> u64;
    /// Draws the nodes at which moves begin.
    fn sampler(&mut self) -> &mut NodeSampler;
}

with_vector_instructions! {
    /// Moves until the quota is used up, while the temperature falls geometrically from `hot` to `cold`.
    pub(crate) cool = cool_plain<M: Mover>(
        mover: &mut M, tree: &mut Working, heat: [f64; 2], quota: Quota, rng: &mut Stream, observer: &dyn Observer)
        -> Tally
}

#[inline(always)]
fn cool_plain<M: Mover>(
    mover: &mut M,
    tree: &mut Working,
    [hot, cold]: [f64; 2],
    quota: Quota,
    rng: &mut Stream,
    observer: &dyn Observer,
) -> Tally {
    let (mut tally, before) = (Tally::default(), mover.work());
    // Long moves ask the observer more often.
    let (mut temperature, mut poll) = (hot, WORK_PER_POLL);
    loop {
        tally.work = mover.work() - before;
        if quota.is_reached(&tally) {
            return tally;
        }
        if tally.moves % MOVES_PER_TEMPERATURE == 0 || tally.work >= poll {
            if observer.cancelled() {
                return tally;
            }
            poll = tally.work + WORK_PER_POLL;
        }
        if tally.moves % MOVES_PER_TEMPERATURE == 0 {
            temperature = hot * libm::pow(cold / hot, tally.work as f64 / quota.work as f64);
        }
        tally.kept += u64::from(mover.step(tree, temperature, rng));
        tally.moves += 1;
    }
}
