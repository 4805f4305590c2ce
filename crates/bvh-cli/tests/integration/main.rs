//! The program `bvh`, run as users run it.

mod bake;
#[cfg(unix)]
mod bake_interrupted;
mod bake_parts;
mod bench;
mod commands;
mod examples;
mod export;
mod inspect;
mod orient;
mod render;
mod sky;
mod support;
