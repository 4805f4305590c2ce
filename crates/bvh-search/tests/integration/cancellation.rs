//! A search returns soon after its observer cancels, for any numbers in its configuration.

use crate::{scatter, work};
use bvh_build::{Builder, median_cut, ploc};
use bvh_core::{Bvh, validate};
use bvh_search::{
    Budget, Event, Judge, Kept, Method, Observer, Problem, StopReason, best, genetic, grasp,
    random_orders, solve, solve_or_keep,
};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Counts the polls, and cancels after a number of them.
struct Polls {
    polled: AtomicU64,
    until: u64,
}

impl Observer for Polls {
    fn cancelled(&self) -> bool {
        self.polled.fetch_add(1, Relaxed) >= self.until
    }
}

/// Counts the trees that it judges.
#[derive(Debug, Default)]
struct Judged(AtomicU64);

impl Judge for Judged {
    fn judge(&self, tree: &Bvh) -> f64 {
        self.0.fetch_add(1, Relaxed);
        tree.nodes.len() as f64
    }
}

#[test]
fn a_cancelled_search_returns_the_tree_of_its_caller_without_an_evaluation() {
    let boxes = scatter(100_000, 1);
    let judged = Judged::default();
    let problem = Problem { judge: Some(&judged), ..Problem::new(&boxes) };
    let tree = median_cut::Config::default().build(&boxes).unwrap();
    for method in Method::all() {
        let kept = Kept { tree: tree.clone(), cost: 7.0 };
        let polls = Polls { polled: 0.into(), until: 0 };
        let outcome =
            solve_or_keep(&method, &problem, Some(kept), 1, Budget::UNLIMITED, &polls).unwrap();
        assert!(outcome.tree == tree, "{}", method.name());
        assert_eq!((outcome.cost, outcome.evaluations), (7.0, 0), "{}", method.name());
        assert_eq!(outcome.stop, StopReason::Cancelled);
        assert!(polls.polled.into_inner() < 100, "{}", method.name());
    }
    assert_eq!(judged.0.into_inner(), 0);
}

#[test]
fn the_observer_hears_of_moves_that_improve_nothing() {
    #[derive(Default)]
    struct Counts {
        evaluations: AtomicU64,
        calls: AtomicU64,
        events: AtomicU64,
    }
    impl Observer for Counts {
        fn event(&self, _: &Event) {
            self.events.fetch_add(1, Relaxed);
        }
        fn counted(&self, evaluations: u64, _: u64) {
            assert!(self.evaluations.swap(evaluations, Relaxed) <= evaluations);
            self.calls.fetch_add(1, Relaxed);
        }
    }
    let boxes = scatter(300, 1);
    let counts = Counts::default();
    let outcome =
        solve(&best::Config::default(), &Problem::new(&boxes), 1, work(10_000_000), &counts)
            .unwrap();
    assert_eq!(counts.evaluations.into_inner(), outcome.evaluations);
    let calls = counts.calls.into_inner();
    let events = counts.events.into_inner();
    assert!(calls > 2 * events, "{calls} calls, {events} events");
}

#[test]
fn a_search_that_is_cancelled_during_its_first_construction_returns_the_tree_of_the_fastest_builder()
 {
    let boxes = scatter(100_000, 1);
    let problem = Problem::new(&boxes);
    let fastest = ploc::Config { radius: 1, near_rounds: 0 }.build(&boxes).unwrap();
    for method in Method::all().into_iter().filter(|method| method.name() != "exact") {
        let polls = Polls { polled: 0.into(), until: 0 };
        let outcome = solve(&method, &problem, 1, Budget::UNLIMITED, &polls).unwrap();
        assert_eq!(outcome.tree, fastest, "{}", method.name());
        assert_eq!(outcome.cost, problem.cost(&fastest), "{}", method.name());
        assert_eq!(outcome.stop, StopReason::Cancelled, "{}", method.name());
        assert!(polls.polled.into_inner() < 100, "{}", method.name());
    }
}

#[test]
fn searches_of_many_trees_are_cancelled_between_them_and_within_one_and_keep_the_incumbent() {
    for (objects, until, population) in [(300, 0, 800_000), (60_000, 400, 4)] {
        let boxes = scatter(objects, 1);
        let problem = Problem::new(&boxes);
        let genetic = genetic::Config { population, generations: u64::MAX, ..Default::default() };
        for method in [
            Method::Grasp(grasp::Config { trials: u64::MAX, ..Default::default() }),
            Method::RandomOrders(random_orders::Config { trials: u64::MAX, ..Default::default() }),
            Method::Genetic(genetic),
        ] {
            let polls = Polls { polled: 0.into(), until };
            let outcome = solve(&method, &problem, 1, Budget::UNLIMITED, &polls).unwrap();
            validate(&outcome.tree, &boxes).unwrap();
            assert_eq!(outcome.cost, problem.cost(&outcome.tree), "{}", method.name());
            assert!(until > 0 || outcome.evaluations == 1, "{}", method.name());
            let polled = polls.polled.into_inner();
            assert!(polled < until + 100, "{}: {polled} polls", method.name());
        }
    }
}
