//! The commands of the program, one file each: arguments in, files and terminal output out.

pub mod jobs;
pub mod merge;
pub mod program;
pub mod run;
pub mod terminal;
