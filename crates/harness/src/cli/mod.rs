//! The commands of the program, one file each: arguments in, files and lines for the terminal out.

pub mod arguments;
pub mod bake;
pub mod bake_instances;
mod bake_rays;
pub mod columns;
pub mod commands;
pub mod effort;
pub mod explain;
pub mod inspect;
pub mod interrupt;
pub mod merge;
pub mod new;
pub mod output;
pub mod render;
pub mod report;
pub mod run;
pub mod scenes;
