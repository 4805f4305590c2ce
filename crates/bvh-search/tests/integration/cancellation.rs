//! A search returns soon after its observer cancels, for any numbers in its configuration.

use bvh_build::{Builder, median_cut, ploc};
use bvh_core::{Aabb, Bvh, validate};
use bvh_search::{
    Budget, Event, Judge, Kept, Method, Observer, Problem, StopReason, best, genetic, grasp,
    random_orders, rebuild, ruin_recreate, solve, solve_or_keep,
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

fn boxes(n: u32) -> Vec<Aabb> {
    (0..n)
        .map(|i: u32| {
            let hash = i.wrapping_mul(2_654_435_761);
            let low = [3, 11, 19].map(|salt| (hash.rotate_left(salt) >> 16) as f32);
            Aabb::from((low, low.map(|c| c + 50.0)))
        })
        .collect()
}

#[test]
fn a_search_that_is_cancelled_at_once_evaluates_one_tree_only() {
    let boxes = boxes(300);
    for method in [
        Method::Grasp(grasp::Config { trials: u64::MAX, ..Default::default() }),
        Method::RandomOrders(random_orders::Config { trials: u64::MAX, ..Default::default() }),
        Method::Genetic(genetic::Config {
            population: 800_000,
            generations: u64::MAX,
            ..Default::default()
        }),
    ] {
        let polls = Polls { polled: 0.into(), until: 0 };
        let outcome = solve(&method, &Problem::new(&boxes), 1, Budget::UNLIMITED, &polls).unwrap();
        validate(&outcome.tree, &boxes).unwrap();
        assert_eq!(outcome.evaluations, 1, "{}", method.name());
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
    let boxes = boxes(300);
    let judged = Judged::default();
    let problem = Problem { judge: Some(&judged), ..Problem::new(&boxes) };
    let tree = median_cut::Config::default().build(&boxes).unwrap();
    for method in Method::all() {
        let kept = Kept { tree: tree.clone(), cost: 7.0 };
        let polls = Polls { polled: 0.into(), until: 0 };
        let outcome =
            solve_or_keep(&method, &problem, Some(kept), 1, Budget::UNLIMITED, &polls).unwrap();
        assert_eq!(outcome.tree, tree, "{}", method.name());
        assert_eq!((outcome.cost, outcome.evaluations), (7.0, 0), "{}", method.name());
        assert_eq!(outcome.stop, StopReason::Cancelled);
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
    let boxes = boxes(300);
    let counts = Counts::default();
    let budget = Budget { max_work: Some(10_000_000), ..Budget::UNLIMITED };
    let outcome =
        solve(&best::Config::default(), &Problem::new(&boxes), 1, budget, &counts).unwrap();
    assert_eq!(counts.evaluations.into_inner(), outcome.evaluations);
    let calls = counts.calls.into_inner();
    let events = counts.events.into_inner();
    assert!(calls > 2 * events, "{calls} calls, {events} events");
}

#[test]
fn the_observer_is_polled_between_moves_however_long_they_are() {
    let boxes = boxes(3000);
    let ruin = ruin_recreate::Ruin { climb: 1000, removed: 1000, ..Default::default() };
    let polls = Polls { polled: 0.into(), until: u64::MAX };
    let budget = Budget { max_evaluations: Some(2000), ..Budget::UNLIMITED };
    let config = ruin_recreate::Config { ruin, ..Default::default() };
    let outcome = solve(&config, &Problem::new(&boxes), 1, budget, &polls).unwrap();
    let polled = polls.polled.into_inner();
    assert!(outcome.work / outcome.evaluations > 2000, "long moves");
    assert!(polled > outcome.work >> 16, "{polled} polls in {} nodes of work", outcome.work);
}

#[test]
fn numbers_that_no_poll_could_interrupt_are_rejected() {
    fn error(method: Method, boxes: &[Aabb]) -> String {
        solve(&method, &Problem::new(boxes), 1, Budget::UNLIMITED, &()).unwrap_err().to_string()
    }
    let climb = rebuild::Config { climb: 1 << 31, ..Default::default() };
    let message = "climb is 2147483648; accepted: 0 to 1000";
    assert_eq!(error(Method::Rebuild(climb), &[]), message);
    let ruin = ruin_recreate::Ruin { removed: u32::MAX, ..Default::default() };
    let ruin = ruin_recreate::Config { ruin, ..Default::default() };
    assert_eq!(
        error(Method::RuinRecreate(ruin), &[]),
        "ruin.removed is 4294967295; accepted: 1 to 1000"
    );
    let population = genetic::Config { population: 1_000_000, ..Default::default() };
    let message = "population is 1000000; accepted: at most 262144";
    assert_eq!(error(Method::Genetic(population), &boxes(1024)), message);
}

/// Methods whose first tree is a construction over all objects.
fn constructing() -> impl Iterator<Item = Method> {
    Method::all().into_iter().filter(|method| method.name() != "exact")
}

#[test]
fn a_search_that_is_cancelled_during_its_first_construction_returns_the_known_tree_or_that_of_the_fastest_builder()
 {
    let boxes = boxes(100_000);
    let known = median_cut::Config::default().build(&boxes).unwrap();
    let fastest = ploc::Config { radius: 1, near_rounds: 0 }.build(&boxes).unwrap();
    for method in constructing() {
        for (known, expected) in [(Some(&known), &known), (None, &fastest)] {
            let polls = Polls { polled: 0.into(), until: 0 };
            let problem = Problem::new(&boxes);
            let kept = known.map(|known| Kept::new(known.clone(), &problem));
            let outcome =
                solve_or_keep(&method, &problem, kept, 1, Budget::UNLIMITED, &polls).unwrap();
            assert_eq!(outcome.tree, *expected, "{}", method.name());
            assert_eq!(outcome.cost, problem.cost(expected), "{}", method.name());
            assert_eq!(outcome.stop, StopReason::Cancelled, "{}", method.name());
            assert!(polls.polled.into_inner() < 100, "{}", method.name());
        }
    }
}

#[test]
fn randomised_constructions_are_polled_and_the_incumbent_is_kept_when_one_is_cut_off() {
    let boxes = boxes(60_000);
    for method in [
        Method::Grasp(grasp::Config { trials: 1000, ..Default::default() }),
        Method::RandomOrders(random_orders::Config { trials: 1000, ..Default::default() }),
        Method::Genetic(genetic::Config { population: 4, generations: 1000, ..Default::default() }),
    ] {
        let polls = Polls { polled: 0.into(), until: 400 };
        let outcome = solve(&method, &Problem::new(&boxes), 1, Budget::UNLIMITED, &polls).unwrap();
        validate(&outcome.tree, &boxes).unwrap();
        let cost = Problem::new(&boxes).cost(&outcome.tree);
        assert_eq!(outcome.cost, cost, "{}", method.name());
        let polled = polls.polled.into_inner();
        assert!(polled < 450, "{}: {polled} polls", method.name());
    }
}
