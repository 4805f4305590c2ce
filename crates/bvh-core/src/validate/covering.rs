//! The check that the boxes of an object's leaves together cover the object.
//!
//! The object's box is cut at the faces of its leaves' boxes until every cell is inside one of
//! these boxes. A cell that no face cuts and that is inside no box is a gap: the part of the object
//! in this cell is in no leaf.

use crate::{Aabb, Clip};

/// The number of comparisons with boxes per leaf after which a covering is rejected, so that a
/// forged file cannot keep the check busy. Leaves that builders and searches make by dividing an
/// object at planes need a few dozen each.
const COMPARISONS_PER_LEAF: usize = 1 << 10;

/// Returns whether every part of `object`, whose box is `full`, is in one of the boxes `leaves`,
/// compared without tolerance. Also returns false for a covering that needs more comparisons than
/// [`COMPARISONS_PER_LEAF`] allows.
///
/// O(leaves · log leaves) where leaves hardly overlap: a cut compares its part with the leaves that
/// meet the part around it.
pub(super) fn is_covered(objects: &dyn Clip, object: u32, full: &Aabb, leaves: &[Aabb]) -> bool {
    let mut comparisons_left = COMPARISONS_PER_LEAF * leaves.len();
    let mut open = vec![(*full, leaves.to_vec())];
    while let Some((region, mut leaves)) = open.pop() {
        // Clip tightly, because a slightly enlarged part might extend beyond the leaf that was made
        // for it.
        let part = objects.clip_tightly(object, &region);
        if part == Aabb::EMPTY || leaves.iter().any(|leaf| leaf.contains(&part)) {
            continue;
        }
        let Some(left) = comparisons_left.checked_sub(leaves.len()) else { return false };
        comparisons_left = left;
        leaves.retain(|leaf| leaf.intersection(&part) != Aabb::EMPTY);
        // A part that no face cuts is outside all leaves, or in the gap between them.
        let Some((axis, plane)) = face_through(&part, &leaves) else { return false };
        open.extend(part.halves(axis, plane).map(|half| (half, leaves.clone())));
    }
    true
}

/// Returns the axis and the coordinate of a face that cuts `part`; `None` if no face does. Of the
/// leaves that have such a face it takes the one with the largest intersection with `part`, so that
/// few cuts are needed.
fn face_through(part: &Aabb, leaves: &[Aabb]) -> Option<(usize, f32)> {
    let mut best = None;
    let mut largest = -1.0;
    for leaf in leaves {
        let common = part.intersection(leaf);
        // An intersection that is only a line has no area, but a sum of its sides.
        let extent = common.extent();
        let size = extent.x + extent.y + extent.z;
        if size <= largest {
            continue;
        }
        if let Some(face) = face_of_leaf(part, leaf) {
            best = Some(face);
            largest = size;
        }
    }
    best
}

/// Returns the axis and the coordinate of the first face of one leaf that cuts `part`.
fn face_of_leaf(part: &Aabb, leaf: &Aabb) -> Option<(usize, f32)> {
    for axis in 0..3 {
        for plane in [leaf.min[axis], leaf.max[axis]] {
            if part.min[axis] < plane && plane < part.max[axis] {
                return Some((axis, plane));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Triangle;
    use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};
    use glam::Vec3;

    /// Returns the parts of the only object of `objects` in the two halves of `part`.
    fn halves_of_part(objects: &dyn Clip, part: &Aabb, axis: usize) -> [Aabb; 2] {
        let middle = 0.5 * (part.min[axis] + part.max[axis]);
        part.halves(axis, middle).map(|region| objects.clip(0, &region))
    }

    #[derive(Debug)]
    struct Counted<'a>(&'a [Triangle], AtomicUsize);

    impl Clip for Counted<'_> {
        fn clip(&self, object: u32, region: &Aabb) -> Aabb {
            self.1.fetch_add(1, Relaxed);
            self.0.clip(object, region)
        }
    }

    #[test]
    fn an_object_in_many_equal_leaves_is_rejected_before_all_are_compared_with_all() {
        let triangles = [Triangle([Vec3::ZERO, Vec3::X, Vec3::ONE])];
        let full = triangles[0].aabb();
        let count = 1 << 12;
        // Slabs that cover the end, and equal boxes that touch it.
        let border = |i: i32| i as f32 / count as f32;
        let slab =
            |i: i32| Aabb { min: full.min.with_y(border(i)), max: full.max.with_y(border(i + 1)) };
        let box_before = Aabb { max: full.max.with_x(0.5), ..full };
        let leaves: Vec<Aabb> = (0..count).flat_map(|i| [slab(i), box_before]).collect();
        let objects = Counted(&triangles, AtomicUsize::new(0));
        assert!(!is_covered(&objects, 0, &full, &leaves));
        let most = 4 * COMPARISONS_PER_LEAF;
        assert!(objects.1.load(Relaxed) < most, "{:?}", objects.1);
    }

    #[test]
    fn halves_of_halves_cover_a_triangle_until_one_of_them_is_smaller() {
        let triangles =
            [Triangle([Vec3::ZERO, Vec3::new(3.0, 2.0, 0.1), Vec3::new(2.9, 2.1, 0.3)])];
        let objects = triangles.as_slice();
        let full = triangles[0].aabb();
        let mut leaves = vec![full];
        // Every part is cut at its middle along one axis after the other.
        for axis in [0, 1, 2, 0] {
            leaves = leaves.iter().flat_map(|part| halves_of_part(&objects, part, axis)).collect();
            leaves.retain(|part| *part != Aabb::EMPTY);
        }
        assert!(leaves.len() > 6, "{}", leaves.len());
        assert!(is_covered(&objects, 0, &full, &leaves));
        for leaf in 0..leaves.len() {
            let mut fewer = leaves.clone();
            fewer.remove(leaf);
            assert!(!is_covered(&objects, 0, &full, &fewer), "without {leaf}");
            for axis in 0..3 {
                let mut smaller = leaves.clone();
                let extent = smaller[leaf].extent()[axis] as f32;
                // A flat part cannot become smaller.
                if extent == 0.0 {
                    continue;
                }
                smaller[leaf].min[axis] += 0.01 * extent;
                assert!(!is_covered(&objects, 0, &full, &smaller), "{leaf} smaller along {axis}");
            }
        }
    }
}
