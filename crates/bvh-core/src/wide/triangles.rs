//! Triangles side by side, for tests of one ray against all of them.

use super::lanes::Lanes;
use crate::each::Each;
use crate::{MAX_OBJECTS, Triangle};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Up to four triangles of a leaf.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct TriangleBlock {
    /// `corners[corner][axis][lane]`.
    pub(crate) corners: [[[f32; 4]; 3]; 3],
    /// The objects' ids; [`UNUSED`](Self::UNUSED) in lanes without a triangle.
    ids: [u32; 4],
}

impl TriangleBlock {
    pub(crate) const LANES: usize = 4;
    /// The coordinates of a corner before those along each axis.
    pub(crate) const ROWS: [usize; 3] = [0, Self::LANES, 2 * Self::LANES];
    const UNUSED: u32 = u32::MAX;
    /// Added to the first id of a leaf's last block; ids themselves are below [`MAX_OBJECTS`].
    pub(crate) const LAST: u32 = MAX_OBJECTS as u32;

    /// The blocks of one leaf of at least one triangle, none degenerate.
    pub(crate) fn chain(ids: &[u32], triangles: &[Triangle]) -> impl Iterator<Item = Self> {
        let blocks = ids.len().div_ceil(Self::LANES);
        (1..).zip(ids.chunks(Self::LANES)).map(move |(number, ids)| {
            let mut block = Self { ids: [Self::UNUSED; Self::LANES], ..Self::zeroed() };
            block.ids[..ids.len()].copy_from_slice(ids);
            block.ids[0] |= if number == blocks { Self::LAST } else { 0 };
            block.move_to(triangles);
            block
        })
    }

    /// Writes the corners of the triangles that the ids name.
    pub(crate) fn move_to(&mut self, triangles: &[Triangle]) {
        let mut last = self.id(0);
        for lane in 0..Self::LANES {
            // Unused lanes repeat the last triangle: what they find, that one finds too, and its id
            // is less.
            last = if self.id(lane) == Self::UNUSED { last } else { self.id(lane) };
            for (lanes, corner) in self.corners.iter_mut().zip(triangles[last as usize].0) {
                (0..3).for_each(|axis| lanes[axis][lane] = corner[axis]);
            }
        }
    }

    pub(crate) fn triangles(&self) -> impl Iterator<Item = (u32, Triangle)> {
        (0..Self::LANES).filter_map(|lane| self.triangle(lane))
    }

    /// Returns the id in a lane; the greatest of all ids for an unused lane.
    #[inline(always)]
    pub(crate) fn id(&self, lane: usize) -> u32 {
        let id = self.ids[lane];
        if lane == 0 { id & !Self::LAST } else { id }
    }

    /// Returns a bit per lane that holds a triangle.
    ///
    /// # Safety
    /// The processor has the instructions, and `L` has four lanes.
    #[inline(always)]
    pub(crate) unsafe fn used<L: Lanes>(&self) -> u32 {
        const { assert!(L::N == Self::LANES && Self::UNUSED > i32::MAX as u32) };
        // SAFETY: ids are four aligned lanes. Those of triangles have no sign.
        0b1111 & !unsafe { L::load(self.ids.as_ptr().cast()) }.signs()
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        1 + (1..Self::LANES).map(|lane| usize::from(self.ids[lane] != Self::UNUSED)).sum::<usize>()
    }

    #[inline(always)]
    pub(crate) fn is_last(&self) -> bool {
        self.ids[0] & Self::LAST != 0
    }

    /// Returns the corners of all four triangles along the axes of these rows.
    ///
    /// # Safety
    /// The processor has the instructions; rows are of [`ROWS`](Self::ROWS), and `L` has four
    /// lanes.
    #[inline(always)]
    pub(crate) unsafe fn corners_along<L: Lanes>(&self, rows: [usize; 3]) -> [[L; 3]; 3] {
        const { assert!(L::N == Self::LANES) };
        // SAFETY: there are three axes of four aligned lanes for every corner.
        unsafe {
            let lanes = self.corners.as_ptr().cast::<f32>();
            let mut corners = [[L::splat(0.0); 3]; 3];
            for (corner, coordinates) in corners.iter_mut().enumerate() {
                for (coordinate, row) in coordinates.iter_mut().zip(rows) {
                    *coordinate = L::load(lanes.add(3 * corner * Self::LANES + row));
                }
            }
            corners
        }
    }

    /// Returns the corners of the triangle in a lane along these axes, each coordinate in all
    /// lanes.
    ///
    /// # Safety
    /// The processor has the instructions; axes are below 3, and `lane` is one.
    #[inline(always)]
    pub(crate) unsafe fn splat_corners<L: Lanes>(
        &self,
        lane: usize,
        axes: [usize; 3],
    ) -> [[L; 3]; 3] {
        // SAFETY: there are three axes of four lanes for every corner.
        unsafe {
            let lanes = self.corners.as_ptr().cast::<f32>().add(lane);
            let of = |corner: usize, axis: usize| {
                L::splat(*lanes.add((3 * corner + axes[axis]) * Self::LANES))
            };
            three_by_three(of)
        }
    }

    /// The triangle in a lane, and its id; `None` in an unused lane.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> Option<(u32, Triangle)> {
        let id = self.id(lane);
        let corner = |corner: &[[f32; Self::LANES]; 3]| {
            Vec3::from(corner.each_ref().each(|axis| axis[lane]))
        };
        (id != Self::UNUSED).then(|| (id, Triangle(self.corners.each_ref().each(corner))))
    }
}

/// Returns the value of every corner and axis.
#[inline(always)]
pub(crate) fn three_by_three<T>(of: impl Fn(usize, usize) -> T) -> [[T; 3]; 3] {
    [[of(0, 0), of(0, 1), of(0, 2)], [of(1, 0), of(1, 1), of(1, 2)], [of(2, 0), of(2, 1), of(2, 2)]]
}
