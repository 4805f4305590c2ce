//! Experiments on bounding volume hierarchies: TOML specs in, CSV files and figures out.
//!
//! Data flows one way: [`spec`] → [scenes](bvh_scenes) → [`run`] → [`rows`] → [`report`], which
//! reads only the CSV files. The commands are in [`cli`]. The libraries below read no clocks and
//! know no folders of results; this crate does.

pub mod cli;
pub mod contestant;
pub mod error;
mod files;
pub mod measure;
pub mod peers;
pub mod processor;
pub mod report;
pub mod rows;
pub mod run;
pub mod spec;
pub mod statistics;

pub use error::Error;
