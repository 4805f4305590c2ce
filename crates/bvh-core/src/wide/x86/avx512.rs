//! The AVX-512 kernel: eight boxes at once, entered children compressed into place.

use super::lanes::{F32x4, F32x8, F32x16};
use super::sort;
use crate::wide::instructions::{Instructions, Pending, Task, last_pending};
use crate::wide::layout::{Child, WideNode};
use core::arch::x86_64::*;

pub(crate) struct Avx512;

impl Instructions for Avx512 {
    type Boxes = F32x8;
    type Block = F32x4;
    type Rays = F32x16;

    shared!("avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt", compress);

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending) {
        // SAFETY: the processor has the instructions, and there is room for eight.
        unsafe {
            let children = compress(_mm256_load_si256(node.children.as_ptr().cast()), mask);
            _mm512_storeu_si512(to.cast(), _mm512_cvtepu32_epi64(children));
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
}

/// The entered lanes moved to the front, zeros behind them.
#[inline(always)]
unsafe fn compress(lanes: __m256i, mask: u32) -> __m256i {
    // SAFETY: the caller has AVX-512 VL.
    unsafe { _mm256_maskz_compress_epi32(mask as u8, lanes) }
}
