//! The everyday calls keep to their time, use all of it, and end with trees worth having.

use bvh_search::prelude::*;
use std::time::Instant;

fn scene() -> Vec<Aabb> {
    let at = |i: u32, k: u32| (i.wrapping_mul(2_654_435_761).rotate_left(k) >> 16) as f32;
    (0..5000)
        .map(|i| [at(i, 3), at(i, 11), at(i, 19)])
        .map(|low| Aabb::from([low, low.map(|c| c + 900.0)]))
        .collect()
}

#[test]
fn a_bake_of_a_moment_beats_the_greedy_tree_and_ends_in_time() {
    let boxes = scene();
    let greedy = muller_fellner::Config::default().build(&boxes).unwrap();
    let start = Instant::now();
    let baked = bake(&boxes, Duration::from_millis(400)).unwrap();
    // Other tests share the machine.
    let seconds = start.elapsed().as_secs_f64();
    assert!((0.3..4.0).contains(&seconds), "{seconds} s");
    validate(&baked.tree, &boxes).unwrap();
    assert!(baked.cost < cost::internal_area(&greedy));

    let improved = improve(&greedy, &boxes, Duration::from_millis(200)).unwrap();
    validate(&improved.tree, &boxes).unwrap();
    assert!(improved.cost < cost::internal_area(&greedy));
}

#[test]
fn a_time_of_zero_still_gives_a_tree() {
    let boxes = scene();
    validate(&bake(&boxes, Duration::ZERO).unwrap().tree, &boxes).unwrap();
    let greedy = muller_fellner::Config::default().build(&boxes).unwrap();
    assert!(improve(&greedy, &boxes, Duration::ZERO).unwrap().cost <= cost::internal_area(&greedy));
    assert!(bake(&[], Duration::ZERO).unwrap().tree.nodes.is_empty());
}
