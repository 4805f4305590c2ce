//! Whether the boxes of an object's leaves together cover it.
//!
//! The object's box is cut at the faces of its leaves' boxes until every cell lies in one of them. A cell that no face cuts
//! and that lies in no box is a gap: what the object has there is in no leaf.

use crate::{Aabb, Clip};
use alloc::vec::Vec;

/// Cells per leaf that are looked at before a covering counts as none: divisions by planes, as builders and searches make
/// them, need a few, and a forged file must not take for ever.
const CELLS_PER_LEAF: usize = 256;

/// Whether everything of `object`, which lies in `whole`, is in one of `leaves`, compared without tolerance.
pub(super) fn is_covered(objects: &dyn Clip, object: u32, whole: &Aabb, leaves: &[Aabb]) -> bool {
    let mut left = CELLS_PER_LEAF * leaves.len();
    let mut open: Vec<Aabb> = alloc::vec![*whole];
    while let Some(region) = open.pop() {
        let part = objects.clip_tightly(object, &region);
        if part == Aabb::EMPTY || leaves.iter().any(|leaf| leaf.contains(&part)) {
            continue;
        }
        let Some((axis, plane)) = face_through(&part, leaves) else { return false };
        if left == 0 {
            return false;
        }
        left -= 1;
        open.extend(part.halves(axis, plane));
    }
    true
}

/// A face of a leaf's box that cuts `part`: of the box that has the largest part of it.
fn face_through(part: &Aabb, leaves: &[Aabb]) -> Option<(usize, f32)> {
    let mut best = None;
    let mut largest = -1.0;
    for leaf in leaves {
        let common = part.intersection(leaf);
        if common == Aabb::EMPTY {
            continue;
        }
        let extent = common.extent();
        let size = extent.x + extent.y + extent.z;
        if size <= largest {
            continue;
        }
        let faces = (0..3).flat_map(|axis| [(axis, leaf.min[axis]), (axis, leaf.max[axis])]);
        let cuts = |&(axis, plane): &(usize, f32)| part.min[axis] < plane && plane < part.max[axis];
        if let Some(face) = faces.into_iter().find(cuts) {
            (best, largest) = (Some(face), size);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Triangle;
    use glam::Vec3;

    #[test]
    fn halves_of_halves_cover_a_triangle_until_one_of_them_is_smaller() {
        let triangles = [Triangle([Vec3::ZERO, Vec3::new(3.0, 2.0, 0.1), Vec3::new(2.9, 2.1, 0.3)])];
        let objects = triangles.as_slice();
        let whole = triangles[0].aabb();
        let mut leaves = alloc::vec![whole];
        // Every part is cut at its middle along every axis in turn.
        for axis in [0, 1, 2, 0] {
            let halves = |part: &Aabb| {
                let at = 0.5 * (part.min[axis] + part.max[axis]);
                part.halves(axis, at).map(|region| objects.clip(0, &region))
            };
            leaves = leaves.iter().flat_map(halves).filter(|part| *part != Aabb::EMPTY).collect();
        }
        assert!(leaves.len() > 6, "{}", leaves.len());
        assert!(is_covered(&objects, 0, &whole, &leaves));
        for at in 0..leaves.len() {
            let mut fewer = leaves.clone();
            fewer.remove(at);
            assert!(!is_covered(&objects, 0, &whole, &fewer), "without {at}");
            for axis in 0..3 {
                let mut smaller = leaves.clone();
                let extent = smaller[at].extent()[axis] as f32;
                smaller[at].min[axis] += 0.01 * extent;
                assert!(
                    extent == 0.0 || !is_covered(&objects, 0, &whole, &smaller),
                    "{at} smaller along {axis}"
                );
            }
        }
    }
}
