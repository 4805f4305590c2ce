//! The kernels in x86 vector registers: one ray with AVX2 or AVX-512, and batches of rays with AVX-512.

pub(super) mod avx2;
pub(super) mod avx512;
mod box_ray;
mod lanes;
mod one_ray;
mod sort;
