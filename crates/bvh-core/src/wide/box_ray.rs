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
/// margin of [`Slabs`], at most 10uS + 2⁻¹²⁶, and `M` = 24uS the margin here. Take `i > 0`; the other sign mirrors every
/// step. `Slabs` computes for a lower plane p, with L = o + m rounded, a value of at least
/// (p − L) · i · (1 − 2u) − 2⁻¹⁴⁹ if p > L and no positive one otherwise, and for an upper plane, with the factor
/// [`Slabs::FAR`] and U = o − m, at most (p − U) · i · (1 + 12u) + 2⁻¹⁴⁸.
///
/// 1. *Shift.* With L' = o + M rounded, the shift −L' · s is off by at most u|L'|s + 2⁻¹⁵⁰ where s is the scale. As
///    S ≥ 2⁻⁹⁰, the difference L' − L is at least 11uS, of which u|L'| < 2uS pays for this error; 9uS remain. Likewise
///    for U' = o − M.
/// 2. *Scale.* Near planes use s = i(1 − 6u), far planes s = i(1 + 16u), each with one rounding, and the fused
///    operation rounds once: (1 − 5u)(1 + u) ≤ 1 − 2u and (1 + 15u)(1 − u) ≥ 1 + 12u.
/// 3. *Underflow.* Subtracting τ = 2⁻¹⁴⁶ from near shifts and adding it to far ones pays for all absolute errors of
///    denormal numbers: where it is too small to change a shift c, |c| > 2⁻¹²³, and uSs of what step 1 left is larger.
/// 4. *Clamp.* Where |d| is far smaller than D, i · o could overflow. So |i| is clamped to K = 2²⁴ / D. Nearer distances
///    to near planes are conservative. A far plane p that `Slabs` puts in front of the origin has p ≥ U, and then
///    (p − U') · K ≥ 8uS · K = 8S / D, which no distance exceeds that `Slabs` accepts on the axis of D.
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
    pub(crate) const MARGIN: f32 = 3.0 * Slabs::MARGIN;
    pub(crate) const NEAR: f32 = 1.0 - 6.0 * Self::U;
    pub(crate) const FAR: f32 = 1.0 + 16.0 * Self::U;
    /// τ of step 3: 2⁻¹⁴⁶.
    pub(crate) const UNDERFLOW: f32 = f32::from_bits(8);
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
        // SAFETY: a ray is three vectors of four lanes; the rest is the caller's promise.
        unsafe {
            let lanes: *const f32 = (&raw const *ray).cast();
            let (origin, inverse) = (_mm_load_ps(lanes), _mm_load_ps(lanes.add(8)));
            let sign = _mm_set1_ps(-0.0);
            let sizes = _mm_andnot_ps(sign, origin);
            let size = _mm_max_ps(sizes, _mm_permute_ps::<0b01>(sizes));
            let size = _mm_max_ss(size, _mm_permute_ps::<0b10>(sizes));
            let size = _mm_cvtss_f32(size) + largest;
            let limit = ray.least_inverse() * Self::CLAMP;
            let in_range = (size < Self::MOST_SIZE) & (size >= Self::LEAST_SIZE) & (size * limit < Self::MOST_SHIFT);
            if !in_range {
                return None;
            }
            let scale = _mm_min_ps(_mm_max_ps(inverse, _mm_set1_ps(-limit)), _mm_set1_ps(limit));
            let margin = _mm_or_ps(_mm_set1_ps(size * Self::MARGIN), _mm_and_ps(sign, inverse));
            let near_scale = _mm_mul_ps(scale, _mm_set1_ps(Self::NEAR));
            let far_scale = _mm_mul_ps(scale, _mm_set1_ps(Self::FAR));
            let tiny = _mm_set1_ps(Self::UNDERFLOW);
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
