//! The instruction sets of x86-64.

mod avx2;
mod avx512;
mod lanes;
mod masks;
mod sort;

use super::all_in_flight::Found;
use super::answer::Batch;
use super::crossed_leaves::AllHits;
use super::instructions::Instructions;
use super::layout::WideBvh;
use super::nearest::Closest;
use super::node::WideNode;
use super::tightness::{Entered, NodeTest};
use crate::{Coherence, Hit, Kernel, Ray};
use alloc::vec::Vec;
use core::marker::PhantomData;
use glam::Vec3;

/// Returns whether this processor can run a kernel.
pub(super) fn has(kernel: Kernel) -> bool {
    match kernel {
        Kernel::Avx2 => has_avx2(),
        Kernel::Avx512 => has_avx512(),
        _ => false,
    }
}

/// Returns whether the processor has the instructions of the AVX2 kernel.
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("lzcnt")
}

/// Returns whether the processor has the instructions of the AVX-512 kernel.
fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
}

/// Runs [`one_ray::trace`](super::one_ray::trace) by the layout's kernel.
///
/// # Safety
/// The layout has a vector kernel, which the processor can run; its references are sound.
#[inline(always)]
pub(super) unsafe fn one_ray<const ANY: bool>(
    wide: &WideBvh,
    ray: &Ray,
    accept: impl FnMut(Hit) -> bool,
) -> Hit {
    // SAFETY: the caller's promises.
    unsafe {
        match wide.kernel {
            Kernel::Avx512 => avx512::one_ray::<ANY>(wide, ray, accept),
            _ => avx2::one_ray::<ANY>(wide, ray, accept),
        }
    }
}

/// Returns a bit for each box of a node that the ray enters, by a test of the layout's kernel.
///
/// # Safety
/// The layout has a vector kernel, which the processor can run.
pub(super) unsafe fn entered(wide: &WideBvh, ray: &Ray, node: &WideNode, test: NodeTest) -> u32 {
    // SAFETY: the processor has the instructions.
    unsafe {
        match wide.kernel {
            Kernel::Avx512 => avx512::Avx512::call(Entered {
                wide,
                ray,
                node,
                test,
                kernel: PhantomData::<avx512::Avx512>,
            }),
            _ => avx2::Avx2::call(Entered {
                wide,
                ray,
                node,
                test,
                kernel: PhantomData::<avx2::Avx2>,
            }),
        }
    }
}

/// Finds all hits by the layout's kernel. Returns whether it could trace the ray.
///
/// # Safety
/// As for [`one_ray`].
pub(super) unsafe fn all_hits(wide: &WideBvh, ray: &Ray, leaves: &mut AllHits) {
    // SAFETY: the caller's promises.
    unsafe {
        match wide.kernel {
            Kernel::Avx512 => avx512::all_hits(wide, ray, leaves),
            _ => avx2::all_hits(wide, ray, leaves),
        }
    }
}

/// Runs [`all_in_flight::trace`](super::all_in_flight::trace) by the layout's kernel.
///
/// # Safety
/// As for [`one_ray`], and there are at most [`MOST`](super::all_in_flight::MOST) rays.
pub(super) unsafe fn all_hits_of(wide: &WideBvh, rays: &[Ray], found: &mut Vec<Found>) {
    // SAFETY: the caller's promises.
    unsafe {
        match wide.kernel {
            Kernel::Avx512 => avx512::all_hits_of(wide, rays, found),
            _ => avx2::all_hits_of(wide, rays, found),
        }
    }
}

/// Runs [`closest_lanes::trace`](super::closest_lanes::trace) by the layout's kernel.
///
/// # Safety
/// As for [`one_ray`].
pub(super) unsafe fn closest_points(
    wide: &WideBvh,
    points: &[Vec3],
    closest: &mut [Option<Closest>],
) {
    // SAFETY: the caller's promises.
    unsafe {
        match wide.kernel {
            Kernel::Avx512 => avx512::closest_points(wide, points, closest),
            _ => avx2::closest_points(wide, points, closest),
        }
    }
}

/// Runs [`batch::trace`](super::batch::trace) by the layout's kernel.
///
/// # Safety
/// As for [`one_ray`], and there is an answer for every ray.
#[inline(always)]
pub(crate) unsafe fn trace<const ANY: bool>(
    wide: &WideBvh,
    batch: &mut Batch,
    coherence: Coherence,
) {
    // SAFETY: the caller's promises.
    unsafe {
        match wide.kernel {
            Kernel::Avx512 => avx512::trace::<ANY>(wide, batch, coherence),
            _ => avx2::trace::<ANY>(wide, batch, coherence),
        }
    }
}

/// Compiles the kernels with the instructions of one processor. The functions are unsafe for the
/// reasons of those that they call, and because the processor must have the instructions.
macro_rules! entry_points {
    ($instructions:ident, $features:literal) => {
        /// [`one_ray::trace`](crate::wide::one_ray::trace).
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn one_ray<const ANY: bool>(
            wide: &WideBvh,
            ray: &crate::Ray,
            accept: impl FnMut(crate::Hit) -> bool,
        ) -> crate::Hit {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's
            // promise.
            unsafe { crate::wide::one_ray::trace::<$instructions, ANY>(wide, ray, accept) }
        }

        /// [`one_ray::traverse`](crate::wide::one_ray::traverse) for all hits.
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn all_hits(
            wide: &WideBvh,
            ray: &crate::Ray,
            leaves: &mut crate::wide::crossed_leaves::AllHits,
        ) {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's
            // promise.
            unsafe {
                crate::wide::one_ray::traverse::<$instructions, { crate::wide::answer::ANY_HIT }>(
                    wide, ray, leaves,
                );
            }
        }

        /// [`all_in_flight::trace`](crate::wide::all_in_flight::trace).
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn all_hits_of(
            wide: &WideBvh,
            rays: &[crate::Ray],
            found: &mut alloc::vec::Vec<crate::wide::all_in_flight::Found>,
        ) {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's
            // promise.
            unsafe { crate::wide::all_in_flight::trace::<$instructions>(wide, rays, found) }
        }

        /// [`closest_lanes::trace`](crate::wide::closest_lanes::trace).
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn closest_points(
            wide: &WideBvh,
            points: &[glam::Vec3],
            closest: &mut [Option<crate::wide::Closest>],
        ) {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's
            // promise.
            unsafe { crate::wide::closest_lanes::trace::<$instructions>(wide, points, closest) }
        }

        /// [`batch::trace`](crate::wide::batch::trace).
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn trace<const ANY: bool>(
            wide: &WideBvh,
            batch: &mut crate::wide::answer::Batch,
            coherence: crate::Coherence,
        ) {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's
            // promise.
            unsafe { crate::wide::batch::trace::<$instructions, ANY>(wide, batch, coherence) }
        }

        /// Runs a part of the kernel.
        #[target_feature(enable = $features)]
        #[inline(never)]
        unsafe fn call<P: Part>(part: P) -> P::Output {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's
            // promise.
            unsafe { part.run() }
        }
    };
}
use entry_points;

/// The operations that all instruction sets of x86-64 have in common.
macro_rules! common_instructions {
    () => {
        #[inline(always)]
        unsafe fn prefetch(line: *const u8) {
            // SAFETY: a prefetch may name any address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) }
        }

        #[inline(always)]
        unsafe fn call<P: Part>(part: P) -> P::Output {
            // SAFETY: the caller's promise: the processor has the instructions.
            unsafe { call(part) }
        }
    };
}
use common_instructions;
