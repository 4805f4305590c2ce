//! The instruction sets of x86-64: eight boxes at once with fused multiply-add, and entered children
//! sorted without a branch.

mod lanes;
mod sort;

use super::instructions::{Instructions, Pending, Task, last_pending};
use super::layout::{Child, WideNode};
use crate::Kernel;
use core::arch::x86_64::*;
use lanes::{F32x4, F32x8, F32x16};

/// Returns whether this processor can run a kernel.
pub(super) fn has(kernel: Kernel) -> bool {
    let has_avx2 = is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("lzcnt");
    let has_avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw");
    match kernel {
        Kernel::Avx2 => has_avx2,
        Kernel::Avx512 => has_avx2 && has_avx512,
        _ => false,
    }
}

/// Runs a task with the instructions of a kernel.
///
/// # Safety
/// [`has`] returns true for the kernel.
#[inline(always)]
pub(super) unsafe fn dispatch<T, O>(kernel: Kernel, task: T) -> O
where
    T: Task<Avx2, Output = O> + Task<Avx512, Output = O>,
{
    // SAFETY: the processor has the instructions of the kernel.
    unsafe {
        match kernel {
            Kernel::Avx512 => Avx512::call(task),
            _ => Avx2::call(task),
        }
    }
}

/// The function that a task is called in. It is the task's own and not the instruction set's, so that
/// the compiler builds tasks of different files side by side, and not all of a set in one piece.
trait Entry<K: Instructions>: Task<K> {
    unsafe fn enter(self) -> Self::Output;
}

macro_rules! entry {
    ($set:ident, $features:tt) => {
        impl<T: Task<$set>> Entry<$set> for T {
            #[target_feature(enable = $features)]
            #[inline(never)]
            unsafe fn enter(self) -> T::Output {
                // SAFETY: the processor has the instructions, with which this function is compiled.
                unsafe { self.run() }
            }
        }
    };
}

entry!(Avx2, "avx2,fma,bmi1,bmi2,popcnt,lzcnt");
entry!(Avx512, "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt");

/// The functions that both instruction sets have in common. `$compress` moves the lanes of a mask to
/// the front. If all others are 0, zeros follow.
macro_rules! shared {
    ($compress:ident) => {
        #[inline(always)]
        unsafe fn prefetch(line: *const u8) {
            // SAFETY: a prefetch may name any address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) }
        }

        #[inline(always)]
        unsafe fn call<T: Task<Self>>(task: T) -> T::Output {
            // SAFETY: the processor has the instructions.
            unsafe { Entry::<Self>::enter(task) }
        }

        #[inline(always)]
        unsafe fn sort_keys(F32x8(keys): F32x8, mask: u32, to: *mut u32) {
            // SAFETY: the processor has the instructions, and there is room for eight.
            unsafe {
                let keys = $compress(_mm256_castps_si256(keys), mask);
                _mm256_storeu_si256(to.cast(), sort::descending(keys, mask.count_ones()));
            }
        }

        #[inline(always)]
        unsafe fn compress_keys(F32x8(keys): F32x8, mask: u32, to: *mut u32) {
            // SAFETY: the processor has the instructions, and there is room for eight.
            unsafe {
                _mm256_storeu_si256(to.cast(), $compress(_mm256_castps_si256(keys), mask));
            }
        }

        #[inline(always)]
        unsafe fn sort(node: &WideNode, F32x8(keys): F32x8, mask: u32, to: *mut Pending) -> Child {
            // SAFETY: the processor has the instructions, and there is room for eight.
            unsafe {
                let keys = _mm256_castps_si256(keys);
                // The nearest child first: a traversal waits for it, and not for the rest.
                let nearest = sort::nearest(node, keys);
                sort::write(node, $compress(keys, mask), mask.count_ones(), to);
                nearest
            }
        }
    };
}

/// AVX2 with fused multiply-add.
pub(super) struct Avx2;

impl Instructions for Avx2 {
    type Boxes = F32x8;
    type Block = F32x4;
    type Rays = F32x8;

    shared!(permuted);

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending) {
        // SAFETY: the processor has the instructions, and there is room for eight.
        unsafe {
            let children = permuted(_mm256_load_si256(node.children.as_ptr().cast()), mask);
            let to = to.cast::<__m256i>();
            _mm256_storeu_si256(to, _mm256_cvtepu32_epi64(_mm256_castsi256_si128(children)));
            _mm256_storeu_si256(
                to.add(1),
                _mm256_cvtepu32_epi64(_mm256_extracti128_si256::<1>(children)),
            );
        }
    }
}

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

/// The entered lanes moved to the front, one of the others behind them.
#[inline(always)]
unsafe fn permuted(lanes: __m256i, mask: u32) -> __m256i {
    // SAFETY: the caller has AVX2.
    unsafe {
        let order = _mm_loadl_epi64(LANES_OF[mask as usize & 255].as_ptr().cast());
        _mm256_permutevar8x32_epi32(lanes, _mm256_cvtepu8_epi32(order))
    }
}

/// AVX-512: entered children are compressed into place.
pub(super) struct Avx512;

impl Instructions for Avx512 {
    type Boxes = F32x8;
    type Block = F32x4;
    type Rays = F32x16;

    shared!(compressed);

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending) {
        // SAFETY: the processor has the instructions, and there is room for eight.
        unsafe {
            let children = compressed(_mm256_load_si256(node.children.as_ptr().cast()), mask);
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
unsafe fn compressed(lanes: __m256i, mask: u32) -> __m256i {
    // SAFETY: the caller has AVX-512 VL.
    unsafe { _mm256_maskz_compress_epi32(mask as u8, lanes) }
}
