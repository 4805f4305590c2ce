//! Reads regular files only, and replaces files as a whole or not at all.
//!
//! Programs and bindings touch files only through this crate. The libraries of trees, builders and
//! searches do no input or output.

mod error;
mod read;
mod replace;
pub mod tree_file;
mod unfinished;

pub use error::WriteError;
pub use read::{ReadError, read, read_text, regular};
pub use replace::{Reserved, write};

/// The example of the README, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
