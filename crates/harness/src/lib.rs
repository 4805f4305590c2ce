//! Experiments on bounding volume hierarchies: TOML specs in, CSV files and figures out.
//!
//! Data flows one way: [`spec`] → [`scenes`] → [`run`] → [`run::rows`] → [`report`], which reads the CSV files only.
//! The commands are in [`cli`]. Everything that touches files, clocks, threads or the terminal lives in this crate.

pub mod cli;
pub mod error;
pub mod figures;
pub mod files;
pub mod measure;
pub mod page;
pub mod peers;
pub mod render;
pub mod report;
pub mod run;
pub mod scenes;
pub mod spec;
pub mod statistics;
pub mod stress;

pub use error::Error;

/// The README's example, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
