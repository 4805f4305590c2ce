//! The edge of the programs: arguments that several commands have, lines for the terminal, signals, and files that are
//! replaced whole.

pub mod arguments;
mod error;
pub mod files;
pub mod interrupt;
pub mod output;

pub use error::Error;
