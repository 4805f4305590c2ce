//! The rays that a tree is searched for, with their parts up to the hit: a renderer's, or any through a scene.

use super::camera::{Camera, View};
use super::random::{Family, JUST_BEFORE, Kind, in_box, on_sphere, random_ray};
use crate::Scene;
use crate::trace::Accelerator;
use bvh_config::{OutOfRange, above, config};
use bvh_core::{Aabb, Bvh, Ray, RayDensity, Segment};
use bvh_search::Stream;
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use std::ops::Bound::Excluded;

config! {
    /// The rays of a renderer, as the file of `bake --rays FILE.toml` describes them. All coordinates are in world units.
    pub struct RenderedRays {
        /// The poses of the camera on its path, at least one; the camera moves straight from each to the next.
        cameras: Vec<Pose>;
        /// Angle of view from the lower edge of the picture to the upper one, degrees.
        fov: f64 = 60.0, in (Excluded(0.0), Excluded(180.0));
        /// Width of the picture over its height.
        aspect: f64 = 1.0, in above(0.0);
        /// Diffuse reflections that follow every primary ray, one after the other.
        bounces: u32 = 1, in 0..=100;
        /// Positions of lights: a shadow ray goes from the hit of every primary ray to each of them.
        lights: Vec<[f64; 3]>;
        /// Number of primary rays.
        count: u32 = 50_000, in 1..=1_000_000;
        /// Draws the pixels and the directions.
        seed: u64 = 1;
    }
    check Self::check_cameras;
}

config! {
    /// Where a camera is, and what it looks at, in world units.
    pub struct Pose {
        /// The eye.
        eye: [f64; 3];
        /// The point in the middle of the picture.
        target: [f64; 3];
    }
}

impl RenderedRays {
    fn check_cameras(&self) -> Option<OutOfRange> {
        let numbers = self
            .cameras
            .iter()
            .flat_map(|pose| [pose.eye, pose.target])
            .chain(self.lights.clone());
        if self.cameras.is_empty() {
            return Some(OutOfRange::new(
                "cameras",
                "empty",
                "at least one table with `eye` and `target`",
            ));
        }
        let wrong = numbers
            .flatten()
            .find(|number| !number.is_finite());
        let wrong =
            wrong.map(|wrong| OutOfRange::new("cameras and lights", wrong, "finite coordinates"));
        wrong.or_else(|| {
            check_count("count", self.count, 1 + self.bounces as usize + self.lights.len())
        })
    }

    /// The camera at a place on its path, 0 at the first pose and 1 at the last; its picture is one unit high.
    fn camera(&self, place: f64, up: DVec3) -> Camera {
        let at = place * (self.cameras.len() - 1) as f64;
        let first = (at as usize).min(self.cameras.len() - 1);
        let a = &self.cameras[first];
        let b = &self.cameras[(first + 1).min(self.cameras.len() - 1)];
        let between = |a: [f64; 3], b: [f64; 3]| DVec3::from(a).lerp(b.into(), at - first as f64);
        let view =
            View { from: between(a.eye, b.eye), at: between(a.target, b.target), fov: self.fov };
        Camera::new(&view, up, 1, 1)
    }
}

/// Rays without a camera that [`of_anything`] makes of each one counted, at most.
pub const OF_ANYTHING: usize = 6;

/// Refuses more rays than a density counts, where each of so many leads to `rays` in all.
pub fn check_count(key: &str, count: u32, rays: usize) -> Option<OutOfRange> {
    let most = RayDensity::MOST_SEGMENTS / rays;
    let accepted = || format!("up to {most}, each with {rays} rays in all");
    (count as usize > most).then(|| OutOfRange::new(key, count, accepted()))
}

/// A ray as it is traced: its kind, and its part up to what it hits.
pub struct TracedRay {
    /// Why it is sent.
    pub kind: Kind,
    /// From a surface or a camera on.
    pub ray: Ray,
    /// Up to the nearest hit. All of a shadow ray, which may meet anything on its way before what is nearest.
    pub segment: Segment,
}

/// The rays of a renderer through `scene`, of which `tree` is any valid tree: through random places of the pictures, from their
/// hits in random directions as often as `bounces` says, and from the hits of primary rays to every light.
pub fn of_renderer(config: &RenderedRays, scene: &Scene, tree: &Bvh) -> Vec<TracedRay> {
    let mut tracing = Tracing::new(scene, tree, config.seed);
    let up = scene.up();
    for index in 0..config.count {
        let place = (f64::from(index) + tracing.rng.random::<f64>()) / f64::from(config.count);
        let camera = config.camera(place, up);
        let x = 0.5 + (tracing.rng.random::<f64>() - 0.5) * config.aspect;
        let direction = camera.direction(x, tracing.rng.random());
        let mut hit = tracing.nearest(Kind::Primary, camera.origin.as_vec3(), direction);
        if let Some(point) = hit {
            config
                .lights
                .iter()
                .for_each(|&light| tracing.shadow(point, light.into()));
        }
        for _ in 0..config.bounces {
            let Some(point) = hit else { break };
            let direction = on_sphere(&mut tracing.rng);
            hit = tracing.nearest(Kind::Bounce, point, direction);
        }
    }
    tracing.rays
}

/// Rays that need no camera: `count` from anywhere in the scene and as many through it from outside; and from the hits of both
/// one in any direction and one to a point anywhere in the scene.
pub fn of_anything(count: u32, scene: &Scene, tree: &Bvh, seed: u64) -> Vec<TracedRay> {
    let mut tracing = Tracing::new(scene, tree, seed);
    let Some(root) = tree.root_aabb() else { return Vec::new() };
    for family in [Family::Inside, Family::Lines] {
        for _ in 0..count {
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

/// The paper's random rays, `count` of them, up to their nearest hits.
pub fn of_inside(count: u32, scene: &Scene, tree: &Bvh, seed: u64) -> Vec<TracedRay> {
    let mut tracing = Tracing::new(scene, tree, seed);
    for _ in 0..count {
        let ray = tree
            .root_aabb()
            .and_then(|root| random_ray(Family::Inside, &root, &mut tracing.rng));
        let Some(ray) = ray else { continue };
        tracing.nearest(Kind::Incoherent, ray.origin(), ray.direction().as_dvec3());
    }
    tracing.rays
}

/// Traces rays and keeps them.
struct Tracing<'a> {
    accelerator: Accelerator<'a>,
    bounds: Aabb,
    rng: Stream,
    rays: Vec<TracedRay>,
}

impl<'a> Tracing<'a> {
    fn new(scene: &'a Scene, tree: &'a Bvh, seed: u64) -> Self {
        let accelerator = Accelerator::of_tree(&scene.primitives, tree);
        let bounds = tree.root_aabb().unwrap_or(Aabb::EMPTY);
        Self { accelerator, bounds, rng: Stream::seed_from_u64(seed), rays: Vec::new() }
    }

    /// Keeps a ray that looks for its nearest hit. Returns a point just before the hit, from which further rays may begin.
    fn nearest(&mut self, kind: Kind, origin: Vec3, direction: DVec3) -> Option<Vec3> {
        let ray = Ray::half_line(origin, direction.as_vec3()).ok()?;
        let hit = self.accelerator.nearest_hit(&ray);
        // A ray that hits nothing ends where it has left the scene.
        let length = hit.map_or_else(|| self.beyond(&ray), |hit| hit.t);
        self.keep(kind, ray, length);
        hit.map(|hit| ray.at(hit.t * JUST_BEFORE))
    }

    /// Keeps the ray from a point to a light.
    fn shadow(&mut self, point: Vec3, light: DVec3) {
        let way = light - point.as_dvec3();
        let Ok(ray) = Ray::new(point, way.as_vec3(), 0.0, JUST_BEFORE) else { return };
        self.keep(Kind::Shadow, ray, JUST_BEFORE);
    }

    fn keep(&mut self, kind: Kind, ray: Ray, end: f32) {
        let from = ray.origin();
        let to = ray.at(end);
        if to.is_finite() {
            let segment = Segment { from: from.to_array(), to: to.to_array() };
            self.rays.push(TracedRay { kind, ray, segment });
        }
    }

    /// A distance at which the ray is outside the scene.
    fn beyond(&self, ray: &Ray) -> f32 {
        let reach = (self.bounds.min - ray.origin())
            .abs()
            .max((self.bounds.max - ray.origin()).abs());
        2.0 * reach.length() / ray.direction().length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_config::Check;

    #[test]
    fn more_rays_than_a_density_counts_are_refused_before_they_are_traced() {
        let pose = Pose { eye: [0.0; 3], target: [1.0; 3] };
        let rays = |count| RenderedRays {
            cameras: vec![pose.clone()],
            bounces: 2,
            count,
            ..Default::default()
        };
        assert_eq!(rays(349_525).check(), Ok(()));
        let refused = rays(349_526).check().unwrap_err().to_string();
        assert_eq!(refused, "count is 349526; accepted: up to 349525, each with 3 rays in all");
    }
}
