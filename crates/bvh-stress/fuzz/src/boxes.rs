//! Boxes of arbitrary bits for every builder, search, bound and conversion.

use super::bytes::Bytes;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{self, SahConstants};
use bvh_core::{Aabb, Bvh, check_boxes, collapse_leaves, file, validate};
use bvh_scenes::trace::kd_tree;
use bvh_search::{Budget, Method, Problem, SearchError, best, lower_bound, optimize, solve};
use bvh_stress::EXACT_OBJECTS;
use bvh_stress::examine::{ROUNDING, check_outcome};

/// The maximum number of boxes of one input.
const MOST: usize = 20;

/// Reads a mode, a seed, a budget, then boxes, and checks that they are rejected or built.
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
    match boxes.iter().position(is_invalid) {
        Some(object) => check_rejected(&boxes, object, seed.into(), budget),
        None => check_built(&boxes, seed.into(), budget),
    }
}

fn is_invalid(aabb: &Aabb) -> bool {
    let is_finite = aabb.min.is_finite() && aabb.max.is_finite();
    !is_finite || aabb.min.cmpgt(aabb.max).any()
}

fn check_rejected(boxes: &[Aabb], object: usize, seed: u64, budget: Budget) {
    let problem = Problem::new(boxes);
    let mut messages = Vec::new();
    for method in Method::all() {
        // Too many objects are an earlier error of the exact method.
        if matches!(method, Method::Exact(_)) && boxes.len() > EXACT_OBJECTS {
            continue;
        }
        let error = solve(&method, &problem, seed, budget, &()).expect_err(method.name());
        assert!(matches!(error, SearchError::Build(_)), "{}: {error:?}", method.name());
        messages.push(error.to_string());
    }
    let kd_tree = kd_tree::Config::default().build(boxes);
    let config = best::Config::default();
    let optimized = optimize(&Bvh::default(), &problem, &config, seed, budget, &());
    messages.push(check_boxes(boxes).unwrap_err().to_string());
    messages.push(kd_tree.unwrap_err().to_string());
    messages.push(optimized.unwrap_err().to_string());
    for message in messages {
        assert!(message.contains(&format!("object {object} ")), "{message}");
    }
}

/// Checks that every method builds a tight tree of exact cost, twice the same, and that everything
/// derived from the tree is valid too.
fn check_built(boxes: &[Aabb], seed: u64, budget: Budget) {
    let bound = lower_bound::of_largest(boxes);
    for method in Method::all() {
        let boxes = match method {
            Method::Exact(_) => &boxes[..boxes.len().min(EXACT_OBJECTS - 3)],
            _ => boxes,
        };
        let name = method.name();
        let problem = Problem::new(boxes);
        // A second run finds outcomes that depend on addresses or on uninitialised memory.
        let [outcome, again] = [(); 2].map(|()| {
            solve(&method, &problem, seed, budget, &())
                .unwrap_or_else(|error| panic!("{name}: {error}"))
        });
        check_outcome(boxes, &outcome).unwrap_or_else(|broken| panic!("{name}: {broken}"));
        assert!(again.tree == outcome.tree && again.history == outcome.history, "{name}");
        // The exact method got fewer boxes than the bound.
        if is_binary(&outcome.tree) && !matches!(method, Method::Exact(_)) {
            assert!(outcome.cost >= bound * (1.0 - ROUNDING), "{name} is below the bound");
        }
        check_conversions(&outcome.tree, boxes);
    }
    let kd_tree = kd_tree::Config::default().build(boxes).unwrap();
    assert!(kd_tree.references() >= kd_tree.cells().min(1));
    let greedy = muller_fellner::Config::default().build(boxes).unwrap();
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

fn is_binary(tree: &Bvh) -> bool {
    let mut nodes = tree.nodes.iter();
    nodes.all(|node| node.is_leaf() || node.children().len() == 2)
}

/// Checks that merged leaves, another library's nodes and a file give a valid tree, and the file
/// the same one.
fn check_conversions(tree: &Bvh, boxes: &[Aabb]) {
    let constants = SahConstants::default();
    let merged = collapse_leaves(tree, &constants);
    validate(&merged, boxes).unwrap();
    assert!(cost::sah(&merged, &constants) <= cost::sah(tree, &constants) * (1.0 + ROUNDING));
    let bytes = file::save(tree, boxes, &file::Origin::default()).unwrap();
    assert_eq!(file::load(&bytes, boxes).as_ref(), Ok(tree));
    if is_binary(tree) {
        let other = Bvh::from_first_count(&tree.to_first_count(), &tree.prim_ids).unwrap();
        validate(&other, boxes).unwrap();
    }
}
