//! Four triangles side by side, for tests of one ray against all of them.

use crate::{MAX_OBJECTS, Shear, Triangle};
use glam::Vec4;

/// Up to four triangles: `corners[corner][axis][lane]`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Block {
    corners: [[Vec4; 3]; 3],
    /// The objects' ids; [`UNUSED`](Self::UNUSED) in lanes without a triangle.
    ids: [u32; 4],
}

impl Block {
    pub(crate) const LANES: usize = 4;
    const UNUSED: u32 = u32::MAX;
    /// Added to the first id of a leaf's last block; ids themselves are below [`MAX_OBJECTS`].
    const LAST: u32 = MAX_OBJECTS as u32;

    /// The blocks of one leaf.
    pub(crate) fn chain(ids: &[u32], triangles: &[Triangle]) -> impl Iterator<Item = Self> {
        let blocks = ids.len().div_ceil(Self::LANES);
        (1..).zip(ids.chunks(Self::LANES)).map(move |(number, ids)| {
            let mut block = Self { corners: [[Vec4::ZERO; 3]; 3], ids: [Self::UNUSED; 4] };
            for (lane, &id) in ids.iter().enumerate() {
                block.ids[lane] = id;
                for (lanes, corner) in block.corners.iter_mut().zip(&triangles[id as usize].0) {
                    for (axis, coordinate) in lanes.iter_mut().zip(corner.to_array()) {
                        axis.as_mut()[lane] = coordinate;
                    }
                }
            }
            block.ids[0] |= if number == blocks { Self::LAST } else { 0 };
            block
        })
    }

    /// Whether this is a leaf's last block.
    #[inline(always)]
    pub(crate) fn is_last(&self) -> bool {
        self.ids[0] & Self::LAST != 0
    }

    /// Calls `found` with every triangle the ray may meet, and its id. All others are missed for sure: the operations
    /// are those of [`Triangle::intersect`] in the same order, so that their signs are the same, bit by bit.
    #[inline(always)]
    pub(crate) fn candidates(&self, shear: &Shear, mut found: impl FnMut(u32, Triangle)) {
        let [a, b, c] = self.corners.each_ref().map(|corner| {
            let [x, y, z] = core::array::from_fn(|i| corner[shear.axes[i]] - shear.origin[i]);
            [x - shear.slope[0] * z, y - shear.slope[1] * z]
        });
        let edge = |p: [Vec4; 2], q: [Vec4; 2]| p[0] * q[1] - p[1] * q[0];
        let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        let negative = u.cmplt(Vec4::ZERO) | v.cmplt(Vec4::ZERO) | w.cmplt(Vec4::ZERO);
        let positive = u.cmpgt(Vec4::ZERO) | v.cmpgt(Vec4::ZERO) | w.cmpgt(Vec4::ZERO);
        let mut lanes = !(negative & positive).bitmask() & 0b1111;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            if self.ids[lane] != Self::UNUSED {
                found(
                    self.ids[lane] & !Self::LAST,
                    Triangle(self.corners.map(|corner| corner.map(|axis| axis.to_array()[lane]).into())),
                );
            }
        }
    }
}
