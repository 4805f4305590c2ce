//! Registers of NEON, by the names that [`lanes`](super::lanes) uses. Masks are registers of
//! numbers whose lanes have all bits or none.
// Instructions name the types between which registers are transmuted.
#![allow(clippy::missing_transmute_annotations, clippy::useless_transmute)]

use core::arch::aarch64::*;
use core::mem::transmute;

pub(super) use core::arch::aarch64::{
    float32x4_t as Single, float64x2_t as Double, vaddq_f32 as add, vaddq_f64 as add_double,
    vcvt_high_f64_f32 as double_high, vdivq_f32 as divide, vdivq_f64 as divide_double,
    vdupq_n_f32 as splat, vdupq_n_f64 as splat_double, vld1q_f32 as load, vld1q_f64 as load_double,
    vmulq_f32 as multiply, vmulq_f64 as multiply_double, vrev64q_f32 as swap_ones,
    vst1q_f32 as store, vst1q_f64 as store_double, vsubq_f32 as subtract,
    vsubq_f64 as subtract_double, vzip1q_f32 as interleave_low, vzip2q_f32 as interleave_high,
};

/// Functions of two registers that are one instruction between other types of registers.
macro_rules! functions {
    ($($name:ident($register:ident) $instruction:ident,)*) => {$(
        #[inline(always)]
        pub(super) unsafe fn $name(a: $register, b: $register) -> $register {
            // SAFETY: the target has NEON; all registers are 128 bits, any of which are a value.
            unsafe { transmute($instruction(transmute(a), transmute(b))) }
        }
    )*};
}

functions! {
    and(Single) vandq_u32,
    and_double(Double) vandq_u64,
    or(Single) vorrq_u32,
    xor(Single) veorq_u32,
    lt(Single) vcltq_f32,
    le(Single) vcleq_f32,
    eq(Single) vceqq_f32,
    below(Single) vcltq_u32,
    lt_double(Double) vcltq_f64,
    le_double(Double) vcleq_f64,
    eq_double(Double) vceqq_f64,
}

// SAFETY, below: the target has NEON; all registers are 128 bits, any of which are a value.

#[inline(always)]
pub(super) unsafe fn select(yes: Single, no: Single, mask: Single) -> Single {
    // SAFETY: as above.
    unsafe { vbslq_f32(transmute(mask), yes, no) }
}

#[inline(always)]
pub(super) unsafe fn select_double(yes: Double, no: Double, mask: Double) -> Double {
    // SAFETY: as above.
    unsafe { vbslq_f64(transmute(mask), yes, no) }
}

/// The mask of 64 bits whose halves are masks of 32 bits.
#[inline(always)]
pub(super) unsafe fn widen(mask: Single) -> Double {
    // SAFETY: as above.
    unsafe { transmute(mask) }
}

#[inline(always)]
pub(super) unsafe fn mul_add(a: Single, b: Single, c: Single) -> Single {
    // SAFETY: as above.
    unsafe { vfmaq_f32(c, a, b) }
}

#[inline(always)]
pub(super) unsafe fn swap_twos(a: Single) -> Single {
    // SAFETY: as above.
    unsafe { vextq_f32::<2>(a, a) }
}

/// Returns a bit per lane whose sign is set.
#[inline(always)]
pub(super) unsafe fn signs(a: Single) -> u32 {
    // SAFETY: as above.
    unsafe {
        let signs = vshrq_n_u32::<31>(transmute(a));
        vaddvq_u32(vshlq_u32(signs, transmute([0, 1, 2, 3])))
    }
}

#[inline(always)]
pub(super) unsafe fn double_low(a: Single) -> Double {
    // SAFETY: as above.
    unsafe { vcvt_f64_f32(vget_low_f32(a)) }
}

/// The numbers of two registers, rounded.
#[inline(always)]
pub(super) unsafe fn single(low: Double, high: Double) -> Single {
    // SAFETY: as above.
    unsafe { vcvt_high_f32_f64(vcvt_f32_f64(low), high) }
}

/// The mask of four numbers from the masks of two and two.
#[inline(always)]
pub(super) unsafe fn narrow(low: Double, high: Double) -> Single {
    // SAFETY: as above.
    unsafe { transmute(vcombine_u32(vmovn_u64(transmute(low)), vmovn_u64(transmute(high)))) }
}
