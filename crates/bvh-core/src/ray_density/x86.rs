//! The entries of a box, four lanes at a time: the innermost loop of a search for rays.
//!
//! All sums are sums of integers below 2⁵³. They are exact in any order, fused or not, so the
//! results are bit by bit the results of the portable code.

use super::crossings::{CELLS, index};
use super::{FRACTION_BITS, FRACTIONS, RayDensity};
use crate::PackedAabb;
use core::arch::x86_64::*;

#[inline]
pub(super) fn is_available() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// Returns the entries times 512³ of a box that is not empty.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn fractional_entries(density: &RayDensity, bounds: &PackedAabb) -> f64 {
    let [negated_min, max] = bounds.planes();
    let zero = _mm256_setzero_pd();
    let low_corner = in_fractions(density, _mm256_sub_pd(zero, promoted(negated_min)));
    let high_corner = in_fractions(density, promoted(max));
    // The corners rounded outward, their cells, and their places in these cells.
    let low = _mm256_cvttpd_epi32(low_corner);
    let high = _mm256_cvttpd_epi32(_mm256_ceil_pd(high_corner));
    let first = cell_of(low);
    let last = cell_of(high);
    let begin = _mm_slli_epi32::<{ FRACTION_BITS as i32 }>(first);
    let end = _mm_add_epi32(begin, _mm_set1_epi32(FRACTIONS as i32));
    let in_first = _mm256_cvtepi32_pd(_mm_sub_epi32(low, begin));
    let is_in_one_cell = _mm_movemask_epi8(_mm_cmpgt_epi32(high, end)) == 0;
    let x = [_mm_extract_epi32::<0>(first) as usize, _mm_extract_epi32::<0>(last) as usize];
    let y = [_mm_extract_epi32::<1>(first) as usize, _mm_extract_epi32::<1>(last) as usize];
    let z = [_mm_extract_epi32::<2>(first) as usize, _mm_extract_epi32::<2>(last) as usize];
    if is_in_one_cell {
        let table = &density.cells[index([x[0], y[0], z[0]])].0;
        let high_in_first = _mm256_cvtepi32_pd(_mm_sub_epi32(high, begin));
        return within(table, in_first, high_in_first);
    }
    let begin_of_last = _mm_slli_epi32::<{ FRACTION_BITS as i32 }>(last);
    let in_last = _mm256_cvtepi32_pd(_mm_sub_epi32(high, begin_of_last));
    // The weights of the eight grid points around each corner: four in the plane of x and y, two
    // along z.
    let low_weights = Weights::new(in_first);
    let high_weights = Weights::new(in_last);
    let weights_x = [low_weights.x, high_weights.x];
    let weights_y = [low_weights.y, high_weights.y];
    let weights_z = [low_weights.z, high_weights.z];
    let mut total = zero;
    for corner in 0..8 {
        let [i, j, k] = [corner & 1, corner >> 1 & 1, corner >> 2];
        let values = &density.corners[8 * index([x[i], y[j], z[k]]) + corner].0;
        let lower_plane = promoted([values[0], values[1], values[2], values[3]]);
        let upper_plane = promoted([values[4], values[5], values[6], values[7]]);
        let [lower_weight, upper_weight] = weights_z[k];
        let along_z =
            _mm256_fmadd_pd(upper_plane, upper_weight, _mm256_mul_pd(lower_plane, lower_weight));
        total = _mm256_fmadd_pd(along_z, _mm256_mul_pd(weights_x[i], weights_y[j]), total);
    }
    sum(total)
}

/// Returns a point in fractions of cells, clamped to the grid.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn in_fractions(density: &RayDensity, point: __m256d) -> __m256d {
    let origin = four_lanes(density.low.to_array());
    let scale = four_lanes(density.scale.to_array());
    let end = _mm256_set1_pd((CELLS << FRACTION_BITS) as f64);
    let fractions = _mm256_mul_pd(_mm256_sub_pd(point, origin), scale);
    _mm256_min_pd(_mm256_max_pd(fractions, _mm256_setzero_pd()), end)
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn four_lanes([x, y, z]: [f64; 3]) -> __m256d {
    _mm256_setr_pd(x, y, z, 0.0)
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn promoted([a, b, c, d]: [f32; 4]) -> __m256d {
    _mm256_cvtps_pd(_mm_setr_ps(a, b, c, d))
}

/// Returns the cells of a corner; the last cell for the upper end of the grid.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn cell_of(corner: __m128i) -> __m128i {
    let cell = _mm_srli_epi32::<{ FRACTION_BITS as i32 }>(corner);
    _mm_min_epi32(cell, _mm_set1_epi32(CELLS as i32 - 1))
}

/// Returns the fractional entries of a box within one cell; see [`within`](super::within()).
#[target_feature(enable = "avx2,fma")]
#[inline]
fn within(table: &[f32; 16], low: __m256d, high: __m256d) -> f64 {
    let size = _mm256_sub_pd(high, low);
    let constant = promoted([table[0], table[1], table[2], table[3]]);
    let by_low = promoted([table[4], table[5], table[6], table[7]]);
    let by_high = promoted([table[8], table[9], table[10], table[11]]);
    let by_size = promoted([table[12], table[13], table[14], table[15]]);
    let mut flux = _mm256_fmadd_pd(by_low, low, constant);
    flux = _mm256_fmadd_pd(by_high, high, flux);
    flux = _mm256_fmadd_pd(by_size, size, flux);
    // The sizes along the two other axes of each lane.
    let next = _mm256_permute4x64_pd::<0b11_00_10_01>(size);
    let after_next = _mm256_permute4x64_pd::<0b11_01_00_10>(size);
    sum(_mm256_mul_pd(flux, _mm256_mul_pd(next, after_next)))
}

/// The weights of the grid points around a corner. The lanes of `x` and `y` are the four points of
/// a plane.
#[derive(Clone, Copy)]
struct Weights {
    x: __m256d,
    y: __m256d,
    /// The weights of the lower and of the upper plane.
    z: [__m256d; 2],
}

impl Weights {
    /// Returns the weights for a corner at this place in its cell.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    fn new(part: __m256d) -> Self {
        let rest = _mm256_sub_pd(_mm256_set1_pd(f64::from(FRACTIONS)), part);
        // `rest` and `part` of x, then of z; and of y, then of the unused lane.
        let xz = _mm256_unpacklo_pd(rest, part);
        let y = _mm256_unpackhi_pd(rest, part);
        Self {
            x: _mm256_permute4x64_pd::<0b01_00_01_00>(xz),
            y: _mm256_permute4x64_pd::<0b01_01_00_00>(y),
            z: [
                _mm256_permute4x64_pd::<0b10_10_10_10>(xz),
                _mm256_permute4x64_pd::<0b11_11_11_11>(xz),
            ],
        }
    }
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn sum(lanes: __m256d) -> f64 {
    let pair = _mm_add_pd(_mm256_castpd256_pd128(lanes), _mm256_extractf128_pd::<1>(lanes));
    _mm_cvtsd_f64(_mm_add_sd(pair, _mm_unpackhi_pd(pair, pair)))
}
