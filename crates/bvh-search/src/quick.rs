//! Small budgets: agglomerative clustering, and reinsertion of the largest nodes for as long as there is time.
//!
//! Bittner, Hapala & Havran 2013 reinsert those nodes first that cost most: few nodes near the root have most of the
//! area that can be saved. Above these budgets annealing from a greedy division ends lower.
//!
//! A time is compared with that of sorting the objects along a curve, which comes first in any case: so many times that
//! long, what can be done, found by measurement. The sort takes about 20 ns per object.

use crate::incumbent::Incumbent;
use crate::reinsertion::{sort_by_area, sweep};
use crate::start::construction;
use crate::working::Working;
use crate::{Observer, Problem, Run, SearchError, Tally};
use bvh_build::Builder;
use bvh_build::agglomerative::{Along, Config};
use bvh_core::{Bvh, cost};

/// What a small budget was enough for.
pub(crate) enum Quick<'p> {
    /// A tree.
    Tree(Bvh),
    /// A local optimum of reinsertion before its end: there is time to go on.
    Optimum(Incumbent<'p>, Working),
}

/// Work per object from which on a budget is not small.
const MOST_WORK: u64 = 64;

/// Times the sort's time from which on a budget is not small.
const MOST_TIME: f64 = 24.0;

/// Work per object, and times the sort's time, from which on the better of two starts is taken. Division is ahead on
/// smooth surfaces; it takes ten times as long as the sort.
const TWO_STARTS: (u64, f64) = (30, 18.0);

/// What so many times the sort's time are enough for, without any reinsertion.
const BUILDS: [(f64, Config); 4] = [
    (2.6, Config { radius: 1, near_rounds: 0 }),
    (3.6, Config { radius: 2, near_rounds: 0 }),
    (4.4, Config { radius: 8, near_rounds: 2 }),
    (5.4, LONGEST_BUILD),
];

/// The last of them is best up to a longer time in [`LARGE`] scenes, whose conversions take longer.
const LARGE_BUILD: (f64, Config) = (6.5, LONGEST_BUILD);

const LONGEST_BUILD: Config = Config { radius: 14, near_rounds: 1 };

/// The start of reinsertion.
const START: Config = Config { radius: 8, near_rounds: 2 };

/// Objects whose nodes do not fit into a core's cache.
const LARGE: usize = 1 << 14;

/// The search for a small budget; nothing if it is not small.
pub(crate) fn search<'p>(problem: &Problem<'p>, run: &mut Run) -> Result<Option<Quick<'p>>, SearchError> {
    let (observer, n) = (run.observer(), problem.boxes.len());
    let (began, work) = (observer.progress(), run.left().work / n.max(1) as u64);
    let large = n >= LARGE;
    if n < 3 || began.is_none() && work >= MOST_WORK {
        return Ok(None);
    }
    let along = Along::new(problem.boxes)?;
    let mut two_starts = work >= TWO_STARTS.0;
    if let (Some(began), Some(sorted)) = (began, observer.progress()) {
        let times = (1.0 - began) / (sorted - began).max(1e-9);
        if times >= MOST_TIME {
            return Ok(None);
        }
        let builds = BUILDS.into_iter().chain(large.then_some(LARGE_BUILD));
        if let Some((_, config)) = builds.into_iter().find(|(enough, _)| times < *enough) {
            return Ok(Some(Quick::Tree(Incumbent::begin_unbounded(along.build(&config)?, problem, run).tree)));
        }
        two_starts = times >= TWO_STARTS.1;
    }
    let (mut start, mut front) = (along.build(&START)?, FRONT);
    if two_starts {
        let divided = construction().build(problem.boxes)?;
        run.count(Tally { moves: 1, kept: 0, work: divided.nodes.len() as u64 });
        if cost::internal_area(&divided) < cost::internal_area(&start) {
            (start, front) = (divided, usize::MAX);
        }
    }
    let built = observer.progress();
    let mut best = Incumbent::begin_unbounded(start, problem, run);
    if built.is_none() {
        best.bound(run);
    }
    let mut tree = Working::from_tight(&best.tree, best.area())?;
    // The conversion at the end takes about as long as the one at the beginning, or what the caches make of it.
    let finish = if large { 2.7 } else { 1.5 };
    let end = match (built, observer.progress()) {
        (Some(built), Some(now)) => 1.0 - finish * (now - built),
        _ => f64::INFINITY,
    };
    let still = reinsert_largest(&mut tree, front, end, run);
    if still {
        best.offer(&tree, run);
        if built.is_some() {
            best.bound(run);
        }
        return Ok(Some(Quick::Optimum(best, tree)));
    }
    if built.is_some() {
        best.offer_level_by_level(&tree, run);
    } else {
        best.offer(&tree, run);
    }
    Ok(Some(Quick::Tree(best.tree)))
}

/// Part of all nodes that are tried first; twice as many every time.
const FIRST: f64 = 0.01;

/// Moves between two looks at the clock.
const MOVES: usize = 32;

/// Reinsertion of more and more of the largest nodes, until the observer's progress is at `end` or the run stops.
/// Returns whether a local optimum came first.
fn reinsert_largest(tree: &mut Working, front: usize, end: f64, run: &mut Run) -> bool {
    let observer: &dyn Observer = run.observer();
    let (mut part, mut order) = (FIRST, Vec::new());
    loop {
        largest(tree, part, front, &mut order);
        let mut kept = 0;
        for some in order.chunks(MOVES) {
            if run.stopped().is_some() || observer.progress().is_some_and(|now| now >= end) {
                return false;
            }
            let tally = sweep(tree, some, run.left(), observer);
            run.count(tally);
            kept += tally.kept;
        }
        if part >= 1.0 && kept == 0 {
            return true;
        }
        part = (2.0 * part).min(1.0);
    }
}

/// Nodes among which the largest are looked for, for each of these: clustering makes large ones last, and they come
/// first.
const FRONT: usize = 4;

/// The largest nodes, about this part of all, the largest first, equal ones by index. Only so many of the first nodes
/// are looked at, times the number of nodes asked for.
fn largest(tree: &Working, part: f64, front: usize, order: &mut Vec<u32>) {
    let nodes = tree.nodes.len() - 1;
    let count = ((part * nodes as f64) as usize).clamp(1, nodes);
    order.clear();
    order.extend(1..=count.saturating_mul(front).min(nodes) as u32);
    if count < order.len() {
        let area = |at: u32| tree.nodes[at as usize].area;
        order.select_nth_unstable_by(count, |&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
        order.truncate(count);
        order.sort_unstable();
    }
    sort_by_area(tree, order);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::scatter;
    use crate::{Budget, portfolio, solve};
    use bvh_core::validate;
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

    /// A clock that is asked a number of times before the time is over.
    struct Asked {
        times: u32,
        asked: AtomicU32,
    }

    impl Observer for Asked {
        fn progress(&self) -> Option<f64> {
            Some(f64::from(self.asked.fetch_add(1, Relaxed)) / f64::from(self.times))
        }
        fn cancelled(&self) -> bool {
            self.asked.load(Relaxed) >= self.times
        }
    }

    #[test]
    fn every_small_budget_gives_a_valid_tree_and_the_next_no_worse_a_one() {
        let boxes = scatter(300);
        let mut before = f64::INFINITY;
        for work in [1, 600, 1200, 2400, 4800, 9600, 19_000] {
            let budget = Budget { max_work: Some(work), ..Budget::default() };
            let found = solve(&portfolio::Config::default(), &Problem::new(&boxes), 1, budget, &()).unwrap();
            validate(&found.tree, &boxes).unwrap();
            assert_eq!(cost::internal_area(&found.tree), found.cost);
            assert!(found.cost <= before, "{work}");
            before = found.cost;
        }
    }

    #[test]
    fn every_short_time_gives_a_valid_tree() {
        let boxes = scatter(300);
        for times in 1..70 {
            let clock = Asked { times, asked: AtomicU32::new(0) };
            let found =
                solve(&portfolio::Config::default(), &Problem::new(&boxes), 1, Budget::default(), &clock);
            validate(&found.unwrap().tree, &boxes).unwrap();
        }
    }

    #[test]
    fn a_start_that_is_named_is_the_start() {
        let boxes = scatter(300);
        let start = crate::start::Start::MullerFellner(Default::default());
        let config = portfolio::Config { start: Some(start), ..Default::default() };
        let budget = Budget { max_work: Some(1), ..Budget::default() };
        let found = solve(&config, &Problem::new(&boxes), 1, budget, &()).unwrap();
        let named = bvh_build::muller_fellner::Config::default().build(&boxes).unwrap();
        assert_eq!(found.cost, cost::internal_area(&named));
    }

    #[test]
    fn the_largest_nodes_are_those_that_a_full_sort_puts_first() {
        let boxes = scatter(300);
        let tree = Config::default().build(&boxes).unwrap();
        let tree = Working::from_tight(&tree, 0.0).unwrap();
        let mut all: Vec<u32> = (1..tree.nodes.len() as u32).collect();
        sort_by_area(&tree, &mut all);
        let mut order = Vec::new();
        for part in [0.001, 0.1, 0.5, 1.0] {
            largest(&tree, part, usize::MAX, &mut order);
            assert_eq!(order, all[..order.len()]);
        }
        assert_eq!(order.len(), all.len());
    }
}
