//! Budgets of milliseconds: clustering along the Morton curve, then reinsertion of the largest
//! nodes until the time is over.
//!
//! Bittner, Hapala & Havran 2013 first reinsert the most expensive nodes, because a few nodes near
//! the root hold most of the area that can be saved. With larger budgets, annealing from a top-down
//! division ends lower.
//!
//! Time limits are multiples of the duration of the Morton sort, which always runs first.

use crate::local::incumbent::Incumbent;
use crate::local::initial::construction;
use crate::local::reinsertion::pass;
use crate::parallel::threads;
use crate::run::{Kept, Observer, Problem, Run, SearchError, Tally, watched};
use crate::tree::{Linked, Siblings};
use crate::tuning::{
    ANNEAL_FROM_TIME, ANNEAL_FROM_WORK, BUILDS, CLUSTERING, COLD_MEMORY, FINISH_TIME, FIRST_PASS,
    FRONT, MOVES_PER_READING, SAMPLED_FROM, SAMPLED_PART, SAMPLES, SEVERAL_THREADS, TOP_DOWN_BELOW,
    TWO_STARTS_FROM_TIME, WARM_SAMPLE,
};
use bvh_build::ploc::MortonOrder;
use bvh_build::{BuildError, Builder};
use bvh_core::{Aabb, Bvh, cost};

/// The result of a small budget.
#[allow(clippy::large_enum_variant, reason = "one is made per search, and taken apart at once")]
pub(super) enum SmallBudget<'p> {
    /// The budget is not small. Holds the objects in Morton order, if a time limit required the
    /// sort.
    Large(Option<MortonOrder>),
    /// The budget is used up.
    Tree(Bvh),
    /// Reinsertion reached a local optimum before the end of the budget, so the search can
    /// continue.
    LocalOptimum(Incumbent<'p>),
}

/// Searches within a small budget.
pub(super) fn search<'p>(
    problem: &Problem<'p>,
    run: &mut Run,
) -> Result<SmallBudget<'p>, SearchError> {
    let observer = run.observer();
    let n = problem.boxes.len();
    let began = observer.progress();
    let work = run.left().work / n.max(1) as u64;
    // Without a clock the decision depends on the work alone, which keeps the result reproducible.
    if n < 3 || began.is_none() && work >= ANNEAL_FROM_WORK {
        return Ok(SmallBudget::Large(None));
    }
    let morton = MortonOrder::new(problem.boxes)?;
    let mut has_two_starts = false;
    let mut end = f64::INFINITY;
    if let (Some(began), Some(sorted)) = (began, observer.progress()) {
        // A coarse clock may not have advanced; the bound avoids a division by zero.
        let sort = (sorted - began).max(1e-9);
        let times = (1.0 - began) / sort;
        let by_threads = if threads() > 1 { SEVERAL_THREADS } else { 1.0 };
        let [two_starts_from, annealing_from] =
            [TWO_STARTS_FROM_TIME, ANNEAL_FROM_TIME].map(|times| times * by_threads);
        if times >= annealing_from
            || times >= annealing_from / COLD_MEMORY
                && (1.0 - began) / warm_sort(problem, observer)? >= annealing_from
        {
            return Ok(SmallBudget::Large(Some(morton)));
        }
        if let Some((_, config)) = BUILDS
            .into_iter()
            .find(|(enough, _)| times < *enough)
        {
            let tree = Kept::new(morton.build(&config)?, problem);
            return Ok(SmallBudget::Tree(Incumbent::begin_unbounded(tree, problem, run).tree));
        }
        // Stop early enough to order and evaluate the tree.
        has_two_starts = times >= two_starts_from;
        end = 1.0 - FINISH_TIME * sort;
    }
    let tries_division = has_two_starts && top_down_may_be_better(&morton, problem, run)?;
    let mut start = morton.build(&CLUSTERING)?;
    let mut front = FRONT;
    if tries_division && let Some(divided) = divided(problem.boxes, run)? {
        run.count(Tally { moves: 1, kept: 0, work: divided.nodes.len() as u64 });
        if cost::internal_area(&divided) < cost::internal_area(&start) {
            start = divided;
            // A division has its largest nodes anywhere, not only at the front.
            front = usize::MAX;
        }
    }
    // A time-limited search does not evaluate the initial tree: reinsertion never makes it worse,
    // and the evaluation would take the time of many moves.
    let mut before = None;
    if began.is_none() {
        before = Some(Incumbent::begin(Kept::new(start.clone(), problem), problem, run));
    } else {
        run.count(Tally { moves: 1, kept: 0, work: start.nodes.len() as u64 });
    }
    let mut tree = Siblings::new(start);
    let is_local_optimum = reinsert_largest(&mut tree, front, end, run);
    let tree = tree.into_tree();
    let mut best = match before {
        Some(mut best) => {
            best.offer_tree(tree, run);
            best
        }
        None => Incumbent::begin_unbounded(Kept::new(tree, problem), problem, run),
    };
    if !is_local_optimum {
        return Ok(SmallBudget::Tree(best.tree));
    }
    if began.is_some() {
        best.bound(run);
    }
    Ok(SmallBudget::LocalOptimum(best))
}

/// Returns the top-down division; `None` if the observer cancels first.
fn divided(boxes: &[Aabb], run: &Run) -> Result<Option<Bvh>, SearchError> {
    match watched(run.observer(), |watch| construction().build_watched(boxes, None, watch)) {
        Err(BuildError::Cancelled) => Ok(None),
        built => Ok(Some(built?)),
    }
}

/// Estimates the duration of the sort in warm memory, in which the later steps run, as a fraction
/// of all time.
fn warm_sort(problem: &Problem, observer: &dyn Observer) -> Result<f64, SearchError> {
    let boxes = &problem.boxes[..problem.boxes.len().div_ceil(WARM_SAMPLE)];
    let began = observer.progress().unwrap_or(0.0);
    MortonOrder::new(boxes)?;
    let took = observer.progress().unwrap_or(0.0) - began;
    Ok((took * problem.boxes.len() as f64 / boxes.len() as f64).max(1e-9))
}

/// Returns whether a top-down build is worth its time: it must be better than clustering on samples
/// of the scene. The samples take about a tenth of the full build's time.
fn top_down_may_be_better(
    morton: &MortonOrder,
    problem: &Problem,
    run: &mut Run,
) -> Result<bool, SearchError> {
    let order = morton.order();
    if order.len() < SAMPLED_FROM {
        return Ok(true);
    }
    let mut divided = 0.0;
    let mut clustered = 0.0;
    for stretch in order.chunks(order.len().div_ceil(SAMPLES)) {
        let objects = &stretch[..stretch.len() / SAMPLED_PART];
        let boxes: Vec<Aabb> = objects
            .iter()
            .map(|&object| problem.boxes[object as usize])
            .collect();
        let Some(tree) = self::divided(&boxes, run)? else { return Ok(false) };
        divided += cost::internal_area(&tree);
        clustered += cost::internal_area(&CLUSTERING.build(&boxes)?);
        run.count(Tally { moves: 2, kept: 0, work: 4 * boxes.len() as u64 });
    }
    Ok(divided < TOP_DOWN_BELOW * clustered)
}

/// Reinserts more and more of the largest nodes, until the observer's progress reaches `end` or the
/// run stops. Returns whether it reached a local optimum first.
fn reinsert_largest(tree: &mut Siblings, front: usize, end: f64, run: &mut Run) -> bool {
    let observer: &dyn Observer = run.observer();
    let mut part = FIRST_PASS;
    let mut order = Vec::new();
    loop {
        largest(tree, part, front, &mut order);
        let mut kept = 0;
        for some in order.chunks(MOVES_PER_READING) {
            if run.stopped().is_some() || observer.progress().is_some_and(|now| now >= end) {
                return false;
            }
            let tally = pass(tree, some, run.left(), observer);
            run.count(tally);
            kept += tally.kept;
        }
        // Only a pass over all nodes that keeps no move proves a local optimum.
        if part >= 1.0 && kept == 0 {
            return true;
        }
        part = (2.0 * part).min(1.0);
    }
}

/// Selects the k largest nodes, the largest first and equal nodes by index, where k is about the
/// fraction `part` of all nodes. Examines only the first `front` · k nodes.
fn largest(tree: &Siblings, part: f64, front: usize, order: &mut Vec<u32>) {
    let nodes = tree.len() - 1;
    let count = ((part * nodes as f64) as usize).clamp(1, nodes);
    let examined = 1..=count.saturating_mul(front).min(nodes) as u32;
    // Areas are never negative, so their bits have the same order. Inverted bits put the largest
    // first, and the index breaks ties.
    let mut keyed: Vec<(u64, u32)> = examined
        .map(|index| (!tree.area(index).to_bits(), index))
        .collect();
    if count < keyed.len() {
        // Selection first makes the sort O(k log k) instead of O(n log n).
        keyed.select_nth_unstable(count);
        keyed.truncate(count);
    }
    keyed.sort_unstable();
    order.clear();
    order.extend(keyed.into_iter().map(|(_, index)| index));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::best;
    use crate::run::{Budget, solve};
    use crate::scatter::scatter;
    use bvh_build::ploc;
    use bvh_core::validate;
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

    /// A clock whose time is over after a number of readings.
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
            let budget = Budget { max_work: Some(work), ..Budget::UNLIMITED };
            let found =
                solve(&best::Config::default(), &Problem::new(&boxes), 1, budget, &()).unwrap();
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
            let found = solve(
                &best::Config::default(),
                &Problem::new(&boxes),
                1,
                Budget::UNLIMITED,
                &clock,
            );
            validate(&found.unwrap().tree, &boxes).unwrap();
        }
    }

    #[test]
    fn a_start_that_is_named_is_the_start() {
        let boxes = scatter(300);
        let start = crate::local::initial::Start::MullerFellner(Default::default());
        let config = best::Config { start: Some(start), ..Default::default() };
        let budget = Budget { max_work: Some(1), ..Budget::UNLIMITED };
        let found = solve(&config, &Problem::new(&boxes), 1, budget, &()).unwrap();
        let named = bvh_build::muller_fellner::Config::default()
            .build(&boxes)
            .unwrap();
        assert_eq!(found.cost, cost::internal_area(&named));
    }

    #[test]
    fn the_largest_nodes_are_those_that_a_full_sort_puts_first() {
        let boxes = scatter(300);
        let tree = ploc::Config::default().build(&boxes).unwrap();
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
