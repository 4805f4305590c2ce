//! The operations of an instruction set that the kernels need besides its lanes.
//!
//! # Safety
//!
//! Every unsafe function of a kernel needs the instructions of its `K`, or of its lanes `L`: only a
//! [`Task`] that [`dispatch`](super::vector::dispatch) runs has them, and what a task calls. Functions
//! whose sections name something else need that, too.

use super::lanes::{Aligned, Lanes, Mask};
use super::layout::{Child, WideNode};

/// A child to visit later: its key, or 0, above the bits of the child.
///
/// The *key* of an entered child is the bits of its entry, of which the last four are those of 8
/// minus its lane. Entries are not negative, so that keys are ordered as they are; and they are
/// distinct and not 0.
pub(crate) type Pending = u64;

/// The last bits of the keys.
static LAST_BITS: Aligned<[u32; 8]> = Aligned([8, 7, 6, 5, 4, 3, 2, 1]);

#[inline(always)]
pub(crate) fn lane_of(key: u32) -> usize {
    (key.wrapping_neg() & 7) as usize
}

/// Returns the greatest key that is not behind a hit at this distance.
#[inline(always)]
pub(crate) fn last_key(nearest: f32) -> u32 {
    nearest.to_bits() | 15
}

/// A part of a kernel that is compiled once for an instruction set and called, so that its callers
/// stay small, or are compiled without the instructions.
pub(crate) trait Task<K: Instructions> {
    type Output;

    /// Runs the task. Is inlined into a function that is compiled with the instructions.
    unsafe fn run(self) -> Self::Output;
}

/// An instruction set. Every function is inlined into one that is compiled with its instructions,
/// or it is very slow.
///
/// # Safety
/// All functions that write: there is room for eight places more than are written.
pub(crate) trait Instructions: Sized {
    /// A register of one number per child of a node.
    type Boxes: Lanes;
    /// A register of one number per triangle of a block.
    type Block: Lanes;
    /// The widest register: one ray per lane.
    type Rays: Lanes;

    /// Returns the [keys](Pending) of the children that are entered, with 0 in other lanes, and a bit
    /// per child.
    #[inline(always)]
    unsafe fn keys(
        entry: Self::Boxes,
        is_entered: <Self::Boxes as Lanes>::Mask,
    ) -> (Self::Boxes, u32) {
        // SAFETY: there are eight aligned lanes.
        let last_bits = unsafe { Self::Boxes::load(LAST_BITS.0.as_ptr().cast()) };
        let keys = entry & entry.filled_with_bits(!15) | last_bits;
        (Self::Boxes::select(is_entered, keys, entry.filled(0.0)), is_entered.bits())
    }

    /// Writes the keys of the entered children, the nearest last.
    unsafe fn sort_keys(keys: Self::Boxes, mask: u32, to: *mut u32);

    /// Writes the keys of the entered children in the order of their lanes.
    unsafe fn compress_keys(keys: Self::Boxes, mask: u32, to: *mut u32);

    /// Writes the entered children to `to`, the nearest last, and returns the nearest. If none was
    /// entered, returns any child.
    unsafe fn sort(node: &WideNode, keys: Self::Boxes, mask: u32, to: *mut Pending) -> Child;

    /// Writes the entered children in the order of their lanes, with keys of 0.
    unsafe fn compress(node: &WideNode, mask: u32, to: *mut Pending);

    /// Fetches a line of memory, which may be anywhere.
    unsafe fn prefetch(line: *const u8);

    /// Fetches the lines of so many bytes, which may be anywhere.
    #[inline(always)]
    unsafe fn prefetch_bytes(first: *const u8, bytes: usize) {
        const LINE: usize = 64;
        for line in 0..bytes.div_ceil(LINE) {
            // SAFETY: a prefetch may name any address.
            unsafe { Self::prefetch(first.wrapping_add(LINE * line)) };
        }
    }

    /// Runs a task in a function of its own that is compiled with the instructions.
    unsafe fn call<T: Task<Self>>(task: T) -> T::Output;

    /// Removes the children behind `nearest` from a stack that is aligned to 64 bytes. Returns its
    /// new end.
    #[inline(always)]
    unsafe fn drop_farther(base: *mut Pending, top: *mut Pending, nearest: f32) -> *mut Pending {
        let last = last_pending(nearest);
        let mut from = base;
        let mut to = base;
        // SAFETY: the stack is between its ends.
        unsafe {
            while from < top {
                let pending = *from;
                *to = pending;
                to = to.add(usize::from(pending <= last));
                from = from.add(1);
            }
        }
        to
    }
}

/// Returns the greatest [`Pending`] that is not behind a hit at this distance.
#[inline(always)]
pub(crate) fn last_pending(nearest: f32) -> Pending {
    u64::from(last_key(nearest)) << 32 | u64::from(u32::MAX)
}
