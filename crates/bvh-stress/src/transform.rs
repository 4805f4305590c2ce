//! Exact transformations of a scene with a known effect on trees: scale, reflection, order.

use bvh_core::{Aabb, Bvh, Triangle};
use bvh_search::Stream;
use glam::Vec3;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use std::ops::RangeInclusive;

/// Multiplies all coordinates of a point by 2^k; exact for every k of [`scale_range`].
fn point(point: Vec3, k: i32) -> Vec3 {
    // The product is exact in f64 and, within the range, in f32.
    (point.as_dvec3() * libm::exp2(k.into())).as_vec3()
}

/// Multiplies all coordinates by 2^k; exact for every k of [`scale_range`].
pub fn scaled(boxes: &[Aabb], k: i32) -> Vec<Aabb> {
    boxes.iter().map(|b| Aabb { min: point(b.min, k), max: point(b.max, k) }).collect()
}

/// Multiplies all corners by 2^k; exact unless they overflow or become denormal.
pub fn scaled_triangles(triangles: &[Triangle], k: i32) -> Vec<Triangle> {
    triangles.iter().map(|t| Triangle(t.0.map(|corner| point(corner, k)))).collect()
}

/// Returns a cost in units of area after the scene is scaled by 2^k.
pub fn scaled_area(area: f64, k: i32) -> f64 {
    area * libm::exp2((2 * k).into())
}

/// Returns the range of k for which no coordinate times 2^k overflows or becomes denormal; it
/// always includes 0.
pub fn scale_range(boxes: &[Aabb]) -> RangeInclusive<i32> {
    let coordinates =
        boxes.iter().flat_map(|b| b.min.to_array().into_iter().chain(b.max.to_array()));
    let exponents = coordinates
        // Zero stays zero at every scale.
        .filter(|&x| x != 0.0)
        .map(|x| (x.to_bits() >> 23 & 0xff).max(1) as i32 - 127);
    let (low, high) = exponents.fold((127, -126), |(low, high), e| (low.min(e), high.max(e)));
    (-126 - low).min(0)..=(127 - high).max(0)
}

/// Negates all coordinates along an axis.
pub fn mirrored(boxes: &[Aabb], axis: usize) -> Vec<Aabb> {
    let mut sign = Vec3::ONE;
    sign[axis] = -1.0;
    boxes
        .iter()
        .map(|aabb| Aabb {
            min: (aabb.min * sign).min(aabb.max * sign),
            max: (aabb.min * sign).max(aabb.max * sign),
        })
        .collect()
}

/// Returns the boxes in another order, and the original index of each.
pub fn shuffled(boxes: &[Aabb], seed: u64) -> (Vec<Aabb>, Vec<u32>) {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    order.shuffle(&mut Stream::seed_from_u64(seed));
    (order.iter().map(|&i| boxes[i as usize]).collect(), order)
}

/// Returns true if two trees have the same nodes over the same objects; their boxes may differ.
pub fn same_topology(a: &Bvh, b: &Bvh) -> bool {
    let a_kinds = a.nodes.iter().map(|node| node.kind());
    let b_kinds = b.nodes.iter().map(|node| node.kind());
    a.prim_ids == b.prim_ids && a_kinds.eq(b_kinds)
}
