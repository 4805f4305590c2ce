//! Traversal of a KD-tree, with the same answers as a test of every object.
//!
//! A ray's interval in a cell is computed by the operations of [`Slabs`] and is only ever cut by
//! split planes. If an object's box is on one side of a plane, its interval is therefore within the
//! interval of that side. A box on both sides is referenced from both, and the two intervals
//! overlap. Hence the traversal skips no cell that contains a hit. A hit outside the current cell
//! counts as well, and cells that begin behind the hit are skipped.

use super::{Cell, KdTree};
use bvh_core::{Counter, Hit, Ray, Slabs};
use std::ops::ControlFlow;

impl KdTree {
    /// Returns the nearest object that `ray` hits in its range; of several at the same distance,
    /// the object with the lowest id. Accepts the same `test` as [`bvh_core::nearest_hit_by`] and
    /// gives the same answer, bit for bit.
    ///
    /// `counter` counts the root's box and every visited split plane as one box each. It counts
    /// every test of an object, which may happen once in each cell that the object overlaps.
    #[inline]
    pub fn nearest_hit(
        &self,
        ray: &Ray,
        mut test: impl FnMut(u32, f32) -> Option<f32>,
        counter: &mut impl Counter,
    ) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        self.walk(ray, counter, |objects, t_max, counter| {
            for &object in objects {
                counter.object();
                if let Some(t) = test(object, *t_max)
                    && t <= *t_max
                {
                    let hit = Hit { t, object };
                    // Cells may return equal distances in any order; the lowest id decides.
                    if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                        nearest = Some(hit);
                        *t_max = t;
                    }
                }
            }
            ControlFlow::Continue(())
        });
        nearest
    }

    /// Returns whether `ray` hits any object in its range; see [`bvh_core::any_hit_by`] and
    /// [`nearest_hit`](Self::nearest_hit).
    #[inline]
    pub fn any_hit(
        &self,
        ray: &Ray,
        mut test: impl FnMut(u32) -> bool,
        counter: &mut impl Counter,
    ) -> bool {
        let mut is_hit = false;
        self.walk(ray, counter, |objects, _, counter| {
            for &object in objects {
                counter.object();
                if test(object) {
                    is_hit = true;
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        });
        is_hit
    }

    /// Calls `leaf` with the objects of every leaf that the ray may hit, from near to far, until
    /// `leaf` breaks. `leaf` may lower the distance beyond which cells are skipped.
    #[inline(always)]
    fn walk<C: Counter>(
        &self,
        ray: &Ray,
        counter: &mut C,
        mut leaf: impl FnMut(&[u32], &mut f32, &mut C) -> ControlFlow<()>,
    ) {
        if self.cells.is_empty() {
            return;
        }
        let slabs = Slabs::new(ray, &self.bounds);
        let backwards = ray.inverse_direction().to_array().map(|inverse| inverse < 0.0);
        let mut t_max = ray.t_max();
        counter.boxes(1);
        let (mut entry, mut exit) = slabs.interval(&self.bounds);
        if entry > exit || entry > t_max {
            return;
        }
        // Every level adds at most one pending cell, so the stack cannot overflow.
        let mut stack = [(0, 0.0, 0.0); Self::MAX_DEPTH];
        let mut pending = 0;
        let mut cell = 0;
        loop {
            match self.cells[cell] {
                Cell::Leaf { first, count } => {
                    let objects = &self.objects[first as usize..first as usize + count as usize];
                    if leaf(objects, &mut t_max, counter).is_break() {
                        return;
                    }
                }
                Cell::Inner { axis, position, below } => {
                    counter.boxes(1);
                    let (far_entry, near_exit) = slabs.crossing(axis.into(), position);
                    let near = below as usize + usize::from(backwards[usize::from(axis)]);
                    let far = below as usize + usize::from(!backwards[usize::from(axis)]);
                    let far_entry = far_entry.max(entry);
                    let near_exit = near_exit.min(exit);
                    let near_met = entry <= near_exit;
                    let far_met = far_entry <= exit && far_entry <= t_max;
                    if near_met {
                        if far_met {
                            stack[pending] = (far, far_entry, exit);
                            pending += 1;
                        }
                        (cell, exit) = (near, near_exit);
                        continue;
                    }
                    if far_met {
                        (cell, entry) = (far, far_entry);
                        continue;
                    }
                }
            }
            loop {
                if pending == 0 {
                    return;
                }
                pending -= 1;
                (cell, entry, exit) = stack[pending];
                if entry <= t_max {
                    break;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Config;
    use super::*;
    use bvh_core::{Aabb, TestCounts, clip_to_box, nearest_hit_of_all};
    use glam::Vec3;
    use proptest::prelude::*;

    /// Makes boxes between points of a small grid: many are flat, identical or nested, and many
    /// faces coincide.
    fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
        let corners = prop::array::uniform2(prop::array::uniform3(-3i8..4));
        let b = corners.prop_map(|corners| {
            Aabb::around(corners.map(|corner| Vec3::from(corner.map(|c| f32::from(c) * 0.75))))
        });
        prop::collection::vec(b, 0..120)
    }

    /// Makes corners of these boxes, and points halfway between them; zeros have both signs.
    fn point(coordinates: [i8; 3]) -> Vec3 {
        Vec3::from(coordinates.map(|c| f32::from(c) * -0.375))
    }

    proptest! {
        #[test]
        fn trees_are_bounded_and_give_the_answers_of_brute_force(
            boxes in boxes(),
            rays in prop::collection::vec(
                (prop::array::uniform3(-9i8..10), prop::array::uniform3(-4i8..5)),
                100,
            ),
        ) {
            let tree = Config::default().build(&boxes).unwrap();
            prop_assert!(tree.references() >= boxes.len() && tree.references() <= 16 * boxes.len());
            prop_assert!(tree.depth() as f64 <= 8.0 + 1.3 * libm::log2(boxes.len().max(1) as f64));
            for (origin, towards) in rays {
                // Rays go through corners, along faces and edges, and past them.
                let Ok(ray) = Ray::half_line(point(origin), point(towards)) else { continue };
                let solid = |id: u32, t_max| {
                    clip_to_box(&ray, &boxes[id as usize], ray.t_min(), t_max)
                };
                let expected = nearest_hit_of_all(boxes.len() as u32, &ray, solid, &mut ());
                prop_assert_eq!(tree.nearest_hit(&ray, solid, &mut ()), expected, "{:?}", ray);
                let any = tree.any_hit(&ray, |id| solid(id, f32::MAX).is_some(), &mut ());
                prop_assert_eq!(any, expected.is_some(), "{:?}", ray);
            }
        }
    }

    #[test]
    fn separate_objects_need_few_tests() {
        let boxes: Vec<Aabb> = (0..64)
            .map(|i| Vec3::X * i as f32 * 2.0)
            .map(|min| Aabb { min, max: min + 1.0 })
            .collect();
        let tree = Config::default().build(&boxes).unwrap();
        assert_eq!(tree.references(), boxes.len());
        let mut counts = TestCounts::default();
        let ray = Ray::half_line(Vec3::new(60.5, 0.5, -5.0), Vec3::Z).unwrap();
        let solid = |id: u32, t_max| clip_to_box(&ray, &boxes[id as usize], 0.0, t_max);
        assert_eq!(tree.nearest_hit(&ray, solid, &mut counts).map(|hit| hit.object), Some(30));
        assert_eq!(counts.objects, 1);
        assert!(counts.boxes <= 1 + tree.depth() as u64, "{counts:?}");
    }
}
