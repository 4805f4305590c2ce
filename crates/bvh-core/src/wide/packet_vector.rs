//! A vector of rays in a packet: what the tests of boxes and of triangles need of them.

use super::answer::Known;
use super::lanes::{Lanes, Mask};
use super::layout::WideBvh;
use super::pairs::Pairs;
use super::ray_lanes::{BoxLanes, RayLanes};
use crate::slabs::{FAR, NEAR};
use core::mem::MaybeUninit;

/// The nearest hits of rays so far, or their ends and `u32::MAX`.
pub(super) struct Nearest<L> {
    pub(super) t: L,
    /// At most the distances; the same, unless hits are decided elsewhere, and `t` is at least the
    /// distance.
    pub(super) low: L,
    pub(super) object: L,
}

impl<L: Lanes> Nearest<L> {
    /// Takes those of some hits with an object that are nearer. Returns whether there are any.
    #[inline(always)]
    pub(super) fn offer(&mut self, hits: L::Mask, t: L, object: u32) -> bool {
        let object = t.filled_with_bits(object);
        let nearer = hits & (t.lt(self.t) | t.eq(self.t) & object.below(self.object));
        let is_hit = nearer.bits() != 0;
        if is_hit {
            self.t = L::select(nearer, t, self.t);
            self.object = L::select(nearer, object, self.object);
        }
        is_hit
    }

    /// Takes some hits between bounds of their distances.
    #[inline(always)]
    pub(super) fn take(&mut self, hits: L::Mask, [low, high]: [L; 2], object: u32) {
        self.t = L::select(hits, high, self.t);
        self.low = L::select(hits, low, self.low);
        self.object = L::select(hits, high.filled_with_bits(object), self.object);
    }

    #[inline(always)]
    pub(super) fn known(&self) -> impl Fn(usize) -> Known + use<L> {
        let mut numbers = [[0.0; 16]; 3];
        let [low, high, object] = &mut numbers;
        // SAFETY: there is room for sixteen lanes.
        unsafe {
            self.low.store(low.as_mut_ptr());
            self.t.store(high.as_mut_ptr());
            self.object.store(object.as_mut_ptr());
        }
        let [low, high, object] = numbers;
        move |i| Known { low: low[i], high: high[i], object: object[i].to_bits() }
    }

    /// Ends rays that have their answer: before they begin. Returns whether there are any.
    #[inline(always)]
    pub(super) fn end(&mut self, hits: L::Mask, object: u32) -> bool {
        self.t = L::select(hits, self.t.filled(-1.0), self.t);
        self.object = L::select(hits, self.t.filled_with_bits(object), self.object);
        hits.bits() != 0
    }
}

/// Rays of a packet side by side.
pub(super) struct Vector<L> {
    /// The origins, as boxes are tested with them.
    pub(super) box_origin: [L; 3],
    pub(super) near_factor: [L; 3],
    pub(super) far_factor: [L; 3],
    pub(super) t_min: L,
    pub(super) nearest: Nearest<L>,
    /// The rays, and whether `pairs` has been made from them. Many packets meet no triangle.
    pub(super) rays: RayLanes<L>,
    pub(super) axes: [usize; 3],
    pub(super) is_sheared: bool,
    pub(super) pairs: MaybeUninit<Pairs<L>>,
    /// The number of the first ray in its batch.
    pub(super) first: usize,
}

impl<L: Lanes> Vector<L> {
    /// Returns rays of which the first is number `first` of its batch.
    #[inline(always)]
    pub(super) unsafe fn new(rays: RayLanes<L>, boxed: BoxLanes<L>, first: usize) -> Self {
        // SAFETY: the processor has the instructions.
        let [near, far, none] =
            unsafe { [L::splat(NEAR), L::splat(FAR), L::splat(f32::from_bits(u32::MAX))] };
        let [x, y, z] = boxed.inverse;
        Self {
            box_origin: boxed.origin,
            near_factor: [x * near, y * near, z * near],
            far_factor: [x * far, y * far, z * far],
            t_min: rays.t_min,
            nearest: Nearest { t: rays.t_max, low: rays.t_max, object: none },
            axes: rays.axes(),
            rays,
            is_sheared: false,
            pairs: MaybeUninit::uninit(),
            first,
        }
    }

    /// Makes `pairs` for triangles of a layout, unless they have been made.
    #[inline(always)]
    pub(super) fn shear(&mut self, wide: &WideBvh) {
        if !self.is_sheared {
            self.pairs.write(self.rays.sheared(self.axes, wide));
            self.is_sheared = true;
        }
    }
}
