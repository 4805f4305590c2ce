//! Small budgets: agglomerative clustering, and reinsertion of the largest nodes for as long as there is time.
//!
//! Bittner, Hapala & Havran 2013 reinsert those nodes first that cost most: few nodes near the root have most of the
//! area that can be saved. Above these budgets annealing from a greedy division ends lower.
//!
//! A time is compared with that of sorting the objects along a curve, which comes first in any case: so many times that
//! long, what can be done, found by measurement. The sort takes about 25 ns per object.

mod siblings;

use crate::incumbent::Incumbent;
use crate::place::Linked;
use crate::reinsertion::sweep;
use crate::start::construction;
use crate::working::Working;
use crate::{Observer, Problem, Run, SearchError, Tally};
use bvh_build::Builder;
use bvh_build::ploc::{Config, MortonOrder};
use bvh_core::{Aabb, Bvh, cost};
use siblings::Siblings;

/// What a small budget was enough for.
pub(crate) enum Quick<'p> {
    /// A tree.
    Tree(Bvh),
    /// A local optimum of reinsertion before its end: there is time to go on.
    Optimum(Incumbent<'p>, Working),
}

/// Work per object from which on annealing ends lower.
const MOST_WORK: u64 = 20;

/// Times the sort's time from which on annealing ends lower, with one thread. The division that it begins with takes 14 to
/// 20 of them, 27 where objects are sorted quickly, and half as much again when the machine is disturbed. With 35 annealing
/// gains one percent on some scenes and loses ten on others.
const MOST_TIME: f64 = 45.0;

/// How many times as long the sort may take in memory that is used for the first time.
const COLD: f64 = 2.5;

/// Times the sort's time from which on the better of two starts is taken, with one thread. Division is ahead on smooth
/// surfaces.
const TWO_STARTS: f64 = 28.0;

/// What so many times the sort's time are enough for, without any reinsertion.
const BUILDS: [(f64, Config); 4] = [
    (2.5, Config { radius: 1, near_rounds: 0 }),
    (2.75, Config { radius: 2, near_rounds: 0 }),
    (3.0, Config { radius: 4, near_rounds: 2 }),
    (3.5, START),
];

/// The start of reinsertion.
const START: Config = Config { radius: 5, near_rounds: 1 };

/// Times the sort's time that a tree takes after its reinsertion, to be put in order and valued.
const FINISH: f64 = 0.75;

/// The search for a small budget; nothing if it is not small.
pub(crate) fn search<'p>(problem: &Problem<'p>, run: &mut Run) -> Result<Option<Quick<'p>>, SearchError> {
    let (observer, n) = (run.observer(), problem.boxes.len());
    let (began, work) = (observer.progress(), run.left().work / n.max(1) as u64);
    if n < 3 || began.is_none() && work >= MOST_WORK {
        return Ok(None);
    }
    let along = MortonOrder::new(problem.boxes)?;
    let (mut two_starts, mut end) = (false, f64::INFINITY);
    if let (Some(began), Some(sorted)) = (began, observer.progress()) {
        let sort = (sorted - began).max(1e-9);
        let times = (1.0 - began) / sort;
        let [two_starts_from, annealing_from] = [TWO_STARTS, MOST_TIME].map(|times| times * part_by_threads());
        if times >= annealing_from
            || times >= annealing_from / COLD && (1.0 - began) / warm_sort(problem, observer)? >= annealing_from
        {
            return Ok(None);
        }
        if let Some((_, config)) = BUILDS.into_iter().find(|(enough, _)| times < *enough) {
            return Ok(Some(Quick::Tree(Incumbent::begin_unbounded(along.build(&config)?, problem, run).tree)));
        }
        (two_starts, end) = (times >= two_starts_from, 1.0 - FINISH * sort);
    }
    let two_starts = two_starts && division_may_be_ahead(&along, problem, run)?;
    let (mut start, mut front) = (along.build(&START)?, FRONT);
    if two_starts {
        let divided = construction().build(problem.boxes)?;
        run.count(Tally { moves: 1, kept: 0, work: divided.nodes.len() as u64 });
        if cost::internal_area(&divided) < cost::internal_area(&start) {
            (start, front) = (divided, usize::MAX);
        }
    }
    // If there is a clock, the start is not valued: what becomes of it is better.
    let mut before = None;
    if began.is_none() {
        before = Some(Incumbent::begin(start.clone(), problem, run));
    } else {
        run.count(Tally { moves: 1, kept: 0, work: start.nodes.len() as u64 });
    }
    let mut tree = Siblings::new(start);
    let still = reinsert_largest(&mut tree, front, end, run);
    let tree = tree.into_tree();
    let mut best = match before {
        Some(mut best) => {
            best.offer_tree(tree, run);
            best
        }
        None => Incumbent::begin_unbounded(tree, problem, run),
    };
    if !still {
        return Ok(Some(Quick::Tree(best.tree)));
    }
    if began.is_some() {
        best.bound(run);
    }
    let tree = best.working()?;
    Ok(Some(Quick::Optimum(best, tree)))
}

/// The part of one thread's times that is enough with several: two divide in 0.58 of the time of one, but do not sort any
/// faster.
#[cfg(feature = "rayon")]
const SEVERAL_THREADS: f64 = 0.65;

/// The part of one thread's times that is enough here.
fn part_by_threads() -> f64 {
    #[cfg(feature = "rayon")]
    if rayon::current_num_threads() > 1 {
        return SEVERAL_THREADS;
    }
    1.0
}

/// The sort is timed again on so many times fewer objects.
const TIMED: usize = 16;

/// The part of the time that the sort would take in memory that has been used before, as what follows is; about.
fn warm_sort(problem: &Problem, observer: &dyn Observer) -> Result<f64, SearchError> {
    let boxes = &problem.boxes[..problem.boxes.len().div_ceil(TIMED)];
    let began = observer.progress().unwrap_or(0.0);
    MortonOrder::new(boxes)?;
    let took = observer.progress().unwrap_or(0.0) - began;
    Ok((took * problem.boxes.len() as f64 / boxes.len() as f64).max(1e-9))
}

/// Stretches of the curve on which the two starts are compared, and one over the part of all objects that they have.
const SAMPLES: (usize, usize) = (8, 8);

/// Objects below which the comparison saves nothing.
const SAMPLED: usize = 2048;

/// Cost of division over that of clustering there, below which it is well ahead on the whole: on smooth surfaces it is
/// 0.92 to 0.97, else 0.98 to 1.10.
const AHEAD: f64 = 0.975;

/// Whether a division is worth its time: it must be ahead on parts of the scene. Takes about a tenth of that time.
fn division_may_be_ahead(along: &MortonOrder, problem: &Problem, run: &mut Run) -> Result<bool, SearchError> {
    let (order, (stretches, part)) = (along.order(), SAMPLES);
    if order.len() < SAMPLED {
        return Ok(true);
    }
    let (mut divided, mut clustered) = (0.0, 0.0);
    for stretch in order.chunks(order.len().div_ceil(stretches)) {
        let objects = &stretch[..stretch.len() / part];
        let boxes: Vec<Aabb> = objects.iter().map(|&object| problem.boxes[object as usize]).collect();
        divided += cost::internal_area(&construction().build(&boxes)?);
        clustered += cost::internal_area(&START.build(&boxes)?);
        run.count(Tally { moves: 2, kept: 0, work: 4 * boxes.len() as u64 });
    }
    Ok(divided < AHEAD * clustered)
}

/// Part of all nodes that are tried first; twice as many every time.
const FIRST: f64 = 0.01;

/// Moves between two looks at the clock.
const MOVES: usize = 16;

/// Reinsertion of more and more of the largest nodes, until the observer's progress is at `end` or the run stops.
/// Returns whether a local optimum came first.
fn reinsert_largest(tree: &mut Siblings, front: usize, end: f64, run: &mut Run) -> bool {
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
fn largest(tree: &Siblings, part: f64, front: usize, order: &mut Vec<u32>) {
    let nodes = tree.len() - 1;
    let count = ((part * nodes as f64) as usize).clamp(1, nodes);
    let looked_at = 1..=count.saturating_mul(front).min(nodes) as u32;
    // No area is below zero, so that they are ordered as their bits are.
    let key = |at: u32| (!tree.area(at).to_bits(), at);
    let mut keyed: Vec<(u64, u32)> = looked_at.map(key).collect();
    if count < keyed.len() {
        keyed.select_nth_unstable(count);
        keyed.truncate(count);
    }
    keyed.sort_unstable();
    order.clear();
    order.extend(keyed.into_iter().map(|(_, at)| at));
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
        for work in [1, 600, 1200, 2400, 4800, 5900] {
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
        for times in 1..100 {
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
        let tree = Siblings::new(tree);
        let mut all: Vec<u32> = (1..tree.len() as u32).collect();
        all.sort_by(|&a, &b| tree.area(b).total_cmp(&tree.area(a)));
        let mut order = Vec::new();
        for part in [0.001, 0.1, 0.5, 1.0] {
            largest(&tree, part, usize::MAX, &mut order);
            assert_eq!(order, all[..order.len()]);
        }
        assert_eq!(order.len(), all.len());
    }
}
