//! From an initial tree to the end of the budget: the choice of annealing runs and their schedules.

use super::config::{Config, Horizon};
use super::improvement::{Improvement, ScheduledRun, TRIALS, cost};
use super::plan::{Planned, plan};
use crate::annealing::cool;
use crate::annealing::references::Divider;
use crate::annealing::ruin_recreate::RuinMover;
use crate::annealing::schedule::Schedule;
use crate::local::incumbent::Incumbent;
use crate::local::reinsertion;
use crate::parallel::threads;
use crate::run::{Problem, Quota, Run, StopReason, Stream, Tally, stream};
use crate::tree::{Metric, Working};
use crate::tuning::{
    FINISH_AT_MOST, FINISH_WORK, LARGE_SUBTREE, LEAST_LARGE_SUBTREES, MOST_GENERATIONS,
    MOST_SUBTREES, PROBE, SECURED_FROM, SUBTREES_PER_THREAD, TRIAL, WORTH_LARGE_SUBTREES,
    WORTH_SUBTREES,
};
use bvh_core::cost::Objective;

/// Improves the incumbent, whose working form is `tree`, until the work is done or the time is
/// over. Also improves its references, if the problem has splits. With an `other` start, a trial
/// chooses the better of the two.
pub(crate) fn improve<A: Metric>(
    config: &Config,
    tree: &mut Working<A>,
    other: Option<Working<A>>,
    seed: u64,
    problem: &Problem,
    best: &mut Incumbent,
    run: &mut Run,
) {
    let n = tree.objects() as u64;
    // Two objects have only one tree.
    if n < 3 || run.stopped() == Some(StopReason::Cancelled) {
        return;
    }
    let (horizon, work) = config.horizon(n, run);
    let by_layout = problem.objective == Objective::Layout;
    let divider = problem.splits.map(|splits| Divider::new(splits, by_layout));
    let mut search = Improvement {
        config,
        boxes: problem.boxes,
        seed,
        n,
        left: work,
        by_layout,
        divider,
        best,
        run,
        is_secured: false,
    };
    if let Some(other) = other {
        search.choose(tree, other, horizon);
    }
    match horizon {
        Horizon::Known => search.until_known_end(tree),
        Horizon::Open => search.until_stopped(tree),
    }
}

impl Improvement<'_, '_, '_, '_> {
    /// Follows a plan of annealing runs. Each ends at a fraction of the work or of the time.
    fn until_known_end(&mut self, tree: &mut Working<impl Metric>) {
        let n = self.n;
        let observer = self.run.observer();
        let timed = observer.progress().is_some();
        let mut length = self.left as f64 / n as f64;
        // The last moves must end early enough for the conversion of the tree.
        let mut end_of_all = 1.0;
        if timed {
            let quota = self.run.left().at_most(self.left.min(PROBE * n));
            let (tally, in_time) = self.probe(tree, stream(self.seed, 0), quota);
            self.left = self.left.saturating_sub(tally.work);
            self.run.count(tally);
            let now = observer.progress().unwrap_or(1.0);
            end_of_all = 1.0 - (1.0 - now) * (FINISH_WORK * n as f64 / in_time).min(FINISH_AT_MOST);
            length = length.min(in_time / n as f64);
            self.secure(tree, length);
        }
        let all = self.left;
        let began = observer.progress().unwrap_or(0.0);
        // Short runs pay only because they are recombined, and trees judged by their layout cannot
        // be.
        let config = if self.by_layout {
            &Config { reheats: 0, ..self.config.clone() }
        } else {
            self.config
        };
        let (plan, each) = plan(config, length, n);
        for (number, Planned { hot, until }) in (0..).zip(plan) {
            let due = (until * all as f64) as u64;
            let work =
                if timed { self.left } else { self.left.min(due.saturating_sub(all - self.left)) };
            let end = began + (end_of_all - began) * until;
            // A slow earlier run may have used the time of this one.
            if observer.progress().is_some_and(|now| now >= end) {
                continue;
            }
            let schedule = self.schedule(hot, work, end, length);
            let is_first = number == 0;
            self.anneal(tree, &ScheduledRun { number, schedule, length: each, is_first });
        }
    }

    /// Searches a local optimum, then anneals in generations of growing length.
    fn until_stopped(&mut self, tree: &mut Working<impl Metric>) {
        self.reinsert(tree);
        let mut length = self.config.first;
        for number in 0..MOST_GENERATIONS {
            let work = self.left.min((length * self.n as f64) as u64);
            let schedule = self.schedule(self.config.hot(length), work, 1.0, length);
            self.anneal(tree, &ScheduledRun { number, schedule, length, is_first: false });
            length *= self.config.growth;
        }
    }

    /// Reinserts to a local optimum and offers it to the incumbent.
    fn reinsert(&mut self, tree: &mut Working<impl Metric>) {
        self.best.improve(tree, u32::MAX, self.run, reinsertion::pass_by_area);
    }

    /// Keeps a local optimum of reinsertion. A caller who stops a time-limited search before
    /// annealing pays then gets at least the result of plain reinsertion. The plan continues from
    /// the unchanged tree.
    fn secure(&mut self, tree: &mut Working<impl Metric>, length: f64) {
        if length < SECURED_FROM || self.is_secured {
            return;
        }
        self.is_secured = true;
        // The shape and the working form of a large tree take most of a second.
        let observer = self.run.observer();
        if observer.cancelled() {
            return;
        }
        if self.divider.is_none() {
            // A working form is a large part of all memory, so the tree itself is searched.
            let before = tree.shape();
            if self.best.refill(tree).is_ok() {
                self.reinsert(tree);
            }
            // After a cancellation nobody continues from the tree.
            if self.run.stopped().is_none() {
                tree.reshape(&before, self.boxes);
            }
        } else if let Ok(mut aside) = self.best.working(tree.metric()) {
            self.reinsert(&mut aside);
        }
    }

    /// Anneals both trees for a short time and keeps the one that ends better.
    fn choose<A: Metric>(
        &mut self,
        tree: &mut Working<A>,
        mut other: Working<A>,
        horizon: Horizon,
    ) {
        let n = self.n as f64;
        let observer = self.run.observer();
        let began = observer.progress().unwrap_or(0.0);
        let work = match horizon {
            Horizon::Known if observer.progress().is_some() => {
                let quota = self.run.left().at_most(self.left.min(PROBE * self.n));
                let (tally, in_time) = self.probe(tree, stream(self.seed, 0), quota);
                self.run.count(tally);
                self.secure(tree, in_time / n);
                TRIAL * in_time.min(self.left as f64)
            }
            Horizon::Known => TRIAL * self.left as f64,
            Horizon::Open => self.config.first * n,
        };
        let length = work / n;
        for (number, tree) in [&mut *tree, &mut other].into_iter().enumerate() {
            let end = began + (1.0 - began) * TRIAL * (number + 1) as f64;
            let schedule = self.schedule(self.config.hot(length), work as u64, end, length);
            let number = TRIALS + number as u64;
            self.anneal(tree, &ScheduledRun { number, schedule, length, is_first: true });
        }
        // A cancelled search continues from neither.
        if self.run.stopped().is_none() && cost(&other, self.by_layout) < cost(tree, self.by_layout)
        {
            *tree = other;
        }
    }

    /// Returns the schedule of an annealing run. `length` is the work per object of the whole
    /// search, or of the generation.
    fn schedule(&self, hot: f64, work: u64, end: f64, length: f64) -> Schedule {
        let Config { cold, .. } = *self.config;
        let quota = self.run.left().at_most(work);
        Schedule {
            hot: hot.max(cold),
            cold,
            quota,
            end,
            subtrees: self.subtrees(length),
            to_local_optimum: !self.by_layout,
        }
    }

    /// Returns the number of subtrees that are annealed at once in a run of a search with `length`
    /// work per object.
    fn subtrees(&self, length: f64) -> u32 {
        if self.config.pieces > 0 {
            return self.config.pieces;
        }
        let large = (self.n / LARGE_SUBTREE).min(u64::from(MOST_SUBTREES)) as u32;
        let by_threads = SUBTREES_PER_THREAD * threads().min(1024) as u32;
        let timed = self.run.observer().progress().is_some();
        // Without a clock the number of threads must not change the tree.
        let subtrees = match timed {
            true if threads() > 1 => by_threads,
            false if large >= LEAST_LARGE_SUBTREES => large,
            _ => 1,
        };
        let worth = if large >= subtrees { WORTH_LARGE_SUBTREES } else { WORTH_SUBTREES };
        if length >= worth { subtrees } else { 1 }
    }

    /// Makes moves at the lowest temperature. Also returns the work that fits into the rest of the
    /// time at this rate.
    fn probe(
        &self,
        tree: &mut Working<impl Metric>,
        mut rng: Stream,
        quota: Quota,
    ) -> (Tally, f64) {
        let observer = self.run.observer();
        let heat = [self.config.cold; 2];
        let began = observer.progress();
        let mut mover = RuinMover::new(&self.config.ruin, PROBE as f64, self.by_layout);
        let tally = cool(&mut mover, tree, Vec::new(), heat, quota, &mut rng, observer);
        let in_time = match (began, observer.progress()) {
            (Some(began), Some(now)) => {
                tally.work as f64 * (1.0 - now).max(0.0) / (now - began).max(1e-9)
            }
            _ => f64::INFINITY,
        };
        (tally, in_time)
    }
}

#[cfg(test)]
mod tests {
    use crate::run::{Budget, Observer, Problem, solve};
    use crate::scatter::scatter;
    use crate::{best, reinsertion};
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

    /// A slow clock that cancels after 5000 polls.
    struct StoppedEarly(AtomicU32);

    impl Observer for StoppedEarly {
        fn progress(&self) -> Option<f64> {
            Some(f64::from(self.0.fetch_add(1, Relaxed)) * 1e-9)
        }
        fn cancelled(&self) -> bool {
            self.0.load(Relaxed) > 5000
        }
    }

    #[test]
    fn a_long_search_under_a_clock_that_is_stopped_early_is_not_behind_reinsertion() {
        let boxes = scatter(300);
        let problem = Problem::new(&boxes);
        let config = reinsertion::Config::default();
        let plain = solve(&config, &problem, 1, Budget::UNLIMITED, &()).unwrap();
        let clock = StoppedEarly(AtomicU32::new(0));
        let found =
            solve(&best::Config::default(), &problem, 1, Budget::UNLIMITED, &clock).unwrap();
        assert!(found.cost <= plain.cost, "{} is above {}", found.cost, plain.cost);
    }
}
