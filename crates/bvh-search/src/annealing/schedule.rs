//! Simulated annealing of a tree by any kind of move: rounds, temperatures, and the final local
//! search.
//!
//! Kirkpatrick, Gelatt & Vecchi 1983. The temperature falls geometrically with the completed
//! fraction of the work or of the time:
//!
//! ```text
//!   hot ┐
//!       └──┐                       one step per round: the nodes are sorted, then every subtree and
//!          └────┐                  the whole tree are moved while the temperature falls further
//!               └─────────┐
//!   cold                  └─────── passes of reinsertion to a local optimum
//! ```

use super::metropolis::Mover;
use super::subtrees::{self, Round};
use crate::local::incumbent::Incumbent;
use crate::run::{Found, Observer, Problem, Quota, Run, Tally};
use crate::tree::{Metric, Working};
use crate::tuning::{FINAL_PASSES_PART, FINAL_PASSES_WORK, LAST_ROUND, ROUNDS, WORK_PER_ROUND};

/// The temperatures and the length of one annealing run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Schedule {
    pub hot: f64,
    pub cold: f64,
    /// The work over which the temperature falls, and the maximum number of moves.
    pub quota: Quota,
    /// The observer's progress at which the run must end, if the observer reports its progress;
    /// greater than the progress at the start.
    pub end: f64,
    /// Number of subtrees that are annealed at once, at least 1.
    pub subtrees: u32,
    /// True if passes of reinsertion follow. They lower the area, which is not always the
    /// objective.
    pub to_local_optimum: bool,
}

/// Anneals the initial tree by moves of one kind, until the work or the budget is used up, and ends
/// in passes of reinsertion to a local optimum: a search that consists of one annealing run.
pub(crate) fn anneal_initial<M: Mover>(
    mover: impl Fn() -> M + Sync,
    [hot, cold]: [f64; 2],
    work_per_object: u64,
    metric: impl Metric,
    problem: &Problem,
    seed: u64,
    run: &mut Run,
) -> Found {
    let (mut best, mut tree) = Incumbent::build(problem, metric, run)?;
    let quota = run.left().at_most(work_per_object.saturating_mul(problem.boxes.len() as u64));
    let schedule = Schedule { hot, cold, quota, end: 1.0, subtrees: 1, to_local_optimum: true };
    let observer = run.observer();
    anneal(mover, &schedule, &mut tree, [seed, 0], observer, &mut |tree, tally| {
        run.count(tally);
        best.offer(tree, run);
    });
    Ok(best.tree)
}

/// Anneals `tree`, then improves it to a local optimum of reinsertion. Calls `round` after every
/// round, with the tree and the work since the previous call. Every round, and every subtree of a
/// round, draws from a separate random stream of `seed`, from stream `first` on.
///
/// If the observer reports its progress, the temperature follows the work or the time, whichever is
/// closer to its end.
pub(crate) fn anneal<M: Mover, A: Metric>(
    mover: impl Fn() -> M + Sync,
    schedule: &Schedule,
    tree: &mut Working<A>,
    [seed, first]: [u64; 2],
    observer: &dyn Observer,
    round: &mut dyn FnMut(&mut Working<A>, Tally),
) {
    let n = tree.objects() as u64;
    let Quota { work, moves } = schedule.quota;
    // Two objects have only one tree.
    if n < 3 {
        return;
    }
    let final_passes = FINAL_PASSES_WORK.saturating_mul(n);
    let final_passes =
        if schedule.to_local_optimum { (work / FINAL_PASSES_PART).min(final_passes) } else { 0 };
    let work = work - final_passes;
    let mut done = Tally::default();
    let mut streams = first;
    let factor = schedule.cold / schedule.hot;
    let temperature = |fraction: f64| schedule.hot * libm::pow(factor, fraction.min(1.0));
    let began = observer.progress();
    let [short, long] = WORK_PER_ROUND.map(|work| work * n);
    let mut next = (work / ROUNDS).clamp(short, long).min(work);
    // The rate of work is still unknown, so the first round under a time limit is short.
    if began.is_some() {
        next = next.min(short);
    }
    // The completed fraction of the work or time, and the fraction per unit of work.
    let mut fraction = 0.0;
    let mut rate = 1.0 / work as f64;
    if observer.cancelled() {
        return;
    }
    // Moves find their nodes near each other in memory only after a sort.
    tree.sort_in_preorder();
    // Every round uses the memory of the one before: fresh memory for the rows of costs of ten
    // million nodes takes more than a second.
    let mut whole = mover();
    while fraction < 1.0 {
        let step = rate * next as f64;
        let heat = [fraction, fraction + step].map(temperature);
        let is_last = began.is_none() && fraction + LAST_ROUND * step >= 1.0;
        let end = if is_last { work } else { work.min(done.work + next) };
        let quota = Quota { work: end, moves }.less(&done);
        let cooling = Round { heat, quota, count: schedule.subtrees, streams: [seed, streams] };
        let tally = subtrees::cool(&cooling, &mover, &mut whole, tree, observer);
        streams += subtrees::STREAMS;
        done += tally;
        round(tree, tally);
        // A cancelled search has no time for the final passes.
        if observer.cancelled() || schedule.quota.is_reached(&done) {
            return;
        }
        fraction = done.work as f64 / work as f64;
        if let (Some(began), Some(now)) = (began, observer.progress()) {
            let passed = (now - began) / (schedule.end - began);
            let per_node = passed / done.work as f64;
            // Reserve the time of the final passes at the measured rate, as the work is reserved
            // above.
            let kept = (per_node * final_passes as f64).min(1.0 / FINAL_PASSES_PART as f64);
            let timed = passed / (1.0 - kept);
            // Whichever of work and time is nearer to its end drives the temperature.
            if timed > fraction {
                (fraction, rate) = (timed, timed / done.work as f64);
                next = ((1.0 / ROUNDS as f64 / rate) as u64).clamp(short, long);
            }
        }
    }
    // The final passes need memory, too.
    drop(whole);
    if schedule.to_local_optimum {
        let tally = subtrees::to_local_optimum(
            tree,
            schedule.subtrees,
            schedule.quota.less(&done),
            observer,
        );
        round(tree, tally);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::annealing::ruin_recreate::{RuinMover, Scale};
    use crate::annealing::single;
    use crate::run::Stream;
    use crate::scatter::{built, scatter};
    use bvh_build::muller_fellner;
    use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

    /// Counts the moves of another mover, and checks the tree after every move.
    struct Checked<'a, M> {
        inner: M,
        moves: &'a AtomicU64,
    }

    impl<M: Mover> Mover for Checked<'_, M> {
        fn step(
            &mut self,
            tree: &mut Working<impl Metric>,
            temperature: f64,
            rng: &mut Stream,
        ) -> bool {
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
        fn begin(&mut self, tree: &Working<impl Metric>, near: Vec<u32>) {
            self.inner.begin(tree, near);
        }
    }

    fn check<M: Mover>(inner: impl Fn() -> M + Sync) {
        let boxes = scatter(60);
        let mut tree = built(&muller_fellner::Config::default(), &boxes);
        let quota = Quota { moves: 300_000, work: u64::MAX / 1024 };
        let schedule =
            Schedule { hot: 0.5, cold: 0.4, quota, end: 1.0, subtrees: 1, to_local_optimum: true };
        let moves = AtomicU64::new(0);
        let mover = || Checked { inner: inner(), moves: &moves };
        anneal(mover, &schedule, &mut tree, [1, 0], &(), &mut |_, _| ());
        assert_eq!(moves.into_inner(), 300_000);
        bvh_core::validate(&tree.to_bvh(), &boxes).unwrap();
    }

    #[test]
    fn areas_stay_exact_after_each_of_a_million_annealed_moves() {
        for by_layout in [false, true] {
            check(|| RuinMover::new(Scale::Saved, 1000.0, by_layout));
        }
        check(single::SingleMover::default);
    }
}
