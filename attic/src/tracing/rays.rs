//! The rays that are timed: pictures in Morton order, and the rays that begin at their hits. They are
//! the same on every machine.

use bvh_core::{Aabb, Bvh, Coherence, Ray};
use bvh_scenes::Scene;
use bvh_scenes::rays::{Camera, Family, Kind, View, Viewpoint, in_box, on_sphere, random_ray};
use bvh_scenes::trace::{Accelerator, Query};
use bvh_search::Stream;
use glam::{DVec3, Vec3};
use rand::SeedableRng;

/// Returns the query of the rays of a kind.
pub fn query(kind: Kind) -> Query {
    if kind == Kind::Shadow { Query::Any } else { Query::Nearest }
}

/// Returns whether consecutive rays of a kind begin close to each other and have similar
/// directions.
pub fn coherence(kind: Kind) -> Coherence {
    match kind {
        Kind::Primary | Kind::Shadow => Coherence::Coherent,
        Kind::Bounce | Kind::Incoherent => Coherence::Incoherent,
    }
}

/// Returns whether `count` rays of a kind cover squares of 16 × 16 pixels completely, one square
/// after the other, each in Morton order.
pub fn is_in_squares(kind: Kind, count: u32) -> bool {
    let side = picture_side(count);
    kind == Kind::Primary && side.is_multiple_of(16) && side * side == count
}

/// Returns `count` rays of a kind through `tree`, which must be valid over the scene. All directions
/// are unit vectors and all rays begin at distance 0. Primary rays come from a pinhole camera with an
/// angle of view of 60 degrees, and bounce and shadow rays from their hits, in their order; without a
/// hit the result is empty. The light is below the middle of the box's upper side.
pub fn rays(
    kind: Kind,
    count: u32,
    scene: &Scene,
    tree: &Bvh,
    viewpoint: &Viewpoint,
    seed: u64,
) -> Vec<Ray> {
    let Some(root) = tree.root_aabb() else { return Vec::new() };
    match kind {
        Kind::Incoherent => {
            let mut rng = Stream::seed_from_u64(seed);
            (0..count).filter_map(|_| random_ray(Family::Inside, &root, &mut rng)).collect()
        }
        Kind::Primary => primary_rays(count, &root, viewpoint),
        Kind::Bounce => {
            let mut rng = Stream::seed_from_u64(seed);
            let primary = primary_rays(count, &root, viewpoint);
            // Many primary rays miss. Repeating the hits keeps the number of rays, which times are
            // compared over.
            hit_points(&primary, scene, tree, JUST_BEFORE)
                .iter()
                .cycle()
                .take(count as usize)
                .filter_map(|&origin| Ray::half_line(origin, on_sphere(&mut rng).as_vec3()).ok())
                .collect()
        }
        Kind::Shadow => {
            let primary = primary_rays(count, &root, viewpoint);
            let light = in_box(&root, [0.5, 0.95, 0.5]);
            hit_points(&primary, scene, tree, 1.0)
                .iter()
                .cycle()
                .take(count as usize)
                .filter_map(|&point| shadow_ray(point, light))
                .collect()
        }
    }
}

/// The fraction of the distance to a hit at which the next ray begins. A library without a minimum
/// distance would otherwise hit the surface that the ray starts from.
const JUST_BEFORE: f32 = 1.0 - 1.0 / 2048.0;

fn hit_points(rays: &[Ray], scene: &Scene, tree: &Bvh, fraction: f32) -> Vec<Vec3> {
    let accelerator = Accelerator::of_tree(&scene.primitives, tree);
    let mut points = Vec::new();
    for ray in rays {
        if let Some(hit) = accelerator.nearest_hit(ray) {
            points.push(ray.at(fraction * hit.t));
        }
    }
    points
}

/// Returns rays through the centres of the pixels of a square picture, in Morton order.
///
/// Packet tracers need consecutive rays to be close to each other in both directions of the
/// picture:
///
/// ```text
///  0  1 │  4  5
///  2  3 │  6  7
/// ──────┼──────
///  8  9 │ 12 13
/// 10 11 │ 14 15
/// ```
fn primary_rays(count: u32, root: &Aabb, viewpoint: &Viewpoint) -> Vec<Ray> {
    let view =
        View { from: in_box(root, viewpoint.eye), at: in_box(root, viewpoint.target), fov: 60.0 };
    let side = picture_side(count);
    let camera = Camera::new(&view, DVec3::Y, side, side);
    let mut rays = Vec::new();
    for [x, y] in pixels(side, count) {
        let direction = camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
        rays.extend(Ray::half_line(camera.origin.as_vec3(), direction.as_vec3()));
    }
    rays
}

/// Returns the side of the smallest square picture with at least `count` pixels. Its last rows may
/// be incomplete.
fn picture_side(count: u32) -> u32 {
    (1..=count).find(|side| side.saturating_mul(*side) >= count).unwrap_or(count)
}

/// Returns the column and the row of the first `count` pixels of a square picture, counted row by
/// row, in Morton order.
fn pixels(side: u32, count: u32) -> impl Iterator<Item = [u32; 2]> {
    // Morton codes fill a square whose side is a power of two; the pixels outside the picture go.
    let codes = u64::from(side.next_power_of_two()).pow(2);
    (0..codes).map(|code| [even_bits(code), even_bits(code >> 1)]).filter(move |&[x, y]| {
        let index = u64::from(y) * u64::from(side) + u64::from(x);
        x < side && index < u64::from(count)
    })
}

fn even_bits(code: u64) -> u32 {
    (0..32).map(|bit| ((code >> (2 * bit) & 1) as u32) << bit).sum()
}

fn shadow_ray(point: Vec3, light: DVec3) -> Option<Ray> {
    let way = light - point.as_dvec3();
    // A library without a minimum distance would hit the surface that the ray starts from.
    let origin = (point.as_dvec3() + 1e-3 * way).as_vec3();
    let direction = way.normalize_or_zero().as_vec3();
    // The ray ends as far from the light as it begins from the surface.
    let length = (0.998 * way.length()) as f32;
    Ray::new(origin, direction, 0.0, length).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_picture_has_every_pixel_once_and_its_squares_in_sequence() {
        for (side, count) in [(1, 1), (3, 7), (16, 256), (48, 2304)] {
            assert_eq!(picture_side(count), side);
            let found: Vec<[u32; 2]> = pixels(side, count).collect();
            let by_rows: BTreeSet<u32> = found.iter().map(|[x, y]| y * side + x).collect();
            assert!(by_rows.into_iter().eq(0..count), "{side}");
            if !is_in_squares(Kind::Primary, count) {
                continue;
            }
            for square in found.chunks(256) {
                let corners: BTreeSet<[u32; 2]> =
                    square.iter().map(|[x, y]| [x / 16, y / 16]).collect();
                assert_eq!(corners.len(), 1, "{side}: {corners:?}");
            }
        }
        assert!(is_in_squares(Kind::Primary, 256) && !is_in_squares(Kind::Primary, 255));
    }
}
