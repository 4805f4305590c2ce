//! The implementations of the wide layout's traversal, and which of them this processor can run.

use super::lanes::Aligned;

/// An implementation of the traversal of a [`WideBvh`](crate::WideBvh). All answer rays by the same
/// bits, and find the same [closest points](crate::WideBvh::closest_point); only in a layout with
/// divided triangles may these differ by rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// Code for any machine; counts its tests on request.
    Portable,
    /// x86-64 with AVX2 and FMA.
    Avx2,
    /// x86-64 with AVX-512 F, VL, DQ and BW.
    Avx512,
    /// Registers of 128 bits: NEON on 64-bit ARM, and WebAssembly compiled with SIMD128.
    Simd128,
}

impl Kernel {
    /// All kernels, the fastest first.
    pub const ALL: [Self; 4] = [Self::Avx512, Self::Avx2, Self::Simd128, Self::Portable];
}

/// The number of children that can wait in the frame of a vector kernel's traversal. The stacks of
/// deeper layouts are [on the heap](deep_stacks).
pub(crate) const STACK: usize = 256;

/// The places of a stack beyond the children that wait: the end of every ray, the next block of the
/// same leaf, and room for stores of whole registers.
pub(crate) const SPARE: usize = 24;

/// The number of u64 in a cache line.
pub(crate) const LINE: usize = 8;

/// Returns room for stacks of `need` entries and [`SPARE`] more, each aligned to a cache line; `None`
/// if [`STACK`] entries suffice.
pub(crate) fn deep_stacks<T>(stacks: usize, need: usize) -> Option<Vec<Aligned<[u64; LINE]>>> {
    let lines = (size_of::<T>() * (need + SPARE)).div_ceil(size_of::<[u64; LINE]>());
    (need > STACK).then(|| Vec::with_capacity(stacks * lines))
}
