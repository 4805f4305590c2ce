//! The implementations of the wide layout's traversal, and which of them this processor can run.

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

/// Entries of the stack of a vector kernel's traversal; layouts that could need more are left to
/// the portable kernel.
pub(crate) const STACK: usize = 256;
