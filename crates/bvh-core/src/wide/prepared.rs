//! Rays made ready for rays in flight: what the tests of boxes and triangles need of one, together
//! in memory.

use super::instructions::Instructions;
use super::lanes::{Lanes, Mask};
use super::layout::{WideBvh, WideNode};
use super::pairs::Pairs;
use super::ray_lanes::{BoxLanes, Loaded, RayLanes};
use super::triangles::{TriangleBlock, three_by_three};
use crate::Aabb;
use crate::each::Each;
use crate::exact::AXES;
use crate::slabs::{FAR, NEAR};

/// Rays side by side that are about to be written one after the other.
pub(crate) struct Ready<L> {
    rays: RayLanes<L>,
    /// The rays as boxes are tested with them.
    boxed: BoxLanes<L>,
    near_factor: [L; 3],
    far_factor: [L; 3],
    /// A bit per ray that begins [far](Ray::is_far_from) from the scene, and is not traced here.
    pub(crate) far: u32,
    reach: L,
}

/// One ray as boxes and triangles are tested with it: two cache lines, in rows of four lanes.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Prepared {
    near_factor: [f32; 3],
    /// The first two components of the direction in the shear's order of axes, as in [`Pairs`].
    x_direction: f32,
    /// The origin by axis, as boxes are tested with it.
    box_origin: [f32; 3],
    pub(crate) t_max: f32,
    far_factor: [f32; 3],
    y_direction: f32,
    /// As in [`Pairs`].
    origin: [f32; 3],
    x_slope: f32,
    y_slope: f32,
    reach: f32,
    depth: f32,
    t_min: f32,
    /// The bytes of a node before the planes that the ray meets first, by axis.
    pub(crate) near: [u32; 3],
    /// The axis of the largest component of the direction.
    pub(crate) largest_axis: u32,
    /// And before the planes opposite.
    pub(crate) far: [u32; 3],
    /// Among the rays of the batch.
    pub(crate) number: u32,
    padding: u32,
    /// As in [`Pairs`].
    errors: [f32; 3],
}

impl<L: Lanes> Ready<L> {
    #[inline(always)]
    pub(crate) fn new((rays, boxed): Loaded<L>, wide: &WideBvh) -> Self {
        let reach = rays.reach(&wide.bounds);
        let reach = reach * reach.filled(wide.error_factor);
        let far = boxed.beyond(wide.near_box());
        let [x, y, z] = boxed.inverse;
        let near = x.filled(NEAR);
        let exit = x.filled(FAR);
        let near_factor = [x * near, y * near, z * near];
        Self { rays, boxed, near_factor, far_factor: [x * exit, y * exit, z * exit], far, reach }
    }

    /// Returns a bit per ray that begins near the scene and may meet something within `bounds`.
    #[inline(always)]
    pub(crate) fn enter(&self, bounds: &Aabb) -> u32 {
        let mut entry = self.rays.t_min;
        let mut exit = self.rays.t_max;
        for axis in 0..3 {
            let low = entry.filled(bounds.min[axis]);
            let high = entry.filled(bounds.max[axis]);
            let is_backwards = self.backwards(axis);
            let near = L::select(is_backwards, high, low);
            let far = L::select(is_backwards, low, high);
            entry = entry.max((near - self.boxed.origin[axis]) * self.near_factor[axis]);
            exit = ((far - self.boxed.origin[axis]) * self.far_factor[axis]).min(exit);
        }
        entry.le(exit).bits() & !self.far
    }

    #[inline(always)]
    fn backwards(&self, axis: usize) -> L::Mask {
        let inverse = self.boxed.inverse[axis];
        inverse.lt(inverse.filled(0.0))
    }

    /// Writes every ray to the place of its lane; the first is number `first` of its batch.
    ///
    /// # Safety
    /// There are as many places as lanes.
    #[inline(always)]
    pub(crate) unsafe fn write(&self, first: u32, to: [*mut Prepared; 16]) {
        let (second, third) = self.rays.largest();
        let origin = in_order(self.rays.origin, second, third);
        let [dx, dy, depth] = in_order(self.rays.direction, second, third);
        let bits = |bits: u32| depth.filled_with_bits(bits);
        let [error, underflow, range_error] = Pairs::errors_of(self.reach, depth);
        let axis = L::select(third, bits(2), L::select(second, bits(1), bits(0)));
        let mut near = [bits(0); 3];
        let mut far = [bits(0); 3];
        for i in 0..3 {
            let lower = bits(32 * i as u32);
            let upper = bits(32 * (i as u32 + 3));
            near[i] = L::select(self.backwards(i), upper, lower);
            far[i] = L::select(self.backwards(i), lower, upper);
        }
        // SAFETY: there is room for a ray per lane.
        unsafe {
            write_row(&to, 0, self.near_factor, dx);
            write_row(&to, 1, self.boxed.origin, self.rays.t_max);
            write_row(&to, 2, self.far_factor, dy);
            write_row(&to, 3, origin, dx / depth);
            write_row(&to, 4, [dy / depth, self.reach, depth], self.rays.t_min);
            write_row(&to, 5, near, axis);
            write_row(&to, 6, far, bits(0));
            write_row(&to, 7, [bits(0), error, underflow], range_error);
            for (number, to) in (first..).zip(to).take(L::N) {
                (*to).number = number;
            }
        }
    }
}

impl Prepared {
    #[inline(always)]
    fn row(&self, row: usize) -> *const f32 {
        (&raw const *self).cast::<f32>().wrapping_add(4 * row)
    }

    /// Returns the [keys](super::instructions::Pending) of the boxes of a node that the ray enters
    /// by `t_max`, and a bit for each of them.
    #[inline(always)]
    pub(crate) unsafe fn boxes<K: Instructions>(
        &self,
        node: &WideNode,
        t_max: f32,
    ) -> (K::Boxes, u32) {
        // SAFETY: the ray names whole, aligned planes.
        unsafe {
            let distance = |axis: usize, plane: u32, factor: f32| {
                let planes = node.planes.as_ptr().cast::<u8>();
                let plane = K::Boxes::load(planes.add(plane as usize).cast());
                (plane - K::Boxes::splat(self.box_origin[axis])) * K::Boxes::splat(factor)
            };
            let near = |axis: usize| distance(axis, self.near[axis], self.near_factor[axis]);
            let far = |axis: usize| distance(axis, self.far[axis], self.far_factor[axis]);
            let begin = K::Boxes::splat(self.t_min);
            let entry = near(0).max(near(1)).max(near(2).max(begin));
            let exit = far(0).min(far(1)).min(far(2).min(K::Boxes::splat(t_max)));
            K::keys(entry, entry.le(exit))
        }
    }

    /// Returns the origin, the direction, the slope, the reach and the beginning, as [`Pairs`] has
    /// them.
    #[inline(always)]
    pub(crate) fn of_pairs(&self) -> [f32; 10] {
        let [x, y, z] = self.origin;
        let [dx, dy, dz] = [self.x_direction, self.y_direction, self.depth];
        [x, y, z, dx, dy, dz, self.x_slope, self.y_slope, self.reach, self.t_min]
    }

    #[inline(always)]
    pub(crate) fn axes(&self) -> &'static [usize; 3] {
        // SAFETY: it is an axis.
        unsafe { AXES.get_unchecked(self.largest_axis as usize) }
    }
}

/// A ray and the block of triangles that it is tested with, in a quarter of the lanes.
#[derive(Clone, Copy)]
pub(crate) struct Test<'a> {
    pub(crate) ray: &'a Prepared,
    pub(crate) block: &'a TriangleBlock,
}

impl Test<'_> {
    /// Returns the rays as triangles are tested with them.
    #[inline(always)]
    pub(crate) unsafe fn rays<L: Lanes>(four: [Self; 4]) -> Pairs<L> {
        // SAFETY: there are so many rows of four aligned lanes.
        unsafe {
            let row = |row: usize| L::load_quarters(four.each(|test| test.ray.row(row)));
            let origin = row(3);
            let last = row(4);
            let errors = row(7);
            Pairs {
                origin: [origin.spread::<0>(), origin.spread::<1>(), origin.spread::<2>()],
                direction: [row(0).spread::<3>(), row(2).spread::<3>(), last.spread::<2>()],
                slope: [origin.spread::<3>(), last.spread::<0>()],
                reach: last.spread::<1>(),
                errors: [errors.spread::<1>(), errors.spread::<2>(), errors.spread::<3>()],
                t_min: last.spread::<3>(),
            }
        }
    }

    /// Returns the corners of the blocks, along the axes of each ray's shear.
    #[inline(always)]
    pub(crate) unsafe fn corners<L: Lanes>(four: [Self; 4]) -> [[L; 3]; 3] {
        three_by_three(|corner, axis| {
            let lanes = |Self { ray, block }: Self| {
                let row = 3 * corner + ray.axes()[axis];
                block.corners.as_ptr().cast::<f32>().wrapping_add(row * TriangleBlock::LANES)
            };
            // SAFETY: there are three axes of four aligned lanes for every corner.
            unsafe { L::load_quarters(four.each(lanes)) }
        })
    }
}

/// Components in the order of each ray's shear: y z x, or z x y if y is the largest, or x y z if z
/// is.
#[inline(always)]
fn in_order<L: Lanes>([x, y, z]: [L; 3], second: L::Mask, third: L::Mask) -> [L; 3] {
    [
        L::select(third, x, L::select(second, z, y)),
        L::select(third, y, L::select(second, x, z)),
        L::select(third, z, L::select(second, y, x)),
    ]
}

/// Writes four lanes of each ray.
#[inline(always)]
unsafe fn write_row<L: Lanes>(to: &[*mut Prepared; 16], row: usize, [a, b, c]: [L; 3], d: L) {
    let to = |lane: usize| to[lane].cast::<f32>().wrapping_add(4 * row);
    for (i, row) in L::transpose_quarters([a, b, c, d]).into_iter().enumerate() {
        // SAFETY: there are so many rows of four aligned lanes; only the quarters of `L` are
        // written.
        unsafe { row.store_quarters([to(i), to(i + 4), to(i + 8), to(i + 12)]) };
    }
}
