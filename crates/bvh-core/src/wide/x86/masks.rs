//! Sets of lanes of AVX2 and AVX-512 as [`Mask`].
//!
//! Every call of an instruction here is safe because a value of these types exists only where the
//! processor has the instructions, and because the function that makes one out of nothing is
//! unsafe.
#![allow(clippy::undocumented_unsafe_blocks)]

use crate::wide::lanes::Mask;
use core::arch::x86_64::*;

/// Four lanes: all bits of a lane, or none.
#[derive(Clone, Copy)]
pub(crate) struct Mask4(pub(super) __m128);

/// Eight lanes.
#[derive(Clone, Copy)]
pub(crate) struct Mask8(pub(super) __m256);

/// Four lanes of f64.
#[derive(Clone, Copy)]
pub(crate) struct WideMask4(pub(super) __m256d);

impl Mask for Mask4 {
    #[inline(always)]
    fn bits(self) -> u32 {
        unsafe { _mm_movemask_ps(self.0) as u32 }
    }
    #[inline(always)]
    unsafe fn from_bits(bits: u32) -> Self {
        unsafe {
            let lanes = _mm_setr_epi32(1, 2, 4, 8);
            let set = _mm_and_si128(_mm_set1_epi32(bits as i32), lanes);
            Self(_mm_castsi128_ps(_mm_cmpeq_epi32(set, lanes)))
        }
    }
    #[inline(always)]
    fn and_not(self, other: Self) -> Self {
        unsafe { Self(_mm_andnot_ps(other.0, self.0)) }
    }
}

impl Mask for Mask8 {
    #[inline(always)]
    fn bits(self) -> u32 {
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
    #[inline(always)]
    unsafe fn from_bits(bits: u32) -> Self {
        unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes);
            Self(_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lanes)))
        }
    }
    #[inline(always)]
    fn and_not(self, other: Self) -> Self {
        unsafe { Self(_mm256_andnot_ps(other.0, self.0)) }
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
    #[inline(always)]
    fn and_not(self, other: Self) -> Self {
        self & !other
    }
}
