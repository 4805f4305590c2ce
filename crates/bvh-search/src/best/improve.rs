//! From an initial tree to the end of the budget: the choice of annealing runs, their schedules, and
//! the recombination of each with the tree from before.

use super::config::{Config, Horizon};
use super::recombine::recombine;
use crate::annealing::cool;
use crate::annealing::references::Divider;
use crate::annealing::ruin_recreate::{RuinMover, Scale};
use crate::annealing::schedule::{Schedule, anneal};
use crate::local::incumbent::Incumbent;
use crate::local::reinsertion;
use crate::parallel::threads;
use crate::run::{Observer, Problem, Run, StopReason, Tally, stream};
use crate::tree::{Metric, Shape, Working};
use crate::tuning::{
    COLD, FINISH_AT_MOST, FINISH_WORK, FIRST_GENERATION, GROWTH, HEAT, HOTTEST, LARGE_SUBTREE,
    LEAST_LARGE_SUBTREES, LONGEST, MOST_GENERATIONS, MOST_SUBTREES, PROBE, RECOMBINED_AT_ONCE,
    REHEAT, REHEATED, REHEATS, REHEATS_FROM, ROUNDS_PER_LOOK, SECURED_FROM, SUBTREES_PER_THREAD,
    TOP_FROM, TRIAL, WORK_ON_REFERENCES, WORK_PER_PAIR, WORTH_AN_EVENT, WORTH_LARGE_SUBTREES,
    WORTH_SUBTREES,
};
use bvh_core::cost::Objective;
use bvh_core::{Aabb, Bvh};

/// The number of the first trial run. Trial runs decide between two starts, and their numbers
/// follow the numbers of all other runs, so that no random stream is used twice.
const TRIALS: u64 = 1 << 20;

struct ScheduledRun {
    /// Number of the run, which selects its random streams.
    number: u64,
    schedule: Schedule,
    /// Work per object, by which the moves are chosen: the work of a long run of the plan with its
    /// short runs, or of the generation.
    length: f64,
    /// True if the run replaces the tree where it ends better, instead of being recombined.
    is_first: bool,
}

/// The tree from before an annealing run.
enum Before {
    /// The incumbent is no worse.
    Incumbent,
    Shape(Shape),
    /// Leaves may hold parts of objects.
    Flat(Bvh),
}

impl Before {
    fn restore(self, tree: &mut Working<impl Metric>, best: &Incumbent, boxes: &[Aabb]) {
        // A binary tree stays binary, so that no conversion fails.
        match self {
            Self::Shape(shape) => tree.reshape(&shape, boxes),
            Self::Flat(flat) => _ = tree.refill(&flat),
            Self::Incumbent => _ = tree.refill(&best.tree),
        }
    }
}

struct Improvement<'a, 'p, 'r, 's> {
    config: &'a Config,
    boxes: &'a [Aabb],
    seed: u64,
    n: u64,
    left: u64,
    /// True if the objective is the cost of the wide layout, not the area.
    by_layout: bool,
    /// Divides and reunites references, if they may change.
    divider: Option<Divider<'s>>,
    best: &'a mut Incumbent<'p>,
    run: &'a mut Run<'r>,
    /// True if the incumbent is at least as good as a local optimum of reinsertion.
    is_secured: bool,
}

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
            let in_time = self.probe(tree);
            let now = observer.progress().unwrap_or(1.0);
            end_of_all = 1.0 - (1.0 - now) * (FINISH_WORK * n as f64 / in_time).min(FINISH_AT_MOST);
            length = length.min(in_time / n as f64);
            self.secure(tree, length);
        }
        let all = self.left;
        let began = observer.progress().unwrap_or(0.0);
        // Short runs pay only because they are recombined, and trees judged by their layout cannot
        // be.
        let (plan, each) = plan(length, n, if self.by_layout { 0 } else { REHEATS });
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
        let mut length = FIRST_GENERATION;
        for number in 0..MOST_GENERATIONS {
            let work = self.left.min((length * self.n as f64) as u64);
            let schedule = self.schedule(hot(length), work, 1.0, length);
            self.anneal(tree, &ScheduledRun { number, schedule, length, is_first: false });
            length *= GROWTH;
        }
    }

    fn reinsert(&mut self, tree: &mut Working<impl Metric>) {
        self.best.improve(tree, self.run, reinsertion::pass_by_area);
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
            if tree.refill(&self.best.tree).is_ok() {
                self.reinsert(tree);
            }
            // After a cancellation nobody continues from the tree.
            if self.run.stopped().is_none() {
                tree.reshape(&before, self.boxes);
            }
        } else if let Ok(mut aside) = Working::from_bvh(&self.best.tree, tree.metric()) {
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
                let in_time = self.probe(tree);
                self.secure(tree, in_time / n);
                TRIAL * in_time.min(self.left as f64)
            }
            Horizon::Known => TRIAL * self.left as f64,
            Horizon::Open => FIRST_GENERATION * n,
        };
        let length = work / n;
        for (number, tree) in [&mut *tree, &mut other].into_iter().enumerate() {
            let end = began + (1.0 - began) * TRIAL * (number + 1) as f64;
            let schedule = self.schedule(hot(length), work as u64, end, length);
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
        let quota = self.run.left().at_most(work);
        Schedule {
            hot: hot.max(COLD),
            cold: COLD,
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

    /// Makes moves at the lowest temperature. Returns the work that fits into the rest of the time
    /// at this rate.
    fn probe(&mut self, tree: &mut Working<impl Metric>) -> f64 {
        let observer = self.run.observer();
        let heat = [COLD; 2];
        let quota = self.run.left().at_most(self.left.min(PROBE * self.n));
        let rng = &mut stream(self.seed, 0);
        let began = observer.progress();
        let mut mover = RuinMover::new(Scale::Saved, PROBE as f64, self.by_layout);
        let tally = cool(&mut mover, tree, Vec::new(), heat, quota, rng, observer);
        let in_time = match (began, observer.progress()) {
            (Some(began), Some(now)) => {
                tally.work as f64 * (1.0 - now).max(0.0) / (now - began).max(1e-9)
            }
            _ => f64::INFINITY,
        };
        self.left = self.left.saturating_sub(tally.work);
        self.run.count(tally);
        in_time
    }

    /// Makes one annealing run from `tree` and recombines the tree with the result. The first run
    /// of a plan replaces the tree instead, if it ends better. If it does not and time is limited,
    /// the time was too short for annealing, and recombination is skipped, too.
    fn anneal(&mut self, tree: &mut Working<impl Metric>, planned: &ScheduledRun) {
        let ScheduledRun { number, ref schedule, length, is_first } = *planned;
        if self.run.stopped().is_some() || schedule.quota.work == 0 {
            return;
        }
        let observer: &dyn Observer = &Until { observer: self.run.observer(), end: schedule.end };
        let mut done = Tally::default();
        let mut rounds = 0;
        // Every run has room for 2⁴⁰ random streams, enough for 2¹⁶ rounds. Stream 0 belongs to the
        // probe, the last streams to the divider.
        let streams = [self.seed, 1 + (number << 40)];
        let mut division = stream(self.seed, (1 << 63) + number);
        let scale = if length < TOP_FROM { Scale::Saved } else { Scale::Top };
        let best = &mut *self.best;
        let run = &mut *self.run;
        let by_layout = self.by_layout;
        // Trees with different references cannot be recombined. Only the first run, which is not
        // recombined, may change references between its rounds; the other runs change them before
        // they begin.
        if let Some(divider) = self.divider.as_mut().filter(|_| !is_first) {
            tree.sort_in_preorder();
            let work = (schedule.quota.work as f64 * WORK_ON_REFERENCES) as u64;
            let tally = divider.pass(tree, run.left().at_most(work), &mut division, observer);
            run.count(tally);
            done += tally;
            best.offer(tree, run);
        }
        let metric = tree.metric();
        let cost_before = cost(tree, by_layout);
        let is_timed = observer.progress().is_some();
        // Recombination needs both trees, and a run that ends worse is discarded. A first run under
        // a time limit is not recombined, so that the incumbent can take the place of the tree,
        // unless a divider changes references or a trial compares two trees.
        let discards_to_incumbent =
            is_first && is_timed && !by_layout && self.divider.is_none() && number < TRIALS;
        let before = if discards_to_incumbent {
            best.offer(tree, run);
            Before::Incumbent
        } else if self.divider.is_some() {
            Before::Flat(tree.to_bvh())
        } else {
            Before::Shape(tree.shape())
        };
        let mut divider = self.divider.as_mut().filter(|_| is_first);
        anneal(
            || RuinMover::new(scale, length, by_layout),
            schedule,
            tree,
            streams,
            observer,
            &mut |tree, tally| {
                done += tally;
                run.count(tally);
                if let Some(divider) = divider.as_mut().filter(|_| !observer.cancelled()) {
                    let work = (tally.work as f64 * WORK_ON_REFERENCES) as u64;
                    let tally =
                        divider.pass(tree, run.left().at_most(work), &mut division, observer);
                    done += tally;
                    run.count(tally);
                }
                rounds += 1;
                // A cancelled search offers its tree below, once.
                let is_cancelled = run.stopped() == Some(StopReason::Cancelled);
                if by_layout && rounds % ROUNDS_PER_LOOK == 0 && !is_cancelled
                    || !by_layout && tree.area() < best.area * (1.0 - WORTH_AN_EVENT)
                {
                    best.offer(tree, run);
                }
            },
        );
        // The tree has been offered before, so that a cancelled search need not compare the two.
        // Nobody continues from the tree then, and a large one takes seconds to restore.
        if run.stopped() == Some(StopReason::Cancelled)
            && (by_layout || tree.objects() > RECOMBINED_AT_ONCE)
        {
            if done.kept > 0 {
                best.offer(tree, run);
            }
            return;
        }
        // The cost of a layout is no sum over clades, so such trees cannot be recombined.
        let is_better = cost(tree, by_layout) < cost_before;
        let is_recombined = !by_layout && !(is_first && (is_better || is_timed));
        if is_recombined || !is_better {
            // Recombination needs both trees.
            let annealed = is_recombined.then(|| std::mem::take(&mut tree.nodes));
            before.restore(tree, best, self.boxes);
            if let Some(annealed) = annealed {
                let annealed = Working::from_nodes(annealed, metric);
                *tree = recombine(&[&*tree, &annealed]);
            }
        }
        best.offer(tree, run);
        self.left = self.left.saturating_sub(done.work);
    }
}

struct Planned {
    hot: f64,
    /// The fraction of all work or time at which the run ends.
    until: f64,
}

/// Returns the annealing runs for `length` work per object, and the work per object of each long
/// run including its short runs, of which `most` follow a run that is long enough.
fn plan(length: f64, n: u64, most: u32) -> (Vec<Planned>, f64) {
    let longest = LONGEST.min(WORK_PER_PAIR * n as f64);
    // Runs of equal length: a short last run would begin at a low temperature.
    let long_runs = (length / longest).ceil().clamp(1.0, MOST_GENERATIONS as f64);
    let length_of_run = length / long_runs;
    let hot_of_run = hot(length_of_run);
    let reheats = if length_of_run < REHEATS_FROM { 0 } else { most };
    let kept = if reheats == 0 { 0.0 } else { REHEATED };
    let mut plan = Vec::new();
    for number in 0..long_runs as u64 {
        for reheat in 0..=reheats {
            // A short run never starts hotter than its long run.
            let hot = if reheat == 0 { hot_of_run } else { hot_of_run.min(REHEAT) };
            let part = 1.0 - kept + kept * f64::from(reheat) / f64::from(reheats.max(1));
            plan.push(Planned { hot, until: (number as f64 + part) / long_runs });
        }
    }
    (plan, length_of_run)
}

/// Returns the first temperature of an annealing run of `length` work per object, unless the last
/// temperature is higher.
fn hot(length: f64) -> f64 {
    (HEAT * length / 1000.0).min(HOTTEST)
}

fn cost(tree: &Working<impl Metric>, by_layout: bool) -> f64 {
    if by_layout { tree.layout_cost() } else { tree.area() }
}

/// An observer that also cancels when the progress reaches `end`.
struct Until<'a> {
    observer: &'a dyn Observer,
    end: f64,
}

impl Observer for Until<'_> {
    fn cancelled(&self) -> bool {
        self.observer.cancelled() || self.progress().is_some_and(|now| now >= self.end)
    }

    fn progress(&self) -> Option<f64> {
        self.observer.progress()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Budget, solve};
    use crate::scatter::{Does, scatter};
    use crate::tree::HalfArea;

    #[test]
    fn a_plan_has_equal_long_runs_and_short_ones_after_those_that_are_long_enough() {
        assert_eq!([500.0, 1000.0, 1e6].map(hot), [0.01, 0.02, 0.2]);
        let short = [0.14, 0.07, 0.07, 0.07, 0.07, 0.07, 0.07];
        for (length, n, most, each, hots, ends) in [
            (6999.0, 1_000_000, 6, 6999.0, &[0.139_98][..], &[1.0][..]),
            (7000.0, 1_000_000, 6, 7000.0, &short, &[0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0]),
            (7000.0, 1_000_000, 0, 7000.0, &short[..1], &[1.0]),
            (7000.0, 1_000_000, 1, 7000.0, &short[..2], &[0.7, 1.0]),
            // Ten objects get 2000 at once.
            (5000.0, 10, 6, 5000.0 / 3.0, &[1.0 / 30.0; 3], &[1.0 / 3.0, 2.0 / 3.0, 1.0]),
        ] {
            let (plan, found) = plan(length, n, most);
            let close = |found: f64, expected: f64| (found - expected).abs() < 1e-12;
            assert!(close(found, each) && plan.len() == hots.len(), "{length} {n} {most}");
            for (planned, (hot, end)) in plan.iter().zip(hots.iter().zip(ends)) {
                assert!(close(planned.hot, *hot) && close(planned.until, *end), "{length} {n}");
            }
        }
        let (plan, each) = plan(250_000.0, 1_000_000, 6);
        assert_eq!((plan.len(), each), (21, 250_000.0 / 3.0));
        assert!(plan.is_sorted_by(|a, b| a.until < b.until) && plan[6].until == 1.0 / 3.0);
    }

    #[test]
    fn a_run_begins_no_colder_than_it_ends_and_a_later_one_goes_on_from_what_it_has_found() {
        let boxes = scatter(300);
        let problem = Problem::new(&boxes);
        let search = Does(|run: &mut Run| {
            let (mut best, mut tree) =
                Incumbent::build(&problem, HalfArea::default(), run).unwrap();
            let before = tree.area();
            let mut search = Improvement {
                config: &Config::default(),
                boxes: &boxes,
                seed: 1,
                n: 300,
                left: 300_000,
                by_layout: false,
                divider: None,
                best: &mut best,
                run,
                is_secured: false,
            };
            let schedule = |hot| search.schedule(hot, 300_000, 1.0, 1000.0);
            assert_eq!([0.0, 0.1].map(|hot| schedule(hot).hot), [COLD, 0.1]);
            let schedule = schedule(0.02);
            let later = ScheduledRun { number: 1, schedule, length: 1000.0, is_first: false };
            search.anneal(&mut tree, &later);
            assert!(tree.area() < 0.99 * before, "{} {before}", tree.area());
            best.tree
        });
        solve(&search, &problem, 1, Budget::UNLIMITED, &()).unwrap();
    }
}
