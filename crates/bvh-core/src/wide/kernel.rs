//! The implementations of the wide layout's traversal, and which of them this processor can run.

/// An implementation of the traversal of a [`WideBvh`](crate::WideBvh). All give the same answers, bit by bit.
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

    /// Whether this processor can run the kernel.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx2 => has_avx2(),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx512 => has_avx512(),
            #[cfg(any(
                all(target_arch = "aarch64", target_feature = "neon"),
                all(target_arch = "wasm32", target_feature = "simd128")
            ))]
            Self::Simd128 => true,
            #[allow(unreachable_patterns)]
            _ => false,
        }
    }

    /// The fastest kernel that this processor can run.
    pub fn best() -> Self {
        Self::ALL
            .into_iter()
            .find(|kernel| kernel.is_available())
            .unwrap_or(Self::Portable)
    }
}

/// Whether the processor has what the AVX2 kernel is compiled for.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("lzcnt")
}

/// Whether the processor has what the AVX-512 kernel is compiled for.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
}

/// Entries of the stack of a vector kernel's traversal; layouts that could need more are left to the portable kernel.
pub(crate) const STACK: usize = 256;
