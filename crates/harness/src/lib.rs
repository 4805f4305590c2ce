//! Experiments on bounding volume hierarchies: TOML specs in, CSV files and figures out.
//!
//! Data flows one way: [`spec`] → [scenes](bvh_scenes) → [`run`] → [`rows`] → [`report`], which reads the CSV files only.
//! The commands are in [`cli`]. Clocks, threads and folders of results are here.

pub mod cli;
pub mod contestant;
pub mod error;
pub mod measure;
pub mod page;
pub mod peers;
pub mod processor;
pub mod report;
pub mod rows;
pub mod run;
pub mod spec;
pub mod statistics;
pub mod stress;

pub use error::Error;

/// The README's example, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
