//! Four triangles side by side, for tests of one ray against all of them.

use crate::{MAX_OBJECTS, Shear, Triangle};
use glam::{Vec3, Vec4};

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

    /// A bit per triangle that the ray may meet. All others are missed for sure: the operations are those of
    /// [`Triangle::intersect`] in the same order, so that their signs are the same, bit by bit.
    #[inline(always)]
    pub(crate) fn candidates(&self, shear: &Shear) -> u32 {
        let [kx, ky, kz] = shear.axes;
        let sheared = |corner: &[Vec4; 3]| {
            let z = corner[kz] - shear.origin[2];
            [
                corner[kx] - shear.origin[0] - shear.slope[0] * z,
                corner[ky] - shear.origin[1] - shear.slope[1] * z,
            ]
        };
        let [a, b, c] = &self.corners;
        let ([ax, ay], [bx, by], [cx, cy]) = (sheared(a), sheared(b), sheared(c));
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        let zero = Vec4::ZERO;
        let negative = u.cmplt(zero) | v.cmplt(zero) | w.cmplt(zero);
        let positive = u.cmpgt(zero) | v.cmpgt(zero) | w.cmpgt(zero);
        !(negative & positive).bitmask() & 0b1111
    }

    /// The triangle in a lane below 4, and its id; `None` in an unused lane.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> Option<(u32, Triangle)> {
        let id = self.ids[lane];
        let corner = |corner: &[Vec4; 3]| Vec3::from(corner.each_ref().map(|axis| axis.as_ref()[lane]));
        (id != Self::UNUSED).then(|| (id & !Self::LAST, Triangle(self.corners.each_ref().map(corner))))
    }
}
