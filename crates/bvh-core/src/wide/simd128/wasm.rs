//! Registers of WebAssembly's SIMD128, by the names that [`lanes`](super::lanes) uses. Masks are
//! registers whose lanes have all bits or none.

use core::arch::wasm32::*;

pub(super) use core::arch::wasm32::{
    f32x4_add as add, f32x4_div as divide, f32x4_eq as eq, f32x4_le as le, f32x4_lt as lt,
    f32x4_mul as multiply, f32x4_splat as splat, f32x4_sub as subtract, f64x2_add as add_double,
    f64x2_div as divide_double, f64x2_eq as eq_double, f64x2_le as le_double,
    f64x2_lt as lt_double, f64x2_mul as multiply_double, f64x2_promote_low_f32x4 as double_low,
    f64x2_splat as splat_double, f64x2_sub as subtract_double, u32x4_lt as below, v128 as Single,
    v128 as Double, v128_and as and, v128_and as and_double, v128_bitselect as select,
    v128_bitselect as select_double, v128_or as or, v128_xor as xor,
};

/// Functions that are one expression each.
macro_rules! functions {
    ($($(#[$doc:meta])* fn $name:ident($($a:ident: $of:ty),*) -> $result:ty = $value:expr;)*) => {$(
        $(#[$doc])*
        #[inline(always)]
        pub(super) unsafe fn $name($($a: $of),*) -> $result {
            // SAFETY: places have as many numbers as the register; their instructions accept any
            // alignment, and all others are safe.
            #[allow(unused_unsafe)]
            unsafe {
                $value
            }
        }
    )*};
}

functions! {
    fn load(from: *const f32) -> v128 = v128_load(from.cast());
    fn load_double(from: *const f64) -> v128 = v128_load(from.cast());
    fn store(to: *mut f32, a: v128) -> () = v128_store(to.cast(), a);
    fn store_double(to: *mut f64, a: v128) -> () = v128_store(to.cast(), a);
    /// The mask of 64 bits whose halves are masks of 32 bits.
    fn widen(mask: v128) -> v128 = mask;
    /// Rounded twice: there is no fused operation.
    fn mul_add(a: v128, b: v128, c: v128) -> v128 = f32x4_add(f32x4_mul(a, b), c);
    fn interleave_low(a: v128, b: v128) -> v128 = i32x4_shuffle::<0, 4, 1, 5>(a, b);
    fn interleave_high(a: v128, b: v128) -> v128 = i32x4_shuffle::<2, 6, 3, 7>(a, b);
    fn swap_twos(a: v128) -> v128 = i32x4_shuffle::<2, 3, 0, 1>(a, a);
    fn swap_ones(a: v128) -> v128 = i32x4_shuffle::<1, 0, 3, 2>(a, a);
    /// Returns a bit per lane whose sign is set.
    fn signs(a: v128) -> u32 = u32::from(i32x4_bitmask(a));
    fn double_high(a: v128) -> v128 = f64x2_promote_low_f32x4(swap_twos(a));
    /// The numbers of two registers, rounded.
    fn single(low: v128, high: v128) -> v128 =
        i32x4_shuffle::<0, 1, 4, 5>(f32x4_demote_f64x2_zero(low), f32x4_demote_f64x2_zero(high));
    /// The mask of four numbers from the masks of two and two.
    fn narrow(low: v128, high: v128) -> v128 = i32x4_shuffle::<0, 2, 4, 6>(low, high);
}
