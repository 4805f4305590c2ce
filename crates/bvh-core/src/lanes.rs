//! One ray against the eight boxes of a wide node: in AVX2 registers, and in portable code with the same results.

use crate::slabs::margin;
use crate::wide::{Child, Pending, WideNode};
use crate::{Aabb, Ray, Slabs};

/// A ray prepared for wide nodes.
pub(crate) struct WideRay {
    /// Which planes of a node the ray meets first, by axis, and which last.
    near: [usize; 3],
    far: [usize; 3],
    /// The margins of [`Slabs`] for those planes.
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    inverse: [f32; 3],
    t_min: f32,
}

impl WideRay {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, bounds: &Aabb) -> Self {
        let (origin, inverse) = (ray.origin(), ray.inverse_direction());
        // Signs cannot be predicted: no branches. The same numbers as those of [`Slabs`].
        let margin = margin(ray, bounds).copysign(inverse);
        let backwards = inverse.to_array().map(|x| (x.to_bits() >> 31) as usize);
        Self {
            near: [3 * backwards[0], 1 + 3 * backwards[1], 2 + 3 * backwards[2]],
            far: [3 - 3 * backwards[0], 4 - 3 * backwards[1], 5 - 3 * backwards[2]],
            near_origin: (origin + margin).to_array(),
            far_origin: (origin - margin).to_array(),
            inverse: inverse.to_array(),
            t_min: ray.t_min(),
        }
    }
}

/// A way to test the eight boxes of a node at once.
pub(crate) trait Expand {
    /// The nearest of the children that the ray enters before `t_max`, and the number of the others, which are written
    /// to `others`, the nearest last. `None` if it enters none. What comes after these is overwritten too.
    ///
    /// Entries are those of [`Slabs::interval`], whatever the implementation; the order of nearly equal ones is not.
    fn expand(node: &WideNode, ray: &WideRay, t_max: f32, others: &mut [Pending; 8]) -> Option<(Child, usize)>;
}

/// Code for any machine.
pub(crate) struct Portable;

impl Expand for Portable {
    #[inline(always)]
    fn expand(node: &WideNode, ray: &WideRay, t_max: f32, others: &mut [Pending; 8]) -> Option<(Child, usize)> {
        let (mut entry, mut exit) = ([ray.t_min; 8], [f32::INFINITY; 8]);
        for axis in 0..3 {
            let (near, far) = (&node.planes[ray.near[axis]], &node.planes[ray.far[axis]]);
            for lane in 0..8 {
                let t = (near[lane] - ray.near_origin[axis]) * ray.inverse[axis];
                entry[lane] = if t > entry[lane] { t } else { entry[lane] };
                // In unused lanes NaN, and it stays so.
                let t = (far[lane] - ray.far_origin[axis]) * ray.inverse[axis];
                exit[lane] = if exit[lane] < t { exit[lane] } else { t };
            }
        }
        let mut count = 0;
        for lane in 0..8 {
            if entry[lane] <= exit[lane] * Slabs::FAR && entry[lane] <= t_max {
                // Insertion; the lower lane stays nearer on ties.
                let mut at = count;
                while at > 0 && others[at - 1].entry <= entry[lane] {
                    others[at] = others[at - 1];
                    at -= 1;
                }
                others[at] = Pending { entry: entry[lane], child: node.children[lane] };
                count += 1;
            }
        }
        let last = count.checked_sub(1)?;
        Some((others[last].child, last))
    }
}

#[cfg(all(feature = "std", target_arch = "x86_64"))]
pub(crate) use avx2::Avx2;

#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx2 {
    use super::{Child, Expand, Pending, WideNode, WideRay};
    use crate::{Hit, Ray, Slabs, WideView};
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
                wide.nearest_with::<Avx2>(ray, &mut ())
            }
            // SAFETY: a value of `Self` exists only where `detect` has found these features.
            unsafe { inner(wide, ray) }
        }

        #[inline(always)]
        pub(crate) fn any_hit(self, wide: WideView, ray: &Ray) -> bool {
            #[target_feature(enable = "avx2,bmi1,popcnt")]
            fn inner(wide: WideView, ray: &Ray) -> bool {
                wide.any_with::<Avx2>(ray, &mut ())
            }
            // SAFETY: a value of `Self` exists only where `detect` has found these features.
            unsafe { inner(wide, ray) }
        }
    }

    impl Expand for Avx2 {
        // Inlined into the two functions above, in which alone the intrinsics are compiled as what they are.
        #[inline(always)]
        fn expand(
            node: &WideNode,
            ray: &WideRay,
            t_max: f32,
            others: &mut [Pending; 8],
        ) -> Option<(Child, usize)> {
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
                let last =
                    _mm256_min_ps(_mm256_set1_ps(t_max), _mm256_mul_ps(exit, _mm256_set1_ps(Slabs::FAR)));
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
}
