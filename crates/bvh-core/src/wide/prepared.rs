//! Rays made ready for rays in flight: what the tests of boxes and triangles need of one, together
//! in memory.

use super::box_ray::MARGIN;
use super::instructions::Instructions;
use super::lanes::{Lanes, Mask};
use super::node::WideNode;
use super::pairs::{Pairs, SINGLE_ERROR};
use super::ray_lanes::RayLanes;
use crate::Aabb;

/// Rays side by side that are about to be written one after the other.
pub(crate) struct Ready<L> {
    rays: RayLanes<L>,
    scale: [L; 3],
    near_shift: [L; 3],
    far_shift: [L; 3],
    /// One bit per ray: unset for a ray that the portable kernel must trace.
    pub(crate) in_range: u32,
    reach: L,
}

/// One ray as boxes and triangles are tested with it: two cache lines, in rows of four lanes.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Prepared {
    /// The distance to a plane is `plane · scale + shift`.
    pub(crate) scale: [f32; 3],
    pub(crate) t_min: f32,
    pub(crate) near_shift: [f32; 3],
    pub(crate) t_max: f32,
    pub(crate) far_shift: [f32; 3],
    /// As in [`Pairs`], and in the shear's order of axes, up to `x_slope`.
    depth: f32,
    origin: [f32; 3],
    y_slope: f32,
    direction: [f32; 2],
    reach: f32,
    x_slope: f32,
    /// The bytes of a node before the planes that the ray meets first, by axis.
    pub(crate) near: [u32; 3],
    /// The axis of the largest component of the direction.
    pub(crate) largest_axis: u32,
    /// And before the planes opposite.
    pub(crate) far: [u32; 3],
    /// Among the rays of the batch.
    pub(crate) number: u32,
    padding: [u32; 4],
}

impl<L: Lanes> Ready<L> {
    /// Rays for boxes whose coordinates are at most `largest`.
    #[inline(always)]
    pub(crate) fn new(rays: RayLanes<L>, largest: f32) -> Self {
        let (in_range, size, scale) = rays.bounded(largest);
        // SAFETY: values exist.
        unsafe {
            let zero = L::splat(0.0);
            let sign = L::splat(-0.0);
            let margin = size * L::splat(MARGIN);
            let mut near_shift = [zero; 3];
            let mut far_shift = [zero; 3];
            for axis in 0..3 {
                let margin = margin | rays.inverse[axis] & sign;
                near_shift[axis] = zero - (rays.origin[axis] + margin) * scale[axis];
                far_shift[axis] = zero - (rays.origin[axis] - margin) * scale[axis];
            }
            Self { rays, scale, near_shift, far_shift, in_range: in_range.bits(), reach: size }
        }
    }

    /// Returns a bit per ray that may meet something within `bounds`.
    #[inline(always)]
    pub(crate) fn enter(&self, bounds: &Aabb) -> u32 {
        let mut entry = self.rays.t_min;
        let mut exit = self.rays.t_max;
        for axis in 0..3 {
            // SAFETY: values exist.
            let (low, high) = unsafe { (L::splat(bounds.min[axis]), L::splat(bounds.max[axis])) };
            let is_backwards = self.backwards(axis);
            let near = L::select(is_backwards, high, low);
            let far = L::select(is_backwards, low, high);
            entry = entry.max(near.mul_add(self.scale[axis], self.near_shift[axis]));
            exit = exit.min(far.mul_add(self.scale[axis], self.far_shift[axis]));
        }
        entry.le(exit).bits()
    }

    /// Returns the rays that run backwards along an axis.
    #[inline(always)]
    fn backwards(&self, axis: usize) -> L::Mask {
        // SAFETY: a value exists.
        self.rays.inverse[axis].lt(unsafe { L::splat(0.0) })
    }

    /// Writes the rays one after the other; the first is number `first` of its batch.
    ///
    /// # Safety
    /// There is room for as many as there are lanes.
    #[inline(always)]
    pub(crate) unsafe fn write(&self, first: u32, to: *mut Prepared) {
        let (second, third) = self.rays.largest();
        let origin = in_order(self.rays.origin, second, third);
        let [dx, dy, depth] = in_order(self.rays.direction, second, third);
        // SAFETY: values exist; the rest is the caller's promise.
        unsafe {
            let bits = |bits: u32| L::splat_bits(bits);
            let axis = L::select(third, bits(2), L::select(second, bits(1), bits(0)));
            let mut near = [bits(0); 3];
            let mut far = [bits(0); 3];
            for i in 0..3 {
                let lower = bits(32 * i as u32);
                let upper = bits(32 * (i as u32 + 3));
                near[i] = L::select(self.backwards(i), upper, lower);
                far[i] = L::select(self.backwards(i), lower, upper);
            }
            write_row(to, 0, self.scale, self.rays.t_min);
            write_row(to, 1, self.near_shift, self.rays.t_max);
            write_row(to, 2, self.far_shift, depth);
            write_row(to, 3, origin, dy / depth);
            write_row(to, 4, [dx, dy, self.reach], dx / depth);
            write_row(to, 5, near, axis);
            write_row(to, 6, far, bits(0));
            for (lane, number) in (first..).enumerate().take(L::N) {
                (*to.add(lane)).number = number;
            }
        }
    }
}

impl Prepared {
    /// Four lanes of it.
    #[inline(always)]
    fn row(&self, row: usize) -> *const f32 {
        (&raw const *self).cast::<f32>().wrapping_add(4 * row)
    }

    /// Returns the distances at which the ray enters the eight boxes of a node, and a bit for each
    /// box that it enters before `t_max`.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(crate) unsafe fn boxes<K: Instructions>(
        &self,
        node: &WideNode,
        t_max: f32,
    ) -> (K::Boxes, u32) {
        // SAFETY: the ray names whole, aligned planes.
        unsafe {
            let distance = |plane: u32, scale: f32, shift: f32| {
                let planes = node.planes.as_ptr().cast::<u8>();
                let plane = K::Boxes::load(planes.add(plane as usize).cast());
                plane.mul_add(K::Boxes::splat(scale), K::Boxes::splat(shift))
            };
            let near =
                |axis: usize| distance(self.near[axis], self.scale[axis], self.near_shift[axis]);
            let far =
                |axis: usize| distance(self.far[axis], self.scale[axis], self.far_shift[axis]);
            let begin = K::Boxes::splat(self.t_min);
            let entry = near(0).max(near(1)).max(near(2).max(begin));
            // `min` returns the second of a NaN and a number: unused lanes stay NaN.
            let exit = K::Boxes::splat(t_max).min(far(0).min(far(1)).min(far(2)));
            (entry, K::entered(entry, exit))
        }
    }

    /// Returns a ray for each quarter of the lanes, as triangles are tested with it.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(crate) unsafe fn pairs<L: Lanes>(rays: [&Self; 4]) -> Pairs<L> {
        // SAFETY: the caller's promise.
        unsafe {
            let row = |row: usize| {
                L::load_quarters([
                    rays[0].row(row),
                    rays[1].row(row),
                    rays[2].row(row),
                    rays[3].row(row),
                ])
            };
            let begin = row(0);
            let far = row(2);
            let origin = row(3);
            let direction = row(4);
            Pairs {
                origin: [origin.spread::<0>(), origin.spread::<1>(), origin.spread::<2>()],
                direction: [direction.spread::<0>(), direction.spread::<1>(), far.spread::<3>()],
                slope: [direction.spread::<3>(), origin.spread::<3>()],
                reach: direction.spread::<2>(),
                error: direction.spread::<2>() * L::splat(SINGLE_ERROR),
                t_min: begin.spread::<3>(),
            }
        }
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
unsafe fn write_row<L: Lanes>(to: *mut Prepared, row: usize, [a, b, c]: [L; 3], d: L) {
    const NEXT: usize = size_of::<Prepared>() / 4;
    // SAFETY: the caller's promises.
    unsafe {
        let to = to.cast::<f32>().wrapping_add(4 * row);
        for (i, row) in L::transpose_quarters([a, b, c, d]).into_iter().enumerate() {
            let to = to.wrapping_add(i * NEXT);
            row.store_quarters([
                to,
                to.wrapping_add(4 * NEXT),
                to.wrapping_add(8 * NEXT),
                to.wrapping_add(12 * NEXT),
            ]);
        }
    }
}
