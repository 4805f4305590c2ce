//! The objects of a scene, checked, packed and sorted once along every axis.

use crate::BuildError;
use crate::error::check_scene;
use bvh_core::{Aabb, PackedAabb};

/// Least number of objects that are sorted and divided in parallel. It is large enough that the
/// start of a task takes a negligible part of its time.
#[cfg(feature = "rayon")]
pub(super) const PARALLEL_OBJECTS: usize = 4096;

/// A scene's objects, sorted along every axis: the input of any number of top-down builds.
#[derive(Clone, Debug)]
pub struct Presorted {
    pub(super) boxes: Vec<PackedAabb>,
    /// Per axis, the objects by increasing box centre, equal centres by index.
    pub(super) orders: [Vec<u32>; 3],
    /// Per axis, true if the objects were already in order.
    in_order: [bool; 3],
}

impl Presorted {
    /// Checks and sorts the objects, by a radix sort of f64 centres, which are exact where f32
    /// centres would be rounded. O(n).
    ///
    /// Source: Ng & Trifonov 2003, Table 1, step 1: 'sort boxes along all three axes', by *box*
    /// centre.
    pub fn new(boxes: &[Aabb]) -> Result<Self, BuildError> {
        Self::sort(boxes, true, false)
    }

    /// Sorts like [`new`](Self::new). Without `skip_sorted`, objects that are already in order are
    /// sorted, too. With `x_without_area`, a scene without area is sorted only along x and has that
    /// order along all axes: every candidate split of its nodes costs nothing, so a greedy build
    /// halves them along the lowest axis.
    pub(crate) fn sort(
        boxes: &[Aabb],
        skip_sorted: bool,
        x_without_area: bool,
    ) -> Result<Self, BuildError> {
        check_scene(boxes)?;
        let along = |axis| sorted_along(boxes, axis, skip_sorted);
        let [x, y, z] = if x_without_area && Self::without_area(boxes) {
            let x = along(0);
            [x.clone(), x.clone(), x]
        } else {
            in_parallel(boxes.len(), || along(0), || along(1), || along(2))
        };
        let orders = [x.0, y.0, z.0];
        let in_order = [x.1, y.1, z.1];
        Ok(Self { boxes: boxes.iter().map(PackedAabb::from).collect(), orders, in_order })
    }

    /// Returns whether the box around all objects has no area, so that every tree costs nothing;
    /// true without boxes. O(n).
    pub fn without_area(boxes: &[Aabb]) -> bool {
        Aabb::union_of(boxes).half_area() == 0.0
    }

    /// Returns, per axis, whether the objects were already in order, for example because all box
    /// centres coincide along the axis.
    pub fn in_order(&self) -> [bool; 3] {
        self.in_order
    }

    /// Returns, per axis, the lowest axis that orders all objects identically, usually the same
    /// axis. O(n).
    pub fn same_orders(&self) -> [u8; 3] {
        let orders = self.orders.each_ref().map(Vec::as_slice);
        let mut same_as = [0, 1, 2];
        note_same_orders(orders, &mut same_as);
        same_as
    }
}

/// Returns the objects sorted along an axis, and whether they were already in order.
fn sorted_along(boxes: &[Aabb], axis: usize, skip_sorted: bool) -> (Vec<u32>, bool) {
    let mut keyed: Vec<(f64, u32)> =
        boxes.iter().zip(0..).map(|(b, index)| (b.doubled_centroid()[axis], index)).collect();
    // The check ends at the first pair out of order, usually within a few objects.
    let in_order = keyed.is_sorted_by_key(|&(key, _)| key);
    if !(in_order && skip_sorted) {
        // The radix sort is stable, so equal centres stay in the order of their indices.
        radsort::sort_by_key(&mut keyed, |&(key, _)| key);
    }
    let order = keyed.into_iter().map(|(_, index)| index);
    (order.collect(), in_order)
}

/// Returns the results for all three axes, computed on several threads if the number of `objects`
/// makes that pay.
pub(super) fn in_parallel<T: Send>(
    objects: usize,
    x: impl FnOnce() -> T + Send,
    y: impl FnOnce() -> T + Send,
    z: impl FnOnce() -> T + Send,
) -> [T; 3] {
    #[cfg(feature = "rayon")]
    if objects >= PARALLEL_OBJECTS {
        let (x, (y, z)) = rayon::join(x, || rayon::join(y, z));
        return [x, y, z];
    }
    #[cfg(not(feature = "rayon"))]
    let _ = objects;
    [x(), y(), z()]
}

/// Finds axes that order a node's objects identically, given the identical axes of its parent. They
/// order the objects of all descendants identically, too.
///
/// Source: Ng & Trifonov 2003, section 3.2.
#[inline(always)]
pub(super) fn note_same_orders(orders: [&[u32]; 3], same_as: &mut [u8; 3]) {
    for (low, high) in [(0u8, 1u8), (0, 2), (1, 2)] {
        let a = low as usize;
        let b = high as usize;
        // The first elements usually differ, which saves the call that compares the rest.
        if same_as[a] == low
            && same_as[b] == high
            && orders[a].first() == orders[b].first()
            && orders[a] == orders[b]
        {
            for axis in same_as.iter_mut().filter(|axis| **axis == high) {
                *axis = low;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_centres_are_ordered_by_index_and_signed_zeros_are_equal() {
        let point = |x: f32| Aabb::from(([x, 0.0, 0.0], [x, 0.0, 0.0]));
        let sorted =
            Presorted::new(&[point(1.0), point(0.0), point(-0.0), point(-1.0), point(0.0)])
                .unwrap();
        assert_eq!(sorted.orders[0], [3, 1, 2, 4, 0]);
        assert_eq!(sorted.orders[1], [0, 1, 2, 3, 4]);
    }

    #[test]
    fn centres_that_differ_below_f32_precision_are_told_apart() {
        // Both centres round to 0.5 in f32.
        let a = Aabb::from(([0.0; 3], [1.0 + f32::EPSILON, 1.0, 1.0]));
        let b = Aabb::from(([0.0; 3], [1.0; 3]));
        assert_eq!(Presorted::new(&[a, b]).unwrap().orders[0], [1, 0]);
    }
}
