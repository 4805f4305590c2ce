//! The empirical cost of a tree: the number of tests of random rays, with its standard error.
//!
//! Ng & Trifonov 2003, section 4: random rays start inside the root's box, and any hit ahead of the
//! origin ends a ray. The surface area costs assume other rays: lines through the whole box that no
//! hit ends.

use crate::rows::RayRow;
use crate::statistics::NORMAL_95;
use bvh_config::config;
use bvh_core::{Aabb, Bvh, TestCounts};
use bvh_scenes::Scene;
use bvh_scenes::rays::{Family, random_ray};
use bvh_scenes::trace::{Accelerator, Query};
use bvh_search::Stream;
use rand::SeedableRng;
use rayon::prelude::*;

config! {
    serde;
    /// Random rays and their query.
    pub struct Config {
        /// The distribution of the rays.
        family: Family = Family::Inside;
        /// The query of the rays.
        query: Query = Query::Any;
        /// The number of rays.
        count: u64 = 10_000, in 1..;
    }
}

/// Sums over some rays. They are integers, so that the order of addition does not matter.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    rays: u64,
    hits: u64,
    boxes: u64,
    boxes_squared: u128,
    objects: u64,
    objects_squared: u128,
}

impl Sums {
    fn add(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.hits += other.hits;
        self.boxes += other.boxes;
        self.boxes_squared += other.boxes_squared;
        self.objects += other.objects;
        self.objects_squared += other.objects_squared;
        self
    }
}

/// Returns mean and standard error of `n` numbers from their sum and sum of squares.
fn estimate(n: u64, sum: u64, squares: u128) -> (f64, f64) {
    let n = n as f64;
    let sum = sum as f64;
    let variance = ((squares as f64 - sum * sum / n) / (n - 1.0).max(1.0)).max(0.0);
    (sum / n, (variance / n).sqrt())
}

/// Number of rays per random stream. Results depend on it, since it decides which rays are drawn.
const CHUNK: u64 = 1024;

/// Sends the rays of `config`, drawn from `seed`, through `tree`, on all threads of the current
/// rayon pool. `row` identifies the run.
pub fn measure(config: &Config, scene: &Scene, tree: &Bvh, seed: u64, row: RayRow) -> RayRow {
    let Some(root) = tree.root_aabb() else { return row };
    let accelerator = Accelerator::of_tree(&scene.primitives, tree);
    let sums = (0..config.count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| measure_chunk(config, &accelerator, &root, seed, chunk))
        .reduce(Sums::default, Sums::add);
    let (boxes_per_ray, boxes_standard_error) = estimate(sums.rays, sums.boxes, sums.boxes_squared);
    let (objects_per_ray, objects_standard_error) =
        estimate(sums.rays, sums.objects, sums.objects_squared);
    RayRow {
        rays: sums.rays,
        hit_fraction: sums.hits as f64 / sums.rays as f64,
        boxes_per_ray,
        boxes_standard_error,
        boxes_low: boxes_per_ray - NORMAL_95 * boxes_standard_error,
        boxes_high: boxes_per_ray + NORMAL_95 * boxes_standard_error,
        objects_per_ray,
        objects_standard_error,
        ..row
    }
}

/// Traces the rays of one random stream.
fn measure_chunk(
    config: &Config,
    accelerator: &Accelerator,
    root: &Aabb,
    seed: u64,
    chunk: u64,
) -> Sums {
    let mut rng = Stream::seed_from_u64(seed);
    rng.set_stream(chunk);
    let mut sums = Sums::default();
    for _ in chunk * CHUNK..config.count.min((chunk + 1) * CHUNK) {
        let mut counts = TestCounts::default();
        // A box of one point has no rays; each counts as a ray without tests or hits.
        let hit = random_ray(config.family, root, &mut rng)
            .is_some_and(|ray| accelerator.count(config.query, &ray, &mut counts));
        sums = sums.add(Sums {
            rays: 1,
            hits: u64::from(hit),
            boxes: counts.boxes,
            boxes_squared: u128::from(counts.boxes).pow(2),
            objects: counts.objects,
            objects_squared: u128::from(counts.objects).pow(2),
        });
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_build::{Builder, muller_fellner};
    use bvh_core::cost;

    fn measured(family: Family, query: Query, count: u64, seed: u64) -> (RayRow, Bvh) {
        let scene = Scene::load("escher:2000").unwrap();
        let tree = muller_fellner::Config::default()
            .build(&scene.boxes)
            .unwrap();
        (measure(&Config { family, query, count }, &scene, &tree, seed, RayRow::default()), tree)
    }

    #[test]
    fn lines_are_tested_against_the_root_and_both_children_of_every_inner_node_they_meet() {
        let (row, tree) = measured(Family::Lines, Query::All, 40_000, 1);
        let expected = 1.0 + cost::goldsmith_salmon(&tree);
        let error = (row.boxes_per_ray - expected).abs();
        // An unlucky seed exceeds four standard errors once in 16 000.
        assert!(error < 4.0 * row.boxes_standard_error, "{row:?} {expected}");
    }

    #[test]
    fn any_hit_needs_fewer_tests_than_nearest_and_nearest_fewer_than_all() {
        let boxes = [Query::Any, Query::Nearest, Query::All].map(|query| {
            measured(Family::Inside, query, 5_000, 4)
                .0
                .boxes_per_ray
        });
        assert!(boxes[0] < boxes[1] && boxes[1] < boxes[2], "{boxes:?}");
    }
}
