//! The kernel in registers of 128 bits, two for eight numbers: NEON on 64-bit ARM, and SIMD128 in
//! WebAssembly.

mod lanes;
#[cfg_attr(target_arch = "aarch64", path = "neon.rs")]
#[cfg_attr(target_arch = "wasm32", path = "wasm.rs")]
mod registers;

use super::instructions::{Instructions, Pending, Task, lane_of};
use super::lanes::Lanes;
use super::layout::{Child, WideNode};
use crate::Kernel;
use core::cmp::Reverse;
use lanes::Singles;

pub(crate) struct Simd128;

/// Returns whether a kernel is the target's own.
pub(super) fn has(kernel: Kernel) -> bool {
    kernel == Kernel::Simd128
}

/// Runs a task with the target's instructions.
///
/// # Safety
/// None: the target has the instructions.
pub(super) unsafe fn dispatch<T: Task<Simd128, Output = O>, O>(_: Kernel, task: T) -> O {
    // SAFETY: the target has the instructions.
    unsafe { Simd128::call(task) }
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

    #[inline(always)]
    unsafe fn sort_keys(keys: Singles<2>, mask: u32, to: *mut u32) {
        // SAFETY: the target has the instructions; as many keys are written as there are bits.
        unsafe {
            Self::compress_keys(keys, mask, to);
            let keys = core::slice::from_raw_parts_mut(to, mask.count_ones() as usize);
            keys.sort_unstable_by_key(|&key| Reverse(key));
        }
    }

    #[inline(always)]
    unsafe fn compress_keys(keys: Singles<2>, mask: u32, to: *mut u32) {
        let mut lanes = [0.0; 8];
        // SAFETY: there is room for eight, and for a key per bit.
        unsafe {
            keys.store(lanes.as_mut_ptr());
            for (i, lane) in lanes_of(mask).enumerate() {
                *to.add(i) = lanes[lane].to_bits();
            }
        }
    }

    #[inline(always)]
    unsafe fn sort(node: &WideNode, keys: Singles<2>, mask: u32, to: *mut Pending) -> Child {
        let mut sorted = [0; 8];
        let mut nearest = Child::node(0);
        // SAFETY: the target has the instructions; there is room for a key per bit.
        unsafe {
            Self::sort_keys(keys, mask, sorted.as_mut_ptr());
            for (i, &key) in sorted.iter().enumerate().take(mask.count_ones() as usize) {
                nearest = node.children[lane_of(key)];
                *to.add(i) = u64::from(key) << 32 | u64::from(nearest.bits());
            }
        }
        nearest
    }

    #[inline(always)]
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending) {
        for (i, lane) in lanes_of(mask).enumerate() {
            // SAFETY: there is room for a child per bit.
            unsafe { *to.add(i) = u64::from(node.children[lane].bits()) };
        }
    }

    /// Does nothing: neither target has a stable instruction for it.
    #[inline(always)]
    unsafe fn prefetch(_: *const u8) {}

    #[inline(never)]
    unsafe fn call<T: Task<Self>>(task: T) -> T::Output {
        // SAFETY: the target has the instructions.
        unsafe { task.run() }
    }
}
