//! The box test of the vector kernels, and the proof that it is conservative.
//!
//! Every kernel computes the distances to the planes of a box as `plane · scale + shift`, and
//! visits a box whose greatest near distance is at most its least far distance. The test decides
//! which boxes are visited, never an answer. It must be *conservative*: whenever the interval that
//! `Slabs` computes for a triangle's own box has a distance `t <= t_max`, every box around the
//! triangle passes.
//!
//! Names, for one axis: u = 2⁻²⁴; o, d and i are the origin, the direction and its reciprocal; D is
//! the largest component of the direction; S is the largest component of the origin plus the
//! largest coordinate of the scene. Take i > 0, since the other sign mirrors every step. `Slabs`
//! has a margin m of at most 10uS + 2⁻¹²⁶. With L = o + m and U = o − m, rounded, it computes for a
//! lower plane p > L at least (p − L) · i · (1 − 2u) − 2⁻¹⁴⁹, for another lower plane nothing
//! positive, and for an upper plane at most (p − U) · i · (1 + 12u) + 2⁻¹⁴⁸. The test here uses the
//! margin M = 32uS, and computes (p − L') · s and (p − U') · s with L' = o + M, U' = o − M and a
//! scale s.
//!
//! 1. *Shift.* M is added to the origin or to the plane, which rounds by at most uS, and the
//!    product of origin and scale rounds by at most uS · s. With the rounding of L, all of these
//!    move a plane by less than 4uS. Hence L' and L differ by at least (32 − 10 − 4)uS = 18uS, and
//!    so do U' and U.
//! 2. *Relative errors.* The factors of `Slabs` and the last rounding here amount to 3u on a near
//!    distance and 13u on a far one. No plane is farther from the origin than S. So these factors
//!    move no plane by more than 14uS, and 4uS of the margin remain.
//! 3. *Underflow.* Errors of subnormal numbers are below 2⁻¹⁴⁶ together. Rays with S / D < 2⁻¹²⁰
//!    are left to the portable kernel; for all others the remaining margin is at least 4uS / D =
//!    2⁻¹⁴² in distance.
//! 4. *Clamp.* Where |d| is far smaller than D, i · o could overflow. Hence |s| is i clamped to K =
//!    2²⁴ / D. Near distances only become nearer. A far plane p that `Slabs` has in front of the
//!    origin has p ≥ U, and then (p − U') · K ≥ 4uS · K = 4S / D, which no distance exceeds that
//!    `Slabs` accepts on the axis of D. Where no instruction fuses, the product of plane and scale
//!    rounds by another uS · s. Then 3uS of the margin remain, which suffices here and in step 3.
//! 5. *Overflow.* Rays with S ≥ 2⁶⁰, S · K ≥ 2¹²⁰ or S < 2⁻⁹⁰ are left to the portable kernel.
//!
//! The interval of `Slabs` for a triangle's own box contains the rounded distance of a hit. Hence a
//! near distance is at most the distance of any hit, and needs no margin compared with the nearest
//! hit so far.
//!
//! Interval arithmetic takes the least and the greatest product over all origins and all scales of
//! a packet by the same operations, with the largest S. Rounding is monotone: the bounds are not
//! beyond the distances of any ray of the packet by more than the steps above allow.

use super::lanes::Lanes;
use super::node::WideNode;
use crate::ray::pow2;
use crate::{Ray, Slabs};
use core::ops::Range;
use glam::Vec4;

/// M, in multiples of S.
pub(crate) const MARGIN: f32 = 4.0 * Slabs::MARGIN;
/// K of step 4, in multiples of 1 / D.
pub(crate) const CLAMP: f32 = pow2(24);
/// The bounds of S: steps 2 and 5.
pub(crate) const SIZES: Range<f32> = pow2(-90)..pow2(60);
/// The bounds of S · K: steps 3 and 5.
pub(crate) const SHIFTS: Range<f32> = pow2(-96)..pow2(120);

/// A ray as boxes are tested with it. The distance to a plane is `plane · scale + shift`.
#[derive(Clone, Copy)]
struct FusedRay {
    scale: Vec4,
    near_shift: Vec4,
    far_shift: Vec4,
    /// The signs of the reciprocals, a bit per axis.
    backwards: usize,
}

impl FusedRay {
    /// Prepares `ray` for boxes whose coordinates are at most `largest`. Returns `None` for the
    /// rare ray that the portable kernel must trace.
    #[inline(always)]
    fn new(ray: &Ray, largest: f32, margin: f32) -> Option<Self> {
        let [origin, _, inverse] = ray.vectors();
        let size = origin.truncate().abs().max_element() + largest;
        let limit = inverse.w * CLAMP;
        let shift = size * limit;
        if !(SIZES.contains(&size) & SHIFTS.contains(&shift)) {
            return None;
        }
        let scale = inverse.max(Vec4::splat(-limit)).min(Vec4::splat(limit));
        let margin = Vec4::splat(size * margin).copysign(inverse);
        Some(Self {
            scale,
            near_shift: -(origin + margin) * scale,
            far_shift: -(origin - margin) * scale,
            backwards: inverse.is_negative_bitmask() as usize,
        })
    }
}

/// A ray in all lanes.
pub(crate) struct BoxRay<L> {
    /// The bytes of a node before the planes that the ray meets first, by axis.
    near: [usize; 3],
    /// And before the planes opposite.
    far: [usize; 3],
    scale: [L; 3],
    near_shift: [L; 3],
    far_shift: [L; 3],
    t_min: L,
}

impl<L: Lanes> BoxRay<L> {
    /// Prepares `ray` for boxes whose coordinates are at most `largest`. Returns `None` for the
    /// rare ray that the portable kernel must trace.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(crate) unsafe fn new(ray: &Ray, largest: f32) -> Option<Self> {
        const PLANE: usize = size_of::<[f32; WideNode::LANES]>();
        let FusedRay { scale, near_shift, far_shift, backwards } =
            FusedRay::new(ray, largest, MARGIN)?;
        let near = [
            3 * PLANE * (backwards & 1),
            3 * PLANE * (backwards >> 1 & 1) + PLANE,
            3 * PLANE * (backwards >> 2 & 1) + 2 * PLANE,
        ];
        // SAFETY: the caller's promise.
        unsafe {
            Some(Self {
                near,
                far: [3 * PLANE - near[0], 5 * PLANE - near[1], 7 * PLANE - near[2]],
                scale: [L::splat(scale.x), L::splat(scale.y), L::splat(scale.z)],
                near_shift: [
                    L::splat(near_shift.x),
                    L::splat(near_shift.y),
                    L::splat(near_shift.z),
                ],
                far_shift: [L::splat(far_shift.x), L::splat(far_shift.y), L::splat(far_shift.z)],
                t_min: L::splat(ray.t_min()),
            })
        }
    }

    /// Returns the distances at which the ray enters and leaves the eight boxes of a node, the
    /// latter at most `t_max`.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(crate) unsafe fn intervals(&self, node: &WideNode, t_max: f32) -> (L, L) {
        // SAFETY: `near` and `far` name aligned planes of the node, of as many lanes as `L`.
        unsafe {
            let planes = node.planes.as_ptr().cast::<u8>();
            let mut near = [self.t_min; 3];
            let mut far = [self.t_min; 3];
            for axis in 0..3 {
                let plane = L::load(planes.add(self.near[axis]).cast());
                near[axis] = plane.mul_add(self.scale[axis], self.near_shift[axis]);
                let plane = L::load(planes.add(self.far[axis]).cast());
                far[axis] = plane.mul_add(self.scale[axis], self.far_shift[axis]);
            }
            let entry = near[0].max(near[1]).max(near[2].max(self.t_min));
            // Of a NaN and a number the second: unused lanes stay NaN.
            let exit = L::splat(t_max).min(far[0].min(far[1]).min(far[2]));
            (entry, exit)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::slabs::margin;
    use glam::Vec3;

    /// Counts the planes that are nearer for [`Slabs`] than for a ray with this margin, where they
    /// are in front of it.
    fn planes_too_far(own_margin: f32) -> usize {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
            (word >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut failures = 0;
        for case in 0..400_000 {
            let scale = pow2([0, -60, 40, -89][case % 4]);
            let size = Vec3::new(random(), random(), random()) * scale;
            // A plane close to the origin and others on the far side: the margins are largest, and
            // nothing else helps.
            let origin = Vec3::new(-random().abs() - 0.5, random(), random()) * scale;
            let near_origin = origin * (1.0 + random() * 2.5e-6 * [1.0, 1e3][case / 4 % 2]);
            let bounds = Aabb::around([near_origin, size * 0.001, -origin]);
            // With the last exponent distances are subnormal or vanish.
            let direction = Vec3::new(random(), random(), random())
                * pow2([0, 30, -30, 0, 30, -30, 85][case % 7]);
            let Ok(ray) = Ray::half_line(origin, direction) else { continue };
            let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
            let Some(fused) = FusedRay::new(&ray, largest, own_margin) else { continue };
            let margin = margin(&ray, &bounds);
            let least_inverse = ray.inverse_direction().abs().min_element();
            // Distances beyond every hit need not be reached: step 4.
            let most = 4.0 * (largest + origin.abs().max_element()) * least_inverse;
            for axis in 0..3 {
                let inverse = ray.inverse_direction()[axis];
                let side = 1.0f32.copysign(inverse);
                let lower = origin[axis] + side * margin[axis];
                let upper = origin[axis] - side * margin[axis];
                for plane in [bounds.min[axis], bounds.max[axis], near_origin[axis]] {
                    let near = (plane - lower) * inverse;
                    let far = (plane - upper) * inverse * Slabs::FAR;
                    let own_near = plane.mul_add(fused.scale[axis], fused.near_shift[axis]);
                    let own_far = plane.mul_add(fused.scale[axis], fused.far_shift[axis]);
                    let is_too_near = far >= 0.0 && own_far < far.min(most);
                    failures += usize::from(own_near > near.max(0.0) || is_too_near);
                }
            }
        }
        failures
    }

    #[test]
    fn the_margin_is_conservative_and_half_of_it_is_not() {
        assert_eq!(planes_too_far(MARGIN), 0);
        assert!(planes_too_far(MARGIN / 2.0) > 0);
    }
}
