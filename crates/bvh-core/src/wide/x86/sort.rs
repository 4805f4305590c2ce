//! Keys of a node's children, and their order.

use core::arch::x86_64::*;

/// The bits of the entries, of which the last three are the inverted lane: of equal ones the higher lane is nearer.
///
/// # Safety
/// The caller has AVX2.
#[inline(always)]
pub(super) unsafe fn keys(entry: __m256) -> __m256i {
    // SAFETY: the caller's promise.
    unsafe {
        let cut = _mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(entry));
        _mm256_or_si256(cut, _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0))
    }
}

/// Writes the first `count` keys in descending order; the others are 0.
///
/// # Safety
/// The caller has AVX2; `to` has room for eight.
#[inline(always)]
pub(super) unsafe fn descending(keys: __m256i, count: u32, to: *mut u32) {
    // SAFETY: the caller's promises.
    unsafe {
        if count <= 4 {
            // Three stages of two comparisons.
            let x = _mm256_castsi256_si128(keys);
            let s = _mm_shuffle_epi32::<0b10_11_00_01>(x);
            let x = _mm_blend_epi32::<0b1010>(_mm_max_epu32(x, s), _mm_min_epu32(x, s));
            let s = _mm_shuffle_epi32::<0b01_00_11_10>(x);
            let x = _mm_blend_epi32::<0b1100>(_mm_max_epu32(x, s), _mm_min_epu32(x, s));
            let s = _mm_shuffle_epi32::<0b11_01_10_00>(x);
            let x = _mm_blend_epi32::<0b0100>(_mm_max_epu32(x, s), _mm_min_epu32(x, s));
            return _mm_storeu_si128(to.cast(), x);
        }
        // Bitonic: pairs, fours, then eight.
        let x = keys;
        let s = _mm256_shuffle_epi32::<0b10_11_00_01>(x);
        let x = _mm256_blend_epi32::<0b0110_0110>(_mm256_max_epu32(x, s), _mm256_min_epu32(x, s));
        let s = _mm256_shuffle_epi32::<0b01_00_11_10>(x);
        let x = _mm256_blend_epi32::<0b0011_1100>(_mm256_max_epu32(x, s), _mm256_min_epu32(x, s));
        let s = _mm256_shuffle_epi32::<0b10_11_00_01>(x);
        let x = _mm256_blend_epi32::<0b0101_1010>(_mm256_max_epu32(x, s), _mm256_min_epu32(x, s));
        let s = _mm256_permute2x128_si256::<1>(x, x);
        let x = _mm256_blend_epi32::<0b1111_0000>(_mm256_max_epu32(x, s), _mm256_min_epu32(x, s));
        let s = _mm256_shuffle_epi32::<0b01_00_11_10>(x);
        let x = _mm256_blend_epi32::<0b1100_1100>(_mm256_max_epu32(x, s), _mm256_min_epu32(x, s));
        let s = _mm256_shuffle_epi32::<0b10_11_00_01>(x);
        let x = _mm256_blend_epi32::<0b1010_1010>(_mm256_max_epu32(x, s), _mm256_min_epu32(x, s));
        _mm256_storeu_si256(to.cast(), x);
    }
}
