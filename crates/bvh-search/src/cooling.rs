//! Simulated annealing of a tree by any kind of move: rounds, temperatures, and the descent at the end.
//!
//! Kirkpatrick, Gelatt & Vecchi 1983. Cools geometrically, by the part of the work done.

use crate::error::require;
use crate::incumbent::Incumbent;
use crate::start::Start;
use crate::starts::Starts;
use crate::stream::Stream;
use crate::working::Working;
use crate::{Observer, Problem, Quota, Run, SearchError, Tally, pieces};
use bvh_core::{Bvh, with_vector_instructions};

/// A kind of move.
pub(crate) trait Move {
    /// Changes the tree, and takes it back unless Metropolis accepts. Returns whether it did.
    fn step(&mut self, tree: &mut Working, temperature: f64, rng: &mut Stream) -> bool;
    /// Nodes visited by all steps so far.
    fn work(&self) -> u64;
    /// Where moves begin.
    fn starts(&mut self) -> &mut Starts;
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
    /// The observer's progress at which to be done, if it knows any; above the one at the beginning.
    pub end: f64,
    /// Pieces that are annealed at once, at least 1.
    pub pieces: u32,
}

/// A search that is one descent of the temperature, from the first to the second.
pub(crate) struct Descent<'a> {
    pub heat: [f64; 2],
    pub work_per_object: u64,
    pub start: &'a Start,
}

impl Descent<'_> {
    /// From the start, by moves of one kind; what is left of the budget is done if it is less.
    pub fn search<M: Move>(
        &self,
        mover: impl Fn() -> M + Sync,
        problem: &Problem,
        seed: u64,
        run: &mut Run,
    ) -> Result<Bvh, SearchError> {
        let [hot, cold] = self.heat;
        require(hot.is_finite() && hot > 0.0, "hot", hot, "above 0")?;
        require(cold > 0.0 && cold <= hot, "cold", cold, "above 0, not above hot")?;
        let (mut best, mut tree) = Incumbent::build(self.start, problem, run)?;
        let quota = run.left().at_most(self.work_per_object.saturating_mul(problem.boxes.len() as u64));
        let (cooling, observer) = (Cooling { hot, cold, quota, end: 1.0, pieces: 1 }, run.observer());
        anneal(mover, &cooling, &mut tree, [seed, 0], observer, &mut |tree, tally| {
            run.count(tally);
            best.offer(tree, run);
        });
        Ok(best.tree)
    }
}

/// Work per object after which nodes are laid out anew, a hundredth of all but within these bounds.
const WORK_PER_ROUND: [u64; 2] = [64, 256];

/// Work per object that is kept for the sweeps, an eighth of all at most.
const WORK_OF_SWEEPS: u64 = 300;

/// Cools `tree`, then sweeps it to a local optimum of reinsertion. Shows the tree to `round` along the way, with what
/// was done since the last time. Every round has its own stream of `seed`, and every piece of it, from number `first`
/// on.
///
/// If the observer knows the time, temperatures follow whichever is nearer to its end, the time or the work.
pub(crate) fn anneal<M: Move>(
    mover: impl Fn() -> M + Sync,
    cooling: &Cooling,
    tree: &mut Working,
    [seed, first]: [u64; 2],
    observer: &dyn Observer,
    round: &mut dyn FnMut(&Working, Tally),
) {
    let (n, Quota { work, moves }) = (tree.objects() as u64, cooling.quota);
    if n < 3 {
        return;
    }
    let sweeps = WORK_OF_SWEEPS.saturating_mul(n);
    let work = work - (work / 8).min(sweeps);
    let (mut done, mut streams) = (Tally::default(), first);
    let factor = cooling.cold / cooling.hot;
    let temperature = |part: f64| cooling.hot * libm::pow(factor, part.min(1.0));
    let began = observer.progress();
    let [short, long] = WORK_PER_ROUND.map(|work| work * n);
    let mut next = (work / 100).clamp(short, long).min(work);
    if began.is_some() {
        next = next.min(short);
    }
    // Parts of the work or time: done, and for one node of work.
    let (mut part, mut rate) = (0.0, 1.0 / work as f64);
    tree.sort_in_preorder();
    while part < 1.0 {
        let step = rate * next as f64;
        let heat = [part, part + step].map(temperature);
        let end = if began.is_none() && part + 1.5 * step >= 1.0 { work } else { work.min(done.work + next) };
        let quota = Quota { work: end, moves }.less(&done);
        let tally =
            pieces::cool_in_pieces(&mover, tree, heat, quota, cooling.pieces, [seed, streams], observer);
        streams += pieces::STREAMS;
        done += tally;
        round(tree, tally);
        if observer.cancelled() || cooling.quota.is_reached(&done) {
            return;
        }
        part = done.work as f64 / work as f64;
        if let (Some(began), Some(now)) = (began, observer.progress()) {
            let passed = (now - began) / (cooling.end - began);
            let per_node = passed / done.work as f64;
            let timed = passed / (1.0 - (per_node * sweeps as f64).min(0.125));
            if timed > part {
                (part, rate) = (timed, timed / done.work as f64);
                next = ((0.01 / rate) as u64).clamp(short, long);
            }
        }
    }
    let tally = pieces::descend_in_pieces(tree, cooling.pieces, cooling.quota.less(&done), observer);
    round(tree, tally);
}

with_vector_instructions! {
    /// Moves until the quota is reached, while the temperature falls geometrically from the first to the second.
    pub(crate) cool = cool_plain<M: Move>(
        mover: &mut M, tree: &mut Working, heat: [f64; 2], quota: Quota, rng: &mut Stream, observer: &dyn Observer)
        -> Tally
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
    use crate::scatter::{built, scatter};
    use crate::{annealing, ruin_recreate};
    use bvh_build::muller_fellner;
    use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

    /// Counts the moves of another kind, and checks the tree after every one.
    struct Checked<'a, M> {
        inner: M,
        moves: &'a AtomicU64,
    }

    impl<M: Move> Move for Checked<'_, M> {
        fn step(&mut self, tree: &mut Working, temperature: f64, rng: &mut Stream) -> bool {
            let before = tree.area();
            let kept = self.inner.step(tree, temperature, rng);
            let area = tree.internal_area();
            let number = self.moves.fetch_add(1, Relaxed);
            assert!((tree.area() - area).abs() <= 1e-12 * area, "move {number}");
            assert!(kept || (tree.area() - before).abs() <= 1e-12 * before);
            kept
        }
        fn work(&self) -> u64 {
            self.inner.work()
        }
        fn starts(&mut self) -> &mut Starts {
            self.inner.starts()
        }
    }

    fn check<M: Move>(inner: impl Fn() -> M + Sync) {
        let boxes = scatter(60);
        let mut tree = built(&muller_fellner::Config::default(), &boxes);
        let quota = Quota { moves: 300_000, work: u64::MAX / 1024 };
        let cooling = Cooling { hot: 0.5, cold: 0.4, quota, end: 1.0, pieces: 1 };
        let moves = AtomicU64::new(0);
        let mover = || Checked { inner: inner(), moves: &moves };
        anneal(mover, &cooling, &mut tree, [1, 0], &(), &mut |_, _| ());
        assert_eq!(moves.into_inner(), 300_000);
        bvh_core::validate(&tree.to_bvh(), &boxes).unwrap();
    }

    #[test]
    fn areas_stay_exact_after_each_of_a_million_annealed_moves() {
        let ruin = ruin_recreate::Ruin::default();
        check(|| ruin_recreate::Mover::new(&ruin, 1000.0));
        for target in [annealing::Target::Random, annealing::Target::Best] {
            let step = annealing::Move { target, ..Default::default() };
            check(|| annealing::Mover::new(&step));
        }
    }
}
