//! The laws of the builders, in one program, which links the library once.

mod goldsmith_salmon;
mod muller_fellner;
mod plain_tree;
mod watch;
