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

/// Functions that are one expression each.
macro_rules! functions {
    ($($(#[$doc:meta])* fn $name:ident($($a:ident: $of:ty),*) -> $result:ty = $value:expr;)*) => {$(
        $(#[$doc])*
        #[inline(always)]
        pub(super) unsafe fn $name($($a: $of),*) -> $result {
            // SAFETY: the target has NEON; all registers are 128 bits, any of which are a value.
            unsafe { $value }
        }
    )*};
}

functions! {
    fn and(a: Single, b: Single) -> Single = transmute(vandq_u32(transmute(a), transmute(b)));
    fn and_double(a: Double, b: Double) -> Double = transmute(vandq_u64(transmute(a), transmute(b)));
    fn or(a: Single, b: Single) -> Single = transmute(vorrq_u32(transmute(a), transmute(b)));
    fn xor(a: Single, b: Single) -> Single = transmute(veorq_u32(transmute(a), transmute(b)));
    fn below(a: Single, b: Single) -> Single = transmute(vcltq_u32(transmute(a), transmute(b)));
    fn lt(a: Single, b: Single) -> Single = transmute(vcltq_f32(a, b));
    fn le(a: Single, b: Single) -> Single = transmute(vcleq_f32(a, b));
    fn eq(a: Single, b: Single) -> Single = transmute(vceqq_f32(a, b));
    fn lt_double(a: Double, b: Double) -> Double = transmute(vcltq_f64(a, b));
    fn le_double(a: Double, b: Double) -> Double = transmute(vcleq_f64(a, b));
    fn eq_double(a: Double, b: Double) -> Double = transmute(vceqq_f64(a, b));
    fn select(yes: Single, no: Single, mask: Single) -> Single = vbslq_f32(transmute(mask), yes, no);
    fn select_double(yes: Double, no: Double, mask: Double) -> Double =
        vbslq_f64(transmute(mask), yes, no);
    /// The mask of 64 bits whose halves are masks of 32 bits.
    fn widen(mask: Single) -> Double = transmute(mask);
    fn mul_add(a: Single, b: Single, c: Single) -> Single = vfmaq_f32(c, a, b);
    fn swap_twos(a: Single) -> Single = vextq_f32::<2>(a, a);
    /// Returns a bit per lane whose sign is set.
    fn signs(a: Single) -> u32 = {
        let signs = vshrq_n_u32::<31>(transmute(a));
        vaddvq_u32(vshlq_u32(signs, transmute([0, 1, 2, 3])))
    };
    fn double_low(a: Single) -> Double = vcvt_f64_f32(vget_low_f32(a));
    /// The numbers of two registers, rounded.
    fn single(low: Double, high: Double) -> Single = vcvt_high_f32_f64(vcvt_f32_f64(low), high);
    /// The mask of four numbers from the masks of two and two.
    fn narrow(low: Double, high: Double) -> Single =
        transmute(vcombine_u32(vmovn_u64(transmute(low)), vmovn_u64(transmute(high))));
}
