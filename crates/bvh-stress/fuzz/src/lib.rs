//! The fuzz targets, functions of arbitrary bytes: libFuzzer runs them, and `cargo test` on stable.
//!
//! A target returns if the promises hold and panics if one is broken. Where most bytes would be
//! rejected immediately, the first bytes select how the rest is read.

mod mesh;
mod tree_file;

pub use mesh::mesh;
pub use tree_file::tree_file;
