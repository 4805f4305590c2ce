//! The implementations of the wide layout's traversal, and which of them this processor can run.

use alloc::vec::Vec;
use core::marker::PhantomData;
use core::mem::MaybeUninit;

/// An implementation of the traversal of a [`WideBvh`](crate::WideBvh). All answer rays by the same
/// bits, and find the same [closest points](crate::WideBvh::closest_point); only in a layout with
/// divided triangles may these differ by rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// Code for any machine; counts its tests on request.
    Portable,
    /// x86-64 with AVX2 and FMA. Needs the feature `std`, which detects them.
    Avx2,
    /// x86-64 with AVX-512 F, VL, DQ and BW. Needs the feature `std`, too.
    Avx512,
    /// Registers of 128 bits: NEON on 64-bit ARM, and WebAssembly compiled with SIMD128.
    Simd128,
}

impl Kernel {
    /// All kernels, the fastest first.
    pub const ALL: [Self; 4] = [Self::Avx512, Self::Avx2, Self::Simd128, Self::Portable];
}

/// The number of children that can wait in the frame of a vector kernel's traversal. The stacks of
/// deeper layouts are [on the heap](DeepStacks).
pub(crate) const STACK: usize = 256;

/// The places of a stack beyond the children that wait: the end of every ray, the next block of the
/// same leaf, and room for stores of whole registers.
pub(crate) const SPARE: usize = 24;

/// The number of u64 in a cache line.
pub(crate) const LINE: usize = 8;

/// Stacks for a layout in which more than [`STACK`] children can wait.
pub(crate) struct DeepStacks<T> {
    /// Cache lines, so that every stack is aligned to them.
    lines: Vec<MaybeUninit<[u64; LINE]>>,
    lines_of_one: usize,
    entries: PhantomData<T>,
}

impl<T> DeepStacks<T> {
    /// Returns stacks of `need` entries and [`SPARE`] more; `None` if [`STACK`] entries suffice.
    pub(crate) fn new(stacks: usize, need: usize) -> Option<Self> {
        if need <= STACK {
            return None;
        }
        let lines_of_one = (size_of::<T>() * (need + SPARE)).div_ceil(size_of::<[u64; LINE]>());
        let mut lines = Vec::with_capacity(stacks * lines_of_one + 1);
        // SAFETY: there is such a capacity, and nothing is claimed of the entries.
        unsafe { lines.set_len(stacks * lines_of_one + 1) };
        Some(Self { lines, lines_of_one, entries: PhantomData })
    }

    /// The beginning of a stack, aligned to a cache line.
    pub(crate) fn stack(&mut self, index: usize) -> *mut T {
        assert!(index < self.lines.len() / self.lines_of_one);
        let first = self.lines.as_mut_ptr().cast::<u8>();
        let line = size_of::<[u64; LINE]>();
        // One more line is there than stacks need.
        let aligned = first.wrapping_add(first.align_offset(line));
        aligned.wrapping_add(line * self.lines_of_one * index).cast()
    }
}
