//! The AVX2 kernel: eight boxes at once with fused multiply-add, entered children sorted without a branch.

use super::box_ray::BoxRay;
use super::one_ray::{Instructions, Pending, any, nearest};
use crate::Ray;
use crate::wide::layout::WideBvh;
use crate::wide::node::{Child, WideNode};
use core::arch::x86_64::*;

pub(crate) struct Avx2;

#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
pub(crate) unsafe fn nearest_hit(wide: &WideBvh, ray: &Ray) -> (f32, u32) {
    // SAFETY: the caller's promises.
    unsafe { nearest::<Avx2>(wide, ray) }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
pub(crate) unsafe fn any_hit(wide: &WideBvh, ray: &Ray) -> bool {
    // SAFETY: the caller's promises.
    unsafe { any::<Avx2>(wide, ray) }
}

/// The lanes of each mask, the lowest first: what compresses eight lanes by one permutation.
static LANES_OF: [[u8; 8]; 256] = {
    let mut lanes_of = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
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
    #[inline(always)]
    unsafe fn boxes(node: &WideNode, ray: &BoxRay, t_min: f32, t_max: f32) -> (__m256, u32) {
        // SAFETY: the caller's promises; loads are of whole arrays of 32 bytes.
        unsafe {
            let (entry, exit) = super::one_ray::interval(node, ray, t_min, t_max);
            (entry, _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(entry, exit)) as u32)
        }
    }

    #[inline(always)]
    unsafe fn sort(node: &WideNode, entry: __m256, mask: u32, stack: *mut Pending) -> Child {
        const TURNS: [[i32; 8]; 7] = {
            let mut turns = [[0; 8]; 7];
            let mut i = 0;
            while i < 56 {
                turns[i / 8][i % 8] = (i / 8 + 1 + i % 8) as i32 & 7;
                i += 1;
            }
            turns
        };
        // SAFETY: the caller's promises; the stack has room for eight entries.
        unsafe {
            // The inverted lane in the last three bits makes keys distinct and prefers the higher of two lanes; lanes that
            // are not entered get negative keys.
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let inverted = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let entered = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits);
            let cut = _mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(entry));
            let cut = _mm256_blendv_epi8(_mm256_set1_epi32(-8), cut, entered);
            let keys = _mm256_or_si256(cut, inverted);

            // The nearest child first: the rest of the work is not on the way to it.
            let least = _mm_min_epu32(_mm256_castsi256_si128(keys), _mm256_extracti128_si256::<1>(keys));
            let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0x4e>(least));
            let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0xb1>(least));
            let nearest = *node.children.get_unchecked((!_mm_cvtsi128_si32(least) & 7) as usize);

            // A child's place is the number of keys greater than its own.
            let mut places = _mm256_setzero_si256();
            for turn in &TURNS {
                let turned = _mm256_permutevar8x32_epi32(keys, _mm256_loadu_si256(turn.as_ptr().cast()));
                places = _mm256_sub_epi32(places, _mm256_cmpgt_epi32(turned, keys));
            }
            // The inverse of that permutation, four bits per place, first gathered in all lanes and then shared out.
            let order = _mm256_sllv_epi32(lanes, _mm256_slli_epi32::<2>(places));
            let order = _mm256_or_si256(order, _mm256_permute2x128_si256::<1>(order, order));
            let order = _mm256_or_si256(order, _mm256_shuffle_epi32::<0x4e>(order));
            let order = _mm256_or_si256(order, _mm256_shuffle_epi32::<0xb1>(order));
            let order = _mm256_srlv_epi32(order, _mm256_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28));

            let entries = _mm256_permutevar8x32_epi32(_mm256_castps_si256(entry), order);
            let children = _mm256_load_si256(node.children.as_ptr().cast());
            let children = _mm256_permutevar8x32_epi32(children, order);
            let low = _mm256_unpacklo_epi32(children, entries);
            let high = _mm256_unpackhi_epi32(children, entries);
            let to = stack.cast::<__m256i>();
            _mm256_storeu_si256(to, _mm256_permute2x128_si256::<0x20>(low, high));
            _mm256_storeu_si256(to.add(1), _mm256_permute2x128_si256::<0x31>(low, high));
            nearest
        }
    }

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, stack: *mut Child) {
        // SAFETY: the caller's promises; the stack has room for eight entries.
        unsafe {
            let order = _mm256_cvtepu8_epi32(_mm_loadl_epi64(LANES_OF[mask as usize & 255].as_ptr().cast()));
            let children = _mm256_load_si256(node.children.as_ptr().cast());
            _mm256_storeu_si256(stack.cast(), _mm256_permutevar8x32_epi32(children, order));
        }
    }
}
