//! A ray prepared for the fused box test of the vector kernels, with the proof that the test is conservative.

use crate::ray::pow2;
use crate::{Ray, Slabs};
use core::arch::x86_64::*;

/// One ray against the planes of wide nodes: the distance to a plane is `plane · scale + shift`, one fused
/// multiply-add.
///
/// The test decides only which children are visited, never an answer; it may therefore be computed differently from
/// [`Slabs`], which the exact test of a triangle uses for the triangle's own box. What it must be is *conservative*:
/// whenever [`Slabs::interval`] of a triangle's box is not empty and contains a distance `t <= t_max`, every box around
/// the triangle passes.
///
/// *Proof.* Let u = 2⁻²⁴, `o`, `d` and `i` one component of origin, direction and reciprocal direction, D the largest
/// component of the direction, S the largest component of the origin plus the largest coordinate of the scene, `m` the
/// margin of [`Slabs`], at most 10uS + 2⁻¹²⁶, and `M` = 16uS the margin here. Take `i > 0`; the other sign mirrors every
/// step. `Slabs` computes for a lower plane p, with L = o + m rounded, a value of at least
/// (p − L) · i · (1 − 2u) − 2⁻¹⁴⁹ if p > L and no positive one otherwise, and for an upper plane, with the factor
/// [`Slabs::FAR`] and U = o − m, at most (p − U) · i · (1 + 12u) + 2⁻¹⁴⁸.
///
/// 1. *Shift.* With L' = o + M rounded, the shift −L' · s − τ is rounded once, after τ of step 3 is subtracted: it is off by at
///    most u(|L'|s + τ) + 2⁻¹⁵⁰, where s is the scale. As S ≥ 2⁻⁹⁰, the difference L' − L is at least
///    (16 − 10 − 2)uS − 2⁻¹²⁶, of which u|L'| pays for this error; 2.8uS remain. Likewise for U' = o − M.
/// 2. *Scale.* Near planes use s = i(1 − 6u), far planes s = i(1 + 16u), each with one rounding, and the fused
///    operation rounds once: (1 − 5u)(1 + u) ≤ 1 − 2u and (1 + 15u)(1 − u) ≥ 1 + 12u.
/// 3. *Underflow.* Subtracting τ = 2⁻¹²⁶ from near shifts and adding it to far ones pays for all absolute errors of
///    subnormal numbers, which are below 2⁻¹⁴⁶ together. A smaller τ would do, but would itself be subnormal, and Intel's
///    processors take about 150 cycles for every multiplication with such an operand.
/// 4. *Clamp.* Where |d| is far smaller than D, i · o could overflow. So |i| is clamped to K = 2²⁴ / D. Nearer distances
///    to near planes are conservative. A far plane p that `Slabs` puts in front of the origin has p ≥ U, and then
///    (p − U') · K ≥ 2.8uS · K = 2.8S / D, which no distance exceeds that `Slabs` accepts on the axis of D.
/// 5. *Overflow.* Rays with S ≥ 2⁶⁰, S · K ≥ 2¹²⁰ or S < 2⁻⁹⁰ are left to the portable kernel, which needs no bounds.
///
/// Distances are compared as `max(near…, t_min) <= min(far…, t_max)`; `Slabs` moves a hit's distance into the interval
/// of the triangle's box, so the first is at most the distance of any hit that would be accepted. ∎
#[derive(Clone, Copy)]
pub(crate) struct BoxRay {
    /// Indices of the planes that the ray meets first, by axis, and of those opposite.
    pub(crate) near: [usize; 3],
    pub(crate) far: [usize; 3],
    pub(crate) near_scale: [__m256; 3],
    pub(crate) near_shift: [__m256; 3],
    pub(crate) far_scale: [__m256; 3],
    pub(crate) far_shift: [__m256; 3],
}

impl BoxRay {
    const U: f32 = f32::EPSILON / 2.0;
    pub(crate) const MARGIN: f32 = 2.0 * Slabs::MARGIN;
    pub(crate) const NEAR: f32 = 1.0 - 6.0 * Self::U;
    pub(crate) const FAR: f32 = 1.0 + 16.0 * Self::U;
    /// τ of step 3: 2⁻¹²⁶, the smallest number that is not subnormal.
    pub(crate) const UNDERFLOW: f32 = f32::MIN_POSITIVE;
    /// K of step 4, times the largest component of the direction: 2²⁴.
    pub(crate) const CLAMP: f32 = pow2(24);
    /// The bounds of step 5, on S from both sides and on S · K.
    pub(crate) const LEAST_SIZE: f32 = pow2(-90);
    pub(crate) const MOST_SIZE: f32 = pow2(60);
    pub(crate) const MOST_SHIFT: f32 = pow2(120);

    /// Prepares `ray` for boxes whose coordinates are at most `largest`; `None` for the rare ray that the portable kernel
    /// must trace.
    ///
    /// # Safety
    /// The caller is compiled with AVX2.
    #[inline(always)]
    pub(crate) unsafe fn new(ray: &Ray, largest: f32) -> Option<Self> {
        // SAFETY: the caller's promise.
        unsafe { Self::with_margin(ray, largest, Self::MARGIN, Self::UNDERFLOW) }
    }

    #[inline(always)]
    unsafe fn with_margin(ray: &Ray, largest: f32, margin: f32, underflow: f32) -> Option<Self> {
        // SAFETY: a ray is three vectors of four lanes; the rest is the caller's promise.
        unsafe {
            let lanes: *const f32 = (&raw const *ray).cast();
            let origin = _mm_load_ps(lanes);
            let inverse = _mm_load_ps(lanes.add(8));
            let sign = _mm_set1_ps(-0.0);
            let sizes = _mm_andnot_ps(sign, origin);
            let size = _mm_max_ps(sizes, _mm_permute_ps::<0b01>(sizes));
            let size = _mm_max_ss(size, _mm_permute_ps::<0b10>(sizes));
            let size = _mm_cvtss_f32(size) + largest;
            let limit = ray.least_inverse() * Self::CLAMP;
            let in_range = (Self::LEAST_SIZE..Self::MOST_SIZE).contains(&size)
                & (size * limit < Self::MOST_SHIFT);
            if !in_range {
                return None;
            }
            let scale = _mm_min_ps(_mm_max_ps(inverse, _mm_set1_ps(-limit)), _mm_set1_ps(limit));
            let margin = _mm_or_ps(_mm_set1_ps(size * margin), _mm_and_ps(sign, inverse));
            let near_scale = _mm_mul_ps(scale, _mm_set1_ps(Self::NEAR));
            let far_scale = _mm_mul_ps(scale, _mm_set1_ps(Self::FAR));
            let tiny = _mm_set1_ps(underflow);
            let near_shift = _mm_fnmsub_ps(_mm_add_ps(origin, margin), near_scale, tiny);
            let far_shift = _mm_fnmadd_ps(_mm_sub_ps(origin, margin), far_scale, tiny);
            let backwards = _mm_movemask_ps(inverse) as usize;
            let flip = [3 * (backwards & 1), 3 * (backwards >> 1 & 1), 3 * (backwards >> 2 & 1)];
            let spread = |x: __m128| {
                [
                    _mm256_broadcastss_ps(x),
                    _mm256_broadcastss_ps(_mm_permute_ps::<0b01>(x)),
                    _mm256_broadcastss_ps(_mm_permute_ps::<0b10>(x)),
                ]
            };
            Some(Self {
                near: [flip[0], 1 + flip[1], 2 + flip[2]],
                far: [3 - flip[0], 4 - flip[1], 5 - flip[2]],
                near_scale: spread(near_scale),
                near_shift: spread(near_shift),
                far_scale: spread(far_scale),
                far_shift: spread(far_shift),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::slabs::margin;
    use glam::Vec3;

    /// How many of many planes are nearer for [`Slabs`] than for a ray with these margins, where they are in front.
    #[target_feature(enable = "avx2,fma")]
    fn planes_too_far(own_margin: f32, underflow: f32) -> usize {
        let mut state = 1u32;
        let mut random = || {
            state = state
                .wrapping_mul(747_796_405)
                .wrapping_add(2_891_336_453);
            let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
            (word >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut failures = 0;
        for case in 0..400_000 {
            let scale = pow2([0, -60, 40, -89][case % 4]);
            let size = Vec3::new(random(), random(), random()) * scale;
            // A plane close to the origin and others on the far side: the margins are largest, and nothing else helps.
            let origin = Vec3::new(-random().abs() - 0.5, random(), random()) * scale;
            let near_origin = origin * (1.0 + random() * 2.5e-6 * [1.0, 1e3][case / 4 % 2]);
            let bounds = Aabb::around([near_origin, size * 0.001, -origin]);
            // With the last exponent distances are denormal or vanish.
            let direction = Vec3::new(random(), random(), random())
                * pow2([0, 30, -30, 0, 30, -30, 85][case % 7]);
            let Ok(ray) = Ray::half_line(origin, direction) else { continue };
            let largest = bounds
                .min
                .abs()
                .max(bounds.max.abs())
                .max_element();
            // SAFETY: this function has the features.
            let Some(boxes) =
                (unsafe { BoxRay::with_margin(&ray, largest, own_margin, underflow) })
            else {
                continue;
            };
            let margin = margin(&ray, &bounds);
            for axis in 0..3 {
                let inverse = ray.inverse_direction()[axis];
                let side = 1.0f32.copysign(inverse);
                for plane in [bounds.min[axis], bounds.max[axis], near_origin[axis]] {
                    let lower = origin[axis] + side * margin[axis];
                    let upper = origin[axis] - side * margin[axis];
                    let near = (plane - lower) * inverse;
                    let far = (plane - upper) * inverse * Slabs::FAR;
                    let first = |lanes: __m256| _mm256_cvtss_f32(lanes);
                    let own_near =
                        plane.mul_add(first(boxes.near_scale[axis]), first(boxes.near_shift[axis]));
                    let own_far =
                        plane.mul_add(first(boxes.far_scale[axis]), first(boxes.far_shift[axis]));
                    // Distances beyond every hit need not be reached: step 4.
                    let most = 4.0 * (largest + origin.abs().max_element()) * ray.least_inverse();
                    failures += usize::from(
                        own_near > near.max(0.0) || (far >= 0.0 && own_far < far.min(most)),
                    );
                }
            }
        }
        failures
    }

    #[test]
    fn the_margins_are_conservative_and_half_of_one_or_none_of_the_other_is_not() {
        if !crate::Kernel::Avx2.is_available() {
            return;
        }
        // SAFETY: the kernel's features include those of the function.
        unsafe {
            assert_eq!(planes_too_far(BoxRay::MARGIN, BoxRay::UNDERFLOW), 0);
            assert!(planes_too_far(BoxRay::MARGIN / 2.0, BoxRay::UNDERFLOW) > 0);
            assert!(planes_too_far(BoxRay::MARGIN, 0.0) > 0);
        }
    }
}
