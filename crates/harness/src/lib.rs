//! Experiments on bounding volume hierarchies: TOML specs in, CSV files and figures out.
//!
//! Data flows one way: [`spec`] → [`scene`] → [`execute`] → [`store`] (rows of [`record`]) → [`report`], which reads
//! the CSV files only. Beside it, [`bake`] makes tree files, [`inspect`] reads them, [`mod@render`] makes pictures.
//! Everything that touches files, clocks, threads or the terminal lives in this crate.

pub mod arguments;
pub mod bake;
pub mod chart;
pub mod check;
mod culprit;
pub mod error;
pub mod execute;
pub mod explain;
pub mod html;
pub mod inspect;
mod job;
pub mod obj;
pub mod part;
pub mod peers;
pub mod provenance;
pub mod rays;
pub mod record;
pub mod reference;
pub mod render;
pub mod report;
pub mod scene;
pub mod spec;
pub mod standin;
pub mod store;
pub mod suite;
pub mod sweep;
pub mod tracing;
pub mod tree_file;

pub use error::Error;
