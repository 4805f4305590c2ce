//! The commands behind the command line, one file each.

pub mod arguments;
pub mod bake;
pub mod explain;
pub mod inspect;
