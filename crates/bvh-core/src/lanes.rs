//! One ray against the eight boxes of a wide node: in AVX2 registers, and in portable code with the same results.

use crate::slabs::margin;
use crate::wide::{Pending, WideNode};
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
    /// Writes the children that the ray enters before `t_max` to `entered`, the nearest last and perhaps without its
    /// entry, and says how many there are. Same numbers as [`Slabs::interval`], whatever the implementation.
    fn expand(node: &WideNode, ray: &WideRay, t_max: f32, entered: &mut [Pending; 8]) -> usize;
}

/// Code for any machine.
pub(crate) struct Portable;

impl Expand for Portable {
    #[inline(always)]
    fn expand(node: &WideNode, ray: &WideRay, t_max: f32, entered: &mut [Pending; 8]) -> usize {
        let (mut entry, mut exit) = ([ray.t_min; 8], [f32::INFINITY; 8]);
        for axis in 0..3 {
            let (near, far) = (&node.planes[ray.near[axis]], &node.planes[ray.far[axis]]);
            for lane in 0..8 {
                let t = (near[lane] - ray.near_origin[axis]) * ray.inverse[axis];
                entry[lane] = if t > entry[lane] { t } else { entry[lane] };
                let t = (far[lane] - ray.far_origin[axis]) * ray.inverse[axis];
                exit[lane] = if t < exit[lane] { t } else { exit[lane] };
            }
        }
        let mut count = 0;
        for lane in 0..8 {
            let hit = entry[lane] <= exit[lane] * Slabs::FAR && entry[lane] <= t_max;
            if hit && node.lanes & (1 << lane) != 0 {
                // Insertion; the lower lane stays nearer on ties.
                let mut at = count;
                while at > 0 && entered[at - 1].entry <= entry[lane] {
                    entered[at] = entered[at - 1];
                    at -= 1;
                }
                entered[at] = Pending { entry: entry[lane], child: node.children[lane] };
                count += 1;
            }
        }
        count
    }
}

#[cfg(all(feature = "std", target_arch = "x86_64"))]
pub(crate) use avx2::Avx2;

#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx2 {
    use super::{Expand, Pending, WideNode, WideRay};
    use crate::{Hit, Ray, Slabs, WideBvh};
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
        pub(crate) fn nearest_hit(self, wide: &WideBvh, ray: &Ray) -> Option<Hit> {
            #[target_feature(enable = "avx2,bmi1,popcnt")]
            fn inner(wide: &WideBvh, ray: &Ray) -> Option<Hit> {
                wide.nearest_with::<Avx2>(ray)
            }
            // SAFETY: a value of `Self` exists only where `detect` has found these features.
            unsafe { inner(wide, ray) }
        }

        #[inline(always)]
        pub(crate) fn any_hit(self, wide: &WideBvh, ray: &Ray) -> bool {
            #[target_feature(enable = "avx2,bmi1,popcnt")]
            fn inner(wide: &WideBvh, ray: &Ray) -> bool {
                wide.any_with::<Avx2>(ray)
            }
            // SAFETY: a value of `Self` exists only where `detect` has found these features.
            unsafe { inner(wide, ray) }
        }
    }

    impl Expand for Avx2 {
        // Inlined into the two functions above, in which alone the intrinsics are compiled as what they are.
        #[inline(always)]
        fn expand(node: &WideNode, ray: &WideRay, t_max: f32, entered: &mut [Pending; 8]) -> usize {
            // SAFETY: called only from those functions, which have the features.
            unsafe {
                let load = |a: &[f32; 8]| _mm256_loadu_ps(a.as_ptr());
                let plane = |plane: usize, origin: f32, inverse: f32| {
                    let distance = _mm256_sub_ps(load(&node.planes[plane]), _mm256_set1_ps(origin));
                    _mm256_mul_ps(distance, _mm256_set1_ps(inverse))
                };
                let near = |axis: usize| plane(ray.near[axis], ray.near_origin[axis], ray.inverse[axis]);
                let far = |axis: usize| plane(ray.far[axis], ray.far_origin[axis], ray.inverse[axis]);
                let entry = _mm256_max_ps(
                    _mm256_max_ps(near(0), near(1)),
                    _mm256_max_ps(near(2), _mm256_set1_ps(ray.t_min)),
                );
                let exit = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), far(2));
                let last =
                    _mm256_min_ps(_mm256_mul_ps(exit, _mm256_set1_ps(Slabs::FAR)), _mm256_set1_ps(t_max));
                let hits = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(entry, last)) as u32 & node.lanes;

                if hits & hits.wrapping_sub(1) == 0 {
                    let lane = hits.trailing_zeros() as usize & 7;
                    // The nearest one's entry is not looked at.
                    entered[0].child = node.children[lane];
                    return usize::from(hits != 0);
                }
                // Entries are not negative: their bits are ordered as they are. The lane in the last bits makes them
                // distinct.
                let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
                let keys = _mm256_or_si256(
                    _mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(entry)),
                    lanes,
                );
                let mut rest = hits;
                while rest != 0 {
                    let lane = rest.trailing_zeros();
                    rest &= rest - 1;
                    // A child's place is the number of those behind it: sorted without a comparison to be predicted.
                    let index = _mm256_set1_epi32(lane as i32);
                    let key = _mm256_permutevar8x32_epi32(keys, index);
                    let behind =
                        _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(keys, key))) as u32 & hits;
                    let t = _mm256_cvtss_f32(_mm256_permutevar8x32_ps(entry, index));
                    entered[(behind.count_ones() & 7) as usize] =
                        Pending { entry: t, child: node.children[(lane & 7) as usize] };
                }
                hits.count_ones() as usize
            }
        }
    }
}
