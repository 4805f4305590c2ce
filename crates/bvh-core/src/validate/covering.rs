//! The check that the boxes of an object's leaves together cover the object.
//!
//! The object's box is cut at the faces of its leaves' boxes until every cell is inside one of
//! these boxes. A cell that no face cuts and that is inside no box is a gap: the part of the object
//! in this cell is in no leaf.

use crate::{Aabb, Clip};

/// The number of cuts per leaf after which a covering is rejected, so that a forged file cannot
/// keep the check busy forever. Leaves that builders and searches make by dividing an object at
/// planes need a few cuts each.
const CUTS_PER_LEAF: usize = 256;

/// Returns whether every part of `object`, whose box is `full`, is in one of the boxes `leaves`,
/// compared without tolerance. Also returns false for a covering that needs more cuts than
/// [`CUTS_PER_LEAF`] allows.
///
/// O(leaves²): every cut compares its part with every leaf.
pub(super) fn is_covered(objects: &dyn Clip, object: u32, full: &Aabb, leaves: &[Aabb]) -> bool {
    let mut cuts_left = CUTS_PER_LEAF * leaves.len();
    let mut open: Vec<Aabb> = vec![*full];
    while let Some(region) = open.pop() {
        // Clip tightly, because a slightly enlarged part might extend beyond the leaf that was made
        // for it.
        let part = objects.clip_tightly(object, &region);
        if part == Aabb::EMPTY || leaves.iter().any(|leaf| leaf.contains(&part)) {
            continue;
        }
        // A part that no face cuts is outside all leaves, or in the gap between them.
        let Some((axis, plane)) = face_through(&part, leaves) else { return false };
        if cuts_left == 0 {
            return false;
        }
        cuts_left -= 1;
        open.extend(part.halves(axis, plane));
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
        if common == Aabb::EMPTY {
            continue;
        }
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
    use glam::Vec3;

    /// Returns the parts of the only object of `objects` in the two halves of `part`.
    fn halves_of_part(objects: &dyn Clip, part: &Aabb, axis: usize) -> [Aabb; 2] {
        let middle = 0.5 * (part.min[axis] + part.max[axis]);
        part.halves(axis, middle).map(|region| objects.clip(0, &region))
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
