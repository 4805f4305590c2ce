//! The objects of a scene, checked, packed and sorted once along every axis.

use crate::error::check_scene;
use crate::{BuildError, OBJECTS_PER_POLL, Watch};
use bvh_core::{Aabb, PackedAabb};

/// Number of objects from which on sorting and division run in parallel: large enough that the start of a task takes a
/// negligible part of its time.
pub const PARALLEL_OBJECTS: usize = 4096;

/// A scene's objects, sorted along every axis: the input of any number of top-down builds.
#[derive(Clone, Debug)]
pub struct Presorted {
    /// One box per object.
    pub(super) boxes: Vec<PackedAabb>,
    /// Per axis, the objects by increasing box centre, equal centres by index.
    pub(super) orders: [Vec<u32>; 3],
    /// Per axis, whether the objects already came in order.
    in_order: [bool; 3],
}

impl Presorted {
    /// Checks and sorts. O(n): a radix sort of f64 centres, which are exact where an f32 centre would round.
    ///
    /// Source: Ng & Trifonov 2003, Table 1, step 1: 'sort boxes along all three axes', by *box* centre.
    pub fn new(boxes: &[Aabb]) -> Result<Self, BuildError> {
        Self::watched(boxes, &Watch::default())
    }

    /// As [`new`](Self::new), unless the `watch` ends it: it is asked before every axis.
    pub fn watched(boxes: &[Aabb], watch: &Watch) -> Result<Self, BuildError> {
        Self::sort(boxes, true, false, watch)
    }

    /// As [`new`](Self::new). Without `skip_sorted`, objects that already came in order are sorted, too. With
    /// `x_without_area`, a scene without area is sorted along x alone and has that order along all axes: every candidate
    /// split of its nodes costs nothing, and of those a greedy build takes the halves along the lowest axis.
    pub(crate) fn sort(
        boxes: &[Aabb],
        skip_sorted: bool,
        x_without_area: bool,
        watch: &Watch,
    ) -> Result<Self, BuildError> {
        check_scene(boxes)?;
        let sorted = |axis: usize| {
            if boxes.len() >= OBJECTS_PER_POLL && watch.is_cancelled() {
                return (Vec::new(), false);
            }
            let mut keyed: Vec<(f64, u32)> = boxes
                .iter()
                .zip(0..)
                .map(|(b, index)| (b.doubled_centroid()[axis], index))
                .collect();
            // Most unsorted scenes are found to be so within a few objects.
            let in_order = keyed.is_sorted_by_key(|&(key, _)| key);
            if !(in_order && skip_sorted) {
                radsort::sort_by_key(&mut keyed, |&(key, _)| key);
            }
            (
                keyed
                    .into_iter()
                    .map(|(_, index)| index)
                    .collect::<Vec<u32>>(),
                in_order,
            )
        };
        let sorted = || {
            if x_without_area && Self::without_area(boxes) {
                let x = sorted(0);
                return [x.clone(), x.clone(), x];
            }
            in_parallel(boxes.len(), || sorted(0), || sorted(1), || sorted(2))
        };
        let [x, y, z] = sorted();
        watch.ensure_wanted()?;
        let orders = [x.0, y.0, z.0];
        let in_order = [x.1, y.1, z.1];
        Ok(Self { boxes: boxes.iter().map(PackedAabb::from).collect(), orders, in_order })
    }

    /// Whether the box around all objects has no area, so that every tree costs nothing; true without boxes. O(n).
    pub fn without_area(boxes: &[Aabb]) -> bool {
        boxes
            .iter()
            .fold(Aabb::EMPTY, |all, b| all.union(b))
            .half_area()
            == 0.0
    }

    /// Per axis, whether the objects came in order and needed no sorting, as along an axis on which all box centres
    /// coincide.
    pub fn in_order(&self) -> [bool; 3] {
        self.in_order
    }

    /// Per axis, the lowest axis that orders all objects identically, usually itself. O(n).
    pub fn same_orders(&self) -> [u8; 3] {
        let orders = self.orders.each_ref().map(Vec::as_slice);
        let mut same_as = [0, 1, 2];
        note_same_orders(orders, &mut same_as);
        same_as
    }

    /// Number of objects.
    pub fn len(&self) -> usize {
        self.boxes.len()
    }

    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.boxes.is_empty()
    }
}

/// The results for all three axes, on several threads if there are so many `objects` that they pay.
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

/// Finds axes that order a node's objects identically, given those of its parent. They do so in the whole subtree.
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
        let at = |x: f32| Aabb::from(([x, 0.0, 0.0], [x, 0.0, 0.0]));
        let sorted = Presorted::new(&[at(1.0), at(0.0), at(-0.0), at(-1.0), at(0.0)]).unwrap();
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
