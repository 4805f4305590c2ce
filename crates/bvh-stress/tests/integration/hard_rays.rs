//! Rays where rounding decides, alone and in bundles.

use crate::tracing;
use bvh_core::{Primitives, Ray, Triangle};
use bvh_scenes::trace::{Accelerator, Structure};
use bvh_search::Stream;
use glam::Vec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};

/// Returns rays of [`tracing::rays`], half of them single, half in bundles.
pub fn random(triangles: &[Triangle], count: usize, seed: u64) -> Vec<Ray> {
    half_in_bundles(count, seed, |count| tracing::rays(triangles, count, seed))
}

/// Returns rays where rounding decides, half of them single, half in bundles.
///
/// The rays run in planes of triangles and along edges, from and through their corners, edges and
/// centres, and along axes, exactly or nearly. Their directions have any length, which makes
/// distances underflow. They cover half lines, single points, and ranges that end at a hit or next
/// to it.
pub fn adversarial(triangles: &[Triangle], count: usize, seed: u64) -> Vec<Ray> {
    let objects = Primitives::Triangles(triangles.to_vec());
    let brute_force = Accelerator::new(&objects, Structure::Brute);
    let mut rng = Stream::seed_from_u64(seed);
    half_in_bundles(count, seed, |count| {
        let draws =
            (0..20 * count).filter_map(|_| one_adversarial(triangles, &brute_force, &mut rng));
        draws.take(count).collect()
    })
}

fn one_adversarial(
    triangles: &[Triangle],
    brute_force: &Accelerator,
    rng: &mut Stream,
) -> Option<Ray> {
    let nowhere = Triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
    let triangle = triangles.choose(rng).unwrap_or(&nowhere);
    let target = in_plane(triangle, rng);
    let other = in_plane(triangle, rng);
    let mut along = Vec3::from([(); 3].map(|()| if rng.random() { 0.0 } else { -0.0 }));
    along[rng.random_range(0..3)] = if rng.random() { 1.0 } else { -1.0 };
    if rng.random() {
        along[rng.random_range(0..3)] += pick(&[1e-7, -1e-30, 1e-42, 1.0], rng);
    }
    let size = triangle.aabb().extent().max_element() as f32;
    let direction = match rng.random_range(0..4) {
        0 => triangle.0[1] - triangle.0[0],
        1 => other - target,
        2 => along,
        _ => Vec3::from([(); 3].map(|()| rng.random_range(-1.0..1.0))),
    };
    // The largest component becomes 1, so that every length below is accepted.
    let direction = direction / direction.abs().max_element();
    let back = pick(&[0.0, 0.0, 1.0, -1.0, 0.3, 100.0, 1e-7], rng);
    let origin = target - direction * (size * back).min(f32::MAX / 4.0);
    // Lengths far from 1 make distances overflow or underflow.
    let direction = direction * 2f32.powi(pick(&[0, 0, 1, -99, 99, 60, -60], rng));
    let t = Ray::half_line(origin, direction)
        .ok()
        .map(|ray| brute_force.nearest_hit(&ray))?
        .map_or(1.0, |hit| hit.t);
    // Ranges that end at a hit or next to it decide by the last bit of the distance.
    let (t_min, t_max) = match rng.random_range(0..12) {
        0 | 1 => (t, t),
        2 => (0.0, t),
        3 => (t, f32::INFINITY),
        4 => (0.0, t.next_down().max(0.0)),
        5 => (t.next_up(), f32::MAX),
        6 => (t.next_up(), t),
        _ => (0.0, f32::INFINITY),
    };
    Ray::new(origin, direction, t_min, t_max).ok()
}

/// Returns a corner, a point of an edge, the centre, or any point in the plane near the triangle.
fn in_plane(Triangle([a, b, c]): &Triangle, rng: &mut Stream) -> Vec3 {
    let (u, v) = match rng.random_range(0..5) {
        0 => (0.0, 0.0),
        1 => (0.5, 0.0),
        2 => (rng.random(), 0.0),
        3 => (1.0 / 3.0, 1.0 / 3.0),
        _ => (rng.random_range(-1.0..2.0), rng.random_range(-1.0..2.0)),
    };
    a * (1.0 - u - v) + b * u + c * v
}

fn pick<T: Copy>(of: &[T], rng: &mut Stream) -> T {
    *of.choose(rng).expect("some")
}

/// The number of rays in a bundle, the same as in a packet.
const BUNDLE: usize = 64;

/// Returns `count` rays: half of them directly from `make`, half in bundles around further rays of
/// `make`. The rays of a bundle are equal, nearly equal, or close to each other.
fn half_in_bundles(count: usize, seed: u64, mut make: impl FnMut(usize) -> Vec<Ray>) -> Vec<Ray> {
    // A different stream from the rays' own, so that bundles do not repeat their numbers.
    let mut rng = Stream::seed_from_u64(!seed);
    let mut rays = make(count / 2);
    let first = rays.len();
    for ray in make((count - first).div_ceil(BUNDLE)) {
        let spread = pick(&[0.0, 1e-7, 1e-3, 0.1], &mut rng);
        let mut near =
            || Vec3::from([(); 3].map(|()| 1.0 + spread * rng.random_range(-1.0..1.0f32)));
        for _ in 0..BUNDLE {
            // Factors instead of offsets keep zeros, and work at every scale.
            let origin = ray.origin() * near();
            let direction = ray.direction() * near();
            rays.push(Ray::new(origin, direction, ray.t_min(), ray.t_max()).unwrap_or(ray));
        }
    }
    rays.truncate(count);
    rays
}

/// Scales triangles by 2^`exponent`, which makes some of them denormal if the exponent is very low;
/// `None` if they would not be finite.
pub fn scaled(triangles: &[Triangle], exponent: i32) -> Option<Vec<Triangle>> {
    // Two steps, because 2^-140 itself is denormal and would lose bits.
    let step = 2f32.powi(exponent / 2);
    let scaled: Vec<_> = triangles.iter().map(|t| Triangle(t.0.map(|p| p * step * step))).collect();
    scaled.iter().all(|t| t.aabb().check().is_ok()).then_some(scaled)
}
