//! Four numbers to a register of 128 bits, in one register or two, as [`Lanes`].
//!
//! Every instruction here is safe to call, since the module is compiled only for targets that have
//! all of them.
#![allow(clippy::undocumented_unsafe_blocks, unused_unsafe)]

use super::registers::*;
use crate::wide::lanes::{DoubleLanes, Lanes, Mask, functions};
use core::array::from_fn;
use core::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Sub};

/// Numbers in `R` registers, or a set of lanes: all bits of a lane, or none.
#[derive(Clone, Copy)]
pub(crate) struct Singles<const R: usize>([Single; R]);

/// One f64 per lane: for each register the lower two and the upper two.
#[derive(Clone, Copy)]
pub(crate) struct Doubles<const R: usize>([[Double; 2]; R]);

/// Operators of registers, an instruction each.
macro_rules! operators {
    ($($operator:ident $function:ident $single:ident $($double:ident)?,)*) => {$(
        impl<const R: usize> $operator for Singles<R> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(from_fn(|i| unsafe { $single(self.0[i], other.0[i]) }))
            }
        }
        $(impl<const R: usize> $operator for Doubles<R> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                self.zip(other, |a, b| unsafe { $double(a, b) })
            }
        })?
    )*};
}

/// Functions of numbers, an expression per register.
macro_rules! by_register {
    ($($name:ident($a:ident $(, $b:ident)*) = $value:expr;)*) => {$(
        #[inline(always)]
        fn $name(self, $($b: Self),*) -> Self {
            Self(from_fn(|i| {
                let $a = self.0[i];
                $(let $b = $b.0[i];)*
                unsafe { $value }
            }))
        }
    )*};
}

operators! {
    Add add add add_double,
    Sub sub subtract subtract_double,
    Mul mul multiply multiply_double,
    Div div divide divide_double,
    BitAnd bitand and and_double,
    BitOr bitor or,
    BitXor bitxor xor,
}

impl<const R: usize> Lanes for Singles<R> {
    const N: usize = 4 * R;
    type Mask = Self;
    type Double = Doubles<R>;

    by_register! {
        min(a, b) = select(a, b, lt(a, b));
        max(a, b) = select(a, b, lt(b, a));
        mul_add(a, b, c) = mul_add(a, b, c);
        lt(a, b) = lt(a, b);
        le(a, b) = le(a, b);
        eq(a, b) = eq(a, b);
        below(a, b) = below(a, b);
    }

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        unsafe { Self([splat(x); R]) }
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        Self(from_fn(|i| unsafe { load(from.add(4 * i)) }))
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        unsafe { self.store_quarters(from_fn(|i| to.wrapping_add(4 * i))) }
    }

    #[inline(always)]
    unsafe fn load_quarters(from: [*const f32; 4]) -> Self {
        Self(from_fn(|i| unsafe { load(from[i]) }))
    }

    #[inline(always)]
    unsafe fn store_quarters(self, to: [*mut f32; 4]) {
        for (to, register) in to.into_iter().zip(self.0) {
            unsafe { store(to, register) };
        }
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        let four = self.0.map(|register| Singles([register]));
        let four = four.into_iter().fold(four[0], Lanes::max);
        let two = four.max(Singles([unsafe { swap_twos(four.0[0]) }]));
        let one = two.max(Singles([unsafe { swap_ones(two.0[0]) }]));
        let mut greatest = [0.0; 4];
        unsafe { one.store(greatest.as_mut_ptr()) };
        greatest[0]
    }

    functions! {
        fn signs(self) -> u32 = (0..R).fold(0, |bits, i| bits | signs(self.0[i]) << (4 * i));
        fn select(mask: Self, yes: Self, no: Self) -> Self =
            Self(from_fn(|i| select(yes.0[i], no.0[i], mask.0[i])));
        fn double(self) -> Doubles<R> = Doubles(self.0.map(|a| [double_low(a), double_high(a)]));
        fn single(double: Doubles<R>) -> Self =
            Self(double.0.map(|[low, high]| single(low, high)));
        // Masks of f64 are narrow from the beginning.
        fn narrow(mask: Self) -> Self = mask;
        fn transpose_quarters([a, b, c, d]: [Self; 4]) -> [Self; 4] = {
            let ac = a.interleaved(c);
            let bd = b.interleaved(d);
            let [first, second] = ac[0].interleaved(bd[0]);
            let [third, fourth] = ac[1].interleaved(bd[1]);
            [first, second, third, fourth]
        };
    }

    #[inline(always)]
    fn spread<const LANE: usize>(self) -> Self {
        let pairs = self.interleaved(self)[LANE / 2];
        pairs.interleaved(pairs)[LANE % 2]
    }
}

impl<const R: usize> Singles<R> {
    /// Returns the lower halves of every quarter of both in turn, and the upper halves.
    #[inline(always)]
    fn interleaved(self, other: Self) -> [Self; 2] {
        [
            Self(from_fn(|i| unsafe { interleave_low(self.0[i], other.0[i]) })),
            Self(from_fn(|i| unsafe { interleave_high(self.0[i], other.0[i]) })),
        ]
    }
}

impl<const R: usize> Mask for Singles<R> {
    functions! {
        fn bits(self) -> u32 = self.signs();
    }

    #[inline(always)]
    unsafe fn from_bits(bits: u32) -> Self {
        let lanes: [f32; 16] = from_fn(|lane| f32::from_bits(bits & 1 << lane));
        unsafe { Self::splat(0.0).below(Self::load(lanes.as_ptr())) }
    }
}

impl<const R: usize> Doubles<R> {
    #[inline(always)]
    fn zip(self, other: Self, function: impl Fn(Double, Double) -> Double) -> Self {
        Self(from_fn(|i| from_fn(|half| function(self.0[i][half], other.0[i][half]))))
    }

    /// A half of every lane.
    #[inline(always)]
    fn narrowed(self) -> Singles<R> {
        Singles(self.0.map(|[low, high]| unsafe { narrow(low, high) }))
    }
}

impl<const R: usize> DoubleLanes for Doubles<R> {
    type Mask = Singles<R>;

    #[inline(always)]
    unsafe fn splat(x: f64) -> Self {
        unsafe { Self([[splat_double(x); 2]; R]) }
    }

    #[inline(always)]
    unsafe fn load(from: *const f64) -> Self {
        let at = |i: usize, half: usize| unsafe { load_double(from.add(4 * i + 2 * half)) };
        Self(from_fn(|i| from_fn(|half| at(i, half))))
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f64) {
        for (i, half) in self.0.as_flattened().iter().enumerate() {
            unsafe { store_double(to.add(2 * i), *half) };
        }
    }

    functions! {
        // By Dekker, since products are not fused.
        fn two_product(self, other: Self) -> (Self, Self) = {
            let split = |x: Self| {
                let scaled = x.filled(((1_u64 << 27) + 1) as f64) * x;
                let high = scaled - (scaled - x);
                (high, x - high)
            };
            let product = self * other;
            let (a, a_low) = split(self);
            let (b, b_low) = split(other);
            (product, a * b - product + a * b_low + a_low * b + a_low * b_low)
        };
        fn select(mask: Singles<R>, yes: Self, no: Self) -> Self = {
            // Twice the mask of 32 bits is the mask of 64.
            let [low, high] = mask.interleaved(mask);
            Self(from_fn(|i| {
                [
                    select_double(yes.0[i][0], no.0[i][0], widen(low.0[i])),
                    select_double(yes.0[i][1], no.0[i][1], widen(high.0[i])),
                ]
            }))
        };
        fn min(self, b: Self) -> Self = self.zip(b, |a, b| select_double(a, b, lt_double(a, b)));
        fn max(self, b: Self) -> Self = self.zip(b, |a, b| select_double(a, b, lt_double(b, a)));
        fn mul_add(self, factor: Self, term: Self) -> Self = self * factor + term;
        fn mul_sub(self, factor: Self, term: Self) -> Self = self * factor - term;
        fn lt(self, b: Self) -> Singles<R> = self.zip(b, |a, b| lt_double(a, b)).narrowed();
        fn le(self, b: Self) -> Singles<R> = self.zip(b, |a, b| le_double(a, b)).narrowed();
        fn eq(self, b: Self) -> Singles<R> = self.zip(b, |a, b| eq_double(a, b)).narrowed();
    }
}
