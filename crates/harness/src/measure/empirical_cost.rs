//! The empirical cost of a tree: the number of tests that random rays take, with its standard error.
//!
//! Ng & Trifonov 2003, section 4: random rays from inside the root's box, and any hit ahead of the origin ends a ray.
//! The surface area costs assume other rays: lines through the whole box that no hit ends.

use crate::rows::RayRow;
use crate::statistics::NORMAL_95;
use bvh_config::config;
use bvh_core::{Bvh, TestCounts};
use bvh_scenes::Scene;
use bvh_scenes::rays::{Family, random_ray};
use bvh_scenes::trace::{Accelerator, Query};
use bvh_search::Stream;
use rand::SeedableRng;
use rayon::prelude::*;

config! {
    serde;
    /// Random rays, and what they ask.
    pub struct Config {
        /// Their distribution.
        family: Family = Family::Inside;
        /// What they ask.
        query: Query = Query::Any;
        /// How many there are.
        count: u64 = 10_000, in 1..;
    }
}

/// Sums over some rays: whole numbers, so that the order of addition does not matter.
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

/// Mean and standard error of `n` numbers from their sum and sum of squares.
fn estimate(n: u64, sum: u64, squares: u128) -> (f64, f64) {
    let n = n as f64;
    let sum = sum as f64;
    let variance = ((squares as f64 - sum * sum / n) / (n - 1.0).max(1.0)).max(0.0);
    (sum / n, (variance / n).sqrt())
}

/// Number of rays from one random stream. It decides which rays are drawn: another number changes results.
const CHUNK: u64 = 1024;

/// Sends the rays of `config`, drawn from `seed`, through `tree`, on all threads of the current rayon pool. `row`
/// names the run.
pub fn measure(config: &Config, scene: &Scene, tree: &Bvh, seed: u64, row: RayRow) -> RayRow {
    let Some(root) = tree.root_aabb() else { return row };
    let accelerator = Accelerator::of_tree(&scene.primitives, tree);
    let chunks = config.count.div_ceil(CHUNK);
    let one_chunk = |chunk: u64| {
        let mut rng = Stream::seed_from_u64(seed);
        rng.set_stream(chunk);
        let count = CHUNK.min(config.count - chunk * CHUNK);
        (0..count).fold(Sums::default(), |sums, _| {
            // Where no ray can be made (a box of one point), it counts as a ray without tests that hits nothing.
            let mut counts = TestCounts::default();
            let hit = random_ray(config.family, &root, &mut rng)
                .is_some_and(|ray| accelerator.count(config.query, &ray, &mut counts));
            sums.add(Sums {
                rays: 1,
                hits: u64::from(hit),
                boxes: counts.boxes,
                boxes_squared: u128::from(counts.boxes).pow(2),
                objects: counts.objects,
                objects_squared: u128::from(counts.objects).pow(2),
            })
        })
    };
    let sums = (0..chunks)
        .into_par_iter()
        .map(one_chunk)
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
    fn lines_are_tested_against_one_box_and_two_for_every_inner_node_they_meet() {
        let (row, tree) = measured(Family::Lines, Query::All, 40_000, 1);
        let expected = 1.0 + cost::goldsmith_salmon(&tree);
        // A tree's inner nodes have two children each, so this is 1 + 2 C / A(root). Four standard errors.
        assert!(
            (row.boxes_per_ray - expected).abs() < 4.0 * row.boxes_standard_error,
            "{row:?} {expected}"
        );
    }

    #[test]
    fn any_hit_asks_less_than_nearest_and_nearest_less_than_all() {
        let boxes = [Query::Any, Query::Nearest, Query::All].map(|query| {
            measured(Family::Inside, query, 5_000, 4)
                .0
                .boxes_per_ray
        });
        assert!(boxes[0] < boxes[1] && boxes[1] < boxes[2], "{boxes:?}");
    }
}
