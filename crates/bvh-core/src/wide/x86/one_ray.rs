//! Exact answers in x86 vector registers: the traversal shared by the AVX2 and the AVX-512 kernel, and the exact test
//! of four triangles at once.

use super::box_ray::BoxRay;
use super::lanes::F32x8;
use crate::wide::instructions::{Instructions, Pending};
use crate::wide::kernel::STACK;
use crate::wide::lanes::{Lanes, Mask};
use crate::wide::layout::WideBvh;
use crate::wide::node::{Child, WideNode};
use crate::wide::portable::walk;
use crate::wide::triangles::TriangleBlock;
use crate::{Hit, Ray, Shear, Slabs};
use core::arch::x86_64::*;
use core::mem::MaybeUninit;

/// What aligns the frame of the function that holds it: otherwise the compiler keeps vectors of 32 bytes at odd multiples of
/// 16, by where its caller's frame happens to end, and then every other one crosses a line of the cache. That costs a ray
/// which misses everything 5 of 14 ns.
#[repr(align(32))]
struct Aligned<T>(T);

/// The distances at which the ray enters the eight boxes of a node, and a bit for each box entered before `t_max`.
#[inline(always)]
unsafe fn boxes(node: &WideNode, ray: &BoxRay, t_min: f32, t_max: f32) -> (F32x8, u32) {
    // SAFETY: the caller has AVX2 and FMA; loads are of whole, aligned planes of 32 bytes, which `BoxRay` names.
    unsafe {
        let distance = |plane: usize, scale: __m256, shift: __m256| {
            _mm256_fmadd_ps(_mm256_load_ps(node.planes.as_ptr().add(plane).cast()), scale, shift)
        };
        let near =
            |axis: usize| distance(ray.near[axis], ray.near_scale[axis], ray.near_shift[axis]);
        let far = |axis: usize| distance(ray.far[axis], ray.far_scale[axis], ray.far_shift[axis]);
        let entry = _mm256_max_ps(near(2), _mm256_set1_ps(t_min));
        let entry = _mm256_max_ps(_mm256_max_ps(near(0), near(1)), entry);
        let exit = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), far(2));
        // Of a NaN and a number the instruction gives the second operand: unused lanes stay NaN.
        let exit = F32x8(_mm256_min_ps(_mm256_set1_ps(t_max), exit));
        (F32x8(entry), F32x8(entry).le(exit).bits())
    }
}

/// The nearest hit as distance and object; the object is `u32::MAX` if there is none.
///
/// # Safety
/// The processor has the instructions of `K`, and the caller is compiled with them; the references of `wide` are
/// sound and its `stack_need` is at most [`STACK`].
#[inline(always)]
pub(crate) unsafe fn nearest<K: Instructions<Boxes = F32x8>>(
    wide: &WideBvh,
    ray: &Ray,
) -> (f32, u32) {
    // SAFETY: the caller's promises.
    unsafe {
        let (Some(root), Some(box_ray)) = (wide.root, BoxRay::new(ray, wide.largest)) else {
            return nearest_portable(wide, ray);
        };
        let box_ray = &box_ray;
        let nodes = wide.nodes.as_ptr();
        let blocks = wide.blocks.as_ptr();
        let mut stack = MaybeUninit::<Aligned<[Pending; STACK + 8]>>::uninit();
        let base = stack.as_mut_ptr().cast::<Pending>();
        let mut top = base;
        let mut shear = MaybeUninit::<Shear4>::uninit();
        let mut sheared = false;
        let mut t_max = ray.t_max();
        let mut object = u32::MAX;
        let mut child = root;
        loop {
            while child.is_node() {
                let node = &*nodes.add(child.index());
                let (entry, mask) = boxes(node, box_ray, ray.t_min(), t_max);
                if mask & mask.wrapping_sub(1) == 0 {
                    if mask == 0 {
                        break;
                    }
                    child = *node
                        .children
                        .get_unchecked(mask.trailing_zeros() as usize);
                    continue;
                }
                child = K::sort(node, entry, mask, top);
                top = top.add(mask.count_ones() as usize - 1);
            }
            if !child.is_node() {
                if !sheared {
                    shear.write(Shear4::new(ray));
                    sheared = true;
                }
                let mut block = blocks.add(child.index());
                loop {
                    let mut candidates = shear.assume_init_ref().candidates(&*block);
                    while candidates != 0 {
                        // Four lanes at a time, those without candidates left out.
                        let first = candidates.trailing_zeros() as usize & !3;
                        let (mut hits, t) =
                            shear
                                .assume_init_ref()
                                .decide(&*block, first, ray.t_min(), t_max);
                        candidates &= !(0b1111 << first);
                        if hits != 0 {
                            let t: [f32; 4] = core::mem::transmute(t);
                            while hits != 0 {
                                let lane = hits.trailing_zeros() as usize & 3;
                                hits &= hits - 1;
                                let hit = Hit { t: t[lane], object: (*block).id(first + lane) };
                                if hit.precedes(&Hit { t: t_max, object }) {
                                    (t_max, object) = (hit.t, hit.object);
                                }
                            }
                        }
                    }
                    if (*block).is_last() {
                        break;
                    }
                    block = block.add(1);
                }
            }
            child = loop {
                if top == base {
                    return (t_max, object);
                }
                top = top.sub(1);
                let pending = *top;
                if (pending >> 32) as u32 <= t_max.to_bits() | 7 {
                    break Child::from_bits(pending as u32);
                }
            };
        }
    }
}

#[cold]
#[inline(never)]
fn nearest_portable(wide: &WideBvh, ray: &Ray) -> (f32, u32) {
    walk::<false>(wide, ray, &mut (), |_| true).map_or((0.0, u32::MAX), |hit| (hit.t, hit.object))
}

#[cold]
#[inline(never)]
fn any_portable(wide: &WideBvh, ray: &Ray) -> bool {
    walk::<true>(wide, ray, &mut (), |_| true).is_some()
}

/// Whether the ray meets any triangle.
///
/// # Safety
/// As [`nearest`].
#[inline(always)]
pub(crate) unsafe fn any<K: Instructions<Boxes = F32x8>>(wide: &WideBvh, ray: &Ray) -> bool {
    // SAFETY: the caller's promises.
    unsafe {
        let (Some(root), Some(box_ray)) = (wide.root, BoxRay::new(ray, wide.largest)) else {
            return any_portable(wide, ray);
        };
        let box_ray = &box_ray;
        let nodes = wide.nodes.as_ptr();
        let blocks = wide.blocks.as_ptr();
        let mut stack = MaybeUninit::<Aligned<[Child; STACK + 8]>>::uninit();
        let base = stack.as_mut_ptr().cast::<Child>();
        let mut top = base;
        let mut shear = MaybeUninit::<Shear4>::uninit();
        let mut sheared = false;
        let t_min = ray.t_min();
        let t_max = ray.t_max();
        let mut child = root;
        loop {
            while child.is_node() {
                let node = &*nodes.add(child.index());
                let (_, mask) = boxes(node, box_ray, t_min, t_max);
                if mask == 0 {
                    break;
                }
                child = *node.children.get_unchecked(mask.ilog2() as usize);
                if mask & (mask - 1) != 0 {
                    K::compress(node, mask, top);
                    top = top.add(mask.count_ones() as usize - 1);
                }
            }
            if !child.is_node() {
                if !sheared {
                    shear.write(Shear4::new(ray));
                    sheared = true;
                }
                let mut block = blocks.add(child.index());
                loop {
                    let mut candidates = shear.assume_init_ref().candidates(&*block);
                    while candidates != 0 {
                        let first = candidates.trailing_zeros() as usize & !3;
                        if shear
                            .assume_init_ref()
                            .decide(&*block, first, ray.t_min(), t_max)
                            .0
                            != 0
                        {
                            return true;
                        }
                        candidates &= !(0b1111 << first);
                    }
                    if (*block).is_last() {
                        break;
                    }
                    block = block.add(1);
                }
            }
            if top == base {
                return false;
            }
            top = top.sub(1);
            child = *top;
        }
    }
}

/// A [`Shear`] in vector registers, with what [`Slabs`] needs, in the order of its axes.
pub(crate) struct Shear4 {
    axes: [usize; 3],
    origin: [f32; 3],
    slope: [f32; 2],
    depth: f64,
    inverse: [f32; 3],
    /// The part of the margin of `Slabs` that depends on the origin alone.
    origin_margin: [f32; 3],
}

impl Shear4 {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let shear = Shear::new(ray);
        let inverse = ray.inverse_direction().to_array();
        Self {
            axes: shear.axes,
            origin: shear.origin,
            slope: shear.slope,
            depth: shear.depth,
            inverse: shear.axes.map(|axis| inverse[axis]),
            origin_margin: shear.origin.map(|x| x.abs() * f32::EPSILON),
        }
    }

    /// Four corners from `lane` on, relative to the ray: along x, y and z of the shear.
    #[inline(always)]
    unsafe fn apply(&self, block: &TriangleBlock, lane: usize) -> [[__m128; 3]; 3] {
        // SAFETY: SSE2 is part of x86-64; axes are below 3 and `lane` is a multiple of four.
        unsafe {
            let [kx, ky, kz] = self.axes;
            let mut sheared = [[_mm_setzero_ps(); 3]; 3];
            for (corner, sheared) in block.corners.iter().zip(&mut sheared) {
                let lanes = corner.as_ptr().cast::<f32>().add(lane);
                let x = _mm_sub_ps(
                    _mm_load_ps(lanes.add(kx * TriangleBlock::LANES)),
                    _mm_set1_ps(self.origin[0]),
                );
                let y = _mm_sub_ps(
                    _mm_load_ps(lanes.add(ky * TriangleBlock::LANES)),
                    _mm_set1_ps(self.origin[1]),
                );
                let z = _mm_sub_ps(
                    _mm_load_ps(lanes.add(kz * TriangleBlock::LANES)),
                    _mm_set1_ps(self.origin[2]),
                );
                sheared[0] = _mm_sub_ps(x, _mm_mul_ps(_mm_set1_ps(self.slope[0]), z));
                sheared[1] = _mm_sub_ps(y, _mm_mul_ps(_mm_set1_ps(self.slope[1]), z));
                sheared[2] = z;
            }
            sheared
        }
    }

    /// A bit per triangle that the ray's line may meet: the sides of the edges in f32, of which the sign is right or the
    /// value zero.
    #[inline(always)]
    pub(crate) unsafe fn candidates(&self, block: &TriangleBlock) -> u32 {
        // SAFETY: the caller has AVX; axes are below 3.
        unsafe {
            let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = self.apply(block, 0);
            let u = _mm_sub_ps(_mm_mul_ps(cx, by), _mm_mul_ps(cy, bx));
            let v = _mm_sub_ps(_mm_mul_ps(ax, cy), _mm_mul_ps(ay, cx));
            let w = _mm_sub_ps(_mm_mul_ps(bx, ay), _mm_mul_ps(by, ax));
            let zero = _mm_setzero_ps();
            let negative = _mm_cmplt_ps(_mm_min_ps(_mm_min_ps(u, v), w), zero);
            let positive = _mm_cmpgt_ps(_mm_max_ps(_mm_max_ps(u, v), w), zero);
            !_mm_movemask_ps(_mm_and_ps(negative, positive)) as u32 & 0b1111
        }
    }

    /// A bit per triangle that [`Triangle::intersect`](crate::Triangle::intersect) accepts up to `t_max`, and its
    /// distances, bit by bit. No triangle is degenerate.
    #[inline(always)]
    pub(crate) unsafe fn decide(
        &self,
        block: &TriangleBlock,
        lane: usize,
        t_min: f32,
        t_max: f32,
    ) -> (u32, __m128) {
        // SAFETY: as the caller's.
        unsafe {
            let [a, b, c] = self.apply(block, lane);
            let ax = _mm256_cvtps_pd(a[0]);
            let ay = _mm256_cvtps_pd(a[1]);
            let az = _mm256_cvtps_pd(a[2]);
            let bx = _mm256_cvtps_pd(b[0]);
            let by = _mm256_cvtps_pd(b[1]);
            let bz = _mm256_cvtps_pd(b[2]);
            let cx = _mm256_cvtps_pd(c[0]);
            let cy = _mm256_cvtps_pd(c[1]);
            let cz = _mm256_cvtps_pd(c[2]);
            // Products of two f32 are exact in f64: fused or not, the difference is the same.
            let u = _mm256_fmsub_pd(cx, by, _mm256_mul_pd(cy, bx));
            let v = _mm256_fmsub_pd(ax, cy, _mm256_mul_pd(ay, cx));
            let w = _mm256_fmsub_pd(bx, ay, _mm256_mul_pd(by, ax));
            let zero = _mm256_setzero_pd();
            let least = _mm256_min_pd(_mm256_min_pd(u, v), w);
            let most = _mm256_max_pd(_mm256_max_pd(u, v), w);
            let determinant = _mm256_add_pd(_mm256_add_pd(u, v), w);
            let negative = _mm256_cmp_pd::<_CMP_LT_OQ>(least, zero);
            let outside = _mm256_and_pd(negative, _mm256_cmp_pd::<_CMP_GT_OQ>(most, zero));
            let outside = _mm256_or_pd(outside, _mm256_cmp_pd::<_CMP_EQ_OQ>(determinant, zero));
            let u = _mm256_mul_pd(u, az);
            let v = _mm256_mul_pd(v, bz);
            let w = _mm256_mul_pd(w, cz);
            let sum = _mm256_add_pd(_mm256_add_pd(u, v), w);
            let t = _mm256_div_pd(sum, _mm256_mul_pd(determinant, _mm256_set1_pd(self.depth)));
            let after = _mm256_cmp_pd::<_CMP_GE_OQ>(t, _mm256_set1_pd(f64::from(t_min)));
            let inside = _mm256_movemask_pd(_mm256_andnot_pd(outside, after)) as u32;
            let t = _mm256_cvtpd_ps(t);

            // The interval of each triangle's own box: the operations of `Slabs`.
            let mut reach = _mm_setzero_ps();
            let mut relative = [[_mm_setzero_ps(); 2]; 3];
            let sign = _mm_set1_ps(-0.0);
            for (i, &axis) in self.axes.iter().enumerate() {
                let lanes = block
                    .corners
                    .as_ptr()
                    .cast::<f32>()
                    .add(axis * TriangleBlock::LANES + lane);
                let a = _mm_load_ps(lanes);
                let b = _mm_load_ps(lanes.add(3 * TriangleBlock::LANES));
                let c = _mm_load_ps(lanes.add(6 * TriangleBlock::LANES));
                let min = _mm_min_ps(_mm_min_ps(a, b), c);
                let max = _mm_max_ps(_mm_max_ps(a, b), c);
                let origin = _mm_set1_ps(self.origin[i]);
                let low = _mm_andnot_ps(sign, _mm_sub_ps(min, origin));
                let high = _mm_andnot_ps(sign, _mm_sub_ps(max, origin));
                reach = _mm_max_ps(reach, _mm_max_ps(low, high));
                relative[i] = [min, max];
            }
            let margin = _mm_mul_ps(reach, _mm_set1_ps(Slabs::MARGIN));
            let mut entry = _mm_set1_ps(t_min);
            let mut exit = _mm_set1_ps(f32::INFINITY);
            for (i, [min, max]) in relative.into_iter().enumerate() {
                let margin = _mm_add_ps(margin, _mm_set1_ps(self.origin_margin[i]));
                let margin = _mm_add_ps(margin, _mm_set1_ps(f32::MIN_POSITIVE));
                let origin = _mm_set1_ps(self.origin[i]);
                let inverse = _mm_set1_ps(self.inverse[i]);
                let low = _mm_mul_ps(_mm_sub_ps(min, _mm_add_ps(origin, margin)), inverse);
                let high = _mm_mul_ps(_mm_sub_ps(max, _mm_sub_ps(origin, margin)), inverse);
                entry = _mm_max_ps(entry, _mm_min_ps(low, high));
                exit = _mm_min_ps(exit, _mm_max_ps(low, high));
            }
            let exit = _mm_mul_ps(exit, _mm_set1_ps(Slabs::FAR));
            let moved = _mm_add_ps(_mm_max_ps(_mm_min_ps(t, exit), entry), _mm_setzero_ps());
            let in_range =
                _mm_and_ps(_mm_cmple_ps(entry, exit), _mm_cmple_ps(moved, _mm_set1_ps(t_max)));
            (inside & _mm_movemask_ps(in_range) as u32, moved)
        }
    }
}
