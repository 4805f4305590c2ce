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
}

impl Presorted {
    /// Checks and sorts. O(n): a radix sort of f64 centres, which are exact where an f32 centre would round.
    ///
    /// Source: Ng & Trifonov 2003, Table 1, step 1: 'sort boxes along all three axes', by *box* centre.
    pub fn new(boxes: &[Aabb]) -> Result<Self, BuildError> {
        check_scene(boxes)?;
        let sorted = |axis: usize| {
            let mut keyed: Vec<(f64, u32)> =
                boxes.iter().zip(0..).map(|(b, index)| (b.doubled_centroid()[axis], index)).collect();
            radsort::sort_by_key(&mut keyed, |&(key, _)| key);
            keyed.into_iter().map(|(_, index)| index).collect()
        };
        #[cfg(feature = "rayon")]
        let orders = if boxes.len() >= crate::division::PARALLEL_OBJECTS {
            let (x, (y, z)) = rayon::join(|| sorted(0), || rayon::join(|| sorted(1), || sorted(2)));
            [x, y, z]
        } else {
            [sorted(0), sorted(1), sorted(2)]
        };
        #[cfg(not(feature = "rayon"))]
        let orders = [sorted(0), sorted(1), sorted(2)];
        Ok(Self { boxes: boxes.iter().map(PackedAabb::from).collect(), orders })
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
