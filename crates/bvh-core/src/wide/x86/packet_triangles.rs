//! Sixteen rays against one triangle, exactly.

use super::answer::Answer;
use super::edges;
use super::prepared::Sixteen;
use crate::Slabs;
use crate::triangle::AXES;
use crate::wide::triangles::TriangleBlock;
use core::arch::x86_64::*;

/// The shears of sixteen rays, along x, y and z of the shear. Made at the first leaf: many packets come to none.
pub(super) struct Shears {
    axes: [usize; 3],
    origin: [__m512; 3],
    inverse: [__m512; 3],
    slope: [__m512; 2],
    depth: __m512,
    t_min: __m512,
}

/// The nearest hits of sixteen rays so far, or the ends of the rays and `u32::MAX`.
pub(super) struct Nearest {
    pub(super) t: __m512,
    pub(super) object: __m512i,
}

impl Shears {
    #[inline(always)]
    pub(super) unsafe fn new(sixteen: &Sixteen) -> Self {
        let Sixteen { origin, direction, inverse, t_min, second, third, .. } = sixteen;
        let axes @ [kx, ky, kz] = AXES[if *third != 0 { 2 } else { usize::from(*second != 0) }];
        // SAFETY: the caller has AVX-512.
        let slope = unsafe {
            [_mm512_div_ps(direction[kx], direction[kz]), _mm512_div_ps(direction[ky], direction[kz])]
        };
        let [origin, inverse] = [origin, inverse].map(|by_axis| [by_axis[kx], by_axis[ky], by_axis[kz]]);
        Self { axes, origin, inverse, slope, depth: direction[kz], t_min: *t_min }
    }

    /// One corner relative to the rays: along x, y and z of the shear.
    #[inline(always)]
    unsafe fn apply(&self, corner: &[[f32; TriangleBlock::LANES]; 3], lane: usize) -> [__m512; 3] {
        // SAFETY: the caller's promises; axes are below 3.
        unsafe {
            let lanes = corner.as_ptr().cast::<f32>().add(lane);
            let coordinate = |axis: usize| *lanes.add(axis * TriangleBlock::LANES);
            let x = _mm512_sub_ps(_mm512_set1_ps(coordinate(self.axes[0])), self.origin[0]);
            let y = _mm512_sub_ps(_mm512_set1_ps(coordinate(self.axes[1])), self.origin[1]);
            let z = _mm512_sub_ps(_mm512_set1_ps(coordinate(self.axes[2])), self.origin[2]);
            let (x_shift, y_shift) = (_mm512_mul_ps(self.slope[0], z), _mm512_mul_ps(self.slope[1], z));
            [_mm512_sub_ps(x, x_shift), _mm512_sub_ps(y, y_shift), z]
        }
    }

    /// A bit per ray whose line may meet the triangle in a lane, by the sides of its edges in f32.
    #[inline(always)]
    pub(super) unsafe fn candidates(&self, block: &TriangleBlock, lane: usize) -> u16 {
        // SAFETY: the caller's promises.
        unsafe {
            let [ax, ay, _] = self.apply(&block.corners[0], lane);
            let [bx, by, _] = self.apply(&block.corners[1], lane);
            let [cx, cy, _] = self.apply(&block.corners[2], lane);
            edges::candidates((ax, ay), (bx, by), (cx, cy))
        }
    }
    /// Decides exactly, as [`Triangle::intersect`](crate::Triangle::intersect), which rays hit the triangle in a lane, and
    /// keeps those hits that precede the rays' nearest; whether there are any.
    #[inline(always)]
    pub(super) unsafe fn decide<A: Answer>(
        &self,
        block: &TriangleBlock,
        lane: usize,
        candidates: u16,
        nearest: &mut Nearest,
    ) -> bool {
        // SAFETY: the caller's promises.
        unsafe {
            let a = self.apply(&block.corners[0], lane);
            let b = self.apply(&block.corners[1], lane);
            let c = self.apply(&block.corners[2], lane);
            let (low, low_t) = self.decide_half::<0>(&a, &b, &c);
            let (high, high_t) = self.decide_half::<1>(&a, &b, &c);
            let inside = candidates & (u16::from(low) | u16::from(high) << 8);
            if inside == 0 {
                return false;
            }
            let t = _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low_t), high_t);

            // The interval of the triangle's own box: the operations of `Slabs`.
            let mut reach = _mm512_setzero_ps();
            let mut corners = [[_mm512_setzero_ps(); 2]; 3];
            for (i, &axis) in self.axes.iter().enumerate() {
                let (a, b) = (block.corners[0][axis][lane], block.corners[1][axis][lane]);
                let c = block.corners[2][axis][lane];
                let (min, max) = (_mm512_set1_ps(a.min(b).min(c)), _mm512_set1_ps(a.max(b).max(c)));
                let low = _mm512_abs_ps(_mm512_sub_ps(min, self.origin[i]));
                let high = _mm512_abs_ps(_mm512_sub_ps(max, self.origin[i]));
                reach = _mm512_max_ps(reach, _mm512_max_ps(low, high));
                corners[i] = [min, max];
            }
            let reach = _mm512_mul_ps(reach, _mm512_set1_ps(Slabs::MARGIN));
            let (mut entry, mut exit) = (self.t_min, _mm512_set1_ps(f32::INFINITY));
            for (i, [min, max]) in corners.into_iter().enumerate() {
                let own = _mm512_mul_ps(_mm512_abs_ps(self.origin[i]), _mm512_set1_ps(f32::EPSILON));
                let margin = _mm512_add_ps(_mm512_add_ps(reach, own), _mm512_set1_ps(f32::MIN_POSITIVE));
                let low =
                    _mm512_mul_ps(_mm512_sub_ps(min, _mm512_add_ps(self.origin[i], margin)), self.inverse[i]);
                let high =
                    _mm512_mul_ps(_mm512_sub_ps(max, _mm512_sub_ps(self.origin[i], margin)), self.inverse[i]);
                entry = _mm512_max_ps(entry, _mm512_min_ps(low, high));
                exit = _mm512_min_ps(exit, _mm512_max_ps(low, high));
            }
            let exit = _mm512_mul_ps(exit, _mm512_set1_ps(Slabs::FAR));
            let moved = _mm512_add_ps(_mm512_max_ps(_mm512_min_ps(t, exit), entry), _mm512_setzero_ps());
            let inside = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(inside, entry, exit);
            if A::ANY {
                let hits = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(inside, moved, nearest.t);
                // A ray that has its answer ends before it begins.
                nearest.t = _mm512_mask_mov_ps(nearest.t, hits, _mm512_set1_ps(-1.0));
                nearest.object = _mm512_mask_mov_epi32(nearest.object, hits, _mm512_setzero_si512());
                return hits != 0;
            }
            let object = _mm512_set1_epi32(block.id(lane) as i32);
            let nearer = _mm512_mask_cmp_ps_mask::<_CMP_LT_OQ>(inside, moved, nearest.t);
            let equal = _mm512_mask_cmp_ps_mask::<_CMP_EQ_OQ>(inside, moved, nearest.t);
            let hits = nearer | _mm512_mask_cmplt_epu32_mask(equal, object, nearest.object);
            nearest.t = _mm512_mask_mov_ps(nearest.t, hits, moved);
            nearest.object = _mm512_mask_mov_epi32(nearest.object, hits, object);
            hits != 0
        }
    }

    /// Eight of the rays against one triangle in f64: which have it in front of them and inside its edges, and where.
    #[inline(always)]
    unsafe fn decide_half<const HALF: i32>(
        &self,
        a: &[__m512; 3],
        b: &[__m512; 3],
        c: &[__m512; 3],
    ) -> (u8, __m256) {
        // SAFETY: the caller's promises.
        unsafe {
            edges::decide(
                [double::<HALF>(a[0]), double::<HALF>(a[1]), double::<HALF>(a[2])],
                [double::<HALF>(b[0]), double::<HALF>(b[1]), double::<HALF>(b[2])],
                [double::<HALF>(c[0]), double::<HALF>(c[1]), double::<HALF>(c[2])],
                double::<HALF>(self.depth),
                double::<HALF>(self.t_min),
            )
        }
    }
}

/// Eight of sixteen numbers in f64.
#[inline(always)]
unsafe fn double<const HALF: i32>(x: __m512) -> __m512d {
    // SAFETY: the caller has AVX-512 DQ.
    unsafe {
        if HALF == 0 {
            _mm512_cvtps_pd(_mm512_castps512_ps256(x))
        } else {
            _mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(x))
        }
    }
}
