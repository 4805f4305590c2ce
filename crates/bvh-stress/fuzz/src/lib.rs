//! The fuzz targets, functions of arbitrary bytes: libFuzzer runs them, and `cargo test` on stable.
//!
//! A target returns if the promises hold and panics if one is broken. Where most bytes would be
//! rejected immediately, the first bytes select how the rest is read.

pub mod boxes;
pub mod bytes;
pub mod mesh;
pub mod rays;
pub mod tree_file;

pub use boxes::boxes;
pub use mesh::mesh;
pub use rays::rays;
pub use tree_file::tree_file;

/// A function of arbitrary bytes.
pub type Target = fn(&[u8]);

/// Every target by name.
pub const TARGETS: [(&str, Target); 4] =
    [("boxes", boxes), ("mesh", mesh), ("tree_file", tree_file), ("rays", rays)];
