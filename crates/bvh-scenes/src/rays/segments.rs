//! The rays that train a tree, with their segments up to the hit and the density of these: from a
//! renderer, or any through a scene.

use super::camera::{Camera, View};
use super::random::{Family, Kind, Viewpoint, in_box, on_sphere, random_ray};
use crate::Scene;
use crate::trace::Accelerator;
use bvh_config::{OutOfRange, above, config};
use bvh_core::{Aabb, Bvh, DensityError, Primitives, Ray, RayDensity, Segment, TestCounts};
use glam::{DVec3, Vec3};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use std::ops::Bound::Excluded;

config! {
    /// The rays of a renderer: the contents of the file of `bake --rays FILE.toml`. All coordinates
    /// are in world units.
    pub struct RenderedRays {
        /// The poses of the camera on its path, at least one. The camera moves in straight lines.
        cameras: Vec<Viewpoint>;
        /// The angle between the lower and the upper edge of the picture, in degrees.
        fov: f64 = 60.0, in (Excluded(0.0), Excluded(180.0));
        /// The picture's width divided by its height.
        aspect: f64 = 1.0, in above(0.0);
        /// The number of diffuse reflections that follow every primary ray.
        bounces: u32 = 1, in 0..=100;
        /// The positions of lights. The hit of every primary ray sends a shadow ray to each light.
        lights: Vec<[f64; 3]>;
        /// The number of primary rays.
        count: u32 = 50_000, in 1..=1_000_000;
        /// The seed of the pixels and of the directions.
        seed: u64 = 1;
    }
    check Self::check_cameras;
}

impl RenderedRays {
    fn check_cameras(&self) -> Result<(), OutOfRange> {
        let numbers =
            self.cameras.iter().flat_map(|pose| [pose.eye, pose.target]).chain(self.lights.clone());
        if self.cameras.is_empty() {
            let accepted = "at least one table with `eye` and `target`";
            return Err(OutOfRange::new("cameras", "empty", accepted));
        }
        if let Some(wrong) = numbers.flatten().find(|number| !number.is_finite()) {
            return Err(OutOfRange::new("cameras and lights", wrong, "finite coordinates"));
        }
        check_count("count", self.count, 1 + self.bounces as usize + self.lights.len())
    }

    /// Returns the camera at a position on its path, 0 at the first pose and 1 at the last. Its
    /// picture is one unit high.
    fn camera(&self, position: f64, up: DVec3) -> Camera {
        let last = self.cameras.len() - 1;
        let place = position * last as f64;
        let first = (place as usize).min(last);
        let fraction = place - first as f64;
        let a = &self.cameras[first];
        let b = &self.cameras[(first + 1).min(last)];
        let view = View {
            from: DVec3::from(a.eye).lerp(b.eye.into(), fraction),
            at: DVec3::from(a.target).lerp(b.target.into(), fraction),
            fov: self.fov,
        };
        Camera::new(&view, up, 1, 1)
    }
}

/// The fraction of the distance to a hit at which the next ray begins, so that it does not hit the
/// surface that it starts from.
const JUST_BEFORE: f32 = 1.0 - 1.0 / 2048.0;

/// The largest number of rays that [`of_anything`] makes per unit of its count.
pub const OF_ANYTHING: usize = 6;

/// Rejects a count if that many rays, each leading to `rays` in total, exceed the limit of a
/// density.
pub fn check_count(key: &str, count: u32, rays: usize) -> Result<(), OutOfRange> {
    let most = RayDensity::MOST_SEGMENTS / rays;
    if count as usize <= most {
        return Ok(());
    }
    Err(OutOfRange::new(key, count, format!("up to {most}, each with {rays} rays in all")))
}

/// A traced ray with its kind and its segment up to the hit.
#[derive(Clone, Copy, Debug)]
pub struct TracedRay {
    /// The purpose of the ray.
    pub kind: Kind,
    /// The ray, which begins at a surface or a camera.
    pub ray: Ray,
    /// The segment up to the nearest hit. A shadow ray has its full length, because any object on
    /// its way may end its traversal.
    pub segment: Segment,
}

/// Returns the rays of a renderer through `scene`: primary rays through random points of the
/// pictures, `bounces` reflections in random directions, and shadow rays from primary hits to every
/// light. `tree` is any valid tree over the scene. Traces fewer rays where they take
/// [too many tests](RayDensity::MOST_TESTS), and ends early when `is_over` returns true.
pub fn of_renderer(
    config: &RenderedRays,
    scene: &Scene,
    tree: &Bvh,
    is_over: &dyn Fn() -> bool,
) -> Vec<TracedRay> {
    let mut tracing = Tracing::new(&scene.primitives, tree, config.seed);
    let up = scene.up();
    for index in 0..config.count {
        if is_over() {
            break;
        }
        if !tracing.affords(index, config.count) {
            continue;
        }
        // One random position in each of `count` equal parts of the path covers it evenly.
        let position = (f64::from(index) + tracing.rng.random::<f64>()) / f64::from(config.count);
        let camera = config.camera(position, up);
        let x = 0.5 + (tracing.rng.random::<f64>() - 0.5) * config.aspect;
        let direction = camera.direction(x, tracing.rng.random());
        let mut hit = tracing.nearest(Kind::Primary, camera.origin.as_vec3(), direction);
        if let Some(point) = hit {
            for &light in &config.lights {
                tracing.shadow(point, light.into());
            }
        }
        for _ in 0..config.bounces {
            let Some(point) = hit else { break };
            let direction = on_sphere(&mut tracing.rng);
            hit = tracing.nearest(Kind::Bounce, point, direction);
        }
    }
    tracing.rays
}

/// Returns rays that need no camera: `count` rays from random points in the scene, `count` rays
/// through it from outside, and from each hit one ray in a random direction and one to a random
/// point. Traces fewer rays where they take [too many tests](RayDensity::MOST_TESTS), and ends early
/// when `is_over` returns true.
pub fn of_anything(
    count: u32,
    primitives: &Primitives,
    tree: &Bvh,
    seed: u64,
    is_over: &dyn Fn() -> bool,
) -> Vec<TracedRay> {
    let mut tracing = Tracing::new(primitives, tree, seed);
    let root = tracing.bounds;
    if tree.nodes.is_empty() {
        return Vec::new();
    }
    for (first, family) in [(0, Family::Inside), (count, Family::Lines)] {
        for index in first..first + count {
            if is_over() {
                return tracing.rays;
            }
            if !tracing.affords(index, 2 * count) {
                continue;
            }
            let Some(ray) = random_ray(family, &root, &mut tracing.rng) else { continue };
            let hit = tracing.nearest(Kind::Incoherent, ray.origin(), ray.direction().as_dvec3());
            let Some(point) = hit else { continue };
            let direction = on_sphere(&mut tracing.rng);
            tracing.nearest(Kind::Bounce, point, direction);
            let place = [tracing.rng.random(), tracing.rng.random(), tracing.rng.random()];
            tracing.shadow(point, in_box(&root, place));
        }
    }
    tracing.rays
}

/// Returns `count` of the paper's random rays, up to their nearest hits.
pub fn of_inside(count: u32, scene: &Scene, tree: &Bvh, seed: u64) -> Vec<TracedRay> {
    let mut tracing = Tracing::new(&scene.primitives, tree, seed);
    for _ in 0..count {
        let root = Some(tracing.bounds).filter(|_| !tree.nodes.is_empty());
        let ray = root.and_then(|root| random_ray(Family::Inside, &root, &mut tracing.rng));
        let Some(ray) = ray else { continue };
        tracing.nearest(Kind::Incoherent, ray.origin(), ray.direction().as_dvec3());
    }
    tracing.rays
}

/// The default number of primary rays that train a tree; without a camera, the number of rays of
/// each family.
pub const TRAINED: u32 = 100_000;

/// Returns the density of [rays that need no camera](of_anything), [`TRAINED`] of each family: those
/// that train the trees of bakes, and, of another seed, judge them. `None` soon after `is_over`
/// returns true.
///
/// # Errors
///
/// As [`density`].
pub fn anywhere(
    primitives: &Primitives,
    tree: &Bvh,
    seed: u64,
    is_over: &dyn Fn() -> bool,
) -> Result<Option<RayDensity>, DensityError> {
    let rays = of_anything(TRAINED, primitives, tree, seed, is_over);
    // After an interruption some rays are missing, or all of them, which is an error otherwise.
    if is_over() { Ok(None) } else { density(&rays, tree).map(Some) }
}

/// The share of area in a box's measure. Without it a box that no sampled ray enters would be free.
/// For a camera, shares from 0.02 to 0.3 change trees by less than seeds do; without a camera, 0.3
/// loses half of the gain in interiors.
const AREA_WEIGHT: f64 = 0.1;

/// Returns the density of rays through the scene of a tree.
///
/// # Errors
///
/// [`DensityError`] if there are no rays, too many, or the tree has no nodes.
pub fn density(rays: &[TracedRay], tree: &Bvh) -> Result<RayDensity, DensityError> {
    let moved = |traced: &TracedRay| traced.segment.in_frame(tree.frame.as_ref());
    let segments: Vec<Segment> = rays.iter().map(moved).collect();
    let bounds = tree.root_aabb().ok_or(DensityError::Bounds)?;
    RayDensity::of_rays(&bounds, &segments, AREA_WEIGHT)
}

/// Returns the box around a tree's objects along the file's axes, also of a tree in a frame.
pub(super) fn bounds_along_file(primitives: &Primitives, tree: &Bvh) -> Option<Aabb> {
    let root = tree.root_aabb()?;
    Some(if tree.frame.is_some() { Aabb::union_of(&primitives.boxes()) } else { root })
}

struct Tracing<'a> {
    accelerator: Accelerator<'a>,
    bounds: Aabb,
    rng: ChaCha8Rng,
    rays: Vec<TracedRay>,
    tests: TestCounts,
}

impl<'a> Tracing<'a> {
    fn new(primitives: &'a Primitives, tree: &'a Bvh, seed: u64) -> Self {
        let accelerator = Accelerator::of_tree(primitives, tree);
        let bounds = bounds_along_file(primitives, tree).unwrap_or(Aabb::EMPTY);
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Self { accelerator, bounds, rng, rays: Vec::new(), tests: TestCounts::default() }
    }

    /// Returns whether the ray of this index, of so many, and those that follow it can be traced.
    fn affords(&self, index: u32, count: u32) -> bool {
        RayDensity::affords(&self.tests, f64::from(index) / f64::from(count))
    }

    /// Keeps a ray that needs its nearest hit. Returns a point just before the hit, where further
    /// rays may begin.
    fn nearest(&mut self, kind: Kind, origin: Vec3, direction: DVec3) -> Option<Vec3> {
        let ray = Ray::half_line(origin, direction.as_vec3()).ok()?;
        let hit = self.accelerator.nearest_hit_counted(&ray, &mut self.tests);
        // A ray without a hit ends outside the scene, because a density needs finite segments.
        let length = hit.map_or_else(|| self.beyond(&ray), |hit| hit.t);
        self.keep(kind, ray, length);
        hit.map(|hit| ray.at(hit.t * JUST_BEFORE))
    }

    fn shadow(&mut self, point: Vec3, light: DVec3) {
        let way = light - point.as_dvec3();
        let Ok(ray) = Ray::new(point, way.as_vec3(), 0.0, JUST_BEFORE) else { return };
        self.keep(Kind::Shadow, ray, JUST_BEFORE);
    }

    fn keep(&mut self, kind: Kind, ray: Ray, end: f32) {
        // In the largest scenes the end of a ray may overflow.
        if let Some(segment) = Segment::of_ray(&ray, end) {
            self.rays.push(TracedRay { kind, ray, segment });
        }
    }

    fn beyond(&self, ray: &Ray) -> f32 {
        let reach =
            (self.bounds.min - ray.origin()).abs().max((self.bounds.max - ray.origin()).abs());
        let (reach, reach_unit) = scaled_length(reach);
        let (step, step_unit) = scaled_length(ray.direction());
        2.0 * reach / step * (reach_unit / step_unit)
    }
}

/// Returns the length of a vector in multiples of a power of two, and that power.
///
/// The power is near the vector's largest component, so that no square overflows or vanishes.
fn scaled_length(vector: Vec3) -> (f32, f32) {
    let largest = vector.abs().max_element();
    let exponent_bits = largest.to_bits() & f32::INFINITY.to_bits();
    let unit = f32::from_bits(exponent_bits).max(f32::MIN_POSITIVE);
    ((vector / unit).length(), unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_build::{Builder, muller_fellner};
    use bvh_config::Check;
    use bvh_core::{Node, Sphere, Triangle};

    /// Returns the segments of rays through four triangles whose corners are multiples of `unit`.
    fn segments_at_scale(unit: f32) -> Vec<[[f32; 3]; 2]> {
        let corners = [[0.0, 0.0, 0.0], [3.0, 0.0, 1.0], [0.0, 2.0, 0.0], [1.0, 1.0, 4.0]];
        let corners = corners.map(|corner| Vec3::from(corner) * unit);
        let triangles: Vec<Triangle> = (0..4)
            .map(|skipped| Triangle([1, 2, 3].map(|step| corners[(skipped + step) % 4])))
            .collect();
        let objects = Primitives::Triangles(triangles);
        let tree = muller_fellner::Config::default().build(&objects.boxes()).unwrap();
        of_anything(50, &objects, &tree, 1, &|| false)
            .iter()
            .filter(|traced| traced.kind != Kind::Shadow)
            .map(|traced| [traced.segment.from, traced.segment.to])
            .collect()
    }

    #[test]
    fn rays_that_miss_are_as_long_in_scenes_of_any_scale() {
        let segments = segments_at_scale(1.0);
        for exponent in [-100, -70, 70, 100] {
            let unit = 2f32.powi(exponent);
            let expected: Vec<_> = segments
                .iter()
                .map(|ends| ends.map(|end| end.map(|coordinate| coordinate * unit)))
                .collect();
            assert_eq!(segments_at_scale(unit), expected, "2^{exponent}");
        }
    }

    #[test]
    fn fewer_rays_of_every_kind_are_traced_where_all_of_them_test_all_objects() {
        let sphere = Sphere { center: Vec3::splat(0.5), radius: 0.5 };
        // The others are soon missed.
        let mut spheres = vec![Sphere { radius: 0.01, ..sphere }; 30_000];
        spheres[0] = sphere;
        let objects = Primitives::Spheres(spheres);
        let leaf = Node::leaf(sphere.aabb(), 0, 30_000);
        let tree = Bvh { nodes: vec![leaf], prim_ids: (0..30_000).collect(), ..Bvh::default() };
        let rays = of_anything(10_000, &objects, &tree, 1, &|| false);
        let begins_inside = |traced: &&TracedRay| {
            let origin = traced.ray.origin();
            origin.min_element() > 0.01 && origin.max_element() < 0.99
        };
        let first = rays.iter().filter(|traced| traced.kind == Kind::Incoherent);
        let inside = first.clone().filter(begins_inside).count();
        let outside = first.count() - inside;
        assert!((1000..6000).contains(&inside), "{inside}");
        assert!((1000..6000).contains(&outside), "{outside}");
    }

    #[test]
    fn more_rays_than_a_density_counts_are_rejected_before_they_are_traced() {
        let pose = Viewpoint { eye: [0.0; 3], target: [1.0; 3] };
        let mut rays =
            RenderedRays { cameras: vec![pose], bounces: 2, count: 349_525, ..Default::default() };
        assert_eq!(rays.check(), Ok(()));
        rays.count += 1;
        let message = rays.check().unwrap_err().to_string();
        assert_eq!(message, "count is 349526; accepted: up to 349525, each with 3 rays in all");
    }

    #[test]
    fn a_renderer_sends_its_number_of_primary_rays_and_a_bounce_from_every_hit() {
        let scene = Scene::load("escher:500").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let pose = Viewpoint { eye: [9.0, 5.0, 8.0], target: [0.0; 3] };
        let rays = RenderedRays { cameras: vec![pose], count: 100, ..Default::default() };
        let traced = of_renderer(&rays, &scene, &tree, &|| false);
        let of_kind = |kind| traced.iter().filter(move |traced| traced.kind == kind);
        let accelerator = Accelerator::of_tree(&scene.primitives, &tree);
        let hits = of_kind(Kind::Primary).filter(|traced| accelerator.any_hit(&traced.ray)).count();
        assert!(hits > 0);
        assert_eq!([of_kind(Kind::Primary).count(), of_kind(Kind::Bounce).count()], [100, hits]);
    }
}
