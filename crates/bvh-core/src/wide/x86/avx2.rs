//! The AVX2 kernel: eight boxes at once with fused multiply-add, entered children sorted without a branch.

use super::lanes::{F32x4, F32x8};
use super::sort;
use crate::wide::answer::Answers;
use crate::wide::instructions::{Instructions, Pending, last_pending};
use crate::wide::lanes::{Lanes as _, Mask as _};
use crate::wide::layout::WideBvh;
use crate::wide::node::{Child, WideNode};
use crate::wide::source::Source;
use core::arch::x86_64::*;
use core::ops::Range;

pub(crate) struct Avx2;

super::entry_points!(Avx2, "avx2,fma,bmi1,bmi2,popcnt,lzcnt");

/// The lanes of each mask, the lowest first: what compresses eight lanes by one permutation.
static LANES_OF: [[u8; 8]; 256] = {
    let mut lanes_of = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let mut lane = 0;
        let mut count = 0;
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                lanes_of[mask][count] = lane;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    lanes_of
};

impl Instructions for Avx2 {
    type Boxes = F32x8;
    type Block = F32x4;
    type Rays = F32x8;
    const PACKET: usize = 64;
    const FLIGHT: usize = 24;

    #[inline(always)]
    unsafe fn entered(entry: F32x8, exit: F32x8) -> u32 {
        entry.le(exit).bits()
    }

    #[inline(always)]
    unsafe fn sort_keys(entry: F32x8, mask: u32, to: *mut u32) {
        // SAFETY: the caller's promises.
        unsafe { sort::descending(compress(sort::keys(entry.0), mask), mask.count_ones(), to) }
    }

    #[inline(always)]
    unsafe fn compress_keys(entry: F32x8, mask: u32, to: *mut u32) {
        // SAFETY: the caller's promises.
        unsafe { _mm256_storeu_si256(to.cast(), compress(sort::keys(entry.0), mask)) }
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
            let children = compress(_mm256_load_si256(node.children.as_ptr().cast()), mask);
            let to = to.cast::<__m256i>();
            _mm256_storeu_si256(to, _mm256_cvtepu32_epi64(_mm256_castsi256_si128(children)));
            _mm256_storeu_si256(
                to.add(1),
                _mm256_cvtepu32_epi64(_mm256_extracti128_si256::<1>(children)),
            );
        }
    }

    #[inline(always)]
    unsafe fn drop_farther(base: *mut Pending, top: *mut Pending, nearest: f32) -> *mut Pending {
        // SAFETY: the stack is between its ends.
        unsafe {
            let last = last_pending(nearest);
            let mut from = base;
            let mut to = base;
            while from < top {
                let pending = *from;
                *to = pending;
                to = to.add(usize::from(pending <= last));
                from = from.add(1);
            }
            to
        }
    }

    #[inline(always)]
    unsafe fn sort(node: &WideNode, F32x8(entry): F32x8, mask: u32, stack: *mut Pending) -> Child {
        const TURNS: [[i32; 8]; 7] = {
            let mut turns = [[0; 8]; 7];
            let mut i = 0;
            while i < 56 {
                turns[i / 8][i % 8] = (i / 8 + 1 + i % 8) as i32 & 7;
                i += 1;
            }
            turns
        };
        // SAFETY: the caller's promises; the stack has room for eight entries.
        unsafe {
            // The inverted lane in the last three bits makes keys distinct and prefers the higher of two lanes; lanes that
            // are not entered get negative keys.
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let inverted = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let entered =
                _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits);
            let cut = _mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(entry));
            let cut = _mm256_blendv_epi8(_mm256_set1_epi32(-8), cut, entered);
            let keys = _mm256_or_si256(cut, inverted);

            // The nearest child first: the rest of the work is not on the way to it.
            let least =
                _mm_min_epu32(_mm256_castsi256_si128(keys), _mm256_extracti128_si256::<1>(keys));
            let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0x4e>(least));
            let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0xb1>(least));
            let nearest = *node
                .children
                .get_unchecked((!_mm_cvtsi128_si32(least) & 7) as usize);

            // A child's place is the number of keys greater than its own.
            let mut places = _mm256_setzero_si256();
            for turn in &TURNS {
                let turned =
                    _mm256_permutevar8x32_epi32(keys, _mm256_loadu_si256(turn.as_ptr().cast()));
                places = _mm256_sub_epi32(places, _mm256_cmpgt_epi32(turned, keys));
            }
            // The inverse of that permutation, four bits per place, first gathered in all lanes and then shared out.
            let order = _mm256_sllv_epi32(lanes, _mm256_slli_epi32::<2>(places));
            let order = _mm256_or_si256(order, _mm256_permute2x128_si256::<1>(order, order));
            let order = _mm256_or_si256(order, _mm256_shuffle_epi32::<0x4e>(order));
            let order = _mm256_or_si256(order, _mm256_shuffle_epi32::<0xb1>(order));
            let order = _mm256_srlv_epi32(order, _mm256_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28));

            let entries = _mm256_permutevar8x32_epi32(_mm256_castps_si256(entry), order);
            let children = _mm256_load_si256(node.children.as_ptr().cast());
            let children = _mm256_permutevar8x32_epi32(children, order);
            let low = _mm256_unpacklo_epi32(children, entries);
            let high = _mm256_unpackhi_epi32(children, entries);
            let to = stack.cast::<__m256i>();
            _mm256_storeu_si256(to, _mm256_permute2x128_si256::<0x20>(low, high));
            _mm256_storeu_si256(to.add(1), _mm256_permute2x128_si256::<0x31>(low, high));
            nearest
        }
    }
}

/// The entered lanes moved to the front, zeros behind them.
#[inline(always)]
unsafe fn compress(lanes: __m256i, mask: u32) -> __m256i {
    // SAFETY: the caller has AVX2.
    unsafe {
        let order =
            _mm256_cvtepu8_epi32(_mm_loadl_epi64(LANES_OF[mask as usize & 255].as_ptr().cast()));
        let count = _mm256_set1_epi32(mask.count_ones() as i32);
        let used = _mm256_cmpgt_epi32(count, _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
        _mm256_and_si256(used, _mm256_permutevar8x32_epi32(lanes, order))
    }
}
