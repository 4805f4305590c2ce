#![doc = include_str!("../README.md")]

mod failure;
#[cfg(test)]
mod tests;
mod tracer;
mod tree;
