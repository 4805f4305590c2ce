//! Simulated annealing of a tree by any kind of move: rounds, temperatures, and the descent at the end.
//!
//! Kirkpatrick, Gelatt & Vecchi 1983. Cools geometrically, by the part of the work done.

use crate::stream::Stream;
use crate::working::Working;
use crate::{Observer, Quota, Tally, reinsertion};
use bvh_core::with_vector_instructions;

/// A kind of move.
pub(crate) trait Move {
    /// Changes the tree, and takes it back unless Metropolis accepts. Returns whether it did.
    fn step(&mut self, tree: &mut Working, temperature: f64, rng: &mut Stream) -> bool;
    /// Nodes visited by all steps so far.
    fn work(&self) -> u64;
}

/// One descent of the temperature.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cooling {
    /// First temperature.
    pub hot: f64,
    /// Last temperature.
    pub cold: f64,
    /// The work to be done meanwhile, and the most moves.
    pub quota: Quota,
}

/// Work per object after which nodes are laid out anew.
const WORK_PER_ROUND: u64 = 64;

/// Work per object that is kept for the sweeps, an eighth of all at most.
const WORK_OF_SWEEPS: u64 = 300;

/// Cools `tree`, then sweeps it to a local optimum of reinsertion. Shows the tree to `round` along the way, with what
/// was done since the last time.
pub(crate) fn anneal<M: Move>(
    mover: &mut M,
    cooling: &Cooling,
    tree: &mut Working,
    rng: &mut Stream,
    observer: &dyn Observer,
    round: &mut dyn FnMut(&Working, Tally),
) {
    let (n, Quota { work, moves }) = (tree.objects() as u64, cooling.quota);
    if n < 3 {
        return;
    }
    let work = work - (work / 8).min(WORK_OF_SWEEPS.saturating_mul(n));
    let rounds = (work / (WORK_PER_ROUND * n)).clamp(1, 100);
    let factor = cooling.cold / cooling.hot;
    let mut done = Tally::default();
    for number in 1..=rounds {
        *tree = tree.in_preorder();
        let part = |number: u64| number as f64 / rounds as f64;
        let heat = [number - 1, number].map(|number| cooling.hot * libm::pow(factor, part(number)));
        let end = Quota { work: (work as f64 * part(number)) as u64, moves };
        let tally = cool(mover, tree, heat, end.less(&done), rng, observer);
        done += tally;
        round(tree, tally);
        if observer.cancelled() {
            return;
        }
    }
    *tree = tree.in_preorder();
    let tally = reinsertion::to_local_optimum(tree, cooling.quota.less(&done), observer);
    round(tree, tally);
}

with_vector_instructions! {
    /// Moves until the quota is reached, while the temperature falls geometrically from the first to the second.
    cool = cool_plain<M: Move>(mover: &mut M, tree: &mut Working, heat: [f64; 2], quota: Quota, rng: &mut Stream,
        observer: &dyn Observer) -> Tally
}

#[inline(always)]
fn cool_plain<M: Move>(
    mover: &mut M,
    tree: &mut Working,
    [hot, cold]: [f64; 2],
    quota: Quota,
    rng: &mut Stream,
    observer: &dyn Observer,
) -> Tally {
    let (mut tally, before) = (Tally::default(), mover.work());
    let mut temperature = hot;
    loop {
        tally.work = mover.work() - before;
        if quota.is_reached(&tally) {
            return tally;
        }
        if tally.moves % 64 == 0 {
            if observer.cancelled() {
                return tally;
            }
            temperature = hot * libm::pow(cold / hot, tally.work as f64 / quota.work as f64);
        }
        tally.kept += u64::from(mover.step(tree, temperature, rng));
        tally.moves += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::scatter;
    use crate::stream::stream;
    use crate::{annealing, ruin_recreate};
    use bvh_build::{Builder, muller_fellner};

    /// Counts the moves of another kind, and checks the tree after every one.
    struct Checked<M> {
        inner: M,
        moves: u64,
    }

    impl<M: Move> Move for Checked<M> {
        fn step(&mut self, tree: &mut Working, temperature: f64, rng: &mut Stream) -> bool {
            let before = tree.area();
            let kept = self.inner.step(tree, temperature, rng);
            let area = tree.internal_area();
            assert!((tree.area() - area).abs() <= 1e-12 * area, "move {}", self.moves);
            assert!(kept || (tree.area() - before).abs() <= 1e-12 * before);
            self.moves += 1;
            kept
        }
        fn work(&self) -> u64 {
            self.inner.work()
        }
    }

    fn check(inner: impl Move) {
        let boxes = scatter(60);
        let start = muller_fellner::Config::default().build(&boxes).unwrap();
        let mut tree = Working::from_bvh(&start, &boxes).unwrap();
        let quota = Quota { moves: 300_000, work: u64::MAX / 1024 };
        let cooling = Cooling { hot: 0.5, cold: 0.4, quota };
        let mut mover = Checked { inner, moves: 0 };
        anneal(&mut mover, &cooling, &mut tree, &mut stream(1, 0), &(), &mut |_, _| ());
        assert!(mover.moves > 250_000);
        bvh_core::validate(&tree.to_bvh(), &boxes).unwrap();
    }

    #[test]
    fn areas_stay_exact_after_each_of_a_million_annealed_moves() {
        check(ruin_recreate::Mover::new(&ruin_recreate::Ruin::default()));
        for target in [annealing::Target::Random, annealing::Target::Best] {
            check(annealing::Mover::new(&annealing::Move { target, ..Default::default() }));
        }
    }
}
