//! Four triangles side by side, for tests of one ray against all of them.

use crate::{MAX_OBJECTS, Shear, Triangle};
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};

/// Up to four triangles: `corners[corner][axis][lane]`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Triangle4 {
    corners: [[Vec4; 3]; 3],
    /// The objects' ids; [`UNUSED`](Self::UNUSED) in lanes without a triangle.
    ids: [u32; 4],
}

impl Triangle4 {
    pub(crate) const LANES: usize = 4;
    const UNUSED: u32 = u32::MAX;
    /// Added to the first id of a leaf's last block; ids themselves are below [`MAX_OBJECTS`].
    const LAST: u32 = MAX_OBJECTS as u32;

    /// The blocks of one leaf.
    pub(crate) fn chain(ids: &[u32], triangles: &[Triangle]) -> impl Iterator<Item = Self> {
        let blocks = ids.len().div_ceil(Self::LANES);
        (1..).zip(ids.chunks(Self::LANES)).map(move |(number, ids)| {
            // Unused lanes at infinity: behind the ray, or after all that it can hit.
            let mut block = Self { corners: [[Vec4::INFINITY; 3]; 3], ids: [Self::UNUSED; 4] };
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

    /// A bit per triangle that the ray may meet before `t_max`. [`Triangle::intersect`] would reject all others: by the
    /// sides of their edges, which are computed here as there, bit by bit, or because all three corners, with a margin
    /// for rounding, are behind the ray's origin or after `t_max`.
    #[inline(always)]
    pub(crate) fn candidates(&self, shear: &Shear, t_max: f32) -> u32 {
        let [kx, ky, kz] = shear.axes;
        let sheared = |corner: &[Vec4; 3]| {
            let z = corner[kz] - shear.origin[2];
            let (x, y) = (corner[kx] - shear.origin[0], corner[ky] - shear.origin[1]);
            [x - shear.slope[0] * z, y - shear.slope[1] * z, z * shear.forwards]
        };
        let [a, b, c] = &self.corners;
        let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (sheared(a), sheared(b), sheared(c));
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        let zero = Vec4::ZERO;
        let negative = u.cmplt(zero) | v.cmplt(zero) | w.cmplt(zero);
        let positive = u.cmpgt(zero) | v.cmpgt(zero) | w.cmpgt(zero);
        let behind = az.max(bz).max(cz).cmplt(zero);
        let after = az.min(bz).min(cz).cmpgt(Vec4::splat(t_max * shear.farther));
        !(negative & positive | behind | after).bitmask() & 0b1111
    }

    /// The triangle in a lane below 4, and its id; `None` in an unused lane.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> Option<(u32, Triangle)> {
        let id = self.ids[lane];
        let corner = |corner: &[Vec4; 3]| Vec3::from(corner.each_ref().map(|axis| axis.as_ref()[lane]));
        (id != Self::UNUSED).then(|| (id & !Self::LAST, Triangle(self.corners.each_ref().map(corner))))
    }
}
