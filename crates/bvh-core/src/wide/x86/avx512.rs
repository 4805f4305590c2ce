//! The AVX-512 kernel: eight boxes at once, entered children compressed into place.

use super::lanes::{F32x4, F32x8, F32x16};
use super::sort;
use crate::wide::answer::Answers;
use crate::wide::instructions::{Instructions, Pending, last_pending};
use crate::wide::layout::WideBvh;
use crate::wide::node::{Child, WideNode};
use crate::wide::source::Source;
use core::arch::x86_64::*;
use core::ops::Range;

pub(crate) struct Avx512;

super::entry_points!(Avx512, "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt");

impl Instructions for Avx512 {
    type Boxes = F32x8;
    type Block = F32x4;
    type Rays = F32x16;
    const PACKET: usize = 64;
    const FLIGHT: usize = 24;

    #[inline(always)]
    unsafe fn entered(F32x8(entry): F32x8, F32x8(exit): F32x8) -> u32 {
        // SAFETY: the caller has AVX-512 VL.
        u32::from(unsafe { _mm256_cmp_ps_mask::<_CMP_LE_OQ>(entry, exit) })
    }

    #[inline(always)]
    unsafe fn sort_keys(entry: F32x8, mask: u32, to: *mut u32) {
        // SAFETY: the caller's promises.
        unsafe {
            let keys = _mm256_maskz_compress_epi32(mask as u8, sort::keys(entry.0));
            sort::descending(keys, mask.count_ones(), to);
        }
    }

    #[inline(always)]
    unsafe fn compress_keys(entry: F32x8, mask: u32, to: *mut u32) {
        // SAFETY: the caller's promises.
        unsafe {
            _mm256_storeu_si256(
                to.cast(),
                _mm256_maskz_compress_epi32(mask as u8, sort::keys(entry.0)),
            )
        }
    }

    #[inline(always)]
    unsafe fn prefetch(line: *const u8) {
        // SAFETY: a prefetch may name any address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) }
    }

    #[inline(always)]
    unsafe fn in_flight<A: Answers>(
        wide: &WideBvh,
        rays: impl Source,
        answers: &mut A,
        numbers: Range<usize>,
    ) {
        // SAFETY: the caller's promises.
        unsafe { in_flight(wide, rays, answers, numbers) }
    }

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending) {
        // SAFETY: the caller's promises.
        unsafe {
            let children = _mm256_load_si256(node.children.as_ptr().cast());
            let entered = _mm256_maskz_compress_epi32(mask as u8, children);
            _mm512_storeu_si512(to.cast(), _mm512_cvtepu32_epi64(entered));
        }
    }

    #[inline(always)]
    unsafe fn drop_farther(base: *mut Pending, top: *mut Pending, nearest: f32) -> *mut Pending {
        // SAFETY: the stack has room for a register more than it holds, and is aligned.
        unsafe {
            let nearest = _mm512_set1_epi64(last_pending(nearest) as i64);
            let mut from = base;
            let mut to = base;
            while from < top {
                let pending = _mm512_load_si512(from.cast());
                let held = (0xff_u32 >> (8 - (top.offset_from(from) as usize).min(8))) as u8;
                let kept = _mm512_mask_cmple_epu64_mask(held, pending, nearest);
                _mm512_storeu_si512(to.cast(), _mm512_maskz_compress_epi64(kept, pending));
                to = to.add(kept.count_ones() as usize);
                from = from.add(8);
            }
            to
        }
    }

    #[inline(always)]
    unsafe fn sort(node: &WideNode, F32x8(entry): F32x8, mask: u32, stack: *mut Pending) -> Child {
        // SAFETY: the caller's promises; the stack has room for eight entries.
        unsafe {
            // The inverted lane in the last three bits prefers the higher of two lanes.
            let inverted = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
            let cut = _mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(entry));
            let keys = _mm256_or_si256(cut, inverted);
            let children = _mm256_load_si256(node.children.as_ptr().cast());
            // The nearest child first: the rest of the work is not on the way to it.
            let least = _mm256_mask_mov_epi32(_mm256_set1_epi32(-1), mask as u8, keys);
            let least =
                _mm_min_epu32(_mm256_castsi256_si128(least), _mm256_extracti128_si256::<1>(least));
            let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0x4e>(least));
            let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0xb1>(least));
            let nearest = *node
                .children
                .get_unchecked((!_mm_cvtsi128_si32(least) & 7) as usize);

            let keys = _mm256_maskz_compress_epi32(mask as u8, keys);
            if mask.count_ones() <= 4 {
                // Descending, zeros last: three stages of two comparisons.
                let x = _mm256_castsi256_si128(keys);
                let s = _mm_shuffle_epi32::<0b10_11_00_01>(x);
                let x = _mm_blend_epi32::<0b1010>(_mm_max_epu32(x, s), _mm_min_epu32(x, s));
                let s = _mm_shuffle_epi32::<0b01_00_11_10>(x);
                let x = _mm_blend_epi32::<0b1100>(_mm_max_epu32(x, s), _mm_min_epu32(x, s));
                let s = _mm_shuffle_epi32::<0b11_01_10_00>(x);
                let x = _mm_blend_epi32::<0b0100>(_mm_max_epu32(x, s), _mm_min_epu32(x, s));
                let order = _mm_andnot_si128(x, _mm_set1_epi32(7));
                let sorted = _mm256_permutevar8x32_epi32(children, _mm256_castsi128_si256(order));
                let sorted = _mm256_castsi256_si128(sorted);
                _mm_storeu_si128(stack.cast(), _mm_unpacklo_epi32(sorted, x));
                _mm_storeu_si128(stack.add(2).cast(), _mm_unpackhi_epi32(sorted, x));
            } else {
                // Loops without iterators, whose calls are not always inlined here.
                let n = mask.count_ones() as usize;
                let keys: [u32; 8] = core::mem::transmute(keys);
                let mut sorted = keys;
                let mut i = 1;
                while i < n {
                    let key = keys[i & 7];
                    let mut at = i;
                    while at > 0 && sorted[(at - 1) & 7] < key {
                        sorted[at & 7] = sorted[(at - 1) & 7];
                        at -= 1;
                    }
                    sorted[at & 7] = key;
                    i += 1;
                }
                let mut i = 0;
                while i < n {
                    let key = sorted[i & 7];
                    let child = node
                        .children
                        .get_unchecked((!key & 7) as usize)
                        .bits();
                    stack
                        .add(i)
                        .write(u64::from(key) << 32 | u64::from(child));
                    i += 1;
                }
            }
            nearest
        }
    }
}
