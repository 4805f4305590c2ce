//! The rays of every kind: through pixels, from what those hit to a light, and from anywhere to anywhere.

use super::{Kind, reference};
use crate::measure::rays::{Family, random_ray};
use crate::scenes::Scene;
use bvh_core::{Bvh, Hit, Ray};
use bvh_search::Stream;
use glam::{DVec3, Vec3};
use rand::SeedableRng;
use serde::{Deserialize, Serialize};

/// A pinhole camera, in fractions of the root's box: 0 is its lower corner, 1 the upper one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Where it is.
    pub eye: [f64; 3],
    /// What it looks at.
    pub target: [f64; 3],
}

impl Default for Camera {
    fn default() -> Self {
        Self { eye: [1.9, 1.3, 2.2], target: [0.5; 3] }
    }
}

/// Rays of a kind: the same for the same scene and seed on every machine. Fewer than `count` only where there are none:
/// without a primary hit no shadow ray.
pub fn rays(kind: Kind, count: u32, scene: &Scene, tree: &Bvh, camera: &Camera, seed: u64) -> Vec<Ray> {
    let Some(root) = tree.root_aabb() else { return Vec::new() };
    match kind {
        Kind::Incoherent => {
            let mut rng = Stream::seed_from_u64(seed);
            (0..count).filter_map(|_| random_ray(Family::Inside, &root, &mut rng)).collect()
        }
        Kind::Primary => camera.rays(count, root.min.as_dvec3(), root.extent()),
        Kind::Shadow => {
            let primary = rays(Kind::Primary, count, scene, tree, camera, seed);
            let hits = reference(Kind::Primary, &primary, scene, tree);
            let point = |(ray, hit): (&Ray, &Option<Hit>)| hit.map(|hit| ray.at(hit.t));
            let points: Vec<Vec3> = primary.iter().zip(&hits).filter_map(point).collect();
            let light = root.min.as_dvec3() + DVec3::new(0.5, 0.95, 0.5) * root.extent();
            points.iter().cycle().take(count as usize).filter_map(|&point| shadow_ray(point, light)).collect()
        }
    }
}

/// From a thousandth of the way on, so that a library without a shortest distance does not hit the surface it starts
/// from, to the light.
fn shadow_ray(point: Vec3, light: DVec3) -> Option<Ray> {
    let way = light - point.as_dvec3();
    let origin = (point.as_dvec3() + 1e-3 * way).as_vec3();
    Ray::new(origin, way.normalize_or_zero().as_vec3(), 0.0, (0.998 * way.length()) as f32).ok()
}

impl Camera {
    /// Rays through the middles of square pixels, as many rows as columns.
    fn rays(&self, count: u32, low: DVec3, size: DVec3) -> Vec<Ray> {
        let [eye, target] = [self.eye, self.target].map(|at| low + DVec3::from(at) * size);
        let forwards = (target - eye).normalize_or_zero();
        let up = if forwards.x.abs().max(forwards.z.abs()) < 1e-3 { DVec3::X } else { DVec3::Y };
        // The tangent of 30 degrees.
        let right = forwards.cross(up).normalize_or_zero() * 0.577_350_269_189_625_8;
        let up = right.cross(forwards);
        let side = (1..=count).find(|side| side.saturating_mul(*side) >= count).unwrap_or(count);
        let middle = |pixel: u32| (2.0 * f64::from(pixel) + 1.0) / f64::from(side) - 1.0;
        let ray = |index: u32| {
            let (x, y) = (middle(index % side), -middle(index / side));
            Ray::half_line(eye.as_vec3(), (forwards + x * right + y * up).normalize_or_zero().as_vec3()).ok()
        };
        (0..count).filter_map(ray).collect()
    }
}
