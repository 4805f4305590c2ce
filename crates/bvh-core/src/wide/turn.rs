//! Single rays in a frame, by vector registers.

use super::lanes::{DoubleLanes, Lanes};
use crate::each::Each;
use crate::{Frame, Ray};
use glam::{DVec3, Vec4};

/// A frame as single rays are turned into it by vector kernels: an axis of the frame per lane.
#[derive(Clone, Debug)]
pub(crate) struct Turn {
    /// The axes of the file in the frame.
    columns: [[f64; 4]; 3],
    centre: DVec3,
}

impl Turn {
    pub(crate) fn new(frame: &Frame) -> Self {
        let [x, y, z] = frame.axes;
        let columns = [0, 1, 2].map(|axis| [x[axis], y[axis], z[axis], 0.0]);
        Self { columns, centre: frame.centre }
    }

    /// Returns what [`Frame::ray_of`] does for a direction times `unit`, a power of two, but for
    /// operations that are fused.
    ///
    /// # Safety
    /// The processor has the instructions of `L`, which has four lanes.
    #[inline(always)]
    pub(crate) unsafe fn ray<L: Lanes>(
        &self,
        origin: DVec3,
        direction: DVec3,
        [size, unit]: [f64; 2],
        [t_min, t_max]: [f32; 2],
    ) -> Ray {
        const { assert!(L::N == 4) };
        let mut vectors = [Vec4::ZERO; 3];
        // SAFETY: the processor has the instructions; a vector has four numbers.
        unsafe {
            let [to_origin, to_direction, to_inverse] =
                vectors.each_mut().each(|vector| (&raw mut *vector).cast());
            L::single(self.turned::<L>(origin - self.centre)).store(to_origin);
            // The unit is found meanwhile.
            let along = self.turned::<L>(direction);
            L::single(along * along.filled(unit)).store(to_direction);
            L::single(along.filled(Frame::ABOVE * size) / along).store(to_inverse);
        }
        let [origin, direction, inverse] = vectors.each(Vec4::truncate);
        Ray::with_inverse(origin, direction, inverse, t_min, t_max)
    }

    /// Returns the components of a direction in the frame, a lane each.
    ///
    /// # Safety
    /// As [`ray`](Self::ray).
    #[inline(always)]
    unsafe fn turned<L: Lanes>(&self, direction: DVec3) -> L::Double {
        // SAFETY: the processor has the instructions; a column has four numbers.
        unsafe {
            let [x, y, z] = direction.to_array().each(|x| L::Double::splat(x));
            let [first, second, third] = &self.columns;
            let first = L::Double::load(first.as_ptr());
            let second = L::Double::load(second.as_ptr());
            let third = L::Double::load(third.as_ptr());
            z.mul_add(third, y.mul_add(second, x * first))
        }
    }
}
