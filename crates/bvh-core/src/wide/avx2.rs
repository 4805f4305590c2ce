//! The eight boxes of a node tested in AVX2 registers, with the results of the portable code.

use super::layout::WideView;
use super::node::{Child, Pending, WideNode};
use super::traverse::{Expand, WideRay, walk};
use crate::{Hit, Ray, Slabs};
use core::arch::x86_64::*;

/// Proof that the processor has AVX2 and what came with it.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

impl Avx2 {
    #[inline(always)]
    pub(crate) fn detect() -> Option<Self> {
        let found = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("popcnt");
        found.then_some(Self(()))
    }

    #[inline(always)]
    pub(crate) fn nearest_hit(self, wide: WideView, ray: &Ray) -> Option<Hit> {
        #[target_feature(enable = "avx2,bmi1,popcnt")]
        fn inner(wide: WideView, ray: &Ray) -> Option<Hit> {
            walk::<Avx2, false>(wide, ray, &mut ())
        }
        // SAFETY: a value of `Self` exists only where `detect` has found these features.
        unsafe { inner(wide, ray) }
    }

    #[inline(always)]
    pub(crate) fn any_hit(self, wide: WideView, ray: &Ray) -> bool {
        #[target_feature(enable = "avx2,bmi1,popcnt")]
        fn inner(wide: WideView, ray: &Ray) -> bool {
            walk::<Avx2, true>(wide, ray, &mut ()).is_some()
        }
        // SAFETY: a value of `Self` exists only where `detect` has found these features.
        unsafe { inner(wide, ray) }
    }
}

impl Expand for Avx2 {
    // Inlined into the two functions above, in which alone the intrinsics are compiled as what they are.
    #[inline(always)]
    fn expand(node: &WideNode, ray: &WideRay, t_max: f32, others: &mut [Pending; 8]) -> Option<(Child, usize)> {
        // SAFETY: called only from those functions, which have the features; loads and stores are of whole arrays
        // of 32 and 64 bytes, of which `Pending` and `Child` are plain parts.
        unsafe {
            let plane = |plane: usize, origin: f32, inverse: f32| {
                let distance =
                    _mm256_sub_ps(_mm256_loadu_ps(node.planes[plane].as_ptr()), _mm256_set1_ps(origin));
                _mm256_mul_ps(distance, _mm256_set1_ps(inverse))
            };
            let near = |axis: usize| plane(ray.near[axis], ray.near_origin[axis], ray.inverse[axis]);
            let far = |axis: usize| plane(ray.far[axis], ray.far_origin[axis], ray.inverse[axis]);
            let nearer_two = _mm256_max_ps(near(2), _mm256_set1_ps(ray.t_min));
            let entry = _mm256_max_ps(_mm256_max_ps(near(0), near(1)), nearer_two);
            let exit = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), far(2));
            // Of a NaN and a number these instructions give the second operand: unused lanes stay NaN.
            let last = _mm256_min_ps(_mm256_set1_ps(t_max), _mm256_mul_ps(exit, _mm256_set1_ps(Slabs::FAR)));
            let entered = _mm256_cmp_ps::<_CMP_LE_OQ>(entry, last);
            let mask = _mm256_movemask_ps(entered) as u32;
            if mask & mask.wrapping_sub(1) == 0 {
                return (mask != 0).then(|| (node.children[mask.trailing_zeros() as usize & 7], 0));
            }
            sort(node, entry, entered, others)
        }
    }
}

/// The children of two or more entered lanes by distance, without a comparison that would have to be predicted.
#[inline(always)]
unsafe fn sort(
    node: &WideNode,
    entry: __m256,
    entered: __m256,
    others: &mut [Pending; 8],
) -> Option<(Child, usize)> {
    const TURNS: [[i32; 8]; 7] = {
        let mut turns = [[0; 8]; 7];
        let mut i = 0;
        while i < 56 {
            turns[i / 8][i % 8] = (i / 8 + 1 + i % 8) as i32 & 7;
            i += 1;
        }
        turns
    };
    // SAFETY: as the caller, `expand`, says.
    unsafe {
        // Entries are not negative: their bits are ordered as they are. The lane in the last three bits makes them
        // distinct; lanes that are not entered get negative keys.
        let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let not_entered = _mm256_castsi256_ps(_mm256_set1_epi32(-8));
        let cut = _mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(entry));
        let cut = _mm256_blendv_ps(not_entered, _mm256_castsi256_ps(cut), entered);
        let keys = _mm256_or_si256(_mm256_castps_si256(cut), lanes);

        // The least key, negative ones last, so that the nearest child is known before the rest is sorted.
        let least = _mm_min_epu32(_mm256_castsi256_si128(keys), _mm256_extracti128_si256::<1>(keys));
        let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0x4e>(least));
        let least = _mm_min_epu32(least, _mm_shuffle_epi32::<0xb1>(least));
        let nearest = node.children[(_mm_cvtsi128_si32(least) & 7) as usize];

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

        let entries = _mm256_castps_si256(_mm256_permutevar8x32_ps(entry, order));
        let children = _mm256_loadu_si256(node.children.as_ptr().cast());
        let children = _mm256_permutevar8x32_epi32(children, order);
        let low = _mm256_unpacklo_epi32(entries, children);
        let high = _mm256_unpackhi_epi32(entries, children);
        let to = others.as_mut_ptr().cast::<__m256i>();
        _mm256_storeu_si256(to, _mm256_permute2x128_si256::<0x20>(low, high));
        _mm256_storeu_si256(to.add(1), _mm256_permute2x128_si256::<0x31>(low, high));
        Some((nearest, _mm256_movemask_ps(entered).count_ones() as usize - 1))
    }
}
