//! The kernel in registers of 128 bits, two for eight numbers: NEON on 64-bit ARM, and SIMD128 in
//! WebAssembly.

mod lanes;
#[cfg_attr(target_arch = "aarch64", path = "neon.rs")]
#[cfg_attr(target_arch = "wasm32", path = "wasm.rs")]
mod registers;

use super::all_in_flight::Found;
use super::answer::{ANY_HIT, Batch};
use super::crossed_leaves::AllHits;
use super::instructions::{Instructions, Part, Pending};
use super::lanes::{Lanes, Mask};
use super::layout::WideBvh;
use super::nearest::Closest;
use super::node::{Child, WideNode};
use super::tightness::{Entered, NodeTest};
use super::{all_in_flight, batch, closest_lanes, one_ray};
use crate::{Coherence, Hit, Kernel, Ray};
use alloc::vec::Vec;
use core::cmp::Reverse;
use core::marker::PhantomData;
use glam::Vec3;
use lanes::Singles;

pub(crate) struct Simd128;

/// Returns whether a kernel is the target's own.
pub(super) fn has(kernel: Kernel) -> bool {
    kernel == Kernel::Simd128
}

/// [`one_ray::trace`].
pub(super) unsafe fn one_ray<const ANY: bool>(
    wide: &WideBvh,
    ray: &Ray,
    accept: impl FnMut(Hit) -> bool,
) -> Hit {
    // SAFETY: the target has the instructions; the rest is the caller's promise.
    unsafe { one_ray::trace::<Simd128, ANY>(wide, ray, accept) }
}

/// [`one_ray::traverse`] for all hits.
pub(super) unsafe fn all_hits(wide: &WideBvh, ray: &Ray, leaves: &mut AllHits) {
    // SAFETY: the target has the instructions; the rest is the caller's promise.
    unsafe { one_ray::traverse::<Simd128, ANY_HIT>(wide, ray, leaves) };
}

/// [`all_in_flight::trace`].
pub(super) unsafe fn all_hits_of(wide: &WideBvh, rays: &[Ray], found: &mut Vec<Found>) {
    // SAFETY: the target has the instructions; the rest is the caller's promise.
    unsafe { all_in_flight::trace::<Simd128>(wide, rays, found) }
}

/// [`closest_lanes::trace`].
pub(super) unsafe fn closest_points(
    wide: &WideBvh,
    points: &[Vec3],
    closest: &mut [Option<Closest>],
) {
    // SAFETY: the target has the instructions; the rest is the caller's promise.
    unsafe { closest_lanes::trace::<Simd128>(wide, points, closest) }
}

/// Returns a bit for each box of a node that the ray enters.
pub(super) unsafe fn entered(wide: &WideBvh, ray: &Ray, node: &WideNode, test: NodeTest) -> u32 {
    // SAFETY: the target has the instructions.
    unsafe { Simd128::call(Entered { wide, ray, node, test, kernel: PhantomData::<Simd128> }) }
}

/// [`batch::trace`].
pub(crate) unsafe fn trace<const ANY: bool>(
    wide: &WideBvh,
    batch: &mut Batch,
    coherence: Coherence,
) {
    // SAFETY: the caller's promises.
    unsafe { batch::trace::<Simd128, ANY>(wide, batch, coherence) }
}

/// The entered lanes, the lowest first.
#[inline(always)]
fn lanes_of(mask: u32) -> impl Iterator<Item = usize> {
    (0..8).filter(move |lane| mask >> lane & 1 != 0)
}

impl Instructions for Simd128 {
    type Boxes = Singles<2>;
    type Block = Singles<1>;
    type Rays = Singles<2>;
    const PACKET: usize = 64;
    const FLIGHT: usize = 24;

    #[inline(always)]
    unsafe fn entered(entry: Singles<2>, exit: Singles<2>) -> u32 {
        entry.le(exit).bits()
    }

    #[inline(always)]
    unsafe fn sort_keys(entry: Singles<2>, mask: u32, to: *mut u32) {
        // SAFETY: the caller's promises; as many keys are written as there are bits.
        unsafe {
            Self::compress_keys(entry, mask, to);
            let keys = core::slice::from_raw_parts_mut(to, mask.count_ones() as usize);
            keys.sort_unstable_by_key(|&key| Reverse(key));
        }
    }

    #[inline(always)]
    unsafe fn compress_keys(entry: Singles<2>, mask: u32, to: *mut u32) {
        let mut entries = [0.0; 8];
        // SAFETY: there is room for eight, and for a key per bit.
        unsafe {
            entry.store(entries.as_mut_ptr());
            for (i, lane) in lanes_of(mask).enumerate() {
                *to.add(i) = entries[lane].to_bits() & !7 | (7 - lane as u32);
            }
        }
    }

    #[inline(always)]
    unsafe fn sort(node: &WideNode, entry: Singles<2>, mask: u32, to: *mut Pending) -> Child {
        let mut keys = [0; 8];
        let mut nearest = Child::node(0);
        // SAFETY: the caller's promises; there is room for a key per bit.
        unsafe {
            Self::sort_keys(entry, mask, keys.as_mut_ptr());
            for (i, &key) in keys.iter().enumerate().take(mask.count_ones() as usize) {
                nearest = node.children[(!key & 7) as usize];
                *to.add(i) = u64::from(key) << 32 | u64::from(nearest.bits());
            }
        }
        nearest
    }

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending) {
        for (i, lane) in lanes_of(mask).enumerate() {
            // SAFETY: the caller's promise: there is room for a child per bit.
            unsafe { *to.add(i) = u64::from(node.children[lane].bits()) };
        }
    }

    /// Does nothing: neither target has a stable instruction for it.
    #[inline(always)]
    unsafe fn prefetch(_: *const u8) {}

    #[inline(never)]
    unsafe fn call<P: Part>(part: P) -> P::Output {
        // SAFETY: the caller's promise.
        unsafe { part.run() }
    }
}
