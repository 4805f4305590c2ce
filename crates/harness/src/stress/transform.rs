//! Exact changes of a scene that a method should not notice, or should: scale, reflection, order.

use bvh_core::{Aabb, Bvh};
use bvh_search::Stream;
use glam::Vec3;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use std::ops::RangeInclusive;

/// All coordinates times 2^k; exact for the k of [`scale_range`].
pub fn scaled(boxes: &[Aabb], k: i32) -> Vec<Aabb> {
    let scale = |p: Vec3| (p.as_dvec3() * libm::exp2(k.into())).as_vec3();
    boxes
        .iter()
        .map(|b| Aabb { min: scale(b.min), max: scale(b.max) })
        .collect()
}

/// A cost in units of area after the scene was scaled by 2^k.
pub fn scaled_area(area: f64, k: i32) -> f64 {
    area * libm::exp2((2 * k).into())
}

/// The k by which all coordinates can be scaled so that none overflows or becomes denormal; 0 is always among them.
pub fn scale_range(boxes: &[Aabb]) -> RangeInclusive<i32> {
    let coordinates = boxes.iter().flat_map(|b| {
        b.min
            .to_array()
            .into_iter()
            .chain(b.max.to_array())
    });
    let exponents = coordinates
        .filter(|&x| x != 0.0)
        .map(|x| (x.to_bits() >> 23 & 0xff).max(1) as i32 - 127);
    let (low, high) = exponents.fold((127, -126), |(low, high), e| (low.min(e), high.max(e)));
    (-126 - low).min(0)..=(127 - high).max(0)
}

/// All coordinates along an axis negated.
pub fn mirrored(boxes: &[Aabb], axis: usize) -> Vec<Aabb> {
    let mut sign = Vec3::ONE;
    sign[axis] = -1.0;
    let mirror = |b: &Aabb| Aabb {
        min: (b.min * sign).min(b.max * sign),
        max: (b.min * sign).max(b.max * sign),
    };
    boxes.iter().map(mirror).collect()
}

/// The boxes in another order, and for every place in it the object's index before.
pub fn shuffled(boxes: &[Aabb], seed: u64) -> (Vec<Aabb>, Vec<u32>) {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    order.shuffle(&mut Stream::seed_from_u64(seed));
    (order.iter().map(|&i| boxes[i as usize]).collect(), order)
}

/// The same tree, but for the boxes: the same nodes over the same objects.
pub fn same_topology(a: &Bvh, b: &Bvh) -> bool {
    let kinds = |tree: &Bvh| {
        tree.nodes
            .iter()
            .map(|node| node.kind())
            .collect::<Vec<_>>()
    };
    a.prim_ids == b.prim_ids && kinds(a) == kinds(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_scenes::builtin::stiff;

    #[test]
    fn scaling_within_the_range_is_exact_and_beyond_it_is_not() {
        let boxes = stiff::boxes(&stiff::uniform(50));
        let range = scale_range(&boxes);
        assert!(*range.start() <= -120 && *range.end() >= 120);
        for k in [*range.start(), *range.end()] {
            assert_eq!(scaled(&scaled(&boxes, k), -k), boxes);
        }
        assert_ne!(scaled(&scaled(&boxes, range.end() + 1), -range.end() - 1), boxes);
    }

    #[test]
    fn two_reflections_change_nothing_and_one_does() {
        let boxes = stiff::boxes(&stiff::symmetric(50));
        assert_eq!(mirrored(&mirrored(&boxes, 1), 1), boxes);
        assert_ne!(mirrored(&boxes, 1), boxes);
    }
}
