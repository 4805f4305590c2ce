//! Sixteen rays made ready for the tests of boxes and triangles at once: what packets and rays in flight begin with.

use super::box_ray::BoxRay;
use crate::{Aabb, Ray};
use core::arch::x86_64::*;

/// Rays that are prepared at once.
pub(crate) const RAYS: usize = 16;

/// Sixteen rays, a ray per lane. Vectors of three are by axis.
pub(crate) struct Sixteen {
    pub(crate) origin: [__m512; 3],
    pub(crate) direction: [__m512; 3],
    pub(crate) inverse: [__m512; 3],
    pub(crate) t_min: __m512,
    pub(crate) t_max: __m512,
    /// A bit per ray whose direction is largest along y, and along z.
    pub(crate) second: u16,
    pub(crate) third: u16,
    /// A bit per ray within the bounds of [`BoxRay`]; the others are left to the portable kernel.
    pub(crate) in_range: u16,
    pub(crate) axes: [Axis; 3],
}

/// Sixteen rays along one axis.
pub(crate) struct Axis {
    /// A bit per ray that runs backwards.
    pub(crate) backwards: u16,
    /// The origins, moved by the margin of near and of far planes.
    pub(crate) near_origin: __m512,
    pub(crate) far_origin: __m512,
    /// As in [`BoxRay`]; `scale` before it is made smaller for near and larger for far planes.
    pub(crate) scale: __m512,
    pub(crate) near_scale: __m512,
    pub(crate) near_shift: __m512,
    pub(crate) far_scale: __m512,
    pub(crate) far_shift: __m512,
}

impl Axis {
    #[inline(always)]
    unsafe fn new(origin: __m512, inverse: __m512, limit: __m512, margin: __m512) -> Self {
        // SAFETY: the caller's promise.
        unsafe {
            let (tiny, sign) = (_mm512_set1_ps(BoxRay::UNDERFLOW), _mm512_set1_ps(-0.0));
            let scale = _mm512_max_ps(inverse, _mm512_sub_ps(_mm512_setzero_ps(), limit));
            let scale = _mm512_min_ps(scale, limit);
            let near_scale = _mm512_mul_ps(scale, _mm512_set1_ps(BoxRay::NEAR));
            let far_scale = _mm512_mul_ps(scale, _mm512_set1_ps(BoxRay::FAR));
            let margin = _mm512_or_ps(margin, _mm512_and_ps(sign, inverse));
            let (near_origin, far_origin) = (_mm512_add_ps(origin, margin), _mm512_sub_ps(origin, margin));
            Self {
                backwards: _mm512_movepi32_mask(_mm512_castps_si512(inverse)),
                near_origin,
                far_origin,
                scale,
                near_scale,
                near_shift: _mm512_fnmsub_ps(near_origin, near_scale, tiny),
                far_scale,
                far_shift: _mm512_fnmadd_ps(far_origin, far_scale, tiny),
            }
        }
    }
}

impl Sixteen {
    /// Prepares rays for boxes whose coordinates are at most `largest`: the operations of [`BoxRay::new`], lane by lane.
    ///
    /// # Safety
    /// The caller is compiled with AVX-512 F, VL, DQ and BW and with FMA.
    #[inline(always)]
    pub(crate) unsafe fn new(rays: &[Ray; RAYS], largest: f32) -> Self {
        // SAFETY: rays are three vectors of four lanes; the rest is the caller's promise.
        unsafe {
            let [ox, oy, oz, t_min] = transpose(rays, 0);
            let [dx, dy, dz, t_max] = transpose(rays, 1);
            let [ix, iy, iz, least] = transpose(rays, 2);
            let (sx, sy, sz) = (_mm512_abs_ps(dx), _mm512_abs_ps(dy), _mm512_abs_ps(dz));
            let third = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(sz, _mm512_max_ps(sx, sy));
            let second = _mm512_mask_cmp_ps_mask::<_CMP_GT_OQ>(!third, sy, sx);
            let size = _mm512_max_ps(_mm512_max_ps(_mm512_abs_ps(ox), _mm512_abs_ps(oy)), _mm512_abs_ps(oz));
            let size = _mm512_add_ps(size, _mm512_set1_ps(largest));
            let limit = _mm512_mul_ps(least, _mm512_set1_ps(BoxRay::CLAMP));
            let shift = _mm512_mul_ps(size, limit);
            let in_range = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(size, _mm512_set1_ps(BoxRay::MOST_SIZE))
                & _mm512_cmp_ps_mask::<_CMP_GE_OQ>(size, _mm512_set1_ps(BoxRay::LEAST_SIZE))
                & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(shift, _mm512_set1_ps(BoxRay::MOST_SHIFT));
            let margin = _mm512_mul_ps(size, _mm512_set1_ps(BoxRay::MARGIN));
            Self {
                origin: [ox, oy, oz],
                direction: [dx, dy, dz],
                inverse: [ix, iy, iz],
                t_min,
                t_max,
                second,
                third,
                in_range,
                axes: [
                    Axis::new(ox, ix, limit, margin),
                    Axis::new(oy, iy, limit, margin),
                    Axis::new(oz, iz, limit, margin),
                ],
            }
        }
    }

    /// Whether the rays run to the same sides, mostly along the same axis, and none is left to the portable kernel.
    #[inline(always)]
    pub(crate) fn cohere(&self) -> bool {
        let same = |mask: u16| mask == 0 || mask == u16::MAX;
        let [x, y, z] = &self.axes;
        same(x.backwards)
            & same(y.backwards)
            & same(z.backwards)
            & same(self.second)
            & same(self.third)
            & (self.in_range == u16::MAX)
    }

    /// A bit per ray that may meet something within `bounds`: the test of [`BoxRay`] for the box around all others, which is
    /// passed by every ray that passes one of theirs.
    ///
    /// # Safety
    /// As [`new`](Self::new).
    #[inline(always)]
    pub(crate) unsafe fn enter(&self, bounds: &Aabb) -> u16 {
        // SAFETY: the caller's promise.
        unsafe {
            let (mut entry, mut exit) = (self.t_min, self.t_max);
            let (low, high) = (bounds.min.to_array(), bounds.max.to_array());
            for (i, axis) in self.axes.iter().enumerate() {
                let (low, high) = (_mm512_set1_ps(low[i]), _mm512_set1_ps(high[i]));
                let near = _mm512_mask_blend_ps(axis.backwards, low, high);
                let far = _mm512_mask_blend_ps(axis.backwards, high, low);
                entry = _mm512_max_ps(entry, _mm512_fmadd_ps(near, axis.near_scale, axis.near_shift));
                exit = _mm512_min_ps(exit, _mm512_fmadd_ps(far, axis.far_scale, axis.far_shift));
            }
            _mm512_cmp_ps_mask::<_CMP_LE_OQ>(entry, exit)
        }
    }

    /// Writes the rays one after the other; the first is number `first` of its batch.
    ///
    /// # Safety
    /// As [`new`](Self::new); there is room for sixteen.
    #[inline(always)]
    pub(crate) unsafe fn write(&self, first: u32, to: *mut Prepared) {
        // SAFETY: the caller's promises; a `Prepared` is eight rows of four lanes.
        unsafe {
            let [x, y, z] = self.in_order(self.origin);
            let [x_inverse, y_inverse, z_inverse] = self.in_order(self.inverse);
            let [dx, dy, depth] = self.in_order(self.direction);
            let axis = _mm512_maskz_set1_epi32(self.third, 2);
            let axis = _mm512_mask_mov_epi32(axis, self.second, _mm512_set1_epi32(1));
            let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            let number = _mm512_add_epi32(_mm512_set1_epi32(first as i32), lanes);
            let mut near = [_mm512_setzero_ps(); 3];
            let mut far = near;
            for i in 0..3 {
                let (lower, upper) = (_mm512_set1_epi32(32 * i as i32), _mm512_set1_epi32(32 * (i as i32 + 3)));
                near[i] = _mm512_castsi512_ps(_mm512_mask_mov_epi32(lower, self.axes[i].backwards, upper));
                far[i] = _mm512_castsi512_ps(_mm512_mask_mov_epi32(upper, self.axes[i].backwards, lower));
            }
            let [first_axis, second_axis, third_axis] = &self.axes;
            let to = to.cast::<f32>();
            write_row(to, [first_axis.near_scale, second_axis.near_scale, third_axis.near_scale], self.t_min);
            write_row(
                to.add(4),
                [first_axis.near_shift, second_axis.near_shift, third_axis.near_shift],
                self.t_max,
            );
            write_row(to.add(8), [first_axis.far_scale, second_axis.far_scale, third_axis.far_scale], depth);
            write_row(
                to.add(12),
                [first_axis.far_shift, second_axis.far_shift, third_axis.far_shift],
                _mm512_div_ps(dx, depth),
            );
            write_row(to.add(16), [x, y, z], _mm512_div_ps(dy, depth));
            write_row(to.add(20), [x_inverse, y_inverse, z_inverse], _mm512_castsi512_ps(axis));
            write_row(to.add(24), near, _mm512_castsi512_ps(number));
            write_row(to.add(28), far, _mm512_setzero_ps());
        }
    }

    /// Components in the order of each ray's shear: y z x, or z x y if y is the largest, or x y z if z is.
    #[inline(always)]
    unsafe fn in_order(&self, [x, y, z]: [__m512; 3]) -> [__m512; 3] {
        // SAFETY: the caller's promise.
        unsafe {
            [
                _mm512_mask_mov_ps(_mm512_mask_mov_ps(y, self.second, z), self.third, x),
                _mm512_mask_mov_ps(_mm512_mask_mov_ps(z, self.second, x), self.third, y),
                _mm512_mask_mov_ps(_mm512_mask_mov_ps(x, self.second, y), self.third, z),
            ]
        }
    }
}

/// What the tests of boxes and triangles need of one ray: two cache lines, in rows of four lanes.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Prepared {
    /// As in [`BoxRay`], and so on.
    pub(crate) near_scale: [f32; 3],
    pub(crate) t_min: f32,
    pub(crate) near_shift: [f32; 3],
    pub(crate) t_max: f32,
    pub(crate) far_scale: [f32; 3],
    /// As in [`Shear`](crate::Shear), and in its order of axes, up to `inverse`.
    depth: f32,
    pub(crate) far_shift: [f32; 3],
    x_slope: f32,
    origin: [f32; 3],
    y_slope: f32,
    inverse: [f32; 3],
    /// The axis of the largest component of the direction.
    pub(crate) largest_axis: u32,
    /// The bytes of a node before the planes that the ray meets first, by axis.
    pub(crate) near: [u32; 3],
    /// Among the rays of the batch.
    pub(crate) number: u32,
    /// And before the planes opposite.
    pub(crate) far: [u32; 3],
    padding: u32,
}

impl Prepared {
    /// The rows that begin with `near_scale`, and end with `t_min`, and so on.
    pub(crate) const T_MIN: usize = 0;
    pub(crate) const DEPTH: usize = 2;
    pub(crate) const X_SLOPE: usize = 3;
    pub(crate) const ORIGIN_AND_Y_SLOPE: usize = 4;
    pub(crate) const INVERSE: usize = 5;

    /// Four lanes of it.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> *const f32 {
        (&raw const *self).cast::<f32>().wrapping_add(4 * row)
    }
}

/// Writes four lanes of each of sixteen rays.
#[inline(always)]
unsafe fn write_row(to: *mut f32, [a, b, c]: [__m512; 3], d: __m512) {
    const NEXT: usize = size_of::<Prepared>() / 4;
    // SAFETY: the caller's promises.
    unsafe {
        for (i, row) in transpose_quarters([a, b, c, d]).into_iter().enumerate() {
            // Rays i, i + 4, i + 8 and i + 12.
            let to = to.add(i * NEXT);
            _mm_store_ps(to, _mm512_extractf32x4_ps::<0>(row));
            _mm_store_ps(to.add(4 * NEXT), _mm512_extractf32x4_ps::<1>(row));
            _mm_store_ps(to.add(8 * NEXT), _mm512_extractf32x4_ps::<2>(row));
            _mm_store_ps(to.add(12 * NEXT), _mm512_extractf32x4_ps::<3>(row));
        }
    }
}

/// One of the three vectors of sixteen rays, by component.
#[inline(always)]
unsafe fn transpose(rays: &[Ray; RAYS], vector: usize) -> [__m512; 4] {
    // SAFETY: a ray is three vectors of four lanes, aligned to sixteen bytes.
    unsafe {
        let lanes = rays.as_ptr().cast::<f32>().add(4 * vector);
        let mut rows = [_mm512_setzero_ps(); 4];
        for (i, row) in rows.iter_mut().enumerate() {
            // Rays i, i + 4, i + 8 and i + 12.
            let ray = lanes.add(12 * i);
            let low =
                _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(_mm_load_ps(ray)), _mm_load_ps(ray.add(48)));
            let high = _mm256_insertf128_ps::<1>(
                _mm256_castps128_ps256(_mm_load_ps(ray.add(96))),
                _mm_load_ps(ray.add(144)),
            );
            *row = _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low), high);
        }
        transpose_quarters(rows)
    }
}

/// Transposes four rows of four lanes in each quarter of the registers.
#[inline(always)]
unsafe fn transpose_quarters([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    // SAFETY: the caller has AVX-512.
    unsafe {
        let (ab, cd) = (_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d));
        let (ab_high, cd_high) = (_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d));
        [
            _mm512_shuffle_ps::<0b01_00_01_00>(ab, cd),
            _mm512_shuffle_ps::<0b11_10_11_10>(ab, cd),
            _mm512_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
            _mm512_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
        ]
    }
}
