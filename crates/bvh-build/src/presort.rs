//! The objects of a scene, checked, packed and sorted once along every axis.

use crate::BuildError;
use bvh_core::{Aabb, MAX_OBJECTS, PackedAabb, check_boxes};

/// The input of every top-down build of one scene: sort once, build as often as you like.
#[derive(Clone, Debug)]
pub struct Presorted {
    /// One box per object.
    pub(crate) boxes: Vec<PackedAabb>,
    /// Per axis, the objects by increasing box centre, equal centres by index.
    pub(crate) orders: [Vec<u32>; 3],
    /// Per axis, whether the objects came in order.
    in_order: [bool; 3],
}

impl Presorted {
    /// Checks and sorts. O(n): a radix sort of f64 centres, which are exact where an f32 centre would round.
    ///
    /// Source: Ng & Trifonov 2003, Table 1, step 1: 'sort boxes along all three axes', by *box* centre.
    pub fn new(boxes: &[Aabb]) -> Result<Self, BuildError> {
        Self::sort(boxes, true, false)
    }

    /// As [`new`](Self::new), unless `skip_sorted`, sorting also what is in order. With `x_without_area` a scene
    /// without area is sorted along x alone, and the other axes have that order: every candidate split of its nodes
    /// costs nothing, so that the halves along x are as good as any and, x being the lowest axis, what a greedy build
    /// takes.
    pub(crate) fn sort(boxes: &[Aabb], skip_sorted: bool, x_without_area: bool) -> Result<Self, BuildError> {
        check_scene(boxes)?;
        let sorted = |axis: usize| {
            let mut keyed: Vec<(f64, u32)> =
                boxes.iter().zip(0..).map(|(b, index)| (b.doubled_centroid()[axis], index)).collect();
            // Seldom true, and then seldom found out late.
            let in_order = keyed.is_sorted_by_key(|&(key, _)| key);
            if !(in_order && skip_sorted) {
                radsort::sort_by_key(&mut keyed, |&(key, _)| key);
            }
            (keyed.into_iter().map(|(_, index)| index).collect::<Vec<u32>>(), in_order)
        };
        let sorted = || {
            if x_without_area && Self::without_area(boxes) {
                let x = sorted(0);
                return [x.clone(), x.clone(), x];
            }
            #[cfg(feature = "rayon")]
            if boxes.len() >= crate::division::PARALLEL_OBJECTS {
                let (x, (y, z)) = rayon::join(|| sorted(0), || rayon::join(|| sorted(1), || sorted(2)));
                return [x, y, z];
            }
            [sorted(0), sorted(1), sorted(2)]
        };
        let [x, y, z] = sorted();
        let (orders, in_order) = ([x.0, y.0, z.0], [x.1, y.1, z.1]);
        Ok(Self { boxes: boxes.iter().map(PackedAabb::from).collect(), orders, in_order })
    }

    /// Whether the box around all has no area, so that no tree costs anything; also if there are no boxes. O(n).
    pub fn without_area(boxes: &[Aabb]) -> bool {
        boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b)).half_area() == 0.0
    }

    /// Per axis, whether the objects came in order, so that they needed no sorting. So they do along an axis on which
    /// all box centres coincide.
    pub fn in_order(&self) -> [bool; 3] {
        self.in_order
    }

    /// Per axis, the lowest axis that orders all objects identically, usually itself. O(n).
    pub fn same_orders(&self) -> [u8; 3] {
        let orders = self.orders.each_ref().map(Vec::as_slice);
        let mut same_as = [0, 1, 2];
        crate::division::note_same_orders(orders, &mut same_as);
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

/// Refuses what no builder can take: too many objects, or a box that is not finite or is inverted.
pub(crate) fn check_scene(boxes: &[Aabb]) -> Result<(), BuildError> {
    if boxes.len() > MAX_OBJECTS {
        return Err(BuildError::TooManyObjects { objects: boxes.len() });
    }
    Ok(check_boxes(boxes)?)
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
