//! The check that the boxes of an object's leaves together cover the object.
//!
//! The object's box is cut at faces of its leaves' boxes until every part is inside one of these
//! boxes. A part that no face cuts and that is inside no box is a gap: it is in no leaf.

use super::InvalidBvh;
use crate::{Aabb, Clip};

/// The number of comparisons with a leaf per leaf and bit of the number of leaves after which a
/// check ends, so that a forged file cannot keep it busy. Builders that divide an object at planes
/// need less than 2, because a cut at a median separates most of their leaves.
const COMPARISONS: usize = 32;

/// Checks that every part of `object`, whose box is `full`, is in one of the boxes `leaves`,
/// compared without tolerance.
///
/// O(k log² k) for k leaves: every part is compared with the leaves that overlap it, at most
/// [`COMPARISONS`] times for each leaf and bit of k, and these are sorted for the next cut.
pub(super) fn check(
    objects: &dyn Clip,
    object: u32,
    full: &Aabb,
    leaves: &[Aabb],
) -> Result<(), InvalidBvh> {
    let mut left = COMPARISONS * leaves.len() * (leaves.len().ilog2() as usize + 1);
    let object_index = object as usize;
    // The leaves that overlap each open region follow each other on a stack of their own.
    let mut near: Vec<u32> = (0..leaves.len() as u32).collect();
    let mut open = vec![(*full, 0)];
    let mut cuts = Cuts::default();
    while let Some((region, start)) = open.pop() {
        let count = near.len() - start;
        left = left
            .checked_sub(count)
            .ok_or(InvalidBvh::Entangled { object: object_index, leaves: leaves.len() })?;
        // Clip tightly, because a slightly enlarged part might extend beyond the leaf that was made
        // for it.
        let part = objects.clip_tightly(object, &region);
        let boxes = near[start..].iter().map(|&leaf| &leaves[leaf as usize]);
        if part == Aabb::EMPTY || boxes.clone().any(|leaf| leaf.contains(&part)) {
            near.truncate(start);
            continue;
        }
        // A part that no face cuts is outside all leaves, or in the gap between them.
        let Some((axis, plane)) = cuts.best(&part, boxes) else {
            return Err(InvalidBvh::Uncovered { object: object_index });
        };
        let [low, high] = part.halves(axis, plane);
        let above = near.len();
        for index in start..above {
            if overlaps(&leaves[near[index] as usize], &high) {
                near.push(near[index]);
            }
        }
        // The lower half takes the place of the part, below the upper half.
        let mut kept = start;
        for index in start..above {
            if overlaps(&leaves[near[index] as usize], &low) {
                near[kept] = near[index];
                kept += 1;
            }
        }
        near.drain(kept..above);
        open.extend([(low, start), (high, kept)]);
    }
    Ok(())
}

/// Returns whether a leaf and a part have more than a face in common, wherever the part has an
/// extent. Other leaves neither contain the part nor cut it.
fn overlaps(leaf: &Aabb, part: &Aabb) -> bool {
    (0..3).all(|axis| {
        let from = leaf.min[axis].max(part.min[axis]);
        let to = leaf.max[axis].min(part.max[axis]);
        from < to || from == to && part.min[axis] == part.max[axis]
    })
}

/// The faces of the leaves near a part, along one axis.
#[derive(Default)]
struct Cuts {
    low: Vec<f32>,
    high: Vec<f32>,
    inside: Vec<f32>,
}

impl Cuts {
    /// Returns the axis and the coordinate of the face that leaves the fewest of these leaves in the
    /// half with more of them; `None` if no face cuts the part.
    fn best<'a>(
        &mut self,
        part: &Aabb,
        leaves: impl Iterator<Item = &'a Aabb> + Clone,
    ) -> Option<(usize, f32)> {
        let mut best: Option<(usize, usize, f32)> = None;
        for axis in 0..3 {
            let cuts = |plane: &f32| part.min[axis] < *plane && *plane < part.max[axis];
            self.low.clear();
            self.low.extend(leaves.clone().map(|leaf| leaf.min[axis]));
            self.high.clear();
            self.high.extend(leaves.clone().map(|leaf| leaf.max[axis]));
            self.inside.clear();
            self.inside.extend(self.low.iter().chain(&self.high).copied().filter(cuts));
            for faces in [&mut self.low, &mut self.high, &mut self.inside] {
                faces.sort_unstable_by(f32::total_cmp);
            }
            let below = |plane: f32| self.low.partition_point(|&low| low < plane);
            let above =
                |plane: f32| self.high.len() - self.high.partition_point(|&high| high <= plane);
            // From face to face, more leaves reach below and fewer reach above.
            let median = self.inside.partition_point(|&plane| below(plane) < above(plane));
            for &plane in &self.inside[median.saturating_sub(1)..self.inside.len().min(median + 1)]
            {
                let larger = below(plane).max(above(plane));
                if best.is_none_or(|(least, ..)| larger < least) {
                    best = Some((larger, axis, plane));
                }
            }
        }
        best.map(|(_, axis, plane)| (axis, plane))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Triangle;
    use glam::Vec3;

    #[test]
    fn halves_of_halves_cover_a_triangle_until_one_of_them_is_smaller() {
        let triangles =
            [Triangle([Vec3::ZERO, Vec3::new(3.0, 2.0, 0.1), Vec3::new(2.9, 2.1, 0.3)])];
        let objects = triangles.as_slice();
        let full = triangles[0].aabb();
        let mut leaves = vec![full];
        // Every part is cut at its middle along one axis after the other.
        for axis in [0, 1, 2, 0] {
            let middle = |part: &Aabb| 0.5 * (part.min[axis] + part.max[axis]);
            let halves = leaves.iter().flat_map(|part| part.halves(axis, middle(part)));
            leaves = halves.map(|region| objects.clip(0, &region)).collect();
            leaves.retain(|part| *part != Aabb::EMPTY);
        }
        assert!(leaves.len() > 6, "{}", leaves.len());
        assert!(check(&objects, 0, &full, &leaves).is_ok());
        for leaf in 0..leaves.len() {
            let mut fewer = leaves.clone();
            fewer.remove(leaf);
            assert!(check(&objects, 0, &full, &fewer).is_err(), "without {leaf}");
            for axis in 0..3 {
                let mut smaller = leaves.clone();
                let extent = smaller[leaf].extent()[axis] as f32;
                // A flat part cannot become smaller.
                if extent == 0.0 {
                    continue;
                }
                smaller[leaf].min[axis] += 0.01 * extent;
                assert!(check(&objects, 0, &full, &smaller).is_err(), "{leaf}, {axis}");
            }
        }
    }

    /// Returns a triangle across the three axes, and `count` slabs on each axis that together cover it
    /// though no two axes do.
    fn slabs(count: u32) -> ([Triangle; 1], Vec<Aabb>) {
        let size = 3.0 * count as f32;
        let whole = Aabb::from([[0.0; 3], [size; 3]]);
        let slab = |axis: usize, number: u32| {
            let mut slab = whole;
            slab.min[axis] = 3.0 * number as f32 + 0.75;
            slab.max[axis] = size.min(3.0 * number as f32 + 3.25);
            slab
        };
        let slabs = (0..3).flat_map(|axis| (0..count).map(move |number| slab(axis, number)));
        ([Triangle([Vec3::X, Vec3::Y, Vec3::Z].map(|corner| corner * size))], slabs.collect())
    }

    #[test]
    fn overlapping_leaves_are_checked_until_they_take_too_many_comparisons() {
        let verdict = |triangles: &[Triangle], leaves: &[Aabb]| {
            check(&triangles, 0, &triangles[0].aabb(), leaves)
        };
        let (triangles, leaves) = slabs(10);
        assert_eq!(verdict(&triangles, &leaves), Ok(()));
        for missing in [1, 15, 28] {
            let mut leaves = leaves.clone();
            leaves.remove(missing);
            assert_eq!(verdict(&triangles, &leaves), Err(InvalidBvh::Uncovered { object: 0 }));
        }
        // The covering has 36 million cells.
        let (triangles, leaves) = slabs(6000);
        let expected = Err(InvalidBvh::Entangled { object: 0, leaves: 18_000 });
        assert_eq!(verdict(&triangles, &leaves), expected);
    }
}
