//! Layouts that other libraries and GPU tracers load. Each layout is documented byte by byte and
//! can be converted back to a [`Bvh`](crate::Bvh).
//!
//! | layout | bytes | to | from | used by |
//! |---|---|---|---|---|
//! | [binary](FirstCountNode) | 32 per node | [`to_first_count`](crate::Bvh::to_first_count) | [`from_first_count`](crate::Bvh::from_first_count) | `obvhs`, `tinybvh`, most GPU tracers |
//! | [three-mesh-bvh's](ThreeMeshNode) | 32 per node | [`to_three_mesh`](crate::Bvh::to_three_mesh) | [`from_three_mesh`](crate::Bvh::from_three_mesh) | `three-mesh-bvh`, `three-gpu-pathtracer` |
//!
//! A cheap tree by area is not yet a fast one there: [`Target::fit`] gives it the leaves, the depth
//! and the order that a library is fastest with, and [`Target::fit_better`] counts whether rays take
//! fewer tests in it than in a tree of the library's kind.
//!
//! Numbers are little-endian, and nodes are plain data: `bytemuck::cast_slice` gives their bytes on
//! little-endian machines. The conversion back rejects invalid indices. A tree that was converted
//! back traces the same hits as the original tree, bit by bit, because no box is smaller than in
//! the original tree.
//!
//! [`SHADER`] traces rays through binary nodes on a GPU; `examples/gpu` of the repository runs it.

mod better;
mod first_count;
mod target;
mod three_mesh;
mod unpack;

/// A complete compute shader in WGSL that traces rays through [`FirstCountNode`]s. It reads buffers
/// of nodes, object ids, corners and rays, and writes a buffer of hits; its declarations define the
/// bindings.
pub const SHADER: &str = include_str!("../../shaders/trace.wgsl");

pub use better::Better;
pub use first_count::FirstCountNode;
pub use target::{ExportError, Layout, Target, UnknownTarget};
pub use three_mesh::ThreeMeshNode;
