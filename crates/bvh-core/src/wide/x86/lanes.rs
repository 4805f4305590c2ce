//! Registers of AVX2 and AVX-512 as [`Lanes`].
//!
//! Why every call of an instruction here is safe: a value of these types exists only where the
//! processor has the instructions, and what makes one out of nothing is unsafe for its caller.

#![allow(clippy::undocumented_unsafe_blocks)]

use crate::wide::lanes::{DoubleLanes, Lanes, Mask, functions};
use core::arch::x86_64::*;
use core::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Sub};

/// Operators of a register, each one instruction.
macro_rules! operators {
    ($name:ident: $($operator:ident $function:ident $instruction:ident),*) => {$(
        impl $operator for $name {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                unsafe { Self($instruction(self.0, other.0)) }
            }
        }
    )*};
}

/// Loads and stores of a register, and the fill of all its lanes.
macro_rules! memory {
    ($number:ident: $splat:ident $load:ident $store:ident) => {
        #[inline(always)]
        unsafe fn splat(x: $number) -> Self {
            unsafe { Self($splat(x)) }
        }
        #[inline(always)]
        unsafe fn load(from: *const $number) -> Self {
            unsafe { Self($load(from)) }
        }
        #[inline(always)]
        unsafe fn store(self, to: *mut $number) {
            unsafe { $store(to, self.0) }
        }
    };
}

/// Moves of lanes within quarters of a register.
macro_rules! quarters {
    ($low:ident $high:ident $shuffle:ident $permute:ident) => {
        #[inline(always)]
        fn transpose_quarters([a, b, c, d]: [Self; 4]) -> [Self; 4] {
            unsafe {
                let ab = $low(a.0, b.0);
                let cd = $low(c.0, d.0);
                let ab_high = $high(a.0, b.0);
                let cd_high = $high(c.0, d.0);
                [
                    Self($shuffle::<0b01_00_01_00>(ab, cd)),
                    Self($shuffle::<0b11_10_11_10>(ab, cd)),
                    Self($shuffle::<0b01_00_01_00>(ab_high, cd_high)),
                    Self($shuffle::<0b11_10_11_10>(ab_high, cd_high)),
                ]
            }
        }
        #[inline(always)]
        fn spread<const LANE: usize>(self) -> Self {
            unsafe {
                match LANE {
                    0 => Self($permute::<0b00_00_00_00>(self.0)),
                    1 => Self($permute::<0b01_01_01_01>(self.0)),
                    2 => Self($permute::<0b10_10_10_10>(self.0)),
                    _ => Self($permute::<0b11_11_11_11>(self.0)),
                }
            }
        }
    };
}

/// Four numbers, or a set of lanes: all bits of a lane, or none.
#[derive(Clone, Copy)]
pub(crate) struct F32x4(pub(crate) __m128);

/// Eight numbers, or a set of lanes.
#[derive(Clone, Copy)]
pub(crate) struct F32x8(pub(crate) __m256);

/// Sixteen numbers.
#[derive(Clone, Copy)]
pub(crate) struct F32x16(pub(crate) __m512);

/// Numbers of f64; four of them may be a set of lanes.
#[derive(Clone, Copy)]
pub(crate) struct F64x4(__m256d);
#[derive(Clone, Copy)]
pub(crate) struct F64x8(__m512d);

/// The numbers of two registers.
#[derive(Clone, Copy)]
pub(crate) struct Two<T>(T, T);

operators!(F32x4: Add add _mm_add_ps, Sub sub _mm_sub_ps, Mul mul _mm_mul_ps, Div div _mm_div_ps,
    BitAnd bitand _mm_and_ps, BitOr bitor _mm_or_ps, BitXor bitxor _mm_xor_ps);
operators!(F32x8: Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps,
    BitAnd bitand _mm256_and_ps, BitOr bitor _mm256_or_ps, BitXor bitxor _mm256_xor_ps);
operators!(F32x16: Add add _mm512_add_ps, Sub sub _mm512_sub_ps, Mul mul _mm512_mul_ps, Div div _mm512_div_ps,
    BitAnd bitand _mm512_and_ps, BitOr bitor _mm512_or_ps, BitXor bitxor _mm512_xor_ps);
operators!(F64x4: Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd,
    BitAnd bitand _mm256_and_pd, BitOr bitor _mm256_or_pd);
operators!(F64x8: Add add _mm512_add_pd, Sub sub _mm512_sub_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd,
    BitAnd bitand _mm512_and_pd);

impl Lanes for F32x4 {
    const N: usize = 4;
    type Mask = Self;
    type Double = F64x4;
    memory!(f32: _mm_set1_ps _mm_load_ps _mm_storeu_ps);
    #[inline(always)]
    unsafe fn load_quarters(from: [*const f32; 4]) -> Self {
        unsafe { Self::load(from[0]) }
    }
    #[inline(always)]
    unsafe fn store_quarters(self, to: [*mut f32; 4]) {
        unsafe { self.store(to[0]) }
    }
    quarters!(_mm_unpacklo_ps _mm_unpackhi_ps _mm_shuffle_ps _mm_permute_ps);
    functions! {
        fn min(self, b: Self) -> Self = Self(_mm_min_ps(self.0, b.0));
        fn max(self, b: Self) -> Self = Self(_mm_max_ps(self.0, b.0));
        fn mul_add(self, b: Self, c: Self) -> Self = Self(_mm_fmadd_ps(self.0, b.0, c.0));
        fn mul_sub(self, b: Self, c: Self) -> Self = Self(_mm_fmsub_ps(self.0, b.0, c.0));
        fn lt(self, b: Self) -> Self = Self(_mm_cmp_ps::<_CMP_LT_OQ>(self.0, b.0));
        fn le(self, b: Self) -> Self = Self(_mm_cmp_ps::<_CMP_LE_OQ>(self.0, b.0));
        fn eq(self, b: Self) -> Self = Self(_mm_cmp_ps::<_CMP_EQ_OQ>(self.0, b.0));
        fn signs(self) -> u32 = _mm_movemask_ps(self.0) as u32;
        fn double(self) -> F64x4 = F64x4(_mm256_cvtps_pd(self.0));
        fn greatest(self) -> f32 = {
            let two = _mm_max_ps(self.0, _mm_movehl_ps(self.0, self.0));
            _mm_cvtss_f32(_mm_max_ss(two, _mm_permute_ps::<0b01>(two)))
        };
        fn below(self, b: Self) -> Self = {
            let a = _mm_castps_si128(self.0);
            let b = _mm_castps_si128(b.0);
            let not_below = _mm_cmpeq_epi32(_mm_max_epu32(a, b), a);
            Self(_mm_castsi128_ps(_mm_xor_si128(not_below, _mm_set1_epi32(-1))))
        };
        fn select(mask: Self, yes: Self, no: Self) -> Self = Self(_mm_blendv_ps(no.0, yes.0, mask.0));
        fn single(double: F64x4) -> Self = Self(_mm256_cvtpd_ps(double.0));
        fn narrow(mask: F64x4) -> Self = {
            let mask = _mm256_castpd_ps(mask.0);
            let high = _mm256_extractf128_ps::<1>(mask);
            Self(_mm_shuffle_ps::<0b10_00_10_00>(_mm256_castps256_ps128(mask), high))
        };
    }
}

impl Lanes for F32x8 {
    const N: usize = 8;
    type Mask = Self;
    type Double = Two<F64x4>;
    memory!(f32: _mm256_set1_ps _mm256_load_ps _mm256_storeu_ps);
    #[inline(always)]
    unsafe fn load_quarters(from: [*const f32; 4]) -> Self {
        unsafe { Self(_mm256_setr_m128(_mm_load_ps(from[0]), _mm_load_ps(from[1]))) }
    }
    #[inline(always)]
    unsafe fn store_quarters(self, to: [*mut f32; 4]) {
        unsafe {
            _mm_store_ps(to[0], _mm256_castps256_ps128(self.0));
            _mm_store_ps(to[1], _mm256_extractf128_ps::<1>(self.0));
        }
    }
    quarters!(_mm256_unpacklo_ps _mm256_unpackhi_ps _mm256_shuffle_ps _mm256_permute_ps);
    functions! {
        fn min(self, b: Self) -> Self = Self(_mm256_min_ps(self.0, b.0));
        fn max(self, b: Self) -> Self = Self(_mm256_max_ps(self.0, b.0));
        fn mul_add(self, b: Self, c: Self) -> Self = Self(_mm256_fmadd_ps(self.0, b.0, c.0));
        fn mul_sub(self, b: Self, c: Self) -> Self = Self(_mm256_fmsub_ps(self.0, b.0, c.0));
        fn lt(self, b: Self) -> Self = Self(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, b.0));
        fn le(self, b: Self) -> Self = Self(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, b.0));
        fn eq(self, b: Self) -> Self = Self(_mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, b.0));
        fn signs(self) -> u32 = _mm256_movemask_ps(self.0) as u32;
        fn greatest(self) -> f32 =
            F32x4(_mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0))).greatest();
        fn double(self) -> Two<F64x4> = Two(
            F64x4(_mm256_cvtps_pd(_mm256_castps256_ps128(self.0))),
            F64x4(_mm256_cvtps_pd(_mm256_extractf128_ps::<1>(self.0))),
        );
        fn below(self, b: Self) -> Self = {
            let a = _mm256_castps_si256(self.0);
            let b = _mm256_castps_si256(b.0);
            let not_below = _mm256_cmpeq_epi32(_mm256_max_epu32(a, b), a);
            Self(_mm256_castsi256_ps(_mm256_xor_si256(not_below, _mm256_set1_epi32(-1))))
        };
        fn select(mask: Self, yes: Self, no: Self) -> Self =
            Self(_mm256_blendv_ps(no.0, yes.0, mask.0));
        fn single(Two(low, high): Two<F64x4>) -> Self =
            Self(_mm256_setr_m128(_mm256_cvtpd_ps(low.0), _mm256_cvtpd_ps(high.0)));
        fn narrow(Two(low, high): Two<F64x4>) -> Self =
            Self(_mm256_setr_m128(F32x4::narrow(low).0, F32x4::narrow(high).0));
    }
}

impl Lanes for F32x16 {
    const N: usize = 16;
    type Mask = u16;
    type Double = Two<F64x8>;
    memory!(f32: _mm512_set1_ps _mm512_load_ps _mm512_storeu_ps);
    #[inline(always)]
    unsafe fn load_quarters(from: [*const f32; 4]) -> Self {
        unsafe {
            let low = _mm256_setr_m128(_mm_load_ps(from[0]), _mm_load_ps(from[1]));
            let high = _mm256_setr_m128(_mm_load_ps(from[2]), _mm_load_ps(from[3]));
            Self(_mm512_insertf32x8::<1>(_mm512_castps256_ps512(low), high))
        }
    }
    #[inline(always)]
    unsafe fn store_quarters(self, to: [*mut f32; 4]) {
        unsafe {
            _mm_store_ps(to[0], _mm512_castps512_ps128(self.0));
            _mm_store_ps(to[1], _mm512_extractf32x4_ps::<1>(self.0));
            _mm_store_ps(to[2], _mm512_extractf32x4_ps::<2>(self.0));
            _mm_store_ps(to[3], _mm512_extractf32x4_ps::<3>(self.0));
        }
    }
    quarters!(_mm512_unpacklo_ps _mm512_unpackhi_ps _mm512_shuffle_ps _mm512_permute_ps);
    functions! {
        fn min(self, b: Self) -> Self = Self(_mm512_min_ps(self.0, b.0));
        fn max(self, b: Self) -> Self = Self(_mm512_max_ps(self.0, b.0));
        fn mul_add(self, b: Self, c: Self) -> Self = Self(_mm512_fmadd_ps(self.0, b.0, c.0));
        fn mul_sub(self, b: Self, c: Self) -> Self = Self(_mm512_fmsub_ps(self.0, b.0, c.0));
        fn lt(self, b: Self) -> u16 = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, b.0);
        fn le(self, b: Self) -> u16 = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, b.0);
        fn eq(self, b: Self) -> u16 = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, b.0);
        fn signs(self) -> u32 = u32::from(_mm512_movepi32_mask(_mm512_castps_si512(self.0)));
        fn greatest(self) -> f32 =
            F32x8(_mm256_max_ps(_mm512_castps512_ps256(self.0), _mm512_extractf32x8_ps::<1>(self.0))).greatest();
        fn double(self) -> Two<F64x8> = Two(
            F64x8(_mm512_cvtps_pd(_mm512_castps512_ps256(self.0))),
            F64x8(_mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(self.0))),
        );
        fn below(self, b: Self) -> u16 =
            _mm512_cmplt_epu32_mask(_mm512_castps_si512(self.0), _mm512_castps_si512(b.0));
        fn select(mask: u16, yes: Self, no: Self) -> Self = Self(_mm512_mask_mov_ps(no.0, mask, yes.0));
        fn single(Two(low, high): Two<F64x8>) -> Self = {
            let low = _mm512_castps256_ps512(_mm512_cvtpd_ps(low.0));
            Self(_mm512_insertf32x8::<1>(low, _mm512_cvtpd_ps(high.0)))
        };
        fn narrow(Two(low, high): Two<u8>) -> u16 = u16::from_le_bytes([low, high]);
    }
}

impl DoubleLanes for F64x4 {
    type Mask = Self;
    memory!(f64: _mm256_set1_pd _mm256_loadu_pd _mm256_storeu_pd);
    #[inline(always)]
    unsafe fn load_twos(from: &[*const f64]) -> [Self; 2] {
        unsafe {
            let even = _mm256_loadu2_m128d(from[2], from[0]);
            let odd = _mm256_loadu2_m128d(from[3], from[1]);
            [Self(_mm256_unpacklo_pd(even, odd)), Self(_mm256_unpackhi_pd(even, odd))]
        }
    }
    functions! {
        fn min(self, b: Self) -> Self = Self(_mm256_min_pd(self.0, b.0));
        fn max(self, b: Self) -> Self = Self(_mm256_max_pd(self.0, b.0));
        fn mul_add(self, b: Self, c: Self) -> Self = Self(_mm256_fmadd_pd(self.0, b.0, c.0));
        fn mul_sub(self, b: Self, c: Self) -> Self = Self(_mm256_fmsub_pd(self.0, b.0, c.0));
        fn lt(self, b: Self) -> Self = Self(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, b.0));
        fn le(self, b: Self) -> Self = Self(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, b.0));
        fn eq(self, b: Self) -> Self = Self(_mm256_cmp_pd::<_CMP_EQ_OQ>(self.0, b.0));
        fn select(mask: Self, yes: Self, no: Self) -> Self =
            Self(_mm256_blendv_pd(no.0, yes.0, mask.0));
    }
}

impl DoubleLanes for F64x8 {
    type Mask = u8;
    memory!(f64: _mm512_set1_pd _mm512_loadu_pd _mm512_storeu_pd);
    /// Two steps of Newton's method, which take half the time of a division. Of 0 and ∞ they make
    /// NaN, which no comparison accepts.
    #[inline(always)]
    fn inverse(self) -> Self {
        unsafe {
            let one = _mm512_set1_pd(1.0);
            let x = _mm512_rcp14_pd(self.0);
            let x = _mm512_fmadd_pd(_mm512_fnmadd_pd(self.0, x, one), x, x);
            Self(_mm512_fmadd_pd(_mm512_fnmadd_pd(self.0, x, one), x, x))
        }
    }
    #[inline(always)]
    unsafe fn load_twos(from: &[*const f64]) -> [Self; 2] {
        unsafe {
            let Two([first, second], [third, fourth]) = load_halves::<F64x4>(from);
            [Self(joined(first, third)), Self(joined(second, fourth))]
        }
    }
    functions! {
        fn min(self, b: Self) -> Self = Self(_mm512_min_pd(self.0, b.0));
        fn max(self, b: Self) -> Self = Self(_mm512_max_pd(self.0, b.0));
        fn mul_add(self, b: Self, c: Self) -> Self = Self(_mm512_fmadd_pd(self.0, b.0, c.0));
        fn mul_sub(self, b: Self, c: Self) -> Self = Self(_mm512_fmsub_pd(self.0, b.0, c.0));
        fn lt(self, b: Self) -> u8 = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, b.0);
        fn le(self, b: Self) -> u8 = _mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, b.0);
        fn eq(self, b: Self) -> u8 = _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(self.0, b.0);
        fn select(mask: u8, yes: Self, no: Self) -> Self = Self(_mm512_mask_mov_pd(no.0, mask, yes.0));
    }
}

/// Operators of both halves.
macro_rules! of_halves {
    ($($operator:ident $function:ident),*) => {$(
        impl<T: $operator<Output = T>> $operator for Two<T> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(self.0.$function(other.0), self.1.$function(other.1))
            }
        }
    )*};
}

/// Two numbers from each of as many places as two registers have lanes.
#[inline(always)]
unsafe fn load_halves<T: DoubleLanes>(from: &[*const f64]) -> Two<[T; 2]> {
    let lanes = size_of::<T>() / size_of::<f64>();
    unsafe { Two(T::load_twos(from), T::load_twos(&from[lanes..])) }
}

#[inline(always)]
unsafe fn joined(low: F64x4, high: F64x4) -> __m512d {
    unsafe { _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(low.0), high.0) }
}

of_halves!(Add add, Sub sub, Mul mul, Div div, BitAnd bitand, BitOr bitor);

impl<T: DoubleLanes> DoubleLanes for Two<T> {
    type Mask = Two<T::Mask>;
    #[inline(always)]
    unsafe fn splat(x: f64) -> Self {
        unsafe { Self(T::splat(x), T::splat(x)) }
    }
    #[inline(always)]
    unsafe fn load(from: *const f64) -> Self {
        unsafe { Self(T::load(from), T::load(from.cast::<T>().add(1).cast())) }
    }
    #[inline(always)]
    unsafe fn load_twos(from: &[*const f64]) -> [Self; 2] {
        let Two([first, second], [third, fourth]) = unsafe { load_halves::<T>(from) };
        [Self(first, third), Self(second, fourth)]
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f64) {
        unsafe {
            self.0.store(to);
            self.1.store(to.cast::<T>().add(1).cast());
        }
    }
    functions! {
        fn min(self, b: Self) -> Self = Self(self.0.min(b.0), self.1.min(b.1));
        fn max(self, b: Self) -> Self = Self(self.0.max(b.0), self.1.max(b.1));
        fn mul_add(self, b: Self, c: Self) -> Self = Self(self.0.mul_add(b.0, c.0), self.1.mul_add(b.1, c.1));
        fn mul_sub(self, b: Self, c: Self) -> Self = Self(self.0.mul_sub(b.0, c.0), self.1.mul_sub(b.1, c.1));
        fn lt(self, b: Self) -> Self::Mask = Two(self.0.lt(b.0), self.1.lt(b.1));
        fn le(self, b: Self) -> Self::Mask = Two(self.0.le(b.0), self.1.le(b.1));
        fn eq(self, b: Self) -> Self::Mask = Two(self.0.eq(b.0), self.1.eq(b.1));
        fn inverse(self) -> Self = Self(self.0.inverse(), self.1.inverse());
        fn select(mask: Self::Mask, yes: Self, no: Self) -> Self =
            Self(T::select(mask.0, yes.0, no.0), T::select(mask.1, yes.1, no.1));
    }
}

impl Mask for F32x4 {
    functions! {
        fn bits(self) -> u32 = self.signs();
    }
    #[inline(always)]
    unsafe fn from_bits(bits: u32) -> Self {
        unsafe {
            let lanes = _mm_setr_epi32(1, 2, 4, 8);
            let set = _mm_and_si128(_mm_set1_epi32(bits as i32), lanes);
            Self(_mm_castsi128_ps(_mm_cmpeq_epi32(set, lanes)))
        }
    }
}

impl Mask for F32x8 {
    functions! {
        fn bits(self) -> u32 = self.signs();
    }
    #[inline(always)]
    unsafe fn from_bits(bits: u32) -> Self {
        unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes);
            Self(_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lanes)))
        }
    }
}

impl Mask for u16 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
    #[inline(always)]
    unsafe fn from_bits(bits: u32) -> Self {
        bits as Self
    }
}
