//! The rays of every measurement: random ones, and those that a renderer sends. The same on every machine.

use super::camera::{Camera, View};
use crate::Scene;
use crate::trace::{Accelerator, Query};
use bvh_core::{Aabb, Bvh, Coherence, Ray};
use bvh_search::Stream;
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};

/// A distribution of random rays over the root's box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Family {
    /// Origin uniform in the box, direction uniform: the paper's.
    Inside,
    /// Lines that meet the box, uniform in the measure that is proportional to surface area.
    Lines,
}

/// A random ray of a family; `None` if the box is so small or so large that no ray can be made.
pub fn random_ray(family: Family, root: &Aabb, rng: &mut Stream) -> Option<Ray> {
    let low = root.min.as_dvec3();
    let size = root.extent();
    let mut unit = || rng.random::<f64>();
    let inside = DVec3::new(unit(), unit(), unit());
    let (origin, direction) = match family {
        Family::Inside => (inside, on_sphere(rng)),
        Family::Lines => {
            // A uniform point on the surface and a direction inwards with the density of the cosine make a line that
            // is uniform among all lines that meet the box.
            let areas = [size.y * size.z, size.z * size.x, size.x * size.y];
            let pick = rng.random::<f64>() * areas.iter().sum::<f64>();
            let axis =
                if pick < areas[0] { 0 } else { 1 + usize::from(pick >= areas[0] + areas[1]) };
            let far = rng.random::<bool>();
            let mut origin = inside;
            origin[axis] = f64::from(u8::from(far));
            let mut normal = DVec3::ZERO;
            normal[axis] = if far { -1.0 } else { 1.0 };
            (origin, on_sphere(rng) + normal)
        }
    };
    let origin = (low + origin * size)
        .as_vec3()
        .clamp(root.min, root.max);
    Ray::half_line(origin, direction.as_vec3()).ok()
}

/// A uniform point on the unit sphere. It is the direction of a uniform point of the unit ball, which needs no function
/// that differs between machines.
pub(super) fn on_sphere(rng: &mut Stream) -> DVec3 {
    loop {
        let mut coordinate = || rng.random::<f64>() * 2.0 - 1.0;
        let point = DVec3::new(coordinate(), coordinate(), coordinate());
        let squared = point.length_squared();
        if squared <= 1.0 && squared > 1e-6 {
            return point / squared.sqrt();
        }
    }
}

/// A kind of rays that a renderer sends. All directions are unit vectors and all rays begin at distance 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Kind {
    /// Origins uniform in the root's box, directions uniform; nearest hit.
    Incoherent,
    /// From a pinhole camera, pixels in Morton order, its field of view 60 degrees wide; nearest hit.
    Primary,
    /// From the hits of the primary rays, in turn, in random directions; nearest hit.
    Bounce,
    /// From the hits of the primary rays, in turn, to a light under the middle of the box's upper side; any hit.
    Shadow,
}

impl Kind {
    /// What the rays ask.
    pub fn query(self) -> Query {
        if self == Self::Shadow { Query::Any } else { Query::Nearest }
    }

    /// Whether `count` rays of this kind go through all pixels of squares of 16 × 16, one square after the other, in Morton
    /// order.
    pub fn is_in_squares(self, count: u32) -> bool {
        let side = picture_side(count);
        self == Self::Primary && side.is_multiple_of(16) && side * side == count
    }

    /// Whether consecutive rays begin close to each other and run the same way.
    pub fn coherence(self) -> Coherence {
        match self {
            Self::Primary | Self::Shadow => Coherence::Coherent,
            Self::Bounce | Self::Incoherent => Coherence::Incoherent,
        }
    }

    /// The kind's name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Incoherent => "incoherent",
            Self::Primary => "primary",
            Self::Bounce => "bounce",
            Self::Shadow => "shadow",
        }
    }
}

/// Where the primary rays of a scene come from, in fractions of the root's box: 0 is its lower corner, 1 the upper one.
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
    /// The point that it looks at.
    pub target: [f64; 3],
}

impl Default for Viewpoint {
    fn default() -> Self {
        Self { eye: [1.9, 1.3, 2.2], target: [0.5; 3] }
    }
}

/// Rays of a kind through `tree`, which must be valid over the scene. There are fewer than `count` only where there are
/// none: without a primary hit there is no shadow ray.
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
            (0..count)
                .filter_map(|_| random_ray(Family::Inside, &root, &mut rng))
                .collect()
        }
        Kind::Primary => primary_rays(count, &root, viewpoint),
        Kind::Bounce => {
            let mut rng = Stream::seed_from_u64(seed);
            let points =
                hit_points(&primary_rays(count, &root, viewpoint), scene, tree, JUST_BEFORE);
            let ray = |&origin: &Vec3| Ray::half_line(origin, on_sphere(&mut rng).as_vec3()).ok();
            points
                .iter()
                .cycle()
                .take(count as usize)
                .filter_map(ray)
                .collect()
        }
        Kind::Shadow => {
            let points = hit_points(&primary_rays(count, &root, viewpoint), scene, tree, 1.0);
            let light = in_box(&root, [0.5, 0.95, 0.5]);
            points
                .iter()
                .cycle()
                .take(count as usize)
                .filter_map(|&point| shadow_ray(point, light))
                .collect()
        }
    }
}

/// The part of the way to a hit at which the next ray begins, because a library without a shortest distance would hit the surface
/// that the ray starts from.
pub(super) const JUST_BEFORE: f32 = 1.0 - 1.0 / 2048.0;

/// A point given in fractions of the root's box.
pub fn in_box(root: &Aabb, at: [f64; 3]) -> DVec3 {
    root.min.as_dvec3() + DVec3::from(at) * root.extent()
}

/// The points at this fraction of the way to the nearest hits of rays.
fn hit_points(rays: &[Ray], scene: &Scene, tree: &Bvh, fraction: f32) -> Vec<Vec3> {
    let accelerator = Accelerator::of_tree(&scene.primitives, tree);
    let point = |ray: &Ray| {
        accelerator
            .nearest_hit(ray)
            .map(|hit| ray.at(fraction * hit.t))
    };
    rays.iter().filter_map(point).collect()
}

/// Rays through the centres of the pixels of a square picture, in Morton order.
///
/// Tracers of packets want consecutive rays to be close to each other in both directions of the picture:
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
    let centre = |pixel: u32| f64::from(pixel) + 0.5;
    let direction = |[x, y]: [u32; 2]| camera.direction(centre(x), centre(y));
    let ray = |pixel| Ray::half_line(camera.origin.as_vec3(), direction(pixel).as_vec3()).ok();
    pixels(side, count).filter_map(ray).collect()
}

/// Pixels per row of a picture with `count` pixels and as many rows as columns; the last row may lack some.
fn picture_side(count: u32) -> u32 {
    (1..=count)
        .find(|side| side.saturating_mul(*side) >= count)
        .unwrap_or(count)
}

/// The column and the row of the first `count` pixels of a square picture, counted row by row, in Morton order.
fn pixels(side: u32, count: u32) -> impl Iterator<Item = [u32; 2]> {
    let codes = u64::from(side.next_power_of_two()).pow(2);
    let pixel = |code: u64| [even_bits(code), even_bits(code >> 1)];
    let is_in_picture = move |[x, y]: &[u32; 2]| {
        *x < side && u64::from(*y) * u64::from(side) + u64::from(*x) < u64::from(count)
    };
    (0..codes).map(pixel).filter(is_in_picture)
}

/// The number that the bits of a Morton code at even places make.
fn even_bits(code: u64) -> u32 {
    (0..32)
        .map(|bit| ((code >> (2 * bit) & 1) as u32) << bit)
        .sum()
}

/// To the light, from a thousandth of the way on: a library without a shortest distance would hit the surface that the
/// ray starts from.
fn shadow_ray(point: Vec3, light: DVec3) -> Option<Ray> {
    let way = light - point.as_dvec3();
    let origin = (point.as_dvec3() + 1e-3 * way).as_vec3();
    Ray::new(origin, way.normalize_or_zero().as_vec3(), 0.0, (0.998 * way.length()) as f32).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_picture_has_every_pixel_once_and_its_squares_one_after_the_other() {
        for (side, count) in [(1, 1), (3, 7), (16, 256), (48, 2304)] {
            assert_eq!(picture_side(count), side);
            let found: Vec<[u32; 2]> = pixels(side, count).collect();
            let by_rows: BTreeSet<u32> = found.iter().map(|[x, y]| y * side + x).collect();
            assert!(by_rows.into_iter().eq(0..count), "{side}");
            if !Kind::Primary.is_in_squares(count) {
                continue;
            }
            for square in found.chunks(256) {
                let corners: BTreeSet<[u32; 2]> = square
                    .iter()
                    .map(|[x, y]| [x / 16, y / 16])
                    .collect();
                assert_eq!(corners.len(), 1, "{side}: {corners:?}");
            }
        }
        assert!(Kind::Primary.is_in_squares(256) && !Kind::Primary.is_in_squares(255));
    }
}
