//! The empirical cost of a tree: the number of tests of random rays, with its standard error.
//!
//! Ng & Trifonov 2003, section 4: random rays start inside the root's box, and any hit ahead of the
//! origin ends a ray. The surface area costs assume other rays: lines through the whole box that no
//! hit ends.

use super::random::{Family, Kind, random_ray};
use super::segments::bounds_along_file;
use crate::trace::{Accelerator, Query};
use bvh_config::config;
use bvh_core::{Aabb, Bvh, Primitives, Ray, TestCounts, WideBvh};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rayon::prelude::*;

config! {
    /// Random rays and their query.
    pub struct RandomRays {
        /// The distribution of the rays.
        family: Family = Family::Inside;
        /// The query of the rays.
        query: Query = Query::Any;
        /// The number of rays.
        count: u64 = 10_000, in 1..;
    }
}

/// Returns the tests of nodes and of blocks of triangles per ray in a layout; NaN without rays.
/// They do not depend on the machine.
pub fn tests_per_ray(wide: &WideBvh, kind: Kind, rays: &[Ray]) -> [f64; 2] {
    let mut counts = TestCounts::default();
    for ray in rays {
        // A renderer stops a shadow ray at the first hit that it finds, so only these rays are
        // any-hit queries.
        if kind == Kind::Shadow {
            wide.any_hit_counted(ray, &mut counts);
        } else {
            wide.nearest_hit_counted(ray, &mut counts);
        }
    }
    let rays = rays.len() as f64;
    [
        counts.boxes as f64 / (WideBvh::BOXES_OF_NODE as f64 * rays),
        counts.objects as f64 / (WideBvh::OBJECTS_OF_BLOCK as f64 * rays),
    ]
}

/// The sums of rays, hits, tests of boxes and their squares, tests of objects and their squares. They
/// are integers, so that the order of addition does not matter.
type Sums = [u128; 6];

fn added(a: Sums, b: Sums) -> Sums {
    std::array::from_fn(|i| a[i] + b[i])
}

/// The mean of a number over random rays, with its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// The standard error of the mean.
    pub standard_error: f64,
}

impl Mean {
    fn of_sums(count: u128, sum: u128, squares: u128) -> Self {
        let n = count as f64;
        let sum = sum as f64;
        let variance = ((squares as f64 - sum * sum / n) / (n - 1.0).max(1.0)).max(0.0);
        Self { mean: sum / n, standard_error: (variance / n).sqrt() }
    }

    /// Returns the ends of the 95 % interval.
    pub fn interval(&self) -> [f64; 2] {
        /// The quantile 0.975 of the standard normal distribution.
        const NORMAL_95: f64 = 1.959_963_984_540_054;
        let half = NORMAL_95 * self.standard_error;
        [self.mean - half, self.mean + half]
    }
}

/// The tests of random rays in a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EmpiricalCost {
    /// Number of rays.
    pub rays: u64,
    /// Fraction of the rays that hit something.
    pub hit_fraction: f64,
    /// Tests against boxes per ray, with the root's box and the leaves' boxes.
    pub boxes: Mean,
    /// Tests against objects per ray.
    pub objects: Mean,
}

/// Number of rays per random stream. Results depend on it, since it decides which rays are drawn.
const CHUNK: u64 = 1024;

/// Measures a tree over `primitives` by the rays of `config`, drawn from `seed`, on all threads of
/// the current rayon pool. An empty tree costs nothing.
pub fn empirical_cost(
    config: &RandomRays,
    primitives: &Primitives,
    tree: &Bvh,
    seed: u64,
) -> EmpiricalCost {
    let Some(root) = bounds_along_file(primitives, tree) else { return EmpiricalCost::default() };
    let accelerator = Accelerator::of_tree(primitives, tree);
    let sums = (0..config.count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| measure_chunk(config, &accelerator, &root, seed, chunk))
        .reduce(Sums::default, added);
    let [rays, hits, boxes, boxes_squared, objects, objects_squared] = sums;
    EmpiricalCost {
        rays: rays as u64,
        hit_fraction: hits as f64 / rays as f64,
        boxes: Mean::of_sums(rays, boxes, boxes_squared),
        objects: Mean::of_sums(rays, objects, objects_squared),
    }
}

fn measure_chunk(
    config: &RandomRays,
    accelerator: &Accelerator,
    root: &Aabb,
    seed: u64,
    chunk: u64,
) -> Sums {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Streams by chunk make the rays independent of the number of threads.
    rng.set_stream(chunk);
    let mut sums = Sums::default();
    for _ in chunk * CHUNK..config.count.min((chunk + 1) * CHUNK) {
        let mut counts = TestCounts::default();
        // A box of one point has no rays; each counts as a ray without tests or hits.
        let hit = random_ray(config.family, root, &mut rng)
            .is_some_and(|ray| accelerator.count(config.query, &ray, &mut counts));
        let [boxes, objects] = [counts.boxes, counts.objects].map(u128::from);
        sums = added(sums, [1, hit.into(), boxes, boxes * boxes, objects, objects * objects]);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use bvh_build::{Builder, muller_fellner};

    #[test]
    fn lines_are_tested_against_the_root_and_both_children_of_every_inner_node_they_meet() {
        let scene = Scene::load("escher:2000").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let rays = RandomRays { family: Family::Lines, query: Query::All, count: 40_000 };
        let cost = empirical_cost(&rays, &scene.primitives, &tree, 1);
        let expected = 1.0 + bvh_core::cost::goldsmith_salmon(&tree);
        let error = (cost.boxes.mean - expected).abs();
        // An unlucky seed exceeds four standard errors once in 16 000.
        assert!(error < 4.0 * cost.boxes.standard_error, "{cost:?} {expected}");
    }
}
