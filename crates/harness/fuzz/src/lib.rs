//! What any bytes must survive, as functions of the bytes: run by libFuzzer, and by `cargo test` on stable.
//!
//! Each returns if the promises hold and panics if one is broken. Where most bytes would be refused at once, the first
//! ones choose how the rest is read.

pub mod boxes;
pub mod bytes;
pub mod obj;
pub mod rays;
pub mod spec;
pub mod tree_file;

pub use boxes::boxes;
pub use obj::obj;
pub use rays::rays;
pub use spec::spec;
pub use tree_file::tree_file;

/// What takes any bytes.
pub type Target = fn(&[u8]);

/// Every target by name.
pub const TARGETS: [(&str, Target); 5] =
    [("boxes", boxes), ("obj", obj), ("spec", spec), ("tree_file", tree_file), ("rays", rays)];
