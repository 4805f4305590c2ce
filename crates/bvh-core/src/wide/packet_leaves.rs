//! Packets of rays at leaves: a triangle is tested with the rays of a vector at once.

use super::answer::Accept;
use super::instructions::Instructions;
use super::lanes::{Lanes, Mask};
use super::packet::Packet;
use super::pairs::Plane;
use super::triangles::TriangleBlock;
use crate::{Aabb, Hit};

impl<K: Instructions> Packet<K> {
    /// Tests the triangles of a leaf with the rays that enter it. `entered` has a bit per ray of
    /// the vector `first` that enters the box of these planes, and earlier vectors do not enter it.
    /// Returns whether any ray has a new nearest hit.
    #[inline(always)]
    pub(super) unsafe fn visit_leaf<const ANY: bool>(
        &mut self,
        first: usize,
        mut entered: u32,
        planes: &[[f32; 2]; 3],
        block: *const TriangleBlock,
        bounds: &Aabb,
        accept: &mut Option<&mut Accept>,
    ) -> bool {
        let mut is_hit = false;
        for i in first..self.count {
            // SAFETY: the caller's promises; so many vectors are counted.
            unsafe {
                if i > first {
                    entered = self.enter(i, planes);
                }
                if entered != 0 {
                    is_hit |= self.test::<ANY>(i, entered, block, bounds, accept);
                }
            }
        }
        is_hit
    }

    /// Tests the triangles of a leaf with the rays of a vector that entered it. Returns whether any
    /// ray has a new nearest hit.
    #[inline(always)]
    unsafe fn test<const ANY: bool>(
        &mut self,
        vector: usize,
        entered: u32,
        block: *const TriangleBlock,
        bounds: &Aabb,
        accept: &mut Option<&mut Accept>,
    ) -> bool {
        // SAFETY: the caller's promises; a block that is not its leaf's last is followed by
        // another.
        unsafe {
            let vector = self.vectors.get_unchecked_mut(vector).assume_init_mut();
            if !vector.is_sheared {
                vector.pairs.write(vector.rays.sheared(vector.axes, bounds));
                vector.is_sheared = true;
            }
            let pairs = vector.pairs.assume_init_ref();
            let mut block = block;
            let mut is_hit = false;
            loop {
                for lane in 0..(*block).len() {
                    let corners = (*block).splat_corners::<K::Rays>(lane, vector.axes);
                    let mut candidates = pairs.candidates(&corners);
                    candidates.possible &= entered;
                    if candidates.possible == 0 {
                        continue;
                    }
                    let plane = Plane::of_triangle(&(*block).doubles(lane, vector.axes));
                    let (inside, t) = pairs.decide(&corners, &plane, &candidates, vector.t);
                    let inside = inside & Mask::from_bits(entered);
                    let object = K::Rays::splat_bits((*block).id(lane));
                    let mut hits = if ANY {
                        inside
                    } else {
                        t.lt(vector.t) & inside
                            | t.eq(vector.t) & inside & object.below(vector.object)
                    };
                    if hits.bits() == 0 {
                        continue;
                    }
                    if let Some(accept) = accept {
                        hits = accepted(accept, vector.first, hits, t, (*block).id(lane));
                    }
                    is_hit |= hits.bits() != 0;
                    // A ray that has its answer ends before it begins.
                    let t = if ANY { K::Rays::splat(-1.0) } else { t };
                    vector.t = Lanes::select(hits, t, vector.t);
                    vector.object = Lanes::select(hits, object, vector.object);
                }
                if (*block).is_last() {
                    return is_hit;
                }
                block = block.add(1);
            }
        }
    }
}

/// Returns the hits with one object that `accept` accepts. The ray of the first lane is number
/// `first` of its batch.
#[inline(always)]
unsafe fn accepted<L: Lanes>(
    accept: &mut Accept,
    first: usize,
    hits: L::Mask,
    t: L,
    object: u32,
) -> L::Mask {
    let found = hits.bits();
    let mut distances = [0.0; 16];
    let mut left = found;
    let mut accepted = found;
    // SAFETY: there is room for sixteen lanes; the processor has the instructions.
    unsafe {
        t.store(distances.as_mut_ptr());
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let hit = Hit { t: distances[lane], object };
            if !accept(first + lane, hit) {
                accepted ^= 1 << lane;
            }
        }
        if accepted == found { hits } else { Mask::from_bits(accepted) }
    }
}
