//! Files of trees and of results: read only where they are regular, replaced whole or not at all.
//!
//! The one place in which programs and bindings touch files, so that the libraries of trees, builders and searches do no input or output.

mod read;
mod replace;
pub mod tree_file;

pub use read::{ReadError, read, read_text};
pub use replace::{Reserved, WriteError, write};

/// The example of the README, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
