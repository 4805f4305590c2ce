//! The traversal of one ray in vector registers.

use super::box_ray::{BoxRay, BoxTest, FarBoxRay};
use super::instructions::{Instructions, Pending, Task, last_pending};
use super::kernel::{SPARE, STACK, deep_stacks};
use super::lanes::{Aligned, Lanes, Mask};
use super::layout::{Child, WideBvh};
use super::pairs::{Crossings, Pairs};
use super::triangles::TriangleBlock;
use crate::each::Each;
use crate::exact::{AXES, largest_axis};
use crate::slabs::FarRay;
use crate::{Hit, Ray};
use core::mem::MaybeUninit;

/// The search for a ray's nearest hit, or with `ANY` the first one found, among those that `filter`
/// accepts; without any the object is `u32::MAX`.
pub(crate) struct OneRay<'a, F, const ANY: bool> {
    pub(crate) wide: &'a WideBvh,
    pub(crate) ray: &'a Ray,
    pub(crate) filter: F,
}

impl<K: Instructions, F: Filter, const ANY: bool> Task<K> for OneRay<'_, F, ANY> {
    type Output = Hit;

    #[inline(always)]
    unsafe fn run(self) -> Hit {
        let Self { wide, ray, filter } = self;
        let mut leaves = FirstHits::<_, _, ANY> { leaf_ray: DeferredRay::new(ray, wide), filter };
        // SAFETY: the processor has the instructions of `K`.
        unsafe { traverse::<K, ANY>(wide, ray, &mut leaves) }
    }
}

/// Decides which hits of a ray count.
pub(crate) trait Filter {
    /// Whether all hits do, so that any hit needs no distance.
    const ACCEPTS_ALL: bool;

    fn accepts(&mut self, hit: Hit) -> bool;
}

pub(crate) struct All;

impl Filter for All {
    const ACCEPTS_ALL: bool = true;

    #[inline(always)]
    fn accepts(&mut self, _: Hit) -> bool {
        true
    }
}

impl Filter for &mut dyn FnMut(Hit) -> bool {
    const ACCEPTS_ALL: bool = false;

    #[inline(always)]
    fn accepts(&mut self, hit: Hit) -> bool {
        self(hit)
    }
}

/// Tests of the triangles in the leaves that a ray enters.
pub(crate) trait Leaves<K> {
    /// Tests the triangles of a block. Returns whether one of them is the new nearest hit.
    unsafe fn visit(&mut self, block: &TriangleBlock, nearest: &mut Hit) -> bool;

    /// Returns the ray for boxes far from which it begins.
    fn far_ray(&self, wide: &WideBvh, ray: &Ray) -> FarRay {
        wide.far_ray(ray)
    }
}

/// Visits the leaves that the ray enters up to the nearest hit, or with `ANY` up to the first hit
/// that is found, in no order.
#[inline(always)]
pub(crate) unsafe fn traverse<K: Instructions, const ANY: bool>(
    wide: &WideBvh,
    ray: &Ray,
    leaves: &mut impl Leaves<K>,
) -> Hit {
    // SAFETY: the processor has the instructions; the stack has room for `stack_need` children and
    // one register more.
    unsafe {
        if !ray.begins_in(&wide.near) || wide.stack_need > STACK {
            return K::call(Rare::<_, ANY> { wide, ray, leaves });
        }
        // Aligned, so that the whole frame is. Otherwise the compiler keeps vectors of 32 bytes at odd
        // multiples of 16, depending on where its caller's frame ends, and then every other vector
        // crosses a line of the cache. That costs a ray which misses everything 5 of 14 ns.
        let mut stack = MaybeUninit::<Aligned<[Pending; STACK + SPARE]>>::uninit();
        let base = stack.as_mut_ptr().cast::<Pending>();
        visit::<K, ANY>(wide, ray.t_max(), &BoxRay::new(ray), leaves, base)
    }
}

/// The traversal of a ray that begins far from the scene, or of a deep layout or one in a frame.
struct Rare<'a, L, const ANY: bool> {
    wide: &'a WideBvh,
    ray: &'a Ray,
    leaves: &'a mut L,
}

impl<K: Instructions, L: Leaves<K>, const ANY: bool> Task<K> for Rare<'_, L, ANY> {
    type Output = Hit;

    #[inline(always)]
    unsafe fn run(self) -> Hit {
        let Self { wide, ray, leaves } = self;
        let mut stack = MaybeUninit::<Aligned<[Pending; STACK + SPARE]>>::uninit();
        let mut deep = deep_stacks::<Pending>(1, wide.stack_need);
        let base = deep.as_mut().map_or(stack.as_mut_ptr().cast(), |deep| deep.as_mut_ptr().cast());
        // SAFETY: the stack has room for `stack_need` children; the rest is as in `traverse`.
        unsafe {
            let (boxed, is_near) = wide.boxed::<K::Block>(ray);
            if is_near {
                visit::<K, ANY>(wide, ray.t_max(), &BoxRay::new(&boxed), leaves, base)
            } else {
                let boxes = FarBoxRay::new(&boxed, &leaves.far_ray(wide, ray));
                visit::<K, ANY>(wide, ray.t_max(), &boxes, leaves, base)
            }
        }
    }
}

/// [`traverse`] up to `t_max` with one of the tests of boxes, and a stack from `base` on.
///
/// # Safety
/// The stack has room for `stack_need` children and one register more.
#[inline(always)]
pub(crate) unsafe fn visit<K: Instructions, const ANY: bool>(
    wide: &WideBvh,
    t_max: f32,
    boxes: &impl BoxTest<K>,
    leaves: &mut impl Leaves<K>,
    base: *mut Pending,
) -> Hit {
    let mut nearest = Hit { t: t_max, object: u32::MAX };
    let Some(root) = wide.root else { return nearest };
    // SAFETY: the processor has the instructions; references are sound, and the stack has room for
    // `stack_need` children and one register more.
    unsafe {
        let nodes = wide.nodes.as_ptr();
        let blocks = wide.blocks.as_ptr();
        let mut top = base;
        let mut child = root;
        loop {
            while child.is_node() {
                let node = &*nodes.add(child.index());
                let (keys, mask) = boxes.boxes(node, nearest.t);
                let others = mask & mask.wrapping_sub(1);
                if others == 0 {
                    if mask == 0 {
                        break;
                    }
                    child = *node.children.get_unchecked(mask.trailing_zeros() as usize);
                    continue;
                }
                child = if ANY {
                    K::compress(node, mask, top);
                    *node.children.get_unchecked(mask.ilog2() as usize)
                } else {
                    K::sort(node, keys, mask, top)
                };
                top = top.add(mask.count_ones() as usize - 1);
            }
            if !child.is_node() {
                let mut block = blocks.add(child.index());
                loop {
                    if leaves.visit(&*block, &mut nearest) && ANY {
                        return nearest;
                    }
                    if (*block).is_last() {
                        break;
                    }
                    block = block.add(1);
                }
            }
            child = loop {
                if top == base {
                    return nearest;
                }
                top = top.sub(1);
                let pending = *top;
                if ANY || pending <= last_pending(nearest.t) {
                    break Child::from_bits(pending as u32);
                }
            };
        }
    }
}

/// Keeps the nearest hit among those that `filter` accepts.
struct FirstHits<'r, L, F, const ANY: bool> {
    leaf_ray: DeferredRay<'r, L>,
    filter: F,
}

impl<K: Instructions, F: Filter, const ANY: bool> Leaves<K> for FirstHits<'_, K::Block, F, ANY> {
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, nearest: &mut Hit) -> bool {
        // SAFETY: the processor has the instructions.
        unsafe {
            let ray = self.leaf_ray.get::<K>();
            let corners = ray.corners(block);
            let t_max = K::Block::splat(nearest.t);
            let mut candidates = ray.pairs.candidates(&corners);
            if ANY {
                let (possible, sure) = ray.pairs.within(&candidates, t_max);
                if F::ACCEPTS_ALL && sure != 0 {
                    nearest.object = block.id(sure.trailing_zeros() as usize & 3);
                    return true;
                }
                candidates.crossings.possible = possible;
            }
            let crossings = candidates.crossings;
            if crossings.possible == 0 {
                return false;
            }
            let (mut inside, unsure, mut t) = ray.pairs.decide_certain(&corners, crossings, t_max);
            if unsure != 0 {
                let t_max = nearest.t;
                (inside, t) = K::call(Doubt { ray, block, crossings, t_max });
            }
            let mut hits = inside.bits();
            if hits == 0 {
                return false;
            }
            let mut distances = [0.0; TriangleBlock::LANES];
            t.store(distances.as_mut_ptr());
            let mut is_nearer = false;
            while hits != 0 {
                let lane = hits.trailing_zeros() as usize & 3;
                hits &= hits - 1;
                let hit = Hit { t: distances[lane], object: block.id(lane) };
                // An unused lane repeats a triangle, which a filter may have rejected.
                if !hit.is_miss() && hit.precedes(nearest) && self.filter.accepts(hit) {
                    *nearest = hit;
                    is_nearer = true;
                }
            }
            is_nearer
        }
    }
}

/// A ray that is prepared for triangles before the first of them: most rays in the open meet none.
pub(crate) struct DeferredRay<'r, L> {
    ray: &'r Ray,
    wide: &'r WideBvh,
    leaf_ray: MaybeUninit<LeafRay<L>>,
    is_prepared: bool,
}

impl<'r, L: Lanes> DeferredRay<'r, L> {
    #[inline(always)]
    pub(crate) fn new(ray: &'r Ray, wide: &'r WideBvh) -> Self {
        Self { ray, wide, leaf_ray: MaybeUninit::uninit(), is_prepared: false }
    }

    #[inline(always)]
    pub(crate) unsafe fn get<K: Instructions<Block = L>>(&mut self) -> &LeafRay<L> {
        // SAFETY: the processor has the instructions; the ray is prepared before its use.
        unsafe {
            if !self.is_prepared {
                let Self { ray, wide, .. } = *self;
                K::call(Prepare { ray, wide, to: &mut self.leaf_ray });
                self.is_prepared = true;
            }
            self.leaf_ray.assume_init_ref()
        }
    }
}

/// The preparation of a ray for triangles.
struct Prepare<'a, L> {
    ray: &'a Ray,
    wide: &'a WideBvh,
    to: &'a mut MaybeUninit<LeafRay<L>>,
}

impl<K: Instructions> Task<K> for Prepare<'_, K::Block> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        // SAFETY: the processor has the instructions.
        self.to.write(unsafe { LeafRay::new(self.ray, self.wide) });
    }
}

/// The decision of pairs that certain crossings leave open. It begins anew, so that the test before
/// it keeps nothing in registers for it.
struct Doubt<'a, L> {
    ray: &'a LeafRay<L>,
    block: &'a TriangleBlock,
    crossings: Crossings,
    t_max: f32,
}

impl<K: Instructions> Task<K> for Doubt<'_, K::Block> {
    type Output = (<K::Block as Lanes>::Mask, K::Block);

    #[inline(always)]
    unsafe fn run(self) -> Self::Output {
        let Self { ray, block, crossings, t_max } = self;
        // SAFETY: the processor has the instructions.
        let (corners, t_max) = unsafe { (ray.corners(block), K::Block::splat(t_max)) };
        ray.pairs.decide(&corners, crossings, t_max)
    }
}

/// A ray in all lanes, as triangles are tested with it.
pub(crate) struct LeafRay<L> {
    pub(crate) pairs: Pairs<L>,
    /// Of [`TriangleBlock::ROWS`], in the shear's order of axes.
    rows: [usize; 3],
}

impl<L: Lanes> LeafRay<L> {
    #[inline(always)]
    pub(crate) unsafe fn new(ray: &Ray, wide: &WideBvh) -> Self {
        let origin = ray.origin().to_array();
        let direction = ray.direction().to_array();
        let reach = ray.reach(&wide.bounds) * wide.error_factor;
        let axes = AXES[largest_axis(ray.direction().into())];
        // SAFETY: the processor has the instructions.
        unsafe {
            let [x, y, z] = axes;
            let dx = direction[x];
            let dy = direction[y];
            let dz = direction[z];
            let pairs = Pairs::new(
                [L::splat(origin[x]), L::splat(origin[y]), L::splat(origin[z])],
                [L::splat(dx), L::splat(dy), L::splat(dz)],
                [L::splat(dx / dz), L::splat(dy / dz)],
                L::splat(reach),
                L::splat(ray.t_min()),
            );
            Self { pairs, rows: axes.each(|axis| axis * TriangleBlock::LANES) }
        }
    }

    /// Returns the corners of a block's triangles in the shear's order of axes.
    #[inline(always)]
    pub(crate) unsafe fn corners(&self, block: &TriangleBlock) -> [[L; 3]; 3] {
        // SAFETY: the processor has the instructions; these are rows.
        unsafe { block.corners_along::<L>(self.rows) }
    }
}
