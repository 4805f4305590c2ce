//! Boxes of any bits through every builder, search, bound and conversion.

use super::bytes::Bytes;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{self, SahConstants};
use bvh_core::{Aabb, Bvh, check_boxes, collapse_leaves, file, validate};
use bvh_scenes::trace::kd_tree;
use bvh_search::{Budget, Method, Problem, SearchError, best, lower_bound, optimize, solve};
use harness::stress::EXACT_OBJECTS;
use harness::stress::examine::{ROUNDING, check_outcome};

/// Most boxes of one input.
const MOST: usize = 20;

/// The bytes: how to read the rest, a seed, the budget, then boxes.
pub fn boxes(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let [mode, seed, budget] = bytes.take();
    let sorted = mode & 1 == 0;
    let few = mode & 2 == 0;
    let copies = if mode & 4 == 0 { 1 } else { 2 };
    let mut boxes = Vec::new();
    while !bytes.0.is_empty() && boxes.len() < MOST {
        let a = bytes.point(few);
        let b = bytes.point(few);
        let aabb =
            if sorted { Aabb { min: a.min(b), max: a.max(b) } } else { Aabb { min: a, max: b } };
        boxes.extend((0..copies).map(|_| aabb));
    }
    let limit = Some(u64::from(budget & 127));
    let budget = if budget < 128 {
        Budget { max_evaluations: limit, max_work: Some(10_000) }
    } else {
        Budget { max_evaluations: None, max_work: limit.map(|limit| limit * 40) }
    };
    let bad = boxes.iter().position(|b| {
        let min = b.min.to_array();
        let max = b.max.to_array();
        !(0..3).all(|axis| min[axis].is_finite() && max[axis].is_finite() && min[axis] <= max[axis])
    });
    match bad {
        Some(bad) => refused(&boxes, bad, seed.into(), budget),
        None => built(&boxes, seed.into(), budget),
    }
}

/// Everything names the object.
fn refused(boxes: &[Aabb], bad: usize, seed: u64, budget: Budget) {
    let named = |who: &str, message: String| {
        assert!(message.contains(&format!("object {bad} ")), "{who}: {message}");
    };
    for method in Method::all() {
        if matches!(method, Method::Exact(_)) && boxes.len() > EXACT_OBJECTS {
            continue;
        }
        let error =
            solve(&method, &Problem::new(boxes), seed, budget, &()).expect_err(method.name());
        assert!(matches!(error, SearchError::Build(_)), "{}: {error:?}", method.name());
        named(method.name(), error.to_string());
    }
    named("check", check_boxes(boxes).unwrap_err().to_string());
    named(
        "KD-tree",
        kd_tree::Config::default()
            .build(boxes)
            .unwrap_err()
            .to_string(),
    );
    named(
        "bound",
        lower_bound::internal_area(boxes, 1, &())
            .unwrap_err()
            .to_string(),
    );
    let config = best::Config::default();
    let tree = Bvh::default();
    named(
        "optimize",
        optimize(&tree, &Problem::new(boxes), &config, seed, budget, &())
            .unwrap_err()
            .to_string(),
    );
}

/// Every method gives a tight tree of exact cost, the same one again, and what is made of trees holds too.
fn built(boxes: &[Aabb], seed: u64, budget: Budget) {
    let bound = lower_bound::internal_area(boxes, lower_bound::DEFAULT_EFFORT, &()).unwrap();
    assert!(bound.is_finite() && bound >= 0.0);
    for method in Method::all() {
        let boxes = match method {
            Method::Exact(_) => &boxes[..boxes.len().min(EXACT_OBJECTS - 3)],
            _ => boxes,
        };
        let solve = || solve(&method, &Problem::new(boxes), seed, budget, &());
        let outcome = solve().unwrap_or_else(|error| panic!("{}: {error}", method.name()));
        check_outcome(boxes, &outcome)
            .unwrap_or_else(|broken| panic!("{}: {broken}", method.name()));
        let again = solve().unwrap();
        assert!(
            again.tree == outcome.tree && again.history == outcome.history,
            "{}",
            method.name()
        );
        let binary = outcome
            .tree
            .nodes
            .iter()
            .all(|node| node.is_leaf() || node.children().len() == 2);
        if binary && !matches!(method, Method::Exact(_)) {
            assert!(
                outcome.cost >= bound * (1.0 - ROUNDING),
                "{} is below the bound",
                method.name()
            );
        }
        converted(&outcome.tree, boxes);
    }
    let kd_tree = kd_tree::Config::default().build(boxes).unwrap();
    assert!(kd_tree.references() >= kd_tree.cells().min(1));
    let greedy = muller_fellner::Config::default()
        .build(boxes)
        .unwrap();
    let before = cost::internal_area(&greedy);
    let merged = collapse_leaves(&greedy, &SahConstants::default());
    for tree in [&greedy, &merged] {
        let better =
            optimize(tree, &Problem::new(boxes), &best::Config::default(), seed, budget, &())
                .unwrap();
        validate(&better.tree, boxes).unwrap();
        assert!(better.cost <= before * (1.0 + ROUNDING));
    }
}

/// Merged leaves, another library's nodes and a file give a valid tree, the latter two this very one.
fn converted(tree: &Bvh, boxes: &[Aabb]) {
    let constants = SahConstants::default();
    let merged = collapse_leaves(tree, &constants);
    validate(&merged, boxes).unwrap();
    assert!(cost::sah(&merged, &constants) <= cost::sah(tree, &constants) * (1.0 + ROUNDING));
    let bytes = file::save(tree, boxes, &file::Origin::default()).unwrap();
    assert_eq!(file::load(&bytes, boxes).as_ref(), Ok(tree));
    if tree
        .nodes
        .iter()
        .all(|node| node.is_leaf() || node.children().len() == 2)
    {
        let other = Bvh::from_first_count(&tree.to_first_count(), &tree.prim_ids).unwrap();
        validate(&other, boxes).unwrap();
    }
}
