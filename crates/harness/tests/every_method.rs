//! One table of scenes, every method of the registry: whatever is built or searched is a valid, tight tree whose
//! cost is the one reported.

use bvh_core::{Aabb, cost::Objective, validate};
use bvh_search::{Budget, Method, Problem, StopReason, exact, solve};

/// The methods that take so many objects.
fn methods(objects: usize) -> impl Iterator<Item = Method> {
    let takes = move |method: &Method| objects <= exact::MOST_OBJECTS || method.name() != "exact";
    Method::all().into_iter().filter(takes)
}

/// Named scenes, small enough for every method.
fn cases() -> Vec<(&'static str, Vec<Aabb>)> {
    let cube = |at: [f32; 3], size: f32| Aabb::from((at, at.map(|c| c + size)));
    let hash = |i: u32, salt: u32| (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 65_521) as f32 / 64.0;
    let scatter =
        |n: u32| (0..n).map(|i| cube([hash(i, 3), hash(i, 11), hash(i, 19)], hash(i, 27) / 50.0)).collect();
    let flat: fn(&Aabb) -> Aabb = |b| Aabb::from(([b.min.x, b.min.y, 0.0], [b.max.x, b.max.y, 0.0]));
    let line: fn(&Aabb) -> Aabb = |b| Aabb::from(([b.min.x, 0.0, 0.0], [b.max.x, 0.0, 0.0]));
    let random: Vec<Aabb> = scatter(300);
    let scaled =
        |factor: f32| random.iter().map(|b| Aabb { min: b.min * factor, max: b.max * factor }).collect();
    vec![
        ("empty", vec![]),
        ("single", scatter(1)),
        ("pair", scatter(2)),
        ("triple", scatter(3)),
        ("coincident boxes", vec![cube([0.1; 3], 1.0); 200]),
        ("coincident points", vec![cube([0.1; 3], 0.0); 200]),
        ("concentric", (1..150u8).map(|i| cube([-f32::from(i); 3], 2.0 * f32::from(i))).collect()),
        ("flat", random.iter().map(flat).collect()),
        ("collinear", random.iter().map(line).collect()),
        ("grid", (0..256u16).map(|i| cube([f32::from(i % 16), f32::from(i / 16), 0.0], 1.0)).collect()),
        ("random", random.clone()),
        ("tiny", scaled(2f32.powi(-100))),
        ("denormal", scaled(2f32.powi(-145))),
        ("huge", scaled(2f32.powi(115))),
        ("far away", random.iter().map(|b| Aabb { min: b.min + 1e8, max: b.max + 1e8 }).collect()),
        ("signed zeros", vec![Aabb::from(([-0.0, 0.0, -0.0], [0.0, -0.0, 0.0])); 9]),
        ("powers of two", (-60..60).map(|k| cube([2f32.powi(k); 3], 2f32.powi(k - 2))).collect()),
        ("stadium", [scatter(200), vec![cube([-1e6, -1e6, -1.0], 2e6)]].concat()),
    ]
}

#[test]
fn every_method_returns_a_valid_tight_tree_with_the_reported_cost() {
    for (case, boxes) in cases() {
        for method in methods(boxes.len()) {
            for objective in [Objective::InternalArea, Objective::GoldsmithSalmon] {
                let name = format!("{case}, {}, {objective:?}", method.name());
                let problem = Problem { boxes: &boxes, objective };
                let outcome = solve(&method, &problem, 1, Budget::default(), &()).expect(&name);
                validate(&outcome.tree, &boxes).expect(&name);
                let mut tight = outcome.tree.clone();
                tight.refit(&boxes);
                assert_eq!(outcome.tree, tight, "{name}");
                let cost = objective.cost(&outcome.tree);
                assert!(cost.is_finite() && cost >= 0.0, "{name}: {cost}");
                assert!(
                    (outcome.cost - cost).abs() <= 1e-12 * cost,
                    "{name}: {} reported, {cost}",
                    outcome.cost
                );
                let best = outcome.history.iter().map(|event| event.cost).fold(f64::INFINITY, f64::min);
                assert_eq!(outcome.cost, best, "{name}");
            }
        }
    }
}

#[test]
fn every_method_gives_the_same_outcome_twice_and_on_any_number_of_threads() {
    let boxes = cases().into_iter().find(|(case, _)| *case == "random").unwrap().1;
    for method in methods(boxes.len()) {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| solve(&method, &Problem::new(&boxes), 5, Budget::default(), &()).unwrap())
        };
        let one = on(1);
        for threads in [1, 2, 3] {
            let other = on(threads);
            assert_eq!(one.tree, other.tree, "{}", method.name());
            assert_eq!(one.history, other.history, "{}", method.name());
        }
    }
}

#[test]
fn every_method_stops_when_told_and_still_returns_a_tree() {
    struct Impatient;
    impl bvh_search::Observer for Impatient {
        fn cancelled(&self) -> bool {
            true
        }
    }
    for (case, boxes) in cases() {
        for method in methods(boxes.len()) {
            let name = format!("{case}, {}", method.name());
            let cancelled = solve(&method, &Problem::new(&boxes), 1, Budget::default(), &Impatient).unwrap();
            validate(&cancelled.tree, &boxes).expect(&name);
            assert_eq!(cancelled.stop, StopReason::Cancelled, "{name}");
            let budget = Budget { max_evaluations: Some(1), max_work: None };
            let one = solve(&method, &Problem::new(&boxes), 1, budget, &()).unwrap();
            validate(&one.tree, &boxes).expect(&name);
            let nothing = Budget { max_evaluations: Some(0), max_work: Some(0) };
            validate(&solve(&method, &Problem::new(&boxes), 1, nothing, &()).unwrap().tree, &boxes)
                .expect(&name);
        }
    }
}

#[test]
fn every_method_refuses_boxes_that_are_not_finite_by_index() {
    let mut boxes = cases().into_iter().find(|(case, _)| *case == "random").unwrap().1;
    boxes[17].max.z = f32::INFINITY;
    for method in methods(boxes.len()) {
        let error = solve(&method, &Problem::new(&boxes), 1, Budget::default(), &()).unwrap_err();
        assert!(error.to_string().contains("object 17"), "{}: {error}", method.name());
    }
}
