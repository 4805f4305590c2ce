//! The rays of every measurement, random or from a renderer. They are the same on every machine.

use super::camera::{Camera, View};
use crate::Scene;
use crate::trace::{Accelerator, Query};
use bvh_core::{Aabb, Bvh, Coherence, Ray};
use glam::{DVec3, Vec3};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

bvh_config::config! {
    /// A distribution of random rays over the root's box.
    #[derive(Copy, Eq)]
    pub enum Family {
        /// The paper's rays: the origin is uniform in the box, and the direction is uniform.
        Inside,
        /// Lines that meet the box, uniform in the measure that is proportional to surface area.
        Lines,
    }
}

/// Returns a random ray of a family; `None` if the box is too small or too large for a ray.
pub fn random_ray(family: Family, root: &Aabb, rng: &mut ChaCha8Rng) -> Option<Ray> {
    let low = root.min.as_dvec3();
    let size = root.extent();
    let inside = DVec3::from_array(rng.random());
    let (origin, direction) = match family {
        Family::Inside => (inside, on_sphere(rng)),
        Family::Lines => {
            // A uniform point on the surface and an inward direction with cosine density make a
            // line that is uniform among all lines through the box.
            let areas = [size.y * size.z, size.z * size.x, size.x * size.y];
            let pick = rng.random::<f64>() * areas.iter().sum::<f64>();
            let axis =
                if pick < areas[0] { 0 } else { 1 + usize::from(pick >= areas[0] + areas[1]) };
            let far = rng.random::<bool>();
            let mut origin = inside;
            origin[axis] = f64::from(u8::from(far));
            let mut normal = DVec3::ZERO;
            normal[axis] = if far { -1.0 } else { 1.0 };
            // A unit normal plus a uniform unit vector has cosine density (Lambert).
            (origin, on_sphere(rng) + normal)
        }
    };
    // Rounding to f32 may leave the box by one step.
    let origin = (low + origin * size).as_vec3().clamp(root.min, root.max);
    Ray::half_line(origin, direction.as_vec3()).ok()
}

/// Returns a uniform point on the unit sphere: the direction of a uniform point in the unit ball,
/// which needs no function that differs between machines.
pub fn on_sphere(rng: &mut ChaCha8Rng) -> DVec3 {
    loop {
        let unit = DVec3::from_array(rng.random());
        let point = unit * 2.0 - 1.0;
        let squared = point.length_squared();
        // Near the centre rounding would make some directions more likely than others.
        if squared <= 1.0 && squared > 1e-6 {
            return point / squared.sqrt();
        }
    }
}

bvh_config::config! {
    /// A kind of rays that a renderer traces. All directions are unit vectors and all rays begin at
    /// distance 0.
    #[derive(Copy, Eq)]
    pub enum Kind {
        /// Rays with uniform origins in the root's box and uniform directions; nearest hit.
        Incoherent,
        /// Rays from a pinhole camera with an angle of view of 60 degrees, pixels in Morton order;
        /// nearest hit.
        Primary,
        /// Rays from the hits of the primary rays, in their order, in random directions; nearest
        /// hit.
        Bounce,
        /// Rays from the hits of the primary rays, in their order, to a light below the middle of
        /// the box's upper side; any hit.
        Shadow,
    }
}

impl Kind {
    /// Returns the query of these rays.
    pub fn query(self) -> Query {
        if self == Self::Shadow { Query::Any } else { Query::Nearest }
    }

    /// Returns whether `count` rays of this kind cover squares of 16 × 16 pixels completely, one
    /// square after the other, each in Morton order.
    pub fn is_in_squares(self, count: u32) -> bool {
        let side = picture_side(count);
        self == Self::Primary && side.is_multiple_of(16) && side * side == count
    }

    /// Returns whether consecutive rays begin close to each other and have similar directions.
    pub fn coherence(self) -> Coherence {
        match self {
            Self::Primary | Self::Shadow => Coherence::Coherent,
            Self::Bounce | Self::Incoherent => Coherence::Incoherent,
        }
    }

    /// Returns the kind's name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Incoherent => "incoherent",
            Self::Primary => "primary",
            Self::Bounce => "bounce",
            Self::Shadow => "shadow",
        }
    }
}

/// The camera of a scene's primary rays, in fractions of the root's box: 0 is the lower corner and
/// 1 the upper corner.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Viewpoint {
    /// The camera's position.
    pub eye: [f64; 3],
    /// The point in the middle of the picture.
    pub target: [f64; 3],
}

impl Default for Viewpoint {
    fn default() -> Self {
        Self { eye: [1.9, 1.3, 2.2], target: [0.5; 3] }
    }
}

/// Returns `count` rays of a kind through `tree`, which must be valid over the scene. Bounce and
/// shadow rays need a primary hit; without one the result is empty.
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
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            (0..count).filter_map(|_| random_ray(Family::Inside, &root, &mut rng)).collect()
        }
        Kind::Primary => primary_rays(count, &root, viewpoint),
        Kind::Bounce => {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
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
pub(super) const JUST_BEFORE: f32 = 1.0 - 1.0 / 2048.0;

/// Converts fractions of the root's box into a point.
pub fn in_box(root: &Aabb, fractions: [f64; 3]) -> DVec3 {
    root.min.as_dvec3() + DVec3::from(fractions) * root.extent()
}

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
            if !Kind::Primary.is_in_squares(count) {
                continue;
            }
            for square in found.chunks(256) {
                let corners: BTreeSet<[u32; 2]> =
                    square.iter().map(|[x, y]| [x / 16, y / 16]).collect();
                assert_eq!(corners.len(), 1, "{side}: {corners:?}");
            }
        }
        assert!(Kind::Primary.is_in_squares(256) && !Kind::Primary.is_in_squares(255));
    }
}
