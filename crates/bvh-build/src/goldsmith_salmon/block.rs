//! The working form of the tree: children in blocks of four, so that one memory access and one
//! vector comparison serve four boxes.

use super::Object;
use bvh_core::cost::{Area, Measure};
use bvh_core::{Aabb, PackedAabb};

/// The size of a box given as −min.xyz, max.xyz: its half area, or a measure.
pub(super) trait Size: Copy {
    fn of(self, bounds: [f32; 6]) -> f64;
}

impl Size for Area {
    /// Uses the operations of [`PackedAabb::half_area`], hence the same bits.
    #[inline(always)]
    fn of(self, bounds: [f32; 6]) -> f64 {
        let [low_x, low_y, low_z, x, y, z] = bounds.map(f64::from);
        let [x, y, z] = [low_x + x, low_y + y, low_z + z];
        x * y + y * z + z * x
    }
}

impl Size for &dyn Measure {
    fn of(self, [x, y, z, far_x, far_y, far_z]: [f32; 6]) -> f64 {
        Measure::of(self, &PackedAabb::from(&Aabb::from(([-x, -y, -z], [far_x, far_y, far_z]))))
    }
}

/// Children per block.
pub(super) const LANES: usize = 4;
/// Marks a leaf in a link.
pub(super) const LEAF: u32 = 1 << 31;
/// The missing parent of the root.
pub(super) const NONE: u32 = u32::MAX;

/// Four children of one node. A node with more children has several consecutive blocks. Their
/// number is a power of two: full blocks move to twice the space. A node has no separate record but
/// a lane in its parent's block; its id is `block · LANES + lane`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// −min.xyz, max.xyz of each child.
    pub(super) bounds: [[f32; LANES]; 6],
    /// An inner child's first block; a leaf's object, marked [`LEAF`].
    pub(super) link: [u32; LANES],
    /// An inner child's number of children; 2 for a leaf, the children of the pair that it may
    /// become.
    pub(super) count: [u32; LANES],
    /// An inner child's size. For a leaf, the size from which its growth counts: 0, or the leaf's
    /// size if children are chosen by area.
    pub(super) area: [f64; LANES],
}

impl Block {
    /// A block of unused lanes. They act as leaves that contain nothing and whose growth is
    /// infinite, so no scan needs a test for them.
    pub(super) const EMPTY: Self = Self {
        bounds: [[f32::INFINITY; LANES]; 6],
        link: [LEAF; LANES],
        count: [2; LANES],
        area: [0.0; LANES],
    };

    #[inline(always)]
    pub(super) fn first_containing(&self, b: &[f32; 6]) -> Option<usize> {
        let lanes = self.containing(b);
        (lanes != 0).then(|| lanes.trailing_zeros() as usize % LANES)
    }

    /// Returns one bit per inner child that contains `b`. Compilers do not vectorise the plain
    /// version below.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn containing(&self, b: &[f32; 6]) -> u32 {
        use std::arch::x86_64::*;
        // SAFETY: these intrinsics need SSE2, which every x86-64 processor has, and use no pointer.
        unsafe {
            let lanes = |x: [f32; LANES]| _mm_setr_ps(x[0], x[1], x[2], x[3]);
            let side = |i: usize| _mm_cmple_ps(_mm_set1_ps(b[i]), lanes(self.bounds[i]));
            let sides = |i: usize| _mm_and_ps(side(i), side(i + 1));
            let contains = _mm_and_ps(_mm_and_ps(sides(0), sides(2)), sides(4));
            // `LEAF` is the sign bit of a float, and the mask collects sign bits.
            let [a, b, c, d] = self.link;
            let leaves = _mm_castsi128_ps(_mm_setr_epi32(a as i32, b as i32, c as i32, d as i32));
            _mm_movemask_ps(_mm_andnot_ps(leaves, contains)) as u32
        }
    }

    #[cfg(not(target_arch = "x86_64"))]
    #[inline(always)]
    fn containing(&self, b: &[f32; 6]) -> u32 {
        self.containing_plain(b)
    }

    #[cfg(any(test, not(target_arch = "x86_64")))]
    #[inline(always)]
    fn containing_plain(&self, b: &[f32; 6]) -> u32 {
        let contains =
            |lane: usize| !self.is_leaf(lane) && (0..6).all(|i| b[i] <= self.bounds[i][lane]);
        (0..LANES).map(|lane| u32::from(contains(lane)) << lane).sum()
    }

    #[inline(always)]
    pub(super) fn union_size(&self, lane: usize, b: &[f32; 6], size: impl Size) -> f64 {
        size.of(std::array::from_fn(|i| larger(self.bounds[i][lane], b[i])))
    }

    #[inline(always)]
    pub(super) fn family(&self, lane: usize) -> (usize, usize) {
        (self.link[lane] as usize, self.count[lane] as usize)
    }

    #[inline(always)]
    pub(super) fn is_leaf(&self, lane: usize) -> bool {
        self.link[lane] & LEAF != 0
    }

    #[inline(always)]
    pub(super) fn grow(&mut self, lane: usize, b: &[f32; 6], area: f64) {
        for (bounds, &b) in self.bounds.iter_mut().zip(b) {
            bounds[lane] = larger(bounds[lane], b);
        }
        self.area[lane] = area;
    }

    #[inline(always)]
    pub(super) fn put_leaf(&mut self, lane: usize, object: &Object, id: u32, area: f64) {
        for (bounds, b) in self.bounds.iter_mut().zip(object.bounds) {
            bounds[lane] = b;
        }
        self.link[lane] = id | LEAF;
        self.count[lane] = 2;
        self.area[lane] = area;
    }

    #[inline(always)]
    pub(super) fn copy(&mut self, lane: usize, from: &Block, from_lane: usize) {
        for (to, from) in self.bounds.iter_mut().zip(&from.bounds) {
            to[lane] = from[from_lane];
        }
        self.link[lane] = from.link[from_lane];
        self.count[lane] = from.count[from_lane];
        self.area[lane] = from.area[from_lane];
    }
}

/// Returns the larger of two numbers that are not NaN. Unlike `f32::max`, it is one instruction.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn place(node: u32) -> (usize, usize) {
    (node as usize / LANES, node as usize % LANES)
}

/// Returns the first block of an inner node's children, and their number.
#[inline(always)]
pub(super) fn family(blocks: &[Block], node: u32) -> (usize, usize) {
    let (block, lane) = place(node);
    if node == NONE { (0, 1) } else { blocks[block].family(lane) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_vector_comparison_finds_what_the_plain_one_finds(
            bounds in prop::array::uniform6(prop::array::uniform4(-6i8..2)),
            leaf in prop::array::uniform4(any::<bool>()),
            b in prop::array::uniform6(-2i8..2),
        ) {
            // Zeros of both signs occur.
            let mut block = Block { bounds: bounds.map(|side| side.map(|c| f32::from(c) * -0.5)), ..Block::EMPTY };
            block.link = leaf.map(|leaf| if leaf { LEAF } else { 7 });
            let b = b.map(|c| f32::from(c) * 0.5);
            prop_assert_eq!(block.containing(&b), block.containing_plain(&b));
        }
    }
}
