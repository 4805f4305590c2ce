//! The laws of every local search: start, budgets, cancellation, threads and rejected trees.

use crate::{scatter, work};
use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, Bvh, Node, cost, validate};
use bvh_search::{
    Budget, Event, Method, Observer, Outcome, Problem, SearchError, StopReason, best, genetic,
    optimize, solve,
};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

const METHODS: [&str; 7] =
    ["reinsertion", "rotation", "treelet", "annealing", "rebuild", "ruin_recreate", "best"];

/// The methods under test with their default parameters.
fn methods() -> impl Iterator<Item = Method> {
    Method::all().into_iter().filter(|method| METHODS.contains(&method.name()))
}

/// The builder of the tree that local searches begin with.
fn construction() -> muller_fellner::Config {
    let heuristic = muller_fellner::Heuristic::AreaTimesPower(0.9);
    muller_fellner::Config { heuristic, ..Default::default() }
}

fn run(method: &Method, boxes: &[Aabb], max_work: u64) -> Outcome {
    let outcome = solve(method, &Problem::new(boxes), 5, work(max_work), &()).unwrap();
    validate(&outcome.tree, boxes).unwrap();
    assert!(outcome.tree.is_tight(boxes), "{}", method.name());
    assert_eq!(outcome.cost, cost::internal_area(&outcome.tree), "{}", method.name());
    outcome
}

#[test]
fn every_method_improves_on_its_start_and_the_best_most() {
    let boxes = scatter(2000, 1);
    let start = cost::internal_area(&construction().build(&boxes).unwrap());
    let [reinsertion, rotated, treelets, single, rebuilt, annealed, best] = METHODS.map(|name| {
        let method = methods().find(|method| method.name() == name).unwrap();
        let outcome = run(&method, &boxes, 8_000_000);
        assert_eq!(outcome.history[0].cost, start);
        outcome.cost
    });
    assert!(rotated < start && treelets < start && reinsertion < start);
    for (name, cost) in
        [("annealing", single), ("rebuild", rebuilt), ("ruin_recreate", annealed), ("best", best)]
    {
        assert!(cost < reinsertion, "{name}: {cost}, reinsertion {reinsertion}");
    }
}

fn run_on_threads(threads: usize, config: best::Config, boxes: &[Aabb], work: u64) -> Outcome {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| run(&Method::Best(config), boxes, work))
}

#[test]
fn subtrees_annealed_in_parallel_do_not_depend_on_the_number_of_threads() {
    // A large scene is cut into subtrees unasked, and then ends elsewhere than as a whole.
    for (objects, pieces, work) in [(1500, 8, 2_000_000), (1 << 18, 0, 80 << 18)] {
        let boxes = scatter(objects, 2);
        let run_on = |threads, pieces| {
            let config = best::Config { pieces, ..Default::default() };
            run_on_threads(threads, config, &boxes, work)
        };
        let one = run_on(1, pieces);
        for threads in [2, 3] {
            let other = run_on(threads, pieces);
            assert_eq!((&one.tree, &one.history), (&other.tree, &other.history), "{objects}");
        }
        assert_ne!(one.cost, run_on(1, 1).cost, "{objects}");
    }
}

#[test]
fn budgets_and_observers_end_a_search_where_they_say() {
    struct AfterTheStart(AtomicBool);
    impl Observer for AfterTheStart {
        fn event(&self, _: &Event) {
            self.0.store(true, Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.0.load(Relaxed)
        }
    }
    let boxes = scatter(1000, 4);
    for method in methods() {
        for max_work in [0, 1, 5_000, 100_000] {
            let outcome = run(&method, &boxes, max_work);
            // At most one more move, or the start alone.
            let most = max_work.max(1999) + 2000;
            assert!(outcome.work <= most, "{}: {} of {most}", method.name(), outcome.work);
        }
        let budget = Budget { max_evaluations: Some(777), ..Budget::UNLIMITED };
        let outcome = solve(&method, &Problem::new(&boxes), 1, budget, &()).unwrap();
        let found = outcome.evaluations;
        assert!((777..=778).contains(&found), "{}: {found}", method.name());
        assert_eq!(outcome.stop, StopReason::Evaluations);
        let after_the_start = AfterTheStart(false.into());
        let outcome =
            solve(&method, &Problem::new(&boxes), 1, Budget::UNLIMITED, &after_the_start).unwrap();
        assert_eq!(outcome.stop, StopReason::Cancelled, "{}", method.name());
        validate(&outcome.tree, &boxes).unwrap();
    }
}

#[test]
fn the_best_ends_when_the_time_does_and_its_pieces_are_a_valid_tree() {
    /// A clock that advances with every reading.
    struct Clock(AtomicU32);
    impl Observer for Clock {
        fn progress(&self) -> Option<f64> {
            Some(f64::from(self.0.fetch_add(1, Relaxed)) / 5000.0)
        }
        fn cancelled(&self) -> bool {
            self.progress() > Some(1.0)
        }
    }
    let boxes = scatter(3000, 7);
    for pieces in [1, 8] {
        let config = Method::Best(best::Config { pieces, ..Default::default() });
        let clock = Clock(0.into());
        let outcome = solve(&config, &Problem::new(&boxes), 1, Budget::UNLIMITED, &clock).unwrap();
        validate(&outcome.tree, &boxes).unwrap();
        assert!((4000..5100).contains(&clock.0.into_inner()), "{pieces}");
        assert!(outcome.cost < run(&config, &boxes, 1_000_000).cost);
    }
}

/// The deepest tree: every inner node has a leaf on its left.
fn chain(boxes: &[Aabb]) -> Bvh {
    let n = boxes.len() as u32;
    let mut nodes = vec![Node::inner(Aabb::EMPTY, 1, 2)];
    for i in 0..n - 1 {
        nodes.push(Node::leaf(Aabb::EMPTY, i, 1));
        nodes.push(if i + 2 < n {
            Node::inner(Aabb::EMPTY, 2 * i + 3, 2)
        } else {
            Node::leaf(Aabb::EMPTY, i + 1, 1)
        });
    }
    let mut tree = Bvh::new(nodes, (0..n).collect());
    tree.refit(boxes);
    tree
}

#[test]
fn the_deepest_tree_can_be_optimised() {
    let boxes = scatter(3000, 5);
    let tree = chain(&boxes);
    let outcome =
        optimize(&tree, &Problem::new(&boxes), &best::Config::default(), 1, work(20_000_000), &())
            .unwrap();
    validate(&outcome.tree, &boxes).unwrap();
    assert!(outcome.cost < cost::internal_area(&tree) / 4.0);
}

#[test]
fn leaves_of_several_objects_are_kept_and_other_trees_are_rejected_by_name() {
    let boxes = scatter(400, 6);
    let pairs: Vec<Aabb> = boxes.chunks(2).map(|pair| pair[0].union(&pair[1])).collect();
    let mut tree = construction().build(&pairs).unwrap();
    for node in &mut tree.nodes {
        if node.is_leaf() {
            *node = Node::leaf(node.aabb, 2 * node.prims().start as u32, 2);
        }
    }
    tree.prim_ids = tree.prim_ids.iter().flat_map(|&pair| [2 * pair, 2 * pair + 1]).collect();
    let config = best::Config::default();
    let outcome = optimize(&tree, &Problem::new(&boxes), &config, 1, work(1_000_000), &()).unwrap();
    validate(&outcome.tree, &boxes).unwrap();
    assert_eq!(outcome.tree.inner_count(), tree.inner_count());
    assert_eq!(outcome.cost, cost::internal_area(&outcome.tree));
    assert!(outcome.cost < cost::internal_area(&tree));

    let error = |tree: &Bvh, boxes: &[Aabb]| {
        optimize(tree, &Problem::new(boxes), &config, 1, work(0), &()).unwrap_err()
    };
    let mut flat = Bvh::new(vec![Node::inner(Aabb::EMPTY, 1, 3)], vec![0, 1, 2]);
    flat.nodes.extend((0..3).map(|i| Node::leaf(Aabb::EMPTY, i, 1)));
    flat.refit(&boxes[..3]);
    assert_eq!(error(&flat, &boxes[..3]), SearchError::NotBinary { node: 0, children: 3 });
    assert!(matches!(error(&flat, &boxes[..2]), SearchError::Invalid(_)));
}

#[test]
fn a_population_that_no_memory_holds_is_named() {
    let boxes = scatter(1024, 1);
    let config = genetic::Config { population: 1_000_000, ..Default::default() };
    let error = solve(&config, &Problem::new(&boxes), 1, Budget::UNLIMITED, &()).unwrap_err();
    assert_eq!(error.to_string(), "population is 1000000; accepted: at most 262144");
}
