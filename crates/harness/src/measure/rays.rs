//! The empirical cost of a tree: the number of tests that random rays take, with its standard error.
//!
//! Ng & Trifonov 2003, section 4: random rays from inside the root's box, any hit ahead of the origin ends a ray. Lines
//! through the whole box, all of whose boxes are visited, are what the surface area costs assume.

use crate::run::rows::RayRow;
use crate::scenes::{Primitives, Scene};
use bvh_core::{Aabb, Bvh, Ray, Shear, TestCounts, Triangle, any_hit, nearest_hit};
use bvh_search::Stream;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A measurement with random rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the rays come from.
    pub family: Family,
    /// What they ask.
    pub query: Query,
    /// How many there are, at least 1.
    pub count: u64,
}

/// A distribution of rays over the root's box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// Origin uniform in the box, direction uniform: the paper's.
    Inside,
    /// Lines that meet the box, uniform in the measure that is proportional to surface area.
    Lines,
}

/// What a ray asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Query {
    /// Whether it hits anything: the paper's shadow rays.
    Any,
    /// What it hits first.
    Nearest,
    /// Everything on its way: no hit ends it.
    All,
}

/// Sums over some rays: whole numbers, so that they do not depend on the order of addition.
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
    let (n, sum) = (n as f64, sum as f64);
    let variance = ((squares as f64 - sum * sum / n) / (n - 1.0).max(1.0)).max(0.0);
    (sum / n, (variance / n).sqrt())
}

/// Rays of one random stream. Their number is part of what is measured: do not change it.
const CHUNK: u64 = 1024;

/// Sends the rays of `config`, drawn from `seed`, through `tree`, on all threads of the current rayon pool. `row`
/// names the run.
pub fn measure(config: &Config, scene: &Scene, tree: &Bvh, seed: u64, row: RayRow) -> RayRow {
    let Some(root) = tree.root_aabb() else { return row };
    let chunks = config.count.div_ceil(CHUNK);
    let one_chunk = |chunk: u64| {
        let mut rng = Stream::seed_from_u64(seed);
        rng.set_stream(chunk);
        let count = CHUNK.min(config.count - chunk * CHUNK);
        (0..count).fold(Sums::default(), |sums, _| {
            // A ray that cannot be (a box of one point) meets nothing and counts as a ray without tests.
            let mut counts = TestCounts::default();
            let hit = random_ray(config.family, &root, &mut rng)
                .is_some_and(|ray| trace(config.query, scene, tree, &ray, &mut counts));
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
    let sums = (0..chunks).into_par_iter().map(one_chunk).reduce(Sums::default, Sums::add);
    let (boxes_per_ray, boxes_standard_error) = estimate(sums.rays, sums.boxes, sums.boxes_squared);
    let (objects_per_ray, objects_standard_error) = estimate(sums.rays, sums.objects, sums.objects_squared);
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

/// Half the width of the normal distribution's central 95 %, in standard deviations.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Whether the ray hits something.
fn trace(query: Query, scene: &Scene, tree: &Bvh, ray: &Ray, counts: &mut TestCounts) -> bool {
    match &scene.primitives {
        Primitives::Triangles(triangles) => {
            let shear = Shear::new(ray);
            ask(query, tree, ray, counts, |id, t_max| Triangle(triangles[id as usize]).intersect(&shear, t_max))
        }
        Primitives::Spheres(spheres) => {
            ask(query, tree, ray, counts, |id, t_max| spheres[id as usize].intersect(ray, t_max))
        }
    }
}

fn ask(
    query: Query,
    tree: &Bvh,
    ray: &Ray,
    counts: &mut TestCounts,
    mut test: impl FnMut(u32, f32) -> Option<f32>,
) -> bool {
    match query {
        Query::Any => any_hit(tree, ray, |id| test(id, ray.t_max()).is_some(), counts),
        Query::Nearest => nearest_hit(tree, ray, test, counts).is_some(),
        Query::All => {
            let mut hit = false;
            any_hit(
                tree,
                ray,
                |id| {
                    hit |= test(id, ray.t_max()).is_some();
                    false
                },
                counts,
            );
            hit
        }
    }
}

/// A random ray; `None` if the box is so small or so large that none can be made.
pub(crate) fn random_ray(family: Family, root: &Aabb, rng: &mut Stream) -> Option<Ray> {
    let (low, size) = (root.min.as_dvec3(), root.extent());
    let mut unit = || rng.random::<f64>();
    let inside = DVec3::new(unit(), unit(), unit());
    let (origin, direction) = match family {
        Family::Inside => (inside, on_sphere(rng)),
        Family::Lines => {
            // A point on the surface, evenly, and a direction inwards with the density of the cosine: together a line
            // that is uniform among those that meet the box.
            let areas = [size.y * size.z, size.z * size.x, size.x * size.y];
            let pick = rng.random::<f64>() * areas.iter().sum::<f64>();
            let axis = if pick < areas[0] { 0 } else { 1 + usize::from(pick >= areas[0] + areas[1]) };
            let far = rng.random::<bool>();
            let mut origin = inside;
            origin[axis] = f64::from(u8::from(far));
            let mut normal = DVec3::ZERO;
            normal[axis] = if far { -1.0 } else { 1.0 };
            (origin, on_sphere(rng) + normal)
        }
    };
    let origin = (low + origin * size).as_vec3().clamp(root.min, root.max);
    Ray::half_line(origin, direction.as_vec3()).ok()
}

/// A point on the unit sphere, evenly: the direction of a point of the unit ball, which needs no function that differs
/// between machines.
fn on_sphere(rng: &mut Stream) -> DVec3 {
    loop {
        let mut coordinate = || rng.random::<f64>() * 2.0 - 1.0;
        let point = DVec3::new(coordinate(), coordinate(), coordinate());
        let squared = point.length_squared();
        if squared <= 1.0 && squared > 1e-6 {
            return point / squared.sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_build::{Builder, muller_fellner};
    use bvh_core::cost;

    fn measured(family: Family, query: Query, count: u64, seed: u64) -> (RayRow, Bvh) {
        let scene = Scene::load("escher:2000").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        (measure(&Config { family, query, count }, &scene, &tree, seed, RayRow::default()), tree)
    }

    #[test]
    fn lines_are_tested_against_one_box_and_two_for_every_inner_node_they_meet() {
        let (row, tree) = measured(Family::Lines, Query::All, 40_000, 1);
        let expected = 1.0 + cost::goldsmith_salmon(&tree);
        // A tree's inner nodes have two children each, so this is 1 + 2 C / A(root). Four standard errors.
        assert!((row.boxes_per_ray - expected).abs() < 4.0 * row.boxes_standard_error, "{row:?} {expected}");
    }

    #[test]
    fn four_times_the_rays_halve_the_standard_error() {
        let errors = [4_000, 16_000, 64_000]
            .map(|count| measured(Family::Inside, Query::Any, count, 2).0.boxes_standard_error);
        for pair in errors.windows(2) {
            assert!((1.7..2.3).contains(&(pair[0] / pair[1])), "{errors:?}");
        }
    }

    #[test]
    fn the_interval_covers_the_truth_about_as_often_as_it_says() {
        let truth = measured(Family::Inside, Query::Nearest, 400_000, 3).0.boxes_per_ray;
        let covered = (0..100)
            .filter(|seed| {
                let row = measured(Family::Inside, Query::Nearest, 1000, 100 + seed).0;
                (row.boxes_low..=row.boxes_high).contains(&truth)
            })
            .count();
        // Binomial(100, 0.95) is within these limits with probability 0.9999.
        assert!((86..=100).contains(&covered), "{covered} of 100");
    }

    #[test]
    fn any_hit_asks_less_than_nearest_and_nearest_less_than_all() {
        let boxes = [Query::Any, Query::Nearest, Query::All]
            .map(|query| measured(Family::Inside, query, 5_000, 4).0.boxes_per_ray);
        assert!(boxes[0] < boxes[1] && boxes[1] < boxes[2], "{boxes:?}");
    }
}
