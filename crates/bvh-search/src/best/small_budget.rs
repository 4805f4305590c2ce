//! Budgets of milliseconds: clustering along the Morton curve, then reinsertion of the largest
//! nodes until the time is over.
//!
//! Bittner, Hapala & Havran 2013 first reinsert the most expensive nodes, because a few nodes near
//! the root hold most of the area that can be saved. With larger budgets, annealing from a top-down
//! division ends lower.
//!
//! Under a time limit, the Morton sort, which always runs first, tells how long the other steps will
//! take: its duration follows the machine and the scene as theirs do. Clocks tell fractions of all
//! time.

use crate::local::incumbent::Incumbent;
use crate::local::reinsertion::pass;
use crate::parallel::threads;
use crate::run::{Kept, Observer, Problem, Run, SearchError};
use crate::tree::{HalfArea, Working};
use crate::tuning::{
    ANNEAL_FROM_TIME, ANNEAL_FROM_WORK, CLUSTERING, COLD_MEMORY, FINISH_TIME, FIRST_PASS, FRONT,
    MOVES_PER_READING, SEVERAL_THREADS, WARM_SAMPLE,
};
use bvh_build::Watch;
use bvh_build::ploc::MortonOrder;

/// Improves a clustering by reinsertion as far as a small budget reaches. Also returns whether this
/// ended in a local optimum, so that the rest of the budget remains. `None` if the budget is not
/// small; `sorted` then receives the objects in Morton order, if a time limit required the sort.
pub(super) fn search<'p>(
    problem: &Problem<'p>,
    sorted: &mut Option<MortonOrder>,
    run: &mut Run,
) -> Result<Option<(Incumbent<'p>, bool)>, SearchError> {
    let observer = run.observer();
    let n = problem.boxes.len();
    let began = observer.progress();
    let work = run.left().work / n.max(1) as u64;
    // Without a clock the decision depends on the work alone, which keeps the result reproducible.
    if n < 3 || began.is_none() && work >= ANNEAL_FROM_WORK {
        return Ok(None);
    }
    let morton = MortonOrder::new(problem.boxes)?;
    let mut end = f64::INFINITY;
    if let (Some(began), Some(now)) = (began, observer.progress()) {
        let sort = (now - began).max(SHORTEST_SORT);
        if is_enough_for_annealing(1.0 - began, sort, problem, observer)? {
            *sorted = Some(morton);
            return Ok(None);
        }
        // Reinsertion must end early enough for the conversion and the evaluation of the tree.
        end = 1.0 - FINISH_TIME * sort;
    }
    let clustered = morton.build(&CLUSTERING, None, &Watch::default())?;
    let mut best = Incumbent::begin(Kept::new(clustered, problem), problem, run);
    let mut tree = Working::from_bvh(&best.tree, HalfArea::default())?;
    let is_local_optimum = reinsert_largest(&mut tree, end, run);
    best.offer(&tree, run);
    Ok(Some((best, is_local_optimum)))
}

/// The shortest duration of a sort, as a fraction of all time: a coarse clock may not advance during
/// one.
const SHORTEST_SORT: f64 = 1e-9;

/// Returns whether annealing ends lower than clustering and reinsertion in this time, after a sort
/// of this duration.
fn is_enough_for_annealing(
    time: f64,
    sort: f64,
    problem: &Problem,
    observer: &dyn Observer,
) -> Result<bool, SearchError> {
    let several = if threads() > 1 { SEVERAL_THREADS } else { 1.0 };
    let sorts = several * ANNEAL_FROM_TIME;
    if time >= sorts * sort || time < sorts / COLD_MEMORY * sort {
        return Ok(time >= sorts * sort);
    }
    // The sort may have been slow because it was the first to use its memory. The later steps run
    // in warm memory.
    let sample = &problem.boxes[..problem.boxes.len().div_ceil(WARM_SAMPLE)];
    let began = observer.progress().unwrap_or(0.0);
    MortonOrder::new(sample)?;
    let took = observer.progress().unwrap_or(0.0) - began;
    let warm = took * problem.boxes.len() as f64 / sample.len() as f64;
    Ok(time >= sorts * warm.max(SHORTEST_SORT))
}

/// Reinserts more and more of the largest nodes, until the observer's progress reaches `end` or the
/// run stops. Returns whether it reached a local optimum first.
fn reinsert_largest(tree: &mut Working, end: f64, run: &mut Run) -> bool {
    let observer = run.observer();
    let mut part = FIRST_PASS;
    let mut order = Vec::new();
    loop {
        select_largest(tree, part, &mut order);
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

/// Writes the k largest nodes to `order`, the largest first and equal nodes by index, where k is
/// about the fraction `part` of all nodes. Examines only the first [`FRONT`] · k nodes.
/// O(k log k).
fn select_largest(tree: &Working, part: f64, order: &mut Vec<u32>) {
    let nodes = tree.nodes.len() - 1;
    let count = ((part * nodes as f64) as usize).clamp(1, nodes);
    let examined = 1..=count.saturating_mul(FRONT).min(nodes) as u32;
    // Areas are never negative, so their bits have the same order. Inverted bits put the largest
    // first, and the index breaks ties.
    let mut keyed: Vec<(u64, u32)> =
        examined.map(|index| (!tree.nodes[index as usize].area.to_bits(), index)).collect();
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
    use crate::run::{Budget, Quota, solve};
    use crate::scatter::{At, Does, built, scatter};

    #[test]
    fn the_largest_of_the_first_nodes_are_selected_in_order() {
        let tree = built(&CLUSTERING, &scatter(100));
        for (part, count) in [(0.0, 1), (0.01, 1), (0.1, 19), (0.5, 99), (1.0, 199)] {
            let mut order = vec![7];
            select_largest(&tree, part, &mut order);
            let area = |index: &u32| tree.nodes[*index as usize].area;
            let mut expected: Vec<u32> = (1..200.min(1 + (FRONT * count) as u32)).collect();
            expected.sort_by(|a, b| area(b).total_cmp(&area(a)));
            assert_eq!(order, expected[..count], "{part}");
        }
    }

    #[test]
    fn the_largest_nodes_are_reinserted_to_a_local_optimum_unless_the_time_is_over() {
        let mut tree = built(&CLUSTERING, &scatter(300));
        let begin = tree.area();
        let mut reached = |at: f64| {
            let ends = std::sync::Mutex::new((tree.clone(), false));
            let search = Does(|run: &mut Run| {
                let (tree, is_optimal) = &mut *ends.lock().unwrap();
                *is_optimal = reinsert_largest(tree, 0.5, run);
                tree.to_bvh()
            });
            let observer = At(at);
            solve(&search, &Problem::new(&[]), 1, Budget::UNLIMITED, &observer).unwrap();
            let is_optimal;
            (tree, is_optimal) = ends.into_inner().unwrap();
            (is_optimal, tree.area())
        };
        assert_eq!(reached(0.5), (false, begin));
        let (is_optimal, area) = reached(0.4);
        assert!(is_optimal && area < begin);
        let again = crate::local::reinsertion::pass_by_area(&mut tree, Quota::ENDLESS, &());
        assert_eq!(again.kept, 0);
    }
}
