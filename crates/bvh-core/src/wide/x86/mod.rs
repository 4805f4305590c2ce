//! The kernels in x86 vector registers: one ray with AVX2 or AVX-512, and batches of rays with AVX-512.

mod answer;
pub(super) mod avx2;
pub(super) mod avx512;
pub(super) mod batch;
mod box_ray;
mod edges;
mod interleaved;
mod leaves;
mod one_ray;
mod packet;
mod packet_triangles;
mod prepared;
