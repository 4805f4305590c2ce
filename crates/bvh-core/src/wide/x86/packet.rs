//! Packets of sixteen coherent rays, one per lane of AVX-512: nodes are culled for all rays at once by interval
//! arithmetic, boxes and triangles tested against sixteen rays each.

use super::answer::Answer;
use super::avx512::Avx512;
use super::box_ray::BoxRay;
use super::one_ray::{Instructions, Pending};
use super::packet_triangles::{Nearest, Shears};
use super::prepared::{Axis, RAYS, Sixteen};
use crate::wide::kernel::STACK;
use crate::wide::layout::WideBvh;
use crate::wide::node::Child;
use crate::wide::node::WideNode;
use core::arch::x86_64::*;
use core::mem::MaybeUninit;

/// Sixteen rays with the same signs of direction and the same largest component of it.
pub(crate) struct Packet<'a> {
    sixteen: &'a Sixteen,
    /// Indices of the planes that the rays meet first, by axis, and of those opposite.
    near: [usize; 3],
    far: [usize; 3],
    bounds: Bounds,
    nearest: Nearest,
}

/// What interval arithmetic knows of sixteen rays. Lane `4 · axis` is the origin with the margin of near planes that makes
/// the distance least, the next the one of far planes that makes it greatest; two more are the greatest and the least
/// scale. Behind the axes are the least distance at which a ray begins and the greatest at which one ends.
struct Bounds {
    of: [f32; RAYS],
    /// The same, scaled as near planes and as far ones are: the least product is that of the least factor.
    near: [f32; RAYS],
    far: [f32; RAYS],
}

impl Bounds {
    const NEAR_ORIGIN: usize = 0;
    const FAR_ORIGIN: usize = 1;
    const MOST: usize = 2;
    const LEAST: usize = 3;
    const BEGIN: usize = 12;
    const END: usize = 13;

    /// Of all sixteen vectors the greatest lanes are found together, in a third of the instructions that they take one by
    /// one. What is wanted least is negated before and after, and so are origins where rays run backwards: distances grow
    /// with the plane minus the origin if the scale is positive, else the other way.
    #[inline(always)]
    unsafe fn new(sixteen: &Sixteen) -> Self {
        let Sixteen { axes: [x, y, z], t_min, t_max, .. } = sixteen;
        let signs = [Self::signs(x), Self::signs(y), Self::signs(z), [MINUS, 0, 0, 0]];
        // SAFETY: the caller has AVX-512; all are sixteen plain values of four bytes.
        unsafe {
            let ends = pair(flip(*t_min, MINUS), *t_max);
            let of =
                quarters(quarters(Self::along(x), Self::along(y)), quarters(Self::along(z), four(ends, ends)));
            let of = _mm512_xor_ps(of, core::mem::transmute::<[[u32; 4]; 4], __m512>(signs));
            let near = _mm512_mul_ps(of, _mm512_set1_ps(BoxRay::NEAR));
            let far = _mm512_mul_ps(of, _mm512_set1_ps(BoxRay::FAR));
            Self {
                of: core::mem::transmute::<__m512, [f32; RAYS]>(of),
                near: core::mem::transmute::<__m512, [f32; RAYS]>(near),
                far: core::mem::transmute::<__m512, [f32; RAYS]>(far),
            }
        }
    }

    /// What is negated along an axis.
    #[inline(always)]
    fn signs(axis: &Axis) -> [u32; 4] {
        let backwards = u32::from(axis.backwards) << 31;
        [backwards, backwards ^ MINUS, 0, MINUS]
    }

    #[inline(always)]
    unsafe fn along(axis: &Axis) -> __m512 {
        let [near, far, most, least] = Self::signs(axis);
        // SAFETY: the caller has AVX-512.
        unsafe {
            let origins = pair(flip(axis.near_origin, near), flip(axis.far_origin, far));
            four(origins, pair(flip(axis.scale, most), flip(axis.scale, least)))
        }
    }
}

/// The bit of the sign.
const MINUS: u32 = 1 << 31;

/// Negated, if `sign` is [`MINUS`].
#[inline(always)]
unsafe fn flip(x: __m512, sign: u32) -> __m512 {
    // SAFETY: the caller has AVX-512.
    unsafe { _mm512_xor_ps(x, _mm512_castsi512_ps(_mm512_set1_epi32(sign as i32))) }
}

/// In each quarter the greater of lanes 0 and 2 of both, then of lanes 1 and 3.
#[inline(always)]
unsafe fn pair(a: __m512, b: __m512) -> __m512 {
    // SAFETY: the caller has AVX-512.
    unsafe { _mm512_max_ps(_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b)) }
}

/// The greatest lanes of the quarters of two pairs.
#[inline(always)]
unsafe fn four(ab: __m512, cd: __m512) -> __m512 {
    // SAFETY: the caller has AVX-512.
    unsafe {
        let (ab, cd) = (_mm512_castps_pd(ab), _mm512_castps_pd(cd));
        let (even, odd) = (_mm512_unpacklo_pd(ab, cd), _mm512_unpackhi_pd(ab, cd));
        _mm512_max_ps(_mm512_castpd_ps(even), _mm512_castpd_ps(odd))
    }
}

/// The greater of the first two quarters of both and of the last two.
#[inline(always)]
unsafe fn quarters(a: __m512, b: __m512) -> __m512 {
    // SAFETY: the caller has AVX-512.
    unsafe {
        let even = _mm512_shuffle_f32x4::<0b10_00_10_00>(a, b);
        _mm512_max_ps(even, _mm512_shuffle_f32x4::<0b11_01_11_01>(a, b))
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
            let [x, y, z] = [0, 1, 2].map(|axis| 3 * usize::from(sixteen.axes[axis].backwards != 0));
            let near = [x, 1 + y, 2 + z];
            Self {
                sixteen,
                near,
                far: [3 - near[0], 5 - near[1], 7 - near[2]],
                bounds: Bounds::new(sixteen),
                nearest: Nearest { t: sixteen.t_max, object: _mm512_set1_epi32(-1) },
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
            let mut farthest = self.bounds.of[Bounds::END];
            let mut child = root;
            let mut shears = None;
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
                    child = if A::ANY {
                        let children = _mm256_load_si256(node.children.as_ptr().cast());
                        let entered = _mm256_maskz_compress_epi32(mask as u8, children);
                        _mm512_storeu_si512(top.cast(), _mm512_cvtepu32_epi64(entered));
                        *node.children.get_unchecked(mask.ilog2() as usize)
                    } else {
                        Avx512::sort(node, entry, mask, top)
                    };
                    top = top.add(mask.count_ones() as usize - 1);
                }
                if !child.is_node() {
                    let shears = match &shears {
                        Some(shears) => shears,
                        None => shears.insert(Shears::new(self.sixteen)),
                    };
                    let mut block = blocks.add(child.index());
                    let mut is_hit = false;
                    loop {
                        for lane in 0..(*block).len() {
                            let candidates = shears.candidates(&*block, lane) & self.live::<A>();
                            if candidates != 0 {
                                is_hit |= shears.decide::<A>(&*block, lane, candidates, &mut self.nearest);
                            }
                        }
                        if (*block).is_last() {
                            break;
                        }
                        block = block.add(1);
                    }
                    if is_hit {
                        farthest = _mm512_reduce_max_ps(self.nearest.t);
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

    /// A bit per ray that still looks for its answer.
    #[inline(always)]
    unsafe fn live<A: Answer>(&self) -> u16 {
        // SAFETY: the caller's promises.
        unsafe {
            if A::ANY {
                _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.nearest.t, _mm512_setzero_ps())
            } else {
                u16::MAX
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
            let (mut entry, mut exit) =
                (_mm256_set1_ps(self.bounds.of[Bounds::BEGIN]), _mm256_set1_ps(farthest));
            for axis in 0..3 {
                let Bounds { of, near: near_scale, far: far_scale } = &self.bounds;
                let at = |bound: usize| 4 * axis + bound;
                let near = _mm256_load_ps(node.planes.as_ptr().add(self.near[axis]).cast());
                let near = _mm256_sub_ps(near, _mm256_set1_ps(of[at(Bounds::NEAR_ORIGIN)]));
                let one = _mm256_fmsub_ps(near, _mm256_set1_ps(near_scale[at(Bounds::LEAST)]), tiny);
                let two = _mm256_fmsub_ps(near, _mm256_set1_ps(near_scale[at(Bounds::MOST)]), tiny);
                // Of two zeros the instruction gives the second operand: entries are never −0.
                entry = _mm256_max_ps(_mm256_min_ps(one, two), entry);
                let far = _mm256_load_ps(node.planes.as_ptr().add(self.far[axis]).cast());
                let far = _mm256_sub_ps(far, _mm256_set1_ps(of[at(Bounds::FAR_ORIGIN)]));
                let one = _mm256_fmadd_ps(far, _mm256_set1_ps(far_scale[at(Bounds::LEAST)]), tiny);
                let two = _mm256_fmadd_ps(far, _mm256_set1_ps(far_scale[at(Bounds::MOST)]), tiny);
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
            let (mut entry, mut exit) = (self.sixteen.t_min, self.nearest.t);
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
                core::mem::transmute::<__m512, [f32; RAYS]>(self.nearest.t),
                core::mem::transmute::<__m512i, [u32; RAYS]>(self.nearest.object),
            )
        }
    }
}
