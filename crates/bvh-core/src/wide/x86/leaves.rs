//! Blocks of triangles against one ray each: a block and its ray in every quarter of a register.
//!
//! No closure here is handed to a function that might not be inlined, such as `map` of arrays: it would be compiled without
//! the instructions of its caller.

use super::edges;
use super::prepared::Prepared;
use crate::Slabs;
use crate::triangle::AXES;
use crate::wide::triangles::TriangleBlock;
use core::arch::x86_64::*;

#[inline(always)]
unsafe fn load_four(from: [*const f32; 4]) -> __m512 {
    // SAFETY: the caller has AVX-512, and the pointers are to four aligned lanes each.
    unsafe {
        let first = _mm512_castps128_ps512(_mm_load_ps(from[0]));
        let two = _mm512_insertf32x4::<1>(first, _mm_load_ps(from[1]));
        let three = _mm512_insertf32x4::<2>(two, _mm_load_ps(from[2]));
        _mm512_insertf32x4::<3>(three, _mm_load_ps(from[3]))
    }
}

#[inline(always)]
unsafe fn load_two(from: [*const f32; 2]) -> __m256 {
    // SAFETY: as of `load_four`.
    unsafe { _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(_mm_load_ps(from[0])), _mm_load_ps(from[1])) }
}

/// One coordinate of one corner of a block's triangles, along an axis of the ray's shear.
#[inline(always)]
fn lanes(block: *const TriangleBlock, ray: &Prepared, corner: usize, axis: usize) -> *const f32 {
    let axis = AXES[ray.largest_axis as usize % 3][axis];
    block.cast::<f32>().wrapping_add((3 * corner + axis) * TriangleBlock::LANES)
}

/// The first, second, third or fourth lane of every quarter.
macro_rules! spread {
    ($permute:ident, $row:expr, $lane:literal) => {
        $permute::<{ 0b01_01_01_01 * $lane }>($row)
    };
}

/// One corner of the triangles of four blocks, relative to their rays: along x and y of the shears.
#[inline(always)]
unsafe fn sheared(
    blocks: [*const TriangleBlock; 4],
    rays: [&Prepared; 4],
    corner: usize,
    origin: [__m512; 3],
    slope: [__m512; 2],
) -> (__m512, __m512) {
    // SAFETY: the caller's promises.
    unsafe {
        let of = |i: usize, axis: usize| lanes(blocks[i], rays[i], corner, axis);
        let coordinate = |axis: usize| load_four([of(0, axis), of(1, axis), of(2, axis), of(3, axis)]);
        let z = _mm512_sub_ps(coordinate(2), origin[2]);
        let (x, y) = (_mm512_sub_ps(coordinate(0), origin[0]), _mm512_sub_ps(coordinate(1), origin[1]));
        (_mm512_sub_ps(x, _mm512_mul_ps(slope[0], z)), _mm512_sub_ps(y, _mm512_mul_ps(slope[1], z)))
    }
}

/// Four bits per block for the triangles that the block's ray may meet: the operations of
/// [`Shear4::candidates`](super::one_ray::Shear4::candidates).
///
/// # Safety
/// The caller is compiled with AVX-512 F, VL and DQ.
#[inline(always)]
pub(crate) unsafe fn candidates(rays: [&Prepared; 4], blocks: [*const TriangleBlock; 4]) -> u16 {
    // SAFETY: the caller's promises.
    unsafe {
        let row = |row| load_four([rays[0].row(row), rays[1].row(row), rays[2].row(row), rays[3].row(row)]);
        let origins = row(Prepared::ORIGIN_AND_Y_SLOPE);
        let origin = [
            spread!(_mm512_permute_ps, origins, 0),
            spread!(_mm512_permute_ps, origins, 1),
            spread!(_mm512_permute_ps, origins, 2),
        ];
        let slope =
            [spread!(_mm512_permute_ps, row(Prepared::X_SLOPE), 3), spread!(_mm512_permute_ps, origins, 3)];
        edges::candidates(
            sheared(blocks, rays, 0, origin, slope),
            sheared(blocks, rays, 1, origin, slope),
            sheared(blocks, rays, 2, origin, slope),
        )
    }
}

/// The nearest hits of two rays, as distance and object, that have these already or end there: the operations of
/// [`Shear4::decide`](super::one_ray::Shear4::decide), and of [`Hit::precedes`](crate::Hit::precedes).
///
/// # Safety
/// As [`candidates`].
#[inline(always)]
pub(crate) unsafe fn nearest_of(
    rays: [&Prepared; 2],
    blocks: [*const TriangleBlock; 2],
    before: [(f32, u32); 2],
) -> [(f32, u32); 2] {
    // SAFETY: the caller's promises; ids are four aligned lanes.
    unsafe {
        let t_max = _mm256_setr_m128(_mm_set1_ps(before[0].0), _mm_set1_ps(before[1].0));
        let (found, t) = decide(rays, blocks, t_max);
        let ids = load_two([(*blocks[0]).ids().cast(), (*blocks[1]).ids().cast()]);
        let marks = _mm256_setr_epi32(TriangleBlock::LAST as i32, 0, 0, 0, TriangleBlock::LAST as i32, 0, 0, 0);
        let ids = _mm256_andnot_si256(marks, _mm256_castps_si256(ids));
        let t = _mm256_mask_mov_ps(t_max, found, t);
        let least = _mm256_min_ps(t, _mm256_permute_ps::<0x4e>(t));
        let least = _mm256_min_ps(least, _mm256_permute_ps::<0xb1>(least));
        let first = _mm256_mask_cmp_ps_mask::<_CMP_EQ_OQ>(found, t, least);
        let ids = _mm256_mask_mov_epi32(_mm256_set1_epi32(-1), first, ids);
        let ids = _mm256_min_epu32(ids, _mm256_shuffle_epi32::<0x4e>(ids));
        let ids = _mm256_min_epu32(ids, _mm256_shuffle_epi32::<0xb1>(ids));
        let least = [_mm256_cvtss_f32(least), _mm_cvtss_f32(_mm256_extractf128_ps::<1>(least))];
        let ids = [_mm256_cvtsi256_si32(ids) as u32, _mm256_extract_epi32::<4>(ids) as u32];
        let nearest =
            |i: usize| (least[i], if least[i] == before[i].0 { ids[i].min(before[i].1) } else { ids[i] });
        [nearest(0), nearest(1)]
    }
}

/// One corner of the triangles of two blocks, relative to their rays, in f64.
#[inline(always)]
unsafe fn relative([x, y, z]: [__m256; 3], origin: [__m256; 3], slope: [__m256; 2]) -> [__m512d; 3] {
    // SAFETY: the caller's promises.
    unsafe {
        let z = _mm256_sub_ps(z, origin[2]);
        let x = _mm256_sub_ps(_mm256_sub_ps(x, origin[0]), _mm256_mul_ps(slope[0], z));
        let y = _mm256_sub_ps(_mm256_sub_ps(y, origin[1]), _mm256_mul_ps(slope[1], z));
        [_mm512_cvtps_pd(x), _mm512_cvtps_pd(y), _mm512_cvtps_pd(z)]
    }
}

/// Four bits per block for the triangles that the block's ray meets up to `t_max`, and their distances.
#[inline(always)]
unsafe fn decide(rays: [&Prepared; 2], blocks: [*const TriangleBlock; 2], t_max: __m256) -> (u8, __m256) {
    // SAFETY: the caller's promises.
    unsafe {
        let row = |row| load_two([rays[0].row(row), rays[1].row(row)]);
        let (origins, inverses) = (row(Prepared::ORIGIN_AND_Y_SLOPE), row(Prepared::INVERSE));
        let origin = [
            spread!(_mm256_permute_ps, origins, 0),
            spread!(_mm256_permute_ps, origins, 1),
            spread!(_mm256_permute_ps, origins, 2),
        ];
        let inverse = [
            spread!(_mm256_permute_ps, inverses, 0),
            spread!(_mm256_permute_ps, inverses, 1),
            spread!(_mm256_permute_ps, inverses, 2),
        ];
        let slope =
            [spread!(_mm256_permute_ps, row(Prepared::X_SLOPE), 3), spread!(_mm256_permute_ps, origins, 3)];
        let depth = spread!(_mm256_permute_ps, row(Prepared::DEPTH), 3);
        let t_min = spread!(_mm256_permute_ps, row(Prepared::T_MIN), 3);
        let of = |i: usize, corner: usize, axis: usize| lanes(blocks[i], rays[i], corner, axis);
        let coordinate = |corner: usize, axis: usize| load_two([of(0, corner, axis), of(1, corner, axis)]);
        let corner = |corner: usize| [coordinate(corner, 0), coordinate(corner, 1), coordinate(corner, 2)];
        let corners = [corner(0), corner(1), corner(2)];
        let (inside, t) = edges::decide(
            relative(corners[0], origin, slope),
            relative(corners[1], origin, slope),
            relative(corners[2], origin, slope),
            _mm512_cvtps_pd(depth),
            _mm512_cvtps_pd(t_min),
        );

        // The interval of each triangle's own box: the operations of `Slabs`.
        let mut reach = _mm256_setzero_ps();
        let mut extent = [[_mm256_setzero_ps(); 2]; 3];
        let sign = _mm256_set1_ps(-0.0);
        for i in 0..3 {
            let (a, b, c) = (corners[0][i], corners[1][i], corners[2][i]);
            let (min, max) = (_mm256_min_ps(_mm256_min_ps(a, b), c), _mm256_max_ps(_mm256_max_ps(a, b), c));
            let low = _mm256_andnot_ps(sign, _mm256_sub_ps(min, origin[i]));
            let high = _mm256_andnot_ps(sign, _mm256_sub_ps(max, origin[i]));
            reach = _mm256_max_ps(reach, _mm256_max_ps(low, high));
            extent[i] = [min, max];
        }
        let margin = _mm256_mul_ps(reach, _mm256_set1_ps(Slabs::MARGIN));
        let (mut entry, mut exit) = (t_min, _mm256_set1_ps(f32::INFINITY));
        for (i, [min, max]) in extent.into_iter().enumerate() {
            let own = _mm256_mul_ps(_mm256_andnot_ps(sign, origin[i]), _mm256_set1_ps(f32::EPSILON));
            let margin = _mm256_add_ps(margin, own);
            let margin = _mm256_add_ps(margin, _mm256_set1_ps(f32::MIN_POSITIVE));
            let low = _mm256_mul_ps(_mm256_sub_ps(min, _mm256_add_ps(origin[i], margin)), inverse[i]);
            let high = _mm256_mul_ps(_mm256_sub_ps(max, _mm256_sub_ps(origin[i], margin)), inverse[i]);
            entry = _mm256_max_ps(entry, _mm256_min_ps(low, high));
            exit = _mm256_min_ps(exit, _mm256_max_ps(low, high));
        }
        let exit = _mm256_mul_ps(exit, _mm256_set1_ps(Slabs::FAR));
        let moved = _mm256_add_ps(_mm256_max_ps(_mm256_min_ps(t, exit), entry), _mm256_setzero_ps());
        let in_range =
            _mm256_mask_cmp_ps_mask::<_CMP_LE_OQ>(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(entry, exit), moved, t_max);
        (inside & in_range, moved)
    }
}
