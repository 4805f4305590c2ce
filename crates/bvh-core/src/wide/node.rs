//! A node of the wide layout, and the references from node to node and to leaves.

use crate::Aabb;
use bytemuck::{Pod, Zeroable};

/// A node's eight children, or fewer in the lower lanes: four cache lines.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    /// Lower x, y, z, then upper x, y, z, of all children; ∞ and −∞ in unused lanes, so that no ray
    /// enters them.
    pub(crate) planes: [[f32; 8]; 6],
    pub(crate) children: [Child; 8],
    pub(crate) padding: [u32; 8],
}

impl WideNode {
    pub(crate) const LANES: usize = 8;
    pub(crate) const EMPTY: Self = {
        let (lower, upper) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        let planes = [lower, lower, lower, upper, upper, upper];
        Self { planes, children: [Child::node(0); 8], padding: [0; 8] }
    };

    /// Gives a lane a child with this box.
    pub(crate) fn set_box(&mut self, lane: usize, aabb: &Aabb) {
        for axis in 0..3 {
            self.planes[axis][lane] = aabb.min[axis];
            self.planes[axis + 3][lane] = aabb.max[axis];
        }
    }

    /// The box of a lane's child; `None` for an unused lane.
    pub(crate) fn lane_box(&self, lane: usize) -> Option<Aabb> {
        let corner = |from: usize| [from, from + 1, from + 2].map(|plane| self.planes[plane][lane]);
        (self.planes[0][lane] < f32::INFINITY).then(|| Aabb::from([corner(0), corner(3)]))
    }
}

/// A node's index, or the index of a leaf's first block; the leaf's last block is marked as such.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    /// The end of every ray.
    pub(crate) const END: Self = Self::leaf(u32::MAX);

    pub(crate) const fn node(index: u32) -> Self {
        Self(index)
    }

    /// The leaf that begins with this block.
    pub(crate) const fn leaf(first_block: u32) -> Self {
        Self(first_block | Self::LEAF)
    }

    #[inline(always)]
    pub(crate) fn is_node(self) -> bool {
        self.0 & Self::LEAF == 0
    }

    /// The index of the node, or of the leaf's first block.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }

    #[inline(always)]
    pub(crate) fn bits(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(crate) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }
}
