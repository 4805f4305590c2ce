//! Rays side by side that are moved into an instance, with the bits of single rays.

use super::lanes::{DoubleLanes, Lanes};
use super::ray_lanes::RayLanes;
use crate::{Aabb, Ray, Slabs};
use glam::{DAffine3, Vec3};

impl<L: Lanes> RayLanes<L> {
    /// Returns the distances at which the rays enter a box, as [`Slabs::entry`] returns them for
    /// rays prepared for a scene with these bounds, and the rays that enter it.
    #[inline(always)]
    pub(super) fn entry(&self, bounds: &Aabb, aabb: &Aabb) -> (L, L::Mask) {
        let mut entries = [f32::INFINITY; 16];
        for (lane, entry) in entries.iter_mut().enumerate().take(L::N) {
            *entry = Slabs::new(&self.ray(lane), bounds).entry(aabb);
        }
        // SAFETY: values exist; there are sixteen numbers.
        unsafe {
            let entry = L::load_unaligned(entries.as_ptr());
            (entry, entry.lt(L::splat(f32::INFINITY)))
        }
    }

    /// Returns the rays in other coordinates over the same ranges, and those that have a valid
    /// direction and origin there.
    #[inline(always)]
    pub(super) fn moved(&self, to_local: &DAffine3) -> (Self, L::Mask) {
        let mut origin = self.origin;
        let mut direction = self.direction;
        // SAFETY: values exist.
        unsafe {
            let most = L::splat(f32::MAX);
            let longest = L::splat(*Ray::DIRECTION_RANGE.end());
            let shortest = L::splat(*Ray::DIRECTION_RANGE.start());
            let mut inverse = self.inverse;
            let mut is_valid = most.le(most);
            for axis in 0..3 {
                let shift = L::Double::splat(to_local.translation[axis]);
                origin[axis] = L::single(turned(to_local, axis, self.origin) + shift);
                direction[axis] = L::single(turned(to_local, axis, self.direction));
                // The same operations as in `Ray`, so that the bits agree.
                inverse[axis] = (L::splat(1.0) / direction[axis]).max(L::splat(f32::MIN)).min(most);
                is_valid =
                    is_valid & direction[axis].abs().le(longest) & origin[axis].abs().le(most);
            }
            let [x, y, z] = direction;
            is_valid = is_valid & shortest.le(x.abs().max(y.abs()).max(z.abs()));
            let moved = Self { origin, direction, inverse, t_min: self.t_min, t_max: self.t_max };
            (moved, is_valid)
        }
    }

    /// Returns one of the rays, which is valid.
    #[inline(always)]
    pub(super) fn ray(&self, lane: usize) -> Ray {
        let origin = self.origin;
        let direction = self.direction;
        let from = Vec3::new(one(origin[0], lane), one(origin[1], lane), one(origin[2], lane));
        let to =
            Vec3::new(one(direction[0], lane), one(direction[1], lane), one(direction[2], lane));
        Ray::assume_valid(from, to, one(self.t_min, lane), one(self.t_max, lane))
    }
}

/// Returns a component of vectors that a matrix turns, in the order of operations of `glam`.
#[inline(always)]
fn turned<L: Lanes>(to_local: &DAffine3, axis: usize, [x, y, z]: [L; 3]) -> L::Double {
    let matrix = &to_local.matrix3;
    // SAFETY: values exist.
    unsafe {
        L::Double::splat(matrix.x_axis[axis]) * x.double()
            + L::Double::splat(matrix.y_axis[axis]) * y.double()
            + L::Double::splat(matrix.z_axis[axis]) * z.double()
    }
}

/// Returns one lane.
#[inline(always)]
fn one<L: Lanes>(lanes: L, lane: usize) -> f32 {
    let mut numbers = [0.0; 16];
    // SAFETY: there is room for sixteen.
    unsafe { lanes.store(numbers.as_mut_ptr()) };
    numbers[lane]
}
