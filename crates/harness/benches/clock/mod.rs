//! A limit in seconds that the search knows and plans with, and `best` under it.

use bvh_core::{cost, validate};
use bvh_search::{Budget, Observer, Problem, portfolio, solve};
use harness::scenes::Scene;
use std::time::Instant;

/// From now on, so many seconds.
struct Clock {
    start: Instant,
    seconds: f64,
}

impl Observer for Clock {
    fn progress(&self) -> Option<f64> {
        Some(self.start.elapsed().as_secs_f64() / self.seconds)
    }

    fn cancelled(&self) -> bool {
        self.start.elapsed().as_secs_f64() >= self.seconds
    }
}

/// What `best` takes when it may plan with so many seconds, and the internal area of its tree, which is valid.
pub fn best(scene: &Scene, seconds: f64, seed: u64) -> (f64, f64) {
    let clock = Clock { start: Instant::now(), seconds };
    let (config, problem) = (portfolio::Config::default(), Problem::new(&scene.boxes));
    let outcome = solve(&config, &problem, seed, Budget::default(), &clock);
    let taken = clock.start.elapsed().as_secs_f64();
    let tree = outcome.expect("a tree").tree;
    validate(&tree, &scene.boxes).expect("a valid tree");
    (taken, cost::internal_area(&tree))
}
