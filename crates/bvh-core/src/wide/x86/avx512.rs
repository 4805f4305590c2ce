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

    #[inline(always)]
    unsafe fn prefetch(line: *const u8) {
        // SAFETY: a prefetch may name any address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) }
    }

    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
    #[inline(never)]
    unsafe fn call<T: Task<Self>>(task: T) -> T::Output {
        // SAFETY: the processor has the instructions, with which this function is compiled.
        unsafe { task.run() }
    }

    #[inline(always)]
    unsafe fn entered(F32x8(entry): F32x8, F32x8(exit): F32x8) -> u32 {
        // SAFETY: the caller has AVX-512 VL.
        u32::from(unsafe { _mm256_cmp_ps_mask::<_CMP_LE_OQ>(entry, exit) })
    }

    #[inline(always)]
    unsafe fn sort_keys(entry: F32x8, mask: u32, to: *mut u32) {
        // SAFETY: the processor has the instructions, and there is room for eight.
        unsafe {
            let keys = _mm256_maskz_compress_epi32(mask as u8, sort::keys(entry.0));
            _mm256_storeu_si256(to.cast(), sort::descending(keys, mask.count_ones()));
        }
    }

    #[inline(always)]
    unsafe fn compress_keys(entry: F32x8, mask: u32, to: *mut u32) {
        // SAFETY: the processor has the instructions, and there is room for eight.
        unsafe {
            _mm256_storeu_si256(
                to.cast(),
                _mm256_maskz_compress_epi32(mask as u8, sort::keys(entry.0)),
            )
        }
    }

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending) {
        // SAFETY: the processor has the instructions, and there is room for eight.
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
    unsafe fn sort(node: &WideNode, F32x8(entry): F32x8, mask: u32, to: *mut Pending) -> Child {
        // SAFETY: this instruction set includes AVX2; there is room for eight.
        unsafe {
            let keys = sort::keys(entry);
            let others = _mm256_set1_epi32(-1);
            // The nearest child first: a traversal waits for it, and not for the rest of the work.
            let nearest = sort::nearest(node, _mm256_mask_mov_epi32(others, mask as u8, keys));
            let keys = _mm256_maskz_compress_epi32(mask as u8, keys);
            sort::write(node, keys, mask.count_ones(), to);
            nearest
        }
    }
}
