//! Rays where rounding decides, alone and in bundles.

use bvh_core::{Primitives, Ray, Triangle};
use bvh_scenes::trace::{Accelerator, Structure};
use bvh_search::Stream;
use bvh_stress::tracing;
use glam::Vec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};

/// The number of rays in a bundle, the same as in a packet.
const BUNDLE: usize = 64;

/// Returns rays: three eighths are of [`tracing::rays`], an eighth is where rounding decides, and
/// half are in bundles around others, equal, nearly equal or close to each other.
pub fn rays(triangles: &[Triangle], count: usize, seed: u64) -> Vec<Ray> {
    let objects = Primitives::Triangles(triangles.to_vec());
    let all = Accelerator::new(&objects, Structure::Brute);
    // Another stream than that of the other rays, so that no numbers are repeated.
    let mut rng = Stream::seed_from_u64(!seed);
    let mut rays = tracing::rays(triangles, count * 3 / 8, seed);
    let draws = (0..20 * count).filter_map(|_| adversarial(triangles, &all, &mut rng));
    rays.extend(draws.take(count / 8));
    let single = rays.len();
    // Bundles in place of missing rays would test less without notice.
    assert_eq!(single, count * 3 / 8 + count / 8, "too few rays where rounding decides");
    while rays.len() < count {
        let ray = pick(&rays[..single], &mut rng);
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

/// Returns a ray in the plane of a triangle, along an edge, from or through a corner, an edge or the
/// centre, or along an axis, exactly or nearly. Its direction has any length, which makes distances
/// underflow. It covers a half line, a single point, or a range that ends at a hit or next to it.
fn adversarial(triangles: &[Triangle], all: &Accelerator, rng: &mut Stream) -> Option<Ray> {
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
        .map(|ray| all.nearest_hit(&ray))?
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
