//! Keys of a node's children, and their order, in AVX2.

use crate::wide::instructions::Pending;
use crate::wide::layout::{Child, WideNode};
use core::arch::x86_64::*;

/// Returns the first `count` keys in descending order, if all others are 0.
#[inline(always)]
pub(super) unsafe fn descending(keys: __m256i, count: u32) -> __m256i {
    // SAFETY: the caller has AVX2.
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
            return _mm256_castsi128_si256(x);
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
        _mm256_blend_epi32::<0b1010_1010>(_mm256_max_epu32(x, s), _mm256_min_epu32(x, s))
    }
}

/// Writes the `count` children that have these keys, the nearest last. All other keys are 0.
///
/// # Safety
/// The caller has AVX2; `to` has room for eight.
#[inline(always)]
pub(super) unsafe fn write(node: &WideNode, keys: __m256i, count: u32, to: *mut Pending) {
    // SAFETY: the caller has AVX2, and there is room for eight.
    unsafe {
        let sorted = descending(keys, count);
        // The last bits of a key are those of 8 minus the lane.
        let order = _mm256_sub_epi32(_mm256_setzero_si256(), sorted);
        let children = _mm256_load_si256(node.children.as_ptr().cast());
        let children = _mm256_permutevar8x32_epi32(children, order);
        if count <= 4 {
            let children = _mm256_castsi256_si128(children);
            let sorted = _mm256_castsi256_si128(sorted);
            _mm_storeu_si128(to.cast(), _mm_unpacklo_epi32(children, sorted));
            _mm_storeu_si128(to.add(2).cast(), _mm_unpackhi_epi32(children, sorted));
            return;
        }
        let low = _mm256_unpacklo_epi32(children, sorted);
        let high = _mm256_unpackhi_epi32(children, sorted);
        let to = to.cast::<__m256i>();
        _mm256_storeu_si256(to, _mm256_permute2x128_si256::<0x20>(low, high));
        _mm256_storeu_si256(to.add(1), _mm256_permute2x128_si256::<0x31>(low, high));
    }
}

/// Returns the child that has the least of these keys, of which 0 is none.
#[inline(always)]
pub(super) unsafe fn nearest(node: &WideNode, keys: __m256i) -> Child {
    // SAFETY: the caller has AVX2; a lane is below eight.
    unsafe {
        // 0 becomes the greatest.
        let keys = _mm256_add_epi32(keys, _mm256_set1_epi32(-1));
        let least =
            _mm_min_epu32(_mm256_castsi256_si128(keys), _mm256_extracti128_si256::<1>(keys));
        let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0x4e>(least));
        let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0xb1>(least));
        *node.children.get_unchecked((!_mm_cvtsi128_si32(least) & 7) as usize)
    }
}
