//! Traversal of a hierarchy as in Chang's CSS 552 report: every box on the ray is opened, the last
//! child first, and no hit ends the traversal or skips a box.
//!
//! A hit in a leaf counts only between the distances at which the ray enters and leaves the leaf's
//! box. The box test is the one that the report cites (Williams, Barrus, Morley & Shirley 2005, 'An
//! efficient and robust ray–box intersection algorithm'). It has no margin, so that rounding can
//! lose a hit on a face of a box. No other traversal of this project loses hits.

use bvh_core::{Aabb, Bvh, Counter, Hit, NodeKind, Ray};
use std::ops::RangeInclusive;

/// Returns the nearest hit in the ray's range that lies within the box of its leaf. `test` is as
/// for [`bvh_core::nearest_hit_by`], and `counter` counts each box and each object that is tested.
#[inline]
pub fn nearest_hit(
    tree: &Bvh,
    ray: &Ray,
    mut test: impl FnMut(u32, f32) -> Option<f32>,
    counter: &mut impl Counter,
) -> Option<Hit> {
    let mut nearest: Option<Hit> = None;
    let mut pending: Vec<u32> = (0..tree.nodes.len().min(1) as u32).collect();
    while let Some(index) = pending.pop() {
        let node = &tree.nodes[index as usize];
        counter.boxes(1);
        let Some(inside) = interval(ray, &node.aabb) else { continue };
        match node.kind() {
            NodeKind::Inner { first, count } => pending.extend(first..first + count),
            NodeKind::Leaf { first, count } => {
                for &object in &tree.prim_ids[first as usize..first as usize + count as usize] {
                    counter.object();
                    let t_max = nearest.map_or(ray.t_max(), |hit| hit.t);
                    let Some(t) = test(object, t_max).filter(|t| inside.contains(t)) else {
                        continue;
                    };
                    let hit = Hit { t, object };
                    if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                        nearest = Some(hit);
                    }
                }
            }
        }
    }
    nearest
}

/// Returns the distances at which the ray's half line enters and leaves the box, without a margin
/// for rounding; `None` if it misses the box. The first distance is negative for a ray that starts
/// in the box.
#[inline]
fn interval(ray: &Ray, aabb: &Aabb) -> Option<RangeInclusive<f32>> {
    let low = (aabb.min - ray.origin()) * ray.inverse_direction();
    let high = (aabb.max - ray.origin()) * ray.inverse_direction();
    let enter = low.min(high).max_element();
    let out = low.max(high).min_element();
    (enter <= out && out >= 0.0).then_some(enter..=out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_build::{Builder, median_cut};
    use bvh_core::{Node, TestCounts};
    use glam::Vec3;

    #[test]
    fn all_boxes_on_the_ray_are_opened_last_child_first_and_hits_count_in_the_box_of_their_leaf() {
        // Unit cubes on the x axis, the first from 0 to 1, the last from 198 to 199.
        let min = |i: usize| Vec3::X * (2 * i) as f32;
        let boxes: Vec<Aabb> = (0..100).map(|i| Aabb { min: min(i), max: min(i) + 1.0 }).collect();
        let config = median_cut::Config { leaf_fraction: 0.1, ..Default::default() };
        let tree = config.build(&boxes).unwrap();
        let ray = Ray::half_line(Vec3::new(-1.0, 0.5, 0.5), Vec3::X).unwrap();
        let mut order = vec![];
        let mut counts = TestCounts::default();
        let entry = |id: u32, t_max| {
            order.push(id);
            Some((2 * id + 1) as f32).filter(|t| *t <= t_max)
        };
        let hit = nearest_hit(&tree, &ray, entry, &mut counts);
        assert_eq!(hit, Some(Hit { t: 1.0, object: 0 }));
        assert_eq!(counts, TestCounts { boxes: tree.nodes.len() as u64, objects: 100 });
        assert!(order[0] >= 50, "{order:?}");
        let leaf = Bvh::new(vec![Node::leaf(boxes[0], 0, 1)], vec![0]);
        // The ray is in the box from 1 to 2.
        for (t, is_in_leaf) in [(0.5, false), (1.0, true), (2.0, true), (2.5, false)] {
            let hit = nearest_hit(&leaf, &ray, |_, _| Some(t), &mut ());
            assert_eq!(hit.is_some(), is_in_leaf, "{t}");
        }
    }
}
