//! The working form of the tree: children in blocks of four, so that one memory access and one
//! vector comparison serve four boxes.

use super::Object;
use crate::larger;
use bvh_core::cost::{Area, Measure};
use bvh_core::glam::Vec4;
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

    /// Returns one bit per inner child that contains `b`. Compilers do not vectorise a loop over the
    /// lanes.
    #[inline(always)]
    fn containing(&self, b: &[f32; 6]) -> u32 {
        let side = |i: usize| Vec4::splat(b[i]).cmple(Vec4::from_array(self.bounds[i]));
        let sides = |i: usize| side(i) & side(i + 1);
        // `LEAF` is the sign bit of a float.
        let leaves = Vec4::from_array(self.link.map(f32::from_bits)).is_negative_bitmask();
        (sides(0) & sides(2) & sides(4)).bitmask() & !leaves
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
