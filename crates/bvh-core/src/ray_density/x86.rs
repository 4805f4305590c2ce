//! The entries of a box in four lanes at a time: the innermost loop of a search for rays.
//!
//! All sums are of whole numbers below 2⁵³, exact in whichever order and fused or not, so these are the bits of the portable code.

use super::crossings::{CELLS, index};
use super::{FRACTION_BITS, FRACTIONS, RayDensity};
use crate::PackedAabb;
use core::arch::x86_64::*;

/// Entries times 512³ of a box that is not empty.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn fractional_entries(density: &RayDensity, bounds: &PackedAabb) -> f64 {
    let [negated_min, max] = bounds.planes();
    let lanes = |v: [f64; 3]| _mm256_setr_pd(v[0], v[1], v[2], 0.0);
    let wide = |v: [f32; 4]| _mm256_cvtps_pd(_mm_setr_ps(v[0], v[1], v[2], v[3]));
    let (origin, scale) = (lanes(density.low.to_array()), lanes(density.scale.to_array()));
    let (zero, most) = (_mm256_setzero_pd(), _mm256_set1_pd((CELLS << FRACTION_BITS) as f64));
    let place = |corner| {
        let at = _mm256_mul_pd(_mm256_sub_pd(corner, origin), scale);
        _mm256_min_pd(_mm256_max_pd(at, zero), most)
    };
    let low = place(_mm256_sub_pd(zero, wide(negated_min)));
    let high = place(wide(max));
    // The corners rounded outward, the cells that they are in, and their places there.
    let low = _mm256_cvttpd_epi32(low);
    let high = _mm256_cvttpd_epi32(_mm256_ceil_pd(high));
    let cell_of = |corner| {
        let cell = _mm_srli_epi32::<{ FRACTION_BITS as i32 }>(corner);
        _mm_min_epi32(cell, _mm_set1_epi32(CELLS as i32 - 1))
    };
    let begin_of = |cell| _mm_slli_epi32::<{ FRACTION_BITS as i32 }>(cell);
    let (first, last) = (cell_of(low), cell_of(high));
    let begin = begin_of(first);
    let end = _mm_add_epi32(begin, _mm_set1_epi32(FRACTIONS as i32));
    let in_cell = _mm256_cvtepi32_pd(_mm_sub_epi32(low, begin));
    let one_cell = _mm_movemask_epi8(_mm_cmpgt_epi32(high, end)) == 0;
    let x = [_mm_extract_epi32::<0>(first) as usize, _mm_extract_epi32::<0>(last) as usize];
    let y = [_mm_extract_epi32::<1>(first) as usize, _mm_extract_epi32::<1>(last) as usize];
    let z = [_mm_extract_epi32::<2>(first) as usize, _mm_extract_epi32::<2>(last) as usize];
    if one_cell {
        let table = &density.cells[index([x[0], y[0], z[0]])].0;
        let high = _mm256_cvtepi32_pd(_mm_sub_epi32(high, begin));
        let size = _mm256_sub_pd(high, in_cell);
        let row = |k: usize| wide([table[k], table[k + 1], table[k + 2], table[k + 3]]);
        let flux = _mm256_fmadd_pd(row(4), in_cell, row(0));
        let flux = _mm256_fmadd_pd(row(8), high, flux);
        let flux = _mm256_fmadd_pd(row(12), size, flux);
        let next = _mm256_permute4x64_pd::<0b11_00_10_01>(size);
        let last = _mm256_permute4x64_pd::<0b11_01_00_10>(size);
        return sum(_mm256_mul_pd(flux, _mm256_mul_pd(next, last)));
    }
    let in_last = _mm256_cvtepi32_pd(_mm_sub_epi32(high, begin_of(last)));
    // The weights of the eight grid points around each corner: four in the plane of x and y, two along z.
    let whole = _mm256_set1_pd(f64::from(FRACTIONS));
    let [near, far] = [in_cell, in_last].map(|part| {
        let rest = _mm256_sub_pd(whole, part);
        (_mm256_unpacklo_pd(rest, part), _mm256_unpackhi_pd(rest, part))
    });
    let of_x = |(xz, _)| _mm256_permute4x64_pd::<0b01_00_01_00>(xz);
    let of_y = |(_, y)| _mm256_permute4x64_pd::<0b01_01_00_00>(y);
    let of_z =
        |(xz, _)| [_mm256_permute4x64_pd::<0b10_10_10_10>(xz), _mm256_permute4x64_pd::<0b11_11_11_11>(xz)];
    let (weights_x, weights_y) = ([of_x(near), of_x(far)], [of_y(near), of_y(far)]);
    let weights_z = [of_z(near), of_z(far)];
    let mut total = zero;
    for corner in 0..8 {
        let [i, j, k] = [corner & 1, corner >> 1 & 1, corner >> 2];
        let values = &density.corners[8 * index([x[i], y[j], z[k]]) + corner].0;
        let row = |k: usize| wide([values[k], values[k + 1], values[k + 2], values[k + 3]]);
        let along = _mm256_fmadd_pd(row(4), weights_z[k][1], _mm256_mul_pd(row(0), weights_z[k][0]));
        total = _mm256_fmadd_pd(along, _mm256_mul_pd(weights_x[i], weights_y[j]), total);
    }
    sum(total)
}

/// The sum of four lanes.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn sum(lanes: __m256d) -> f64 {
    let pair = _mm_add_pd(_mm256_castpd256_pd128(lanes), _mm256_extractf128_pd::<1>(lanes));
    _mm_cvtsd_f64(_mm_add_sd(pair, _mm_unpackhi_pd(pair, pair)))
}
