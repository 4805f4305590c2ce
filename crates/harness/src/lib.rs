//! Experiments on bounding volume hierarchies: TOML specs in, CSV files and figures out.
//!
//! Data flows one way: [`spec`] → [`scene`] → [`execute`] → [`store`] (rows of [`record`]) → [`report`], which reads
//! the CSV files only. Everything that touches files, clocks, threads or the terminal lives in this crate.

pub mod chart;
pub mod check;
pub mod error;
pub mod execute;
pub mod obj;
pub mod part;
pub mod peers;
pub mod provenance;
pub mod rays;
pub mod record;
pub mod report;
pub mod scene;
pub mod spec;
pub mod standin;
pub mod store;
pub mod tracing;

pub use error::Error;
