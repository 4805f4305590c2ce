//! The interface of the programs to their users: arguments of several commands, lines for the
//! terminal, signals, and files that are replaced as a whole.

pub mod arguments;
mod error;
pub mod files;
pub mod interrupt;
pub mod output;

pub use error::Error;
