//! On which sides of a triangle's edges a ray passes, and where it meets the plane: sixteen pairs of both in f32, eight in f64.

use core::arch::x86_64::*;

/// A bit per pair whose triangle the ray's line may meet, from the corners' x and y along the ray's shear. In f32 the side of an edge
/// is right or zero.
///
/// # Safety
/// The caller is compiled with AVX-512 F.
#[inline(always)]
pub(super) unsafe fn candidates(
    (ax, ay): (__m512, __m512),
    (bx, by): (__m512, __m512),
    (cx, cy): (__m512, __m512),
) -> u16 {
    // SAFETY: the caller's promise.
    unsafe {
        let u = _mm512_sub_ps(_mm512_mul_ps(cx, by), _mm512_mul_ps(cy, bx));
        let v = _mm512_sub_ps(_mm512_mul_ps(ax, cy), _mm512_mul_ps(ay, cx));
        let w = _mm512_sub_ps(_mm512_mul_ps(bx, ay), _mm512_mul_ps(by, ax));
        let zero = _mm512_setzero_ps();
        let negative = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(_mm512_min_ps(_mm512_min_ps(u, v), w), zero);
        let positive = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(_mm512_max_ps(_mm512_max_ps(u, v), w), zero);
        !(negative & positive)
    }
}

/// A bit per pair whose triangle the ray meets at `t_min` or later, and the distances: the operations of
/// [`Triangle::intersect`](crate::Triangle::intersect), without those on the triangle's box. Corners are along the ray's shear.
///
/// # Safety
/// As [`candidates`].
#[inline(always)]
pub(super) unsafe fn decide(
    [ax, ay, az]: [__m512d; 3],
    [bx, by, bz]: [__m512d; 3],
    [cx, cy, cz]: [__m512d; 3],
    depth: __m512d,
    t_min: __m512d,
) -> (u8, __m256) {
    // SAFETY: the caller's promise.
    unsafe {
        // Products of two f32 are exact in f64: fused or not, the difference is the same.
        let u = _mm512_fmsub_pd(cx, by, _mm512_mul_pd(cy, bx));
        let v = _mm512_fmsub_pd(ax, cy, _mm512_mul_pd(ay, cx));
        let w = _mm512_fmsub_pd(bx, ay, _mm512_mul_pd(by, ax));
        let zero = _mm512_setzero_pd();
        let negative = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(_mm512_min_pd(_mm512_min_pd(u, v), w), zero);
        let positive = _mm512_cmp_pd_mask::<_CMP_GT_OQ>(_mm512_max_pd(_mm512_max_pd(u, v), w), zero);
        let determinant = _mm512_add_pd(_mm512_add_pd(u, v), w);
        let flat = _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(determinant, zero);
        let (u, v, w) = (_mm512_mul_pd(u, az), _mm512_mul_pd(v, bz), _mm512_mul_pd(w, cz));
        let sum = _mm512_add_pd(_mm512_add_pd(u, v), w);
        let t = _mm512_div_pd(sum, _mm512_mul_pd(determinant, depth));
        let after = _mm512_cmp_pd_mask::<_CMP_GE_OQ>(t, t_min);
        (after & !(negative & positive | flat), _mm512_cvtpd_ps(t))
    }
}
