//! What a run counts, keeps and allows.

use super::*;
use crate::scatter::Does;
use rand::Rng;
use std::cell::Cell;

/// A tree that tells its number.
fn tree(number: u32) -> Bvh {
    Bvh { prim_ids: vec![number], ..Bvh::default() }
}

fn budget(max_evaluations: impl Into<Option<u64>>, max_work: impl Into<Option<u64>>) -> Budget {
    Budget { max_evaluations: max_evaluations.into(), max_work: max_work.into() }
}

/// Evaluates trees of these costs, each of as much work as its number, from 1.
fn evaluated(costs: &[f64], kept: Option<f64>, budget: Budget) -> Outcome {
    let search = Does(|run: &mut Run| {
        let mut best = 0;
        for (&cost, number) in costs.iter().zip(1..) {
            if run.stopped().is_none() && run.record(cost, u64::from(number)) {
                best = number;
            }
        }
        tree(best)
    });
    let kept = kept.map(|cost| Kept { tree: tree(99), cost });
    solve_or_keep(&search, &Problem::new(&[]), kept, 1, budget, &()).unwrap()
}

#[test]
fn the_first_of_the_cheapest_trees_is_the_outcome_and_limits_end_the_search_when_they_are_reached()
{
    let costs = [5.0, 7.0, 4.0, 4.0, 6.0];
    for (budget, evaluations, work, cost, best, stop) in [
        (Budget::UNLIMITED, 5, 15, 4.0, 3, StopReason::Completed),
        (budget(3, None), 3, 6, 4.0, 3, StopReason::Evaluations),
        (budget(2, 3), 2, 3, 5.0, 1, StopReason::Evaluations),
        (budget(None, 3), 2, 3, 5.0, 1, StopReason::Work),
        (budget(None, 4), 3, 6, 4.0, 3, StopReason::Work),
        (budget(0, 0), 1, 1, 5.0, 1, StopReason::Evaluations),
    ] {
        let found = evaluated(&costs, None, budget);
        let counts = (found.evaluations, found.work, found.cost, found.stop);
        assert_eq!(
            (counts, found.tree),
            ((evaluations, work, cost, stop), tree(best)),
            "{budget:?}"
        );
    }
    let history = evaluated(&costs, None, Budget::UNLIMITED).history;
    let event = |event: &Event| (event.evaluations, event.work, event.cost, event.incumbent);
    let expected = [
        (1, 1, 5.0, 5.0),
        (2, 3, 7.0, 5.0),
        (3, 6, 4.0, 4.0),
        (4, 10, 4.0, 4.0),
        (5, 15, 6.0, 4.0),
    ];
    assert_eq!(history.iter().map(event).collect::<Vec<_>>(), expected);
}

#[test]
fn the_callers_tree_is_the_outcome_where_it_is_strictly_cheaper() {
    for (kept, cost, best, events) in [(4.5, 4.0, 2, 2), (4.0, 4.0, 2, 2), (3.0, 3.0, 99, 3)] {
        let found = evaluated(&[5.0, 4.0], Some(kept), Budget::UNLIMITED);
        assert_eq!((found.cost, found.tree, found.history.len()), (cost, tree(best), events));
    }
}

#[test]
fn what_remains_is_the_budget_without_what_is_counted_and_nothing_after_a_proof() {
    let search = Does(|run: &mut Run| {
        assert_eq!(run.left(), Quota { moves: 10, work: 100 });
        assert_eq!([30, 100, 101, 0].map(|work| run.evaluations_left(work)), [4, 1, 1, 10]);
        assert!(run.record(9.0, 40));
        assert_eq!(run.left(), Quota { moves: 9, work: 60 });
        assert_eq!([30, 7, 61].map(|work| run.evaluations_left(work)), [2, 9, 1]);
        run.count(Tally { moves: 4, kept: 1, work: 50 });
        assert!(!run.improve(9.0) && run.improve(8.0) && run.incumbent() == 8.0);
        assert_eq!((run.left(), run.stopped()), (Quota { moves: 5, work: 10 }, None));
        for (cost, number) in [(7.0, 1), (7.5, 2), (7.0, 3)] {
            run.keep_aside(Kept { tree: tree(number), cost });
        }
        assert_eq!(run.take_aside_below(7.0), None);
        assert_eq!(run.take_aside_below(7.1).map(|kept| kept.tree), Some(tree(1)));
        run.proved_optimal(Shortcut::BoundMet);
        assert_eq!(run.left(), Quota { moves: 0, work: 0 });
        assert_eq!((run.stopped(), run.evaluations_left(1)), (Some(StopReason::Optimal), 0));
        tree(0)
    });
    let found = solve(&search, &Problem::new(&[]), 1, budget(10, 100), &()).unwrap();
    assert_eq!((found.proof, found.cost), (Some(Shortcut::BoundMet), 8.0));
    assert_eq!((found.evaluations, found.work, found.history.len()), (5, 90, 2));
    let first = Cell::new(0);
    let search = Does(|run: &mut Run| {
        first.set(run.evaluations_left(9));
        run.record_generation(3, 1.0, 9);
        assert_eq!((run.evaluations_left(9), run.stopped()), (0, Some(StopReason::Evaluations)));
        tree(0)
    });
    let found = solve(&search, &Problem::new(&[]), 1, budget(0, None), &()).unwrap();
    assert_eq!((first.get(), found.evaluations), (1, 3));
}

#[test]
fn quotas_are_reached_by_either_limit_and_never_fall_below_zero() {
    let quota = Quota { moves: 5, work: 9 };
    let done = |moves, work| Tally { moves, kept: 0, work };
    let reached = [(5, 0), (0, 9), (4, 8), (6, 10)].map(|(a, b)| quota.is_reached(&done(a, b)));
    assert_eq!(reached, [true, true, false, true]);
    assert_eq!(quota.less(&done(2, 10)), Quota { moves: 3, work: 0 });
    assert_eq!([quota.at_most(4).work, quota.at_most(10).work], [4, 9]);
    let mut sum = done(1, 2);
    sum += Tally { moves: 10, kept: 20, work: 30 };
    assert_eq!(sum, Tally { moves: 11, kept: 20, work: 32 });
}

#[test]
fn the_first_draws_are_pinned() {
    let draws = |seed, index| {
        let mut rng = stream(seed, index);
        [(); 3].map(|()| rng.next_u32())
    };
    assert_eq!(draws(1, 2), [2_436_003_126, 3_764_084_094, 3_950_055_637]);
    assert_ne!(draws(1, 3), draws(1, 2));
}
