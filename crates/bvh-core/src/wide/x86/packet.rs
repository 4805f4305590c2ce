//! Packets of sixteen coherent rays, one per lane of AVX-512: nodes are culled for all rays at once by interval
//! arithmetic, boxes and triangles tested against sixteen rays each.

use super::answer::Answer;
use super::avx512::Avx512;
use super::box_ray::BoxRay;
use super::one_ray::{Instructions, Pending};
use super::prepared::{Axis, RAYS, Sixteen};
use crate::triangle::AXES;
use crate::wide::kernel::STACK;
use crate::wide::layout::WideBvh;
use crate::wide::node::Child;
use crate::wide::node::WideNode;
use crate::wide::triangles::TriangleBlock;
use core::arch::x86_64::*;
use core::mem::MaybeUninit;

/// Sixteen rays with the same signs of direction and the same largest component of it.
pub(crate) struct Packet<'a> {
    pub(super) sixteen: &'a Sixteen,
    /// Indices of the planes that the rays meet first, by axis, and of those opposite.
    near: [usize; 3],
    far: [usize; 3],
    bounds: [AxisBounds; 3],
    /// The axes of the shear; what follows is in their order.
    pub(super) axes: [usize; 3],
    pub(super) origin: [__m512; 3],
    pub(super) inverse: [__m512; 3],
    pub(super) slope: [__m512; 2],
    pub(super) depth: __m512,
    least_t_min: f32,
    /// The nearest hits so far, or the ends of the rays.
    pub(super) t: __m512,
    pub(super) object: __m512i,
}

/// What interval arithmetic knows of sixteen rays along one axis: the origins with the margin of near and of far planes
/// that make the distance least and greatest, and the least and the greatest scale.
#[derive(Clone, Copy)]
struct AxisBounds {
    near_origin: f32,
    far_origin: f32,
    near_scale: [f32; 2],
    far_scale: [f32; 2],
}

impl AxisBounds {
    #[inline(always)]
    unsafe fn new(axis: &Axis) -> Self {
        // SAFETY: the caller has AVX-512.
        unsafe {
            let Axis { near_origin, far_origin, near_scale, far_scale, .. } = *axis;
            // Distances grow with the plane minus the origin if the scale is positive, else the other way.
            let (far_origin, near_origin) = if axis.backwards != 0 {
                (_mm512_reduce_max_ps(far_origin), _mm512_reduce_min_ps(near_origin))
            } else {
                (_mm512_reduce_min_ps(far_origin), _mm512_reduce_max_ps(near_origin))
            };
            Self {
                near_origin,
                far_origin,
                near_scale: [_mm512_reduce_min_ps(near_scale), _mm512_reduce_max_ps(near_scale)],
                far_scale: [_mm512_reduce_min_ps(far_scale), _mm512_reduce_max_ps(far_scale)],
            }
        }
    }
}

impl<'a> Packet<'a> {
    /// A packet of rays that [cohere](Sixteen::cohere).
    ///
    /// # Safety
    /// The caller is compiled with AVX-512 F, VL, DQ and BW and with FMA.
    #[inline(always)]
    pub(crate) unsafe fn new(sixteen: &'a Sixteen) -> Self {
        // SAFETY: the caller's promise.
        unsafe {
            let Sixteen { origin, direction, inverse, t_min, t_max, second, third, .. } = sixteen;
            let axes @ [kx, ky, kz] = AXES[if *third != 0 { 2 } else { usize::from(*second != 0) }];
            let [x, y, z] = &sixteen.axes;
            let plane = |axis: usize, of: &Axis| axis + 3 * usize::from(of.backwards != 0);
            let near = [plane(0, x), plane(1, y), plane(2, z)];
            Self {
                sixteen,
                near,
                far: [3 - near[0], 5 - near[1], 7 - near[2]],
                bounds: [AxisBounds::new(x), AxisBounds::new(y), AxisBounds::new(z)],
                axes,
                origin: [origin[kx], origin[ky], origin[kz]],
                inverse: [inverse[kx], inverse[ky], inverse[kz]],
                slope: [
                    _mm512_div_ps(direction[kx], direction[kz]),
                    _mm512_div_ps(direction[ky], direction[kz]),
                ],
                depth: direction[kz],
                least_t_min: _mm512_reduce_min_ps(*t_min),
                t: *t_max,
                object: _mm512_set1_epi32(-1),
            }
        }
    }

    /// Traces the packet. Where [`Answer::ANY`] a ray ends at its first hit, which need not be the nearest.
    ///
    /// # Safety
    /// As [`nearest`](super::one_ray::nearest), with AVX-512.
    #[inline(always)]
    pub(crate) unsafe fn trace<A: Answer>(&mut self, wide: &WideBvh) {
        let Some(root) = wide.root else { return };
        // SAFETY: the caller's promises.
        unsafe {
            let (nodes, blocks) = (wide.nodes.as_ptr(), wide.blocks.as_ptr());
            let mut stack = MaybeUninit::<[Pending; STACK + 8]>::uninit();
            let base = stack.as_mut_ptr().cast::<Pending>();
            let mut top = base;
            let mut farthest = _mm512_reduce_max_ps(self.t);
            let mut child = root;
            loop {
                while child.is_node() {
                    let node = &*nodes.add(child.index());
                    let (entry, mut mask) = self.cull(node, farthest);
                    let mut others = mask;
                    while others != 0 {
                        let lane = others.trailing_zeros() as usize;
                        if !self.enters(node, lane) {
                            mask &= !(1 << lane);
                        }
                        others &= others - 1;
                    }
                    if mask & mask.wrapping_sub(1) == 0 {
                        if mask == 0 {
                            break;
                        }
                        child = *node.children.get_unchecked(mask.trailing_zeros() as usize);
                        continue;
                    }
                    child = Avx512::sort(node, entry, mask, top);
                    top = top.add(mask.count_ones() as usize - 1);
                }
                if !child.is_node() {
                    let mut block = blocks.add(child.index());
                    let mut is_hit = false;
                    loop {
                        for lane in 0..TriangleBlock::LANES {
                            let candidates = self.candidates(&*block, lane);
                            if candidates != 0 {
                                is_hit |= self.decide::<A>(&*block, lane, candidates);
                            }
                        }
                        if (*block).is_last() {
                            break;
                        }
                        block = block.add(1);
                    }
                    if is_hit {
                        farthest = _mm512_reduce_max_ps(self.t);
                        if A::ANY && farthest < 0.0 {
                            return;
                        }
                    }
                }
                child = loop {
                    if top == base {
                        return;
                    }
                    top = top.sub(1);
                    let pending = *top;
                    if (pending >> 32) as u32 <= farthest.to_bits() | 7 {
                        break Child::from_bits(pending as u32);
                    }
                };
            }
        }
    }

    /// The least distance at which any ray may enter each child, and a bit per child that some ray may enter before
    /// `farthest`: the bounds of `(plane − origin) · scale` over all rays. Conservative by the proof of [`BoxRay`], whose
    /// first step is not needed here, since nothing is shifted.
    #[inline(always)]
    unsafe fn cull(&self, node: &WideNode, farthest: f32) -> (__m256, u32) {
        // SAFETY: the caller's promises; loads are of whole, aligned planes of 32 bytes.
        unsafe {
            let tiny = _mm256_set1_ps(BoxRay::UNDERFLOW);
            let (mut entry, mut exit) = (_mm256_set1_ps(self.least_t_min), _mm256_set1_ps(farthest));
            for axis in 0..3 {
                let bounds = &self.bounds[axis];
                let near = _mm256_load_ps(node.planes.as_ptr().add(self.near[axis]).cast());
                let near = _mm256_sub_ps(near, _mm256_set1_ps(bounds.near_origin));
                let one = _mm256_fmsub_ps(near, _mm256_set1_ps(bounds.near_scale[0]), tiny);
                let two = _mm256_fmsub_ps(near, _mm256_set1_ps(bounds.near_scale[1]), tiny);
                // Of two zeros the instruction gives the second operand: entries are never −0.
                entry = _mm256_max_ps(_mm256_min_ps(one, two), entry);
                let far = _mm256_load_ps(node.planes.as_ptr().add(self.far[axis]).cast());
                let far = _mm256_sub_ps(far, _mm256_set1_ps(bounds.far_origin));
                let one = _mm256_fmadd_ps(far, _mm256_set1_ps(bounds.far_scale[0]), tiny);
                let two = _mm256_fmadd_ps(far, _mm256_set1_ps(bounds.far_scale[1]), tiny);
                // Of a NaN and a number the instruction gives the second operand: unused lanes stay NaN.
                exit = _mm256_min_ps(exit, _mm256_max_ps(one, two));
            }
            (entry, u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(entry, exit)))
        }
    }

    /// Whether any ray enters the child in a lane before its nearest hit.
    #[inline(always)]
    unsafe fn enters(&self, node: &WideNode, lane: usize) -> bool {
        // SAFETY: the caller's promises; planes are six, lanes eight.
        unsafe {
            let planes = node.planes.as_ptr().cast::<f32>().add(lane);
            let (mut entry, mut exit) = (self.sixteen.t_min, self.t);
            for axis in 0..3 {
                let near = _mm512_set1_ps(*planes.add(8 * self.near[axis]));
                entry = _mm512_max_ps(
                    entry,
                    _mm512_fmadd_ps(
                        near,
                        self.sixteen.axes[axis].near_scale,
                        self.sixteen.axes[axis].near_shift,
                    ),
                );
                let far = _mm512_set1_ps(*planes.add(8 * self.far[axis]));
                exit = _mm512_min_ps(
                    exit,
                    _mm512_fmadd_ps(far, self.sixteen.axes[axis].far_scale, self.sixteen.axes[axis].far_shift),
                );
            }
            _mm512_cmp_ps_mask::<_CMP_LE_OQ>(entry, exit) != 0
        }
    }

    /// The distances and objects of the rays' hits; the object is `u32::MAX` for a ray without one.
    #[inline(always)]
    pub(crate) fn hits(&self) -> ([f32; RAYS], [u32; RAYS]) {
        // SAFETY: both are sixteen plain values of four bytes.
        unsafe {
            (
                core::mem::transmute::<__m512, [f32; RAYS]>(self.t),
                core::mem::transmute::<__m512i, [u32; RAYS]>(self.object),
            )
        }
    }
}
