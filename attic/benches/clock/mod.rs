//! Runs `best` against the clock, for the benchmarks of full searches.

use bvh_core::{cost, validate};
use bvh_scenes::Scene;
use bvh_search::{Budget, Deadline, Problem, solve};
use std::time::Duration;

/// Runs `best` with a plan of `seconds`. Returns its wall time and the internal area of its valid
/// tree.
pub fn best(scene: &Scene, seconds: f64, seed: u64) -> (f64, f64) {
    let deadline = Deadline::after(Duration::from_secs_f64(seconds));
    let config = bvh_search::best::Config::default();
    let problem = Problem::new(&scene.boxes);
    let outcome = solve(&config, &problem, seed, Budget::UNLIMITED, &deadline);
    let taken = deadline.elapsed().as_secs_f64();
    let tree = outcome.expect("finite boxes").tree;
    validate(&tree, &scene.boxes).expect("a valid tree");
    (taken, cost::internal_area(&tree))
}
