//! The AVX2 kernel: eight boxes at once with fused multiply-add, entered children sorted without a
//! branch.

use super::lanes::{F32x4, F32x8};
use super::sort;
use crate::wide::instructions::{Instructions, Pending, Task};
use crate::wide::layout::{Child, WideNode};
use core::arch::x86_64::*;

pub(crate) struct Avx2;

/// The lanes of each mask, the lowest first, then another lane as often as there is room: what
/// compresses eight lanes by one permutation.
static LANES_OF: [[u8; 8]; 256] = {
    let mut lanes_of = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        lanes_of[mask] = [mask.trailing_ones() as u8 & 7; 8];
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

    shared!("avx2,fma,bmi1,bmi2,popcnt,lzcnt", compress);

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending) {
        // SAFETY: the processor has the instructions, and there is room for eight.
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
}

/// The entered lanes moved to the front, one of the others behind them.
#[inline(always)]
unsafe fn compress(lanes: __m256i, mask: u32) -> __m256i {
    // SAFETY: the caller has AVX2.
    unsafe {
        let order = _mm_loadl_epi64(LANES_OF[mask as usize & 255].as_ptr().cast());
        _mm256_permutevar8x32_epi32(lanes, _mm256_cvtepu8_epi32(order))
    }
}
